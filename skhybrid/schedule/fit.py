"""Fit of the schedule model on a training table: a coarse grid, Gauss-Newton, and cross-validated shrinkage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .._table import ZoneTable, is_stage
from .._time import rows_per_day, rows_per_hour, spell
from ..filtering import ForecastSample, hourly_sample
from ..thermal import RCNetwork
from .channels import ChannelPlan, make_channels, make_plan, with_contrast
from .constrained_ridge import Solution, gram, solve_coefficients
from .day_blocks import block_grams, blocks_of_days, can_leave_out
from .expected_heat import heat_surprise
from .filter_model import FILTER_PARAMETERS, FilterModel
from .lead_problem import OVERLAP, Evaluation, LeadProblem, ScoredForecasts, Shrinkage, minimise, penalty_of
from .network_prior import NetworkPrior, NetworkSums
from .segment import Segment, make_segment
from .step_gain import GainPull, is_delayed, is_usual

_COARSE = slice(2, None, 4)  # leads of a sample on which the grid is scored
#: grid of the network's scale and of its time constants, as multiples of the rough guess
_SCALES, _PACES = (0.1, 0.3, 1.0, 3.0, 10.0), (0.3, 1.0, 3.0)
#: rough guess of a network for 2.5 kW of spread in its heat: capacitance of the measured node and of others [kWh/K],
#: resistance inside and to the outside [K/kW]
_GUESS_HEAT, _GUESS = 2.5, (1.5, 12.0, 0.4, 4.0)
_GUESS_PLANT = 6.0  # plant for which the guess was made, where nothing tells its size [kW]
_LEAST_SPREAD = 0.1  # least spread of the known heat, as a share of its largest value
_LEAST_EVIDENCE = 1.0  # log-likelihood that a determined source gains: below it, chance explains as much
_LEAST_ERROR = 0.02  # least standard deviation of a lead's errors in its weight [K]
_GAINS, _UAS, _DAY_TYPES = (0.1, 0.3, 1.0, 3.0), (0.1, 0.3, 1.0, 3.0, 10.0), (1.0, 3.0)  # shrinkages that are tried
#: the usual response may raise the loss of forecasts by this share, plus a constant: six weeks raise it by up to 0.35
#: in EnergyPlus zones, whose thermostats' answers speak against it, and by 0.7 or more in ``make_office``
_WORSE, _WORSE_BY_CHANCE = 0.3, 4.0
_USUAL_HOURS = 24.0  # hours of forecasts that the usual errors of other zones count as
_ROUGH_GAIN = 1e-2  # relative decrease of the objective below which the search at every second lead stops


@dataclass(frozen=True)
class LeadFit:
    """A fitted schedule model."""

    problem: LeadProblem  # of the training rows
    psi: np.ndarray  # (p,) logarithms of the nonlinear parameters
    solution: Solution  # coefficients of the channels, the emitter's last
    gram: np.ndarray  # (J + 1, J + 1) of the weighted training forecasts and of the pull
    blocks: np.ndarray  # (O,) int, block of days of each origin
    left_out: np.ndarray  # (O, L, 1 once saved) errors [K] of training forecasts without their block; NaN: not measured
    reference: float  # temperature from which deviations count [degC]
    undetermined: tuple[str, ...] = ()  # plant roles of whose effect the training says next to nothing
    meters: tuple[tuple[str, tuple[float, float]], ...] = ()  # roles of measured heat, with its least and most [kW]

    @property
    def model(self) -> FilterModel:
        return self.problem.model

    @property
    def plan(self) -> ChannelPlan:
        return self.problem.plan

    @property
    def coef(self) -> np.ndarray:
        """(J,) coefficients of the channels, the emitter's last."""
        return self.solution.coef

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the coefficients, without the emitter's."""
        return self.segment.channels.names

    @property
    def sample(self) -> ForecastSample:
        """Training forecasts that were scored."""
        return self.problem.scored.sample

    @property
    def segment(self) -> Segment:
        """Training rows; of 0 rows after :meth:`without_rows`."""
        return self.problem.segment

    def make_segment(self, table: ZoneTable, T: np.ndarray) -> Segment:
        """Make a segment for this model of a table and its measured temperature (N,) [degC], NaN where missing."""
        return make_segment(self.plan, table, T, self.reference, self.segment.channels)

    def with_rows(self, segment: Segment) -> LeadFit:
        """Copy with a segment in place of the training rows."""
        scored = self.problem.scored._replace(segment=segment)
        return replace(self, problem=replace(self.problem, forecasts=(scored,)))

    @property
    def sums(self) -> NetworkSums:
        """Sums from which a prior of other zones is learned."""
        problem = self.problem
        left = np.append(-self.coef, 1.0)
        count = float(np.sum(problem.root_weights(problem.scored) ** 2 / problem.precision))
        noise = float(left @ self.gram @ left) / max(count, 1.0)
        return NetworkSums(
            self.model.network,
            self.model.step,
            self.model.names,
            self.psi,
            problem.channels,
            self.coef,
            self.gram / noise,
            self.plan.mean_outdoor,
            self.sample.leads * self.model.step,
            noise / problem.precision,
        )

    def without_rows(self) -> LeadFit:
        """Copy to be saved, of whose left-out errors only the first lead is read; ``with_rows`` restores its rows."""
        return replace(self.with_rows(self.segment.between(0, 0)), left_out=self.left_out[:, :1].copy())


