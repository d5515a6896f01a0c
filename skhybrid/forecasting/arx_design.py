"""The ARX regression: its data matrix, its ridge solution, and its recursion over the horizon."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.signal import lfilter

from .._calendar import N_CELLS, day_type_hour
from .._clock import hour_of_day
from .._last_known import carried_forward
from .._table import ZoneTable
from .._time import rows_per_day
from ..filtering import iterate_lags, low_pass, solve_positive_definite, with_products
from .features import irradiance_roles

_MIN_KNOWN = 0.5  # share of a window's temperatures that must be known for a row to be learned from
#: usual spread of a stage [-] and of measured heat [kW], which is the unit of an input that hardly ran: in units of its
#: own small spread, an hour of heat would be a thousand times what training has seen
_USUAL_SPREAD = {"u_": 0.4, "Q_": 2.5}
CONSTANT_PENALTY = 1e-9  # penalty of the constant: none, but where no pair is known the equations must stay regular
_ROUNDING = 1e-11  # relative penalty that keeps equations of parallel columns regular
_FILTER_HOURS = (6.0, 24.0)  # time constants of the filtered inputs [h]
_FILTER_DAYS = 6  # days before an origin from which the filters run
_FROM_NOON = 4.0  # irradiance of the morning counts fully so long before noon [h], none at twice that and at noon
K_PER_COLUMN = 10.0  # unit of outdoor temperature in the columns by hour [K]
#: spread of an input that a table holds constant, where a prior knows of its effect
_UNSEEN_SPREAD = _USUAL_SPREAD | {"T_": 5.0}


@dataclass(frozen=True)
class ARXData:
    """The rows of a table as the regression reads them; rows are numbered from ``first``."""

    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    carried_forward: np.ndarray  # (n_rows,) the same, with the last known value where missing
    first: int
    make_exogenous: Callable[[], np.ndarray]

    @cached_property
    def n_known(self) -> np.ndarray:
        """(n_rows + 1,) how many temperatures are measured before each row."""
        return np.append(0, np.isfinite(self.T).cumsum())

    @cached_property
    def exogenous(self) -> np.ndarray:
        """(n_rows, p - n_lags) standardised inputs with lags, calendar and constant; made when first read."""
        return self.make_exogenous()

    @property
    def end(self) -> int:
        """The number after that of the last row."""
        return self.first + len(self.T)


class Pairs(NamedTuple):
    """Pairs of rows (k, k + 1) with measured temperatures: what the regression is fitted on."""

    D: np.ndarray  # (m, p) columns of row k
    d: np.ndarray  # (m,) temperature step T[k + 1] - T[k] [K]
    rows: np.ndarray  # (m,) number of row k, increasing

    def squares(self, coef: np.ndarray) -> float:
        """Sum of squared errors of coefficients (p,) [K2]."""
        return float(np.sum((self.d - self.D @ coef) ** 2))

    def between(self, begin: int, end: int) -> Pairs:
        """The pairs whose row k lies in [begin, end)."""
        inside = slice(*np.searchsorted(self.rows, (begin, end)))
        return Pairs(self.D[inside], self.d[inside], self.rows[inside])


class Moments(NamedTuple):
    """The normal equations of the regression.  They are sums over pairs, so that rows are added without a new fit."""

    gram: np.ndarray  # (p, p) D' D
    cross: np.ndarray  # (p,) D' d

    @classmethod
    def of(cls, pairs: Pairs) -> Moments:
        """The sums over these pairs."""
        return cls(pairs.D.T @ pairs.D, pairs.D.T @ pairs.d)

    def with_pairs(self, pairs: Pairs, sign: int = 1) -> Moments:
        """The sums with further pairs or, with ``sign=-1``, without some of them."""
        return Moments(with_products(self.gram, pairs.D, sign=sign), self.cross + sign * (pairs.D.T @ pairs.d))

    def ridge(self, alpha: float, prior: Moments | None = None) -> np.ndarray:
        """Coefficients (p,) under the penalty ``alpha``, from which the constant (the last column) is free.

        A prior, as sums over pairs, takes the place of the penalty.
        """
        if prior is not None:
            return self.plus(prior).solution(np.zeros(len(self.cross)))
        penalty = np.full(len(self.cross), alpha)
        penalty[-1] = CONSTANT_PENALTY
        return solve_positive_definite(self.gram + np.diag(penalty), self.cross)

    def solution(self, penalty: np.ndarray) -> np.ndarray:
        """Coefficients (p,) under a penalty (p,) on each, of equations whose units may differ by far."""
        whole = self.gram + np.diag(penalty)
        unit = 1.0 / np.sqrt(np.maximum(np.diag(whole), CONSTANT_PENALTY))
        scaled = unit[:, None] * whole * unit + _ROUNDING * np.eye(len(whole))
        return unit * solve_positive_definite(scaled, unit * self.cross)

    def plus(self, other: Moments, weight: float = 1.0) -> Moments:
        """The sums plus ``weight`` times others."""
        return Moments(self.gram + weight * other.gram, self.cross + weight * other.cross)


@dataclass(frozen=True)
class DailyColumns:
    """Columns for errors up to a day ahead: filtered inputs, irradiance by side, outdoor temperature by hour."""

    roles: list[str]  # of each column
    decay: np.ndarray  # (n_filters,) of the filters over a step
    noon: float  # hour at which the training irradiance has its mean [h]
    T_oa_mean: float  # [degC]
    memory: int  # rows from which the filters run

    @classmethod
    def of_training(cls, table: ZoneTable, roles: tuple[str, ...]) -> Self:
        """Take the time constants in steps, noon and the mean outdoor temperature from the training table."""
        sun = sum((table.inputs[role] for role in irradiance_roles(table.inputs)), np.zeros(table.n_rows))
        noon = float(sun @ hour_of_day(table.time) / sun.sum()) if sun.sum() > 0.0 else 12.0
        T_oa_mean = float(table.inputs["T_oa"].mean()) if "T_oa" in roles else 0.0
        of_column = [role for role in roles for _ in _FILTER_HOURS]
        of_column += [role for role in irradiance_roles(table.inputs) for _ in range(2)]
        decay = np.exp(-table.step_hours / np.array(_FILTER_HOURS))
        return cls(of_column, decay, noon, T_oa_mean, _FILTER_DAYS * rows_per_day(table.step))

    def of(
        self, table: ZoneTable, values: np.ndarray, roles: tuple[str, ...], before: Mapping[str, np.ndarray] | None
    ) -> list[np.ndarray]:
        """Blocks (k, n_rows) of the columns but those of the calendar, from the ``values`` (n_roles, n_rows) of inputs.

        Filters run from the first of the rows ``before``.
        """
        earlier = np.array([before[role] for role in roles]) if before else values[:, :1]
        earlier = earlier if earlier.size else values[:, :1]
        states = earlier @ _filter_weights(earlier.shape[1], tuple(self.decay))
        each = np.repeat(values, len(self.decay), axis=0).T
        filtered = low_pass(each, np.broadcast_to(self.decay, states.shape), states)
        from_noon = (hour_of_day(table.time) - self.noon) / _FROM_NOON
        sides = np.maximum(1.0 - np.abs(from_noon - np.array([[-1.0], [1.0]])), 0.0)
        return [filtered.T, *(table.inputs[role] * sides for role in irradiance_roles(dict.fromkeys(roles)))]


@dataclass(frozen=True)
class ARXDesign:
    """The columns of the regression, in units of the training table: a refit moves coefficients, not units."""

    n_lags: int
    n_input_lags: int
    calendar: bool
    roles: tuple[str, ...]  # of the inputs
    T_mean: float  # [degC]
    T_scale: float  # [K]
    T_range: tuple[float, float]  # lowest and highest temperature that is forecast [degC]
    input_mean: np.ndarray  # (n_input_columns,)
    input_scale: np.ndarray  # (n_input_columns,)
    daily: DailyColumns | None = None  # further columns, for errors up to a day ahead

    @classmethod
    def of_training(
        cls,
        table: ZoneTable,
        T: np.ndarray,
        n_lags: int,
        n_input_lags: int,
        calendar: bool,
        daily: bool = False,
        prior: bool = False,
    ) -> Self:
        """Take roles, means and scales from the training table and its temperature (n_rows,) [degC].

        With a ``prior`` inputs that are constant there keep their columns.
        """
        known, roles = T[np.isfinite(T)], tuple(table.inputs)
        # A linear recursion can diverge where the data say little: nothing far outside what was seen is forecast.
        reach = 3.0 * max(float(np.ptp(known)), 1.0)
        further = DailyColumns.of_training(table, roles) if daily else None
        lagged = _input_columns(table, roles, n_input_lags, further)
        usual = {role: _USUAL_SPREAD[role[:2]] if table.hardly_ran(role) else 0.0 for role in roles}
        of_column = [role for role in roles for _ in range(n_input_lags)]
        spread = lagged.std(axis=0)
        if further:  # in units of the input itself: what a filter leaves of a short table may be next to nothing
            of_column += further.roles
            of_role = {role: spread[n_input_lags * place] for place, role in enumerate(roles)}
            spread[len(roles) * n_input_lags :] = [of_role[role] for role in further.roles]
        scale = np.maximum(spread, [usual[role] for role in of_column])
        unseen = [_UNSEEN_SPREAD.get(role[:2], 0.2) if prior else np.inf for role in of_column]
        return cls(
            n_lags,
            n_input_lags,
            calendar,
            roles,
            T_mean=float(known.mean()),
            T_scale=max(float(known.std()), 1e-3),
            T_range=(float(known.min()) - reach, float(known.max()) + reach),
            input_mean=lagged.mean(axis=0),
            input_scale=np.where(spread > 1e-9, scale, unseen),  # a constant input has no effect
            daily=further,
        )

    @property
    def warmup(self) -> int:
        """Rows before an origin that a forecast reads."""
        lags = max(self.n_lags, self.n_input_lags) + 1
        return lags if self.daily is None else max(lags, self.daily.memory)

    @property
    def n_calendar(self) -> int:
        """Columns of the calendar, which stand before the constant."""
        return self.calendar * (N_CELLS + 24 * (self.daily is not None and "T_oa" in self.roles))

    def view(
        self, table: ZoneTable, T: np.ndarray, first: int = 0, before: Mapping[str, np.ndarray] | None = None
    ) -> ARXData:
        """A table and its measured temperature (n_rows,) [degC], NaN where missing, as the regression reads them.

        Its rows are numbered from ``first``; inputs are filtered from those of the rows ``before`` on.
        """
        return ARXData(T, carried_forward(T), first, partial(self._exogenous, table, before))

    def _exogenous(self, table: ZoneTable, before: Mapping[str, np.ndarray] | None) -> np.ndarray:
        inputs = _input_columns(table, self.roles, self.n_input_lags, self.daily, before)
        rows, n_inputs = np.arange(table.n_rows), inputs.shape[1]
        columns = np.zeros((table.n_rows, n_inputs + self.n_calendar + 1))
        columns[:, :n_inputs] = (inputs - self.input_mean) / self.input_scale
        if self.calendar:
            slots = day_type_hour(table)
            columns[rows, n_inputs + slots] = 1.0
            if self.daily is not None and "T_oa" in self.roles:
                across = (table.inputs["T_oa"] - self.daily.T_oa_mean) / K_PER_COLUMN
                columns[rows, n_inputs + N_CELLS + slots % 24] = across
        columns[:, -1] = 1.0
        return columns

    def pairs(self, view: ARXData, begin: int = 0, end: int | None = None) -> Pairs:
        """Pairs whose row k lies in [begin, end); a missing lag is filled as in a forecast, half must be known."""
        earliest = min(self.n_lags, view.end - 1) - 1
        rows = np.arange(max(begin, earliest), view.end - 1 if end is None else min(end, view.end - 1))
        here = rows - view.first
        steps = view.T[here + 1] - view.T[here]
        use = self.half_known(view, rows) & np.isfinite(steps)
        rows, here = rows[use], here[use]
        return Pairs(np.hstack([self.windows(view, rows), view.exogenous[here]]), steps[use], rows)

    def half_known(self, view: ARXData, rows: np.ndarray) -> np.ndarray:
        """Whether at least half of the temperatures up to each row are known, (n_rows,)."""
        here, begin = rows - view.first, np.maximum(rows - self.n_lags + 1, 0) - view.first
        known = view.n_known[here + 1] - view.n_known[begin]
        known += np.maximum(self.n_lags - 1 - rows, 0) * view.n_known[1]  # row 0 stands for the rows before it
        return known >= _MIN_KNOWN * self.n_lags

    def windows(self, view: ARXData, rows: np.ndarray) -> np.ndarray:
        """(n_rows, n_lags) standardised temperatures up to each row, newest first; the last known one where missing.

        Row 0 stands for the rows before it.
        """
        places = np.maximum(rows[:, None] - np.arange(self.n_lags), 0) - view.first
        if places.min(initial=0) < 0:  # would be read from the end
            raise IndexError(f"row {view.first + places.min()} lies before the rows at hand, from {view.first} on.")
        known = _causally_filled(view.carried_forward[places], self.T_mean)
        return (known - self.T_mean) / self.T_scale

    def iterate(
        self, view: ARXData, origins: np.ndarray, n_leads: int, coefs: np.ndarray, *, clipped: bool = True
    ) -> np.ndarray:
        """Forecasts (n_origins, n_leads) [degC] from each origin, by coefficients of each or of all (1, n_columns).

        The temperature is read up to each origin; after the last row inputs are held.  Where ``clipped``, nothing far
        outside of the training temperatures is forecast.
        """
        lag_coefs, drive = coefs[:, : self.n_lags] / self.T_scale, coefs[:, self.n_lags :] / self.T_scale
        if len(coefs) == 1:
            first = int(origins.min(initial=view.end))
            ahead = slice(first - view.first, int(origins.max(initial=first)) + n_leads - view.first)
            driven, at = view.exogenous[ahead] @ drive[0], origins - first
            lag_coefs = np.repeat(lag_coefs, len(origins), axis=0)
        else:
            rows = np.minimum(origins[:, None] + np.arange(n_leads), view.end - 1) - view.first
            each = [view.exogenous[r] @ c for r, c in zip(rows, drive, strict=True)]
            driven, at = np.concatenate(each), n_leads * np.arange(len(origins))
        bounds = self.T_range if clipped else (-np.inf, np.inf)
        low, high = ((bound - self.T_mean) / self.T_scale for bound in bounds)
        begin, lags = (np.ascontiguousarray(v[:, ::-1]) for v in (self.windows(view, origins), lag_coefs))
        return iterate_lags(begin, lags, driven, at, n_leads, low, high) * self.T_scale + self.T_mean

    def input_response(self, role: str, coef: np.ndarray, n_leads: int) -> np.ndarray:
        """(n_leads,) temperature [K] after 1, 2 ... steps of a unit of an input over one step, by coefficients (p,)."""
        if role not in self.roles:
            return np.zeros(n_leads)
        lags, place = coef[: self.n_lags] / self.T_scale, self.roles.index(role)
        each = coef[self.n_lags : self.n_lags + len(self.input_mean)] / self.input_scale
        own = each[place * self.n_input_lags : (place + 1) * self.n_input_lags]
        drive = np.zeros(max(n_leads, len(own)))
        drive[: len(own)] = own
        if self.daily is not None:
            first = len(self.roles) * self.n_input_lags + place * len(self.daily.decay)
            for weight, decay in zip(each[first:], self.daily.decay, strict=False):
                drive[:n_leads] += weight * (1.0 - decay) * decay ** np.arange(n_leads)
        # T[k+1] = T[k] + lags (T[k], T[k-1] ...) + drive[k]
        recursion = -np.append(0.0, lags)
        recursion[1] -= 1.0
        recursion[0] = 1.0
        return lfilter([1.0], recursion, drive[:n_leads])


class RecursiveARX:
    """The regression updated by pairs of rows as they become known; row ``begin`` is the first after the training."""

    def __init__(
        self, design: ARXDesign, moments: Moments, alpha: float, begin: int, prior: Moments | None = None
    ) -> None:
        self._design, self._moments, self._alpha, self._prior = design, moments, alpha, prior
        self._next = begin - 1  # row k of the next pair: the first one ends at the first new row
        self._coef: np.ndarray | None = None

    def advance(self, view: ARXData, row: int) -> None:
        """Add the pairs that end by ``row``."""
        if row > max(self._next, 0):
            pairs = self._design.pairs(view, max(self._next, 0), row)
            self._moments, self._next, self._coef = self._moments.with_pairs(pairs), row, None

    def coef(self) -> np.ndarray:
        """Coefficients (n_columns,) from all pairs so far."""
        if self._coef is None:
            self._coef = self._moments.ridge(self._alpha, self._prior)
        return self._coef


def coefs_at(regression: Any, view: ARXData, origins: np.ndarray) -> np.ndarray:
    """(n_origins, n_columns) coefficients of an updated regression as known at each origin, in any order."""
    known = {}
    for origin in np.unique(origins).tolist():
        regression.advance(view, origin)
        known[origin] = regression.coef()
    return np.array([known[origin] for origin in origins.tolist()])


def _input_columns(
    table: ZoneTable,
    roles: tuple[str, ...],
    n_lags: int,
    daily: DailyColumns | None,
    before: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """(n_rows, n_input_columns) inputs of each row and of those before it; the first row stands for earlier ones."""
    if not roles:
        return np.empty((table.n_rows, 0))
    values = np.array([table.inputs[role] for role in roles])
    longer = np.concatenate([np.repeat(values[:, :1], n_lags - 1, axis=1), values], axis=1)
    lagged = np.stack([longer[:, n_lags - 1 - lag :][:, : table.n_rows] for lag in range(n_lags)], axis=1)
    further = daily.of(table, values, roles, before) if daily else []
    return np.concatenate([lagged.reshape(-1, table.n_rows), *further]).T


@lru_cache(maxsize=16)
def _filter_weights(n_rows: int, decays: tuple[float, ...]) -> np.ndarray:
    """(n_rows, n_filters) weights of the rows in the last value of a filter, at rest before the first."""
    decay, age = np.array(decays), np.arange(n_rows)[::-1, None]
    weights = (1.0 - decay) * decay**age
    weights[0] = decay ** age[0]
    return weights


def _causally_filled(windows: np.ndarray, default: float) -> np.ndarray:
    """Windows (newest first) with missing values at the oldest known value, or at the default where none is known."""
    known = np.isfinite(windows)
    if known.all():
        return windows
    oldest = windows.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    filler = np.where(known.any(axis=1), windows[np.arange(len(windows)), oldest], default)
    return np.where(known, windows, filler[:, None])
