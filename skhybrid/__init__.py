"""Hybrid gray-box models for buildings, as scikit-learn estimators.

Identify an RC network in spite of unmeasured heat, learn that heat, and forecast tomorrow's room temperature and load.
Names are loaded on first use, so that ``import skhybrid`` loads neither torch nor pymc nor matplotlib.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import (
        datasets,
        exceptions,
        fleet,
        forecasting,
        identification,
        inspection,
        logs,
        model_selection,
        persistence,
        preprocessing,
        study,
        thermal,
        zone,
    )
    from ._show_versions import show_versions
    from .forecasting import ARXRegressor, DisturbanceForecaster
    from .hybrid import BuildingPredictor, HybridPredictor, SchedulePredictor, TwoStagePredictor
    from .identification import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
    from .thermal import RCNetwork

    __version__: str

_NAMES_OF = {
    "_show_versions": ("show_versions",),
    "forecasting": ("ARXRegressor", "DisturbanceForecaster"),
    "hybrid": ("BuildingPredictor", "HybridPredictor", "SchedulePredictor", "TwoStagePredictor"),
    "identification": ("GrayBoxRC", "InputDisturbanceID", "OutputDisturbanceID", "PeriodicDisturbanceID"),
    "thermal": ("RCNetwork",),
}
_MODULE_OF = {name: module for module, names in _NAMES_OF.items() for name in names}
__all__ = [
    "ARXRegressor",
    "BuildingPredictor",
    "DisturbanceForecaster",
    "GrayBoxRC",
    "HybridPredictor",
    "InputDisturbanceID",
    "OutputDisturbanceID",
    "PeriodicDisturbanceID",
    "RCNetwork",
    "SchedulePredictor",
    "TwoStagePredictor",
    "__version__",
    "datasets",
    "exceptions",
    "fleet",
    "forecasting",
    "identification",
    "inspection",
    "logs",
    "model_selection",
    "persistence",
    "preprocessing",
    "show_versions",
    "study",
    "thermal",
    "zone",
]
_SUBMODULES = {*__all__} - {*_MODULE_OF, "__version__"}


def __getattr__(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name == "__version__":
        globals()[name] = _installed_version()
        return globals()[name]
    if name in _SUBMODULES:
        return import_module(f"{__name__}.{name}")
    if name in _MODULE_OF:
        value = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _installed_version() -> str:
    # imported here, since it takes most of the time until the command line listens to signals
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("skhybrid")
    except PackageNotFoundError:  # a source tree that is not installed
        return "0+unknown"


def __dir__() -> list[str]:
    return sorted(__all__)
