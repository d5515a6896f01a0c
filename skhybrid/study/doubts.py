"""Reasons to doubt a model: inputs beyond its training, growing errors, parameters at the end of their range."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import plant_roles
from .._warnings import percent
from ..exceptions import TooFewDaysError
from ..logs.conversion import contract_unit
from .log_split import StudyData, inputs_of, without_setpoints

_MARGIN = 0.05  # of a range, beyond which a value lies outside of it
OUTSIDE = 0.1  # of a day beyond what training covered, from which on it is a reason to doubt
_HELD = "the temperature to hold"
_END = 1e-3  # distance from the end of a parameter's range, as a share of the range [of the logarithm]
_DRIFTS = {
    "level": "at all hours, as after a change of season or plant",
    "schedule": "at certain hours, as after a change of use",
    "quiet": "while the room hardly moved, as in a closure",
}
#: nodes of the networks of the catalogue, and boundaries, as a reader knows them
_NODES = {
    "za": "the room", "w": "the walls", "e": "the walls", "m": "the furniture and inner walls", "h": "the heater",
    "s": "the sensor", "T_oa": "outdoors",
}  # fmt: skip
_INPUTS = {
    "T_oa": "the outdoor temperature", "q_sol": "the sun", "Q_hvac": "the heat of the plant",
    "u_heat": "the heating stage", "u_cool": "the cooling stage",
}  # fmt: skip
_QUANTITIES = (
    (r"capacitance of node (\S+)", "heat capacity of {}"),
    (r"resistance between (\S+) and (\S+)", "thermal resistance between {} and {}"),
    (r"share of (.+) to (\S+)", "share of {} to {}"),
    (r"effective window area for \S+", "solar aperture"),
)


class Doubts(NamedTuple):
    """Reasons to take care, apart from errors and intervals."""

    temperature: list[str]
    load: list[str]

    @classmethod
    def of(
        cls, model: Any, later: Any, data: StudyData, identification: Any = None, *, setpoints_known: bool = False
    ) -> Doubts:
        """Reasons to doubt a fitted predictor over the rows ``later`` than its training, and the day to come.

        ``identification`` gives the capacities of stages, where it is another model.  With ``setpoints_known`` the day
        to come is known by weather and set-points; else by its heat, or for the load by the temperature to hold.
        """
        days = drift_days(model, later)
        ends = at_ends(model.gray_box_)
        of_capacities = [] if identification is None or identification is model.gray_box_ else at_ends(identification)
        ranges, ahead = ranges_of(inputs_of(data.train)), inputs_of(data.future)
        of_load = ahead.drop(columns=plant_roles(ahead))
        if setpoints_known:
            ahead = of_load
        else:
            ahead, of_load = without_setpoints(ahead), without_setpoints(of_load)
            of_load = of_load.assign(**{_HELD: data.setpoint.loc[ahead.index]})
            ranges |= ranges_of(data.train[["T_za"]].set_axis([_HELD], axis=1))
        day = f"the last complete day, {ahead.index[0]:%Y-%m-%d}," if data.held_out else "the day to come"
        return cls(
            [*drifted(days), *day_beyond(ahead, ranges, day), *ends],
            [*drifted(days, "its temperature errors"), *day_beyond(of_load, ranges, day), *ends, *of_capacities],
        )


def ranges_of(rows: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each column."""
    return {str(role): (float(rows[role].min()), float(rows[role].max())) for role in rows}


def beyond_training(rows: pd.DataFrame, ranges: Mapping[str, tuple[float, float]]) -> pd.DataFrame:
    """True where a column lies beyond the range that training covered, for the columns that have one."""
    out = {}
    for role, (low, high) in ranges.items():
        if role in rows:
            margin = _MARGIN * (high - low)
            out[role] = (rows[role] < low - margin) | (rows[role] > high + margin)
    return pd.DataFrame(out, index=rows.index)


def day_beyond(
    rows: pd.DataFrame, ranges: Mapping[str, tuple[float, float]], day: str = "the day to come"
) -> list[str]:
    """A reason where much of a day lies beyond what training covered, with the columns that do."""
    beyond = beyond_training(rows, ranges)
    share = float(beyond.any(axis=1).mean()) if len(beyond) else 0.0
    if not share > OUTSIDE:
        return []
    which = "; ".join(_excess(rows[role], *ranges[str(role)]) for role in beyond if beyond[role].any())
    return [f"{percent(share)} of {day} lies beyond what training covered ({which})"]


def _excess(values: pd.Series, low: float, high: float) -> str:
    reached = values.min() if low - values.min() > values.max() - high else values.max()
    name = _INPUTS.get(str(values.name), str(values.name))
    unit = "degC" if "temperature" in name else contract_unit(str(values.name)).replace("-", "")
    return f"{name} reaches {f'{reached:.3g} {unit}'.strip()}, training had {low:.3g} to {high:.3g}"


def drift_days(model: Any, rows: Any = None) -> pd.DataFrame:
    """The drift of a predictor day by day over rows, or over those that it has taken in; empty if it cannot tell."""
    try:
        return model.drift(rows)
    except TooFewDaysError:
        return pd.DataFrame()


def drifted(days: pd.DataFrame, whose: str = "its errors") -> list[str]:
    """A reason where errors have grown by the last of the days."""
    if days.empty or not days["drifted"].iloc[-1]:
        return []
    last = days.iloc[-1]
    return [f"{whose} have grown since {last['since']:%Y-%m-%d}, {_DRIFTS[last['kind']]}"]


def at_ends(gray_box: Any) -> list[str]:
    """A reason for each parameter of a fitted network that is at an end of its range."""
    return [
        f"the {in_words(p.description)} ({p.name}) is at the {end} end of its range: not identified"
        for p, end in ends_of(gray_box)
    ]


def ends_of(gray_box: Any) -> list[tuple[Any, str]]:
    """The parameters of a fitted network that are at the "lower" or "upper" end of their range."""
    theta = gray_box.theta_
    found = getattr(gray_box, "identifiability_", None)
    searched = [p for p in getattr(gray_box, "parameters_", gray_box.network_.parameters()) if p.name in theta]
    named = getattr(found, "at_bound", ()) if found is not None else _near_ends(searched, theta)
    nearer = (theta[p.name] - p.lower < p.upper - theta[p.name] for p in searched)
    ends = ["lower" if lower else "upper" for lower in nearer]
    return [(p, end) for p, end in zip(searched, ends, strict=True) if p.name in named]


def _near_ends(searched: list[Any], theta: pd.Series) -> list[str]:
    """Positive parameters near an end of their range by their logarithm, or beyond it."""
    near = []
    for p in searched:
        low, high, value = (np.log(max(x, 1e-300)) for x in (p.lower, p.upper, theta[p.name]))
        if p.lower > 0.0 and min(value - low, high - value) < _END * (high - low):
            near.append(p.name)
    return near


def in_words(description: str) -> str:
    """The description of a network's parameter for those who do not know its nodes."""
    for pattern, words in _QUANTITIES:
        if found := re.fullmatch(pattern, description):
            return words.format(*(_NODES.get(name, name) for name in found.groups()))
    return description
