"""HybridPredictor: a gray box driven by a forecast of what nobody measures (paper 3.1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Memory
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.utils.validation import check_is_fitted

from ._clock import ASSUMED_START, origin_rows
from ._contract import ZoneTable, read_table, read_target
from ._rolling import RollingForecastMixin
from ._threads import one_blas_thread
from .forecasting import DisturbanceForecaster
from .forecasting.forecaster import BASELINES
from .identification import PeriodicDisturbanceID
from .thermal import RCNetwork, get_network

#: the disturbance is forecast by hours (paper 3.3)
_HOUR = pd.Timedelta("1h")
#: history kept behind the training table: two weeks, the longest lag of any forecaster
_KEPT = pd.Timedelta("15D")
#: stamps that a table without any is given in ``predict``, so that it follows no training table
_ELSEWHERE = ASSUMED_START + pd.Timedelta(weeks=5200)


class _Bins(NamedTuple):
    """Rows of a table gathered into the steps of the forecaster."""

    frame: pd.DataFrame  # one row a bin, columns by role
    of_row: np.ndarray  # (n_rows,) bin of every row
    first_row: np.ndarray  # (n_bins,) first row of every bin


class HybridPredictor(RollingForecastMixin, RegressorMixin, BaseEstimator):
    """Day-ahead forecast of temperature and load: an identified network driven by a forecast disturbance.

    The gray box is identified, the disturbance that it leaves is estimated (causally, as later in use), gathered into
    hours and learned by the forecaster; a forecast drives the network with the forecast disturbance (paper Eqs.
    ID_hybrid and od_hybrid).

    Parameters
    ----------
    gray_box : estimator, optional
        An identification of this package; default ``PeriodicDisturbanceID()``.
    forecaster : estimator, optional
        A regressor of the disturbance; default ``DisturbanceForecaster(model="ridge")`` with the same horizon.
    disturbance : {"input", "output"}, default="input"
        Whether the disturbance is heat on the zone [kW] or an addition to its temperature [K].
    horizon : timedelta-like, default="1D"
        How far ahead ``predict`` looks; None forecasts from the first row on.
    adapt : {None, "linear", "full"}, default="linear"
        What a forecast takes in from the history up to its origin.  None: the state and the recent disturbance.
        ``"linear"``: for every full week of history behind the training table a linear forecaster or baseline is also
        re-fitted on training and history; networks and other regressors stay as trained.  ``"full"``: the network is
        not re-identified yet, so it acts as ``"linear"``.
    memory : str or joblib.Memory, optional
        Where identifications are kept, so that candidates of a search that share one identify it once.
    n_jobs : int, optional
        Passed to parts that take it and have none.
    random_state : int, RandomState or None
        Passed to parts that take it and have none.
    verbose : int, default=0
        1 shows progress.
    columns : dict of role to column, optional
        Columns whose names are not their roles; default is the gray box's own ``columns``.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; default is the gray box's own.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.

    Attributes
    ----------
    gray_box_ : estimator
        The identified network.
    forecaster_ : estimator
        The fitted disturbance model.
    sampling_time_, disturbance_step_ : Timedelta
        Steps of the table and of the disturbance.
    zeta_ : Series
        The training disturbance by steps of the forecaster [kW or K].

    Examples
    --------
    >>> from skhybrid import HybridPredictor
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=14, random_state=0)
    >>> model = HybridPredictor(random_state=0).fit(office.X[:-96], office.y[:-96])
    >>> tomorrow = model.predict(office.X[-96:])
    >>> tomorrow.shape
    (96,)
    """

    def __init__(
        self,
        gray_box=None,
        forecaster=None,
        *,
        disturbance="input",
        horizon="1D",
        adapt="linear",
        memory=None,
        n_jobs=None,
        random_state=None,
        verbose=0,
        columns=None,
        sampling_time=None,
        origin_step=None,
        max_missing=0.5,
    ):
        self.gray_box = gray_box
        self.forecaster = forecaster
        self.disturbance = disturbance
        self.horizon = horizon
        self.adapt = adapt
        self.memory = memory
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose
        self.columns = columns
        self.sampling_time = sampling_time
        self.origin_step = origin_step
        self.max_missing = max_missing

    # --------------------------------------------------------------------------------------------------------- fit
    @one_blas_thread
    def fit(self, X: Any, y: Any) -> HybridPredictor:
        """Identify the network, estimate its disturbance, learn to forecast it.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows by the data contract.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            As the parts do, if ``disturbance`` or ``adapt`` is unknown, and if the network has several measured nodes.
        """
        if self.disturbance not in ("input", "output"):
            raise ValueError(f"disturbance={self.disturbance!r} is neither 'input' nor 'output'.")
        if self.adapt not in (None, "linear", "full"):
            raise ValueError(f"adapt={self.adapt!r} is none of None, 'linear', 'full'.")
        gray_box = self._part(self.gray_box, self._default_gray_box())
        network = get_network(gray_box.network)
        if len(network.measured_nodes) > 1:
            raise ValueError(
                f"network {network.name} has several measured temperatures; HybridPredictor "
                "forecasts one zone, so fit the identification itself."
            )
        forecaster = self._part(self.forecaster, self._default_forecaster())
        table = self._read(X, reset=True)
        target = read_target(y, table, max_missing=self.max_missing, role="T_za")
        self._check_spans(table.step)
        frame = _frame(table.replace(history={"T_za": target}), ASSUMED_START)
        given = dict(self._columns() or {})
        dark = "q_sol" not in table.inputs and (not isinstance(X, pd.DataFrame) or given.get("q_sol", "") is None)
        fitted = _memory(self.memory).cache(_fit_gray_box)(gray_box, frame, target, {"q_sol": None} if dark else None)
        self.gray_box_ = fitted
        self.sampling_time_, self.disturbance_step_ = table.step, _disturbance_step(table.step)
        causal = fitted.estimate_disturbance(frame, kind=self.disturbance)
        bins = _gather(frame.assign(zeta=causal), self.disturbance_step_)
        self.zeta_ = bins.frame["zeta"]
        rows = bins.frame.drop(columns="T_za", errors="ignore")
        self.forecaster_ = forecaster.fit(rows, rows["zeta"])
        self._rows = rows
        self._mean = float(np.nanmean(target)) if np.isfinite(target).any() else 20.0
        self._keep(table, target, causal.to_numpy())
        return self

    def set_params(self, **params: Any) -> HybridPredictor:
        """Set parameters, also those of parts (``forecaster__case``), of the default part where none was given.

        Parameters
        ----------
        **params : dict

        Returns
        -------
        self
        """
        for name, make in (("gray_box", self._default_gray_box), ("forecaster", self._default_forecaster)):
            if getattr(self, name) is None and name not in params and any(p.startswith(f"{name}__") for p in params):
                setattr(self, name, make())
        return super().set_params(**params)

    def _default_gray_box(self) -> PeriodicDisturbanceID:
        return PeriodicDisturbanceID()

    def _default_forecaster(self) -> DisturbanceForecaster:
        return DisturbanceForecaster(model="ridge", horizon=self.horizon or "1D")

    def _part(self, given: Any, default: Any) -> Any:
        """A clone of a part, with what it can take over from this estimator."""
        part = clone(given if given is not None else default)
        params = part.get_params(deep=False)
        passed = {"n_jobs": self.n_jobs, "random_state": self.random_state, "verbose": self.verbose or None}
        wanted = {k: v for k, v in passed.items() if k in params and not params[k] and v is not None}
        return part.set_params(**wanted)

    def _keep(self, table: ZoneTable, target: np.ndarray, zeta: np.ndarray) -> None:
        n = min(table.n_rows, int(_KEPT / table.step))
        tail = table.rows(slice(table.n_rows - n, None))
        inputs = {role: v.copy() for role, v in tail.inputs.items()}
        self._tail = tail.replace(inputs=inputs, history={"T_za": target[-n:].copy(), "zeta": zeta[-n:].copy()})

    # ----------------------------------------------------------------------------------------------- tables at hand
    def _read(self, X: Any, *, reset: bool) -> ZoneTable:
        step = self.sampling_time if self.sampling_time is not None else getattr(self.gray_box, "sampling_time", None)
        return read_table(
            self,
            X,
            columns=self._columns(),
            required=self._network().required_roles,
            needed=self._reads,
            sampling_time=step,
            reset=reset,
            min_rows=2 if reset else 1,
            expected_step=None if reset else self.sampling_time_,
        )

    def _reads(self, role: str) -> bool:
        """Weather and plant, and of further boundary temperatures those that the network names."""
        return not role.startswith("T_") or role == "T_oa" or self._network().reads(role)

    def _network(self) -> RCNetwork:
        return get_network(getattr(self.gray_box, "network", "2R2C"))

    def _columns(self) -> Mapping[str, Any] | None:
        return self.columns if self.columns is not None else getattr(self.gray_box, "columns", None)

    def _read_X(self, X: Any) -> ZoneTable:
        table = self._read(X, reset=False)
        # a measured disturbance is not a thing that this estimator reads
        return table.replace(history={k: v for k, v in table.history.items() if k == "T_za"})

    def _cold_value(self, table: ZoneTable) -> float:
        return self._mean if table.T_za is None or not np.isfinite(table.T_za[0]) else float(table.T_za[0])

    # ----------------------------------------------------------------------------------------------------- forecast
    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        n_tail = table.n_history
        here = _frame(table.rows(slice(n_tail, None)), _ELSEWHERE)
        paths = self._disturbance_paths(table, here, origins, n_leads)
        return self.gray_box_.drive(here, origins - n_tail, paths, kind=self.disturbance)

    @property
    def _shift(self) -> int:
        """Rows from an origin to the first disturbance wanted: heat of a row acts over its own step."""
        return 0 if self.disturbance == "input" else 1

    def _disturbance_paths(self, table: ZoneTable, here: pd.DataFrame, origins: np.ndarray, n_leads: int) -> np.ndarray:
        """(n_origins, n_leads) forecast disturbance as the gray box takes it, by rows of the table.

        An input disturbance of a row acts over its step, so it is wanted from the origin's own row on; an output
        disturbance from the row behind it.
        """
        n_tail = table.n_history
        zeta = np.full(table.n_rows, np.nan)
        if n_tail:
            zeta[:n_tail] = self._tail.history["zeta"]
        # before the first measurement of X nothing is estimated, and whether one comes later must not be known
        seen = np.logical_or.accumulate(np.isfinite(here["T_za"].to_numpy()))
        if seen.any():
            estimate = self.gray_box_.estimate_disturbance(here, kind=self.disturbance)
            zeta[n_tail:] = np.where(seen, estimate, np.nan)
        frame = _frame(table, _ELSEWHERE).assign(zeta=zeta).drop(columns="T_za")
        bins = _gather(_with_row_before(frame, self.disturbance_step_), self.disturbance_step_)
        lead_in = len(bins.of_row) - table.n_rows
        known = bins.of_row[origins + lead_in] - 1  # the last bin that ended before the origin
        rows = origins[:, None] + self._shift + np.arange(n_leads)
        wanted = bins.of_row[np.minimum(rows, table.n_rows - 1) + lead_in] - known[:, None] - 1
        steps = int(wanted.max()) + 1
        ahead = np.empty((len(origins), steps))
        for forecaster, chosen in self._forecasters(bins, known):
            paths = forecaster.predict_from(bins.frame, known[chosen], horizon=steps * self.disturbance_step_)
            ahead[chosen] = pd.DataFrame(paths).ffill(axis=1).to_numpy()
        return np.take_along_axis(ahead, np.maximum(wanted, 0), axis=1)

    def _forecasters(self, bins: _Bins, known: np.ndarray) -> Iterator[tuple[Any, np.ndarray]]:
        """The forecaster of each origin: as trained, or re-fitted on the full weeks since the training ended."""
        week = int(pd.Timedelta("7D") / self.disturbance_step_)
        first = int(np.sum(bins.frame.index <= self._rows.index[-1]))
        weeks = np.maximum(known + 1 - first, 0) // week
        if self.adapt is None or not _refits_fast(self.forecaster_):
            weeks[:] = 0
        for count in np.unique(weeks):
            chosen = np.flatnonzero(weeks == count)
            if count == 0:
                yield self.forecaster_, chosen
                continue
            rows = _joined_rows(self._rows, bins.frame.iloc[first : first + count * week], self.disturbance_step_)
            yield clone(self.forecaster_).fit(rows, rows["zeta"]), chosen

    def forecast(self, history: pd.DataFrame, future: pd.DataFrame) -> pd.DataFrame:
        """Forecast from the last row of a history.

        Parameters
        ----------
        history : DataFrame
            Rows up to the origin, with ``T_za``; where it continues the training table, that is taken as its history.
        future : DataFrame
            The rows to forecast, with the known future inputs; it begins one step after the history.

        Returns
        -------
        DataFrame
            Index of ``future``; ``T_za`` [degC] at each stamp and ``zeta`` [kW, or K for an output disturbance] over
            the step that begins there.

        Raises
        ------
        ValueError
            If the two do not join evenly or a column is missing.
        """
        check_is_fitted(self)
        if not len(history) or not len(future):
            raise ValueError("history and future need at least one row each.")
        stamps = _in_zone_of(future.index, history.index)
        names = list(getattr(self, "feature_names_in_", history.columns))
        absent = [n for n in names if n not in future.columns and n in history.columns]
        past = {"T_za", (self._columns() or {}).get("T_za", "T_za")}
        if [n for n in absent if n not in past]:
            raise ValueError(f"future has no column {next(n for n in absent if n not in past)!r}, which history has.")
        whole = pd.concat([history, future.reindex(columns=history.columns).set_axis(stamps)])
        for name in past & set(whole.columns):
            whole[name] = whole[name].where(np.arange(len(whole)) < len(history))
        table, n_tail = self._with_history(whole)
        origin = np.array([n_tail + len(history) - 1])
        here = _frame(table.rows(slice(n_tail, None)), _ELSEWHERE)
        paths = self._disturbance_paths(table, here, origin, len(future) + 1)
        temperature = self.gray_box_.drive(here, origin - n_tail, paths[:, :-1], kind=self.disturbance)
        zeta = paths[0, :-1] if self._shift else paths[0, 1:]
        return pd.DataFrame({"T_za": temperature[0], "zeta": zeta}, index=future.index)

    # ---------------------------------------------------------------------------------------------------------- load
    def predict_load(self, X: Any, setpoint: Any, limits: tuple[float, float] | None = None) -> pd.DataFrame:
        """Heating and cooling that brings the temperature to a set-point, under the forecast disturbance.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Heating and cooling columns are read up to each origin only; after it they are what is sought.
        setpoint : float or array-like of shape (n_samples,)
            Wanted temperature at each row's stamp [degC].
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; by default the capacity of its stages, and no limit where only
            its heat is measured.

        Returns
        -------
        DataFrame of length n_samples
            Stages [-] by role and ``Q_hvac`` [kW], clipped to what the plant can do, the same with ``_unclipped`` as
            the set-point would need (paper Eq. inverseQ2), and ``zeta`` as forecast.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        local = table.rows(slice(n_tail, None))
        here = _frame(local, _ELSEWHERE)
        origins = origin_rows(local.time, self.horizon, self.origin_step, local.step)
        counts = np.diff(np.append(origins, local.n_rows))
        paths = self._disturbance_paths(table, here, origins + n_tail, int(counts.max()))
        wanted = np.asarray(setpoint, dtype=np.float64)
        if isinstance(setpoint, pd.Series) and isinstance(X, pd.DataFrame) and not setpoint.index.equals(X.index):
            raise ValueError("setpoint bears other time stamps than X; align it with setpoint.reindex(X.index).")
        load = self.gray_box_.required_heat(here, wanted, origins, paths, kind=self.disturbance, limits=limits)
        zeta = np.concatenate([path[:count] for path, count in zip(paths, counts, strict=True)])
        return load.set_axis(local.index).assign(zeta=zeta)


