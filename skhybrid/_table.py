"""The data contract: what a table of consecutive time steps must look like.

A row is a time step, a column has a role (see :data:`ROLES`).  This is the only module that validates tables; every
estimator reads its input through :func:`read_table` and :func:`read_target`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils import check_array, column_or_1d
from sklearn.utils.validation import validate_data

from ._time import read_index, spell
from .exceptions import RoleWarning, UnitWarning, warn_user

#: role (a pattern), unit and meaning of every column that an estimator may read.
ROLES: tuple[tuple[str, str, str], ...] = (
    ("T_oa", "degC", "outdoor air temperature"),
    ("q_sol", "kW/m2", "solar irradiance on the window, or global horizontal"),
    ("q_sol_<name>", "kW/m2", "a further irradiance input, such as a facade"),
    ("u_heat, u_cool, u_<name>", "-", "mean stage or runtime fraction over the step; its capacity [kW] is a parameter"),
    ("Q_hvac, Q_<name>", "kW", "measured heat into the zone (+ heats)"),
    ("T_<name>", "degC", "a further boundary temperature that the network names"),
    ("T_za", "degC", "the measured zone temperature itself, as history"),
    ("zeta", "kW or degC", "the estimated disturbance, as history"),
)
_ROLE = re.compile(r"(T_\w+|q_sol(_\w+)?|u_\w+|Q_\w+|zeta)\Z")
#: roles that hold the past only: read up to a forecast origin, NaN allowed.
HISTORY_ROLES = ("T_za", "zeta")
_DAY = pd.Timedelta("1D")


@dataclass(frozen=True)
class ZoneTable:
    """A validated table of evenly spaced time steps, in one stretch or several."""

    inputs: dict[str, np.ndarray]  # role -> (n,) float64, finite
    history: dict[str, np.ndarray]  # "T_za", "zeta" where given -> (n,) float64, NaN where missing
    index: pd.Index  # the caller's own index, for outputs
    time: pd.DatetimeIndex  # local wall-clock time, without zone; assumed where the table has no stamps
    utc: pd.DatetimeIndex | None  # stamps in UTC; None where the table has no stamps
    step: pd.Timedelta  # the sampling time
    n_history: int = 0  # rows at the front that are the end of a training table
    breaks: tuple[int, ...] = (0,)  # first rows of the stretches of consecutive rows
    order: tuple[str, ...] = ()  # roles in the order of the caller's columns

    @property
    def n_rows(self) -> int:
        return len(self.index)

    @property
    def step_hours(self) -> float:
        return self.step / pd.Timedelta("1h")

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
    def pieces(self) -> tuple[ZoneTable, ...]:
        """The stretches of consecutive rows, each a table of its own."""
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
    """``second`` behind ``first``; inputs that either lacks are dropped, missing history is NaN."""
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
    X : DataFrame or array-like of shape (n_samples, n_features)
        A frame's columns are found by role, an array's by position (``T_oa``, ``q_sol``, ``u_2``, ``u_3`` ...).
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
        Whether the rows may come in stretches with three hours or more between them.
    history_roles : iterable of str
        Roles that hold the past only.

    Raises
    ------
    ValueError
        In one sentence that names the column, the stamp or the step and says what to do.
    """
    if isinstance(X, pd.DataFrame):
        _refuse_shape(X, min_rows)
        validate_data(estimator, X, reset=reset, skip_check_array=True)
        by_role = _columns_by_role(X, columns, required)
        values = {role: _numeric(X[column], column) for role, column in by_role.items()}
        names = {role: repr(column) for role, column in by_role.items()}
        index = X.index
    else:
        array = validate_data(
            estimator, X, reset=reset, dtype=np.float64, ensure_all_finite=False, ensure_min_samples=min_rows
        )
        chosen = _positions(array.shape[1], columns)
        values = {role: array[:, j] for role, j in chosen.items()}
        names = {role: str(j) for role, j in chosen.items()}
        index = pd.RangeIndex(len(array))
    step, time, utc, breaks = read_index(index, sampling_time, default_step, expected_step, gaps)
    inputs, history = {}, {}
    past = set(history_roles)
    for role, v in values.items():
        if role in past:
            history[role] = _history(v, names[role], index)
        elif needed is None or needed(role):
            inputs[role] = _finite(v, names[role], index)
    if reset:
        _warn_units({**inputs, **history}, names)
    if expected_step is not None and step != expected_step:
        raise ValueError(
            f"X has a sampling time of {spell(step)}, but {type(estimator).__name__} was fitted at "
            f"{spell(expected_step)}; resample it with skhybrid.datasets.regularize."
        )
    return ZoneTable(inputs, history, index, time, utc, step, order=tuple(values), breaks=breaks)


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
    if role is not None and role not in table.history:
        _warn_units({role: target}, {role: "y"})
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


# ----------------------------------------------------------------------------------------------------------- columns
def role_of(name: object) -> str | None:
    """The role that a column bears by its name, or None."""
    return name if isinstance(name, str) and _ROLE.match(name) else None


def _known_roles(columns: Mapping[str, Any] | None) -> dict[str, Any]:
    columns = dict(columns or {})
    for role in columns:
        if role_of(role) is None:
            raise ValueError(f"columns= names the role {role!r}, which is none of {', '.join(r for r, *_ in ROLES)}.")
    return columns


