"""The data contract: a validated table of consecutive time steps, and the functions that read one.

A row is a time step, a column has a role (see :data:`ROLES`).  This is the only module that validates tables; every
estimator reads its input through :func:`read_table` and :func:`read_target`.  A table is read once per public call and
travels on as a :class:`ZoneTable`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils import check_array, column_or_1d
from sklearn.utils.validation import validate_data

from ._columns import (
    HISTORY_ROLES,
    ROLES,
    columns_by_position,
    columns_by_role,
    listed,
    numeric,
    read_history,
    read_input,
    refuse_impossible,
    refuse_shape,
    role_of,
    warn_units,
)
from ._time import read_index, spell

__all__ = [
    "HISTORY_ROLES",
    "ROLES",
    "ZoneTable",
    "append_tables",
    "read_table",
    "read_target",
    "read_targets",
    "role_of",
]


@dataclass(frozen=True)
class ZoneTable:
    """A validated table of evenly spaced time steps, in one segment or several."""

    inputs: dict[str, np.ndarray]  # role -> (n,) float64, finite
    history: dict[str, np.ndarray]  # "T_za", "zeta" where given -> (n,) float64, NaN where missing
    index: pd.Index  # the caller's own index, for outputs
    time: pd.DatetimeIndex  # local wall-clock time, without zone; assumed where the table has no stamps
    utc: pd.DatetimeIndex | None  # stamps in UTC; None where the table has no stamps
    step: pd.Timedelta  # the sampling time
    n_history: int = 0  # rows at the front that are the end of a training table
    breaks: tuple[int, ...] = (0,)  # first rows of the segments of consecutive rows
    order: tuple[str, ...] = ()  # roles in the order of the caller's columns

    @property
    def n_rows(self) -> int:
        return len(self.index)

    @property
    def step_hours(self) -> float:
        return self.step / pd.Timedelta("1h")

    @property
    def roles(self) -> list[str]:
        """Roles of the columns, in the caller's order."""
        here = {**self.inputs, **self.history}
        return [role for role in self.order if role in here] + [role for role in here if role not in self.order]

    @property
    def T_za(self) -> np.ndarray | None:
        return self.history.get("T_za")

    def replace(self, **changes: Any) -> ZoneTable:
        """The same table with other inputs, history or stamps."""
        return replace(self, **changes)

    def rows(self, chosen: slice) -> ZoneTable:
        """The table's rows ``chosen``, as views."""
        return ZoneTable(
            {role: v[chosen] for role, v in self.inputs.items()},
            {role: v[chosen] for role, v in self.history.items()},
            self.index[chosen],
            self.time[chosen],
            None if self.utc is None else self.utc[chosen],
            self.step,
            order=self.order,
        )

    @property
    def segments(self) -> tuple[ZoneTable, ...]:
        """The segments of consecutive rows, each a table of its own."""
        if len(self.breaks) == 1:
            return (self,)
        ends = (*self.breaks[1:], self.n_rows)
        return tuple(self.rows(slice(a, b)) for a, b in zip(self.breaks, ends, strict=True))

    def follows(self, earlier: ZoneTable | None) -> bool:
        """Whether this table begins where ``earlier`` ended."""
        if earlier is None or self.utc is None or earlier.utc is None or self.step != earlier.step:
            return False
        return self.utc[0] == earlier.utc[-1] + self.step


def append_tables(first: ZoneTable, second: ZoneTable) -> ZoneTable:
    """Append ``second`` to ``first``; inputs that either lacks are dropped, missing history is NaN."""
    shared = [role for role in second.inputs if role in first.inputs]
    kept = {role for table in (first, second) for role in table.history}

    def past(table: ZoneTable, role: str) -> np.ndarray:
        return table.history.get(role, np.full(table.n_rows, np.nan))

    return ZoneTable(
        {role: np.concatenate([first.inputs[role], second.inputs[role]]) for role in shared},
        {role: np.concatenate([past(first, role), past(second, role)]) for role in sorted(kept)},
        first.index.append(second.index),
        pd.DatetimeIndex(first.time.append(second.time)),
        None if first.utc is None or second.utc is None else pd.DatetimeIndex(first.utc.append(second.utc)),
        second.step,
        n_history=first.n_rows,
        order=second.order,
    )


