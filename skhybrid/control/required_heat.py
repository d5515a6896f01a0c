"""The heat that holds a set-point (paper Eqs. 15 and 16), and the plant that delivers it."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import is_cooling
from ..filtering import simulate_inverse
from .setpoints import Band, Limits

RINGING = 0.25  # a load that overshoots by a larger share than this from step to step rings
_GROWTH = 1.0 + 1e-6  # largest growth per step of the state under an inverse that is stable
MOST_AHEAD = 24  # longest hold of a load that is tried [steps]


class HeatedZone(NamedTuple):
    """One measured node and the plant that heats and cools it."""

    A: np.ndarray  # (n, n) over one step
    heat: np.ndarray  # (2, n) effect of 1 kW of the plant over a step, where it heats and where it cools
    output: np.ndarray  # (n,) output row of the measured node


class WantedPaths(NamedTuple):
    """Set-points that a plant shall keep from some origins on."""

    band: Band  # (N,) of the rows of a table [degC]
    limits: Limits  # (O,) of the plant, from each origin on
    delivered: np.ndarray | None = None  # (O,) heat of the origins' own rows [kW], where the plant begins after them
    #: boundary temperatures that heat is sought without knowing ahead, such as those of neighbours
    unforeseen: tuple[str, ...] = ()
    #: (O, K) values of some of these after each origin [degC] in place of the table's; the last one holds
    boundary: Mapping[str, np.ndarray] = MappingProxyType({})


class LoadPaths(NamedTuple):
    """Heat of the rows ``origin``, ``origin + 1``, ... from some origins, and the temperature at the end of each."""

    heat: np.ndarray  # (O, L) [kW]
    temperature: np.ndarray  # (O, L) [degC]
    zeta: np.ndarray  # (O, L) unmeasured heat [kW, or K for an output disturbance]

    def rows(self, chosen: np.ndarray) -> LoadPaths:
        """The paths of some of the origins."""
        return LoadPaths(*(part[chosen] for part in self))

    def at(self, lead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heat and temperature (O,) at one lead of each path, counted from 0."""
        row = np.arange(len(lead))
        return self.heat[row, lead], self.temperature[row, lead]


