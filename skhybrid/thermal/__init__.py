"""Thermal networks: declared as data, turned into matrices with exact derivatives."""

from .catalogue import CATALOGUE, get_network
from .network import RCNetwork
from .parameters import Parameter

__all__ = ["CATALOGUE", "Parameter", "RCNetwork", "get_network"]
