"""Journal of a zone: what its model has taken in since it was saved, and how its forecasts did."""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd

from .._files import atomic_path
from .._time import zone_name

_FRAMES = ("rows", "ahead", "scored")


@dataclass
class Journal:
    """Facts and rows of a zone, kept beside its model."""

    #: zone; fitted, updated: fingerprints; until; training_rmse; fallback: why; days: with errors; turn: see ModelStore
    facts: dict[str, Any]
    rows: pd.DataFrame = field(default_factory=pd.DataFrame)  # taken in since the model was saved
    ahead: pd.DataFrame = field(default_factory=pd.DataFrame)  # the last forecast: y_pred and its quantiles
    scored: pd.DataFrame = field(default_factory=pd.DataFrame)  # y_true, y_pred and quantiles of the last days

    def save(self, path: str | PathLike[str]) -> None:
        """Write it to a file, in one step."""
        frames = {name: getattr(self, name).select_dtypes(["number", "bool"]) for name in _FRAMES}
        kinds = {name: _kind_of(frame) for name, frame in frames.items()}
        arrays: dict[str, Any] = {"text": np.array(json.dumps({"facts": self.facts, "frames": kinds}))}
        for name, frame in frames.items():
            index = frame.index
            numbers = index.asi8 if isinstance(index, pd.DatetimeIndex) else np.arange(len(index))
            arrays |= {name: frame.to_numpy(dtype=np.float64), f"{name}_index": numbers}
        with atomic_path(path) as made, open(made, "wb") as file:
            np.savez(file, **arrays)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Journal:
        """Read what :meth:`save` wrote."""
        try:
            with np.load(path, allow_pickle=False) as found:
                known = json.loads(str(found["text"]))
                frames = {n: _frame(found[n], found[f"{n}_index"], known["frames"][n]) for n in _FRAMES}
                return cls(dict(known["facts"]), **frames)
        except FileNotFoundError:
            raise
        except Exception as error:  # a damaged file can let any part of the reading fail
            raise ValueError(f"{path} cannot be read as the journal of a zone; remove it and fit again.") from error


def is_journal(path: str | PathLike[str]) -> bool:
    """Whether a file holds what a journal does, not arrays of another program."""
    try:
        with zipfile.ZipFile(path) as found:
            return {f"{name}.npy" for name in ("text", *_FRAMES)} <= set(found.namelist())
    except (OSError, zipfile.BadZipFile):
        return False


def _kind_of(frame: pd.DataFrame) -> dict[str, Any]:
    index = frame.index
    kind: dict[str, Any] = {"columns": [str(column) for column in frame], "name": index.name}
    if isinstance(index, pd.DatetimeIndex):
        kind |= {"unit": index.unit, "tz": zone_name(index.tz)}
    return kind


def _frame(values: np.ndarray, numbers: np.ndarray, kind: dict[str, Any]) -> pd.DataFrame:
    index: pd.Index = pd.RangeIndex(len(numbers), name=kind["name"])
    if "unit" in kind:
        stamps = pd.DatetimeIndex(numbers.view(f"M8[{kind['unit']}]"), name=kind["name"])
        index = stamps if kind["tz"] is None else stamps.tz_localize("UTC").tz_convert(kind["tz"])
    return pd.DataFrame(values, index=index, columns=kind["columns"])
