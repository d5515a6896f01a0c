"""Thermal networks: declared as data, turned into matrices with exact derivatives."""

from .catalogue import CATALOGUE, get_network, list_networks
from .network import RCNetwork, Source
from .parameters import Parameter
from .stencil import Continuous, Stencil

__all__ = ["CATALOGUE", "Continuous", "Parameter", "RCNetwork", "Source", "Stencil", "get_network", "list_networks"]
