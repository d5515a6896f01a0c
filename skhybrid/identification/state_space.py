"""Discrete state-space model of a network, and its frequency and step responses, exact at its own step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .._arguments import check_integer
from .._time import positive_duration, read_duration, rows_covering, spell
from ..filtering import simulate_path
from ..thermal import RCNetwork, get_network
from ..thermal.declaration import as_names
from ..thermal.parameters import check_known
from .disturbance_models import measured_states

_ROLES = ("T_oa", "q_sol", "u_heat", "u_cool")  # inputs of the paper's network


@dataclass(frozen=True)
class StateSpace:
    """Discrete state-space model ``x[k+1] = A x[k] + B v[k]``, ``y[k] = C x[k] + D v[k]``.

    Attributes
    ----------
    A, B, C, D : ndarray
        Of shape (n, n), (n, m), (o, n) and (o, m), with one output row per measured node.
    state_names, input_names : tuple of str
        Units are those of the data contract; the last inputs are the heat gains [kW] of the disturbed nodes.
    sampling_time : Timedelta
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    sampling_time: pd.Timedelta


def checked_theta(network: RCNetwork, theta: Mapping[str, float], roles: Iterable[str]) -> dict[str, float]:
    """The value of every parameter under the given inputs; refused where one is absent or impossible."""
    parameters = network.parameters(roles)
    if absent := [p.name for p in parameters if p.name not in theta]:
        raise ValueError(
            f"theta lacks {', '.join(absent)}: network {network.name} needs a value of each under the inputs "
            f"{', '.join(roles)}."
        )
    check_known(parameters, theta, "theta", may_be_0=("-", "m2", "kW"))
    return {p.name: float(theta[p.name]) for p in parameters}


def state_space_of(
    network: RCNetwork, theta: Mapping[str, float], roles: tuple[str, ...], step: pd.Timedelta
) -> StateSpace:
    """The exact zero-order hold of a network under the given inputs, with named rows and columns."""
    d = network.discrete(theta, roles, step / pd.Timedelta("1h"))
    C = np.eye(len(network.nodes))[measured_states(network)]
    names = (*network.inputs(roles), *network.gain_names)
    return StateSpace(d.A, d.B, C, np.zeros((len(C), len(names))), network.states, names, step)


def make_state_space(
    network: str | RCNetwork, theta: Mapping[str, float], *, roles: Iterable[str] = _ROLES, sampling_time: Any = "15min"
) -> StateSpace:
    """Discrete model of a network with given parameters, such as the true ones of a simulation.

    Parameters
    ----------
    network : str or RCNetwork
        A name of the catalogue, or a network of your own.
    theta : mapping of parameter to value
        Every parameter that the network has under these inputs, in the units of its parameter table.
    roles : iterable of str
        Inputs that act; the unmeasured ``heat_gain`` [kW] is added after them.
    sampling_time : timedelta-like, default="15min"
        Step of the exact zero-order hold.

    Returns
    -------
    StateSpace

    Raises
    ------
    ValueError
        If a parameter has no value, or an impossible one.

    Examples
    --------
    >>> from skhybrid.identification import frequency_response, make_state_space, step_response
    >>> shed = make_state_space("1R1C", {"C_za": 2.0, "R_zo": 5.0, "A_win": 1.0}, roles=["T_oa", "q_sol"])
    >>> shed.input_names
    ('T_oa', 'q_sol', 'heat_gain')
    >>> round(float(frequency_response(shed, ["365D"])["heat_gain"].abs().iloc[0]), 2)  # R_zo
    5.0
    >>> round(float(step_response(shed, "10h")["T_oa"].iloc[-1]), 3)  # after one time constant, 1 - 1/e
    0.632
    """
    network, roles = get_network(network), as_names(roles)
    step = positive_duration(sampling_time, "sampling_time")
    return state_space_of(network, checked_theta(network, theta, roles), roles, step)


def _read_model(model: Any, output: int) -> StateSpace:
    """A state-space model, given as such or that of a fitted identification, which has this output."""
    if not isinstance(model, StateSpace):
        if not hasattr(model, "simulate_states"):
            name = type(model).__name__
            raise ValueError(
                f"{name} is neither a StateSpace nor a fitted identification of a network; "
                "skhybrid.inspection.StepResponseDisplay draws a hybrid too, and a building by its own_."
            )
        model = model.to_state_space()
    check_integer("output", output, 0, len(model.C) - 1)
    return model


def frequency_response(model: Any, periods: Any = None, *, output: int = 0) -> pd.DataFrame:
    """Response of the measured temperature to a sinusoidal input of each period.

    Parameters
    ----------
    model : StateSpace or fitted identification
    periods : sequence of timedelta-like, optional
        Two steps of the model or longer; by default 200 from 10 minutes (or two steps) to 30 days, log-spaced.
    output : int, default=0
        Which measured temperature, for a model with several.

    Returns
    -------
    DataFrame of complex of shape (n_periods, n_inputs)
        Index ``period`` (Timedelta), columns the inputs: magnitude in K per unit of the input, phase [rad], negative
        where the temperature lags.

    Notes
    -----
    ``C (exp(2 pi i step / period) I - A)^-1 B + D``: exact for inputs sampled at the step and held over it.
    """
    model = _read_model(model, output)
    chosen = _read_periods(periods, model.sampling_time)
    z = np.exp(2j * np.pi * (model.sampling_time / chosen).to_numpy(dtype=np.float64))
    states = np.linalg.solve(z[:, None, None] * np.eye(len(model.A)) - model.A, model.B.astype(np.complex128)[None])
    return pd.DataFrame(model.C[output] @ states + model.D[output], index=chosen, columns=list(model.input_names))


def _read_periods(periods: Any, step: pd.Timedelta) -> pd.TimedeltaIndex:
    if periods is None:
        shortest = max(pd.Timedelta("10min"), 2 * step) / pd.Timedelta("1s")
        chosen = pd.to_timedelta(np.ceil(np.geomspace(shortest, 30 * 86400.0, 200)), unit="s")
    else:
        given = [periods] if not isinstance(periods, Iterable) or isinstance(periods, str) else periods
        chosen = pd.TimedeltaIndex([read_duration(p, "periods") for p in given])
    if len(chosen) and chosen.min() < 2 * step:
        raise ValueError(
            f"the period {chosen.min()} is shorter than two steps of the model ({spell(2 * step)}), which says nothing "
            "about it; ask for longer ones."
        )
    return pd.TimedeltaIndex(chosen, name="period").as_unit("ns")


def step_response(model: Any, duration: Any = "12h", *, output: int = 0) -> pd.DataFrame:
    """Response of the measured temperature to a unit step of each input, from rest.

    Parameters
    ----------
    model : StateSpace or fitted identification
    duration : timedelta-like, default="12h"
        Positive; rounded up to whole steps of the model.
    output : int, default=0
        Which measured temperature, for a model with several.

    Returns
    -------
    DataFrame of shape (n_steps + 1, n_inputs)
        Index ``time`` (Timedelta) since the step, columns the inputs; K per unit of the input.
    """
    model = _read_model(model, output)
    n_steps, inputs = rows_covering(duration, model.sampling_time, "duration"), range(len(model.input_names))
    start = np.zeros(len(model.A))
    paths = [simulate_path(model.A, np.tile(model.B[:, j], (n_steps, 1)), start) @ model.C[output] for j in inputs]
    time = pd.TimedeltaIndex(np.arange(n_steps + 1) * model.sampling_time, name="time").as_unit("ns")
    return pd.DataFrame(np.array(paths).T + model.D[output], index=time, columns=list(model.input_names))
