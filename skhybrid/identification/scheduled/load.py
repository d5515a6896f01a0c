"""The load of a scheduled network: forward from each origin, the emitter's store being one more state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..._contract import ZoneTable
from ..._kernels import filter_gains, filter_series, simulate_inverse, simulate_path
from ..load import Plant, load_frame, steps_ahead
from ..setpoints import Band, Limits
from .adaptation import Later
from .channels import Plan, bent, emitter_series
from .fit import LeadFit
from .model import NOISE, Matrices
from .responses import Stretch

#: stages at which the heat of one that is not in proportion is worked out; every knot is among them where it runs to 1
_GRID = 101


def loads(
    fit: LeadFit,
    later: Later,
    origins: np.ndarray,
    learned: Sequence[tuple[np.ndarray, np.ndarray]],
    table: ZoneTable,
    first: int,
    setpoint: Band,
    limits: Limits,
) -> pd.DataFrame:
    """Heat that keeps the rows from ``first`` on within their set-points, each origin's up to the next one.

    Parameters
    ----------
    fit : LeadFit
    later : Later
    origins : ndarray of int, shape (n_origins,)
        Increasing; the first one is ``first``.
    learned : sequence of (psi, coef)
        What is known at each origin.
    table : ZoneTable
        The rows of ``later``.
    first : int
    setpoint : Band
        Of the rows from ``first`` on [degC].
    limits : Limits
        [kW].

    Returns
    -------
    DataFrame
        As the identifications give it, and ``zeta`` [kW].
    """
    ends = np.append(origins[1:], table.n_rows)
    frames = []
    for origin, end, known in zip(origins, ends, learned, strict=True):
        rows = slice(origin - first, end - first)
        band = Band(*(side[rows] for side in setpoint))
        within = Limits(*(side[rows] for side in limits))
        frames.append(_load_from(fit, later.stretch, int(origin), int(end), known, table, band, within))
    # a stage whose capacity came out as 0 at one origin delivers nothing there
    return pd.concat(frames).fillna(0.0) if len(frames) > 1 else frames[0]


def _load_from(
    fit: LeadFit,
    stretch: Stretch,
    origin: int,
    end: int,
    known: tuple[np.ndarray, np.ndarray],
    table: ZoneTable,
    setpoint: Band,
    limits: Limits,
) -> pd.DataFrame:
    """The rows from an origin up to ``end``, by what is known at the origin."""
    psi, coef = known
    M = fit.model.matrices(psi)
    plant = _plant(stretch.plan, coef, fit)
    state, heat = _standing(fit, M, psi, coef, stretch, origin)
    zeta = heat[origin:end] + state[-2] * M.F[-1, -1] ** np.arange(end - origin)
    A, forcing, effect = _augmented(fit, M, psi, coef, stretch, zeta, origin, end)
    c, begin = np.eye(len(A))[fit.model.zone], np.append(state[:-2], state[-1])
    band = [side - fit.reference for side in setpoint]
    free = np.full(end - origin, np.inf)
    ahead = steps_ahead(A, effect, c)
    clipped, path = simulate_inverse(A, forcing, effect, c, *band, *plant.within(limits), begin, ahead)
    unclipped, _ = simulate_inverse(A, forcing, effect, c, *band, -free, free, begin, ahead)
    here = stretch.y[origin] if stretch.seen[origin] else begin[fit.model.zone]
    temperature = np.append(here, path[:-1]) + fit.reference
    out = load_frame(plant, table.index[origin:end], clipped, unclipped, temperature)
    return _bent(out, stretch.plan, plant, coef, fit).assign(zeta=zeta)


def _bent(out: pd.DataFrame, plan: Plan, plant: Plant, coef: np.ndarray, fit: LeadFit) -> pd.DataFrame:
    """Stages whose heat is not in proportion: those that give the heat that is asked of them."""
    names, full = fit.stretch.channels.names, dict((*plant.heating, *plant.cooling))
    for role in full.keys() & {role for role, _, _ in plan.knots}:
        grid = np.linspace(0.0, plant.most[role], _GRID)
        heat = next(c for known, c in plan.fixed if known == role) * grid
        for name, knot, c in plan.knots:
            if name == role:
                heat = heat + coef[names.index(f"{role}_{knot:.2g}")] * c * bent(grid, knot, dict(plan.tops)[role])
        share = np.maximum.accumulate(heat / full[role])  # the stage in proportion that gives as much
        for column in (role, f"{role}_unclipped"):
            even = out[column].to_numpy()
            out[column] = np.where(even < grid[-1], np.interp(even, share, grid), even)
    return out


def _plant(plan: Plan, coef: np.ndarray, fit: LeadFit) -> Plant:
    """What heats and cools: stages of a given or a fitted capacity; a measured heat tells of no limit."""
    names = fit.stretch.channels.names
    most = {role: max(1.0, top) for role, top in plan.tops}
    capacity = {role: c for role, c in plan.fixed if role.startswith("u_")}
    capacity |= {role: sign * coef[names.index(role)] for role, sign in plan.stages}
    heating = tuple((role, q) for role, q in capacity.items() if q > 0)
    cooling = tuple((role, q) for role, q in capacity.items() if q < 0)
    beyond = np.inf if any(role.startswith("Q_") for role, _ in plan.fixed) else 0.0
    lower = sum(q * most[role] for role, q in cooling) - beyond
    upper = sum(q * most[role] for role, q in heating) + beyond
    return Plant(heating, cooling, most, lower, upper)


def _standing(
    fit: LeadFit, M: Matrices, psi: np.ndarray, coef: np.ndarray, stretch: Stretch, origin: int
) -> tuple[np.ndarray, np.ndarray]:
    """At an origin: nodes, tracked heat and the emitter's store; and the scheduled heat of all rows [kW]."""
    seen = stretch.until(origin + 1)
    forcing = _node_heat(seen, coef) @ M.B[:, -len(M.A) :].T + seen.boundary @ M.B[:, : seen.boundary.shape[1]].T
    store = 0.0
    delivered = _delivered(seen, coef)
    unit = M.B[:, seen.boundary.shape[1] + seen.plan.heated]
    if seen.plan.emitter:
        given = seen.heat if origin else np.zeros(1)  # what acts over the origin's own row is sought
        lag, _ = emitter_series(given, fit.model.step, np.exp(psi[-1]))
        delivered = delivered + coef[-1] * lag
        store = lag[-1] + given[-1]
    path = simulate_path(M.A, forcing + np.outer(delivered, unit), np.zeros(len(M.A)))
    gains, _ = filter_gains(M.F, M.Q, fit.model.output, NOISE**2, M.P0, M.dF[..., :0], M.dQ[..., :0], seen.seen)
    left = np.where(seen.seen, seen.y - path[: origin + 1, fit.model.zone], 0.0)
    held = filter_series(M.F, gains, fit.model.zone, left[:, None], np.array([origin]))[0, :, 0]
    scheduled = [name.startswith(("gain", "ua")) for name in stretch.channels.names]
    heat = stretch.channels.series[:, scheduled] @ coef[: len(scheduled)][scheduled]
    return np.concatenate([path[origin] + held[:-1], held[-1:], [store]]), heat


