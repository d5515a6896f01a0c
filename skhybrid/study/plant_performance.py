"""The heat that a plant makes of electricity, and back, by its coefficient of performance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np


class Performance(NamedTuple):
    """Heat per electricity, by the outdoor temperature."""

    heating: np.ndarray  # (n, 2) T_oa [degC] and COP [-]
    cooling: np.ndarray  # (n, 2) T_oa [degC] and EER [-]

    @classmethod
    def of(cls, plant: Mapping[str, Any]) -> Self | None:
        """The performance that ``[plant]`` gives, None where it gives none; a ValueError says what cannot be read."""
        electric = plant.get("electricity", False)
        if not isinstance(electric, bool):
            raise ValueError(f"[plant] electricity = {electric!r} must be true or false.")
        if "cop" not in plant and "eer" not in plant:
            if electric:
                raise ValueError("[plant] electricity = true needs a coefficient of performance, such as cop = 3.0.")
            return None
        cop = plant.get("cop", plant.get("eer"))
        return cls(_curve("cop", cop), _curve("eer", plant.get("eer", cop)))

    def heat(self, electricity: np.ndarray, T_oa: np.ndarray) -> np.ndarray:
        """Heat [kW] of electricity [kW], negative where it cools."""
        return electricity * self._factor(electricity, T_oa)

    def electricity(self, heat: np.ndarray, T_oa: np.ndarray) -> np.ndarray:
        """Electricity [kW] that makes heat [kW], never negative."""
        return np.abs(heat) / self._factor(heat, T_oa)

    def _factor(self, signed: np.ndarray, T_oa: np.ndarray) -> np.ndarray:
        heating, cooling = (np.interp(T_oa, *curve.T) for curve in self)
        return np.where(np.asarray(signed) >= 0.0, heating, cooling)


def _curve(name: str, given: Any) -> np.ndarray:
    """Pairs of outdoor temperature and performance, increasing."""
    pairs = [[0.0, given]] if isinstance(given, int | float) else given
    try:
        curve = np.asarray(pairs, dtype=np.float64)
    except (TypeError, ValueError):
        curve = np.empty(0)
    if curve.ndim != 2 or curve.shape[1] != 2 or isinstance(given, bool):
        raise ValueError(f"[plant] {name} = {given!r} must be a number, or pairs [T_oa, {name}].")
    if not np.isfinite(curve).all() or (np.diff(curve[:, 0]) <= 0).any():
        raise ValueError(f"[plant] {name} = {given!r} must be finite, with rising outdoor temperatures.")
    if not ((curve[:, 1] > 0) & (curve[:, 1] < 20)).all():
        worst = curve[np.argmax(np.abs(np.log(np.maximum(curve[:, 1], math.ulp(1.0))))), 1]
        raise ValueError(f"[plant] {name} holds {worst:g}; a coefficient of performance lies between 0 and 20.")
    return curve
