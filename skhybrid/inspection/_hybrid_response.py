"""Responses of a hybrid predictor to its heating and cooling, at several origins."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import numpy as np
import pandas as pd

from .._time import rows_covering, rows_of, spell
from ..hybrid import HybridPredictor, SchedulePredictor, TwoStagePredictor
from ..identification import StateSpace, frequency_response, step_response

_HYBRIDS = (HybridPredictor, SchedulePredictor, TwoStagePredictor)
_SHORTEST, _LONGEST = pd.Timedelta("10min"), pd.Timedelta("1D")  # periods by default
_CYCLES = 2  # of the longest sinusoid are simulated

Responses = dict[str, list[pd.DataFrame]]  # by member and origin


def is_hybrid(model: Any) -> bool:
    """Whether a model's response depends on the origin."""
    return isinstance(model, _HYBRIDS)


def step_responses(model: Any, X: Any, origin_step: Any, duration: Any) -> Responses:
    """Temperature after a unit step of each input from the first row ahead on."""
    n = rows_covering(duration, model.sampling_time_, "duration")
    found = Responses()
    for running, future in _origins(model, X, origin_step, n + 1):
        network = step_response(_network(running, future), duration)
        for member in ("network", "blend") if running.scheme_ == "schedule" else ("network",):
            gain = running.affine_forecast(None, future, list(network), member=member).gain
            found.setdefault(member, []).append(pd.DataFrame(gain.sum(axis=1), network.index, network.columns))
    return found


def frequency_responses(model: Any, X: Any, origin_step: Any, periods: Any) -> Responses:
    """Response to sinusoids; that of a blend in the last row ahead."""
    step = model.sampling_time_
    n = rows_covering(_CYCLES * max(pd.TimedeltaIndex(periods)), step, "periods")
    found = Responses()
    for running, future in _origins(model, X, origin_step, n + 1):
        network = frequency_response(_network(running, future), periods)
        if running.scheme_ != "schedule":
            found.setdefault("network", []).append(network)
            continue
        for member in ("network", "blend"):
            gain = running.affine_forecast(None, future, list(network), member=member).gain[n, :n]
            values = sinusoidal(gain[::-1], (step / network.index).to_numpy(dtype=np.float64))
            found.setdefault(member, []).append(pd.DataFrame(values, network.index, network.columns))
    return found


def sinusoidal(effect: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """(p, m) response to sinusoids of so many turns per row, by the effect (n, m) of an input 1, 2 ... n rows ago.

    Earlier inputs fade as fast as those of the last two rows do.
    """
    n, last = len(effect), effect[-1]
    fading = np.clip(np.divide(last, effect[-2], out=np.zeros_like(last), where=effect[-2] != 0), 0.0, 0.999)
    z = np.exp(-2j * np.pi * turns)[:, None]
    return z ** np.arange(1, n + 1) @ effect + last * z ** (n + 1) * fading / (1.0 - fading * z)


def periods_to_a_day(step: pd.Timedelta) -> pd.TimedeltaIndex:
    """Periods from two steps to a day."""
    seconds = np.geomspace(max(_SHORTEST, 2 * step) / pd.Timedelta("1s"), _LONGEST / pd.Timedelta("1s"), 100)
    return pd.to_timedelta(np.ceil(seconds), unit="s").as_unit("ns")


def _network(model: Any, future: pd.DataFrame) -> StateSpace:
    made = model.to_state_space(None, future)
    D = np.zeros((len(made.C), len(made.inputs)))
    return StateSpace(made.A, made.B, made.C, D, made.states, made.inputs, made.sampling_time)


def _origins(model: Any, X: Any, origin_step: Any, n_rows: int) -> Iterator[tuple[Any, pd.DataFrame]]:
    """The model as it is at each origin, and the rows after it."""
    step = model.sampling_time_
    if not isinstance(X, pd.DataFrame):
        raise ValueError("the response of a hybrid changes as it learns; pass X, the table of rows after its training.")
    if len(X) < n_rows:
        raise ValueError(
            f"X has {len(X)} rows, but the response needs {n_rows} ({spell(n_rows * step)}); give more rows, or ask "
            "for a shorter response."
        )
    every, running = rows_of(origin_step, step, "origin_step"), deepcopy(model)
    for begin in range(0, len(X) - n_rows + 1, every):
        if begin:
            running.update(X.iloc[begin - every : begin])
        yield running, X.iloc[begin : begin + n_rows]
