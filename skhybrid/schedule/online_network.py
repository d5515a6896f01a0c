"""A network at fixed nonlinear parameters that goes through rows and re-solves its coefficients."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from .._shallow import shallow_copy
from .._time import rows_per_day
from ..filtering import lead_errors, lead_rows, simulate_path, with_products
from .filter_model import Matrices
from .fit import LeadFit
from .lead_problem import LeadProblem
from .responses import ResponseFilter, Responses, emitter_series, node_inputs
from .segment import Segment

HALF_LIVES = (30.0, 7.0)  # days after which evidence counts half: in a long memory, and in one that adapts sooner
HISTORY_WEIGHT = 3.0  # weight of a forecast of the history relative to one of the training


class CompletedForecasts(NamedTuple):
    """Forecasts, one per origin and lead, whose target has been measured."""

    columns: np.ndarray  # (k, J + 1), weighted
    root: np.ndarray  # (k,) square roots of the weights
    origin: np.ndarray  # (k,) rows
    lead: np.ndarray  # (k,) index of the lead
    age: np.ndarray  # (k,) rows from the target to the last row


class OpenForecasts:
    """Forecasts at increasing ``leads`` (L,) that wait for their targets, with the rows that they need."""

    def __init__(self, problem: LeadProblem, leads: np.ndarray, matrices: Matrices) -> None:
        self._problem, self._leads = problem, leads
        self._lead_rows, _ = lead_rows(matrices.F, matrices.dF, problem.model.zone, leads)
        self._first = 0  # row at which the kept series begin
        self._series, self._seen = np.empty((0, 0)), np.empty(0, dtype=bool)
        self._origins, self._weight = np.empty(0, dtype=np.int64), np.empty(0)
        self._states = np.empty((0, 0, 0))

    def advance(
        self, responses: Responses, seen: np.ndarray, first: int, origins: np.ndarray, spacing: float
    ) -> CompletedForecasts:
        """Add rows from ``first`` on and the forecasts from ``origins`` (rows), which are ``spacing`` rows apart."""
        self._append(responses, seen, first, origins, spacing)
        end = first + len(seen)
        targets = self._origins[:, None] + self._leads
        known = (targets >= first) & (targets < end)
        known &= self._seen[np.minimum(targets, end - 1) - self._first]
        root = self._problem.root_weights_of(known, self._weight)
        E = lead_errors(self._series, self._states, self._lead_rows, self._origins - self._first, self._leads, root)
        place, lead = np.nonzero(root)
        age = end - 1 - targets[place, lead]
        completed = CompletedForecasts(E[root.ravel() > 0], root[place, lead], self._origins[place], lead, age)
        self._drop_before(end)
        return completed

    def _append(self, responses: Responses, seen: np.ndarray, first: int, origins: np.ndarray, spacing: float) -> None:
        if not len(self._origins):
            self._first, self._series, self._seen, self._states = first, responses.series, seen, responses.states
        else:
            self._series = np.concatenate([self._series, responses.series])
            self._seen = np.concatenate([self._seen, seen])
            self._states = np.concatenate([self._states, responses.states])
        weight = HISTORY_WEIGHT * self._problem.overlap_weight(spacing)
        self._origins = np.concatenate([self._origins, origins])
        self._weight = np.append(self._weight, np.full(len(origins), weight))

    def _drop_before(self, end: int) -> None:
        """Keep the forecasts with targets at row ``end`` or later, and their rows."""
        is_open = self._origins + self._leads[-1] >= end
        self._origins, self._states, self._weight = self._origins[is_open], self._states[is_open], self._weight[is_open]
        first = int(self._origins[0]) if len(self._origins) else end
        keep = slice(first - self._first, None)
        self._first, self._series, self._seen = first, self._series[keep], self._seen[keep]


class OriginState(NamedTuple):
    """State of a network at an origin."""

    psi: np.ndarray  # (p,)
    matrices: Matrices
    coef: np.ndarray  # (J,)
    nodes: np.ndarray  # (n,) temperatures [K from the reference], before the inputs of the origin's row act
    gain: float  # unmeasured heat that the filter estimates [kW]
    emitter: float  # heat that the emitter gives off from what it was given before the origin's row [kW]


class CoefficientMemory:
    """Coefficients by forecasts that count half after ``half_life`` rows.

    The training's Gram matrix ``products`` (J + 1, J + 1) counts fully at ``row``.
    """

    def __init__(self, problem: LeadProblem, products: np.ndarray, row: int, half_life: float) -> None:
        self._problem, self._products, self._row, self._half_life = problem, products, row, half_life
        self._coef: np.ndarray | None = None

    def learn(self, columns: np.ndarray, age: np.ndarray, row: int) -> None:
        """Add weighted forecasts (k, J + 1) whose targets are ``age`` rows before ``row``; earlier ones fade."""
        root_fade = 0.5 ** (0.5 * age / self._half_life)
        fade = 0.5 ** (max(row - self._row, 0) / self._half_life)
        self._products = with_products(self._products, columns * root_fade[:, None], fade)
        self._row, self._coef = max(row, self._row), None

    @property
    def coef(self) -> np.ndarray:
        """(J,) solved when first read after new forecasts."""
        if self._coef is None:
            self._coef = self._problem.solve(self._products).coef
        return self._coef


class OnlineNetwork:
    """A network at one psi (p,) that goes through rows, ``begin`` being the first new one, and its coefficients."""

    def __init__(self, fit: LeadFit, psi: np.ndarray, begin: int) -> None:
        self.psi, self._fit, self._begin = psi, fit, begin
        self._filter = ResponseFilter(fit.model, psi, fit.plan, fit.segment.channels.node)
        self._open = OpenForecasts(fit.problem, fit.sample.leads, self._filter.matrices)
        self._n_rows = 0
        self.start_memories(fit.gram)

    def start_memories(self, products: np.ndarray) -> None:
        """Begin with the Gram matrix (J + 1, J + 1) of the training forecasts."""
        per_day = rows_per_day(self._fit.model.step)
        self._memories = [
            CoefficientMemory(self._fit.problem, products, self._begin, days * per_day) for days in HALF_LIVES
        ]

    def fork(self) -> Self:
        """A copy that goes on by itself; its parts replace what they hold, and modify nothing."""
        made = shallow_copy(self)
        made._filter, made._open = shallow_copy(self._filter), shallow_copy(self._open)
        made._memories = [shallow_copy(memory) for memory in self._memories]
        return made

    def respond(self, segment: Segment, origins: np.ndarray) -> Responses:
        """Simulate and filter the next rows; ``origins`` count from the first of them."""
        self._n_rows += segment.n_rows
        return self._filter.run(segment, origins)

    def advance(self, segment: Segment, first: int, origins: np.ndarray, spacing: float) -> CompletedForecasts:
        """Go through the next rows, from row ``first`` on; forecasts begin at ``origins``, ``spacing`` rows apart."""
        return self._open.advance(self.respond(segment, origins - first), segment.seen, first, origins, spacing)

    def learn(self, completed: CompletedForecasts, row: int) -> None:
        """Add forecasts that have ended by the last row, ``row``."""
        for memory in self._memories:
            memory.learn(completed.columns, completed.age, row)

    def coefs(self) -> np.ndarray:
        """(K, J) coefficients of each memory."""
        return np.array([memory.coef for memory in self._memories])

    def coef(self, memory: int) -> np.ndarray:
        """(J,) coefficients of one memory."""
        return self._memories[memory].coef

    def state(self, coef: np.ndarray) -> OriginState:
        """State at the last row under coefficients (J,)."""
        emitter, filtered = self._filter.emitter, self._filter.filtered @ np.append(-coef, 1.0)
        # before the first of all rows the emitter is taken as cold
        output = emitter.output if emitter is not None and self._n_rows > 1 else 0.0
        nodes = self._filter.last_states @ np.append(coef, 1.0) + filtered[:-1]
        return OriginState(self.psi, self._filter.matrices, coef, nodes, filtered[-1], output)

    @property
    def emitted(self) -> float:
        """Heat that the emitter gives off in the last row [kW]."""
        return 0.0 if self._filter.emitter is None else self._filter.emitter.output

    def forecast(self, ahead: Segment, n_known: int, coefs: np.ndarray, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """(K, n_leads) deviations [K] and unmeasured heat [kW] after the last row, under coefficients (K, J).

        ``ahead`` are the ``n_known`` rows that follow, or the last row where there are none; the last of them is held.
        """
        M, leads = self._filter.matrices, np.arange(1, n_leads + 1)
        P, _ = lead_rows(M.F, M.dF, self._fit.model.zone, leads)
        rows = np.minimum(leads - 1, n_known - 1)
        filtered = self._filter.filtered @ np.column_stack([-coefs, np.ones(len(coefs))]).T
        paths = self._simulate(ahead, n_known, coefs)[:, rows] + (P @ filtered).T
        heat = ahead.channels.scheduled_heat(coefs.T)[rows].T + np.outer(filtered[-1], M.F[-1, -1] ** leads)
        return paths, heat

    def _simulate(self, ahead: Segment, n_known: int, coefs: np.ndarray) -> np.ndarray:
        """(K, n_known) simulated output of the rows that follow, or (K, 1) that of the last row."""
        responses, zone = self._filter, self._fit.model.zone
        weights = np.column_stack([coefs, np.ones(len(coefs))])
        if n_known == 0:
            return weights @ responses.last_states[[zone]].T
        M, begin = responses.matrices, weights @ responses.next_states.T
        lag = emitter_series(ahead.heat, self._fit.model.step, np.exp(self.psi[-1]), responses.emitter)
        forcing = [node_inputs(ahead, coef, lag) @ M.B.T for coef in coefs]
        paths = [simulate_path(M.A, f[:-1], state)[:, zone] for f, state in zip(forcing, begin, strict=True)]
        return np.array(paths)
