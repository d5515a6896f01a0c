"""Tables and figures of the study, from the part of it that is in the store."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import _study_offices
import numpy as np
import pandas as pd
from _report import RESULTS, write_table
from _study_claims import judge
from _study_cost import costs
from _study_plan import CLIMATES, SIZES, TEST_DAYS, TRAIN_DAYS
from _study_tables import (
    SIZE_COLUMNS,
    Findings,
    baselines_table,
    comparable,
    effects,
    even_part,
    facts,
    find,
    load_results,
    read_csv,
    robustness_table,
    transfer,
)

from skhybrid.inspection import PosteriorDisplay, RobustnessDisplay

_CSV = ["climate", "level", "framework", "case", "disturbance", "name", *SIZE_COLUMNS]
_CSV += ["rmse", "fit_time", "score_time", "n_epochs", "error"]
COMMAND = (
    "python benchmarks/selection_study.py run --store DIR && python benchmarks/selection_study.py report --store DIR"
)
#: cases that the figure of robustness shows, of up to 152
_SHOWN = 30
NOTE = (
    f"make_office in two climates: the first {TRAIN_DAYS} days, from 8 July, are for training, the next {TEST_DAYS} "
    "days for testing.  RMSE of the room temperature, one origin per day at midnight, all quarter hours of the day "
    "ahead.  Gray box OutputDisturbanceID with known Q_h, identified once per climate.  Networks as "
    "DisturbanceForecaster.published, but with one seed instead of ten repeats: up to 1000 epochs, patience 150, "
    "validation on the last week of training.  "
    "**The part**: all 21, 21, 17 and 17 cases of MLP, CNN, RNN and LSTM, ID and OD, both climates, in the same few "
    "sizes each (benchmarks/_study_plan.py): MLP a Graeco-Latin square over layers, width and activation, RNN and LSTM "
    "two thirds of such a square, CNN with **10 channels and pools of 4 only**, since more channels, or no pools, "
    "over seven days cost minutes to hours per candidate.  Tables and figures use the sizes that are finished in every "
    "case, disturbance and climate.  **The test months make the choice here, as in the paper**, so the error "
    "of the choice is optimistic; its error in the other climate (same building and occupants, other weather) is "
    "below.  P(reduces): probability that a term reduces the error.  *cases*: rows of a case share what no "
    "ingredient explains (this package's default in select_case); *rows*: each size an experiment of its own, as in "
    "the paper; *cases, log*: effects on log(RMSE), on which a few very bad candidates weigh less."
)


def report(store: Path | None, folder: Path = RESULTS) -> Path:
    """Write ``selection_study.md``, ``.csv`` and three figures; without a store from the ``.csv`` of the last report.

    Raises
    ------
    ValueError
        If no network is finished yet.
    """
    results = read_csv(folder / "selection_study.csv") if store is None else load_results(store)
    part = even_part(results)
    if part.empty:
        raise ValueError(f"store {store} holds no finished network; run for longer.")
    if store is not None:
        _write_csv(results, folder / "selection_study.csv")
    offices = _study_offices.read(store or folder)
    if store is not None and len(offices):
        _study_offices.write(offices, folder)
    found = find(results)
    path = write_table(
        "selection_study",
        "The paper's method of selection on its office",
        COMMAND if store is not None else "python benchmarks/selection_study.py report",
        _tables(results, part, found) | _office_tables(offices),
        NOTE,
        folder,
    )
    figures(found, folder)
    return path


def _write_csv(results: pd.DataFrame, path: Path) -> None:
    """Write every finished candidate, failed ones too."""
    path.parent.mkdir(exist_ok=True)
    done = results[results["rmse"].notna() | results["error"].notna()]
    errors = done["error"].map(lambda text: str(text).strip().splitlines()[-1] if text else "")
    hidden = path.with_suffix(".csv.part")
    done.assign(error=errors)[_CSV].to_csv(hidden, index=False, float_format="%.6g")
    hidden.replace(path)


def _tables(results: pd.DataFrame, part: pd.DataFrame, found: Findings) -> dict[str, pd.DataFrame]:
    tables = {
        "The paper's findings and ours": judge(facts(results, found)),
        "Cost of what ran, and of the full matrix": costs(results),
        "Sizes that all tables below use": sizes_used(part),
        "Models without a network, and the choice": baselines_table(results, found),
    }
    for climate, choice in found.choices.items():
        kind = {"input": "ID", "output": "OD"}[choice.disturbance]
        rules = pd.DataFrame({"result of the rule": choice.reasons}, index=range(1, len(choice.reasons) + 1))
        tables[f"The choice, {climate}: {choice.name} ({kind})"] = rules.rename_axis("rule")
    if len(moved := transfer(results, found)):
        tables["Error of a choice in the other climate"] = moved
    if found.regressions:
        tables["Ingredients [K, or of the logarithm]"] = effects(found.regressions, ["where", "grouping"])
    if found.sizes:
        tables["Sizes [K; hidden_size in tens], grouped by cases"] = effects(found.sizes, ["framework", "climate"])
    for climate in found.robustness:
        tables[f"Robustness, {climate}: the first forty"] = robustness_table(found, climate)
    if found.refused:
        refused = pd.DataFrame({"why": found.refused}).rename_axis("refused")
        tables["Refused because chains were bad"] = refused
    return tables


def _office_tables(offices: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The final comparison, where it was run: a table only says who wins where the offices agree."""
    if offices.empty:
        return {}
    title = f"The choice in several offices, {int(offices['repeats'].max())} networks, median (lowest-highest)"
    return {title: _study_offices.comparison(offices)}


