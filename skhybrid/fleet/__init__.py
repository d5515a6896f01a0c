"""Many zones: one model each, fitted, updated and watched on joblib, Dask or Ray, and what they say of a new one."""

from .fleet_folder import FleetFolder, FleetTick
from .prior import FleetPrior
from .zone_fleet import ZoneFleet

__all__ = ["FleetFolder", "FleetPrior", "FleetTick", "ZoneFleet"]
