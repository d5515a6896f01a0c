"""SQLite files that one process at a time writes to."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from os import PathLike, fspath

_PATIENCE = 1.0  # how long a process waits for another one before it gives up [s]


@contextmanager
def open_database(path: str | PathLike[str], busy: str, remedy: str) -> Iterator[sqlite3.Connection]:
    """A connection that begins no transaction by itself; the file is created where there is none.

    ``busy`` is the message of the BlockingIOError where another process is writing to it, ``remedy`` what the OSError
    says to do where it cannot be used for another reason.
    """
    try:
        with closing(sqlite3.connect(fspath(path), timeout=_PATIENCE, isolation_level=None)) as database:
            yield database
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            raise BlockingIOError(busy) from None
        raise OSError(f"{fspath(path)} cannot be used ({error}); {remedy}") from error


def table_of_others(database: sqlite3.Connection, own: str) -> str | None:
    """A table of a database of another program, which has tables, but none named ``own``; else None."""
    names = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    return names[0] if names and own not in names else None


@contextmanager
def transaction(database: sqlite3.Connection) -> Iterator[None]:
    """Keep all that the block writes, or nothing; no other process can begin one meanwhile.

    The lock is SQLite's own, so it vanishes with the process.
    """
    database.execute("BEGIN IMMEDIATE")
    try:
        yield
        database.execute("COMMIT")
    except BaseException:
        # SQLite has rolled back by itself if the disk is full, and cannot if it is gone
        with suppress(sqlite3.Error):
            database.execute("ROLLBACK")
        raise
