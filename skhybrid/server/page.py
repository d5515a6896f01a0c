"""The page of a zone, and the page that describes the routes: HTML without scripts or anything from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import pandas as pd

from ..study.report.figures import NARROW, WIDE, backtest_figure, day_figure, in_two_widths
from ..study.report.html import day_energy, html_cards, html_page, html_table, verdict_boxes
from ..study.report.words import percent_or_dash
from ..study.verdict import Verdict
from .zone_view import ZoneView, compared

REFRESH = '<meta http-equiv="refresh" content="300">\n'
SPANS = {WIDE: pd.Timedelta("7D"), NARROW: pd.Timedelta("3D")}  # of past days in a figure
LINKS = '<p class="soft">{}</p>'.format(
    " · ".join(f'<a href="/{path}">{path}</a>' for path in ("forecast", "status", "docs"))
)
NO_FORECAST = "<p>There is no forecast yet: post rows, or run <code>skhybrid zone tick</code>.</p>"
_OLD = pd.Timedelta(days=1)


def zone_page(view: ZoneView, status: dict[str, Any]) -> str:
    """The page of a zone: verdict, tomorrow, yesterday, and the last week."""
    head = f'<p class="soft">skhybrid: day-ahead forecast of a zone</p><h1>{escape(view.name)}</h1>\n'
    sections = [
        head + verdict_boxes([Verdict(**one) for one in status["verdicts"]]),
        _tomorrow(view),
        _yesterday(view),
        _week(view),
        _state(status),
        LINKS,
    ]
    return html_page(f"{view.name}: forecast", sections, REFRESH)


def _tomorrow(view: ZoneView) -> str:
    if view.origin is None:
        return NO_FORECAST
    rows = view.forecast
    low, high = rows["T_za"].min(), rows["T_za"].max()
    cards = [(f"{low:.1f}–{high:.1f}\u00a0°C", "room temperature in the day to come")]
    if view.scaled:
        cards += energy_cards(rows)
    unscaled = not view.scaled and "Q_hvac" in rows
    return day_to_come(cards, view.origin, "band is", unscaled, lambda width: day_figure(rows, width))


def day_to_come(
    cards: list[tuple[str, str]], origin: pd.Timestamp, bands: str, unscaled: bool, figure: Callable[[float], Any]
) -> str:
    """The section on the latest forecast, of which ``figure`` makes a drawing of some width."""
    scale = " The heat has no certain scale: no capacity is known." if unscaled else ""
    return (
        f"{html_cards(cards)}<h2>The day to come</h2>\n<p>Forecast from {_stamp_words(origin)}; the {bands} meant to "
        f"hold 80 % of the measurements.{scale}{_age_words(origin)}</p>\n"
        + in_two_widths(figure, "Forecast of temperature and heat.", "day")
    )


def energy_cards(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Energies of a forecast as cards; it need not cover a day."""
    return [(value, text.replace("that day", "in that time")) for value, text in day_energy(rows)]


def _age_words(origin: pd.Timestamp) -> str:
    """A sentence on an origin that is old; else ""."""
    if origin.tz is None or pd.Timestamp.now(origin.tz) - origin <= _OLD:
        return ""
    return " It is more than a day old: no newer rows came in, or the weather to come was not known."


def _yesterday(view: ZoneView) -> str:
    origin, rows = (None, view.past) if view.past.empty else last_past(view)
    return past_day(origin, lambda width: day_figure(rows, width))


def past_day(origin: pd.Timestamp | None, figure: Callable[[float], Any]) -> str:
    """The section on the last forecast that is over, if there is one."""
    head = "<h2>Forecast and measured</h2>\n"
    if origin is None:
        return head + "<p>No forecast is over yet.</p>"
    words = f"<p>The last forecast that is over, from {_stamp_words(origin)}.</p>\n"
    return head + words + in_two_widths(figure, "The last forecast that is over, and measurements.", "past")


def last_past(view: ZoneView) -> tuple[pd.Timestamp, pd.DataFrame]:
    """Origin and rows of the last forecast that is over, with what was measured."""
    last = view.past[view.past["origin"] == view.past["origin"].max()].set_index("time")
    rows = last.drop(columns="origin").rename(columns={"Q_hvac_measured": "Q_hvac_delivered"}).dropna(axis=1, how="all")
    return last["origin"].iloc[0], rows


def _week(view: ZoneView) -> str:
    rows = compared(view.past)
    if rows["origin"].nunique() < 2 or rows["y_true"].isna().all():
        return ""
    return days_before(lambda width: backtest_figure({"forecast": rows}, SPANS[width], width))


def days_before(figure: Callable[[float], Any]) -> str:
    """The forecasts and measurements of the last days."""
    words = "<p>The days before; a vertical line is the origin of a forecast.</p>\n"
    return words + in_two_widths(figure, "Past forecasts and measurements.", "week")


def _state(status: dict[str, Any]) -> str:
    rows = []
    for name, short in (("yesterday's forecast", "last one"), ("last four weeks", "four weeks")):
        for quantity in ("temperature [K]", "load [kW]"):
            if errors := (status[name] or {}).get(quantity):
                shown = (f"{errors[key]:.2f}" for key in ("rmse", "bias"))
                rows.append((f"{short} {quantity[quantity.index('[') :]}", *shown, percent_or_dash(errors["coverage"])))
    facts = f"{rows_words(status)} Drift: {drift_words(status['drift'])}."
    table = html_table(("errors", "RMSE", "bias", "in band"), rows) if rows else ""
    return f"<h2>State</h2>\n{table}<p>{escape(facts)}</p>"


def rows_words(status: dict[str, Any]) -> str:
    """The last row, and until when the model learned."""
    return f"Last row: {status['last row'] or '–'}. Learned until: {status['learned until']}."


def drift_words(drift: dict[str, Any]) -> str:
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
