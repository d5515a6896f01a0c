"""Prior of ARX: a normal distribution of its coefficients in units that zones share, learned from fitted zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
from scipy.linalg import cho_factor, cho_solve

from .._calendar import N_CELLS
from .._table import is_plant
from .._time import spell
from ..filtering import learn_normal
from .arx_design import K_PER_COLUMN, ARXDesign, Moments
from .features import irradiance_roles

_REFERENCE = 20.0  # temperature from which all temperatures count [degC]
_SIZES = np.linspace(-2.5, 2.5, 11)  # sizes that are tried, in standard deviations
#: by objective, how much more the prior counts than independent rows would let it (errors at many leads overlap), and
#: the ridge that stays beside it (errors of one step alone tell little of a day)
_STRENGTH, _RIDGE = {"one_step": 1.0, "multi_step": 5.0}, {"one_step": 1.0, "multi_step": 0.0}
_TURNS = 4  # by which size and squared error of a zone are found in turn
_MOST_NOISE_ROWS = 96.0  # rows that the fleet's squared error counts as at most


class ARXKind(NamedTuple):
    """Features that two regressions must share so that one says anything of the other."""

    step: pd.Timedelta
    roles: tuple[str, ...]
    n_lags: int
    n_input_lags: int
    calendar: bool
    objective: str

    @classmethod
    def of(cls, design: ARXDesign, step: pd.Timedelta) -> Self:
        objective = "one_step" if design.daily is None else "multi_step"
        roles = tuple(sorted(design.roles))
        return cls(step, roles, design.n_lags, design.n_input_lags, design.calendar, objective)

    def refuse_other(
        self, other: ARXKind, what: str = "prior=", here: str = "this log", give: str = "a prior of zones"
    ) -> None:
        """Raise a ValueError if ``other`` differs in step, columns or setting."""
        if other.step != self.step:
            raise ValueError(
                f"{what} was learned at {spell(self.step)}, {here} has {spell(other.step)}; give {give} of the same "
                "step."
            )
        if other.roles != self.roles:
            raise ValueError(
                f"{what} was learned from the columns {', '.join(self.roles)}, {here} has {', '.join(other.roles)}; "
                f"give {give} with the same columns."
            )
        for name in ("n_lags", "n_input_lags", "calendar", "objective"):
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                raise ValueError(f"{what} was learned with {name}={mine!r}, this regression has {name}={its!r}.")


class ZoneSums(NamedTuple):
    """The normal equations of a fitted zone, from which a prior is learned."""

    design: ARXDesign
    step: pd.Timedelta
    moments: Moments
    noise: float  # variance of what an equation leaves [K2]

    @property
    def kind(self) -> ARXKind:
        return ARXKind.of(self.design, self.step)


class ZoneEvidence(NamedTuple):
    """Sums that a fitted predictor has learned of its zone, from which a prior of other zones is made."""

    regressions: dict[str, ZoneSums]  # by objective
    network: Any = None  # NetworkSums of a network with schedules


@dataclass(frozen=True)
class ARXPrior:
    """Normal distribution of coefficients in shared units, those of heat times the size of the zone."""

    kind: ARXKind
    mean: np.ndarray  # (p,)
    precision: np.ndarray  # (p, p)
    noise: float  # usual variance of what an equation leaves [K2]
    noise_rows: float  # rows that it counts as
    log_size: float = 0.0  # of a zone of which no nameplate is known
    log_size_std: float = 0.0

    @classmethod
    def learn(cls, zones: Sequence[ZoneSums], log_sizes: np.ndarray, pseudo_zones: float) -> Self:
        """Empirical Bayes by EM; the covariance is shrunk to its diagonal as by so many zones."""
        mean, precision = learn_normal(*shared_sums(zones, log_sizes), pseudo_zones)
        log_noise = np.log([zone.noise for zone in zones])
        # the logarithm of a variance that n rows tell has the variance 2 / n
        rows = min(2.0 / max(float(np.var(log_noise)), 1e-6), _MOST_NOISE_ROWS)
        return cls(zones[0].kind, mean, precision, float(np.exp(log_noise.mean())), rows)

    def sized(self, log_size: float, log_size_std: float) -> Self:
        """The same for zones whose size is otherwise known."""
        return replace(self, log_size=log_size, log_size_std=log_size_std)

    def usual(self, design: ARXDesign) -> np.ndarray:
        """(p,) the mean in the columns of a design, for a zone of the usual size."""
        return _shared(design, float(np.exp(self.log_size))) @ self.mean

    def pseudo_rows(self, design: ARXDesign, step: pd.Timedelta, moments: Moments, squares: float, n: float) -> Moments:
        """The prior as sums over rows of a zone, in the columns and with the squared error of its regression.

        ``moments`` and ``squares`` are the zone's own sums over ``n`` equations, by which its size and its squared
        error are found.
        """
        self.kind.refuse_other(ARXKind.of(design, step))
        noise, scale = self.noise, 1.0
        for _ in range(_TURNS):
            scale = self._likeliest_size(design, moments, noise)
            whole = moments.plus(self._moments(design, scale, noise))
            coef = whole.solution(np.zeros(len(whole.cross)))
            left = squares - 2.0 * coef @ moments.cross + coef @ moments.gram @ coef
            # number of coefficients that the rows determine
            effective = min(float(np.trace(np.linalg.solve(whole.gram, moments.gram))), n / 2)
            noise = float((self.noise_rows * self.noise + max(left, 0.0)) / (self.noise_rows + n - effective))
        return self._moments(design, scale, noise)

    def _moments(self, design: ARXDesign, size: float, noise: float) -> Moments:
        """The prior in the design's columns."""
        B, strength = np.linalg.inv(_shared(design, size)), noise * _STRENGTH[self.kind.objective]
        ridge = np.full(len(B), _RIDGE[self.kind.objective])
        ridge[-1] = 0.0
        gram = strength * B.T @ self.precision @ B + np.diag(ridge)
        return Moments(gram, strength * B.T @ (self.precision @ self.mean))

    def _likeliest_size(self, design: ARXDesign, moments: Moments, noise: float) -> float:
        """The size under which the zone's rows and the fleet's sizes are likeliest together."""
        if not self.log_size_std:
            return float(np.exp(self.log_size))
        tried = self.log_size + self.log_size_std * _SIZES
        chances = [self._evidence(_shared(design, np.exp(size)), moments, noise) for size in tried]
        return float(np.exp(tried[np.argmax(chances - 0.5 * _SIZES**2)]))

    def _evidence(self, A: np.ndarray, moments: Moments, noise: float) -> float:
        """Logarithm of the likelihood of a zone's rows, less what does not depend on its size."""
        H = A.T @ moments.gram @ A / noise + self.precision
        h = A.T @ moments.cross / noise + self.precision @ self.mean
        factor = cho_factor(H)
        return float(0.5 * h @ cho_solve(factor, h) - np.sum(np.log(np.diag(factor[0]))))


