"""The information that the log of a zone holds about its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ...filtering import Discrete
from ..disturbance_models import first_covariance
from ..gain_model import LEVEL_SD
from .zone import CLASSES, Calendar, Zone

_PLANT = 6.0  # heat of the plant for which LEVEL_SD was chosen [kW]
#: parameters of the gain and of the thermometer that an identification finds besides the network's
NUISANCE = ("tau", *(f"sigma_{c}" for c in CLASSES.names), "sigma_y")
_HOURS = 24
_FLAT = 1e-9  # eigenvalue of the information scaled to a unit diagonal, below which a direction is unknown


def walk_root() -> np.ndarray:
    """(24, 23) exact root of the covariance of a cyclic walk; a fit takes ``gain_model.smooth_walk_root``."""
    steps = np.eye(_HOURS) - np.roll(np.eye(_HOURS), 1, axis=1)
    values, vectors = np.linalg.eigh(steps.T @ steps)
    return vectors[:, 1:] / np.sqrt(values[1:])


class _Gains(NamedTuple):
    """Gains ``A P c / S`` and innovation variances of every row, and derivatives by q unknowns."""

    K: np.ndarray  # (N, n)
    S: np.ndarray  # (N,)
    dK: np.ndarray  # (N, q, n)
    dS: np.ndarray  # (N, q)


class Scores(NamedTuple):
    """Derivatives of which the score of M logs is made."""

    de: np.ndarray  # (N, M, q) derivatives of the innovations
    dS: np.ndarray  # (N, q) derivatives of their variances
    S: np.ndarray  # (N,) the variances


@dataclass(frozen=True)
class FilterInformation:
    """Information in a log about network, gain and thermometer, by a Kalman filter with a gain state.

    It sums the expected square of the score given the rows before, so that it holds in closed loop too, and its mean
    over runs is Fisher's.  The unknowns are logarithms of ``free`` (network parameters) and :data:`NUISANCE`, then 48
    standard normal numbers that make the weekly profile.
    """

    zone: Zone
    calendar: Calendar
    hours: float
    free: tuple[str, ...]

    @cached_property
    def _profile_root(self) -> np.ndarray:
        plant = max((abs(v) for k, v in self.zone.theta.items() if k.startswith("Q_")), default=_PLANT)
        level = np.full((_HOURS, 1), LEVEL_SD * plant / _PLANT)
        steps = (self.zone.gain.profile_step, self.zone.gain.weekend_step)
        return block_diag(*(np.hstack([level, step * walk_root()]) for step in steps))

    @cached_property
    def _system(self) -> tuple[Discrete, np.ndarray, np.ndarray]:
        """The network with the gain as a last state, derivatives by all unknowns, and the gain's own noise."""
        zone, d = self.zone, self.zone.discrete(self.hours)
        n, m = d.B.shape
        chosen = [zone.order.index(name) for name in self.free]
        p, q = len(chosen), len(chosen) + len(NUISANCE)
        total = q + 2 * _HOURS
        A, B = np.zeros((n + 1, n + 1)), np.zeros((n + 1, m))
        dA, dB = np.zeros((total, n + 1, n + 1)), np.zeros((total, n + 1, m))
        scale = np.array([zone.theta[name] for name in self.free]).reshape(-1, 1, 1)
        A[:n, :n], A[:n, n], B[:n] = d.A, d.B[:, -1], d.B
        dA[:p, :n, :n], dA[:p, :n, n] = scale * d.dA[chosen], scale[:, :, 0] * d.dB[chosen, :, -1]
        dB[:p, :n] = scale * d.dB[chosen]
        phi = float(np.exp(-self.hours / zone.gain.tau))
        A[n, n], dA[p, n, n] = phi, phi * self.hours / zone.gain.tau
        Q, dQ = np.zeros((len(CLASSES.names), n + 1, n + 1)), np.zeros((total, len(CLASSES.names), n + 1, n + 1))
        variance = zone.gain.sigma**2
        Q[:, n, n] = variance * (1.0 - phi**2)
        dQ[p, :, n, n] = -2.0 * variance * phi * dA[p, n, n]
        for i in range(len(CLASSES.names)):
            dQ[p + 1 + i, i, n, n] = 2.0 * Q[i, n, n]
        return Discrete(A, B, dA, dB), Q, dQ

    def _gains(self, seen: np.ndarray) -> _Gains:
        """The filter's covariance recursion with derivatives; it does not depend on what was measured, only when."""
        (A, _, dA, _), Q, dQ = self._system
        at, klass, R = self.zone.measured, self.calendar.klass, self.zone.gain.noise_std**2
        dR = np.zeros(len(dA))
        dR[len(self.free) + len(NUISANCE) - 1] = 2.0 * R
        P, dP = first_covariance(self.zone.network, float(self.zone.gain.sigma[klass[0]])), np.zeros_like(dA)
        N, n, q = len(klass), len(A), len(dA)
        out = _Gains(np.zeros((N, n)), np.empty(N), np.zeros((N, q, n)), np.empty((N, q)))
        for k in range(N):
            S, dS = P[at, at] + R, dP[:, at, at] + dR
            out.S[k], out.dS[k] = S, dS
            if seen[k]:
                gain = P[at] / S
                dgain = (dP[:, at] - dS[:, None] * gain) / S
                out.K[k], out.dK[k] = A @ gain, dA @ gain + dgain @ A.T
                cross = dgain[:, :, None] * gain
                dP = dP - S * (cross + cross.transpose(0, 2, 1)) - dS[:, None, None] * np.outer(gain, gain)
                P = P - S * np.outer(gain, gain)
            turned = dA @ P @ A.T
            dP = turned + turned.transpose(0, 2, 1) + A @ dP @ A.T + dQ[:, klass[k]]
            P = A @ P @ A.T + Q[klass[k]]
        return out

    def scores(self, y: np.ndarray, inputs: np.ndarray, first: np.ndarray | None = None) -> Scores:
        """Scores of M logs that miss the same rows: ``y`` (N, M) [degC], ``inputs`` (N, M, m), mean gain [kW] last.

        ``first`` (M,) is the mean of every node at the first row [degC], by default the first measurement.
        """
        A, B, dA, dB = self._system[0]
        n, q, at = len(A), len(dA), self.zone.measured
        seen = np.isfinite(y[:, 0])
        gains = self._gains(seen)
        by_state = dA.transpose(2, 0, 1).reshape(n, q * n)  # for one product a row instead of one a parameter
        by_input = dB.transpose(2, 0, 1).reshape(-1, q * n)
        M = y.shape[1]
        s = np.zeros((M, n))
        s[:, :-1] = (y[seen][0] if first is None else first)[:, None]
        ds, de = np.zeros((M, q, n)), np.zeros((len(y), M, q))
        for k, (measured, v) in enumerate(zip(y, inputs, strict=True)):
            e = measured - s[:, at] if seen[k] else np.zeros(M)
            if seen[k]:
                de[k] = -ds[:, :, at]
            pushed = (s @ by_state + v @ by_input).reshape(M, q, n)
            pushed[:, -2 * _HOURS :] += np.outer(self._profile_root[self.calendar.cell[k]], B[:, -1])
            ds = ds @ A.T + pushed + e[:, None, None] * gains.dK[k] + de[k][:, :, None] * gains.K[k]
            s = s @ A.T + v @ B.T + np.outer(e, gains.K[k])
        return Scores(de, gains.dS, gains.S)

    def of_logs(self, y: np.ndarray, inputs: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
        """Information (M, q, q) of every log, the profile's prior included; arguments as in :meth:`scores`."""
        scores, seen = self.scores(y, inputs, first), np.isfinite(y[:, 0])
        by_mean = (scores.de[seen] / np.sqrt(scores.S[seen])[:, None, None]).transpose(1, 0, 2)
        by_spread = scores.dS[seen] / scores.S[seen][:, None]
        out = by_mean.transpose(0, 2, 1) @ by_mean + 0.5 * by_spread.T @ by_spread
        profile = np.arange(out.shape[1] - 2 * _HOURS, out.shape[1])
        out[:, profile, profile] += 1.0  # standard normal numbers
        return out


def relative_errors(information: np.ndarray, n_free: int) -> np.ndarray:
    """(n_free,) standard errors of the first unknowns from (q, q) information; infinite where no row moves them."""
    scale = np.sqrt(np.diag(information))
    moved = scale > 1e-12 * scale.max(initial=0.0)
    values, vectors = np.linalg.eigh(information[np.ix_(moved, moved)] / np.outer(scale[moved], scale[moved]))
    weak = values < _FLAT
    lost = (vectors[:, weak] ** 2).sum(axis=1) > 1e-6
    variance = (vectors[:, ~weak] ** 2 / values[~weak]).sum(axis=1)
    variance[lost] = np.inf
    errors = np.full(len(information), np.inf)
    errors[moved] = np.sqrt(variance) / scale[moved]
    return errors[:n_free]
