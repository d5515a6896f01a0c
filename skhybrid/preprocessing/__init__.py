"""Transformers that a Pipeline needs before an estimator of this package: units, short gaps, sun on the facades."""

from ._facades import FacadeIrradiance
from ._gaps import GapFiller
from ._unit_converter import UnitConverter

__all__ = ["FacadeIrradiance", "GapFiller", "UnitConverter"]
