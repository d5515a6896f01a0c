"""Law of a thermostat and its plant: what they make of the network's ideal load, learned by boosted trees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...control import LoadPaths
from .boosted_trees import BoostedTrees, fit_trees
from .law_features import LawRows, further_features, network_features, same_clock, same_plan

#: ways to forecast load and temperature, and their shares where nothing is known of their errors
MEMBERS = ("network", "network, corrected", "direct", "last week")
PRIOR = np.array([0.25, 0.30, 0.35, 0.10])
_PAIRS, _PER_ORIGIN = 8000, 24  # pairs of origin and lead that the trees see, in all and of one origin, at most
_BLOCK_DAYS = 4  # days per block of the cross-fitting
_GOLDEN = 0.6180339887498949  # its multiples spread the leads evenly


class PlantLaw(NamedTuple):
    """Trees by one state of knowledge."""

    heat_correction: BoostedTrees  # of the network's ideal load [kW]
    temperature_correction: BoostedTrees  # of the temperature under it [K]
    heat: BoostedTrees  # the load [kW]
    temperature: BoostedTrees  # of the network's temperature [K], by the load that is forecast too


class LawPairs(NamedTuple):
    """Pairs of origin and lead: features, and what was measured."""

    network: np.ndarray  # (n, k) float32, features that the corrections see
    further: np.ndarray  # (n, m) float32, those that a direct regression sees too
    heat: np.ndarray  # (n, 2) measured, and the network's ideal [kW]
    temperature: np.ndarray  # (n, 2) measured, and the network's [degC]
    ends: np.ndarray  # (n,) int, the row at which a pair was known

    def before(self, row: int) -> LawPairs:
        """Pairs that were known before a row."""
        return LawPairs(*(part[self.ends < row] for part in self))

    def joined_with(self, other: LawPairs) -> LawPairs:
        """These pairs and others."""
        return LawPairs(*(np.concatenate(parts) for parts in zip(self, other, strict=True)))


def make_pairs(rows: LawRows, origins: np.ndarray, ideal: LoadPaths, n_known: int) -> LawPairs:
    """Pairs whose target was measured within the first ``n_known`` rows."""
    count = int(np.clip(_PAIRS // max(len(origins), 1), 1, _PER_ORIGIN))
    at = np.repeat(np.arange(len(origins)), count)
    lead = (np.arange(len(at)) * _GOLDEN % 1.0 * ideal.heat.shape[1]).astype(np.int64)
    ends = origins[at] + lead + 1
    known = ends < n_known
    known[known] = np.isfinite(rows.T[ends[known]])
    at, lead, ends = at[known], lead[known], ends[known]
    own, begin = ideal.rows(at), origins[at]
    heat, T = own.at(lead)
    network, further = _features(rows, own, begin, lead)
    measured = np.column_stack([rows.T[ends], T])
    return LawPairs(network, further, np.column_stack([rows.heat[ends - 1], heat]), measured, ends)


def _features(rows: LawRows, paths: LoadPaths, origins: np.ndarray, lead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Features of pairs as they are kept."""
    network, further = network_features(rows, paths, origins, lead), further_features(rows, origins, lead)
    return network.astype(np.float32), further.astype(np.float32)


def _as_seen(network: np.ndarray, further: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Features of the corrections, and of the direct regressions."""
    return network.astype(np.float64), np.hstack([network, further]).astype(np.float64)


def learn(pairs: LawPairs, per_day: int, weight: np.ndarray | None = None) -> PlantLaw:
    """Trees from pairs, as many as there are weights (n,).

    The load by which the temperature is learned is cross-fitted: in every other block of days it is forecast by trees
    that were fitted on the blocks between.
    """
    (heat, ideal), (T, network) = pairs.heat.T, pairs.temperature.T
    of_network, X = _as_seen(pairs.network, pairs.further)
    block = pairs.ends // (_BLOCK_DAYS * per_day) % 2
    unseen = np.empty(len(X))
    for own in (block == 0, block == 1):
        unseen[own] = fit_trees(X[~own], heat[~own], None if weight is None else weight[~own]).predict(X[own])
    return PlantLaw(
        fit_trees(of_network, heat - ideal, weight),
        fit_trees(of_network, T - network, weight),
        fit_trees(X, heat, weight),
        fit_trees(np.column_stack([X, unseen, unseen - ideal]), T - network, weight),
    )


def member_paths(rows: LawRows, origins: np.ndarray, ideal: LoadPaths, law: PlantLaw, leads: np.ndarray) -> np.ndarray:
    """(O, L, 2, M) load [kW] and temperature [degC] by each member at some leads, counted from 0."""
    at, lead = np.repeat(np.arange(len(origins)), len(leads)), np.tile(leads, len(origins))
    own, begin = ideal.rows(at), origins[at]
    of_network, X = _as_seen(*_features(rows, own, begin, lead))
    heat, T = own.at(lead)
    corrected = heat + law.heat_correction.predict(of_network), T + law.temperature_correction.predict(of_network)
    load = law.heat.predict(X)
    direct = load, T + law.temperature.predict(np.column_stack([X, load, load - heat]))
    targets = np.minimum(begin + lead, len(rows.T) - 1)
    holds = same_plan(rows, targets)
    earlier = same_clock(rows, begin, targets)
    week = [np.where(holds & np.isfinite(old), old, new) for old, new in zip(earlier, corrected, strict=True)]
    found = np.stack([np.column_stack(pair) for pair in ((heat, T), corrected, direct, week)], axis=-1)
    return found.reshape(len(origins), len(leads), 2, len(MEMBERS))


def member_errors(rows: LawRows, origins: np.ndarray, ideal: LoadPaths, law: PlantLaw, leads: np.ndarray) -> np.ndarray:
    """(O, L, 2, M) errors, measured less forecast; NaN where nothing was measured."""
    ends = origins[:, None] + leads + 1
    at = np.minimum(ends, len(rows.T) - 1)
    measured = np.stack([rows.heat[at - 1], rows.T[at]], axis=-1)
    measured = np.where((ends < len(rows.T))[..., None], measured, np.nan)
    return measured[..., None] - member_paths(rows, origins, ideal, law, leads)
