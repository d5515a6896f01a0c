"""Plans for all zones of a building: closed loops, loads and affine forecasts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..._last_known import held_paths
from ..._table import ZoneTable
from ..._warnings import ignore, warnings_dropped, warnings_to
from ...control import Limits, LoadPaths, heat_column, read_limits, read_setpoint
from ...exceptions import PlanWarning, UnitWarning
from ...forecasting.weather_error import WeatherError
from ..base import BaseHybrid
from ..thermostat_law.closed_loop_paths import ClosedLoopPaths
from .arguments_by_zone import NO_SETPOINTS
from .building_forecast import FittedZones
from .building_tables import arrays_by_name, of_zone, warn_of_usual, with_neighbour_temperatures, with_next
from .coupled_zone import CoupledZone
from .zone_columns import NEXT

_SPANS = 12  # parts of the rows in which zones that share a plant are settled, one after the other
_ROUNDING = 1e-9  # of heat [kW]
_Key = tuple[str, bool]  # a zone, and whether its predictor is the one with neighbours


def closed_loops(zones: FittedZones, X: Any, origins: np.ndarray, *asked: Any) -> dict[str, ClosedLoopPaths]:
    """Forecasts of all zones from given rows under set-points; ``asked``: horizon, quantiles, errors of the weather."""
    tables, own = {}, {}
    for zone, model in zones.own.items():
        with of_zone(zone):
            warn_of_usual(model)
            tables[zone] = model._read_X(X)
            own[zone] = _paths_of(model, tables[zone], origins, {}, *asked)
    known, found = zones.carried_on(zones.columns.known(X)), dict(own)
    for zone, one in zones.coupled.items():
        table = with_neighbour_temperatures(tables[zone], {other: known[other] for other in one.neighbours})
        ahead = {NEXT + other: held_paths(own[other].paths.temperature) for other in one.neighbours}
        with of_zone(zone), warnings_to(ignore):  # the zones by themselves have told it
            found[zone] = _blended(own[zone], _paths_of(one.model, table, origins, ahead, *asked), one)
    return found


def loads_of_zones(zones: FittedZones, rows: Any, wanted: Mapping[str, Any], limits: Any) -> pd.DataFrame:
    """Loads of all zones under set-points, within limits of each zone's own plant or of one for all."""
    shared = limits is not None and not isinstance(limits, Mapping)
    most = {} if shared else {zone: own for zone, own in zones.arguments.limits(limits).items() if own is not None}
    here, held, n_known = {}, {}, len(rows)
    for zone, model in zones.own.items():
        with of_zone(zone):
            with warnings_to(ignore):  # told where it is forecast
                table, n_tail, _ = model._load_rows(rows, model._plant)
            here[zone], n_known = table.rows(slice(n_tail, None)), min(n_known, model._n_known_before(table, n_tail))
            if model._plant:
                held[zone] = read_setpoint(wanted.get(zone), here[zone])
            if zone in most:
                most[zone] = read_limits(most[zone], here[zone])
    together = read_limits(limits, here[zones.columns.zones[0]]) if shared else None
    if together and ((together.lower > 0.0).any() or (together.upper < 0.0).any()):
        raise ValueError("limits of all zones together must have 0 kW, a plant that is off, between them.")
    loads = []
    for part in (slice(n_known), slice(n_known, None)) if n_known else (slice(None),):  # the known rows by themselves
        X, bands, own = rows[part], *({zone: v.rows(part) for zone, v in given.items()} for given in (held, most))
        if together:
            loads.append(_shared_out(zones, X, bands, together.rows(part)))
        else:
            within = {key: own.get(key[0]) for key in product(zones.own, (False, True))}
            loads.append(_loads(zones, X, bands, within)[0])
    return pd.concat(loads)


def _loads(
    zones: FittedZones, rows: pd.DataFrame, wanted: Mapping[str, Any], limits: Mapping[_Key, Any]
) -> tuple[pd.DataFrame, dict[_Key, np.ndarray]]:
    """Loads of all zones, and the heat (N,) [kW] by each of their predictors, which are within their limits."""
    heat: dict[_Key, np.ndarray] = {}

    def of(model: BaseHybrid, zone: str, T: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        under, key = with_next(rows, T) if T else rows, (zone, bool(T))
        if not model._plant:
            free = arrays_by_name(model._held(under, NO_SETPOINTS))
            return {name: free[name] for name in ("T_za", "zeta")}
        load = arrays_by_name(model.predict_load(under, wanted.get(zone), limits[key]))
        heat[key] = load[heat_column(load)]
        return load

    return pd.DataFrame(zones.joined(of), getattr(rows, "index", None)), heat


def _shared_out(zones: FittedZones, rows: pd.DataFrame, wanted: Mapping[str, Any], shared: Limits) -> pd.DataFrame:
    """Loads of all zones that together keep within the limits of a plant.

    Each zone may have all of the plant, but for rows in which they would take too much: there each gets the same
    share of what it would take.  As what it takes later hangs on that, such rows are settled from the first on.
    """
    limits = {key: Limits(shared.lower.copy(), shared.upper.copy()) for key in product(zones.own, (False, True))}
    span = max(1, len(rows) // _SPANS)
    while True:
        loads, heat = _loads(zones, rows, wanted, limits)
        by_zone = [loads[heat_column(loads, f"_{zone}")] for zone, model in zones.own.items() if model._plant]
        sides = [np.sum([side(q, 0.0) for q in by_zone], axis=0) for side in (np.minimum, np.maximum)]
        over = [np.abs(taken) > np.abs(most) + _ROUNDING for taken, most in zip(sides, shared, strict=True)]
        if not np.any(over):
            return loads
        first = int(np.argmax(np.any(over, axis=0)))
        for end, (taken, most) in enumerate(zip(sides, shared, strict=True)):
            now = first + np.flatnonzero(over[end][first : first + span])
            for key, q in heat.items():
                limits[key][end][now] = (np.minimum, np.maximum)[end](q[now], 0.0) * most[now] / taken[now]


def _paths_of(
    model: BaseHybrid,
    table: ZoneTable,
    origins: np.ndarray,
    boundary: Mapping[str, np.ndarray],
    horizon: Any,
    quantiles: Sequence[float] | None,
    weather: WeatherError | None,
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


def affine_of_zones(
    zones: FittedZones, history: Any, ahead: pd.DataFrame, roles: Sequence[str], now: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Free temperatures, gain and disturbance of all zones, as an :class:`AffineForecast` has them."""
    plan = zones.columns.planned(ahead, roles)
    acts = [(k, *one) for k, role in enumerate(roles) for one in zones.columns.input_of(role)]
    chosen = {zone: [(k, own) for k, on, own in acts if on == zone] for zone in zones.own}
    own = {z: _Affine.of(model, history, ahead, chosen[z], now.get(z), plan, z) for z, model in zones.own.items()}
    found = dict(own)
    before = history if history is None else zones.with_measured(history)
    for zone, one in zones.coupled.items():
        rows = with_next(ahead, {other: own[other].path for other in one.neighbours})
        with warnings_dropped(PlanWarning, UnitWarning):  # the zones by themselves have told of the user's columns
            with_others = _Affine.of(one.model, before, rows, chosen[zone], now.get(zone), plan, zone, one.roles)
        found[zone] = own[zone].blended(with_others.through(own, one), one, 0 if zone in now else 1)
    free = np.column_stack([f.path - np.tensordot(f.gain, plan, axes=2) for f in found.values()])
    gain = np.stack([f.gain for f in found.values()], axis=-1)
    return free, gain, np.column_stack([f.zeta for f in found.values()])
