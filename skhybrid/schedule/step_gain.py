"""Step gains: a network's response to a kW, the gains that jumps of the heat show, and the pull toward these.

A thermostat answers every disturbance with heat, so that a fit on forecast errors is rewarded for too small a gain.
Jumps of the heat come from changes of the set-points and tell the gain of the first rows almost without feedback.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np

from ..filtering import lead_sensitivities
from .filter_model import FilterModel, Matrices
from .segment import Segment

JUMP_LEADS = (1, 2)  # rows after a jump at which the gain is observed
_LEAST_JUMP = 0.3  # share of the largest heat; smaller ones answer disturbances
_LITTLE_CHANGE = 0.2  # share of a jump by which other plants may change with it and after it
_MOST_CHANGE = 0.5  # share of a jump by which the heat itself may change in the rows after it
_LEAST_ANSWER = 0.5  # share of the usual answer below which a jump itself answers a disturbance of its row
_LEAST_JUMPS = 6
#: share of the slope before a jump that lasts: 1 gives gains 5 % too large, least squares gains 9 % too small, in the
#: mean of 14 step tests in EnergyPlus and of the office of :func:`~skhybrid.datasets.make_office`
_LASTING = 0.75
_SPREAD = 0.03  # relative standard error to which a gain is believed, beside that of the jumps
_MOST_ERROR = 0.5  # relative standard error from which jumps tell nothing
KNOWN_HEAT = -1  # in place of the index of a channel
#: usual step response of a room whose air is heated, 1 + 0.24 ln(t / 15 min) relative to 15 min: EnergyPlus, 22 step
#: tests in eleven zones of four buildings; hours at which it is read
_HOURS, _PER_LOG = np.array([0.25, 1.0, 4.0, 12.0, 24.0]), 0.24
#: spread of its logarithm; plants differ by 0.08 up to 12 h, but delivered heat pulls all forecasts the same way
_USUAL_SPREAD = 0.07
_NEAR, _FAR = 0.2, 0.3  # differences of logarithms: up to the first a response is usual, beyond the second it is not


class ObservedGain(NamedTuple):
    """Response of the temperature some rows after a step of one source."""

    source: int  # index of the channel whose coefficient is its capacity, KNOWN_HEAT for the known heat
    lead: int  # rows
    gain: float  # [K per unit of the source]
    error: float  # standard error of the gain
    n_jumps: int


def observed_gains(segment: Segment, shares: np.ndarray | None = None) -> tuple[ObservedGain, ...]:
    """Gains at the first rows after jumps of the known heat and of each stage; rows count by ``shares`` (N,)."""
    sources, out = _sources(segment), []
    for source in sources:
        found: list[ObservedGain] = []
        for lead in JUMP_LEADS:
            gain = _observed(segment, source, sources, found, lead, shares)
            if gain is None:
                break
            found.append(gain)
        out += found
    return tuple(out)


def _sources(segment: Segment) -> dict[int, np.ndarray]:
    """Heat [kW] or stage (N,) of each source that ran, by its channel."""
    stages, channels = dict(segment.plan.stages), segment.channels
    found = {i: channels.series[:, i] for i, name in enumerate(channels.names) if name in stages}
    return {source: v for source, v in {KNOWN_HEAT: segment.heat, **found}.items() if np.any(v)}


def _observed(
    segment: Segment,
    source: int,
    sources: Mapping[int, np.ndarray],
    sooner: Sequence[ObservedGain],
    lead: int,
    shares: np.ndarray | None,
) -> ObservedGain | None:
    """Least squares of the temperature's bend by the jump at the same row; ``sooner`` are gains at shorter leads."""
    k, y, seen, heat = np.arange(1, segment.n_rows - lead), segment.y, segment.seen, sources[source]
    jump, use = _jumps(source, sources, k, lead)
    use &= seen[k - 1] & seen[k] & seen[k + lead]
    weight = use.astype(float) if shares is None else use * shares[k]
    bend = y[k + lead] - y[k] - _LASTING * lead * (y[k] - y[k - 1])
    for one in sooner:  # what changes of the heat after the jump have done
        row = k + lead - one.lead
        bend -= one.gain * (heat[row] - heat[row - 1])
    gain, error = _least_squares(jump, bend, weight)
    if np.count_nonzero(weight) < _LEAST_JUMPS or not error < _MOST_ERROR * gain:
        return None
    # where the temperature hardly moves, the jump answers people or sun
    weight = weight * (bend * np.sign(jump) > _LEAST_ANSWER * gain * np.abs(jump))
    n_jumps = int(np.count_nonzero(weight))
    gain, error = _least_squares(jump, bend, weight)
    usable = n_jumps >= _LEAST_JUMPS and error < _MOST_ERROR * gain
    return ObservedGain(source, lead, gain, error, n_jumps) if usable else None


