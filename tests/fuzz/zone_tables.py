"""Strategies for zone tables with gaps, sentinels, odd types, indices and clocks, and for calls that take them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from decimal import Decimal
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from hypothesis import strategies as st
from scipy import sparse
from sklearn.utils import Bunch

from skhybrid.datasets import make_office

COLUMNS = ("T_oa", "q_sol", "u_heat", "u_cool", "T_za")
WITH_SETPOINTS = (*COLUMNS, "T_heat_set", "T_cool_set")
ZONE, NEXT_DAY = "Europe/Amsterdam", "2024-10-26"  # the clock goes back on the day after


@cache
def training() -> Bunch:
    """Nine days of the synthetic office, hourly; the day after them is ``NEXT_DAY``."""
    office = make_office(n_days=9, random_state=0, sampling_time="1h", start="2024-10-17")
    whole = office.X.join(office.setpoints)[list(WITH_SETPOINTS)].tz_localize(ZONE)
    return Bunch(X=whole[list(COLUMNS)], y=office.y.set_axis(whole.index), with_setpoints=whole)


# ------------------------------------------------------------------------------------------ values and their types
VALUES = {"NaN": np.nan, "inf": np.inf, "-inf": -np.inf, "1e-300": 1e-300, "0": 0.0, "85": 85.0}
#: fill values of loggers and files, which no sensor has measured
SENTINELS = {"-9999": -9999.0, "-999": -999.0, "9999": 9999.0, "9.97e36": 9.97e36, "1e300": 1e300, "-1e300": -1e300}
OTHER_UNIT: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "degF": lambda v: 1.8 * v + 32.0,
    "K": lambda v: v + 273.15,
    "x1000": lambda v: 1e3 * v,
    "x100": lambda v: 1e2 * v,
    "negated": lambda v: -v,
    "standardised": lambda v: (v - v.mean()) / (v.std() or 1.0) if len(v) else v,
    "constant": lambda v: np.full(len(v), v[0]) if len(v) else v,
    "reversed": lambda v: v[::-1].copy(),
}
WHERE: dict[str, slice] = {
    "in the middle": slice(None),  # replaced by one row in `_spoilt`
    "first": slice(0, 1),
    "last": slice(-1, None),
    "every seventh": slice(3, None, 7),
    "all": slice(None),
}
TYPES: dict[str, Callable[[pd.Series], Any]] = {
    **{name: (lambda s, name=name: s.astype(name)) for name in ("float32", "float16", "object", "Float64", "complex")},
    **{name: (lambda s, name=name: s.round().fillna(0).clip(-100, 100).astype(name)) for name in ("int64", "int8")},
    "bool": lambda s: s > s.mean(),
    "boolean NA": lambda s: (s > s.mean()).astype("boolean").mask(np.arange(len(s)) == 2),
    "Int64 NA": lambda s: s.round().clip(-100, 100).astype("Int64").mask(np.arange(len(s)) == 2),
    "string NA": lambda s: s.astype(str).astype("string").mask(np.arange(len(s)) == 2),
    "text": lambda s: s.astype(str),
    "words": lambda s: pd.Series("warm", index=s.index),
    "category": lambda s: s.round().astype("category"),
    "dates": lambda s: pd.Series(pd.date_range("2024-01-01", periods=len(s), freq="h"), index=s.index),
    "durations": lambda s: pd.Series(pd.to_timedelta(np.arange(len(s)), unit="s"), index=s.index),
    "decimals": lambda s: pd.Series([Decimal(str(v)) for v in s], index=s.index, dtype=object),
    "lists": lambda s: pd.Series([[v] for v in s], index=s.index, dtype=object),
    "None": lambda s: pd.Series([None] * len(s), index=s.index, dtype=object),
    "sparse": lambda s: s.astype(pd.SparseDtype("float64", 0.0)),
}
#: types of a column that are no numbers
NO_NUMBERS = ("dates", "durations")
ROWS: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "one row is missing": lambda X: X.drop(X.index[len(X) // 2 : len(X) // 2 + 1]),
    "half a day is missing": lambda X: (
        X.iloc[np.r_[: len(X) // 3, len(X) // 3 + 12 : len(X)]] if len(X) > 40 else X.iloc[:-1]
    ),
    "a row occurs twice": lambda X: X.iloc[np.r_[: len(X) // 2 + 1, len(X) // 2 : len(X)]] if len(X) else X,
    "backwards": lambda X: X.iloc[::-1],
    "shuffled": lambda X: X.iloc[np.random.default_rng(0).permutation(len(X))],
    "a stamp is late": lambda X: X.set_axis(X.index.where(np.arange(len(X)) != 5, X.index + pd.Timedelta("20s"))),
    "a stamp is missing": lambda X: X.set_axis(X.index.where(np.arange(len(X)) != 5)),
    "one stamp": lambda X: X.set_axis(X.index[[0] * len(X)]),
}
INDEX: dict[str, Callable[[pd.DatetimeIndex], Any]] = {
    "wall clock": lambda i: i.tz_localize(None),
    "seconds": lambda i: i.as_unit("s"),
    "text": lambda i: i.astype(str),
    "objects": lambda i: i.astype(object),
    "periods": lambda i: i.tz_localize(None).to_period("h"),
    "durations": lambda i: i - i[0] if len(i) else i,
    "rows": lambda i: pd.RangeIndex(len(i)),
    "later rows": lambda i: pd.RangeIndex(7, 7 + len(i)),
    "shuffled rows": lambda i: pd.Index(np.random.default_rng(0).permutation(len(i))),
    "floats": lambda i: pd.Index(np.arange(len(i)) / 4.0),
    "words": lambda i: pd.Index([f"row {k}" for k in range(len(i))]),
    "two levels": lambda i: pd.MultiIndex.from_product([["zone"], i]),
    "dates": lambda i: i.date,
}
NAMES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "other order": lambda X: X.iloc[:, ::-1],
    "one more": lambda X: X.assign(note=1.0),
    "words too": lambda X: X.assign(note="fine"),
    "a stage too": lambda X: X.assign(u_fan=0.5),
    "a facade too": lambda X: X.assign(q_sol_east=0.1),
    "a neighbour too": lambda X: X.assign(T_next=20.0),
    "measured heat": lambda X: X.assign(Q_hvac=1.0),
    "disturbance too": lambda X: X.assign(zeta=0.5),
    "time as a column": lambda X: X.assign(time=X.index),
    "twice the same": lambda X: pd.concat([X, X.iloc[:, :1]], axis=1),
    "numbers": lambda X: X.set_axis(range(X.shape[1]), axis=1),
    "numbers and words": lambda X: X.set_axis([*X.columns[:-1], 7][: X.shape[1]], axis=1),
    "two levels": lambda X: X.set_axis(pd.MultiIndex.from_product([["zone"], X.columns]), axis=1),
    "capitals": lambda X: X.rename(columns=str.upper),
    "None": lambda X: X.set_axis([None, *X.columns[1:]][: X.shape[1]], axis=1),
}
CONTAINER: dict[str, Callable[[pd.DataFrame], Any]] = {
    "array": lambda X: X.to_numpy(),
    "float32 array": lambda X: X.select_dtypes("float64").to_numpy().clip(-1e38, 1e38).astype(np.float32),
    "object array": lambda X: X.to_numpy(dtype=object),
    "list": lambda X: X.to_numpy().tolist(),
    "masked array": lambda X: np.ma.masked_array(X.to_numpy(), mask=np.arange(X.size).reshape(X.shape) % 11 == 0),
    "array with an empty mask": lambda X: np.ma.masked_array(X.to_numpy(), mask=np.zeros(X.shape, bool)),
    "records": lambda X: X.to_records(),
    "series": lambda X: X.iloc[:, 0] if X.shape[1] else pd.Series(dtype=float),
    "3-D": lambda X: X.to_numpy()[None],
    "1-D": lambda X: X.to_numpy().ravel(),
    "dict": lambda X: X.to_dict("list"),
    "sparse matrix": lambda X: sparse.csr_matrix(X.select_dtypes("float64").to_numpy()),
    "text": lambda X: "X",
    "None": lambda X: None,
}
TARGET: dict[str, Callable[[pd.Series], Any]] = {
    "series": lambda y: y,
    "array": lambda y: y.to_numpy(),
    "list": lambda y: y.tolist(),
    "frame": lambda y: y.to_frame(),
    "column": lambda y: y.to_numpy()[:, None],
    "two columns": lambda y: np.column_stack([y, y]),
    "other stamps": lambda y: y.set_axis(y.index + pd.Timedelta("1D")) if isinstance(y.index, pd.DatetimeIndex) else y,
    "shuffled rows": lambda y: y.set_axis(np.random.default_rng(0).permutation(len(y))),
    "rows": lambda y: y.reset_index(drop=True),
    "short": lambda y: y.iloc[:-1],
    "None": lambda y: None,
    "masked array": lambda y: np.ma.masked_array(y.to_numpy(), mask=np.arange(len(y)) % 5 == 0),
    "number": lambda y: 21.0,
    **{f"some {name}": (lambda y, v=v: y.mask(np.arange(len(y)) % 9 == 4, v)) for name, v in VALUES.items()},
    **{f"some {name}": (lambda y, v=v: y.mask(np.arange(len(y)) % 9 == 4, v)) for name, v in SENTINELS.items()},
    "all NaN": lambda y: y * np.nan,
    **{name: (lambda y, f=f: pd.Series(f(y.to_numpy()), index=y.index)) for name, f in OTHER_UNIT.items()},
    **{f"as {name}": f for name, f in TYPES.items()},
    "x1e200": lambda y: y * 1e200,
}
#: what cannot be the temperature of the same table
NOT_THE_TEMPERATURE = (
    "degF", "K", "x1000", "x100", "negated", "standardised", "reversed", "shuffled rows", "x1e200", "as dates",
    "as durations", *(f"some {name}" for name in SENTINELS),
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class _Shown:
    """A dataclass whose repr shows only what is not default, so that an example is as short as it can be."""

    def __repr__(self) -> str:
        changed = [(f.name, getattr(self, f.name)) for f in fields(self) if getattr(self, f.name) != f.default]
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in changed)})"


@dataclass(frozen=True, repr=False)
class Spoilt(_Shown):
    """Values of a column that are replaced, or another unit or type of the column."""

    column: str = "T_oa"
    change: str = "NaN"  # a key of VALUES, SENTINELS, OTHER_UNIT or TYPES
    where: str = "in the middle"


@dataclass(frozen=True, repr=False)
class Table(_Shown):
    """Ingredients of a table; :meth:`make` makes it."""

    n_rows: int = 48
    step: str = "1h"
    start: str = NEXT_DAY
    zone: str | None = ZONE
    columns: tuple[str, ...] = COLUMNS
    spoilt: tuple[Spoilt, ...] = ()
    rows: str | None = None
    index: str | None = None
    names: str | None = None
    container: str | None = None

    def frame(self) -> pd.DataFrame:
        """The table as a frame with stamps, before its index, its names and its container change."""
        office = training().with_setpoints
        values = office.to_numpy()[np.arange(self.n_rows) % len(office)]
        index = pd.date_range(self.start, periods=self.n_rows, freq=self.step, tz=self.zone)
        X = pd.DataFrame(values, columns=list(WITH_SETPOINTS), index=index)[list(self.columns)]
        for spoilt in self.spoilt:
            if spoilt.column in X:
                X[spoilt.column] = _spoil(X[spoilt.column], spoilt)
        return X if self.rows is None else ROWS[self.rows](X)

    def odd(self, X: pd.DataFrame) -> Any:
        """A frame, with the odd index, names and container of this table."""
        X = X if self.index is None else X.set_axis(pd.Index(INDEX[self.index](X.index)))
        X = X if self.names is None else NAMES[self.names](X)
        try:
            return X if self.container is None else CONTAINER[self.container](X)
        except ValueError:  # there are no such records
            return X

    def temperature(self) -> pd.Series:
        """The temperature that was measured in these rows [degC], whatever the column ``T_za`` says."""
        whole = Table(self.n_rows, self.step, self.start, self.zone, rows=self.rows).frame()
        return whole["T_za"].rename("y")

    def lies(self, roles: tuple[str, ...]) -> bool:
        """Whether a column of ``roles`` holds what it cannot hold: it must be refused, wherever it is read."""
        if self.names is not None or self.index is not None or not self.n_rows:
            return False
        if self.container == "masked array":
            return self.n_rows > 1
        return any(
            s.column in roles and s.column in self.columns and (s.change in SENTINELS or s.change in NO_NUMBERS)
            for i, s in enumerate(self.spoilt)
            if s.column not in {later.column for later in self.spoilt[i + 1 :]}
            and _holds(s.where, self.n_rows)
            and self.rows is None
            and self.container is None
        )


def _holds(where: str, n_rows: int) -> bool:
    return n_rows > 7 or where != "every seventh"


def _spoil(column: pd.Series, spoilt: Spoilt) -> Any:
    values = np.array(column, dtype=np.float64) if column.dtype == np.float64 else np.full(len(column), 20.0)
    if spoilt.change in TYPES:
        return TYPES[spoilt.change](pd.Series(values, index=column.index))
    if spoilt.change in OTHER_UNIT:
        return OTHER_UNIT[spoilt.change](values)
    middle = len(values) // 2
    chosen = slice(middle, middle + 1) if spoilt.where == "in the middle" else WHERE[spoilt.where]
    values[chosen] = (VALUES | SENTINELS)[spoilt.change]
    return values


# ---------------------------------------------------------------------------------------------------------- strategies
def usually(first: Any, others: Any, share: int = 4) -> st.SearchStrategy[Any]:
    """Mostly ``first``, else one of the others; ``share`` to one, and towards ``first`` an example shrinks."""
    others = list(others)
    return st.integers(0, share).flatmap(lambda k: st.just(first) if k < share else st.sampled_from(others))


_CHANGE = st.one_of(*(st.sampled_from(list(kinds)) for kinds in (VALUES, SENTINELS, OTHER_UNIT, TYPES)))
_ZONES = (None, "UTC", "America/Chicago", "Asia/Kolkata", "Australia/Lord_Howe", "+05:30", "-11:00")
_STEPS = ("15min", "30min", "1min", "2h", "7min", "10s", "1D", "1ns", "25h")
_STARTS = ("2024-10-17", "2024-10-20", "2024-10-26 01:00", "2024-03-30", "1700-01-01", "2250-12-30", "2024-10-26 00:07")


@st.composite
def tables(
    draw: st.DrawFn,
    sizes: tuple[int, ...] = (48, 24, 5, 1, 0, 2, 3, 60, 216),
    columns: tuple[str, ...] = COLUMNS,
) -> Table:
    """Tables of which most have one or two oddities, so that each of them is seen by more than the first check."""
    one = st.builds(Spoilt, st.sampled_from(columns), _CHANGE, st.sampled_from(list(WHERE)))
    spoilt = draw(st.lists(one, min_size=0, max_size=2))
    fewer = st.lists(st.sampled_from(columns), min_size=0, max_size=5, unique=True).map(tuple)
    plain = st.just(columns)
    return Table(
        draw(usually(sizes[0], sizes[1:])),
        draw(usually("1h", _STEPS, 8)),
        draw(usually(NEXT_DAY, _STARTS, 3)),
        draw(usually(ZONE, _ZONES, 6)),
        draw(st.one_of(plain, plain, plain, st.just(tuple(name for name in columns if name != "T_za")), fewer)),
        tuple(spoilt),
        draw(usually(None, ROWS, 12)),
        draw(usually(None, INDEX, 12)),
        draw(usually(None, NAMES, 12)),
        draw(usually(None, CONTAINER, 12)),
    )
