"""Writing the results of a study of several zones: the files that a study of one zone has, with columns per zone."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from .building_setpoints import zones_setpoints_known
from .building_study import BuildingResult, verdicts_by_zone
from .compared_models import HYBRID
from .identified_building import identified_only
from .outputs import NAMES, metrics_of, staged_files, write_tables
from .report import verdict
from .report.building_page import write_building_report, zones_in_words
from .report.figures import SHOWN, save_png, weeks_figure


def write_building(
    result: BuildingResult, folder: str | PathLike[str], *, before_swap: Callable[[], None] | None = None
) -> list[Path]:
    """Write tables, metrics, model, report and picture of a study of several zones, all or none; return their paths.

    As :func:`write_outputs` for one zone.
    """
    held = result.setpoints_known
    shown, more = (result.frames[HYBRID], None) if held is None else (held.whole.frame, held.whole.columns)
    with staged_files(folder, before_swap) as staged:
        write_tables(result, staged, _identified(result), building_metrics(result), more)
        write_building_report(staged / "report.html", result)
        save_png(weeks_figure({HYBRID: shown}, SHOWN), staged / "forecast.png")
    return [Path(folder) / name for name in NAMES]


def building_metrics(result: BuildingResult) -> str:
    """Errors, verdicts and settings of a study of several zones as JSON."""
    return metrics_of(
        result,
        f"{zones_in_words(result.verdicts)} {verdict(result.table, HYBRID)}",
        verdicts_by_zone(result.verdicts),
        zones=result.zones.to_dict(orient="index"),
        building={} if result.identified is None else identified_content(result.identified),
    )


def format_zones(result: BuildingResult) -> str:
    """The errors of each zone by model as text, the worst verdict first; before them those without the heat known."""
    models = [label for label in result.table.index if label in result.frames]
    loads = ["load_rmse", "load_yesterday"] if result.zones["load_rmse"].notna().any() else []
    table = result.zones[[*models, "coverage", *loads]].astype(float)
    unit = "kW" if result.scaled else "-"
    named = {
        "coverage": "in 80 % interval",
        "load_rmse": f"load [{unit}]",
        "load_yesterday": f"load a day before [{unit}]",
    }
    head, held, words = "RMSE of the temperature [K] by model", result.setpoints_known, verdict(result.table, HYBRID)
    known = f"{head}:\n{_as_text(table.rename(columns=named))}\n\n{words}"
    if held is None:
        return known
    first = zones_setpoints_known(held).loc[result.zones.index]
    return f"known: weather, set-points\n{_as_text(first)}\n\n{held.whole.words}\n\nknown: weather, heat\n{known}"


def _as_text(table: pd.DataFrame) -> str:
    """A table with a column per zone."""
    return table.T.to_string(na_rep="-", float_format="{:.3f}".format)


def _identified(result: BuildingResult) -> pd.DataFrame:
    """Quantities of the rooms, and what each two exchange; empty where the rooms were not identified."""
    columns = ["zone", "value", "std", "unit", "remark"]
    if result.identified is None:
        return pd.DataFrame(columns=columns).rename_axis("quantity")
    rooms = result.identified.rooms.reset_index("zone")
    between = result.identified.partitions.reset_index()
    between = between.set_index("exchange with " + between["neighbour"].astype(str)).drop(columns="neighbour")
    return pd.concat([rooms, between])[columns].rename_axis("quantity")


def identified_content(identified: Any) -> dict[str, Any]:
    """An identified building of several zones as plain values."""
    rooms, partitions = identified_only(identified.rooms), identified_only(identified.partitions)
    zones = rooms.index.get_level_values("zone").unique()
    exchanged = zip(partitions.index, partitions.to_dict(orient="records"), strict=True)
    between = [{"zones": list(pair), **row} for pair, row in exchanged]
    return {"zones": {str(zone): rooms.loc[zone].to_dict(orient="index") for zone in zones}, "exchange": between}
