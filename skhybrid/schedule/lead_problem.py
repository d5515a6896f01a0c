"""Least squares of forecast errors at all leads: coefficients solved inside, the rest searched by Gauss-Newton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..filtering import ForecastSample, solve_positive_definite
from .channels import GROUPS, ChannelPlan
from .constrained_ridge import Solution, gram, solve_coefficients
from .expected_heat import SurpriseEffect
from .filter_model import FilterModel
from .network_prior import ProblemPrior
from .responses import Responses, error_columns, error_sensitivities, simulate_responses
from .segment import Segment
from .step_gain import GainPull

OVERLAP = 8.0  # hours within which forecasts overlap so much that they count as one
_LEAST_PENALTY = 1e-3  # penalty of coefficients that are not shrunk, which keeps the equations regular
_WINDOW = 10.0  # unit of a window [m2] under that penalty
_LEAST_GAIN = 1e-3  # usual relative decrease of the objective below which a search stops
_PSI_SPREAD = 1.2  # standard deviation of psi around its centre, where no prior of other zones is given
_SWAP_PENALTY = 150.0  # penalty of swapping the type of a day of the week: a few days of evidence overcome it


class Shrinkage(NamedTuple):
    """Penalties of the schedules, in units of the known heat's spread."""

    gain: float = 0.3
    ua: float = 1.0
    day_type: float = 1.0  # factor by which the contrast of weekdays and weekends is shrunk more

    def by_group(self) -> np.ndarray:
        """(6,) penalties in the order of GROUPS."""
        return np.array(
            [_LEAST_PENALTY, self.gain, self.gain * self.day_type, self.ua, self.ua * self.day_type, _SWAP_PENALTY]
        )


class ScoredForecasts(NamedTuple):
    """Forecasts of one segment that enter the objective."""

    segment: Segment
    sample: ForecastSample
    weight: np.ndarray | float = 1.0  # (O,) of each origin
    surprise: np.ndarray | None = None  # (O, n_leads) delivered less expected heat [kW], where expected heat is scored

    def every(self, n: int, leads: np.ndarray | None = None) -> ScoredForecasts:
        """Every n-th origin, at all leads by default."""
        chosen = self.sample.origins[::n], self.sample.leads if leads is None else leads
        sample = ForecastSample(*map(np.ascontiguousarray, chosen))  # kernels are compiled once more for strided arrays
        weight = self.weight if np.ndim(self.weight) == 0 else np.asarray(self.weight)[::n]
        surprise = None if self.surprise is None else self.surprise[::n, : sample.leads[-1]]
        return ScoredForecasts(self.segment, sample, weight, surprise)


class Evaluation(NamedTuple):
    """Objective at one psi, with the coefficients that minimise it there."""

    psi: np.ndarray  # (p,)
    loss: float
    solution: Solution
    gram: np.ndarray  # (J + 1, J + 1) of the designs
    designs: tuple[np.ndarray, ...]  # (O L, J + 1) weighted columns and target, of each segment