def fit_leads(
    network: RCNetwork,
    table: ZoneTable,
    T: np.ndarray,
    n_leads: int,
    known: dict[str, float] | None = None,
    purpose: str = "forecast",
    prior: NetworkPrior | None = None,
) -> LeadFit:
    """Fit a network with schedules on the errors of forecasts up to ``n_leads`` rows ahead.

    ``T`` (N,) [degC], NaN where missing; ``known`` capacities [kW].  Where the rows do not tell what the known heat
    does, the network is about as large as is usual for such a plant.  With the purpose "plan" the response to a kW is
    pulled toward what jumps of the heat say of it, and forecasts are fitted with the heat that could be expected at
    their origins, unless too little of it could.  A ``prior`` takes the place of the grid, of the shrinkage and of the
    usual size.

    Raises
    ------
    ValueError
        If there are too few rows, the network heats or disturbs several nodes, a known value is no capacity or has the
        wrong sign, or the prior was learned with another network or step.
    """
    step = table.step_hours
    sample = hourly_sample(table.n_rows, n_leads, step, rows_per_day(step))
    if not len(sample.leads):
        raise ValueError(
            f"X has {table.n_rows} rows of {spell(table.step)}, too few for forecasts over {n_leads} rows: give a "
            "day or more, or a shorter horizon."
        )
    plan = make_plan(network, table, known or {}, calendar=True)
    reference = float(np.nanmean(T)) if np.isfinite(T).any() else 20.0
    pull = None
    if purpose == "plan":
        pull = GainPull.of(make_segment(plan, table, T, reference), step)
        plan = plan._replace(lags=is_delayed(pull.observed))
    scored = ScoredForecasts(make_segment(plan, table, T, reference), sample)
    if pull is not None:
        scored = with_expected_heat(scored, step)
    heat = scored.segment.heat
    # a plant that hardly ran does not make the building small
    scale = max(float(heat.std()), _LEAST_SPREAD * float(np.abs(heat).max()))
    scale = scale if scale > 1e-6 else 1.0
    if prior is not None:
        return _fit_under(prior, table, scored, reference, scale)
    if pull is not None and is_usual(pull.observed, step) is None:
        pull = _drop_contradicted_response(FilterModel.of(plan.network, step, scale), scored, pull)
    if pull is not None and scored.surprise is None and pull.shape is None and pull.observed and not plan.lags:
        pull = _toward_one_hour(FilterModel.of(plan.network, step, scale), scored, pull)
    fit, best = _fit_at_scale(table, scored, reference, scale, _SCALES, pull)
    undetermined = _undetermined(fit, best, table, T)
    if plan.known and {role for role, _ in plan.known} <= set(undetermined):
        plant = max((abs(capacity) for role, capacity in plan.known if is_stage(role)), default=_GUESS_PLANT)
        usual = _GUESS_HEAT * plant / _GUESS_PLANT
        fit, _ = _fit_at_scale(table, scored, reference, usual, (1.0,), pull)
    return replace(fit, undetermined=undetermined)


