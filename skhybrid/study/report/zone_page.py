"""The report of a study of one zone as one HTML file with everything inside."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from os import PathLike

import numpy as np
import pandas as pd

from ..._table import SETPOINT_ROLES
from ..compared_models import HYBRID
from ..identified_building import identified_only
from ..results import StudyResult
from ..scores import has_intervals
from ..setpoints_known import SetpointsKnown
from .figures import backtest_figure, day_figure, held_figure, lead_figure, schedule_figure, week_figure
from .html import html_cards, html_figure, html_table, next_day_cards, results_table, verdict_boxes, write_sections
from .words import day_words, flat, lead_group_names, number, percent_or_dash, verdict

#: below the comparison of a study's models, with what is to be said of stages
_TABLE_WORDS = (
    '<p class="soft">The best model comes first. The load error compares the heat that would have held the measured '
    "temperature with the heat that was delivered; stages are converted to heat with the identified capacities{}. The "
    "time is that of fit and back-test, for the hybrid with its intervals. The two-stage models share one "
    "identification, whose time is counted for the first of them.</p>\n"
)


def write_zone_report(path: str | PathLike[str], result: StudyResult, truth: pd.Series | None = None) -> None:
    """Write a study of one zone as one self-contained HTML file, in one step."""
    sections = [
        _head(result),
        _tomorrow(result.forecast, result.settings.load.get("setpoint", "measured") == "measured"),
        _setpoints_known(result.setpoints_known),
        _accuracy(result),
        _learned(result),
        _week(result.zeta, None if truth is None else truth.reindex(result.zeta.index)),
        _building(result),
    ]
    listed = {**result.data.spans(result.frames[HYBRID]), **flat(result.settings.as_dict())}
    write_sections(path, result.settings.name, sections, result.warnings, listed)


def _is_own(result: StudyResult) -> bool:
    """Whether the identification that describes the building is that of the model itself."""
    return result.model.gray_box_ is result.identification


def _head(result: StudyResult) -> str:
    table, forecast, held = result.table, result.forecast, result.setpoints_known
    own, sentences, in_kw = table.loc[HYBRID], [verdict(table, HYBRID)], result.scaled
    if held is not None:
        own, in_kw = held.table.loc[HYBRID], held.unit == "kW"
        sentences = [held.words, f"With the heat known too: {sentences[0]}"]
    n_origins = result.frames[HYBRID]["origin"].nunique()
    cards = [
        (f"{own['rmse']:.2f} K", f"day-ahead temperature error (RMSE) of the {HYBRID} model in {n_origins} forecasts"),
        (f"{own['mae']:.2f} K", "mean absolute temperature error"),
    ]
    if in_kw and np.isfinite(own.get("load_rmse", np.nan)):
        cards.append((f"{own['load_rmse']:.2f} kW", "error of the heating or cooling load (RMSE)"))
    low, high = forecast["T_za"].min(), forecast["T_za"].max()
    cards.append((f"{low:.1f}–{high:.1f}\u00a0°C", f"forecast room temperature on {day_words(forecast.index)}"))
    return (
        f'<p class="soft">skhybrid: day-ahead forecast of a zone</p><h1>{escape(result.settings.name)}</h1>\n'
        + verdict_boxes(result.verdicts)
        + "".join(f'<p class="verdict">{escape(sentence)}</p>\n' for sentence in sentences)
        + html_cards([*cards, *next_day_cards(result)])
    )


def _tomorrow(forecast: pd.DataFrame, holds_measured: bool) -> str:
    words = "This is the day after the last measurement."
    if "T_za_measured" in forecast:
        words = "This is the last complete day of the log. The temperature forecast used no measurement of that "
        words += "day; the measurements are drawn for comparison."
    if any(role in forecast for role in SETPOINT_ROLES):
        words += " Both curves are forecast from the weather and the set-points of that day, by the learned thermostat."
    else:
        held = "that would hold the temperature that was measured that day"
        held = held if holds_measured and "T_za_measured" in forecast else "that would hold the set-point instead"
        words += " The temperature curve assumes the logged or planned heating and cooling. The load curve is the heat "
        words += f"{held}, within the limits of the plant."
    if has_intervals(forecast):
        words += " Four out of five measurements should lie in the shaded interval."
    return f"<h2>Forecast for {escape(day_words(forecast.index))}</h2>\n<p>{words}</p>\n" + html_figure(
        day_figure(forecast), "Forecast of room temperature and heating or cooling load."
    )


def _setpoints_known(held: SetpointsKnown | None) -> str:
    """The section on forecasts as they are used, in which the heat is not known ahead."""
    if held is None:
        return ""
    contained = [(held.coverage, "temperatures"), (held.load_coverage, "loads")]
    shares = " and ".join(
        f"{percent_or_dash(share)} of the measured {what}" for share, what in contained if share is not None
    )
    return (
        "<h2>Accuracy in daily use</h2>\n"
        f"<p>Here each forecast was given {held.weather} and the set-points, but neither "
        "the heat nor the room temperature measured after it started. The thermostat and the plant act as they were "
        "learned on the training days.</p>\n"
        + results_table(held.table, held.unit == "kW", held.load_name)
        + (f"<p>The 80 % intervals contained {shares}.</p>\n" if shares else "")
        + html_figure(
            held_figure(held.frame, held.load, held.loads[HYBRID], held.unit),
            "Measured and forecast temperature and load on the last test days, with only the set-points known.",
        )
    )


def _accuracy(result: StudyResult) -> str:
    table, frames, coverage = result.table, result.frames, result.coverage
    ordered = {name: frames[name] for name in [HYBRID, *table.index.drop(HYBRID)] if name in frames}
    hours = frames[HYBRID]["lead"].max() / pd.Timedelta("1h")
    days = "Measured and forecast temperature on the last test days; a dashed line marks the start of each forecast."
    interval = (
        ""
        if coverage is None
        else (
            f"<p>The 80 % interval of the {HYBRID} model was learned on the training days; it contained "
            f"{percent_or_dash(coverage)} of the measurements of the test days.</p>\n"
        )
    )
    return (
        "<h2>Accuracy with the heat known</h2>\n"
        "<p>Each model was fitted on the training days only. It then forecast the test days "
        f"{hours:g} hours ahead. Each forecast was given the weather and the heating and cooling of those hours, but "
        "no room temperature measured after it started. All models are compared at the same times.</p>\n"
        + results_table(table, result.scaled)
        + _TABLE_WORDS.format("" if result.scaled else ", whose scale this log does not determine")
        + interval
        + html_figure(backtest_figure(ordered), days)
        + html_figure(lead_figure(ordered), "Error by lead time, for the best models.")
    )


def _learned(result: StudyResult) -> str:
    schedule = getattr(result.model.gray_box_, "schedule_", None)
    weights = getattr(result.model, "weights_", None)
    if schedule is None or _is_own(result):
        return ""
    words = (
        f"<p>Schedules that the {HYBRID} model learned from the training days, by hour: unmeasured heat at the "
        "mean outdoor temperature, and conductance to the outside. Both are what the network of the forecast lacks, "
        "and may be negative: they are no properties of the building. Each forecast begins with updated ones.</p>\n"
    )
    picture = html_figure(schedule_figure(schedule), "Learned schedules of unmeasured heat and of conductance.")
    section = f"<h2>Learned schedules</h2>\n{words}{picture}"
    if weights is None:
        return section
    rows = zip(
        lead_group_names(result.frames[HYBRID]), *(map(percent_or_dash, weights[name]) for name in weights), strict=True
    )
    shares = html_table(["hours ahead", *map(str, weights)], rows)
    words = "Share of each model in the forecast after training. The short memory forgets past days faster."
    return f'{section}{shares}<p class="soft">{words}</p>'


def _week(zeta: pd.Series, truth: pd.Series | None) -> str:
    known = (
        " The dashed line is the true internal gains alone; the estimate also contains ventilation, infiltration and "
        "whatever the simple network leaves out."
    )
    return (
        "<h2>Unmeasured heat</h2>\n<p>Heat from people, equipment, lights, air exchange and anything else that is not "
        "in the log, estimated by the identification from the temperature of the training days. Positive values heat "
        f"the room.{'' if truth is None else known}</p>\n"
        + html_figure(week_figure(zeta, truth), "Unmeasured heat by hour of the week.")
    )


def _building(result: StudyResult) -> str:
    separate = (
        ""
        if _is_own(result)
        else " These values and the unmeasured heat above come from a separate identification "
        f"({escape(type(result.identification).__name__)}): the network of the {HYBRID} model is fitted for its "
        "forecasts, and its parameters do not describe the building."
    )
    described = _values("quantity", identified_only(result.building), ("remark",))
    return (
        "<h2>The building</h2>\n<p>Heat loss of the zone per degree of temperature difference, time constants, and the "
        "window area that the sun heats through. The standard error shows how well the data determine a value; one "
        f"that they do not determine is not shown.{separate}</p>\n{described}"
        "<p>Parameters of the thermal network: capacities store heat, and resistances slow its flow.</p>\n"
        + _values("parameter", identified_only(result.parameters), ("description", "remark"))
    )


def _values(what: str, table: pd.DataFrame, texts: Sequence[str]) -> str:
    """A table of values with standard errors, to two digits of the error; texts that all are empty are left out."""
    texts, rows = [name for name in texts if any(table[name])], []
    for name, row in table.iterrows():
        error = float(row["std"])
        digits = int(np.clip(1 - np.floor(np.log10(error)), 0, 4)) if 0.0 < error < np.inf else 3
        numbers = [number(row[c], digits) for c in ("value", "std")]
        rows.append((f"{name} [{row['unit']}]", *numbers, *(str(row[c]) for c in texts)))
    return html_table((what, "value", "± std. error", *texts), rows, n_texts=len(texts))
