"""The thermal parameters that users of EMHASS type in by hand, from an identified network with standard errors.

The law is the one that comes nearest to the network over a plan's hours.  EMHASS (docs/thermal_model.md, version 0.18)
plans with

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

from .._table import is_stage
from ..study.identified_building import UNSURE, discrete, quantities, with_errors
from ..study.plant_performance import Performance
from ..study.settings import Settings, is_scaled

_DENSITY, _HEAT_CAPACITY = 2400.0, 0.88  # of EMHASS's concrete [kg/m3], [kJ/(kg K)]
_LARGE = 0.99  # quantile of the logged heat that is its nominal power, where no setting gives it
_LONGEST = 8760.0  # hours of a plan
_SIGNS = {"heat": 1.0, "cool": -1.0}
_UNITS = {"heating_rate": "K/h", "cooling_constant": "1/h", "volume": "m3", "u_value": "W/(m2 K)", "window_area": "m2"}
_IN_KW = ("volume", "u_value", "window_area")
_OF_HEAT_PUMP = "supply_temperature, heating_curve and carnot_efficiency"
_BY_HAND = {
    "start_temperature, min_temperatures and max_temperatures": "they belong to each plan; fill them in when you call "
    "EMHASS",
    _OF_HEAT_PUMP: "a log of a room does not hold them; read them from "
    "the heat pump, or give cop in [plant], which becomes efficiency",
    "internal_gains_factor": "it needs the electricity of the household beside this log",
    "envelope_area, ventilation_rate and heated_volume": "a log holds only the heat loss of all together, which is "
    "written as u_value [W/K] with an area of 1 m2 and no ventilation",
    "density and heat_capacity": "a log holds only their product with volume, which is that of concrete here",
    "window_area and shgc": "a log holds only their product, which is written as window_area with a shgc of 1; "
    "EMHASS multiplies it with the irradiance on the horizontal",
}


class EmhassLaw(NamedTuple):
    """EMHASS's law of a zone."""

    heating_rate: float  # at nominal power [K/h]
    cooling_constant: float  # [1/h]


class EmhassExport(NamedTuple):
    """Parameters of a zone for EMHASS.

    Parameters
    ----------
    values : DataFrame
        Index: parameter; ``value``, ``std``, ``unit``, ``block`` and ``remark``.
    load : dict of block to parameters, as ``def_load_config`` of EMHASS takes them
    left_out : dict of parameters to the reason why they are not written
    nominal_power : float or None, electrical power at which the heating rate holds [W]
    misfit : float, difference between law and network over the hours at nominal power, root mean square [K]
    warmed : float, by how much the network warms (or cools) in these hours [K]
    """

    values: pd.DataFrame
    load: dict[str, dict[str, Any]]
    left_out: dict[str, str]
    nominal_power: float | None
    misfit: float
    warmed: float

    def runtime_parameters(self, block: str = "thermal_config") -> dict[str, Any]:
        """Return what EMHASS takes with a call, for one deferrable load.

        Parameters
        ----------
        block : {"thermal_config", "thermal_battery"}
        """
        if block not in self.load:
            raise ValueError(f"block={block!r} is not one of {', '.join(map(repr, self.load))}.")
        power = {} if self.nominal_power is None else {"nominal_power_of_deferrable_loads": [self.nominal_power]}
        return {"def_load_config": [{block: self.load[block]}], **power}


def check_plan(step: float, hours: float) -> None:
    """Refuse a plan [h] of less than two steps, or of more than a year."""
    if not (step > 0 and hours >= 2 * step):
        raise ValueError(f"a plan of {hours:g} h in steps of {step:g} h is too short; give two steps or more.")
    if hours > _LONGEST:
        raise ValueError(f"a plan of {hours:g} h is longer than a year; give hours that the load stays on at a time.")


