"""Reader of Parquet files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from ..assembly import Choice, Pieces, rows_of_piece
from ..raw_log import RawLog
from ..rows_by_zone import may_name_zones
from ..stamp_cells import find_stamp_columns
from ..table_shapes import SAMPLE, assemble_table
from .change_of_value import long_columns


def looks_like(path: Path, head: str) -> bool:
    """Whether a file is a Parquet file."""
    if head:
        return False
    with path.open("rb") as file:
        return file.read(4) == b"PAR1"


def read(path: Path, **options: Any) -> RawLog:
    """Read a Parquet file, wide or long, its time in the index or a column; the options are those of ``Choice``."""
    choice = Choice(**options)
    where = repr(path.name)
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise ImportError(
            'reading a Parquet file needs pyarrow; install it with pip install "skhybrid[files]".'
        ) from None
    try:
        with ParquetFile(path) as file:
            return _read(file, choice, where)
    except (ArrowException, OSError) as error:
        raise ValueError(f"{where} cannot be read as a Parquet file ({error}).") from None


def _read(file: Any, choice: Choice, where: str) -> RawLog:
    from pyarrow import types

    names = [field.name for field in file.schema_arrow if not types.is_nested(field.type)]
    size = rows_of_piece(len(names))
    sample = next(_frames(file, names, SAMPLE), pd.DataFrame(columns=names))
    if sample.empty:
        raise ValueError(f"{where} has no rows.")
    indices = [name for name in (file.schema_arrow.pandas_metadata or {}).get("index_columns", []) if name in names]
    dated = [name for name in indices if pd.api.types.is_datetime64_any_dtype(sample[name])]
    time = choice.time_column or (dated[0] if dated else None)
    stamps = find_stamp_columns(sample, time, where)
    long = long_columns([name for name in names if name not in stamps])
    if choice.columns is None:
        zones = may_name_zones(sample, stamps)
        names = [name for name in names if name not in indices or name in (*stamps, *zones)]
    pieces = Pieces((), stamps, where, "Parquet")
    return assemble_table(pieces, sample[names], choice, lambda wanted, _: _frames(file, wanted, size), long)


def _frames(file: Any, names: list[str], size: int) -> Iterator[pd.DataFrame]:
    for batch in file.iter_batches(batch_size=size, columns=names):
        yield batch.to_pandas(ignore_metadata=True)
