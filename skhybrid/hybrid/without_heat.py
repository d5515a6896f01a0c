"""A member that learns from temperatures without the network's response to the plants, which is added back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from .._table import ZoneTable
from ..filtering import ForecastSample
from ..schedule import HeatResponse
from .members import Member, NumberedTable, RollingMember


class RowsAndHeat(NamedTuple):
    """Rows without the columns of the plants, and their heat less its mean in the training (n_rows,) [kW]."""

    rows: NumberedTable
    heat: np.ndarray


class WithoutHeat:
    """A member whose response to the heat of the plants is that of the fitted network."""

    def __init__(self, member: Member, response: HeatResponse) -> None:
        self._member, self._response = member, response
        self.names, self.is_rule, self.needs_days = member.names, member.is_rule, member.needs_days

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        self._member.fit(self._reduced(training), n_leads)
        return self

    def _reduced(self, training: ZoneTable) -> ZoneTable:
        """The training as the member knows it."""
        response = self._response
        s = response.output(response.simulate(response.heat(training)))[:-1]
        T = training.history["T_za"] - s
        return response.without_plants(training).replace(history={"T_za": T})

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        return self._member.left_out(self._reduced(training), sample, blocks)

    def view(self, rows: NumberedTable) -> RowsAndHeat:
        response = self._response
        before = None if rows.before is None else response.without_plants(rows.before)
        without = rows._replace(table=response.without_plants(rows.table), before=before, whole=None)
        return RowsAndHeat(without, response.heat(rows.table))

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingWithoutHeat:
        return RollingWithoutHeat(self._response, self._member.view, self._member.start(rows, sample, adapt))


class RollingWithoutHeat:
    """The member as it goes through rows from row 0 on."""

    def __init__(
        self, response: HeatResponse, view: Callable[[NumberedTable], Any], rolling: RollingMember
    ) -> None:
        self._response, self._view_of, self._rolling = response, view, rolling
        self._row = 0  # the last row that it went through
        self._past = np.empty(0)  # responses [K] of the rows before it
        self._states = np.zeros((1, len(response.A)))  # of the network from row ``_first`` on
        self._first = 0
        self._rows: RowsAndHeat | None = None  # as last seen
        self._view: Any = None

    @property
    def errors(self) -> np.ndarray:
        return self._rolling.errors

    def _take(self, rows: RowsAndHeat) -> Any:
        """The rows as the member takes them; those after the last one may differ from those seen before."""
        if rows is not self._rows:
            first, T = rows.rows.first, rows.rows.T
            self._past = np.append(self._past, self._response.output(self._states[: self._row - self._first]))
            begin = self._states[self._row - self._first]
            self._states, self._first = self._response.simulate(rows.heat[self._row - first :], begin), self._row
            s = np.append(self._past, self._response.output(self._states[:-1]))[first:]
            self._rows, self._view = rows, self._view_of(rows.rows._replace(T=T - s))
        return self._view

    def advance(self, view: RowsAndHeat, origin: int) -> None:
        self._rolling.advance(self._take(view), origin)
        self._row = origin

    def forecast(self, view: RowsAndHeat, n_leads: int) -> tuple[np.ndarray, np.ndarray | None]:
        paths, zeta = self._rolling.forecast(self._take(view), n_leads)
        ahead = self._states[self._row - self._first + 1 :][:n_leads]
        if len(ahead) < n_leads:  # after the last row its heat is held
            held = np.full(n_leads - len(ahead), view.heat[-1])
            ahead = np.concatenate([ahead, self._response.simulate(held, self._states[-1])[1:]])
        return paths + self._response.output(ahead), zeta
