"""Fitting on a training table: a rough grid, Gauss-Newton, and shrinkage by weeks that are left out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import ZoneTable
from ..filtering import ForecastSample, hourly_sample
from ..thermal import RCNetwork
from .channels import make_plan, with_contrast
from .constrained_ridge import gram, solve_coefficients
from .filter_model import OWN, LeadModel
from .lead_problem import LeadProblem, Part, Point, Shrinkage, minimise, penalty_of
from .responses import Segment, make_segment

#: the leads of a sample on which the grid is scored
_COARSE = slice(2, None, 4)
#: grid of the overall scale of the network and of its time constants, around the rough guess
_SCALES, _PACES = (0.1, 0.3, 1.0, 3.0, 10.0), (0.3, 1.0, 3.0)
#: rough guess of a network for 2.5 kW of spread in its heat: the measured node, others [kWh/K], inside, outside [K/kW]
_GUESS_HEAT, _GUESS = 2.5, (1.5, 12.0, 0.4, 4.0)
#: least spread of the known heat, as a share of its largest value
_LEAST_SPREAD = 0.1
#: standard deviation of the logarithms of the parameters around the grid's best point
_SPREAD = 1.2
#: shrinkages that are tried
_GAINS, _UAS, _DAY_TYPES = (0.1, 0.3, 1.0, 3.0), (0.1, 0.3, 1.0, 3.0, 10.0), (1.0, 3.0)
_MOST_BLOCKS, _LEAST_BLOCKS = 6, 3
_DAY = 24.0
#: error below which no lead is trusted to be forecast [K]
_FLOOR = 0.02


@dataclass(frozen=True)
class LeadFit:
    """A fitted model.

    Parameters
    ----------
    model : LeadModel
    problem : LeadProblem
        Of the training table.
    point : Point
        Its solution, without the columns.
    gram : ndarray of shape (J + 1, J + 1)
        Of the training forecasts, weighted.
    blocks : ndarray of int, shape (O,)
        Block of days of every origin.
    left_out : ndarray of shape (O, L)
        Errors [K] of the training forecasts whose block of days was left out, NaN where there is no measurement.
    reference : float
        Temperature from which deviations count [degC].
    """

    model: LeadModel
    problem: LeadProblem
    point: Point
    gram: np.ndarray
    blocks: np.ndarray
    left_out: np.ndarray
    reference: float

    @property
    def sample(self) -> ForecastSample:
        """The training forecasts that were scored."""
        return self.problem.parts[0].sample

    @property
    def segment(self) -> Segment:
        """The training rows."""
        return self.problem.parts[0].segment


def fit_leads(
    network: RCNetwork,
    table: ZoneTable,
    T: np.ndarray,
    n_leads: int,
    known: dict[str, float] | None = None,
    calendar: bool = True,
) -> LeadFit:
    """Fit a network with schedules on the errors of forecasts up to ``n_leads`` rows ahead.

    Parameters
    ----------
    network : RCNetwork
    table : ZoneTable
    T : ndarray of shape (N,)
        Measured temperature [degC], NaN where missing.
    n_leads : int
    known : dict, optional
        Capacities [kW] that are given.
    calendar : bool
        Whether there are schedules.

    Returns
    -------
    LeadFit
    """
    plan = make_plan(network, table, known or {}, calendar)
    reference = float(np.nanmean(T)) if np.isfinite(T).any() else 20.0
    segment = make_segment(plan, table, T, reference)
    step = table.step / pd.Timedelta("1h")
    # a plant that hardly ran does not make the building small
    scale = max(float(segment.heat.std()), _LEAST_SPREAD * float(np.abs(segment.heat).max()))
    model = LeadModel.of(network, step, scale if scale > 1e-6 else 1.0)
    sample = hourly_sample(table.n_rows, n_leads, step, round(_DAY / step))
    problem = _start(model, Part(segment, sample))
    point = minimise(problem, problem.centre, most=10)
    blocks = _blocks(sample, step)
    problem = replace(problem, shrinkage=_best_shrinkage(problem, point, blocks))
    point = minimise(problem, point.psi, most=4)
    plan = with_contrast(plan, segment.channels.names, point.solution.coef)
    problem = replace(problem, parts=(Part(make_segment(plan, table, T, reference), sample),))
    point = problem.evaluate(point.psi)
    left_out = _left_out(problem, point.columns[0], blocks)
    return LeadFit(model, problem, point._replace(columns=()), point.products, blocks, left_out, reference)


def _start(model: LeadModel, part: Part) -> LeadProblem:
    """The problem around the grid's best point, each lead weighted by the inverse variance of its errors there."""
    leads = part.sample.leads
    rough = ForecastSample(part.sample.origins[::6], leads[_COARSE] if len(leads) > 4 else leads)
    spread = np.full(len(model.names), _SPREAD)
    best = None
    for scale in _SCALES:
        for pace in _PACES:
            psi = _guess(model, scale * model.heat_scale / _GUESS_HEAT, pace)
            problem = LeadProblem(
                model, (Part(part.segment, rough),), psi, spread, Shrinkage(), np.ones(len(rough.leads))
            )
            point = problem.evaluate(psi)
            if best is None or point.loss < best.loss:
                best = point
    assert best is not None
    problem = LeadProblem(model, (part,), best.psi, spread, Shrinkage(), np.ones(len(part.sample.leads)))
    point = problem.evaluate(best.psi)
    errors = _errors(problem, part, point.columns[0], point.solution.coef)
    known = np.isfinite(errors).sum(axis=0)
    variance = np.where(known > 0, np.nansum(errors**2, axis=0) / np.maximum(known, 1), 1.0)
    return replace(problem, precision=1.0 / np.maximum(variance, _FLOOR**2))


