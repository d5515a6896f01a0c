"""Rows of each zone as files, for workers to read."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from glob import escape
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
import pandas as pd

from .._files import named_in_errors
from .._table import as_pandas, refuse_order, refuse_shape

_NUMBER = re.compile(r"(\d+)")
TARGET = "__y__"  # column of a target that was given beside the table
_UNNAMED = ("", "__HIVE_DEFAULT_PARTITION__")  # what writers of a dataset put for a missing name


class ZoneFiles(NamedTuple):
    """Files of rows, by the name of their zone."""

    paths: dict[str, str]
    labels: dict[str, Any]  # the key as the caller gave it

    def add(self, label: Any, path: str) -> None:
        """Add the file of a zone; an empty or a repeated name is refused."""
        name = str(label)
        if not name:
            raise ValueError("a zone has an empty name; name it, or leave its rows out.")
        if name in self.paths:
            raise ValueError(f"zone {name!r} comes twice; join its rows in one table.")
        self.paths[name], self.labels[name] = path, label

    @property
    def by_zone(self) -> dict[str, tuple[str, ...]]:
        """The file of each zone as the files of a call."""
        return {zone: (path,) for zone, path in self.paths.items()}


@contextmanager
def zone_files(X: Any, y: Any, key: str) -> Iterator[ZoneFiles]:
    """Files of the zones of a table, of tables or of a Parquet dataset, for the time of the block."""
    if isinstance(X, str | PathLike):
        if y is not None:
            raise ValueError("y is read from the dataset, as its column T_za; leave y out.")
        yield _in_dataset(Path(X).absolute(), key)
        return
    with tempfile.TemporaryDirectory(prefix="skhybrid-fleet-") as folder:
        found = ZoneFiles({}, {})
        with named_in_errors(folder):
            for label, rows in _tables(X, y, key):
                found.add(label, _write(rows, Path(folder) / str(len(found.paths))))
        if not found.paths:
            raise ValueError("there is no zone; give a table with rows.")
        yield found


def _tables(X: Any, y: Any, key: str) -> Iterator[tuple[Any, pd.DataFrame]]:
    if isinstance(X := as_pandas(X), pd.DataFrame):
        yield from _of_long(X if y is None else _with_target(X, y), key)
        return
    if not isinstance(X, Iterable):
        raise ValueError(f"X is a {type(X).__name__}; give a long table, tables, or the path of a Parquet dataset.")
    if y is not None:
        raise ValueError("y of several tables is their column T_za; leave y out.")
    for item in X.items() if isinstance(X, Mapping) else X:
        paired = isinstance(item, tuple) and len(item) == 2
        rows = as_pandas(item[1] if paired else item)
        if not isinstance(rows, pd.DataFrame):
            raise ValueError(f"X holds a {type(item).__name__}; give tables, or pairs of a zone and its table.")
        yield from [(item[0], rows.drop(columns=key, errors="ignore"))] if paired else _of_long(rows, key)


def _with_target(X: pd.DataFrame, y: Any) -> pd.DataFrame:
    values = np.asarray(y)
    if values.shape not in ((len(X),), (len(X), 1)):
        raise ValueError(f"X has {len(X)} rows, but y has the shape {values.shape}; pass one value per row.")
    if isinstance(y, pd.Series | pd.DataFrame):
        refuse_order(y.index, X.index)
    return X.assign(**{TARGET: values.ravel()})


def _of_long(X: pd.DataFrame, key: str) -> Iterator[tuple[Any, pd.DataFrame]]:
    if key in X.index.names:
        X = X.reset_index(key)
    if list(X.columns).count(key) != 1:
        there = ", ".join(map(str, X.columns))
        raise ValueError(f"X needs one column {key!r} with the name of each row's zone; it has {there}.")
    unnamed = np.flatnonzero(X[key].isna().to_numpy())
    if len(unnamed):
        raise ValueError(
            f"column {key!r} names no zone in {len(unnamed)} rows, the first at {X.index[unnamed[0]]}; name it, or "
            "leave these rows out."
        )
    for label, rows in X.groupby(key, sort=False, observed=True):
        yield label, rows.drop(columns=key)


def _write(rows: pd.DataFrame, path: Path) -> str:
    """Write a temporary file of a zone; what Parquet cannot hold is for its estimator to refuse."""
    try:
        from pyarrow import ArrowException

        made = path.with_suffix(".parquet")
        try:
            rows.to_parquet(made)
            return str(made)
        except (ArrowException, ValueError, TypeError):
            made.unlink(missing_ok=True)
    except ImportError:  # an extra
        pass
    made = path.with_suffix(".pickle")
    rows.to_pickle(made)
    return str(made)


def _in_dataset(path: Path, key: str) -> ZoneFiles:
    if not path.is_dir():
        raise ValueError(f"{path} is not a folder; give a Parquet dataset with one folder per zone, as {key}=kitchen.")
    found = ZoneFiles({}, {})
    for folder in sorted(path.glob(f"{escape(key)}=*/")):
        name = folder.name.partition("=")[2]
        if name not in _UNNAMED:
            found.add(unquote(name), str(folder))
        elif any(folder.rglob("*.parquet")):
            raise ValueError(f"{folder} holds rows that name no zone; name it, or remove the folder.")
    if not found.paths:
        raise ValueError(f"{path} has no folder {key}=...; give a Parquet dataset partitioned by {key!r}.")
    return found


def read_rows(path: str | PathLike[str]) -> pd.DataFrame:
    """The rows of a zone, from its file or the Parquet files of its folder; rows of later names replace earlier ones.

    Numbers in names count as numbers: ``day-10.parquet`` is later than ``day-9.parquet``.
    """
    where = Path(path)
    if where.suffix == ".pickle":  # a temporary file of this process
        rows = pd.read_pickle(where)
        refuse_shape(rows, 0)
        return rows
    files = [where]
    if where.is_dir():
        files = [file for file in where.rglob("*.parquet") if not _is_hidden(file.relative_to(where))]
        files.sort(key=lambda file: [int(part) if part.isdecimal() else part for part in _NUMBER.split(str(file))])
    if not files:
        raise ValueError(f"{where} holds no Parquet file; write the rows of the zone there, or remove the folder.")
    frames = [_read_file(file) for file in files]
    if len(frames) == 1:
        return frames[0]
    bare = [file for file, frame in zip(files, frames, strict=True) if not isinstance(frame.index, pd.DatetimeIndex)]
    if bare:
        raise ValueError(f"{bare[0]} has no time stamps, by which the files of a zone are joined; add the column time.")
    frames = _in_one_clock(frames, files)
    rows, numbers = pd.concat(frames), np.repeat(np.arange(len(frames)), list(map(len, frames)))
    last = pd.Series(numbers).groupby(rows.index.to_numpy(), dropna=False).transform("max").to_numpy()
    return rows[numbers == last].sort_index(kind="stable")


def _is_hidden(path: Path) -> bool:
    """Whether a file, or a folder above it, has a name that readers of datasets leave out, such as ``_temporary``."""
    return any(part.startswith((".", "_")) for part in path.parts)


def _in_one_clock(frames: list[pd.DataFrame], files: list[Path]) -> list[pd.DataFrame]:
    """Tables whose stamps are in UTC if they had several time zones, such as the offsets of winter and summer."""
    clocks = [pd.DatetimeIndex(frame.index).tz for frame in frames]
    if None in clocks and any(clocks):
        raise ValueError(
            f"{files[clocks.index(None)]} has stamps without a time zone, but other files of the zone have one; give "
            "all of them one."
        )
    return [frame.tz_convert("UTC") for frame in frames] if len(set(map(str, clocks))) > 1 else frames


def _read_file(path: Path) -> pd.DataFrame:
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise ImportError('a Parquet dataset needs pyarrow; install it with pip install "skhybrid[files]".') from None
    try:
        with ParquetFile(path) as file:
            frame = file.read().to_pandas()
    except (ArrowException, OSError) as error:
        cause = " ".join(str(error).split()).removesuffix(".")
        raise ValueError(f"{path} cannot be read as a Parquet file ({cause}); write it again.") from None
    if isinstance(frame.index, pd.DatetimeIndex):
        return frame
    dated = [name for name in frame if pd.api.types.is_datetime64_any_dtype(frame[name])]
    times = ["time"] if "time" in dated else dated
    return frame.set_index(times[0]) if len(times) == 1 else frame


def fingerprint(*tables: pd.DataFrame | pd.Series) -> str:
    """A short text of values, stamps and names, the same in every process."""
    total = sha256()
    for table in map(pd.DataFrame, tables):
        total.update(repr([*table.dtypes.items(), table.index.dtype]).encode())
        try:
            total.update(pd.util.hash_pandas_object(table, index=True).to_numpy().tobytes())
        except TypeError:  # lists, in a table that the estimator will refuse
            total.update(repr(table.to_dict()).encode())
    return total.hexdigest()[:32]
