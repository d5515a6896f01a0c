"""Transformers that a Pipeline needs before an estimator of this package: units and short gaps."""

from ._gaps import GapFiller
from ._unit_converter import UnitConverter

__all__ = ["GapFiller", "UnitConverter"]
