"""Channels of the periodic model: the inputs whose coefficients are solved inside, by segment of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...thermal import RCNetwork, Source
from ..disturbance_models import first_state, measured_states
from ..experiment import Experiment
from ..gain_model import VENTILATION_SD, profile_basis, ventilation_series, week_cells


class PeriodicChannel(NamedTuple):
    """One input with an unknown coefficient, which heats ``node`` by ``coefficient`` kW per unit."""

    name: str
    node: int
    sign: float = 0.0  # +1: the coefficient is not negative, -1: not positive, 0: free
    sd: float = np.inf  # prior standard deviation for a plant of 6 kW
    times: str | None = None  # the parameter that multiplies ``sd``


class SegmentSeries(NamedTuple):
    """One segment of rows, ready for the filter."""

    y: np.ndarray  # (N, o)
    series: np.ndarray  # (N, J) of every channel; column 0 is that of the measurement
    boundary: np.ndarray  # (N, k) boundary temperatures
    inputs: np.ndarray  # (N, m)
    klass: np.ndarray  # (N,)
    s0: np.ndarray  # (n + d,)


@dataclass(frozen=True)
class ChannelLayout:
    """Heat sources of a network: those whose coefficient, one of ``inner``, is solved inside, and the others."""

    network: RCNetwork
    roles: tuple[str, ...]
    inner: tuple[str, ...]

    @cached_property
    def place(self) -> dict[str, int]:
        """Place of every node among the states."""
        return {node: i for i, node in enumerate(self.network.nodes)}

    @cached_property
    def disturbed(self) -> list[int]:
        """Places of the disturbed nodes; each has a gain state and a profile."""
        return [self.place[node] for node in self.network.disturbed_nodes]

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Everything that heats the network."""
        return self.network.sources(self.roles)

    @cached_property
    def columns(self) -> dict[str, int]:
        """Column of every role among the inputs."""
        return {role: j for j, role in enumerate(self.network.inputs(self.roles))}

    @cached_property
    def plain(self) -> tuple[tuple[PeriodicChannel, str], ...]:
        """Capacities and areas that are solved inside, with the role of each."""
        out = []
        for source in self.sources:
            if source.parameter not in self.inner:
                continue
            for node, fraction in source.shares:
                sign = -1.0 if source.parameter.startswith("Q_c") else 1.0
                sign = sign if source.parameter.startswith(("A_win", "Q_h", "Q_c")) else 0.0
                name = f"{source.parameter}:{fraction or ''}" if len(source.shares) > 1 else source.parameter
                out.append((PeriodicChannel(name, self.place[node], sign), source.role))
        return tuple(out)

    @cached_property
    def channels(self) -> tuple[PeriodicChannel, ...]:
        """Inputs with a coefficient that is solved inside: :attr:`plain`, then the gain of every disturbed node."""
        basis, sd, times = profile_basis()
        out = [channel for channel, _ in self.plain]
        for node in self.disturbed:
            out += [PeriodicChannel(f"profile_{j}", node, 0.0, sd[j], times[j]) for j in range(basis.shape[1])]
            if self.ventilated:
                out.append(PeriodicChannel("ventilation", node, 0.0, VENTILATION_SD))
        return tuple(out)

    @property
    def ventilated(self) -> bool:
        """Whether there is an outdoor temperature, so that ventilation can be told."""
        return "T_oa" in self.columns

    @property
    def n_plain(self) -> int:
        """Coefficients without those of the gain."""
        return len(self.plain)

    @cached_property
    def signs(self) -> np.ndarray:
        """(n_plain,) sign that each of those coefficients must have; 0 for either."""
        return np.array([channel.sign for channel, _ in self.plain])

    def series(self, segment: Experiment, klass: np.ndarray) -> SegmentSeries:
        """One segment of rows as the filter reads it; ``klass`` (N,) is the class of variance of every row."""
        cells = profile_basis()[0][week_cells(segment)]
        columns = [np.zeros(len(cells)), *(segment.inputs[:, self.columns[role]] for _, role in self.plain)]
        outputs = list(measured_states(self.network))
        for node in self.disturbed:
            columns += list(cells.T)
            if self.ventilated:
                output = outputs.index(node) if node in outputs else 0
                columns.append(ventilation_series(segment, segment.inputs[:, self.columns["T_oa"]], output))
        boundary = np.ascontiguousarray(segment.inputs[:, : len(self.network.boundaries)])
        series = np.ascontiguousarray(np.array(columns).T)
        s0 = first_state(self.network, segment.firsts, len(self.disturbed))
        return SegmentSeries(np.ascontiguousarray(segment.outputs), series, boundary, segment.inputs, klass, s0)

    def known_sources(self, values: Mapping[str, float]) -> Iterator[tuple[Source, float, float]]:
        """Sources whose coefficient is not solved inside, each with its kW per unit and the share of its remainder."""
        for source in self.sources:
            if source.parameter not in self.inner:
                gain = 1.0 if source.parameter is None else values[source.parameter]
                yield source, gain, 1.0 - sum(values[f] for _, f in source.shares if f)

    def known_heat(self, segment: SegmentSeries, values: Mapping[str, float]) -> np.ndarray:
        """(N, n) heat into every node by inputs whose coefficient is not solved inside [kW]."""
        heat = np.zeros((len(segment.y), len(self.place)))
        for source, gain, left in self.known_sources(values):
            for node, fraction in source.shares:
                share = values[fraction] if fraction else left
                heat[:, self.place[node]] += gain * share * segment.inputs[:, self.columns[source.role]]
        return heat


def physical(
    plain: Sequence[PeriodicChannel], values: Mapping[str, float], beta: np.ndarray
) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Network parameters from searched values and inner coefficients, and their derivatives by the coefficients."""
    theta, turn, unit = dict(values), {}, np.eye(len(beta))
    shares: dict[str, list[tuple[str, int]]] = {}  # of each capacity or area: fraction and coefficient
    for j, channel in enumerate(plain):
        name, _, fraction = channel.name.partition(":")
        shares.setdefault(name, []).append((fraction, j))
    for name, parts in shares.items():
        theta[name] = sum(float(beta[j]) for _, j in parts)
        turn[name] = unit[[j for _, j in parts]].sum(axis=0)
        total = max(theta[name], 1e-9)
        for fraction, j in parts:
            if fraction:
                theta[fraction] = float(beta[j]) / total if theta[name] > 0 else 0.5
                turn[fraction] = (unit[j] - theta[fraction] * turn[name]) / total
    return theta, turn
