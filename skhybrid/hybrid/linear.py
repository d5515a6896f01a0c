"""The scheme that forecasts best: a scheduled network fitted on forecast errors, blended with ARX."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
import pandas as pd

from .._clock import rows_of
from .._contract import ZoneTable
from ..forecasting.quantiles import LeftOut
from ..identification.scheduled import Sample, ScheduledNetwork, follow, loads
from ..identification.setpoints import Band, Limits
from ..thermal import RCNetwork
from .blend import GROUP_NAMES, blend_weights, by_lead, faded, lead_groups, moments
from .drift import DriftMonitor
from .echo import echo
from .members import BlackBox, Member, Physics, Rows
from .scheme import Paths
from .tables import one_behind_another

#: temperatures that the black box regresses on
_LAGS = 24
#: pieces of rows that are kept before they are joined
_GATHERED = 96
#: the last rows that a new fit learns from, where the first one had fewer
_MOST_LEARNED = pd.Timedelta("56D")


class LinearScheme:
    """Forecasts that are linear in what they learn: schedules of gains and conductance through the network, and ARX.

    Parameters
    ----------
    network : RCNetwork
    known : dict
        Capacities that are given [kW].
    horizon : timedelta-like or None
    adapt : {None, "linear", "full"}

    Attributes
    ----------
    gray_box_ : ScheduledNetwork
        The network and its schedules, as fitted.
    forecaster_ : ScheduledNetwork
        The same: its schedules are the forecast of the disturbance.
    weights_ : DataFrame
        Share of each member by group of leads, as the training has it.
    zeta_ : Series
        The training's unmeasured heat by its schedules [kW].
    """

    def __init__(self, network: RCNetwork, *, known: dict[str, float], horizon: Any, adapt: str | None) -> None:
        self.network = network
        self.known = known
        self.horizon = horizon
        self.adapt = adapt

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Fit the members and weigh them by their errors on left-out blocks of days."""
        self._n_leads = rows_of(self.horizon if self.horizon is not None else "1D", table.step)
        self._known = [_owned(table, target)]
        self._n_learned = table.n_rows
        self._physics = Physics(self.network, self.known, calendar=True)
        self._members: list[Member] = [self._physics, BlackBox(_LAGS)]
        for member in self._members:
            member.fit(self._known[0], target, self._n_leads)
        fit = self._physics.fit_
        self._groups = lead_groups(fit.sample.leads, self._n_leads)
        self._left_out = np.stack([m.left_out(fit.sample, fit.blocks) for m in self._members], axis=-1)
        ends = fit.sample.origins[:, None] + fit.sample.leads
        self._products = moments(self._left_out, self._groups, self._share(ends, table.n_rows - 1, table.step))
        self.disturbance_step_ = table.step
        self.gray_box_ = self.forecaster_ = ScheduledNetwork.of(fit)
        self.weights_ = pd.DataFrame(blend_weights(self._products), list(GROUP_NAMES), [m.name for m in self._members])
        self.zeta_ = self.gray_box_.heat_at(table)
        return self

    # ----------------------------------------------------------------------------------------------------- forecast
    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> Paths:
        """Forecast each member from each origin, and blend them by what is known of their errors there."""
        rows, moved = self._rows(table)
        order = np.argsort(origins, kind="stable")
        found, heat = self._blend(rows, origins[order] + moved, n_leads)
        temperature, zeta = np.empty_like(found), np.empty_like(heat)
        temperature[order], zeta[order] = found, heat
        return Paths(temperature, zeta)

    def _rows(self, table: ZoneTable) -> tuple[Rows, int]:
        """The rows of a table behind all that is known, and by how many rows origins move."""
        T = table.history.get("T_za", np.full(table.n_rows, np.nan))
        if not table.n_history:
            return Rows(table, T, 0, joined=False), 0
        later = table.rows(slice(table.n_history, None)).replace(history={"T_za": T[table.n_history :]})
        whole = one_behind_another([*self._known, later])
        return Rows(whole, whole.history["T_za"], self._n_learned, joined=True), whole.n_rows - table.n_rows

    def _blend(self, rows: Rows, origins: np.ndarray, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """(n_origins, n_leads) temperatures [degC] and unmeasured heat [kW]."""
        leads, step = self._physics.fit_.sample.leads, rows.table.step
        last = int(origins[-1]) if len(origins) else 0
        every = max(1, round(pd.Timedelta("1h") / step))
        begin = rows.begin if self.adapt is not None else last
        sample = Sample(np.arange(begin, max(begin, last), every), leads)
        followed = [m.follow(rows, origins, n_leads, sample, self.adapt) for m in self._members]
        paths = np.stack([f.paths for f in followed], axis=-1)
        errors = np.stack([f.errors for f in followed], axis=-1)
        ends = sample.origins[:, None] + leads
        every_lead, a_day = np.arange(1, n_leads + 1), round(pd.Timedelta("1D") / step)
        past, past_origins = errors, sample.origins
        if rows.joined:
            past = np.concatenate([self._left_out, errors])
            past_origins = np.concatenate([self._physics.fit_.sample.origins, sample.origins])
        out = np.empty(paths.shape[:2])
        for i, origin in enumerate(origins):
            products = self._products
            if self.adapt is not None:  # what was seen in training fades as what the history shows
                products = products * self._share(np.array(rows.begin), max(int(origin), rows.begin), step)
            if len(errors):
                products = products + moments(errors, self._groups, self._share(ends, int(origin), step))
            shares = blend_weights(products)
            weights = by_lead(shares, self._n_leads, n_leads)
            out[i] = np.sum(paths[i] * weights, axis=1)
            if self.adapt is not None:
                missed = echo(np.sum(past * shares[self._groups], axis=-1), past_origins, leads, int(origin), a_day)
                out[i] += np.interp(every_lead, leads, missed)
        heat = followed[0].heat
        assert heat is not None  # the physics gives it
        return out, heat

    @staticmethod
    def _share(ends: np.ndarray, row: int, step: pd.Timedelta) -> np.ndarray:
        """How much forecasts that end at the rows ``ends`` count at ``row``."""
        return faded((row - ends) * (step / pd.Timedelta("1D")))

    # ------------------------------------------------------------------------------------------------------ the load
    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """Heat that keeps the network within its set-points, under its schedules and what its filter tracks."""
        rows, moved = self._rows(table)
        here = origins + moved
        sample = Sample(np.empty(0, dtype=np.int64), self._physics.fit_.sample.leads)
        if self.adapt is not None:
            every = max(1, round(pd.Timedelta("1h") / rows.table.step))
            sample = Sample(np.arange(rows.begin, max(rows.begin, int(here[-1])), every), sample.leads)
        later = self._physics.later(rows)
        learned = follow(self._physics.fit_, later, here, 1, sample, self.adapt).learned
        first = rows.table.n_rows - len(setpoint.heating)
        return loads(self._physics.fit_, later, here, learned, rows.table, first, setpoint, limits)

    # ------------------------------------------------------------------------------------------------- its own errors
    def calibration_errors(self, table: ZoneTable, target: np.ndarray, n_leads: int) -> LeftOut:
        """Errors of the blend on left-out blocks, every third hour, interpolated between leads."""
        sample = self._physics.fit_.sample
        shares = by_lead(blend_weights(self._products), self._n_leads, self._n_leads)[sample.leads - 1]
        errors = np.sum(self._left_out * shares, axis=-1)[::3]
        known = np.isfinite(errors).all(axis=1)
        every = np.arange(1, n_leads + 1)
        out = np.array([np.interp(every, sample.leads, e) for e in errors[known]]).reshape(-1, n_leads)
        return LeftOut(out, sample.origins[::3][known])

    # ------------------------------------------------------------------------------------------ living with a building
    def advance(self, table: ZoneTable, target: np.ndarray) -> None:
        """Take in rows; what they teach is worked out when a forecast is wanted."""
        self._known = [*self._known, _owned(table, target)]
        if len(self._known) > _GATHERED:
            self._known = [self._known[0], one_behind_another(self._known[1:])]

    def forecast_live(self, future: ZoneTable) -> Paths:
        """Forecast from the last known row."""
        whole = one_behind_another([*self._known, future.replace(history={"T_za": np.full(future.n_rows, np.nan)})])
        rows = Rows(whole, whole.history["T_za"], self._n_learned, joined=True)
        origin = np.array([whole.n_rows - future.n_rows - 1])
        return Paths(*self._blend(rows, origin, future.n_rows))

    def learn(self, table: ZoneTable, target: np.ndarray) -> None:
        """Fit again on the last weeks of all that is known."""
        if table.n_rows:
            self.advance(table, target)
        known = one_behind_another(self._known)
        most = max(int(_MOST_LEARNED / known.step), self._n_learned)
        kept = known.rows(slice(max(0, known.n_rows - most), None))
        self.fit(kept, kept.history["T_za"])

    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Go through the day-ahead errors of the temperature, forecast as trained."""
        known, per_day = self._known[0], round(pd.Timedelta("1D") / self._known[0].step)
        left_out = self.calibration_errors(known, known.history["T_za"], per_day)
        midnight = _begins_day(known)[left_out.origins]
        reference = _days(known, left_out.origins[midnight], per_day)
        monitor = DriftMonitor().fit(reference, reference - left_out.errors[midnight])
        if table is None:
            later = one_behind_another(self._known)
            rows = Rows(later, later.history["T_za"], self._n_learned, joined=True)
        else:
            rows, _ = self._rows(table)
        origins = np.flatnonzero(_begins_day(rows.table))
        origins = origins[(origins >= rows.begin) & (origins + per_day < rows.table.n_rows)]
        frozen = copy(self)
        frozen.adapt = None
        forecast, _ = frozen._blend(rows, origins, per_day)
        measured = _days(rows.table.replace(history={"T_za": rows.T}), origins, per_day)
        return monitor.watch(measured, pd.DataFrame(forecast, measured.index))


def _begins_day(table: ZoneTable) -> np.ndarray:
    """(n_rows,) whether a row is the first of a local day."""
    day = table.time.normalize()
    return np.append(False, np.asarray(day[1:] != day[:-1]))


def _days(table: ZoneTable, origins: np.ndarray, per_day: int) -> pd.DataFrame:
    """Measured temperature of the rows after each origin, stamped by the day."""
    rows = origins[:, None] + np.arange(1, per_day + 1)
    inside = rows < table.n_rows
    measured = np.where(inside, table.history["T_za"][np.minimum(rows, table.n_rows - 1)], np.nan)
    return pd.DataFrame(measured, index=table.time[origins].normalize())


def _owned(table: ZoneTable, target: np.ndarray) -> ZoneTable:
    """A table with its measured temperature, in arrays of its own."""
    inputs = {role: v.copy() for role, v in table.inputs.items()}
    return table.replace(inputs=inputs, history={"T_za": target.copy()}, n_history=0)
