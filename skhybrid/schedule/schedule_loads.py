"""Loads of the schedule model: heat that keeps it within set-points, from each origin on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.isotonic import isotonic_regression

from .._table import ZoneTable, is_stage
from ..control import MOST_AHEAD, Band, Limits, LoadPaths, Plant, WantedPaths, load_frame, make_plant, steps_ahead
from ..filtering import simulate_inverse, solve_lq_path
from .channels import ChannelPlan, deviation, knot_name, known_heat
from .filter_model import NOISE
from .fit import LeadFit
from .online_network import OriginState
from .plant_model import emitting, fitted_heat, forcing_by, into_heated
from .segment import Segment

_GRID = 101  # stages at which a part-load curve is evaluated; each knot is among them where the stage runs to 1
_LEAST_SLOPE = 0.5  # least slope of a part-load curve, as a share of the proportional one
#: noise of a wanted temperature: at most this share of the error of the training's one-step forecasts, at least so much
_NOISE_SHARE, _LEAST_NOISE = 0.5, 0.01  # [-], [K]


def loads(
    fit: LeadFit,
    segment: Segment,
    origins: np.ndarray,
    states: Sequence[OriginState],
    table: ZoneTable,
    setpoint: Band,
    limits: Limits,
) -> pd.DataFrame:
    """Loads as of :meth:`GrayBoxRC.predict_load`, and ``zeta`` [kW]; each origin covers the rows up to the next one.

    A single temperature (a band whose sides are equal) is followed by a linear-quadratic path: heat that met each value
    of a measured temperature would answer to the thermometer's noise.  A band takes the least heat that keeps within it
    (paper Eq. 16).  Origins increase; ``setpoint`` [degC] and ``limits`` [kW] are of the rows from the first on.
    """
    ends = np.append(origins[1:], table.n_rows)
    variation = _Variation.of(fit) if np.array_equal(*setpoint) else None
    frames = []
    for origin, end, state in zip(origins, ends, states, strict=True):
        rows = slice(origin - origins[0], end - origins[0])
        ahead, asked = segment.between(int(origin), int(end)), (setpoint.rows(rows), limits.rows(rows))
        frames.append(_load_from(fit, ahead, state, table.index[origin:end], *asked, variation))
    return pd.concat(frames) if len(frames) > 1 else frames[0]


def load_paths(
    fit: LeadFit,
    segment: Segment,
    origins: np.ndarray,
    states: Sequence[OriginState],
    wanted: WantedPaths,
    n_leads: int,
) -> LoadPaths:
    """Least heat that keeps the network within the set-points (N,) of its rows, from each origin on.

    After the last row the values are those of the last one.
    """
    out = LoadPaths(*np.empty((3, len(origins), n_leads)))
    for i, (origin, state) in enumerate(zip(origins, states, strict=True)):
        rows = slice(int(origin), min(int(origin) + n_leads, segment.n_rows))
        ahead, n = segment.between(rows.start, rows.stop), rows.stop - rows.start
        zeta = _zeta(ahead, state)
        foreseen, unforeseen = _without_unforeseen(fit, state, ahead, wanted, i)
        system, begin = _system(fit, state, foreseen, zeta), np.append(state.nodes, state.emitter)
        band = [side[rows] - fit.reference for side in wanted.band]
        within = [np.full(n, side[i]) for side in wanted.limits]
        if wanted.delivered is not None:
            within[0][0] = within[1][0] = wanted.delivered[i]
        hold = steps_ahead(system.A, system.effect, system.c)
        load, path = simulate_inverse(*system, *band, *within, begin, hold, unforeseen)
        for part, values in zip(out, (load, path + fit.reference, zeta), strict=True):
            part[i, :n], part[i, n:] = values, values[-1]
    return out


def _without_unforeseen(
    fit: LeadFit, state: OriginState, ahead: Segment, wanted: WantedPaths, number: int
) -> tuple[Segment, np.ndarray | None]:
    """Rows after an origin without the boundaries that are unforeseen there, and the effect (n, m) of these."""
    if not wanted.unforeseen:
        return ahead, None
    column = {role: fit.plan.network.boundaries.index(role) for role in wanted.unforeseen}
    boundary, unforeseen = ahead.boundary.copy(), np.zeros(ahead.boundary.shape)
    for role, values in wanted.boundary.items():
        given = values[number] - fit.reference
        boundary[1:, column[role]] = given[np.minimum(np.arange(ahead.n_rows - 1), len(given) - 1)]
    of = list(column.values())
    unforeseen[:, of], boundary[:, of] = boundary[:, of], 0.0
    effect = unforeseen @ state.matrices.of_boundaries.T
    return ahead._replace(boundary=boundary), np.column_stack([effect, np.zeros(len(effect))])


def plant_heat(fit: LeadFit, table: ZoneTable) -> np.ndarray:
    """(N,) heat [kW] of the plant in the rows of a table, by its fitted capacities."""
    return known_heat(fit.plan, table) + fitted_heat(fit, fit.coef, table)


def heat_frame(fit: LeadFit, index: pd.Index, paths: LoadPaths) -> pd.DataFrame:
    """Stages by role and heat of a path, temperature and ``zeta`` of its rows."""
    plant = _plant(fit, fit.coef)
    frame = load_frame(plant, index, paths.heat[0], paths.heat[0], paths.temperature[0], paths.zeta[0])
    return _at_part_load(frame, fit, plant, fit.coef)


class _Variation(NamedTuple):
    """Root mean squares of the training, which weigh the linear-quadratic path."""

    noise: float  # of a temperature [K]
    change: float  # of the plant's heat from row to row [kW]

    @classmethod
    def of(cls, fit: LeadFit) -> _Variation:
        errors = fit.left_out[:, 0]
        known = np.isfinite(errors)
        noise = _NOISE_SHARE * float(np.sqrt(np.mean(errors[known] ** 2))) if known.any() else NOISE
        channels = fit.segment.channels
        plant = ~(channels.scheduled | channels.solar)
        heat = fit.segment.heat + channels.series[:, plant] @ fit.coef[: len(plant)][plant]
        change = float(np.sqrt(np.mean(np.diff(heat) ** 2)))
        return cls(noise, change if change > 0 else fit.model.heat_scale)

    def penalty(self, wanted: np.ndarray) -> float:
        """Penalty [K2/kW2] of a change of heat, relative to an error of the wanted temperatures (N,).

        The path is then the likeliest one of heat that walks at random by its usual changes, and a noisy temperature.
        """
        # a path that is smooth has little noise: white noise alone gives second differences of root 6 its size
        rough = float(np.sqrt(np.mean(np.diff(wanted, 2) ** 2) / 6.0)) if len(wanted) > 2 else self.noise
        return (max(min(self.noise, rough), _LEAST_NOISE) / self.change) ** 2


def _load_from(
    fit: LeadFit,
    segment: Segment,
    state: OriginState,
    index: pd.Index,
    setpoint: Band,
    limits: Limits,
    variation: _Variation | None,
) -> pd.DataFrame:
    """Load of the rows from an origin on."""
    plant = _plant(fit, state.coef)
    zeta = _zeta(segment, state)
    system, begin = _system(fit, state, segment, zeta), np.append(state.nodes, state.emitter)
    band = [side - fit.reference for side in setpoint]
    free = np.full(segment.n_rows, np.inf)
    ahead = steps_ahead(system.A, system.effect, system.c) if variation is None else MOST_AHEAD

    def heat_within(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if variation is None:
            return simulate_inverse(*system, *band, lower, upper, begin, ahead)
        return solve_lq_path(*system, band[0], variation.penalty(band[0]), lower, upper, begin, ahead)

    clipped, path = heat_within(*plant.within(limits))
    unclipped, _ = heat_within(-free, free)
    at_origin = segment.y[0] if segment.seen[0] else begin[fit.model.zone]
    temperature = np.append(at_origin, path[:-1]) + fit.reference
    return _at_part_load(load_frame(plant, index, clipped, unclipped, temperature, zeta), fit, plant, state.coef)


def _zeta(segment: Segment, state: OriginState) -> np.ndarray:
    """(N,) unmeasured heat of the rows from an origin on [kW]."""
    fading = state.matrices.F[-1, -1] ** np.arange(segment.n_rows)
    return segment.channels.scheduled_heat(state.coef) + state.gain * fading


def _at_part_load(out: pd.DataFrame, fit: LeadFit, plant: Plant, coef: np.ndarray) -> pd.DataFrame:
    """Replace proportional stages by those whose part-load curve gives the same heat."""
    plan, names = fit.plan, fit.channel_names
    full, largest = dict((*plant.heating, *plant.cooling)), dict(plan.max_stages)
    for role in full.keys() & {role for role, _, _ in plan.knots}:
        grid = np.linspace(0.0, plant.most[role], _GRID)
        heat = dict(plan.known)[role] * grid
        for stage, knot, capacity in plan.knots:
            if stage == role:
                slope = coef[names.index(knot_name(role, knot))] * capacity
                heat = heat + slope * deviation(grid, knot, largest[role])
        proportional = increasing_curve(heat / full[role], grid)
        for column in (role, f"{role}_unclipped"):
            stages = out[column].to_numpy()
            out[column] = np.where(stages < grid[-1], np.interp(stages, proportional, grid), stages)
    return out


def increasing_curve(curve: np.ndarray, proportional: np.ndarray) -> np.ndarray:
    """The nearest curve that increases everywhere, between the same ends."""
    # where a curve is flat or falling many stages give the same heat, of which the first may be far too low
    least = _LEAST_SLOPE * proportional
    return isotonic_regression(curve - least, y_min=0.0, y_max=proportional[-1] - least[-1]) + least


def _plant(fit: LeadFit, coef: np.ndarray) -> Plant:
    """Stages with their given or fitted capacity, and measured heat."""
    plan, names = fit.plan, fit.channel_names
    capacity = {role: c for role, c in plan.known if is_stage(role)}
    capacity |= {role: sign * coef[names.index(role)] for role, sign in plan.stages}
    seen = {role: np.array([largest]) for role, largest in plan.max_stages}
    return make_plant(capacity, seen | {role: np.array(ends) for role, ends in fit.meters})


class _System(NamedTuple):
    """Network with the emitter's heat as one more state, over some rows."""

    A: np.ndarray  # (n + 1, n + 1)
    forcing: np.ndarray  # (N, n + 1) by all but the plant
    effect: np.ndarray  # (2, n + 1) of 1 kW of the plant that heats, and of the one that cools
    c: np.ndarray  # (n + 1,) row of the measured node


def _system(fit: LeadFit, state: OriginState, segment: Segment, zeta: np.ndarray) -> _System:
    (A, effect), direct = emitting(fit, state), into_heated(fit, state)
    plant = _plant(fit, state.coef)
    sides = [_share_known(fit.plan, plant, stages) for stages in (plant.heating, plant.cooling)]
    M, channels = state.matrices, segment.channels
    heat = channels.heat(np.where(channels.solar, state.coef[: len(channels.names)], 0.0), len(M.A))
    heat[:, segment.plan.zone] += zeta
    effects = np.array([share * effect + (1.0 - share) * direct for share in sides])
    return _System(A, forcing_by(M, segment, heat), effects, fit.model.output)


def _share_known(plan: ChannelPlan, plant: Plant, stages: Sequence[tuple[str, float]]) -> float:
    """Share of the heat of some stages that is known, so that the emitter delays it; 1 without stages."""
    known = dict(plan.known)
    return plant.full([stage for stage in stages if stage[0] in known]) / plant.full(stages) if stages else 1.0
