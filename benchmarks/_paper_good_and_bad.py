"""Figures of a good and a bad disturbance model on days of training and of test (paper 4.1)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from _paper_forecast_data import PER_DAY, STARTS, Log, midnights
from sklearn.frozen import FrozenEstimator

from skhybrid import DisturbanceForecaster, HybridPredictor, OutputDisturbanceID, TwoStagePredictor
from skhybrid.inspection._style import COLORS, MEASURED, shared_legend, tidy

#: the case that the paper chooses, and one that knows neither the time nor the weather before
MODELS = {"good": ("lstm", "case01"), "bad": ("mlp", "case07")}
N_DAYS = 4


def forecast_days(log: Log, seed: int = 0) -> pd.DataFrame:
    """Forecasts of both models on randomly drawn days of training and test.

    Returns
    -------
    DataFrame
        A row per step: ``model``, ``part``, ``time``; ``measured``, ``hybrid`` and ``conventional`` temperature [degC];
        ``estimated`` and ``forecast`` input disturbance, means of the hour [kW].
    """
    train, y = log.train, log.train["T_za"]
    gray_box = OutputDisturbanceID(known=log.known, n_starts=STARTS, random_state=seed).fit(train, y)
    frozen, rng, parts = FrozenEstimator(gray_box), np.random.default_rng(seed), []
    conventional = TwoStagePredictor.conventional(frozen).fit(train, y)
    days = {"training": _drawn(train, train.index[8 * PER_DAY], rng), "test": _drawn(log.after, log.test_start, rng)}
    for name, (framework, case) in MODELS.items():
        network = DisturbanceForecaster.published(framework, case, n_repeats=1)
        model = HybridPredictor(frozen, network, adapt=None, intervals=False, random_state=seed).fit(train, y)
        for part, rows in (("training", train), ("test", log.after)):
            zeta = gray_box.estimate_disturbance(rows).resample("1h").transform("mean")
            for origin in days[part]:
                ahead = rows[origin + 1 : origin + 1 + PER_DAY]
                said = model.forecast(rows[: origin + 1], ahead.drop(columns="T_za"))
                without = conventional.predict_from(rows, [origin])[0]
                day = {"model": name, "part": part, "time": ahead.index, "measured": ahead["T_za"].to_numpy()}
                day |= {"hybrid": said["T_za"].to_numpy(), "conventional": without}
                day |= {"estimated": zeta[ahead.index].to_numpy(), "forecast": said["zeta"].to_numpy()}
                parts.append(pd.DataFrame(day))
    return pd.concat(parts, ignore_index=True)


def _drawn(rows: pd.DataFrame, first: pd.Timestamp, rng: np.random.Generator) -> np.ndarray:
    """Midnights of some days, in order."""
    origins = midnights(rows.index)
    origins = origins[(rows.index[origins] >= first) & (origins + PER_DAY < len(rows))]
    return np.sort(rng.choice(origins, N_DAYS, replace=False))


def draw_good_and_bad(days: pd.DataFrame, folder: Path) -> None:
    """One picture per model and part: disturbance above, temperature below, a day per column."""
    for (name, part), rows in days.groupby(["model", "part"]):
        starts = (rows["time"] - pd.Timedelta("15min")).dt.normalize()
        each = [day for _, day in rows.groupby(starts)]
        size = {"figsize": (11, 5), "layout": "constrained", "squeeze": False}
        figure, axes = plt.subplots(2, len(each), sharex="col", sharey="row", **size)
        for i, day in enumerate(each):
            _draw_day(axes[:, i], day.set_index("time"), first=i == 0)
        framework, case = MODELS[str(name)]
        shared_legend(axes.ravel(), f"A {name} model ({framework.upper()}, {case}) on days of {part}")
        path = folder / f"paper_forecast_{name}_{part}.png"
        figure.savefig(path.with_suffix(".part"), format="png", dpi=110)
        path.with_suffix(".part").replace(path)
        plt.close(figure)


def _draw_day(axes: Any, day: pd.DataFrame, first: bool) -> None:
    above, below = axes
    hour = 0.25 * np.arange(1, len(day) + 1)  # the first row ahead is a quarter past midnight
    errors = [float(np.sqrt(((day[one] - day["measured"]) ** 2).mean())) for one in ("conventional", "hybrid")]
    above.step(hour, day["estimated"], where="post", color=MEASURED, linewidth=1.4, label="estimated / measured")
    above.step(hour, day["forecast"], where="post", color=COLORS[0], linewidth=1.2, label="hybrid")
    below.plot(hour, day["measured"], color=MEASURED, linewidth=1.4)
    below.plot(hour, day["conventional"], color=COLORS[1], linewidth=1.2, linestyle="--", label="no disturbance")
    below.plot(hour, day["hybrid"], color=COLORS[0], linewidth=1.2)
    title = f"{day.index[0]:%a %d %b}: {errors[0]:.2f} -> {errors[1]:.2f} K"
    tidy(above, ylabel="disturbance [kW]" if first else "", title=title)
    tidy(below, ylabel="temperature [degC]" if first else "", xlabel="hour")
    below.set_xticks(range(0, 25, 6))
    below.set_xlim(0, 24)
