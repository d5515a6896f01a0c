"""Baselines of the forecast benchmark that the package does not ship: rules, a plain gray box, an oracle.

Each has ``fit(X, y)`` and ``predict_from(X, origins, horizon)`` and reads ``T_za`` of X up to an origin only.
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import pandas as pd
from _forecast_data import Truth
from sklearn.base import BaseEstimator, RegressorMixin, clone

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
