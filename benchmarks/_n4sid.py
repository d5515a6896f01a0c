"""Subspace identification (N4SID) with daily and weekly harmonics: a baseline of the forecast benchmark.

Harmonics are removed from temperature and inputs first: a linear system keeps their frequencies, so that the rest obeys
the same system.  States come from the projection of future outputs on the past with the SSARX weighting, which a
thermostat does not bias (Jansson 2003, IFAC Proceedings 36(16)); A, C and K from least squares on these states; B of
inputs and harmonics from least squares on the one-step errors.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solve, svd
from sklearn.base import BaseEstimator, RegressorMixin

from skhybrid._time import rows_of

BLOCK_HOURS = 6  # past and future of the projection
ORDERS = (1, 2, 3, 4, 6, 8, 12)
DAILY, WEEKLY = 6, 3  # harmonics of a day, and of a week


class System(NamedTuple):
    """x[k+1] = A x[k] + B v[k] + K e[k], y[k] = C x[k] + e[k]; v holds inputs, harmonics and a constant."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    K: np.ndarray


def harmonics(index: pd.DatetimeIndex) -> np.ndarray:
    """(n, 2 * (DAILY + WEEKLY) + 1) sines and cosines of local time, and a constant."""
    hours = 24.0 * index.day_of_week.to_numpy() + index.hour.to_numpy() + index.minute.to_numpy() / 60.0
    turns = np.concatenate([np.arange(1, DAILY + 1) / 24.0, np.arange(1, WEEKLY + 1) / 168.0])
    angles = 2.0 * np.pi * hours[:, None] * turns
    return np.hstack([np.sin(angles), np.cos(angles), np.ones((len(hours), 1))])


def states_of(y: np.ndarray, u: np.ndarray, n_blocks: int) -> np.ndarray:
    """(N - 2 n_blocks + 1, n_blocks) states of the rows from ``n_blocks`` on, the most telling first."""
    past = sliding_window_view(np.column_stack([y, u]), n_blocks, axis=0)[:-1, :, ::-1]  # newest first
    past = past.reshape(len(past), -1)  # of rows n_blocks, n_blocks + 1, ...
    markov = _ridge(past, y[n_blocks:])[:, 0].reshape(1 + u.shape[1], n_blocks)
    n = len(past) - n_blocks + 1
    future = np.empty((n, n_blocks))
    for ahead in range(n_blocks):  # less what outputs and inputs since then explain
        known = past[ahead : ahead + n].reshape(n, 1 + u.shape[1], n_blocks)[..., :ahead]
        future[:, ahead] = y[n_blocks + ahead : n_blocks + ahead + n] - np.einsum("ncb,cb->n", known, markov[:, :ahead])
    explained = past[:n] @ _ridge(past[:n], future)
    spread = np.sqrt(np.mean((future - explained) ** 2, axis=0)) + 1e-9
    left, values, _ = svd(explained / spread, full_matrices=False)
    return left * values


