"""Online updating: time of ``update`` and ``forecast``, and errors before and after a change of schedule.

``python benchmarks/online_updating.py`` writes ``results/online_updating.md``, ``online_updating.png`` and
``online_updating_times.md``, in about twenty minutes on one core.  ``--times`` measures times only.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from itertools import product

import numpy as np
import pandas as pd
from _report import RESULTS, write_table

from skhybrid import DisturbanceForecaster, HybridPredictor, PeriodicDisturbanceID
from skhybrid.datasets import make_office, make_weather
from skhybrid.exceptions import SkhybridWarning
from skhybrid.inspection._style import line_style, tidy

COMMAND = "python benchmarks/online_updating.py"
DAY, WEEK = 96, 7 * 96
#: Mondays a quarter of a year apart, because some seasons make the weeks after a change harder, some easier
STARTS = tuple(map(pd.Timestamp, ("2023-02-06", "2023-05-01", "2023-07-31", "2023-10-30")))
TRAIN, BEFORE, AFTER = 4, 4, 6  # weeks
#: offices per start, all different; a week that is hard because of its people is as hard in every season
N_OFFICES = 3
#: lag of the clock of people and set-points against the sun's after the change
CHANGES = {
    "no change": "0h",
    "three hours later": "-3h",
    "three hours later, closed on Friday and Saturday": "21h",
}


def make_log(seed: int, lag: str, start: pd.Timestamp) -> pd.DataFrame:
    """An office whose people and set-points follow another clock from week TRAIN + BEFORE on, under one weather.

    The second part is a separate office whose weather was shifted on the clock.  Where the two meet, the temperature
    jumps once by up to a few kelvin.
    """
    days, change = 7 * (TRAIN + BEFORE + AFTER), start + pd.Timedelta(weeks=TRAIN + BEFORE)
    shift = pd.Timedelta(lag)
    weather = make_weather(days + 4, start=start, step="5min", random_state=seed)
    first = make_office(7 * (TRAIN + BEFORE), weather=weather, start=start, random_state=seed)
    second = make_office(
        7 * AFTER + 2,
        weather=weather.set_axis(weather.index + shift),
        start=change - pd.Timedelta("1D"),
        excitation=None,
        random_state=seed + 100,
    )
    later = second.X.set_axis(second.X.index - shift)
    return pd.concat([first.X, later[later.index >= change][: AFTER * WEEK]])


def fitted(X: pd.DataFrame, adapt: str | None, two_stage: bool = False) -> HybridPredictor:
    """The default, or the two-stage scheme with ridge, fitted on the first weeks."""
    parts = (PeriodicDisturbanceID(known={"Q_h": 6.0}), DisturbanceForecaster("ridge")) if two_stage else ()
    model = HybridPredictor(*parts, adapt=adapt, random_state=0)
    return model.fit(X[: TRAIN * WEEK], X["T_za"][: TRAIN * WEEK])


#: name -> adapt, and whether it is the two-stage scheme
MODELS = {
    "frozen": (None, False),
    "adapted": ("full", False),
    "partial_fit on drift": (None, False),
    "two-stage, frozen": (None, True),
    "two-stage, adapted": ("linear", True),
}


def weekly(model: HybridPredictor, X: pd.DataFrame, learn: bool) -> tuple[list[float], list[int]]:
    """RMSE [K] of day-ahead forecasts by week, and the weeks after which ``partial_fit`` was called on a drift."""
    errors, learned = [], []
    for week in range(TRAIN, TRAIN + BEFORE + AFTER):
        rows = X[week * WEEK : (week + 1) * WEEK]
        errors.append(float(np.sqrt(np.mean((model.predict(rows) - rows["T_za"]) ** 2))))
        model.update(rows)
        if learn and model.drift()["drifted"].iloc[-2:].any():
            model.partial_fit(rows, rows["T_za"])
            learned.append(week - TRAIN - BEFORE)
    return errors, learned


def study() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors by change, model, start, seed and week (0 is the first after the change), and the drift signals."""
    rows, signals = [], []
    for change, (number, start), office in product(CHANGES, enumerate(STARTS), range(N_OFFICES)):
        seed = N_OFFICES * number + office
        X = make_log(seed, CHANGES[change], start)
        signal = {"change": change, "start": str(start.date()), "seed": seed} | alarms(X, start)
        for name, (adapt, two_stage) in MODELS.items():
            errors, learned = weekly(fitted(X, adapt, two_stage), X, name.startswith("partial"))
            weeks = enumerate(errors, start=-BEFORE)
            rows += [(change, name, signal["start"], seed, week, error) for week, error in weeks]
            if name.startswith("partial"):
                signal["partial_fit after week"] = ", ".join(map(str, learned)) or "none"
        signals.append(signal)
        print(signal, flush=True)
    return pd.DataFrame(rows, columns=["change", "model", "start", "seed", "week", "rmse"]), pd.DataFrame(signals)


