"""Forecasts of all zones of a building under set-points, their loads, affine forecasts, and joint samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..._arguments import check_integer, random_numbers
from ..._clock import hour_of_day
from ..._joining import refuse_no_frames
from ..._table import ZoneTable, as_numbers
from ..._time import wall_clock
from ..._warnings import ignore, warnings_dropped, warnings_to
from ...control import AffineForecast, Limits, LoadPaths, heat_column, read_inputs, read_limits
from ...exceptions import PlanWarning, UnitWarning
from ...forecasting.quantiles import LeftOut, quantile_columns
from ...forecasting.weather_error import WeatherError, read_weather_error
from ..base import BaseHybrid
from ..thermostat_law.closed_loop_paths import ClosedLoopPaths
from .building_forecast import BuildingForecastMixin
from .building_tables import arrays_by_name, of_zone, warn_of_usual, with_neighbour_temperatures, with_next
from .coupled_zone import CoupledZone, at_common_origins
from .zone_columns import NEXT, held

_NEAR = 1.5  # hours within which the errors of the training are drawn
_SPANS = 12  # parts of the rows in which zones that share a plant are settled, one after the other
_ROUNDING = 1e-9  # of heat [kW]
_FREE = (None, None)  # set-points of a zone without a plant
_Key = tuple[str, bool]  # a zone, and whether its predictor is the one with neighbours
_LEAST_DRAWN = 10  # forecasts of the training from about that hour of the day, below which those of any are drawn


class JointErrors(NamedTuple):
    """Errors of forecasts of the training, of all zones at once."""

    values: np.ndarray  # (n_origins, n_leads, n_zones) [K]
    hours: np.ndarray  # (n_origins,) hour of the day of each origin

    @classmethod
    def of(cls, errors: Mapping[str, LeftOut], index: pd.Index) -> JointErrors:
        """Of the origins that all zones have."""
        origins, values = at_common_origins(list(errors.values()))
        known = [held(v) for v in values]  # errors after the end of a left-out block are unknown
        return cls(np.stack(known, axis=-1).astype(np.float32), _hours(index)[origins])

    def drawn(self, hour: float, n_samples: int, n_rows: int, rng: np.random.RandomState) -> np.ndarray:
        """(n_samples, n_rows, n_zones) errors of forecasts from that hour; the last lead's hold on."""
        near = np.flatnonzero(np.abs((self.hours - hour + 12) % 24 - 12) <= _NEAR)
        near = near if len(near) >= _LEAST_DRAWN else np.arange(len(self.hours))
        leads = np.minimum(np.arange(n_rows), self.values.shape[1] - 1)
        return self.values[rng.choice(near, n_samples)][:, leads]


def _hours(index: pd.Index) -> np.ndarray:
    """(n,) hour of the day, 0 without stamps."""
    if not isinstance(index, pd.DatetimeIndex):
        return np.zeros(len(index))
    return hour_of_day(wall_clock(index))


