"""Folder with the models of a fleet: two files per zone, each replaced in one step, and a lock."""

from __future__ import annotations

import json
import shutil
import sqlite3
import tempfile
import weakref
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote, unquote

from .._files import remove_leftovers, write_text
from .._sqlite import open_database, table_of_others, transaction
from .._table import listed
from .._warnings import warn_user
from ..exceptions import SkhybridWarning
from ..parallel.stored_settings import check_settings
from ..persistence import load_model, save_model
from ..persistence.model_file import checked_archive
from .journal import Journal, is_journal

_MODEL, _JOURNAL, _LOCK = ".skops", ".npz", "fleet.sqlite"
_FAILURES = {"fit": "failures.json", "tick": "tick_failures.json"}
_NEW_MODEL = ("+0.skops", "+1.skops")  # of a zone, by turns; no name of a zone has a plus, see _file
_LONGEST = 230  # name of a file without its ending; a temporary file has 24 characters more, and systems take 255
_MOST_ROWS = 4000  # of a journal; above it the model is saved with them


class TemporaryStore:
    """Folder that is removed with the last that holds it; a deep copy, or a pickle, is a folder with the same files."""

    def __init__(self, files: Mapping[str, bytes] = MappingProxyType({})) -> None:
        self._path = tempfile.mkdtemp(prefix="skhybrid-fleet-")
        weakref.finalize(self, shutil.rmtree, self._path, ignore_errors=True)
        for name, content in files.items():
            (Path(self._path) / name).write_bytes(content)

    def __fspath__(self) -> str:
        return self._path

    def __reduce__(self) -> tuple[type[TemporaryStore], tuple[dict[str, bytes]]]:
        return TemporaryStore, ({file.name: file.read_bytes() for file in Path(self._path).iterdir()},)


