"""Figures of the forecast benchmark: error by hour ahead, and by length of training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _forecast_data import KNOWN, group_of
from _forecast_models import AIR_ORACLE, ARX, HYBRID, ORACLE, REFITTED
from _forecast_store import HOURS
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from skhybrid.inspection._style import COLORS, grid_or_new, tidy

#: models that are drawn; more lines would hide one another
LINES = ("CONV", "hour-of-week mean", "ridge", ARX, REFITTED, HYBRID, ORACLE, AIR_ORACLE)
#: the same look in every figure
STYLES = {
    "yesterday": {"color": COLORS[5], "linestyle": ":"},
    "last temperature": {"color": COLORS[5], "linestyle": "--"},
    "CONV": {"color": COLORS[2], "linestyle": "-."},
    "hour-of-week mean": {"color": COLORS[4], "linestyle": ":"},
    "ridge": {"color": COLORS[3], "linestyle": (0, (5, 1))},
    ARX: {"color": COLORS[1], "linestyle": "--"},
    REFITTED: {"color": COLORS[1], "linestyle": "-"},
    HYBRID: {"color": COLORS[0], "linestyle": "-", "linewidth": 2.6},
    ORACLE: {"color": "#777777", "linestyle": ":"},
    AIR_ORACLE: {"color": "#777777", "linestyle": "-"},
}
#: models that set the height of a panel
_FRAME = ("ridge", ARX, REFITTED, HYBRID)


def draw(runs: dict[tuple[str, str], list[Any]], path: Path) -> Path:
    """Write the figure, complete or not at all."""
    datas = [d for d in dict.fromkeys(data for data, _ in runs) if not (group_of(d) or d.endswith(KNOWN))]
    axes = grid_or_new(None, len(datas), 4, (3.3, 2.5))
    for ax, data in zip(axes, datas, strict=True):
        _panel(ax, {model: mine for (name, model), mine in runs.items() if name == data}, data)
    for ax in axes[-4:]:
        ax.set_xlabel("hours ahead")
    return _saved(axes, path)


def draw_learning(frame: pd.DataFrame, models: tuple[str, ...], path: Path) -> Path:
    """Error by days of training, one panel per log: one point per date, and a line of their geometric means."""
    logs = list(dict.fromkeys(frame["log"]))
    axes = grid_or_new(None, len(logs), 3, (4.4, 3.0))
    for ax, log in zip(axes, logs, strict=True):
        for model in models:
            mine = frame[(frame["log"] == log) & (frame["model"] == model)]
            if mine.empty:
                continue
            style = {"linewidth": 1.5, **STYLES[model]}
            curve = np.exp(np.log(mine["rmse"]).groupby(mine["days"]).mean())
            ax.plot(curve.index, curve, label=model, marker="o", markersize=3.5, **style)
            ax.plot(mine["days"], mine["rmse"], ".", color=style["color"], alpha=0.35, markersize=4)
        tidy(ax, ylabel="RMSE [K]", xlabel="days of training", title=log)
        ax.set(xscale="log", yscale="log", xticks=sorted(frame["days"].unique()))
        ax.xaxis.set_major_formatter("{x:.0f}")
        ax.xaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter(NullFormatter())
    return _saved(axes, path)


def _saved(axes: np.ndarray, path: Path) -> Path:
    """Write a figure, complete or not at all."""
    entries: dict[str, Any] = {}
    for ax in axes:
        entries |= {label: handle for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    order = [name for name in STYLES if name in entries]
    handles = [entries[name] for name in order]
    axes[0].figure.legend(
        handles,
        order,
        loc="outside upper left",
        ncols=3 if len(axes) < 3 else len(order),
        frameon=False,
        handlelength=3,
    )
    part = path.with_suffix(".part")
    axes[0].figure.savefig(part, format="png", dpi=110)
    part.replace(path)
    plt.close(axes[0].figure)
    return path


def _panel(ax: Any, models: dict[str, list[Any]], title: str) -> None:
    hours = np.arange(1, HOURS + 1)
    curves = {name: _curve(mine) for name, mine in models.items()}
    for name in LINES:
        if name in curves:
            ax.plot(hours, curves[name], label=name, **{"linewidth": 1.5, **STYLES[name]})
    tidy(ax, ylabel="RMSE [K]", title=title)
    top = max((curves[name].max() for name in _FRAME if name in curves), default=None)
    ax.set_ylim(0.0, None if top is None else 1.25 * top)
    ax.set_xlim(1, HOURS)
    ax.set_xticks([1, 6, 12, 18, 24])


def _curve(mine: list[Any]) -> np.ndarray:
    """(24,) mean over seeds of the error by hour ahead."""
    curves = [np.sqrt(r.temperature.square.sum(axis=0) / r.temperature.count.sum(axis=0)) for r in mine]
    return np.mean(curves, axis=0)
