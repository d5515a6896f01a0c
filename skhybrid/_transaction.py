"""A decorator for methods that leave an estimator unchanged when they fail."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

_Method = TypeVar("_Method", bound=Callable[..., Any])


def unchanged_on_failure(method: _Method) -> _Method:
    """Restore the attributes of the estimator if the method raises; it may replace, but not modify, what they hold."""

    @wraps(method)
    def guarded(self: Any, *args: Any, **kwargs: Any) -> Any:
        before = dict(vars(self))
        try:
            return method(self, *args, **kwargs)
        except BaseException:  # an interrupted fit must not leave half a fit either
            vars(self).clear()
            vars(self).update(before)
            raise

    return cast(_Method, guarded)
