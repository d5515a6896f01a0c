"""Blend weights of several models by lead, from their errors on left-out weeks and on the history."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...filtering import simplex_weights

#: ends of the groups of leads, and the leads that their weights are those of, as shares of the horizon
_ENDS, _CENTRES = np.array([2, 8, 24]) / 24.0, np.array([1, 5, 16]) / 24.0
GROUP_NAMES = ("first twelfth", "to a third", "the rest")
PULL = 0.3  # pull toward prior weights, beside the harmonic mean of the models' squared errors
_HALF_LIFE = 14.0  # days after which an error of the history counts half


def lead_groups(leads: np.ndarray, n_leads: int) -> np.ndarray:
    """Group of every lead."""
    return np.minimum(np.searchsorted(_ENDS * n_leads, leads), len(_ENDS) - 1)


def moments(errors: np.ndarray, groups: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(n_groups, K, K) sums of products of the models' errors (O, L, K), by ``share`` (O, L), where none is NaN."""
    K = errors.shape[2]
    out = np.zeros((len(_ENDS), K, K))
    known = np.isfinite(errors).all(axis=2) & (share > 0)
    E, weight, group = errors[known], share[known], np.broadcast_to(groups, known.shape)[known]
    for g in range(len(_ENDS)):
        mine = group == g
        if mine.any():
            out[g] = (E[mine] * weight[mine][:, None]).T @ E[mine] / int((groups == g).sum())
    return out


def faded(age: np.ndarray) -> np.ndarray:
    """Weight of an error, by its age [days]; 0 before it was known."""
    return np.where(age >= 0, 0.5 ** (np.maximum(age, 0.0) / _HALF_LIFE), 0.0)


def blend_weights(products: np.ndarray, prior: np.ndarray | None = None, pull: float = PULL) -> np.ndarray:
    """(n_groups, K) weights that are not negative and sum to 1, with the least squared error of the blend.

    A ridge of size ``pull`` pulls toward the ``prior`` (K,), or equal ones, which hold where nothing is known.
    """
    K = products.shape[1]
    prior = np.full(K, 1.0 / K) if prior is None else prior
    own = np.diagonal(products, axis1=1, axis2=2)
    most = np.where(own.max(axis=1) > 0.0, own.max(axis=1), 1.0)
    # the harmonic mean, as a pull in proportion to the error of a model that has run away would keep it in
    size = 1.0 / np.mean(1.0 / np.maximum(own, 1e-9 * most[:, None]), axis=1)
    M = products / size[:, None, None] + pull * np.eye(K)
    return np.asarray(simplex_weights(M, pull * prior))


def by_lead(weights: np.ndarray, n_leads: int, span: int) -> np.ndarray:
    """Weights (span, K) of leads 1 ... span, joined by straight lines between the groups of ``n_leads``."""
    return np.asarray(_group_shares(n_leads, span) @ weights)


@lru_cache(maxsize=64)
def _group_shares(n_leads: int, span: int) -> np.ndarray:
    """(span, n_groups) share of each group in the leads 1 ... span."""
    leads = np.arange(1, span + 1)
    return np.column_stack([np.interp(leads, _CENTRES * n_leads, one) for one in np.eye(len(_CENTRES))])
