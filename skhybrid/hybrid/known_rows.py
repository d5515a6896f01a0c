"""The rows that a fitted estimator knows: its training table, and what came after it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import pandas as pd

from .._joining import LAST_KNOWN, in_zone_of, refuse_unless_following
from .._table import SETPOINT_ROLES, ZoneTable, append_tables, concatenate_tables, last_rows, refuse_other_clock
from .plausible_range import PlausibleRange
from .tables import KEPT, utc_of

_JOINED = 96  # recent rows that are joined to the older ones at once: joining one row costs as much as joining many

_ALIKE = 12  # recent tables of one length that are joined


@dataclass(frozen=True)
class KnownRows:
    """A training table and those that followed it, with the measured temperature as history ``T_za``; never changed."""

    settled: tuple[ZoneTable, ...]  # the training table, then rows that were joined
    recent: tuple[ZoneTable, ...]  # tables that came since, each as it came
    n_end: int  # how many of the settled rows belong to the end that serves as history
    plausible: PlausibleRange  # of all temperatures measured so far

    @classmethod
    def of(cls, training: ZoneTable) -> Self:
        n_end = min(training.n_rows, _most(training))
        return cls((_owned(training),), (), n_end, PlausibleRange.of(training.history["T_za"]))

    @property
    def training(self) -> ZoneTable:
        return self.settled[0]

    @property
    def tables(self) -> tuple[ZoneTable, ...]:
        return (*self.settled, *self.recent)

    @property
    def latest(self) -> ZoneTable:
        return self.tables[-1]

    @property
    def last_stamp(self) -> pd.Timestamp | None:
        """The stamp of the last row in UTC; None where there are no stamps."""
        stamps = self.latest.utc
        return None if stamps is None else stamps[-1]

    @cached_property
    def n_rows(self) -> int:
        return sum(table.n_rows for table in self.tables)

    def end(self) -> ZoneTable:
        """The last rows, which serve as history of a table that follows."""
        return last_rows(self.tables, self.n_end + self._n_recent)

    def with_earlier(self, table: ZoneTable, n_rows: int) -> ZoneTable:
        """A table that begins with the end of these rows, with up to ``n_rows`` of them."""
        if not table.n_history or n_rows <= table.n_history:
            return table
        return append_tables(last_rows(self.tables, n_rows), table.rows(slice(table.n_history, None)))

    def inputs_before(self, roles: Iterable[str], n_after: int, n_rows: int) -> dict[str, np.ndarray]:
        """(n_rows,) values of each input before the last ``n_after`` rows, fewer where there are fewer."""
        parts: list[tuple[ZoneTable, slice]] = []
        for table in reversed(self.tables):
            if n_rows <= 0:
                break
            end = max(table.n_rows - n_after, 0)
            begin = max(end - n_rows, 0)
            parts.insert(0, (table, slice(begin, end)))
            n_after, n_rows = max(n_after - table.n_rows, 0), n_rows - (end - begin)
        return {role: np.concatenate([np.empty(0), *(t.inputs[role][rows] for t, rows in parts)]) for role in roles}

    def whole(self) -> ZoneTable:
        return concatenate_tables(self.tables)

    def appended(self, table: ZoneTable) -> KnownRows:
        """These rows and a table that follows them, in a time that does not depend on how many there are."""
        plausible = self.plausible.extended(table.history["T_za"])
        longer = replace(self, recent=_fewer((*self.recent, _owned(table))), plausible=plausible)
        if longer._n_recent < _JOINED:
            return longer
        n_end = min(longer.n_end + longer._n_recent, _most(table))
        return replace(longer, settled=(*self.settled, concatenate_tables(longer.recent)), recent=(), n_end=n_end)

    def retrained(self, training: ZoneTable) -> KnownRows:
        """Rows whose training table is another one, which ends where these end."""
        return replace(self, settled=(training,), recent=(), n_end=min(self.n_end + self._n_recent, training.n_rows))

    def n_known_of(self, history: ZoneTable) -> int:
        """Number of rows of a history that are known already, where it goes on from them or ends with the last one."""
        n, end = history.stamps.n_until(self.last_stamp), self.end()
        if not n or utc_of(history)[-1] < utc_of(self.latest)[-1]:
            return 0
        n_alike = min(n, end.n_rows)
        given, kept = history.rows(slice(n - n_alike, n)), end.rows(slice(end.n_rows - n_alike, None))
        pairs = [(given.inputs.get(role), v) for role, v in kept.inputs.items()]
        # a history need not have the set-points
        unsaid = [role for role in SETPOINT_ROLES if np.isnan(given.measured(role)).all()]
        pairs += [(given.history.get(role), v) for role, v in kept.history.items() if role not in unsaid]
        # a file may keep fewer digits than the table that was fitted
        alike = all(a is not None and np.allclose(a, b, 1e-6, 1e-6, equal_nan=True) for a, b in pairs)
        return n if alike and utc_of(kept).equals(utc_of(given)) else 0

    @property
    def _n_recent(self) -> int:
        return sum(table.n_rows for table in self.recent)

    def in_own_zone(self, data: Any) -> Any:
        """A table or a target in the time zone of these rows."""
        if not isinstance(data, pd.DataFrame | pd.Series):
            return data
        stamps = in_zone_of(data.index, self.latest.index, ("the training table", "X"))
        return data if stamps is data.index else data.set_axis(stamps)

    def with_own_clock(self, table: ZoneTable) -> ZoneTable:
        """A table without stamps continues the clock of these rows."""
        if table.utc is not None or self.latest.utc is not None:
            return table
        begin = self.latest.time[-1] + table.step
        return table.replace(time=pd.date_range(begin, periods=table.n_rows, freq=table.step))

    def without_known(self, table: ZoneTable) -> ZoneTable:
        """The rows of a table that come after the last known one."""
        n = table.stamps.n_until(self.last_stamp)
        return table.rows(slice(n, None)) if n else table

    def refuse_other_values(self, table: ZoneTable, name: Any) -> None:
        """Raise a ValueError if a known row has another temperature in a table; ``name`` is the column of it."""
        if not (n := table.stamps.n_until(self.last_stamp)):
            return
        past = self.whole()
        at = utc_of(past).get_indexer(utc_of(table)[:n])
        given, known = table.history["T_za"][:n], past.history["T_za"][at]
        other = (at >= 0) & np.isfinite(given) & ~np.isclose(given, known, 1e-6, 1e-6)
        if other.any():
            row = int(np.argmax(other))
            raise ValueError(
                f"y is {given[row]:g} at {table.index[row]}, a row that was taken in with {name} = {known[row]:g}; "
                "known rows stay as they are, so give NaN there, or fit again."
            )

    def refuse_unless_following(self, table: ZoneTable, name: str = "X") -> None:
        """Raise a ValueError if a table, the argument ``name``, does not begin one step after the last known row."""
        refuse_other_clock(table, self.latest)
        if table.utc is not None:
            refuse_unless_following(table, self.latest, name, LAST_KNOWN)


def _fewer(recent: tuple[ZoneTable, ...]) -> tuple[ZoneTable, ...]:
    """The same rows, the last tables joined where there are many of one length: each call goes through all of them."""
    last = recent[-_ALIKE:]
    if len(last) < _ALIKE or len({table.n_rows for table in last}) > 1:
        return recent
    return (*recent[:-_ALIKE], concatenate_tables(last))


def _owned(table: ZoneTable) -> ZoneTable:
    """A table by itself, none of whose rows counts as history."""
    return table.owned().replace(n_history=0)


def _most(table: ZoneTable) -> int:
    """Rows that the end has at most, without recent ones."""
    return int(KEPT / table.step)
