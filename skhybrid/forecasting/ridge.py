"""The baseline ``"ridge"``, on calendar and weather and on recent deviations from them; and any regressor on the same.

Two ridge regressions.  The *static* one explains every row by calendar and weather alone, so that it is also the
expectation when no past is known.  The *dynamic* one forecasts the deviation from it, over (origin, lead) pairs, from
deviations known at the origin.  Both choose their penalty by leaving out blocks of time (weeks where there are enough),
and the dynamic one learns from deviations that the static one left in blocks it had not seen.
"""

from __future__ import annotations

from math import gcd
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.linalg import eigh
from sklearn.base import clone

from .._calendar import N_CELLS, clock_hour, day_type_hour, one_hot
from .._table import ZoneTable, predicted_by
from .._time import rows_per_day, rows_per_hour
from .features import held_target_rows, irradiance_roles, known_before, lag_features, target_rows

ALPHAS = np.logspace(-1.0, 5.0, 13)
#: weather columns count ten standard deviations, so that the penalty that shrinks the calendar hardly touches them.
_WEATHER_SCALE = 10.0
_HOURLY_SHARES = (0.0, 0.3, 1.0)  # how freely the effect of T_oa may differ by hour; left-out blocks choose
_MOST_PAIRS = 150_000  # (origin, lead) pairs that are learned from; beyond it origins are thinned


class RidgeFit(NamedTuple):
    """A ridge regression whose penalty was chosen by blocks of time."""

    mean: np.ndarray  # (p,) of the columns
    coef: np.ndarray  # (p,)
    intercept: float
    alpha: float

    def predict(self, D: np.ndarray) -> np.ndarray:
        return (D - self.mean) @ self.coef + self.intercept