def _is_equipment(stretch: Stretch) -> np.ndarray:
    """(J,) channels that are stages of the plant."""
    return np.array([name.startswith("u_") for name in stretch.channels.names])


def _node_heat(stretch: Stretch, coef: np.ndarray) -> np.ndarray:
    """(N, n) heat into every node of the sun and the schedules [kW]."""
    channels, J = stretch.channels, len(stretch.channels.names)
    share = np.where(_is_equipment(stretch), 0.0, coef[:J])
    heat = np.zeros((stretch.n_rows, len(stretch.plan.network.nodes)))
    for i in range(heat.shape[1]):
        mine = np.flatnonzero((channels.node == i) & (share != 0))
        heat[:, i] = channels.series[:, mine] @ share[mine]
    return heat


def _delivered(stretch: Stretch, coef: np.ndarray) -> np.ndarray:
    """(N,) heat of the plant [kW]."""
    own = np.flatnonzero(_is_equipment(stretch))
    return stretch.heat + stretch.channels.series[:, own] @ coef[own]


def _augmented(
    fit: LeadFit,
    M: Matrices,
    psi: np.ndarray,
    coef: np.ndarray,
    stretch: Stretch,
    zeta: np.ndarray,
    origin: int,
    end: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The network with the emitter's store: transition, forcing of the rows without the plant, effect of 1 kW."""
    n, nb = len(M.A), stretch.boundary.shape[1]
    unit = M.B[:, nb:]
    held = coef[-1] if stretch.plan.emitter else 0.0
    a = np.exp(-fit.model.step / np.exp(psi[-1]))
    A, effect = np.zeros((n + 1, n + 1)), np.empty(n + 1)
    A[:n, :n], A[:n, n], A[n, n] = M.A, held * unit[:, stretch.plan.heated], a
    effect[:n], effect[n] = (1.0 - held) * unit[:, stretch.plan.heated], 1.0 - a
    channels, J = stretch.channels, len(stretch.channels.names)
    window = channels._replace(series=channels.series[origin:end])
    sun = np.array([name.startswith("q_sol") for name in channels.names])
    only = np.where(sun, coef[:J], 0.0)
    heat = np.zeros((end - origin, n))
    for i in range(n):
        mine = np.flatnonzero((channels.node == i) & sun)
        heat[:, i] = window.series[:, mine] @ only[mine]
    heat[:, stretch.plan.zone] += zeta
    forcing = np.zeros((end - origin, n + 1))
    forcing[:, :n] = stretch.boundary[origin:end] @ M.B[:, :nb].T + heat @ unit.T
    return A, forcing, effect
