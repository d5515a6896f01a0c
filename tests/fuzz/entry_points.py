"""Every public method and function that takes a table, and values for its other arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from estimators import ESTIMATORS, NETWORKS, SETPOINTS, fitted
from functions import FUNCTIONS, NOT_CALLED, SETTINGS
from sklearn.base import BaseEstimator, clone

import skhybrid
from skhybrid.study import Settings

#: how often one is fitted, where a fit is slow (others: 10)
_SHARE = {"HybridPredictor": 3, "SchedulePredictor": 3, "TwoStagePredictor": 3, "PeriodicDisturbanceID": 1}
_SHARE |= {"profile_likelihood": 1, "fit_many": 2, "backtest": 4, "GrayBoxRC": 4, "InputDisturbanceID": 4}
_SHARE |= {"OutputDisturbanceID": 4, "DesignMatrixSearchCV, ARXRegressor": 2, "compare_models": 1}
_SHARE["SchedulePredictor, set-points"] = 1
_SHARE |= dict.fromkeys((*NETWORKS, "fit_many, networks", "save and load, mlp"), 1)
_SHARE |= {name: 1 for name in FUNCTIONS if "Display" in name or name == "skhybrid run"}
#: public methods that take no table of a user: they take what another method has read, or no table at all
NO_TABLE = {
    "left_out_paths", "refitted", "recursive", "published", "theta_interval",
    "origin_state", "get_feature_names_out", "set_params", "get_params", "summary",
    "without_neighbours", "left_out_errors",
}  # fmt: skip
#: methods that change the estimator
CHANGING = ("fit", "partial_fit", "update")

# values of arguments by the name of the parameter; the first is the usual one, X is the table that is passed
Make = Callable[[Any], Any]


def n_rows_of(X: Any) -> int:
    """Number of rows of a table of any kind."""
    return X.shape[0] if getattr(X, "shape", ()) else len(X) if hasattr(X, "__len__") else 3


def _stamps(X: Any) -> Any:
    return X.index if isinstance(X, pd.DataFrame) else None


def _constant(**values: Any) -> dict[str, Make]:
    return {name: (lambda X, v=v: v) for name, v in values.items()}


_BAD = _constant(NaN=np.nan, inf=np.inf, word="warm", none=None)
ARGUMENTS: dict[str, dict[str, Make]] = {
    "setpoint": {
        **_constant(number=21.0, pair=(20.0, 24.0), heat_only=(20.0, None), free=(None, None), crossed=(24.0, 20.0)),
        "series": lambda X: pd.Series(21.0, index=_stamps(X)) if _stamps(X) is not None else [21.0] * n_rows_of(X),
        "array": lambda X: np.full(n_rows_of(X), 21.0),
        "short array": lambda X: np.full(max(n_rows_of(X) - 1, 0), 21.0),
        "frame": lambda X: pd.DataFrame({"heat": 20.0, "cool": 24.0}, index=range(n_rows_of(X))),
        **_constant(degF=72.0, sentinel=-9999.0, text="21", three=(20.0, 21.0, 22.0), flag=True, complex=21j),
        **_BAD,
    },
    "limits": {
        **_constant(none=None, usual=(-5.0, 5.0), off=(0.0, 0.0), crossed=(5.0, -5.0), one=(5.0,), number=5.0),
        **_constant(nan=(np.nan, 5.0), inf=(-np.inf, np.inf), watt=(-5000.0, 5000.0), sentinel=(-9999.0, 5.0)),
        "arrays": lambda X: (np.full(n_rows_of(X), -5.0), np.full(n_rows_of(X), 5.0)),
        "short": lambda X: (np.full(2, -5.0), 5.0),
        **_constant(words=("low", "high")),
    },
    "quantiles": _constant(
        usual=(0.1, 0.5, 0.9), one=[0.5], zero=[0.0], over=[1.5], below=[-0.1], empty=[], nan=[np.nan], word="median",
        number=0.5, twice=[0.5, 0.5], unordered=[0.9, 0.1], percent=[10, 90], none=None, extreme=[1e-9, 1 - 1e-9],
    ),
    "origins": {
        **_constant(first=[0], two=[0, 5], negative=[-1], far=[10**6], half=[0.5], unsorted=[5, 0], twice=[3, 3]),
        "last": lambda X: [max(n_rows_of(X) - 1, 0)],
        "end": lambda X: [n_rows_of(X)],
        "all": lambda X: np.arange(n_rows_of(X)),
        "mask": lambda X: np.ones(n_rows_of(X), bool),
        **_constant(empty=[], number=0, word="noon", none=None, levels=[[0]], nan=[np.nan]),
    },
    "disturbance": {
        "one": lambda X: np.zeros((1, max(n_rows_of(X), 24))),
        **_constant(two=np.zeros((2, 24)), vector=np.zeros(24), none=None, word="none", huge=np.full((1, 24), 1e300)),
        **_constant(nan=np.full((1, 24), np.nan), empty=np.zeros((1, 0)), three=np.zeros((1, 24, 3)), short=[[0.0]]),
    },
    "kind": _constant(input="input", output="output", both="both", none=None),
    "smooth": _constant(no=False, yes=True),
    "horizon": _constant(
        none=None, quarter="6h", uneven="7min", zero="0h", back="-1D", word="day", number=24, years="1000D", nan=np.nan,
        every="1h", infinite=np.inf,
    ),
    "heat_gain": {
        **_constant(none=None, word="sun", infinite=np.inf),
        "array": lambda X: np.full(n_rows_of(X), 0.5),
        "series": lambda X: pd.Series(0.5, index=_stamps(X)) if _stamps(X) is not None else np.zeros(n_rows_of(X)),
        "short": lambda X: np.zeros(2),
        "nan": lambda X: np.full(n_rows_of(X), np.nan),
        "number": lambda X: 0.5,
    },
    "initial_state": _constant(
        none=None, one=[20.0], number=20.0, two=[20.0, 20.0], nan=[np.nan], word="warm", empty=[], sentinel=[-9999.0]
    ),
    "sample_weight": {
        "none": lambda X: None,
        "ones": lambda X: np.ones(n_rows_of(X)),
        "short": lambda X: np.ones(2),
        "negative": lambda X: -np.ones(n_rows_of(X)),
        "nan": lambda X: np.full(n_rows_of(X), np.nan),
    },
    "theta_init": _constant(
        none=None, some={"R_zo": 5.0}, unknown={"x": 1.0}, nan={"R_zo": np.nan}, negative={"R_zo": -1.0}, word="5"
    ),
    "step": _constant(
        none=None, quarter="15min", hour="1h", zero="0h", back="-1h", uneven="7min", tiny="1ns", word="step",
        days="10D", nan=np.nan,
    ),
    "held": _constant(none=(), some=("u_heat",), unknown=("u_9",), text="u_heat", number=(1,)),
    "max_hold": _constant(day="1D", zero="0h", back="-1h", word="gap", none=None),
    "max_gap": _constant(hour="1h", zero="0h", back="-1h", word="gap", years="1000D", none=None),
    "return_report": _constant(no=False, yes=True),
    "origin_step": _constant(day="1D", hours="6h", uneven="7min", zero="0h", word="step"),
    "start": _constant(none=None, early="1990-01-01", within="2024-10-27", late="2090-01-01", word="start", row=3),
    "max_lag": _constant(day="1D", zero="0h", word="lag", years="1000D", back="-1D"),
    "weather_error": _constant(none=None, medium="medium", huge="huge", number=1.0, levels=["low"]),
    "level": _constant(usual=0.5, zero=0.0, one=1.0, over=2.0, nan=np.nan, word="high"),
    "parameter": _constant(resistance="R_zo", unknown="R_xy", none=None),
    "by": _constant(none=None, lead="lead", origin="origin", word="x"),
    "purpose": _constant(parameters="parameters", forecast="forecast", word="x"),
    "train": _constant(day="1D", rows=12, zero="0h", word="train", years="1000D", none=None, half=0.5, nan=np.nan),
    "config": _constant(**{key: key for key in SETTINGS}),
    "settings": _constant(usual=Settings(columns={"T_za": "T_za", "T_oa": "T_oa"}, step="1h")),
    "y_ahead": _constant(none=None),
    "T_za": _constant(
        none=None, usual=21.3, degF=70.0, several=[21.0, 22.0], sentinel=-9999.0, flag=True, nan=np.nan, word="warm",
        infinite=np.inf, complex=21j,
    ),
    "inputs": _constant(
        heating=("u_heat",), both=("u_heat", "u_cool"), heat=("Q_hvac",), text="u_heat", twice=("u_heat", "u_heat"),
        weather=("T_oa",), empty=(), none=None, number=3, numbers=(1, 2), nested=(("u_heat",),),
    ),
    "like": _constant(none=None, word="the last", number=3),
    "boundary": _constant(none=None, empty={}, unknown={"T_south": [[20.0]]}, word="T_south", number=3),
    "n_samples": _constant(few=3, none=0, below=-1, word="many", half=0.5),
    "random_state": _constant(number=0, word="x"),
    "member": _constant(blend="blend", network="network", other="ARX", none=None, number=1),
}  # fmt: skip
#: parameters with a default that are left alone
LEFT_ALONE = {"output", "values", "on_error", "verbose", "n_leads"}
TABLES = {"X", "history", "future", "frame", "y", "target"}


class Entry(NamedTuple):
    """One public method of an estimator, or a function."""

    name: str
    estimator: str | None  # key of ESTIMATORS
    method: str
    parameters: tuple[str, ...]

    @property
    def of_thermostat(self) -> bool:
        """Whether the estimator has learned a thermostat, so that its tables have set-points."""
        return (self.estimator or "").endswith(SETPOINTS)

    @property
    def share(self) -> int:
        """Weight with which it is called, against others."""
        slow = self.method in ("fit", "partial_fit") or self.estimator in (None, *NETWORKS)
        return _SHARE.get(self.estimator or self.method, 10) if slow else 5


def _methods(name: str) -> list[str]:
    estimator = fitted(name)
    public = [m for m in dir(estimator) if not m.startswith("_") and m not in NO_TABLE and hasattr(estimator, m)]
    methods = [m for m in public if inspect.ismethod(getattr(estimator, m))]
    return [m for m in methods if TABLES & set(inspect.signature(getattr(estimator, m)).parameters)]


@cache
def entries() -> dict[str, Entry]:
    """All entry points by name; a parameter that nothing is known of is an error, so that none is forgotten."""
    found = []
    for name in ESTIMATORS:
        for method in _methods(name):
            found.append(_entry(f"{name}.{method}", name, method, getattr(fitted(name), method)))
    found += [_entry(name, None, name, function) for name, function in FUNCTIONS.items()]
    return {entry.name: entry for entry in found}


def _entry(name: str, estimator: str | None, method: str, function: Callable[..., Any]) -> Entry:
    signature = inspect.signature(function).parameters.values()
    kinds = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    parameters = tuple(p.name for p in signature if p.name not in ("self", *LEFT_ALONE) and p.kind not in kinds)
    unknown = [p for p in parameters if p not in ARGUMENTS and p not in TABLES]
    if unknown:
        raise LookupError(f"{name} has a parameter {unknown[0]!r}: say in ARGUMENTS which values it may take.")
    return Entry(name, estimator, method, parameters)


def forgotten() -> set[str]:
    """Public names that are neither called nor known to need no call."""
    modules = [import_module(f"skhybrid.{name}") for name in (*_subpackages(), "hybrid")]
    public = {name for module in modules for name in module.__all__} | set(skhybrid.__all__)
    names = {text.partition(",")[0].partition(".")[0] for text in (*ESTIMATORS, *FUNCTIONS)}
    return public - names - set(NOT_CALLED) - {"__version__", *_subpackages(), *skhybrid.exceptions.__all__}


def _subpackages() -> list[str]:
    return [name for name in skhybrid.__all__ if isinstance(getattr(skhybrid, name), ModuleType)]


def called(entry: Entry) -> tuple[BaseEstimator | None, Callable[..., Any]]:
    """The estimator, a copy where the call changes it, and what is called."""
    if entry.estimator is None:
        return None, FUNCTIONS[entry.method]
    if entry.method in ("fit", "fit_transform"):
        estimator = clone(ESTIMATORS[entry.estimator])
    elif entry.method in CHANGING:
        estimator = deepcopy(fitted(entry.estimator))
    else:
        estimator = fitted(entry.estimator)
    return estimator, getattr(estimator, entry.method)
