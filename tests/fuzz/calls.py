"""Calls of all entry points on odd tables: their strategy, their outcome, and the simplest call of a failure."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from entry_points import ARGUMENTS, Entry, called, entries, n_rows_of
from estimators import TRANSFORMERS
from functions import NO_ZONE
from hypothesis import strategies as st
from outcomes import Outcome, observe, refusal, state, wrong_numbers
from zone_tables import (
    COLUMNS,
    INDEX,
    NOT_THE_TEMPERATURE,
    TARGET,
    WITH_SETPOINTS,
    Spoilt,
    Table,
    _Shown,
    tables,
    usually,
)

_FITS = ("fit", "fit_transform")
_TEMPERATURES = ("predict", "predict_from", "predict_quantiles", "predict_quantiles_from", "forecast", "sample")
_TEMPERATURES += ("simulate", "simulate_states", "update", "partial_fit", *_FITS)
_LOADS = ("predict_load", "required_heat")
#: results that are NaN where a measurement is missing, or after the last row
_MISSING = ("innovations", "transform", "fit_transform", "inverse_transform", "regularize", "drift", "predict_from")
_MISSING += (
    "predict_quantiles_from",
    "score_backtest",
    "score_intervals",
    "backtest",
    "split_log",
    "diagnose",
    "drive",
    "cross_correlation",
    "autocorrelation",
)
_NO_STAMPS = ("rows", "later rows", "floats")
_NO_SETPOINT = ("sentinel", "NaN", "inf", "word", "crossed", "short array", "complex", "three")
#: how the same rows can be given otherwise
SAME: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "other order": lambda X: X.iloc[:, ::-1],
    "one more": lambda X: X.assign(note=1.0),
    "objects": lambda X: X.astype(object),
    "nullable": lambda X: X.astype("Float64"),
    "a copy": lambda X: X.copy(),
}
#: parts of a table that are the history and the future of a forecast, by its number of rows
HISTORY: dict[str, Callable[[Any, int], Any]] = {
    "first half": lambda X, n: X[: n // 2],
    "none": lambda X, n: None,
    "no row": lambda X, n: X[:0],
    "one row": lambda X, n: X[:1],
    "all": lambda X, n: X,
}
FUTURE: dict[str, Callable[[Any, int], Any]] = {
    "second half": lambda X, n: X[n // 2 :],
    "without T_za": lambda X, n: X[n // 2 :].drop(columns="T_za", errors="ignore") if hasattr(X, "drop") else X,
    "later": lambda X, n: X[n // 2 + 1 :],
    "overlap": lambda X, n: X[max(n // 2 - 1, 0) :],
    "no row": lambda X, n: X[:0],
    "one row": lambda X, n: X[n // 2 : n // 2 + 1],
    "none": lambda X, n: None,
    "all": lambda X, n: X,
}

USUAL = Table()


@dataclass(frozen=True, repr=False)
class Call(_Shown):
    """A call of an entry point on a table."""

    entry: str
    table: Table = USUAL
    target: str = "series"
    arguments: tuple[tuple[str, str], ...] = ()  # name, and key of ARGUMENTS, HISTORY or FUTURE
    same: str | None = None  # key of SAME: the result must be the same to the bit

    def outcome(self) -> Outcome:
        """Make the call, and say what came of it."""
        entry, frame = entries()[self.entry], self.table.frame()
        estimator, function = called(entry)
        X = self.table.odd(frame)
        keywords = {name: self._argument(name, X) for name in entry.parameters}
        before = state(estimator)
        outcome = observe(lambda: function(**keywords), lambda result, warned: self._wrong(entry, X, result, warned))
        kept = outcome.kind == "accepted" and entry.method in (*_FITS, "update", "partial_fit")
        whole = entry.estimator != "Pipeline" and entry.method != "fit_transform"  # which may fail after a fit
        if not kept and not outcome.failed and whole and state(estimator) != before:
            return Outcome(f"{outcome.kind}, but {entry.method} changed the estimator")
        if outcome.kind == "accepted" and self.same is not None:
            return self._compared(function, X, keywords)
        return outcome

    def _argument(self, name: str, X: Any) -> Any:
        if name in ("X", "frame"):
            return X
        if name == "y":
            y = self.table.temperature()
            y = y if self.table.index is None else y.set_axis(pd.Index(INDEX[self.table.index](y.index)))
            return TARGET[self.target](y)
        chosen = dict(self.arguments).get(name)
        if name in ("history", "future") and not isinstance(X, pd.DataFrame | np.ndarray | list):
            return X
        if name in ("history", "future"):
            parts = HISTORY if name == "history" else FUTURE
            return parts[chosen or next(iter(parts))](X, n_rows_of(X))
        return ARGUMENTS[name][chosen or next(iter(ARGUMENTS[name]))](X)

    def _wrong(self, entry: Entry, X: Any, result: Any, warned: bool) -> str | None:
        lie = self.lie(entry, warned)
        if lie is not None:
            return f"accepted: {lie}"
        roomy = not warned and not any(name in ("heat_gain", "initial_state") for name, _ in self.arguments)
        roomy = roomy and not (entry.estimator or "").startswith("DisturbanceForecaster")
        if entry.method in (*_FITS, "update", "partial_fit") and hasattr(result, "predict") and len(self.table.columns):
            try:
                result = result.predict(X)
            except Exception as error:  # the call was accepted; what follows may be refused
                after = refusal(error)
                return after.kind if after.failed else None
        names: tuple[str, ...] = ("", "T_za", "q_") if entry.method in _TEMPERATURES else ()
        names = ("T_za",) if entry.method in _LOADS else names
        if entry.estimator in TRANSFORMERS and entry.method != "fit":
            return None  # what is missing or infinite in a table is passed on
        return wrong_numbers(result, missing=entry.method in _MISSING, temperature=names if roomy else ())

    def lie(self, entry: Entry, warned: bool) -> str | None:
        """The lie that must be refused in this call, where there is one."""
        if entry.estimator in TRANSFORMERS or entry.method in ("regularize", "split_log"):
            return None
        if entry.estimator is None and entry.name.startswith(NO_ZONE):
            return None
        forecaster = (entry.estimator or entry.method).startswith(("DisturbanceForecaster", "fit_many"))
        arx = "ARX" in entry.name or "Pipeline" in entry.name or entry.name == "backtest"
        roles = ("T_oa", "q_sol")
        if not forecaster and not arx and entry.method not in ("forecast", "affine_forecast", "to_state_space"):
            roles += ("T_za",)
        arguments = dict(self.arguments)
        if arguments.get("future") != "one row" and self.table.lies(roles):  # the rows after it are not given
            return "a value, a type or a mask that T_oa, q_sol or T_za cannot have"
        setpoint = arguments.get("setpoint")
        fits = self.table.n_rows == 3 and setpoint == "three"  # one value per row
        if "setpoint" in entry.parameters and setpoint in _NO_SETPOINT and self.table.n_rows > 1 and not fits:
            return f"the set-point {setpoint}"
        if setpoint == "degF" and not warned and self.table.n_rows > 1:
            return "the set-point 72, without a warning"
        if entry.method not in _FITS or self.table.container is not None or self.table.n_rows < 24:
            return None
        if self.table.index in _NO_STAMPS:
            return "a table without time stamps"
        plain = self.table == replace(USUAL, n_rows=self.table.n_rows, start=self.table.start, zone=self.table.zone)
        if plain and not forecaster and self.target in NOT_THE_TEMPERATURE:
            return f"a y that is not T_za ({self.target})"
        return None

    def _compared(self, function: Callable[..., Any], X: pd.DataFrame, keywords: dict[str, Any]) -> Outcome:
        other, rows = SAME[self.same or "a copy"](X), ("X", "history", "future")
        changed = keywords | {name: self._argument(name, other) for name in rows if name in keywords}

        def judge(result: Any, warned: bool) -> str | None:
            same = np.array_equal(np.asarray(result, float), np.asarray(function(**keywords), float), equal_nan=True)
            return None if same else f"another result: {self.same}"

        outcome = observe(lambda: function(**changed), judge)
        return Outcome(f"refused: {self.same}", outcome.detail) if outcome.kind == "refused" else outcome


@cache
def _by_share(but: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name, e in entries().items() if not (but and name.startswith(but)) for _ in range(e.share))


@st.composite
def calls(draw: st.DrawFn, but: tuple[str, ...] = ()) -> Call:
    """Calls of all entry points (``but`` those that begin so), on tables of which most are odd in one or two ways."""
    entry = entries()[draw(st.sampled_from(_by_share(but)))]
    arguments = []
    for name in entry.parameters:
        choices = {"history": HISTORY, "future": FUTURE, **ARGUMENTS}.get(name)
        if choices is not None and len(choices) > 1:
            first, *others = choices
            chosen = draw(usually(first, others, 2))
            arguments += [(name, chosen)] if chosen != first else []
    long = entry.method in (*_FITS, "compare_models")
    sizes = (96, 48, 24, 6, 4, 3, 2, 1, 0, 216) if long else (48, 24, 5, 1, 0, 2, 3, 60, 216)
    table = draw(tables(sizes, WITH_SETPOINTS if entry.of_thermostat else COLUMNS))
    target = draw(usually("series", TARGET, 1)) if "y" in entry.parameters else "series"
    plain = table.container is None and table.names is None and entry.method in ("predict", "predict_quantiles")
    same = draw(usually(None, SAME, 3)) if plain and entry.estimator != "Pipeline" else None
    return Call(entry.name, table, target, tuple(arguments), same)


def simplest(call: Call) -> Call:
    """The same failure with as little that is odd as possible."""
    kind, until = call.outcome().kind, time.monotonic() + 20.0
    better: Call | None = call
    while better is not None and time.monotonic() < until:
        call = better
        better = next((simpler for simpler in _simpler(call) if simpler.outcome().kind == kind), None)
    return call


def _simpler(call: Call) -> list[Call]:
    found = [replace(call, arguments=call.arguments[:i] + call.arguments[i + 1 :]) for i in range(len(call.arguments))]
    found += [replace(call, **{f.name: f.default}) for f in fields(call)[2:] if getattr(call, f.name) != f.default]
    table = call.table
    changes: list[dict[str, Any]] = [{f.name: f.default} for f in fields(table) if getattr(table, f.name) != f.default]
    changes += [{"spoilt": table.spoilt[:i] + table.spoilt[i + 1 :]} for i in range(len(table.spoilt))]
    return found + [replace(call, table=replace(table, **change)) for change in changes]


def read(text: str) -> Call:
    """The call that a repr shows."""
    return eval(text, {"Call": Call, "Table": Table, "Spoilt": Spoilt, "COLUMNS": COLUMNS})