def alarms(X: pd.DataFrame, start: pd.Timestamp) -> dict[str, object]:
    """Drift signal of the frozen default before and after the change."""
    days = fitted(X, None).drift(X[TRAIN * WEEK :])
    drifted = days[days["drifted"]]
    at = start + pd.Timedelta(weeks=TRAIN + BEFORE)
    late = drifted[drifted.index >= at]
    return {
        "days of false alarm": int((drifted.index < at).sum()),
        "alarm after [d]": (late.index[0] - at).days + 1 if len(late) else "none",
        "kind": late["kind"].iloc[-1] if len(late) else "",
    }


def recovery(errors: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Errors of the weeks before, of the two after and of the four after those; ratios to before."""
    span = np.select([errors["week"] < 0, errors["week"] < 2], ["before", "first two weeks"], "later")
    square = errors.assign(span=span, square=errors["rmse"] ** 2)
    table = square.pivot_table(index=by, columns="span", values="square", sort=False) ** 0.5
    table = table[["before", "first two weeks", "later"]]
    table["later / before"] = table["later"] / table["before"]
    same = table.loc["no change", "later"]
    table["later / later without change"] = [table.loc[key, "later"] / same[key[1]] for key in table.index]
    return table


def picture(means: pd.DataFrame) -> None:
    """Draw weekly errors, means over starts and seeds: one panel per change, one line per model."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    axes = figure.subplots(1, len(CHANGES), sharey=True)
    for ax, change in zip(axes, CHANGES, strict=True):
        for number, (model, line) in enumerate(means.loc[change].iterrows()):
            ax.plot(line.index.astype(int), line, label=model, **line_style(number))
        if change != "no change":
            ax.axvline(-0.5, color="#888888", linewidth=0.8)
        tidy(ax, ylabel="", xlabel="week after the change", title=change.replace(", ", ",\n"))
    axes[0].set_ylim(0.0, 1.05 * float(means.to_numpy().max()))
    axes[0].set_ylabel("day-ahead RMSE [K]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False)
    figure.savefig(RESULTS / "online_updating.png", dpi=130)


# ---------------------------------------------------------------------------------------------------------- speed
def cpu_ms(call: Callable[[int], object], n: int) -> tuple[float, float]:
    """Median and least CPU time of a call [ms]; other processes lengthen it less than the time on the wall."""
    spent = []
    for i in range(n):
        begin = time.process_time()
        call(i)
        spent.append(time.process_time() - begin)
    return 1e3 * float(np.median(spent)), 1e3 * min(spent)


def speed(adapt: str, two_stage: bool) -> pd.DataFrame:
    """Time of updates and forecasts, early and late in a model's use."""
    X = make_log(0, "0h", STARTS[1])
    model = fitted(X, adapt, two_stage)
    square = np.random.default_rng(0).normal(size=(60, 60))
    loop = cpu_ms(lambda i: [square @ square for _ in range(100)], 50)
    rows, now = {}, TRAIN * WEEK
    for name, until in (("first day", now), ("nine weeks on", now + 9 * WEEK)):
        if until > now:
            model.update(X[now:until])
            now = until
        begin = now
        rows[f"update, one row, {name}"] = cpu_ms(lambda i, at=begin: model.update(X[at + i : at + i + 1]), DAY)
        now += DAY
        future = X[now : now + DAY].drop(columns="T_za")
        model.forecast(None, future)  # the first forecast of a new week fits again, once
        rows[f"forecast, 24 h, {name}"] = cpu_ms(lambda i, ahead=future: model.forecast(None, ahead), 60)
    days = [X[now + i * DAY : now + (i + 1) * DAY] for i in range(4)]
    rows["update, 96 rows"] = cpu_ms(lambda i: model.update(days[i]), len(days))
    table = pd.DataFrame(rows, index=["median [ms]", "least [ms]"]).T
    table["least, in 100 products of 60 x 60"] = table["least [ms]"] / loop[1]
    return table


def main() -> None:
    """Run all; write tables and figure."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        times = {
            "Two-stage, 2R2C and ridge: CPU time of a call": speed("linear", True),
            "Default: CPU time of a call": speed("full", False),
        }
        print(*times.values(), sep="\n", flush=True)
        write_table("online_updating_times", "Time of an update and of a forecast", f"{COMMAND} --times", times)
        if "--times" in sys.argv[1:]:
            return
        errors, signals = study()
    means = errors.pivot_table(index=["change", "model"], columns="week", values="rmse", sort=False)
    RESULTS.mkdir(exist_ok=True)
    picture(means)
    write_table(
        "online_updating",
        "Online updating",
        COMMAND,
        {
            "Day-ahead RMSE [K] around a change of schedule": recovery(errors, ["change", "model"]),
            "The adapted default by the day on which its training began [K]": recovery(
                errors[errors["model"] == "adapted"], ["change", "start"]
            ),
            "By week after the change, mean [K]": means,
            "Drift signal of the frozen model": signals.set_index(["change", "start", "seed"]),
        },
        f"make_office (Oakland), {TRAIN} weeks of training, {BEFORE} weeks as before, then {AFTER} under another "
        f"schedule; {N_OFFICES} offices (seeds) at each of {len(STARTS)} starts a quarter of a year apart, as some "
        "seasons make later weeks harder, others easier; the default, and the two-stage scheme with ridge.",
    )


if __name__ == "__main__":
    main()
