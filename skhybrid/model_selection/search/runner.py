"""Parallel runs of the tasks of a search, with all results in one store."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from joblib import delayed
from tqdm.auto import tqdm

from ...parallel.shared import Shared
from ...parallel.stored_settings import as_plain
from ...parallel.workers import Workers
from .candidates import BASELINE, candidate_id, effort_of, identification_params, shares_network, stack_key
from .store import Result, ResultStore, Task
from .tasks import Problem, evaluate, identify

_POLL_INTERVAL = 0.5  # how long to wait before asking again whether another process has finished its part [s]


class Chunk(NamedTuple):
    """Candidates that one worker fits together."""

    network: str | None  # key of the thermal network that they share; None where each is fitted as a whole
    params: dict[str, dict[str, Any]]  # candidate id -> parameters


class Runner:
    """Runs candidates on all splits, except for what the store already holds; ``chunk_size`` is the largest chunk."""

    def __init__(
        self, problem: Problem, store: ResultStore, workers: Workers, chunk_size: int, catch_errors: bool, verbose: bool
    ) -> None:
        self._problem, self._shared, self._store, self._workers = problem, Shared(problem), store, workers
        self._chunk_size, self._catch_errors, self._verbose = chunk_size, catch_errors, verbose
        self._shares: dict[str, bool] = {}
        self._network_params: dict[str, dict[str, Any]] = {}
        self._networks: dict[tuple[str, int], Shared] = {}

    def run(self, candidates: Sequence[Mapping[str, Any]], note: str = "") -> list[list[Result]]:
        """Results by candidate and split; the note is shown before the progress bar."""
        named = {candidate_id(params): dict(params) for params in candidates}
        self._store.describe({name: as_plain(params) for name, params in named.items()})
        chunks, n_splits = self._chunks(named), len(self._problem.splits)
        work = [(chunk, split) for chunk in chunks for split in range(n_splits)]
        with tqdm(total=len(named) * n_splits, unit="fit", desc=note or None, disable=not self._verbose) as bar:
            found = self._store.results(named)
            bar.initial = bar.n = len(found)  # stored results do not count for the rate
            bar.refresh()
            while left := _unfinished(work, found):
                if not self._compute(left, bar):
                    time.sleep(_POLL_INTERVAL)  # other processes are working on all that is left
                found = self._store.results(named)
                bar.n = len(found)
                bar.refresh()
        return [[found[Task(name, split)] for split in range(n_splits)] for name in map(candidate_id, candidates)]

    def _chunks(self, named: Mapping[str, dict[str, Any]]) -> list[Chunk]:
        """Chunks with the same network and kind of disturbance, the longest first so that none waits at the end."""
        groups: dict[tuple[str, str], list[str]] = {}
        networks = {name: self._network_of(params) for name, params in named.items()}
        for name, params in named.items():
            kind = {key: value for key, value in params.items() if key.split("__")[-1] in ("disturbance", "model")}
            groups.setdefault((str(networks[name]), as_plain(kind)), []).append(name)
        chunks = []
        for names in groups.values():
            for part in _parts({name: stack_key(named[name]) for name in names}, self._chunk_size):
                chunks.append(Chunk(networks[part[0]], {name: named[name] for name in part}))
        return sorted(chunks, key=lambda chunk: -sum(map(effort_of, chunk.params.values())))

    def _network_of(self, params: Mapping[str, Any]) -> str | None:
        """Key of the network that a candidate shares, or None where it is fitted as a whole."""
        if BASELINE in params:
            return None
        shared = identification_params(self._problem.estimator, params)
        named = {k: v for k, v in params.items() if k.split("__")[-1] in ("forecaster", "model", "disturbance")}
        key = as_plain([shared, named])
        if key not in self._shares:
            self._shares[key] = shares_network(self._problem.estimator, params)
        network = as_plain(shared)
        self._network_params[network] = shared
        return network if self._shares[key] else None

    def _compute(self, work: Sequence[tuple[Chunk, int]], bar: tqdm) -> int:
        """Compute the tasks that no other process has claimed; return how many there were."""
        self._identify(work, bar)
        count = 0
        for results in self._workers.run(self._calls(work)):
            self._store.finish(results)
            count += len(results)
            bar.update(len(results))
        return count

    def _calls(self, work: Sequence[tuple[Chunk, int]]) -> Iterator[Any]:
        """Calls for the workers; the tasks of each are claimed when a worker asks for it."""
        for chunk, split in work:
            claimed = self._store.claim([Task(name, split) for name in chunk.params])
            if claimed:
                network = None if chunk.network is None else self._networks[chunk.network, split]
                tasks = {task: chunk.params[task.candidate] for task in claimed}
                yield delayed(evaluate)(self._shared, network, tasks, split, self._catch_errors)

    def _identify(self, work: Sequence[tuple[Chunk, int]], bar: tqdm) -> None:
        """Identify the networks that are needed and not known yet, each once."""
        needed = {(chunk.network, split): None for chunk, split in work if chunk.network is not None}
        new = [key for key in needed if key not in self._networks]
        if new:
            bar.set_postfix_str(f"identifying the network of {len(new)} training blocks")
            calls = (
                delayed(identify)(self._shared, name, self._network_params[name], split, self._catch_errors)
                for name, split in new
            )
            for found in self._workers.run(calls):
                self._networks |= {key: Shared(network) for key, network in found.items()}
            bar.set_postfix_str("")


def _parts(keys: Mapping[str, tuple[str, ...]], size: int) -> list[list[str]]:
    """Names of candidates in parts of at most ``size``; what trains as one stack is cut only if it is larger.

    Small stacks are joined up to half of ``size`` only: the longest part should not be all that is left at the end.
    """
    parts: list[list[str]] = []
    for _, stack in groupby(sorted(keys, key=lambda name: keys[name]), key=lambda name: keys[name][:2]):
        names = list(stack)
        for piece in (names[start : start + size] for start in range(0, len(names), size)):
            if not parts or len(parts[-1]) + len(piece) > max(1, size // 2):
                parts.append([])
            parts[-1] += piece
    return parts


def _unfinished(work: Sequence[tuple[Chunk, int]], found: Mapping[Task, Result]) -> list[tuple[Chunk, int]]:
    left = []
    for chunk, split in work:
        params = {name: params for name, params in chunk.params.items() if Task(name, split) not in found}
        if params:
            left.append((Chunk(chunk.network, params), split))
    return left
