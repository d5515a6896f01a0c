"""Nested identifications and the likelihood-ratio test between them."""

from __future__ import annotations

from typing import Any, NamedTuple

from scipy import stats


class Nesting(NamedTuple):
    """Parameters that are free in the larger model only."""

    at_edge: tuple[str, ...]  # resistances, infinite in the smaller
    inside: tuple[str, ...]  # parameters that the smaller takes as known


def nesting(smaller: Any, larger: Any) -> Nesting | None:
    """The difference of two fitted identifications if the first is a special case of the second; else None."""
    if type(smaller) is not type(larger):
        return None
    first, second = (model.get_params(deep=False) for model in (smaller, larger))
    free = {"network", "known", "bounds", "n_starts", "n_jobs", "random_state", "verbose"}
    if any(repr(first[name]) != repr(second[name]) for name in first if name not in free):
        return None
    within, also_within = (dict(model.bounds or {}) for model in (smaller, larger))
    if any(within.get(name) != also_within.get(name) for name in (*smaller.theta_.index, *smaller.disturbance_.index)):
        return None
    resistors = _without_resistors(smaller.network_, larger.network_)
    known, also = (dict(model.known or {}) for model in (smaller, larger))
    edge = () if resistors is None else tuple(name for name in resistors if name not in also)
    shared_known = {name: value for name, value in also.items() if name in known or name not in (resistors or ())}
    if resistors is None or len(edge) != len(resistors) or any(known.get(n) != v for n, v in shared_known.items()):
        return None
    inside = tuple(name for name in known if name not in also and name in larger.theta_.index)
    return Nesting(edge, inside) if edge or inside else None


def _without_resistors(small: Any, large: Any) -> tuple[str, ...] | None:
    """Resistors of the larger network that the smaller one lacks; None where they differ in more than that."""
    same = ("capacitances", "solar", "measured", "disturbed", "heated")
    if any(getattr(small, name) != getattr(large, name) for name in same):
        return None
    ends = {name: frozenset(pair) for name, pair in large.resistors.items()}
    if any(ends.get(name) != frozenset(pair) for name, pair in small.resistors.items()):
        return None
    shared = [name for name in small.bounds if name in large.bounds]
    if any(small.bounds[name] != large.bounds[name] for name in shared):
        return None
    return tuple(name for name in large.resistors if name not in small.resistors)


def likelihood_ratio(gain: float, n_edge: int, n_inside: int) -> tuple[float, str, float]:
    """Statistic, its distribution as text, and p-value of a gain in log-likelihood.

    Of the additional parameters of the larger model, the smaller one fixes ``n_edge`` at the edge of their range and
    ``n_inside`` within it.
    """
    statistic = max(2.0 * gain, 0.0)
    weights = {n_inside + j: float(stats.binom.pmf(j, n_edge, 0.5)) for j in range(n_edge + 1)}
    # chi2(0) is the constant 0
    p_value = sum(w * (stats.chi2.sf(statistic, d) if d else float(statistic <= 0.0)) for d, w in weights.items())
    words = " + ".join(f"{w:g} chi2({d})" if w < 1.0 else f"chi2({d})" for d, w in weights.items())
    return statistic, words, float(p_value)
