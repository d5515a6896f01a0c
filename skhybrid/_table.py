"""The data contract: validated tables of consecutive time steps, and the functions that read them.

A row is a time step, a column has a role (see :data:`ROLES`).  Tables are validated here only, by :func:`read_table`
and :func:`read_target`, once per public call, and passed on as a :class:`ZoneTable`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils.validation import validate_data

from ._clock import Stamps, clock_of_training, joined_stamps
from ._columns import (
    HISTORY_ROLES,
    columns_by_position,
    columns_by_role,
    is_plant,
    missing_roles,
    read_history,
    read_input,
    role_numbers,
    roles_as_fitted,
    target_numbers,
)
from ._columns import ROLES as ROLES
from ._columns import SETPOINT_ROLES as SETPOINT_ROLES
from ._columns import as_numbers as as_numbers
from ._columns import as_pandas as as_pandas
from ._columns import by_name as by_name
from ._columns import checked_columns as checked_columns
from ._columns import ending_zone as ending_zone
from ._columns import fill_ahead as fill_ahead
from ._columns import float_columns as float_columns
from ._columns import is_cooling as is_cooling
from ._columns import is_history as is_history
from ._columns import is_instant as is_instant
from ._columns import is_set_point as is_set_point
from ._columns import is_stage as is_stage
from ._columns import listed as listed
from ._columns import numeric as numeric
from ._columns import plant_roles as plant_roles
from ._columns import predicted_by as predicted_by
from ._columns import refuse_huge as refuse_huge
from ._columns import refuse_infinite as refuse_infinite
from ._columns import refuse_infinite_columns as refuse_infinite_columns
from ._columns import refuse_shape as refuse_shape
from ._columns import role_of as role_of
from ._columns import unmasked as unmasked
from ._holidays import NO_HOLIDAYS, Holidays, read_holidays
from ._ranges import check_range
from ._target import SCORED as SCORED
from ._target import UNLIMITED as UNLIMITED
from ._target import is_target as is_target
from ._target import refuse_exchanged as refuse_exchanged
from ._target import refuse_missing, refuse_target_among, warn_if_still, warn_if_temperature
from ._target import refuse_order as refuse_order
from ._target import refuse_other_quantity as refuse_other_quantity
from ._target import same_values as same_values
from ._time import read_index, spell

_FEW_HOURS = 1.0  # at full load, below which a plant hardly ran


@dataclass(frozen=True)
class ZoneTable:
    """A validated table of evenly spaced time steps, in one segment or several."""

    inputs: dict[str, np.ndarray]  # role -> (n,) float64, finite
    history: dict[str, np.ndarray]  # "T_za", "zeta" where given -> (n,) float64, NaN where missing
    index: pd.Index  # the caller's own index, for outputs
    time: pd.DatetimeIndex  # local wall-clock time, without zone; assumed where the table has no stamps
    utc: pd.DatetimeIndex | None  # stamps in UTC; None where the table has no stamps
    step: pd.Timedelta  # the sampling time
    n_history: int = 0  # first rows, which are the end of a training table
    breaks: tuple[int, ...] = (0,)  # first rows of the segments of consecutive rows
    order: tuple[str, ...] = ()  # roles in the order of the caller's columns
    named: bool = True  # whether the caller named the roles; an array has them by position
    holidays: Holidays = NO_HOLIDAYS

    @cached_property
    def n_rows(self) -> int:
        return len(self.index)

    @property
    def stamps(self) -> Stamps:
        return Stamps(self.index, self.time, self.utc)

    @property
    def step_hours(self) -> float:
        return self.step / pd.Timedelta("1h")

    @property
    def roles(self) -> list[str]:
        """Roles of the columns, in the caller's order."""
        here = {**self.inputs, **self.history}
        return [role for role in self.order if role in here] + [role for role in here if role not in self.order]

    @property
    def day_of_week(self) -> np.ndarray:
        """Kind of day (n,): Monday is 0, a Sunday or holiday 6."""
        return self.holidays.day_of_week(self.time)

    @property
    def weekend(self) -> np.ndarray:
        """Whether a row lies on a weekend day or a holiday, (n,) bool."""
        return self.holidays.weekend(self.time)

    def measured(self, role: str = "T_za") -> np.ndarray:
        """A measured series, NaN where it is missing or the table has none, (n,) float64."""
        return self.history.get(role, np.full(self.n_rows, np.nan))

    def hours_run(self, role: str) -> float:
        """Full-load hours of a plant, whose full load is the most that it gave [h]."""
        away = np.abs(self.inputs[role])
        most = float(away.max(initial=0.0))
        return float(away.sum()) / most * self.step_hours if most > 0.0 else 0.0

    def hardly_ran(self, role: str) -> bool:
        """Whether a role is a plant that ran too little to tell what its heat does."""
        return is_plant(role) and self.hours_run(role) < _FEW_HOURS

    def replace(self, **changes: Any) -> ZoneTable:
        """A copy with some fields replaced."""
        return replace(self, **changes)

    def rows(self, chosen: slice) -> ZoneTable:
        """The chosen consecutive rows, as views."""
        inputs, history = ({role: v[chosen] for role, v in part.items()} for part in (self.inputs, self.history))
        shown, time, utc = self.stamps.rows(chosen)
        return self.replace(inputs=inputs, history=history, index=shown, time=time, utc=utc, n_history=0, breaks=(0,))

    def owned(self) -> ZoneTable:
        """A copy in arrays of its own, which keeps no longer table in memory."""
        inputs, history = ({role: v.copy() for role, v in part.items()} for part in (self.inputs, self.history))
        return self.replace(inputs=inputs, history=history)

    @property
    def segments(self) -> tuple[ZoneTable, ...]:
        """The segments of consecutive rows, one table per segment."""
        if len(self.breaks) == 1:
            return (self,)
        ends = (*self.breaks[1:], self.n_rows)
        return tuple(self.rows(slice(a, b)) for a, b in zip(self.breaks, ends, strict=True))

    def follows(self, earlier: ZoneTable | None) -> bool:
        """Whether this table begins where ``earlier`` ended."""
        if earlier is None or self.utc is None or earlier.utc is None or self.step != earlier.step:
            return False
        return self.utc[0] == earlier.utc[-1] + self.step


