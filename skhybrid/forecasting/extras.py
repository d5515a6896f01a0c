"""Check for the optional libraries that networks need, without loading them."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from .cases import NETWORKS


def networks_available() -> bool:
    """Whether torch and skorch are installed."""
    try:
        return all(find_spec(name) is not None for name in ("torch", "skorch"))
    except (ImportError, ValueError):  # an import hook refuses them, or their place in sys.modules is taken
        return False


def require_networks(model: Any) -> None:
    """Raise an ImportError for a network whose libraries are missing; any other model of a forecaster is accepted."""
    if isinstance(model, str) and model in NETWORKS and not networks_available():
        raise ImportError(
            f'model={model!r} needs torch and skorch; install them with pip install "skhybrid[networks]".'
        )
