"""A blend on its way through rows: its members go along, are weighed by their errors so far, and what they missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..filtering import ForecastSample
from .blend import blend_weights, by_lead, faded, moments
from .members import Member, NumberedTable
from .residual_correction import DAYS_BACK, echo


@dataclass(frozen=True)
class BlendTraining:
    """What a blend knows of its members from their training."""

    sample: ForecastSample
    errors: np.ndarray  # (O, L, K) on blocks that were left out [K]
    products: np.ndarray  # (n_groups, K, K) moments of these errors, faded up to the last row of the training
    groups: np.ndarray  # (L,) group of each lead
    prior: np.ndarray  # (K,) weights where nothing is known of errors
    pull: float  # toward them
    n_leads: int
    a_day: int  # rows
    every: int  # rows between forecasts of the history


class RollingBlend:
    """A blend that goes through later rows and forecasts from them.

    Parameters
    ----------
    members : sequence of Member
        Fitted.  The first one tells the unmeasured heat.
    trained : BlendTraining
    rows : NumberedTable
        Where it begins, at row 0.
    adapt : {None, "linear", "full"}

    Attributes
    ----------
    adapt : {None, "linear", "full"}
    row : int
        The last row that it went through; -1 before the first.
    """

    def __init__(
        self, members: Sequence[Member], trained: BlendTraining, rows: NumberedTable, adapt: str | None
    ) -> None:
        self._members, self._trained, self.adapt = members, trained, adapt
        self._begin, self._joined = rows.begin, rows.joined
        self._courses = [member.start(rows, trained.sample, adapt) for member in members]
        self._products = np.zeros_like(trained.products)
        self.row = -1

    def views(self, rows: NumberedTable) -> list[Any]:
        """Rows as the members take them."""
        return [member.view(rows) for member in self._members]

    def advance(self, views: list[Any], origin: int) -> None:
        """Go through the rows up to ``origin``, that one included."""
        for course, view in zip(self._courses, views, strict=True):
            course.advance(view, origin)
        before, self.row = max(self.row, self._begin), origin
        if self.adapt is not None and origin > before:
            self._products = self._products * self._share(before, origin) + self._since(before)

    def forecast(self, views: list[Any], n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """From the last row: (n_leads,) temperatures [degC], and unmeasured heat [kW]."""
        found = [course.forecast(view, n_leads) for course, view in zip(self._courses, views, strict=True)]
        trained, heats = self._trained, found[0][1]
        assert heats is not None  # the physics gives it
        products = trained.products
        if self.adapt is not None:  # what was seen in training fades as what the history shows
            products = products * self._share(self._begin, max(self.row, self._begin)) + self._products
        shares = blend_weights(products, trained.prior, trained.pull)
        weights = by_lead(shares, trained.n_leads, n_leads)
        path = np.sum(np.concatenate([paths for paths, _ in found]).T * weights, axis=1)
        if self.adapt is not None:
            missed = self._missed(shares[trained.groups])
            path += np.interp(np.arange(1, n_leads + 1), trained.sample.leads, missed)
        return path, heats[0]

    def _share(self, row: Any, later: int) -> Any:
        """How much forecasts that ended at a row count at a later one."""
        return faded((later - row) / self._trained.a_day)

    def _since(self, before: int) -> np.ndarray:
        """Moments of the errors that have become known behind a row."""
        trained = self._trained
        first = max(0, (before - int(trained.sample.leads[-1]) - self._begin) // trained.every)
        errors, origins = self._history(first)
        ends = origins[:, None] + trained.sample.leads
        share = np.where(ends > before, self._share(ends, self.row), 0.0)
        return moments(errors, trained.groups, share)

    def _history(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Errors (O, L, K) of forecasts of the history from one on, and their origins."""
        errors = np.concatenate([course.errors[first:] for course in self._courses], axis=-1)
        return errors, self._begin + self._trained.every * np.arange(first, first + len(errors))

    def _missed(self, shares: np.ndarray) -> np.ndarray:
        """(L,) what the blend of these shares (L, K) missed that may come back."""
        trained = self._trained
        oldest = self.row - (int(DAYS_BACK.max()) + 1) * trained.a_day
        errors, origins = self._history(max(0, (oldest - self._begin) // trained.every))
        if self._joined:
            recent = trained.sample.origins >= oldest
            errors = np.concatenate([trained.errors[recent], errors])
            origins = np.append(trained.sample.origins[recent], origins)
        return echo(np.sum(errors * shares, axis=-1), origins, trained.sample.leads, self.row, trained.a_day)
