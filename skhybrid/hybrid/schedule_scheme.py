"""The scheme that forecasts best: a scheduled network fitted on forecast errors, blended with ARX."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import rows_of
from ..control.setpoints import Band, Limits
from ..forecasting.features import rows_per_day, rows_per_hour
from ..forecasting.quantiles import LeftOut, measured_ahead
from ..schedule import ScheduledNetwork, loads
from ..thermal import RCNetwork
from .blend import GROUP_NAMES, PULL, blend_weights, by_lead, faded, lead_groups, moments
from .drift import DriftMonitor
from .members import ARXMember, DayBeforeMember, Member, NumberedTable, ScheduleMember
from .rolling_blend import BlendTraining, RollingBlend
from .scheme import Paths
from .tables import concatenate_tables, last_rows

#: temperatures that the black box regresses on
_LAGS = 24
#: prior share of the day before, and the pull toward it: where no days could be left out to try what was learned, with
#: a week of training or less (three members alike), and with two weeks or more
_UNTRIED, _WEEK, _WEEKS = (0.75, PULL), (1.0 / 3.0, 1.2), (0.1, PULL)
#: segments of rows that are kept before they are joined
_GATHERED = 96
#: rows beside its leads that a live forecast looks back on, for the lags of the black box
_MORE_ROWS = 64
#: the last rows that a new fit learns from, where the first one had fewer
_MOST_LEARNED = pd.Timedelta("56D")


class ScheduleScheme:
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

    _live: RollingBlend | None = None  # as far as the last live forecast went

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_live"}

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Fit the members and weigh them by their errors on left-out blocks of days."""
        n_leads = rows_of(self.horizon if self.horizon is not None else "1D", table.step)
        self._known, self._n_blocks = [_owned(table, target)], 1
        self._n_learned = self._n_known = table.n_rows
        self._physics = ScheduleMember(self.network, self.known, calendar=True)
        self._members: list[Member] = [self._physics.fit(self._known[0], target, n_leads)]
        fit = self._physics.fit_
        others: list[Member] = [ARXMember(_LAGS), DayBeforeMember()]
        self._members += [member.fit(self._known[0], target, n_leads) for member in others]
        sample, groups = fit.sample, lead_groups(fit.sample.leads, n_leads)
        names = [name for m in self._members for name in m.names]
        ways = [len(m.names) for m in self._members]
        left_out = np.repeat(np.stack([m.left_out(sample, fit.blocks) for m in self._members], axis=-1), ways, axis=-1)
        a_day = rows_per_day(table.step)
        rule, pull = _caution(fit.blocks, table.n_rows / a_day)
        prior = np.repeat(np.array([0.5 * (1.0 - rule), 0.5 * (1.0 - rule), rule]) / ways, ways)
        age = (table.n_rows - 1 - sample.origins[:, None] - sample.leads) / a_day
        products = moments(left_out, groups, faded(age))
        every = rows_per_hour(table.step)
        self._trained = BlendTraining(sample, left_out, products, groups, prior, pull, n_leads, a_day, every)
        self.disturbance_step_ = table.step
        self.gray_box_ = self.forecaster_ = ScheduledNetwork.of(fit)
        self.weights_ = pd.DataFrame(blend_weights(products, prior, pull), list(GROUP_NAMES), names)
        self.zeta_ = self.gray_box_.heat_at(table)
        self._live = None
        return self

    # ----------------------------------------------------------------------------------------------------- forecast
    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> Paths:
        """Forecast each member from each origin, and blend them by what is known of their errors there."""
        rows, moved = self._rows(table)
        return self._blend(rows, origins + moved, n_leads)

    def _rows(self, table: ZoneTable) -> tuple[NumberedTable, int]:
        """The rows of a table behind all that is known, and by how many rows origins move."""
        T = table.history.get("T_za", np.full(table.n_rows, np.nan))
        if not table.n_history:
            return NumberedTable(table, T, 0, joined=False), 0
        later = table.rows(slice(table.n_history, None)).replace(history={"T_za": T[table.n_history :]})
        rows = self._joined([*self._known, later])
        return rows, rows.table.n_rows - table.n_rows

    def _joined(self, tables: list[ZoneTable]) -> NumberedTable:
        """The training and what follows it."""
        whole = concatenate_tables(tables)
        return NumberedTable(whole, whole.history["T_za"], self._n_learned, joined=True)

    def _blend(self, rows: NumberedTable, origins: np.ndarray, n_leads: int) -> Paths:
        """(n_origins, n_leads) temperatures [degC] and unmeasured heat [kW]."""
        course = RollingBlend(self._members, self._trained, rows, self.adapt)
        views = course.views(rows)
        paths = Paths(np.empty((len(origins), n_leads)), np.empty((len(origins), n_leads)))
        for i in np.argsort(origins, kind="stable"):
            course.advance(views, int(origins[i]))
            paths.temperature[i], paths.zeta[i] = course.forecast(views, n_leads)
        return paths

    # ------------------------------------------------------------------------------------------------------ the load
    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """Heat that keeps the network within its set-points, under its schedules and what its filter tracks."""
        rows, moved = self._rows(table)
        course, view = self._physics.start(rows, self._trained.sample, self.adapt), self._physics.view(rows)
        learned = []
        for origin in origins + moved:
            course.advance(view, int(origin))
            learned.append(course.state())
        return loads(self._physics.fit_, view.segment, origins + moved, learned, rows.table, setpoint, limits)

    # ------------------------------------------------------------------------------------------------- its own errors
    def calibration_errors(self, table: ZoneTable, target: np.ndarray, n_leads: int) -> LeftOut:
        """Errors of the blend on left-out blocks, every third hour, interpolated between leads."""
        return self._left_out(n_leads, every=3)

    def _left_out(self, n_leads: int, every: int) -> LeftOut:
        """Errors of the blend on left-out blocks, interpolated between leads."""
        trained = self._trained
        sample, ours = trained.sample, trained.n_leads
        shares = by_lead(blend_weights(trained.products, trained.prior, trained.pull), ours, ours)[sample.leads - 1]
        errors = np.sum(trained.errors * shares, axis=-1)[::every]
        known = np.isfinite(errors).all(axis=1)
        leads = np.arange(1, n_leads + 1)
        out = np.array([np.interp(leads, sample.leads, e) for e in errors[known]]).reshape(-1, n_leads)
        return LeftOut(out, sample.origins[::every][known])

    # ------------------------------------------------------------------------------------------ living with a building
    def advance(self, table: ZoneTable, target: np.ndarray) -> None:
        """Take in rows; what they teach is worked out when a forecast is wanted."""
        self._known, self._n_known = [*self._known, _owned(table, target)], self._n_known + table.n_rows
        if len(self._known) - self._n_blocks > _GATHERED:
            self._known = [*self._known[: self._n_blocks], concatenate_tables(self._known[self._n_blocks :])]
            self._n_blocks = len(self._known)

    def forecast_live(self, future: ZoneTable) -> Paths:
        """Forecast from the last known row, going on from where the live forecast before had come to."""
        ahead = future.replace(history={"T_za": np.full(future.n_rows, np.nan)})
        # whoever comes meanwhile, in another thread, finds none and begins at the first row
        course = self.__dict__.pop("_live", None)
        if course is None or course.adapt != self.adapt:
            rows = self._joined([*self._known, ahead])
            course = RollingBlend(self._members, self._trained, rows, self.adapt)
        else:
            rows = self._last_rows(
                max(0, course.row - int(self._trained.sample.leads[-1]) - self._trained.a_day - _MORE_ROWS), ahead
            )
        views = course.views(rows)
        course.advance(views, self._n_known - 1)
        path, heat = course.forecast(views, future.n_rows)
        self._live = course
        return Paths(path[None], heat[None])

    def _last_rows(self, first: int, ahead: ZoneTable) -> NumberedTable:
        """What is known from a row on, or from the last measurement before it, and the rows ahead."""
        known = last_rows(self._known, self._n_known - first)
        while not np.isfinite(known.history["T_za"][0]) and known.n_rows < self._n_known:
            known = last_rows(self._known, 2 * known.n_rows)
        table = concatenate_tables([known, ahead])

        def whole() -> tuple[ZoneTable, np.ndarray]:
            rows = self._joined(self._known)
            return rows.table, rows.T

        return NumberedTable(table, table.history["T_za"], self._n_learned, True, self._n_known - known.n_rows, whole)

    def learn(self, table: ZoneTable, target: np.ndarray) -> None:
        """Fit again on the last weeks of all that is known."""
        if table.n_rows:
            self.advance(table, target)
        known = last_rows(self._known, max(int(_MOST_LEARNED / self._known[0].step), self._n_learned))
        self.fit(known, known.history["T_za"])

    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Go through the day-ahead errors of the temperature, forecast as trained."""
        known, per_day = self._known[0], self._trained.a_day
        left_out = self._left_out(per_day, every=1)
        # the first forecast of each day: where the table does not begin on the hour there is none at midnight
        midnight = np.flatnonzero(_begins_day(known))
        at = np.searchsorted(left_out.origins, midnight)
        near = at < len(left_out.origins)
        near[near] = left_out.origins[at[near]] - midnight[near] < self._trained.every
        reference = _days(known, left_out.origins[at[near]], per_day)
        monitor = DriftMonitor().fit(reference, reference - left_out.errors[at[near]])
        rows = self._joined(self._known) if table is None else self._rows(table)[0]
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
    return pd.DataFrame(measured_ahead(table, origins, per_day), index=table.time[origins].normalize())


def _owned(table: ZoneTable, target: np.ndarray) -> ZoneTable:
    """A table with its measured temperature, in arrays of its own."""
    inputs = {role: v.copy() for role, v in table.inputs.items()}
    return table.replace(inputs=inputs, history={"T_za": target.copy()}, n_history=0)


def _caution(blocks: np.ndarray, n_days: float) -> tuple[float, float]:
    """Prior share of the day before, and the pull toward it, after so many days of training in blocks to leave out."""
    if not len(blocks) or not blocks.max():
        return _UNTRIED  # nothing tells how far to trust what was learned
    rule, pull = (float(np.interp(n_days, [7, 14], ends)) for ends in zip(_WEEK, _WEEKS, strict=True))
    return rule, pull
