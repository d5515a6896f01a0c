"""The ARX regression: its data matrix, its ridge solution, and its recursion over the horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy.linalg import solve

from .._table import ZoneTable
from ..filtering import iterate_lags
from .features import day_type_hour, one_hot

_MIN_KNOWN = 0.5  # share of a window's temperatures that must be known for a row to be learned from
#: spread of a usual stage [-] and measured heat [kW], the unit of an input that hardly ran: in units of its own spread
#: an hour of heat would be a thousand times what was learned from
_USUAL_SPREAD = {"u_": 0.4, "Q_": 2.5}
_CONSTANT_PENALTY = 1e-9  # penalty of the constant: none, but where no pair is known the equations must stay regular


class ARXData(NamedTuple):
    """The rows of a table as the regression reads them; rows are numbered from ``first``."""

    exogenous: np.ndarray  # (n_rows, p - n_lags) standardised inputs with lags, calendar and constant
    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    held: np.ndarray  # (n_rows,) the same, with the last known value where missing
    first: int

    @property
    def end(self) -> int:
        """The number after that of the last row."""
        return self.first + len(self.T)


class Pairs(NamedTuple):
    """Pairs of rows (k, k + 1) with measured temperatures: what the regression is fitted on."""

    D: np.ndarray  # (m, p) columns of row k
    d: np.ndarray  # (m,) temperature step T[k + 1] - T[k] [K]
    rows: np.ndarray  # (m,) number of row k

    def between(self, begin: int, end: int) -> Pairs:
        """The pairs whose row k lies in [begin, end)."""
        inside = (self.rows >= begin) & (self.rows < end)
        return Pairs(self.D[inside], self.d[inside], self.rows[inside])


class Moments(NamedTuple):
    """The normal equations of the regression.  They are sums over pairs, so that rows are added without a new fit."""

    gram: np.ndarray  # (p, p) D' D
    cross: np.ndarray  # (p,) D' d

    @classmethod
    def of(cls, pairs: Pairs) -> Moments:
        """The sums over these pairs."""
        return cls(pairs.D.T @ pairs.D, pairs.D.T @ pairs.d)

    def plus(self, pairs: Pairs, sign: int = 1) -> Moments:
        """The sums with further pairs or, with ``sign=-1``, without some of them."""
        other = Moments.of(pairs)
        return Moments(self.gram + sign * other.gram, self.cross + sign * other.cross)

    def ridge(self, alpha: float) -> np.ndarray:
        """Coefficients (p,) under the penalty ``alpha``, from which the constant (the last column) is free."""
        penalty = np.full(len(self.cross), alpha)
        penalty[-1] = _CONSTANT_PENALTY
        return solve(self.gram + np.diag(penalty), self.cross, assume_a="pos")


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
    input_mean: np.ndarray  # (n_roles * n_input_lags,)
    input_scale: np.ndarray  # (n_roles * n_input_lags,)

    @classmethod
    def of_training(cls, table: ZoneTable, T: np.ndarray, n_lags: int, n_input_lags: int, calendar: bool) -> Self:
        """Take roles, means and scales from the training table and its temperature (n_rows,) [degC]."""
        known, roles = T[np.isfinite(T)], tuple(table.inputs)
        # A linear recursion can diverge where the data say little: nothing far outside what was seen is forecast.
        reach = 3.0 * max(float(np.ptp(known)), 1.0)
        lagged = _lagged_inputs(table, roles, n_input_lags)
        usual = [_USUAL_SPREAD[role[:2]] if table.hardly_ran(role) else 0.0 for role in roles]
        spread = lagged.std(axis=0)
        scale = np.maximum(spread, np.repeat(usual, n_input_lags))
        return cls(
            n_lags,
            n_input_lags,
            calendar,
            roles,
            T_mean=float(known.mean()),
            T_scale=max(float(known.std()), 1e-3),
            T_range=(float(known.min()) - reach, float(known.max()) + reach),
            input_mean=lagged.mean(axis=0),
            input_scale=np.where(spread > 1e-9, scale, np.inf),  # a constant input has no effect
        )

    @property
    def warmup(self) -> int:
        """Rows before an origin that a forecast reads."""
        return max(self.n_lags, self.n_input_lags) + 1

    def view(self, table: ZoneTable, T: np.ndarray, first: int = 0) -> ARXData:
        """See :meth:`ARXRegressor.view`."""
        blocks = [(_lagged_inputs(table, self.roles, self.n_input_lags) - self.input_mean) / self.input_scale]
        if self.calendar:
            blocks.append(one_hot(day_type_hour(table), 48))
        return ARXData(np.hstack([*blocks, np.ones((table.n_rows, 1))]), T, _held(T), first)

    def pairs(self, view: ARXData, begin: int = 0, end: int | None = None) -> Pairs:
        """Pairs whose row k lies in [begin, end); a missing lag is held as in a forecast, half must be known."""
        earliest = min(self.n_lags, view.end - 1) - 1
        rows = np.arange(max(begin, earliest), view.end - 1 if end is None else min(end, view.end - 1))
        here = rows - view.first
        steps = view.T[here + 1] - view.T[here]
        known = np.isfinite(self._windows(view, view.T, rows)).mean(axis=1)
        windows = _causally_filled(self._windows(view, view.held, rows), self.T_mean)
        use = (known >= _MIN_KNOWN) & np.isfinite(steps)
        D = np.hstack([(windows[use] - self.T_mean) / self.T_scale, view.exogenous[here[use]]])
        return Pairs(D, steps[use], rows[use])

    def _windows(self, view: ARXData, T: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(n_rows, n_lags) temperatures up to each row, newest first; row 0 stands for the rows before it."""
        return T[np.maximum(rows[:, None] - np.arange(self.n_lags), 0) - view.first]

    def iterate(self, view: ARXData, origins: np.ndarray, n_leads: int, coefs: np.ndarray) -> np.ndarray:
        """See :meth:`ARXRegressor.iterate`."""
        known = _causally_filled(self._windows(view, view.held, origins), self.T_mean)
        rows = np.minimum(origins[:, None] + np.arange(n_leads), view.end - 1) - view.first
        lag_coefs, drive = coefs[:, : self.n_lags], coefs[:, self.n_lags :]
        if len(coefs) == 1:
            driven = (view.exogenous @ drive[0])[rows]
        else:
            driven = np.stack([view.exogenous[r] @ c for r, c in zip(rows, drive, strict=True)])
        low, high = ((bound - self.T_mean) / self.T_scale for bound in self.T_range)
        begin = np.ascontiguousarray((known[:, ::-1] - self.T_mean) / self.T_scale)
        each = np.ascontiguousarray(np.broadcast_to(lag_coefs[:, ::-1] / self.T_scale, begin.shape))
        return iterate_lags(begin, each, driven / self.T_scale, low, high) * self.T_scale + self.T_mean


