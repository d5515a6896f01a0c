"""Prior of a network with schedules: its parameters and coefficients in other zones, relative to their size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from .._time import spell
from ..filtering import learn_normal, shrunk_covariance
from ..thermal import RCNetwork
from .channels import UA_DIFFERENCE
from .filter_model import FilterModel

_OUTDOOR = 10.0  # outdoor temperature from which shared coefficients count [degC]
_LEAST_SPREAD = 1e-2  # least standard deviation of the logarithm of a parameter
_EMITTER = "emitter"
#: standard deviations from the usual size from which a fit starts
_STARTS = (-2.0, -1.0, 0.0, 1.0, 2.0)


class NetworkSums(NamedTuple):
    """Sums of a fitted network, from which a prior is learned."""

    network: RCNetwork
    step: float  # [h]
    names: tuple[str, ...]  # of psi
    psi: np.ndarray  # (p,)
    channels: tuple[str, ...]  # of the coefficients, an emitter's last
    coef: np.ndarray  # (J,)
    gram: np.ndarray  # (J + 1, J + 1) of the training forecasts, in units of what they leave
    mean_outdoor: float  # [degC]
    leads: np.ndarray  # (L,) [h]
    variance: np.ndarray  # (L,) of the errors of forecasts at each lead [K2]

    @property
    def log_size(self) -> float:
        """Logarithm of the size: the mean of those of capacitances [kWh/K] and conductances [kW/K]."""
        return float(size_direction(self.network, self.names) @ self.psi)


class ProblemPrior(NamedTuple):
    """A prior in the form that a zone's problem takes."""

    psi_precision: np.ndarray  # (p, p)
    channels: tuple[str, ...]
    gram: np.ndarray  # (K + 1, K + 1) of these channels and, last, the target

    def of_channels(self, names: Sequence[str]) -> np.ndarray:
        """(J + 1, J + 1) for channels by name; 0 for those that the prior does not know."""
        known = {name: k for k, name in enumerate(self.channels)}
        at = np.array([known.get(name, -1) for name in names] + [len(self.channels)])
        return np.where((at >= 0)[:, None] & (at >= 0), self.gram[np.ix_(at, at)], 0.0)


