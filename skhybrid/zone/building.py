"""A building as an engineer describes it: heat loss, time constants, solar aperture, with remarks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from ..study.compared_models import make_gray_box
from ..study.data import FACADES
from ..study.settings import Settings
from .zone_model import complete_rows

_DAYS = 56
_UNSURE, _UNKNOWN = 0.3, 1.0  # relative standard errors above which a value is uncertain, or not identified
#: what a room's values usually are; a value outside is worth a look
_USUAL = {"heat loss": (5.0, 5000.0), "solar aperture": (0.0, 100.0), "time constant": (0.1, 500.0)}


def describe_building(settings: Settings, frame: pd.DataFrame) -> pd.DataFrame:
    """Identify the network of the settings on the last weeks of a log, and describe it.

    Parameters
    ----------
    settings : Settings
    frame : DataFrame, one column per role

    Returns
    -------
    DataFrame
        Index: quantity; ``value``, ``std``, ``unit`` and ``remark``.
    """
    return describe(identify_building(settings, frame))


def identify_building(settings: Settings, frame: pd.DataFrame) -> Any:
    """The gray box of the settings, fitted on the last weeks of a log."""
    rows = complete_rows(frame)
    rows = rows[rows.index > rows.index[-1] - pd.Timedelta(days=_DAYS)]
    columns = [c for c in rows if str(c) not in (f"q_sol_{name}" for name in FACADES)]
    return make_gray_box(settings).fit(rows[columns], rows["T_za"])


def describe(gray_box: Any) -> pd.DataFrame:
    """Describe a fitted gray box.

    The heat loss is that of the zone held at one temperature, from the steady state of its network; standard errors
    come from the parameters' covariance by first-order differences.
    """
    rows = {}
    for name, value, std in with_errors(gray_box, lambda theta: quantities(gray_box, theta)).itertuples():
        unit = name.rpartition(" [")[2].removesuffix("]")
        rows[name.rpartition(" [")[0]] = {"value": value, "std": std, "unit": unit, "remark": _remark(name, value, std)}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("quantity")


def with_errors(gray_box: Any, of: Callable[[pd.Series], dict[str, float]]) -> pd.DataFrame:
    """Quantities of a fitted gray box by name: ``value``, and ``std`` by the delta method; NaN without a covariance.

    Parameters
    ----------
    gray_box : fitted estimator
    of : callable, from the parameters to the quantities
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
    """``A``, ``B`` over a step [h], the names of the inputs, and the position of the zone's temperature."""
    network, names = gray_box.network_, list(gray_box.state_space_.input_names)
    d = network.discrete(dict(theta), tuple(n for n in names if n not in network.gain_names), step)
    zone = network.states.index("T_za") if "T_za" in network.states else len(network.states) - 1
    return np.asarray(d.A), np.asarray(d.B), names, zone


def quantities(gray_box: Any, theta: pd.Series) -> dict[str, float]:
    """What an engineer calls the quantities of a network with some parameters, with units in their names."""
    step = gray_box.sampling_time_ / pd.Timedelta("1h")
    A, B, names, zone = discrete(gray_box, theta, step)
    steady = np.linalg.solve(np.eye(len(A)) - A, B)
    out = {}
    per_kw = steady[zone, names.index(gray_box.network_.gain_names[0])]
    out["heat loss [W/K]"] = 1000.0 / per_kw
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


def _remark(name: str, value: float, std: float) -> str:
    """What to think of a value."""
    relative = std / abs(value) if value else np.inf
    usual = next((span for begin, span in _USUAL.items() if name.startswith(begin)), (-np.inf, np.inf))
    if np.isfinite(relative) and relative > _UNKNOWN:
        return "not identified: the log does not tell it"
    if not usual[0] <= value <= usual[1]:
        return "implausible for a room or a building"
    return "uncertain" if np.isfinite(relative) and relative > _UNSURE else ""
