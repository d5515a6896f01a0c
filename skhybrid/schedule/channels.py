"""What enters linearly: the sun by node, schedules of gains and of conductance, further stages, a lagging emitter.

Each channel is a known series of heat [kW per unit of its coefficient] into one node.  A schedule is a level, an hourly
profile that weekdays and weekends share, and an hourly contrast between the two; each of them is shrunk by itself.  The
contrast that a training has found is then one channel for every day of the week, which turns that day into one of the
other kind: in part where Saturdays differ from Sundays, wholly where the weekend has moved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from .._table import ZoneTable
from ..thermal import RCNetwork

#: groups of coefficients that are shrunk alike
GROUPS = ("free", "gain_hour", "gain_day_type", "ua_hour", "ua_day_type", "turned")
#: a stage need not give its heat in proportion: shares of its largest training value at which its slope may change
_KNOTS = (0.2, 0.45)
_HOURS, _DAYS = 24, 7
#: a unit of the conductance schedule is the heat at this difference [K]
UA_DIFFERENCE = 10.0
#: hours from solar noon at which the parts of a day are centred, where no facades are given, and their half-width
_PARTS = {"morning": -3.5, "noon": 0.0, "afternoon": 3.5}
_PART_WIDTH = 3.5


class ChannelPlan(NamedTuple):
    """Which channels a model has: fixed by its training table."""

    network: RCNetwork
    sun: tuple[str, ...]  # irradiance roles
    fixed: tuple[tuple[str, float], ...]  # heat of a known capacity [kW per unit of the role]
    stages: tuple[tuple[str, float], ...]  # stages whose capacity is sought, with its sign
    knots: tuple[tuple[str, float, float], ...]  # stages whose slope may change, where, and the capacity [kW]
    tops: tuple[tuple[str, float], ...]  # largest training value of each stage
    mean_outdoor: float  # [degC]
    noon: float  # hour (UTC where known) at which the sun is highest
    calendar: bool
    contrast: tuple[tuple[float, ...], ...] = ()  # (2, 24) as learned: of gains, and of conductance times its unit [kW]

    @property
    def emitter(self) -> bool:
        """Whether there is heat that an emitter could hold back."""
        return bool(self.fixed)

    @property
    def zone(self) -> int:
        """Place of the node that schedules heat."""
        return self.network.nodes.index(self.network.disturbed_nodes[0])

    @property
    def heated(self) -> int:
        """Place of the node that equipment heats."""
        heated = self.network.heated
        return self.network.nodes.index(heated) if isinstance(heated, str) else self.zone


class Channels(NamedTuple):
    """The linear inputs of one table, the emitter's left out."""

    names: tuple[str, ...]
    series: np.ndarray  # (N, J) heat per unit coefficient
    node: np.ndarray  # (J,) int, node that a channel heats
    positive: np.ndarray  # (J,) bool, coefficient >= 0
    group: np.ndarray  # (J,) int, place in GROUPS

    @property
    def scheduled(self) -> np.ndarray:
        """(J,) bool, heat that nobody measures: schedules of gains and of conductance."""
        return self._begin_with("gain", "ua")

    @property
    def solar(self) -> np.ndarray:
        """(J,) bool, irradiance."""
        return self._begin_with("q_sol")

    def _begin_with(self, *prefixes: str) -> np.ndarray:
        return np.array([name.startswith(prefixes) for name in self.names])

    def scheduled_heat(self, coef: np.ndarray) -> np.ndarray:
        """(N,) heat of the schedules under coefficients that begin with the channels' (J,) [kW]."""
        mine = self.scheduled
        return self.series[:, mine] @ coef[: len(mine)][mine]

    def heat(self, coef: np.ndarray, n_nodes: int) -> np.ndarray:
        """(N, n_nodes) heat into every node under coefficients (J,) [kW]."""
        by_node = np.zeros((len(self.names), n_nodes))
        by_node[np.arange(len(self.names)), self.node] = coef
        return self.series @ by_node


