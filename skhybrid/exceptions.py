"""Warnings and errors of the package."""

from __future__ import annotations

from sklearn.exceptions import NotFittedError

__all__ = [
    "ExcitationWarning",
    "FleetWarning",
    "GainWarning",
    "MeasurementWarning",
    "ModelFileError",
    "PlanWarning",
    "RoleWarning",
    "ScaleNotIdentifiableWarning",
    "SettingsError",
    "SkhybridWarning",
    "TooFewDaysError",
    "UnitWarning",
]


class SkhybridWarning(UserWarning):
    """Base class of all warnings of this package."""


class UnitWarning(SkhybridWarning):
    """The range of a column suggests a unit other than its role's (degF, W/m2, percent)."""


class RoleWarning(SkhybridWarning):
    """No column has the name of a role, so that roles are assigned by position, or none is read."""


class ScaleNotIdentifiableWarning(SkhybridWarning):
    """Neither a known parameter nor measured heat fixes the scale of the network."""


class ExcitationWarning(SkhybridWarning):
    """The data do not excite a parameter, so the fit cannot determine it."""


class FleetWarning(SkhybridWarning):
    """Zones of a fleet failed, and the others went on."""


class GainWarning(SkhybridWarning):
    """The response of a forecast to a kW is unreliable."""


class MeasurementWarning(SkhybridWarning):
    """Rows lack a temperature or a set-point: a zone is forecast from what is known besides."""


class PlanWarning(SkhybridWarning):
    """A plan goes beyond what training covered, or the forecast is not affine in it."""


class ModelFileError(ValueError):
    """A model file is truncated, altered, written by another version, or not a model file at all."""


class SettingsError(ValueError):
    """A configuration file cannot be used."""


class TooFewDaysError(NotFittedError):
    """The training was too short to learn the errors that intervals and the drift monitor need."""
