"""The interface between the estimators, which read tables, and the schemes, which forecast a building."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .._arguments import as_mapping
from .._shallow import shallow_copy
from .._table import ZoneTable
from ..control import Band, Limits, LinearNetwork, LoadPaths, Plan, WantedPaths, refuse_boundary
from ..forecasting.arx_prior import ZoneEvidence
from ..forecasting.quantiles import LeftOut
from ..thermal import RCNetwork
from .known_rows import KnownRows
from .plausible_range import PlausibleRange

NEXT = "T_next_"  # before a zone's name: the role of its temperature as a boundary of its neighbours
#: boundary temperatures (n_origins, n_leads) [degC] by role, in place of those that a table has ahead
Boundary = Mapping[str, np.ndarray] | None
#: loads from some origins (n_origins,), by the number of rows ahead and what is wanted
LoadsFrom = Callable[[np.ndarray, int, WantedPaths], LoadPaths]


class Paths(NamedTuple):
    """Forecasts from some origins; column j is the row ``origin + 1 + j``."""

    temperature: np.ndarray  # (n_origins, n_leads) at the stamp of each row [degC]
    zeta: np.ndarray  # (n_origins, n_leads) over the step that begins there [kW, or K for an output disturbance]
    zeta_now: np.ndarray  # (n_origins,) over the step that begins at the origin; NaN where that row is not asked for

    def columns(self, T_za: float | None) -> dict[str, np.ndarray]:
        """Temperature and zeta of the first path by the rows ahead, of which the first may be the measured origin."""
        if T_za is None:
            return {"T_za": self.temperature[0], "zeta": self.zeta[0]}
        return {"T_za": np.append(T_za, self.temperature[0]), "zeta": np.append(self.zeta_now[0], self.zeta[0])}


class Ahead(NamedTuple):
    """Rows ahead of an origin."""

    table: ZoneTable  # these alone, or with all rows before them
    origin: int | None  # row of the table; None: the rows follow the known ones
    T_za: float | None  # measured in the first row ahead, which then is the origin [degC]
    n_rows: int

    @property
    def n_leads(self) -> int:
        return self.n_rows - (self.T_za is not None)


class RecentErrors(NamedTuple):
    """Errors of forecasts that were made about whole days before an origin, as known there."""

    values: np.ndarray  # (D, L) [K], NaN where unknown
    back: np.ndarray  # (D,) rows from their origins to this one
    leads: np.ndarray  # (L,) rows


class AffinePaths(NamedTuple):
    """A forecast under a plan (H, m) by the rows ahead, in which nothing is clipped, and its slope."""

    temperature: np.ndarray  # (H,) [degC]
    zeta: np.ndarray  # (H,) [kW, or K for an output disturbance]
    gain: np.ndarray  # (H, H, m) [K per kW or stage]
    bent: np.ndarray  # (m,) bool, inputs in which it is not affine
    recent: RecentErrors | None = None  # None where nothing is recorded


class Scheme(ABC):
    """A way to forecast a building.

    Apart from caches, a fitted scheme never changes: :meth:`advanced`, :meth:`relearned` and :meth:`adapting` return
    another one.  Measured temperatures come as history ``T_za`` of a table.  A table that follows the known rows begins
    with the end of them: those are its first ``n_history`` rows, and origins count from the first of them.
    """

    name: str  # "schedule" or "two-stage"
    network: RCNetwork
    adapt: str | None  # what a forecast takes in from the history up to its origin: None, "linear" or "full"
    rows: KnownRows
    disturbance_step_: pd.Timedelta
    gray_box_: Any
    forecaster_: Any
    gain_doubt: str | None = None  # why not to plan with its forecasts

    @property
    @abstractmethod
    def zeta_(self) -> pd.Series:
        """The training disturbance."""

    @property
    def weights_(self) -> pd.DataFrame:
        """Shares of the members of a blend."""
        raise AttributeError(f"the {self.name} scheme blends nothing, so that it has no weights_.")

    @property
    def evidence_(self) -> ZoneEvidence:
        """Sums from which a prior of other zones is learned."""
        raise AttributeError(f"the {self.name} scheme has no evidence_; fit the schedule model.")

    @property
    def gain_(self) -> pd.DataFrame:
        """Temperature after a step of 1 kW."""
        raise AttributeError(f"the {self.name} scheme has no gain_; take the step response of its gray_box_.")

    @property
    def gain_std_(self) -> pd.Series:
        """Relative standard error of the gain."""
        raise AttributeError(f"the {self.name} scheme has no gain_std_; take theta_cov_ of its gray_box_.")

    @abstractmethod
    def fit(self, measured: ZoneTable, like: Scheme | None = None) -> Self:
        """Learn from a training table; what another fitted scheme has chosen may be taken from it."""

    @abstractmethod
    def forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int, boundary: Boundary = None) -> Paths:
        """Forecast from each origin, which may lie in the history; anything at rows beyond the table."""

    def forecast_each(self, tables: Sequence[ZoneTable], origin: int, n_leads: int) -> np.ndarray:
        """(n_tables, n_leads) temperatures [degC] from one origin of tables that differ after it only."""
        once = self.adapting(None)  # the network, and so what inputs change, hardly adapts
        return np.concatenate([once.forecast(table, np.array([origin]), n_leads).temperature for table in tables])

    @abstractmethod
    def forecast_ahead(self, future: ZoneTable, T_za: float | None = None) -> Paths:
        """Forecast the rows of ``future``, which follow the last known one: (1, n_rows) paths.

        With the measured temperature of its first row, which is not kept, that row is the origin.
        """

    @abstractmethod
    def affine(self, ahead: Ahead, plan: Plan, member: str) -> AffinePaths:
        """The forecast of the rows ahead, by the whole model or its network, as a function of the plan."""

    @abstractmethod
    def linear_network(self, ahead: Ahead, plan: Plan) -> LinearNetwork:
        """The network from the first row ahead on, whose inputs are those of the plan."""

    @property
    def planned_boundaries(self) -> tuple[str, ...]:
        """Boundary temperatures that a plan may hold."""
        return ()

    def read_boundary(self, given: Any, shape: tuple[int, int]) -> dict[str, np.ndarray]:
        """Boundary temperatures (n_origins, n_leads) by role; refused where the network has no such ones."""
        boundary = as_mapping("boundary", given, "boundary temperatures to their values")
        if boundary and not self.planned_boundaries:
            raise ValueError(
                f"boundary names {next(iter(boundary))!r}, but boundary temperatures of this model are those in X; "
                "leave boundary out."
            )
        refuse_boundary(boundary, self.planned_boundaries, shape)
        return {role: np.asarray(values) for role, values in boundary.items()}

    @property
    def unforeseen(self) -> tuple[str, ...]:
        """Boundary temperatures that nobody knows ahead: those of neighbours."""
        return tuple(role for role in self.planned_boundaries if role.startswith(NEXT))

    @abstractmethod
    def stages(self) -> dict[str, float]:
        """Highest value of each stage."""

    @abstractmethod
    def required_heat(self, table: ZoneTable, origins: np.ndarray, setpoint: Band, limits: Limits) -> pd.DataFrame:
        """:meth:`~skhybrid.hybrid.HybridPredictor.predict_load` of the rows from the first origin on.

        ``setpoint`` and ``limits`` are of these (n_rows - n_history) rows; each origin is forecast up to the next one.
        """

    @abstractmethod
    def load_paths_from(self, table: ZoneTable, origins: np.ndarray) -> LoadsFrom:
        """Least heat that keeps the network within the set-points (n_rows,) of a table, from some of these origins on.

        They increase, and the states at them are computed once.
        """

    @abstractmethod
    def plant_heat(self, table: ZoneTable) -> np.ndarray:
        """(n_rows,) heat [kW] of the plant in a table."""

    @abstractmethod
    def heat_frame(self, index: pd.Index, paths: LoadPaths) -> pd.DataFrame:
        """Stages, heat, temperature and zeta of one path by rows."""

    @abstractmethod
    def left_out_errors(self, n_leads: int) -> LeftOut:
        """Errors of forecasts of parts of the training table, each by what has not learned from that part."""

    @abstractmethod
    def advanced(self, measured: ZoneTable) -> Self:
        """The scheme after rows that follow the last known one, in a time that does not depend on earlier rows."""

    @abstractmethod
    def go_on(self) -> None:
        """Learn from the last rows now, if it has forecast before, so that the next forecast comes sooner."""

    @abstractmethod
    def relearned(self, measured: ZoneTable | None) -> Self:
        """The scheme recalibrated on all known rows and those that follow them (None: there are none)."""

    @abstractmethod
    def drift(self, table: ZoneTable | None) -> pd.DataFrame:
        """Daily report on whether what was learned still holds (:class:`DriftMonitor`); None: of rows taken in."""

    def plausible(self, table: ZoneTable, origins: np.ndarray) -> PlausibleRange:
        """Limits of a forecast from each origin: ranges (n_origins, 1), from what is known there."""
        return self.rows.plausible.at(table.measured(), origins)

    def _clipped_load(self, load: pd.DataFrame, table: ZoneTable, origins: np.ndarray, setpoint: Band) -> pd.DataFrame:
        """A load whose temperature is plausible, or one between the set-points."""
        of_row = np.repeat(origins, np.diff(np.append(origins, table.n_rows)))
        low, high = (ends.ravel() for ends in self.plausible(table, of_row).around(setpoint))
        return load.assign(T_za=PlausibleRange(low, high).clip(load["T_za"].to_numpy()))

    def adapting(self, adapt: str | None) -> Self:
        """The scheme with another ``adapt``."""
        return self._with(adapt=adapt)

    def _with(self, **changes: Any) -> Self:
        """The same scheme with some attributes changed."""
        made = shallow_copy(self)
        made.__dict__.update(changes)
        return made
