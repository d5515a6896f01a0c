"""Results of the study as one table, its even part, and the findings of the paper's method on that part."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import _study_baselines
import numpy as np
import pandas as pd
from _study_claims import CASE01
from _study_plan import CLIMATES, SIZES, planned
from _study_store import read_results

from skhybrid.forecasting.cases import NETWORKS, TIME_FEATURES, cases_of
from skhybrid.model_selection import CaseChoice, PatternExpressiveness, RobustnessComparison, select_case
from skhybrid.model_selection.choice.regression_terms import INGREDIENTS

BY = ("name", "disturbance")
IDENTITY = ["framework", "case", "disturbance", "name"]
SIZE_COLUMNS = list(dict.fromkeys(name for sizes in SIZES.values() for size in sizes for name in size))


def load_results(store: Path) -> pd.DataFrame:
    """One row per planned candidate and baseline; ``rmse`` is NaN if it has not finished or has failed (``error``)."""
    plan = planned()
    parts = []
    for climate in CLIMATES:
        kept = read_results(store / f"{climate}.sqlite")
        parts.append(plan[plan["climate"] == climate].merge(kept, on="id", how="left"))
        others = _study_baselines.read(store, climate).assign(climate=climate, level=0)
        parts.append(others.assign(name=others["framework"]))
    return _typed(pd.concat(parts, ignore_index=True).drop(columns="id"))


def read_csv(path: Path) -> pd.DataFrame:
    """The finished candidates and baselines of a report, as :func:`load_results` gives them (six digits)."""
    table = pd.read_csv(path)
    return _typed(table.assign(error=table["error"].where(table["rmse"].isna())))


def _typed(table: pd.DataFrame) -> pd.DataFrame:
    for column in ("case", "disturbance", "error", "activation"):
        table[column] = table[column].astype(object).where(table[column].notna(), None)
    return table.assign(**{name: pd.to_numeric(table[name]) for name in ("rmse", "fit_time", "n_epochs")})


def even_part(results: pd.DataFrame) -> pd.DataFrame:
    """Candidates of the sizes that are finished in all cases, disturbances and climates, else all finished ones."""
    networks = results[results["case"].notna()]
    done = networks["rmse"].notna() | networks["error"].notna()
    whole = done.groupby([networks["framework"], *(networks[c] for c in SIZE_COLUMNS)], dropna=False).transform("all")
    kept = networks[whole if whole.any() else done]
    return kept[kept["rmse"].notna()]


def comparable(part: pd.DataFrame) -> pd.DataFrame:
    """Rows of cases with two sizes or more; a single size has no spread."""
    n_sizes = part.groupby(["climate", *BY])["rmse"].transform("size")
    return part[n_sizes > 1]


def simple_baselines(results: pd.DataFrame, climate: str) -> pd.DataFrame:
    """Rows that select_case compares with the cases."""
    here = results[(results["climate"] == climate) & results["framework"].isin(_study_baselines.SIMPLE)]
    return here[here["rmse"].notna()]


class Findings(NamedTuple):
    """Findings of the method in a part."""

    regressions: dict[tuple[str, str], PatternExpressiveness]  # by scope and grouping
    sizes: dict[tuple[str, str], PatternExpressiveness]  # by framework and climate
    robustness: dict[str, RobustnessComparison]  # by climate
    choices: dict[str, CaseChoice]  # by climate
    refused: dict[str, str]  # what the package refused because chains were bad, and why

    def add(self, kind: str, key: Any, make: Callable[[], Any]) -> None:
        """Add a finding, or the reason why there is none."""
        begun = time.monotonic()
        try:
            getattr(self, kind)[key] = make()
        except RuntimeError as error:
            self.refused[f"{kind}, {key if isinstance(key, str) else ' '.join(key)}"] = str(error)
        print(f"{kind} {key}: {time.monotonic() - begun:.0f} s", flush=True)


def find(results: pd.DataFrame) -> Findings:
    """Regress, compare and choose."""
    part, found = even_part(results), Findings({}, {}, {}, {}, {})
    climates = list(dict.fromkeys(part["climate"]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for climate in climates:
            _regress(found, climate, part[part["climate"] == climate], list(INGREDIENTS))
        if len(climates) > 1:
            _regress(found, "both", part, [*INGREDIENTS, "climate"])
        several = comparable(part)
        for climate in climates:
            here = several[several["climate"] == climate]
            if here.groupby(list(BY)).ngroups > 1:
                _compare(found, climate, here, simple_baselines(results, climate))
    return found


def _regress(found: Findings, scope: str, part: pd.DataFrame, terms: list[str]) -> None:
    """By cases, whose rows share what no ingredient explains; the same of log(rmse); and by rows, as the paper does."""
    kinds: dict[str, dict[str, Any]] = {"rows": {}}
    if part.groupby(list(BY)).size().max() > 1:
        kinds = {"cases": {"group": BY}, "cases, log": {"group": BY, "log": True}} | kinds
    for grouping, settings in kinds.items():
        one = PatternExpressiveness(terms, random_state=0, **settings)
        found.add("regressions", (scope, grouping), lambda one=one: one.fit(part))


def _compare(found: Findings, climate: str, here: pd.DataFrame, baselines: pd.DataFrame) -> None:
    """Sizes of each framework, robustness of all cases, and the choice."""
    for framework in dict.fromkeys(here["framework"]):
        rows = here[here["framework"] == framework]
        rows = rows.assign(hidden_size=rows["hidden_size"] / 10.0)  # one more is too little to see
        one = PatternExpressiveness("sizes", group=BY, random_state=0)
        found.add("sizes", (framework, climate), lambda one=one, rows=rows: one.fit(rows))
    found.add("robustness", climate, lambda: RobustnessComparison(by=BY, random_state=0).fit(here))
    columns = [*IDENTITY, *SIZE_COLUMNS, "rmse"]
    both = pd.concat([here[columns], baselines[columns]], ignore_index=True)
    found.add("choices", climate, lambda: select_case(both, random_state=0))


# ---------------------------------------------------------------------------------------------------------- as tables
def effects(regressions: dict[Any, PatternExpressiveness], names: list[str]) -> pd.DataFrame:
    """One row per regression and term."""
    columns = ["mean", "lower", "upper", "probability_reduces"]
    parts = {key: one.summary_[columns] for key, one in regressions.items()}
    table = pd.concat(parts, names=[*names, "term"])
    untold = {key: "; ".join(one.left_out_) for key, one in regressions.items() if one.left_out_}
    rows = [(*key, terms, *["cannot be separated"] * len(columns)) for key, terms in untold.items()]
    more = pd.DataFrame(rows, columns=[*names, "term", *columns]).set_index([*names, "term"])
    return pd.concat([table.astype(object), more]) if len(more) else table


def robustness_table(found: Findings, climate: str, n_rows: int = 40) -> pd.DataFrame:
    """Cases by rising median: those that cannot be told from the best, and some after them."""
    one = found.robustness[climate]
    table = pd.DataFrame(
        {
            "median [K]": one.median_,
            "sigma of log": one.summary_["sigma"],
            "sizes": one.summary_["n_sizes"],
            "P(best is better)": one.probability_,
            "as good as the best": np.where(one.probability_.index.isin(one.indistinguishable_), "yes", ""),
        }
    )
    case01 = f"{CASE01} input"
    keep = (np.arange(len(table)) < n_rows) | (table.index == case01)
    return table.assign(rank=np.arange(1, len(table) + 1))[keep].rename_axis("case")


def transfer(results: pd.DataFrame, found: Findings) -> pd.DataFrame:
    """Errors in one climate of choices that were made in the other."""
    part, rows = even_part(results), []
    for climate, choice in found.choices.items():
        here = part[part["climate"] == climate].sort_values("rmse", kind="stable")
        of_case = here[(here["name"] == choice.name) & (here["disturbance"] == choice.disturbance)]
        baselines = simple_baselines(results, climate).sort_values("rmse", kind="stable")
        picks = {"the paper's rules": of_case.iloc[0], "lowest error of all": here.iloc[0]}
        for other in CLIMATES:
            if other == climate or other not in set(part["climate"]):
                continue
            pool = {"network": part[part["climate"] == other], "baseline": simple_baselines(results, other)}
            for how, pick in {**picks, **({"best baseline": baselines.iloc[0]} if len(baselines) else {})}.items():
                twin = pool["baseline" if pick["case"] is None else "network"]
                same = [*IDENTITY, *SIZE_COLUMNS]
                twin = twin[[bool(row == _key(pick, same)) for row in (_key(r, same) for _, r in twin.iterrows())]]
                rows.append(
                    {
                        "chosen on": climate,
                        "by": how,
                        "candidate": _said(pick),
                        "error there, optimistic [K]": float(pick["rmse"]),
                        "used on": other,
                        "error [K]": float(twin["rmse"].iloc[0]) if len(twin) else np.nan,
                        "lowest of all there [K]": float(pool["network"]["rmse"].min()),
                        "lowest baseline there [K]": float(pool["baseline"]["rmse"].min()),
                    }
                )
    return pd.DataFrame(rows).set_index("chosen on") if rows else pd.DataFrame()


def _key(row: pd.Series, columns: list[str]) -> tuple[Any, ...]:
    return tuple(None if pd.isna(row[c]) else row[c] for c in columns)


def _said(row: pd.Series) -> str:
    size = ", ".join(
        f"{c} {row[c]:g}" if isinstance(row[c], float) else f"{c} {row[c]}" for c in SIZE_COLUMNS if not pd.isna(row[c])
    )
    kind = {"input": " (ID)", "output": " (OD)"}.get(row["disturbance"], "")
    return f"{row['name']}{kind}" + (f"; {size}" if size else "")


def baselines_table(results: pd.DataFrame, found: Findings) -> pd.DataFrame:
    """All models without a network, and of the networks the choice, case01 of the LSTM and the lowest error."""
    part, rows = even_part(results), []
    for climate in CLIMATES:
        here = results[(results["climate"] == climate) & results["case"].isna() & results["rmse"].notna()]
        for _, row in here.iterrows():
            rows.append((climate, _said(row), row["rmse"], "", row["fit_time"]))
        networks = part[part["climate"] == climate]
        for label, name, kind in _wanted(found.choices.get(climate)):
            of = networks[(networks["name"] == name) & (networks["disturbance"] == kind)]
            if len(of):
                rows.append((climate, label, of["rmse"].median(), _range(of["rmse"]), of["fit_time"].mean()))
        if len(networks):
            best = networks.loc[networks["rmse"].idxmin()]
            rows.append((climate, f"lowest of all: {_said(best)}", best["rmse"], "", best["fit_time"]))
    columns = ["climate", "model", "RMSE [K]", "over sizes", "fit [s]"]
    return pd.DataFrame(rows, columns=columns).sort_values(["climate", "RMSE [K]"]).set_index("climate")


def _wanted(choice: CaseChoice | None) -> list[tuple[str, str, str]]:
    wanted = [(f"{CASE01} (ID), median", CASE01, "input")]
    if choice is not None:
        kind = {"input": "ID", "output": "OD"}[choice.disturbance]
        wanted.append((f"the choice, {choice.name} ({kind}), median", choice.name, choice.disturbance))
    return wanted


def _range(errors: pd.Series) -> str:
    return f"{errors.min():.3f}-{errors.max():.3f}"


# ----------------------------------------------------------------------------------------------------------- as facts
def facts(results: pd.DataFrame, found: Findings) -> dict[str, dict[str, float]]:
    """Numbers by name, for each climate and for both, that decide the paper's statements."""
    part = even_part(results)
    known: dict[str, dict[str, float]] = {scope: {} for scope in (*CLIMATES, "both")}
    for (scope, grouping), one in found.regressions.items():
        if grouping == ("cases" if (scope, "cases") in found.regressions else "rows"):
            known[scope] |= {f"P({t})": float(p) for t, p in one.summary_["probability_reduces"].items()}
            known[scope] |= {f"effect {t} [K]": float(m) for t, m in one.summary_["mean"].items()}
    for (framework, climate), one in found.sizes.items():
        for term, p in one.summary_["probability_reduces"].items():
            known[climate][f"P({framework.upper()} {term})"] = float(p)
    for climate, robust in found.robustness.items():
        known[climate] |= _robust_facts(robust)
    for climate in CLIMATES:
        here = part[part["climate"] == climate]
        known[climate] |= {f"log how/{other}": v for other in ("dow", "weekday") if (v := how_against(here, other))}
        others = results[results["climate"] == climate].set_index("framework")["rmse"]
        names = ("OD alone", "OD, no disturbance")
        known[climate] |= {f"{name} [K]": float(others[name]) for name in names if name in others.index}
    for climate, choice in found.choices.items():
        known[climate]["chosen [K]"] = choice.median
        known[climate]["LSTM-case01 chosen"] = float((choice.name, choice.disturbance) == (CASE01, "input"))
    return known


