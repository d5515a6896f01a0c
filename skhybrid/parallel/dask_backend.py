"""joblib's Dask backend, which also reports that a worker died."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple

from joblib._dask import DaskDistributedBackend

_RESTART = 60.0  # seconds that workers which died may take to come back


class _LostTask(NamedTuple):
    error: BaseException


class ErrorReportingDaskBackend(DaskDistributedBackend):
    """A Dask backend that hands on the error of a lost task; joblib's own would wait for its result forever."""

    def __init__(self, active: DaskDistributedBackend) -> None:
        patience = max(active.wait_for_workers_timeout, _RESTART)
        super().__init__(client=active.client, wait_for_workers_timeout=patience, **active.submit_kwargs)
        self.data_futures = active.data_futures

    def effective_n_jobs(self, n_jobs: int) -> int:
        """Threads of the workers, at least two: with one, joblib would compute in this process."""
        return max(2, super().effective_n_jobs(n_jobs))

    def submit(self, func: Any, callback: Callable[[Any], None] | None = None) -> Future:
        """Submit a task; ``callback`` hears of its result, and of the error if there will be none."""
        return _with_error(super().submit(func, callback), callback)

    def apply_async(self, func: Any, callback: Callable[[Any], None] | None = None) -> Future:
        """:meth:`submit` as joblib before 1.6 names it."""
        return _with_error(super().apply_async(func, callback), callback)

    def retrieve_result_callback(self, out: Any) -> Any:
        """The result of a task, or its error raised."""
        if isinstance(out, _LostTask):
            raise out.error
        return super().retrieve_result_callback(out)


def _with_error(future: Future, callback: Callable[[Any], None] | None) -> Future:
    def report(done: Future) -> None:
        error = done.exception()
        if error is not None and callback is not None:
            callback(_LostTask(error))

    future.add_done_callback(report)
    return future
