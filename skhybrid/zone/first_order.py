"""The first-order law of EMHASS that comes nearest to a thermal network over a plan's hours.

EMHASS (docs/thermal_model.md, version 0.18) plans with

    T[k+1] = T[k] + S dt heating_rate P[k] / P_nom - dt cooling_constant (T[k] - T_oa[k]),

so under nominal power it warms by ``heating_rate / cooling_constant * (1 - (1 - dt cooling_constant)**k)`` in k steps.
A network warms by g[k], and by g[inf] in the end.  A zone that was held warm loses the share ``g[k] / g[inf]`` of its
excess when its heat goes off; ``cooling_constant`` is fitted to that, and ``heating_rate`` then to g itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.signal import dlsim

from ..study.identified_building import discrete


class Law(NamedTuple):
    """EMHASS's law of a zone."""

    heating_rate: float  # at nominal power [K/h]
    cooling_constant: float  # [1/h]


def first_order(warmed: np.ndarray, final: float, step: float) -> Law:
    """The law of a zone that nominal power warms by ``warmed`` (n,) after each step [h], by ``final`` at last [K]."""
    k, share = np.arange(1, len(warmed) + 1), warmed / final
    begin = np.clip((1.0 - share[-1]) ** (1.0 / len(k)), 1e-6, 1.0 - 1e-9)
    found = least_squares(  # in what remains after a step
        lambda r: 1.0 - r[0] ** k - share,
        [begin],
        jac=lambda r: (-k * r[0] ** (k - 1.0))[:, None],
        bounds=(0.0, 1.0),
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    shape = 1.0 - found.x[0] ** k
    cooling_constant = float(1.0 - found.x[0]) / step
    return Law(cooling_constant * float(warmed @ shape / (shape @ shape)), cooling_constant)


def temperatures(law: Law, power: np.ndarray, T_oa: np.ndarray, start: float, step: float) -> np.ndarray:
    """Temperatures [degC] after each step [h] by EMHASS's law, from ``start`` on.

    ``power`` (n,) is the share of nominal power, negative where it cools, and ``T_oa`` (n,) [degC], of each step.
    """
    out, T = np.empty(len(power)), start
    for i, (share, outside) in enumerate(zip(power, T_oa, strict=True)):
        T = T + step * (law.heating_rate * share - law.cooling_constant * (T - outside))
        out[i] = T
    return out


def warming(
    gray_box: Any, theta: pd.Series, nominal: dict[str, float], step: float, n_steps: int
) -> tuple[np.ndarray, float]:
    """Warming of the zone by a plant at nominal power [K]: after each step [h], and in the end.

    ``theta`` are parameters of the gray box's network; ``nominal`` is a stage of 1 or the heat [kW] by role.
    """
    A, B, names, zone = discrete(gray_box, theta, step)
    given = B[:, [names.index(role) for role in nominal]] @ np.array(list(nominal.values()))
    system = A, given[:, None], np.eye(len(A))[[zone]], np.zeros((1, 1)), step
    _, warmed, _ = dlsim(system, np.ones(n_steps + 1))
    return warmed[1:, 0], float(np.linalg.solve(np.eye(len(A)) - A, given)[zone])
