"""The default scheme: a network with schedules, fitted on forecast errors at all leads, blended with ARX."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np
import pandas as pd

from .._table import ZoneTable, concatenate_tables, last_rows
from .._time import rows_of, rows_per_day, rows_per_hour
from ..control import Band, Limits, LinearNetwork, LoadPaths, Plan, WantedPaths
from ..forecasting.arx_prior import ZoneEvidence
from ..forecasting.quantiles import LeftOut
from ..schedule import (
    NumberedSegment,
    OriginState,
    ScheduledNetwork,
    Segment,
    bends_at,
    heat_frame,
    load_paths,
    loads,
    plant_heat,
    scheduled_linear_network,
    warn_of_days_off,
)
from ..thermal import RCNetwork
from .blending.blend import GROUP_NAMES, by_lead, faded, lead_groups, moments
from .blending.blend_members import evidence_of, first_shares, members_beside_network
from .blending.gain_report import determined_plant, disagreement, gain_errors, gain_table, main_source, warn_of_gain
from .blending.kept_blends import KeptBlends
from .blending.members import Member, ScheduleMember
from .blending.numbered_table import NumberedTable
from .blending.rolling_blend import SETTLED_DAYS, SETTLED_DAYS_OF_FLEET, BlendRecord, RollingBlend
from .drift import DriftMonitor
from .known_rows import KnownRows
from .scheme import AffinePaths, Ahead, Boundary, LoadsFrom, Paths, Scheme
from .tables import days_after, parts_of_days, since_history

_LOOKS_BACK = 64  # rows before its origin that a forecast looks back on, for the lags of ARX
_FILTERED_DAYS = 30  # days of rows before those, from which the filtered inputs of ARX are computed
_MOST_LEARNED = pd.Timedelta("56D")  # the last rows that a new fit learns from, where the first one had fewer
_NETWORK_PRIOR_DAYS = 7  # days from which the log says more of the network than others do (benchmarks/fleet_prior.py)
_NEVER = np.iinfo(np.int64).max  # a row after all others
_EVERY = 3  # every so many hours an error of the blend is taken for its intervals


class ScheduleScheme(Scheme):
    """Schedules of gain and conductance through the network, and ARX, with given capacities ``known`` [kW]."""

    name = "schedule"

    def __init__(
        self, network: RCNetwork, *, known: dict[str, float], horizon: Any, adapt: str | None, purpose: str, prior: Any
    ) -> None:
        self.network, self.known, self.horizon = network, known, horizon
        self.adapt, self.purpose, self.prior = adapt, purpose, prior
        self._kept = KeptBlends()

    def __getstate__(self) -> dict[str, Any]:
        made_anew = ("_kept", "gray_box_", "forecaster_", "weights_", "zeta_", "gain_", "gain_std_")
        return {name: value for name, value in self.__dict__.items() if name not in made_anew}

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        # it shares what never changes, so that a copy goes on from where this one is
        made = object.__new__(type(self))
        made.__dict__.update(self.__getstate__(), _kept=self._kept.fork())
        return made

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _kept=KeptBlends())
        self._physics.restore(self.rows.training)

    @property
    def _members(self) -> list[Member]:
        return [self._physics, *self._others]

    def fit(self, measured: ZoneTable, like: Scheme | None = None) -> Self:
        """Fit the members and weigh them by their errors on left-out blocks of days."""
        self._learn(measured, like._others if isinstance(like, ScheduleScheme) else ())
        if like is None:  # else the other has warned of the zone's heat
            warn_of_gain(self._physics.fit_, self.rows.training, self.known, lambda: self.gain_)
            warn_of_days_off(self._physics.fit_, self.rows.training)
        return self

    def _learn(self, measured: ZoneTable, like: Sequence[Member] = ()) -> None:
        n_leads = rows_of(self.horizon if self.horizon is not None else "1D", measured.step)
        self.rows = KnownRows.of(measured)
        self.disturbance_step_ = measured.step
        training = self.rows.training
        per_day = rows_per_day(training.step)
        young = training.n_rows < _NETWORK_PRIOR_DAYS * per_day
        network_prior = self.prior.network if self.prior is not None and young else None
        self._physics = ScheduleMember(self.network, self.known, self.purpose, network_prior).fit(training, n_leads)
        fit = self._physics.fit_
        others = members_beside_network(fit, training, self.purpose, like, self.prior)
        self._others = [member.fit(training, n_leads) for member in others]
        sample, groups = fit.sample, lead_groups(fit.sample.leads, n_leads)
        left_out = np.stack([m.left_out(training, sample, fit.blocks) for m in self._members], axis=-1)
        T = training.history["T_za"]
        left_out = self.rows.plausible.errors_of_clipped(left_out, T[sample.targets(len(T))[0], None])
        member_of = np.repeat(np.arange(len(self._members)), [len(m.names) for m in self._members])
        age = (training.n_rows - 1 - sample.origins[:, None] - sample.leads) / per_day
        products = moments(left_out[..., member_of], groups, faded(age))
        settled = SETTLED_DAYS if network_prior is None else SETTLED_DAYS_OF_FLEET
        priors = first_shares(self._members, self.prior is not None), settled
        n_days, every = training.n_rows / per_day, rows_per_hour(training.step)
        errors, plausible = left_out.astype(np.float32), self.rows.plausible
        self._record = BlendRecord(
            sample, errors, member_of, products, groups, *priors, n_days, n_leads, per_day, every, plausible
        )
        if plant := determined_plant(fit, training):
            self.gain_doubt = disagreement(fit, self._members, self.gain_, plant)

    @property
    def evidence_(self) -> ZoneEvidence:
        return evidence_of(self._physics.fit_, self._others)

    @cached_property
    def gray_box_(self) -> ScheduledNetwork:
        return ScheduledNetwork.of(self._physics.fit_)

    @cached_property
    def forecaster_(self) -> ScheduledNetwork:
        return self.gray_box_

    @cached_property
    def weights_(self) -> pd.DataFrame:
        """Share of each way to forecast by group of leads, as the training has it."""
        names = [name for member in self._members for name in member.names]
        return pd.DataFrame(self._record.weights(), list(GROUP_NAMES), names)

    def _plant(self, wanted: str) -> tuple[str, float]:
        """The role that gave most of the known heat, with its capacity [kW]."""
        plant = main_source(self._physics.fit_, self.rows.training)
        if plant is None:
            raise AttributeError(f"the training has no plant, so that there is no {wanted}.")
        return plant

    @cached_property
    def gain_(self) -> pd.DataFrame:
        """Temperature after a step of 1 kW, by lead and member [K/kW]."""
        return gain_table(self._members, self._record, self.rows.training, self._plant("gain_"))

    @cached_property
    def gain_std_(self) -> pd.Series:
        """Relative standard error of the network's gain, by lead."""
        self._plant("gain_std_")
        return gain_errors(self._physics.fit_, self._record, self.rows.training.step)

    @cached_property
    def zeta_(self) -> pd.Series:
        """The training's unmeasured heat by its schedules [kW]."""
        return self.gray_box_.heat_at(self.rows.training)

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int, boundary: Boundary = None) -> Paths:
        """Forecast each member from each origin, and blend them by what is known of their errors there."""
        blend, rows, moved = self._blend_before(table, origins)
        return self._paths(blend, rows, origins + moved, n_leads, boundary)

    def forecast_each(self, tables: Sequence[ZoneTable], origin: int, n_leads: int) -> np.ndarray:
        blend, rows, moved = self._blend_before(tables[0], np.array([origin]))
        ahead, origins = slice(origin + 1, origin + 1 + n_leads), np.full(len(tables), origin + moved)
        inputs = {role: np.array([table.inputs[role][ahead] for table in tables]) for role in tables[0].inputs}
        return self._paths(blend, rows, origins, n_leads, inputs).temperature

    def _blend_before(self, table: ZoneTable, origins: np.ndarray) -> tuple[RollingBlend, NumberedTable, int]:
        """A blend that is not beyond any of the origins, the rows that it reads, and by how many rows origins move."""
        moved = self.rows.n_rows - table.n_history
        first = origins.min(initial=table.n_rows) + moved
        blend = self._with_trained().last_before(self.adapt, int(first))
        if table.n_history and first >= blend.row:
            n_back = self._n_back(blend.row, int(origins.max(initial=0)) + moved)
            rows, blend = self._last_rows(blend.row - n_back, since_history(table)), blend.fork()
            if blend.row + self._record.rows_per_day <= first < self.rows.n_rows:  # later forecasts need not go there
                blend.advance(blend.views(rows), int(first))
                self._kept.keep(blend)
                blend = blend.fork()
            return blend, rows, moved
        rows, moved = self._numbered(table)
        return RollingBlend(self._members, self._record, rows, self.adapt), rows, moved

    def _with_trained(self) -> KeptBlends:
        """The kept blends, with the one at the last training row."""
        if self.adapt not in self._kept.trained:
            rows = self._joined([self.rows.training])
            blend = self._kept.trained[self.adapt] = RollingBlend(self._members, self._record, rows, self.adapt)
            segment = NumberedSegment(self._physics.fit_.segment, rows.begin, joined=True)
            blend.advance([segment, *(member.view(rows) for member in self._others)], rows.begin - 1)
        return self._kept

    def _numbered(self, table: ZoneTable) -> tuple[NumberedTable, int]:
        """The rows of a table, after all known ones where it follows them, and by how many rows origins move."""
        if not table.n_history:
            return NumberedTable(table, table.measured(), 0, joined=False), 0
        rows = self._joined([*self.rows.tables, since_history(table)])
        return rows, rows.table.n_rows - table.n_rows

    def _joined(self, tables: Sequence[ZoneTable]) -> NumberedTable:
        """The training and what follows it."""
        whole = concatenate_tables(tables)
        return NumberedTable(whole, whole.history["T_za"], self.rows.training.n_rows, joined=True)

    def _paths(
        self, blend: RollingBlend, rows: NumberedTable, origins: np.ndarray, n_leads: int, boundary: Boundary = None
    ) -> Paths:
        """(n_origins, n_leads) temperatures [degC] and unmeasured heat [kW] by a blend that goes on to each origin."""
        views = blend.views(rows)
        size = len(origins), n_leads
        paths = Paths(np.empty(size), np.empty(size), np.empty(len(origins)))
        ranges = self.rows.plausible.at(rows.T, origins - rows.first)
        for i in np.argsort(origins, kind="stable"):
            row, ahead = int(origins[i]), views
            blend.advance(views, row)
            if boundary:
                ahead = blend.views(rows.with_boundary({r: v[i] for r, v in boundary.items()}, row, _LOOKS_BACK))
            paths.temperature[i], paths.zeta[i] = blend.forecast(ahead, n_leads, ranges.of_row(i))
            paths.zeta_now[i] = blend.heat_now(views)
        return paths

    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """Heat that keeps the network within its set-points, under its schedules and the heat that its filter sees."""
        rows, segment, states, moved = self._states(table, origins)
        load = loads(self._physics.fit_, segment, origins + moved, states, rows.table, setpoint, limits)
        return self._clipped_load(load, table, origins, setpoint)

    def _states(self, table: ZoneTable, origins: np.ndarray) -> tuple[NumberedTable, Segment, list[OriginState], int]:
        """Rows up to the end of a table, the same as the network takes them, and its state at increasing origins.

        The last value is by how many rows the origins move among them.
        """
        blend, rows, moved = self._blend_before(table, origins)
        rolling, view, states = blend.network, self._physics.view(rows), []
        for origin in origins + moved:
            rolling.advance(view, int(origin))
            states.append(rolling.state())
        return rows, view.segment, states, moved - rows.first

    def load_paths_from(self, table: ZoneTable, origins: np.ndarray) -> LoadsFrom:
        _, segment, states, moved = self._states(table, origins)

        def paths(chosen: np.ndarray, n_leads: int, wanted: WantedPaths) -> LoadPaths:
            wanted = wanted._replace(band=wanted.band.moved(moved))
            own = [states[i] for i in np.searchsorted(origins, chosen)]
            return load_paths(self._physics.fit_, segment, chosen + moved, own, wanted, n_leads)

        return paths

    def plant_heat(self, table: ZoneTable) -> np.ndarray:
        return plant_heat(self._physics.fit_, table)

    def heat_frame(self, index: pd.Index, paths: LoadPaths) -> pd.DataFrame:
        return heat_frame(self._physics.fit_, index, paths)

    def left_out_errors(self, n_leads: int, every: int = _EVERY) -> LeftOut:
        """Errors of the blend on left-out blocks, interpolated between leads."""
        record = self._record
        sample, own = record.sample, record.n_leads
        shares = by_lead(record.weights(), own, own)[sample.leads - 1]
        errors = np.sum(record.errors() * shares, axis=-1)[::every]
        known = np.isfinite(errors).all(axis=1)
        leads = np.arange(1, n_leads + 1)
        out = np.array([np.interp(leads, sample.leads, e) for e in errors[known]]).reshape(-1, n_leads)
        return LeftOut(out, sample.origins[::every][known])

    def advanced(self, measured: ZoneTable) -> Self:
        """The scheme after new rows; what they teach is computed when a forecast is wanted, or by :meth:`go_on`."""
        return self._with(rows=self.rows.appended(measured), _kept=self._kept.fork())

    def go_on(self) -> None:
        if self.adapt in self._kept.trained:
            blend, _ = self._at_last_row()
            blend.solve()

    def forecast_ahead(self, future: ZoneTable, T_za: float | None = None) -> Paths:
        """Forecast from the last known row, starting where the forecast before had come to."""
        blend, views = self._at_last(future, T_za)
        n_leads, plausible, now = future.n_rows, self.rows.plausible, np.nan
        if T_za is not None:
            n_leads, plausible, now = n_leads - 1, plausible.extended(np.array([T_za])), blend.heat_now(views)
        path, heat = blend.forecast(views, n_leads, plausible)
        return Paths(path[None], heat[None], np.array([now]))

    def _at_last(self, future: ZoneTable, T_za: float | None) -> tuple[RollingBlend, list[Any]]:
        """The blend at the last known row, or at the measured one after it, and the rows that it reads."""
        T = np.append(np.nan if T_za is None else T_za, np.full(future.n_rows - 1, np.nan))
        blend, views = self._at_last_row(future.replace(history={"T_za": T}), n_more=int(T_za is not None))
        if T_za is not None:  # a row that is not kept
            blend = blend.fork()
            blend.advance(views, self.rows.n_rows)
        return blend, views

    def _at_last_row(self, ahead: ZoneTable | None = None, n_more: int = 0) -> tuple[RollingBlend, list[Any]]:
        """The blend at the last known row, and the rows that it reads to go on by ``n_more`` and to forecast."""
        blend = self._with_trained().last_before(self.adapt, last := self.rows.n_rows - 1)
        n_back = self._n_back(blend.row, last + n_more)
        views = blend.views(self._last_rows(blend.row - n_back, ahead))
        if blend.row < last:
            blend = blend.fork()
            blend.advance(views, last)
            self._kept.running[self.adapt] = blend
        return blend, views

    def _n_back(self, row: int, last: int) -> int:
        """Rows before ``row`` that a blend reads to go on to ``last``, from forecasts into the rows between."""
        if last <= row:
            return _LOOKS_BACK
        per_day, first = self._record.rows_per_day, self.rows.training.n_rows - 1
        learns = (last - first) // per_day > (row - first) // per_day  # a whole day, at its end
        return int(self._record.sample.leads[-1]) + per_day * learns + _LOOKS_BACK

    @property
    def planned_boundaries(self) -> tuple[str, ...]:
        return tuple(role for role in self.network.boundaries if role != "T_oa")

    def _start(self, ahead: Ahead) -> tuple[RollingBlend, list[Any]]:
        """The blend at the origin of rows ahead, and the rows that it reads."""
        if ahead.origin is None:
            return self._at_last(ahead.table, ahead.T_za)
        blend, rows, moved = self._blend_before(ahead.table, np.array([ahead.origin]))
        views = blend.views(rows)
        blend.advance(views, ahead.origin + moved)
        return blend, views

    def affine(self, ahead: Ahead, plan: Plan, member: str) -> AffinePaths:
        blend, views = self._start(ahead)
        network = blend.network
        if member == "blend":
            temperature, zeta = blend.forecast(views, ahead.n_leads, None)
            gain = blend.gain(plan, ahead.n_leads - ahead.n_rows + 1)
        else:
            temperature, zeta = network.path(views[0], ahead.n_leads)
            gain = network.gain(plan)[0]
        if ahead.T_za is not None:
            temperature, zeta = np.append(ahead.T_za, temperature), np.append(blend.heat_now(views), zeta)
        bends = bends_at(network.fit, network.forecast_state(0), plan.inputs, plan.values)
        return AffinePaths(temperature, zeta, gain, bends.bent, blend.recent_errors())

    def stages(self) -> dict[str, float]:
        return {role: max(1.0, most) for role, most in self._physics.fit_.plan.max_stages}

    def linear_network(self, ahead: Ahead, plan: Plan) -> LinearNetwork:
        blend, views = self._start(ahead)
        segment, values = views[0].between(blend.row, blend.row + 1 + ahead.n_leads), plan.values
        if ahead.T_za is None:
            known = self.rows.latest if ahead.origin is None else ahead.table.rows(slice(0, ahead.origin + 1))
            values = np.vstack([[known.inputs[role][-1] for role in plan.inputs], values])
        state = blend.network.forecast_state(0)
        network = scheduled_linear_network(blend.network.fit, state, segment, plan.inputs, values)
        return network.after(values[0]) if ahead.T_za is None else network.measured(np.array([ahead.T_za]))

    def _last_rows(self, first: int, ahead: ZoneTable | None) -> NumberedTable:
        """The known rows from a row on, or from the last measurement before it, and the rows ahead, if any."""
        n_known = self.rows.n_rows
        n_rows, n_filtered = n_known - max(0, first), _FILTERED_DAYS * self._record.rows_per_day
        tables, n_ahead = (self.rows.tables, 0) if ahead is None else ((*self.rows.tables, ahead), ahead.n_rows)
        table = last_rows(tables, n_rows + n_ahead)
        while not np.isfinite(table.history["T_za"][0]) and n_rows < n_known:
            n_rows = min(2 * n_rows, n_known)
            table = last_rows(tables, n_rows + n_ahead)
        before = self.rows.inputs_before(table.inputs, n_rows, n_filtered)
        begin, first, T = self.rows.training.n_rows, n_known - n_rows, table.history["T_za"]
        return NumberedTable(table, T, begin, True, first, lambda: self._joined(tables)[:2], before)

    def relearned(self, measured: ZoneTable | None) -> Self:
        """The scheme fitted again on the last weeks of all that is known."""
        rows = self.rows if measured is None else self.rows.appended(measured)
        training = rows.training
        n_learned = max(int(_MOST_LEARNED / training.step), training.n_rows)
        settings = {name: getattr(self, name) for name in ("known", "horizon", "adapt", "purpose", "prior")}
        learned = type(self)(self.network, **settings)
        learned._learn(last_rows(rows.tables, n_learned))
        learned.rows = rows.retrained(learned.rows.training)
        return learned

    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Test the errors of each day's temperature, forecast without adaptation."""
        known, per_day = self.rows.training, self._record.rows_per_day
        # with a shorter horizon a day has several forecasts: the errors left out say nothing of longer ones
        wanted = parts_of_days(known, self._record.n_leads, per_day)
        n_leads = per_day // wanted.shape[1]
        left_out = self.left_out_errors(n_leads, every=1)
        # the first forecast of each part: where the table does not begin on the hour there is none at midnight
        at = np.searchsorted(left_out.origins, wanted)
        found = np.append(left_out.origins, _NEVER)[at]
        near = (found - wanted < self._record.every).all(axis=1)
        reference = days_after(known, found[near, 0], per_day)
        errors = left_out.errors[at[near]].reshape(-1, per_day)
        monitor = DriftMonitor(holidays=known.holidays).fit(reference, reference - errors)
        rows = self._joined(self.rows.tables) if table is None else self._numbered(table)[0]
        parts = parts_of_days(rows.table, n_leads, per_day)
        parts = parts[(parts[:, 0] >= rows.begin) & (parts[:, 0] + per_day < rows.table.n_rows)]
        blend = RollingBlend(self._members, self._record, rows, None)
        forecast = self._paths(blend, rows, parts.ravel(), n_leads).temperature.reshape(-1, per_day)
        measured = days_after(rows.table.replace(history={"T_za": rows.T}), parts[:, 0], per_day)
        return monitor.watch(measured, pd.DataFrame(forecast, measured.index))
