"""Figures of the study of the paper's sections 4.3 and 4.4; ``paper_forecast.py`` calls them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _paper_forecast_data import Log
from _report import RESULTS

from skhybrid.inspection._style import COLORS, MEASURED, shared_legend, tidy, time_axis

#: methods that are drawn, and their labels
DRAWN = {"OD, no disturbance": "conventional", "hybrid OD, LSTM": "hybrid, LSTM", "default": "hybrid, default"}
STYLE = {
    "OD, no disturbance": {"color": COLORS[1], "linestyle": "--"},
    "hybrid OD, LSTM": {"color": COLORS[0], "linestyle": "-"},
    "default": {"color": COLORS[2], "linestyle": "-."},
}
#: five days from a Friday on: a weekend between working days
FIRST_DAY = {
    "oakland": "2024-01-12",
    "chicago": "2024-01-12",
    "home 2": "2021-12-10",
    "home 3": "2021-12-10",
    "small office": "2018-11-09",
}
WINDOWS = ("0-6 h", "6-12 h", "12-18 h", "18-24 h")


def draw_all(
    shown: dict[str, tuple[Log, dict[str, pd.DataFrame]]], runs: dict[str, list[pd.DataFrame]], folder: Path = RESULTS
) -> None:
    """Draw and save every figure; ``shown`` holds the first run of every log."""
    for name, (log, said) in shown.items():
        save(draw_days(name, log, said), name, folder)
    save(draw_windows(runs), "windows", folder)


def save(figure: Any, name: str, folder: Path = RESULTS) -> Path:
    """Write a PNG, completely or not at all."""
    folder.mkdir(exist_ok=True)
    path = folder / f"paper_forecast_{name.replace(' ', '_')}.png"
    part = path.with_suffix(".part")
    figure.savefig(part, format="png", dpi=110)
    part.replace(path)
    plt.close(figure)
    return path


def draw_days(name: str, log: Log, said: dict[str, pd.DataFrame]) -> Any:
    """Temperature and hourly heat of five days, a line at every origin, the RMSE of each day above."""
    first = pd.Timestamp(FIRST_DAY[name], tz=log.after.index.tz)
    rows = log.after[first : first + pd.Timedelta("5D") - pd.Timedelta("15min")]
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(10, 5.6), layout="constrained")
    above.plot(rows.index, rows["T_za"], color=MEASURED, linewidth=1.8, label="measured")
    heat = log.heat(rows).resample("1h").mean()
    below.step(heat.index, heat, where="post", color=MEASURED, linewidth=1.8, label="measured")
    for method, label in DRAWN.items():
        mine = said[method].loc[rows.index]
        above.plot(mine.index, _broken(mine["temperature"]), **STYLE[method], linewidth=1.3, label=label)
        load = mine["load"].resample("1h").mean()
        below.step(load.index, load, where="post", **STYLE[method], linewidth=1.2, label=label)
    for ax in (above, below):
        for day in pd.date_range(first, periods=5, freq="1D"):
            ax.axvline(day, color="#bbbbbb", linewidth=0.8, zorder=0)
    for i in range(5):
        _mark_day(above, rows, said, first + pd.Timedelta(days=i))
    tidy(above, ylabel="zone temperature [°C]")
    tidy(below, ylabel="heat [kW]")
    above.margins(y=0.16)
    time_axis(below, rows.index)
    shared_legend(np.array([above, below]), f"{name.capitalize()}: a day ahead from every midnight; RMSE [K] by day")
    return figure


def _broken(series: pd.Series) -> pd.Series:
    """A break at every midnight, where the next forecast begins."""
    return series.where(series.index != series.index.normalize())


def _mark_day(ax: Any, rows: pd.DataFrame, said: dict[str, pd.DataFrame], day: pd.Timestamp) -> None:
    """The day's RMSE of each method, in its colour."""
    end = day + pd.Timedelta("1D")
    inside = rows.index[(rows.index > day) & (rows.index < end)]
    for j, method in enumerate(DRAWN):
        error = said[method].loc[inside, "temperature"] - rows.loc[inside, "T_za"]
        place = day + pd.Timedelta("5h") + j * pd.Timedelta("7h")
        ax.annotate(
            f"{np.sqrt((error**2).mean()):.2f}",
            (place, 0.97),
            xycoords=("data", "axes fraction"),
            color=STYLE[method]["color"],
            fontsize="small",
            ha="center",
            va="top",
        )


def draw_windows(runs: dict[str, list[pd.DataFrame]]) -> Any:
    """Temperature above and load below: RMSE by 6-hour window, one column per log, one dot per run."""
    figure, axes = plt.subplots(2, len(runs), figsize=(2.5 * len(runs) + 1, 5.2), layout="constrained", squeeze=False)
    place = np.arange(len(WINDOWS))
    for column, (name, frames) in enumerate(runs.items()):
        for ax, unit in zip(axes[:, column], ("K", "kW"), strict=True):
            for j, (method, label) in enumerate(DRAWN.items()):
                values = np.array([[f.loc[method, f"{w} {unit}"] for w in WINDOWS] for f in frames])
                x = place + 0.26 * (j - 1)
                ax.bar(x, np.median(values, axis=0), 0.24, color=STYLE[method]["color"], label=label)
                ax.plot(np.tile(x, (len(frames), 1)).ravel(), values.ravel(), ".", color="#222222", markersize=3)
            ax.set_xticks(place, ["0-6", "6-12", "12-18", "18-24"])
            label = {"K": "temperature, RMSE [K]", "kW": "load, RMSE [kW]"}[unit] if column == 0 else ""
            tidy(ax, ylabel=label, title=name if unit == "K" else None)
            ax.grid(False, axis="x")
        axes[1, column].set_xlabel("hour of the day")
    shared_legend(axes.ravel(), "Forecasts from midnight: RMSE by 6-hour window")
    return figure