@dataclass(frozen=True)
class NetworkPrior:
    """Normal distributions of the logarithms of the parameters, and of the coefficients divided by the size."""

    network: RCNetwork
    step: float  # [h]
    names: tuple[str, ...]
    centre: np.ndarray  # (p,)
    covariance: np.ndarray  # (p, p)
    channels: tuple[str, ...]
    mean: np.ndarray  # (K,)
    precision: np.ndarray  # (K, K)
    leads: np.ndarray  # (L,) [h]
    variance: np.ndarray  # (L,) usual variance of the errors of forecasts at each lead [K2]

    @classmethod
    def learn(cls, zones: Sequence[NetworkSums], log_nameplates: np.ndarray, pseudo_zones: float) -> Self:
        """Moments of the parameters per nameplate, and EM over the sums of the coefficients."""
        first = zones[0]
        along = _scaling(first.network, first.names)
        psi = np.array([zone.psi for zone in zones]) - log_nameplates[:, None] * along
        covariance = shrunk_covariance(np.cov(psi.T, ddof=0), len(psi), pseudo_zones, _LEAST_SPREAD**2)
        shared = tuple(name for name in first.channels if all(name in zone.channels for zone in zones))
        sums = [_shared_sums(zone, shared) for zone in zones]
        grams, crosses = np.array([G[:-1, :-1] for G in sums]), np.array([G[:-1, -1] for G in sums])
        mean, precision = learn_normal(grams, crosses, pseudo_zones)
        errors = [np.log(np.interp(first.leads, zone.leads, zone.variance)) for zone in zones]
        usual = np.exp(np.mean(errors, axis=0))
        normal = (psi.mean(axis=0), covariance, shared, mean, precision)
        return cls(first.network, first.step, first.names, *normal, first.leads, usual)

    def scaled(self, log_nameplate: float, spread: float) -> Self:
        """The prior of a zone, from the logarithm of its nameplate and the standard deviation of that."""
        along = _scaling(self.network, self.names)
        return replace(
            self,
            centre=self.centre + log_nameplate * along,
            covariance=self.covariance + spread**2 * np.outer(along, along),
        )

    def starts(self) -> list[np.ndarray]:
        """(p,) parameters of zones of five sizes, the others as is usual for these."""
        size = size_direction(self.network, self.names)
        along = self.covariance @ size
        return [self.centre + k * along / np.sqrt(size @ along) for k in _STARTS]

    def at(self, psi: np.ndarray, mean_outdoor: float) -> ProblemPrior:
        """The prior of a problem, for a zone of the size that ``psi`` (p,) has."""
        size = float(np.exp(size_direction(self.network, self.names) @ psi))
        B = np.linalg.inv(_to_zone(self.channels, size, mean_outdoor))
        P, b = B.T @ self.precision @ B, B.T @ (self.precision @ self.mean)
        gram = np.block([[P, b[:, None]], [b[None], np.array([[self.mean @ self.precision @ self.mean]])]])
        return ProblemPrior(np.linalg.inv(self.covariance), self.channels, gram)

    def refuse_other(self, model: FilterModel) -> None:
        """Raise a ValueError if the prior was learned with another network or step."""
        if model.step != self.step:
            raise ValueError(
                f"prior= was learned at {_spell(self.step)}, this log has {_spell(model.step)}; give a prior of zones "
                "of the same step."
            )
        if model.names != self.names or model.network.resistors != self.network.resistors:
            raise ValueError(
                f"prior= was learned with network={self.network.name!r}, this one is {model.network.name!r}; give a "
                "prior of zones with the same network."
            )


def size_direction(network: RCNetwork, names: Sequence[str]) -> np.ndarray:
    """(p,) weights of the logarithms whose sum is that of the size."""
    signs = np.array([_sign(network, name) for name in names])
    return signs / np.abs(signs).sum()


def _sign(network: RCNetwork, name: str) -> float:
    return 1.0 if name in network.capacitances.values() else -float(name in network.resistors)


def _scaling(network: RCNetwork, names: Sequence[str]) -> np.ndarray:
    """(p,) changes of the logarithms per change of that of the size: 1, -1 or 0."""
    return np.array([1.0 if name == "sigma_g" else _sign(network, name) for name in names])


def _to_zone(channels: Sequence[str], size: float, mean_outdoor: float) -> np.ndarray:
    """(K, K) matrix that turns shared coefficients into those of a zone."""
    A = np.diag([1.0 if name == _EMITTER else size for name in channels])
    place = {name: k for k, name in enumerate(channels)}
    for name, k in place.items():
        if name == "ua" or name.startswith("ua_"):  # of the difference from another outdoor temperature
            partner = place.get("gain" + name[2:])
            if partner is not None:
                A[partner, k] = size * (mean_outdoor - _OUTDOOR) / UA_DIFFERENCE
    return A


def _shared_sums(zone: NetworkSums, shared: Sequence[str]) -> np.ndarray:
    """(K + 1, K + 1) sums of the shared coefficients and the target, the others held at their fitted values."""
    J = len(zone.channels)
    place = {name: j for j, name in enumerate(zone.channels)}
    T = np.zeros((J + 1, len(shared) + 1))
    size = float(np.exp(zone.log_size))
    T[[place[name] for name in shared], : len(shared)] = _to_zone(shared, size, zone.mean_outdoor)
    T[:J, -1] = [0.0 if name in shared else -c for name, c in zip(zone.channels, zone.coef, strict=True)]
    T[J, -1] = 1.0
    return T.T @ zone.gram @ T


def _spell(hours: float) -> str:
    return spell(pd.Timedelta(hours=hours))