def _moments(D: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The matrix [D 1 y]' [D 1 y], which adds over blocks."""
    whole = np.column_stack([D, np.ones(len(y)), y])
    return whole.T @ whole


def _solve(moments: np.ndarray, alphas: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Column means (p,), coefficients (n_alphas, p) and intercept of the ridge with a free intercept."""
    n = max(moments[-2, -2], 1.0)
    mean, y_mean = moments[:-2, -2] / n, moments[-1, -2] / n
    gram = moments[:-2, :-2] - n * np.outer(mean, mean)
    cross = moments[:-2, -1] - n * mean * y_mean
    values, vectors = eigh(gram)
    coefs = (vectors @ ((vectors.T @ cross)[:, None] / (np.maximum(values, 0.0)[:, None] + alphas))).T
    return mean, coefs, float(y_mean)


def ridge_by_blocks(D: np.ndarray, y: np.ndarray, blocks: np.ndarray) -> tuple[RidgeFit, np.ndarray]:
    """Ridge with the penalty (10 for one block of time) that forecasts left-out blocks best, and that forecast (n,)."""
    # The blocks' moments are summed once; scikit-learn's searches would refit for every pair of penalty and block.
    names = np.unique(blocks)
    parts = [_moments(D[blocks == b], y[blocks == b]) for b in names]
    total = np.sum(parts, axis=0)
    if len(names) < 2:
        alpha, left_out = 10.0, None
    else:
        paths = np.empty((len(ALPHAS), len(y)))
        for b, part in zip(names, parts, strict=True):
            mean, coefs, intercept = _solve(total - part, ALPHAS)
            paths[:, blocks == b] = coefs @ (D[blocks == b] - mean).T + intercept
        best = int(np.argmin(((paths - y) ** 2).mean(axis=1)))
        alpha, left_out = float(ALPHAS[best]), paths[best]
    mean, coefs, intercept = _solve(total, np.array([alpha]))
    fit = RidgeFit(mean, coefs[0], intercept, alpha)
    return fit, fit.predict(D) if left_out is None else left_out


def time_blocks(table: ZoneTable) -> np.ndarray:
    """Block of each row, (n_rows,) int: weeks counted from the end, days where there are less than three weeks."""
    per_day = rows_per_day(table.step)
    back = np.arange(table.n_rows)[::-1]
    width = 7 * per_day if table.n_rows >= 21 * per_day else per_day
    last = max(table.n_rows // width - 1, 0)  # a short first block joins its neighbour
    return np.minimum(back // width, last)


class StaticModel:
    """Calendar and weather: hour and day effects that shrink to their mean, weather, and its effect by hour."""

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Fit the rows whose target is known; ``left_out_`` holds out-of-block predictions of every row."""
        weather = _weather(table)
        self.weather_mean_, spread = weather.mean(axis=0), weather.std(axis=0)
        self.weather_std_ = np.where(spread > 1e-9, spread, np.inf)  # a constant column has no effect
        known, blocks = np.isfinite(target), time_blocks(table)
        least = np.inf
        for share in _HOURLY_SHARES if "T_oa" in table.inputs else (0.0,):
            D = self._design(table, share)
            fit, left_out = ridge_by_blocks(D[known], target[known], blocks[known])
            error = float(((left_out - target[known]) ** 2).mean())
            if error < least:
                least, self.fit_, self.hourly_share_ = error, fit, share
                self.left_out_ = fit.predict(D)
                self.left_out_[known] = left_out
        return self

    def predict(self, table: ZoneTable) -> np.ndarray:
        """The expectation of every row, (n_rows,)."""
        return self.fit_.predict(self._design(table, self.hourly_share_))

    def _design(self, table: ZoneTable, hourly_share: float) -> np.ndarray:
        """Hour x weekday/weekend, day of week, weather and, unless its share is 0, outdoor temperature by hour."""
        cells = one_hot(day_type_hour(table), N_CELLS)
        scaled = (_weather(table) - self.weather_mean_) / self.weather_std_
        blocks = [cells, one_hot(table.day_of_week, 7), _WEATHER_SCALE * scaled]
        if hourly_share > 0.0:  # ventilation and infiltration follow the schedule
            blocks.append(hourly_share * cells * scaled[:, -1:])
        return np.hstack(blocks)


def _weather(table: ZoneTable) -> np.ndarray:
    """Irradiances and, last, the outdoor temperature, (n_rows, n_columns)."""
    columns = [table.inputs[role] for role in irradiance_roles(table.inputs)]
    columns += [table.inputs["T_oa"]] if "T_oa" in table.inputs else []
    return np.column_stack(columns) if columns else np.empty((table.n_rows, 0))


class RidgeForecaster:
    """The static model plus a linear forecast of the deviation from it."""

    def fit(self, table: ZoneTable, target: np.ndarray, n_leads: int) -> Self:
        """Fit both regressions on a training table; the dynamic one covers leads up to ``n_leads``."""
        self.static_ = StaticModel().fit(table, target)
        left = self.static_.left_out_
        deviation, wanted = table.measured("zeta") - left, target - left
        origins = training_origins(table, n_leads)
        rows = target_rows(origins, n_leads)
        ahead = known_before(wanted, rows, table.n_rows)
        use = np.isfinite(ahead)
        self.dynamic_ = None
        if use.sum() >= 2:
            L = lag_features(table, deviation, origins, n_leads)[use]
            self.scale_ = np.maximum(np.sqrt((L**2).mean(axis=0)), 1e-12)
            self.dynamic_, _ = ridge_by_blocks(L / self.scale_, ahead[use], time_blocks(table)[rows[use]])
        return self

    def expected(self, table: ZoneTable) -> np.ndarray:
        """Calendar and weather alone."""
        return self.static_.predict(table)

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """Calendar and weather, corrected by what the known past deviates from them."""
        expected = self.expected(table)
        out = expected[held_target_rows(table, origins, n_leads)]
        if self.dynamic_ is None:
            return out
        L = lag_features(table, table.measured("zeta") - expected, origins, n_leads) / self.scale_
        # Without its intercept: no known deviation means no correction.
        return out + L @ self.dynamic_.coef


class PairRegressor:
    """Any scikit-learn regressor over the (origin, lead) pairs, on the features of the ridge."""

    def __init__(self, model: Any, random_state: int) -> None:
        self.model, self.random_state = model, random_state

    def fit(self, table: ZoneTable, target: np.ndarray, n_leads: int) -> Self:
        """Clone and fit the regressor, with every unset ``random_state`` of it set."""
        self.static_ = StaticModel().fit(table, target)
        origins = training_origins(table, n_leads)
        features = self._features(table, self.static_.left_out_, origins, n_leads)
        wanted = known_before(target, target_rows(origins, n_leads), table.n_rows)
        use = np.isfinite(wanted)
        self.mean_ = features[use].mean(axis=0)
        self.std_ = np.maximum(features[use].std(axis=0), 1e-12)
        self.regressor_ = _seeded(clone(self.model), self.random_state)
        self.regressor_.fit((features[use] - self.mean_) / self.std_, wanted[use])
        return self

    def expected(self, table: ZoneTable) -> np.ndarray:
        """Calendar and weather alone."""
        return self.static_.predict(table)

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """The regressor on every pair."""
        features = self._features(table, self.expected(table), origins, n_leads)
        flat = ((features - self.mean_) / self.std_).reshape(-1, features.shape[-1])
        values = predicted_by(self.regressor_, flat)
        if n_bad := int((~np.isfinite(values)).sum()):
            name = type(self.regressor_).__name__
            raise ValueError(f"{name} predicts NaN or inf in {n_bad} of {len(flat)} rows; it must forecast every row.")
        return values.reshape(features.shape[:2])

    @staticmethod
    def _features(table: ZoneTable, expected: np.ndarray, origins: np.ndarray, n_leads: int) -> np.ndarray:
        rows = held_target_rows(table, origins, n_leads)
        columns = [expected, clock_hour(table.time).astype(float), table.day_of_week.astype(float)]
        columns += [table.weekend.astype(float), table.inputs.get("T_oa", np.zeros(table.n_rows))]
        columns += [table.inputs[role] for role in irradiance_roles(table.inputs)]
        here = np.stack([c[rows] for c in columns], axis=-1)
        lead = np.broadcast_to(np.arange(1, n_leads + 1) * table.step_hours, rows.shape)[..., None]
        past = lag_features(table, table.measured("zeta") - expected, origins, n_leads)
        return np.concatenate([here, lead, past], axis=-1)


def _seeded(model: Any, seed: int) -> Any:
    """The model with every ``random_state`` that is None set to the seed."""
    unset = {k: seed for k, v in model.get_params().items() if k.split("__")[-1] == "random_state" and v is None}
    return model.set_params(**unset)


def training_origins(table: ZoneTable, n_leads: int) -> np.ndarray:
    """All rows as origins; where pairs would be too many, every so many of them, but some of every hour of the day."""
    stride = max(-(-table.n_rows * n_leads // _MOST_PAIRS), 1)
    while gcd(stride, rows_per_day(table.step)) > rows_per_hour(table.step):
        stride += 1
    return np.arange(0, max(table.n_rows - 1, 1), stride)