def emhass_parameters(
    gray_box: Any,
    settings: Settings,
    rows: pd.DataFrame | None = None,
    *,
    sense: str = "heat",
    step: float = 0.5,
    hours: float = 6.0,
) -> EmhassExport:
    """The values of ``thermal_config`` and ``thermal_battery`` of EMHASS, each with its standard error.

    Parameters
    ----------
    gray_box : fitted estimator, with ``theta_cov_``
    settings : Settings
    rows : DataFrame, optional, the log it was identified on, by role
    sense : {"heat", "cool"}
    step : float, time step of the plan [h]
    hours : float
        How long heating goes on or off at a stretch [h]; the law, which has one time constant, is fitted to them.

    Raises
    ------
    ValueError
        If nothing heats (or cools), or no nominal heat is known.

    Notes
    -----
    :doc:`/how_to/emhass` derives heating rate and cooling constant.  EMHASS's storage takes heat without
    feedback (docs/thermal_battery.md), ``T[k+1] = T[k] + (COP P dt - demand[k]) / C``; its C is the one that warms as
    the network does over the hours, by least squares.  Standard errors are those of the parameters by the delta method.
    """
    check_plan(step, hours)
    plant = _plant(gray_box, settings, rows, sense)
    time = step * np.arange(1, round(hours / step) + 1)
    found = with_errors(gray_box, lambda theta: _values(gray_box, theta, plant, time))
    scaled = is_scaled(gray_box.state_space_.input_names, settings.capacities)
    left_out = _undetermined(found, scaled) | _BY_HAND
    known = {str(name): float(f"{value:.4g}") for name, value in found["value"].items() if name not in left_out}
    efficiency = _efficiency(settings, sense)
    if isinstance(efficiency, float):
        known["efficiency"] = efficiency
        left_out.pop(_OF_HEAT_PUMP)
    elif efficiency is not None:
        left_out[_OF_HEAT_PUMP] = efficiency
    heat = _heat(gray_box, plant, gray_box.theta_)
    power = _electricity(settings, _SIGNS[sense] * heat, rows) if scaled else None
    if power is None:
        delivered = f"{heat:.3g} kW of {sense}ing" if scaled else "the heat of its full stage"
        left_out["nominal_power_of_deferrable_loads"] = (
            f"it is the plant's electricity [W] when it delivers {delivered}; give cop in [plant], or type it in"
        )
    warmed = np.abs(warming(gray_box, gray_box.theta_, plant, step, len(time))[0])
    by_law = temperatures(EmhassLaw(*found["value"].iloc[:2]), np.ones(len(time)), np.zeros(len(time)), 0.0, step)
    misfit = float(np.sqrt(np.mean((by_law - warmed) ** 2)))
    table = _table(found.drop(index=[name for name in found.index if name in left_out]))
    return EmhassExport(table, _blocks(known, sense), left_out, power, misfit, float(warmed[-1]))


def _values(gray_box: Any, theta: pd.Series, plant: dict[str, float], time: np.ndarray) -> dict[str, float]:
    """EMHASS's parameters of a network with some parameters, over the ends of the plan's steps [h]."""
    warmed, final = warming(gray_box, theta, plant, time[0], len(time))
    building = quantities(gray_box, theta)
    capacity = _heat(gray_box, plant, theta) * float(time @ time) / float(np.abs(warmed) @ time)  # [kWh/K]
    return {
        **_first_order(np.abs(warmed), abs(final), time[0])._asdict(),
        "volume": 3600.0 * capacity / (_DENSITY * _HEAT_CAPACITY),
        "u_value": building["heat loss [W/K]"],
        "window_area": building.get("solar aperture [m2]", np.nan),
    }


def _plant(gray_box: Any, settings: Settings, rows: pd.DataFrame | None, sense: str) -> dict[str, float]:
    """Inputs of the plant at nominal power: stages of 1 that heat (or cool), else heat [kW]."""
    if sense not in _SIGNS:
        raise ValueError(f"sense={sense!r} is not one of {', '.join(map(repr, _SIGNS))}.")
    sign = _SIGNS[sense]
    theta = gray_box.theta_
    sources = gray_box.network_.sources(gray_box.state_space_.input_names[: -len(gray_box.network_.gain_names)])
    stages = {s.role: 1.0 for s in sources if is_stage(s.role) and sign * theta[s.parameter] > 0.0}
    heats = [s.role for s in sources if s.role.startswith("Q_")]
    if stages:
        return stages
    if not heats:
        raise ValueError(f"the log has no heat and no stage that can {sense}, so EMHASS's law cannot be determined.")
    given = settings.plant.get("most_heat" if sense == "heat" else "most_cold")
    if given is None and rows is not None:
        used = (sign * rows[heats[0]])[lambda heat: heat > 0.0]
        given = used.quantile(_LARGE) if len(used) else None
    if not given:
        raise ValueError(
            f"no heat of {heats[0]} can be called nominal, since the log has none that can {sense}; give most_heat or "
            "most_cold in [plant]."
        )
    return {heats[0]: sign * float(given)}


