"""Columns of a table: their roles, and the checks of their values."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import sparse
from sklearn.utils import check_array, column_or_1d
from sklearn.utils.validation import _num_samples

from ._arguments import as_mapping, is_integer, row_of
from ._warnings import several, warn_user
from .exceptions import RoleWarning

#: role (or its pattern), unit and meaning of every column that an estimator can read
ROLES: tuple[tuple[str, str, str], ...] = (
    ("T_oa", "degC", "outdoor air temperature"),
    ("q_sol", "kW/m2", "solar irradiance on the window, or global horizontal"),
    ("q_sol_<name>", "kW/m2", "a further irradiance input, such as a facade"),
    ("u_heat, u_cool, u_<name>", "-", "mean stage or runtime fraction over the step; its capacity [kW] is a parameter"),
    ("Q_hvac, Q_<name>", "kW", "measured heat into the zone (+ heats)"),
    ("T_heat_set, T_cool_set", "degC", "a thermostat's set-points over the step, known in advance; never a boundary"),
    ("T_<name>", "degC", "a further boundary temperature that the network names"),
    ("T_za", "degC", "the measured zone temperature itself, as history"),
    ("zeta", "kW or degC", "the estimated disturbance, as history"),
)
_ROLE = re.compile(r"(T_\w+|q_sol(_\w+)?|u_\w+|Q_\w+|zeta)\Z")
#: roles that are read only up to a forecast origin; values may be missing
HISTORY_ROLES = ("T_za", "zeta")
_LONGEST_NAME = 40  # characters of a column's name that a message shows
_HUGE = 1e100  # nothing measured is larger; squares of larger numbers overflow
#: roles of a thermostat's heating and cooling set-point
SETPOINT_ROLES = ("T_heat_set", "T_cool_set")


def role_of(name: object) -> str | None:
    """The role of a column by its name, or None."""
    return name if isinstance(name, str) and _ROLE.match(name) else None


def is_history(role: object) -> bool:
    """Whether a role is measured and so known in the past only; ``T_za_<zone>`` is one of the zones of a building."""
    return role in HISTORY_ROLES or str(role).startswith("T_za_")


def is_set_point(role: object) -> bool:
    """Whether a role is a thermostat's set-point, or that of a zone: an input over the step, though a temperature."""
    return str(role).startswith(SETPOINT_ROLES)


def is_instant(role: object) -> bool:
    """Whether a role is a value at its stamp, as temperatures are; anything else acts over the step."""
    return str(role).startswith("T_") and not is_set_point(role)


def is_plant(role: object) -> bool:
    """Whether a role is heating or cooling."""
    return str(role).startswith(("u_", "Q_"))


def is_stage(role: object) -> bool:
    """Whether a role is a stage or a runtime fraction of a plant, whose capacity is a parameter."""
    return str(role).startswith("u_")


def is_cooling(role: object) -> bool:
    """Whether a role is that of cooling alone: a stage, or cold of a meter that is logged as positive."""
    return str(role).startswith(("u_cool", "Q_cool"))


def ending_zone(role: object, zones: Iterable[str]) -> str | None:
    """The zone with whose name a role ends, the longest of several such as ``hall`` and ``big_hall``; else None."""
    return max((zone for zone in zones if str(role).endswith(f"_{zone}")), key=len, default=None)


def plant_roles(roles: Iterable[object]) -> list[str]:
    """Those of heating and cooling."""
    return [str(role) for role in roles if is_plant(role)]


def checked_columns(columns: Mapping[str, Any] | None) -> dict[str, Any]:
    """The parameter ``columns``, which maps roles to columns; empty where it is None."""
    columns = as_mapping("columns", columns, "roles to columns, such as {'T_oa': 'outdoor'}")
    for role, column in columns.items():
        if not isinstance(column, Hashable):
            raise ValueError(f"columns= gives {role!r} the column {column!r}; give one name or position.")
        if role_of(role) is None:
            raise ValueError(
                f"columns= names the role {role!r}, which is not one of {', '.join(r for r, *_ in ROLES)}."
            )
    role_by_column: dict[Any, str] = {}
    for role, column in columns.items():
        if column is not None and (other := role_by_column.setdefault(column, role)) != role:
            raise ValueError(f"columns= gives {other!r} and {role!r} the same column {column!r}; give each its own.")
    return columns


