"""The log that comes with the package: an EnergyPlus run of the DOE reference small office."""

from __future__ import annotations

from importlib.resources import as_file, files

import pandas as pd
from sklearn.utils import Bunch

_DESCR = """The DOE reference small office in Chicago, autumn 2018 (label), 15 min, UTC-06:00 without daylight saving.

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
    log = _read("irregular")
    if control == "shifted":  # its file lacks weather and occupancy, which are the same
        changed = _read("shifted")
        log = log.assign(**{str(name): changed[name] for name in changed})
    X = log[["T_oa", "q_sol", "Q_hvac", "T_za"]].copy()
    rest = ["set_heat", "set_cool", "stage_heat", "stage_cool", "dni", "dhi", "people"]
    return Bunch(X=X, y=X["T_za"].copy(), heat_gain=log["heat_gain"].copy(), frame=log[rest].copy(), DESCR=_DESCR)


def _read(control: str) -> pd.DataFrame:
    with as_file(files("skhybrid.datasets").joinpath("data", f"small_office_{control}.csv.gz")) as path:
        table = pd.read_csv(path, index_col="time")
    table.index = pd.DatetimeIndex(pd.to_datetime(table.index), name="time")
    return table.astype("float64")