def _drop_contradicted_response(model: FilterModel, scored: ScoredForecasts, pull: GainPull) -> GainPull:
    """The pull, without the usual response of rooms if that makes forecasts with delivered heat much worse."""
    few, free = scored._replace(surprise=None).every(4), pull._replace(shape=None)
    problem, start = _start(model, few, _best_of_grid(model, few, _SCALES, free), free)
    best = minimise(problem, start, max_steps=10)
    problem = replace(problem, pull=pull)
    held = minimise(problem, problem.evaluate(best.psi), max_steps=10)
    return pull if held.loss - best.loss < _WORSE * best.loss + _WORSE_BY_CHANCE else free


def _toward_one_hour(model: FilterModel, scored: ScoredForecasts, pull: GainPull) -> GainPull:
    """A pull toward the shape of the response that forecasts over an hour tell.

    Within an hour a thermostat answers little of what happens after the origin.
    """
    lead = rows_per_hour(model.step)
    origins = np.arange(scored.sample.origins[0], scored.segment.n_rows - lead, max(lead // 2, 1))
    short = ScoredForecasts(scored.segment, ForecastSample(origins, np.array([lead])), OVERLAP)
    problem, start = _start(model, short, _best_of_grid(model, scored, _SCALES, pull), pull)
    best = minimise(problem, start, max_steps=20)
    _, H = problem.slopes(best)
    return pull.toward_response_of(model, best.psi, np.linalg.inv(H), scored.segment.plan.heated)


def with_expected_heat(scored: ScoredForecasts, step: float) -> ScoredForecasts:
    """Forecasts with expected in place of delivered heat, where there are enough days to tell it."""
    blocks = blocks_of_days(scored.sample, step)
    if not can_leave_out(blocks) or not np.any(scored.segment.heat):
        return scored
    return scored._replace(surprise=heat_surprise(scored.segment, scored.sample, blocks, step))


def _undetermined(fit: LeadFit, best: Evaluation, table: ZoneTable, T: np.ndarray) -> tuple[str, ...]:
    """Plant roles without which the rows are explained about as well as by the fit, which ``best`` evaluates."""
    out = []
    for role in (*dict(fit.plan.known), *dict(fit.plan.stages)):
        idle = table.replace(inputs={**table.inputs, role: np.zeros(table.n_rows)})
        if fit.problem.with_other_heat(best, fit.make_segment(idle, T)).loss - best.loss < _LEAST_EVIDENCE:
            out.append(role)
    return tuple(out)


def _fit_at_scale(
    table: ZoneTable,
    scored: ScoredForecasts,
    reference: float,
    heat_scale: float,
    scales: Sequence[float],
    pull: GainPull | None,
) -> tuple[LeadFit, Evaluation]:
    """Fit from the best of ``scales``, sizes relative to the usual one for a spread of heat [kW]; its evaluation."""
    step, sample, blocks = table.step_hours, scored.sample, blocks_of_days(scored.sample, table.step_hours)
    part, search = scored, minimise
    if sample.stride > 1 and pull is None:  # a gain needs all leads
        part, search = scored.every(1, sample.main_leads), partial(minimise, least_gain=_ROUGH_GAIN)
    model = FilterModel.of(scored.segment.plan.network, step, heat_scale)
    problem, start = _start(model, part, _best_of_grid(model, scored, scales, pull), pull)
    best = search(problem, start, max_steps=10)
    problem = replace(problem, shrinkage=_best_shrinkage(problem, best, blocks))
    best = search(problem, problem.solved(best.psi, best.gram, best.designs), max_steps=4)
    precision = np.interp(sample.leads, part.sample.leads, problem.precision)
    problem = replace(problem, forecasts=(scored,), precision=precision)
    return _with_contrasts(problem, best, blocks, table, reference)


def _with_contrasts(
    problem: LeadProblem, best: Evaluation, blocks: np.ndarray, table: ZoneTable, reference: float
) -> tuple[LeadFit, Evaluation]:
    """Fit with the channels of swapped days, on delivered heat, and its evaluation."""
    scored, segment = problem.scored, problem.segment
    plan = with_contrast(segment.plan, segment.channels.names, best.solution.coef)
    segment = segment._replace(plan=plan, channels=make_channels(plan, table))
    # schedules and blend learn from delivered heat, which tells more than expected heat
    problem = replace(problem, forecasts=(scored._replace(segment=segment, surprise=None),))
    best, left_out = _evaluated_by_blocks(problem, best.psi, blocks)
    measured = ((role, table.inputs[role]) for role, _ in plan.known if role.startswith("Q_"))
    meters = tuple((role, (float(heat.min()), float(heat.max()))) for role, heat in measured)
    made = LeadFit(problem, best.psi, best.solution, best.gram, blocks, left_out, reference, meters=meters)
    return made, best


def _fit_under(
    prior: NetworkPrior, table: ZoneTable, scored: ScoredForecasts, reference: float, heat_scale: float
) -> LeadFit:
    """Fit under a prior, from the best of five sizes; the prior follows the size found so far."""
    plan = scored.segment.plan
    model = FilterModel.of(plan.network, table.step_hours, heat_scale)
    prior.refuse_other(model)
    few = _few_of(scored)

    def usual_variance(leads: np.ndarray) -> np.ndarray:
        return np.interp(leads * table.step_hours, prior.leads, prior.variance)

    def problem_at(psi: np.ndarray, forecasts: ScoredForecasts) -> LeadProblem:
        weights = 1.0 / usual_variance(forecasts.sample.leads)
        own = prior.at(psi, plan.mean_outdoor)
        return LeadProblem(model, (forecasts,), prior.centre, weights, prior=own)

    best = min((problem_at(psi, few).evaluate(psi) for psi in prior.starts()), key=lambda at: at.loss)
    problem, usual = problem_at(best.psi, scored), usual_variance(scored.sample.leads)
    best = minimise(problem, problem.evaluate(best.psi), max_steps=6)
    hours = table.step_hours * float(np.mean(np.diff(scored.sample.origins))) if len(scored.sample.origins) > 1 else 1.0
    for _ in range(2):
        problem = replace(problem, prior=prior.at(best.psi, plan.mean_outdoor))
        at = problem.solved(best.psi, best.gram, best.designs)
        problem = weighted(problem, at, usual, _USUAL_HOURS / hours)
        best = minimise(problem, problem.evaluate(best.psi), max_steps=4)
    blocks = blocks_of_days(scored.sample, table.step_hours)
    return _with_contrasts(problem, best, blocks, table, reference)[0]


def _start(
    model: FilterModel, scored: ScoredForecasts, psi: np.ndarray, pull: GainPull | None
) -> tuple[LeadProblem, Evaluation]:
    """Problem around a point, each lead weighted by the inverse variance of its errors there, and its evaluation."""
    problem = LeadProblem(model, (scored,), psi, np.ones(len(scored.sample.leads)), pull=pull)
    at = problem.evaluate(psi)
    problem, (E,) = weighted(problem, at), at.designs
    E *= np.tile(np.sqrt(problem.precision), len(scored.sample.origins))[:, None]
    return problem, problem.solved(psi, gram(E) + problem.pull_gram(psi), (E,))


def weighted(
    problem: LeadProblem, at: Evaluation, usual: np.ndarray | float = 1.0, n_usual: float = 0.0
) -> LeadProblem:
    """A problem with each lead weighted by the inverse variance of its errors at a point.

    The ``usual`` variance (L,) [K2] counts as that of ``n_usual`` more errors, and holds where none is measured.
    """
    root = problem.root_weights(problem.scored)
    errors = forecast_errors(root, at.designs[0].reshape(*root.shape, -1), at.solution.coef)
    known = np.isfinite(errors).sum(axis=0) + n_usual
    squares = np.nansum(errors**2, axis=0) + n_usual * usual
    variance = np.where(known > 0, squares / np.where(known > 0, known, 1.0), usual)
    return replace(problem, precision=1.0 / np.maximum(variance, _LEAST_ERROR**2))


def _best_of_grid(
    model: FilterModel, scored: ScoredForecasts, scales: Sequence[float], pull: GainPull | None
) -> np.ndarray:
    """The point (p,) of a coarse grid with the least loss of a few forecasts."""
    few = _few_of(scored)

    def evaluate(scale: float, pace: float) -> Evaluation:
        psi = _guess(model, scale * model.heat_scale / _GUESS_HEAT, pace)
        return LeadProblem(model, (few,), psi, np.ones(len(few.sample.leads)), pull=pull).evaluate(psi)

    return min((evaluate(scale, pace) for scale in scales for pace in _PACES), key=lambda at: at.loss).psi


def _few_of(scored: ScoredForecasts) -> ScoredForecasts:
    """A few of the forecasts and leads, on which starts are compared."""
    leads = scored.sample.leads
    return scored.every(6, leads[_COARSE] if len(leads) > 4 else leads)


def _guess(model: FilterModel, scale: float, pace: float) -> np.ndarray:
    """Logarithms of a rough guess: ``scale`` makes the building larger, ``pace`` slower."""
    measured, other, inside, outside = _GUESS
    network = model.network
    values = [
        (measured if node == network.measured_nodes[0] else other) * scale * pace for node in network.capacitances
    ]
    for ends in network.resistors.values():
        values.append((inside if all(end in network.capacitances for end in ends) else outside) / scale)
    theta = dict(zip([*network.capacitances.values(), *network.resistors], values, strict=True))
    of_filter = {"sigma_x": 0.05, "sigma_g": 0.3 * model.heat_scale, "tau_g": 6.0, "tau_e": 0.5}
    return np.log([{**theta, **of_filter}[name] for name in (*model.builder.parameters, *FILTER_PARAMETERS)])


def _best_shrinkage(problem: LeadProblem, at: Evaluation, blocks: np.ndarray) -> Shrinkage:
    """Shrinkage with the least error in blocks that are left out in turn."""
    if not problem.plan.calendar or not can_leave_out(blocks):
        return Shrinkage()
    scored = problem.scored
    grams = block_grams(at.designs[0], scored.sample, blocks)
    scale, positive = problem.model.heat_scale, problem.positive

    def error(shrinkage: Shrinkage) -> float:
        penalty, out = penalty_of(scored.segment, shrinkage, scale), 0.0
        for block, others in grams:
            residual = np.append(-solve_coefficients(others, penalty, positive).coef, 1.0)
            out += float(residual @ block @ residual)
        return out

    # one coordinate after the other: the three hardly depend on each other
    best = min((Shrinkage(g, u) for g in _GAINS for u in _UAS), key=error)
    return min((best._replace(day_type=d) for d in _DAY_TYPES), key=error)


def _evaluated_by_blocks(problem: LeadProblem, psi: np.ndarray, blocks: np.ndarray) -> tuple[Evaluation, np.ndarray]:
    """Evaluation, and (O, L) errors [K] of forecasts whose block of days was left out; NaN where not measured."""
    scored = problem.scored
    errors = np.full((len(scored.sample.origins), len(scored.sample.leads)), np.nan)
    if not can_leave_out(blocks):
        return problem.evaluate(psi), errors
    E, root = problem.design(psi, scored), problem.root_weights(scored)
    grams, by_origin = block_grams(E, scored.sample, blocks), E.reshape(*errors.shape, -1)
    for b, (_, others) in enumerate(grams):
        own = slice(*np.searchsorted(blocks, [b, b + 1]))
        errors[own] = forecast_errors(root[own], by_origin[own], problem.solve(others).coef)
    products = np.sum([own for own, _ in grams], axis=0) + problem.pull_gram(psi)
    return problem.solved(psi, products, (E,)), errors


def forecast_errors(root: np.ndarray, design: np.ndarray, coef: np.ndarray) -> np.ndarray:
    """(O, L) errors [K] of a design (O, L, J + 1) of root weights under coefficients; NaN without a measurement."""
    e = design[..., -1] - design[..., :-1] @ coef
    return np.where(root > 0, e / np.where(root > 0, root, 1.0), np.nan)
