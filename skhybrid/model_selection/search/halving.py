"""Successive halving: networks that do badly after a few epochs are trained no further."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import clone

from ..._arguments import is_integer
from ...forecasting.named_models import is_network
from .candidates import forecaster_prefix, model_of
from .store import Result

_COLUMNS = ["max_epochs", "n_candidates", "n_stopped", "worst_kept"]
_Run = Callable[[Sequence[Mapping[str, Any]], str], list[list[Result]]]


class SearchOutcome(NamedTuple):
    """Results of all candidates, in their order."""

    results: list[list[Result]]  # by candidate and split
    stopped_at: np.ndarray  # (n_candidates,) epochs after which a candidate was stopped; NaN where it was not
    rungs: pd.DataFrame


def check_halving(halving: Any) -> tuple[int, int]:
    """Epochs of the first rung and the factor, which is 3 unless it is given."""
    given = halving if isinstance(halving, tuple | list) else (halving, 3)
    if not all(map(is_integer, given)) or len(given) != 2 or given[0] < 1 or given[1] < 2:
        raise ValueError(
            f"halving={halving!r} must be a number of epochs from 1 on, or a pair of it and a factor from 2 on."
        )
    return int(given[0]), int(given[1])


def run_halving(
    run: _Run, estimator: Any, candidates: Sequence[Mapping[str, Any]], first: int, factor: int
) -> SearchOutcome:
    """Train networks for ``first`` epochs, the best ``1 / factor`` of them for ``factor`` times as many, and so on.

    ``run`` takes candidates and a note for the progress bar.  Candidates without a network are fitted to the end.
    """
    results: list[list[Result]] = [[] for _ in candidates]
    stopped_at = np.full(len(candidates), np.nan)
    prefix = forecaster_prefix(estimator)
    left, limits = _networks(estimator, candidates, prefix)
    rungs, epochs = [], first
    while len(left) > 1 and epochs < limits.min():  # fewer than the shortest training of any candidate
        found = run([{**candidates[i], f"{prefix}max_epochs": epochs} for i in left], f"{epochs} epochs")
        rmse = np.array([np.mean([one.rmse for one in row]) for row in found])  # NaN of a failed one sorts last
        order = np.argsort(rmse, kind="stable")
        n_kept = min(-(-len(left) // factor), int(np.isfinite(rmse).sum()))
        for i in order[n_kept:]:
            results[left[i]], stopped_at[left[i]] = found[i], epochs
        worst = float(rmse[order[n_kept - 1]]) if n_kept else np.nan
        rungs.append((epochs, len(left), len(left) - n_kept, worst))
        left = left[np.sort(order[:n_kept])]
        epochs *= factor
    kept = [i for i, stopped in enumerate(stopped_at) if np.isnan(stopped)]
    for i, row in zip(kept, run([candidates[i] for i in kept], ""), strict=True):
        results[i] = row
    return SearchOutcome(results, stopped_at, pd.DataFrame(rungs, columns=_COLUMNS))


def run_all(run: _Run, candidates: Sequence[Mapping[str, Any]]) -> SearchOutcome:
    """Run all candidates to the end."""
    return SearchOutcome(run(candidates, ""), np.full(len(candidates), np.nan), pd.DataFrame(columns=_COLUMNS))


def _networks(estimator: Any, candidates: Sequence[Mapping[str, Any]], prefix: str) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the candidates that are networks, and the most epochs of each."""
    default = clone(estimator).set_params(**{f"{prefix}model": "lstm"}).get_params()[f"{prefix}max_epochs"]
    chosen = [i for i, params in enumerate(candidates) if is_network(model_of(estimator, params))]
    limits = [candidates[i].get(f"{prefix}max_epochs", default) for i in chosen]
    return np.array(chosen, dtype=np.int64), np.array(limits)
