"""Results of a search in an SQLite file that several processes of one machine may share."""

from __future__ import annotations

import json
import math
import os
import platform
import sqlite3
import threading
import time
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import NamedTuple, Self

from ..._sqlite import table_of_others, transaction
from ...parallel.stored_settings import check_settings

_FORMAT = "1"  # format of the file; another one is refused
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
_OTHER_FILE = "give the path of another file."
_KEPT = "what it holds is kept: run the same search again to continue."
_REMEDIES = {
    sqlite3.SQLITE_FULL: f"free some space on the disk; {_KEPT}",
    sqlite3.SQLITE_IOERR: f"check the disk, and that it has space; {_KEPT}",
    sqlite3.SQLITE_READONLY: "make the file and its folder writable, or give the path of another file.",
    sqlite3.SQLITE_CANTOPEN: "make its folder writable, or give the path of another file.",
    sqlite3.SQLITE_BUSY: f"another process holds it; {_KEPT}",
}
#: SQLite keeps values of any type in any column
_FOREIGN_ROWS = """
SELECT 'setting' FROM setting WHERE typeof(name) <> 'text' OR typeof(value) <> 'text'
UNION ALL SELECT 'owner' FROM owner WHERE typeof(host) <> 'text' OR typeof(pid) <> 'integer' OR pid NOT BETWEEN 1 AND
    2147483647 OR typeof(seen) <> 'real'
UNION ALL SELECT 'result' FROM result WHERE typeof(candidate) <> 'text' OR typeof(split) <> 'integer' OR
    NOT json_valid(scores) OR json_type(scores) <> 'object' OR typeof(rmse) NOT IN ('real', 'null') OR
    typeof(fit_time) <> 'real' OR typeof(score_time) <> 'real' OR typeof(n_epochs) NOT IN ('integer', 'null') OR
    typeof(error) NOT IN ('text', 'null')
LIMIT 1
"""
_PATIENCE = 120.0  # how long a process waits for the transaction of another one [s]


class StoreError(OSError):
    """A store cannot be read or written; the message names its path, the cause and the remedy."""


class Task(NamedTuple):
    """One candidate on one split of the data."""

    candidate: str  # its id
    split: int


class Result(NamedTuple):
    """Scores of a task, or its error."""

    scores: dict[str, float]  # by scorer; empty where it failed
    rmse: float  # root-mean-square error over the measured rows; NaN where it failed
    fit_time: float  # [s]
    score_time: float  # [s]
    n_epochs: int | None  # of a network
    error: str | None  # with its traceback; None where it did not fail


