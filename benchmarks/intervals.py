"""Coverage and width of 80 % intervals, by kind of interval.

Every model runs on every log of the forecast benchmark, with three kinds of interval: the scale is constant for each
lead, depends on lead and hour of day, or (the default) also follows the errors of the last days.  The method was chosen
on the office's winter and summer, on home 1 and on synthetic offices other than these.  Rows marked "chosen on" show
logs on which it was tuned; the others show its real quality.  Writes ``results/intervals.md`` and a figure.  Logs that
are not beside the checkout are left out.  ``python benchmarks/intervals.py``
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from unittest import mock

import numpy as np
import pandas as pd
from _forecast_data import DataSet, data_sets
from _report import RESULTS, write_table
from sklearn.base import clone

from skhybrid import ARXRegressor, HybridPredictor
from skhybrid.exceptions import SkhybridWarning
from skhybrid.forecasting import quantiles as quantile_module
from skhybrid.forecasting.intervals import LeadIntervals
from skhybrid.model_selection import backtest, score_intervals

LEVELS = (0.1, 0.5, 0.9)
CHOSEN_ON = ("winter", "summer", "home 1", "regular")
#: the goal of the coverage of 80 % intervals
LEAST, MOST = 0.75, 0.85


class StillIntervals(LeadIntervals):
    """Intervals that are those of the training for ever."""

    def offsets(self, clock, quantiles, recent=None, now=None, further=None, factor=1.0):
        return super().offsets(clock, quantiles, further=further)

    def factor_at(self, recent, now):
        return 1.0


class IntervalsByLead(StillIntervals):
    """The same at all hours of the day."""

    def _set_scales(self, size, known, clock):
        super()._set_scales(size, known, clock._replace(slot=np.zeros_like(clock.slot)))
        self.hour_scale_ = np.ones_like(self.hour_scale_)


KINDS = {"by lead": IntervalsByLead, "by lead and hour": StillIntervals, "following (default)": LeadIntervals}


def models(memory: str) -> dict[str, object]:
    """Estimators by name; a gray box is identified once for all kinds of interval."""
    return {
        "ARX": ARXRegressor(),
        "ARX re-fitted": ARXRegressor(adapt="refit"),
        "hybrid": HybridPredictor(),
    }


def back_test(model: object, data: DataSet, kind: type[LeadIntervals], origin_step: str = "") -> pd.DataFrame:
    """Fit and back-test with one kind of interval, at the log's own origins by default."""
    train, later = (frame.drop(columns=["dni", "dhi"], errors="ignore") for frame in (data.train, data.later))
    with warnings.catch_warnings(), mock.patch.object(quantile_module, "LeadIntervals", kind):
        warnings.simplefilter("ignore", SkhybridWarning)
        fitted = clone(model).fit(train, train["T_za"])
        every = origin_step or data.origin_step
        return backtest(fitted, later, later["T_za"], origin_step=every, start=data.start, quantiles=LEVELS)


def lead_groups(frame: pd.DataFrame) -> np.ndarray:
    """The span of leads, of three, that each row is in."""
    hours = frame["lead"] / pd.Timedelta("1h")
    return np.select([hours <= 2, hours <= 8], ["0-2 h", "2-8 h"], "8-24 h")


def measure(names: list[str]) -> pd.DataFrame:
    """One row per log, model, kind of interval and span of leads."""
    rows, loaders = [], data_sets()
    with tempfile.TemporaryDirectory() as memory:
        for name in names or list(loaders):
            data = loaders[name](0)
            for label, model in models(memory).items():
                for kind, intervals in KINDS.items():
                    begin = time.perf_counter()
                    frame = back_test(model, data, intervals)
                    spans = {"all": score_intervals(frame)}
                    spans |= dict(score_intervals(frame, by=lead_groups(frame)).iterrows())
                    origins = frame["origin"].nunique()
                    for span, score in spans.items():
                        key = {"log": name, "model": label, "interval": kind, "leads": span, "origins": origins}
                        rows.append(key | score.drop(["nominal", "n"]).to_dict())
                    seconds = time.perf_counter() - begin
                    print(f"{name}, {label}, {kind}: {spans['all'].round(3).to_dict()} {seconds:.1f} s", flush=True)
    return pd.DataFrame(rows)


def _marked(name: str) -> str:
    return f"{name} (chosen on)" if any(part in name for part in CHOSEN_ON) else name


def tables(found: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Tables of the report."""
    found = found.assign(log=found["log"].map(_marked))
    whole = found[found["leads"] == "all"]
    usual = found[found["interval"] == "following (default)"]

    def wide(frame: pd.DataFrame, value: str, columns: list[str]) -> pd.DataFrame:
        table = frame.pivot_table(index="log", columns=columns, values=value, sort=False)
        return table.set_axis([", ".join(c) if isinstance(c, tuple) else c for c in table.columns], axis=1)

    fresh = whole[~whole["log"].str.contains("chosen on")]
    inside = fresh["coverage"].between(LEAST, MOST)
    relative = fresh.pivot_table(index=["log", "model"], columns="interval", values="pinball", sort=False)
    relative = np.exp(np.log(relative.div(relative["by lead"], axis=0)).groupby("model", sort=False).mean())
    return {
        "Coverage of 80 % intervals [-], default": wide(usual[usual["leads"] == "all"], "coverage", ["model"]),
        "Width of 80 % intervals [K], default": wide(usual[usual["leads"] == "all"], "width", ["model"]),
        "Pinball loss of 10, 50, 90 % [K], default": wide(usual[usual["leads"] == "all"], "pinball", ["model"]),
        "Coverage by lead, default": wide(usual[usual["leads"] != "all"], "coverage", ["model", "leads"]),
        "Width by lead [K], default": wide(usual[usual["leads"] != "all"], "width", ["model", "leads"]),
        "Coverage by kind of interval": wide(whole, "coverage", ["model", "interval"]),
        "Logs not chosen on with coverage from 75 to 85 %": inside.groupby(
            [fresh["model"], fresh["interval"]], sort=False
        ).agg(covered="sum", of="size"),
        "Pinball loss relative to intervals by lead, logs not chosen on, geometric mean": relative,
        "Origins": whole.groupby("log", sort=False)[["origins"]].first(),
    }


def picture(name: str) -> None:
    """A week of the hybrid's bands on one log, three weeks after its start."""
    from skhybrid.inspection import ForecastDisplay

    data = data_sets()[name](0)
    begin = data.start + pd.Timedelta("21D")
    with tempfile.TemporaryDirectory() as memory:
        frame = back_test(models(memory)["hybrid"], data, LeadIntervals, "1D")
    display = ForecastDisplay.from_predictions(frame, start=begin, end=begin + pd.Timedelta("7D"), title=name)
    part = RESULTS / "intervals.part.png"
    display.figure_.savefig(part, dpi=110)
    part.replace(RESULTS / "intervals.png")


def main() -> None:
    """Run all logs, or the named ones, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="*", help="names of logs, default all")
    chosen = parser.parse_args().logs
    found = measure(chosen)
    if chosen:
        return
    write_table(
        "intervals",
        "Intervals of the day-ahead temperature",
        "python benchmarks/intervals.py",
        tables(found),
        'Goal: 75-85 % on every log. "chosen on": its season or home was used to choose how intervals are made.',
    )
    picture("office autumn, new control")


if __name__ == "__main__":
    main()
