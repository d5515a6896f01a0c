"""A log as a model reads it: its complete rows, those that are new to the model, and outages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, partial

import numpy as np
import pandas as pd

from .._clock import on_clock_of
from ..preprocessing.bridges import bridged, complete, stretches
from ..study.log_split import with_facades
from ..study.settings import Settings
from ..study.spans import NO_ROWS
from ..study.unread_rows import BRIDGED, Unread
from ..study.zone_part import log_columns
from .complete_rows import up_to_measured
from .dead_meters import without_further_temperatures, without_roles

_ENOUGH = pd.Timedelta("1D")  # history from which on an earlier outage does not matter
_HISTORY = pd.Timedelta("21D")  # least history of a forecast: what its schedules, laws and intervals look back on


class ReadableLog:
    """The rows of a log that a model can read.

    Parameters
    ----------
    frame : DataFrame, one column per role, as :func:`skhybrid.study.read_log` returns
    settings : Settings
    not_learned : mapping of zone to roles of heat that it was learned without
    """

    def __init__(self, frame: pd.DataFrame, settings: Settings, not_learned: Mapping[str, Sequence[str]]) -> None:
        self.frame, self.settings = frame, settings
        self._not_learned = not_learned
        self._measured, self._step = settings.roles_of("T_za"), pd.Timedelta(settings.step)

    @cached_property
    def _rows(self) -> pd.DataFrame:
        """Rows up to the last temperature, without what the model does not read."""
        own = without_roles(without_further_temperatures(self.frame, self.settings), self._not_learned)
        return up_to_measured(own, self._measured)

    @cached_property
    def _with_facades(self) -> pd.DataFrame:
        return with_facades(self._rows, self.settings)

    @cached_property
    def complete(self) -> pd.DataFrame:
        """The rows that have all that the model reads, up to the last temperature."""
        return complete(self._with_facades, self._measured)

    @cached_property
    def unread(self) -> Unread | None:
        """The rows at the end that have a temperature but not all inputs; None where there are none."""
        return Unread.of(self._rows.drop(columns=self._measured), partial(log_columns, settings=self.settings))

    @cached_property
    def history(self) -> pd.DataFrame:
        """The rows that a forecast starts from: the last unbroken ones, a day or more if outages are short.

        Raises
        ------
        ValueError
            If no row has all inputs and a temperature.
        """
        if self.complete.empty:
            raise ValueError(NO_ROWS)
        last, *earlier = reversed(stretches(self.complete, self._step))
        first, end = last.index[0], last.index[-1]
        for part in earlier:
            if end - first >= _ENOUGH or first - part.index[-1] > BRIDGED:
                break
            first = part.index[0]
        rows = self._bridged(self._with_facades.loc[first:end])
        return rows[rows.index > end - _HISTORY]

    @property
    def origin(self) -> pd.Timestamp:
        """The last complete row, from which a forecast starts."""
        return pd.Timestamp(self.history.index[-1])

    def new_rows(self, known_until: pd.Timestamp) -> pd.DataFrame:
        """The complete rows after those that are known.

        Parameters
        ----------
        known_until : Timestamp, the last stamp that a model knows
        """
        rows = self.complete
        return rows[rows.index > on_clock_of(known_until, rows.index)]

    def outage(self, known_until: pd.Timestamp, longest: pd.Timedelta) -> str:
        """The outage before or among the new rows, if it exceeds ``longest``; empty where there is none.

        Parameters
        ----------
        known_until : Timestamp, the last stamp that a model knows
        longest : Timedelta
        """
        rows = self.new_rows(known_until).index
        stamps = pd.DatetimeIndex([on_clock_of(known_until, rows), *rows])
        wide = np.diff(stamps) > longest
        return f"rows are missing after {stamps[int(np.argmax(wide))]}" if wide.any() else ""

    def following(self, known: pd.DataFrame, known_until: pd.Timestamp) -> pd.DataFrame:
        """The new rows, with those of short outages, also of one after the last of the known rows.

        Parameters
        ----------
        known : DataFrame, the last rows that a model knows, with the columns of the log by role
        known_until : Timestamp, the last stamp that it knows
        """
        rows = self.new_rows(known_until)
        last = known.iloc[-1:].reindex(columns=rows.columns)
        last.index = pd.DatetimeIndex([on_clock_of(known_until, rows.index)])
        if (rows.index[0] - last.index[0]) % self._step:
            return rows  # the predictor refuses them
        later = self._with_facades.loc[: rows.index[-1]]
        return self._bridged(pd.concat([last, later[later.index > last.index[0]]])).iloc[1:]

    def remarks_on_outages(self, known_until: pd.Timestamp) -> list[str]:
        """Remarks on outages that the history bridges, or after which it begins.

        Parameters
        ----------
        known_until : Timestamp, the last stamp that a model knows
        """
        complete, history = self.complete.index, self.history.index
        missing = history.difference(complete)
        if len(missing):
            return [f"no complete rows from {missing[0]} to {missing[-1]}: their inputs are interpolated"]
        span = len(history) * self._step
        is_known = on_clock_of(known_until, history) == history[-1]  # with the rows before
        if history[0] == complete[0] or span >= _ENOUGH or is_known:
            return []
        hours = span / pd.Timedelta("1h")
        return [f"the forecast starts from the last {hours:.3g} h, since rows are missing before {history[0]}"]

    def _bridged(self, rows: pd.DataFrame) -> pd.DataFrame:
        return bridged(rows, self._step, self._measured, self.settings.setpoints)
