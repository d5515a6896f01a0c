"""Intervals around a blend of members, which are wider where the members disagree."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ...forecasting.intervals import LEAST_ERRORS, LeadIntervals, PathClock

#: weight of the usual disagreement beside that of a row, as members that agree may all be wrong (five EnergyPlus
#: buildings; 1 to 3 did about as well)
_USUAL = 2.0
_REACHED = 0.4  # distance from the median of the levels whose quantiles reach a member that may be right alone
_LEAST = 1e-12  # variance of members that always agree


class MemberValues(NamedTuple):
    """Forecasts of the members of a blend, or their errors: they differ alike in both."""

    values: np.ndarray  # (n_origins, n_leads, M), NaN where unknown
    weights: np.ndarray  # (n_leads, M) of the blend
    clock: PathClock  # of the targets
    runs: np.ndarray | None = None  # (n_origins, n_leads) whether the plant is forecast to run

    def of_state(self, runs: bool) -> MemberValues:
        """Those in which the plant is forecast to run, or to rest; the others are NaN."""
        assert self.runs is not None
        return self._replace(values=np.where((self.runs == runs)[..., None], self.values, np.nan))

    def of_blend(self) -> np.ndarray:
        """(n_origins, n_leads) by the blend."""
        return np.asarray(np.sum(self.values * self.weights, axis=-1))

    def variance(self) -> np.ndarray:
        """(n_origins, n_leads) weighted variance of the members about the blend."""
        return np.asarray(np.sum(self.weights * (self.values - self.of_blend()[..., None]) ** 2, axis=-1))


class MemberIntervals(NamedTuple):
    """Intervals whose width follows, beside lead, hour and recent errors, how much the members differ."""

    intervals: LeadIntervals
    usual: float  # mean variance of the members about the blend in training

    @classmethod
    def learn(cls, errors: MemberValues, independent_per_day: float) -> Self | None:
        """Learn from errors on data that the members were not fitted on; None where there are too few."""
        missed = errors.of_blend()
        if np.isfinite(missed).sum() < LEAST_ERRORS:
            return None
        made = cls(LeadIntervals(independent_per_day=independent_per_day), float(np.nanmean(errors.variance())))
        made.intervals.fit(missed, made._clock(errors))
        return made

    def offsets(
        self,
        paths: MemberValues,
        levels: np.ndarray,
        recent: MemberValues | None,
        now: float,
        further: np.ndarray | None,
    ) -> np.ndarray:
        """(n_leads, n_levels) quantiles of the error of one path, as those of :meth:`LeadIntervals.offsets`."""
        known = None if recent is None else (recent.of_blend(), self._clock(recent))
        return self.intervals.offsets(self._clock(paths), levels, known, now, further)

    def _clock(self, members: MemberValues) -> PathClock:
        """Their clock, with the spread of the members."""
        return members.clock._replace(spread=np.sqrt(members.variance() + _USUAL * self.usual + _LEAST))


class StateIntervals(NamedTuple):
    """Intervals of a load: those of rows in which the plant is forecast to run, and to rest.

    Hours of rest, in which all members are right, say nothing of how wrong they are while the plant runs.
    """

    running: MemberIntervals
    resting: MemberIntervals

    @classmethod
    def learn(cls, errors: MemberValues, independent_per_day: float) -> Self | None:
        """As :meth:`MemberIntervals.learn`; a state with too few errors has the intervals of the other."""
        running, resting = (MemberIntervals.learn(errors.of_state(runs), independent_per_day) for runs in (True, False))
        either = running or resting
        return None if either is None else cls(running or either, resting or either)

    def offsets(
        self,
        paths: MemberValues,
        levels: np.ndarray,
        recent: MemberValues | None,
        now: float,
        further: np.ndarray | None,
    ) -> np.ndarray:
        """(n_leads, n_levels) quantiles of the error of one path, as those of :meth:`MemberIntervals.offsets`."""
        assert paths.runs is not None
        running, resting = (
            of.offsets(paths, levels, recent and recent.of_state(runs), now, further)
            for of, runs in zip(self, (True, False), strict=True)
        )
        return np.where(paths.runs[0][:, None], running, resting)


def reaching(offsets: np.ndarray, farther: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Offsets (n_leads, n_levels) of quantiles, of which the 10 and 90 % ones reach as far as a member (n_leads,)."""
    side, share = np.sign(levels - 0.5), np.minimum(np.abs(levels - 0.5) / _REACHED, 1.0)
    reach = side * farther[:, None] * share
    return np.where(reach > 0.0, side * np.maximum(side * offsets, reach), offsets)
