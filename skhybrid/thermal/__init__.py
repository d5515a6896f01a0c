"""Thermal networks: declared as data, turned into matrices with exact derivatives."""

from .catalogue import CATALOGUE, get_network
from .network import RCNetwork
from .parameters import Parameter
from .stencil import Continuous, Stencil

__all__ = ["CATALOGUE", "Continuous", "Parameter", "RCNetwork", "Stencil", "get_network"]
