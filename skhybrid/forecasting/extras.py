"""Check for the optional libraries that networks need, without loading them."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from .cases import is_network


def networks_available() -> bool:
    """Whether torch and skorch are installed."""
    try:
        return all(find_spec(name) is not None for name in ("torch", "skorch"))
    except (ImportError, ValueError):  # an import hook refuses them, or their place in sys.modules is taken
        return False


def require_networks(model: Any, device: str = "cpu") -> None:
    """Refuse a network whose libraries are missing (ImportError), or a device that torch cannot use (ValueError).

    Any other model of a forecaster is accepted.
    """
    if not is_network(model):
        return
    if not networks_available():
        raise ImportError(
            f'model={model!r} needs torch and skorch; install them with pip install "skhybrid[networks]".'
        )
    if device != "cpu":
        from .networks.jobs import torch_device  # torch loads here

        torch_device(device)
