"""Many zones: one model each, fitted, updated and watched on joblib, Dask or Ray."""

from .zone_fleet import ZoneFleet

__all__ = ["ZoneFleet"]
