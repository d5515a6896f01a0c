"""Writing the results of a study of several zones: the files that a study of one zone has, with columns per zone."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

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
    with staged_files(folder, before_swap) as staged:
        write_tables(result, staged, _identified(result), building_metrics(result))
        write_building_report(staged / "report.html", result)
        save_png(weeks_figure({HYBRID: result.frames[HYBRID]}, SHOWN), staged / "forecast.png")
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
    """The errors of each zone by model as text, the worst verdict first."""
    models = [label for label in result.table.index if label in result.frames]
    loads = ["load_rmse", "load_yesterday"] if result.zones["load_rmse"].notna().any() else []
    table = result.zones[[*models, "coverage", *loads]].astype(float)
    unit = "kW" if result.scaled else "-"
    named = {"coverage": "in 80 % band", "load_rmse": f"load [{unit}]", "load_yesterday": f"its day before [{unit}]"}
    head = "RMSE of the temperature [K] by model:"
    shown = table.rename(columns=named).T.to_string(na_rep="-", float_format="{:.3f}".format)
    return f"{head}\n{shown}\n\n{verdict(result.table, HYBRID)}"


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
