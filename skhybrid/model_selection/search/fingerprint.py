"""Data, settings and parameters of a search as text that is the same in every process."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
import pandas as pd

from ... import __version__
from ...forecasting.named_models import networks_available
from ...parallel.stored_settings import VERSION, WITHOUT_EFFECT, as_plain, is_estimator, name_of


def settings_of(estimator: Any, X: Any, y: Any, splits: Sequence[tuple[Any, Any]], scoring: Any) -> dict[str, str]:
    """Data, splits, scoring and parameters of the estimator by name, for a store to compare with its own."""
    found = {**_data("X", X), **_data("y", y)}
    found["cv"] = f"{len(splits)} splits ({_digest(*(np.asarray(rows) for split in splits for rows in split))})"
    found["scoring"] = as_plain(scoring)
    found["estimator"] = name_of(type(estimator))
    for name, value in sorted(estimator.get_params(deep=True).items()):
        if name.split("__")[-1] not in WITHOUT_EFFECT:
            found[f"parameter {name}"] = name_of(type(value)) if is_estimator(value) else as_plain(value)
    versions = {"skhybrid": __version__} | {name: version(name) for name in ("numpy", "scikit-learn")}
    if networks_available():
        versions["torch"] = version("torch")
    return found | {f"{VERSION}{name}": number for name, number in versions.items()}


def candidate_id(params: Mapping[str, Any]) -> str:
    """A short id of a candidate's parameters, the same in every process."""
    return hashlib.sha256(as_plain(params).encode()).hexdigest()[:32]


def _data(name: str, data: Any) -> dict[str, str]:
    """Size, names, stamps and values one by one, so that a difference can be named."""
    table = pd.DataFrame(data if isinstance(data, pd.DataFrame | pd.Series) else np.asarray(data))
    found = {f"rows of {name}": str(len(table))}
    if isinstance(data, pd.DataFrame):
        found[f"columns of {name}"] = ", ".join(map(str, table.columns))
    if isinstance(table.index, pd.DatetimeIndex) and len(table):
        found[f"first stamp of {name}"] = str(table.index[0])
        found[f"last stamp of {name}"] = str(table.index[-1])
    return found | {f"values of {name}": _digest(pd.util.hash_pandas_object(table, index=True).to_numpy())}


def _digest(*arrays: np.ndarray) -> str:
    total = hashlib.sha256()
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
        total.update(b"|")
    return total.hexdigest()[:16]
