"""Figures with a panel per zone, for files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ._forecast import DayAheadDisplay, ForecastDisplay
from ._room_map import RoomMapDisplay
from ._style import MARKERS, NARROW, legend, line_style, shared_legend, tidy
from .unshown_figure import blank_axes

_ROW = 1.75  # height of a panel [in]


def days_figure(forecasts: Mapping[str, pd.DataFrame], width: float = 9.0, power: str = "kW") -> Any:
    """The day to come of each zone: temperature and, where there is a plant, load, in the unit ``power``.

    The forecasts are as for DayAheadDisplay, with ``setpoint`` and measurements; ``width`` [in].
    """
    loads = any("Q_hvac" in frame for frame in forecasts.values())
    figure, axes = _panels(len(forecasts), 1 + loads, width)
    for row, (zone, frame) in zip(axes, forecasts.items(), strict=True):
        shown = row[: 1 + ("Q_hvac" in frame)]
        DayAheadDisplay.from_predictions(frame, **measured_and_setpoint(frame), ax=shown)
        for ax, unit in zip(shown, ("degC", power), strict=False):
            ax.set_ylabel(f"{zone} [{unit}]")
            ax.get_legend().remove()
            ax.set_xlabel("")
        for spare in row[len(shown) :]:
            spare.set_axis_off()
    shared_legend(axes.ravel())
    return figure


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
