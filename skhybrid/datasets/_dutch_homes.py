"""The logs of three Dutch homes that come with the package."""

from __future__ import annotations

from importlib.resources import as_file, files

from sklearn.utils import Bunch

from ..logs import read_zone_csv

_COLUMNS = {"T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd", "T_za": "T_in_degC"}
_HIGHEST = 78.0  # of the boiler's signal

_DESCR = """An occupied Dutch home with thermostat and boiler, 15 min, 43 to 72 days to 2022-01-04, Amsterdam time.

X: T_oa [degC] and T_za [degC] (thermostat); q_sol (global horizontal) [kW/m2]; u_heat [-], the signal for the heating
water as a share of its highest value.  Its capacity in kW is not known, nor is what the household did.

Credit: Leprince et al., Energy and Buildings (2022); the data are under the MIT licence.
"""


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
    if number not in (1, 2, 3):
        raise ValueError(f"number={number!r} must be 1, 2 or 3.")
    with as_file(files("skhybrid.datasets").joinpath("data", f"dutch_home_{number}.csv.gz")) as path:
        X = read_zone_csv(path, _COLUMNS, timezone="Europe/Amsterdam")
    X = X.assign(u_heat=X["u_heat"] / _HIGHEST)
    return Bunch(X=X, y=X["T_za"].copy(), DESCR=_DESCR)
