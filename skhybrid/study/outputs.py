"""Writing the results of a study, of one zone or of several: tables, metrics, the model and the report."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import __version__
from .._files import named_in_errors
from .._json import strict_json
from ..inspection.zone_panels import weeks_and_days_figure
from ..persistence import save_model
from .compared_models import HYBRID
from .identified_building import identified_only
from .report import study_picture, verdict, write_building_report, write_zone_report
from .report.figures import SHOWN, save_png
from .results import BuildingResult, StudyResult
from .scores import side_by_side
from .verdict import zones_in_words
from .zone_part import forecast_of


def format_result(result: StudyResult | BuildingResult) -> str:
    """The comparisons of a study as text, and what they say; first the one in which the heat is not known."""
    held, words = result.setpoints_known, verdict(result.table, HYBRID)
    if isinstance(result, BuildingResult):
        known = f"RMSE of the temperature [K] by model:\n{_as_text(_zones_shown(result))}\n\n{words}"
        first = "" if held is None else f"known: weather, set-points\n{_as_text(held.by_zone.loc[result.zones.index])}"
        return known if held is None else f"{first}\n\n{held.words}\n\nknown: weather, heat\n{known}"
    if held is None:
        return f"{format_table(result.table, result.scaled)}\n\n{words}"
    first = format_table(held.table, held.unit == "kW", "known: weather, set-points", held.load_name)
    second = format_table(result.table, result.scaled, "known: weather, heat")
    return f"{first}\n\n{held.words}\n\n{second}\n\n{words}"


def _zones_shown(result: BuildingResult) -> pd.DataFrame:
    """The errors of each zone by model, the worst verdict first."""
    models = [label for label in result.table.index if label in result.frames]
    loads = ["load_rmse", "load_yesterday"] if result.zones["load_rmse"].notna().any() else []
    unit = "kW" if result.scaled else "-"
    named = {
        "coverage": "in 80 % interval",
        "load_rmse": f"load [{unit}]",
        "load_yesterday": f"load a day before [{unit}]",
    }
    return result.zones[[*models, "coverage", *loads]].astype(float).rename(columns=named)


def _as_text(table: pd.DataFrame) -> str:
    """A table with a column per zone."""
    return table.T.to_string(na_rep="-", float_format="{:.3f}".format)


def format_table(
    table: pd.DataFrame, scaled: bool = True, head: str = "day-ahead forecast", load_name: str = "load"
) -> str:
    """A comparison as text, the best model first and marked; ``scaled``: loads are certain kW."""
    width = max(len(head), *(len(str(name)) for name in table.index)) + 2
    of_time, load_head = "seconds" in table, f"{load_name} RMSE [{'kW' if scaled else '-'}]"
    line = f"{head:{width}}  RMSE [K]  MAE [K]  {load_head:>14}{'  time [s]' * of_time}"
    lines = [line, "-" * len(line)]
    for place, (name, row) in enumerate(table.iterrows()):
        load = f"{row['load_rmse']:14.2f}" if np.isfinite(row["load_rmse"]) else f"{'-':>14}"
        mark = "* " if place == 0 else "  "
        cells = [_cell(row["rmse"], 8, 3), _cell(row["mae"], 7, 3), load]
        cells += [_cell(row["seconds"], 8, 1)] if of_time else []
        lines.append("  ".join([f"{mark + str(name):{width}}", *cells]))
    return "\n".join(lines)


def _cell(value: float, width: int, digits: int) -> str:
    """A number of so many digits, or a dash."""
    return f"{value:{width}.{digits}f}" if np.isfinite(value) else f"{'-':>{width}}"


#: every file that a study writes, in the order in which it is listed
NAMES = (
    "forecast.csv", "backtest.csv", "parameters.csv", "metrics.json", "model.skops", "report.html", "forecast.png",
)  # fmt: skip


def write_outputs(
    result: StudyResult | BuildingResult,
    folder: str | PathLike[str],
    *,
    truth: pd.Series | None = None,
    before_swap: Callable[[], None] | None = None,
) -> list[Path]:
    """Write tables, metrics, model, report and picture of a study, all or none; return their paths.

    They are written to a hidden folder first.  Then the files of an earlier study are removed and the new ones take
    their place, so that the folder never holds files of two studies; other files in it stay.

    Parameters
    ----------
    result : StudyResult
        Or that of several zones, whose tables have a column ``zone``, or names that end with the zone's.
    folder : path-like, created if it does not exist
    truth : Series, optional, true unmeasured heat [kW] of one zone, for the report
        Read at the stamps of the training rows.
    before_swap : callable, optional, called after all is written and before a file in the folder changes

    Raises
    ------
    OSError
        If the folder cannot be written to, or the disk is full; the folder is then as it was.
    """
    with _staged_files(folder, before_swap) as staged:
        write_csv(result.forecast, staged / "forecast.csv")
        held = result.setpoints_known
        tests = pd.concat([side_by_side(result.frames), None if held is None else held.columns], axis=1)
        write_csv(tests.set_index("origin"), staged / "backtest.csv")
        write_csv(result.parameters, staged / "parameters.csv", "%.6g")
        (staged / "metrics.json").write_text(metrics_text(result) + "\n", encoding="utf-8")
        save_model(result.model, staged / "model.skops")
        write_report(staged / "report.html", result, truth)
        _draw_picture(result, staged / "forecast.png")
    return [Path(folder) / name for name in NAMES]


def _draw_picture(result: StudyResult | BuildingResult, path: Path) -> None:
    """One picture of a study: its back-tests, and the next day."""
    names = [HYBRID, *result.table.index.drop(HYBRID)]
    frames = {name: result.frames[name] for name in names if name in result.frames}
    if result.setpoints_known is not None:
        frames = {HYBRID: result.setpoints_known.frame}
    if isinstance(result, BuildingResult):
        zones = frames[HYBRID]["zone"].unique()
        parts = {zone: forecast_of(result.forecast, result.settings, zone) for zone in zones}
        power = "kW" if result.scaled else "relative"
        shown = {HYBRID: frames[HYBRID]}
        save_png(weeks_and_days_figure(shown, parts, SHOWN, power=power, title=result.settings.name), path)
    else:
        study_picture(path, frames, result.forecast, title=result.settings.name)


@contextmanager
def _staged_files(folder: str | PathLike[str], before_swap: Callable[[], None] | None = None) -> Iterator[Path]:
    """A hidden folder whose files take the place of those of an earlier study when the block ends."""
    out = Path(folder)
    with named_in_errors(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{out.name}.", dir=out if out.is_dir() else out.parent) as made:
            staged = Path(made)
            yield staged
            if before_swap is not None:
                before_swap()
            try:
                _swap(staged, out)
            except (KeyboardInterrupt, SystemExit):  # half of a swap would be worse than a moment more
                _swap(staged, out)
                raise


def _swap(staged: Path, out: Path) -> None:
    """Let the staged files take the place of those of an earlier study; continues where it was stopped."""
    out.mkdir(exist_ok=True)
    left = [name for name in NAMES if (staged / name).exists()]
    for name in left:
        (out / name).unlink(missing_ok=True)
    for name in left:
        (staged / name).replace(out / name)


def write_report(
    path: str | PathLike[str], result: StudyResult | BuildingResult, truth: pd.Series | None = None
) -> None:
    """Write a study of one zone or of several as one self-contained HTML file, in one step.

    Parameters
    ----------
    path : path-like, the file to make or replace
    result : StudyResult, or that of a study of several zones
    truth : Series, optional
        Internal gains [kW] by the stamps of the log of one zone, where they are known.
    """
    if isinstance(result, BuildingResult):
        write_building_report(path, result)
    else:
        write_zone_report(path, result, truth)


def write_csv(frame: pd.DataFrame, path: Path, form: str = "%.4f") -> None:
    """Write a table with its numbers and stamps in one form."""
    frame.to_csv(path, float_format=form, date_format="%Y-%m-%dT%H:%M:%S%z")


def metrics_text(result: StudyResult | BuildingResult) -> str:
    """Errors, verdicts and settings of a study as JSON."""
    cost, held, words = result.next_day_cost, result.setpoints_known, verdict(result.table, HYBRID)
    own: dict[str, Any] = {}
    if isinstance(result, BuildingResult):
        words = f"{zones_in_words(result.zone_verdicts)} {words}"
        own["zones"] = result.zones.to_dict(orient="index")
        own["building"] = {} if result.identified is None else result.identified.as_dict()
    else:
        own["building"] = identified_only(result.building).to_dict(orient="index")
    content = {
        "skhybrid": __version__,
        "name": result.settings.name,
        "best": result.best,
        "verdict": words,
        "verdicts": [one._asdict() for one in result.verdicts],
        "setpoints_known": None if held is None else held.as_dict(),
        **own,
        "models": result.table.drop(columns="note").to_dict(orient="index"),
        "interval_80_coverage": result.coverage,
        **result.data.spans(result.frames[HYBRID]),
        "next_day": str(result.forecast.index[0].date()),
        "next_day_held_out": result.data.held_out,
        "next_day_cost": None if cost is None else cost._asdict(),
        "seconds": round(result.seconds, 2),
        "warnings": result.warnings,
        "settings": result.settings.as_dict(),
    }
    return strict_json(content)
