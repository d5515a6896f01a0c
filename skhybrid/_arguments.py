"""Checks of arguments that estimators share: integers, numbers, mappings and seeds."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
from sklearn.utils import check_random_state

_LARGEST = sys.float_info.max


def check_integer(name: str, value: Any, least: int = 1) -> None:
    """Refuse a value that is no integer, or less than the least one."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name}={value!r} must be an integer of at least {least}.")


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, which a bool is not."""
    number: Any = value if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    return bool(abs(number) <= _LARGEST)


def check_rate(name: str, value: Any) -> None:
    """Refuse a value that is no finite number above 0."""
    if not (is_number(value) and value > 0):
        raise ValueError(f"{name}={value!r} is outside (0, inf).")


def as_mapping(name: str, given: Any, content: str) -> dict[Any, Any]:
    """A mapping as a dict, an empty one for None; anything else is refused with what it should map."""
    if given is not None and not isinstance(given, Mapping):
        raise ValueError(f"{name}={given!r} must be a mapping of {content}.")
    return dict(given or {})


def draw_seed(random_state: int | np.random.RandomState | None) -> int:
    """A seed for local generators; fresh entropy where None, so that the global state is left alone."""
    if random_state is None:
        return int(np.random.default_rng().integers(2**31 - 1))
    if isinstance(random_state, int | np.integer):
        return int(random_state)
    return int(check_random_state(random_state).randint(2**31 - 1))