def make_plan(network: RCNetwork, table: ZoneTable, known: Mapping[str, float], calendar: bool) -> ChannelPlan:
    """Choose the channels that a table can feed.

    Measured heat has no parameter.  Without it the scale of a network is free, so that one stage's capacity is taken as
    known: the given one, or 6 kW.
    """
    measured = tuple((role, 1.0) for role in table.inputs if role.startswith("Q_"))
    stages = [role for role in table.inputs if role.startswith("u_")]
    stages.sort(key=lambda role: (not role.startswith("u_heat"), not role.startswith("u_cool"), role))
    sign = {role: -1.0 if role.startswith("u_cool") else 1.0 for role in stages}
    capacity = {source.role: source.parameter for source in network.sources(stages)}
    given = [(role, float(known[str(capacity[role])])) for role in stages if capacity[role] in known]
    if not measured and not given and stages:
        moved = [role for role in stages if np.ptp(table.inputs[role]) > 0] or stages
        given = [(moved[0], 6.0 * sign[moved[0]])]
    taken = {role for role, _ in given}
    sun = tuple(role for role in table.inputs if role.startswith("q_sol"))
    tops = {role: float(table.inputs[role].max()) for role in stages}
    knots = tuple((role, share * tops[role], c) for role, c in given for share in _KNOTS if tops[role] > 0)
    return ChannelPlan(
        network,
        sun,
        (*measured, *given),
        tuple((role, sign[role]) for role in stages if role not in taken),
        knots,
        tuple(tops.items()),
        float(table.inputs["T_oa"].mean()) if "T_oa" in table.inputs else 0.0,
        _noon(table, sun),
        calendar,
    )


def _noon(table: ZoneTable, sun: tuple[str, ...]) -> float:
    """Local hour around which a table's irradiance lies."""
    total = np.sum([table.inputs[role] for role in sun], axis=0) if sun else np.zeros(table.n_rows)
    angle = 2.0 * np.pi * _sun_hour(table) / _HOURS
    x, y = np.sum(total * np.cos(angle)), np.sum(total * np.sin(angle))
    return float(np.arctan2(y, x) * _HOURS / (2.0 * np.pi)) % _HOURS if np.hypot(x, y) > 0 else 12.0


def _sun_hour(table: ZoneTable) -> np.ndarray:
    """(N,) hour of a clock that no daylight saving moves."""
    time = table.time if table.utc is None else table.utc.tz_localize(None)
    return np.asarray((time - time.normalize()) / pd.Timedelta("1h"), dtype=np.float64)


def heat_of(plan: ChannelPlan, table: ZoneTable) -> np.ndarray:
    """(N,) known heat into the heated node [kW]."""
    heat = np.zeros(table.n_rows)
    for role, capacity in plan.fixed:
        heat += capacity * table.inputs[role]
    return heat


def make_channels(plan: ChannelPlan, table: ZoneTable) -> Channels:
    """The channels of a table but for the emitter's, whose series depends on its time constant."""
    parts = [*_sunlight(plan, table), *_equipment(plan, table), *_schedules(plan, table), *_turned(plan, table)]
    names, columns, node, positive, group = zip(*parts, strict=True)
    return Channels(
        names,
        np.column_stack(columns),
        np.array(node, dtype=np.int64),
        np.array(positive, dtype=bool),
        np.array([GROUPS.index(g) for g in group], dtype=np.int64),
    )


def _sunlight(plan: ChannelPlan, table: ZoneTable):
    """Every irradiance on every node; the horizontal one alone is split into parts of the day, which face the sun."""
    beams = {role: table.inputs[role] for role in plan.sun}
    if len(beams) == 1:
        role, light = next(iter(beams.items()))
        away = (_sun_hour(table) - plan.noon + 12.0) % _HOURS - 12.0
        beams = {
            f"{role}_{part}": light * np.clip(1.0 - np.abs(away - centre) / _PART_WIDTH, 0.0, 1.0)
            for part, centre in _PARTS.items()
        }
    for role, light in beams.items():
        for i, node in enumerate(plan.network.nodes):
            yield f"{role}->{node}", light, i, True, "free"


