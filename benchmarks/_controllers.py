"""Controllers of a zone: its thermostat, rules of pre-heating, and plans of cost and comfort by linear programming."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
import pandas as pd
from _control_plant import LEAST_BAND, STEP
from scipy.optimize import linprog

HOUR, DAY = 4, 96
HOURS = 0.25  # of a step
#: ct per kWh of heat or cold, otherwise and in hours of peak on working days (24 and 48 ct of electricity at a
#: coefficient of performance of 3); ct per K h beside the band
PRICE, PEAK_PRICE, COMFORT = 8.0, 16.0, 50.0
PEAKS = {"winter": ((6, 10), (17, 21)), "summer": ((13, 19),)}
#: grid of rules: hours before people or a peak come, and by how much the set-point goes into the band then [K]
LEADS, RAISES = (0, 1, 2, 3, 4), (0.0, 0.5, 1.0)
_RUNNING = 0.01  # least heat of a plan that counts as heating [kW]


# ------------------------------------------------------------------------------------------------------ what is judged
def prices(index: pd.DatetimeIndex, season: str) -> np.ndarray:
    """Price of a kWh over the step of each row [ct]."""
    peak = np.zeros(len(index), dtype=bool)
    for begin, end in PEAKS[season]:
        peak |= (index.hour >= begin) & (index.hour < end)
    return np.where(peak & (index.day_of_week < 5), PEAK_PRICE, PRICE)


def discomfort(T: np.ndarray, band: np.ndarray) -> np.ndarray:
    """K h beside the band (n, 2) of each step, by the temperature at its end."""
    return (np.maximum(band[:, 0] - T, 0.0) + np.maximum(T - band[:, 1], 0.0)) * HOURS


def judge(log: pd.DataFrame, band: np.ndarray, price: np.ndarray) -> dict[str, float]:
    """Cost [ct], energy [kWh] and discomfort [K h] of rows."""
    energy = log["Q_hvac"].abs().to_numpy() * HOURS
    return {
        "cost": float(price @ energy),
        "energy": float(energy.sum()),
        "K h": float(discomfort(log["T_end"].to_numpy(), band).sum()),
    }


# --------------------------------------------------------------------------------------------------------------- rules
def rule(setpoints: np.ndarray, price: np.ndarray, season: str, lead: int, shift: float) -> np.ndarray:
    """Set-points (n, 2) that are early by hours: those of the day before people come, and moved before a peak."""
    side, sign = (0, 1.0) if season == "winter" else (1, -1.0)
    own = setpoints[:, side]
    comes = np.diff(sign * own, prepend=sign * own[0]) > 0.5
    begins = comes | (np.diff(price, prepend=price[0]) > 0.0)
    n, used = len(own), sign * (sign * own).max()
    early = np.zeros(n, dtype=bool)
    for row in np.flatnonzero(begins):
        early[max(row - lead * HOUR, 0) : row] = True
    out = setpoints.copy()
    # people who are not there on the day of a peak need nothing
    ahead = pd.Series(sign * own[::-1]).rolling((lead + 1) * HOUR, min_periods=1).max().to_numpy()[::-1]
    followed = ahead >= sign * used - 1e-6
    out[early & followed, side] = used + sign * shift
    if side == 0:
        out[:, 1] = np.maximum(out[:, 1], out[:, 0] + LEAST_BAND)
    else:
        out[:, 0] = np.minimum(out[:, 0], out[:, 1] - LEAST_BAND)
    return out


def tune(try_rule: Callable[[int, float], float]) -> tuple[int, float]:
    """The rule of the grid that has the lowest J on the training weeks, which ``try_rule`` runs."""
    grid = [(lead, shift) for lead in LEADS for shift in RAISES if lead or not shift]
    return min(grid, key=lambda one: try_rule(*one))


# --------------------------------------------------------------------------------------------------------------- plans
class Prediction(NamedTuple):
    """A forecast from now on by the rows ahead: ``T = free + gain @ q``, the first row being the present."""

    free: np.ndarray  # (H,) degC
    gain: np.ndarray  # (H, H) K/kW


class Plan(NamedTuple):
    """Heat of a plan over the step of each row but the last [kW], and the temperature at the end of it [degC]."""

    heat: np.ndarray
    temperature: np.ndarray


def blocks_of(n: int) -> np.ndarray:
    """(n,) number of the block of equal heat that a step belongs to: single steps for 4 h, then hours."""
    steps = np.arange(n)
    return np.where(steps < 4 * HOUR, steps, 4 * HOUR + (steps - 4 * HOUR) // HOUR)


def plan(
    prediction: Prediction, band: np.ndarray, price: np.ndarray, limits: tuple[float, float], weight: float = COMFORT
) -> Plan:
    """The cheapest heat of the next steps, cost and ``weight`` times the K h beside the band together.

    The band (n, 2) and the price (n,) are those of n steps, of which the prediction has n + 1 rows.
    """
    n = len(price)
    block = blocks_of(n)
    last = np.flatnonzero(np.append(np.diff(block) > 0, True))  # step that ends a block
    held = (block[:, None] == np.arange(len(last))).astype(float)
    rows = last + 1
    gain, free = prediction.gain[rows][:, :n] @ held, prediction.free[rows]
    hours = held.sum(axis=0) * HOURS
    cost = price @ held * HOURS
    slack = -np.eye(len(last))
    A = np.block([[-gain, gain, slack], [gain, -gain, slack]])
    b = np.concatenate([free - band[last, 0], band[last, 1] - free])
    m = len(last)
    bounds = [(0.0, max(limits[1], 0.0))] * m + [(0.0, max(-limits[0], 0.0))] * m + [(0.0, None)] * m
    found = linprog(np.concatenate([cost, cost, weight * hours]), A_ub=A, b_ub=b, bounds=bounds, method="highs")
    if found.x is None:
        raise RuntimeError(f"HiGHS found no plan: {found.message}")
    heat = held @ (found.x[:m] - found.x[m : 2 * m])
    return Plan(heat, (prediction.free + prediction.gain[:, :n] @ heat)[1:])


def tracked(heat: float, T: float, band: np.ndarray) -> tuple[float, float]:
    """Set-points of a step whose plan is some heat [kW] and a temperature [degC] at its end.

    A plan leaves the band where the plant would not do, which the thermostat may prove wrong.
    """
    low, high = float(band[0]), float(band[1])
    if heat > _RUNNING:
        T = max(T, low)
        return T, max(high, T + LEAST_BAND)
    if heat < -_RUNNING:
        T = min(T, high)
        return min(low, T - LEAST_BAND), T
    return low, max(high, low + LEAST_BAND)


class Forecaster(Protocol):
    """Takes in rows as they become known and predicts from the present on."""

    def observe(self, rows: pd.DataFrame) -> None: ...

    def predict(self, ahead: pd.DataFrame, T: float) -> Prediction: ...


class Interface:
    """A model of the package, through ``update`` and ``affine_forecast``."""

    def __init__(self, model, member: str | None = None, hold: bool = False) -> None:
        self.model, self.hold = deepcopy(model), hold
        self.member = {} if member is None else {"member": member}

    def observe(self, rows: pd.DataFrame) -> None:
        self.model.update(rows)

    def predict(self, ahead: pd.DataFrame, T: float) -> Prediction:
        found = self.model.affine_forecast(None, ahead, inputs=("Q_hvac",), T_za=T, **self.member)
        gain, free = found.gain[:, :, 0], found.free
        if self.hold:  # the unmeasured heat of now, in the place of its forecast
            free = free + gain @ (found.zeta[0] - found.zeta)
        return Prediction(free, gain)


class Impulse:
    """An :class:`~skhybrid.ARXRegressor`, which is affine in its inputs, by its impulse response."""

    HISTORY = 8 * DAY

    def __init__(self, model) -> None:
        self.model, self.rows = model, pd.DataFrame()
        self.response: np.ndarray | None = None

    def observe(self, rows: pd.DataFrame) -> None:
        self.rows = pd.concat([self.rows, rows])[-self.HISTORY :]

    def predict(self, ahead: pd.DataFrame, T: float) -> Prediction:
        n, now = len(ahead), len(self.rows)
        table = pd.concat([self.rows, ahead.assign(Q_hvac=0.0, T_za=np.nan)])[self.rows.columns]
        table.iloc[now, table.columns.get_loc("T_za")] = T
        free = self._path(table, now, n)
        if self.response is None:
            pushed = table.copy()
            pushed.iloc[now, pushed.columns.get_loc("Q_hvac")] = 1.0
            self.response = self._path(pushed, now, n) - free
        lag = np.arange(n)[:, None] - np.arange(n)
        return Prediction(free, np.where(lag > 0, self.response[np.maximum(lag, 0)], 0.0))

    def _path(self, table: pd.DataFrame, now: int, n: int) -> np.ndarray:
        ahead = self.model.predict_from(table, [now], (n - 1) * STEP)[0]
        return np.append(table["T_za"].iloc[now], ahead[: n - 1])


@dataclass
class Planner:
    """A policy of a zone that plans anew every hour and lets the thermostat track the planned temperatures."""

    forecaster: Forecaster
    inputs: pd.DataFrame  # of the year by row, without what is measured
    band: np.ndarray  # (N, 2)
    price: np.ndarray  # (N,)
    limits: tuple[float, float]
    begin: int  # row from which it decides; before it the thermostat does
    weather: Callable[[int, int], pd.DataFrame] | None = None  # of rows from one on, as forecast there
    n: int = DAY
    measured: list[tuple[float, float]] = field(default_factory=list)  # of T and heat since the last plan
    kept: list[tuple[int, Prediction]] = field(default_factory=list)
    seconds: list[tuple[float, float]] = field(default_factory=list)  # of the forecast and of the plan
    present: Plan | None = None
    last: float = np.nan

    def __call__(self, row: int, T: float, delivered: float) -> tuple[float, float]:
        if row < self.begin:
            heat, cool = self.band[row if row >= 0 else -1 - row]
            return float(heat), float(cool)
        if row > self.begin:
            self.measured.append((self.last, delivered))
        self.last = T
        since = (row - self.begin) % HOUR
        if since == 0:
            self._renew(row, T)
        return tracked(self.present.heat[since], self.present.temperature[since], self.band[row])

    def _renew(self, row: int, T: float) -> None:
        begin = time.process_time()
        if self.measured:
            T_za, heat = np.array(self.measured).T
            known = slice(row - len(heat), row)
            self.forecaster.observe(self.inputs.iloc[known].assign(Q_hvac=heat, T_za=T_za))
            self.measured.clear()
        ahead = self.inputs.iloc[row : row + self.n + 1]
        if self.weather is not None:
            ahead = ahead.assign(**self.weather(row, len(ahead)))
        prediction = self.forecaster.predict(ahead, T)
        middle = time.process_time()
        steps = slice(row, row + self.n)
        self.present = plan(prediction, self.band[steps], self.price[steps], self.limits)
        self.seconds.append((middle - begin, time.process_time() - middle))
        if len(self.seconds) % 6 == 1:
            self.kept.append((row, prediction))


def closed_loop_error(kept: Sequence[tuple[int, Prediction]], heat: np.ndarray, T: np.ndarray) -> dict[str, float]:
    """RMSE [K] of kept predictions under the heat that was delivered (N,), against the temperatures (N,) of rows."""
    errors = [
        prediction.free + prediction.gain @ heat[row : row + len(prediction.free)] - T[row : row + len(prediction.free)]
        for row, prediction in kept
    ]
    whole = np.array([e for e in errors if np.isfinite(e).all()])
    if not len(whole):
        return {}
    leads = {"1 h": HOUR, "6 h": 6 * HOUR, "24 h": DAY}
    found = {f"RMSE {name}": float(np.sqrt(np.mean(whole[:, lead] ** 2))) for name, lead in leads.items()}
    return found | {"RMSE": float(np.sqrt(np.mean(whole[:, 1:] ** 2)))}
