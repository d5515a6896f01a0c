"""Figures with a panel per zone, for files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ._forecast import DayAheadDisplay, ForecastDisplay
from ._room_map import RoomMapDisplay
from ._style import MARKERS, NARROW, legend, line_style, shared_legend, tidy, time_axis
from .unshown_figure import blank_axes

_ROW = 1.75  # height of a panel [in]


def days_figure(forecasts: Mapping[str, pd.DataFrame], width: float = 9.0, power: str = "kW") -> Any:
    """The day to come of each zone: temperature and, where there is a plant, load, in the unit ``power``.

    The forecasts are as for DayAheadDisplay, with ``setpoint`` and measurements; ``width`` [in].
    """
    figure, axes = _panels(len(forecasts), _n_of_day(forecasts), width)
    _draw_days(axes, forecasts, power)
    shared_legend(axes.ravel())
    return figure


def weeks_and_days_figure(
    frames: Mapping[str, pd.DataFrame],
    forecasts: Mapping[str, pd.DataFrame],
    shown: pd.Timedelta,
    width: float = 9.0,
    power: str = "kW",
    title: str | None = None,
) -> Any:
    """A row per zone: its temperature over the last days of back-tests, and its day to come as in ``days_figure``.

    ``forecasts`` are in the order of the zones of ``frames``; ``width`` of two columns [in].
    """
    n_columns = 1 + _n_of_day(forecasts)
    size = width * n_columns / 2, _ROW * len(forecasts) + 1.0
    figure, axes = blank_axes(len(forecasts), size, n_columns, share="col")
    axes = axes.reshape(-1, n_columns)
    last = next(iter(frames.values()))["time"].max()
    ForecastDisplay.from_predictions(frames, ax=axes[:, 0], start=last - shown)
    _draw_days(axes[:, 1:], forecasts, power)
    title_parts(axes[0])
    axes[-1, 0].set_xlabel("")
    time_axis(axes[-1, 1], next(iter(forecasts.values())).index)
    axes[-1, 1].set_xlabel("")
    figure.legends.clear()  # that of the back-test alone
    shared_legend(axes.ravel(), title)
    return figure


def title_parts(axes: np.ndarray) -> None:
    """Title the first of some axes as a back-test, and the second as the next day."""
    for ax, text in zip(axes, ("back-test", "the next day"), strict=False):
        ax.set_title(text, loc="right", fontsize="small", color="#555555")


def _n_of_day(forecasts: Mapping[str, pd.DataFrame]) -> int:
    """Number of panels of the day of a zone: its temperature, and its load where some zone has one."""
    return 1 + any("Q_hvac" in frame for frame in forecasts.values())


def _draw_days(axes: np.ndarray, forecasts: Mapping[str, pd.DataFrame], power: str) -> None:
    """The day to come of each zone in its row of (n_zones, n_panels) axes."""
    for row, (zone, frame) in zip(axes, forecasts.items(), strict=True):
        shown = row[: 1 + ("Q_hvac" in frame)]
        DayAheadDisplay.from_predictions(frame, **measured_and_setpoint(frame), ax=shown)
        for ax, unit in zip(shown, ("degC", power), strict=False):
            ax.set_ylabel(f"{zone} [{unit}]")
            ax.get_legend().remove()
            ax.set_xlabel("")
        for spare in row[len(shown) :]:
            spare.set_axis_off()


def measured_and_setpoint(forecast: pd.DataFrame) -> dict[str, Any]:
    """Measurements of a day, and its set-point, where it is not the measured temperature itself."""
    renamed = {"T_za_measured": "T_za", "Q_hvac_delivered": "Q_hvac"}
    measured = forecast[[c for c in renamed if c in forecast]].rename(columns=renamed)
    held = forecast.get("setpoint")
    if held is not None and "T_za" in measured and (held - measured["T_za"]).abs().max() < 1e-9:
        held = None
    return {"measured": measured if "T_za" in measured else None, "setpoint": held}


def weeks_figure(
    frames: Mapping[str, pd.DataFrame], shown: pd.Timedelta, width: float = 9.0, unit: str = "degC"
) -> Any:
    """Measured and forecast temperature, or load, of each zone over the last days of back-tests; ``width`` [in]."""
    first = next(iter(frames.values()))
    n_zones = first["zone"].nunique()
    n_columns = 1 if width < NARROW else min(2, n_zones)
    figure, axes = _panels(-(-n_zones // n_columns), n_columns, width)
    panels = axes.ravel()[:n_zones]
    ForecastDisplay.from_predictions(frames, ax=panels, start=first["time"].max() - shown, unit=unit)
    for ax in panels:
        ax.set_xlabel("")
    for spare in axes.ravel()[n_zones:]:
        spare.set_axis_off()
        panels[-n_columns].tick_params(labelbottom=True)
    return figure


def errors_figure(errors: pd.DataFrame, width: float = 9.0) -> Any:
    """Errors of each zone (rows) by model (columns) [K], the first zone on top."""
    figure, axes = blank_axes(1, (width, 0.4 * len(errors) + 1.6))
    ax, places = axes[0], np.arange(len(errors))
    for number, (label, values) in enumerate(errors.items()):
        style = {"linestyle": "none", "marker": MARKERS[number % len(MARKERS)], "markersize": 7.0}
        ax.plot(values, places, label=label, color=line_style(number)["color"], **style)
    ax.set_yticks(places, list(map(str, errors.index)))
    ax.set_ylim(len(errors) - 0.5, -0.5)
    ax.set_xlim(left=0.0)
    tidy(ax, ylabel="", xlabel="RMSE of temperature [K]")
    legend(ax)
    return figure


def map_figure(
    couplings: Mapping[tuple[str, str], float | None], errors: Mapping[str, float | None], width: float = 9.0
) -> Any:
    """The map of the rooms, as RoomMapDisplay draws it."""
    display = RoomMapDisplay(couplings, errors)
    figure, axes = blank_axes(1, display.size(width))
    display.plot(axes[0])
    return figure


def _panels(n_rows: int, n_columns: int, width: float) -> tuple[Any, np.ndarray]:
    """A figure and its (n_rows, n_columns) axes; of a narrow figure the columns of a row are below one another."""
    stacked = n_columns if width < NARROW else 1
    figure, axes = blank_axes(n_rows * stacked, (width, _ROW * n_rows * stacked + 0.6), n_columns // stacked)
    return figure, axes.reshape(n_rows, n_columns)
