"""Tables of the closed-loop study: money, comfort, forecasts, paired differences, and what has not been run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _report import write_table
from scipy import stats

CASE = ["building", "zone", "season", "seed", "log"]
#: prices of comfort at which results are judged [ct/(K h)]; plans are made at the middle one
WEIGHTS = (20, 50, 200)
RULE, KNOWN, FORECAST, HELD = "tuned rule", "MPC, gains known", "MPC, hybrid's network", "MPC, network, heat held"
_LEADS = ("15 min", "1 h", "4 h", "12 h", "24 h")
NOTE = (
    "EnergyPlus 25.2 in closed loop: set-points of one zone, whose plant is ideal with 25 W/m2 (office) or 35 W/m2 "
    "(apartment) of heating and as much of cooling; the other zones keep their thermostats. A plan of 24 h is made "
    "every hour, of cost and 50 ct per K h beside the band of the model's set-points; a kWh of heat or cold costs 8 "
    "ct, on working days 16 ct in winter from 6 to 10 and 17 to 21 h, in summer from 13 to 19 h. The plan knows the "
    "plant's power, and the thermostat tracks the planned temperatures. Weather is known but where a weather forecast"
    " is named (medium error). Models are trained on six weeks, and the hybrid alone adapts, as it does by default. "
    "Rules start the season's set-point 0 to 4 h before people or a peak come, 0 to 1 K into the band; the tuned one "
    'is the best of the last three weeks of training, the one in hindsight the best of the tested fortnights. "Heat '
    'held": the unmeasured heat that the network sees now stays for the horizon. J = cost + price of comfort x K h; '
    "the three prices judge the same runs. RMSE: forecasts under the heat that was delivered. Intervals: 95 %, t "
    "distribution over fortnights, which take the fortnights as independent."
)


def _frame(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Rows of the controllers that have as many fortnights as any in their case."""
    frame = pd.DataFrame(rows)
    for weight in WEIGHTS:
        frame[f"J{weight}"] = frame["cost"] + weight * frame["K h"]
    n = frame.groupby([*CASE, "controller"])["fortnight"].transform("size")
    return frame[n == n.groupby([frame[c] for c in CASE]).transform("max")]


def money(frame: pd.DataFrame) -> pd.DataFrame:
    """Mean of a fortnight by case and controller."""
    shown = {"cost [ct]": "cost", "energy [kWh]": "energy", "discomfort [K h]": "K h"}
    shown |= {f"J at {w} ct [ct]": f"J{w}" for w in WEIGHTS}
    groups = frame.groupby([*CASE, "controller"], sort=False)
    means = groups[list(shown.values())].mean()
    digits = {"K h": 2}
    out = pd.DataFrame({name: means[c].map(f"{{:.{digits.get(c, 0)}f}}".format) for name, c in shown.items()})
    return out.assign(fortnights=groups.size())


