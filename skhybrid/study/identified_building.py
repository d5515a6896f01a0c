"""An identified building: its parameters, and what an engineer calls them, with remarks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from .doubts import ends_of, in_words
from .settings import is_scaled

_NOT = "not identified"  # beginning of the remarks on values that the log does not determine
NOT_IDENTIFIED = f"{_NOT}: the log does not determine it"
UNSCALED = f"{_NOT}: no capacity of the plant is known"
NEIGHBOUR = "T_za_"  # beginning of the roles of room temperatures in a building, a room's own and its neighbours'
UNSURE, _UNKNOWN = 0.3, 1.0  # relative standard errors above which a value is uncertain, or not identified
#: what a room's values usually are; a value outside is worth a look
_USUAL = {"heat loss": (5.0, 5000.0), "solar aperture": (0.0, 100.0), "time constant": (0.1, 500.0)}


def describe(gray_box: Any) -> pd.DataFrame:
    """Describe a fitted gray box.

    The heat loss is that of the zone held at one temperature, from the steady state of its network; standard errors
    come from the parameters' covariance by first-order differences.
    """
    rows, doubtful = {}, not_identified(gray_box)
    for name, value, std in with_errors(gray_box, lambda theta: quantities(gray_box, theta)).itertuples():
        quantity, _, unit = name.removesuffix("]").rpartition(" [")
        relative = unit != "h" and not has_scale(gray_box)
        remark = UNSCALED if relative else remark_on(name, value, std)
        remark = doubtful.get(quantity.rpartition(" ")[2]) or remark
        rows[quantity] = {"value": value, "std": std, "unit": unit, "remark": remark}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("quantity")


def with_errors(gray_box: Any, of: Callable[[pd.Series], dict[str, float]]) -> pd.DataFrame:
    """Quantities ``of`` the parameters of a gray box, by name: ``value``, and ``std`` by the delta method.

    ``std`` is NaN without a covariance.
    """
    theta = pd.Series(gray_box.theta_, dtype=np.float64)
    base = pd.Series(of(theta), dtype=np.float64)
    cov = np.asarray(getattr(gray_box, "theta_cov_", np.nan), dtype=np.float64)
    if not np.isfinite(cov).any():
        return pd.DataFrame({"value": base, "std": np.nan})
    slopes = np.zeros((len(base), len(theta)))
    for j, value in enumerate(theta):
        small = 1e-4 * abs(value) or 1e-8
        moved = of(theta + small * (np.arange(len(theta)) == j))
        slopes[:, j] = (pd.Series(moved, dtype=np.float64).reindex(base.index) - base) / small
    slopes = np.nan_to_num(slopes)
    with np.errstate(invalid="ignore", over="ignore"):
        variance = np.nansum((slopes @ np.nan_to_num(cov)) * slopes, axis=1)
        return pd.DataFrame({"value": base, "std": np.sqrt(np.maximum(variance, 0.0))})


def discrete(gray_box: Any, theta: pd.Series, step: float) -> tuple[np.ndarray, np.ndarray, list[str], int]:
    """``A``, ``B`` over a step [h], the names of the inputs, and the position of the measured node."""
    network, names = gray_box.network_, list(gray_box.state_space_.input_names)
    d = network.discrete(dict(theta), tuple(n for n in names if n not in network.gain_names), step)
    return np.asarray(d.A), np.asarray(d.B), names, network.nodes.index(network.measured_nodes[0])


def quantities(gray_box: Any, theta: pd.Series) -> dict[str, float]:
    """Quantities of a network as an engineer names them, with units in their names."""
    step = gray_box.sampling_time_ / pd.Timedelta("1h")
    A, B, names, zone = discrete(gray_box, theta, step)
    steady = np.linalg.solve(np.eye(len(A)) - A, B)
    out = {}
    per_kw = steady[zone, names.index(gray_box.network_.gain_names[0])]
    out["heat loss [W/K]"] = 1000.0 / per_kw
    others = [k for k, name in enumerate(names) if str(name).startswith(NEIGHBOUR)]
    if others:  # the rest goes to the neighbours
        out["heat loss [W/K]"] *= 1.0 - float(steady[zone, others].sum())
    poles = np.sort(np.linalg.eigvals(A).real)
    for i, pole in enumerate(poles[(poles > 0) & (poles < 1)][::-1], 1):
        out[f"time constant {i} [h]"] = -step / np.log(pole)
    sun = [k for k, name in enumerate(names) if str(name).startswith("q_sol")]
    if sun:
        out["solar aperture [m2]"] = float(steady[zone, sun].sum()) / per_kw
    for name, value in theta.items():
        if str(name).startswith("Q_"):
            out[f"capacity {name} [kW]"] = float(value)
        if str(name).startswith("C_"):
            out[f"heat capacity {name} [kWh/K]"] = float(value)
    return out


def has_scale(gray_box: Any) -> bool:
    """Whether the kW of a gray box have a scale; time constants need none."""
    return is_scaled(gray_box.state_space_.input_names, gray_box.known or ())


def remark_on(name: str, value: float, std: float) -> str:
    """A remark on an uncertain or implausible value; "" on others."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.float64(std) / abs(value)
    usual = next((span for begin, span in _USUAL.items() if name.startswith(begin)), (-np.inf, np.inf))
    if relative > _UNKNOWN:
        return NOT_IDENTIFIED
    if not usual[0] <= value <= usual[1]:
        return f"implausible: a room or a building has {usual[0]:g} to {usual[1]:g}"
    return "uncertain" if relative > UNSURE else ""


def parameter_table(gray_box: Any) -> pd.DataFrame:
    """Identified parameters with units, standard errors, bounds and a remark on each doubtful one."""
    table = pd.DataFrame({"value": gray_box.theta_, "std": gray_box.theta_std_})
    searched = {p.name: p for p in gray_box.parameters_}
    for column in ("unit", "lower", "upper", "description"):
        table[column] = [getattr(searched[str(name)], column) for name in table.index]
    table["description"] = table["description"].map(in_words)
    relative = (table["std"] / table["value"].abs()).to_numpy(dtype=float)
    remark = np.select([relative > _UNKNOWN, relative > UNSURE], [NOT_IDENTIFIED, "uncertain"], "")
    scaled = [] if has_scale(gray_box) else [name for name in table.index if str(name)[0] in "CRAQ"]
    special = (
        dict.fromkeys(scaled, UNSCALED)
        | not_identified(gray_box)
        | dict.fromkeys(gray_box.known or (), "given, not identified")
    )
    table["remark"] = [special.get(str(name), text) for name, text in zip(table.index, remark, strict=True)]
    return table.rename_axis("parameter")


def identified_only(table: pd.DataFrame) -> pd.DataFrame:
    """The table without the values and standard errors of what was not identified."""
    known = ~table["remark"].astype(str).str.startswith(_NOT)
    return table.assign(value=table["value"].where(known), std=table["std"].where(known))


def not_identified(gray_box: Any) -> dict[str, str]:
    """Remarks on the parameters at an end of their range, and on those that nothing in the log moved."""
    found = {p.name: f"{_NOT}: at the {end} end of its range" for p, end in ends_of(gray_box)}
    idle = getattr(getattr(gray_box, "identifiability_", None), "not_excited", ())
    return found | dict.fromkeys(idle, f"{_NOT}: nothing in the log moved it")