class BuildingPlansMixin(BuildingForecastMixin):
    """``closed_loop_from``, ``predict_load``, ``affine_forecast`` and ``sample`` of :class:`BuildingPredictor`."""

    _joint: JointErrors | None

    def closed_loop_from(
        self,
        X: pd.DataFrame,
        origins: Sequence[int] | np.ndarray,
        horizon: Any = None,
        quantiles: Sequence[float] | None = None,
        weather_error: Any = None,
    ) -> dict[str, ClosedLoopPaths]:
        """Forecast all zones from given rows, under the set-points of X and their learned thermostats.

        Parameters
        ----------
        X : DataFrame of n_samples rows
            Weather and set-points are known in advance; heat of every zone is read before each origin, ``T_za_<zone>``
            up to it.  After it, neighbours are as forecast.
        origins : sequence of int
            Row numbers of X, increasing.
        horizon : timedelta-like, optional
        quantiles : sequence of float, optional
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`forecast`.

        Returns
        -------
        dict of str to ClosedLoopPaths
            By zone, as :meth:`HybridPredictor.closed_loop_from` has it; a zone without a plant is free, and a plant of
            which no thermostat was learned runs as usual.

        Raises
        ------
        ValueError
            As there, in the name of the zone; also where zones share a plant, or none has one.

        Warns
        -----
        SkhybridWarning
            Of plants that run as usual, once per fit.
        """
        check_is_fitted(self)
        self._refuse_shared_plants()
        self._arguments.refuse_without_plant("heat_known=False")
        X, rows = self._prepared(self._read(X)), np.asarray(origins)
        asked = horizon, quantiles, read_weather_error(weather_error)
        tables, own = {}, {}
        for zone, model in self.own_.items():
            with of_zone(zone):
                warn_of_usual(model)
                tables[zone] = model._read_X(X)
                own[zone] = _paths_of(model, tables[zone], rows, *asked, {})
        known, found = self._carried_on(self._known(X)), dict(own)
        for zone, one in self.coupled_.items():
            table = with_neighbour_temperatures(tables[zone], {other: known[other] for other in one.neighbours})
            ahead = {NEXT + other: held(own[other].paths.temperature) for other in one.neighbours}
            with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
                found[zone] = _blended(own[zone], _paths_of(one.model, table, rows, *asked, ahead), one)
        return found

    def predict_load(self, X: pd.DataFrame, setpoint: Any, limits: Any = None) -> pd.DataFrame:
        """Heating and cooling that brings each zone to its set-points, under the forecast disturbances.

        Parameters
        ----------
        X : DataFrame of n_samples rows
            As in :meth:`HybridPredictor.predict_load`.
        setpoint : mapping or DataFrame of zone to set-point, or one for all zones
            As there; a zone that a mapping leaves out is free, and one without a plant is so always.
        limits : tuple of (lowest, highest), or mapping of zone to such pairs, optional
            What one plant gives to all zones together [kW], each a number or one value per row, with 0 between them; or
            what each zone's own plant can do.  Where all zones together need more, every zone gets the same share of
            what it would take if the plant were its own.

        Returns
        -------
        DataFrame of length n_samples
            The columns of :meth:`HybridPredictor.predict_load` with the zone's name, such as ``Q_hvac_<zone>`` [kW];
            without a plant ``T_za_<zone>`` and ``zeta_<zone>`` only.

        Raises
        ------
        ValueError
            As there; the message names the zone.  Also if limits of all zones together exclude 0 kW, or zones share the
            column of a plant (``shared_plants_``).
        """
        self._refuse_shared_plants()
        wanted = self._arguments.setpoints(setpoint)
        X = self._prepared(self._read(X))
        rows = self._with_measured(X, self._known(X))
        if limits is None or isinstance(limits, Mapping):
            own = self._arguments.limits(limits)
            return self._loads(rows, wanted, {(z, near): own.get(z) for z, near in self._predictors})[0]
        with of_zone(self.zones_[0]):
            table, n_tail, _ = self._first._load_rows(rows, self._first._plant)
        shared = read_limits(limits, table.rows(slice(n_tail, None)))
        if (shared.lower > 0.0).any() or (shared.upper < 0.0).any():
            raise ValueError("limits of all zones together must have 0 kW, a plant that is off, between them.")
        return self._shared_out(rows, wanted, shared)

    @property
    def _predictors(self) -> list[_Key]:
        return [(zone, near) for zone in self.zones_ for near in (False, True)]

    def _loads(
        self, rows: pd.DataFrame, wanted: Mapping[str, Any], limits: Mapping[_Key, Any]
    ) -> tuple[pd.DataFrame, dict[_Key, np.ndarray]]:
        """Loads of all zones, and the heat (N,) [kW] by each of their predictors, which are within their limits."""
        heat: dict[_Key, np.ndarray] = {}

        def of(model: BaseHybrid, zone: str, T: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
            under, key = with_next(rows, T) if T else rows, (zone, bool(T))
            if not model._plant:
                free = arrays_by_name(model._held(under, _FREE))
                return {name: free[name] for name in ("T_za", "zeta")}
            load = arrays_by_name(model.predict_load(under, wanted.get(zone), limits[key]))
            heat[key] = load[heat_column(load)]
            return load

        return pd.DataFrame(self._joined(of, first_lead=1), getattr(rows, "index", None)), heat

    def _shared_out(self, rows: pd.DataFrame, wanted: Mapping[str, Any], shared: Limits) -> pd.DataFrame:
        """Loads of all zones that together keep within the limits of a plant.

        Each zone may have all of the plant, but for rows in which they would take too much: there each gets the same
        share of what it would take.  As what it takes later hangs on that, such rows are settled from the first on.
        """
        limits = {key: Limits(shared.lower.copy(), shared.upper.copy()) for key in self._predictors}
        span = max(1, len(rows) // _SPANS)
        while True:
            loads, heat = self._loads(rows, wanted, limits)
            by_zone = [loads[heat_column(loads, f"_{zone}")] for zone, model in self.own_.items() if model._plant]
            sides = [np.sum([side(q, 0.0) for q in by_zone], axis=0) for side in (np.minimum, np.maximum)]
            over = [np.abs(taken) > np.abs(most) + _ROUNDING for taken, most in zip(sides, shared, strict=True)]
            if not np.any(over):
                return loads
            first = int(np.argmax(np.any(over, axis=0)))
            for end, (taken, most) in enumerate(zip(sides, shared, strict=True)):
                now = first + np.flatnonzero(over[end][first : first + span])
                for key, q in heat.items():
                    limits[key][end][now] = (np.minimum, np.maximum)[end](q[now], 0.0) * most[now] / taken[now]

    def affine_forecast(
        self, history: pd.DataFrame | None, future: pd.DataFrame, inputs: Sequence[str] | None = None, T_za: Any = None
    ) -> AffineForecast:
        """Forecast as an affine function of the heat that is planned for the zones: ``T = free + gain @ q``.

        Parameters
        ----------
        history, future
            As in :meth:`forecast`; columns of the ``inputs`` may be absent from ``future``.
        inputs : sequence of str, optional
            What is decided: roles of heating and cooling, such as ``"Q_hvac_north"``; default is all of them.
        T_za
            As in :meth:`forecast`.

        Returns
        -------
        AffineForecast
            ``free`` (H, n_zones) [degC], ``gain`` (H, H, n_inputs, n_zones) [K per kW or stage], ``zeta`` (H, n_zones).

        Raises
        ------
        ValueError
            As in :meth:`forecast`, and if an input was not in training.
        """
        check_is_fitted(self)
        refuse_no_frames(history, future)
        columns = self._columns.columns
        roles = list(read_inputs(inputs, list(columns), columns.__getitem__))
        ahead, now = self._prepared(future), self._arguments.now(T_za)
        known = None if history is None else self._prepared(history)
        plan = np.column_stack([self._planned(ahead, role) for role in roles])
        acts = [(k, *one) for k, role in enumerate(roles) for one in self._columns.input_of(role)]
        chosen = {zone: [(k, own) for k, on, own in acts if on == zone] for zone in self.zones_}
        own = {z: _Affine.of(model, known, ahead, chosen[z], now.get(z), plan, z) for z, model in self.own_.items()}
        found = dict(own)
        before = known if known is None else self._with_measured(known, self._known(known))
        for zone, one in self.coupled_.items():
            rows = with_next(ahead, {other: own[other].path for other in one.neighbours})
            with warnings_dropped(PlanWarning, UnitWarning):  # the zones by themselves have told of the user's columns
                with_others = _Affine.of(one.model, before, rows, chosen[zone], now.get(zone), plan, zone, one.roles)
            found[zone] = own[zone].blended(with_others.through(own, one), one, 0 if now else 1)
        free = np.column_stack([f.path - np.tensordot(f.gain, plan, axes=2) for f in found.values()])
        gain = np.stack([f.gain for f in found.values()], axis=-1)
        return AffineForecast(free, gain, np.column_stack([f.zeta for f in found.values()]), future.index, tuple(roles))

    def _planned(self, rows: pd.DataFrame, role: str) -> np.ndarray:
        column = self._columns.columns[role]
        return as_numbers(rows[column], str(column)) if column in rows else np.zeros(len(rows))

    def sample(
        self,
        history: pd.DataFrame | None,
        future: pd.DataFrame,
        n_samples: int = 100,
        T_za: Any = None,
        random_state: Any = None,
    ) -> np.ndarray:
        """Draw joint paths of all zones: each zone's quantiles, in the order of errors that zones made together.

        Parameters
        ----------
        history, future
            As in :meth:`forecast`, under given heat.
        n_samples : int, default=100
        T_za
            As in :meth:`forecast`.
        random_state : int, RandomState or None

        Returns
        -------
        ndarray of shape (n_samples, H, n_zones), float64
            [degC]; the correlation of zones, and along the day, is that of left-out forecasts of the training.

        Raises
        ------
        ValueError
            As in :meth:`forecast`, and if no intervals were learned.
        """
        check_is_fitted(self)
        check_integer("n_samples", n_samples)
        levels = (np.arange(n_samples) + 0.5) / n_samples
        frame = self.forecast(history, future, T_za, quantiles=list(levels))
        names = quantile_columns(levels)
        bands = np.stack([frame[[f"{name}_{zone}" for name in names]].to_numpy() for zone in self.zones_], axis=-1)
        assert self._joint is not None  # as there are intervals
        before = self._first.sampling_time_ / pd.Timedelta("1h") if T_za is None else 0.0
        index = self._first._scheme.rows.in_own_zone(frame).index
        drawn = self._joint.drawn(_hours(index)[0] - before, n_samples, len(frame), random_numbers(random_state))
        ranks = np.argsort(np.argsort(drawn, axis=0), axis=0)
        return np.take_along_axis(bands.transpose(1, 0, 2), ranks, axis=0)


def _paths_of(
    model: BaseHybrid,
    table: ZoneTable,
    origins: np.ndarray,
    horizon: Any,
    quantiles: Sequence[float] | None,
    weather: WeatherError | None,
    boundary: Mapping[str, np.ndarray],
) -> ClosedLoopPaths:
    """Forecasts of a zone by one of its predictors; without a plant it is free."""
    if model._plant:
        return model._running().closed_loop_from(table, origins, horizon, quantiles, boundary, weather)
    T = model.predict_from(table, origins, horizon, boundary or None)
    paths = LoadPaths(np.zeros(T.shape), T, np.full(T.shape, np.nan))
    if quantiles is None or boundary:  # quantiles with neighbours are made from those of the zone by itself
        return ClosedLoopPaths(paths)
    bands = model.predict_quantiles_from(table, origins, quantiles, horizon, weather_error=weather)
    return ClosedLoopPaths(paths, None, bands)


def _blended(own: ClosedLoopPaths, coupled: ClosedLoopPaths, one: CoupledZone) -> ClosedLoopPaths:
    """The blend of a zone's paths by itself and with neighbours, with quantiles as :meth:`CoupledZone.blended`."""
    n_leads = own.paths.temperature.shape[1]
    share = one.share(n_leads)
    over_step = np.append(0.0, share[:-1])  # heat that acts before the first temperature is that by itself

    def heat(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (1.0 - over_step) * a + over_step * b

    T = (1.0 - share) * own.paths.temperature + share * coupled.paths.temperature
    bands, loads = own.temperature_bands, own.heat_bands
    if bands is not None:
        bands = T[..., None] + (bands - own.paths.temperature[..., None]) * one.widths(n_leads)[:, None]
    if loads is not None and coupled.heat_bands is not None:
        loads = heat(loads.swapaxes(1, 2), coupled.heat_bands.swapaxes(1, 2)).swapaxes(1, 2)
    plant = {name: heat(values, coupled.plant[name]) for name, values in own.plant.items()}
    paths = LoadPaths(heat(own.paths.heat, coupled.paths.heat), T, heat(own.paths.zeta, coupled.paths.zeta))
    return own._replace(paths=paths, heat_bands=loads, temperature_bands=bands, plant=plant)


class _Affine(NamedTuple):
    """A zone's forecast under a plan, and its slope by all inputs of the plan."""

    path: np.ndarray  # (H,) [degC]
    gain: np.ndarray  # (H, H, n_inputs) [K per kW or stage]
    zeta: np.ndarray  # (H,)
    gain_by_neighbours: np.ndarray  # (H, H, n_neighbours) slope by the neighbours' temperatures [K/K]

    @classmethod
    def of(
        cls,
        model: BaseHybrid,
        history: Any,
        rows: pd.DataFrame,
        chosen: Sequence[tuple[int, str]],
        now: float | None,
        plan: np.ndarray,
        zone: str,
        boundaries: Sequence[str] = (),
    ) -> _Affine:
        """By a predictor, of which ``chosen`` are the inputs: their places in the plan (H, n_inputs), and its roles."""
        H, roles = len(rows), [*(role for _, role in chosen), *boundaries]
        gain = np.zeros((H, H, plan.shape[1]))
        with of_zone(zone):
            if not roles:
                frame = model.forecast(history, rows, now)
                return cls(frame["T_za"].to_numpy(), gain, frame["zeta"].to_numpy(), np.zeros((H, H, 0)))
            found = model.affine_forecast(history, rows, roles, now)
        at = [k for k, _ in chosen]
        gain[:, :, at] = found.gain[:, :, : len(at)]
        values = np.column_stack([plan[:, at], *(rows[name].to_numpy(dtype=float) for name in boundaries)])
        return cls(found.temperature(values), gain, found.zeta, found.gain[:, :, len(at) :])

    def through(self, own: Mapping[str, _Affine], one: CoupledZone) -> _Affine:
        """With the effect of the plan through the neighbours."""
        by_others = (
            np.einsum("ij,jkm->ikm", self.gain_by_neighbours[:, :, n], own[z].gain)
            for n, z in enumerate(one.neighbours)
        )
        return self._replace(gain=self.gain + sum(by_others))

    def blended(self, other: _Affine, one: CoupledZone, first_lead: int) -> _Affine:
        share = one.share_by_row(len(self.path), first_lead)
        mean = [a + (share * (b - a).T).T for a, b in zip(self[:3], other[:3], strict=True)]
        return _Affine(mean[0], mean[1], mean[2], self.gain_by_neighbours)
