"""The heating and cooling that holds a set-point (paper Eqs. inverseQ1 and inverseQ2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._table import ZoneTable
from .._time import origin_rows
from ..control import Limits, Plant, is_plant, load_frame, read_limits, read_setpoint, steps_ahead
from ..filtering import simulate_inverse
from ..thermal import RCNetwork
from .experiment import Experiment
from .filtered_network import ForecastStart
from .gain_filter import GainFilter


class LoadMixin:
    """The loads of an identified network."""

    network_: RCNetwork
    theta_: pd.Series
    horizon: Any
    _plant: Plant
    _filter: GainFilter
    _roles: tuple[str, ...]
    _with_history: Callable[..., tuple[ZoneTable, int]]
    _experiment: Callable[[ZoneTable], Experiment]
    _measurements: Callable[[ZoneTable], np.ndarray]
    _forecast_start: Callable[..., ForecastStart]
    _given: Callable[..., ForecastStart]

    def predict_load(self, X: Any, setpoint: Any, limits: Any = None) -> pd.DataFrame:
        """Heating and cooling that brings the temperature to a set-point at the end of every row (paper Eq. inverseQ2).

        Heating and cooling columns of X are not read; the state is taken from the measurements at each origin, as in
        :meth:`predict`.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        setpoint : float, array-like of shape (n_samples,), pair or DataFrame of two columns
            Wanted temperature at each row's stamp [degC].  Or a thermostat's heating and cooling set-point over each
            row's step, as a pair ``(heat, cool)`` of numbers or of values by row, or as two columns: between the two
            there is no load, and None as one of a pair leaves that side free.
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; each a number or one value a row, such as 0 at hours when the
            plant is off.  The capacity of its stages holds beside them; where only its heat is measured there is no
            other limit.

        Returns
        -------
        DataFrame of length n_samples
            Stages [-] by role and ``Q_hvac`` [kW] over each row's step, clipped to what the plant can do, and ``T_za``
            [degC] at each row's stamp under them; stages and heat with ``_unclipped`` as the set-point would need.  Of
            stages that heat (or cool) alike, each takes its share of the capacity.

        Raises
        ------
        ValueError
            If a set-point or limit has another length or other stamps than X or a NaN, or if the lower of two is above
            the higher.

        Notes
        -----
        In a network whose plant heats another node than the measured one (a heater, a sensor that lags), the set-point
        at every step would need a load that swings from step to step.  There the load is sought as if held for the
        next few steps, so that the temperature comes near the set-point instead of meeting it at each row.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        origins, n = self._load_origins(table, n_tail)
        return self._load(table, n_tail, setpoint, origins, self._forecast_start(table, origins, n), limits)

    def required_heat(
        self, X: Any, setpoint: Any, origins: Any, disturbance: Any, kind: str = "input", limits: Any = None
    ) -> pd.DataFrame:
        """As :meth:`predict_load`, under a given disturbance.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        setpoint : float, array-like of shape (n_samples,), pair or DataFrame of two columns
            As in :meth:`predict_load`.
        origins : sequence of int
            Rows of X at which the state is taken from the measurements, beginning with 0.
        disturbance : array-like of shape (n_origins, n_leads)
            As in :meth:`drive`; long enough to reach the next origin.
        kind : {"input", "output"}
        limits : tuple of (lowest, highest), optional
            As in :meth:`predict_load`.

        Returns
        -------
        DataFrame of length n_samples
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        rows = np.asarray(origins, dtype=np.int64) + n_tail
        given = np.asarray(disturbance, dtype=np.float64)
        return self._load(table, n_tail, setpoint, rows, self._given(table, rows, given, kind), limits)

    def _load_origins(self, table: ZoneTable, n_tail: int) -> tuple[np.ndarray, int]:
        here = table.rows(slice(n_tail, None))
        origins = origin_rows(here.time, self.horizon, getattr(self, "origin_step", None), here.step)
        return origins + n_tail, int(np.diff(np.append(origins, here.n_rows)).max())

    def _load(
        self, table: ZoneTable, n_tail: int, setpoint: Any, origins: np.ndarray, outlook: ForecastStart, limits: Any
    ) -> pd.DataFrame:
        tracker = self._filter
        if len(tracker.measured) > 1 or tracker.n_gains > 1:
            raise ValueError(
                f"network {self.network_.name} has several zones, whose loads depend on one another; a load is "
                "predicted for one measured and disturbed node only."
            )
        here = table.rows(slice(n_tail, None))
        wanted = read_setpoint(setpoint, here)
        within = self._plant.within(read_limits(limits, here))
        unlimited = Limits(np.full(here.n_rows, -np.inf), np.full(here.n_rows, np.inf))
        effect = self._unit_heat(self.network_.nodes.index(self.network_.heated))
        c = np.eye(tracker.n)[tracker.measured[0]]
        ahead = steps_ahead(tracker.A, effect, c)
        inputs = self._without_plant(table)
        ends = np.append(origins[1:], table.n_rows)
        parts: list[list[np.ndarray]] = [[], [], []]
        for i, (a, b) in enumerate(zip(origins, ends, strict=True)):
            forcing = inputs[a:b] @ tracker.B.T + outlook.heat[i, : b - a] @ tracker.heat.T
            rows, offset = slice(a - n_tail, b - n_tail), outlook.offset[i, : b - a, 0]
            band = [side[rows] - offset for side in wanted]
            runs = [
                simulate_inverse(tracker.A, forcing, effect, c, *band, low[rows], high[rows], outlook.states[i], ahead)
                for low, high in (within, unlimited)
            ]
            for part, values in zip(parts, (runs[0][0], runs[1][0], runs[0][1] + offset), strict=True):
                part.append(values)
        measured = np.ravel(self._measurements(here))[:1]
        begin = np.where(np.isfinite(measured), measured, c @ outlook.states[0])
        clipped, unclipped, path = map(np.concatenate, parts)
        return load_frame(self._plant, here.index, clipped, unclipped, np.append(begin, path[:-1]))

    def _without_plant(self, table: ZoneTable) -> np.ndarray:
        """(N, m) inputs of the rows with nothing that heats or cools."""
        inputs = self._experiment(table).inputs.copy()
        for j, role in enumerate(self.network_.inputs(self._roles)):
            if is_plant(role):
                inputs[:, j] = 0.0
        return inputs

    def _unit_heat(self, node: int) -> np.ndarray:
        """Effect on the states of 1 kW over a step on a node."""
        names = [*self.network_.inputs(self._roles)]
        for source in self.network_.sources(self._roles):
            if source.role.startswith("Q_"):
                return self._filter.B[:, names.index(source.role)].copy()
        for source in self.network_.sources(self._roles):
            if source.role.startswith("u_") and source.parameter and self.theta_[source.parameter] != 0:
                return self._filter.B[:, names.index(source.role)] / self.theta_[source.parameter]
        if self.network_.nodes[node] == self.network_.disturbed:
            return self._filter.B[:, -1].copy()
        raise ValueError("the network has no heating or cooling input, so no load can be predicted.")