def _least_squares(jump: np.ndarray, bend: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Gain and its standard error; 0 without jumps."""
    squares = float(np.sum(weight * jump**2))
    if squares == 0.0:
        return 0.0, 0.0
    gain = float(np.sum(weight * jump * bend)) / squares
    return gain, float(np.sqrt(np.sum(weight * (jump * (bend - gain * jump)) ** 2))) / squares


def _jumps(source: int, sources: Mapping[int, np.ndarray], k: np.ndarray, lead: int) -> tuple[np.ndarray, np.ndarray]:
    """Change of a source at rows ``k``, and where it is a jump with and after which no source changes much."""
    size = {i: float(np.abs(v).max()) for i, v in sources.items()}
    jump = sources[source][k] - sources[source][k - 1]
    use = np.abs(jump) > _LEAST_JUMP * size[source]
    for i, series in sources.items():
        most = (_MOST_CHANGE if i == source else _LITTLE_CHANGE) * np.abs(jump) * size[i] / size[source]
        if i != source:
            use &= np.abs(series[k] - series[k - 1]) < most
        for row in range(1, lead):
            use &= np.abs(series[k + row] - series[k]) < most
    return jump, use


def _of_known_heat(gains: tuple[ObservedGain, ...]) -> tuple[ObservedGain, ...] | None:
    """Gains of the known heat at the leads of jumps; None where one of them is not known."""
    known = {g.lead: g for g in gains if g.source == KNOWN_HEAT}
    return tuple(known[lead] for lead in JUMP_LEADS) if known.keys() >= set(JUMP_LEADS) else None


def _usual(hours: np.ndarray) -> np.ndarray:
    """Logarithm of the usual step response, relative to that at 15 min."""
    return np.log(np.maximum(1.0 + _PER_LOG * np.log(hours / _HOURS[0]), _PER_LOG))


def _shape_rows(step: float) -> np.ndarray:
    """Rows at which the shape of a response is read, the first of them its unit."""
    return np.unique(np.maximum(np.round(_HOURS / step).astype(int), 1))


def is_usual(gains: tuple[ObservedGain, ...], step: float) -> bool | None:
    """Whether jumps say that the response begins as is usual where the air is heated; None if they leave it open."""
    found = _of_known_heat(gains)
    if found is None:
        return False
    first, second = found
    error = 2.0 * float(np.hypot(first.error / first.gain, second.error / second.gain))
    usual = float(np.diff(_usual(step * np.array(JUMP_LEADS)))[0])
    away = abs(float(np.log(second.gain / first.gain)) - usual)
    if away - error > _FAR:
        return False
    return True if away + error < _NEAR else None


def is_delayed(gains: tuple[ObservedGain, ...]) -> bool:
    """Whether jumps say that the response accelerates, which that of air that is heated directly never does."""
    found = _of_known_heat(gains)
    if found is None:
        return False
    first, second = found
    return second.gain - 2.0 * first.gain > 2.0 * float(np.hypot(second.error, 2.0 * first.error))


class StepResponse(NamedTuple):
    """Temperature of the zone 1 to L rows after the start of a step of 1 kW into the heated node."""

    gain: np.ndarray  # (L,) [K/kW]
    slope: np.ndarray  # (L, p) by psi
    lagging: np.ndarray  # (L,) the same of the emitter's series, per unit of its coefficient
    dlagging: np.ndarray  # (L, p)


def network_step_response(model: FilterModel, M: Matrices, psi: np.ndarray, heated: int, n_leads: int) -> StepResponse:
    """Response with its exact derivatives by psi."""
    m, p, nb = len(M.F), len(psi), M.B.shape[1] - len(M.A)
    b, db = M.B[:, nb + heated], M.dB[:, nb + heated]
    rows, rate = np.arange(n_leads + 1.0), model.step / np.exp(psi[-1])
    no_gains, never = (np.zeros((len(rows), m)), np.zeros((len(rows), m, p))), np.empty(0, dtype=np.int64)

    def simulated(heat: np.ndarray, dheat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dforcing = heat[:, None, None] * db
        dforcing[..., -1] += np.outer(dheat, b)
        forcing, y = np.outer(heat, b), np.zeros(len(rows))
        found = lead_sensitivities(M.A, M.dA, forcing, dforcing, M.F, M.dF, *no_gains, model.zone, y, never)
        return found.response[1:], found.dresponse[1:]

    lag = -np.exp(-rate * rows)  # what the emitter gives off less what it is given
    return StepResponse(*simulated(np.ones(len(rows)), np.zeros(len(rows))), *simulated(lag, rows * rate * lag))


class ResponseShape(NamedTuple):
    """Logarithms of a step response at some rows, relative to the first of them."""

    relative: np.ndarray  # (k,)
    spread: np.ndarray  # (k,) standard errors

    @classmethod
    def usual(cls, step: float) -> Self:
        """The shape that is usual where the air is heated."""
        usual = _usual(_shape_rows(step) * step)
        return cls(usual[1:] - usual[0], np.full(len(usual) - 1, _USUAL_SPREAD))


class GainPull(NamedTuple):
    """Additional rows of the least-squares problem, which pull the gains of the network toward observed ones."""

    observed: tuple[ObservedGain, ...]
    shape: ResponseShape | None  # toward which the response is pulled, too
    step: float  # [h]

    @classmethod
    def of(cls, segment: Segment, step: float) -> Self:
        """Pull toward what the jumps in these rows say."""
        observed = observed_gains(segment)
        return cls(observed, None if is_usual(observed, step) is False else ResponseShape.usual(step), step)

    def toward_response_of(self, model: FilterModel, psi: np.ndarray, covariance: np.ndarray, heated: int) -> Self:
        """The same, and toward the shape of a network's response, whose psi has a ``covariance`` (p, p)."""
        relative, slope = self._relative(self._response(model, psi, heated))
        variance = np.einsum("kp,pq,kq->k", slope, covariance, slope)
        return self._replace(shape=ResponseShape(relative, np.sqrt(_SPREAD**2 + variance)))

    @property
    def n_rows(self) -> int:
        """Number of the rows."""
        return len(self.observed) + (0 if self.shape is None else len(self.shape.relative))

    @property
    def root(self) -> np.ndarray:
        """(r,) root weights of the observed gains."""
        return np.array([1.0 / np.hypot(_SPREAD * g.gain, g.error) for g in self.observed])

    def design(self, model: FilterModel, psi: np.ndarray, segment: Segment) -> np.ndarray:
        """(r, J + 1) weighted columns and target."""
        plan, n_channels = segment.plan, len(segment.channels.names)
        at = self._response(model, psi, plan.heated)
        E = np.zeros((len(self.observed), n_channels + plan.emitter + 1))
        for row, g in zip(E, self.observed, strict=True):
            row[-1] = g.gain
            if g.source == KNOWN_HEAT:
                row[-1] -= at.gain[g.lead - 1]
                if plan.emitter:
                    row[n_channels] = at.lagging[g.lead - 1]
            else:
                row[g.source] = at.gain[g.lead - 1]
        errors, _ = self._shape_errors(at)
        shape = np.zeros((len(errors), E.shape[1]))
        shape[:, -1] = errors
        return np.vstack([self.root[:, None] * E, shape])

    def sensitivities(self, model: FilterModel, psi: np.ndarray, coef: np.ndarray, segment: Segment) -> np.ndarray:
        """(r, p) derivatives by psi of the weighted errors at fixed coefficients."""
        plan = segment.plan
        at, de = self._response(model, psi, plan.heated), np.empty((len(self.observed), len(psi)))
        for row, g in zip(de, self.observed, strict=True):
            row[:] = -at.slope[g.lead - 1] * (1.0 if g.source == KNOWN_HEAT else coef[g.source])
            if g.source == KNOWN_HEAT and plan.emitter:
                row -= coef[-1] * at.dlagging[g.lead - 1]
        return np.vstack([self.root[:, None] * de, self._shape_errors(at)[1]])

    def _response(self, model: FilterModel, psi: np.ndarray, heated: int) -> StepResponse:
        n_leads = max(*JUMP_LEADS, *_shape_rows(self.step))
        return network_step_response(model, model.matrices(psi), psi, heated, n_leads)

    def _shape_errors(self, at: StepResponse) -> tuple[np.ndarray, np.ndarray]:
        """Weighted errors of the shape, and their derivatives by psi."""
        if self.shape is None:
            return np.empty(0), np.empty((0, at.slope.shape[1]))
        relative, slope = self._relative(at)
        return (self.shape.relative - relative) / self.shape.spread, -slope / self.shape.spread[:, None]

    def _relative(self, at: StepResponse) -> tuple[np.ndarray, np.ndarray]:
        """(k,) logarithms of a response relative to its first row, and their derivatives (k, p) by psi."""
        rows = _shape_rows(self.step) - 1
        gain, slope = np.log(at.gain[rows]), at.slope[rows] / at.gain[rows, None]
        return gain[1:] - gain[0], slope[1:] - slope[0]
