"""The scheme of the paper (3.1): an identified network driven by a forecast of its disturbance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np
import pandas as pd
from joblib import Memory
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from .._joining import with_measured
from .._table import ZoneTable, concatenate_tables
from .._time import ASSUMED_START, rows_per_day
from .._warnings import ignore, warnings_to
from ..control import Band, Limits, LinearNetwork, LoadPaths, Plan, load_frame
from ..forecasting.joint_fit import fit_each
from ..forecasting.named_models import BASELINES
from ..forecasting.quantiles import LeftOut, block_origins, errors_inside, joined_blocks, left_out_blocks
from ..identification.filtered_network import advance, drive_on, identify_again
from ..identification.loads import input_places, linear_network, plan_gain
from ..thermal import get_network
from .disturbance_steps import (
    Steps,
    average,
    disturbance_step,
    fit_forecaster,
    forecast_steps,
    frame_of,
    join_steps,
    reads_tables,
    steps_of_rows,
    with_step_before,
)
from .drift import DriftMonitor
from .earlier_states import EarlierStates
from .hourly_aggregation import HourlyAggregation
from .known_rows import KnownRows
from .scheme import AffinePaths, Ahead, Boundary, Paths, Scheme
from .tables import ELSEWHERE, KEPT, stamps_ns, time_zone_of, with_stamps
from .weekly_refit import WeeklyRefit, by_days, reference_days


class TwoStageScheme(EarlierStates):
    """A gray box, and a forecaster of the disturbance that it leaves, averaged over hours."""

    name = "two-stage"
    steps: ZoneTable  # the disturbance that the forecaster was fitted on, and the inputs

    def __init__(self, gray_box: Any, forecaster: Any, *, disturbance: str, adapt: str | None, memory: Any) -> None:
        self.gray_box, self.forecaster, self.network = gray_box, forecaster, get_network(gray_box.network)
        self.disturbance, self.adapt, self.memory = disturbance, adapt, memory

    @property
    def zeta_(self) -> pd.Series:
        return pd.Series(self.steps.history["zeta"], self.steps.index, name="zeta")

    def fit(self, measured: ZoneTable, like: Scheme | None = None) -> Self:
        """Identify the network, estimate its disturbance, learn to forecast it."""
        stamped = with_stamps(measured.replace(history={"T_za": measured.history["T_za"]}), ASSUMED_START)
        self.gray_box_ = self._identified(stamped, measured.history["T_za"])
        self.disturbance_step_ = disturbance_step(measured.step)
        self.rows = KnownRows.of(measured)
        return self._learn_disturbance(self.forecaster)

    def _identified(self, table: ZoneTable, target: np.ndarray) -> Any:
        """The gray box fitted to a table; a frozen one keeps its parameters and only follows the rows."""
        if isinstance(self.gray_box, FrozenEstimator):
            return self.gray_box.estimator.with_rows(table, target)
        dark = {"q_sol": None} if "q_sol" not in table.inputs else None
        memory = self.memory if hasattr(self.memory, "cache") else Memory(location=self.memory, verbose=0)
        return memory.cache(_fit_gray_box)(self.gray_box, table, target, dark)

    def _learn_disturbance(self, forecaster: Any) -> Self:
        zeta = self._estimate()
        self.forecaster_ = fit_forecaster(forecaster, self.steps)
        return self._begin_aggregation(zeta)

    def _estimate(self) -> np.ndarray:
        """The training disturbance by rows (n_rows,); by steps it becomes ``steps``."""
        training = with_stamps(self.rows.training, ASSUMED_START)
        zeta = self.gray_box_.estimate_disturbance(training, kind=self.disturbance).to_numpy()
        zeta = _since_measured(zeta, training.history["T_za"])
        self.steps = average(training, zeta, self.disturbance_step_, time_zone_of(training)).table
        return zeta

    def with_forecasters(self, forecasters: Sequence[Any], disturbance: str) -> list[Self]:
        """Schemes that share this one's identification: each as if fitted with that forecaster on the same table."""
        first = self._with(disturbance=disturbance)
        zeta = first._estimate()
        alike = all(map(reads_tables, forecasters))
        fitted = fit_each(forecasters, first.steps if alike else frame_of(first.steps), first.zeta_)
        return [first._with(forecaster=one, forecaster_=one)._begin_aggregation(zeta) for one in fitted]

    def _begin_aggregation(self, zeta: np.ndarray) -> Self:
        """Average the end of the training over steps, to which later rows are added."""
        training, step = self.rows.training, self.disturbance_step_
        names, fine = [*self.steps.inputs, "zeta"], training.step < step
        empty = HourlyAggregation(names, step, fine, time_zone_of(training), training.holidays)
        stamps = stamps_ns(training)
        self._aggregation = empty.added(stamps, self._rows_of(training, zeta)).since(int(stamps[-1] - KEPT.value))
        self._learned_to = int(stamps_ns(self.steps)[-1])
        self._seen_since = False  # whether a temperature was measured after the training
        self._refit = WeeklyRefit(self.forecaster_)
        return self._begin()

    def _rows_of(self, table: ZoneTable, zeta: np.ndarray) -> np.ndarray:
        """(n_rows, n_inputs + 1) inputs in the order of ``steps``, and the disturbance."""
        return np.column_stack([*(table.inputs[role] for role in self.steps.inputs), zeta])

    def advanced(self, measured: ZoneTable) -> Self:
        """The scheme after new rows: the filter follows them, and their disturbance is averaged."""
        gray_box, target = copy(self.gray_box_), measured.history["T_za"]
        zeta = self._known_zeta(advance(gray_box, measured, self.disturbance)[:, 0], target)
        return self._with(
            gray_box_=gray_box,
            rows=self.rows.appended(measured),
            _aggregation=self._aggregation.added(stamps_ns(measured), self._rows_of(measured, zeta)),
            _seen_since=self._seen_since or bool(np.isfinite(target).any()),
            _refit=self._refit.fork(),
            _earlier=dict(self._earlier),
        )

    def go_on(self) -> None:
        """The filter has followed the rows already."""

    def _known_zeta(self, zeta: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """NaN before the first measurement: nothing is estimated there, and what comes later must not be known."""
        return zeta if self._seen_since else _since_measured(zeta, measured)

    def forecast_ahead(self, future: ZoneTable, T_za: float | None = None) -> Paths:
        scheme, rest = self._at_origin(future, T_za)
        zeta, temperature = scheme._ahead(rest)
        return Paths(scheme.rows.plausible.clip(temperature)[None], zeta[None, 1:], zeta[:1])

    def _at_origin(self, ahead: ZoneTable, T_za: float | None) -> tuple[Self, ZoneTable]:
        """The scheme at the origin of rows ahead, which is the first one if that is measured, and the rows after it."""
        if T_za is None:
            return self, ahead
        return self.advanced(with_measured(ahead.rows(slice(0, 1)), 0, T_za)), ahead.rows(slice(1, None))

    def _ahead(self, future: ZoneTable) -> tuple[np.ndarray, np.ndarray]:
        """(n_rows + 1,) disturbance from the last known row on, and (n_rows,) temperatures."""
        rows = self._rows_of(future, np.full(future.n_rows, np.nan))
        steps = self._aggregation.extended(stamps_ns(future), rows, self._n_kept)
        known = steps.of_row[:1] - 1
        wanted = steps.of_row - known - 1
        forecaster, _ = next(self._forecasters(steps, known, True))
        zeta = _path(forecaster, steps, known, int(wanted[-1]) + 1)[0, wanted]
        acting = zeta[:-1] if self.disturbance == "input" else zeta[1:]
        if not future.n_rows:
            return zeta, np.empty(0)
        return zeta, drive_on(self.gray_box_, future, acting, self.disturbance)

    @property
    def _n_kept(self) -> int:
        return int(KEPT / self.disturbance_step_)

    def relearned(self, measured: ZoneTable | None) -> Self:
        """The forecaster fitted again on training and all rows since; the network too where ``adapt="full"``."""
        made = self._with() if measured is None else self.advanced(measured)
        if made.adapt == "full":
            return made._identified_again()
        new = made._aggregation.after(made._learned_to)
        return made._with_steps(join_steps(made.steps, new)) if new.n_rows else made

    def _with_steps(self, steps: ZoneTable) -> Self:
        forecaster = self.forecaster_
        if refits_fast(forecaster):  # by a refit of its own: what it keeps is of rows that this scheme may never know
            forecaster = WeeklyRefit(forecaster).fitted(steps)
        return self._with(
            forecaster_=forecaster,
            steps=steps,
            _learned_to=int(stamps_ns(steps)[-1]),
            _refit=WeeklyRefit(forecaster),
            _aggregation=self._aggregation.since(int(self._aggregation.labels[-1] - KEPT.value)),
        )._begin()

    def _identified_again(self) -> Self:
        """The network identified again, from its present parameters, and the forecaster trained on what it leaves."""
        whole = self.rows.whole()
        rows = with_stamps(whole, ASSUMED_START), whole.history["T_za"]
        if isinstance(self.gray_box, FrozenEstimator):
            gray_box = self.gray_box_.with_rows(*rows)
        else:
            gray_box = identify_again(self.gray_box_, *rows)
        made = self._with(gray_box_=gray_box, rows=self.rows.retrained(whole))
        return made._learn_disturbance(clone(self.forecaster_))

    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Test the day-ahead errors of the disturbance, forecast without adaptation."""
        frozen = self.forecaster_
        monitor = DriftMonitor(holidays=self.steps.holidays).fit(
            *reference_days(self.steps, frozen, refits_fast(frozen))
        )
        if table is None:
            steps = self._aggregation.table()
            first = int(np.searchsorted(self._aggregation.labels, self._learned_to, side="right"))
        else:
            found, offset = self._steps_of(table, _after_history(table))
            steps, first = found.table, int(found.of_row[offset + table.n_history])
        measured, forecast = by_days(steps, frozen)
        begin = steps.time[first : first + 1]
        later = measured.index >= begin[0] if len(begin) else np.zeros(len(measured), dtype=bool)
        return monitor.watch(measured[later], forecast[later])

    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int, boundary: Boundary = None) -> Paths:
        """Drive the network with the forecast disturbance (paper Eqs. 17 and 18)."""
        kept = origins < table.n_history - 1
        if kept.any():
            scheme, earlier, moved = self._before(table, origins[kept])
            found = [scheme.forecast(earlier, origins[kept] + moved, n_leads)]
            if not kept.all():
                found.append(self.forecast(table, origins[~kept], n_leads))
            at = np.argsort(np.append(np.flatnonzero(kept), np.flatnonzero(~kept)))
            return Paths(*(np.concatenate(parts)[at] for parts in zip(*found, strict=True)))
        zeta, temperature = self._driven(table, origins, n_leads)
        return Paths(self.plausible(table, origins).clip(temperature), zeta[:, 1:], zeta[:, 0])

    def affine(self, ahead: Ahead, plan: Plan, member: str) -> AffinePaths:
        zeta, temperature = self._unclipped(ahead)
        found = Paths(temperature[None], zeta[None, 1:], zeta[:1]).columns(ahead.T_za)
        gain = plan_gain(self.gray_box_.filtered_network_, plan.inputs, ahead.n_rows)
        return AffinePaths(found["T_za"], found["zeta"], gain, np.zeros(len(plan.inputs), dtype=bool))

    def _unclipped(self, ahead: Ahead) -> tuple[np.ndarray, np.ndarray]:
        """(n_leads + 1,) disturbance from the origin on, and (n_leads,) temperatures."""
        if ahead.origin is not None:
            zeta, temperature = self._driven(ahead.table, np.array([ahead.origin]), ahead.n_leads)
            return zeta[0], temperature[0]
        scheme, rest = self._at_origin(ahead.table, ahead.T_za)
        return scheme._ahead(rest)

    def linear_network(self, ahead: Ahead, plan: Plan) -> LinearNetwork:
        zeta, nodes, rows = self._unclipped(ahead)[0][:, None], *self._origin(ahead)
        known, nothing = self.gray_box_.filtered_network_, np.zeros_like(zeta)
        heat, offset = (zeta, nothing) if self.disturbance == "input" else (nothing, zeta)
        network = linear_network(known, plan.inputs, rows, nodes, heat, offset)
        if ahead.T_za is not None:
            return network.measured(np.array([ahead.T_za]))
        return network.after(rows[0, input_places(known, plan.inputs)])

    def _origin(self, ahead: Ahead) -> tuple[np.ndarray, np.ndarray]:
        """(n,) node temperatures at the origin (open loop for an output disturbance), and (N, p) inputs from there."""
        if ahead.origin is not None:
            here = _after_history(ahead.table)
            return self.gray_box_.origin_state(here, ahead.origin - ahead.table.n_history, self.disturbance)
        scheme, rest = self._at_origin(ahead.table, ahead.T_za)
        known = scheme.gray_box_.filtered_network_
        rows = np.vstack([known.rolling.inputs, known.experiment(rest).inputs])
        return (known.rolling.nodes if self.disturbance == "input" else known.rolling.open_nodes), rows

    def stages(self) -> dict[str, float]:
        return dict(self.gray_box_.plant.most)

    def _driven(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> tuple[np.ndarray, np.ndarray]:
        """(n_origins, n_leads + 1) disturbance from each origin on, and (n_origins, n_leads) temperatures."""
        here = _after_history(table)
        zeta = self._disturbance_paths(table, here, origins, n_leads + 1)
        # heat of a row acts over its own step, so that of the origin's row is the first to act
        acting = zeta[:, :-1] if self.disturbance == "input" else zeta[:, 1:]
        if not n_leads:
            return zeta, np.empty((len(origins), 0))
        return zeta, self.gray_box_.drive(here, origins - table.n_history, acting, kind=self.disturbance)

    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """Heat that keeps the network within its set-points under the forecast disturbance (paper Eq. 16)."""
        here, first = _after_history(table), 0 if self.disturbance == "input" else 1
        counts = np.diff(np.append(origins, table.n_rows))
        zeta = self._disturbance_paths(table, here, origins, int(counts.max()) + first)
        rows, acting = origins - table.n_history, zeta[:, first:]
        load = self.gray_box_.required_heat(here, setpoint, rows, acting, kind=self.disturbance, limits=limits)
        of_rows = np.concatenate([path[:count] for path, count in zip(zeta, counts, strict=True)])
        return self._clipped_load(load.assign(zeta=of_rows), table, origins, setpoint)

    def plant_heat(self, table: ZoneTable) -> np.ndarray:
        plant = self.gray_box_.plant
        heat = np.sum([table.inputs[role] for role in table.inputs if role.startswith("Q_")], axis=0)
        stages = [capacity * table.inputs[role] for role, capacity in (*plant.heating, *plant.cooling)]
        return np.zeros(table.n_rows) + heat + np.sum(stages, axis=0)

    def heat_frame(self, index: pd.Index, paths: LoadPaths) -> pd.DataFrame:
        heat, temperature, zeta = (part[0] for part in paths)
        return load_frame(self.gray_box_.plant, index, heat, heat, temperature, zeta)

    def left_out_errors(self, n_leads: int) -> LeftOut:
        """Errors in weeks (or the last quarter, where fits are slow) that the forecaster was not fitted on."""
        table, quick = self.rows.training, refits_fast(self.forecaster_)
        per_day, target = rows_per_day(table.step), table.history["T_za"]
        _, step_of_row = steps_of_rows(with_stamps(table, ASSUMED_START), self.disturbance_step_)
        found = []
        for block in left_out_blocks(table.n_rows, per_day) if quick else [(3 * table.n_rows // 4, table.n_rows)]:
            known = self.steps.history["zeta"].copy()
            known[np.unique(step_of_row[slice(*block)])] = np.nan
            origins = block_origins(block, per_day)
            if len(origins) and np.isfinite(known).any():
                with warnings_to(ignore):  # of fewer rows than the user has given
                    without = fit_forecaster(clone(self.forecaster_), self.steps, known)
                paths = self._with(adapt=None, forecaster_=without).forecast(table, origins, n_leads).temperature
                found.append(LeftOut(errors_inside(target, origins, paths, block[1]), origins))
        return joined_blocks(found)

    def _disturbance_paths(self, table: ZoneTable, here: ZoneTable, origins: np.ndarray, n_rows: int) -> np.ndarray:
        """(n_origins, n_rows) forecast disturbance of the rows ``origin``, ``origin + 1`` ..."""
        steps, offset = self._steps_of(table, here)
        known = steps.of_row[origins + offset] - 1  # the last step that ended before the origin
        rows = origins[:, None] + np.arange(n_rows)
        wanted = steps.of_row[np.minimum(rows, table.n_rows - 1) + offset] - known[:, None] - 1
        n_steps = int(wanted.max()) + 1
        ahead = np.empty((len(origins), n_steps))
        for forecaster, chosen in self._forecasters(steps, known, table.n_history > 0):
            ahead[chosen] = _path(forecaster, steps, known[chosen], n_steps)
        return np.take_along_axis(ahead, np.maximum(wanted, 0), axis=1)

    def _steps_of(self, table: ZoneTable, here: ZoneTable) -> tuple[Steps, int]:
        """The steps up to the end of a table, after the known ones, and the place in ``of_row`` of its first row."""
        measured = here.history["T_za"]
        zeta = np.full(here.n_rows, np.nan)
        if np.isfinite(measured).any():
            zeta = self.gray_box_.estimate_disturbance(here, kind=self.disturbance).to_numpy()
        if table.n_history:
            rows = table.rows(slice(table.n_history, None))
            known = self._rows_of(rows, self._known_zeta(zeta, measured))
            return self._aggregation.extended(stamps_ns(rows), known, self._n_kept), 1 - table.n_history
        padded = with_step_before(here, self.disturbance_step_)
        n_before = padded.n_rows - here.n_rows
        zeta = np.append(np.full(n_before, np.nan), _since_measured(zeta, measured))
        return average(padded, zeta, self.disturbance_step_, time_zone_of(self.rows.training)), n_before

    def _forecasters(self, steps: Steps, known: np.ndarray, following: bool) -> Iterator[tuple[Any, np.ndarray]]:
        """The forecaster of each origin: as fitted, or refitted on the full weeks since the training ended."""
        if self.adapt is None or not refits_fast(self.forecaster_):
            yield self.forecaster_, np.arange(len(known))
            return
        week = int(pd.Timedelta("7D") / self.disturbance_step_)
        labels = stamps_ns(steps.table)
        kept = self._aggregation.labels
        kept_to = kept[-1] if following and len(kept) else self._learned_to
        first = int(np.searchsorted(labels, max(kept_to, self._learned_to), side="right"))
        early = int((kept > self._learned_to).sum()) if following else 0
        weeks = (early + np.maximum(known + 1 - first, 0)) // week
        here = WeeklyRefit(self.forecaster_)  # on rows of this table, which another one need not have
        for count in np.unique(weeks):
            chosen, n_steps = np.flatnonzero(weeks == count), int(count) * week
            if count == 0:
                yield self.forecaster_, chosen
                continue
            later = steps.table.rows(slice(first, None))
            until = partial(self._steps_until, n_steps, later, following)
            if n_steps <= early or self._settled:  # steps that were taken in do not change
                yield self._refit.fitted_once(n_steps, until), chosen
            else:
                yield here.fitted(until()), chosen

    def _steps_until(self, n_steps: int, later: ZoneTable, following: bool) -> ZoneTable:
        """The training steps and so many after them: those that were taken in, if wanted, then later ones."""
        parts = [self._aggregation.after(self._learned_to), later] if following else [later]
        return join_steps(self.steps, concatenate_tables(parts).rows(slice(0, n_steps)))


def refits_fast(forecaster: Any) -> bool:
    """Whether a forecaster is one of the baselines, which are refitted in a fraction of a second."""
    return isinstance(model := getattr(forecaster, "model", None), str) and model in BASELINES


def _since_measured(zeta: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """A disturbance by rows, NaN before the first measured temperature: nothing is estimated there."""
    return np.where(np.logical_or.accumulate(np.isfinite(measured)), zeta, np.nan)


def _path(forecaster: Any, steps: Steps, known: np.ndarray, n_steps: int) -> np.ndarray:
    """(n_origins, n_steps) forecasts of the steps after the known ones; beyond the table the last one holds."""
    paths = forecast_steps(forecaster, steps.table, known, n_steps)
    return pd.DataFrame(paths).ffill(axis=1).to_numpy() if np.isnan(paths).any() else paths


def _after_history(table: ZoneTable) -> ZoneTable:
    """The rows of a table after the history that was put before it, with stamps and measured temperatures."""
    here = with_stamps(table.rows(slice(table.n_history, None)), ELSEWHERE)
    return here if "T_za" in here.history else here.replace(history={"T_za": here.measured()})


def _fit_gray_box(gray_box: Any, table: ZoneTable, target: np.ndarray, columns: Mapping[str, Any] | None) -> Any:
    """Fit on a table by roles; a function of its own, so that ``memory`` can keep it."""
    return gray_box.set_params(columns=columns, sampling_time=None).fit(table, target)
