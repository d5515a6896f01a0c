"""A simulated house of three rooms in a row, with doors open between them, for tests of several zones."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd

ZONES = ("kitchen", "hall", "study")
DOORS = [("kitchen", "hall"), ("hall", "study")]
#: capacitance of the air and of the walls [kWh/K], conductance outside, to the walls and through a door [kW/K]
C_AIR, C_WALL, UA, UW, DOOR = 0.5, 4.0, 0.06, 0.5, 0.3


@cache
def make_rooms(n_days: int = 24, seed: int = 0, step: float = 1.0) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Inputs with measured temperatures, and the temperatures by zone; set-points of each room are its own."""
    rng, n = np.random.default_rng(seed), int(n_days * 24 / step)
    index = pd.date_range("2024-01-08", periods=n, freq=pd.Timedelta(hours=step))
    hour, day = index.hour.to_numpy() + index.minute.to_numpy() / 60.0, np.arange(n) * step / 24.0
    T_oa = 3.0 + 4.0 * np.sin(2 * np.pi * (hour - 9.0) / 24.0) + 2.0 * np.sin(2 * np.pi * day / 6.0)
    q_sol = np.maximum(0.0, np.sin(np.pi * (hour - 7.0) / 10.0)) * (hour > 7) * (hour < 17) * rng.uniform(0.1, 0.5, n)
    at_home = ((hour > 7) & (hour < 9)) | (hour > 17)
    air, wall = np.full(3, 20.0), np.full(3, 19.0)
    T, Q = np.empty((n, 3)), np.empty((n, 3))
    wanted = np.array([21.0, 18.0, 20.0]) - np.array([3.0, 1.0, 4.0]) * (hour[:, None] < np.array([6.0, 7.0, 8.0]))
    wanted[:, 2] += 2.0 * (rng.random(n_days)[day.astype(int)] > 0.5)  # the study is warmed on some days
    gains = np.column_stack([0.5 * at_home, 0.05 + 0.0 * hour, 0.3 * (hour > 9) * (hour < 16)])
    gains *= rng.uniform(0.6, 1.4, (n_days, 3))[day.astype(int)]
    n_inner = round(12 * step)
    inner = step / n_inner
    for k in range(n):
        T[k] = air
        Q[k] = np.clip(3.0 * (wanted[k] - air), 0.0, 2.5)
        for _ in range(n_inner):
            exchanged = DOOR * np.array([air[1] - air[0], air[0] + air[2] - 2 * air[1], air[1] - air[2]])
            heat = UA * (T_oa[k] - air) + UW * (wall - air) + Q[k] + gains[k] + 2.0 * q_sol[k] + exchanged
            air, wall = air + inner * heat / C_AIR, wall + inner * UW * (air - wall) / C_WALL
    y = pd.DataFrame(T, index, list(ZONES))
    X = pd.DataFrame({"T_oa": T_oa, "q_sol": q_sol}, index)
    for j, zone in enumerate(ZONES):
        X[f"Q_hvac_{zone}"], X[f"T_za_{zone}"] = Q[:, j], T[:, j]
    return X, y
