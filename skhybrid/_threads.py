"""A decorator that limits BLAS to one thread."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, TypeVar, cast

from threadpoolctl import ThreadpoolController

_Method = TypeVar("_Method", bound=Callable[..., Any])


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def one_blas_thread(method: _Method) -> _Method:
    """Run a method with one BLAS thread: faster for small matrices, and its last bits depend on no thread count."""

    @wraps(method)
    def limited(*args: Any, **kwargs: Any) -> Any:
        with _controller().limit(limits=1, user_api="blas"):
            return method(*args, **kwargs)

    return cast(_Method, limited)
