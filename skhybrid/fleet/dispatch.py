"""Calls per zone on joblib's workers, here or on a cluster; a zone that fails does not stop the others."""

from __future__ import annotations

import errno
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from joblib import delayed

from .._threads import one_blas_thread
from .._warnings import several, warn_user, warnings_to
from ..exceptions import FleetWarning
from ..parallel.workers import Workers

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS}  # errors that every further zone would meet as well
#: classes of the errors by which engines tell that a worker died: those of joblib, Dask and Ray
_DEATHS = {"BrokenExecutor", "KilledWorker", "RayActorError", "WorkerCrashedError", "OutOfMemoryError"}
_DIED = (
    "the worker died at this zone, twice, as where memory runs out; give workers more memory, or the zone fewer rows."
)
_MOST_CAUSES = 3  # that an error names
_NUMBER = re.compile(r"\d[\d.]*")


class ZoneOutcome(NamedTuple):
    """The result of a call for one zone, or its error."""

    zone: str
    value: Any = None
    error: str | None = None
    warnings: tuple[str, ...] = ()
    stop: OSError | None = None  # an error that ends the fleet's work


def causes(failed: Iterable[ZoneOutcome]) -> str:
    """The commonest errors of zones, each with its number of zones; stamps and numbers make no other error."""
    alike: dict[str, list[ZoneOutcome]] = {}
    for outcome in failed:
        alike.setdefault(_NUMBER.sub("", outcome.error or ""), []).append(outcome)
    ranked = sorted(alike.values(), key=len, reverse=True)
    shown = [(f"{len(of)} zones, the first" if len(of) > 1 else "zone", of[0]) for of in ranked[:_MOST_CAUSES]]
    told = [f"{zones} {first.zone}: {first.error}" for zones, first in shown]
    n_others = sum(map(len, ranked[_MOST_CAUSES:]))
    return " ".join([*told, f"{several(n_others, 'zone')}: other errors."] if n_others else told)


def warn_of_failed(outcomes: Sequence[ZoneOutcome], failed: str = "failed") -> None:
    """Warn once of the zones that failed."""
    bad = [outcome for outcome in outcomes if outcome.error is not None]
    if bad:
        warn_user(f"{len(bad)} of {len(outcomes)} zones {failed}, see errors_; {causes(bad)}", FleetWarning)


@one_blas_thread
def attempt(zone: str, call: Callable[..., Any], *given: Any, **named: Any) -> ZoneOutcome:
    """Call for a zone; its errors and warnings are part of the outcome."""
    said: dict[str, None] = {}
    with warnings_to(lambda warning: said.setdefault(str(warning))):  # zones may run in threads
        value, error, stop = None, None, None
        try:
            value = call(*given, **named)
        except OSError as failure:
            error, stop = str(failure), failure if failure.errno in _FULL else None
        except Exception as failure:  # whatever it is, the other zones go on
            error = str(failure) or type(failure).__name__
    return ZoneOutcome(zone, value, error, tuple(said), stop)


def run(calls: Mapping[str, tuple[Callable[..., Any], tuple[Any, ...]]], n_jobs: int | None) -> Iterator[ZoneOutcome]:
    """Outcomes of calls (function, arguments) by zone, as they are finished.

    Where a worker dies, the zones in work are tried once more, one at a time: the one that kills its worker again has
    failed.
    """
    waiting, suspects = dict(calls), set[str]()
    while waiting:
        first = next(iter(waiting))
        batch = {zone: call for zone, call in waiting.items() if zone not in suspects} or {first: waiting[first]}
        begun: set[str] = set()
        try:
            with Workers(n_jobs) as workers:
                for outcome in workers.run(_tasks(batch, begun)):
                    begun.discard(outcome.zone)
                    del waiting[outcome.zone]
                    if outcome.stop is not None:
                        raise outcome.stop
                    yield outcome
        except Exception as error:
            if not {base.__name__ for base in type(error).__mro__} & _DEATHS:
                raise
            if not batch.keys().isdisjoint(suspects):
                del waiting[first]
                yield ZoneOutcome(first, error=_DIED)
            suspects |= begun


def _tasks(batch: Mapping[str, tuple[Callable[..., Any], tuple[Any, ...]]], begun: set[str]) -> Iterator[Any]:
    for zone, (call, given) in batch.items():
        begun.add(zone)
        yield delayed(attempt)(zone, call, *given)
