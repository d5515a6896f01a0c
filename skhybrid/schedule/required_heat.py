"""The load of a scheduled network: forward from each origin, the emitter's store being one more state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.isotonic import isotonic_regression

from .._table import ZoneTable
from ..control import MOST_AHEAD, Band, Limits, Plant, load_frame, steps_ahead
from ..filtering import simulate_inverse, track_path
from .channels import ChannelPlan, bent
from .filter_model import NOISE
from .fit import LeadFit
from .online_updating import OriginState
from .responses import Segment

#: stages at which the heat of one that is not in proportion is worked out; every knot is among them where it runs to 1
_GRID = 101
#: a stage adds at least this share of the heat that it adds on average over its range
_LEAST_SLOPE = 0.5
#: noise of a wanted temperature: at most this share of the error of the training's one-step forecasts, at least so much
_NOISE_SHARE, _LEAST_NOISE = 0.5, 0.01  # [-], [K]


def loads(
    fit: LeadFit,
    segment: Segment,
    origins: np.ndarray,
    learned: Sequence[OriginState],
    table: ZoneTable,
    setpoint: Band,
    limits: Limits,
) -> pd.DataFrame:
    """Heat that keeps the last rows within their set-points, each origin's up to the next one.

    A temperature (a band whose sides are equal) is tracked: heat that met each value of a measured one would answer to
    the thermometer's noise.  A band is a thermostat's setting, and has the least heat that keeps within it.

    Parameters
    ----------
    fit : LeadFit
    segment : Segment
    origins : ndarray of int, shape (n_origins,)
        Rows of the segment, increasing.
    learned : sequence of OriginState
        What is known at each origin.
    table : ZoneTable
        The rows of ``segment``.
    setpoint : Band
        Of the rows from the first origin on [degC].
    limits : Limits
        [kW].

    Returns
    -------
    DataFrame
        As the identifications give it, and ``zeta`` [kW].
    """
    ends = np.append(origins[1:], table.n_rows)
    usual = _Usual.of(fit) if np.array_equal(*setpoint) else None
    frames = []
    for origin, end, known in zip(origins, ends, learned, strict=True):
        rows = slice(origin - origins[0], end - origins[0])
        band = Band(*(side[rows] for side in setpoint))
        within = Limits(*(side[rows] for side in limits))
        ahead = segment.between(int(origin), int(end))
        frames.append(_load_from(fit, ahead, known, table.index[origin:end], band, within, usual))
    # a stage whose capacity came out as 0 at one origin delivers nothing there
    return pd.concat(frames).fillna(0.0) if len(frames) > 1 else frames[0]


class _Usual(NamedTuple):
    """What is usual in the training."""

    noise: float  # of a temperature [K]
    change: float  # of the plant's heat from row to row [kW]

    @classmethod
    def of(cls, fit: LeadFit) -> _Usual:
        """Root mean squares."""
        errors = fit.left_out[:, 0]
        known = np.isfinite(errors)
        noise = _NOISE_SHARE * float(np.sqrt(np.mean(errors[known] ** 2))) if known.any() else NOISE
        channels, coef = fit.segment.channels, fit.point.solution.coef
        plant = ~(channels.scheduled | channels.solar)
        heat = fit.segment.heat + channels.series[:, plant] @ coef[: len(plant)][plant]
        change = float(np.sqrt(np.mean(np.diff(heat) ** 2)))
        return cls(noise, change if change > 0 else fit.model.heat_scale)

    def penalty(self, wanted: np.ndarray) -> float:
        """What a change of heat costs beside an error of a wanted temperature (N,) [K2/kW2].

        Of a heat that walks at random by usual changes, and a temperature with noise, the likeliest has the least of
        both.  A path that is smooth has little noise: white noise alone gives second differences of root 6 its size.
        """
        rough = float(np.sqrt(np.mean(np.diff(wanted, 2) ** 2) / 6.0)) if len(wanted) > 2 else self.noise
        return (max(min(self.noise, rough), _LEAST_NOISE) / self.change) ** 2


def _load_from(
    fit: LeadFit,
    segment: Segment,
    known: OriginState,
    index: pd.Index,
    setpoint: Band,
    limits: Limits,
    usual: _Usual | None,
) -> pd.DataFrame:
    """The rows from an origin on, by what is known there."""
    M, coef, n = known.matrices, known.coef, segment.n_rows
    plant = _plant(segment.plan, coef, fit)
    zeta = segment.channels.scheduled_heat(coef) + known.tracked * M.F[-1, -1] ** np.arange(n)
    A, forcing, effect = _augmented(fit, known, segment, zeta)
    c, begin = np.eye(len(A))[fit.model.zone], np.append(known.nodes, known.store)
    band = [side - fit.reference for side in setpoint]
    system, free = (A, forcing, effect, c), np.full(n, np.inf)
    ahead = steps_ahead(A, effect, c) if usual is None else MOST_AHEAD

    def heat_within(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if usual is None:
            return simulate_inverse(*system, *band, lower, upper, begin, ahead)
        return track_path(*system, band[0], usual.penalty(band[0]), lower, upper, begin, ahead)

    clipped, path = heat_within(*plant.within(limits))
    unclipped, _ = heat_within(-free, free)
    here = segment.y[0] if segment.seen[0] else begin[fit.model.zone]
    temperature = np.append(here, path[:-1]) + fit.reference
    out = load_frame(plant, index, clipped, unclipped, temperature)
    return _bent(out, segment.plan, plant, coef, fit).assign(zeta=zeta)


def _bent(out: pd.DataFrame, plan: ChannelPlan, plant: Plant, coef: np.ndarray, fit: LeadFit) -> pd.DataFrame:
    """Stages whose heat is not in proportion: those that give the heat that is asked of them."""
    names, full = fit.segment.channels.names, dict((*plant.heating, *plant.cooling))
    for role in full.keys() & {role for role, _, _ in plan.knots}:
        grid = np.linspace(0.0, plant.most[role], _GRID)
        heat = next(c for known, c in plan.fixed if known == role) * grid
        for name, knot, c in plan.knots:
            if name == role:
                heat = heat + coef[names.index(f"{role}_{knot:.2g}")] * c * bent(grid, knot, dict(plan.tops)[role])
        share = _rising(heat / full[role], grid)  # the stage in proportion that gives as much
        for column in (role, f"{role}_unclipped"):
            even = out[column].to_numpy()
            out[column] = np.where(even < grid[-1], np.interp(even, share, grid), even)
    return out


def _rising(given: np.ndarray, proportional: np.ndarray) -> np.ndarray:
    """The nearest curve that rises everywhere, between the same ends.

    The bends are learned from rooms whose thermostat chose the stage.  Where they leave a curve flat or falling, any of
    many stages gives the heat, and the first of them may be far below what a building runs at.
    """
    least = _LEAST_SLOPE * proportional
    return isotonic_regression(given - least, y_min=0.0, y_max=proportional[-1] - least[-1]) + least


def _plant(plan: ChannelPlan, coef: np.ndarray, fit: LeadFit) -> Plant:
    """What heats and cools: stages of a given or a fitted capacity; a measured heat tells of no limit."""
    names = fit.segment.channels.names
    most = {role: max(1.0, top) for role, top in plan.tops}
    capacity = {role: c for role, c in plan.fixed if role.startswith("u_")}
    capacity |= {role: sign * coef[names.index(role)] for role, sign in plan.stages}
    heating = tuple((role, q) for role, q in capacity.items() if q > 0)
    cooling = tuple((role, q) for role, q in capacity.items() if q < 0)
    beyond = np.inf if any(role.startswith("Q_") for role, _ in plan.fixed) else 0.0
    lower = sum(q * most[role] for role, q in cooling) - beyond
    upper = sum(q * most[role] for role, q in heating) + beyond
    return Plant(heating, cooling, most, lower, upper)


def _augmented(
    fit: LeadFit, known: OriginState, segment: Segment, zeta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The network with the emitter's store: transition, forcing of the rows without the plant, effect of 1 kW."""
    M, coef, plan, channels = known.matrices, known.coef, segment.plan, segment.channels
    n, nb = len(M.A), segment.boundary.shape[1]
    unit = M.B[:, nb:]
    held = coef[-1] if plan.emitter else 0.0
    a = np.exp(-fit.model.step / np.exp(known.psi[-1]))
    A, effect = np.zeros((n + 1, n + 1)), np.empty(n + 1)
    A[:n, :n], A[:n, n], A[n, n] = M.A, held * unit[:, plan.heated], a
    effect[:n], effect[n] = (1.0 - held) * unit[:, plan.heated], 1.0 - a
    heat = channels.heat(np.where(channels.solar, coef[: len(channels.names)], 0.0), n)
    heat[:, plan.zone] += zeta
    forcing = np.zeros((segment.n_rows, n + 1))
    forcing[:, :n] = segment.boundary @ M.B[:, :nb].T + heat @ unit.T
    return A, forcing, effect