def concatenate_tables(tables: Sequence[ZoneTable]) -> ZoneTable:
    """Join tables that follow each other; inputs that one lacks are dropped, history that one lacks is NaN there."""
    last = tables[-1]
    shared = [role for role in last.inputs if all(role in table.inputs for table in tables)]
    kept = {role for table in tables for role in table.history}
    return last.replace(
        inputs={role: np.concatenate([table.inputs[role] for table in tables]) for role in shared},
        history={role: np.concatenate([table.measured(role) for table in tables]) for role in sorted(kept)},
        **dict(zip(("index", "time", "utc"), joined_stamps([table.stamps for table in tables]), strict=True)),
        n_history=0,
        breaks=(0,),
    )


def append_tables(first: ZoneTable, second: ZoneTable) -> ZoneTable:
    """Join two tables by :func:`concatenate_tables`; the rows of ``first`` count as history."""
    return concatenate_tables([first, second]).replace(n_history=first.n_rows)


def last_rows(tables: Sequence[ZoneTable], n_rows: int) -> ZoneTable:
    """The last ``n_rows`` rows of tables that follow each other; all rows where there are fewer."""
    chosen: list[ZoneTable] = []
    for table in reversed(tables):
        if chosen and n_rows <= 0:
            break
        chosen.insert(0, table if table.n_rows <= n_rows else table.rows(slice(table.n_rows - n_rows, None)))
        n_rows -= table.n_rows
    return concatenate_tables(chosen)


