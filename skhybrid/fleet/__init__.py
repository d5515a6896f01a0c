"""Fleets of zones: a model per zone, fitted, updated and watched in parallel, and a prior for new zones."""

from .fleet_folder import FleetFolder, FleetTick
from .prior import FleetPrior
from .zone_fleet import ZoneFleet

__all__ = ["FleetFolder", "FleetPrior", "FleetTick", "ZoneFleet"]