def columns_by_role(X: pd.DataFrame, columns: Mapping[str, Any] | None, required: Iterable[str]) -> dict[str, Any]:
    """The column of each role in a frame."""
    columns = checked_columns(columns)
    for role, column in columns.items():
        if column is not None and column not in X.columns:
            raise ValueError(f"columns= gives {role!r} the column {column!r}, but X has {listed(X.columns)}.")
    taken = {c for c in columns.values() if c is not None}
    by_name = {str(c): c for c in X.columns if role_of(c) and c not in taken and c not in columns}
    found: dict[str, Any] = by_name | {role: c for role, c in columns.items() if c is not None}
    if not found and not columns and not isinstance(X.index, pd.DatetimeIndex):
        warn_user(
            f"no column of X has the name of a role, so they are taken by position ({X.columns[0]!r} as T_oa, ...); "
            "name them or pass columns={role: column}.",
            RoleWarning,
        )
        return {role: X.columns[j] for role, j in columns_by_position(X.shape[1], None).items()}
    absent = missing_roles(required, columns, found)
    if absent:
        raise ValueError(
            f"role {absent[0]!r} is missing: X has {listed(X.columns)}; name a column {absent[0]!r}, pass "
            f"columns={{{absent[0]!r}: 'its column'}}, or {{{absent[0]!r}: None}} to do without it."
        )
    if not found and not columns:
        warn_user(f"no column of X has the name of a role, so none is read: X has {listed(X.columns)}.", RoleWarning)
    return found


def roles_as_fitted(columns: Mapping[str, Any] | None, fitted: Iterable[Any]) -> list[str]:
    """Roles of a training table with the columns ``fitted``; empty where none of them has the name of a role."""
    columns = dict(columns or {})
    role_by_column = {column: role for role, column in columns.items() if column is not None}
    roles = [role_by_column.get(name) or role_of(name) for name in fitted]
    return [role for role in roles if role is not None and columns.get(role, role) is not None]


def missing_roles(required: Iterable[str], columns: Mapping[str, Any], present: Iterable[str]) -> list[str]:
    """Required roles that are neither present nor left out on purpose; a facade's irradiance stands for ``q_sol``."""
    given = {*present, *(role for role, column in columns.items() if column is None)}
    if any(role.startswith("q_sol_") for role in present):
        given.add("q_sol")
    return [role for role in required if role not in given]


def columns_by_position(n_columns: int, columns: Mapping[str, Any] | None) -> dict[str, int]:
    """The position of each role in an array."""
    roles: dict[str, int] = {("T_oa", "q_sol")[j] if j < 2 else f"u_{j}": j for j in range(n_columns)}
    for role, j in checked_columns(columns).items():
        if j is None:
            roles.pop(role, None)
            continue
        if not is_integer(j) or not 0 <= j < n_columns:
            raise ValueError(
                f"columns= gives {role!r} the column {j!r}, but X is an array of {n_columns} columns: give a position."
            )
        roles = {r: k for r, k in roles.items() if k != j} | {role: int(j)}
    return roles


def as_pandas(data: Any, label: str = "X") -> Any:
    """A frame or series of polars, pyarrow and others as one of pandas, whose columns have names; else as it is.

    A series as X, such as ``X.loc[stamp]``, is refused.
    """
    if label == "X" and isinstance(data, pd.Series):
        raise ValueError("X is a Series; give a DataFrame: one row as X.loc[[stamp]], one column as X[[name]].")
    if isinstance(data, pd.DataFrame | pd.Series) or not hasattr(data, "to_pandas"):
        return data
    try:
        return data.to_pandas()
    except Exception as error:  # each library has errors of its own; polars needs pyarrow
        kind = f"{type(data).__module__.partition('.')[0]} {type(data).__name__}"
        why = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
        raise ValueError(
            f"{label} is a {kind} that cannot be converted to pandas ({why}); install pyarrow, or give pandas."
        ) from None


def numeric(column: pd.Series, label: str | None = None) -> np.ndarray:
    """A column as float64, NaN where missing."""
    if column.dtype == np.float64:
        return column.to_numpy(copy=True)
    label = f"column {column.name!r}" if label is None else label
    _refuse_times(column, label)
    try:
        if pd.api.types.is_complex_dtype(column):
            raise ValueError("Complex data not supported")
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{label} is not numeric ({error}); convert it to float first.") from None


def role_numbers(column: pd.Series, role: str, label: str | None = None) -> np.ndarray:
    """The column of a role as :func:`numeric` reads it; True and False, which pandas takes for 1 and 0, are stages."""
    if not is_stage(role) and pd.api.types.infer_dtype(column) == "boolean":
        label = f"column {column.name!r}" if label is None else label
        raise ValueError(f"{label} is true or false, but {role} is not a stage; give numbers.")
    return numeric(column, label)


