"""Forecasts that are affine in the heat of a plan, and the discrete model that gives them: arrays for optimisers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..filtering import simulate_path
from .heat_plan import as_plan


@dataclass(frozen=True, eq=False, repr=False)  # arrays have no equality, and are long
class AffineForecast:
    """A forecast by the rows of a plan, ``T = free + gain @ q``.

    For m inputs of one column each, ``T[i] = free[i] + sum_jk gain[i, j, k] q[j, k]``.  Where several nodes of a
    network are measured, ``free`` and ``gain`` have a last axis of that length, as ``zeta`` has of the disturbed ones.

    Attributes
    ----------
    free : ndarray of shape (H,)
        Temperature at each stamp with every input at 0 [degC].
    gain : ndarray of shape (H, H, m)
        Change of the temperature at stamp i by a unit of an input over the step that begins at stamp j [K per kW, or K
        per stage]; 0 unless j is before i.
    zeta : ndarray of shape (H,)
        Forecast disturbance over the step that begins at each stamp [kW, or K for an output disturbance].
    index : Index of length H
        Stamps, those of the rows ahead.
    inputs : tuple of str
        Roles of the inputs, in the order of the gain's last axis.
    offsets : ndarray of shape (H, n_quantiles), optional
        Quantiles of the temperature less the forecast itself [K].
    """

    free: np.ndarray
    gain: np.ndarray
    zeta: np.ndarray
    index: pd.Index
    inputs: tuple[str, ...]
    offsets: np.ndarray | None = None

    def __repr__(self) -> str:
        return _spelt(self)

    def temperature(self, q: np.ndarray) -> np.ndarray:
        """Temperature under a plan.

        Parameters
        ----------
        q : array-like of shape (H, m), or (H,) of one input
            Inputs over the step of each row [kW, or stages], of a DataFrame by the names of the roles.

        Returns
        -------
        ndarray of shape (H,)
            At each stamp [degC]; with a last axis where several nodes are measured.

        Raises
        ------
        ValueError
            If the plan has another shape or other time stamps, or lacks a number.
        """
        plan = as_plan(q, self.inputs, self.index)
        return self.free + np.tensordot(self.gain, plan, axes=((1, 2), (0, 1)))


@dataclass(frozen=True, eq=False, repr=False)  # arrays have no equality, and are long
class ControlModel:
    """A discrete model of the rows ahead: ``x[k+1] = A x[k] + B u[k] + forcing[k]``, ``T[k] = C x[k]``.

    Row k is the k-th row ahead; ``T[k]`` is the temperature at its stamp and ``u[k]`` acts over the step that begins
    there.  All are plain arrays, and A, B and C do not change with time: schedules of conductance are heat that depends
    on the outdoor temperature alone, and stand in ``forcing``.

    Attributes
    ----------
    A : ndarray of shape (n, n)
    B : ndarray of shape (n, m)
    C : ndarray of shape (o, n)
        One row per measured node.
    x0 : ndarray of shape (n,)
        State at the first row: temperatures of the nodes [degC], and of an emitter the heat that it gives off [kW].
    forcing : ndarray of shape (H, n)
        Effect of weather, schedules and unmeasured heat over each row's step.
    inputs : tuple of str
        Roles of the inputs [kW, or stages].
    limits : ndarray of shape (m, 2)
        Least and most of each input: of a stage 0 and its highest value, of measured heat what training covered.
    states : tuple of str
    index : Index of length H
    sampling_time : Timedelta
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    x0: np.ndarray
    forcing: np.ndarray
    inputs: tuple[str, ...]
    limits: np.ndarray
    states: tuple[str, ...]
    index: pd.Index
    sampling_time: pd.Timedelta

    def __repr__(self) -> str:
        return _spelt(self)

    def simulate(self, u: np.ndarray) -> np.ndarray:
        """Simulate the temperature under inputs.

        Parameters
        ----------
        u : array-like of shape (H, m), or (H,) of one input
            As in :meth:`AffineForecast.temperature`.

        Returns
        -------
        ndarray of shape (H + 1, o)
            At the stamp of each row and at the end of the last one [degC].

        Raises
        ------
        ValueError
            If the inputs have another shape or other time stamps, or lack a number.
        """
        plan = as_plan(u, self.inputs, self.index)
        return simulate_path(self.A, self.forcing + plan @ self.B.T, self.x0) @ self.C.T


def _spelt(made: AffineForecast | ControlModel) -> str:
    first, last = made.index[[0, -1]]
    return f"{type(made).__name__}({len(made.index)} rows from {first} to {last}, inputs={made.inputs})"


class LinearNetwork(NamedTuple):
    """A network at one row: from there on ``x[k+1] = A x[k] + B u[k] + forcing[k]``."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, m)
    C: np.ndarray  # (o, n)
    state: np.ndarray  # (n,) before the inputs of the row act
    forcing: np.ndarray  # (N, n) by all but the inputs
    states: tuple[str, ...]
    bent: np.ndarray | bool = False  # (m,) inputs with bends, which are in the forcing

    def after(self, u: np.ndarray) -> LinearNetwork:
        """The same from the next row on, after inputs (m,) of this one."""
        state = self.A @ self.state + self.B @ u + self.forcing[0]
        return self._replace(state=state, forcing=self.forcing[1:])

    def measured(self, T_za: np.ndarray) -> LinearNetwork:
        """With the measured temperatures (o,) in place of the estimated ones; what follows stays as it is.

        The first forcing takes up the difference.
        """
        state, forcing = self.state.copy(), self.forcing.copy()
        state[self.C.argmax(axis=1)] += T_za - self.C @ state
        forcing[0] += self.A @ (self.state - state)
        return self._replace(state=state, forcing=forcing)


def impulse_response(A: np.ndarray, B: np.ndarray, C: np.ndarray, n: int) -> np.ndarray:
    """(n, m, o) outputs after 1, 2 ... n steps of a unit of each input over one step: ``C A^k B``."""
    nothing = np.zeros((n - 1, len(A)))
    return np.stack([simulate_path(A, nothing, b) @ C.T for b in np.ascontiguousarray(B.T)], axis=1)


def gain_of(response: np.ndarray) -> np.ndarray:
    """(n, n, ...) gain of row i by an input over row j, from the response (n, ...) after 1, 2 ... steps."""
    n = len(response)
    lag = np.arange(n)[:, None] - np.arange(n) - 1
    return np.where((lag >= 0).reshape(n, n, *[1] * (response.ndim - 1)), response[np.maximum(lag, 0)], 0.0)