def _columns_by_role(X: pd.DataFrame, columns: Mapping[str, Any] | None, required: Iterable[str]) -> dict[str, Any]:
    columns = _known_roles(columns)
    for role, column in columns.items():
        if column is not None and column not in X.columns:
            raise ValueError(f"columns= gives {role!r} the column {column!r}, but X has {_listed(X.columns)}.")
    taken = {c for c in columns.values() if c is not None}
    by_name = {str(c): c for c in X.columns if role_of(c) and c not in taken and c not in columns}
    found: dict[str, Any] = by_name | {role: c for role, c in columns.items() if c is not None}
    if not found and not columns and not isinstance(X.index, pd.DatetimeIndex):
        warn_user(
            f"no column of X bears a role's name, so they are taken by position ({X.columns[0]!r} as T_oa, ...); "
            "name them or pass columns={role: column}.",
            RoleWarning,
        )
        return {role: X.columns[j] for role, j in _positions(X.shape[1], None).items()}
    absent = [r for r in required if r not in found and columns.get(r, r) is not None]
    absent = [r for r in absent if not (r == "q_sol" and any(f.startswith("q_sol_") for f in found))]
    if absent:
        raise ValueError(
            f"role {absent[0]!r} is missing: X has {_listed(X.columns)}; name a column {absent[0]!r}, pass "
            f"columns={{{absent[0]!r}: 'its column'}}, or {{{absent[0]!r}: None}} to do without."
        )
    return found


def _positions(n_columns: int, columns: Mapping[str, Any] | None) -> dict[str, int]:
    roles: dict[str, int] = {("T_oa", "q_sol")[j] if j < 2 else f"u_{j}": j for j in range(n_columns)}
    for role, j in _known_roles(columns).items():
        if j is None:
            roles.pop(role, None)
            continue
        if not isinstance(j, int | np.integer) or not 0 <= j < n_columns:
            raise ValueError(
                f"columns= gives {role!r} the column {j!r}, but X is an array of {n_columns} columns: give a position."
            )
        roles = {r: k for r, k in roles.items() if k != j} | {role: int(j)}
    return roles


def _numeric(column: pd.Series, name: object) -> np.ndarray:
    try:
        if pd.api.types.is_complex_dtype(column):
            raise ValueError("Complex data not supported")
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise ValueError(f"column {name!r} is not numeric ({error}); convert it to float first.") from None


def _refuse_shape(X: pd.DataFrame, min_rows: int) -> None:
    if not X.columns.is_unique:
        twice = X.columns[X.columns.duplicated()][0]
        raise ValueError(f"column {twice!r} stands twice in X; keep one of them.")
    if X.shape[1] == 0:
        raise ValueError(f"0 feature(s) (shape=({len(X)}, 0)) while a minimum of 1 is required.")
    if len(X) < min_rows:
        raise ValueError(f"Found array with {len(X)} sample(s) (n_samples={len(X)}) while {min_rows} are required.")


def _finite(v: np.ndarray, name: str, index: pd.Index) -> np.ndarray:
    bad = ~np.isfinite(v)
    if bad.any():
        kind = " or ".join(k for k, there in (("NaN", np.isnan(v)), ("inf", np.isinf(v))) if there.any())
        raise ValueError(
            f"column {name} contains {kind} in {int(bad.sum())} rows (first at {index[int(np.argmax(bad))]}); "
            "fill short gaps with skhybrid.preprocessing.GapFiller or choose another span."
        )
    return np.ascontiguousarray(v, dtype=np.float64)


def _history(v: np.ndarray, name: str, index: pd.Index) -> np.ndarray:
    bad = np.isinf(v)
    if bad.any():
        raise ValueError(
            f"column {name} contains inf in {int(bad.sum())} rows (first at {index[int(np.argmax(bad))]}); "
            "set it to NaN where the sensor failed."
        )
    return np.array(v, dtype=np.float64)


def _warn_units(values: dict[str, np.ndarray], names: dict[str, str]) -> None:
    for role, v in values.items():
        known = v[np.isfinite(v)]
        if not len(known):
            continue
        low, high = float(known.min()), float(known.max())
        likely = None
        if role.startswith("T_") and (high > 200):
            likely = "K rather than degC"
        elif role.startswith("T_") and (high > 55 or float(np.median(known)) > 42):
            likely = "degF rather than degC"
        elif role.startswith("q_sol") and high > 2.0:
            likely = "W/m2 rather than kW/m2"
        elif role.startswith("u_") and high > 4.0:
            likely = "percent rather than a fraction or stage"
        elif role.startswith("Q_") and max(abs(low), abs(high)) > 5000.0:
            likely = "W rather than kW"
        if likely:
            warn_user(
                f"column {names[role]} (role {role}) ranges from {low:.4g} to {high:.4g}: likely {likely}; "
                "convert it with skhybrid.preprocessing.UnitConverter.",
                UnitWarning,
            )


def _listed(names: Iterable[object], most: int = 12) -> str:
    shown = [repr(str(n)) for n in names]
    return "no columns" if not shown else ", ".join(shown[:most]) + (", ..." if len(shown) > most else "")
