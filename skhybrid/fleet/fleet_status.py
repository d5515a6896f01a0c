"""Status of the zones of a fleet: errors, drift and a verdict for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._time import spell
from .._warnings import several
from ..study.doubts import at_ends, drift_days, drifted
from ..study.verdict import CARE, NOT, USABLE, WORST_FIRST, compare_errors, judge
from .model_store import ModelStore

_SHORT = pd.Timedelta("3D")  # a training that says little
_OLD = pd.Timedelta("12h")  # by how much the last row of a zone may be older than the newest of the fleet
_HALF_DAY = pd.Timedelta("12h")
COLUMNS = ("verdict", "last_row", "rmse_yesterday", "rmse_training", "coverage", "drift", "reasons")


class ZoneStatus(NamedTuple):
    """A row of the status, and the last measured and forecast temperatures of the zone."""

    row: dict[str, Any]
    recent: pd.DataFrame  # y_true, y_pred and quantiles


def zone_status(zone: str, store: str) -> ZoneStatus:
    """The status of a zone."""
    model, journal = ModelStore(store).load(zone)
    facts, days = journal.facts, pd.DataFrame(journal.facts["days"])
    why = facts["fallback"]
    fallback = [] if why is None else [f"the fallback forecasts it, because {why.removesuffix('.')}"]
    watched = drift_days(model) if hasattr(model, "drift") else pd.DataFrame()
    doubts = [
        *fallback,
        *_few_rows(model),
        *drifted(watched),
        *(at_ends(model.gray_box_) if hasattr(model, "gray_box_") else ()),
    ]
    rules, coverage = [], None
    if len(days):
        errors = days[["rmse", "rule"]].astype(float)
        rules = [compare_errors(errors["rmse"], errors["rule"], days["day"], "yesterday's temperature")]
        inside = days["inside"].astype(float)
        coverage = (
            float(np.average(inside.dropna(), weights=days["n"][inside.notna()])) if inside.notna().any() else None
        )
    verdict = judge("temperature", rules, n_origins=len(days), coverage=coverage, doubts=doubts)
    row = {
        "verdict": verdict.level,
        "last_row": pd.Timestamp(facts["until"]) if facts["until"] else pd.NaT,
        "rmse_yesterday": _last_error(days, journal.scored.index),
        "rmse_training": np.nan if facts["training_rmse"] is None else facts["training_rmse"],
        "coverage": np.nan if coverage is None else coverage,
        "drift": bool(len(watched) and watched["drifted"].iloc[-1]),
        "reasons": "; ".join(verdict.reasons),
    }
    ahead = journal.ahead
    if len(ahead) and len(journal.scored):
        ahead = ahead[ahead.index > journal.scored.index[-1]]
    return ZoneStatus(row, pd.concat([journal.scored, ahead]))


def _last_error(days: pd.DataFrame, stamps: pd.Index) -> float:
    """Error of the last of the ``days`` that is known for half of its rows or more [K]; ``stamps`` show their step."""
    if days.empty:
        return np.nan
    errors = days["rmse"][days["n"] * stamps.to_series().diff().min() >= _HALF_DAY]
    return float(errors.iloc[-1]) if len(errors) else np.nan


def _few_rows(model: Any) -> list[str]:
    """A reason where a model learned from less than three days."""
    record = getattr(model, "training_", None)
    if record is None or record.n_rows * record.step >= _SHORT:
        return []
    return [f"it learned from {several(record.n_rows, 'row')} of {spell(record.step)} only"]


def _doubt(row: dict[str, Any], reason: str) -> None:
    """Add a reason for care to a row of the status."""
    row["reasons"] = f"{reason}; {row['reasons']}"
    row["verdict"] = CARE if row["verdict"] == USABLE else row["verdict"]


def status_table(found: Mapping[str, ZoneStatus], failed: Mapping[str, Mapping[str, str]], key: str) -> pd.DataFrame:
    """One row per zone, the worst first; zones without a model are not usable. ``failed``: why, by fit and tick."""
    rows = {zone: dict(one.row) for zone, one in found.items()}
    known = {zone: row["last_row"] for zone, row in rows.items() if row["last_row"] is not pd.NaT}
    stamps = {zone: pd.to_datetime(last, utc=True) for zone, last in known.items()}
    for zone, stamp in stamps.items():
        age = max(stamps.values()) - stamp
        if age >= _OLD:
            hours = age / pd.Timedelta("1h")
            span = several(round(hours / 24), "day") if hours > 36 else f"{hours:.0f} h"
            _doubt(rows[zone], f"its last row is {span} older than the newest of the fleet")
    for of, zone, why in ((of, zone, why) for of, whys in failed.items() for zone, why in whys.items()):
        if zone in rows and (cause := why.removesuffix(".")) not in rows[zone]["reasons"]:
            _doubt(rows[zone], f"its last {of} failed ({cause})")
        elif zone not in rows:
            rows[zone] = {"verdict": NOT, "last_row": pd.NaT, "drift": False, "reasons": why}
    table = pd.DataFrame([{key: zone, **row} for zone, row in rows.items()], columns=[key, *COLUMNS])
    numbers = ["rmse_yesterday", "rmse_training", "coverage"]
    table[numbers] = table[numbers].astype(float)
    grown = (table["rmse_yesterday"] / table["rmse_training"]).fillna(0.0)
    order = pd.DataFrame({"verdict": table["verdict"].map(WORST_FIRST.index), "grown": -grown, "zone": table[key]})
    return table.loc[order.sort_values(["verdict", "grown", "zone"]).index].reset_index(drop=True)
