"""Lag of an emitter (a radiator, a heated floor) between the heat it is given and the heat it gives off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter


class EmitterState(NamedTuple):
    """State of an emitter between two segments of rows."""

    output: float  # heat that it gave off in the last row [kW]
    input: float  # heat that it was given in that row [kW]


def emitter_series(
    heat: np.ndarray, step: float, time_constant: float, state: EmitterState | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Heat that a lagging emitter gives off less the heat that it is given, ``z - heat``.

    ``z[k+1] = a z[k] + (1 - a) heat[k]`` with ``a = exp(-step / time_constant)``.

    Parameters
    ----------
    heat : ndarray of shape (N,)
        Heat that the emitter is given [kW].
    step, time_constant : float
        [h].
    state : EmitterState, optional
        State after the row before the first; by default the first row's heat has always been given.

    Returns
    -------
    lag, dlag : ndarray of shape (N,)
        ``z - heat`` [kW], and its derivative by the logarithm of the time constant.
    """
    a = np.exp(-step / time_constant)
    output, given = state if state is not None else (heat[0], heat[0])
    previous_heat = np.concatenate([[given], heat[:-1]])
    z, _ = lfilter([1.0 - a], [1.0, -a], previous_heat, zi=[a * output])
    da = a * step / time_constant
    previous_z = np.concatenate([[output], z[:-1]])
    return z - heat, lfilter([1.0], [1.0, -a], da * (previous_z - previous_heat))
