"""Rows of a zone of a fleet as its model reads them: the target apart, short gaps filled, and outages bridged."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._table import is_set_point, listed, numeric, role_of
from .._time import LONGEST_BRIDGE, SHORTEST_GAP, positive_duration
from .._warnings import warn_user
from ..exceptions import SkhybridWarning
from ..hybrid.parts import is_read
from ..preprocessing import GapFiller
from ..preprocessing.bridges import with_known_heat
from ..study.unread_rows import Unread
from .zone_rows import TARGET, read_rows


def read_filled(path: str, model: Any) -> pd.DataFrame:
    """The rows of a file, with short gaps of the inputs filled."""
    return _filled(read_rows(path), model, SHORTEST_GAP)


def rows_to_fit(rows: pd.DataFrame, estimator: Any, last: Any) -> tuple[pd.DataFrame, pd.Series]:
    """X and y of a fit: without the rows after the last measurement, which are plans, and from the last span only."""
    X, y = split_target(rows, estimator)
    known = np.flatnonzero(y.notna().to_numpy())
    if TARGET not in rows and len(known):
        X, y = X.iloc[: known[-1] + 1], y.iloc[: known[-1] + 1]
    if X.empty:
        raise ValueError("there are no rows; write those of the zone, or leave it out.")
    if TARGET not in rows and not len(known):  # where the measured rows end, plans begin
        raise ValueError(
            f"column {target_column(estimator)!r}, the measured temperature, is empty in all {len(X)} rows; see that "
            "it is logged, or leave the zone out."
        )
    if last is not None and isinstance(X.index, pd.DatetimeIndex):
        chosen = X.index > X.index[-1] - positive_duration(last, "last")
        X, y = X[chosen], y[chosen]
    return X, y


def split_target(rows: pd.DataFrame, model: Any) -> tuple[pd.DataFrame, pd.Series]:
    """X and y: the target is apart, or else the column of the measured temperature, which stays in X."""
    if TARGET in rows:
        return rows.drop(columns=TARGET), rows[TARGET].rename("T_za")
    column = target_column(model)
    if column not in rows:
        raise ValueError(
            f"the rows have no column {column!r}, the measured temperature, among {listed(rows.columns)}; name it by "
            "the estimator's columns={'T_za': ...}, or give y."
        )
    return rows, pd.Series(numeric(rows[column]), rows.index, name=column)


def target_column(model: Any) -> Any:
    """The name that the model gives the column of the measured temperature."""
    return (getattr(model, "columns", None) or {}).get("T_za", "T_za")


def rows_over_outages(rows: pd.DataFrame, model: Any, *, forecasts: bool = False) -> pd.DataFrame:
    """Rows with bridges over outages before the last measurement, and without short gaps of any kind.

    Where one ``forecasts``, inputs that end long before the temperatures are refused.
    """
    whole, unread = _without_unread(_filled(_restored(rows, SHORTEST_GAP), model, SHORTEST_GAP), model)
    if unread is not None and not unread.is_step:
        if forecasts:
            unread.refuse_long()
        warn_user(f"{unread}.", SkhybridWarning)
    n_past = _n_past(whole, model)
    return pd.concat([_bridged(whole[:n_past], model), whole[n_past:]])


def _without_unread(rows: pd.DataFrame, model: Any) -> tuple[pd.DataFrame, Unread | None]:
    """Rows without the temperatures after the last row with all inputs, as in the folder of one zone; and these."""
    n_past = _n_past(rows, model)
    unread = None if TARGET in rows else Unread.of(rows[list(input_roles(rows, model))].iloc[:n_past])
    if unread is None:
        return rows, None
    n_known = n_past - unread.n_rows
    if n_past == len(rows):
        return rows.iloc[:n_known], unread
    known = np.arange(len(rows))[:, None] < n_known  # after that the temperature is not, nor is heat without a plan
    return rows.where(known | rows.iloc[n_past:].notna().any().to_numpy()), unread


def _n_past(rows: pd.DataFrame, model: Any) -> int:
    """Number of the rows up to the last measurement of the target."""
    measured = np.flatnonzero(split_target(rows, model)[1].notna().to_numpy())
    return int(measured[-1]) + 1 if len(measured) else 0


def row_after_outage(stamps: pd.Index, least: pd.Timedelta) -> int:
    """The row after the last outage that is too long for a bridge, 0 where there is none.

    Refused where the rows after it span less than the ``least``.
    """
    if not isinstance(stamps, pd.DatetimeIndex) or not ((steps := np.diff(stamps)) > LONGEST_BRIDGE).any():
        return 0
    row = int(np.flatnonzero(steps > LONGEST_BRIDGE)[-1]) + 1
    if stamps[-1] - stamps[row] + steps.min() < least:
        raise ValueError(
            f"there are no rows between {stamps[row - 1]} and {stamps[row]}, and an outage of more than four days is "
            "not bridged; fit the zone again once rows of three days follow it."
        )
    return row


def _bridged(rows: pd.DataFrame, model: Any) -> pd.DataFrame:
    """Rows with bridges over outages: inputs are interpolated there, and no temperature is known."""
    whole = _restored(rows, LONGEST_BRIDGE)
    measured, roles = [c for c in (TARGET, target_column(model)) if c in whole], input_roles(whole, model)
    inputs = list(roles)
    whole[inputs] = with_known_heat(whole[inputs].set_axis(list(roles.values()), axis=1)).to_numpy()
    filled = _filled(whole, model, LONGEST_BRIDGE)
    out = (whole[inputs].isna() & filled[inputs].notna()).any(axis=1)
    filled.loc[out, measured] = np.nan
    return filled


def input_roles(rows: pd.DataFrame, model: Any) -> dict[Any, str]:
    """Columns of weather and plants that a model reads, and their roles."""
    roles = {column: role for role, column in (getattr(model, "columns", None) or {}).items()}
    named = {c: str(roles.get(c, c)) for c in rows if c not in (TARGET, target_column(model))}
    inputs = {column: role for column, role in named.items() if role_of(role) and not is_set_point(role)}
    return {column: role for column, role in inputs.items() if _reads(model, role)}


def _reads(model: Any, role: str) -> bool:
    """True for an input that a model reads: one that it was fitted on, else one that a network of it lets it read."""
    if record := getattr(model, "training_", None):
        return role in record.ranges
    networks = [given for name, given in model.get_params().items() if name.endswith("network")]
    unknown = not networks or getattr(model, "preprocess", None) is not None
    return unknown or any(is_read(role, network) for network in networks)


def _restored(rows: pd.DataFrame, longest: pd.Timedelta) -> pd.DataFrame:
    """Rows with those that are absent for up to the longest gap, as missing ones."""
    index = rows.index
    if not isinstance(index, pd.DatetimeIndex) or len(index) < 3 or not index.is_monotonic_increasing:
        return rows
    ticks = index.as_unit("ns").asi8
    jumps = np.diff(ticks)
    step = int(np.median(jumps))
    if not (jumps > 0).all():  # for the model to refuse
        return rows
    short = (jumps > step) & (jumps <= step + longest.value) & (jumps % step == 0)
    absent = [np.arange(t + step, t + jump, step) for t, jump in zip(ticks[:-1][short], jumps[short], strict=True)]
    if not absent:
        return rows
    stamps = pd.DatetimeIndex(np.concatenate(absent).astype("datetime64[ns]"), tz="UTC").tz_convert(index.tz)
    return rows.reindex(index.union(stamps.as_unit(index.unit)).rename(index.name))


def _filled(rows: pd.DataFrame, model: Any, longest: pd.Timedelta) -> pd.DataFrame:
    """Rows with gaps of inputs filled up to the longest, as readers of logs do; others are for the model to refuse."""
    gaps = [column for column in rows.columns[rows.isna().any()] if column != TARGET]
    if not gaps or not isinstance(rows.index, pd.DatetimeIndex) or not rows.columns.is_unique:
        return rows
    named = {role: column for role, column in (getattr(model, "columns", None) or {}).items() if column in gaps}
    filled = rows.copy()
    filled[gaps] = GapFiller(longest, columns=named).fit_transform(rows[gaps])
    return filled