# --------------------------------------------------------------------------------------------------- reading tables
def read_table(
    estimator: Any,
    X: Any,
    *,
    columns: Mapping[str, Any] | None = None,
    required: Iterable[str] = (),
    needed: Callable[[str], object] | None = None,
    sampling_time: Any = None,
    default_step: str = "15min",
    reset: bool,
    min_rows: int = 1,
    expected_step: pd.Timedelta | None = None,
    gaps: bool = False,
    history_roles: Iterable[str] = HISTORY_ROLES,
) -> ZoneTable:
    """Validate ``X`` by the data contract and return it by roles.

    Parameters
    ----------
    estimator : estimator
        Gets ``n_features_in_`` and ``feature_names_in_`` where ``reset``, and is checked against them otherwise.
    X : DataFrame, array-like of shape (n_samples, n_features) or ZoneTable
        A frame's columns are found by role, an array's by position (``T_oa``, ``q_sol``, ``u_2``, ``u_3`` ...).  A
        ZoneTable was read before: its roles are selected and nothing is parsed again.
    columns : mapping of role to column, optional
        Overrides the names; None as a column says that the role is absent on purpose.
    required : iterable of str
        Roles without which a *named* table is refused.
    needed : callable of a role, optional
        Inputs for whose role it is not true are left unread (and so may hold anything).
    sampling_time : timedelta-like, optional
        The step of a table without time stamps.
    reset : bool
        True in ``fit``.
    min_rows : int
        Fewer rows are refused.
    expected_step : Timedelta, optional
        The step seen in ``fit``; another one is refused.
    gaps : bool
        Whether the rows may come in segments with three hours or more between them.
    history_roles : iterable of str
        Roles that hold the past only.

    Raises
    ------
    ValueError
        In one sentence that names the column, the stamp or the step and says what to do.
    """
    wanted = _Request(columns, required, needed, gaps, frozenset(history_roles), reset, min_rows)
    if isinstance(X, ZoneTable):
        table = _select(estimator, X, wanted)
    else:
        table = _parse(estimator, X, wanted, (sampling_time, default_step, expected_step))
    if expected_step is not None and table.step != expected_step:
        raise ValueError(
            f"X has a sampling time of {spell(table.step)}, but {type(estimator).__name__} was fitted at "
            f"{spell(expected_step)}; resample it with skhybrid.datasets.regularize."
        )
    return table


class _Request(NamedTuple):
    """The arguments of :func:`read_table` that say which roles are read."""

    columns: Mapping[str, Any] | None
    required: Iterable[str]
    needed: Callable[[str], object] | None
    gaps: bool
    history_roles: frozenset[str]
    reset: bool
    min_rows: int

    def reads(self, role: str) -> bool:
        return self.needed is None or bool(self.needed(role))


def _parse(estimator: Any, X: Any, wanted: _Request, steps: tuple[Any, str, pd.Timedelta | None]) -> ZoneTable:
    """Parse a caller's frame or array; this happens once per public call."""
    if isinstance(X, pd.DataFrame):
        refuse_shape(X, wanted.min_rows)
        validate_data(estimator, X, reset=wanted.reset, skip_check_array=True)
        by_role = columns_by_role(X, wanted.columns, wanted.required)
        values = {role: numeric(X[column], column) for role, column in by_role.items()}
        names = {role: repr(column) for role, column in by_role.items()}
        index = X.index
    else:
        array = validate_data(
            estimator,
            X,
            reset=wanted.reset,
            dtype=np.float64,
            ensure_all_finite=False,
            ensure_min_samples=wanted.min_rows,
        )
        chosen = columns_by_position(array.shape[1], wanted.columns)
        values = {role: array[:, j] for role, j in chosen.items()}
        names = {role: str(j) for role, j in chosen.items()}
        index = pd.RangeIndex(len(array))
    step, time, utc, breaks = read_index(index, *steps, wanted.gaps)
    past = wanted.history_roles & set(values)
    history = {role: read_history(v, names[role], index) for role, v in values.items() if role in past}
    inputs = {
        role: read_input(v, names[role], index) for role, v in values.items() if role not in past and wanted.reads(role)
    }
    for role, v in {**inputs, **history}.items():
        refuse_impossible(v, role, f"column {names[role]}", index)
    if wanted.reset:
        warn_units({**inputs, **history}, names)
    return ZoneTable(inputs, history, index, time, utc, step, order=tuple(values), breaks=breaks)


