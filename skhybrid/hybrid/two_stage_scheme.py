"""The scheme of the paper (3.1): an identified network driven by a forecast of its disturbance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy, deepcopy
from typing import Any, Self

import numpy as np
import pandas as pd
from joblib import Memory
from sklearn.base import clone

from .._table import ZoneTable
from .._time import ASSUMED_START
from ..control.setpoints import Band, Limits
from ..forecasting import DisturbanceForecaster
from ..forecasting.features import rows_per_day
from ..forecasting.joint_fit import fit_each
from ..forecasting.models import BASELINES
from ..forecasting.quantiles import LeftOut, block_origins, errors_inside, joined, left_out_blocks
from ..identification.rolling_state import advance, drive_on, identify_again
from .daily_errors import by_days, reference_days
from .drift import DriftMonitor
from .hourly_aggregation import HourlyAggregation
from .scheme import Paths
from .tables import (
    ELSEWHERE,
    KEPT,
    Bins,
    concatenate_tables,
    disturbance_step,
    frame_by_role,
    gather,
    joined_rows,
    stamps_ns,
    with_row_before,
)
from .weekly_refit import WeeklyRefit


class TwoStageScheme:
    """A gray box, and a forecaster of the disturbance that it leaves, gathered into hours.

    Parameters
    ----------
    gray_box, forecaster : estimator
        Unfitted; they become ``gray_box_`` and ``forecaster_``.
    disturbance : {"input", "output"}
    adapt : {None, "linear", "full"}
    memory : str, joblib.Memory or None
    """

    def __init__(self, gray_box: Any, forecaster: Any, *, disturbance: str, adapt: str | None, memory: Any) -> None:
        self.gray_box = gray_box
        self.forecaster = forecaster
        self.disturbance = disturbance
        self.adapt = adapt
        self.memory = memory

    def fit(self, table: ZoneTable, target: np.ndarray) -> Self:
        """Identify the network, estimate its disturbance, learn to forecast it."""
        measured = table.replace(history={"T_za": target})
        dark = {"q_sol": None} if "q_sol" not in table.inputs else None
        identify = _memory(self.memory).cache(_fit_gray_box)
        self.gray_box_ = identify(self.gray_box, frame_by_role(measured, ASSUMED_START), target, dark)
        self.disturbance_step_ = disturbance_step(table.step)
        # the rows themselves are wanted again only where the network is identified again
        self._log: list[ZoneTable] | None = [measured] if self.adapt == "full" else None
        return self._learn_disturbance(measured, self.forecaster)

    def _learn_disturbance(self, measured: ZoneTable, forecaster: Any) -> Self:
        causal = self._estimate(measured)
        self.forecaster_ = forecaster.fit(self._rows, self._rows["zeta"])
        self._open_ledger(measured, causal)
        return self

    def _estimate(self, measured: ZoneTable) -> np.ndarray:
        """The disturbance by rows (n_rows,), and gathered into the steps that a forecaster learns from."""
        frame = frame_by_role(measured, ASSUMED_START)
        causal = self.gray_box_.estimate_disturbance(frame, kind=self.disturbance)
        bins = gather(frame.assign(zeta=causal), self.disturbance_step_)
        self.zeta_ = bins.frame["zeta"]
        self._rows = bins.frame.drop(columns="T_za", errors="ignore")
        return causal.to_numpy()

    def with_forecasters(self, measured: ZoneTable, forecasters: Sequence[Any], disturbance: str) -> list[Self]:
        """Schemes that share this one's identification: each as if fitted with that forecaster on the same table."""
        first = copy(self)
        first.disturbance = disturbance
        causal = first._estimate(measured)
        made = []
        for forecaster in fit_each(forecasters, first._rows, first._rows["zeta"]):
            one = copy(first)
            one.forecaster = one.forecaster_ = forecaster
            one.gray_box_ = deepcopy(self.gray_box_)  # it follows the rows to come
            one._log = None if self._log is None else [measured]
            one._open_ledger(measured, causal)
            made.append(one)
        return made

    def _open_ledger(self, table: ZoneTable, zeta: np.ndarray) -> None:
        """Keep the end of the training by steps, to which rows to come are added."""
        zone = table.index.tz if isinstance(table.index, pd.DatetimeIndex) else None
        fine = table.step < self.disturbance_step_
        self._ledger = HourlyAggregation(list(self._rows.columns), self.disturbance_step_, fine, zone)
        stamps = stamps_ns(table)
        self._ledger.add(stamps, self._by_column(table, zeta))
        self._ledger.drop_before(int(stamps[-1] - KEPT.value))
        self._trained_to = int(self._rows.index[-1].as_unit("ns").value)
        self._awake = False  # whether something was measured behind the training
        self._refit = WeeklyRefit(self.forecaster_, self.disturbance_step_)

    def _by_column(self, table: ZoneTable, zeta: np.ndarray) -> np.ndarray:
        """(n_rows, n_columns) in the order of the forecaster's training table, whose last column is the disturbance."""
        inputs = [table.inputs[role] for role in self._ledger.names[:-1]]
        return np.column_stack([*inputs, zeta])

    # ------------------------------------------------------------------------------------------------ rows as they come
    def advance(self, table: ZoneTable, target: np.ndarray) -> None:
        """Let the filter follow new rows, and gather their disturbance."""
        measured = table.replace(history={"T_za": target})
        zeta = self._unless_asleep(advance(self.gray_box_, measured, self.disturbance)[:, 0], target)
        self._ledger.add(stamps_ns(table), self._by_column(table, zeta))
        self._awake |= bool(np.isfinite(target).any())
        if self._log is not None:
            self._keep_rows(self._log, measured)

    @staticmethod
    def _keep_rows(log: list[ZoneTable], measured: ZoneTable) -> None:
        """Single rows are joined by days, longer tables stay as they came."""
        if len(log) > 1 and log[-1].n_rows < pd.Timedelta("1D") / measured.step:
            measured = concatenate_tables([log.pop(), measured])
        log.append(measured)

    def _unless_asleep(self, zeta: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """Before the first measurement nothing is estimated, and whether one comes later must not be known."""
        awake = np.logical_or.accumulate(np.isfinite(measured)) | self._awake
        return np.where(awake, zeta, np.nan)

    def forecast_live(self, future: ZoneTable) -> Paths:
        """Forecast from where the filter stands; the past is not run through again."""
        rows = self._by_column(future, np.full(future.n_rows, np.nan))
        bins = self._ledger.extended(stamps_ns(future), rows, self._n_kept)
        known = bins.of_row[:1] - 1
        wanted = bins.of_row - known - 1
        forecaster, _ = next(self._forecasters(bins, known, True))
        zeta = self._path(forecaster, bins, known, int(wanted[-1]) + 1)[0, wanted]
        acting = zeta[:-1] if self.disturbance == "input" else zeta[1:]
        temperature = drive_on(self.gray_box_, future, acting, self.disturbance)
        return Paths(temperature[None], zeta[None, 1:])

    @property
    def _n_kept(self) -> int:
        return int(KEPT / self.disturbance_step_)

    def _path(self, forecaster: Any, bins: Bins, known: np.ndarray, steps: int) -> np.ndarray:
        """(n_origins, steps) forecasts of the steps behind the known ones; beyond the table the last one holds."""
        paths = forecaster.predict_from(bins.frame, known, horizon=steps * self.disturbance_step_)
        return pd.DataFrame(paths).ffill(axis=1).to_numpy() if np.isnan(paths).any() else paths

    def learn(self, table: ZoneTable, target: np.ndarray) -> None:
        """Fit the forecaster again on training and all rows since; all of it anew where ``adapt="full"`` asks so."""
        if self.adapt == "full" and self._log is None:
            raise ValueError("adapt was set to 'full' behind fit, which kept no rows to identify again; fit with it.")
        if table.n_rows:
            self.advance(table, target)
        if self._log is not None and self.adapt == "full":
            self._learn_anew(concatenate_tables(self._log))
        elif len(new := self._ledger.since(self._trained_to)):
            self._learn_steps(joined_rows(self._rows, new, self.disturbance_step_))

    def _learn_steps(self, rows: pd.DataFrame) -> None:
        if _refits_fast(self.forecaster_):
            self.forecaster_ = self._refit.fitted(rows)
        self._rows, self.zeta_ = rows, rows["zeta"]
        self._trained_to = int(rows.index[-1].as_unit("ns").value)
        self._refit = WeeklyRefit(self.forecaster_, self.disturbance_step_)
        self._ledger.drop_before(int(self._ledger.labels[-1] - KEPT.value))

    def _learn_anew(self, measured: ZoneTable) -> None:
        """Identify the network again, from where it is, and train the forecaster on what it leaves."""
        frame = frame_by_role(measured, ASSUMED_START)
        self.gray_box_ = identify_again(self.gray_box_, frame, measured.history["T_za"])
        self._log = [measured]
        self._learn_disturbance(measured, clone(self.forecaster_))

    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Go through the day-ahead errors of the disturbance, forecast as trained."""
        step, frozen = self.disturbance_step_, self.forecaster_
        monitor = DriftMonitor().fit(*reference_days(self._rows, frozen, step, _refits_fast(frozen)))
        if table is None:
            steps = self._ledger.frame(self._ledger.labels, self._ledger.means)
            first = int(np.searchsorted(self._ledger.labels, self._trained_to, side="right"))
        else:
            bins, offset = self._bins(table, self._here(table))
            steps, first = bins.frame, int(bins.of_row[offset + table.n_history])
        measured, forecast = by_days(steps, frozen, step)
        begin = pd.DatetimeIndex(steps.index[first : first + 1]).tz_localize(None)
        later = measured.index >= begin[0] if len(begin) else np.zeros(len(measured), dtype=bool)
        return monitor.watch(measured[later], forecast[later])

    # ----------------------------------------------------------------------------------------------------- forecast
    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> Paths:
        """Drive the network with the forecast disturbance (paper Eqs. ID_hybrid and od_hybrid)."""
        here = self._here(table)
        # heat of a row acts over its own step, so that of the origin's row is the first to act
        shift = 1 if self.disturbance == "input" else 0
        zeta = self._disturbance_paths(table, here, origins, n_leads + shift, 1 - shift)
        acting = zeta[:, :n_leads]
        temperature = self.gray_box_.drive(here, origins - table.n_history, acting, kind=self.disturbance)
        return Paths(temperature, zeta[:, shift:])

    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """Heat that keeps the network within its set-points under the forecast disturbance (paper Eq. inverseQ2)."""
        here, first = self._here(table), 0 if self.disturbance == "input" else 1
        counts = np.diff(np.append(origins, table.n_rows))
        paths = self._disturbance_paths(table, here, origins, int(counts.max()), first)
        rows = origins - table.n_history
        load = self.gray_box_.required_heat(here, setpoint, rows, paths, kind=self.disturbance, limits=limits)
        return load.assign(zeta=np.concatenate([path[:n] for path, n in zip(paths, counts, strict=True)]))

    def calibration_errors(self, table: ZoneTable, target: np.ndarray, n_leads: int) -> LeftOut:
        """Errors in weeks whose disturbance the forecaster was not fitted on; the network stays as identified.

        Where the forecaster takes long to fit, one block is left out: the last quarter.
        """
        per_day = rows_per_day(table.step)
        of_bin = gather(frame_by_role(table, ASSUMED_START), self.disturbance_step_).of_row
        quick = _refits_fast(self.forecaster_)
        found = []
        for block in left_out_blocks(table.n_rows, per_day) if quick else [(3 * table.n_rows // 4, table.n_rows)]:
            known = self._rows["zeta"].copy()
            known.iloc[np.unique(of_bin[slice(*block)])] = np.nan
            origins = block_origins(block, per_day)
            if len(origins) and known.notna().any():
                other = copy(self)
                other.adapt, other.forecaster_ = None, clone(self.forecaster_).fit(self._rows, known)
                paths = other.forecast(table, origins, n_leads).temperature
                found.append(LeftOut(errors_inside(target, origins, paths, block[1]), origins))
        return joined(found)

    @staticmethod
    def _here(table: ZoneTable) -> pd.DataFrame:
        """The rows behind the tail."""
        return frame_by_role(table.rows(slice(table.n_history, None)), ELSEWHERE)

    def _disturbance_paths(
        self, table: ZoneTable, here: pd.DataFrame, origins: np.ndarray, n_rows: int, first: int
    ) -> np.ndarray:
        """(n_origins, n_rows) forecast disturbance of the rows ``origin + first``, ``origin + first + 1`` ..."""
        bins, offset = self._bins(table, here)
        known = bins.of_row[origins + offset] - 1  # the last bin that ended before the origin
        rows = origins[:, None] + first + np.arange(n_rows)
        wanted = bins.of_row[np.minimum(rows, table.n_rows - 1) + offset] - known[:, None] - 1
        steps = int(wanted.max()) + 1
        ahead = np.empty((len(origins), steps))
        for forecaster, chosen in self._forecasters(bins, known, table.n_history > 0):
            ahead[chosen] = self._path(forecaster, bins, known[chosen], steps)
        return np.take_along_axis(ahead, np.maximum(wanted, 0), axis=1)

    def _bins(self, table: ZoneTable, here: pd.DataFrame) -> tuple[Bins, int]:
        """The steps up to the end of a table, and the place in ``of_row`` of its first row.

        Behind the training, or the rows since, those are at hand.
        """
        measured = here["T_za"].to_numpy()
        zeta = np.full(len(here), np.nan)
        if np.isfinite(measured).any():
            zeta = self.gray_box_.estimate_disturbance(here, kind=self.disturbance).to_numpy()
        if table.n_history:
            rows = table.rows(slice(table.n_history, None))
            known = self._by_column(rows, self._unless_asleep(zeta, measured))
            return self._ledger.extended(stamps_ns(rows), known, self._n_kept), 1 - table.n_history
        awake = np.logical_or.accumulate(np.isfinite(measured))
        frame = here.assign(zeta=np.where(awake, zeta, np.nan)).drop(columns="T_za")
        bins = gather(with_row_before(frame, self.disturbance_step_), self.disturbance_step_)
        return bins, len(bins.of_row) - table.n_rows

    def _forecasters(self, bins: Bins, known: np.ndarray, following: bool) -> Iterator[tuple[Any, np.ndarray]]:
        """The forecaster of each origin: as trained, or re-fitted on the full weeks since the training ended."""
        if self.adapt is None or not _refits_fast(self.forecaster_):
            yield self.forecaster_, np.arange(len(known))
            return
        week = int(pd.Timedelta("7D") / self.disturbance_step_)
        labels = pd.DatetimeIndex(bins.frame.index).as_unit("ns").asi8
        kept_to = self._ledger.labels[-1] if following and len(self._ledger.labels) else self._trained_to
        first = int(np.searchsorted(labels, max(kept_to, self._trained_to), side="right"))
        early = int((self._ledger.labels > self._trained_to).sum()) if following else 0
        weeks = (early + np.maximum(known + 1 - first, 0)) // week
        refit = self._refit if following else WeeklyRefit(self.forecaster_, self.disturbance_step_)
        for count in np.unique(weeks):
            chosen = np.flatnonzero(weeks == count)
            if count == 0:
                yield self.forecaster_, chosen
                continue
            n_steps, own = int(count) * week, following and int(count) * week <= early
            if own and n_steps in refit.kept:
                yield refit.kept[n_steps], chosen
                continue
            since = bins.frame.iloc[first:]
            since = pd.concat([self._ledger.since(self._trained_to), since]) if following else since
            fitted = refit.fitted(joined_rows(self._rows, since.iloc[:n_steps], self.disturbance_step_))
            if own:  # the steps that were taken in do not change
                refit.kept = {n_steps: fitted}
            yield fitted, chosen


def _fit_gray_box(gray_box: Any, frame: pd.DataFrame, target: np.ndarray, columns: Mapping[str, Any] | None) -> Any:
    """Fit on a table by roles; a function of its own, so that ``memory`` can keep it."""
    return gray_box.set_params(columns=columns, sampling_time=None).fit(frame, target)


def _memory(memory: Any) -> Memory:
    return memory if hasattr(memory, "cache") else Memory(location=memory, verbose=0)


def _refits_fast(forecaster: Any) -> bool:
    """Whether a forecaster is one of the linear ones, which are re-fitted in a fraction of a second."""
    return isinstance(forecaster, DisturbanceForecaster) and forecaster.model in tuple(BASELINES)
