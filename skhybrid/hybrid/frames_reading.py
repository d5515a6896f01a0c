"""Tables of forecasts from one origin: a history and rows ahead, joined to the rows that a predictor knows."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from .._ranges import check_range
from .._table import ZoneTable, append_tables
from .scheme_intervals import HybridQuantilesMixin
from .tables import join_frames, join_tables, refuse_absent, unmeasured


def read_now(T_za: Any, index: pd.Index) -> float:
    """The temperature that is measured now [degC], at the first of some rows ahead."""
    if isinstance(T_za, bool | np.bool_) or not isinstance(T_za, Real) or not np.isfinite(float(T_za)):
        raise ValueError(f"T_za={T_za!r} is not a number; give the temperature [degC] measured at {index[0]}.")
    value = float(T_za)
    check_range(np.array([value]), "T_za", "T_za", index[:1])
    return value


def refuse_no_frames(history: Any, future: Any) -> None:
    """Refuse a history or rows ahead that are no tables, or have no rows."""
    for name, rows in (("history", history), ("future", future)):
        if not isinstance(rows, pd.DataFrame | ZoneTable) and (name == "future" or rows is not None):
            raise ValueError(f"{name} is a {type(rows).__name__}; give a DataFrame with time stamps.")
    if (history is not None and not len(history.index)) or not len(future.index):
        raise ValueError("history and future need at least one row each.")


def with_measured(table: ZoneTable, row: int, T_za: float) -> ZoneTable:
    """A table in which the temperature of one row is measured."""
    T = np.full(table.n_rows, np.nan) if table.T_za is None else table.T_za.copy()
    T[row] = T_za
    return table.replace(history={**table.history, "T_za": T})


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
            whole = join_frames(history, future, self._input_columns(history), self._column_of("T_za"))
        table, n_tail = self._with_history(whole)
        return _at_now(table, n_tail + len(history.index), T_za)

    def _input_columns(self, frame: pd.DataFrame) -> list[Any]:
        """Columns of a frame that are read and known in advance."""
        names = list(getattr(self, "feature_names_in_", frame.columns))
        if self.preprocess_ is not None:
            past = self._column_of("T_za")
            return [name for name in getattr(self.preprocess_, "feature_names_in_", frame.columns) if name != past]
        by_role = [self._column_of(role) for role in self._scheme.rows.training.inputs]
        return by_role if set(by_role) <= set(names) else names
