"""A zone with its neighbours' temperatures as boundaries, blended with the zone by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
import pandas as pd

from ...forecasting.quantiles import LeftOut
from ...thermal import RCNetwork
from ..base import BaseHybrid
from ..blending.blend import GROUP_NAMES, blend_weights, by_lead, lead_groups, moments
from .zone_columns import NEXT

#: shares of a zone by itself and with neighbours where the training says nothing; chosen on coupled rooms and an office
_PRIOR = np.array([0.6, 0.4])


def with_neighbours(network: RCNetwork, neighbours: Sequence[str]) -> RCNetwork:
    """A zone's network with a resistance between its measured node and the air of each neighbour, a boundary."""
    node = network.measured_nodes[0]
    partitions = {f"R_{node}_{other}": (node, NEXT + other) for other in neighbours}
    return replace(network, name=f"{network.name} with neighbours", resistors={**network.resistors, **partitions})


@dataclass(frozen=True)
class CoupledZone:
    """The predictor of a zone that knows its neighbours, and how much of its forecast counts."""

    neighbours: tuple[str, ...]
    model: BaseHybrid
    weights: np.ndarray  # (n_groups, 2) of the zone by itself, and of this one
    ratio: np.ndarray  # (n_leads,) spread of the blend's errors relative to those of the zone by itself

    @property
    def roles(self) -> list[str]:
        """Boundaries of the network that are neighbours."""
        return [NEXT + other for other in self.neighbours]

    @property
    def shares(self) -> pd.Series:
        """Share of this forecast, by group of leads."""
        return pd.Series(self.weights[:, 1], list(GROUP_NAMES))

    def share_by_row(self, n_rows: int, first_lead: int) -> np.ndarray:
        """(n_rows,) share of this forecast in rows of which the first has lead 1, or 0: the measured origin."""
        return np.append(np.zeros(1 - first_lead), self.share(n_rows - 1 + first_lead))

    def blended(
        self, own: Mapping[str, np.ndarray], coupled: Mapping[str, np.ndarray], first_lead: int
    ) -> dict[str, np.ndarray]:
        """The blend of the columns of the zone by itself and of this forecast.

        Quantiles of T_za are those of the zone by itself, around the blend, wider or narrower by :meth:`widths`.
        """
        n_rows = len(own["T_za"])
        share = self.share_by_row(n_rows, first_lead)
        widths = np.append(np.ones(1 - first_lead), self.widths(n_rows - 1 + first_lead))
        found = {
            name: (1.0 - share) * values + share * coupled[name] for name, values in own.items() if name in coupled
        }
        T = found["T_za"]
        moved = {name: T + (own[name] - own["T_za"]) * widths for name in own if name.startswith("q_")}
        return {name: moved[name] if name in moved else found[name] for name in own}

    def share(self, n_leads: int) -> np.ndarray:
        """(n_leads,) share of this forecast."""
        return by_lead(self.weights, len(self.ratio), n_leads)[:, 1]

    def widths(self, n_leads: int) -> np.ndarray:
        """(n_leads,) factor on the width of the intervals of the zone by itself; the last one holds on."""
        return self.ratio[np.minimum(np.arange(n_leads), len(self.ratio) - 1)]


def at_common_origins(parts: Sequence[LeftOut]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Origins that all of some errors have, and each of the errors there."""
    origins = reduce(np.intersect1d, [part.origins for part in parts])
    return origins, [part.errors[np.searchsorted(part.origins, origins)] for part in parts]


def couple(
    model: BaseHybrid, zone: str, neighbours: tuple[str, ...], own: Mapping[str, LeftOut], gain: np.ndarray
) -> tuple[CoupledZone, LeftOut]:
    """Weigh a zone's predictor with neighbours by its left-out errors, and the errors of the blend.

    Its errors are those under the neighbours' true temperatures, and what the errors of their own forecasts make of
    them by its ``gain`` (n_leads, n_leads, n_neighbours) [K/K].
    """
    parts = [own[zone], model.left_out_errors(), *(own[other] for other in neighbours)]
    origins, (alone, errors, *others) = at_common_origins(parts)
    for k, missed in enumerate(others):
        errors = errors + missed @ gain[:, :, k].T
    n_leads = alone.shape[1]
    both = np.stack([alone, errors], axis=-1)
    groups = lead_groups(np.arange(1, n_leads + 1), n_leads)
    weights = blend_weights(moments(both, groups, np.ones(alone.shape)), _PRIOR)
    blended = np.sum(both * by_lead(weights, n_leads, n_leads), axis=-1)
    spread = [np.sqrt(np.mean(e**2, axis=0)) if len(e) else np.ones(n_leads) for e in (blended, alone)]
    ratio = np.clip(spread[0] / np.maximum(spread[1], 1e-9), 0.2, 1.5)
    return CoupledZone(neighbours, model, weights, ratio), LeftOut(blended, origins)
