"""Forecasts by any scikit-learn regressor, fitted over (origin, lead) pairs on calendar, weather and lags."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from sklearn.base import clone

from .._calendar import clock_hour
from .._table import ZoneTable
from .features import held_target_rows, irradiance_roles, known_before, target_rows
from .ridge import StaticModel, lag_features, training_origins


class PairRegressor:
    """Any scikit-learn regressor over the (origin, lead) pairs, on the features of the ridge."""

    def __init__(self, model: Any, random_state: int) -> None:
        self.model = model
        self.random_state = random_state

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
        return np.asarray(self.regressor_.predict(flat), dtype=np.float64).reshape(features.shape[:2])

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
