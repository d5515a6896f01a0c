"""Thermal networks declared as data, their matrices with exact derivatives, and a catalogue of usual ones."""

from .catalogue import CATALOGUE, get_network, list_networks
from .declaration import Source
from .drawing import draw
from .matrices import MatrixBuilder
from .network import RCNetwork
from .parameters import Parameter

__all__ = [
    "CATALOGUE",
    "MatrixBuilder",
    "Parameter",
    "RCNetwork",
    "Source",
    "draw",
    "get_network",
    "list_networks",
]
