"""Channels of the schedule model: heat inputs with a coefficient (sun, equipment and its part-load curve, schedules).

Each channel is a known series of heat [kW per unit of its coefficient] into one node.  A schedule is a level, an hourly
profile that weekdays and weekends share, and an hourly contrast between the two; each of them is shrunk by itself.  The
contrast found by a fit also makes one channel per day of the week, which swaps that day's type: partly where Saturdays
differ from Sundays, wholly where the weekend has moved.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from .._calendar import clock_hour, one_hot
from .._clock import hour_of_day
from .._table import ZoneTable, is_cooling, is_plant, is_stage, listed
from ..thermal import RCNetwork
from ..thermal.parameters import check_known

#: groups of coefficients that are shrunk alike
GROUPS = ("free", "gain_hour", "gain_day_type", "ua_hour", "ua_day_type", "swapped")
_KNOTS = (0.2, 0.45)  # knots of the part-load curve, as shares of a stage's largest training value
_HOURS, _DAYS = 24, 7
UA_DIFFERENCE = 10.0  # a unit of the conductance schedule is the heat at this difference from the mean T_oa [K]
#: parts of the day that replace facades where there is one irradiance only: centre [h from solar noon], half-width [h]
_DAY_PARTS = {"morning": -3.5, "noon": 0.0, "afternoon": 3.5}
_HALF_WIDTH = 3.5


class ChannelPlan(NamedTuple):
    """Channels of a model, as chosen for its training table."""

    network: RCNetwork
    irradiance: tuple[str, ...]  # roles
    known: tuple[tuple[str, float], ...]  # roles of known heat, with their capacity [kW per unit of the role]
    stages: tuple[tuple[str, float], ...]  # stages whose capacity is fitted, with its sign
    knots: tuple[tuple[str, float, float], ...]  # part load: stage, knot [-], capacity [kW]
    max_stages: tuple[tuple[str, float], ...]  # largest training value of each stage
    mean_outdoor: float  # [degC]
    noon: float  # hour (UTC where known) at which the sun is highest
    calendar: bool  # whether there are schedules
    contrast: tuple[tuple[float, ...], ...] = ()  # (2, 24) fitted day-type contrast [kW]: gain, and ua per unit
    lags: bool = True  # whether known heat may be delayed

    @property
    def emitter(self) -> bool:
        """Whether there is known heat, which an emitter may delay."""
        return self.lags and bool(self.known)

    @property
    def zone(self) -> int:
        """Index of the node into which schedules give their heat."""
        return self.network.nodes.index(self.network.disturbed_nodes[0])

    @property
    def heated(self) -> int:
        """Index of the node into which equipment gives its heat."""
        if isinstance(self.network.heated, str):
            return self.network.nodes.index(self.network.heated)
        nodes = _heated_nodes(self.network, (role for role, _ in (*self.known, *self.stages)))
        return self.network.nodes.index(nodes[0]) if nodes else self.zone


class Block(NamedTuple):
    """Channels that are alike, over the rows of a table."""

    names: Sequence[str]  # (k,)
    series: np.ndarray  # (N, k) heat per unit coefficient [kW]
    node: Sequence[int]  # (k,) index of the node that each heats
    positive: bool  # whether the coefficients are at least 0
    group: str  # one of GROUPS


class Channels(NamedTuple):
    """All channels of a table but the emitter's, whose series depends on its time constant."""

    names: tuple[str, ...]
    series: np.ndarray  # (N, J) heat per unit coefficient [kW]
    node: np.ndarray  # (J,) int, index of the node that a channel heats
    positive: np.ndarray  # (J,) bool, coefficient >= 0
    group: np.ndarray  # (J,) int, index in GROUPS

    def first(self, n: int) -> Channels:
        """The first ``n`` of them."""
        return Channels(self.names[:n], self.series[:, :n], self.node[:n], self.positive[:n], self.group[:n])

    @property
    def scheduled(self) -> np.ndarray:
        """(J,) bool, unmeasured heat: schedules of gain and conductance."""
        return _begin_with(self.names, ("gain", "ua"))

    @property
    def solar(self) -> np.ndarray:
        """(J,) bool, irradiance."""
        return _begin_with(self.names, ("q_sol",))

    def scheduled_heat(self, coef: np.ndarray) -> np.ndarray:
        """(N, ...) heat of the schedules [kW]; the first J of ``coef`` (J or J + 1, ...) are those of the channels."""
        return self.series @ (self.scheduled * coef[: len(self.names)].T).T

    def heat(self, coef: np.ndarray, n_nodes: int) -> np.ndarray:
        """(N, n_nodes) heat of all channels into each node under coefficients (J,) [kW]."""
        by_node = np.zeros((len(self.names), n_nodes))
        by_node[np.arange(len(self.names)), self.node] = coef
        return self.series @ by_node


