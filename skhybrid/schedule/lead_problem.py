"""Forecast errors at all leads as least squares: coefficients solved inside, the rest searched by Gauss-Newton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..filtering import ForecastSample
from .channels import GROUPS, ChannelPlan
from .constrained_ridge import Solution, gram, solve_coefficients
from .filter_model import LeadModel
from .responses import Responses, Segment, error_columns, error_sensitivities, respond

#: hours within which forecasts overlap so much that they count as one
_OVERLAP = 8.0
#: penalty of coefficients that are not shrunk, which keeps the equations regular
_LEAST = 1e-3
#: unit of a window [m2] under that penalty
_WINDOW = 10.0
#: penalty of turning a day of the week into one of the other kind: of a few days that speak for it
_TURNED = 150.0


class Shrinkage(NamedTuple):
    """Penalties of the schedules, in units of the known heat's spread."""

    gain: float = 0.3
    ua: float = 1.0
    day_type: float = 1.0  # how much more the contrast of weekdays and weekends is shrunk

    def by_group(self) -> np.ndarray:
        """In the order of GROUPS."""
        return np.array([_LEAST, self.gain, self.gain * self.day_type, self.ua, self.ua * self.day_type, _TURNED])


class Part(NamedTuple):
    """Forecasts of one segment, and how much they count."""

    segment: Segment
    sample: ForecastSample
    weight: np.ndarray | float = 1.0  # of every origin


class Point(NamedTuple):
    """The objective at one psi."""

    psi: np.ndarray
    loss: float
    solution: Solution
    products: np.ndarray  # (J + 1, J + 1) of the columns
    columns: tuple[np.ndarray, ...]  # of every part, (O L, J + 1), weighted


@dataclass(frozen=True)
class LeadProblem:
    """Penalised least squares over the parts.

    Parameters
    ----------
    model : LeadModel
    parts : sequence of Part
    centre, spread : ndarray of shape (p,)
        Normal prior of psi.
    shrinkage : Shrinkage
    precision : ndarray of shape (L,)
        Inverse variance of the errors at each lead [1/K2].
    """

    model: LeadModel
    parts: Sequence[Part]
    centre: np.ndarray
    spread: np.ndarray
    shrinkage: Shrinkage
    precision: np.ndarray

    @property
    def plan(self) -> ChannelPlan:
        """Its channels."""
        return self.parts[0].segment.plan

    @property
    def positive(self) -> np.ndarray:
        """(J,) coefficients that are at least 0."""
        own = self.parts[0].segment.channels.positive
        return np.append(own, True) if self.plan.emitter else own

    @property
    def penalty(self) -> np.ndarray:
        """(J,) of every coefficient."""
        return penalty_of(self.parts[0].segment, self.shrinkage, self.model.heat_scale)

    def root_weights(self, part: Part) -> np.ndarray:
        """(O, L); 0 where the target is missing or beyond the segment."""
        rows, inside = part.sample.targets(part.segment.n_rows)
        origins = part.sample.origins
        # a single origin is the first of hourly ones, and counts as it will among them
        several = len(origins) > 1
        apart = (origins[-1] - origins[0]) / (len(origins) - 1) if several else max(1.0 / self.model.step, 1.0)
        share = np.broadcast_to(part.weight, len(origins)) * self.share(apart)
        return self.roots(inside & part.segment.seen[rows], share)

    def share(self, apart: float) -> float:
        """How much each of several forecasts counts whose origins are so many rows apart."""
        return min(apart * self.model.step / _OVERLAP, 1.0)

    def roots(self, known: np.ndarray, share: np.ndarray) -> np.ndarray:
        """(O, L) root weights of forecasts that count ``share`` (O,), 0 where nothing is ``known`` (O, L)."""
        return np.sqrt(np.where(known, self.precision * share[:, None] / known.shape[1], 0.0))

    def columns(self, psi: np.ndarray, part: Part, found: Responses | None = None) -> np.ndarray:
        """(O L, J + 1) weighted columns and target; ``found`` are the responses at ``psi``, at the part's origins."""
        if found is None:
            found = respond(self.model, psi, part.segment, part.sample.origins)
        return error_columns(self.model, found, part.sample, self.root_weights(part))

    def evaluate(self, psi: np.ndarray) -> Point:
        """Solve the coefficients at ``psi``."""
        columns = tuple(self.columns(psi, part) for part in self.parts)
        products = np.sum([gram(E) for E in columns], axis=0)
        solution = solve_coefficients(products, self.penalty, self.positive)
        prior = 0.5 * np.sum(((psi - self.centre) / self.spread) ** 2)
        return Point(psi, solution.loss + float(prior), solution, products, columns)

    def slopes(self, point: Point) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (p,) and Gauss-Newton Hessian (p, p) of the objective with the coefficients projected out."""
        free = np.flatnonzero(point.solution.free)
        g, H = (point.psi - self.centre) / self.spread**2, np.diag(1.0 / self.spread**2)
        inner = np.diag(self.penalty[free]) + point.products[np.ix_(free, free)]
        cross = np.zeros((len(free), len(g)))
        for part, E in zip(self.parts, point.columns, strict=True):
            root = self.root_weights(part)
            e, de = error_sensitivities(self.model, point.psi, point.solution.coef, part.segment, part.sample)
            J = (root[..., None] * de).reshape(-1, len(g))
            H = H + gram(J)
            g = g + J.T @ (root * e).ravel()
            cross += (E.T @ J)[free]
        return g, H - cross.T @ cho_solve(cho_factor(inner), cross)


def penalty_of(segment: Segment, shrinkage: Shrinkage, heat_scale: float) -> np.ndarray:
    """(J,) penalty of every coefficient of a segment."""
    channels = segment.channels
    strength = shrinkage.by_group()[channels.group]
    unit = np.full(len(strength), heat_scale)
    unit[channels.solar] = _WINDOW
    unit[channels.group == GROUPS.index("turned")] = 1.0
    if segment.plan.emitter:
        strength, unit = np.append(strength, _LEAST), np.append(unit, 1.0)
    return strength / unit**2


def minimise(problem: LeadProblem, psi: np.ndarray, most: int = 12, tolerance: float = 1e-3) -> Point:
    """Levenberg-Marquardt from ``psi``, at most ``most`` steps."""
    point, damping = problem.evaluate(psi), 1e-2
    for _ in range(most):
        g, H = problem.slopes(point)
        better = None
        for _ in range(5):
            move = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            move *= min(1.0, 1.0 / max(float(np.abs(move).max()), 1e-12))  # e-fold at most
            trial = problem.evaluate(point.psi + move)
            if trial.loss < point.loss:
                better, damping = trial, max(damping / 5.0, 1e-6)
                break
            damping = max(damping * 5.0, 1e-3)
        if better is None:
            break
        gained, point = point.loss - better.loss, better
        if gained < tolerance * max(1.0, point.loss):
            break
    return point