def refuse_gap(table: ZoneTable) -> None:
    """Raise a ValueError that names the stamps around the first gap, where there is one."""
    if len(table.breaks) > 1:
        before, after = table.index[table.breaks[1] - 1], table.index[table.breaks[1]]
        raise ValueError(f"X has a gap: {before} is followed by {after}; give one segment at a time.")


def refuse_other_clock(table: ZoneTable, training: ZoneTable) -> None:
    """Raise a ValueError where only one of two tables has time stamps, for their hours of the day do not compare."""
    if (table.utc is None) != (training.utc is None):
        raise ValueError("X has time stamps and the training table has none, or the reverse; give both or neither.")


def read_table(
    estimator: Any,
    X: Any,
    *,
    columns: Mapping[str, Any] | None = None,  # overrides the names; None as a column: left out on purpose
    required: Iterable[str] = (),  # roles that a table with names must have
    needed: Callable[[str], object] | None = None,  # inputs whose role it rejects are not read
    sampling_time: Any = None,  # step of a table without time stamps
    reset: bool,  # True in ``fit``
    min_rows: int = 1,
    expected_step: pd.Timedelta | None = None,  # step of the training table; another one is refused
    gaps: bool = False,  # whether gaps of three hours or more are accepted
    history_roles: Iterable[str] = HISTORY_ROLES,  # known in the past only; values may be missing
    holidays: Any = None,  # a country, a state or dates; None: those of a ZoneTable
) -> ZoneTable:
    """Read ``X`` by the data contract; a ValueError names the column, the stamp or the step, and what to do.

    With ``reset`` the estimator gets ``n_features_in_`` and ``feature_names_in_``; otherwise X is checked against
    them.  Columns of a frame are found by role, those of an array by position (``T_oa``, ``q_sol``, ``u_2``, ``u_3``
    ...).  A ZoneTable is already parsed: its roles are only selected.
    """
    wanted = _Request(columns, required, needed, gaps, frozenset(history_roles), reset, min_rows)
    if isinstance(X, ZoneTable):
        table = _select(estimator, X, wanted)
    else:
        table = _parse(estimator, X, wanted, (sampling_time, expected_step))
    if expected_step is not None and table.step != expected_step:
        raise ValueError(
            f"X has a sampling time of {spell(table.step)}, but {type(estimator).__name__} was fitted at "
            f"{spell(expected_step)}; resample it with skhybrid.datasets.regularize."
        )
    if not reset:  # what was learned by hour and day holds in the time zone and with the holidays of the training
        training = getattr(estimator, "training_", None)
        table = table.replace(time=clock_of_training(table.stamps, training))
        holidays = getattr(training, "holidays", holidays)
    return table if holidays is None else table.replace(holidays=read_holidays(holidays, table.index))


class _Request(NamedTuple):
    """The arguments of :func:`read_table` that select what is read."""

    columns: Mapping[str, Any] | None
    required: Iterable[str]
    needed: Callable[[str], object] | None
    gaps: bool
    history_roles: frozenset[str]
    reset: bool
    min_rows: int

    def reads(self, role: str) -> bool:
        return self.needed is None or bool(self.needed(role))

    def known_roles(self, estimator: Any) -> list[str]:
        """Roles of the training table; empty in ``fit``, and where none of its columns had the name of a role."""
        known = [] if self.reset else roles_as_fitted(self.columns, getattr(estimator, "feature_names_in_", ()))
        own = bool(known) and self.columns == getattr(estimator, "columns", None)
        trained = getattr(getattr(estimator, "training_", None), "ranges", {}) if own else {}
        return [*known, *(role for role in trained if role not in known)]  # ``columns`` may have changed since ``fit``

    def refuse_absent(self, known: list[str], present: Iterable[str], names: Mapping[str, Any], here: Any) -> None:
        """Refuse a table that lacks an input of the training table; history it need not have."""
        absent = [role for role in known if role not in {*present, *self.history_roles} and self.reads(role)]
        if absent:
            name = names.get(absent[0], absent[0])
            if name is None or name in here:
                raise ValueError(f"columns= gives role {absent[0]!r} of the training table no column of its own.")
            raise ValueError(f"X has no column {name!r}, which the training table has; it has {listed(here)}.")