def _robust_facts(robust: RobustnessComparison) -> dict[str, float]:
    case01, found = f"{CASE01} input", {}
    recurrent = robust.summary_.index.str.contains("_AR_")
    for label, chosen in (("RNN and LSTM", recurrent), ("MLP and CNN", ~recurrent)):
        if chosen.any():
            found[f"sigma, {label}"] = float(robust.summary_["sigma"][chosen].mean())
    if case01 in robust.probability_:
        found["P(best beats LSTM-case01)"] = float(robust.probability_[case01])
        found["rank of LSTM-case01"] = 1.0 + list(robust.probability_.index).index(case01)
    return found


def how_against(part: pd.DataFrame, other: str) -> float | None:
    """Mean of log(median error with hour of week / with ``other``) over cases that differ in nothing else."""
    medians = part.groupby(["framework", "case", "disturbance"])["rmse"].median()
    ratios = []
    for framework in NETWORKS:
        twins = {_but_time(case): name for name, case in cases_of(framework).items()}
        for (key, feature), name in twins.items():
            twin = twins.get((key, (other,)))
            if feature != ("how",) or twin is None:
                continue
            for kind in ("input", "output"):
                pair = [(framework, one, kind) for one in (name, twin)]
                if all(one in medians.index for one in pair):
                    ratios.append(float(np.log(medians[pair[0]] / medians[pair[1]])))
    return float(np.mean(ratios)) if ratios else None


def _but_time(case: Any) -> tuple[Any, tuple[str, ...]]:
    """A case without its time features, and these where past and future name the same, or only the future does."""
    rest = tuple(tuple(f for f in side if f not in TIME_FEATURES) for side in (case.past, case.future))
    times = tuple(tuple(f for f in side if f in TIME_FEATURES) for side in (case.past, case.future))
    same = times[0] if times[0] == times[1] else (*times[0], "|", *times[1])
    return (case.pattern_days, rest), same
