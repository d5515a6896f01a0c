"""Work on one zone of a fleet: read its rows, load its model, and keep what has changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.base import clone

from .._clock import in_time_zone, refuse_one_zone
from .._table import is_plant
from .._warnings import warn_user
from ..exceptions import SkhybridWarning, TooFewDaysError
from ..forecasting.quantiles import INTERVAL, quantile_columns
from ..model_selection import backtest
from ..study.changed_units import refuse_changed_units
from .day_errors import forecasts_from_midnight, scored_days
from .journal import Journal
from .model_rows import (
    input_roles,
    read_filled,
    row_after_outage,
    rows_over_outages,
    rows_to_fit,
    split_target,
    target_column,
)
from .model_store import ModelStore
from .plan_ahead import refuse_without_plan
from .zone_rows import fingerprint, read_rows

_LEAST = pd.Timedelta("3D")  # of rows after a long outage, to learn from them alone


def fit_zone(
    zone: str, store: str, paths: Sequence[str], estimator: Any, fallback: Any, last: Any = None
) -> str | None:
    """Fit a clone, unless the store has one of the same rows; why the fallback took over, None where it did not."""
    X, y = rows_to_fit(rows_over_outages(read_rows(paths[0]), estimator), estimator, last)
    if begin := row_after_outage(X.index, _LEAST):
        warn_user(f"learned from {X.index[begin]} on, after an outage of more than four days.", SkhybridWarning)
        X, y = X[begin:], y[begin:]
    mark, models = fingerprint(X, y), ModelStore(store)
    why, days = None, []
    if models.has(zone):
        known = models.journal(zone).facts
        if known["fitted"] == mark and known["updated"] is None and models.is_whole(zone):
            return known["fallback"]
        days = known["days"]
    try:
        model = clone(estimator).fit(X, y)
    except Exception as error:  # whatever it is, the fallback may do
        if fallback is None:
            raise
        why = str(error) or type(error).__name__
        model = clone(fallback).fit(X, y)
    stamped = isinstance(X.index, pd.DatetimeIndex)
    facts: dict[str, Any] = {
        "zone": zone,
        "fitted": mark,
        "updated": None,
        "fallback": why,
        "until": str(X.index[-1]) if stamped else None,
        "training_rmse": _training_error(model, X, y),
        "days": [day for day in days if stamped and day["day"] <= f"{X.index[-1]:%Y-%m-%d}"],
    }
    day = y[X.index > X.index[-1] - pd.Timedelta("1D")] if stamped else y[:0]
    models.save(zone, model, Journal(facts, scored=pd.DataFrame({"y_true": day})))
    return why


def predict_zone(zone: str, store: str, paths: Sequence[str]) -> pd.DataFrame:
    """The forecast of ``predict``, as a table with the column ``T_za`` [degC]."""
    model, journal = ModelStore(store).load(zone)
    X = read_filled(paths[0], model)
    table = _after_known(model, journal, X)
    return pd.DataFrame({"T_za": np.asarray(model.predict(table))[len(table) - len(X) :]}, index=X.index)


def forecast_zone(zone: str, store: str, paths: Sequence[str], given: Mapping[str, Any]) -> pd.DataFrame:
    """The table of ``forecast``; ``paths`` are those of the rows ahead and, where it is given, of the history."""
    model, journal = ModelStore(store).load(zone)
    future, *history = (read_filled(path, model) for path in paths)
    return _forecast(model, journal, history[0] if history else None, future, given)


def score_zone(zone: str, store: str, paths: Sequence[str]) -> pd.DataFrame:
    """The score of a zone, in one row."""
    model, _ = ModelStore(store).load(zone)
    X, y = split_target(read_filled(paths[0], model), model)
    return pd.DataFrame({"score": [model.score(X, y)]})


def backtest_stored(zone: str, store: str, paths: Sequence[str], given: Mapping[str, Any]) -> pd.DataFrame:
    """The table of a back-test."""
    model, _ = ModelStore(store).load(zone)
    X, y = split_target(read_filled(paths[0], model), model)
    return backtest(model, X, y, **given)


def update_zone(zone: str, store: str, paths: Sequence[str]) -> None:
    """Take in rows, unless they are those of the last update."""
    models = ModelStore(store)
    rows = read_rows(paths[0])
    mark = fingerprint(rows)
    if models.journal(zone).facts["updated"] == mark:
        return
    model, journal = models.load(zone)
    X, y = split_target(_in_clock(rows_over_outages(rows, model), journal.scored.index), model)
    if not hasattr(model, "update"):  # which would refuse them itself
        _refuse_known(journal, X)
    _take_in(model, journal, X, y, mark)
    models.keep(zone, model, journal)


class ZoneTick(NamedTuple):
    """The result of a tick for one zone."""

    forecast: pd.DataFrame | None  # None where no rows follow the last measurement
    silent: str | None  # a sentence where nothing new was measured
    first: bool  # whether it is the first since the fit, and nothing new was measured


def tick_zone(zone: str, store: str, paths: Sequence[str]) -> ZoneTick:
    """Take in the rows after the known ones, up to the last measurement, and forecast those after it."""
    models = ModelStore(store)
    model, journal = models.load(zone)
    rows = rows_over_outages(read_rows(paths[0]), model, forecasts=True)
    X, y = split_target(_in_clock(rows, journal.scored.index), model)
    if not isinstance(X.index, pd.DatetimeIndex) or journal.facts["until"] is None:
        raise ValueError("the rows have no time stamps, which a tick needs; use update and forecast.")
    known = _in_clock_of(journal.facts["until"], X.index)
    measured = X.index[y.notna().to_numpy()]
    now = max(measured[-1], known) if len(measured) else known
    new, ahead = (X.index > known) & (X.index <= now), X.index > now
    silent = None if new.any() else f"nothing was measured after {known}, the last known row."
    first = silent is not None and journal.facts["updated"] is None and not len(journal.ahead)
    if silent is None:
        row_after_outage(X.index[new].insert(0, known), pd.Timedelta.max)
        if X.index[0] > known + pd.Timedelta(model.sampling_time_):
            raise ValueError(
                f"the rows begin at {X.index[0]}, but the last known one is {known}; give it and all later."
            )
        _take_in(model, journal, X[new], y[new], fingerprint(X[new]))
    found = None
    if not ahead.any():
        warn_user(f"there is no forecast, since no rows follow {now}; give the weather to come.", SkhybridWarning)
    else:
        rows = X[ahead].drop(columns=target_column(model), errors="ignore")
        weather = {c for c, role in input_roles(rows, model).items() if not is_plant(role)}  # which has to be known
        future = rows[[c for c in rows if c in weather or rows[c].notna().any()]]
        refuse_without_plan(model, future, now)
        found = _forecast(model, journal, None, future, {"quantiles": INTERVAL})
        journal.ahead = _first_forecasts(journal.ahead, found, now)
    if new.any() or ahead.any():
        models.keep(zone, model, journal)
    return ZoneTick(found, silent, first)


def _refuse_known(journal: Journal, X: pd.DataFrame) -> None:
    """Refuse rows that do not come after the known ones: a journal with both could not be read any more."""
    until = journal.facts["until"]
    if X.empty:
        raise ValueError("there are no rows; give those after the known ones.")
    stamps = X.index if isinstance(X.index, pd.DatetimeIndex) else None
    if (stamps is None) != (until is None):
        raise ValueError("these rows or the known ones have time stamps, but not both; give both or neither.")
    if stamps is not None and not stamps[0] > _in_clock_of(until, stamps):
        raise ValueError(f"the rows begin at {X.index[0]}, but the last known one is {until}; give those after it.")


def _take_in(model: Any, journal: Journal, X: pd.DataFrame, y: pd.Series, mark: str) -> None:
    """Score the forecasts of new rows, and let the model know the rows; those in another unit are refused."""
    _refuse_changed_units(model, journal, X, y)
    scored = None
    if isinstance(X.index, pd.DatetimeIndex):
        ahead = journal.ahead
        covered = len(ahead) > 0 and X.index.isin(ahead.index).all()
        if not covered or not hasattr(model, "update"):  # whose predict refuses rows that nothing could follow
            table = _after_known(model, journal, X)
            found = forecasts_from_midnight(model, table).iloc[len(table) - len(X) :]
            ahead = ahead if covered else found
        scored = ahead.reindex(X.index).assign(y_true=y)
    rows = X.assign(**{target_column(model): y})
    if hasattr(model, "update"):
        model.update(rows)
    journal.rows = pd.concat([journal.rows, rows]) if len(journal.rows) else rows
    journal.facts["updated"] = mark
    journal.facts["until"] = str(X.index[-1]) if isinstance(X.index, pd.DatetimeIndex) else None
    if scored is not None:
        journal.scored, journal.facts["days"] = scored_days(journal.scored, scored, journal.facts["days"])


def _refuse_changed_units(model: Any, journal: Journal, X: pd.DataFrame, y: pd.Series) -> None:
    """Refuse new rows in another unit than what the model learned from, as one zone by itself does."""
    record = getattr(model, "training_", None)
    if record is None:  # of a Pipeline, which may convert its columns
        return
    names = {"T_za": "T_za", **(getattr(model, "columns", None) or {})}
    new = X.drop(columns=names["T_za"], errors="ignore").rename(columns={name: role for role, name in names.items()})
    known = journal.scored[["y_true"]].rename(columns={"y_true": "T_za"})
    named = {str(role): repr(names.get(role, role)) for role in (*new, "T_za")}
    refuse_changed_units(new.assign(T_za=y), known, record.ranges, named, "convert them as those before")


def _forecast(
    model: Any, journal: Journal, history: pd.DataFrame | None, future: pd.DataFrame, given: Mapping[str, Any]
) -> pd.DataFrame:
    """Forecast rows ahead, also by an estimator that has only ``predict_from``."""
    given = {name: value for name, value in given.items() if value is not None}
    if hasattr(model, "forecast"):
        try:
            return model.forecast(history, future, **given)
        except TooFewDaysError:
            if given.get("quantiles") is not INTERVAL:
                raise
            return model.forecast(history, future)
    quantiles = given.pop("quantiles", None)
    if given:
        raise ValueError(f"{type(model).__name__} forecasts under given heat only; leave out {', '.join(given)}.")
    past = _in_clock(journal.rows, future.index) if history is None else history
    table = pd.concat([past, future]) if len(past) else future
    asked = {"horizon": len(future) * pd.Timedelta(model.sampling_time_)}
    found = pd.DataFrame({"T_za": model.predict_from(table, [len(past) - 1], **asked)[0]}, index=future.index)
    if quantiles is None or (quantiles is INTERVAL and not hasattr(model, "intervals_")):
        return found
    bands = model.predict_quantiles_from(table, [len(past) - 1], quantiles, **asked)[0]
    return found.join(pd.DataFrame(bands, found.index, quantile_columns(quantiles)))


def _first_forecasts(known: pd.DataFrame, found: pd.DataFrame, now: pd.Timestamp) -> pd.DataFrame:
    """Of each row ahead the forecast that was made first, which looked furthest ahead."""
    new = found.filter(regex=r"^(T_za$|q_)").rename(columns={"T_za": "y_pred"})
    old = known[known.index > now] if len(known) else new[:0]
    return pd.concat([old, new[~new.index.isin(old.index)]])


def _after_known(model: Any, journal: Journal, X: pd.DataFrame) -> pd.DataFrame:
    """The rows of the journal and X as one table, for a model without ``update``; X alone where it is not later."""
    rows = _in_clock(journal.rows, X.index)
    if hasattr(model, "update") or not len(rows) or not len(X) or not X.index[0] > rows.index[-1]:
        return X
    return pd.concat([rows, X])


def _training_error(model: Any, X: pd.DataFrame, y: pd.Series) -> float | None:
    """Root-mean-square error on left-out training days; where there are none, of the fit [K]."""
    try:
        errors = model.left_out_errors().errors
    except (AttributeError, TooFewDaysError):
        errors = np.asarray(model.predict(X)) - np.asarray(y, dtype=np.float64).reshape(len(X), -1).squeeze()
    return float(np.sqrt(np.nanmean(errors**2))) if np.isfinite(errors).any() else None


def _in_clock(rows: pd.DataFrame, index: pd.Index) -> pd.DataFrame:
    """Rows with their stamps in the time zone of an index, where both have one."""
    return rows.set_axis(in_time_zone(rows.index, getattr(index, "tz", None)))


def _in_clock_of(text: str, index: pd.DatetimeIndex) -> pd.Timestamp:
    stamp = pd.Timestamp(text)
    refuse_one_zone(stamp, index, ("the last known row", "these rows"))
    return stamp if stamp.tz is None else stamp.tz_convert(index.tz)
