"""Independent random streams from one ``random_state``, and autoregressive noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arguments import random_numbers


def spawn_generators(random_state: Any, n: int) -> list[np.random.Generator]:
    """``n`` independent generators, one per purpose, so that switching one off leaves the others unchanged."""
    if isinstance(random_state, np.random.Generator):
        entropy = random_state.integers(2**31, size=4)
    else:
        entropy = random_numbers(random_state).randint(2**31 - 1, size=4)
    seeds = np.random.SeedSequence([int(word) for word in entropy]).spawn(n)
    return [np.random.default_rng(seed) for seed in seeds]


def ar1(rng: np.random.Generator, n: int, phi: float) -> np.ndarray:
    """Draw a stationary first-order autoregression of unit variance, shape (n,)."""
    from scipy.signal import lfilter

    shocks = rng.standard_normal(n)
    shocks[1:] *= np.sqrt(1.0 - phi**2)
    return lfilter([1.0], [1.0, -phi], shocks)