def _equipment(plan: ChannelPlan, table: ZoneTable):
    for role, sign in plan.stages:
        yield role, sign * table.inputs[role], plan.heated, True, "free"
    tops = dict(plan.tops)
    for role, knot, capacity in plan.knots:
        yield f"{role}_{knot:.2g}", capacity * bent(table.inputs[role], knot, tops[role]), plan.heated, False, "free"


def bent(stage: np.ndarray, knot: float, top: float) -> np.ndarray:
    """How a stage's heat may leave the straight line: most at the knot, not at all at 0 and from the top on.

    So the heat of the full stage stays that of its capacity, and a stage that was not seen is not bent.
    """
    return np.minimum(stage, knot) - np.minimum(stage, top) * knot / top


def _drives(plan: ChannelPlan, table: ZoneTable) -> dict[str, np.ndarray]:
    """What the schedules multiply."""
    drives = {"gain": np.ones(table.n_rows)}
    if "T_oa" in table.inputs:
        drives["ua"] = (table.inputs["T_oa"] - plan.mean_outdoor) / UA_DIFFERENCE
    return drives


def _contrast(table: ZoneTable) -> np.ndarray:
    """(N,) 1 on weekends, -1 on weekdays."""
    return np.where(table.time.day_of_week.to_numpy() >= 5, 1.0, -1.0)


def _schedules(plan: ChannelPlan, table: ZoneTable):
    drives = _drives(plan, table)
    every = drives["gain"]
    yield "gain", every, plan.zone, False, "free"
    if "ua" in drives:
        yield "ua", drives["ua"], plan.zone, False, "ua_hour"
    if not plan.calendar:
        return
    hour, contrast = table.time.hour.to_numpy(), _contrast(table)
    for kind, drive in drives.items():
        for group, sign in ((f"{kind}_hour", every), (f"{kind}_day_type", contrast)):
            for h in range(_HOURS):
                yield f"{group}_{h}", (hour == h) * drive * sign, plan.zone, False, group


def _turned(plan: ChannelPlan, table: ZoneTable):
    """Heat of a day of the other kind less that of its own, for every day of the week."""
    if not plan.contrast:
        return
    hour, day = table.time.hour.to_numpy(), table.time.day_of_week.to_numpy()
    of_hour = dict(zip(("gain", "ua"), np.array(plan.contrast), strict=True))
    weekend = sum(of_hour[kind][hour] * drive for kind, drive in _drives(plan, table).items())
    other = -2.0 * _contrast(table) * weekend
    for d in range(_DAYS):
        yield f"gain_turned_{d}", (day == d) * other, plan.zone, False, "turned"


def with_contrast(plan: ChannelPlan, names: Sequence[str], coef: np.ndarray) -> ChannelPlan:
    """A plan that knows how weekends differ from weekdays by fitted coefficients of the channels ``names``."""
    found = dict(zip(names, coef, strict=False))  # the emitter's is the last, and has no name
    contrast = np.array([[found.get(f"{kind}_day_type_{h}", 0.0) for h in range(_HOURS)] for kind in ("gain", "ua")])
    return plan._replace(contrast=tuple(map(tuple, contrast.tolist()))) if contrast.any() else plan


class EmitterStore(NamedTuple):
    """An emitter between two segments of rows."""

    held: float  # what it gave back in the last row [kW]
    given: float  # what it was given in that row [kW]


def emitter_series(
    heat: np.ndarray, step: float, time_constant: float, store: EmitterStore | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """What a lagging emitter gives back later of the heat it was given, less what it takes: ``z - heat``.

    ``z[k+1] = a z[k] + (1 - a) heat[k]`` with ``a = exp(-step / time_constant)``; also its derivative by the logarithm
    of the time constant [h].  It begins with a ``store``, or as if the first row's heat had always been given.
    """
    a = np.exp(-step / time_constant)
    held, given = store if store is not None else (heat[0], heat[0])
    before = np.concatenate([[given], heat[:-1]])
    z, _ = lfilter([1.0 - a], [1.0, -a], before, zi=[a * held])
    da = a * step / time_constant
    behind = np.concatenate([[held], z[:-1]])
    return z - heat, lfilter([1.0], [1.0, -a], da * (behind - before))