def forecasts(frame: pd.DataFrame, plants: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Error under the controller, gain relative to the plant's, and time, by case and controller."""
    errors, gains = ["RMSE 1 h", "RMSE 6 h", "RMSE 24 h", "RMSE"], [f"gain {lead}" for lead in _LEADS]
    planned = frame[frame["controller"].str.startswith("MPC")]
    out = planned.groupby([*CASE, "controller"], sort=False)[[*errors, *gains, "ms forecast", "ms plan"]].mean()
    plant = pd.DataFrame(plants).set_index(CASE)[gains]
    for name in gains:
        out[name] = out[name] / plant[name].reindex(out.index.droplevel("controller")).to_numpy()
    return out.round(dict.fromkeys([*errors, *gains], 2) | {"ms forecast": 1, "ms plan": 1})


def interval(differences: np.ndarray) -> tuple[float, float, float]:
    """Mean, and the ends of its 95 % interval; NaN of less than two."""
    n, mean = len(differences), float(np.mean(differences))
    if n < 2:
        return mean, np.nan, np.nan
    half = float(stats.t.ppf(0.975, n - 1) * np.std(differences, ddof=1) / np.sqrt(n))
    return mean, mean - half, mean + half


def _wide(frame: pd.DataFrame, column: str) -> pd.DataFrame:
    """Values by fortnight and controller."""
    return frame.pivot_table(index=[*CASE, "fortnight"], columns="controller", values=column, sort=False)


def _wide(frame: pd.DataFrame, column: str) -> pd.DataFrame:
    """Values by fortnight and controller."""
    return frame.pivot_table(index=[*CASE, "fortnight"], columns="controller", values=column, sort=False)


def _text(mean: float, low: float, high: float, digits: int) -> str:
    """A difference and its interval."""
    if not np.isfinite(low):
        return f"{mean:+.{digits}f}"
    return f"{mean:+.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def differences(frame: pd.DataFrame, reference: str, columns: Sequence[str]) -> pd.DataFrame:
    """Mean difference of every controller from one, by season, and its interval."""
    found = []
    for season, own in frame.groupby("season", sort=False):
        for column in columns:
            wide = _wide(own, column)
            if reference not in wide:
                continue
            for name in wide.columns.drop(reference):
                paired = (wide[name] - wide[reference]).dropna().to_numpy()
                if len(paired):
                    text = _text(*interval(paired), 2 if column[:1] in "RK" else 0)
                    found.append((season, name, column, text, len(paired)))
    table = pd.DataFrame(found, columns=["season", "controller", "column", "difference", "fortnights"])
    wide = table.pivot_table(
        index=["season", "controller", "fortnights"], columns="column", values="difference", aggfunc="first", sort=False
    )
    return wide.fillna("")


def recovered(frame: pd.DataFrame) -> pd.DataFrame:
    """Share of what knowing the gains saves over the tuned rule, by season; empty where it saves nothing."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for season, own in frame.groupby("season", sort=False):
        for weight in WEIGHTS:
            wide = _wide(own, f"J{weight}")
            if not {RULE, KNOWN} <= set(wide):
                continue
            wide = wide.dropna(subset=[RULE, KNOWN])
            for name in wide.columns.drop([RULE, KNOWN]):
                both = wide.dropna(subset=[name])
                saved = (both[RULE] - both[KNOWN]).sum()
                share = (both[RULE] - both[name]).sum() / saved if saved > 0 else np.nan
                cells = found.setdefault((season, name), {})
                cells[f"J at {weight} ct"] = f"{share:.0%}" if np.isfinite(share) else ""
    if not found:
        return pd.DataFrame()
    return pd.DataFrame.from_dict(found, orient="index").rename_axis(["season", "controller"]).fillna("")


def not_run(missing: Sequence[tuple[Any, str, int]]) -> pd.DataFrame:
    """Missing rows: per case the controllers and fortnights."""
    frame = pd.DataFrame([(*case, name, f"{n + 1}") for case, name, n in missing], columns=[*CASE, "who", "n"])
    by = frame.groupby([*CASE, "who"], sort=False)["n"].agg(", ".join).reset_index()
    same = by.groupby([*CASE, "n"], sort=False)["who"].agg("; ".join).reset_index()
    counts = frame.groupby(CASE, sort=False)["who"].nunique()
    whole = same.merge(counts.rename("all").reset_index(), on=CASE)
    everything = (whole["n"] == "1, 2, 3") & (whole["who"].str.count("; ") + 1 == whole["all"])
    everything &= whole["all"] == whole.groupby("log")["all"].transform("max")
    whole.loc[everything, "who"] = "all"
    return whole.rename(columns={"who": "controllers", "n": "fortnights"}).drop(columns="all").set_index(CASE)


def write_results(
    rows: Sequence[dict[str, Any]],
    plants: Sequence[dict[str, Any]],
    missing: Sequence[tuple[Any, str, int]],
    n_rows: int,
    command: str,
    folder: Path,
) -> None:
    """Write ``control.md``; nothing where no row is there."""
    if not rows:
        return
    frame = _frame(rows)
    tables = {"Money and comfort of a fortnight": money(frame)}
    if plants and frame["controller"].str.startswith("MPC").any():
        tables["Forecasts in the loop: RMSE [K], gain relative to the plant's, ms"] = forecasts(frame, plants)
    costs = ["cost", "energy", "K h", *(f"J{w}" for w in WEIGHTS)]
    tables[f"Difference from the {RULE}, per fortnight"] = differences(frame, RULE, costs)
    held = frame[frame["controller"].isin([FORECAST, HELD])]
    if held["controller"].nunique() == 2:
        tables["What it costs to hold the unmeasured heat, per fortnight"] = differences(
            held, FORECAST, ["RMSE", "RMSE 6 h", "RMSE 24 h", *costs]
        )
    shares = recovered(frame)
    if len(shares):
        tables["Share of what knowing the gains saves over the tuned rule"] = shares
    if missing:
        tables["Rows that have not been run"] = not_run(missing)
    note = f"{NOTE}\n\nRun: {n_rows - len(missing)} of {n_rows} rows; nothing is claimed beyond them."
    write_table("control", "Closed loop on EnergyPlus", command, tables, note, folder)