class ModelStore:
    """Models by the name of their zone; a process that writes to it may be killed at any moment."""

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = Path(path)

    def zones(self) -> list[str]:
        """Names of the zones that have a model."""
        files = (file for file in self.path.glob(f"[!.]*{_JOURNAL}") if self._is_of_zone(file))
        return sorted(unquote(file.name.removesuffix(_JOURNAL)) for file in files)

    def _is_of_zone(self, journal: Path) -> bool:
        """Whether a file is a journal: it has a model beside it, or where that is lost, holds what a journal does."""
        stem = str(journal).removesuffix(_JOURNAL)
        return any(Path(stem + kind).exists() for kind in (_MODEL, *_NEW_MODEL)) or is_journal(journal)

    def has(self, zone: str) -> bool:
        """Whether a zone has a model."""
        return len(_stem(zone)) <= _LONGEST and self._file(zone, _JOURNAL).exists()

    def journal(self, zone: str) -> Journal:
        """The journal of a zone that has a model."""
        journal = Journal.load(self._file(zone, _JOURNAL))
        if (owner := journal.facts.get("zone", zone)) != zone:  # on a disk that tells no capital letters apart
            raise ValueError(f"the file of its model is that of zone {owner!r}; give one of them another name.")
        return journal

    def load(self, zone: str) -> tuple[Any, Journal]:
        """The model of a zone, which has taken in the rows of its journal where it can, and the journal."""
        path, known = self._file(zone, _JOURNAL), -1
        while known != (known := path.stat().st_mtime_ns):  # another process may replace the pair meanwhile
            journal = self.journal(zone)
            model = load_model(self._model_of(zone, journal))
        if len(journal.rows) and hasattr(model, "update"):
            model.update(journal.rows)
        return model, journal

    def is_whole(self, zone: str) -> bool:
        """Whether the files of a zone can be read and are as they were saved."""
        try:
            checked_archive(self._model_of(zone, self.journal(zone)))
        except (OSError, ValueError):
            return False
        return True

    def fitted(self, zones: Iterable[str]) -> Iterator[tuple[str, Any]]:
        """Name and model of those of some zones that the estimator, not the fallback, was fitted on.

        Zones of which a file cannot be read are left out, with a warning.
        """
        damaged = []
        for zone in zones:
            try:
                model, journal = self.load(zone)
            except (OSError, ValueError):
                damaged.append(zone)
                continue
            if journal.facts["fallback"] is None:
                yield zone, model
        if damaged:
            warn_user(
                f"left out: {listed(damaged)}, of which a file in {self.path} is damaged; fit again.", SkhybridWarning
            )

    def save(self, zone: str, model: Any, journal: Journal) -> None:
        """Keep a model that holds all rows that its zone has taken in."""
        # A model is the file of its journal's turn, or the usual one where that is absent.  Each step is atomic: until
        # the journal is replaced the old pair holds, since the file of the other turn is not read; then the new pair,
        # under either name.  A file that a kill left is written anew before its turn comes, and never read before.
        turn = 1 - self.journal(zone).facts.get("turn", 0) if self.has(zone) else 0
        new = self._file(zone, _NEW_MODEL[turn])
        save_model(model, new)
        journal.facts["turn"] = turn
        journal.save(self._file(zone, _JOURNAL))
        new.replace(self._file(zone, _MODEL))

    def keep(self, zone: str, model: Any, journal: Journal) -> None:
        """Keep what a zone has taken in: in the journal alone, as long as that is short."""
        if len(journal.rows) > _MOST_ROWS:
            if hasattr(model, "update"):
                journal.rows = journal.rows[:0]
                self.save(zone, model, journal)
                return
            journal.rows = journal.rows.iloc[-_MOST_ROWS:]
        journal.save(self._file(zone, _JOURNAL))

    def failures(self, of: str) -> dict[str, str]:
        """Why the last fit or tick of zones failed, by zone."""
        path = self.path / _FAILURES[of]
        if not path.exists():
            return {}
        try:
            return dict(json.loads(path.read_text(encoding="utf-8")))
        except (ValueError, TypeError):
            warn_user(f"{path} cannot be read, so why a {of} of zones failed is unknown; {of} again.", SkhybridWarning)
            return {}

    def keep_failures(self, of: str, found: Mapping[str, str | None]) -> None:
        """Keep why a fit or a tick of zones failed, None where it did not; what is known of other ticks stays."""
        known = {} if of == "fit" else self.failures(of)
        told = {zone: why for zone, why in {**known, **found}.items() if why is not None}
        whys = {zone: why for zone, why in told.items() if of == "fit" or self.has(zone)}
        if whys or (self.path / _FAILURES[of]).exists():
            write_text(self.path / _FAILURES[of], json.dumps(whys))

    def _model_of(self, zone: str, journal: Journal) -> Path:
        """The file of a zone's model: that of the journal's turn, or the usual one where that is absent."""
        new = self._file(zone, _NEW_MODEL[journal.facts.get("turn", 0)])
        return new if new.exists() else self._file(zone, _MODEL)

    def _file(self, zone: str, kind: str) -> Path:
        stem = _stem(zone)
        if len(stem) > _LONGEST:
            raise ValueError(
                f"its name takes {len(stem)} characters as a file name, and at most {_LONGEST} are possible; "
                "shorten it."
            )
        return self.path / f"{stem}{kind}"

    def check(self, settings: Mapping[str, str]) -> None:
        """Refuse a store of other estimators."""
        if (self.path / _LOCK).exists():
            with self._open() as database:
                self._compare(database, settings)
        else:
            self._refuse_models_of_unknown()

    @contextmanager
    def locked(self, settings: Mapping[str, str], *, new: bool = False) -> Iterator[None]:
        """Let no other fleet write meanwhile; SQLite's lock vanishes with its process.  ``new``: make absent stores."""
        if self.path.is_file():
            raise ValueError(f"store={str(self.path)!r} is a file; give a folder, which is made where there is none.")
        if not new and not (self.path / _LOCK).exists():
            self._refuse_models_of_unknown()
            raise ValueError(f"store {self.path} has no models; fit the zones first, or give the store that has them.")
        self.path.mkdir(parents=True, exist_ok=True)
        with self._open() as database:
            with transaction(database):  # of its own: a kill must not lose the settings
                if not self._compare(database, settings):
                    database.execute("CREATE TABLE IF NOT EXISTS setting (name TEXT PRIMARY KEY, value TEXT NOT NULL)")
                    database.execute("DELETE FROM setting")
                    database.executemany("INSERT INTO setting VALUES (?, ?)", settings.items())
            with transaction(database):
                remove_leftovers(self.path, f"*{_MODEL}", f"*{_JOURNAL}", *_FAILURES.values())
                yield

    def _compare(self, database: sqlite3.Connection, settings: Mapping[str, str]) -> dict[str, str]:
        if (other := table_of_others(database, "setting")) is not None:
            raise OSError(
                f"{self.path / _LOCK} is a database of another program, with a table {other!r}; give another store."
            )
        try:
            known = dict(database.execute("SELECT name, value FROM setting"))
        except sqlite3.OperationalError as error:
            if "no such table" not in str(error):
                raise
            known = {}
        if not known:
            self._refuse_models_of_unknown()
        if not self.zones():  # every zone failed, so that no model is of these settings
            known = {}
        check_settings(str(self.path), known, settings)
        return known

    def _refuse_models_of_unknown(self) -> None:
        """Refuse models without the settings that they were made with: they may be of any estimator."""
        journals = self.path.glob(f"[!.]*{_JOURNAL}")
        if any(file.with_suffix(_MODEL).exists() for file in journals):  # other programs write .npz files, too
            raise ValueError(
                f"store {self.path} has models, but {_LOCK}, which tells what they were made with, is absent or "
                "empty; restore that file, give another store, or remove this one to begin anew."
            )

    def _open(self) -> AbstractContextManager[sqlite3.Connection]:
        busy = f"another fleet is at work in {self.path}; wait until it has ended, or give another store."
        return open_database(self.path / _LOCK, busy, "check the disk, or give another store.")


def _stem(zone: str) -> str:
    """The name of a zone as that of a file."""
    name = quote(zone, safe=" ")
    return name.replace(".", "%2E", 1) if name.startswith(".") else name
