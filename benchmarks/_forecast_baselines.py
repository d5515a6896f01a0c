"""Baselines of the forecast benchmark that the package does not ship: rules, boosting, a plain gray box, an oracle.

Each has ``fit(X, y)`` and ``predict_from(X, origins, horizon)`` and reads ``T_za`` of X up to an origin only.
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import pandas as pd
from _forecast_data import Truth
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.ensemble import HistGradientBoostingRegressor

from skhybrid._time import rows_of
from skhybrid.datasets._office import true_system


class _WithPast(RegressorMixin, BaseEstimator):
    """Base class that keeps the last day of training as history of an X that follows it."""

    def fit(self, X: pd.DataFrame, y: Any) -> Self:
        """Keep the end of the training rows."""
        self.step_ = X.index[1] - X.index[0]
        self.day_ = rows_of("1D", self.step_)
        self.past_ = X.assign(T_za=np.asarray(y, dtype=np.float64)).tail(self.day_ + 1)
        return self

    def _joined(self, X: pd.DataFrame) -> tuple[pd.DataFrame, int]:
        """X with the kept rows before it if it follows them, and the number of these rows."""
        if X.index[0] == self.past_.index[-1] + self.step_:
            return pd.concat([self.past_, X]), len(self.past_)
        return X, 0


class Yesterday(_WithPast):
    """The temperature of 24 hours before."""

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Repeat the last known day; before the first row, the first temperature."""
        joined, before = self._joined(X)
        known = joined["T_za"].ffill().to_numpy()
        back = np.arange(rows_of(horizon, self.step_)) % self.day_ + 1 - self.day_
        return known[np.maximum(np.asarray(origins)[:, None] + before + back, 0)]


class Held(_WithPast):
    """The temperature at the origin."""

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Hold the last known temperature."""
        known = X["T_za"].ffill().to_numpy()[np.asarray(origins)]
        return np.repeat(known[:, None], rows_of(horizon, self.step_), axis=1)


class LeftAlone(RegressorMixin, BaseEstimator):
    """A gray box without a forecast of the disturbance: the network runs from the filtered state with the known inputs.

    Parameters
    ----------
    gray_box : estimator
        An identification of the package.
    """

    def __init__(self, gray_box: Any) -> None:
        self.gray_box = gray_box

    def fit(self, X: pd.DataFrame, y: Any) -> Self:
        """Identify."""
        self.gray_box_ = clone(self.gray_box).fit(X, y)
        return self

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Drive the network without unmeasured heat."""
        leads = rows_of(horizon, self.gray_box_.sampling_time_)
        return self.gray_box_.drive(X, origins, np.zeros((len(origins), leads)))

    def load_from(self, X: pd.DataFrame, setpoint: Any, origins: np.ndarray, limits: Any = None) -> pd.DataFrame:
        """The load without unmeasured heat, from the states at the origins."""
        leads = int(np.diff(np.append(origins, len(X))).max())
        return self.gray_box_.required_heat(X, setpoint, origins, np.zeros((len(origins), leads)), limits=limits)


