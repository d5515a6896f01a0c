"""The report of a study of several zones: verdicts, a map of the rooms, and a row or a panel per zone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd

from ..._table import SETPOINT_ROLES
from ..compared_models import ALONE, HYBRID
from ..identified_building import identified_only
from ..results import BuildingResult
from ..scores import has_intervals
from ..verdict import Verdict, worst, zones_in_words
from ..zone_part import forecast_of
from .figures import (
    SHOWN_IN,
    days_figure,
    errors_figure,
    in_two_widths,
    lead_figure,
    loads_backtest,
    map_figure,
    weeks_figure,
)
from .html import html_cards, html_table, next_day_cards, results_table, verdict_boxes, write_sections
from .words import day_words, flat, lead_group_names, number, percent_or_dash, verdict

_MOST_MODELS = 4  # in the figure of errors
#: of tables with a row per zone
ZONE_STYLE = """<style>
.zones th { white-space: normal; vertical-align: bottom; } .zones td.text { min-width: 7rem; }
</style>
"""


def write_building_report(path: str | PathLike[str], result: BuildingResult) -> None:
    """Write a study of several zones as one self-contained HTML file, in one step."""
    parts = (_head, _map, _tomorrow, _setpoints_known, _accuracy, _building)
    listed = {**result.data.spans(result.frames[HYBRID]), **flat(result.settings.as_dict())}
    sections = [part(result) for part in parts]
    write_sections(path, result.settings.name, sections, result.warnings, listed, ZONE_STYLE)


def zone_boxes(verdicts: Mapping[str, Sequence[Verdict]]) -> str:
    """A box per zone: the worst of its verdicts, and the reasons of all."""
    joint = []
    for zone, found in verdicts.items():
        if found:
            reasons = [f"{one.quantity}, {one.level}: {'; '.join(one.reasons)}" for one in found]
            joint.append(Verdict(zone, worst(found), tuple(reasons)))
    return verdict_boxes(joint)


def by_zone(heads: Sequence[str], rows: Iterable[Sequence[str]], n_texts: int = 0) -> str:
    """A table with a row per zone, whose heads may be long."""
    return f'<div class="zones">{html_table(heads, rows, n_texts)}</div>'


def _head(result: BuildingResult) -> str:
    held, sentences = result.setpoints_known, [verdict(result.table, HYBRID)]
    own, errors, in_kw = result.table.loc[HYBRID], result.zones[HYBRID], result.scaled
    if held is not None:
        own, in_kw = held.table.loc[HYBRID], held.unit == "kW"
        errors = pd.Series({zone: one.table.loc[HYBRID, "rmse"] for zone, one in held.zones.items()})
        sentences = [held.words, f"With the heat known too: {sentences[0]}"]
    n_origins = result.frames[HYBRID]["origin"].nunique()
    cards = [
        (f"{own['rmse']:.2f} K", f"day-ahead temperature error (RMSE) of the hybrid model, {n_origins} forecasts"),
        (f"{errors.max():.2f} K", f"largest error of a zone: {errors.idxmax()}"),
    ]
    if in_kw and np.isfinite(own["load_rmse"]):
        cards.append((f"{own['load_rmse']:.2f} kW", "error of a zone's heating or cooling load (RMSE)"))
    temperatures = result.forecast[result.settings.roles_of("T_za")]
    low, high = (float(end) for end in (temperatures.to_numpy().min(), temperatures.to_numpy().max()))
    cards.append((f"{low:.1f}–{high:.1f}\u00a0°C", f"forecast of all zones on {day_words(result.forecast.index)}"))
    return (
        f'<p class="soft">skhybrid: day-ahead forecast of {len(result.zone_verdicts)} zones</p>'
        f"<h1>{escape(result.settings.name)}</h1>\n"
        f'<p class="verdict">{escape(zones_in_words(result.zone_verdicts))}</p>\n{zone_boxes(result.zone_verdicts)}'
        + "".join(f"<p>{escape(sentence)}</p>\n" for sentence in sentences)
        + html_cards([*cards, *next_day_cards(result)])
    )


def _map(result: BuildingResult) -> str:
    pairs, errors = result.pairs(), result.zones[HYBRID].to_dict()
    by_zone = {zone: float(errors[zone]) for zone in result.settings.zones}
    source = (
        "The floor plan of the configuration says which zones are next to each other."
        if result.settings.adjacency is not None
        else "No floor plan was given, so neighbours were found in the log; if you know which zones are next to each "
        "other, give them as adjacency in the configuration."
    )
    known = any(value is not None for value in pairs.values())
    lines = (
        " Lines carry the heat that two zones exchange per degree, as far as the log determines it, and are wider "
        "where it is more."
        if known
        else ""
    )
    dashed = (
        " A dashed line joins neighbours whose exchange the log does not determine." if None in pairs.values() else ""
    )
    return (
        f"<h2>Rooms</h2>\n<p>{source}{lines}{dashed} The darker a room, the larger the error of its forecast with "
        "the heat known.</p>\n"
        + in_two_widths(
            lambda width: map_figure(pairs, by_zone, width), "Rooms, the RMSE of each, and what they exchange.", "rooms"
        )
        + _neighbours(result)
    )


def _neighbours(result: BuildingResult) -> str:
    """A row per zone: its neighbours, and what they bring to its forecast."""
    if not result.model.coupled_:
        return "<p>Each zone was forecast by itself: no neighbours were given or found.</p>\n"
    shares, rows = result.model.shares_, []
    for zone in result.zones.index:
        if zone in shares.index:
            own = [percent_or_dash(share) for share in shares.loc[zone]]
            errors = [number(result.zones.loc[zone, label], 2) for label in (HYBRID, ALONE)]
            rows.append((str(zone), *own, *errors, ", ".join(result.model.coupled_[zone].neighbours)))
        else:
            alone = number(result.zones.loc[zone, ALONE], 2)
            rows.append((str(zone), *["–"] * len(shares.columns), alone, alone, "none"))
    spans = (f"share, {span}" for span in lead_group_names(result.frames[HYBRID]))
    heads = ("zone", *spans, "RMSE [K]", "by itself [K]", "neighbours in the forecast")
    return (
        by_zone(heads, rows, n_texts=1)
        + '<p class="soft">Share of the forecast that knows the neighbours, by lead, and the errors with '
        "them and without.</p>\n"
    )


def _tomorrow(result: BuildingResult) -> str:
    day = "This is the day after the last measurement."
    if result.data.held_out:
        day = "This is the last complete day of the log. The forecast used no temperature of that day; the "
        day += "measurements are drawn for comparison."
    measured = result.settings.load.get("setpoint", "measured") == "measured" and result.data.held_out
    held = " (here the temperatures that were measured)" if measured else ""
    shaded = has_intervals(result.frames[HYBRID])
    band = " Four out of five measurements should lie in the shaded interval." if shaded else ""
    how = (
        "The temperatures assume the logged or planned heating and cooling. The loads are the heat that would hold the "
        f"set-points{held}, within the limits of the plant."
    )
    if any(str(name).startswith(SETPOINT_ROLES) for name in result.forecast):
        how = "All curves are forecast from the weather and the set-points of that day, by the learned thermostats."
        how += "" if result.setpoints_known is None else f" {result.setpoints_known.usual_words}"
    words = f"{day} {how}{band}"
    power = "kW" if result.scaled else "relative"
    parts = {zone: forecast_of(result.forecast, result.settings, zone) for zone in result.settings.zones}
    return f"<h2>Forecast for {escape(day_words(result.forecast.index))}</h2>\n<p>{words}</p>\n" + in_two_widths(
        lambda width: days_figure(parts, width, power), "Forecast of each zone: temperature and load.", "day"
    )


def _setpoints_known(result: BuildingResult) -> str:
    """The section on forecasts as they are used, in which the heat is not known ahead."""
    held = result.setpoints_known
    if held is None:
        return ""
    table = held.by_zone.loc[result.zones.index]
    in_percent = [str(name).endswith("interval") for name in table]
    rows = [
        (str(zone), *(percent_or_dash(v) if share else number(v, 2) for v, share in zip(row, in_percent, strict=True)))
        for zone, row in table.iterrows()
    ]
    loaded = {zone: one for zone, one in held.zones.items() if one.loads}
    loads = [
        loads_backtest(one.frame, one.load, one.loads[HYBRID], one.unit).assign(zone=zone)
        for zone, one in loaded.items()
    ]
    power = "kW" if result.scaled else "relative"
    days = "of each zone on the last test days, with only the set-points known."
    return (
        "<h2>Accuracy in daily use</h2>\n"
        f"<p>Here each forecast was given {held.weather} and the set-points, but neither "
        "the heat nor the temperature of any zone measured after it started. Thermostats and plants act as they were "
        f"learned on the training days, and neighbours are as forecast. {escape(held.usual_words)}</p>\n"
        + by_zone(["zone", *map(str, table)], rows)
        + _weeks(held.frame, f"Measured and forecast temperature {days}", "used")
        + _weeks(pd.concat(loads, ignore_index=True), f"Measured and forecast {held.load_name} {days}", "loads", power)
        + "<p>All zones together:</p>\n"
        + results_table(held.table, held.unit == "kW", held.load_name)
    )


def _weeks(frame: pd.DataFrame, caption: str, name: str, unit: str = "degC") -> str:
    """A figure of the last days of a back-test, with a panel per zone."""
    return in_two_widths(lambda width: weeks_figure({HYBRID: frame}, SHOWN_IN[width], width, unit), caption, name)


def _accuracy(result: BuildingResult) -> str:
    hours = result.frames[HYBRID]["lead"].max() / pd.Timedelta("1h")
    models = [label for label in result.table.index if label in result.frames]
    shown = [HYBRID, *[label for label in models if label != HYBRID]]
    best = shown[:_MOST_MODELS]
    return (
        "<h2>Accuracy with the heat known</h2>\n"
        "<p>Each model was fitted on the training days only. It then forecast the test days "
        f"{hours:g} hours ahead, given the weather and the heating and cooling of those hours, but no temperature of "
        "any zone measured after it started. All models are compared at the same times.</p>\n"
        + _zone_table(result, shown)
        + in_two_widths(
            lambda width: errors_figure(result.zones[best], width), "Error of each zone, for the best models.", "errors"
        )
        + _weeks(
            result.frames[HYBRID],
            "Measured and forecast temperature of each zone on the last test days; a dashed line marks the start of "
            "each forecast.",
            "weeks",
        )
        + "<p>All zones together:</p>\n"
        + results_table(result.table, result.scaled)
        + '<p class="soft">The best model comes first. The time is that of fit and back-test of all zones.</p>\n'
        + in_two_widths(
            lambda width: lead_figure({label: result.frames[label] for label in best}, width),
            "Error of all zones by lead time, for the best models.",
            "leads",
        )
    )


def _zone_table(result: BuildingResult, models: Sequence[str]) -> str:
    """A row per zone with the errors of all models."""
    table, unit = result.zones, "kW" if result.scaled else "-"
    has_loads = table["load_rmse"].notna().any()
    rows = []
    for zone, row in table.iterrows():
        cells = [str(zone), *(number(row[label], 2) for label in models)]
        cells.append(percent_or_dash(row["coverage"]))
        cells += [number(row[name], 2) for name in ("load_rmse", "load_yesterday")] if has_loads else []
        rows.append((*cells, str(row["level"])))
    heads = ["zone", *(f"{label} [K]" for label in models), "in 80\u00a0% band"]
    heads += [f"load [{unit}]", f"yesterday's load [{unit}]"] if has_loads else []
    return by_zone([*heads, "verdict"], rows, n_texts=1) + (
        '<p class="soft">RMSE of the temperature by model, share of the measurements inside the interval of the '
        "hybrid, and RMSE of the load that would have held the measured temperature, beside the load of the day "
        "before. The zone with the worst verdict comes first.</p>\n"
    )


def _building(result: BuildingResult) -> str:
    if result.identified is None:
        return ""
    rooms, partitions = (identified_only(table) for table in (result.identified.rooms, result.identified.partitions))
    quantities = list(dict.fromkeys(rooms.index.get_level_values("quantity")))
    rows = []
    for zone in result.settings.zones:
        own = rooms.loc[zone].reindex(quantities)
        rows.append((zone, *(_with_error(*pair) for pair in zip(own["value"], own["std"], strict=True))))
    units = rooms.groupby(level="quantity")["unit"].first()
    heads = ("zone", *(f"{name} [{units[name]}]" for name in quantities))
    names = partitions.index.map(" – ".join)
    known = zip(names, partitions["value"], partitions["std"], partitions["remark"], strict=True)
    between = [(str(pair), _with_error(value, std), str(remark)) for pair, value, std, remark in known]
    joined = (
        "<p>Heat that neighbours exchange per degree of their difference:</p>\n"
        + html_table(("zones", "exchange [W/K]", "remark"), between, n_texts=1)
        if between
        else "<p>No exchange of heat between zones was identified.</p>\n"
    )
    how = " Which zones exchange heat was found in the log, too." if result.identified.found else ""
    return (
        "<h2>The building</h2>\n<p>Each room was identified by itself, with its neighbours' measured temperatures as "
        f"boundaries.{how} The heat loss is that to outdoors. The number after ± is the standard error; a value that "
        "the log does not determine is not shown.</p>\n" + by_zone(heads, rows) + joined
    )


def _with_error(value: Any, std: Any) -> str:
    if value is None or not np.isfinite(value):
        return "–"
    return f"{value:.3g} ± {std:.2g}" if np.isfinite(std) else f"{value:.3g}"