def _fit_gray_box(gray_box: Any, frame: pd.DataFrame, target: np.ndarray, columns: Mapping[str, Any] | None) -> Any:
    """Fit on a table by roles; a function of its own, so that ``memory`` can keep it."""
    return gray_box.set_params(columns=columns, sampling_time=None).fit(frame, target)


def _memory(memory: Any) -> Memory:
    return memory if hasattr(memory, "cache") else Memory(location=memory, verbose=0)


def _frame(table: ZoneTable, start: pd.Timestamp) -> pd.DataFrame:
    """A table as a frame by roles, with stamps (from ``start`` where it had none) and a ``T_za`` column."""
    index = table.index if table.utc is not None else pd.DatetimeIndex(start + (table.time - table.time[0]))
    missing = np.full(table.n_rows, np.nan)
    frame = pd.DataFrame({**table.inputs, "T_za": table.history.get("T_za", missing)}, index=index)
    return frame[sorted(frame.columns, key=lambda role: table.order.index(role) if role in table.order else 99)]


def _in_zone_of(future: pd.Index, history: pd.Index) -> pd.Index:
    """The stamps of ``future`` in the time zone of ``history``.

    Raises
    ------
    ValueError
        If only one of the two has a zone.
    """
    if not isinstance(future, pd.DatetimeIndex) or not isinstance(history, pd.DatetimeIndex):
        return future
    if (future.tz is None) != (history.tz is None):
        raise ValueError(f"history has the time zone {history.tz}, future {future.tz}; localize the one without.")
    return future if history.tz is None else future.tz_convert(history.tz)


