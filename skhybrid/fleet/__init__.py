"""Many zones: one model each, fitted, updated and watched on joblib, Dask or Ray."""

from .fleet_folder import FleetFolder, FleetTick
from .zone_fleet import ZoneFleet

__all__ = ["FleetFolder", "FleetTick", "ZoneFleet"]
