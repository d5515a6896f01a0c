"""The logs that come with the package: an EnergyPlus run of the DOE reference small office, and three Dutch homes."""

from __future__ import annotations

from contextlib import AbstractContextManager
from importlib.resources import as_file, files
from pathlib import Path

import pandas as pd
from sklearn.utils import Bunch

from .._arguments import is_integer
from ..logs import read_zone_csv

_HOME_COLUMNS = {"T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd", "T_za": "T_in_degC"}
_HIGHEST = 78.0  # of the boiler's signal of a home

_OFFICE = """The DOE reference small office in Chicago, autumn 2018 (label), 15 min, UTC-06:00 without daylight saving.

An EnergyPlus 25.2 run of a 511 m2 office of five zones (new construction, 90.1-2004) under TMY3 weather, with an
irregular occupancy (day level autocorrelated, off-site days, random arrivals).  control="irregular" has the reference
set-points; control="shifted" is the same building, weather and occupancy under random daily set-points, pre-heating
and load shifting, a kind of control that does not occur in the first log.

X: T_oa [degC] and T_za [degC] (mean of the zones by volume) are values at the stamp; q_sol (global horizontal)
[kW/m2] and Q_hvac (net sensible heat delivered, + heats) [kW] are means over [t, t + 15 min).
heat_gain: the internal gains [kW] (people, lights, plugs), for comparison with estimates, never an input.
frame: set-points, stages (mean runtime fraction), dni and dhi [kW/m2], people.

Credit: EnergyPlus (BSD-style licence, LBNL/DOE); reference buildings by DOE, NREL, PNNL, LBNL: Deru et al. (2011),
"U.S. Department of Energy Commercial Reference Building Models of the National Building Stock", NREL/TP-5500-46861.
Cut from year-long runs by benchmarks/data/make_small_office.py.
"""
_HOME = """An occupied Dutch home with thermostat and boiler, 15 min, 43 to 72 days to 2022-01-04, Amsterdam time.

X: T_oa [degC] and T_za [degC] (thermostat); q_sol (global horizontal) [kW/m2]; u_heat [-], the signal for the heating
water as a share of its highest value.  Its capacity in kW is not known, nor is what the household did.

Credit: Leprince et al., Energy and Buildings (2022); the data are under the MIT licence.
"""


def load_small_office(control: str = "irregular") -> Bunch:
    """Load an EnergyPlus run of a small office in autumn, 15 min.

    Parameters
    ----------
    control : {"irregular", "shifted"}; the usual set-points, or the same autumn under shifted and randomised set-points

    Returns
    -------
    Bunch
        ``X`` DataFrame [T_oa, q_sol, Q_hvac, T_za]; ``y`` Series T_za [degC]; ``heat_gain`` Series, true internal
        gains [kW], never part of ``X``; ``frame`` DataFrame [set_heat, set_cool, stage_heat, stage_cool, dni, dhi,
        people]; ``DESCR``.

    Raises
    ------
    ValueError
        If ``control`` is another.
    """
    if control not in ("irregular", "shifted"):
        raise ValueError(f"control={control!r} is unknown; choose 'irregular' or 'shifted'.")
    log = _read_office("irregular")
    if control == "shifted":  # its file lacks weather and occupancy, which are the same
        changed = _read_office("shifted")
        log = log.assign(**{str(name): changed[name] for name in changed})
    X = log[["T_oa", "q_sol", "Q_hvac", "T_za"]].copy()
    rest = ["set_heat", "set_cool", "stage_heat", "stage_cool", "dni", "dhi", "people"]
    return Bunch(X=X, y=X["T_za"].copy(), heat_gain=log["heat_gain"].copy(), frame=log[rest].copy(), DESCR=_OFFICE)


def load_dutch_home(number: int) -> Bunch:
    """Load the log of an occupied Dutch home, 15 min.

    Parameters
    ----------
    number : {1, 2, 3}

    Returns
    -------
    Bunch
        ``X`` DataFrame [T_oa, q_sol, u_heat, T_za]; ``y`` Series T_za [degC]; ``DESCR``.

    Raises
    ------
    ValueError
        If ``number`` is another.
    """
    if not is_integer(number) or number not in (1, 2, 3):
        raise ValueError(f"number={number!r} must be 1, 2 or 3.")
    with _shipped(f"dutch_home_{number}") as path:
        X = read_zone_csv(path, _HOME_COLUMNS, timezone="Europe/Amsterdam")
    X = X.assign(u_heat=X["u_heat"] / _HIGHEST)
    return Bunch(X=X, y=X["T_za"].copy(), DESCR=_HOME)


def _read_office(control: str) -> pd.DataFrame:
    with _shipped(f"small_office_{control}") as path:
        table = pd.read_csv(path, index_col="time")
    table.index = pd.DatetimeIndex(pd.to_datetime(table.index), name="time")
    return table.astype("float64")


def _shipped(name: str) -> AbstractContextManager[Path]:
    return as_file(files("skhybrid.datasets").joinpath("data", f"{name}.csv.gz"))
