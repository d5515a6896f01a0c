"""Derivatives of the periodic likelihood by its parameters, from those of the filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...filtering import ChannelAdjoint, Discrete
from ...thermal import Parameter
from ..gain_model import VarianceModel
from .periodic_channels import ChannelLayout, SegmentSeries


class PeriodicMatrices(NamedTuple):
    """Matrices of one evaluation."""

    values: dict[str, float]
    discrete: Discrete
    heat: np.ndarray  # (n, n) effect of 1 kW on each node
    phi: float
    sigma: np.ndarray  # (n_classes,) [kW]
    A: np.ndarray  # (n + d, n + d)
    columns: np.ndarray  # (n + d, J)
    Q: np.ndarray  # (n_classes, n + d, n + d)
    C: np.ndarray  # (o, n + d)
    R: np.ndarray  # (o,)


class Slopes:
    """Derivatives of the objective by every parameter, gathered over the segments."""

    def __init__(self, layout: ChannelLayout, model: PeriodicMatrices) -> None:
        self.layout, self.model = layout, model
        n = len(model.heat)
        self.A, self.Q = np.zeros_like(model.A), np.zeros(len(model.sigma))
        self.boundary = np.zeros((n, len(layout.network.boundaries)))
        self.heat = np.zeros((n, n))
        self.log_sigma, self.R = np.zeros(len(model.sigma)), 0.0
        self.by_value = dict.fromkeys(model.values, 0.0)

    def add(self, segment: SegmentSeries, adjoint: ChannelAdjoint, known_heat: np.ndarray) -> None:
        """Add a segment's share."""
        model, n = self.model, len(self.model.heat)
        known = adjoint.known[:, :n]
        self.A += adjoint.A
        self.boundary += known.T @ segment.boundary
        self.heat += known.T @ known_heat
        for j, channel in enumerate(self.layout.channels):
            self.heat[:, channel.node] += adjoint.columns[:n, j + 1]
        self.Q += np.trace(adjoint.Q[:, n:, n:], axis1=1, axis2=2)
        first = segment.klass[0]
        self.log_sigma[first] += 2.0 * model.sigma[first] ** 2 * np.trace(adjoint.P0[n:, n:])
        self.R += float(adjoint.R.sum())
        self._add_known(segment, known @ model.heat)

    def _add_known(self, segment: SegmentSeries, heat_by: np.ndarray) -> None:
        """Searched capacities, areas and fractions that act through the known heat."""
        layout, values, by_value = self.layout, self.model.values, self.by_value
        for source in layout.sources:
            if source.parameter in layout.inner or source.parameter is None:
                continue
            left = 1.0 - sum(values[f] for _, f in source.shares if f)
            flows = heat_by.T @ segment.inputs[:, layout.columns[source.role]]
            gain = values[source.parameter]
            rest = next(flows[layout.place[node]] for node, fraction in source.shares if fraction is None)
            for node, fraction in source.shares:
                flow = float(flows[layout.place[node]])
                by_value[source.parameter] += flow * (values[fraction] if fraction else left)
                if fraction:
                    by_value[fraction] += gain * (flow - float(rest))

    def by_free(self, searched: Sequence[Parameter], variance: VarianceModel, hours: float) -> np.ndarray:
        """(p,) derivatives on the searched scale; ``hours`` is the step."""
        network, (values, d, _, phi, sigma, *_) = self.layout.network, self.model
        n, by_value = len(self.heat), self.by_value
        heat = self.heat.copy()
        for i, node in enumerate(self.layout.disturbed):
            heat[:, node] += self.A[:n, n + i]
        B = np.hstack([self.boundary, heat])
        for q, p in enumerate(network.parameters(network.boundaries)):
            by_value[p.name] = float(np.sum(self.A[:n, :n] * d.dA[q]) + np.sum(B * d.dB[q]))
        phi_bar = float(np.trace(self.A[n:, n:])) - 2.0 * phi * float(self.Q @ sigma**2)
        by_value["tau"] = phi_bar * phi * hours / values["tau"] ** 2
        by_value["sigma_y"] = 2.0 * values["sigma_y"] * self.R
        logs = (self.log_sigma + 2.0 * sigma**2 * (1.0 - phi**2) * self.Q) @ variance.variance
        by_log = dict(zip(variance.names, logs, strict=True))
        out = [by_log.get(p.name, by_value[p.name] * p.slope(values[p.name])) for p in searched]
        return np.array(out, dtype=np.float64)
