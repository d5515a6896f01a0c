"""Results of a search as they finish, in an SQLite file that several processes of one machine may share."""

from __future__ import annotations

import json
import os
import platform
import sqlite3
import threading
import time
import uuid
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import NamedTuple, Self

#: the layout of the file; another one is refused.
_FORMAT = "1"
#: settings of this beginning may differ, with a warning
VERSION = "version of "
_TABLES = """
CREATE TABLE IF NOT EXISTS setting (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS owner (id TEXT PRIMARY KEY, host TEXT NOT NULL, pid INTEGER NOT NULL, seen REAL NOT NULL);
CREATE TABLE IF NOT EXISTS candidate (id TEXT PRIMARY KEY, params TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS claim (
    candidate TEXT NOT NULL, split INTEGER NOT NULL, owner TEXT NOT NULL, PRIMARY KEY (candidate, split));
CREATE TABLE IF NOT EXISTS result (
    candidate TEXT NOT NULL, split INTEGER NOT NULL, scores TEXT NOT NULL, rmse REAL, fit_time REAL NOT NULL,
    score_time REAL NOT NULL, n_epochs INTEGER, error TEXT, finished REAL NOT NULL, PRIMARY KEY (candidate, split));
"""
#: how long a process waits for another one's transaction [s]
_PATIENCE = 120.0


class Task(NamedTuple):
    """One candidate on one split of the data."""

    candidate: str  # its id
    split: int


class Result(NamedTuple):
    """What became of a task."""

    scores: dict[str, float]  # by scorer; empty where it failed
    rmse: float  # root-mean-square error over the measured rows; NaN where it failed
    fit_time: float  # [s]
    score_time: float  # [s]
    n_epochs: int | None  # of a network
    error: str | None  # where it failed: the error, with its traceback