def shared_sums(zones: Sequence[ZoneSums], log_sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, p, p) and (N, p) normal equations of zones in shared units, in which each has a noise of 1."""
    grams, crosses = [], []
    for zone, log_size in zip(zones, log_sizes, strict=True):
        A = _shared(zone.design, float(np.exp(log_size)))
        grams.append(A.T @ zone.moments.gram @ A / zone.noise)
        crosses.append(A.T @ zone.moments.cross / zone.noise)
    return np.array(grams), np.array(crosses)


def prior_of(prior: Any, objective: str) -> ARXPrior:
    """The part of a prior that is for regressions with an objective."""
    found = prior if isinstance(prior, ARXPrior) else getattr(prior, "arx", {}).get(objective)
    if not isinstance(found, ARXPrior):
        raise ValueError(
            f"prior={prior!r} holds nothing for an ARX with objective={objective!r}; give a FleetPrior that was "
            "learned from such zones, or None."
        )
    return found


def _columns(design: ARXDesign) -> list[tuple[str, float, float]]:
    """Name, mean and unit of each column of the regression that is measured."""
    lags = [(f"T_za {lag}", design.T_mean, design.T_scale) for lag in range(design.n_lags)]
    names = [f"{role} {lag}" for role in design.roles for lag in range(design.n_input_lags)]
    if design.daily is not None:
        names += [f"{role} filtered {k}" for role in design.roles for k in range(len(design.daily.decay))]
        names += [f"{role} side {k}" for role in irradiance_roles(dict.fromkeys(design.roles)) for k in range(2)]
    return lags + list(zip(names, design.input_mean, design.input_scale, strict=True))


def _shared(design: ARXDesign, size: float) -> np.ndarray:
    """(p, p) matrix that turns shared coefficients, their columns by name, into those of the design's columns."""
    measured = _columns(design)
    place = {name: j for j, name in enumerate(sorted(name for name, _, _ in measured))}
    p = len(measured) + design.n_calendar + 1
    A = np.zeros((p, p))
    for i, (name, mean, unit) in enumerate(measured):
        role, j = name.split()[0], place[name]
        scale = 1.0 / size if is_plant(role) else 1.0
        A[i, j] = scale * (unit if np.isfinite(unit) else 0.0)
        A[-1, j] = scale * (mean - _REFERENCE * role.startswith("T_"))
    calendar = np.arange(len(measured), p)
    A[calendar, calendar] = 1.0
    if design.daily is not None and "T_oa" in design.roles and design.calendar:  # outdoor temperature by hour
        hour = len(measured) + np.arange(24)
        away = (design.daily.T_oa_mean - _REFERENCE) / K_PER_COLUMN
        A[hour, hour + N_CELLS], A[hour + 24, hour + N_CELLS] = away, away
    return A
