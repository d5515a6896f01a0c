"""The heating and cooling that holds a set-point (paper Eqs. inverseQ1 and inverseQ2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._clock import origin_rows
from .._contract import ZoneTable
from .._kernels import simulate_inverse
from ..thermal import RCNetwork
from .experiment import Experiment
from .tracked import Outlook
from .tracking import GainTracker


class Plant(NamedTuple):
    """What heats and cools the zone, and how much of it there is."""

    heating: tuple[tuple[str, float], ...]  # (role, capacity [kW]) of the stages that heat
    cooling: tuple[tuple[str, float], ...]  # the same of those that cool, capacity < 0
    most: Mapping[str, float]  # highest stage of each role
    lower: float  # [kW], 0 or less; -inf where only the heat was measured
    upper: float  # [kW], 0 or more; inf where only the heat was measured

    def limited(self, limits: tuple[float, float] | None) -> Plant:
        """The same plant within other limits.

        Raises
        ------
        ValueError
            If the lower limit is not below the upper one.
        """
        if limits is None:
            return self
        lower, upper = float(limits[0]), float(limits[1])
        if not lower < upper:
            raise ValueError(f"limits=({lower}, {upper}) [kW]: the first is the lowest heat, below the second.")
        return self._replace(lower=lower, upper=upper)


def make_plant(network: RCNetwork, theta: Mapping[str, float], table: ZoneTable) -> Plant:
    """The plant of a training table: stages up to 1 or the highest seen; a measured heat tells of no limit."""
    capacity = {
        s.role: theta[s.parameter] for s in network.sources(table.inputs) if s.role.startswith("u_") and s.parameter
    }
    most = {role: max(1.0, float(table.inputs[role].max())) for role in capacity}
    heating = tuple((role, q) for role, q in capacity.items() if q > 0)
    cooling = tuple((role, q) for role, q in capacity.items() if q < 0)
    beyond = np.inf if any(role.startswith("Q_") for role in table.inputs) else 0.0
    lower = sum(q * most[role] for role, q in cooling) - beyond
    upper = sum(q * most[role] for role, q in heating) + beyond
    return Plant(heating, cooling, most, lower, upper)


def is_plant(role: str) -> bool:
    """Whether a role is heating or cooling."""
    return role.startswith(("u_", "Q_"))


def read_setpoint(setpoint: Any, table: ZoneTable) -> np.ndarray:
    """The set-point at the end of every row's step, (N,) [degC].

    Raises
    ------
    ValueError
        If it has another length or other stamps than X, or a NaN.
    """
    if isinstance(setpoint, pd.Series) and isinstance(table.index, pd.DatetimeIndex):
        if not setpoint.index.equals(table.index):
            raise ValueError("setpoint bears other time stamps than X; align it with setpoint.reindex(X.index).")
        setpoint = setpoint.to_numpy(dtype=np.float64)
    wanted = np.asarray(setpoint, dtype=np.float64)
    if wanted.ndim == 0:
        wanted = np.full(table.n_rows, float(wanted))
    if wanted.shape != (table.n_rows,):
        raise ValueError(f"setpoint has shape {wanted.shape}, but X has {table.n_rows} rows; give one value a row.")
    if not np.isfinite(wanted).all():
        row = int(np.argmax(~np.isfinite(wanted)))
        raise ValueError(f"setpoint contains NaN or inf (first at {table.index[row]}); fill it first.")
    return np.append(wanted[1:], wanted[-1])


def load_frame(plant: Plant, index: pd.Index, clipped: np.ndarray, unclipped: np.ndarray) -> pd.DataFrame:
    """Heat [kW] and the stages [-] that deliver it, clipped to the plant and as the set-point would need."""
    out: dict[str, np.ndarray] = {}
    for suffix, heat in (("", clipped), ("_unclipped", unclipped)):
        for side, stages in ((np.maximum, plant.heating), (np.minimum, plant.cooling)):
            wanted = side(heat, 0.0)
            full = sum(q * plant.most[role] for role, q in stages)
            for role, _ in stages:
                out[role + suffix] = wanted / full * plant.most[role]
    out["Q_hvac"], out["Q_hvac_unclipped"] = clipped, unclipped
    return pd.DataFrame(out, index=index)


class LoadMixin:
    """The loads of an identified network."""

    network_: RCNetwork
    theta_: pd.Series
    horizon: Any
    _plant: Plant
    _tracker: GainTracker
    _roles: tuple[str, ...]
    _with_history: Callable[..., tuple[ZoneTable, int]]
    _experiment: Callable[[ZoneTable], Experiment]
    _outlook: Callable[..., Outlook]
    _given: Callable[..., Outlook]

    def predict_load(self, X: Any, setpoint: Any, limits: tuple[float, float] | None = None) -> pd.DataFrame:
        """Heating and cooling that brings the temperature to a set-point at the end of every row (paper Eq. inverseQ2).

        Heating and cooling columns of X are not read; the state is taken from the measurements at each origin, as in
        :meth:`predict`.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        setpoint : float or array-like of shape (n_samples,)
            Wanted temperature at each row's stamp [degC].
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; by default the capacity of its stages, and no limit where only
            its heat is measured.

        Returns
        -------
        DataFrame of length n_samples
            Stages [-] by role and ``Q_hvac`` [kW], clipped to what the plant can do; the same with ``_unclipped`` as
            the set-point would need.  Of stages that heat (or cool) alike, each takes its share of the capacity.
        """
        check_is_fitted(self)
        table, n_tail = self._with_history(X)
        origins, n = self._load_origins(table, n_tail)
        return self._load(table, n_tail, setpoint, origins, self._outlook(table, origins, n), limits)

    def required_heat(
        self,
        X: Any,
        setpoint: Any,
        origins: Any,
        disturbance: Any,
        kind: str = "input",
        limits: tuple[float, float] | None = None,
    ) -> pd.DataFrame:
        """As :meth:`predict_load`, under a given disturbance.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        setpoint : float or array-like of shape (n_samples,)
            Wanted temperature at each row's stamp [degC].
        origins : sequence of int
            Rows of X at which the state is taken from the measurements, beginning with 0.
        disturbance : array-like of shape (n_origins, n_leads)
            As in :meth:`drive`; long enough to reach the next origin.
        kind : {"input", "output"}
        limits : tuple of (lowest, highest), optional
            What the plant can do [kW], cooling negative; by default the capacity of its stages, and no limit where only
            its heat is measured.

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
        self,
        table: ZoneTable,
        n_tail: int,
        setpoint: Any,
        origins: np.ndarray,
        outlook: Outlook,
        limits: tuple[float, float] | None,
    ) -> pd.DataFrame:
        tracker, plant = self._tracker, self._plant.limited(limits)
        if len(tracker.measured) > 1 or tracker.n_gains > 1:
            raise ValueError(
                f"network {self.network_.name} has several zones, whose loads depend on one another; a load is "
                "predicted for one measured and disturbed node only."
            )
        here = table.rows(slice(n_tail, None))
        target = np.concatenate([np.full(n_tail, np.nan), read_setpoint(setpoint, here)])
        inputs = self._experiment(table).inputs.copy()
        for j, role in enumerate(self.network_.inputs(self._roles)):
            if is_plant(role):
                inputs[:, j] = 0.0
        heated = self.network_.nodes.index(self.network_.heated)
        effect = self._unit_heat(heated)
        c = np.eye(tracker.n)[tracker.measured[0]]
        ends = np.append(origins[1:], table.n_rows)
        parts: list[list[np.ndarray]] = [[], []]
        for i, (a, b) in enumerate(zip(origins, ends, strict=True)):
            forcing = inputs[a:b] @ tracker.B.T + outlook.heat[i, : b - a] @ tracker.heat.T
            wanted = target[a:b] - outlook.offset[i, : b - a, 0]
            for part, (low, high) in zip(parts, ((plant.lower, plant.upper), (-np.inf, np.inf)), strict=True):
                part.append(simulate_inverse(tracker.A, forcing, effect, c, wanted, low, high, outlook.states[i]))
        return load_frame(plant, here.index, np.concatenate(parts[0]), np.concatenate(parts[1]))

    def _unit_heat(self, node: int) -> np.ndarray:
        """Effect on the states of 1 kW over a step on a node."""
        names = [*self.network_.inputs(self._roles)]
        for source in self.network_.sources(self._roles):
            if source.role.startswith("Q_"):
                return self._tracker.B[:, names.index(source.role)].copy()
        for source in self.network_.sources(self._roles):
            if source.role.startswith("u_") and source.parameter and self.theta_[source.parameter] != 0:
                return self._tracker.B[:, names.index(source.role)] / self.theta_[source.parameter]
        if self.network_.nodes[node] == self.network_.disturbed:
            return self._tracker.B[:, -1].copy()
        raise ValueError("the network has no heating or cooling input, so no load can be predicted.")
