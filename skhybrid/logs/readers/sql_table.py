"""Reader of tables and queries in a database, by its SQLAlchemy URL."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import pandas as pd

from ..assembly import Choice, Pieces
from ..raw_log import RawLog
from ..stamp_cells import find_stamp_columns
from ..table_shapes import SAMPLE, assemble_table
from .change_of_value import point_and_value
from .recorder import is_sqlite

_PIECE = 50_000  # rows


def looks_like(path: Path, head: str) -> bool:
    """Whether a file is an SQLite database."""
    return not head and is_sqlite(path)


def read(
    source: Path | str,
    *,
    table: str | None = None,
    query: str | None = None,
    point_column: str | None = None,
    value_column: str | None = None,
    **options: Any,
) -> RawLog:
    """Read a table or a query, wide or long; the options beside these are those of ``Choice``."""
    choice = Choice(**options)
    if table is not None and query is not None:
        raise ValueError("table= and query= were both given; give one of them.")
    try:
        import sqlalchemy as alchemy
    except ImportError:
        raise ImportError('reading a database needs SQLAlchemy; install it with pip install "skhybrid[sql]".') from None
    url = _url(alchemy, source)
    place = f"{url.get_backend_name()} database {Path(url.database or '').name!r}"  # never with its password
    engine = _engine(alchemy, url)
    try:
        with engine.connect() as connection:
            what, where = _statement(alchemy, connection, table, query, place)
            return _read(connection, what, where, (point_column, value_column), choice)
    except alchemy.exc.SQLAlchemyError as error:
        reason = " ".join(str(getattr(error, "orig", None) or type(error).__name__).split())
        secret = url.password
        reason = reason.replace(str(secret), "***") if secret else reason
        raise ValueError(f"the {place} cannot be read ({reason}).") from None
    finally:
        engine.dispose()


def _url(alchemy: Any, source: Path | str) -> Any:
    """The URL of a database; an SQLite file must exist, since opening would make one."""
    if isinstance(source, Path):
        return alchemy.URL.create("sqlite", database=str(source))
    try:
        url = alchemy.make_url(source)
    except (alchemy.exc.ArgumentError, ValueError):
        raise ValueError(
            "the URL of the database cannot be read; write it as postgresql+psycopg://user:password@host/name or "
            "sqlite:///file.db."
        ) from None
    if url.get_backend_name() == "sqlite" and not (url.database and Path(url.database).is_file()):
        raise FileNotFoundError(f"there is no file {url.database!r}.")
    return url


def _engine(alchemy: Any, url: Any) -> Any:
    try:
        return alchemy.create_engine(url)
    except ModuleNotFoundError as error:
        raise ImportError(
            f"{url.drivername!r} needs the package {error.name}; install it with pip install {error.name}."
        ) from None
    except alchemy.exc.ArgumentError:
        raise ValueError(
            f"the kind of database {url.drivername!r} is unknown; write postgresql+psycopg or sqlite, or give a file."
        ) from None


def _statement(alchemy: Any, connection: Any, table: str | None, query: str | None, place: str) -> tuple[Any, str]:
    """The table or query to select, and its name in messages."""
    if query is not None:
        return alchemy.text(query), f"the query of the {place}"
    inspector = alchemy.inspect(connection)
    names = [*inspector.get_table_names(), *inspector.get_view_names()]
    if table is None:
        if len(names) != 1:
            shown = f"its tables are {', '.join(map(repr, sorted(names)))}" if names else "it has no tables"
            raise ValueError(f"the {place} needs table= or query=; {shown}.")
        table = names[0]
    schema, _, bare = table.rpartition(".") if table not in names else ("", "", table)
    known = names if not schema else [*inspector.get_table_names(schema), *inspector.get_view_names(schema)]
    if bare not in known:
        raise ValueError(f"the {place} has no table {table!r}; its tables are {', '.join(map(repr, sorted(names)))}.")
    columns = [alchemy.column(column["name"]) for column in inspector.get_columns(bare, schema or None)]
    return alchemy.select(*columns).select_from(alchemy.table(bare, schema=schema or None)), f"table {table!r}"


def _read(connection: Any, what: Any, where: str, long: tuple[str | None, str | None], choice: Choice) -> RawLog:
    streamed = connection.execution_options(stream_results=True, max_row_buffer=_PIECE)
    first = streamed.execute(what)
    names = list(first.keys())
    head = _table(first.fetchmany(SAMPLE), names)
    if head.empty:
        raise ValueError(f"{where} has no rows.")
    both = point_and_value(names, *long, where)
    stamps = find_stamp_columns(head.drop(columns=list(both or ())), choice.time_column, where)
    begun = [chain([head], _frames(first, names))]

    def rows(wanted: list[str], as_text: bool) -> Iterator[pd.DataFrame]:
        frames = begun.pop() if begun else _frames(streamed.execute(what), names)
        return (frame[wanted] for frame in frames)

    return assemble_table(Pieces((), stamps, where, "SQL"), head, choice, rows, both)


def _frames(rows: Any, names: list[str]) -> Iterator[pd.DataFrame]:
    while part := rows.fetchmany(_PIECE):
        yield _table(part, names)


def _table(rows: Sequence[Any], names: list[str]) -> pd.DataFrame:
    return pd.DataFrame([tuple(row) for row in rows], columns=names)
