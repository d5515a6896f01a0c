"""A decorator for methods that leave an estimator unchanged when they fail."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np

_Method = TypeVar("_Method", bound=Callable[..., Any])


def unchanged_on_failure(method: _Method) -> _Method:
    """Restore the attributes of the estimator if the method raises; it may replace, but not modify, what they hold.

    A random generator among them, which every draw modifies, is set back.
    """

    @wraps(method)
    def guarded(self: Any, *args: Any, **kwargs: Any) -> Any:
        held = vars(self)
        before = dict(held)
        drawn = [(rng, rng.get_state()) for rng in before.values() if isinstance(rng, np.random.RandomState)]
        try:
            return method(self, *args, **kwargs)
        except BaseException:  # an interrupted fit must not leave half a fit either
            held.update(before)
            for name in held.keys() - before.keys():
                del held[name]
            for rng, state in drawn:
                rng.set_state(state)
            raise

    return cast(_Method, guarded)
