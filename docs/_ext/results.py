"""Tables of ``benchmarks/results`` as frames of text, for pages that show them and the test of numbers they quote.

``.. frame:: results: default_beside_others()`` puts one on a page.
"""

import re
from pathlib import Path

import pandas as pd

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "results"
_SMALL_OFFICE, _OTHERS = "small office", "homes and the paper's office"


def note(name: str) -> str:
    """The text above the tables of a report."""
    return (FOLDER / f"{name}.md").read_text(encoding="utf-8").split("\n|")[0]


def measured(name: str) -> tuple[str, str]:
    """The command that wrote a report, and its date."""
    text = note(name)
    return re.search(r"`(python benchmarks/[^`]+)`", text)[1], re.search(r"20\d\d-\d\d-\d\d", text)[0]


def table(name: str, heading: str = "") -> pd.DataFrame:
    """The first table under a heading of a report; cells are text, the first column is the index."""
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    _, found, text = text.partition(f"\n## {heading}\n" if heading else "\n")
    rows = [cells(line) for line in re.search(r"(?:^\|.*\n)+", text, re.M)[0].splitlines()] if found else []
    if not rows:
        raise ValueError(f"{name}.md has no table under {heading!r}.")
    frame = pd.DataFrame(rows[2:], columns=rows[0]).set_index(rows[0][0])
    frame.attrs["title"] = heading.replace("`", "")
    return frame


def cells(line: str) -> list[str]:
    """Cells of a line of a Markdown table."""
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def ratios() -> pd.DataFrame:
    """The default's error relative to others by log, held buildings included."""
    heading = "What is asked of the default (hybrid, full): ratio of errors"
    held = table("forecast_held", f"{heading}, held buildings")
    found = pd.concat([table("forecast", heading), held]).fillna("").rename_axis("data")
    found.columns = [column.split(",")[0] for column in found]
    return found.replace(r" \*\*missed\*\*", "", regex=True)


def errors() -> pd.DataFrame:
    """RMSE [K] by model and log of the benchmark."""
    return table("forecast", f"RMSE [K], {_SMALL_OFFICE}").join(table("forecast", f"RMSE [K], {_OTHERS}"))


KNOWN = ", calendar known"


def calendar_known() -> pd.DataFrame:
    """Error of the default, and its ratio to the best competitor, without and with the days off of the office."""
    known = table("forecast", f"RMSE [K], {_SMALL_OFFICE}{KNOWN}").loc["hybrid, full"]
    logs, ratio = known.index.str.removesuffix(KNOWN), ratios()["to best competitor"]
    return pd.DataFrame(
        {
            "RMSE [K]": errors().loc["hybrid, full", logs],
            "with the calendar [K]": known.to_numpy(),
            "ratio to the best competitor": ratio[logs],
            "ratio with the calendar": ratio[known.index].to_numpy(),
        }
    ).rename_axis("log")


def competitors() -> pd.DataFrame:
    """RMSE [K] of the default and its competitors, one row per log."""
    names = ["hybrid, full", "ARX", "ARX re-fitted", "ARX, multi-step", "ARX, multi-step, re-fitted"]
    found = errors().T[[*names, "boosting on ARX", "boosting, direct", "N4SID"]].rename_axis(index="log", columns="")
    return found.rename(columns={"hybrid, full": "default"})


def demo_in_short() -> pd.DataFrame:
    """The table of the demonstration without the variants of the two-stage scheme."""
    shown = table("demo", "heat known, as `make demo` has it")
    return shown[~shown.index.str.contains("two-stage|alone|simple")]


def default_beside_others() -> pd.DataFrame:
    """Error of the default by log, and its ratio to ARX, the best competitor and the best gray box."""
    rmse, ratio = errors().loc["hybrid, full"], ratios()
    return pd.DataFrame(
        {
            "RMSE [K]": rmse,
            "ratio to ARX": ratio["to ARX"],
            "ratio to ARX re-fitted": ratio["to ARX re-fitted"],
            "ratio to the best competitor": ratio["to best competitor"],
            "ratio to the best gray box alone": ratio["to best of CONV"],
        },
        index=rmse.index,
    ).rename_axis("log")


def set_points_known() -> pd.DataFrame:
    """Ratios of the default's errors to others where only set-points are known."""
    shown = {
        "/ best rule": "load, to the best of last week, yesterday and mean by hour",
        "/ boosting": "load, to gradient boosting",
        "/ heat given": "temperature, to the default with the heat given",
    }
    return table("set_points_known")[list(shown)].set_axis(list(shown.values()), axis=1).rename_axis("log")


def objectives() -> pd.DataFrame:
    """Forecast errors and the distance of A_win from the truth by model and objective."""
    kept = ["objective", "midnight RMSE [K]", "midnight better on", "hourly RMSE [K]", "hourly better on"]
    found = table("objectives", "Forecasts of a day")[kept]
    away = table("objectives", "Median distance from the truth [%]")["A_win"]
    names = ["objective", "from every midnight [K]", "better on", "from every hour [K]", "better on "]
    return found.set_axis(names, axis=1).assign(**{"A_win off by [%] (median)": away.to_numpy()})


def coverage() -> pd.DataFrame:
    """Coverage [%] of intervals of 90 % in both climates, and of those of the Hessian alone."""
    headings = {
        "": "coverage of theta_interval(0.9) [%]",
        ", by the Hessian alone": "of the model's own errors, normal quantile [%]",
    }
    found = {}
    for suffix, heading in headings.items():
        both = table("coverage", heading).query("climate == 'both'").drop(columns=["climate", "fits"])
        found |= {(name, suffix): row for name, row in both.iterrows()}
    models = dict.fromkeys(name for name, _ in found)
    order = [(name, suffix) for name in models for suffix in headings]
    return pd.DataFrame({"".join(key): found[key] for key in order}).T.rename_axis("model")