def read_array(estimator: Any, X: Any, **checks: Any) -> np.ndarray:
    """X (n_samples, n_features) as float64 by scikit-learn's checks, NaN where a mask hides it; words are refused."""
    try:
        return np.asarray(validate_data(estimator, unmasked(X, "X"), dtype=np.float64, **checks))
    except (TypeError, ValueError) as error:
        if not any(words in str(error) for words in ("could not convert", "NAType")):
            raise
        raise ValueError(f"X is not numeric ({error}); convert it to float first.") from None


def _parse(estimator: Any, X: Any, wanted: _Request, steps: tuple[Any, pd.Timedelta | None]) -> ZoneTable:
    """Parse the frame or array of a caller; once per public call."""
    given, X = X, as_pandas(X)
    if isinstance(X, pd.DataFrame):
        refuse_shape(X, wanted.min_rows)
        by_role = _columns_by_name(estimator, X, wanted)
        values = {role: role_numbers(X[column], role) for role, column in by_role.items()}
        names = {role: repr(column) for role, column in by_role.items()}
        index, named = X.index, any(role_of(role) == column for role, column in by_role.items()) or bool(wanted.columns)
    else:
        array = read_array(
            estimator, X, reset=wanted.reset, ensure_all_finite=False, ensure_min_samples=wanted.min_rows
        )
        if wanted.known_roles(estimator):  # the columns of an array stand as in the training table
            return _parse(estimator, pd.DataFrame(array, columns=estimator.feature_names_in_), wanted, steps)
        chosen = columns_by_position(array.shape[1], wanted.columns)
        values = {role: array[:, j] for role, j in chosen.items()}
        names = {role: str(j) for role, j in chosen.items()}
        index, named = pd.RangeIndex(len(array)), bool(wanted.columns)
    shown = (X, "X" if X is given else "X.to_pandas()") if isinstance(X, pd.DataFrame) else (None,)
    step, time, utc, breaks = read_index(index, *steps, wanted.gaps, *shown)
    past = wanted.history_roles & set(values)
    history = {role: read_history(v, names[role], index) for role, v in values.items() if role in past}
    ahead = {role: v for role, v in values.items() if role not in past and wanted.reads(role)}
    inputs = {role: read_input(v, names[role], index) for role, v in ahead.items()}
    trained = {} if wanted.reset else getattr(getattr(estimator, "training_", None), "ranges", {})
    for role, v in {**inputs, **history}.items():
        check_range(v, role, f"column {names[role]}", index, named=named, trained=trained.get(role), measured=True)
    return ZoneTable(inputs, history, index, time, utc, step, breaks=breaks, order=tuple(values), named=named)


def _columns_by_name(estimator: Any, X: pd.DataFrame, wanted: _Request) -> dict[str, Any]:
    """The column of each role; without ``reset`` those of the training table, in its order, wherever they stand in X.

    Frames whose columns have no role are held to the order of the training table, as scikit-learn does.
    """
    known, columns = wanted.known_roles(estimator), wanted.columns or {}
    if known:
        places = {role: columns.get(role, role) for role in [*known, *sorted(wanted.history_roles)]}
        found = {role: c for role, c in places.items() if c in X and (role in columns or c not in columns.values())}
    else:
        validate_data(estimator, X, reset=wanted.reset, skip_check_array=True)
        found = columns_by_role(X, wanted.columns, wanted.required)
        known = [] if wanted.reset else [*getattr(getattr(estimator, "training_", None), "ranges", ())]
    wanted.refuse_absent(known, found, columns, X.columns)
    return found