def sizes_used(part: pd.DataFrame) -> pd.DataFrame:
    """One row per framework: its sizes, its number of candidates, and whether robustness can be compared."""
    rows = {}
    for framework in SIZES:
        here = part[part["framework"] == framework]
        sizes = here[[c for c in SIZE_COLUMNS if here[c].notna().any()]].drop_duplicates()
        said = ["-".join(_plain(v) for v in row) for row in sizes.itertuples(index=False)]
        names = " - ".join(sizes.columns)
        compared = "yes" if len(comparable(here)) else "no: that takes two sizes"
        rows[framework] = {"candidates": len(here), "sizes": f"({names}) " + ", ".join(said), "robustness": compared}
    return pd.DataFrame(rows).T.rename_axis("framework")


def _plain(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float | int) else str(value)


# ------------------------------------------------------------------------------------------------------------ figures
def figures(found: Findings, folder: Path) -> None:
    """Draw ingredients, sizes and robustness, each climate beside the other."""
    import matplotlib

    matplotlib.use("Agg")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _ingredients(found, folder / "selection_study_ingredients.png")
        _sizes(found, folder / "selection_study_sizes.png")
        _robustness(found, folder / "selection_study_robustness.png")


def _save(figure: Any, path: Path) -> None:
    import matplotlib.pyplot as plt

    part = path.with_suffix(".part")
    figure.savefig(part, format="png", dpi=110)
    part.replace(path)
    plt.close(figure)


def _ingredients(found: Findings, path: Path) -> None:
    import matplotlib.pyplot as plt

    scopes = [scope for scope in (*CLIMATES, "both") if (scope, "rows") in found.regressions]
    if not scopes:
        return
    figure, axes = plt.subplots(1, len(scopes), figsize=(6.0 * len(scopes), 5.4), layout="constrained", squeeze=False)
    for ax, scope in zip(axes[0], scopes, strict=True):
        one = found.regressions.get((scope, "cases"), found.regressions[scope, "rows"])
        title = f"{scope}, {one.n_candidates_} candidates"
        PosteriorDisplay.from_estimator(one, ax=ax, title=title)
    _save(figure, path)


def _sizes(found: Findings, path: Path) -> None:
    import matplotlib.pyplot as plt

    if not found.sizes:
        return
    frameworks = [name for name in SIZES if any(key[0] == name for key in found.sizes)]
    size = (6.0 * len(CLIMATES), 3.2 * len(frameworks))
    figure, axes = plt.subplots(len(frameworks), len(CLIMATES), figsize=size, layout="constrained", squeeze=False)
    for ax, key in zip(axes.ravel(), [(f, c) for f in frameworks for c in CLIMATES], strict=True):
        if key in found.sizes:
            PosteriorDisplay.from_estimator(
                found.sizes[key], ax=ax, title=f"{key[0].upper()}, {key[1]} (width in tens)"
            )
        else:
            ax.set_axis_off()
    _save(figure, path)


def _robustness(found: Findings, path: Path) -> None:
    import matplotlib.pyplot as plt

    if not found.robustness:
        return
    n = len(found.robustness)
    figure = plt.figure(figsize=(12.5, n * (1.6 + 0.22 * _SHOWN)), layout="constrained")
    for part, (climate, one) in zip(np.ravel(figure.subfigures(n, 1)), found.robustness.items(), strict=True):
        axes = part.subplots(1, 2)
        title = f"{climate}: the {min(_SHOWN, len(one.median_))} lowest of {len(one.median_)} cases"
        RobustnessDisplay.from_estimator(one, ax=axes, n_cases=_SHOWN, title=title)
    _save(figure, path)
