"""Heat that could be expected at the origins of forecasts, by two-stage least squares.

A thermostat answers every disturbance with heat.  Delivered heat therefore tells of disturbances after the origin, and
a network that is fitted on forecasts with it learns too small a gain.  Expected heat tells nothing of them: it comes
from what is known ahead (weather, calendar) and at the origin.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._last_known import last_known_row
from .._time import rows_per_day
from ..filtering import ForecastSample, low_pass
from .day_blocks import block_grams
from .filter_model import FilterModel
from .segment import Segment
from .step_gain import network_step_response

_DAY = 24.0
_SLOW = (6.0, 24.0)  # time constants at which what is known ahead is smoothed too [h]
_RIDGE = 100.0  # penalty of standardised coefficients, with which expected and delivered heat vary alike
#: least share of the heat's variance that is expected: 0.64 to 0.96 in 22 logs of EnergyPlus zones, where the gain
#: comes nearer to the plant's; at 0.2 to 0.58, in the office of :func:`~skhybrid.datasets.make_office`, it went too low
_LEAST_EXPECTED = 0.6
_KNOWN_AHEAD = ("q_sol", "gain_", "ua")  # beginnings of the names of channels that no thermostat moves


def heat_surprise(segment: Segment, sample: ForecastSample, blocks: np.ndarray, step: float) -> np.ndarray | None:
    """(O, n_leads) delivered less expected heat [kW] of the rows from each origin on; None where little is expected.

    The heat of each block of days is expected by a regression on the other blocks; ``step`` in hours.
    """
    rows = sample.origins[:, None] + np.arange(sample.leads[-1])
    inside, last = rows < segment.n_rows, segment.n_rows - 1
    heat = np.where(inside, segment.heat[np.minimum(rows, last)], 0.0)
    out, one_lead = np.zeros(rows.shape), sample._replace(leads=sample.leads[-1:])
    for lead, X in enumerate(_regressors(segment, sample.origins, np.minimum(rows, last), step)):
        X *= inside[:, [lead]]
        for b, (_, others) in enumerate(block_grams(np.column_stack([X, heat[:, lead]]), one_lead, blocks)):
            own = blocks == b
            coef = np.linalg.solve(others[:-1, :-1] + _RIDGE * np.eye(X.shape[1]), others[:-1, -1])
            out[own, lead] = heat[own, lead] - X[own] @ coef
    unexpected = np.sum(out**2) / max(float(np.sum((heat[inside] - heat[inside].mean()) ** 2)), 1e-12)
    return out if unexpected < 1.0 - _LEAST_EXPECTED else None


def _regressors(segment: Segment, origins: np.ndarray, rows: np.ndarray, step: float) -> Iterator[np.ndarray]:
    """(O, F) standardised regressors with a constant, for each lead."""
    per_day, heat = rows_per_day(step), segment.heat
    names = segment.channels.names
    ahead = [i for i, name in enumerate(names) if name.startswith(_KNOWN_AHEAD) and "swapped" not in name]
    weather = np.hstack([segment.boundary, segment.channels.series[:, [i for i in ahead if "q_sol" in names[i]]]])
    weather = np.unique(weather, axis=1)
    series = np.hstack([segment.channels.series[:, ahead], weather, *(_smoothed(weather, tau / step) for tau in _SLOW)])
    y = segment.y[last_known_row(segment.seen, before=0)]
    given = np.column_stack([heat, _smoothed(heat[:, None], 2.0 / step), _smoothed(heat[:, None], _DAY / step)])
    slow = [_smoothed(y[:, None], tau / step)[origins] for tau in _SLOW]
    before = np.maximum(origins - 1, 0)
    at_origin = np.column_stack([y[origins], y[before], *slow, given[before]])
    for lead in range(rows.shape[1]):
        now = rows[:, lead]
        days_before = heat[np.maximum(now - per_day * (lead // per_day + 1), 0)]
        X = np.column_stack([at_origin, series[now], days_before])
        spread = X.std(axis=0)
        X = (X - X.mean(axis=0)) / np.where(spread > 1e-9, spread, 1.0)
        yield np.column_stack([X, np.full(len(X), 10.0)])  # a constant that is hardly shrunk


def _smoothed(series: np.ndarray, rows: float) -> np.ndarray:
    """(N, k) first-order low-pass of series, begun at their first value."""
    return low_pass(series, np.exp(-1.0 / rows), series[0])


class SurpriseEffect:
    """Effect of the surprise (O, n_leads) in the heat of forecasts on their errors at ``leads`` (L,), at one psi."""

    def __init__(self, model: FilterModel, psi: np.ndarray, heated: int, surprise: np.ndarray, leads: np.ndarray):
        at = network_step_response(model, model.matrices(psi), psi, heated, int(leads[-1]))
        self._surprise, self._at = surprise, at
        after = leads - 1 - np.arange(int(leads[-1]))[:, None]  # (n_leads, L) rows from a kW to each lead
        self._rows, self._acts = np.maximum(after, 0), after >= 0

    def errors(self, lag: float = 0.0) -> np.ndarray:
        """(O, L) to be added to errors [K]; ``lag`` is the emitter's coefficient."""
        return self._of(self._at.gain + lag * self._at.lagging)

    def of_emitter(self) -> np.ndarray:
        """(O, L) per unit of the emitter's coefficient."""
        return self._of(self._at.lagging)

    def slopes(self, lag: float) -> np.ndarray:
        """(O, L, p) derivatives of :meth:`errors` by psi."""
        return self._of(self._at.slope + lag * self._at.dlagging)

    def _of(self, response: np.ndarray) -> np.ndarray:
        """(O, L, ...) effect by the response to a step (n_leads, ...)."""
        one_row = np.diff(response, axis=0, prepend=np.zeros_like(response[:1]))
        effect = one_row[self._rows]
        effect[~self._acts] = 0.0
        return np.tensordot(self._surprise, effect, axes=1)
