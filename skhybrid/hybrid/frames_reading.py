"""Reading of the tables that a predictor is given, and of the rows before them, for forecasts by its scheme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from .._joining import (
    join_frames,
    join_tables,
    refuse_absent_ahead,
    refuse_unmeasured,
    unmeasured,
    warn_if_unmeasured,
    with_measured,
)
from .._table import (
    HISTORY_ROLES,
    SETPOINT_ROLES,
    ZoneTable,
    append_tables,
    plant_roles,
    read_table,
    refuse_gap,
    refuse_other_clock,
)
from .._time import rows_of, rows_per_day
from .._warnings import several, warn_once
from ..control import Plan, refuse_where, warn_uncovered
from ..exceptions import MeasurementWarning
from ..forecasting.intervals import DAYS_BACK
from ..forecasting.quantiles import QuantileForecastMixin
from ..thermal import RCNetwork
from .joint_errors import JointErrors
from .parts import is_read, preprocessed
from .plausible_range import PlausibleRange
from .scheme import Scheme
from .setpoint_columns import check_setpoints, setpoints_in
from .thermostat_law.closed_loop import ClosedLoop


def _at_now(table: ZoneTable, first: int, T_za: float | None) -> tuple[ZoneTable, np.ndarray]:
    """A table whose rows ahead begin with ``first``, and the row of the origin: that one where it is measured."""
    if T_za is None:
        return table, np.array([first - 1])
    return with_measured(table, first, T_za), np.array([first])


class FramesReadingMixin(QuantileForecastMixin):
    """Reading of tables, refusals of those that lack the plant, and rolling forecasts by a scheme."""

    columns: Mapping[str, Any] | None
    sampling_time: Any
    holidays: Any
    preprocess_: Any
    adapt: str | None
    _scheme: Scheme
    _law: ClosedLoop | None
    _joint: JointErrors | None
    _learned_to: pd.Timestamp | None  # the last stamp that was learned from
    _no_intervals = (
        "no intervals were learned: the training table was too short, or the model is a candidate of a search; fit on "
        "more days, with T_za measured."
    )

    def _reading(self) -> dict[str, Any]:
        """Arguments with which tables are read."""
        return {"columns": self.columns, "sampling_time": self.sampling_time, "holidays": self.holidays}

    def _column_of(self, role: str) -> Any:
        return (self._reading()["columns"] or {}).get(role, role)

    def _read(self, X: Any, network: RCNetwork, *, reset: bool, **reading: Any) -> ZoneTable:
        given = {"history_roles": (*HISTORY_ROLES, *SETPOINT_ROLES), **self._reading(), **reading}
        return read_table(
            self,
            preprocessed(self.preprocess_, X, [self._column_of("T_za")]),
            required=network.required_roles,
            needed=lambda role: is_read(role, network),
            reset=reset,
            min_rows=2 if reset else 1,
            expected_step=None if reset else self.sampling_time_,
            **given,
        )

    def _read_X(self, X: Any) -> ZoneTable:
        table = self._read(X, self._scheme.network, reset=False)
        # a measured disturbance is not read
        return table.replace(history={k: v for k, v in table.history.items() if k in ("T_za", *SETPOINT_ROLES)})

    def _read_following(self, X: Any) -> ZoneTable:
        """X in the time zone of the known rows, which it continues."""
        rows = self._scheme.rows
        return rows.with_own_clock(self._read_X(rows.in_own_zone(X)))

    def _after_tail(self, table: ZoneTable) -> tuple[ZoneTable, int]:
        rows = self._scheme.rows
        refuse_other_clock(table, rows.training)
        if not table.follows(rows.latest):
            return table, 0
        end = rows.end()
        return append_tables(end, table), end.n_rows

    def _n_known(self, table: ZoneTable) -> int:
        return self._scheme.rows.n_known_of(table)

    def _after_known(self, ahead: ZoneTable, T_za: float | None = None) -> tuple[ZoneTable, np.ndarray]:
        """Rows ahead after the end of the known ones, and the row of the origin: the first one where it is measured."""
        table = append_tables(self._scheme.rows.end(), ahead)
        return _at_now(table, table.n_rows - ahead.n_rows, T_za)

    def _read_future(self, future: pd.DataFrame | ZoneTable) -> ZoneTable:
        if isinstance(future, ZoneTable):
            table = self._read_following(unmeasured(future, self._scheme.rows.training))
        else:
            refuse_absent_ahead(self._input_columns(future), future, "the training table")
            table = self._read_following(future)
        self._scheme.rows.refuse_unless_following(table, "future")
        return table

    def _read_both(self, history: Any, future: Any, T_za: float | None = None) -> tuple[ZoneTable, np.ndarray]:
        """History and future as one table, after the known rows where it follows them, and the row of the origin."""
        if isinstance(history, ZoneTable):
            whole: Any = join_tables(history, future, self._scheme.rows.training)
        else:
            history = self._with_columns_of_setpoints(self._scheme.rows.in_own_zone(history), future)
            whole = join_frames(history, future, self._input_columns(history), self._column_of("T_za"))
        table = self._read_X(whole)
        refuse_gap(table)
        refuse_unmeasured(table, ("T_za",), self._column_of)
        n_past = len(history.index)
        n_known = self._n_known(table.rows(slice(0, n_past)))  # they are not taken in twice
        table, n_tail = self._after_tail(table.rows(slice(n_known, None)))
        if not n_tail and T_za is None:
            warn_if_unmeasured(table, ("T_za",), self._column_of)
        return _at_now(table, n_tail + n_past - n_known, T_za)

    def _with_columns_of_setpoints(self, history: pd.DataFrame, future: pd.DataFrame) -> pd.DataFrame:
        """A history with the columns of the set-points ahead, which are missing where it does not know them."""
        names = [self._column_of(role) for role in SETPOINT_ROLES]
        unknown = [name for name in names if name in future.columns and name not in history.columns]
        return history.reindex(columns=[*history.columns, *unknown]) if unknown else history

    def _input_columns(self, frame: pd.DataFrame) -> list[Any]:
        """Columns of a frame that are read and known in advance."""
        names = list(getattr(self, "feature_names_in_", frame.columns))
        if self.preprocess_ is not None:
            past = self._column_of("T_za")
            return [name for name in getattr(self.preprocess_, "feature_names_in_", frame.columns) if name != past]
        by_role = [self._column_of(role) for role in self._scheme.rows.training.inputs]
        return by_role if set(by_role) <= set(names) else names

    @property
    def _plant(self) -> list[str]:
        """Roles of the plant."""
        return plant_roles(self._scheme.rows.training.inputs)

    @property
    def _runs_as_usual(self) -> bool:
        """Whether the plant is forecast without set-points."""
        return self._law is not None and self._law.usual is not None

    def _refuse_without_heat(self, future: Any) -> None:
        """Refuse rows ahead without a column of the plant in the words of both tasks."""
        if self.preprocess_ is not None or not isinstance(future, pd.DataFrame):
            return  # what is read of these is refused by its role
        absent = [self._column_of(role) for role in self._plant if self._column_of(role) not in future.columns]
        if absent and self._column_of("T_oa") in future.columns:  # else columns go by position
            learned = [] if self._law is None else setpoints_in(self._scheme.rows.training)
            columns = " and ".join(str(self._column_of(role)) for role in learned)
            raise ValueError(
                f"future has no column {absent[0]!r}, which the training table has; give the heat, or the set-points "
                f"under which it is forecast: setpoint={f', or columns {columns}' if columns else ''}."
            )

    def _check_setpoints_ahead(self, ahead: ZoneTable) -> None:
        """Refuse rows ahead whose set-points are crossed, or lack one with which the thermostat was learned."""
        if self._runs_as_usual:  # set-points are not read
            return
        for role in setpoints_in(self._scheme.rows.training):
            missing, name = np.isnan(ahead.measured(role)), self._column_of(role)
            what = f"{name} is missing in {several(int(missing.sum()), 'row')}, but the thermostat was learned with it"
            refuse_where(missing, ahead, what, "give the set-point that is in force there")
        check_setpoints(ahead, self._column_of)

    def _warn_without_setpoints(self, table: ZoneTable) -> None:
        """Warn, once per fit, of rows to take in that lack set-points with which the thermostat was learned."""
        if self._law is None or self._runs_as_usual:
            return
        learned = setpoints_in(self._scheme.rows.training)
        lacking = [str(self._column_of(role)) for role in learned if np.isnan(table.measured(role)).all()]
        if lacking:
            warn_once(
                f"rows that are taken in have no {' and '.join(lacking)}, with which the thermostat was learned: they "
                "count as free running, and loads are forecast worse after them; give the set-point that was in force.",
                MeasurementWarning,
                self._law,
            )

    def _refuse_without_plant(self, so: str) -> None:
        if not self._plant:
            raise ValueError(f"the training has no heating or cooling, so that {so}.")

    def _warn_of_plan(self, table: ZoneTable, n_ahead: int) -> None:
        """Warn where the plant of the last rows of a table leaves what training covered."""
        warn_uncovered(Plan.of(table, self._plant, n_ahead), self._plant, self._scheme.rows.training.inputs)

    def _check_adapt(self) -> None:
        if self.adapt not in (None, "linear", "full"):
            raise ValueError(f"adapt={self.adapt!r} is not one of None, 'linear', 'full'.")

    def _present_scheme(self) -> Scheme:
        """The fitted scheme; ``adapt`` may have been set since, as ``horizon`` may."""
        self._check_adapt()
        return self._scheme if self._scheme.adapt == self.adapt else self._scheme.adapting(self.adapt)

    def _most_leads(self, step: pd.Timedelta) -> int:
        """Leads of a day, or of a longer horizon."""
        return max(rows_per_day(step), rows_of(self.horizon or "1D", step))

    def _quantile_paths(self, table: ZoneTable, origins: np.ndarray, *args: Any, **kwargs: Any) -> np.ndarray:
        bands = super()._quantile_paths(table, origins, *args, **kwargs)
        lowest, highest = self._present_scheme().plausible(table, origins)
        return PlausibleRange(lowest[..., None], highest[..., None]).clip(bands)

    def _quantile_offsets(
        self, table: ZoneTable, origins: np.ndarray, *args: Any, **kwargs: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        # of the kept rows all whose errors count, as if the table followed the training
        missing = DAYS_BACK * rows_per_day(table.step) - int(origins.min(initial=table.n_rows))
        longer = self._scheme.rows.with_earlier(table, table.n_history + missing)
        return super()._quantile_offsets(longer, origins + longer.n_rows - table.n_rows, *args, **kwargs)

    def _each_path(self, tables: Sequence[ZoneTable], origin: int, n_leads: int) -> np.ndarray:
        return self._present_scheme().forecast_each(tables, origin, n_leads)[:, None]

    def _first_past(self, table: ZoneTable) -> int:
        if table.utc is None or self._learned_to is None:
            return table.n_history
        return min(table.stamps.n_until(self._learned_to), table.n_history)  # rows taken in since count too
