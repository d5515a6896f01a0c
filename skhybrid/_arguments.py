"""Arguments of constructors, stored and checked: integers, numbers, mappings, rows, seeds, estimators of one kind."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

_LARGEST = sys.float_info.max


def is_integer(value: Any) -> bool:
    """Whether a value is an integer, which a bool and a duration of NumPy are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def store_arguments(estimator: Any, given: Mapping[str, Any]) -> None:
    """Set the arguments of ``__init__``, its ``locals()``, as attributes: scikit-learn's convention, in one line."""
    for name, value in given.items():
        if name != "self":
            setattr(estimator, name, value)


def check_integer(name: str, value: Any, least: int = 1, most: int | None = None) -> None:
    """Refuse what is not an integer from ``least`` to ``most``; without ``most`` there is no upper limit."""
    if not is_integer(value) or value < least or (most is not None and value > most):
        span = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise ValueError(f"{name}={value!r} must be an integer {span}.")


def check_n_jobs(n_jobs: Any) -> None:
    """Refuse a number of workers that is neither None nor an integer other than 0."""
    if n_jobs is not None and (not is_integer(n_jobs) or n_jobs == 0):
        raise ValueError(f"n_jobs={n_jobs!r} must be a number of workers, -1 for one per core, or None.")


def check_bool(name: str, value: Any) -> None:
    """Refuse a value that is neither True nor False: any word would count as True."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name}={value!r} must be True or False.")


def check_verbose(verbose: Any) -> None:
    """Refuse what is neither a bool nor an integer: any word would count as True."""
    if not isinstance(verbose, int | np.integer | np.bool_):
        raise ValueError(f"verbose={verbose!r} must be True, False or an integer; 0 shows nothing.")


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, which a bool is not."""
    number: Any = value if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    number = float(number) if isinstance(number, np.floating) else number  # of 32 bits, the bound would overflow
    return bool(abs(number) <= _LARGEST)


def check_place(latitude: Any, longitude: Any, where: str = "") -> None:
    """Refuse what is no place on earth [deg]; ``where`` names the table of a configuration that gives it."""
    for name, value, bound in (("latitude", latitude, 90.0), ("longitude", longitude, 180.0)):
        if not (is_number(value) and abs(value) <= bound):
            given = f"{where} {name} = {value!r}" if where else f"{name}={value!r}"
            raise ValueError(f"{given} must be a number of degrees from {-bound:g} to {bound:g}.")


def check_rate(name: str, value: Any) -> None:
    """Refuse what is not a finite number above 0."""
    if not (is_number(value) and value > 0):
        raise ValueError(f"{name}={value!r} is outside (0, inf).")


def check_level(level: Any, least: float = 0.0) -> None:
    """Refuse what is not a probability between ``least`` and 1."""
    if not (is_number(level) and least < level < 1.0):
        raise ValueError(f"level={level!r} is not between {least:g} and 1; give a share, such as 0.9 for 90 %.")


def refuse_without(estimator: Any, name: str, needed: str) -> None:
    """Refuse an estimator that lacks a method or a fitted attribute, in words for what is ``needed``."""
    if not hasattr(estimator, name):
        if isinstance(estimator, BaseEstimator):
            check_is_fitted(estimator)
        raise ValueError(f"{type(estimator).__name__} is not {needed}; give one.")


def as_mapping(name: str, given: Any, content: str) -> dict[Any, Any]:
    """A mapping as a dict, an empty one for None; anything else is refused with what it should map."""
    if given is not None and not isinstance(given, Mapping):
        raise ValueError(f"{name}={given!r} must be a mapping of {content}.")
    return dict(given or {})


def row_of(given: Any) -> Any:
    """The row of a frame that has only one, as a Series; anything else as it is."""
    return given.iloc[0] if isinstance(given, pd.DataFrame) and len(given) == 1 else given


def random_numbers(random_state: Any) -> np.random.RandomState:
    """The generator of a seed or RandomState; one of fresh entropy where None, so that the global one is left alone."""
    if random_state is None:
        return np.random.RandomState()
    try:
        return check_random_state(random_state)
    except ValueError:
        raise ValueError(
            f"random_state={random_state!r} must be an integer from 0 to {2**32 - 1}, a RandomState or None."
        ) from None


def draw_seed(random_state: Any) -> int:
    """A seed for local generators: an integer itself, else one that is drawn."""
    if isinstance(random_state, int | np.integer) and 0 <= random_state < 2**32:
        return int(random_state)
    return int(random_numbers(random_state).randint(2**31 - 1))
