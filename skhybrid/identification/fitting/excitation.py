"""Warnings of what a table cannot identify: the scale, gains of inputs that never ran, too few days."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from ..._table import ZoneTable, is_stage
from ..._time import FEW_DAYS
from ..._warnings import warn_user
from ...exceptions import ExcitationWarning, ScaleNotIdentifiableWarning
from ...thermal import Parameter, RCNetwork

#: power of the scale by which what stores, collects or delivers heat rises and what resists it falls, by unit
_SCALES = {"kWh/K": 1.0, "m2": 1.0, "kW": 1.0, "K/kW": -1.0}
#: least heat of a stage that tells its capacity where the model has a disturbance, in hours at full stage: in summers
#: of make_office, Q_h is within 8 % after 0.4 to 1 h, and 63 % off at its default
_FULL_HOURS = 0.25


def scaling_of(p: Parameter) -> float:
    """Power by which a parameter of a network rises with its scale: 1, -1, or 0 of a share."""
    return _SCALES.get(p.unit, 0.0)


def fixing_scale(network: RCNetwork, inputs: Mapping[str, np.ndarray], known: Iterable[str]) -> set[str]:
    """The ``known`` parameters that fix the scale of a network: those of its own whose input is not 0 in all rows."""
    scaled = {p.name for p in network.parameters(inputs) if scaling_of(p)}
    idle = {s.parameter for s in network.sources(inputs) if not np.any(inputs[s.role])}
    return {*known} & scaled - idle


def warn_scale(network: RCNetwork, table: ZoneTable, known: Iterable[str], name: str) -> None:
    """Warn where nothing fixes the scale of the network (design ruling 3)."""
    measured_heat = [r for r, v in table.inputs.items() if r.startswith("Q_") and np.ptp(v) > 0]
    if measured_heat or fixing_scale(network, table.inputs, known):
        return
    parameters = network.parameters(table.inputs)
    up, down = (", ".join(p.name for p in parameters if scaling_of(p) == way) for way in (1.0, -1.0))
    direction = f"{up} together, {down} inversely"
    stages = [s for s in network.sources(table.inputs) if is_stage(s.role) and np.any(table.inputs[s.role])]
    remedy = f"fix one parameter, such as {stages[0].nameplate}" if stages else "fix one of them by known="
    warn_user(
        f"{name}: the scale of the network is not identifiable: {direction} leave every prediction as it is; {remedy}, "
        "or give a measured Q_hvac.",
        ScaleNotIdentifiableWarning,
    )


def unexcited(
    network: RCNetwork, table: ZoneTable, known: Iterable[str], name: str, *, disturbed: bool
) -> tuple[str, ...]:
    """Gains whose input never or hardly ran; warns of them and of others that the rows can hardly identify.

    A model that is ``disturbed`` explains by its disturbance what a stage of an hour does not; one that is not would
    explain all of it by the capacity.
    """
    known = set(known)
    roles = {s.parameter: s.role for s in network.sources(table.inputs) if s.parameter is not None}
    idle = {p: role for p, role in roles.items() if _is_idle(table, role, disturbed)}
    _warn_little_excited(network, table, known, idle, name)
    out = [p for p in idle if p not in known]
    areas = {p for p in roles if p.startswith("A_win")}
    if areas <= idle.keys() and areas & {*out}:
        out += [f for f in network.solar_fractions if f not in known]
    if out:
        what = ", ".join(_idleness(table, role) for role in sorted({*idle.values()}))
        warn_user(
            f"{name}: {what}, so {', '.join(out)} cannot be identified and stays at its default; pass it in known= or "
            "add days on which it ran.",
            ExcitationWarning,
        )
    return tuple(out)


def _is_idle(table: ZoneTable, role: str, disturbed: bool) -> bool:
    if disturbed and is_stage(role):
        return float(np.abs(table.inputs[role]).sum()) * table.step_hours < _FULL_HOURS
    return table.hardly_ran(role) or not np.any(table.inputs[role])


def _idleness(table: ZoneTable, role: str) -> str:
    return (
        f"{role} ran for {table.hours_run(role):.2g} h only"
        if table.inputs[role].any()
        else f"{role} is 0 in every row"
    )


def _warn_little_excited(
    network: RCNetwork, table: ZoneTable, known: set[str], idle: Collection[str], name: str
) -> None:
    """Warn of inputs that never change, plants that hardly ran, and less than two days, with what they leave open."""
    found = []
    still = {role for role, v in table.inputs.items() if np.ptp(v) == 0}
    sources = [s for s in network.sources(table.inputs) if np.any(table.inputs[s.role])]
    for role in sorted(still):
        open_ = [r for r, ends in network.resistors.items() if role in ends]
        open_ += [s.parameter for s in sources if s.role == role and s.parameter]
        found.append((f"{role} is the same in every row", open_))
    network_of_heat = [*network.capacitances.values(), *network.resistors]
    found += [
        (_idleness(table, s.role), network_of_heat if s.parameter is None else [s.parameter])
        for s in sources
        if s.role not in still and s.parameter not in idle and table.hardly_ran(s.role)
    ]
    if table.n_rows * table.step < FEW_DAYS:
        found.append((f"{table.n_rows * table.step_hours:g} h of rows are few", list(network.capacitances.values())))
    for what, names in found:
        if open_names := [p for p in names if p not in known]:
            warn_user(
                f"{name}: {what}, so {', '.join(open_names)} can hardly be identified; pass it in known= or add days.",
                ExcitationWarning,
            )