def make_plan(network: RCNetwork, table: ZoneTable, known: Mapping[str, float], calendar: bool) -> ChannelPlan:
    """Choose the channels that a table can feed; ``known`` are given capacities by parameter name [kW]."""
    _refuse_several_nodes(network, table)
    _refuse_capacities(network, table, known)
    measured = tuple((role, 1.0) for role in table.inputs if role.startswith("Q_"))
    stages = [role for role in table.inputs if is_stage(role)]
    stages.sort(key=lambda role: (not role.startswith("u_heat"), not is_cooling(role), role))
    sign = {role: -1.0 if is_cooling(role) else 1.0 for role in stages}
    capacity = {source.role: source.parameter for source in network.sources(stages)}
    given = [(role, float(known[str(capacity[role])])) for role in stages if capacity[role] in known]
    if not measured and not given and stages:  # nothing fixes the scale: a stage that runs is taken to have 6 kW
        running = [role for role in stages if np.ptp(table.inputs[role]) > 0] or stages
        given = [(running[0], 6.0 * sign[running[0]])]
    with_capacity = {role for role, _ in given}
    irradiance = tuple(role for role in table.inputs if role.startswith("q_sol"))
    largest = {role: float(table.inputs[role].max()) for role in stages}
    return ChannelPlan(
        network,
        irradiance,
        (*measured, *given),
        tuple((role, sign[role]) for role in stages if role not in with_capacity),
        tuple((role, share * largest[role], c) for role, c in given for share in _KNOTS if largest[role] > 0),
        tuple(largest.items()),
        float(table.inputs["T_oa"].mean()) if "T_oa" in table.inputs else 0.0,
        _solar_noon(table, irradiance),
        calendar,
    )


def _heated_nodes(network: RCNetwork, plants: Iterable[str]) -> tuple[str, ...]:
    """Nodes that plants heat, each once."""
    return tuple(dict.fromkeys(node for source in network.sources(plants) for node, _ in source.shares))


def _refuse_several_nodes(network: RCNetwork, table: ZoneTable) -> None:
    """Refuse a network whose plants heat several nodes, or that has several disturbed ones."""
    for field, nodes in (
        ("heated", _heated_nodes(network, filter(is_plant, table.inputs))),
        ("disturbed", network.disturbed_nodes),
    ):
        if len(nodes) > 1:
            raise ValueError(
                f"network {network.name} has the {field} nodes {listed(nodes)}, but the schedule model takes one; "
                f"name one in {field}=, or give a gray_box."
            )


def _refuse_capacities(network: RCNetwork, table: ZoneTable, known: Mapping[str, float]) -> None:
    """Refuse known values that are no capacity of the network under its usual roles or the table's, or impossible."""
    parameters = {p.name: p for p in (*network.parameters(table.inputs), *network.parameters()) if p.unit == "kW"}
    for name in known:
        if name not in parameters:
            raise ValueError(f"known= names {name!r}, but the capacities are {', '.join(parameters)}.")
    check_known(parameters.values(), known)


def _solar_noon(table: ZoneTable, irradiance: tuple[str, ...]) -> float:
    """Hour around which a table's irradiance lies."""
    total = np.sum([table.inputs[role] for role in irradiance], axis=0)  # 0 without irradiance
    angle = 2.0 * np.pi * _standard_hour(table) / _HOURS
    x, y = np.sum(total * np.cos(angle)), np.sum(total * np.sin(angle))
    return float(np.arctan2(y, x) * _HOURS / (2.0 * np.pi)) % _HOURS if np.hypot(x, y) > 0 else 12.0


def _standard_hour(table: ZoneTable) -> np.ndarray:
    """(N,) hour of day without daylight saving."""
    return hour_of_day(table.time if table.utc is None else table.utc)


def with_contrast(plan: ChannelPlan, names: Sequence[str], coef: np.ndarray) -> ChannelPlan:
    """Add the fitted contrast of weekends and weekdays to a plan; ``names`` are the channels of ``coef``."""
    found = dict(zip(names, coef, strict=False))  # the emitter's coefficient is the last one and has no name
    contrast = np.array([[found.get(f"{kind}_day_type_{h}", 0.0) for h in range(_HOURS)] for kind in ("gain", "ua")])
    return plan._replace(contrast=tuple(map(tuple, contrast.tolist()))) if contrast.any() else plan


def known_heat(plan: ChannelPlan, table: ZoneTable) -> np.ndarray:
    """(N,) known heat into the heated node [kW]."""
    return sum((capacity * table.inputs[role] for role, capacity in plan.known), np.zeros(table.n_rows))