class Boosted(_WithPast):
    """Gradient boosting of the change of temperature since the origin, over (origin, lead) pairs.

    The features that a data scientist would choose: lead, hour and day of the target, the change of temperature before
    the origin, the temperature at the target's time a day earlier, and means of every input from origin to target.
    """

    def __init__(self, every: str = "1h", random_state: int | None = None) -> None:
        self.every = every
        self.random_state = random_state

    def fit(self, X: pd.DataFrame, y: Any) -> Self:
        """Train on one origin per ``every``, if its next day lies in X."""
        super().fit(X, y)
        self.inputs_ = [c for c in X if c != "T_za"]
        rows = X.assign(T_za=np.asarray(y, dtype=np.float64))
        origins = np.arange(self.day_, len(X) - self.day_, rows_of(self.every, self.step_))
        features, origin_T = self._features(rows, origins, self.day_)
        target = rows["T_za"].to_numpy()[origins[:, None] + np.arange(1, self.day_ + 1)] - origin_T[:, None]
        seen = np.isfinite(target).ravel()
        booster = HistGradientBoostingRegressor(max_iter=300, learning_rate=0.06, random_state=self.random_state)
        self.booster_ = booster.fit(features[seen], target.ravel()[seen])
        return self

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Forecast from each origin."""
        joined, before = self._joined(X)
        leads = rows_of(horizon, self.step_)
        features, origin_T = self._features(joined, np.asarray(origins) + before, leads)
        return origin_T[:, None] + self.booster_.predict(features).reshape(len(origins), leads)

    def _features(self, rows: pd.DataFrame, origins: np.ndarray, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """(n_origins * n_leads, n_features), and the temperature at each origin."""
        T = rows["T_za"].ffill().to_numpy()
        leads = np.arange(1, n_leads + 1)
        targets = np.minimum(origins[:, None] + leads, len(rows) - 1)
        hour = (rows.index.hour + rows.index.minute / 60.0).to_numpy()
        here, hourly = T[origins][:, None], rows_of("1h", self.step_)

        def at(back: np.ndarray) -> np.ndarray:
            """(n_origins, n_leads) temperature ``back`` rows before each origin, relative to that of the origin."""
            wanted = origins[:, None] - back
            return np.where(wanted >= 0, T[np.maximum(wanted, 0)], np.nan) - here

        columns = [np.broadcast_to(leads, targets.shape), hour[targets], rows.index.day_of_week.to_numpy()[targets]]
        columns += [np.broadcast_to(here, targets.shape), at(np.broadcast_to(-leads % self.day_, targets.shape))]
        columns += [at(np.full_like(targets, lag * hourly)) for lag in (1, 3, 6)]
        for name in self.inputs_:
            total = np.concatenate([[0.0], rows[name].to_numpy().cumsum()])
            for span in (n_leads, 3 * hourly):  # an input acts over the step after its stamp
                first = np.maximum(targets - span, origins[:, None])
                columns.append((total[targets] - total[first]) / np.maximum(targets - first, 1))
        return np.stack(columns, axis=-1).reshape(targets.size, -1), T[origins]


class Oracle(RegressorMixin, BaseEstimator):
    """The true network from the true state at the origin, under the hour-of-week mean of the true training gains.

    Parameters
    ----------
    truth : Truth
        Of training and later rows.
    knows_air : bool
        False: the mean of all unmeasured heat.  True: the mean of the heat of people and devices; the heat of outdoor
        air then comes from the mean conductance of that hour of the week, so that a change of season does not make the
        oracle wrong.
    """

    def __init__(self, truth: Truth, knows_air: bool = False) -> None:
        self.truth = truth
        self.knows_air = knows_air

    def fit(self, X: pd.DataFrame, y: Any) -> Self:
        """Average the true gains of the training rows by hour of the week."""
        self.step_ = X.index[1] - X.index[0]
        air = self.truth.air[X.index] if self.knows_air else 0.0 * self.truth.air[X.index]
        across = X["T_oa"] - self.truth.states.loc[X.index, "T_za"]
        hours = hour_of_week(X.index)
        self.level_ = (self.truth.heat_gain[X.index] - air).groupby(hours).mean().reindex(range(168)).to_numpy()
        sums = pd.DataFrame({"heat": air * across, "square": across**2}).groupby(hours).sum().reindex(range(168))
        self.conductance_ = (sums["heat"] / sums["square"]).to_numpy()
        return self

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Simulate from the true states at the origins."""
        A, B = true_system(self.step_ / pd.Timedelta("1h"))
        plant = [X[role].to_numpy() for role in ("T_oa", "q_sol", "u_heat", "u_cool")]
        hours = hour_of_week(X.index)
        states = self.truth.states.loc[X.index].to_numpy()[np.asarray(origins)]
        out = np.empty((len(origins), rows_of(horizon, self.step_)))
        for lead in range(out.shape[1]):
            rows = np.minimum(np.asarray(origins) + lead, len(X) - 1)
            gain = self.level_[hours[rows]] + self.conductance_[hours[rows]] * (plant[0][rows] - states[:, 1])
            states = states @ A.T + np.column_stack([*(p[rows] for p in plant), gain]) @ B.T
            out[:, lead] = states[:, 1]
        return out


def hour_of_week(index: pd.DatetimeIndex) -> np.ndarray:
    """0 is the hour from Monday 00:00 on."""
    return (index.day_of_week * 24 + index.hour).to_numpy()
