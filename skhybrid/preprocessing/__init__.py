"""Transformers for a Pipeline: unit conversion, gap filling and irradiance on facades."""

from ._facades import FacadeIrradiance
from ._gaps import GapFiller
from ._units import UnitConverter

__all__ = ["FacadeIrradiance", "GapFiller", "UnitConverter"]
