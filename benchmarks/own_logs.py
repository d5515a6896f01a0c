"""Every sample format, the shipped office and the homes from a log to tomorrow's forecast, by the command line alone.

``python benchmarks/own_logs.py`` writes ``results/own_logs.md``: edits by hand that the proposed configuration needed,
seconds, and the verdict of the check.  The samples are those of ``tests/log_samples``, which are too short to learn
from; they are read and checked, and logs of weeks are fitted and forecast.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from _report import RESULTS, write_table

from skhybrid.cli import main as command
from skhybrid.datasets import load_dutch_home, load_small_office

SAMPLES = Path(__file__).parents[1] / "tests" / "log_samples"
COMMAND = "python benchmarks/own_logs.py"


class Case(NamedTuple):
    """A log on the disk, and tomorrow's weather where it is long enough to forecast."""

    name: str
    log: Path
    weather: Path | None = None
    setpoint: str = "20,25"


def cases(folder: Path) -> Iterator[Case]:
    """Logs of weeks, then samples of formats."""
    office = load_small_office("irregular")
    frame = office.frame.drop(columns=[c for c in office.X if c in office.frame]).join(office.X)
    yield _written("small office", frame.loc["2018-09-03":"2018-10-20"], folder)
    for number in (1, 2, 3):
        home = load_dutch_home(number)
        yield _written(f"dutch home {number}", home.X.join(home.y) if "T_za" not in home.X else home.X, folder, "20")
    for path in sorted(SAMPLES.glob("*")):
        if path.name not in ("metadata.csv", "open_meteo.json"):  # of another file, and of the weather
            yield Case(path.name, path)


def _written(name: str, frame: pd.DataFrame, folder: Path, setpoint: str = "20,25") -> Case:
    """All but the last two days as a log, and the weather of these."""
    stem = name.replace(" ", "_")
    log, weather = folder / f"{stem}.csv", folder / f"{stem}_weather.csv"
    cut = frame.index[-1] - pd.Timedelta("2D")
    frame[frame.index <= cut].rename_axis("time").to_csv(log)
    frame.loc[frame.index >= cut, ["T_oa", "q_sol"]].rename_axis("time").to_csv(weather)
    return Case(name, log, weather, setpoint)


def walk(case: Case, folder: Path) -> dict[str, object]:
    """Answers of each command to one log."""
    begun = time.perf_counter()
    config, model = folder / f"{case.log.stem}.toml", folder / f"{case.log.stem}.skops"
    code, text = _call("check", str(case.log), "--config", str(config), "--json", "--quiet")
    if code:
        return {"format": "-", "read": text, "edits": "-", "forecast": "-", "seconds": time.perf_counter() - begun}
    found = json.loads(text)
    roles = {row["role"] for row in found["columns"].values() if row["role"]}
    missing = [role for role in ("T_za", "T_oa") if role not in roles]
    out = {
        "format": found["format"],
        "read": f"{found['rows']} rows, {', '.join(sorted(roles))}",
        "edits": len(missing),
        "forecast": "too short to learn from",
        "verdict": "-",
    }
    if case.weather is not None:
        given = ("forecast", "--model", str(model), "--log", str(case.log), "--weather", str(case.weather))
        for arguments in (
            ("fit", str(case.log), "--config", str(config), "--model", str(model), "--quiet"),
            (*given, "--setpoint", case.setpoint, "--json", "--quiet"),
        ):
            code, text = _call(*arguments)
            if code:
                break
        if code:
            out["forecast"] = text
        else:
            day = json.loads(text)["summary"]
            low, high = day["lowest temperature [degC]"], day["highest temperature [degC]"]
            load = f"{day['heating [kWh]']} kWh" if "heating [kWh]" in day else "kW without a scale"
            out["forecast"] = f"{low} to {high} degC, {load}"
            out["verdict"] = _verdict(case.log, config)
    return out | {"seconds": time.perf_counter() - begun}


def _verdict(log: Path, config: Path) -> str:
    """The verdicts of a back-test on temperature and load."""
    code, text = _call("backtest", str(log), "--config", str(config), "--json", "--quiet")
    return text if code else "; ".join(f"{one['quantity']}: {one['level']}" for one in json.loads(text)["verdicts"])


def _call(*arguments: str) -> tuple[int, str]:
    """Exit code and output of a command; what it says on stderr where it fails."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = command(arguments)
    return code, err.getvalue().strip() if code else out.getvalue()


def main() -> None:
    """Walk all, write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the table")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        rows = {case.name: walk(case, folder) for case in cases(folder)}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("log").round({"seconds": 1})
    note = (
        "`check` proposes a configuration, `fit` learns and `forecast` forecasts the day after the log under "
        "set-points; the verdict is that of `backtest`.  Edits: roles without which there is no forecast (T_za, T_oa) "
        "that nobody but the user can name."
    )
    title = "From a log to tomorrow, by the command line alone"
    write_table("own_logs", title, COMMAND, {"Every log": table}, note, given.out)


if __name__ == "__main__":
    main()
