"""Tables of results with one row per candidate: the finished ones, and the ingredients of their cases."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from ..._warnings import warn_user
from ...exceptions import SkhybridWarning
from ...forecasting import ModelCase
from ...forecasting.cases import NETWORKS, cases_by_name, resolve_case


def finished(results: pd.DataFrame, columns: Iterable[str] = ()) -> pd.DataFrame:
    """The candidates that were trained to the end, with a positive ``rmse`` [K]; a warning counts the others.

    ``rmse`` is NaN for a candidate that failed; any number in ``stopped_at`` marks one that the search stopped early.
    """
    if not isinstance(results, pd.DataFrame):
        raise TypeError(f"results is a {type(results).__name__}; pass a DataFrame with one row per candidate.")
    refuse_absent_results((*columns, "rmse"), results)
    errors = pd.to_numeric(results["rmse"], errors="coerce").astype(float)
    unreadable = errors.isna() & results["rmse"].notna()
    bad = unreadable | np.isinf(errors) | (errors <= 0.0)
    if bad.any():
        row = int(np.argmax(bad))
        found = results["rmse"].iloc[row]
        raise ValueError(f"rmse of row {results.index[row]!r} is {found}; errors are positive numbers [K].")
    failed = int(errors.isna().sum())
    if failed == len(results):
        raise ValueError("results holds no candidate with an error; rmse is empty or NaN throughout.")
    if failed:
        warn_user(f"{failed} of {len(results)} candidates have no rmse and are left out.", SkhybridWarning)
    stopped = errors.notna() & results.get("stopped_at", pd.Series(np.nan, index=results.index)).notna()
    if stopped.any():
        warn_user(
            f"{stopped.sum()} of {len(results)} candidates were stopped early and are left out; the findings hold for "
            "the others.",
            SkhybridWarning,
        )
    left = errors.notna() & ~stopped
    if not left.any():
        raise ValueError("results holds no candidate that was trained to the end.")
    return results.assign(rmse=errors)[left]


def refuse_absent_results(columns: Iterable[str], results: pd.DataFrame) -> None:
    """Refuse a table of results that lacks a column."""
    for column in columns:
        if column not in results:
            raise ValueError(f"results has no column {column!r}; it has {', '.join(map(str, results.columns))}.")


def case_of(framework: str, case: str, cases: Iterable[ModelCase] = ()) -> ModelCase:
    """The case of a row: one of the caller's own, or the paper's case of that name and framework."""
    own = cases_by_name(cases, [framework] if framework in NETWORKS else [])
    if case in own:
        return own[case]
    if framework not in NETWORKS:
        raise ValueError(
            f"case {case!r} of framework {framework!r} is not one of the paper's; pass it in cases=[ModelCase(...)]."
        )
    return resolve_case(case, framework)


def ingredients(results: pd.DataFrame, cases: Iterable[ModelCase] = ()) -> pd.DataFrame:
    """``time``, ``pattern`` [d], ``past-w``, ``future-w`` and ``ID`` of each row, for the regression of paper 3.3."""
    unknown = sorted(set(results["disturbance"].astype(str)) - {"input", "output"})
    if unknown:
        raise ValueError(f"disturbance holds {unknown[0]!r}; it is 'input' or 'output'.")
    kinds = results[["framework", "case"]].drop_duplicates()
    known = {(f, c): case_of(f, c, cases).ingredients for f, c in kinds.itertuples(index=False)}
    rows = [known[f, c] for f, c in zip(results["framework"], results["case"], strict=True)]
    return pd.DataFrame(rows, index=results.index).assign(ID=(results["disturbance"] == "input").astype(int))
