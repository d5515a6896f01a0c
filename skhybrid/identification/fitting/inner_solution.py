"""Coefficients of the periodic model that enter linearly: a ridge regression on the filtered channels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve


@dataclass(frozen=True)
class Linear:
    """The coefficients that are solved inside, at the optimum: a ridge regression on standardised columns."""

    gamma: np.ndarray  # (J - 1,) capacities and areas, then the gain's coefficients as standard normal numbers
    free: np.ndarray  # (J - 1,) bool, False where a sign bound holds a coefficient at 0
    normal: np.ndarray  # (J - 1, J - 1) of the normal equations, ridge included
    scale: np.ndarray  # (J - 1,) prior standard deviations, 1 for capacities and areas

    @cached_property
    def beta(self) -> np.ndarray:
        """(J - 1,) capacities and areas, then the coefficients of the gain's channels [kW]."""
        return self.gamma * self.scale

    @cached_property
    def covariance(self) -> np.ndarray:
        """(J - 1, J - 1) covariance of ``beta`` given the searched parameters."""
        inverse, chosen = np.zeros_like(self.normal), np.ix_(self.free, self.free)
        inverse[chosen] = np.linalg.pinv(self.normal[chosen])
        return inverse * np.outer(self.scale, self.scale)


class GainPriors(NamedTuple):
    """Prior standard deviations of the coefficients of the gain."""

    sd: np.ndarray  # (K,) apart from what is searched
    which: np.ndarray  # (K,) int, the searched parameter that multiplies each; -1 for none


class Inner(NamedTuple):
    """The inner solution, the objective there and its derivatives."""

    loss: float
    linear: Linear
    errors_bar: np.ndarray  # (rows, J) by the filtered channels
    S_bar: np.ndarray  # (rows,) by the innovation variances
    sd_bar: np.ndarray  # (p,) by the searched parameters, through the prior standard deviations


def solve_inner(errors: np.ndarray, S: np.ndarray, priors: GainPriors, signs: np.ndarray, free: np.ndarray) -> Inner:
    """Ridge solution of the linear coefficients, with the derivatives of the objective by ``free`` (p,).

    ``errors`` (rows, J) are the filtered channels, with innovation variances ``S`` (rows,): of the measurement, of k
    coefficients that must have ``signs`` (k,), 0 for either, and of the gain.
    """
    # a response enters the innovation with the sign of a prediction: e = e_y + sum_j beta_j e_j
    k, (fixed, which) = len(signs), priors
    sd = np.where(which >= 0, np.exp(free[which]), 1.0) * fixed if len(free) else fixed
    scale = np.concatenate([np.ones(k), sd])
    scaled = errors / np.sqrt(S)[:, None]
    M = scaled.T @ scaled
    normal = M[1:, 1:] * np.outer(scale, scale)
    normal[np.diag_indices(len(scale))] += np.concatenate([np.full(k, 1e-9), np.ones(len(sd))])
    gamma, unbound = _signed_ridge(normal, -M[1:, 0] * scale, signs)
    u, z = np.append(1.0, gamma * scale), gamma[k:]
    H = cho_factor(normal[k:, k:], lower=True)
    inverse = cho_solve(H, np.eye(len(z)))
    logdet = 2.0 * float(np.log(np.diag(H[0])).sum())
    loss = 0.5 * (float(np.log(S).sum()) + float(u @ M @ u) + float(z @ z) + logdet)

    # envelope theorem: the coefficients are at their optimum; the log-determinant depends on M and sd themselves
    M_bar = np.outer(u, u)
    M_bar[1 + k :, 1 + k :] += inverse * np.outer(sd, sd)
    scaled_bar = scaled @ M_bar
    S_bar = 0.5 / S - 0.5 * np.einsum("kj,kj->k", scaled_bar, scaled) / S
    sd_bar = np.zeros(len(free))
    np.add.at(sd_bar, which[which >= 0], (1.0 - np.diag(inverse) - z**2)[which >= 0])
    return Inner(loss, Linear(gamma, unbound, normal, scale), scaled_bar / np.sqrt(S)[:, None], S_bar, sd_bar)


def _signed_ridge(normal: np.ndarray, right: np.ndarray, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ridge solution whose first coefficients have the given signs (0: either), and which are not held at 0."""
    free = np.ones(len(right), dtype=bool)
    for _ in range(2 * len(signs) + 1):
        gamma = np.zeros(len(right))
        gamma[free] = np.linalg.lstsq(normal[np.ix_(free, free)], right[free], rcond=1e-13)[0]
        wrong = np.flatnonzero((gamma[: len(signs)] * signs < 0) & free[: len(signs)])
        if len(wrong):
            free[wrong[np.argmax(np.abs(gamma[wrong]))]] = False
            continue
        pull = (right - normal @ gamma)[: len(signs)] * signs
        inward = np.flatnonzero((pull > 1e-9) & ~free[: len(signs)])
        if not len(inward):
            break
        free[inward[np.argmax(pull[inward])]] = True
    return gamma, free
