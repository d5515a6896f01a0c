"""The figures of a report."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Mapping
from html import escape
from os import PathLike
from typing import Any

import pandas as pd

from ..._files import atomic_path
from ...inspection import DayAheadDisplay, DisturbanceWeekDisplay, ForecastDisplay, LeadErrorDisplay, ScheduleDisplay
from ...inspection.unshown_figure import blank_axes, svg_text
from ...inspection.zone_panels import days_figure as days_figure
from ...inspection.zone_panels import errors_figure as errors_figure
from ...inspection.zone_panels import map_figure as map_figure
from ...inspection.zone_panels import measured_and_setpoint, title_parts
from ...inspection.zone_panels import weeks_figure as weeks_figure
from ..compared_models import HYBRID

WIDE, NARROW = 9.0, 4.4  # of a figure [in]
SHOWN = pd.Timedelta("7D")  # last part of the back-test that a figure shows
SHOWN_IN = {WIDE: SHOWN, NARROW: pd.Timedelta("3D")}  # the same, by the width of the figure
_MOST_LINES = 3  # most models in a figure; more would hide one another
_MOST_LEADS = 5
_PNG: dict[str, Any] = {"format": "png", "dpi": 130, "facecolor": "white", "metadata": {"Software": None}}
#: parts of an SVG that the page has itself, its size, and colours that follow the page
_NO_STYLE = re.compile(
    r"""<metadata>.*?</metadata>|<style[^>]*>.*?</style>|font-family: [^;"]*;?|(?<=<g) id="[^"]*\""""
)
_SIZE = re.compile(r"<svg [^>]*?(?=viewBox)")
_COLOURS = {"#222222": "currentColor", "#000000": "currentColor", "#dddddd": "var(--line)", "#bbbbbb": "var(--line)"}
_COLOURS |= {"#0072b2": "var(--mark)", "#d55e00": "var(--warm)", "#fefefe": "var(--page)"}


def as_image(figure: Any) -> str:
    """A figure as a ``data:`` address, to be put into an HTML page."""
    buffer = io.BytesIO()
    figure.savefig(buffer, **_PNG)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def save_png(figure: Any, path: str | PathLike[str]) -> None:
    """Write a figure to a PNG file, in one step."""
    with atomic_path(path) as made:
        figure.savefig(made, **_PNG)


def as_svg(figure: Any, label: str, name: str) -> str:
    """A figure as an SVG element that takes text, lines and fonts of the page, so that it follows its dark mode.

    ``label`` describes the figure to those who do not see it; ``name``, from which identifiers are made, must differ
    between the figures of a page.
    """
    text = svg_text(figure, name)
    text = _NO_STYLE.sub("", text[text.index("<svg") :].replace("\n", " "))
    text = _SIZE.sub(f'<svg role="img" aria-label="{label}" ', text, count=1)
    for colour, own in _COLOURS.items():
        text = text.replace(colour, own)
    return text


def in_two_widths(draw: Callable[[float], Any], caption: str, name: str) -> str:
    """A figure that is drawn by its width [in] as HTML in two widths, of which the style shows one.

    ``name`` must differ between the figures of a page: identifiers are made from it.
    """
    text = escape(caption, quote=True)
    drawn = "".join(
        f'<div class="{kind}">{as_svg(draw(width), text, f"{name}-{kind}")}</div>'
        for kind, width in (("wide-figure", WIDE), ("narrow-figure", NARROW))
    )
    return f'<figure tabindex="0">{drawn}<figcaption>{text}</figcaption></figure>\n'


def day_figure(forecast: pd.DataFrame, width: float = WIDE) -> Any:
    """The next day: temperature and, where there is a plant, load."""
    n_axes = 2 if "Q_hvac" in forecast else 1
    figure, axes = blank_axes(n_axes, (width, 2.5 * n_axes + 0.7))
    DayAheadDisplay.from_predictions(forecast, **measured_and_setpoint(forecast), ax=axes)
    return figure


def backtest_figure(frames: Mapping[str, pd.DataFrame], shown: pd.Timedelta = SHOWN, width: float = WIDE) -> Any:
    """Measured and forecast temperature over the last days of back-tests, the most important first."""
    figure, axes = blank_axes(1, (width, 3.6))
    _draw_backtest(axes[0], frames, shown)
    return figure


def _draw_backtest(ax: Any, frames: Mapping[str, pd.DataFrame], shown: pd.Timedelta) -> None:
    chosen = dict(list(frames.items())[:_MOST_LINES])
    last = next(iter(chosen.values()))["time"].max()
    ForecastDisplay.from_predictions(chosen, ax=ax, start=last - shown)


def held_figure(frame: pd.DataFrame, load: pd.Series, own: pd.Series, unit: str) -> Any:
    """Temperature and load over the last days of a back-test under set-points; ``load`` is measured [unit]."""
    figure, axes = blank_axes(2, (WIDE, 5.6))
    _draw_backtest(axes[0], {HYBRID: frame}, SHOWN)
    loads = loads_backtest(frame, load, own, unit)
    _draw_backtest(axes[1], {HYBRID: loads}, SHOWN)
    axes[1].set_ylabel("heat [kW]" if unit == "kW" else "stages [-]")
    return figure


def loads_backtest(frame: pd.DataFrame, load: pd.Series, own: pd.Series, unit: str) -> pd.DataFrame:
    """A back-test of ``own`` load beside the measured ``load`` [unit], with an interval where that is of the whole."""
    banded = unit == "kW" and "Q_total_pred" not in frame  # beside stages the load may be the meter's part alone
    bands = {f"q_{level}": frame[f"Q_hvac_{level}"] for level in (0.1, 0.9) if banded and f"Q_hvac_{level}" in frame}
    return frame[["origin", "lead", "time"]].assign(y_true=load, y_pred=own, **bands)


def lead_figure(frames: Mapping[str, pd.DataFrame], width: float = WIDE) -> Any:
    """Error by lead of back-tests, the most important first."""
    figure, axes = blank_axes(1, (width, 3.4))
    LeadErrorDisplay.from_predictions(dict(list(frames.items())[:_MOST_LEADS]), ax=axes[0])
    return figure


def week_figure(zeta: pd.Series, truth: pd.Series | None = None) -> Any:
    """Estimated disturbance and, where it is known, the true heat [kW] by hour of the week."""
    figure, axes = blank_axes(1, (WIDE, 3.2))
    DisturbanceWeekDisplay.from_predictions(zeta, truth=truth, ax=axes[0])
    return figure


def schedule_figure(schedule: pd.DataFrame) -> Any:
    """Learned ``gain`` [kW] and ``ua`` [kW/K] by hour; the index of the schedule is (day, hour)."""
    figure, axes = blank_axes(2, (WIDE, 4.4))
    ScheduleDisplay.from_predictions(schedule, ax=axes)
    return figure


def study_picture(
    path: str | PathLike[str], frames: Mapping[str, pd.DataFrame], forecast: pd.DataFrame, title: str | None = None
) -> None:
    """Write one PNG file of a study: a week of its back-tests, the most important first, and the next day."""
    n_axes = 2 if "Q_hvac" in forecast else 1
    figure, axes = blank_axes(1 + n_axes, (WIDE, 3.2 + 2.3 * n_axes), share=False)
    _draw_backtest(axes[0], frames, SHOWN)
    title_parts(axes)
    DayAheadDisplay.from_predictions(forecast, **measured_and_setpoint(forecast), ax=axes[1:])
    if n_axes == 2:
        axes[1].sharex(axes[2])
        axes[1].tick_params(labelbottom=False)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
    save_png(figure, path)
