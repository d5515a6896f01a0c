"""Forecasts of the history, from their origins until their targets are measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..filtering import lead_errors, lead_rows
from .filter_model import Matrices
from .lead_problem import LeadProblem
from .responses import Responses

#: weight of a forecast of the history relative to one of the training
HISTORY_WEIGHT = 3.0


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
        self._lead_rows, _ = lead_rows(matrices.F, matrices.dF[..., :0], problem.model.zone, leads)
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