@dataclass(frozen=True)
class LeadProblem:
    """Penalised least squares over the forecasts of one or several segments, which have the same channels."""

    model: FilterModel
    forecasts: Sequence[ScoredForecasts]
    centre: np.ndarray  # (p,) of the normal prior of psi
    precision: np.ndarray  # (L,) inverse variance of the errors at each lead [1/K2]
    shrinkage: Shrinkage = field(default_factory=Shrinkage)
    pull: GainPull | None = None  # of the gain, toward what jumps of the heat say
    prior: ProblemPrior | None = None  # of other zones, in place of the usual spread of psi and of the shrinkage

    @property
    def scored(self) -> ScoredForecasts:
        """Forecasts of the first segment."""
        return self.forecasts[0]

    @property
    def segment(self) -> Segment:
        """The first segment."""
        return self.scored.segment

    @property
    def plan(self) -> ChannelPlan:
        return self.segment.plan

    @property
    def positive(self) -> np.ndarray:
        """(J,) bool, coefficients that are at least 0."""
        positive = self.segment.channels.positive
        return np.append(positive, True) if self.plan.emitter else positive

    @cached_property
    def penalty(self) -> np.ndarray:
        penalty = penalty_of(self.segment, self.shrinkage, self.model.heat_scale)
        if self.prior is not None:
            penalty[np.isin(self.channels, self.prior.channels)] = 0.0
        return penalty

    @property
    def channels(self) -> tuple[str, ...]:
        """(J,) names of the coefficients."""
        names = self.segment.channels.names
        return (*names, "emitter") if self.plan.emitter else names

    @property
    def psi_precision(self) -> np.ndarray:
        """(p, p) of the prior of psi."""
        return np.eye(len(self.centre)) / _PSI_SPREAD**2 if self.prior is None else self.prior.psi_precision

    def pull_of_psi(self, psi: np.ndarray) -> np.ndarray:
        """(p,) gradient of half the prior's square by psi."""
        away = psi - self.centre
        return away / _PSI_SPREAD**2 if self.prior is None else self.prior.psi_precision @ away

    def prior_gram(self) -> np.ndarray | float:
        """(J + 1, J + 1) that is added to the sums at every solution; 0 without a prior."""
        return 0.0 if self.prior is None else self.prior.of_channels(self.channels)

    def solve(self, products: np.ndarray) -> Solution:
        """Coefficients under penalty and prior by sums of products (J + 1, J + 1)."""
        whole = products if self.prior is None else products + self.prior_gram()
        return solve_coefficients(whole, self.penalty, self.positive)

    def root_weights(self, scored: ScoredForecasts) -> np.ndarray:
        """(O, L) square roots of the weights; 0 where the target is missing or beyond the segment."""
        rows, inside = scored.sample.targets(scored.segment.n_rows)
        origins = scored.sample.origins
        # a single origin is the first of hourly ones, and counts as it will among them
        hourly = max(1.0 / self.model.step, 1.0)
        spacing = (origins[-1] - origins[0]) / (len(origins) - 1) if len(origins) > 1 else hourly
        weight = np.broadcast_to(scored.weight, len(origins)) * self.overlap_weight(spacing)
        return self.root_weights_of(inside & scored.segment.seen[rows], weight)

    def overlap_weight(self, spacing: float) -> float:
        """Weight of each forecast where origins are ``spacing`` rows apart."""
        return min(spacing * self.model.step / OVERLAP, 1.0)

    def root_weights_of(self, known: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """(O, L) square roots of the weights of forecasts that count ``weight`` (O,); 0 where not ``known`` (O, L)."""
        return np.sqrt(np.where(known, self.precision * weight[:, None] / known.shape[1], 0.0))

    def design(self, psi: np.ndarray, scored: ScoredForecasts, responses: Responses | None = None) -> np.ndarray:
        """(O L, J + 1) weighted columns and target; ``responses`` at ``psi`` and the origins save simulating them."""
        if responses is None:
            responses = simulate_responses(self.model, psi, scored.segment, scored.sample.origins)
        root = self.root_weights(scored)
        E = error_columns(self.model, responses, scored.sample, root)
        effect = self._effect(psi, scored)
        if effect is not None:
            E[:, -1] += (root * effect.errors()).ravel()
            if self.plan.emitter:
                E[:, -2] -= (root * effect.of_emitter()).ravel()
        return E

    def sensitivities(
        self, psi: np.ndarray, coef: np.ndarray, scored: ScoredForecasts
    ) -> tuple[np.ndarray, np.ndarray]:
        """Errors (O, L) [K] at fixed coefficients, and their derivatives (O, L, p) by psi."""
        e, de = error_sensitivities(self.model, psi, coef, scored.segment, scored.sample)
        effect = self._effect(psi, scored)
        if effect is not None:
            lag = coef[-1] if self.plan.emitter else 0.0
            e, de = e + effect.errors(lag), de + effect.slopes(lag)
        return e, de

    def _effect(self, psi: np.ndarray, scored: ScoredForecasts) -> SurpriseEffect | None:
        if scored.surprise is None:
            return None
        return SurpriseEffect(self.model, psi, self.plan.heated, scored.surprise, scored.sample.leads)

    def pull_gram(self, psi: np.ndarray) -> np.ndarray | float:
        """(J + 1, J + 1) of the pull of the gain; 0 without one."""
        return 0.0 if self.pull is None else gram(self.pull.design(self.model, psi, self.segment))

    def evaluate(self, psi: np.ndarray) -> Evaluation:
        """Solve the coefficients at ``psi``."""
        designs = tuple(self.design(psi, scored) for scored in self.forecasts)
        return self.solved(psi, np.sum([gram(E) for E in designs], axis=0) + self.pull_gram(psi), designs)

    def solved(self, psi: np.ndarray, products: np.ndarray, designs: tuple[np.ndarray, ...]) -> Evaluation:
        """The same with designs at ``psi`` and their sums of products (J + 1, J + 1)."""
        solution = self.solve(products)
        prior = 0.5 * self.pull_of_psi(psi) @ (psi - self.centre)
        return Evaluation(psi, solution.loss + float(prior), solution, products, designs)

    def with_other_heat(self, at: Evaluation, segment: Segment) -> Evaluation:
        """The same with other known heat and without the channels whose series differ; ``segment`` has the same rows.

        The other columns of the design stay as they are.
        """
        old, (E,) = self.segment.channels, at.designs
        n, gone = len(old.names), np.flatnonzero((old.series != segment.channels.series).any(axis=0))
        bare = segment._replace(channels=segment.channels.first(0))
        target = self.design(at.psi, self.scored._replace(segment=bare))
        changed = np.append(gone, np.arange(n, E.shape[1]))
        change = np.hstack([-E[:, gone], target - E[:, n:]])
        products, cross = at.gram.copy(), (change.T @ E).T  # faster than E.T @ change
        products[:, changed] += cross
        products[changed] += cross.T
        products[np.ix_(changed, changed)] += change.T @ change
        return self.solved(at.psi, products, ())

    def slopes(self, at: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (p,) and Gauss-Newton Hessian (p, p) of the objective with the coefficients projected out."""
        free = np.flatnonzero(at.solution.free)
        g, H = self.pull_of_psi(at.psi), self.psi_precision
        inner = np.diag(self.penalty[free]) + (at.gram + self.prior_gram())[np.ix_(free, free)]
        cross = np.zeros((len(free), len(g)))
        for scored, E in zip(self.forecasts, at.designs, strict=True):
            root = self.root_weights(scored)
            e, de = self.sensitivities(at.psi, at.solution.coef, scored)
            J = (root[..., None] * de).reshape(-1, len(g))
            H = H + gram(J)
            g = g + J.T @ (root * e).ravel()
            cross += (J.T @ E).T[free]
        if self.pull is not None:
            coef = at.solution.coef
            E = self.pull.design(self.model, at.psi, self.segment)
            J = self.pull.sensitivities(self.model, at.psi, coef, self.segment)
            H, g = H + gram(J), g + J.T @ (E @ np.append(-coef, 1.0))
            cross += (E.T @ J)[free]
        return g, H - cross.T @ solve_positive_definite(inner, cross)


def penalty_of(segment: Segment, shrinkage: Shrinkage, heat_scale: float) -> np.ndarray:
    """(J,) penalty of each coefficient of a segment."""
    channels = segment.channels
    strength = shrinkage.by_group()[channels.group]
    unit = np.full(len(strength), heat_scale)
    unit[channels.solar] = _WINDOW
    unit[channels.group == GROUPS.index("swapped")] = 1.0
    if segment.plan.emitter:
        strength, unit = np.append(strength, _LEAST_PENALTY), np.append(unit, 1.0)
    return strength / unit**2


def minimise(problem: LeadProblem, best: Evaluation, max_steps: int, least_gain: float = _LEAST_GAIN) -> Evaluation:
    """Levenberg-Marquardt from an evaluation of the problem, at most ``max_steps`` steps.

    It stops where the objective decreases by a share of less than ``least_gain``.
    """
    damping = 1e-2
    for _ in range(max_steps):
        g, H = problem.slopes(best)
        better = None
        for _ in range(5):
            move = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            move *= min(1.0, 1.0 / max(float(np.abs(move).max()), 1e-12))  # e-fold at most
            trial = problem.evaluate(best.psi + move)
            if trial.loss < best.loss:
                better, damping = trial, max(damping / 5.0, 1e-6)
                break
            damping = max(damping * 5.0, 1e-3)
        if better is None:
            break
        gained, best = best.loss - better.loss, better
        if gained < least_gain * max(1.0, best.loss):
            break
    return best