def required_heat(
    zone: HeatedZone,
    band: Band,
    limits: Limits,
    forcing: np.ndarray,
    offset: np.ndarray,
    begins: np.ndarray,
    states: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Heat (N,) [kW] that brings the temperature into a band at the end of every row, and that temperature (N,) [degC].

    ``forcing`` (N, n) is the effect of all but the plant over each step; the temperature includes ``offset`` (N,) [K].
    Spans begin at the rows ``begins`` (n_spans,), from 0, with node temperatures ``states`` (n_spans, n) [degC].
    """
    ahead = steps_ahead(*zone)
    low, high = band.heating - offset, band.cooling - offset
    loads, paths = [], []
    for a, b, state in zip(begins, np.append(begins[1:], len(forcing)), states, strict=True):
        rows = slice(a, b)
        bounds = low[rows], high[rows], limits.lower[rows], limits.upper[rows]
        load, path = simulate_inverse(zone.A, forcing[rows], zone.heat, zone.output, *bounds, state, ahead)
        loads.append(load)
        paths.append(path)
    return np.concatenate(loads), np.concatenate(paths) + offset


def heat_column(names: Container[object], ending: str = "") -> str:
    """The column of a load that holds the heat of the whole plant; beside stages ``Q_hvac`` may be that of a meter."""
    return f"Q_total{ending}" if f"Q_total{ending}" in names else f"Q_hvac{ending}"


def steps_ahead(A: np.ndarray, heat: np.ndarray, c: np.ndarray) -> int:
    """Steps for which a load is assumed to be held when it is sought (1: paper Eq. 16 itself).

    ``heat`` (2, n) is the effect of 1 kW of a plant that heats, and of one that cools; the longer hold of both counts.
    The state under the load that meets every set-point at once follows ``A - b (c A) / (c b)``.  With a negative
    eigenvalue each load overshoots and the next takes it back; with one above 1 the load runs away.  The shortest hold
    that damps both is taken.
    """
    return max(_least_hold(A, effect, c) for effect in np.unique(heat, axis=0))


def _least_hold(A: np.ndarray, heat: np.ndarray, c: np.ndarray) -> int:
    """Steps for which heat (n,) [kW] of one effect is held."""
    held, power = np.array(heat, dtype=np.float64), np.array(A, dtype=np.float64)
    for ahead in range(1, MOST_AHEAD):
        effect = c @ held
        if effect != 0:
            inverse = np.linalg.eigvals(A - np.outer(heat, c @ power) / effect)
            if inverse.real.min() > -RINGING and np.abs(inverse).max() < _GROWTH:
                return ahead
        held, power = heat + A @ held, A @ power
    return MOST_AHEAD


class Plant(NamedTuple):
    """Stages that heat and cool the zone, and their capacities, and the metered heat beside them."""

    heating: tuple[tuple[str, float], ...]  # (role, capacity [kW]) of the stages that heat
    cooling: tuple[tuple[str, float], ...]  # the same of those that cool, capacity < 0
    most: Mapping[str, float]  # highest stage of each role
    lower: float  # [kW], 0 or less; -inf where heat was measured
    upper: float  # [kW], 0 or more; inf where heat was measured
    meters: Mapping[str, tuple[float, float]]  # least and most measured heat [kW] of each role

    def full(self, stages: Sequence[tuple[str, float]]) -> float:
        """Heat [kW] of some of the stages, each at its highest."""
        return sum(q * self.most[role] for role, q in stages)

    def within(self, limits: Limits) -> Limits:
        """The narrower of given limits and the capacity of the stages."""
        return limits.within(self.lower, self.upper)


def make_plant(capacity: Mapping[str, float], inputs: Mapping[str, np.ndarray]) -> Plant:
    """Plant of a training table, from the capacity [kW] of each stage.

    Measured heat sets no limit; beside stages it does so only on the sides, heating and cooling, where it ever acted.
    """
    roles = sorted(capacity, key=lambda role: (not role.startswith("u_heat"), not is_cooling(role), role))
    most = {role: max(1.0, float(inputs[role].max())) for role in roles}
    heating = tuple((role, q) for role, q in capacity.items() if q > 0)
    cooling = tuple((role, q) for role, q in capacity.items() if q < 0)
    measured = ((role, heat) for role, heat in inputs.items() if role.startswith("Q_"))
    meters = {role: (float(heat.min(initial=0.0)), float(heat.max(initial=0.0))) for role, heat in measured}
    cools, heats = (any(ends[end] for ends in meters.values()) or bool(meters and not most) for end in (0, 1))
    lower = sum(q * most[role] for role, q in cooling) - (np.inf if cools else 0.0)
    upper = sum(q * most[role] for role, q in heating) + (np.inf if heats else 0.0)
    return Plant(heating, cooling, most, lower, upper, meters)


def load_frame(
    plant: Plant, index: pd.Index, clipped: np.ndarray, unclipped: np.ndarray, temperature: np.ndarray, zeta: np.ndarray
) -> pd.DataFrame:
    """Heat [kW] and stages [-], clipped and not, the ``temperature`` (N,) [degC] under the clipped load, ``zeta`` (N,).

    Every stage has its columns; one without capacity stays at 0.  Beside stages metered heat has the columns of its
    roles, with what is left where the stages give what they can; a sum of all is then ``Q_total`` if one is ``Q_hvac``.
    """
    meters = plant.meters if plant.most else {}
    roles = (*plant.most, *meters)
    out = {role + suffix: np.zeros(len(index)) for suffix in ("", "_unclipped") for role in roles}
    for suffix, heat in (("", np.clip(clipped, plant.lower, plant.upper)), ("_unclipped", unclipped)):
        for end, side, stages in ((1, np.maximum, plant.heating), (0, np.minimum, plant.cooling)):
            left, metered = side(heat, 0.0), sum(ends[end] for ends in meters.values())
            if stages:
                full = plant.full(stages)
                share = np.minimum(np.abs(left / full), 1.0 if metered else np.inf)
                left = left - share * full
                out |= {role + suffix: share * plant.most[role] for role, _ in stages}
            for role, ends in meters.items() if metered else ():
                out[role + suffix] = out[role + suffix] + left * (ends[end] / metered)
        out[("Q_total" if "Q_hvac" in meters else "Q_hvac") + suffix] = heat
    out["T_za"], out["zeta"] = temperature, zeta
    return pd.DataFrame(out, index=index)
