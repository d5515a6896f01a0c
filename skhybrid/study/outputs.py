"""Writing the results of a study: tables, metrics, the model and the report."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import __version__
from .._files import named_in_errors
from .._json import strict_json
from ..persistence import save_model
from .compared_models import HYBRID
from .identified_building import identified_only
from .report import study_picture, verdict, write_report
from .run import StudyResult
from .scores import coverage_of, side_by_side
from .tariff import next_day_cost
from .verdict import Verdict


def format_result(result: StudyResult) -> str:
    """The comparisons of a study as text, and what they say; first the one in which the heat is not known."""
    held, words = result.setpoints_known, ["", verdict(result.table, HYBRID)]
    if held is None:
        return "\n".join([format_table(result.table, result.scaled), *words])
    first = format_table(held.table, held.unit == "kW", "known: weather, set-points", held.load_name)
    second = format_table(result.table, result.scaled, "known: weather, heat")
    return "\n".join([first, "", held.words, "", second, *words])


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
    result: StudyResult,
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
    folder : path-like, created if it does not exist
    truth : Series, optional, true unmeasured heat [kW] at the stamps of the training rows, for the report
    before_swap : callable, optional, called after all is written and before a file in the folder changes

    Raises
    ------
    OSError
        If the folder cannot be written to, or the disk is full; the folder is then as it was.
    """
    names = [HYBRID, *result.table.index.drop(HYBRID)]
    ordered = {name: result.frames[name] for name in names if name in result.frames}
    with staged_files(folder, before_swap) as staged:
        held, more = result.setpoints_known, None
        if held is not None:
            ordered, more = {HYBRID: held.frame}, held.columns
        write_tables(result, staged, result.parameters, metrics_text(result), more)
        write_page(result, staged / "report.html", truth)
        study_picture(staged / "forecast.png", ordered, result.forecast, title=result.settings.name)
    return [Path(folder) / name for name in NAMES]


@contextmanager
def staged_files(folder: str | PathLike[str], before_swap: Callable[[], None] | None = None) -> Iterator[Path]:
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


def write_tables(
    result: Any, out: Path, parameters: pd.DataFrame, metrics: str, more: pd.DataFrame | None = None
) -> None:
    """Write forecast, back-tests with ``more`` columns, parameters, metrics and model of a study."""
    write_csv(result.forecast, out / "forecast.csv")
    tests = pd.concat([side_by_side(result.frames), more], axis=1)
    write_csv(tests.set_index("origin"), out / "backtest.csv")
    write_csv(parameters, out / "parameters.csv", "%.6g")
    (out / "metrics.json").write_text(metrics + "\n", encoding="utf-8")
    save_model(result.model, out / "model.skops")


def write_page(result: StudyResult, path: str | PathLike[str], truth: pd.Series | None = None) -> None:
    """Write the report of a study, one HTML page; ``truth`` as in :func:`write_outputs`."""
    write_report(
        path,
        title=result.settings.name,
        table=result.table,
        frames=result.frames,
        forecast=result.forecast,
        parameters=identified_only(result.parameters),
        building=identified_only(result.building),
        label=HYBRID,
        zeta=result.zeta,
        truth=truth,
        **_learned(result),
        coverage=result.coverage,
        spans=result.data.spans(result.frames[HYBRID]),
        settings=result.settings.as_dict(),
        verdicts=result.verdicts,
        scaled=result.scaled,
        cost=next_day_cost(result),
        notes=result.warnings,
        setpoints_known=result.setpoints_known,
    )


def metrics_text(result: StudyResult) -> str:
    """Errors, verdicts and settings of a study as JSON."""
    building = identified_only(result.building).to_dict(orient="index")
    return metrics_of(result, verdict(result.table, HYBRID), result.verdicts, building=building)


def _learned(result: StudyResult) -> dict[str, Any]:
    """Arguments of the report that only the schedule model has."""
    model = result.model
    if model.gray_box_ is result.identification:
        return {}
    return {
        "schedule": getattr(model.gray_box_, "schedule_", None),
        "weights": getattr(model, "weights_", None),
        "identification": type(result.identification).__name__,
    }


def write_csv(frame: pd.DataFrame, path: Path, form: str = "%.4f") -> None:
    """Write a table with its numbers and stamps in one form."""
    frame.to_csv(path, float_format=form, date_format="%Y-%m-%dT%H:%M:%S%z")


def metrics_of(result: Any, words: str, verdicts: Iterable[Verdict], **more: Any) -> str:
    """Errors, verdicts and settings of a study as JSON, with what else one of its kind has."""
    cost, held = next_day_cost(result), result.setpoints_known
    content = {
        "skhybrid": __version__,
        "name": result.settings.name,
        "best": result.best,
        "verdict": words,
        "verdicts": [one._asdict() for one in verdicts],
        "setpoints_known": None if held is None else held.as_dict(),
        **more,
        "models": result.table.drop(columns="note").to_dict(orient="index"),
        "interval_80_coverage": coverage_of(result.frames[HYBRID]),
        **result.data.spans(result.frames[HYBRID]),
        "next_day": str(result.forecast.index[0].date()),
        "next_day_held_out": result.data.held_out,
        "next_day_cost": None if cost is None else cost._asdict(),
        "seconds": round(result.seconds, 2),
        "warnings": result.warnings,
        "settings": result.settings.as_dict(),
    }
    return strict_json(content)