def _select(estimator: Any, table: ZoneTable, wanted: _Request) -> ZoneTable:
    """Select the roles that an estimator reads from a table that was parsed before."""
    without = {role for role, column in (wanted.columns or {}).items() if column is None}
    sunny = any(role.startswith("q_sol_") for role in table.inputs)
    given = {*table.inputs, *without, *(["q_sol"] if sunny else [])}
    absent = [role for role in wanted.required if role not in given]
    if absent:
        raise ValueError(f"role {absent[0]!r} is missing: the table has {listed(table.roles)}.")
    if table.n_rows < wanted.min_rows:
        raise ValueError(f"Found a table of {table.n_rows} row(s) while {wanted.min_rows} are required.")
    if len(table.breaks) > 1 and not wanted.gaps:
        raise ValueError(f"X has a gap before {table.index[table.breaks[1]]}; give one segment at a time.")
    if wanted.reset:
        estimator.feature_names_in_ = np.array(table.roles, dtype=object)
        estimator.n_features_in_ = len(table.roles)
    values = {**table.inputs, **table.history}
    past = wanted.history_roles | without
    return table.replace(
        inputs={role: v for role, v in values.items() if role not in past and wanted.reads(role)},
        history={role: v for role, v in values.items() if role in wanted.history_roles},
    )


def read_target(y: Any, table: ZoneTable, *, max_missing: float = 0.5, role: str | None = None) -> np.ndarray:
    """Validate the target: shape (n_samples,) float64, NaN where missing, never infinite.

    With ``role`` its range is held against that role's unit, unless the table holds the same as history.

    Raises
    ------
    ValueError
        If it is None, infinite somewhere, of another length or index than the table, or missing for more than
        ``max_missing`` of the rows.
    """
    if y is None:
        raise ValueError("This estimator requires y to be passed, but the target y is None.")
    stamps = y.index if isinstance(y, pd.Series | pd.DataFrame) else None
    checked = check_array(y, ensure_2d=False, dtype=None, ensure_all_finite=False, ensure_min_samples=0, input_name="y")
    if np.iscomplexobj(checked):
        raise ValueError("Complex data not supported: y must be real.")
    target = column_or_1d(checked, warn=True).astype(np.float64, copy=True)
    if len(target) != table.n_rows:
        raise ValueError(
            f"Found input variables with inconsistent numbers of samples: X has {table.n_rows} rows, y {len(target)}."
        )
    if (
        stamps is not None
        and isinstance(stamps, pd.DatetimeIndex)
        and table.utc is not None
        and not stamps.equals(table.index)
    ):
        raise ValueError(
            f"X and y bear different time stamps (X from {table.index[0]}, y from {stamps[0]}); align them first."
        )
    if np.isinf(target).any():
        row = int(np.flatnonzero(np.isinf(target))[0])
        raise ValueError(
            f"Input y contains infinity or a value too large for dtype('float64') "
            f"(first at {table.index[row]}); set it to NaN where the sensor failed."
        )
    missing = float(np.isnan(target).mean()) if len(target) else 1.0
    if missing > max_missing:
        raise ValueError(
            f"Input y contains NaN in {missing:.0%} of its rows, more than max_missing={max_missing:.0%}; "
            "choose a span with more measurements."
        )
    if role is not None:
        refuse_impossible(target, role, "y", table.index)
        if role not in table.history:
            warn_units({role: target}, {role: "y"})
    return target


def read_targets(y: Any, table: ZoneTable, roles: tuple[str, ...], *, max_missing: float = 0.5) -> np.ndarray:
    """Validate the targets of the given roles: (n_samples,) of one, (n_samples, n_roles) of several.

    Raises
    ------
    ValueError
        As :func:`read_target`, and if y has another number of columns, or names others.
    """
    if len(roles) == 1 or y is None:
        return read_target(y, table, max_missing=max_missing, role=roles[0])
    frame = y if isinstance(y, pd.DataFrame) else pd.DataFrame(np.asarray(y))
    named = isinstance(y, pd.DataFrame) and set(roles) <= set(frame.columns)
    if not named and frame.shape[1] != len(roles):
        raise ValueError(f"y has shape {np.shape(y)}, but several temperatures are measured: give {', '.join(roles)}.")
    columns: list[Any] = [frame[role] if named else frame.iloc[:, j] for j, role in enumerate(roles)]
    if not isinstance(y, pd.DataFrame):
        columns = [column.to_numpy() for column in columns]
    read = [read_target(c, table, max_missing=max_missing, role=role) for c, role in zip(columns, roles, strict=True)]
    return np.column_stack(read)
