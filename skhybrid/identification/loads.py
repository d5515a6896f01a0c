"""Loads and plans of an identified network: its matrices, states and limits for the control functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._table import ZoneTable, is_plant, is_stage, listed
from ..control import (
    FREE,
    HeatedZone,
    Limits,
    LinearNetwork,
    Plant,
    gain_of,
    impulse_response,
    load_frame,
    make_plant,
    read_limits,
    read_setpoint,
    required_heat,
)
from ..thermal import RCNetwork
from .filtered_network import FilteredNetwork, ForecastStart


def plant_of(network: RCNetwork, theta: Mapping[str, float], table: ZoneTable) -> Plant:
    """The plant of a training table, with the identified capacities."""
    sources = network.sources(table.inputs)
    capacities: dict[str, float] = {}
    for source in sources:
        if is_stage(source.role) and source.parameter:  # a shared stage has a capacity per zone
            capacities[source.role] = capacities.get(source.role, 0.0) + theta[source.parameter]
    return make_plant(capacities, table.inputs)


def network_load(
    filtered: FilteredNetwork,
    plant: Plant,
    table: ZoneTable,
    origins: np.ndarray,
    start: ForecastStart,
    setpoint: Any,
    limits: Any,
) -> pd.DataFrame:
    """Load of the rows from the first origin on; ``setpoint`` and ``limits`` are as in ``predict_load``, by these."""
    kalman, network = filtered.kalman, filtered.network
    if len(kalman.measured) > 1 or kalman.n_gains > 1:
        raise ValueError(
            f"network {network.name} has several zones, whose loads depend on one another; a load is "
            "predicted for one measured and disturbed node only."
        )
    here = table.rows(slice(int(origins[0]), None))
    counts = np.diff(np.append(origins, table.n_rows))
    heat, offset = (
        np.concatenate([path[:n] for path, n in zip(paths, counts, strict=True)])
        for paths in (start.heat, start.offset[..., 0])
    )
    forcing = _without_plant(filtered, table)[origins[0] :] @ kalman.B.T + heat @ kalman.heat.T
    zone = HeatedZone(kalman.A, _unit_heat(filtered, plant), np.eye(kalman.n)[kalman.measured[0]])
    band, within = read_setpoint(setpoint, here), plant.within(read_limits(limits, here))
    (clipped, path), (unclipped, _) = (
        required_heat(zone, band, chosen, forcing, offset, origins - origins[0], start.states)
        for chosen in (within, Limits.constant(*FREE, here.n_rows))
    )
    measured = np.ravel(filtered.measurements(here))[:1]
    first = np.where(np.isfinite(measured), measured, zone.output @ start.states[0] + start.offset_now[0])
    zeta = heat[:, 0]
    if offset.any():  # of an output disturbance, which is added to the temperature at the end of a row
        zeta = np.append(first - zone.output @ start.states[0], offset[:-1])
    return load_frame(plant, here.index, clipped, unclipped, np.append(first, path[:-1]), zeta)


def _without_plant(filtered: FilteredNetwork, table: ZoneTable) -> np.ndarray:
    """(N, m) inputs of the rows with nothing that heats or cools."""
    inputs = filtered.experiment(table).inputs.copy()
    for j, role in enumerate(filtered.network.inputs(filtered.roles)):
        if is_plant(role):
            inputs[:, j] = 0.0
    return inputs


def _unit_heat(filtered: FilteredNetwork, plant: Plant) -> np.ndarray:
    """(2, n) effect on the states of 1 kW of the plant over a step, where it heats and where it cools.

    Stages of a side run in proportion, as in ``load_frame``.  A side without a plant is felt as the other one.
    """
    network, B = filtered.network, filtered.kalman.B
    columns = dict(zip(network.inputs(filtered.roles), B.T, strict=False))
    sides = []
    for end, stages in ((1, plant.heating), (0, plant.cooling)):
        metered = [role for role, ends in plant.meters.items() if ends[end]]
        effects = [columns[role] for role in metered]
        if stages:
            at_most = [columns[role] * plant.most[role] for role, _ in stages]
            effects.append(np.sum(at_most, axis=0) / plant.full(stages))
        if not np.allclose(effects, effects[:1]):
            named = listed([*(role for role, _ in stages), *metered])
            raise ValueError(
                f"network {network.name}: {named} act on different nodes, so the effect of a load is unclear; name one "
                "node for them in heated=."
            )
        sides.append(effects[:1])
    heats, cools = sides
    if heats or cools:
        return np.array([*(heats or cools), *(cools or heats)])
    if network.heated == network.disturbed:
        return np.tile(B[:, -1], (2, 1))
    raise ValueError("the network has no heating or cooling input, so no load can be predicted.")


def plan_gain(known: FilteredNetwork, roles: Sequence[str], n_rows: int) -> np.ndarray:
    """(H, H, m) gain of the temperature by a plan [K per kW or stage], with a last axis of several measured nodes."""
    kalman = known.kalman
    C = np.eye(kalman.n)[kalman.measured]
    gain = gain_of(impulse_response(kalman.A, kalman.B[:, input_places(known, roles)], C, n_rows))
    return gain[..., 0] if len(C) == 1 else gain


def linear_network(
    known: FilteredNetwork,
    roles: Sequence[str],
    inputs: np.ndarray,
    nodes: np.ndarray,
    heat: np.ndarray,
    offset: np.ndarray,
) -> LinearNetwork:
    """The network from an origin on, under ``inputs`` (N, p) of which those of a plan are left out.

    ``nodes`` (n,) [degC] at the origin; ``heat`` (N, d) [kW] is the disturbance over each step, ``offset`` (N, o) [K]
    what the output has beyond the network at each row.  An output disturbance is one more state per output.
    """
    kalman, chosen = known.kalman, input_places(known, roles)
    others = inputs.copy()
    others[:, chosen] = 0.0
    A, B, C = kalman.A, kalman.B[:, chosen], np.eye(kalman.n)[kalman.measured]
    forcing, names = others @ kalman.B.T + heat @ kalman.heat.T, known.network.states
    if offset.any():
        o = len(C)
        A = np.pad(A, (0, o))
        B, C = np.pad(B, ((0, o), (0, 0))), np.hstack([C, np.eye(o)])
        forcing, nodes = np.hstack([forcing, np.vstack([offset[1:], offset[-1:]])]), np.append(nodes, offset[0])
        names = (*names, *(f"zeta_{name}" for name in known.network.measured_names))
    return LinearNetwork(A, B, C, nodes, forcing, tuple(names))


def input_places(known: FilteredNetwork, roles: Sequence[str]) -> list[int]:
    """Columns of the network's inputs."""
    names = list(known.network.inputs(known.roles))
    return [names.index(role) for role in roles]
