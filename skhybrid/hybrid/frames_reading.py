"""Tables of forecasts from one origin: a history and rows ahead, joined to the rows that a predictor knows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._joining import join_frames, join_tables, refuse_absent, unmeasured, with_measured
from .._table import ZoneTable, append_tables, refuse_gap
from .scheme_intervals import HybridQuantilesMixin


def _at_now(table: ZoneTable, first: int, T_za: float | None) -> tuple[ZoneTable, np.ndarray]:
    """A table whose rows ahead begin with ``first``, and the row of the origin: that one where it is measured."""
    if T_za is None:
        return table, np.array([first - 1])
    return with_measured(table, first, T_za), np.array([first])


class FramesReadingMixin(HybridQuantilesMixin):
    """Reading of a history and rows ahead."""

    preprocess_: Any

    def _read_following(self, X: Any) -> ZoneTable:
        raise NotImplementedError

    def _after_known(self, ahead: ZoneTable, T_za: float | None = None) -> tuple[ZoneTable, np.ndarray]:
        """Rows ahead after the end of the known ones, and the row of the origin: the first one where it is measured."""
        table = append_tables(self._scheme.rows.end(), ahead)
        return _at_now(table, table.n_rows - ahead.n_rows, T_za)

    def _read_future(self, future: pd.DataFrame | ZoneTable) -> ZoneTable:
        if isinstance(future, ZoneTable):
            table = self._read_following(unmeasured(future, self._scheme.rows.training))
        else:
            refuse_absent(self._input_columns(future), future, "the training table")
            table = self._read_following(future)
        self._scheme.rows.refuse_unless_following(table)
        return table

    def _read_both(self, history: Any, future: Any, T_za: float | None = None) -> tuple[ZoneTable, np.ndarray]:
        """History and future as one table, after the known rows where it follows them, and the row of the origin."""
        if isinstance(history, ZoneTable):
            whole: Any = join_tables(history, future, self._scheme.rows.training)
        else:
            history = self._scheme.rows.in_own_zone(history)
            whole = join_frames(history, future, self._input_columns(history), self._column_of("T_za"))
        table = self._read_X(whole)
        refuse_gap(table)
        n_past = len(history.index)
        n_known = self._scheme.rows.n_known_of(table.rows(slice(0, n_past)))  # they are not taken in twice
        table, n_tail = self._after_tail(table.rows(slice(n_known, None)))
        return _at_now(table, n_tail + n_past - n_known, T_za)

    def _input_columns(self, frame: pd.DataFrame) -> list[Any]:
        """Columns of a frame that are read and known in advance."""
        names = list(getattr(self, "feature_names_in_", frame.columns))
        if self.preprocess_ is not None:
            past = self._column_of("T_za")
            return [name for name in getattr(self.preprocess_, "feature_names_in_", frame.columns) if name != past]
        by_role = [self._column_of(role) for role in self._scheme.rows.training.inputs]
        return by_role if set(by_role) <= set(names) else names
