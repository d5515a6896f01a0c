"""Forecasts from a history and rows ahead, and loads: the heat is given, or a thermostat acts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._joining import read_now, refuse_no_frames
from .._rolling import checked_origins
from .._table import SETPOINT_ROLES, ZoneTable
from .._threads import one_blas_thread
from ..control import Band, Limits, read_limits, read_plant_limits, read_setpoint
from ..exceptions import TooFewDaysError
from ..forecasting.quantiles import load_quantile_columns, quantile_columns, read_quantiles
from ..forecasting.weather_error import read_weather_error, weather_of_quantiles
from .frames_reading import FramesReadingMixin
from .joint_errors import SampleMixin, origin_hours
from .plant_run import PlantRun, Wanted
from .scheme import Paths
from .setpoint_columns import setpoints_in, with_band
from .thermostat_law.closed_loop_paths import ClosedLoopPaths


class FramesForecastMixin(SampleMixin, FramesReadingMixin):
    """``forecast``, ``sample`` and ``predict_load`` of the hybrid predictors."""

    @one_blas_thread
    def forecast(
        self,
        history: pd.DataFrame | ZoneTable | None,
        future: pd.DataFrame | ZoneTable,
        T_za: float | None = None,
        setpoint: Any = None,
        quantiles: Sequence[float] | None = None,
        *,
        weather_error: Any = None,
        limits: tuple[float | None, float | None] | None = None,
    ) -> pd.DataFrame:
        """Forecast from the last row of a history, under given heat or under a thermostat.

        The thermostat acts where ``setpoint`` is given, or where ``future`` has set-points (``T_heat_set``,
        ``T_cool_set``) and none of the columns of the plant; otherwise the heat in ``future`` is taken as it is.

        Parameters
        ----------
        history : DataFrame or None
            Rows up to the origin, with ``T_za``; if it continues or repeats the known rows, these are used too. None:
            all that is known from :meth:`fit`, :meth:`update` and :meth:`partial_fit`.
        future : DataFrame
            The rows to forecast, with the known future inputs; it begins one step after the history.
        T_za : float, optional
            Temperature measured at the first row of ``future``, which then is *now* [degC]: the forecast begins there,
            and the heat of that row is still to be decided.  It is not added to the history.
        setpoint : float, array-like of shape (n_future,), pair or DataFrame of two columns, optional
            As in :meth:`predict_load`, of the rows of ``future``.
        quantiles : sequence of float, optional
            As in :meth:`predict_quantiles`; the more days of history, the better the intervals know the present.
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`predict_quantiles`, for ``quantiles``; under a thermostat those of its load are wider too.
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative, under a thermostat only; None as one of the two: as learned.

        Returns
        -------
        DataFrame with the index of ``future``
            ``T_za`` [degC] at each stamp; ``zeta`` [kW, or K for an output disturbance] over the step that begins
            there, of the schedule model's network; a column such as ``q_0.1`` [degC] for each quantile.  Under a
            thermostat also ``Q_hvac`` [kW] and stages [-] by role over each row's step, as in :meth:`predict_load`, and
            ``Q_hvac_0.1`` [kW] for each quantile of the whole load.

        Raises
        ------
        ValueError
            If the two do not join evenly or a column is missing, ``T_za`` is no temperature, or ``weather_error`` comes
            without ``quantiles``; under a thermostat, if set-points are missing or crossed, the training had no plant,
            or if quantiles are wanted and it had no set-points.

        Warns
        -----
        PlanWarning
            If the heat in ``future`` leaves what training covered.
        """
        check_is_fitted(self)
        refuse_no_frames(history, future)
        now = None if T_za is None else read_now(T_za, future.index)
        levels = None if quantiles is None else read_quantiles(quantiles)
        wanted = Wanted(now, levels, weather_of_quantiles(weather_error, quantiles))
        if setpoint is None and not self._has_setpoints_only(future):
            self._refuse_without_heat(future)
            if limits is not None:
                raise ValueError("limits= are for a plant that a thermostat runs; with given heat leave limits=None.")
            return self._under_heat(history, future, wanted)
        self._refuse_without_plant("set-points do nothing: leave setpoint=None")
        return self._under_thermostat(history, future, wanted, setpoint, limits)

    def _samples(
        self, frame: pd.DataFrame, levels: list[float], T_za: Any, rng: np.random.RandomState, zone: str = ""
    ) -> pd.DataFrame:
        """Paths by a forecast with quantiles, whose columns end with the ``zone``; the first row may be *now*."""
        names = {"Q_hvac": load_quantile_columns(levels), "T_za": quantile_columns(levels)}
        own = {f"{role}{zone}": [f"{name}{zone}" for name in each] for role, each in names.items()}
        bands = {role: frame[each] for role, each in own.items() if each[0] in frame}
        law = self._running()._law
        joint = law.joint if law is not None and len(bands) == len(names) else self._joint
        if joint is None or not bands:
            raise TooFewDaysError(self._no_intervals)
        return joint.samples(bands, self._origin_hour(frame, T_za), rng)

    def _origin_hour(self, ahead: pd.DataFrame, T_za: Any) -> float:
        """Hour of the day of the origin of some rows, of which the first may be *now*; without stamps 0."""
        hour = origin_hours(self._scheme.rows.in_own_zone(ahead).index[:1])[0]
        return float(hour - (self.sampling_time_ / pd.Timedelta("1h") if T_za is None else 0.0))

    def _under_heat(self, history: Any, future: Any, wanted: Wanted) -> pd.DataFrame:
        """The forecast with the heat of ``future``."""
        if history is None:
            ahead = self._read_future(future)
            self._warn_of_plan(ahead, len(future.index))
            return pd.DataFrame(self._columns_ahead(ahead, wanted), future.index)
        table, origin = self._read_both(history, future, wanted.now)
        self._warn_of_plan(table, len(future.index))
        paths = self._present_scheme().forecast(table, origin, len(future.index) - (wanted.now is not None))
        return pd.DataFrame(self._columns(paths, table, origin, wanted), future.index)

    def _columns_ahead(self, ahead: ZoneTable, wanted: Wanted) -> dict[str, np.ndarray]:
        """The columns of :meth:`forecast` of rows that follow the known ones, under their heat."""
        paths = self._present_scheme().forecast_ahead(ahead, wanted.now)
        if wanted.levels is None:
            return paths.columns(wanted.now)
        return self._columns(paths, *self._after_known(ahead, wanted.now), wanted)

    def _columns(self, paths: Paths, table: ZoneTable, origin: np.ndarray, wanted: Wanted) -> dict[str, np.ndarray]:
        """The columns of a path from an origin, and one for each of its quantiles."""
        (now, levels, weather), n_leads = wanted, paths.temperature.shape[1]
        if levels is None:
            return paths.columns(now)
        bands = np.empty((0, len(levels)))
        if n_leads:
            bands = self._quantile_paths(table, origin, n_leads, levels, weather, paths.temperature)[0]
        bands = bands if now is None else np.vstack([np.full(len(levels), now), bands])
        return paths.columns(now) | dict(zip(quantile_columns(levels), bands.T, strict=True))

    def _under_thermostat(
        self, history: Any, future: Any, wanted: Wanted, setpoint: Any, limits: tuple[float | None, float | None] | None
    ) -> pd.DataFrame:
        """The forecast in which the plant follows set-points."""
        now, run, idle = wanted.now, self._run, self._idle(future)
        table, _ = (
            self._after_known(self._read_future(idle), now) if history is None else self._read_both(history, idle, now)
        )
        table = run.with_earlier(table)
        ahead = table.rows(slice(table.n_rows - len(future.index), None))
        if setpoint is None:
            if self._law is None:
                raise ValueError(
                    "future has set-points and no heat, but no thermostat was learned: fit on a week or more with "
                    "T_heat_set or T_cool_set and the heat, or pass setpoint= for an ideal plant."
                )
            self._check_setpoints_ahead(ahead)
        else:
            table = with_band(table, read_setpoint(setpoint, ahead))
        return run.ahead(table, future.index, wanted, read_plant_limits(limits, ahead))

    @property
    def _run(self) -> PlantRun:
        return PlantRun(self._present_scheme(), self._law)

    def _has_setpoints_only(self, future: Any) -> bool:
        """Whether rows ahead have set-points and no column of the plant."""
        names = future.roles if isinstance(future, ZoneTable) else future.columns
        of = (lambda role: role) if isinstance(future, ZoneTable) else self._column_of
        held = self._runs_as_usual or any(of(role) in names for role in SETPOINT_ROLES)
        return held and bool(self._plant) and not any(of(role) in names for role in self._plant)

    def _idle(self, future: Any) -> Any:
        """Rows ahead with a plant that is off, whatever they say of it."""
        if isinstance(future, ZoneTable):
            return future.replace(inputs={**future.inputs, **{role: np.zeros(future.n_rows) for role in self._plant}})
        idle = future.copy()
        for role in self._plant:
            idle[self._column_of(role)] = 0.0
        return idle

    @one_blas_thread
    def predict_load(
        self, X: Any, setpoint: Any, limits: Any = None, quantiles: Sequence[float] | None = None
    ) -> pd.DataFrame:
        """Heating and cooling that brings the temperature to a set-point, under the forecast disturbance.

        The plant is ideal: it gives the least heat that the network needs (ARX has no model of the plant).  If the
        training had set-points, ``setpoint`` is a pair and there are no ``limits``, thermostat and plant act as learned
        instead.  If a set-point is noisy, such as a measured temperature, the load follows its smooth part
        (:doc:`/explanation/thermostat`).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Heating and cooling columns are read up to each origin only; rows ahead need none.  Where X begins with
            known rows (:meth:`n_known_of`), those after the last of these go on from it.
        setpoint : float, array-like of shape (n_samples,), pair or DataFrame of two columns
            Wanted temperature at each row's stamp [degC].  Or a thermostat's heating and cooling set-point over each
            row's step, as a pair ``(heat, cool)`` of numbers or of values by row, or as two columns: between the two
            there is no load.  None as one of a pair, or ``T_heat_set`` as the only column, leaves the other side free.
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; each a number or one value per row, such as 0 at hours when
            the plant is off.  The capacity of its stages is a limit too.
        quantiles : sequence of float, optional
            Of temperature and load, by a learned thermostat.

        Returns
        -------
        DataFrame of length n_samples
            Stages [-] by role and ``Q_hvac`` [kW] over each row's step, clipped to what the plant can do, and ``T_za``
            [degC] at each row's stamp under them; stages and heat with ``_unclipped`` as the set-point would need
            (paper Eq. 16), and ``zeta`` as forecast.  For quantiles ``q_0.1`` [degC] and ``Q_hvac_0.1`` [kW].
            Where the training has stages and a metered ``Q_hvac``, that is the meter's part, and ``Q_total`` the sum.

        Raises
        ------
        ValueError
            If a set-point or limit has another length or other stamps than X or a NaN, if the lower of two is above
            the higher, if the training had no plant, or if quantiles are wanted and no learned thermostat acts.
        """
        check_is_fitted(self)
        self._refuse_without_plant("there is no load: call forecast or predict")
        return self._held(X, setpoint, limits, quantiles)

    def _held(
        self, X: Any, setpoint: Any, limits: Any = None, quantiles: Sequence[float] | None = None
    ) -> pd.DataFrame:
        """The frame of :meth:`predict_load`; of a zone without a plant its load is 0."""
        levels = None if quantiles is None else read_quantiles(quantiles)
        table, n_tail, origins = self._load_rows(X, self._plant)
        here = table.rows(slice(n_tail, None))
        wanted, within = read_setpoint(setpoint, here), None if limits is None else read_limits(limits, here)
        if not (n := self._n_known_before(table, n_tail)):
            return self._load_of(table, origins + n_tail, wanted, within, levels)
        past, later = slice(n), slice(n, None)
        earlier = self._load_of(
            table.rows(past), origins[origins < n], wanted.rows(past), within and within.rows(past), levels
        )
        table, n_tail = self._after_tail(table.rows(later))
        origins = np.append(n, origins[origins > n]) - n + n_tail
        load = self._load_of(table, origins, wanted.rows(later), within and within.rows(later), levels)
        return pd.concat([earlier, load.set_axis(here.index[later])])

    def _load_of(
        self, table: ZoneTable, origins: np.ndarray, wanted: Band, within: Limits | None, levels: np.ndarray | None
    ) -> pd.DataFrame:
        """The load of the rows of a table after its history, from origins among them."""
        longer = self._run.with_earlier(table)
        return self._run.held(longer, origins + longer.n_rows - table.n_rows, wanted, within, levels)

    def _n_known_before(self, table: ZoneTable, n_tail: int) -> int:
        """Number of the first rows of a table that are known already, where others follow these in it."""
        n_known = 0 if n_tail else self._n_known(table)
        return n_known if n_known < table.n_rows else 0

    @one_blas_thread
    def closed_loop_from(
        self,
        X: Any,
        origins: Sequence[int] | np.ndarray,
        horizon: Any = None,
        quantiles: Sequence[float] | None = None,
        boundary: Mapping[str, np.ndarray] | None = None,
        weather_error: Any = None,
    ) -> ClosedLoopPaths:
        """Forecast temperature and load from given rows, under the set-points of X and a learned thermostat.

        Parameters
        ----------
        X : DataFrame of n_samples rows
            Weather and set-points are known in advance; heat is read before each origin, ``T_za`` up to it.
        origins : sequence of int
            Row numbers of X, increasing.
        horizon : timedelta-like, optional
        quantiles : sequence of float, optional
        boundary : mapping of role to array of shape (n_origins, n_leads), optional
            Temperatures of neighbours, as for :meth:`predict_from`.
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`forecast`.

        Returns
        -------
        ClosedLoopPaths
            ``paths.heat`` [kW] (n_origins, n_leads) over the rows ``origin``, ``origin + 1`` ..., ``paths.temperature``
            [degC] at the end of each; ``plant`` has stages [-] and heat [kW] by name, as :meth:`predict_load`, and
            ``measured`` what X has of them; ``heat_bands`` and ``temperature_bands`` (n_origins, n_leads, n_quantiles).
            All are NaN after the last row of X.

        Raises
        ------
        ValueError
            If no thermostat was learned, set-points are missing or crossed, or the origins do not increase.
        """
        check_is_fitted(self)
        levels = None if quantiles is None else read_quantiles(quantiles)
        table, n_tail = self._with_history(X)
        rows = checked_origins(origins, table.n_rows - n_tail)
        if not len(rows) or (np.diff(rows) <= 0).any():
            raise ValueError("origins must be increasing row numbers of X, at least one.")
        law, run, weather = self._law, self._run, read_weather_error(weather_error)
        n_leads = self._leads(horizon, table.step)
        given, found = run.scheme.read_boundary(boundary, (len(rows), n_leads)), []
        for part, at, of in self._parts(table, n_tail, rows):
            longer = run.with_earlier(part)
            here, at = longer.rows(slice(longer.n_history, None)), at + longer.n_rows - part.n_rows
            if law is None or not (self._runs_as_usual or setpoints_in(here)):
                raise ValueError(
                    "no thermostat was learned, or X has no set-points: fit on a week or more with T_heat_set or "
                    "T_cool_set and the heat, and give the same columns here."
                )
            self._check_setpoints_ahead(here)
            around = {role: values[of] for role, values in given.items()}
            paths = law.paths(run.scheme, longer, at, n_leads, levels, boundary=around, weather=weather)
            found.append(paths.by_role(run.scheme, longer, at))
        return ClosedLoopPaths.joined(found)