def _ridge(D: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(p, q) coefficients under a small penalty."""
    return solve(D.T @ D + 1e-6 * len(D) * np.eye(D.shape[1]), D.T @ d.reshape(len(D), -1), assume_a="pos")


def identify(y: np.ndarray, u: np.ndarray, states: np.ndarray, n_blocks: int) -> tuple[np.ndarray, ...]:
    """A, C and K of states (n_rows, n) from row ``n_blocks`` on."""
    rows = slice(n_blocks, n_blocks + len(states) - 1)
    C = _ridge(states[:-1], y[rows]).T
    error = y[rows] - states[:-1] @ C[0]
    coef = _ridge(np.column_stack([states[:-1], u[rows], error]), states[1:]).T
    n = states.shape[1]
    return coef[:, :n], C, coef[:, -1:]


def with_inputs(A: np.ndarray, C: np.ndarray, K: np.ndarray, y: np.ndarray, v: np.ndarray) -> System:
    """The system with B (n, m) of all inputs v (N, m) by least squares on the one-step errors."""
    n, m = len(A), v.shape[1]
    closed, each = A - K @ C, np.kron(np.eye(n), np.ones((1, m)))
    own, by_input, initial = np.zeros(n), np.zeros((n, n * m)), np.eye(n)
    rows, rest = np.empty((len(y), n * m + n)), np.empty(len(y))
    for k in range(len(y)):
        rows[k] = np.concatenate([(C @ by_input)[0], (C @ initial)[0]])
        rest[k] = y[k] - (C @ own)[0]
        by_input, initial = closed @ by_input + each * np.tile(v[k], n), closed @ initial
        own = closed @ own + K[:, 0] * y[k]
    ridge = np.append(np.full(n * m, 1e-3), np.full(n, 1e-9))
    coef = solve(rows.T @ rows + np.diag(ridge), rows.T @ rest, assume_a="pos")
    return System(A, coef[: n * m].reshape(n, m), C, K)


def paths(system: System, y: np.ndarray, v: np.ndarray, origins: np.ndarray, n_leads: int) -> np.ndarray:
    """(n_origins, n_leads) forecasts from filtered states; a missing temperature is not filtered."""
    A, B, C, K = system
    state, states = np.zeros(len(A)), np.empty((len(y), len(A)))
    for k in range(int(origins.max()) + 1):
        error = y[k] - (C @ state)[0]
        state = A @ state + B @ v[k] + (K[:, 0] * error if np.isfinite(error) else 0.0)
        states[k] = state  # of row k + 1, as known at row k
    x, out = states[origins], np.empty((len(origins), n_leads))
    for lead in range(n_leads):
        rows = np.minimum(origins + lead + 1, len(v) - 1)
        out[:, lead] = x @ C[0]
        x = x @ A.T + v[rows] @ B.T
    return out


class N4SID(RegressorMixin, BaseEstimator):
    """A state-space model by subspace identification, its order by the day-ahead error on the last third."""

    def fit(self, X: pd.DataFrame, y: Any) -> Self:
        """Identify on two thirds at every order, then at the best order on all rows."""
        self.inputs_ = [c for c in X if c != "T_za"]
        self.step_ = X.index[1] - X.index[0]
        self.day_, self.blocks_ = rows_of("1D", self.step_), rows_of(f"{BLOCK_HOURS}h", self.step_)
        T = pd.Series(np.asarray(y, dtype=np.float64), index=X.index).interpolate(limit_direction="both").to_numpy()
        raw = X[self.inputs_].to_numpy(dtype=np.float64)
        self.center_, self.mean_ = raw.mean(axis=0), T.mean()
        self.scale_ = np.maximum(raw.std(axis=0), 1e-6)
        self.range_ = (T.min() - 3 * np.ptp(T), T.max() + 3 * np.ptp(T))
        split = 2 * len(X) // 3
        origins = np.arange(split, len(X) - self.day_, self.day_ // 8)
        truth = T[origins[:, None] + np.arange(1, self.day_ + 1)]
        errors = {}
        for order, system in self._systems(X[:split], T[:split], ORDERS):
            ahead = self._clipped(paths(system, T - self.mean_, self._known(X), origins, self.day_))
            errors[order] = float(np.mean((ahead - truth) ** 2))
        self.order_ = min(errors, key=errors.__getitem__)
        self.system_ = next(self._systems(X, T, (self.order_,)))[1]
        self.past_ = X.assign(T_za=T).tail(3 * self.day_)
        return self

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Forecast from each origin."""
        follows = X.index[0] == self.past_.index[-1] + self.step_
        joined = pd.concat([self.past_, X]) if follows else X
        rows = np.asarray(origins) + (len(self.past_) if follows else 0)
        T = joined["T_za"].to_numpy(dtype=np.float64) - self.mean_
        return self._clipped(paths(self.system_, T, self._known(joined), rows, rows_of(horizon, self.step_)))

    def _systems(self, X: pd.DataFrame, T: np.ndarray, orders: tuple[int, ...]) -> Any:
        """Pairs (order, system) identified on rows."""
        v, wave = self._known(X), harmonics(X.index)
        signals = np.column_stack([T - self.mean_, v[:, : len(self.inputs_)]])
        left = signals - wave @ np.linalg.lstsq(wave, signals, rcond=None)[0]
        states = states_of(left[:, 0], left[:, 1:], self.blocks_)
        for order in orders:
            A, C, K = identify(left[:, 0], left[:, 1:], states[:, :order], self.blocks_)
            if max(np.abs(np.linalg.eigvals(M)).max() for M in (A, A - K @ C)) < 1.0:  # stable, and so its filter
                yield order, with_inputs(A, C, K, T - self.mean_, v)

    def _known(self, X: pd.DataFrame) -> np.ndarray:
        """(n, m) standardised inputs, harmonics and a constant."""
        scaled = (X[self.inputs_].to_numpy(dtype=np.float64) - self.center_) / self.scale_
        return np.hstack([scaled, harmonics(X.index)])

    def _clipped(self, path: np.ndarray) -> np.ndarray:
        return np.clip(np.nan_to_num(path, nan=0.0, posinf=1e9, neginf=-1e9) + self.mean_, *self.range_)