def _select(estimator: Any, table: ZoneTable, wanted: _Request) -> ZoneTable:
    """Select what an estimator reads from a table that is already parsed."""
    columns = wanted.columns or {}
    absent = missing_roles(wanted.required, columns, table.roles)
    if absent:
        raise ValueError(f"role {absent[0]!r} is missing: the table has {listed(table.roles)}.")
    if table.n_rows < wanted.min_rows:
        raise ValueError(f"the table has {table.n_rows} row(s), but at least {wanted.min_rows} are required.")
    if not wanted.gaps:
        refuse_gap(table)
    if wanted.reset:
        estimator.feature_names_in_ = np.array(table.roles, dtype=object)
        estimator.n_features_in_ = len(table.roles)
    known = wanted.known_roles(estimator)
    wanted.refuse_absent(known, table.roles, {}, table.roles)
    values = {**table.inputs, **table.history}
    values = {role: v for role, v in values.items() if columns.get(role, role) is not None}
    values = {role: v for role, v in values.items() if not known or role in {*known, *wanted.history_roles}}
    history = {role: v for role, v in values.items() if role in wanted.history_roles}
    inputs = {role: v for role, v in values.items() if role not in history and wanted.reads(role)}
    for role in table.history:
        if role in inputs:  # history may have missing values, an input may not
            read_input(inputs[role], repr(role), table.index)
    return table.replace(inputs=inputs, history=history)


def read_target(y: Any, table: ZoneTable, *, max_missing: Any = 0.5, role: str | None = None) -> np.ndarray:
    """(n_samples,) float64 target, NaN where missing, never infinite.

    Refused where it is None, has other rows than the table, or all or more than ``max_missing`` of it is missing; with
    a ``role`` also values beyond its range, a history of that role in X that is not y, and an input that is y.
    """
    if y is None:
        raise ValueError("This estimator requires y to be passed, but the target y is None.")
    y = as_pandas(y, "y")
    target = target_numbers(y)
    if len(target) != table.n_rows:
        raise ValueError(
            f"Found input variables with inconsistent numbers of samples: X has {table.n_rows} rows, y {len(target)}."
        )
    if isinstance(y, pd.Series | pd.DataFrame):
        refuse_order(y.index, table.index)
    refuse_infinite(target, "y", table.index)
    if learns := max_missing not in (UNLIMITED, SCORED):
        refuse_missing(target, max_missing)
    if role is not None:
        check_range(target, role, "y", table.index, named=table.named, warns=role not in table.history, measured=True)
        if role in table.history:
            refuse_other_quantity(table.history[role], target, role, scores=max_missing is SCORED)
        if role.startswith("T_"):
            if learns:
                warn_if_still(target, table.step)
            by_position = None if table.named else {column: j for j, column in enumerate(table.order)}
            refuse_target_among(table.inputs, target, columns=by_position)
        elif learns:
            warn_if_temperature(table.history, target)
    return target


def read_targets(y: Any, table: ZoneTable, roles: tuple[str, ...], *, max_missing: Any = 0.5) -> np.ndarray:
    """(n_samples,) target of one role or (n_samples, n_roles), by role from a frame; see :func:`read_target`."""
    if len(roles) == 1 or y is None:
        return read_target(y, table, max_missing=max_missing, role=roles[0])
    y = as_pandas(y, "y")
    frame = y if isinstance(y, pd.DataFrame) else pd.DataFrame(as_numbers(y, "y"))
    named = frame is y and set(roles) <= set(frame.columns)
    if not named and frame.shape[1] != len(roles):
        raise ValueError(f"y has shape {np.shape(y)}, but several temperatures are measured: give {', '.join(roles)}.")
    columns: list[Any] = [frame[role] if named else frame.iloc[:, j] for j, role in enumerate(roles)]
    columns = columns if frame is y else [column.to_numpy() for column in columns]
    read = {r: read_target(c, table, max_missing=max_missing, role=r) for c, r in zip(columns, roles, strict=True)}
    refuse_exchanged(table.history, read)
    return np.column_stack(list(read.values()))
