"""Findings of a diagnosis: the meaning of a model's errors, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import stats

from ..._time import rows_per_day
from .residual_tests import Z95

#: heat flow that is badly described where the errors follow an input
_MEANING = {
    "T_oa": "heat that leaves with the outdoor temperature (a resistance to it, ventilation)",
    "q_sol": "solar gain (window area, its share to the air, a shaded facade)",
    "u_heat": "heating (its capacity, the lag of its emitter, or a thermostat that acts within a step)",
    "u_cool": "cooling (its capacity, its lag, or a thermostat that acts within a step)",
    "Q_": "the measured heat (its lag, or the node that it enters)",
    "T_": "heat to this neighbour",
    "u_": "this stage (its capacity or its lag)",
}
_WEAK = 0.1  # a correlation below this is real where rows are many, and still of little weight


@dataclass(frozen=True)
class ErrorPattern:
    """Tables of a model's errors, in rows; :meth:`findings` reads them."""

    z: np.ndarray
    index: pd.Index
    step: pd.Timedelta
    acf: pd.DataFrame
    spectrum: pd.DataFrame
    crossed: pd.DataFrame
    tests: pd.DataFrame

    def findings(self) -> tuple[str, ...]:
        found = [*self._neighbours(), *self._day(), *self._spectrum(), *self._inputs()]
        if not found:
            found = ["the errors are white and independent of the inputs: nothing is left to explain."]
        return (*found, *self._size(), *self._clock(), *self._tails())

    def _neighbours(self) -> list[str]:
        if self.tests.loc["white (Ljung-Box)", "passed"]:
            return []
        outside = self.acf.index[self.acf["acf"].abs() > self.acf["band"]]
        near = self.acf["acf"].loc[: max(int(outside[0]), 4) if len(outside) else 1]
        first = int(near.index[int(near.abs().to_numpy().argmax())])
        r = float(near.loc[first])
        at = f"(r = {r:.2f} at {_spell(first * self.step)})"
        if first > 4:
            return [f"errors are correlated at a longer lag {at}: look for what repeats with this period."]
        weak = "slightly " if abs(r) < _WEAK else ""
        if r > 0:
            what = (
                "the disturbance model is not quite that of these rows."
                if weak
                else "the model lacks a heat flow that comes and goes, so its standard errors are too small; add a "
                "disturbance state or a node."
            )
            return [f"successive errors are {weak}positively correlated {at}: {what}"]
        return [
            f"successive errors are {weak}negatively correlated {at}: the model follows the noise of the thermometer; "
            "it takes the disturbance to be too quick, or the measurement to be too accurate."
        ]

    def _day(self) -> list[str]:
        day = rows_per_day(self.step)
        near = self.acf.loc[max(1, day - 1) : day + 1]
        high = near[near["acf"] > 2.0 * near["band"]]
        if high.empty:
            return []
        return [
            f"errors repeat from day to day (r = {high['acf'].max():.2f} at 24 h): a daily schedule of people or "
            "equipment is not in the model; PeriodicDisturbanceID learns one."
        ]

    def _spectrum(self) -> list[str]:
        if self.tests.loc["white (periodogram)", "passed"]:
            return []
        gap = self.spectrum["cumulative"] - self.spectrum["expected"]
        place = float(gap.index[int(gap.abs().to_numpy().argmax())])
        period = _spell(self.step / place)
        if gap.abs().max() == gap.max():
            return [f"errors vary too much over periods longer than {period}: slow heat flows are missing."]
        return [f"errors vary too much over periods shorter than {period}: noise or cycling within the step."]

    def _inputs(self) -> list[str]:
        out = []
        for name in self.crossed.columns.unique("input"):
            if self.tests.loc[f"independent of {name}", "passed"]:
                continue
            part = self.crossed[name].loc[1:]
            t = part["t"].abs().to_numpy()
            worst = int(np.nanargmax(t))
            lags, r = _segment(t > Z95, worst) + 1, float(part["ccf"].iloc[worst])
            first, last = _spell(int(lags[0]) * self.step), _spell(int(lags[-1]) * self.step)
            at = f"at a lag of {first}" if first == last else f"at lags of {first} to {last}"
            out.append(
                f"errors are {'weakly ' if abs(r) < _WEAK else ''}correlated with {name} {at} (r = {r:.2f}): "
                f"{_meaning(name)} is not well described, or something unmeasured keeps the same hours."
            )
        return out

    def _size(self) -> list[str]:
        known = self.z[np.isfinite(self.z)]
        ratio, out = float(np.sqrt(np.mean(known**2))), []
        if not 0.8 < ratio < 1.25:
            out.append(f"errors are {ratio:.2g} times as large as the model says: its error bars are off by that.")
        drift = float(known.mean())
        if abs(drift) > 0.1 and abs(drift) * np.sqrt(len(known)) > 4.0:
            out.append(f"the temperature is on average {'above' if drift > 0 else 'below'} what is predicted.")
        return out

    def _clock(self) -> list[str]:
        if not isinstance(self.index, pd.DatetimeIndex):
            return []
        quarter = np.asarray(self.index.hour) // 6
        seen = np.isfinite(self.z)
        count = np.bincount(quarter[seen], minlength=4)
        if not count.all():
            return []
        block = np.bincount(quarter[seen], self.z[seen] ** 2) / count
        if not block.max() > 3.0 * block.min():
            return []
        hour = 6 * int(block.argmax())
        return [
            f"errors are {np.sqrt(block.max() / block.min()):.1f} times as large from {hour} to {hour + 6} h as in the "
            "quietest quarter of the day: a model whose variance changes with time (PeriodicDisturbanceID) would weigh "
            "the quiet hours more."
        ]

    def _tails(self) -> list[str]:
        excess = float(stats.kurtosis(self.z[np.isfinite(self.z)]))
        if self.tests.loc["normal (Jarque-Bera)", "passed"] or excess < 3.0:
            return []
        return [f"a few errors are very large (excess kurtosis {excess:.1f}): single events, such as an open window."]


def _spell(span: pd.Timedelta) -> str:
    minutes = span / pd.Timedelta("1min")
    return f"{minutes:.3g} min" if minutes < 120 else f"{minutes / 60:.3g} h"


def _segment(high: np.ndarray, place: int) -> np.ndarray:
    """The unbroken run of high values around a place; one low value does not break it."""
    first = last = place
    while first > 0 and high[max(0, first - 2) : first].any():
        first -= 1 if high[first - 1] else 2
    while last < len(high) - 1 and high[last + 1 : last + 3].any():
        last += 1 if high[last + 1] else 2
    return np.arange(first, last + 1)


def _meaning(name: str) -> str:
    longest = max((key for key in _MEANING if name.startswith(key)), key=len, default="")
    return _MEANING.get(longest, "its effect")
