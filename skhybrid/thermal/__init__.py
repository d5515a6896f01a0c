"""Thermal networks declared as data, their matrices with exact derivatives, and a catalogue of usual ones."""

from .catalogue import get_network, list_networks
from .declaration import Source
from .drawing import draw
from .joined_rooms import building_network, room_network
from .matrices import MatrixBuilder
from .network import RCNetwork
from .parameters import Parameter

__all__ = [
    "MatrixBuilder",
    "Parameter",
    "RCNetwork",
    "Source",
    "building_network",
    "draw",
    "get_network",
    "list_networks",
    "room_network",
]
