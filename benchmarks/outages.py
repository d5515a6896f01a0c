"""Training over outages: bridged as the command line does it, or by the longest stretch between them.

``python benchmarks/outages.py`` writes ``results/outages.md``, in some minutes on one core.  Inputs and temperature are
removed from the training at places that are drawn for each log; the test weeks are whole.
"""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
from _forecast_data import office_run, read_home
from _report import write_table

from skhybrid import HybridPredictor
from skhybrid._table import is_plant
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.model_selection import backtest, score_backtest
from skhybrid.preprocessing.bridges import stretches
from skhybrid.study.settings import settings_from
from skhybrid.zone.complete_rows import complete_rows
from skhybrid.zone.training_rows import training_rows

DAYS, TEST_DAYS = 42, 21
OUTAGES = ((1, "12h"), (1, "48h"), (6, "12h"), (4, "36h"), (12, "5h"))  # number and length


def logs() -> dict[str, pd.DataFrame]:
    """Rows by log, with roles as columns."""
    year = office_run("irregular")
    seasons = {"winter": "2018-01-08", "spring": "2018-03-01", "autumn": "2018-09-01"}
    found = {f"office, {name}": year.loc[start:] for name, start in seasons.items()}
    office = make_office(DAYS + TEST_DAYS, "chicago", start="2023-10-01", random_state=3, sampling_time="15min")
    found["make_office chicago"] = office.X.tz_localize("Etc/GMT+6")
    found |= {f"dutch home {number}": read_home(number) for number in (1, 2, 3)}
    return found


def error(train: pd.DataFrame, test: pd.DataFrame) -> float:
    """RMSE of the day-ahead forecasts of the test [K]."""
    model = HybridPredictor(intervals=False).fit(train, train["T_za"])
    return float(score_backtest(backtest(model, test, test["T_za"], origin_step="13h"))["rmse"])


def rows_out(train: pd.DataFrame, n_outages: int, length: str, rng: np.random.Generator) -> np.ndarray:
    """True for each row (n,) of an outage; one is in each of as many equal parts."""
    out, n = np.zeros(len(train), dtype=bool), round(pd.Timedelta(length) / (train.index[1] - train.index[0]))
    for k in range(n_outages):
        at = int((k + rng.random()) * 0.9 * len(train) / n_outages)
        out[at : at + n] = True
    return out


def blank(train: pd.DataFrame, out: np.ndarray, roles: list[str]) -> pd.DataFrame:
    """The rows, in some of which some roles were not measured."""
    return train.assign(**{role: train[role].mask(out) for role in roles})


def main() -> None:
    """Run all logs and write the table."""
    warnings.simplefilter("ignore", SkhybridWarning)
    rows = []
    for number, (name, frame) in enumerate(logs().items()):
        roles = [c for c in frame if c in ("T_oa", "q_sol", "Q_hvac", "T_za") or str(c).startswith("u_")]
        step, rng = frame.index[1] - frame.index[0], np.random.default_rng(number)
        day = pd.Timedelta("1D") // step
        n_train = min(DAYS, len(frame) // day * 2 // 3) * day
        train, test = frame[roles][:n_train], frame[roles][n_train : n_train + TEST_DAYS * day]
        settings = settings_from({"columns": {role: role for role in roles}, "step": str(step)})
        of_heat = list(filter(is_plant, roles))
        of_weather = [role for role in roles if role not in ("T_za", *of_heat)]
        whole = error(train, test)
        for n_outages, length in OUTAGES:
            out = rows_out(train, n_outages, length, rng)
            holed, no_heat, no_weather = (blank(train, out, some) for some in (roles, of_heat, of_weather))
            longest = max(stretches(complete_rows(holed), step), key=len)
            one = {
                "log": name,
                "outages": f"{n_outages} of {length}",
                "days in a row": len(longest) / day,
            }
            one["bridged"] = error(training_rows(holed, settings, DAYS), test) / whole
            one["bridged, heat alone out"] = error(training_rows(no_heat, settings, DAYS), test) / whole
            one["bridged, weather alone out"] = error(training_rows(no_weather, settings, DAYS), test) / whole
            rows.append(one | {"longest stretch": error(longest, test) / whole})
            print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    ratios = ["bridged", "bridged, heat alone out", "bridged, weather alone out", "longest stretch"]
    means = np.exp(np.log(table[ratios]).groupby(table["outages"], sort=False).mean())
    means.loc["all"] = np.exp(np.log(table[ratios]).mean())
    note = (
        f"Errors of day-ahead forecasts relative to those of a training of {DAYS} days (home 1: 28) without an outage. "
        "Heat or weather alone out: all else is measured.  Measured heat is used then, and measured weather is not: a "
        "guess of the heat goes with a guess of the weather."
    )
    tables = {"Geometric mean of all logs": means, "By log": table.set_index(["log", "outages"])}
    write_table("outages", "Training over outages", "python benchmarks/outages.py", tables, note)


if __name__ == "__main__":
    main()
