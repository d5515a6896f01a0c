"""Back-tests: forecasts from every origin of a table, with the measurements of the same rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import _num_samples, check_is_fitted

from .._arguments import check_bool
from .._ranges import check_range
from .._rolling import RollingForecastMixin
from .._table import (
    ZoneTable,
    as_numbers,
    float_columns,
    listed,
    predicted_by,
    refuse_exchanged,
    refuse_infinite,
    refuse_order,
    refuse_other_quantity,
)
from .._time import assumed_clock, even_step, positive_duration, read_instant, rows_of, spell, wall_clock
from .._warnings import several
from ..forecasting.features import target_rows
from ..forecasting.quantiles import quantile_levels, read_quantiles
from ..forecasting.weather_error import read_weather_error
from .later_measurements import refuse_later_measurements, unwrapped
from .origin_paths import Asked, columns_from, target_roles
from .single_reading import read_once, reading_of, takes_tables

_DAY = pd.Timedelta("1D")


def backtest(
    estimator: Any,
    X: Any,
    y: Any,
    *,
    horizon: Any = "1D",
    origin_step: Any = "1D",
    start: Any = None,
    quantiles: Sequence[float] | None = None,
    whole: bool = True,
    weather_error: Any = None,
    heat_known: bool = True,
) -> pd.DataFrame:
    """Forecast from every origin and put the measurements next to the forecasts.

    Parameters
    ----------
    estimator : fitted estimator
        With ``predict_from(X, origins, horizon)``; a Pipeline whose last step has it; a search that holds one as
        ``best_estimator_``; or any regressor, whose ``predict(X)`` then counts as the forecast from every origin, and
        which may therefore not read what is measured after an origin: ``T_za``, ``zeta``, or y under another name, in
        another unit, or lagged by less than the horizon.
    X : DataFrame, array-like of shape (n_samples, n_features) or ZoneTable
        Consecutive rows, with ``T_za`` as history; a forecast reads history only up to its origin.  After the
        rows that a hybrid predictor or a BuildingPredictor knows, it goes on from them, as in use.
    y : Series or array-like of shape (n_samples,) or (n_samples, 1), or (n_samples, n_zones) for several zones
        Measured zone temperature [degC]; NaN is kept as it is.
    horizon : timedelta-like, default="1D"
        How far each forecast reaches.
    origin_step : timedelta-like, default="1D"
        Distance of the origins.  If it is a whole number of days or divides a day, origins are counted from the
        first local midnight, by the wall clock; any other step, such as ``"25h"``, is counted from the first row.
    start : timestamp or int, optional
        The earliest origin (a row number for an array).  Rows before it are history only; origins are counted from
        the first midnight, or row, at or after it.
    quantiles : sequence of float, optional
        Quantiles to forecast as well, in (0, 1), increasing; they need an estimator with ``predict_quantiles_from``.
    whole : bool, default=True
        Whether to leave out the origins whose horizon does not end in X; else the rows that are there count.
    weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
        Replace the weather after each origin by a forecast with such errors
        (:class:`~skhybrid.forecasting.WeatherError`), and widen the intervals by what they do; None: the weather in X
        is known in advance.
    heat_known : bool, default=True
        Whether the heat in X is known in advance; else its set-points are, a learned thermostat acts, and the load is
        forecast too (a hybrid predictor or a BuildingPredictor).

    Returns
    -------
    DataFrame
        One row per origin and lead: ``origin`` and ``time`` (stamps, or row numbers for an array), ``lead``
        (Timedelta), ``y_true`` and ``y_pred`` [degC], and ``q_0.1`` ... [degC] for the quantiles.  Of several zones
        also ``zone``.  With ``heat_known=False`` also, over the step before ``time``, ``Q_hvac_pred`` and
        ``Q_hvac_true`` (or stages by role), and ``Q_hvac_0.1`` ... [kW]; NaN in zones without them.

    Raises
    ------
    ValueError
        If the lengths of X and y differ, y is beyond what a room can have, or is not ``T_za`` of X, a duration is not a
        multiple of the sampling time, ``start`` is not of the kind of the rows, X is too short for a forecast or has no
        midnight, the estimator forecasts no quantiles, one without ``predict_from`` reads what is measured after an
        origin, or with ``heat_known=False`` it has learned no thermostat, or set-points are missing.

    Warns
    -----
    UnitWarning
        If y is likely in another unit.
    """
    check_is_fitted(estimator)
    check_bool("whole", whole)
    check_bool("heat_known", heat_known)
    forecaster, table = unwrapped(estimator, X)
    if quantiles is not None and not hasattr(forecaster, "predict_quantiles_from"):
        raise ValueError(f"{type(forecaster).__name__} forecasts no quantiles; leave quantiles=None.")
    quantiles = None if quantiles is None else read_quantiles(quantiles).tolist()
    zones = [role.removeprefix("T_za_") for role in target_roles(forecaster)]
    truth = _truth(X, y, zones)
    stamps, wall, sampling = _clock(forecaster, X)
    if isinstance(forecaster, RollingForecastMixin):
        check_range(truth.ravel(), forecaster._target_role, "y", stamps.repeat(len(zones)))
    _refuse_other_rows(forecaster, X, table, truth)
    n_leads = rows_of(horizon, sampling)
    origins = _origins(wall, sampling, origin_step, _first_row(stamps, start))
    origins = _with_leads(origins, n_leads if whole else 1, len(wall), sampling)
    asked = Asked(n_leads * sampling, quantiles, read_weather_error(weather_error), heat_known)
    if asked.weather is None and heat_known and not hasattr(forecaster, "predict_from"):
        predicted = predicted_by(forecaster, table)
        refuse_later_measurements(estimator, X, truth[:, 0], predicted, origins, n_leads)
        columns = {"y_pred": predicted[np.minimum(target_rows(origins, n_leads), len(wall) - 1)]}
    else:
        if takes_tables(forecaster):
            table = read_once(table, **reading_of(forecaster), fits=False)
        columns = columns_from(forecaster, table, origins, asked)
    return _in_rows(stamps, origins, asked.horizon, truth, columns, zones)


def _in_rows(
    stamps: pd.Index,
    origins: np.ndarray,
    horizon: pd.Timedelta,
    truth: np.ndarray,
    columns: Mapping[str, np.ndarray],
    zones: Sequence[str],
) -> pd.DataFrame:
    """A row per origin and lead, of each zone, with measurements and columns (n_origins, n_leads) or of each zone."""
    n_leads = next(iter(columns.values())).shape[1]
    ahead = target_rows(origins, n_leads)
    rows, there = np.minimum(ahead, len(stamps) - 1), (ahead < len(stamps)).ravel()
    of_all = {
        "origin": stamps[np.repeat(origins, n_leads)],
        "lead": pd.to_timedelta(np.tile(np.arange(1, n_leads + 1), len(origins)) * (horizon / n_leads)),
        "time": stamps[rows.ravel()],
    }
    of_zones = {name: np.reshape(v, (rows.size, len(zones))) for name, v in {"y_true": truth[rows], **columns}.items()}
    named = [{"zone": zone} for zone in zones] if len(zones) > 1 else [{}]
    made = [
        pd.DataFrame({**of_all, **{name: v[:, k] for name, v in of_zones.items()}, **zone})[there]
        for k, zone in enumerate(named)
    ]
    return pd.concat(made, ignore_index=True)


def score_backtest(frame: pd.DataFrame, by: str | None = None) -> pd.Series | pd.DataFrame:
    """Errors of a back-test.

    Parameters
    ----------
    frame : DataFrame
        From :func:`backtest`; rows without a measurement or a forecast are left out.
    by : {None, "lead", "origin"}, default=None
        What to group by; None gives one number for all forecasts.

    Returns
    -------
    Series or DataFrame
        ``rmse`` and ``mae`` [degC], and the number ``n`` of forecasts compared; with ``by`` one row per lead or origin.
    """
    if by not in (None, "lead", "origin"):
        raise ValueError(f"by={by!r} must be None, 'lead' or 'origin'.")
    pairs = float_columns(frame, ("y_true", "y_pred"), "the back-test")
    error = (pairs["y_pred"] - pairs["y_true"]).rename("error")
    if by is None:
        known = error.dropna().to_numpy()
        rmse, mae = (np.sqrt(np.mean(known**2)), np.mean(np.abs(known))) if len(known) else (np.nan, np.nan)
        return pd.Series({"rmse": rmse, "mae": mae, "n": len(known)})
    if by not in frame:
        raise ValueError(f"the back-test has no column {by!r}; make it with backtest().")
    means = pd.DataFrame({"rmse": error**2, "mae": error.abs()}).groupby(frame[by]).mean()
    return means.assign(rmse=means["rmse"] ** 0.5, n=error.groupby(frame[by]).count())


def score_intervals(frame: pd.DataFrame, by: Any = None) -> pd.Series | pd.DataFrame:
    """Coverage, sharpness and pinball loss of the quantiles of a back-test.

    Parameters
    ----------
    frame : DataFrame
        From :func:`backtest` with ``quantiles``, at least two of them; rows without a measurement are left out.
    by : {None, "lead", "origin"} or array-like of shape (n_rows,), default=None
        What to group by, or a label for each row; None gives one number for all forecasts.

    Returns
    -------
    Series or DataFrame
        ``nominal``, the probability [-] between the lowest and the highest quantile; ``coverage``, the share of
        measurements between them [-]; ``width``, their distance [K]; ``pinball``, the mean loss over all quantiles [K]
        (Koenker & Bassett 1978); and the number ``n`` of forecasts compared.
    """
    levels = quantile_levels(getattr(frame, "columns", ()))
    if len(levels) < 2:
        raise ValueError("the back-test has no interval; make it with backtest(..., quantiles=(0.1, 0.9)).")
    names = list(levels)
    numbers = float_columns(frame, ("y_true", *names), "the back-test")
    known = numbers.notna().all(axis=1)
    seen, lowest, highest = numbers[known], names[0], names[-1]
    y = seen["y_true"]
    losses = [np.maximum(levels[c] * (y - seen[c]), (levels[c] - 1.0) * (y - seen[c])) for c in names]
    scores = pd.DataFrame(
        {
            "nominal": levels[highest] - levels[lowest],
            "coverage": ((y >= seen[lowest]) & (y <= seen[highest])).astype(float),
            "width": seen[highest] - seen[lowest],
            "pinball": sum(losses) / len(losses),
        }
    )
    if by is None:
        return pd.concat([scores.mean(), pd.Series({"n": len(scores)})])
    if isinstance(by, str) and by not in frame:
        raise ValueError(f"by={by!r} is not a column of the back-test; give 'lead' or 'origin'.")
    if not isinstance(by, str) and np.shape(by) != (len(frame),):
        raise ValueError(f"by has the shape {np.shape(by)}; give a label for each of {several(len(frame), 'row')}.")
    keys = frame[by] if isinstance(by, str) else pd.Series(np.asarray(by), index=frame.index)
    groups = scores.groupby(keys[known])
    return groups.mean().assign(n=groups.size())


def _truth(X: Any, y: Any, zones: Sequence[str]) -> np.ndarray:
    """(n_samples, n_zones) measurements of the rows of X, NaN where missing."""
    if isinstance(y, pd.DataFrame) and len(zones) > 1 and not isinstance(y.columns, pd.RangeIndex):
        names = {str(column).removeprefix("T_za_"): column for column in y}
        if absent := [zone for zone in zones if zone not in names]:
            raise ValueError(f"y has no column of zone {absent[0]!r}; name one {absent[0]!r} or 'T_za_{absent[0]}'.")
        y = y[[names[zone] for zone in zones]]
    truth, n_rows = as_numbers(y, "y"), _n_rows(X)
    if truth.shape != (n_rows, len(zones)) and not (len(zones) == 1 and truth.shape == (n_rows,)):
        what = "one value per row" if len(zones) == 1 else f"a column for each of {listed(zones)}"
        raise ValueError(f"X has {n_rows} rows, but y has the shape {truth.shape}; pass {what}.")
    if isinstance(y, pd.Series | pd.DataFrame) and isinstance(getattr(X, "index", None), pd.Index):
        refuse_order(y.index, X.index)
    refuse_infinite(truth, "y", X.index if isinstance(X, pd.DataFrame | ZoneTable) else np.arange(n_rows))
    if np.isnan(truth).all():
        raise ValueError(f"y has no value in {several(n_rows, 'row')}, so that no forecast can be compared with it.")
    return truth.reshape(n_rows, len(zones))


def _refuse_other_rows(forecaster: Any, X: Any, table: Any, truth: np.ndarray) -> None:
    """Refuse measurements (n_samples, n_zones) that are not the past of the same zone in X, as ``score`` does."""
    if hasattr(forecaster, "zones_"):
        forecaster._columns.refuse_exchanged(X, pd.DataFrame(truth, columns=forecaster.zones_))
    elif takes_tables(forecaster):
        measured = dict(zip(target_roles(forecaster), truth.T, strict=True))
        past = {role: _past(forecaster, table, role) for role in measured if role != "zeta"}
        history = {role: values for role, values in past.items() if values is not None}
        for role, values in history.items():
            refuse_other_quantity(values, measured[role], role)
        refuse_exchanged(history, measured)


def _past(forecaster: Any, table: Any, role: str) -> np.ndarray | None:
    """Measurements (n,) of a role in X; None where it has none."""
    column = forecaster._column_of(role)
    if isinstance(table, ZoneTable):
        return table.history.get(role)
    return as_numbers(table[column], f"column {column!r}") if column in getattr(table, "columns", ()) else None


def _clock(forecaster: Any, X: Any) -> tuple[pd.Index, pd.DatetimeIndex, pd.Timedelta]:
    """Names of the rows, their local wall-clock time, and the sampling time."""
    index = getattr(X, "index", None)
    if isinstance(index, pd.DatetimeIndex) and len(index) > 1:
        return index, wall_clock(index), even_step(index)
    given = getattr(forecaster, "sampling_time_", None) or getattr(forecaster, "sampling_time", None)
    if given is None:
        raise ValueError("X has no time stamps, and the estimator no sampling_time; give X a DatetimeIndex.")
    sampling = positive_duration(given, "sampling_time")
    rows = pd.RangeIndex(_n_rows(X))
    return rows, assumed_clock(index if isinstance(index, pd.Index) else rows, sampling), sampling


def _n_rows(X: Any) -> int:
    return X.n_rows if isinstance(X, ZoneTable) else _num_samples(X)


def _first_row(stamps: pd.Index, start: Any) -> int:
    """Number of the first row that is not before ``start``."""
    if start is None:
        return 0
    first = read_instant(start, stamps, "start", "X")
    if not isinstance(stamps, pd.DatetimeIndex):
        return int(stamps.searchsorted(first))
    if first > stamps[-1]:
        such = f"give one, such as {str(stamps[0])!r}."
        raise ValueError(f"start={start!r} comes after the last row of X; {such}")
    return int(stamps.searchsorted(first.as_unit(stamps.unit)))


def _with_leads(origins: np.ndarray, n_leads: int, n_rows: int, sampling: pd.Timedelta) -> np.ndarray:
    """The origins that ``n_leads`` rows follow; refused where there are none."""
    if not len(origins):
        raise ValueError(
            "X has no local midnight (from start on), from which origins are counted; give more rows, or stamps that "
            "fall on midnight (skhybrid.datasets.regularize)."
        )
    found = origins[origins + n_leads < n_rows]
    if not len(found):
        raise ValueError(
            f"X is too short to be forecast: {n_rows - 1 - origins[0]} rows follow the first origin, row {origins[0]}, "
            f"and a forecast over {spell(n_leads * sampling)} needs {n_leads}; give more rows, or an earlier start."
        )
    return found


def _origins(wall: pd.DatetimeIndex, sampling: pd.Timedelta, origin_step: Any, first: int) -> np.ndarray:
    """Rows that are origins, by the rule that :func:`backtest` states."""
    apart = rows_of(origin_step, sampling, "origin_step")
    every = apart * sampling
    if every % _DAY != pd.Timedelta(0) and _DAY % every != pd.Timedelta(0):
        return np.arange(first, len(wall), apart)
    later = wall[first:]
    midnights = np.flatnonzero(later == later.normalize())
    if not len(midnights):
        return np.empty(0, dtype=np.int64)
    later = later[midnights[0] :]
    since = later - later[0]
    on_grid = (since % every == pd.Timedelta(0)) & ~later.duplicated()  # an hour that the clock repeats counts once
    return first + midnights[0] + np.flatnonzero(on_grid)
