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
    """Heat that brings the temperature into a band at the end of every row, in spans that begin at given states.

    Parameters
    ----------
    zone : HeatedZone
    band : Band
        Of the N rows [degC].
    limits : Limits
        Of the N rows [kW].
    forcing : ndarray of shape (N, n)
        Effect of everything but the plant over each step.
    offset : ndarray of shape (N,)
        Added to the temperature at the end of each row [K].
    begins : ndarray of int, shape (n_spans,)
        First row of each span, from 0.
    states : ndarray of shape (n_spans, n)
        Node temperatures at those rows [degC].

    Returns
    -------
    heat : ndarray of shape (N,)
        [kW]
    temperature : ndarray of shape (N,)
        Of the measured node at the end of every row [degC].
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
