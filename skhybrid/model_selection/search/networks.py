"""The only calls of the search into the training of networks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ...forecasting.batch import fit_each
from .candidates import is_network

#: the module that loads torch and skorch
_TRAINING = "skhybrid.forecasting.training"


def require_networks(models: Iterable[Any]) -> bool:
    """Whether there are networks among the models; refuse them where the libraries that train them are missing.

    Raises
    ------
    ImportError
        If a model is a network and torch or skorch is not installed.
    """
    first = next((model for model in models if is_network(model)), None)
    if first is not None and not all(find_spec(name) for name in ("torch", "skorch")):
        raise ImportError(
            f'model={first!r} needs torch and skorch; install them with pip install "skhybrid[networks]".'
        )
    return first is not None


def preload_networks() -> None:
    """Load torch before the first task: joblib restarts a worker whose memory has grown by 300 MB after a task."""
    import_module(_TRAINING)


def fit_together(models: Sequence[Any], X: Any, y: Any) -> list[Any]:
    """Fit models on the same rows; networks of equal shape are trained as one stack."""
    return fit_each(models, X, y)
