"""Large float arrays in the form in which a file holds them in fewer bytes, exactly."""

from __future__ import annotations

from math import isqrt
from typing import Any

import numpy as np

_SIZE = 1000  # values of an array that is worth it


def pack(value: np.ndarray) -> tuple[str, dict[str, Any]] | None:
    """Kind and parts of a packed array; None where it stays as it is.

    Of a symmetric matrix half is kept.  Of other arrays the bytes of all values are sorted by their place, since signs
    and exponents are alike and compress.
    """
    if type(value) is not np.ndarray or value.dtype != np.float64 or value.ndim < 2 or value.size < _SIZE:
        return None
    if not value.flags.c_contiguous:  # products of an array in another order may differ in their last bits
        return None
    if value.ndim == 2 and value.shape[0] == value.shape[1] and value.tobytes() == value.T.tobytes():
        return "symmetric", {"half": value[np.triu_indices(len(value))]}
    planes = value.reshape(-1).view(np.uint8).reshape(-1, value.itemsize).T
    return "planes", {"planes": np.ascontiguousarray(planes), "shape": list(value.shape)}


def unpack(kind: str, parts: dict[str, Any]) -> np.ndarray:
    """The array that was packed."""
    if not all(isinstance(parts[name], np.ndarray) for name in ("planes", "half") if name in parts):
        raise ValueError("the values of a packed array are not an array")  # an index would be unfolded
    if kind == "planes":
        return np.ascontiguousarray(parts["planes"].T).view(np.float64).reshape(parts["shape"])
    half = parts["half"]
    n = (isqrt(8 * len(half) + 1) - 1) // 2
    made = np.empty((n, n))
    made[np.triu_indices(n)] = half
    made.T[np.triu_indices(n)] = half
    return made