def _guess(model: LeadModel, scale: float, pace: float) -> np.ndarray:
    """Logarithms of a rough guess: ``scale`` makes the building larger, ``pace`` slower."""
    measured, other, inside, outside = _GUESS
    network = model.network
    values = [
        (measured if node == network.measured_nodes[0] else other) * scale * pace for node in network.capacitances
    ]
    for ends in network.resistors.values():
        values.append((inside if all(end in network.capacitances for end in ends) else outside) / scale)
    by_name = dict(zip([*network.capacitances.values(), *network.resistors], values, strict=True))
    own = {"sigma_x": 0.05, "sigma_g": 0.3 * model.heat_scale, "tau_g": 6.0, "tau_e": 0.5}
    return np.log([{**by_name, **own}[name] for name in (*model.builder.parameters, *OWN)])


def _errors(problem: LeadProblem, part: Part, columns: np.ndarray, coef: np.ndarray) -> np.ndarray:
    """(O, L) errors [K] behind weighted columns, NaN where there is no measurement."""
    root = problem.root_weights(part)
    e = (columns[:, -1] - columns[:, :-1] @ coef).reshape(root.shape)
    return np.where(root > 0, e / np.where(root > 0, root, 1.0), np.nan)


def _blocks(sample: ForecastSample, step: float) -> np.ndarray:
    """(O,) block of days of every origin: weeks where there are enough; one block where nothing can be left out."""
    hours = (sample.origins - sample.origins[:1]) * step if len(sample.origins) else np.empty(0)
    days = hours[-1] / _DAY if len(hours) else 0.0
    length = max(1.0, min(7.0, days / _MOST_BLOCKS)) if days < 7.0 * _LEAST_BLOCKS else 7.0
    count = max(1, round(days / length))
    return (
        np.zeros(len(hours), dtype=np.int64)
        if count < _LEAST_BLOCKS
        else np.minimum((hours / _DAY / length).astype(np.int64), count - 1)
    )


class _Block(NamedTuple):
    """A block of days: its own forecasts, and the others that touch none of its days."""

    own: np.ndarray  # (J + 1, J + 1)
    others: np.ndarray  # (J + 1, J + 1)


def _parted(E: np.ndarray, sample: ForecastSample, blocks: np.ndarray) -> list[_Block]:
    by_origin = E.reshape(len(blocks), -1, E.shape[1])

    def of(chosen: np.ndarray) -> np.ndarray:
        return gram(by_origin[chosen].reshape(-1, E.shape[1]))

    grams = [of(blocks == b) for b in range(int(blocks.max()) + 1)]
    total = np.sum(grams, axis=0)
    begins = sample.origins[np.searchsorted(blocks, np.arange(len(grams)))]
    span = int(sample.leads[-1])
    # forecasts from just before a block have their targets in it
    reach = [of((blocks < b) & (sample.origins + span > begin)) for b, begin in enumerate(begins)]
    return [_Block(own, total - own - before) for own, before in zip(grams, reach, strict=True)]


def _best_shrinkage(problem: LeadProblem, point: Point, blocks: np.ndarray) -> Shrinkage:
    """The shrinkage with the least error in blocks that are left out in turn; linear re-solves only."""
    if not problem.plan.calendar or not len(blocks) or not blocks.max():
        return Shrinkage()
    parts = _parted(point.columns[0], problem.parts[0].sample, blocks)
    segment, scale, positive = problem.parts[0].segment, problem.model.heat_scale, problem.positive

    def score(shrinkage: Shrinkage) -> float:
        penalty, out = penalty_of(segment, shrinkage, scale), 0.0
        for part in parts:
            against = np.append(-solve_coefficients(part.others, penalty, positive).coef, 1.0)
            out += float(against @ part.own @ against)
        return out

    # one coordinate after the other: the three hardly depend on each other
    best = min((Shrinkage(g, u) for g in _GAINS for u in _UAS), key=score)
    return min((best._replace(day_type=d) for d in _DAY_TYPES), key=score)


def _left_out(problem: LeadProblem, E: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    part = problem.parts[0]
    errors = np.full((len(part.sample.origins), len(part.sample.leads)), np.nan)
    if not len(blocks) or not blocks.max():
        return errors
    for b, block in enumerate(_parted(E, part.sample, blocks)):
        coef = solve_coefficients(block.others, problem.penalty, problem.positive).coef
        errors[blocks == b] = _errors(problem, part, E, coef)[blocks == b]
    return errors
