"""Known and future rows by their number since the start of the training."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ..._table import ZoneTable


class NumberedTable(NamedTuple):
    """Known and future rows: after the training rows as one table with them, or by themselves."""

    table: ZoneTable
    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    begin: int  # the first row that the training has not seen
    joined: bool  # whether the rows before ``begin`` are the training's own
    first: int = 0  # the table's first row, where it holds the last ones only
    whole: Callable[[], tuple[ZoneTable, np.ndarray]] | None = None  # all rows from 0 on, where it does not hold them
    before: Mapping[str, np.ndarray] | None = None  # inputs of some rows before ``first``

    def since(self, row: int) -> NumberedTable:
        """The rows from one on, for a member that has gone through those before it."""
        if row <= self.first:
            return self
        later = slice(row - self.first, None)
        return self._replace(table=self.table.rows(later), T=self.T[later], first=row, whole=self._whole)

    def with_boundary(self, values: Mapping[str, np.ndarray], origin: int, n_back: int) -> NumberedTable:
        """Rows from ``n_back`` before an origin to the last lead, with other values (n_leads,) of some inputs ahead.

        The first of them is measured where any row before it is.
        """
        table, n_leads, at = self.table, len(next(iter(values.values()))), origin - self.first
        first = max(0, at - n_back)
        while first and not np.isfinite(self.T[first]):
            first = max(0, first - n_back)
        kept, T = table.rows(slice(first, at + 1 + n_leads)), self.T[first : at + 1 + n_leads]
        ahead = slice(0, first + kept.n_rows - at - 1)
        inputs = {role: np.append(kept.inputs[role][: at + 1 - first], v[ahead]) for role, v in values.items()}
        earlier = self.before or {}
        before = {role: np.append(earlier.get(role, []), v[:first]) for role, v in table.inputs.items()}
        kept = kept.replace(inputs={**kept.inputs, **inputs})
        first += self.first
        return NumberedTable(kept, T, self.begin, self.joined, first, self._whole, before if first else None)

    @property
    def _whole(self) -> Callable[[], tuple[ZoneTable, np.ndarray]]:
        """All rows from 0 on."""
        return self.whole or (lambda: (self.table, self.T))
