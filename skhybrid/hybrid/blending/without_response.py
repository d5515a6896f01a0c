"""A member that learns from temperatures without the network's response to some inputs, which is added back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from ..._shallow import shallow_copy
from ..._table import ZoneTable
from ..._time import rows_per_day
from ...control import Plan
from ...filtering import ForecastSample
from ...schedule import NetworkResponse, RollingNetwork
from .members import Member, RollingMember
from .numbered_table import NumberedTable


class RowsAndDrive(NamedTuple):
    """Rows without the columns of the response, and what drives it, ``NetworkResponse.drive`` (n_rows, 2 + nb)."""

    rows: NumberedTable
    drive: np.ndarray


class WithoutResponse:
    """A member whose response to plants and neighbours is that of the fitted network."""

    def __init__(self, member: Member, response: NetworkResponse) -> None:
        self._member, self._response = member, response
        self.names, self.is_rule, self.needs_days = member.names, member.is_rule, member.needs_days

    def fit(self, training: ZoneTable, n_leads: int) -> Self:
        self._member.fit(self._reduced(training), n_leads)
        return self

    def _reduced(self, training: ZoneTable) -> ZoneTable:
        """The training as the member knows it."""
        T = training.history["T_za"] - self._response.temperature(training)
        return self._response.without_roles(training).replace(history={"T_za": T})

    def left_out(self, training: ZoneTable, sample: ForecastSample, blocks: np.ndarray) -> np.ndarray:
        return self._member.left_out(self._reduced(training), sample, blocks)

    def step_gain(self, training: ZoneTable, plant: tuple[str, float], n_leads: int) -> np.ndarray:
        if plant[0] not in self._response.roles:
            return self._member.step_gain(self._reduced(training), plant, n_leads)
        return self._response.step(n_leads)

    def view(self, rows: NumberedTable) -> RowsAndDrive:
        response = self._response
        before = None if rows.before is None else response.without_inputs(rows.before)
        without = rows._replace(table=response.without_roles(rows.table), before=before, whole=None)
        return RowsAndDrive(without, response.drive(rows.table))

    def start(self, rows: NumberedTable, sample: ForecastSample, adapt: str | None) -> RollingWithoutResponse:
        rolling, per_week = self._member.start(rows, sample, adapt), 7 * rows_per_day(rows.table.step)
        return RollingWithoutResponse(self._response, self._member.view, rolling, per_week)


class RollingWithoutResponse:
    """The member as it goes through rows from row 0 on."""

    def __init__(
        self, response: NetworkResponse, view: Callable[[NumberedTable], Any], rolling: RollingMember, per_week: int
    ) -> None:
        self._response, self._view_of, self._rolling, self._per_week = response, view, rolling, per_week
        self._row = 0  # the last row that it went through
        # what drove the rows before it, and the response [K]
        self._drive, self._past = np.empty((0, len(response.mean))), np.empty(0)
        self._states = response.simulate(self._drive)  # of the network from that row on
        self._shift = 0.0  # taken off a later network's response, so that its level stays [K]
        self._rows: RowsAndDrive | None = None  # as last seen
        self._view: Any = None
        self._first = 0  # row of the first state

    @property
    def errors(self) -> np.ndarray:
        return self._rolling.errors

    def follow(self, network: RollingNetwork) -> None:
        """Take the response of a network that was fitted again, from now on and for all rows so far."""
        if np.array_equal(network.psi, self._response.rest.psi):
            return
        self._settle()
        self._response = self._response.at(network.psi, network.coefs()[0])
        states = self._response.simulate(self._drive)
        past, recent = self._response.output(states[:-1]), slice(-self._per_week, None)
        self._shift = float(np.mean(past[recent] - self._past[recent])) if len(past) else 0.0
        self._past, self._states, self._rows = past - self._shift, states[-1:], None

    def _settle(self) -> None:
        """Keep what is known of the rows before the last one."""
        n = self._row - self._first
        if n and self._rows is not None:
            begin = self._first - self._rows.rows.first
            self._drive = np.concatenate([self._drive, self._rows.drive[begin : begin + n]])
            self._past = np.append(self._past, self._output(self._states[:n]))
        self._states, self._first = self._states[n:], self._row

    def _output(self, states: np.ndarray) -> np.ndarray:
        return self._response.output(states) - self._shift

    def _take(self, rows: RowsAndDrive) -> Any:
        """The rows as the member takes them; those after the last one may differ from those seen before."""
        if rows is not self._rows:
            self._settle()
            first = rows.rows.first
            self._states = self._response.simulate(rows.drive[self._row - first :], self._states[0])
            response = np.append(self._past, self._output(self._states[:-1]))[first:]
            self._rows, self._view = rows, self._view_of(rows.rows._replace(T=rows.rows.T - response))
        return self._view

    def advance(self, view: RowsAndDrive, origin: int) -> None:
        self._rolling.advance(self._take(view), origin)
        self._row = origin

    def solve(self) -> None:
        self._rolling.solve()

    def forecast(self, view: RowsAndDrive, n_leads: int, clipped: bool = True) -> tuple[np.ndarray, np.ndarray | None]:
        paths, zeta = self._rolling.forecast(self._take(view), n_leads, clipped)
        return paths + self._ahead(view, n_leads), zeta

    def _ahead(self, view: RowsAndDrive, n_leads: int) -> np.ndarray:
        """(n_leads,) response after the last row [K]; after the last known row it is held."""
        states = self._states[self._row - self._first + 1 :][:n_leads]
        if len(states) < n_leads:
            held = np.tile(view.drive[-1], (n_leads - len(states), 1))
            states = np.concatenate([states, self._response.simulate(held, self._states[-1])[1:]])
        return self._output(states)

    def gain(self, plan: Plan) -> np.ndarray:
        return self._rolling.gain(plan) + self._response.gain(plan.inputs, plan.values)

    def fork(self, first: int) -> Self:
        made = shallow_copy(self)  # its parts are replaced, never changed
        made._rolling = self._rolling.fork(first)
        return made
