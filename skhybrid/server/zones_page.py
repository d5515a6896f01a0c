"""The page of a building: a verdict and panels per zone."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import pandas as pd

from ..study.report.building_page import ZONE_STYLE, by_zone, zone_boxes, zones_in_words
from ..study.report.figures import days_figure, weeks_figure
from ..study.report.html import html_page
from ..study.report.words import number, percent_or_dash
from ..study.verdict import Verdict
from .page import (
    LINKS,
    NO_FORECAST,
    REFRESH,
    SPANS,
    day_to_come,
    days_before,
    drift_words,
    energy_cards,
    last_past,
    past_day,
    rows_words,
)
from .zone_view import ZoneView, compared

_T = "temperature [K]"  # the name of its errors in a status


def building_page(name: str, views: Mapping[str, ZoneView], status: dict[str, Any]) -> str:
    """The page of several zones: verdicts, tomorrow, yesterday, and the last week."""
    judged = {zone: [Verdict(**one) for one in state["verdicts"]] for zone, state in status["zones"].items()}
    head = f'<p class="soft">skhybrid: day-ahead forecast of {len(views)} zones</p><h1>{escape(name)}</h1>\n'
    sections = [head + _verdicts(judged), _tomorrow(views), _yesterday(views), _week(views), _state(status), LINKS]
    return html_page(f"{name}: forecast", sections, REFRESH + ZONE_STYLE)


def _verdicts(judged: Mapping[str, list[Verdict]]) -> str:
    known = {zone: found for zone, found in judged.items() if found}
    if not known:
        return ""
    return f'<p class="verdict">{escape(zones_in_words(known))}</p>\n{zone_boxes(known)}'


def _tomorrow(views: Mapping[str, ZoneView]) -> str:
    rows = {zone: view.forecast for zone, view in views.items() if "T_za" in view.forecast}
    origin = next(iter(views.values())).origin
    if origin is None or not rows:
        return NO_FORECAST
    low, high = min(frame["T_za"].min() for frame in rows.values()), max(frame["T_za"].max() for frame in rows.values())
    cards = [(f"{low:.1f}–{high:.1f}\u00a0°C", "temperature of all zones in the day to come")]
    scaled = all(view.scaled for view in views.values())
    loads = [frame["Q_hvac"] for frame in rows.values() if "Q_hvac" in frame]
    if scaled and loads:
        cards += energy_cards(pd.DataFrame({"Q_hvac": sum(loads[1:], loads[0])}))
    power, unscaled = "kW" if scaled else "relative", not scaled and bool(loads)
    return day_to_come(cards, origin, "bands are", unscaled, lambda width: days_figure(rows, width, power))


def _yesterday(views: Mapping[str, ZoneView]) -> str:
    past = {zone: last_past(view) for zone, view in views.items() if len(view.past) and view.past["T_za"].notna().any()}
    rows = {zone: frame for zone, (_, frame) in past.items()}
    origin = next((origin for origin, _ in past.values()), None)
    return past_day(origin, lambda width: days_figure(rows, width))


def _week(views: Mapping[str, ZoneView]) -> str:
    known = {zone: compared(view.past).assign(zone=zone) for zone, view in views.items() if len(view.past)}
    known = {
        zone: rows for zone, rows in known.items() if len(rows["origin"].unique()) > 1 and rows["y_true"].notna().any()
    }
    if not known:
        return ""
    rows = pd.concat(known.values(), ignore_index=True)
    return days_before(lambda width: weeks_figure({"forecast": rows}, SPANS[width], width))


def _state(status: dict[str, Any]) -> str:
    """Errors and drift, a row per zone."""
    rows = [(zone, *_errors(state), drift_words(state["drift"])) for zone, state in status["zones"].items()]
    weeks = ("four weeks [K]", "bias [K]", "in band", "load [kW]")
    heads = ("zone", "last one [K]", *weeks, "drift")
    words = (
        "RMSE of the last forecast that is over, and of those of four weeks with bias and share in the 80 % interval."
    )
    return (
        f'<h2>State</h2>\n{by_zone(heads, rows, n_texts=1)}<p class="soft">{words}</p>'
        f"<p>{escape(rows_words(status))}</p>"
    )


def _errors(state: dict[str, Any]) -> list[str]:
    last, weeks = state["yesterday's forecast"] or {}, state["last four weeks"] or {}
    newest, all_of, load = (found or {} for found in (last.get(_T), weeks.get(_T), weeks.get("load [kW]")))
    numbers = [number(newest.get("rmse"), 2), number(all_of.get("rmse"), 2), number(all_of.get("bias"), 2)]
    return [*numbers, percent_or_dash(all_of.get("coverage")), number(load.get("rmse"), 2)]
