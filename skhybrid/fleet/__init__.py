"""Fleets: many zones, and what they say of a new one."""

from .prior import FleetPrior

__all__ = ["FleetPrior"]