def _disturbance_step(step: pd.Timedelta) -> pd.Timedelta:
    """An hour where the table's step divides it, else the table's own step."""
    return _HOUR if step < _HOUR and _HOUR % step == pd.Timedelta(0) else step


def _refits_fast(forecaster: Any) -> bool:
    """Whether a forecaster is one of the linear ones, which are re-fitted in a fraction of a second."""
    return isinstance(forecaster, DisturbanceForecaster) and forecaster.model in tuple(BASELINES)


def _joined_rows(old: pd.DataFrame, new: pd.DataFrame, step: pd.Timedelta) -> pd.DataFrame:
    """Training rows and history as one even table.

    Training that ended long before is moved later by whole weeks, which keeps the hour of the week; what is left of the
    gap has no disturbance, so that nothing is learned from it.
    """
    gap = new.index[0] - old.index[-1] - step
    moved = old.set_axis(old.index + pd.Timedelta("7D") * int(gap / pd.Timedelta("7D")))
    whole = pd.concat([moved, new[list(old.columns)]])
    grid = pd.date_range(whole.index[0], whole.index[-1], freq=step)
    if len(grid) == len(whole):
        return whole
    filled = whole.reindex(grid)
    inputs = [c for c in filled.columns if c != "zeta"]
    filled[inputs] = filled[inputs].ffill()
    return filled


