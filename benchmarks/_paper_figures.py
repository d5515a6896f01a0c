"""Figures of the study of the paper's section 2; ``paper_identification.py`` calls them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _paper_claims import FREE, PAPER_TABLE
from _report import RESULTS

from skhybrid.identification import make_state_space
from skhybrid.inspection import BodeDisplay, StepResponseDisplay
from skhybrid.inspection._style import COLORS, DASHES, MEASURED, WEEKDAYS, legend, shared_legend, tidy, time_axis

MODELS = ("CONV", "ID", "OD", "ours")
#: colour and dashes of a model, the same in every figure
STYLE = {name: {"color": c, "linestyle": d} for name, c, d in zip(MODELS, COLORS, DASHES, strict=False)}
STYLE["TRUE"] = {"color": "#999999", "linestyle": "-", "linewidth": 2.8}


def draw_all(case: Any, works: dict[str, Any], fitted: dict[str, Any], runs: list[pd.DataFrame]) -> None:
    """Draw and save every figure."""
    draw_responses(case.office.theta, fitted)
    draw_parameters(runs)
    draw_days(case, {name: works[name].with_gain for name in ("TRUE", *MODELS)}, "with_gain", origin_days=3)
    draw_days(case, {name: works[name].without_gain for name in ("TRUE", *MODELS)}, "without_gain", origin_days=1)
    draw_runtime(case, works)
    draw_data(case)
    draw_week(case, fitted)
    draw_disturbance(case, works)


def weeks(series: pd.Series) -> pd.DataFrame:
    """Hourly means, one row per hour of the week and one column per week."""
    hourly = series.resample("1h").mean()
    hours = hourly.index.day_of_week * 24 + hourly.index.hour
    number = (hourly.index - hourly.index[0]).days // 7
    table = pd.DataFrame({"hour": hours, "week": number, "heat": hourly.to_numpy()})
    return table.pivot_table(values="heat", index="hour", columns="week")


def save(figure: Any, name: str) -> Path:
    """Write a PNG, completely or not at all."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"paper_{name}.png"
    part = path.with_suffix(".part")
    figure.savefig(part, format="png", dpi=110)
    part.replace(path)
    plt.close(figure)
    return path


def draw_responses(truth: dict[str, float], fitted: dict[str, Any]) -> None:
    """Bode magnitudes and step responses of every input."""
    true = make_state_space("2R2C", truth)
    models = {name: fitted[name] for name in MODELS}
    save(BodeDisplay.from_estimator(models, truth=true).figure_, "bode")
    save(StepResponseDisplay.from_estimator(models, truth=true, duration="12h").figure_, "step")


def draw_parameters(runs: list[pd.DataFrame]) -> None:
    """Each parameter as a factor of the truth: one dot per seed, and a cross for the paper's rescaled number."""
    figure, ax = plt.subplots(figsize=(9, 3.8), layout="constrained")
    for j, name in enumerate(MODELS):
        place = np.arange(len(FREE)) + 0.18 * (j - 1.5)
        for run in runs:
            ax.plot(place, run.loc[name, list(FREE)], ".", color=STYLE[name]["color"], markersize=7, alpha=0.7)
        ax.plot([], [], ".", color=STYLE[name]["color"], markersize=7, label=name)
        if name in PAPER_TABLE.index:
            ax.plot(place, runs[0].loc[f"paper {name}", list(FREE)], "x", color=STYLE[name]["color"])
    ax.plot([], [], "x", color="#444444", label="paper, rescaled")
    ax.axhline(1.0, color=MEASURED, linewidth=1.0)
    ax.set_yscale("log")
    ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 40]
    ax.set_yticks(ticks, [f"{t:g}" for t in ticks])
    ax.minorticks_off()
    ax.set_xticks(range(len(FREE)), FREE)
    tidy(ax, ylabel="estimated / true [-]")
    legend(ax)
    save(figure, "parameters")


def draw_days(case: Any, predicted: dict[str, pd.Series], name: str, origin_days: int) -> None:
    """Measured and predicted temperature over the test days, and the true gain below; a line at every origin."""
    figure, (above, below) = plt.subplots(
        2, 1, sharex=True, figsize=(10, 5.2), height_ratios=(3, 1), layout="constrained"
    )
    measured, gain = case.office.y[case.test], case.office.heat_gain[case.test]
    for label, series in predicted.items():
        above.plot(series, label=label, **STYLE[label])
    above.plot(measured, color=MEASURED, linewidth=1.2, label="measured")
    for origin in measured.index[:: 96 * origin_days]:
        above.axvline(origin, color="#bbbbbb", linewidth=0.8, zorder=0)
    below.plot(gain, color="#b8860b", linewidth=1.2)
    tidy(above, ylabel="zone temperature [degC]")
    tidy(below, ylabel="true gain [kW]")
    shared_legend(np.array([above]))
    time_axis(below, measured.index)
    save(figure, name)


