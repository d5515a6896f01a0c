"""The zones of a study in one table: levels of their verdicts, and errors of temperature and load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from .compared_models import HYBRID
from .judgement import ZoneLoads
from .load_rules import YESTERDAY as YESTERDAYS_LOAD
from .scores import coverage_of, rmse_by_zone
from .verdict import Verdict, worst, worst_first


def zone_table(
    frames: Mapping[str, pd.DataFrame],
    verdicts: Mapping[str, list[Verdict]],
    loads: Mapping[str, ZoneLoads],
    test_start: pd.Timestamp,
) -> pd.DataFrame:
    """Level of the verdicts, errors [K] by model, coverage, and errors of the load of each zone, the worst first."""
    table, own = rmse_by_zone(frames).reindex(list(verdicts)), frames[HYBRID]
    level = pd.Series({name: worst(found) for name, found in verdicts.items()})
    coverage = pd.Series({name: coverage_of(own[own["zone"] == name]) for name in verdicts}, dtype=float)
    by_error = table[HYBRID].sort_values(ascending=False, kind="stable").index
    order = worst_first({str(zone): [level[zone]] for zone in by_error})
    of_loads = {zone: _load_errors(loads.get(zone), test_start) for zone in verdicts}
    table = table.assign(level=level, coverage=coverage).join(pd.DataFrame.from_dict(of_loads, orient="index"))
    return table.loc[order].rename_axis("zone")


def _load_errors(loads: ZoneLoads | None, test_start: pd.Timestamp) -> dict[str, object]:
    """Error of a zone's load and of that of a day before, and their unit."""
    if loads is None:
        return {"load_rmse": np.nan, "load_yesterday": np.nan, "unit": ""}
    rmse = np.sqrt((loads.errors(test_start) ** 2).mean())
    return {"load_rmse": rmse[HYBRID], "load_yesterday": rmse[YESTERDAYS_LOAD], "unit": loads.delivered.unit}
