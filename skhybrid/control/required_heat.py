"""The heat that holds a set-point (paper Eqs. inverseQ1 and inverseQ2), from plain matrices and states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..filtering import simulate_inverse
from .hold import steps_ahead
from .setpoints import Band, Limits


class HeatedZone(NamedTuple):
    """One measured node and the plant that heats it."""

    A: np.ndarray  # (n, n) over one step
    heat: np.ndarray  # (n,) effect of 1 kW of the plant over a step
    output: np.ndarray  # (n,) output row of the measured node


def required_heat(
    zone: HeatedZone,
    band: Band,
    limits: Limits,
    forcing: np.ndarray,
    offset: np.ndarray,
    begins: np.ndarray,
    states: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Heat (N,) [kW] that brings the temperature into a band at the end of every row, and that temperature (N,) [degC].

    ``forcing`` (N, n) is the effect of everything but the plant over each step, ``offset`` (N,) [K] is added to the
    temperature at the end of each row. The spans of rows begin at the rows ``begins`` (n_spans,), from 0, with the node
    temperatures ``states`` (n_spans, n) [degC].
    """
    ahead = steps_ahead(zone.A, zone.heat, zone.output)
    low, high = band.heating - offset, band.cooling - offset
    loads, paths = [], []
    for a, b, state in zip(begins, np.append(begins[1:], len(forcing)), states, strict=True):
        rows = slice(a, b)
        load, path = simulate_inverse(
            zone.A,
            forcing[rows],
            zone.heat,
            zone.output,
            low[rows],
            high[rows],
            limits.lower[rows],
            limits.upper[rows],
            state,
            ahead,
        )
        loads.append(load)
        paths.append(path)
    return np.concatenate(loads), np.concatenate(paths) + offset