def draw_data(case: Any) -> None:
    """A week of the identification data: weather, set-points and temperature, runtimes, unmeasured heat."""
    rows = slice(0, 7 * 96)
    X, setpoints, gain = case.office.X[rows], case.office.setpoints[rows], case.office.heat_gain[rows]
    figure, axes = plt.subplots(4, 1, sharex=True, figsize=(10, 8), height_ratios=(2, 3, 2, 2), layout="constrained")
    axes[0].plot(X["T_oa"], color=COLORS[0], linewidth=1.2)
    tidy(axes[0], ylabel="outdoors [degC]")
    sun = axes[0].twinx()
    sun.fill_between(X.index, X["q_sol"], color="#e0c060", alpha=0.5, linewidth=0)
    sun.set_ylabel("sun [kW/m2]")
    axes[1].plot(case.office.y[rows], color=MEASURED, linewidth=1.2, label="zone")
    for column, color, label in (("T_heat_set", COLORS[1], "heating"), ("T_cool_set", COLORS[0], "cooling")):
        axes[1].step(X.index, setpoints[column], where="post", color=color, linewidth=1.0, label=f"{label} set-point")
    tidy(axes[1], ylabel="temperature [degC]")
    legend(axes[1])
    for role, color, label in (("u_heat", COLORS[1], "heating"), ("u_cool", COLORS[0], "cooling")):
        hourly = X[role].resample("1h").mean()
        axes[2].step(hourly.index, hourly, where="post", color=color, linewidth=1.2, label=label)
    tidy(axes[2], ylabel="runtime [-]")
    legend(axes[2])
    axes[3].plot(gain, color="#b8860b", linewidth=1.2)
    tidy(axes[3], ylabel="gain [kW]")
    time_axis(axes[3], X.index)
    save(figure, "data")


def draw_week(case: Any, fitted: dict[str, Any]) -> None:
    """The input disturbance that ID estimates, beside the true gain, and the output disturbance that OD estimates."""
    X = case.office.X[: 7 * 96]
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(10, 5.4), layout="constrained")
    above.plot(case.office.heat_gain[X.index], color="#b8860b", linewidth=1.2, label="true unmeasured heat")
    above.plot(fitted["ID"].estimate_disturbance(X, "input"), color=COLORS[0], linewidth=1.2, label="input disturbance")
    output = fitted["OD"].estimate_disturbance(X, "output")
    below.plot(output, color=COLORS[2], linewidth=1.2, label="output disturbance")
    tidy(above, ylabel="ID [kW]")
    tidy(below, ylabel="OD [K]")
    legend(above)
    legend(below)
    time_axis(below, X.index)
    save(figure, "week")


def draw_runtime(case: Any, works: dict[str, Any]) -> None:
    """Hourly cooling runtime that holds the measured temperature, one panel per model, over the measured one."""
    true = case.office.X["u_cool"][case.test].resample("1h").mean()
    figure, axes = plt.subplots(len(MODELS), 1, sharex=True, sharey=True, figsize=(10, 7), layout="constrained")
    for ax, name in zip(axes, MODELS, strict=True):
        ax.fill_between(true.index, true, step="post", color="#cccccc", label="measured")
        ax.step(true.index, works[name].runtime, where="post", color=STYLE[name]["color"], linewidth=1.2, label=name)
        tidy(ax, ylabel="runtime [-]")
        ax.legend(loc="upper right", frameon=False, fontsize="small", ncols=2)
    time_axis(axes[-1], true.index)
    save(figure, "runtime")


def draw_disturbance(case: Any, works: dict[str, Any]) -> None:
    """The estimated disturbance by hour of the week: every week, and the mean beside that of the true gain."""
    true = weeks(case.office.heat_gain).mean(axis=1)
    shown = ("TRUE", "ours", "OD", "CONV")
    figure, axes = plt.subplots(len(shown), 1, sharex=True, sharey=True, figsize=(10, 7.5), layout="constrained")
    for ax, name in zip(axes, shown, strict=True):
        estimated = weeks(works[name].zeta)
        mean = estimated.mean(axis=1)
        ax.plot(estimated, color=COLORS[0], linewidth=0.6, alpha=0.5)
        ax.plot([], [], color=COLORS[0], linewidth=0.6, alpha=0.5, label="estimated, each week")
        ax.plot(mean, color=COLORS[0], linewidth=1.8, label="estimated, mean")
        ax.plot(true, color=MEASURED, linewidth=1.4, linestyle="--", label="true, mean")
        error = float(np.sqrt(np.mean((mean - true) ** 2)))
        tidy(ax, ylabel="heat [kW]", title=f"parameters of {name}: mean week off by {error:.2f} kW (RMSE)")
    shared_legend(axes)
    axes[-1].set_xticks(np.arange(7) * 24, WEEKDAYS)
    axes[-1].set_xlim(0, 168)
    save(figure, "disturbance")