class ResultStore:
    """Finished results, and claims of the processes that are computing others.

    Every change is one transaction, so that a process may be killed at any moment.  A task is *claimed* before it is
    computed.  A claim is valid while its owner is alive: its process runs (if it is on this machine) and has renewed
    its heartbeat within the last ``lease`` seconds.  A file that holds results for other data or settings is refused.
    Without a ``path`` results are kept in memory.  The file must be on a local disk, since SQLite's write-ahead log
    needs shared memory.
    """

    def __init__(self, path: str | os.PathLike[str] | None, settings: Mapping[str, str], lease: float = 60.0) -> None:
        if not isinstance(path, str | os.PathLike | None):
            raise StoreError(f"store={path!r} is no path; give that of a file, or None.")
        self.path = ":memory:" if path is None else os.fspath(path)
        self.owner = uuid.uuid4().hex
        self.lease = lease
        self._lock = threading.Lock()
        self._closed = threading.Event()
        if path is not None:
            _refuse_other_kinds(self.path)
        with self._explained():
            # joblib may ask for tasks from any thread; the lock keeps their transactions apart
            self._db = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None, check_same_thread=False)
        try:
            self._open(settings)
        except BaseException:
            self._db.close()
            raise
        self._heartbeat = threading.Thread(target=self._beat, daemon=True, name="skhybrid-store")
        self._heartbeat.start()

    def _open(self, settings: Mapping[str, str]) -> None:
        with suppress(sqlite3.Error):  # what cannot be read is explained below
            if (other := table_of_others(self._db, "setting")) is not None:
                raise StoreError(
                    f"store {self.path} is a database of another program, with a table {other!r}; {_OTHER_FILE}"
                )
        with self._explained():
            self._write_ahead()
        with self._transaction() as db:
            for statement in _TABLES.strip().split(";\n"):
                db.execute(statement)
            foreign = db.execute(_FOREIGN_ROWS).fetchone()
            if foreign is not None:
                raise StoreError(f"store {self.path} has a row of {foreign[0]} that no search wrote; {_OTHER_FILE}")
            known = dict(db.execute("SELECT name, value FROM setting"))
            check_settings(self.path, known, {"format": _FORMAT, **settings})
            if not known:
                db.executemany("INSERT INTO setting VALUES (?, ?)", [("format", _FORMAT), *settings.items()])
            self._renew(db)

    def _write_ahead(self) -> None:
        """Switch to a write-ahead log; SQLite does not wait if another process does the same, so it is retried."""
        until = time.monotonic() + _PATIENCE
        while True:
            try:
                self._db.execute("PRAGMA journal_mode=WAL")
                return
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                    raise
                time.sleep(0.05)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Release claims that are not finished, and close the file."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._heartbeat.join()
        try:
            # a claim that cannot be given back lapses, and results are stored already
            with suppress(OSError), self._transaction() as db:
                db.execute("DELETE FROM claim WHERE owner = ?", (self.owner,))
                db.execute("DELETE FROM owner WHERE id = ?", (self.owner,))
        finally:
            self._db.close()

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        """A transaction during which no other process writes."""
        with self._lock, self._explained(), transaction(self._db):
            yield self._db

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Let errors of SQLite name the file and say what to do."""
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError) as error:
            code = getattr(error, "sqlite_errorcode", None)
            remedy = _REMEDIES.get(-1 if code is None else code & 0xFF, _OTHER_FILE)
            cause = " ".join(str(error).split())  # a message may quote lines of the file
            raise StoreError(f"store {self.path} cannot be used ({cause}); {remedy}") from error

    def _renew(self, db: sqlite3.Connection) -> None:
        own = (self.owner, platform.node(), os.getpid(), time.time())
        db.execute("INSERT OR REPLACE INTO owner VALUES (?, ?, ?, ?)", own)

    def _beat(self) -> None:
        while not self._closed.wait(self.lease / 4.0):
            with suppress(OSError), self._transaction() as db:  # busy, or full: try at the next beat
                self._renew(db)

    def _drop_dead_owners(self, db: sqlite3.Connection) -> None:
        oldest = time.time() - self.lease
        for owner, host, pid, seen in db.execute("SELECT id, host, pid, seen FROM owner").fetchall():
            if owner != self.owner and (seen < oldest or (host == platform.node() and not _runs(pid))):
                db.execute("DELETE FROM owner WHERE id = ?", (owner,))
        db.execute("DELETE FROM claim WHERE owner NOT IN (SELECT id FROM owner)")

    def describe(self, candidates: Mapping[str, str]) -> None:
        """Store the parameters of candidates (id -> text), for people who read the file."""
        with self._transaction() as db:
            db.executemany("INSERT OR IGNORE INTO candidate VALUES (?, ?)", candidates.items())

    def claim(self, tasks: Sequence[Task]) -> list[Task]:
        """Claim tasks that are neither finished nor claimed; return those that are now claimed by this store."""
        with self._transaction() as db:
            self._drop_dead_owners(db)
            taken = []
            for task in tasks:
                if db.execute("SELECT 1 FROM result WHERE candidate = ? AND split = ?", task).fetchone() is None:
                    done = db.execute("INSERT OR IGNORE INTO claim VALUES (?, ?, ?)", (*task, self.owner))
                    taken += [task] * done.rowcount
            return taken

    def finish(self, results: Mapping[Task, Result]) -> None:
        """Store results, except for tasks that another process has finished first."""
        now = time.time()
        rows = [(*task, _as_json(one.scores), *one[1:], now) for task, one in results.items()]
        with self._transaction() as db:
            db.executemany("INSERT OR IGNORE INTO result VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)
            db.executemany("DELETE FROM claim WHERE candidate = ? AND split = ?", list(results))

    def results(self, candidates: Iterable[str] | None = None) -> dict[Task, Result]:
        """Finished results, of all candidates or of those with the given ids."""
        wanted = None if candidates is None else set(candidates)
        query = "SELECT candidate, split, scores, rmse, fit_time, score_time, n_epochs, error FROM result"
        with self._lock, self._explained():
            return {  # SQLite stores NaN as NULL
                Task(candidate, split): Result(_scores_of(scores), float("nan") if rmse is None else rmse, *rest)
                for candidate, split, scores, rmse, *rest in self._db.execute(query).fetchall()
                if wanted is None or candidate in wanted
            }

    def forget_failed(self) -> int:
        """Delete results that are errors, so that they are computed again; return how many there were."""
        with self._transaction() as db:
            return db.execute("DELETE FROM result WHERE error IS NOT NULL").rowcount


def _as_json(scores: Mapping[str, float]) -> str:
    """Scores as strict JSON, which knows neither NaN nor infinity: these are text."""
    return json.dumps({name: one if math.isfinite(one) else str(one) for name, one in scores.items()})


def _scores_of(text: str) -> dict[str, float]:
    try:
        return {name: float(one) for name, one in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError):
        raise sqlite3.DataError(f"scores are {text!r:.40}") from None


def _refuse_other_kinds(path: str) -> None:
    """Create the folder of a store; refuse a path that is empty, a folder or a device."""
    if not path:  # SQLite would take it for a database that it deletes in the end
        raise StoreError("store is an empty path, under which no result would be kept; give the path of a file.")
    try:
        os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    except OSError as error:
        raise StoreError(f"store {path} cannot be created ({error.strerror}); {_OTHER_FILE}") from error
    if os.path.exists(path) and not os.path.isfile(path):
        raise StoreError(f"store {path} is not a file; {_OTHER_FILE}")


def _runs(pid: int) -> bool:
    """Whether a process of this machine runs; assumed where it cannot be asked, so that its heartbeat decides."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)  # signal 0 only tests whether the process exists
    except OSError as error:
        return not isinstance(error, ProcessLookupError)
    return True
