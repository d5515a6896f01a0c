"""A pool of workers: joblib's own processes, or those of Dask or Ray by the backend in force."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any, Self

from joblib import Parallel, effective_n_jobs
from joblib.parallel import get_active_backend

from .._arguments import check_n_jobs

_MAX_SENT = 10_000  # joblib's own workers map larger arrays from disk instead of getting them with every task [bytes]


class Workers:
    """One pool of joblib workers, here or on a cluster, kept until all is done."""

    def __init__(self, n_jobs: int | None) -> None:
        check_n_jobs(n_jobs)
        settings = {"n_jobs": n_jobs, "batch_size": 1, "max_nbytes": _MAX_SENT} | _of_dask()
        self._batch_size = None
        try:
            self._parallel = Parallel(**settings, return_as="generator_unordered")
        except ValueError:  # this backend returns nothing before all is done, so it gets a few tasks at a time
            self._parallel = Parallel(**settings)
            self._batch_size = 2 * effective_n_jobs(n_jobs)

    def __enter__(self) -> Self:
        self._parallel.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._parallel.__exit__(*raised)

    def run(self, calls: Iterator[Any]) -> Iterator[Any]:
        """Results in the order in which they are finished; the next call is taken when a worker is free."""
        if self._batch_size is None:
            yield from self._parallel(calls)
            return
        while batch := list(islice(calls, self._batch_size)):
            yield from self._parallel(batch)


def _of_dask() -> dict[str, Any]:
    """The backend to use in place of joblib's for Dask, where that is the active one."""
    active, _ = get_active_backend()
    if type(active).__name__ != "DaskDistributedBackend":
        return {}
    from .dask_backend import ErrorReportingDaskBackend  # imports Dask

    return {"backend": ErrorReportingDaskBackend(active)}