class ResultStore:
    """Finished results, and who works on what.

    Every change is one transaction, so that a process may be killed at any moment.  A task is *claimed* before it is
    computed.  A claim holds while its owner lives: it is on the same machine with a running process, and has given a
    sign of life within the last ``lease`` seconds.

    Parameters
    ----------
    path : path-like or None
        The file, made where there is none.  None: results are kept in memory.  It belongs on a local disk: SQLite's
        write-ahead log, which lets one process read while another writes, needs memory that they share.
    settings : Mapping of str to str
        What data and settings the results are for.
    lease : float, default=60.0
        [s].

    Raises
    ------
    ValueError
        If the file holds results for other data or settings, or is no store.
    """

    def __init__(self, path: str | os.PathLike[str] | None, settings: Mapping[str, str], lease: float = 60.0) -> None:
        self.path = ":memory:" if path is None else os.fspath(path)
        self.owner = uuid.uuid4().hex
        self.lease = lease
        self._lock = threading.Lock()
        self._closed = threading.Event()
        folder = os.path.dirname(self.path)
        if path is not None and folder:
            os.makedirs(folder, exist_ok=True)
        # claims are made by whichever thread joblib asks from; the lock keeps them apart
        self._db = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None, check_same_thread=False)
        try:
            self._open(settings)
        except BaseException:
            self._db.close()
            raise
        self._pulse = threading.Thread(target=self._beat, daemon=True, name="skhybrid-store")
        self._pulse.start()

    def _open(self, settings: Mapping[str, str]) -> None:
        try:
            self._write_ahead()
            with self._transaction() as db:
                for statement in _TABLES.strip().split(";\n"):
                    db.execute(statement)
                known = dict(db.execute("SELECT name, value FROM setting"))
                check_settings(self.path, known, {"format": _FORMAT, **settings})
                if not known:
                    db.executemany("INSERT INTO setting VALUES (?, ?)", [("format", _FORMAT), *settings.items()])
                self._sign(db)
        except sqlite3.DatabaseError as error:
            raise ValueError(f"store {self.path} cannot be used ({error}); give the path of another file.") from None

    def _write_ahead(self) -> None:
        """Change the kind of the file's log, for which SQLite does not wait where another process does it too."""
        until = time.monotonic() + _PATIENCE
        while True:
            try:
                self._db.execute("PRAGMA journal_mode=WAL")
                return
            except sqlite3.OperationalError:
                if time.monotonic() > until:
                    raise
                time.sleep(0.05)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Give back what is claimed and not finished, and close the file."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._pulse.join()
        with self._transaction() as db:
            db.execute("DELETE FROM claim WHERE owner = ?", (self.owner,))
            db.execute("DELETE FROM owner WHERE id = ?", (self.owner,))
        self._db.close()

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        """All or nothing; no other process writes meanwhile."""
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
                self._db.execute("COMMIT")
            except BaseException:
                self._db.execute("ROLLBACK")
                raise

    # ------------------------------------------------------------------------------------------------- signs of life
    def _sign(self, db: sqlite3.Connection) -> None:
        db.execute("INSERT OR REPLACE INTO owner VALUES (?, ?, ?, ?)", (self.owner, _host(), os.getpid(), time.time()))

    def _beat(self) -> None:
        while not self._closed.wait(self.lease / 4.0):
            with suppress(sqlite3.OperationalError), self._transaction() as db:  # a busy file: the next beat will do
                self._sign(db)

    def _bury_the_dead(self, db: sqlite3.Connection) -> None:
        """Owners that live no more, and their claims, go."""
        oldest = time.time() - self.lease
        for owner, host, pid, seen in db.execute("SELECT id, host, pid, seen FROM owner").fetchall():
            if owner != self.owner and (seen < oldest or (host == _host() and not _runs(pid))):
                db.execute("DELETE FROM owner WHERE id = ?", (owner,))
        db.execute("DELETE FROM claim WHERE owner NOT IN (SELECT id FROM owner)")

    # --------------------------------------------------------------------------------------------------------- tasks
    def describe(self, candidates: Mapping[str, str]) -> None:
        """Write down what the ids of candidates stand for.

        Parameters
        ----------
        candidates : Mapping of str to str
            Id -> parameters in words.
        """
        with self._transaction() as db:
            db.executemany("INSERT OR IGNORE INTO candidate VALUES (?, ?)", candidates.items())

    def claim(self, tasks: Sequence[Task]) -> list[Task]:
        """Take on tasks that nobody has finished or works on.

        Parameters
        ----------
        tasks : sequence of Task
            The wanted ones.

        Returns
        -------
        list of Task
            Those that are this store's own to compute now.
        """
        with self._transaction() as db:
            self._bury_the_dead(db)
            taken = []
            for task in tasks:
                if db.execute("SELECT 1 FROM result WHERE candidate = ? AND split = ?", task).fetchone() is None:
                    done = db.execute("INSERT OR IGNORE INTO claim VALUES (?, ?, ?)", (*task, self.owner))
                    taken += [task] * done.rowcount
            return taken

    def finish(self, results: Mapping[Task, Result]) -> None:
        """Write results; what another process has finished first stays.

        Parameters
        ----------
        results : Mapping of Task to Result
        """
        now = time.time()
        rows = [(*task, json.dumps(one.scores), *one[1:], now) for task, one in results.items()]
        with self._transaction() as db:
            db.executemany("INSERT OR IGNORE INTO result VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)
            db.executemany("DELETE FROM claim WHERE candidate = ? AND split = ?", list(results))

    def results(self, candidates: Iterable[str] | None = None) -> dict[Task, Result]:
        """What is finished.

        Parameters
        ----------
        candidates : iterable of str, optional
            Of these only.

        Returns
        -------
        dict of Task to Result
        """
        wanted = None if candidates is None else set(candidates)
        query = "SELECT candidate, split, scores, rmse, fit_time, score_time, n_epochs, error FROM result"
        with self._lock:
            rows = self._db.execute(query).fetchall()
        return {  # SQLite has no NaN: it is NULL there
            Task(candidate, split): Result(json.loads(scores), float("nan") if rmse is None else rmse, *rest)
            for candidate, split, scores, rmse, *rest in rows
            if wanted is None or candidate in wanted
        }

    def forget_failed(self) -> int:
        """Drop the results that are errors, so that they are tried again.

        Returns
        -------
        int
            How many.
        """
        with self._transaction() as db:
            return db.execute("DELETE FROM result WHERE error IS NOT NULL").rowcount


def check_settings(path: str, known: Mapping[str, str], given: Mapping[str, str]) -> None:
    """Refuse a store that was made for something else, and warn of one that other versions made.

    Parameters
    ----------
    path : str
        Of the store.
    known, given : Mapping of str to str
        Settings in the store, and those that are wanted; a new store has none.

    Raises
    ------
    ValueError
        Naming what differs.
    """
    names = [name for name in {**known, **given} if known.get(name) != given.get(name)] if known else []
    told = {name: f"{name} is {known.get(name, 'absent')} there and {given.get(name, 'absent')} here" for name in names}
    versions = [told.pop(name) for name in names if name.startswith(VERSION)]
    if told:
        more = f" and {len(told) - 5} more" if len(told) > 5 else ""
        raise ValueError(
            f"store {path} was made with other data or settings: {'; '.join(list(told.values())[:5])}{more}; give "
            "another store, or the same data and settings."
        )
    if versions:
        warnings.warn(
            f"part of the results in store {path} comes from other versions: {'; '.join(versions)}.",
            stacklevel=2,
        )


def _host() -> str:
    return platform.node()


def _runs(pid: int) -> bool:
    """Whether a process of this machine runs; where that cannot be asked, its signs of life alone decide."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)  # signal 0 asks, and does nothing
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