def _with_row_before(frame: pd.DataFrame, step: pd.Timedelta) -> pd.DataFrame:
    """The frame behind one more step of rows, whose disturbance is unknown: a forecast needs a row to stand on."""
    index = pd.DatetimeIndex(frame.index)
    own = index[1] - index[0] if len(index) > 1 else step
    count = max(1, int(step / own))
    stamps = index[0] - own * np.arange(count, 0, -1)
    first = pd.concat([frame.iloc[[0]]] * count).set_axis(pd.DatetimeIndex(stamps)).assign(zeta=np.nan)
    return pd.concat([first, frame])


def _gather(frame: pd.DataFrame, step: pd.Timedelta) -> _Bins:
    """Means by steps of the forecaster."""
    index = pd.DatetimeIndex(frame.index)
    utc = index.tz_convert("UTC") if index.tz is not None else index
    stamps = utc.floor(step) if len(index) < 2 or utc[1] - utc[0] < step else utc
    begins = np.append(True, stamps[1:] != stamps[:-1])
    of_row, first_row = np.cumsum(begins) - 1, np.flatnonzero(begins)
    hours = frame.groupby(of_row).mean()
    labels = stamps[first_row]
    return _Bins(hours.set_axis(labels.tz_convert(index.tz) if index.tz is not None else labels), of_row, first_row)