class RecursiveARX:
    """The regression updated by pairs of rows as they become known; row ``begin`` is the first after the training."""

    def __init__(self, design: ARXDesign, moments: Moments, alpha: float, begin: int) -> None:
        self._design, self._moments, self._alpha = design, moments, alpha
        self._next = begin - 1  # row k of the next pair: the first one ends at the first new row
        self._coef: np.ndarray | None = None

    def advance(self, view: ARXData, row: int) -> None:
        """Add the pairs that end by ``row``."""
        if row > max(self._next, 0):
            pairs = self._design.pairs(view, max(self._next, 0), row)
            self._moments, self._next, self._coef = self._moments.plus(pairs), row, None

    def coef(self) -> np.ndarray:
        """Coefficients (n_columns,) from all pairs so far."""
        if self._coef is None:
            self._coef = self._moments.ridge(self._alpha)
        return self._coef


def _lagged_inputs(table: ZoneTable, roles: tuple[str, ...], n_lags: int) -> np.ndarray:
    """(n_rows, n_roles * n_lags) inputs of each row and of those before it; the first row stands for earlier ones."""
    rows = np.arange(table.n_rows)
    lags = [np.maximum(rows - lag, 0) for lag in range(n_lags)]
    columns = [table.inputs[role][chosen] for role in roles for chosen in lags]
    return np.column_stack(columns) if columns else np.empty((table.n_rows, 0))


def _held(T: np.ndarray) -> np.ndarray:
    """Missing values replaced by the last known one, NaN before the first."""
    last = np.maximum.accumulate(np.where(np.isfinite(T), np.arange(len(T)), -1))
    return np.where(last >= 0, T[np.maximum(last, 0)], np.nan)


def _causally_filled(windows: np.ndarray, default: float) -> np.ndarray:
    """Windows (newest first) with missing values at the oldest known value, or at the default where none is known."""
    known = np.isfinite(windows)
    oldest = windows.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    held = np.where(known.any(axis=1), windows[np.arange(len(windows)), oldest], default)
    return np.where(known, windows, held[:, None])
