"""The parts of a predictor, which are cloned, and refused where they cannot do their work."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sklearn.base import clone


def clone_part(name: str, given: Any, needed: Iterable[str], wanted: str) -> Any:
    """A clone of what was given for a part; refused unless it is an estimator with all ``needed`` attributes."""
    if isinstance(given, type) or not all(hasattr(given, one) for one in ("get_params", *needed)):
        raise ValueError(f"{name}={given!r} must be {wanted}.")
    return clone(given)


def wanted_forecaster(given: Any) -> str:
    """A sentence end for what does not forecast a disturbance, such as a regressor: what to give in its place."""
    model = given if isinstance(given, str) or (hasattr(given, "predict") and not isinstance(given, type)) else "ridge"
    return f"a DisturbanceForecaster; give DisturbanceForecaster({model!r})"
