"""Writing the results of a study of several zones: the files that a study of one zone has, with columns per zone."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from .. import __version__
from .._files import atomic_path
from .._json import strict_json
from ..inspection.zone_panels import weeks_figure
from ..persistence import save_model
from .building_study import BuildingResult
from .compared_models import HYBRID
from .identified_building import identified_only
from .outputs import NAMES, staged_files, write_csv
from .report import verdict
from .report.building_page import write_building_report, zones_in_words
from .scores import coverage_of, side_by_side
from .verdict import Verdict

_SHOWN = pd.Timedelta("7D")


def write_building(
    result: BuildingResult, folder: str | PathLike[str], *, before_swap: Callable[[], None] | None = None
) -> list[Path]:
    """Write tables, metrics, model, report and picture of a study of several zones, all or none; return their paths.

    Parameters
    ----------
    result : BuildingResult
    folder, before_swap
        As for :func:`write_outputs`.

    Raises
    ------
    OSError
        If the folder cannot be written to, or the disk is full; the folder is then as it was.
    """
    with staged_files(folder, before_swap) as staged:
        write_csv(result.forecast, staged / "forecast.csv")
        write_csv(side_by_side(result.frames).set_index("origin"), staged / "backtest.csv")
        write_csv(_identified(result), staged / "parameters.csv", digits=6)
        (staged / "metrics.json").write_text(building_metrics(result) + "\n", encoding="utf-8")
        save_model(result.model, staged / "model.skops")
        write_building_report(staged / "report.html", result)
        with atomic_path(staged / "forecast.png") as made:
            figure = weeks_figure({HYBRID: result.frames[HYBRID]}, _SHOWN)
            figure.savefig(made, format="png", dpi=130, facecolor="white", metadata={"Software": None})
    return [Path(folder) / name for name in NAMES]


def building_metrics(result: BuildingResult) -> str:
    """Errors, verdicts and settings of a study of several zones as JSON."""
    content = {
        "skhybrid": __version__,
        "name": result.settings.name,
        "best": result.best,
        "verdict": f"{zones_in_words(result.verdicts)} {verdict(result.table, HYBRID)}",
        "verdicts": [one._asdict() for one in verdicts_by_zone(result)],
        "zones": result.zones.to_dict(orient="index"),
        "building": _nested(result),
        "models": result.table.drop(columns="note").to_dict(orient="index"),
        "interval_80_coverage": coverage_of(result.frames[HYBRID]),
        **result.data.spans(result.frames[HYBRID]),
        "next_day": str(result.forecast.index[0].date()),
        "next_day_held_out": result.data.held_out,
        "seconds": round(result.seconds, 2),
        "warnings": result.warnings,
        "settings": result.settings.as_dict(),
    }
    return strict_json(content)


def verdicts_by_zone(result: BuildingResult) -> list[Verdict]:
    """The verdicts of all zones, the worst zone first, each with the zone in its quantity."""
    pairs = ((zone, one) for zone, found in result.verdicts.items() for one in found)
    return [one._replace(quantity=f"{one.quantity} of {zone}") for zone, one in pairs]


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


def _nested(result: BuildingResult) -> dict[str, Any]:
    """Quantities of the rooms by zone, and what each two exchange."""
    return {} if result.identified is None else identified_content(result.identified)


def identified_content(identified: Any) -> dict[str, Any]:
    """An identified building of several zones as plain values."""
    rooms, partitions = identified_only(identified.rooms), identified_only(identified.partitions)
    zones = rooms.index.get_level_values("zone").unique()
    exchanged = zip(partitions.index, partitions.to_dict(orient="records"), strict=True)
    between = [{"zones": list(pair), **row} for pair, row in exchanged]
    return {"zones": {str(zone): rooms.loc[zone].to_dict(orient="index") for zone in zones}, "exchange": between}
