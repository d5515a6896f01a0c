"""Limits of BLAS and OpenMP to one thread."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from threading import Lock
from typing import Any, TypeVar, cast

from threadpoolctl import ThreadpoolController, threadpool_limits

_Method = TypeVar("_Method", bound=Callable[..., Any])


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


class _OneBlasThread:
    """A limit of the whole process: the first method to begin, in any thread, sets it, and the last to end lifts it."""

    def __init__(self) -> None:
        self._lock, self._running = Lock(), 0
        self._limit: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._running:
                self._limit = _controller().limit(limits=1, user_api="blas")
            self._running += 1

    def __exit__(self, *error: object) -> None:
        with self._lock:
            self._running -= 1
            if not self._running:
                self._limit.restore_original_limits()
            for library in _controller().lib_controllers:
                # since threadpoolctl 3.8 only one thread may set the number, until it gives that up
                getattr(library, "clear_controlling_thread", lambda: None)()


_one_blas_thread = _OneBlasThread()


def one_blas_thread(method: _Method) -> _Method:
    """Run a method with one BLAS thread: faster for small matrices, and its last bits depend on no thread count."""

    @wraps(method)
    def limited(*args: Any, **kwargs: Any) -> Any:
        with _one_blas_thread:
            return method(*args, **kwargs)

    return cast(_Method, limited)


def one_openmp_thread() -> threadpool_limits:
    """A limit for a block that grows trees on few rows.

    Threads that wait for one another spin: beside other processes, two took ten times as long as one.
    """
    return threadpool_limits(1, user_api="openmp")
