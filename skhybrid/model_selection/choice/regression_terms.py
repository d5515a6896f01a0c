"""Terms of the regression on candidates, as columns of numbers made from a table of results."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from ..._warnings import warn_user
from ...exceptions import SkhybridWarning
from ...forecasting import ModelCase
from ...forecasting.cases import NETWORKS, SIZES
from .results_table import ingredients, refuse_absent_results

INGREDIENTS = ("framework", "time", "pattern", "past-w", "future-w", "ID")
_SIZE_COLUMNS = (*dict.fromkeys(name for sizes in SIZES.values() for name in sizes), "dropout")
_ALIASED = 1e-8  # a term is a combination of others if at most this share of it is independent of them


class RegressionTerms(NamedTuple):
    """Input of the regression."""

    columns: pd.DataFrame  # (n_candidates, n_terms), one column per term; none is constant or a combination of others
    rmse: pd.Series  # (n_candidates,) [K]
    used: pd.Index  # rows of the table that were used
    reference: dict[str, str]  # entry -> the category that its terms are compared with
    left_out: dict[str, str]  # term -> why its effect cannot be estimated


def build_terms(
    table: pd.DataFrame,
    terms: str | Sequence[str],
    interactions: str | Sequence[tuple[str, str]],
    cases: Sequence[ModelCase],
    best_sizes: int | None,
) -> RegressionTerms:
    """Terms of the finished candidates in a table; the arguments are those of :class:`PatternExpressiveness`."""
    names = _names(table, terms)
    wants_ingredients = bool(set(names) & set(INGREDIENTS[1:]))  # the first is a column of the table itself
    if wants_ingredients or best_sizes is not None:
        refuse_absent_results(("framework", "case", "disturbance"), table)
    if wants_ingredients:
        table = table[table["case"].notna()]  # baselines have none
        if table.empty:
            raise ValueError("no row of results has a case; baselines alone have no ingredients to compare.")
        table = table.drop(columns=[c for c in INGREDIENTS[1:] if c in table]).join(ingredients(table, cases))
    if best_sizes is not None:
        by_case = table.sort_values("rmse", kind="stable").groupby(["framework", "case", "disturbance"], dropna=False)
        table = table.loc[by_case.head(best_sizes).index.sort_values()]
    entries, reference = {}, {}
    for name in names:
        entries[name] = _entry(table, name)
        if entries[name].shape[1] and name not in entries[name]:
            reference[name] = _categories(table[name])[0]
    columns, left_out = _estimable(entries, _pairs(interactions, names))
    if len(table) < columns.shape[1] + 2:
        raise ValueError(f"{len(table)} candidates are too few for {columns.shape[1]} terms; ask for fewer terms.")
    return RegressionTerms(columns, table["rmse"], table.index, reference, left_out)


def _names(table: pd.DataFrame, terms: str | Sequence[str]) -> list[str]:
    if isinstance(terms, str):
        if terms == "ingredients":
            return list(INGREDIENTS)
        if terms != "sizes":
            raise ValueError(f"terms={terms!r} is neither 'ingredients', 'sizes' nor a list of columns.")
        found = [name for name in _SIZE_COLUMNS if name in table and table[name].notna().any()]
        if not found:
            raise ValueError(f"results has no size; it may have {', '.join(_SIZE_COLUMNS)}.")
        return found
    names = list(dict.fromkeys(terms))
    for name in names:
        if name not in INGREDIENTS and name not in table:
            raise ValueError(f"term {name!r} is neither an ingredient ({', '.join(INGREDIENTS)}) nor a column.")
    if not names:
        raise ValueError("terms is empty; name an ingredient or a column.")
    return names


def _categories(column: pd.Series) -> list[str]:
    """Categories of a column, the reference first: MLP among frameworks, as in the paper."""
    found = list(dict.fromkeys(map(str, column)))
    order = [name for name in NETWORKS if name in found] if column.name == "framework" else []
    return order + sorted(name for name in found if name not in order)


def _entry(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """The terms of one entry: a column of numbers, or one indicator per category after the reference."""
    column = table[name]
    if column.isna().any():
        raise ValueError(
            f"{name} is NaN in {int(column.isna().sum())} of {len(column)} candidates; pass the rows of one framework."
        )
    in_objects = column.map(lambda value: isinstance(value, int | float)).all()
    if in_objects or is_numeric_dtype(column) or is_bool_dtype(column):
        return column.astype(float).to_frame(name)
    as_text = column.astype(str)
    others = {one: framework_label(one) if name == "framework" else f"{name}={one}" for one in _categories(column)[1:]}
    return pd.DataFrame({label: (as_text == one).astype(float) for one, label in others.items()}, index=table.index)


def framework_label(framework: str) -> str:
    """Name of a framework's term: a network in the paper's spelling."""
    return framework.upper() if framework in NETWORKS else framework


def _pairs(interactions: str | Sequence[tuple[str, str]], names: list[str]) -> list[tuple[str, str]]:
    if isinstance(interactions, str):
        if interactions != "all":
            raise ValueError(f"interactions={interactions!r} is neither 'all' nor a list of pairs.")
        return list(combinations(names, 2))
    pairs = []
    for pair in interactions:
        if isinstance(pair, str) or len(pair) != 2 or pair[0] == pair[1] or not set(pair) <= set(names):
            raise ValueError(f"interaction {pair!r} is not a pair of two of the terms {', '.join(names)}.")
        pairs.append((pair[0], pair[1]))
    return pairs


def _estimable(entries: dict[str, pd.DataFrame], pairs: list[tuple[str, str]]) -> tuple[pd.DataFrame, dict[str, str]]:
    """Terms that vary and are independent of those before them; and for the others, why they are left out."""
    main = pd.concat(entries.values(), axis=1)
    left_out = {name: f"{name} is the same in all candidates." for name, e in entries.items() if not _varies(e).any()}
    kept = main.loc[:, _varies(main)]
    kept, aliased = _independent(kept.iloc[:, :0], kept)
    if aliased:
        shown = "; ".join(f"{name} from {' and '.join(others)}" for name, others in aliased.items())
        warn_user(f"the table cannot separate {shown}: one effect is shown for them together.", SkhybridWarning)
    left_out |= {name: f"it cannot be separated from {' and '.join(others)}." for name, others in aliased.items()}
    if kept.empty:
        raise ValueError(f"none of {', '.join(entries)} differs between the candidates; there is nothing to compare.")
    centred = kept - kept.mean()
    products = {
        f"{a}:{b}": centred[a] * centred[b]
        for first, second in pairs
        for a in entries[first].columns.intersection(kept.columns)
        for b in entries[second].columns.intersection(kept.columns)
    }
    kept, aliased = _independent(kept, pd.DataFrame(products, index=kept.index))
    left_out |= {name: f"no candidates separate it from {' and '.join(others)}." for name, others in aliased.items()}
    return kept, left_out


def _varies(frame: pd.DataFrame) -> pd.Series:
    return (frame != frame.iloc[0]).any()


def _independent(kept: pd.DataFrame, more: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, list[str]]]:
    """``kept`` with the independent columns of ``more``; the names that each of the others depends on."""
    aliased = {}
    for name, column in more.items():
        x, before = column.to_numpy(float), (kept - kept.mean()).to_numpy(float)
        x = x - x.mean()
        weights = np.linalg.lstsq(before, x, rcond=None)[0] if before.shape[1] else np.zeros(0)
        length = float(np.linalg.norm(x))
        if float(np.linalg.norm(x - before @ weights)) > _ALIASED * max(length, 1.0):
            kept = kept.assign(**{str(name): column})
        else:
            weighed = np.abs(weights) * np.linalg.norm(before, axis=0)
            involved = weighed > 1e-6 * max(length, 1e-12)
            aliased[str(name)] = [str(c) for c in kept.columns[involved]] or ["the mean"]
    return kept, aliased