def _heat(gray_box: Any, plant: dict[str, float], theta: pd.Series) -> float:
    """Heat or cold at nominal power [kW]."""
    sources = gray_box.network_.sources(plant)
    return float(sum(abs(plant[s.role] * (1.0 if s.parameter is None else theta[s.parameter])) for s in sources))


def _efficiency(settings: Settings, sense: str) -> float | str | None:
    """The coefficient of performance in ``[plant]``, or why it is no efficiency of EMHASS; None where it has none.

    That of one sense counts for both, as in all forecasts.
    """
    performance = Performance.of(settings.plant)
    if performance is None:
        return None
    curve = performance.heating if sense == "heat" else performance.cooling
    if len(curve) == 1:
        return float(curve[0, 1])
    return "[plant] has a performance by outdoor temperature, and EMHASS takes one number; read them from the heat pump"


def _electricity(settings: Settings, heat: float, rows: pd.DataFrame | None) -> float | None:
    """Electricity [W] at nominal power and the mean outdoor temperature; None where it is not known."""
    performance = Performance.of(settings.plant)
    if performance is None:
        return None
    outdoors = np.nan if rows is None else rows["T_oa"].mean()
    found = 1000.0 * float(performance.electricity(np.array(heat), np.array(outdoors)))
    return round(found) if np.isfinite(found) else None


def _undetermined(found: pd.DataFrame, scaled: bool) -> dict[str, str]:
    """Parameters that this log does not determine, with the reason."""
    out = {}
    for name, value, std in found.itertuples():
        if name in _IN_KW and not scaled:
            out[name] = (
                "no capacity of the plant is known, so no kW is certain; give known = { Q_h = ... } in [estimator]"
            )
        elif not np.isfinite(value):
            out[name] = "the log has no irradiance"
        elif not std < abs(value):
            out[name] = f"not identified: {value:.2g} with a standard error of {std:.2g}"
    return out


def _table(found: pd.DataFrame) -> pd.DataFrame:
    """Identified values with block, unit and remark."""
    remark = np.where(found["std"] > UNSURE * found["value"].abs(), "uncertain", "")
    units = [_UNITS[str(name)] for name in found.index]
    blocks = ["thermal_battery" if name in _IN_KW else "thermal_config" for name in found.index]
    return found.assign(unit=units, block=blocks, remark=remark).rename_axis("parameter")


def _blocks(known: dict[str, float], sense: str) -> dict[str, dict[str, Any]]:
    """The two blocks of EMHASS, with what makes each lumped value stand for a product."""
    battery: dict[str, Any] = {"sense": sense, "thermal_loss": 0.0}  # all losses are in u_value
    if "u_value" in known:
        battery |= {"u_value": known["u_value"], "envelope_area": 1.0, "ventilation_rate": 0.0, "heated_volume": 0.0}
    if "volume" in known:
        battery |= {"volume": known["volume"], "density": _DENSITY, "heat_capacity": _HEAT_CAPACITY}
    if "window_area" in known:
        battery |= {"window_area": known["window_area"], "shgc": 1.0}
    if "efficiency" in known:
        battery["efficiency"] = known["efficiency"]
    law = {name: known[name] for name in EmhassLaw._fields if name in known}
    return {"thermal_config": {**law, "sense": sense}, "thermal_battery": battery}


def _first_order(warmed: np.ndarray, final: float, step: float) -> EmhassLaw:
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
    return EmhassLaw(cooling_constant * float(warmed @ shape / (shape @ shape)), cooling_constant)


def temperatures(law: EmhassLaw, power: np.ndarray, T_oa: np.ndarray, start: float, step: float) -> np.ndarray:
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
