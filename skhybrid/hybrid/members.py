"""What a blend is made of: models that forecast later rows, learn from them, and know how wrong they have been."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

import numpy as np
import pandas as pd

from .._clock import ASSUMED_START
from .._contract import ZoneTable
from ..forecasting import ARXRegressor
from ..identification.scheduled import Followed, Later, LeadFit, Sample, fit_leads, follow, make_stretch
from ..thermal import RCNetwork
from .tables import frame_by_role


class Rows(NamedTuple):
    """Known and future rows: behind the training rows as one table with them, or by themselves."""

    table: ZoneTable
    T: np.ndarray  # (n_rows,) measured temperature [degC], NaN where missing
    begin: int  # the first row that the training has not seen
    joined: bool  # whether the rows before ``begin`` are the training's own


class Member(Protocol):
    """One model of a blend."""

    name: str

    def fit(self, table: ZoneTable, T: np.ndarray, n_leads: int) -> Self:
        """Learn from the training table."""

    def left_out(self, sample: Sample, blocks: np.ndarray) -> np.ndarray:
        """Errors (O, L) [K] of training forecasts, each by what has not learned from its block of days."""

    def follow(self, rows: Rows, origins: np.ndarray, n_leads: int, sample: Sample, adapt: str | None) -> Followed:
        """Forecasts [degC] from each origin (increasing), and errors of the history's sample, as known on its days."""


class Physics:
    """A network with schedules, fitted on the errors of forecasts at all leads.

    Parameters
    ----------
    network : RCNetwork
    known : dict
        Capacities that are given [kW].
    calendar : bool
    """

    name = "network"

    def __init__(self, network: RCNetwork, known: dict[str, float], calendar: bool) -> None:
        self.network = network
        self.known = known
        self.calendar = calendar

    fit_: LeadFit

    def fit(self, table: ZoneTable, T: np.ndarray, n_leads: int) -> Self:
        """Fit network, schedules and filter."""
        self.fit_ = fit_leads(self.network, table, T, n_leads, self.known, self.calendar)
        return self

    def left_out(self, sample: Sample, blocks: np.ndarray) -> np.ndarray:
        """Errors of the fit's own sample and blocks, which the blend shares."""
        return self.fit_.left_out

    def later(self, rows: Rows) -> Later:
        """Rows as the fit takes them."""
        stretch = make_stretch(self.fit_.stretch.plan, rows.table, rows.T, self.fit_.reference)
        return Later(stretch, rows.begin, rows.joined)

    def follow(self, rows: Rows, origins: np.ndarray, n_leads: int, sample: Sample, adapt: str | None) -> Followed:
        """Coefficients re-solved at every origin; with ``adapt="full"`` the network re-fitted every ten days."""
        found = follow(self.fit_, self.later(rows), origins, n_leads, sample, adapt)
        return found._replace(paths=found.paths + self.fit_.reference)


class BlackBox:
    """ARX on all inputs.

    Parameters
    ----------
    n_lags : int
        Temperatures that it regresses on.
    """

    name = "ARX"

    def __init__(self, n_lags: int) -> None:
        self.n_lags = n_lags

    def fit(self, table: ZoneTable, T: np.ndarray, n_leads: int) -> Self:
        """Fit the regression."""
        horizon = n_leads * table.step
        self.arx_ = ARXRegressor(horizon=horizon, n_lags=self.n_lags, max_missing=1.0)
        self.arx_.fit(frame_by_role(table, ASSUMED_START).drop(columns="T_za"), T)
        self._table, self._T = table, T
        return self

    def left_out(self, sample: Sample, blocks: np.ndarray) -> np.ndarray:
        """Errors of regressions without a block."""
        n_leads = int(sample.leads[-1])
        paths = self.arx_.left_out_paths(self._table, self._T, sample.origins, n_leads, blocks)
        return _errors(self._T, sample, paths[:, sample.leads - 1])

    def follow(self, rows: Rows, origins: np.ndarray, n_leads: int, sample: Sample, adapt: str | None) -> Followed:
        """Re-solved at every origin on all pairs known by then."""
        if adapt is None or not len(origins):
            coefs = self.arx_.coef_[None, :]
            errors = np.full((len(sample.origins), len(sample.leads)), np.nan)
            return Followed(self.arx_.paths_by(rows.table, rows.T, origins, n_leads, coefs), errors)
        a_day = round(pd.Timedelta("1D") / rows.table.step)
        past = sample.origins[sample.origins < origins[-1]]
        days = (past - rows.begin) // a_day
        marks = rows.begin + a_day * np.unique(days)
        coefs = self.arx_.refitted(rows.table, rows.T, np.concatenate([origins, marks]), rows.begin)
        paths = self.arx_.paths_by(rows.table, rows.T, origins, n_leads, coefs[: len(origins)])
        errors = np.full((len(sample.origins), len(sample.leads)), np.nan)
        if len(past):
            of_day = coefs[len(origins) :][np.searchsorted(marks, rows.begin + a_day * days)]
            known = Sample(past, sample.leads)
            made = self.arx_.paths_by(rows.table, rows.T, past, int(sample.leads[-1]), of_day)
            errors[: len(past)] = _errors(rows.T, known, made[:, sample.leads - 1])
        return Followed(paths, errors)


def _errors(T: np.ndarray, sample: Sample, paths: np.ndarray) -> np.ndarray:
    rows, inside = sample.targets(len(T))
    return np.where(inside, T[rows] - paths, np.nan)
