"""One-step errors of a fitted identification, with the standard deviation that the model gives each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._table import ZoneTable
from .._threads import one_blas_thread
from .._time import rows_covering
from ..filtering import Prediction, one_step_errors, simulate_path
from .disturbance_models import Conventional, first_state, take_searched
from .gain_filter import GainFilter, without_disturbance


class Innovations(NamedTuple):
    """Errors of every row and measured node; NaN where nothing was measured."""

    error: np.ndarray  # (N, o) [K]
    std: np.ndarray  # (N, o) [K]


class InnovationsMixin:
    """``innovations`` over one hook; the default is the Kalman filter of the model's own tracker."""

    @one_blas_thread
    def innovations(self, X: Any) -> pd.DataFrame:
        """Errors of the model's own predictor, one step ahead.

        CONV predicts by simulation, so that its errors are simulation errors; OD by its ARMA model; ID and the periodic
        model by their Kalman filters.  The standardised errors ``innovation / std`` of a right model are white and
        N(0, 1).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            With the measured temperature as column ``T_za``.  Where X begins as the training table did (by its time
            stamps) the predictor starts as in ``fit``; where X follows it, from its end; else cold.

        Returns
        -------
        DataFrame of length n_samples
            ``innovation`` and ``std`` [K] (``innovation_<node>`` and ``std_<node>`` where several nodes are measured);
            NaN where ``T_za`` is missing, and in the warm-up from which CONV takes its first state.

        Raises
        ------
        ValueError
            If X has no ``T_za``.

        Notes
        -----
        CONV, ID and OD minimise squares, which fixes the size of their errors only through the errors themselves:
        ``std`` is scaled to the training errors (``noise_std_``).  The gain of a Kalman filter does not change with
        that scale.  Behind missing rows ``std`` is larger; a fit of ID or OD weighs its errors by it.
        """
        check_is_fitted(self)
        table = self._read_X(X)  # type: ignore[attr-defined]
        roles = self.network_.history_roles  # type: ignore[attr-defined]
        for role in roles:
            if role not in table.history:
                raise ValueError(f"role {role!r} is missing: innovations compare predictions with the measurements.")
        in_training, errors, spreads = self._is_training(table), [], []  # type: ignore[attr-defined]
        for number, segment in enumerate(table.segments):
            longer, n_tail = self._after_tail(segment) if number == 0 else (segment, 0)  # type: ignore[attr-defined]
            found = self._innovations(longer, number if in_training else None)
            errors.append(found.error[n_tail:])
            spreads.append(found.std[n_tail:])
        error = np.concatenate(errors)
        std = np.where(np.isfinite(error), np.concatenate(spreads), np.nan)
        ends = [""] if len(roles) == 1 else [f"_{role.removeprefix('T_')}" for role in roles]
        columns = {f"innovation{end}": error[:, j] for j, end in enumerate(ends)}
        columns |= {f"std{end}": std[:, j] for j, end in enumerate(ends)}
        return pd.DataFrame(columns, index=table.index)

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        """Of one segment of rows; ``segment`` is its number in the training table, None where it is not from there."""
        return kalman_innovations(self, table, segment)


def kalman_innovations(model: Any, table: ZoneTable, segment: int | None) -> Innovations:
    """Of the filter with the gain state, which starts as in ``fit`` or from the end of the training table."""
    tracker, experiment = model._filter, model._experiment(table)
    C = tracker.augmented()[1]
    follows = segment is None and model._is_tail(table)
    start = model._start(table) if follows else tracker.cold(experiment.firsts)
    means, covariances = tracker.track(experiment, model._cells(table), model._classes(table), start).starts
    variance = np.einsum("os,kst,ot->ko", C, covariances, C) + tracker.R
    return Innovations(experiment.outputs - means @ C.T, np.sqrt(variance))


def scaled_innovations(model: Any, table: ZoneTable, segment: int | None) -> Innovations:
    """Kalman innovations whose variance, in the steady state, is that of the training errors."""
    found = kalman_innovations(model, table, segment)
    return Innovations(found.error, found.std * model.noise_std_ / np.sqrt(steady_variance(model._filter)))


