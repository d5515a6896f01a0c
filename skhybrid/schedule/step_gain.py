"""Step gains: a network's response to a kW, what jumps of the heat say of it, and the pull that joins the two.

A thermostat answers every disturbance with heat, so that a fit on forecast errors is rewarded for too small a gain.
Jumps of the heat come from changes of the set-points and tell the gain of the first rows almost without feedback.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .filter_model import FilterModel, Matrices
from .segment import Segment

JUMP_LEADS = (1, 2)  # rows after a jump at which the gain is observed
_LEAST_JUMP = 0.3  # share of the largest heat
_LITTLE_CHANGE = 0.2  # share of a jump by which the heat may change in the rows after it, or other plants with it
_LEAST_JUMPS = 8
_SPREAD = 0.03  # relative standard error to which a gain is believed, beside that of the jumps
_MOST_ERROR = 0.5  # relative standard error from which jumps tell nothing
_SHAPE_HOURS, _PER_LOG_HOUR = np.array([0.25, 4.0, 12.0, 24.0]), 0.24
_UNUSUAL = 0.2
import os
_SHAPE_SPREAD = float(os.environ.get("SHAPE","0.25"))
_RHO = float(os.environ.get("RHO",".75"))
_KNOWN = -1  # in place of a channel, for the known heat


class ObservedGain(NamedTuple):
    """Response of the temperature some rows after a step of one source."""

    source: int  # index of the channel whose coefficient is its capacity, _KNOWN for the known heat
    lead: int  # rows
    gain: float  # [K per unit of the source]
    error: float  # standard error of the gain
    n_jumps: int


def observed_gains(segment: Segment, shares: np.ndarray | None = None) -> tuple[ObservedGain, ...]:
    """Gains at the first rows after jumps of the known heat and of each stage; rows count by ``shares`` (N,)."""
    sources = _sources(segment)
    return tuple(
        gain
        for source, series in sources.items()
        for lead in JUMP_LEADS
        if (gain := _observed(segment, source, series, sources, lead, shares)) is not None
    )


def _sources(segment: Segment) -> dict[int, np.ndarray]:
    """Heat [kW] or stage (N,) of each source that may jump, by its channel."""
    channels = segment.channels
    stages = dict(segment.plan.stages)
    found = {i: channels.series[:, i] for i, name in enumerate(channels.names) if name in stages}
    return {source: v for source, v in {_KNOWN: segment.heat, **found}.items() if np.any(v)}


def _observed(
    segment: Segment,
    source: int,
    series: np.ndarray,
    sources: dict[int, np.ndarray],
    lead: int,
    shares: np.ndarray | None,
) -> ObservedGain | None:
    """Least squares of the bend of the temperature by the jump at the same row."""
    k = np.arange(1, segment.n_rows - lead)
    jump = series[k] - series[k - 1]
    use = np.abs(jump) > _LEAST_JUMP * np.abs(series).max()
    for i, other in sources.items():
        most = np.abs(jump) * (np.abs(other).max() / np.abs(series).max())
        for later in range(1, lead):
            use &= np.abs(other[k + later] - other[k]) < _LITTLE_CHANGE * most
        if i != source:
            use &= np.abs(other[k] - other[k - 1]) < _LITTLE_CHANGE * most
    use &= segment.seen[k - 1] & segment.seen[k] & segment.seen[k + lead]
    weight = use if shares is None else use * shares[k]
    if np.count_nonzero(weight) < _LEAST_JUMPS:
        return None
    y = segment.y
    bend = y[k + lead] - y[k] - _RHO * lead * (y[k] - y[k - 1])
    squares = float(np.sum(weight * jump**2))
    gain = float(np.sum(weight * jump * bend)) / squares
    error = float(np.sqrt(np.sum(weight * (jump * (bend - gain * jump)) ** 2))) / squares
    if gain <= 0.0 or error > _MOST_ERROR * gain:
        return None
    return ObservedGain(source, lead, gain, error, int(np.count_nonzero(weight)))


def _by_lead(gains: tuple[ObservedGain, ...]) -> tuple[ObservedGain, ...] | None:
    """Gains of the known heat at the leads of jumps; None where one of them is not known."""
    known = {g.lead: g for g in gains if g.source == _KNOWN}
    return tuple(known[lead] for lead in JUMP_LEADS) if known.keys() >= set(JUMP_LEADS) else None


def is_usual(gains: tuple[ObservedGain, ...]) -> bool:
    """Whether jumps say that the response begins as is usual in rooms whose air is heated."""
    found = _by_lead(gains)
    if found is None:
        return False
    first, second = found
    error = float(np.hypot(first.error / first.gain, second.error / second.gain))
    usual = np.log1p(_PER_LOG_HOUR * np.log(second.lead / first.lead))
    return abs(np.log(second.gain / first.gain) - usual) < _UNUSUAL + 2.0 * error


def delayed(gains: tuple[ObservedGain, ...]) -> bool:
    """Whether jumps say that the response accelerates, which that of air that is heated directly never does."""
    found = _by_lead(gains)
    if found is None:
        return False
    first, second = found
    return second.gain - 2.0 * first.gain > 2.0 * float(np.hypot(second.error, 2.0 * first.error))


class StepResponse(NamedTuple):
    """Temperature of the zone after a step of 1 kW into the heated node, rows 1 to L after its begin, by psi."""

    gain: np.ndarray  # (L,) [K/kW]
    slope: np.ndarray  # (L, p)
    lagging: np.ndarray  # (L,) the same of the emitter's series, per unit of its coefficient
    dlagging: np.ndarray  # (L, p)


def step_response(model: FilterModel, M: Matrices, psi: np.ndarray, heated: int, n_leads: int) -> StepResponse:
    """Response with its exact derivatives by psi."""
    n, p, nb = len(M.A), len(psi), M.B.shape[1] - len(M.A)
    a = np.exp(-model.step / np.exp(psi[-1]))
    log_slope = a * model.step / np.exp(psi[-1])  # of a, by the logarithm of the time constant
    b, db = M.B[:, nb + heated], M.dB[:, nb + heated]
    out = StepResponse(np.empty(n_leads), np.empty((n_leads, p)), np.empty(n_leads), np.empty((n_leads, p)))
    x, dx, z, dz = np.zeros(n), np.zeros((n, p)), np.zeros(n), np.zeros((n, p))
    for row in range(n_leads):
        dx, x = M.A @ dx + np.tensordot(M.dA, x, axes=(1, 0)) + db, M.A @ x + b
        given = -(a**row)
        dz, z = M.A @ dz + np.tensordot(M.dA, z, axes=(1, 0)) + given * db, M.A @ z + given * b
        if row:
            dz[:, -1] -= row * a ** (row - 1) * log_slope * b
        out.gain[row], out.slope[row] = x[model.zone], dx[model.zone]
        out.lagging[row], out.dlagging[row] = z[model.zone], dz[model.zone]
    return out


class GainPull(NamedTuple):
    """Rows of a least-squares problem that pull the gains of a network toward observed ones."""

    observed: tuple[ObservedGain, ...]
    step: float  # [h]
    usual: bool  # whether the response is also pulled toward the usual shape

    def shape(self, model: FilterModel, psi: np.ndarray, heated: int) -> tuple[np.ndarray, np.ndarray]:
        """(3,) weighted residuals of the shape of the step response, and their derivatives (3, p) by psi."""
        rows = np.maximum(np.round(_SHAPE_HOURS / self.step).astype(int), 1)
        at = step_response(model, model.matrices(psi), psi, heated, rows[-1])
        log_gain, slope = np.log(at.gain[rows - 1]), at.slope[rows - 1] / at.gain[rows - 1, None]
        usual = np.log1p(_PER_LOG_HOUR * np.log(_SHAPE_HOURS / _SHAPE_HOURS[0]))
        residual = log_gain - log_gain[0] - usual
        return -residual[1:] / _SHAPE_SPREAD, -(slope - slope[0])[1:] / _SHAPE_SPREAD

    @property
    def root(self) -> np.ndarray:
        """(r,) root weights."""
        return np.array([1.0 / np.hypot(_SPREAD * g.gain, g.error) for g in self.observed])

    def _response(self, model: FilterModel, psi: np.ndarray, heated: int) -> StepResponse:
        return step_response(model, model.matrices(psi), psi, heated, max(JUMP_LEADS))

    def design(self, model: FilterModel, psi: np.ndarray, segment: Segment) -> np.ndarray:
        """(r, J + 1) weighted columns and target."""
        plan, n_channels = segment.plan, len(segment.channels.names)
        at = self._response(model, psi, plan.heated)
        E = np.zeros((len(self.observed), n_channels + plan.emitter + 1))
        for row, g in zip(E, self.observed, strict=True):
            row[-1] = g.gain
            if g.source == _KNOWN:
                row[-1] -= at.gain[g.lead - 1]
                if plan.emitter:
                    row[n_channels] = at.lagging[g.lead - 1]
            else:
                row[g.source] = at.gain[g.lead - 1]
        if not self.usual:
            return self.root[:, None] * E
        residual, _ = self.shape(model, psi, plan.heated)
        usual = np.zeros((len(residual), E.shape[1]))
        usual[:, -1] = residual
        return np.vstack([self.root[:, None] * E, usual])

    def sensitivities(self, model: FilterModel, psi: np.ndarray, coef: np.ndarray, segment: Segment) -> np.ndarray:
        """(r, p) derivatives by psi of the weighted errors at fixed coefficients."""
        at, plan = self._response(model, psi, segment.plan.heated), segment.plan
        de = np.empty((len(self.observed), len(psi)))
        for row, g in zip(de, self.observed, strict=True):
            row[:] = -at.slope[g.lead - 1] * (1.0 if g.source == _KNOWN else coef[g.source])
            if g.source == _KNOWN and plan.emitter:
                row -= coef[-1] * at.dlagging[g.lead - 1]
        if not self.usual:
            return self.root[:, None] * de
        return np.vstack([self.root[:, None] * de, self.shape(model, psi, plan.heated)[1]])


def unit_step(model: FilterModel, M: Matrices, psi: np.ndarray, heated: int, n_leads: int, lagging: float) -> np.ndarray:
    """(n_leads,) temperature after a step of 1 kW, of which the emitter delays the share ``lagging`` [K/kW]."""
    at = step_response(model, M, psi, heated, n_leads)
    return at.gain + lagging * at.lagging
