"""Least squares of forecast errors: CONV, ID and OD with ``objective="multi_step"``."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..._time import rows_per_day, rows_per_hour
from ...filtering import ForecastSample, hourly_sample, multi_step_sensitivities
from ..experiment import Experiment
from .prediction_errors import PredictionErrorProblem


@dataclass(frozen=True)
class ForecastErrorProblem(PredictionErrorProblem):
    """Least squares of forecast errors from hourly origins, over ``n_leads`` rows, the first origin at row ``first``.

    Overlapping forecasts share noise, so that errors at a lead of h hours count as one every h hours, and all leads of
    one origin as one: the Gauss-Newton matrix and the weight of the priors use that number of errors.
    """

    n_leads: int = field(kw_only=True)
    first: int = field(kw_only=True)

    def __post_init__(self) -> None:
        if not any(seen.any() for seen in self._seen):
            raise ValueError(
                'objective="multi_step" finds no measurement of y after another one within the horizon; give more '
                'rows, or use objective="one_step".'
            )

    @property
    def one_step(self) -> PredictionErrorProblem:
        """The same problem with the errors one step ahead."""
        return PredictionErrorProblem(
            self.network, self.experiment, self.disturbance, self.searched, self.fixed, self.centre, self.spread
        )

    @cached_property
    def samples(self) -> tuple[ForecastSample, ...]:
        """Origins and leads of every segment of rows."""
        return tuple(self._sample(segment) for segment in self.experiment.segments)

    def _sample(self, segment: Experiment) -> ForecastSample:
        """Hourly origins, each moved on to the first measured row of its hour; an hour without one has none."""
        n_rows = len(segment.y)
        first = self.first if self._kalman(n_rows) else 0  # OD searches its first state
        sample = hourly_sample(n_rows, self.n_leads, segment.hours, first)
        measured = np.flatnonzero(np.isfinite(segment.outputs).any(axis=1))
        place = np.searchsorted(measured, sample.origins)
        inside = place < len(measured)
        origins = measured[place[inside]]
        return sample._replace(origins=origins[origins < sample.origins[inside] + rows_per_hour(segment.hours)])

    def _kalman(self, n_rows: int) -> int:
        """Rows over which a filter runs: none for OD, else all (CONV takes the state at every origin from it)."""
        return n_rows if self.disturbance.filtered(n_rows) else 0

    @cached_property
    def _seen(self) -> tuple[np.ndarray, ...]:
        """(O, L, o) of every segment: whether a forecast meets a measurement."""
        out = []
        for segment, sample in zip(self.experiment.segments, self.samples, strict=True):
            rows, inside = sample.targets(len(segment.y))
            out.append(inside[..., None] & np.isfinite(segment.outputs[rows]))
        return tuple(out)

    @cached_property
    def n_counted(self) -> int:
        """Number of independent errors that the forecasts amount to."""
        worth, apart = 0.0, rows_per_hour(self.experiment.hours)
        for seen, sample in zip(self._seen, self.samples, strict=True):
            worth += float(seen.sum(axis=(0, 2)) @ np.minimum(apart / sample.leads, 1.0)) / len(sample.leads)
        return max(1, round(worth))

    @property
    def weighted(self) -> bool:
        """Forecast errors are not weighted."""
        return False

    def _errors(self, free: np.ndarray, derive: bool) -> tuple[np.ndarray, np.ndarray]:
        """Errors of all forecasts, (S, n), by origin, lead and output, and their derivatives (S, n, p)."""
        S, parts = len(free), []
        for m, segment, sample in zip(self.models(free, derive), self.experiment.segments, self.samples, strict=True):
            kalman = self._kalman(len(segment.y))
            exact = not kalman and bool(np.isnan(segment.outputs).any())
            run = multi_step_sensitivities(m, segment.inputs, segment.outputs, kalman, exact, *sample)
            n = run.errors[0].size
            parts.append((run.errors.reshape(S, n), run.derrors.reshape(S, n, run.derrors.shape[-1])))
        errors, derrors = (np.concatenate(values, axis=1) for values in zip(*parts, strict=True))
        return errors, derrors

    @property
    def n_entries(self) -> int:
        """Errors of one point, with those that meet no measurement."""
        return sum(seen.size for seen in self._seen)

    @property
    def days(self) -> np.ndarray:
        """(n,) day of the origin of every error, numbered without gaps."""
        per_day = rows_per_day(self.experiment.hours)
        day = [
            np.repeat((sample.origins + begin) // per_day, seen[0].size)
            for begin, seen, sample in zip(self.experiment.breaks, self._seen, self.samples, strict=True)
            if len(seen)
        ]
        return np.unique(np.concatenate(day), return_inverse=True)[1]

    @property
    def overlap(self) -> int:
        """Days over which the errors of one day are correlated with those of another."""
        return int(np.ceil(self.n_leads * self.experiment.hours / 24.0)) + 1