def make_channels(plan: ChannelPlan, table: ZoneTable, like: Channels | None = None) -> Channels:
    """The channels of a table; ``like`` are those of another table under the same plan."""
    makers = (_solar_channels, _plant_channels, _schedule_channels)
    blocks = [block for make in makers for block in make(plan, table)]
    series = np.hstack([block.series for block in blocks])
    if like is not None:
        return like._replace(series=series)
    sizes = [len(block.names) for block in blocks]
    return Channels(
        tuple(name for block in blocks for name in block.names),
        series,
        np.concatenate([block.node for block in blocks]),
        np.repeat([block.positive for block in blocks], sizes),
        np.repeat([GROUPS.index(block.group) for block in blocks], sizes),
    )


@lru_cache(maxsize=128)
def _begin_with(names: tuple[str, ...], beginnings: tuple[str, ...]) -> np.ndarray:
    return np.array([name.startswith(beginnings) for name in names])


def _solar_channels(plan: ChannelPlan, table: ZoneTable) -> Iterator[Block]:
    """Each irradiance on each node; a single one is split into parts of the day, in place of facades."""
    beams = {role: table.inputs[role] for role in plan.irradiance}
    if not beams:
        return
    if len(beams) == 1:
        role, light = next(iter(beams.items()))
        from_noon = (_standard_hour(table) - plan.noon + 12.0) % _HOURS - 12.0
        far = np.abs(from_noon - np.array([*_DAY_PARTS.values()])[:, None]) / _HALF_WIDTH
        parts = light * np.maximum(1.0 - far, 0.0)
        beams = {f"{role}_{part}": series for part, series in zip(_DAY_PARTS, parts, strict=True)}
    nodes = plan.network.nodes
    names = [f"{role}->{node}" for role in beams for node in nodes]
    series = np.repeat(np.column_stack(list(beams.values())), len(nodes), axis=1)
    yield Block(names, series, [*range(len(nodes))] * len(beams), True, "free")


def _plant_channels(plan: ChannelPlan, table: ZoneTable) -> Iterator[Block]:
    fitted = dict(plan.stages)  # whose capacities are at least 0
    for name, series in equipment(plan, table).items():
        yield Block([name], series[:, None], [plan.heated], name in fitted, "free")


def equipment(plan: ChannelPlan, table: ZoneTable) -> dict[str, np.ndarray]:
    """(N,) heat per unit coefficient [kW] of stages with a fitted capacity, and of part-load curves of the others."""
    stages = {role: sign * table.inputs[role] for role, sign in plan.stages}
    largest = dict(plan.max_stages)
    return stages | {
        knot_name(role, knot): capacity * deviation(table.inputs[role], knot, largest[role])
        for role, knot, capacity in plan.knots
    }


def knot_name(role: str, knot: float) -> str:
    """Name of the channel of one knot of a stage's part-load curve."""
    return f"{role}_{knot:.2g}"


def deviation(stage: np.ndarray, knot: float, largest: float) -> np.ndarray:
    """Deviation of a part-load curve from proportional: largest at the knot, 0 at stage 0 and from ``largest`` on."""
    return np.minimum(stage, knot) - np.minimum(stage, largest) * knot / largest


def _schedule_channels(plan: ChannelPlan, table: ZoneTable) -> Iterator[Block]:
    """Levels, hourly profiles and hourly day-type contrasts of gain and conductance, and days of the other type."""
    always, zone = np.ones(table.n_rows), plan.zone
    drivers = {"gain": always}  # series that the schedules multiply
    yield Block(["gain"], always[:, None], [zone], False, "free")
    if "T_oa" in table.inputs:
        drivers["ua"] = (table.inputs["T_oa"] - plan.mean_outdoor) / UA_DIFFERENCE
        yield Block(["ua"], drivers["ua"][:, None], [zone], False, "ua_hour")
    if not plan.calendar:
        return
    hour, day_type = clock_hour(table.time), np.where(table.weekend, 1.0, -1.0)
    at = one_hot(hour, _HOURS)
    for kind, driver in drivers.items():
        for group, series in ((f"{kind}_hour", driver), (f"{kind}_day_type", driver * day_type)):
            yield Block(_numbered(group, _HOURS), at * series[:, None], [zone] * _HOURS, False, group)
    if plan.contrast:
        # heat of a day of the other type less that of its own type, for each day of the week
        by_hour = dict(zip(("gain", "ua"), np.array(plan.contrast), strict=True))
        swap = -2.0 * day_type * sum(by_hour[kind][hour] * driver for kind, driver in drivers.items())
        of_day = one_hot(table.day_of_week, _DAYS) * swap[:, None]
        yield Block(_numbered("gain_swapped", _DAYS), of_day, [zone] * _DAYS, False, "swapped")


@cache
def _numbered(name: str, n: int) -> tuple[str, ...]:
    return tuple(f"{name}_{k}" for k in range(n))
