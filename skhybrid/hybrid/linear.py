"""The scheme that forecasts best: a scheduled network fitted on forecast errors, blended with ARX, learning as it goes."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .._clock import rows_of
from .._contract import ZoneTable, append_tables
from ..identification.scheduled import Sample
from ..thermal import RCNetwork
from .blend import blend_weights, by_lead, faded, lead_groups, moments
from .members import BlackBox, Member, Physics, Rows
from .scheme import Paths

#: temperatures that the black box regresses on
_LAGS = 24


class _Blended(NamedTuple):
    """Forecasts of a blend and what they are made of."""

    temperature: np.ndarray  # (n_origins, n_leads) [degC]
    weights: np.ndarray  # (n_origins, n_groups, K)


class LinearScheme:
    """Forecasts that are linear in what they learn: schedules of gains and conductance through the network, and ARX.

    Parameters
    ----------
    network : RCNetwork
    known : dict
        Capacities that are given [kW].
    horizon : timedelta-like or None
    adapt : {None, "linear", "full"}
    """

    def __init__(self, network: RCNetwork, *, known: dict[str, float], horizon: Any, adapt: str | None) -> None:
        self.network = network
        self.known = known
        self.horizon = horizon
        self.adapt = adapt

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Fit the members and weigh them by their errors on left-out blocks of days."""
        self._n_leads = rows_of(self.horizon if self.horizon is not None else "1D", table.step)
        self._table, self._T = _owned(table), target.copy()
        physics = Physics(self.network, self.known, calendar=True)
        self._members: list[Member] = [physics, BlackBox(_LAGS)]
        for member in self._members:
            member.fit(self._table, self._T, self._n_leads)
        self._physics = physics.fit_
        sample = self._physics.sample
        self._groups = lead_groups(sample.leads, self._n_leads)
        left_out = [member.left_out(sample, self._physics.blocks) for member in self._members]
        self._left_out = np.stack(left_out, axis=-1)
        ends = sample.origins[:, None] + sample.leads
        self._products = moments(self._left_out, self._groups, self._share(ends, table.n_rows - 1))
        return self

    # ----------------------------------------------------------------------------------------------------- forecast
    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> Paths:
        """Forecast each member from each origin, and blend them by what is known of their errors there."""
        rows, moved = self._rows(table)
        order = np.argsort(origins, kind="stable")
        blended = self._blend(rows, origins[order] + moved, n_leads)
        temperature = np.empty_like(blended.temperature)
        temperature[order] = blended.temperature
        return Paths(temperature, np.zeros_like(temperature))

    def _rows(self, table: ZoneTable) -> tuple[Rows, int]:
        """The rows of a table behind all that is known of the training, and by how many rows origins move."""
        T = table.history.get("T_za", np.full(table.n_rows, np.nan))
        if not table.n_history:
            return Rows(table, T, 0, joined=False), 0
        later = table.rows(slice(table.n_history, None))
        n = self._table.n_rows
        whole = append_tables(self._table, later)
        return Rows(whole, np.concatenate([self._T, T[table.n_history :]]), n, joined=True), n - table.n_history

    def _blend(self, rows: Rows, origins: np.ndarray, n_leads: int) -> _Blended:
        leads = self._physics.sample.leads
        last = int(origins[-1]) if len(origins) else 0
        every = max(1, round(pd.Timedelta("1h") / rows.table.step))
        begin = rows.begin if self.adapt is not None else last
        sample = Sample(np.arange(begin, max(begin, last), every), leads)
        followed = [m.follow(rows, origins, n_leads, sample, self.adapt) for m in self._members]
        paths = np.stack([f.paths for f in followed], axis=-1)
        errors = np.stack([f.errors for f in followed], axis=-1)
        ends = sample.origins[:, None] + leads
        weights = np.empty((len(origins), len(self._products), paths.shape[2]))
        out = np.empty(paths.shape[:2])
        for i, origin in enumerate(origins):
            # what was learned in training fades as what the history shows
            products = self._products * (self._fade(max(origin - rows.begin, 0)) if self.adapt is not None else 1.0)
            if len(errors):
                products = products + moments(errors, self._groups, self._share(ends, origin))
            weights[i] = blend_weights(products)
            out[i] = np.sum(paths[i] * by_lead(weights[i], self._n_leads, n_leads), axis=1)
        return _Blended(out, weights)


    def _fade(self, n_rows: Any) -> Any:
        return faded(n_rows * (self._table.step / pd.Timedelta("1D")))

    def _share(self, ends: np.ndarray, row: int) -> np.ndarray:
        """How much forecasts that end at the rows ``ends`` count at ``row``."""
        return self._fade(row - ends)


def _owned(table: ZoneTable) -> ZoneTable:
    return table.replace(inputs={role: v.copy() for role, v in table.inputs.items()})
