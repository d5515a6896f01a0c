"""Rolling blend: members that go through rows, weighed by their errors so far, and a residual correction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ..._shallow import shallow_copy
from ...control import Plan
from ...filtering import ForecastSample
from ...forecasting.intervals import DAYS_BACK
from ..plausible_range import PlausibleRange
from ..scheme import RecentErrors
from .blend import PULL, blend_weights, by_lead, faded, moments
from .members import Member
from .numbered_table import NumberedTable
from .without_response import RollingWithoutResponse

#: days back at which errors are read, and the share of them that is added: from five simulated buildings, three homes'
#: training weeks and the paper's office; shares regressed on each building's own errors did worse.  Yesterday's are
#: read in a young log, which knows little of a week ago, all of that share after a day and none after four weeks
_DAYS_BACK, _SHARES, _YOUNG = np.array([1, 7, 14]), np.array([0.20, 0.10, 0.08]), (1.0, 28.0)
#: days known at which the prior is the settled one; sooner where a fleet speaks for all members (EnergyPlus rooms on
#: dates that are not in benchmarks/fleet_prior.py)
SETTLED_DAYS, SETTLED_DAYS_OF_FLEET = 14.0, 7.0
#: days known between which the weights become those of errors, and the pull toward the prior at either end
_DAYS, _PULLS = (1.0, SETTLED_DAYS), (8.0, PULL)
#: days of training, and how much its left-out errors count beside those of the history: with a few days fewer a fit is
#: another one
_TRAINED_DAYS, _TRUST = (7.0, SETTLED_DAYS), (0.03, 1.0)


@dataclass(frozen=True)
class BlendRecord:
    """Knowledge of a blend about its members, from their training."""

    sample: ForecastSample
    member_errors: np.ndarray  # (O, L, M) float32, of each member on blocks that were left out [K]
    member_of: np.ndarray  # (K,) int, the member of each way to forecast
    products: np.ndarray  # (n_groups, K, K) moments of these errors, faded up to the last row of the training
    groups: np.ndarray  # (L,) group of each lead
    priors: np.ndarray  # (2, K) weights where nothing is known of errors, after a day and from ``settled_days`` on
    settled_days: float
    n_days: float  # of the training
    n_leads: int
    rows_per_day: int
    every: int  # rows between forecasts of the history
    plausible: PlausibleRange  # of the training's temperatures

    def errors(self, chosen: Any = slice(None)) -> np.ndarray:
        """(O, L, K) errors of each way to forecast, from some of the origins."""
        return self.member_errors[chosen][..., self.member_of]

    def weights(self) -> np.ndarray:
        """(n_groups, K) shares by the training."""
        return blend_weights(self.products, *self.caution(0.0))

    @property
    def trust(self) -> float:
        """Share of a training error beside one of the history."""
        return float(np.interp(self.n_days, _TRAINED_DAYS, _TRUST))

    def shares_back(self, n_more: float) -> np.ndarray:
        """Shares of earlier errors that may come back, so many days after the training."""
        youth = np.interp(self.n_days + n_more, _YOUNG, (1.0, 0.0))
        return np.where(_DAYS_BACK == 1, youth, 1.0) * _SHARES

    def caution(self, n_more: float) -> tuple[np.ndarray, float]:
        """Prior weights (K,), and the pull toward them, so many days after the training."""
        days, (first, settled) = self.n_days + n_more, self.priors
        share = np.interp(days, (_DAYS[0], self.settled_days), (0.0, 1.0))
        return first + share * (settled - first), float(np.interp(days, _DAYS, _PULLS))


class RollingBlend:
    """A blend of fitted members, one of which gives the unmeasured heat, that goes through new rows from row 0 on."""

    def __init__(self, members: Sequence[Member], record: BlendRecord, rows: NumberedTable, adapt: str | None) -> None:
        self._members, self._record, self.adapt = members, record, adapt
        self._begin, self._joined = rows.begin, rows.joined
        self._rolling = [member.start(rows, record.sample, adapt) for member in members]
        self._products = np.zeros_like(record.products)
        self.row = -1  # the last row that it went through
        self._weighed: tuple[int, np.ndarray, np.ndarray] | None = None  # a row, and weights and errors known there
        self._first = 0  # number of the first hourly forecast whose errors are kept

    def fork(self) -> Self:
        """A copy that goes on by itself, in a time that does not depend on how many rows there were."""
        made, record = shallow_copy(self), self._record
        reach = int(record.sample.leads[-1]) + (DAYS_BACK + 1) * record.rows_per_day
        made._first = max(self._first, (self.row - reach - self._begin) // record.every)
        made._rolling = [rolling.fork(made._first) for rolling in self._rolling]
        return made

    def views(self, rows: NumberedTable) -> list[Any]:
        """The rows as each member takes them; the network needs none that it has gone through."""
        network, *others = self._members
        return [network.view(rows.since(self.row)), *(member.view(rows) for member in others)]

    def advance(self, views: list[Any], origin: int) -> None:
        """Go through the rows up to and including ``origin``."""
        refits = self.network.refits(origin)
        # all stop before and at a refit, so that it does not matter in how many calls the rows come
        for row in sorted({*refits, *(refit - 1 for refit in refits), origin}):
            for rolling, view in zip(self._rolling, views, strict=True):
                if isinstance(rolling, RollingWithoutResponse):
                    rolling.follow(self.network)
                rolling.advance(view, row)
        before, self.row = max(self.row, self._begin), origin
        if self.adapt is not None and origin > before:
            self._products = self._products * self._share(before, origin) + self._since(before)

    def solve(self) -> None:
        """Compute coefficients and weights now, and not when they are first read."""
        for rolling in self._rolling:
            rolling.solve()
        self._known()

    def forecast(
        self, views: list[Any], n_leads: int, plausible: PlausibleRange | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """From the last row: (n_leads,) temperatures [degC], clipped to what is plausible, and unmeasured heat [kW].

        Without a plausible range nothing is clipped, in the members neither.
        """
        if not n_leads:
            return np.empty(0), np.empty(0)
        clip, clipped = (np.asarray, False) if plausible is None else (plausible.clip, True)
        found = [rolling.forecast(view, n_leads, clipped) for rolling, view in zip(self._rolling, views, strict=True)]
        heat, (shares, missed) = next(heats[0] for _, heats in found if heats is not None), self._known()
        weights = by_lead(shares, self._record.n_leads, n_leads)
        path = np.sum(clip(np.concatenate([paths for paths, _ in found])).T * weights, axis=1)
        return clip(path + np.interp(np.arange(1, n_leads + 1), self._record.sample.leads, missed)), heat

    def gain(self, plan: Plan, first_lead: int) -> np.ndarray:
        """(H, H, m) gain by a plan, whose first row is that of lead ``first_lead``, 0 or 1; nothing is clipped."""
        n = len(plan.values)
        weights = np.zeros((n, len(self._record.member_of)))
        weights[1 - first_lead :] = by_lead(self._known()[0], self._record.n_leads, n - 1 + first_lead)
        found = np.concatenate([rolling.gain(plan) for rolling in self._rolling])
        return np.asarray(np.einsum("ik,kijm->ijm", weights, found))

    def recent_errors(self) -> RecentErrors | None:
        """Errors of the forecasts since the training that began whole days (up to an hour more) before the last row."""
        record = self._record
        if self.adapt is None or self.row < self._begin:
            return None
        errors, origins = self._history(self._first)
        rows = self.row - record.rows_per_day * np.arange(1, DAYS_BACK + 1)
        at = np.searchsorted(origins, rows[rows >= self._begin], side="right") - 1
        missed = np.sum(errors[at] * self._known()[0][record.groups], axis=-1)
        known = origins[at][:, None] + record.sample.leads <= self.row
        return RecentErrors(np.where(known, missed, np.nan), self.row - origins[at], record.sample.leads)

    @property
    def network(self) -> Any:
        """The member that is a network."""
        return self._rolling[0]

    def _known(self) -> tuple[np.ndarray, np.ndarray]:
        """As known at the last row: weights (n_groups, K) of the ways to forecast, and what these missed (L,) [K]."""
        if self._weighed is None or self._weighed[0] != self.row:
            shares, record = self._weigh(), self._record
            missed = np.zeros(len(record.sample.leads)) if self.adapt is None else self._missed(shares[record.groups])
            self._weighed = self.row, shares, missed
        return self._weighed[1:]

    def _weigh(self) -> np.ndarray:
        record = self._record
        products, n_more = record.products, 0.0
        if self.adapt is not None:  # what was seen in training fades as what the history shows
            share = record.trust * self._share(self._begin, max(self.row, self._begin))
            products, n_more = products * share + self._products, self._n_more
        return blend_weights(products, *record.caution(n_more))

    @property
    def _n_more(self) -> float:
        """Days after the training."""
        return (self.row + 1 - self._begin) / self._record.rows_per_day

    def heat_now(self, views: list[Any]) -> float:
        """Unmeasured heat over the step of the last row [kW]."""
        return self.network.heat_now(views[0])

    def _share(self, row: Any, later: int) -> Any:
        """Weights at a row of forecasts that ended before it."""
        return faded((later - row) / self._record.rows_per_day)

    def _since(self, before: int) -> np.ndarray:
        """Moments of the errors that have become known after a row."""
        record = self._record
        first = max(0, (before - int(record.sample.leads[-1]) - self._begin) // record.every)
        errors, origins = self._history(first)
        ends = origins[:, None] + record.sample.leads
        return moments(errors, record.groups, np.where(ends > before, self._share(ends, self.row), 0.0))

    def _history(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Errors (O, L, K) of forecasts of the history from one on, and their origins."""
        kept = first - self._first
        errors = np.concatenate([rolling.errors[kept:] for rolling in self._rolling], axis=-1)
        origins = self._begin + self._record.every * np.arange(first, first + len(errors))
        return self._record.plausible.clip_errors(errors), origins

    def _missed(self, shares: np.ndarray) -> np.ndarray:
        """(L,) what the blend of these shares (L, K) missed that may come back."""
        record = self._record
        oldest = self.row - (int(_DAYS_BACK.max()) + 1) * record.rows_per_day
        first = max(0, (oldest - self._begin) // record.every)
        origins = self._begin + record.every * np.arange(first, self._first + len(self._rolling[0].errors))
        trained = np.flatnonzero(record.sample.origins >= oldest) if self._joined else np.empty(0, dtype=np.int64)
        origins = np.append(record.sample.origins[trained], origins)

        def missed_from(place: int) -> np.ndarray:
            if place < len(trained):
                errors = record.errors(trained[place])
            else:
                kept = first + place - len(trained) - self._first
                errors = np.concatenate([rolling.errors[kept] for rolling in self._rolling], axis=-1)
                errors = record.plausible.clip_errors(errors)
            return np.sum(errors * shares, axis=-1)

        leads, back = record.sample.leads, record.shares_back(self._n_more)
        return residual_correction(missed_from, origins, leads, self.row, record.rows_per_day, record.every, back)


def residual_correction(
    errors_from: Callable[[int], np.ndarray],
    origins: np.ndarray,
    leads: np.ndarray,
    row: int,
    rows_per_day: int,
    every: int,
    shares: np.ndarray,
) -> np.ndarray:
    """(L,) expected error of a forecast from ``row``, 0 where unknown, by errors (L,) from some of ``origins`` (O,).

    These are ``every`` rows apart, but where history joins the training.  ``shares`` of the errors are added.
    """
    if len(origins) < 2:
        return np.zeros(len(leads))
    rows = row - _DAYS_BACK * rows_per_day
    at = np.searchsorted(origins, rows, side="right") - 1
    near = (at >= 0) & (rows - origins[np.maximum(at, 0)] < every) & (shares > 0.0)
    out = np.zeros(len(leads))
    for share, place in zip(shares[near], at[near], strict=True):
        errors = errors_from(int(place))
        out += share * np.where((origins[place] + leads <= row) & np.isfinite(errors), errors, 0.0)
    return out
