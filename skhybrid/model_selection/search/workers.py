"""Running tasks through joblib, from one store, whatever the backend."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple, Self

from joblib import Parallel, delayed, effective_n_jobs
from tqdm.auto import tqdm

from .candidates import RIVAL, Problem, Shared, effort_of, evaluate, identify, outside_params, shares_network, stack_of
from .fingerprint import as_plain, candidate_id
from .store import Result, ResultStore, Task

#: what is larger is mapped from disk by joblib's own workers, not sent with every task [bytes]
_MAPPED = 10_000
#: how long to wait before asking again whether another process has finished its part [s]
_POLL = 0.5


class _Chunk(NamedTuple):
    """Candidates that a worker takes at once: they share a network, and features."""

    base: str | None  # the network, by name; None: each is fitted whole
    params: dict[str, dict[str, Any]]  # by candidate


class Workers:
    """Processes that joblib has, here or on a cluster; the same ones from the beginning of a search to its end.

    Parameters
    ----------
    n_jobs : int or None
        As joblib counts them.
    """

    def __init__(self, n_jobs: int | None) -> None:
        how = {"n_jobs": n_jobs, "batch_size": 1, "max_nbytes": _MAPPED}
        self._at_once = None
        try:
            self._parallel = Parallel(**how, return_as="generator_unordered")
        except ValueError:  # a backend that hands over nothing before all is done: it is given little at a time
            self._parallel = Parallel(**how)
            self._at_once = 2 * effective_n_jobs(n_jobs)

    def __enter__(self) -> Self:
        self._parallel.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._parallel.__exit__(*raised)

    def run(self, calls: Iterator[Any]) -> Iterator[Any]:
        """Results in the order in which they are finished; a call is asked for when there is somebody to take it."""
        if self._at_once is None:
            yield from self._parallel(calls)
            return
        while some := list(islice(calls, self._at_once)):
            yield from self._parallel(some)


class Runner:
    """Candidates in, results out; what the store holds is not computed again.

    Parameters
    ----------
    problem : Problem
    store : ResultStore
    workers : Workers
    chunk_size : int
        Most candidates of a chunk.
    careful : bool
        Whether an error becomes part of the result; else it is raised.
    verbose : bool
        Whether a progress bar is shown.
    """

    def __init__(
        self, problem: Problem, store: ResultStore, workers: Workers, chunk_size: int, careful: bool, verbose: bool
    ) -> None:
        self._problem = problem
        self._shared = Shared(problem)
        self._store = store
        self._workers = workers
        self._chunk_size = chunk_size
        self._careful = careful
        self._verbose = verbose
        self._shares: dict[str, bool] = {}
        self._base_params: dict[str, dict[str, Any]] = {}
        self._bases: dict[tuple[str, int], Shared] = {}

    def run(self, candidates: Sequence[Mapping[str, Any]], note: str = "") -> list[list[Result]]:
        """Run candidates on all splits.

        Parameters
        ----------
        candidates : sequence of Mapping
            Their parameters.
        note : str, default ""
            Shown before the progress bar.

        Returns
        -------
        list of list of Result
            By candidate and split.
        """
        named = {candidate_id(params): dict(params) for params in candidates}
        self._store.describe({name: as_plain(params) for name, params in named.items()})
        chunks, n_splits = self._chunks(named), len(self._problem.splits)
        work = [(chunk, split) for chunk in chunks for split in range(n_splits)]
        with tqdm(total=len(named) * n_splits, unit="fit", desc=note or None, disable=not self._verbose) as bar:
            found = self._store.results(named)
            bar.initial = bar.n = len(found)  # what was there does not count for the rate
            bar.refresh()
            while left := _without(found, work):
                if not self._round(left, bar):
                    time.sleep(_POLL)  # all that is left is in other hands
                found = self._store.results(named)
                bar.n = len(found)
                bar.refresh()
        names = map(candidate_id, candidates)
        return [[found[Task(name, split)] for split in range(n_splits)] for name in names]

    def _chunks(self, named: Mapping[str, dict[str, Any]]) -> list[_Chunk]:
        """Candidates of the same network and kind of disturbance, those that can be trained as one stack together.

        What takes longest stands first.
        """
        groups: dict[tuple[str, str], list[str]] = {}
        bases = {name: self._base_of(params) for name, params in named.items()}
        for name, params in named.items():
            kind = {key: value for key, value in params.items() if key.split("__")[-1] in ("disturbance", "model")}
            groups.setdefault((str(bases[name]), as_plain(kind)), []).append(name)
        size = max(1, int(self._chunk_size))
        chunks = []
        for names in groups.values():
            names = sorted(names, key=lambda name: stack_of(named[name]))
            parts = [names[start : start + size] for start in range(0, len(names), size)]
            chunks += [_Chunk(bases[part[0]], {name: named[name] for name in part}) for part in parts]
        return sorted(chunks, key=lambda chunk: -sum(map(effort_of, chunk.params.values())))

    def _base_of(self, params: Mapping[str, Any]) -> str | None:
        """The name of a candidate's network, or None where it is fitted whole."""
        if RIVAL in params:
            return None
        outside, model = outside_params(self._problem.estimator, params)
        key = as_plain([outside, model])
        if key not in self._shares:
            self._shares[key] = shares_network(self._problem.estimator, params)
        self._base_params[as_plain(outside)] = outside
        return as_plain(outside) if self._shares[key] else None

    def _round(self, work: Sequence[tuple[_Chunk, int]], bar: tqdm) -> int:
        """Compute what is nobody else's; how many tasks that were."""
        self._identify(work, bar)
        count = 0
        for results in self._workers.run(self._jobs(work)):
            self._store.finish(results)
            count += len(results)
            bar.update(len(results))
        return count

    def _jobs(self, work: Sequence[tuple[_Chunk, int]]) -> Iterator[Any]:
        """Calls for workers, each claimed when it is asked for."""
        for chunk, split in work:
            mine = self._store.claim([Task(name, split) for name in chunk.params])
            if mine:
                base = None if chunk.base is None else self._bases[chunk.base, split]
                tasks = {task: chunk.params[task.candidate] for task in mine}
                yield delayed(evaluate)(self._shared, base, tasks, split, self._careful)

    def _identify(self, work: Sequence[tuple[_Chunk, int]], bar: tqdm) -> None:
        """Identify the networks that are wanted and not at hand, each once."""
        wanted = {(chunk.base, split): None for chunk, split in work if chunk.base is not None}
        new = [key for key in wanted if key not in self._bases]
        if new:
            bar.set_postfix_str(f"identifying the network of {len(new)} training blocks")
            calls = (delayed(identify)(self._shared, b, self._base_params[b], split, self._careful) for b, split in new)
            for found in self._workers.run(calls):
                self._bases |= {key: Shared(base) for key, base in found.items()}
            bar.set_postfix_str("")


def _without(found: Mapping[Task, Result], work: Sequence[tuple[_Chunk, int]]) -> list[tuple[_Chunk, int]]:
    """The work that is not finished."""
    left = []
    for chunk, split in work:
        params = {name: params for name, params in chunk.params.items() if Task(name, split) not in found}
        if params:
            left.append((_Chunk(chunk.base, params), split))
    return left