def float_columns(frame: Any, columns: Iterable[Any], name: str) -> pd.DataFrame:
    """Columns of a frame that is called ``name`` as float64, NaN where missing; refused where one is absent or huge."""
    if not isinstance(frame, pd.DataFrame):
        raise ValueError(f"{name} is a {type(frame).__name__}; give a DataFrame.")
    found = {}
    for column in columns:
        if (n := int((frame.columns == column).sum())) != 1:
            raise ValueError(f"{name} has {n or 'no'} column{'s' * (n > 1)} {column!r}; give one.")
        values = role_numbers(frame[column], str(column), f"column {column!r} of {name}")
        refuse_huge(values, f"column {column!r} of {name}")
        found[column] = values
    return pd.DataFrame(found, index=frame.index, columns=list(found))


def refuse_huge(values: np.ndarray, label: str) -> None:
    """Refuse numbers whose squares could overflow."""
    if (np.abs(values) > _HUGE).any():
        raise ValueError(f"{label} holds numbers beyond 1e100; set to NaN what was not measured.")


def unmasked(values: Any, label: str) -> Any:
    """Values, NaN where a mask hides them; refused where they are None, times, mappings, records or uncomputed."""
    if values is None:
        raise ValueError(f"{label} is None; give a DataFrame or an array.")
    _refuse_times(values, label)
    if isinstance(values, list | tuple) and any(isinstance(row, Mapping) for row in values):
        raise ValueError(f"{label} is a {type(values).__name__} of mappings; make it a table with pd.DataFrame.")
    maps = isinstance(values, Mapping) and not sparse.issparse(values)  # scikit-learn refuses what is sparse
    if maps or getattr(getattr(values, "dtype", None), "names", None) or hasattr(values, "collect"):
        raise ValueError(f"{label} is a {type(values).__name__}; give a DataFrame or an array.")
    if not isinstance(values, np.ma.MaskedArray):
        return values
    return np.where(np.ma.getmaskarray(values), np.nan, _floats(np.ma.getdata(values), label))


def as_numbers(values: Any, label: str) -> np.ndarray:
    """Values as float64, NaN where a mask hides them.

    Refused where they are times, words, True and False, or rows of unequal length; so are digits in quotes, outside of
    a table's columns.
    """
    if not isinstance(values, pd.Series | pd.DataFrame) and _kind(values) in ("U", "S"):
        raise ValueError(f"{label} is text; give numbers.")
    return _floats(unmasked(values, label), label)


def predicted_by(estimator: Any, X: Any) -> np.ndarray:
    """(n_samples,) float64 predictions of anybody's regressor; refused where they are not one number per row of X."""
    label, n_rows = f"what {type(estimator).__name__} predicts", _num_samples(X)
    values = as_numbers(estimator.predict(X), label)
    if values.shape not in ((n_rows,), (n_rows, 1)):
        raise ValueError(f"{label} for {several(n_rows, 'row')} has the shape {values.shape}; return a number per row.")
    return values.reshape(-1)


def target_numbers(y: Any) -> np.ndarray:
    """(n_samples,) float64 copy of a target, NaN where missing or masked."""
    if isinstance(y, pd.DataFrame):
        y = y.iloc[:, 0] if y.shape[1] == 1 else y.to_numpy()  # a name may come twice
    if isinstance(y, pd.Series) and y.dtype != bool:
        y = numeric(y, "y")
    y = unmasked(y, "y")
    checked = check_array(y, ensure_2d=False, dtype=None, ensure_all_finite=False, ensure_min_samples=0, input_name="y")
    if np.iscomplexobj(checked):
        raise ValueError("Complex data not supported: y must be real.")
    _refuse_bools(checked, "y")
    column = column_or_1d(checked, warn=True)
    try:
        return column.astype(np.float64, copy=True)
    except (TypeError, ValueError) as error:
        raise ValueError(f"y is not numeric ({error}); convert it to float first.") from None


def _kind(values: Any) -> str:
    """The kind of NumPy's type for values; empty where they are rows of unequal length."""
    try:
        return np.asarray(values).dtype.kind
    except ValueError:
        return ""


def _floats(values: Any, label: str) -> np.ndarray:
    if _kind(values) == "c":
        raise ValueError(f"Complex data not supported: {label} must be real.")
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{label} is not numeric ({error}); give numbers.") from None
    _refuse_bools(values, label)
    return numbers


def _refuse_bools(values: Any, label: str) -> None:
    """Refuse True and False, which NumPy takes for 1 and 0."""
    if _kind(values) == "b":
        raise ValueError(f"{label} is true or false; give numbers.")


