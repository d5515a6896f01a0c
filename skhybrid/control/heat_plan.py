"""Plans of a controller: the inputs that it decides on, and how far training covered what is planned."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import ZoneTable, is_plant, listed
from .._time import refuse_other_stamps
from .._warnings import several, warn_once, warn_user
from ..exceptions import PlanWarning

_BEYOND = 0.05  # share of the range of training by which a plan may leave it without a warning
_MEMBERS = ("blend", "network")


class Plan(NamedTuple):
    """Inputs that are decided for the rows ahead; 0 where nothing is planned."""

    inputs: tuple[str, ...]  # roles
    values: np.ndarray  # (H, m) [kW, or stages]

    @classmethod
    def of(cls, table: ZoneTable, inputs: Sequence[str], n_rows: int) -> Plan:
        """The plan in the last rows of a table."""
        values = [table.inputs[role][table.n_rows - n_rows :] for role in inputs]
        return cls(tuple(inputs), np.column_stack(values) if values else np.empty((n_rows, 0)))


def decided_on(roles: Iterable[str]) -> tuple[str, ...]:
    """Heating and cooling among the roles of training; refused where there is none."""
    plant = tuple(filter(is_plant, roles))
    if not plant:
        raise ValueError("the training table has no heating or cooling to decide on; give u_heat or Q_hvac to fit.")
    return plant


def read_inputs(
    inputs: Any, trained: Sequence[str], column_of: Callable[[str], Any], boundaries: Sequence[str] = ()
) -> tuple[str, ...]:
    """Roles of the inputs of a plan, given by role or column: those of training's plant, and some ``boundaries``.

    None: all heating and cooling.
    """
    if inputs is None:
        return decided_on(trained)
    names = [inputs] if isinstance(inputs, str) else inputs
    plant = [role for role in trained if is_plant(role) or role in boundaries]
    if not isinstance(names, list | tuple) or not names or len(set(map(str, names))) < len(names):
        raise ValueError(f"inputs={inputs!r} must be a list of different names, such as {plant!r}.")
    by_name = {**{column_of(role): role for role in plant}, **{role: role for role in plant}}
    for name in names:
        if not isinstance(name, str) or name not in by_name:
            what = "is neither heating nor cooling" if name in trained else "was not in the training table"
            raise ValueError(
                f"inputs names {name!r}, which {what}; the training had heating and cooling {listed(plant)}."
            )
    roles = tuple(by_name[name] for name in names)
    if len(set(roles)) < len(roles):
        raise ValueError(f"inputs={inputs!r} names a role and its column, which are one input; give one of them.")
    return roles


def refuse_boundary(boundary: Mapping[str, Any], allowed: Sequence[str], shape: tuple[int, int]) -> None:
    """Refuse boundary temperatures that the network does not have, or that are not finite (n_origins, n_leads)."""
    for role, values in boundary.items():
        if role not in allowed:
            raise ValueError(f"boundary names {role!r}; the network's are {listed(allowed)}.")
        if np.shape(values) != shape or not np.isfinite(values).all():
            raise ValueError(
                f"boundary gives {role!r} values of the shape {np.shape(values)}; give a finite temperature for each "
                f"of {shape[0]} origins and {shape[1]} leads."
            )


def read_member(member: Any) -> str:
    """The model whose forecast is wanted: "blend" or "network"; any other is refused."""
    if not isinstance(member, str) or member not in _MEMBERS:
        raise ValueError(f"member={member!r} is neither 'blend' nor 'network'.")
    return member


def planned(future: Any, inputs: Sequence[str], column_of: Callable[[str], Any]) -> tuple[Any, list[str]]:
    """Rows ahead in which every input has a value, 0 where there is none, and the inputs that had one."""
    if isinstance(future, ZoneTable):
        given = [role for role in inputs if role in future.inputs]
        off = {role: np.zeros(future.n_rows) for role in inputs if role not in given}
        return (future.replace(inputs={**future.inputs, **off}) if off else future), given
    given, filled = [role for role in inputs if column_of(role) in future], future.copy()
    for role in inputs:
        if role not in given:
            filled[column_of(role)] = 0.0
    return filled, given


def _covered_by(training: Mapping[str, np.ndarray], inputs: Sequence[str]) -> np.ndarray:
    """(m, 2) least and most of each input in training, and 0."""
    return np.array([[min(0.0, training[r].min()), max(0.0, training[r].max())] for r in inputs]).reshape(-1, 2)


def warn_uncovered(plan: Plan, given: Sequence[str], training: Mapping[str, np.ndarray]) -> None:
    """Warn of a plan that leaves what training covered, of the inputs that were given."""
    for role, values, (low, high) in zip(plan.inputs, plan.values.T, _covered_by(training, plan.inputs), strict=True):
        margin = _BEYOND * (high - low) + 1e-9
        n_beyond = int(((values < low - margin) | (values > high + margin)).sum())
        if role in given and n_beyond:
            warn_user(
                f"the plan has {role} outside of the range that training covered, {low:.4g} to {high:.4g}, in "
                f"{n_beyond} of {len(values)} rows ahead: its effect there is extrapolated.",
                PlanWarning,
            )


def warn_bent(plan: Plan, bent: np.ndarray | bool, training: Any) -> None:
    """Warn of the inputs, ``bent`` (m,) bool, in which the forecast is not affine, once per record of a training."""
    for role in np.array(plan.inputs, dtype=object)[bent]:
        warn_once(
            f"the heat of {role} bends with its stage at part load, so that the forecast is not affine in it: the gain "
            "is the tangent at the plan in future, and a state space holds the bends of that plan.",
            PlanWarning,
            training,
        )


def limits_of(stages: Mapping[str, float], training: Mapping[str, np.ndarray], inputs: Sequence[str]) -> np.ndarray:
    """(m, 2) least and most of each input: of a stage 0 and its highest value, of heat what training covered."""
    own = zip(inputs, _covered_by(training, inputs), strict=True)
    return np.array([(0.0, stages[role]) if role in stages else ends for role, ends in own]).reshape(-1, 2)


def as_plan(q: Any, inputs: Sequence[str], index: pd.Index) -> np.ndarray:
    """A plan of inputs as an array (H, m) for the rows of a forecast; refused with another shape, stamps, or gaps."""
    shape = len(index), len(inputs)
    if q is None:
        raise ValueError("the plan is None; look at the status of the solver that made it.")
    if isinstance(q, pd.Series | pd.DataFrame):
        refuse_other_stamps(q, index, "the plan", "future")
    if isinstance(q, pd.DataFrame) and set(q) == set(inputs):
        q = q[list(inputs)]
    elif isinstance(q, pd.DataFrame) and shape[1] > 1 and any(isinstance(name, str) for name in q):
        raise ValueError(f"the plan has the columns {listed(q)}; give it those of the inputs, {listed(inputs)}.")
    try:
        values = np.asarray(q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the plan is not numeric ({error}); give numbers.") from None
    if values.shape != shape and (values.ndim != 1 or shape[1] != 1 or len(values) != shape[0]):
        raise ValueError(
            f"the plan has shape {values.shape}, but there are {shape[0]} rows from {index[0]} to {index[-1]} and "
            f"{several(shape[1], 'input')}; give a value per row and input, and more rows in future for a longer "
            "horizon."
        )
    values = values.reshape(shape)
    if (unknown := ~np.isfinite(values).all(axis=1)).any():
        raise ValueError(
            f"the plan contains NaN or inf (first at {index[int(np.argmax(unknown))]}); give a number for every row, 0 "
            "where a plant is off."
        )
    return values
