"""Scores of the archived forecasts of a zone, and the verdicts on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._clock import on_clock_of
from .._table import SETPOINT_ROLES, is_stage, plant_roles
from .._warnings import percent
from ..study.doubts import OUTSIDE, at_ends, drifted
from ..study.verdict import NO_SCALE, Verdict, compare_errors, judge
from ..study.zone_loads import load_of
from .forecast_archive import BEYOND
from .zone_model import ZoneModel

_MOVED = 0.25  # of a set-point, from which on it is another one [K]
_DAY = pd.Timedelta(days=1)


def errors_of(rows: pd.DataFrame) -> dict[str, Any]:
    """Root mean square error, bias and share inside of the 80 % interval of temperature, load and stages.

    None where nothing can be compared; heat that the log does not hold in kW is left out where there are stages.
    """
    stages = [role for role in plant_roles(rows) if is_stage(role) and f"{role}_measured" in rows]
    out = {"temperature [K]": _errors(rows, "T_za", "q")}
    if not stages or rows["Q_hvac_measured"].notna().any():
        out["load [kW]"] = _errors(rows, "Q_hvac", "Q_hvac")
    return out | {f"{role} [-]": _errors(rows, role) for role in stages}


def _errors(rows: pd.DataFrame, role: str, quantiles: str = "") -> dict[str, Any] | None:
    measured = rows[f"{role}_measured"]
    error = (rows[role] - measured).dropna()
    if error.empty:
        return None
    return {
        "rmse": round(float(np.sqrt((error**2).mean())), 3),
        "bias": round(float(error.mean()), 3),
        "coverage": _coverage(rows, role, quantiles) if quantiles else None,
    }


def _coverage(rows: pd.DataFrame, role: str, quantiles: str) -> float | None:
    """Share inside of the 80 % interval, rounded once: a status shows it in errors and in verdicts."""
    low, high = f"{quantiles}_0.1", f"{quantiles}_0.9"
    known = rows.dropna(subset=[low, high, role, f"{role}_measured"])
    inside = known[f"{role}_measured"].between(known[low], known[high])
    return round(float(inside.mean()), 3) if len(inside) else None


def verdicts_of(
    archive: Any, zone: ZoneModel, rows: pd.DataFrame, days: pd.DataFrame, doubts: Sequence[str] = ()
) -> list[Verdict]:
    """The verdicts on temperature and load by finished forecasts, with the drift ``days`` and other ``doubts``."""
    stamps = pd.DatetimeIndex(pd.to_datetime(rows["time"]))
    known = archive.measured(stamps[0] - _DAY)
    before = known.reindex(stamps - _DAY).set_axis(rows.index)
    doubts = [
        *doubts,
        *_other_setpoints(rows, zone.learned_until),
        *_beyond(archive.latest()),
        *at_ends(zone.predictor.gray_box_),
    ]
    measured = rows.filter(like="_measured").rename(columns=lambda name: name.removesuffix("_measured"))
    out = [_verdict("temperature", rows, (rows["T_za"], measured["T_za"], before["T_za"]), [*drifted(days), *doubts])]
    roles = [role for role in plant_roles(measured) if role in rows and measured[role].notna().any()]
    loads = [load_of(frame, zone.settings, roles) for frame in (rows, measured, before)]
    if loads[0] is not None and loads[0].values.notna().any():
        scale = [] if zone.scaled else [NO_SCALE]
        doubts = [*scale, *drifted(days, "its temperature errors"), *doubts]
        out.append(_verdict("load", rows, [load.values for load in loads if load is not None], doubts))
    return out


def _verdict(quantity: str, rows: pd.DataFrame, values: Sequence[pd.Series], doubts: list[str]) -> Verdict:
    """The verdict on forecasts, beside what was measured then and a day before."""
    forecast, measured, before = values
    blocks = pd.to_datetime(rows["origin"]).dt.floor("D")  # forecasts of one day err alike, however many there are
    rule = compare_errors(forecast - measured, before - measured, blocks, f"yesterday's {quantity}")
    coverage = _coverage(rows, *(("T_za", "q") if quantity == "temperature" else ("Q_hvac", "Q_hvac")))
    scored = blocks[(forecast - measured).notna()].nunique()
    return judge(quantity, [rule], n_origins=scored, coverage=coverage, doubts=doubts)


def _other_setpoints(rows: pd.DataFrame, learned_until: pd.Timestamp) -> list[str]:
    """A reason where often other set-points were in force than forecast with, in the time zone of the log."""
    roles = [role for role in SETPOINT_ROLES if role in rows and f"{role}_measured" in rows]
    other = pd.DataFrame({role: (rows[role] - rows[f"{role}_measured"]).abs() > _MOVED for role in roles}, rows.index)
    share = float(other.any(axis=1).mean())
    if not share > OUTSIDE:
        return []
    role = next(str(role) for role in other if other[role].any())
    last = rows[other[role]].iloc[-1]
    text = f"in {percent(share)} of the hours forecast other set-points were in force than forecast with"
    at = on_clock_of(pd.Timestamp(last["time"]), learned_until)
    return [f"{text}, such as {role} {last[f'{role}_measured']:.3g} for {last[role]:.3g} degC at {at}"]


def _beyond(ahead: pd.DataFrame) -> list[str]:
    share = float(ahead[BEYOND].mean()) if BEYOND in ahead else 0.0
    return [f"{percent(share)} of the last forecast lies beyond what training covered"] if share > OUTSIDE else []
