"""The scheme of the paper (3.1): an identified network driven by a forecast of its disturbance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Self

import numpy as np
import pandas as pd
from joblib import Memory
from sklearn.base import clone

from .._clock import ASSUMED_START
from .._contract import ZoneTable
from ..forecasting import DisturbanceForecaster
from ..forecasting.forecaster import BASELINES
from ..identification.setpoints import Band, Limits
from .scheme import Paths
from .tables import ELSEWHERE, Bins, disturbance_step, frame_by_role, gather, joined_rows, with_row_before


class PublishedScheme:
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
        frame = frame_by_role(table.replace(history={"T_za": target}), ASSUMED_START)
        dark = {"q_sol": None} if "q_sol" not in table.inputs else None
        self.gray_box_ = _memory(self.memory).cache(_fit_gray_box)(self.gray_box, frame, target, dark)
        self.disturbance_step_ = disturbance_step(table.step)
        causal = self.gray_box_.estimate_disturbance(frame, kind=self.disturbance)
        bins = gather(frame.assign(zeta=causal), self.disturbance_step_)
        self.zeta_ = bins.frame["zeta"]
        self._rows = bins.frame.drop(columns="T_za", errors="ignore")
        self.forecaster_ = self.forecaster.fit(self._rows, self._rows["zeta"])
        self._zeta = causal.to_numpy(copy=True)
        return self

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

    @staticmethod
    def _here(table: ZoneTable) -> pd.DataFrame:
        """The rows behind the tail."""
        return frame_by_role(table.rows(slice(table.n_history, None)), ELSEWHERE)

    def _disturbance_paths(
        self, table: ZoneTable, here: pd.DataFrame, origins: np.ndarray, n_rows: int, first: int
    ) -> np.ndarray:
        """(n_origins, n_rows) forecast disturbance of the rows ``origin + first``, ``origin + first + 1`` ..."""
        bins = gather(with_row_before(self._with_zeta(table, here), self.disturbance_step_), self.disturbance_step_)
        lead_in = len(bins.of_row) - table.n_rows
        known = bins.of_row[origins + lead_in] - 1  # the last bin that ended before the origin
        rows = origins[:, None] + first + np.arange(n_rows)
        wanted = bins.of_row[np.minimum(rows, table.n_rows - 1) + lead_in] - known[:, None] - 1
        steps = int(wanted.max()) + 1
        ahead = np.empty((len(origins), steps))
        for forecaster, chosen in self._forecasters(bins, known):
            paths = forecaster.predict_from(bins.frame, known[chosen], horizon=steps * self.disturbance_step_)
            ahead[chosen] = pd.DataFrame(paths).ffill(axis=1).to_numpy()
        return np.take_along_axis(ahead, np.maximum(wanted, 0), axis=1)

    def _with_zeta(self, table: ZoneTable, here: pd.DataFrame) -> pd.DataFrame:
        """The inputs of a table with the estimated disturbance of its tail and of the rows behind that."""
        n_tail = table.n_history
        zeta = np.full(table.n_rows, np.nan)
        zeta[:n_tail] = self._zeta[len(self._zeta) - n_tail :]
        # before the first measurement of X nothing is estimated, and whether one comes later must not be known
        seen = np.logical_or.accumulate(np.isfinite(here["T_za"].to_numpy()))
        if seen.any():
            estimate = self.gray_box_.estimate_disturbance(here, kind=self.disturbance)
            zeta[n_tail:] = np.where(seen, estimate, np.nan)
        return frame_by_role(table, ELSEWHERE).assign(zeta=zeta).drop(columns="T_za")

    def _forecasters(self, bins: Bins, known: np.ndarray) -> Iterator[tuple[Any, np.ndarray]]:
        """The forecaster of each origin: as trained, or re-fitted on the full weeks since the training ended."""
        week = int(pd.Timedelta("7D") / self.disturbance_step_)
        first = int(np.sum(bins.frame.index <= self._rows.index[-1]))
        weeks = np.maximum(known + 1 - first, 0) // week
        if self.adapt is None or not _refits_fast(self.forecaster_):
            weeks[:] = 0
        for count in np.unique(weeks):
            chosen = np.flatnonzero(weeks == count)
            if count == 0:
                yield self.forecaster_, chosen
                continue
            rows = joined_rows(self._rows, bins.frame.iloc[first : first + count * week], self.disturbance_step_)
            yield clone(self.forecaster_).fit(rows, rows["zeta"]), chosen


def _fit_gray_box(gray_box: Any, frame: pd.DataFrame, target: np.ndarray, columns: Mapping[str, Any] | None) -> Any:
    """Fit on a table by roles; a function of its own, so that ``memory`` can keep it."""
    return gray_box.set_params(columns=columns, sampling_time=None).fit(frame, target)


def _memory(memory: Any) -> Memory:
    return memory if hasattr(memory, "cache") else Memory(location=memory, verbose=0)


def _refits_fast(forecaster: Any) -> bool:
    """Whether a forecaster is one of the linear ones, which are re-fitted in a fraction of a second."""
    return isinstance(forecaster, DisturbanceForecaster) and forecaster.model in tuple(BASELINES)