def _refuse_times(values: Any, label: str) -> None:
    if getattr(getattr(values, "dtype", None), "kind", "") in ("m", "M"):
        raise ValueError(
            f"{label} holds times ({values.dtype}), not numbers; make dates the index, drop the column, or divide a "
            "duration by its unit, such as pd.Timedelta('1h')."
        )


def refuse_shape(X: pd.DataFrame, min_rows: int) -> None:
    """Refuse a frame with duplicate columns, without columns or with too few rows."""
    if not X.columns.is_unique:
        twice = X.columns[X.columns.duplicated()][0]
        raise ValueError(f"column {twice!r} appears twice in X; keep one of them.")
    if X.shape[1] == 0:
        raise ValueError(f"0 feature(s) (shape=({len(X)}, 0)) while a minimum of 1 is required.")
    if len(X) < min_rows:
        raise ValueError(f"Found array with {len(X)} sample(s) (n_samples={len(X)}) while {min_rows} are required.")


def refuse_infinite(v: np.ndarray, label: str, index: Any) -> None:
    """Refuse infinite values (n,), of which ``index`` names the rows."""
    bad = np.isinf(v)
    if bad.any():
        raise ValueError(
            f"{label} contains inf in {several(int(bad.sum()), 'row')} (first at {index[int(np.argmax(bad))]}); "
            "set it to NaN where the sensor failed."
        )


def refuse_infinite_columns(X: pd.DataFrame | np.ndarray) -> None:
    """Refuse infinite values in the columns of a frame, or of an array, that hold numbers."""
    if not isinstance(X, pd.DataFrame):
        X = pd.DataFrame(X)
    for name, column in X.items():
        if pd.api.types.is_numeric_dtype(column):
            refuse_infinite(numeric(column), f"column {name!r}", X.index)
        elif column.dtype == object:
            floats = np.array([x if isinstance(x, float) else 0.0 for x in column], dtype=np.float64)
            refuse_infinite(floats, f"column {name!r}", X.index)


def read_input(v: np.ndarray, name: str, index: pd.Index) -> np.ndarray:
    """Check that an input is finite; return a copy."""
    refuse_infinite(v, f"column {name}", index)
    bad = np.isnan(v)
    if len(v) > 1 and bad.all():  # of one row nothing says that the column is of no use
        raise ValueError(f"column {name} is empty: it contains NaN in all {len(v)} rows; give its values, or drop it.")
    if bad.any():
        raise ValueError(
            f"column {name} contains NaN in {several(int(bad.sum()), 'row')} (first at {index[int(np.argmax(bad))]}); "
            "fill short gaps with skhybrid.preprocessing.GapFiller or choose another span."
        )
    return np.array(v, dtype=np.float64)


def read_history(v: np.ndarray, name: str, index: pd.Index) -> np.ndarray:
    """Check that history, which may be missing, is not infinite; return a copy."""
    refuse_infinite(v, f"column {name}", index)
    return np.array(v, dtype=np.float64)


def fill_ahead(X: Any, names: Iterable[Any]) -> tuple[Any, float]:
    """A frame whose columns ``names`` are 0 where they are absent or missing to the end, and the first such row."""
    X = as_pandas(X)
    if not isinstance(X, pd.DataFrame) or not X.columns.is_unique:
        return X, np.inf
    filled, n_known = X.copy(deep=False), np.inf
    for name in names:
        seen = X[name].notna().to_numpy() if name in X else np.zeros(len(X), dtype=bool)
        known = int(np.flatnonzero(seen)[-1]) + 1 if seen.any() else 0
        if known < len(X):
            filled[name] = X[name].where(np.arange(len(X)) < known, 0.0) if known else 0.0
            n_known = min(n_known, known)
    return filled, n_known


def by_name(given: Any, names: Sequence[str], what: str) -> Any:
    """Values of a mapping, a Series or a row of a frame, which have these names, in their order; others as they are."""
    given = row_of(given)
    here = list(given.keys()) if isinstance(given, Mapping | pd.Series) else []
    if not any(isinstance(name, str) for name in here):
        return given
    if sorted(map(str, here)) != sorted(names):
        raise ValueError(f"{what} has the names {listed(here)}; give a value for each of {listed(names)}.")
    return [given[name] for name in names]


def listed(names: Iterable[object], most: int = 12) -> str:
    """Names as text; only the first ``most`` of them, and only the beginning of long ones."""
    shown = [repr(n if len(n) <= _LONGEST_NAME else n[: _LONGEST_NAME - 3] + "...") for n in map(str, names)]
    return "none" if not shown else ", ".join(shown[:most]) + (", ..." if len(shown) > most else "")
