"""Search from many random starts, in rounds, until enough of them agree on the best minimum."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed, effective_n_jobs

from ..._arguments import as_mapping
from ...thermal import Parameter
from ...thermal.parameters import search_bounds
from .gauss_newton import Minimum

ENOUGH = 5  # starts that have to end at the best minimum before the search ends
SAME = 0.05  # two minima are one where their log-likelihoods differ by no more than this
_POLISHED = 2  # minima of a round that are carried to the end

Minimise = Callable[[np.ndarray], list[Minimum]]


def random_starts(searched: Sequence[Parameter], n_starts: int, rng: np.random.RandomState) -> np.ndarray:
    """(n_starts, p) uniform on the searched scale, which is log-uniform for the physical parameters."""
    low, high = search_bounds(searched)
    return low + (high - low) * rng.uniform(size=(n_starts, len(searched)))


def check_start(begin: Any, names: Collection[str], is_own: Callable[[str], bool]) -> None:
    """Refuse a start that is not a mapping of names, or of what the disturbance model may have, to values."""
    given = as_mapping("theta_init", begin, "parameters to values")
    unknown = [name for name in given if name not in names and not is_own(name)]
    if unknown:
        raise ValueError(f"theta_init names {unknown[0]!r}, which is not one of {', '.join(sorted(names))}.")


def start_at(searched: Sequence[Parameter], begin: Mapping[str, float], others: np.ndarray) -> np.ndarray:
    """(1, p) the start at given values, within the bounds; (p,) ``others`` where none is given."""
    for p in searched:
        value = begin.get(p.name, p.default)
        if not isinstance(value, Real) or not np.isfinite(value) or (p.transform == "log" and value * p.sign <= 0):
            raise ValueError(f"theta_init gives {p.name} the value {value!r}; it lies in [{p.lower:g}, {p.upper:g}].")
    start = [p.to_free(begin[p.name]) if p.name in begin else x for p, x in zip(searched, others, strict=True)]
    return np.clip([start], *search_bounds(searched))


def search(
    minimise: Minimise,
    starts: np.ndarray,
    drop: Callable[[float, float], float],
    *,
    polish: Minimise | None = None,
    per_round: int = 10,
    enough: int = ENOUGH,
    n_jobs: int | None = None,
    verbose: int = 0,
    name: str = "",
) -> list[Minimum]:
    """Minima of the starts that were made, in their order; rounds of a fixed size, so that ``n_jobs`` changes nothing.

    After a round ``polish`` carries its best minima to the end; the search ends once ``enough`` starts have reached the
    best one.  ``drop`` gives by how much the log-likelihood of one loss lies below that of the best.
    """
    minima: list[Minimum] = []
    rounds = [starts[i : i + per_round] for i in range(0, len(starts), per_round)]
    bar = _bar(len(starts), verbose, name)
    for batch in rounds:
        minima += _run(minimise, batch, n_jobs)
        if polish is not None:
            _polish_best(polish, minima, len(minima) - len(batch))
        if bar is not None:
            bar.update(len(batch))
        if int(reached_best(minima, drop).sum()) >= enough:
            break
    if bar is not None:
        bar.close()
    return minima


def _run(minimise: Minimise, batch: np.ndarray, n_jobs: int | None) -> list[Minimum]:
    workers = min(effective_n_jobs(n_jobs), len(batch))
    if workers < 2:
        return minimise(batch)
    parts = Parallel(n_jobs=workers)(delayed(minimise)(part) for part in np.array_split(batch, workers))
    return [minimum for part in parts for minimum in part]


def _polish_best(polish: Minimise, minima: list[Minimum], first: int) -> None:
    """Carry the best minima of a round to the end, where they may still be the best of all."""
    order = sorted(range(first, len(minima)), key=lambda i: minima[i].loss)[:_POLISHED]
    for i, end in zip(order, polish(np.array([minima[i].free for i in order])), strict=True):
        if end.loss <= minima[i].loss:
            minima[i] = end._replace(n_evaluations=end.n_evaluations + minima[i].n_evaluations)


def reached_best(minima: Sequence[Minimum], drop: Callable[[float, float], float]) -> np.ndarray:
    """(n,) bool, True for minima within :data:`SAME` of the best log-likelihood."""
    best = min(m.loss for m in minima)
    return np.array([np.isfinite(m.loss) and drop(m.loss, best) <= SAME for m in minima])


def starts_table(
    minima: Sequence[Minimum], searched: Sequence[Parameter], drop: Callable[[float, float], float]
) -> pd.DataFrame:
    """One row per start that was made: its loss, whether that is the best, its evaluations, and where it ended."""
    rows = [
        {"loss": m.loss, "reached_best": bool(b), "n_evaluations": m.n_evaluations, "converged": m.converged}
        | {p.name: p.from_free(x) for p, x in zip(searched, m.free, strict=True)}
        for m, b in zip(minima, reached_best(minima, drop), strict=True)
    ]
    return pd.DataFrame(rows, index=pd.RangeIndex(len(rows), name="start"))


def _bar(total: int, verbose: int, name: str):
    if not verbose:
        return None
    from tqdm.auto import tqdm  # slow to import, and rarely needed

    return tqdm(total=total, desc=f"{name} starts", unit="start")