def steady_variance(tracker: GainFilter, tolerance: float = 1e-9) -> float:
    """Innovation variance of a filter that has measured every row for long, the mean of several outputs [K2]."""
    A, C = tracker.augmented()
    P, last, mean = tracker.cold(np.zeros(len(C))).covariance, np.inf, 0.0
    for _ in range(5000):
        S = C @ P @ C.T + tracker.R * np.eye(len(C))
        mean = float(np.trace(S)) / len(C)
        if abs(mean - last) < tolerance * mean:
            break
        last = mean
        P = A @ (P - P @ C.T @ np.linalg.solve(S, C @ P)) @ A.T + tracker.Q[0]
    return mean


def simulation_errors(model: Any, table: ZoneTable) -> Innovations:
    """CONV: a Kalman filter over the warm-up sets the state, then the network is simulated (paper 2.2.1)."""
    tracker, experiment = model._filter, model._experiment(table)
    setting, n_rows = Conventional(rows_covering(model.warmup, table.step)), len(experiment.y)
    plain = without_disturbance(tracker, experiment.hours)
    warm, state = setting.filtered(n_rows), first_state(tracker.network, experiment)
    if warm:
        none, early = np.zeros(warm, np.int64), experiment.rows(slice(0, warm))
        state = plain.track(early, none, none, plain.cold(experiment.firsts)).end.mean[: tracker.n]
    predicted = np.full(experiment.outputs.shape, np.nan)
    path = simulate_path(tracker.A, experiment.inputs[warm:] @ tracker.B.T, state)
    predicted[warm:] = path[: n_rows - warm, tracker.measured]
    return Innovations(experiment.outputs - predicted, np.full(predicted.shape, model.noise_std_))


def arma_innovations(model: Any, table: ZoneTable, segment: int | None) -> Innovations:
    """OD: what the open loop leaves over, predicted by the ARMA(1,1) disturbance (paper Eq. od_pred)."""
    tracker, experiment = model._filter, model._experiment(table)
    if segment is None:
        state = np.array(model._open_start(table), dtype=np.float64)
    else:  # as it was searched
        state = first_state(tracker.network, experiment)
        take_searched(state, tracker.network, model.disturbance_, segment)
    free = experiment.outputs - model._open_loop(experiment, state)[:-1, tracker.measured]
    found = arma_errors(free, *(float(model.disturbance_[name]) for name in ("rho_1", "rho_2")))
    return Innovations(found.error, model.noise_std_ * found.std)


def arma_errors(free: np.ndarray, rho_1: float, rho_2: float) -> Innovations:
    """One-step errors (N, o) of ``z[k+1] = rho_1 z[k] + rho_2 e[k]``, ``free = z + e``; std for unit noise."""
    _, spread = arma_gains(np.isfinite(free), rho_1, rho_2)
    error = arma_prediction(free, rho_1, rho_2).errors
    return Innovations(np.where(np.isfinite(free), error, np.nan), np.sqrt(1.0 + spread))


def arma_prediction(free: np.ndarray, rho_1: float, rho_2: float) -> Prediction:
    """The disturbance (N + 1, o) that every row leads to expect of the next, and the errors (N, o), 0 where missing."""
    o = free.shape[1]
    gains, _ = arma_gains(np.isfinite(free), rho_1, rho_2)
    own = gains[:, :, None] * np.eye(o)
    return one_step_errors(rho_1 * np.eye(o), np.zeros(free.shape), own, np.eye(o), free, np.zeros(o))


def arma_gains(seen: np.ndarray, rho_1: float, rho_2: float) -> tuple[np.ndarray, np.ndarray]:
    """Gain of every row (N, o), and variance of z there for unit noise.

    A row without a measurement leaves ``rho_2 e`` unknown, so that the rows after it are less certain, and correct z by
    more.  The first measured row knows z.
    """
    spread = np.zeros(seen.shape)
    for j, column in enumerate(seen.T):
        p, rows = 0.0, np.flatnonzero(column)
        # nothing is uncertain before the first missing row behind a measured one
        first = rows[0] + np.argmin(column[rows[0] :]) if len(rows) and not column[rows[0] :].all() else len(column)
        for k in range(first, len(column)):
            spread[k, j] = p
            p = (rho_1 - rho_2) ** 2 * p / (1.0 + p) if column[k] else rho_1**2 * p + rho_2**2
    return (rho_1 * spread + rho_2) / (1.0 + spread), spread
