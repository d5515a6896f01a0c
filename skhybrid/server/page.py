"""The page of a zone or of a building, and that which describes the routes: HTML without scripts or foreign parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import pandas as pd

from ..study.day_energy import Energy
from ..study.report.building_page import ZONE_STYLE, by_zone, zone_boxes
from ..study.report.figures import (
    SHOWN_IN,
    backtest_figure,
    day_figure,
    days_figure,
    in_two_widths,
    weeks_figure,
)
from ..study.report.html import energy_cards, html_cards, html_page, html_table, verdict_boxes
from ..study.report.words import number, percent_or_dash
from ..study.verdict import Verdict, zones_in_words
from .zone_view import ZoneView, compared

_REFRESH = '<meta http-equiv="refresh" content="300">\n'
_LINKS = '<p class="soft">{}</p>'.format(
    " · ".join(f'<a href="/{path}">{path}</a>' for path in ("forecast", "status", "docs"))
)
_OLD = pd.Timedelta(days=1)
_T, _LOAD = "temperature [K]", "load [kW]"  # the names of their errors in a status


def page_of(name: str, views: Mapping[str, ZoneView], status: dict[str, Any], energy: Sequence[Energy]) -> str:
    """The page of a zone, whose view has an empty name, or of several: verdicts, tomorrow, yesterday, the last week.

    ``energy`` is that of the last forecast.
    """
    several = "" not in views
    of = f"{len(views)} zones" if several else "a zone"
    head = f'<p class="soft">skhybrid: day-ahead forecast of {of}</p><h1>{escape(name)}</h1>\n'
    verdicts = _verdicts_of_zones(status) if several else verdict_boxes(_verdicts(status))
    state = _state_of_zones(status) if several else _state(status)
    sections = [head + verdicts, _tomorrow(views, several, energy), _yesterday(views, several), _week(views, several)]
    return html_page(f"{name}: forecast", [*sections, state, _LINKS], _REFRESH + (ZONE_STYLE if several else ""))


def _verdicts(state: dict[str, Any]) -> list[Verdict]:
    return [Verdict(**one) for one in state["verdicts"]]


def _verdicts_of_zones(status: dict[str, Any]) -> str:
    known = {zone: found for zone, state in status["zones"].items() if (found := _verdicts(state))}
    return f'<p class="verdict">{escape(zones_in_words(known))}</p>\n{zone_boxes(known)}' if known else ""


def _tomorrow(views: Mapping[str, ZoneView], several: bool, energy: Sequence[Energy]) -> str:
    rows = {zone: view.forecast for zone, view in views.items() if "T_za" in view.forecast}
    origin = next(iter(views.values())).origin
    if origin is None or not rows:
        return "<p>There is no forecast yet: post rows, or run <code>skhybrid zone tick</code>.</p>"
    first = next(iter(rows.values())).index[0]
    low, high = min(frame["T_za"].min() for frame in rows.values()), max(frame["T_za"].max() for frame in rows.values())
    of, bands = ("temperature of all zones", "bands are") if several else ("room temperature", "band is")
    cards = [(f"{low:.1f}–{high:.1f}\u00a0°C", f"{of} in the day to come")]
    scaled = all(view.scaled for view in views.values())
    if scaled:  # it need not cover a day
        cards += [(value, text.replace("that day", "in that time")) for value, text in energy_cards(energy)]
    relative = not scaled and any("Q_hvac" in frame for frame in rows.values())
    scale = " The heat has no certain scale: no capacity is known." if relative else ""

    def figure(width: float) -> Any:
        return days_figure(rows, width, "kW" if scaled else "relative") if several else day_figure(rows[""], width)

    return (
        f"{html_cards(cards)}<h2>The day to come</h2>\n<p>Forecast from {_stamp_words(first)}; the {bands} meant to "
        f"hold 80 % of the measurements.{scale}{_age_words(origin)}</p>\n"
        + in_two_widths(figure, "Forecast of temperature and heat.", "day")
    )


def _age_words(origin: pd.Timestamp) -> str:
    """A sentence on an origin that is old; else ""."""
    if origin.tz is None or pd.Timestamp.now(origin.tz) - origin <= _OLD:
        return ""
    return " It is more than a day old: no newer rows came in, or the weather to come was not known."


def _yesterday(views: Mapping[str, ZoneView], several: bool) -> str:
    """The last forecast that is over, if there is one, and what was measured."""
    head, rows = "<h2>Forecast and measured</h2>\n", {}
    first: pd.Timestamp | None = None
    for zone, view in views.items():
        past = view.past
        if past.empty or past["T_za"].isna().all():
            continue
        last = past[past["origin"] == past["origin"].max()].set_index("time")
        first = last.index[0] if first is None else first
        measured = last.drop(columns="origin").rename(columns={"Q_hvac_measured": "Q_hvac_delivered"})
        rows[zone] = measured.dropna(axis=1, how="all")
    if first is None:
        return head + "<p>No forecast is over yet.</p>"

    def figure(width: float) -> Any:
        return days_figure(rows, width) if several else day_figure(rows[""], width)

    words = f"<p>The last forecast that is over, from {_stamp_words(first)}.</p>\n"
    return head + words + in_two_widths(figure, "The last forecast that is over, and measurements.", "past")


def _week(views: Mapping[str, ZoneView], several: bool) -> str:
    """The forecasts and measurements of the last days."""
    past = [compared(view.past).assign(zone=zone) for zone, view in views.items() if len(view.past)]
    known = [rows for rows in past if rows["origin"].nunique() >= 2 and rows["y_true"].notna().any()]
    if not known:
        return ""
    frames, draw = {"forecast": pd.concat(known, ignore_index=True)}, weeks_figure if several else backtest_figure

    def figure(width: float) -> Any:
        return draw(frames, SHOWN_IN[width], width)

    words = "<p>The days before; a vertical line is the origin of a forecast.</p>\n"
    return words + in_two_widths(figure, "Past forecasts and measurements.", "week")


def _state(status: dict[str, Any]) -> str:
    rows = []
    for name, short in (("yesterday's forecast", "last one"), ("last four weeks", "four weeks")):
        for quantity in (_T, _LOAD):
            if errors := (status[name] or {}).get(quantity):
                shown = (f"{errors[key]:.2f}" for key in ("rmse", "bias"))
                rows.append((f"{short} {quantity[quantity.index('[') :]}", *shown, percent_or_dash(errors["coverage"])))
    facts = f"{_rows_words(status)} Drift: {_drift_words(status['drift'])}."
    table = html_table(("errors", "RMSE", "bias", "in band"), rows) if rows else ""
    return f"<h2>State</h2>\n{table}<p>{escape(facts)}</p>"


def _state_of_zones(status: dict[str, Any]) -> str:
    """Errors and drift, a row per zone."""
    rows = [(zone, *_errors(state), _drift_words(state["drift"])) for zone, state in status["zones"].items()]
    weeks = ("four weeks [K]", "bias [K]", "in band", _LOAD)
    heads = ("zone", "last one [K]", *weeks, "drift")
    words = (
        "RMSE of the last forecast that is over, and of those of four weeks with bias and share in the 80 % interval."
    )
    return (
        f'<h2>State</h2>\n{by_zone(heads, rows, n_texts=1)}<p class="soft">{words}</p>'
        f"<p>{escape(_rows_words(status))}</p>"
    )


def _errors(state: dict[str, Any]) -> list[str]:
    last, weeks = state["yesterday's forecast"] or {}, state["last four weeks"] or {}
    newest, all_of, load = (found or {} for found in (last.get(_T), weeks.get(_T), weeks.get(_LOAD)))
    numbers = [number(newest.get("rmse"), 2), number(all_of.get("rmse"), 2), number(all_of.get("bias"), 2)]
    return [*numbers, percent_or_dash(all_of.get("coverage")), number(load.get("rmse"), 2)]


def _rows_words(status: dict[str, Any]) -> str:
    """The last row, and until when the model learned."""
    return f"Last row: {status['last row'] or '–'}. Learned until: {status['learned until']}."


def _drift_words(drift: dict[str, Any]) -> str:
    """Whether errors have drifted."""
    if not drift:
        return "not known yet"
    return f"yes, since {drift['since']}" if drift["drifted"] else "no"


def _stamp_words(stamp: pd.Timestamp) -> str:
    """A stamp in words, with its time zone."""
    zone = f" ({escape(str(stamp.tz))})" if stamp.tz is not None else ""
    return f"{stamp:%A} {stamp.day} {stamp:%B %Y, %H:%M}{zone}"


def docs_page(description: dict[str, Any]) -> str:
    """The OpenAPI description as one page."""
    info, parts = description["info"], []
    for path, methods in description["paths"].items():
        for method, route in methods.items():
            codes = "; ".join(f"{code}: {one['description']}" for code, one in route["responses"].items())
            words = escape(route.get("description") or route.get("summary", ""))
            title = f"<code>{method.upper()} {escape(path)}</code>"
            parts.append(f'<h2>{title}</h2>\n<p>{words}</p><p class="soft">{escape(codes)}</p>')
    for name, schema in description["components"]["schemas"].items():
        rows = [(key, _kind(one), one.get("description", "")) for key, one in schema.get("properties", {}).items()]
        table = html_table(("field", "type", "meaning"), rows, n_texts=2) if rows else ""
        parts.append(f"<h2>{escape(name)}</h2>\n<p>{escape(schema.get('description', ''))}</p>{table}")
    links = '<p class="soft"><a href="/openapi.json">openapi.json</a> · <a href="/">the page of the zone</a></p>'
    title, version, summary = (escape(info[key]) for key in ("title", "version", "summary"))
    head = f'<p class="soft">{title} {version}</p><h1>Routes</h1><p>{summary}</p>'
    return html_page("Routes", [head, *parts, links])


def _kind(field: dict[str, Any]) -> str:
    if "anyOf" in field:
        return " or ".join(_kind(one) for one in field["anyOf"])
    if "items" in field:
        return f"list of {_kind(field['items'])}"
    return str(field.get("type") or field.get("$ref", "").rpartition("/")[2])
