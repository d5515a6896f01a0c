"""Statements of the paper's section 2: its Table 1, and its sentences as predicates on the numbers of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

#: the paper's Table 1: C [kWh/K], R [K/kW], f [-], A_win [m2], Q [kW].
PAPER_TABLE = pd.DataFrame(
    {
        "C_w": [40.0, 20.6, 10.6],
        "C_za": [0.4, 1.4, 1.3],
        "R_zw": [6.2, 0.8, 0.8],
        "R_zo": [40.0, 3.4, 4.1],
        "f": [1.0, 0.03, 0.2],
        "A_win": [1.1, 20.0, 12.4],
        "Q_h": [1.5, 6.7, 6.7],
        "Q_c": [-1.3, -8.7, -8.6],
    },
    index=["CONV", "ID", "OD"],
)
#: its last two columns: sigma_x [K] and sigma_zeta [kW] of ID, rho_1 and rho_2 [-] of OD.
PAPER_NOISE = {
    "ID": {"sigma_x": 1e-3, "sigma_zeta": 2e-2},
    "OD": {"rho_1": 0.99, "rho_2": 0.99},
}
PARAMETERS = tuple(PAPER_TABLE.columns)
#: parameters that are left once Q_h fixes the scale
FREE = tuple(name for name in PARAMETERS if name != "Q_h")
#: a parameter beyond this factor counts as over- or underestimated, a response beyond this share as off
FACTOR, SHARE, DECIBEL = 1.5, 20.0, 1.0

Getter = Callable[[str, str], float]


def rescale(theta: Mapping[str, float], capacity: float) -> dict[str, float]:
    """The same input-output map with ``Q_h = capacity`` [kW]: C, A and Q times a factor, R through it."""
    factor = capacity / theta["Q_h"]
    power = {"C": 1.0, "A": 1.0, "Q": 1.0, "R": -1.0}
    return {name: float(value) * factor ** power.get(name[0], 0.0) for name, value in theta.items()}


def off(ratio: float) -> float:
    """By what factor a parameter is wrong, either way."""
    return max(ratio, 1.0 / ratio)


class Claim(NamedTuple):
    """One statement of the paper, when it holds, and the numbers that decide."""

    where: str
    statement: str
    holds: Callable[[Getter], bool]
    shown: tuple[tuple[str, str], ...]  # (model, quantity)


def _both(quantity: str, *models: str) -> tuple[tuple[str, str], ...]:
    return tuple((model, quantity) for model in models)


def _better(quantity: str) -> Callable[[Getter], bool]:
    """ID and OD are both below CONV."""
    return lambda g: max(g("ID", quantity), g("OD", quantity)) < g("CONV", quantity)


THREE = ("CONV", "ID", "OD")


def _over(model: str, *names: str) -> tuple[Claim, ...]:
    """One claim per parameter: the model overestimates it."""
    return tuple(
        Claim(
            "Table 1",
            f"{model} overestimates {name} (by more than {FACTOR})",
            lambda g, name=name: g(model, name) > FACTOR,
            ((model, name),),
        )
        for name in names
    )


def _worst(quantity: str, *models: str) -> Callable[[Getter], float]:
    """The largest size among the models."""
    return lambda g: max(abs(g(m, quantity)) for m in models)


CLAIMS = (
    *_over("CONV", "C_w", "R_zo"),
    Claim(
        "Table 1",
        "CONV underestimates the capacities (what the scale leaves of it: Q_c beside Q_h, by more than 10 %)",
        lambda g: g("CONV", "Q_c") < 0.9,
        (("CONV", "Q_c"),),
    ),
    Claim("Table 1", "ID and OD estimate better than CONV (mean factor)", _better("factor"), _both("factor", *THREE)),
    *_over("ID", "A_win", "f"),
    Claim(
        "Table 1",
        "OD is nearer than ID in most of the seven parameters",
        lambda g: sum(off(g("OD", p)) < off(g("ID", p)) for p in FREE) > len(FREE) / 2,
        _both("factor", "ID", "OD"),
    ),
    *_over("OD", "C_w", "A_win"),
    Claim("Table 1", "OD's rho_2 lies within 0.999", lambda g: abs(g("OD", "rho_2")) < 0.999, (("OD", "rho_2"),)),
    Claim(
        "Bode",
        f"at 1 cph CONV misses u_cool (by {DECIBEL:g} dB)",
        lambda g: abs(g("CONV", "u_cool 1 h dB")) > DECIBEL,
        _both("u_cool 1 h dB", "CONV"),
    ),
    Claim(
        "Bode",
        f"at 1 cph ID and OD have u_cool (within {DECIBEL:g} dB)",
        lambda g: _worst("u_cool 1 h dB", "ID", "OD")(g) < DECIBEL,
        _both("u_cool 1 h dB", "ID", "OD"),
    ),
    Claim(
        "Bode",
        "ID and OD have u_heat and u_cool worse at 1 cpd than at 1 cph",
        lambda g: all(g(m, "slow dB") > g(m, "fast dB") for m in ("ID", "OD")),
        _both("slow dB", "ID", "OD") + _both("fast dB", "ID", "OD"),
    ),
    Claim(
        "step",
        f"u_heat: all are within {SHARE:g} % for half an hour",
        lambda g: _worst("u_heat 0.5 h %", *THREE)(g) < SHARE,
        _both("u_heat 0.5 h %", *THREE),
    ),
    Claim(
        "step",
        f"u_heat: none is within {SHARE:g} % after 12 h",
        lambda g: min(abs(g(m, "u_heat 12 h %")) for m in THREE) > SHARE,
        _both("u_heat 12 h %", *THREE),
    ),
    Claim(
        "step",
        f"u_cool: ID and OD are within {SHARE:g} % after 1.5 h",
        lambda g: _worst("u_cool 1.5 h %", "ID", "OD")(g) < SHARE,
        _both("u_cool 1.5 h %", "ID", "OD"),
    ),
    Claim(
        "step",
        f"u_cool: CONV is off by more than {SHARE:g} % after half an hour",
        lambda g: abs(g("CONV", "u_cool 0.5 h %")) > SHARE,
        _both("u_cool 0.5 h %", "CONV"),
    ),
    Claim(
        "three days",
        "with the gain given, ID and OD predict better than CONV",
        _better("with gain K"),
        _both("with gain K", *THREE),
    ),
    Claim(
        "three days",
        "ID and OD are worse at the weekend than on weekdays",
        lambda g: all(g(m, "with gain, weekend K") > g(m, "with gain, weekday K") for m in ("ID", "OD")),
        _both("with gain, weekend K", "ID", "OD") + _both("with gain, weekday K", "ID", "OD"),
    ),
    Claim(
        "runtime",
        "in occupied hours ID and OD tell the cooling runtime better than CONV",
        _better("runtime, occupied"),
        _both("runtime, occupied", *THREE),
    ),
    Claim(
        "runtime",
        "in unoccupied hours all deviate (twice what TRUE does)",
        lambda g: all(g(m, "runtime, empty") > 2 * g("TRUE", "runtime, empty") for m in THREE),
        _both("runtime, empty", "TRUE", *THREE),
    ),
    *(
        Claim(
            "summary",
            f"OD is the best of the three: {words}",
            lambda g, quantity=quantity: g("OD", quantity) < min(g("CONV", quantity), g("ID", quantity)),
            _both(quantity, *THREE),
        )
        for quantity, words in (
            ("factor", "parameters"),
            ("with gain K", "three days"),
            ("runtime, occupied", "runtime"),
        )
    ),
    Claim(
        "no gain",
        "a day ahead without the gain, even TRUE is wrong (ten times what it is with the gain)",
        lambda g: g("TRUE", "no gain K") > 10 * g("TRUE", "with gain K"),
        (("TRUE", "no gain K"), ("TRUE", "with gain K")),
    ),
    Claim(
        "no gain",
        "OD comes nearer to the measurement than TRUE",
        lambda g: g("OD", "no gain K") < g("TRUE", "no gain K"),
        _both("no gain K", "OD", "TRUE"),
    ),
    Claim(
        "no gain",
        "CONV comes no nearer to the measurement than OD",
        lambda g: g("CONV", "no gain K") >= g("OD", "no gain K"),
        _both("no gain K", "CONV", "OD"),
    ),
    Claim(
        "disturbance",
        "with the accurate model its mean week is the true one (within 0.1 kW)",
        lambda g: g("TRUE", "mean week kW") < 0.1,
        _both("mean week kW", "TRUE"),
    ),
    Claim(
        "disturbance",
        "with an inaccurate model (CONV) it is not (three times as far)",
        lambda g: g("CONV", "mean week kW") > 3 * g("TRUE", "mean week kW"),
        _both("mean week kW", "CONV", "TRUE"),
    ),
    Claim(
        "disturbance",
        "with an inaccurate model (CONV) it differs more from week to week",
        lambda g: g("CONV", "week to week kW") > g("TRUE", "week to week kW"),
        _both("week to week kW", "CONV", "TRUE"),
    ),
)


def judge(claims: tuple[Claim, ...], runs: list[pd.DataFrame]) -> pd.DataFrame:
    """Judge statements run by run, with our identifications and with the paper's own numbers.

    Parameters
    ----------
    claims : tuple of Claim
    runs : list of DataFrame
        A frame a seed: rows models (the paper's as ``paper CONV`` ...), columns quantities.

    Returns
    -------
    DataFrame
        A row a claim, index ``where``; columns ``the paper says``, ``here`` and ``the paper's numbers``, the last two
        with the verdict and its medians.
    """
    rows = []
    for claim in claims:
        row = {"where": claim.where, "the paper says": claim.statement}
        for column, prefix in (("here", ""), ("the paper's numbers", "paper ")):
            count = sum(bool(claim.holds(_getter(run, prefix))) for run in runs)
            row[column] = f"{verdict(count, len(runs))}: {_spelled(claim, runs, prefix)}"
        rows.append(row)
    return pd.DataFrame(rows).set_index("where")


def verdict(count: int, n: int) -> str:
    """The verdict in words, from the number of runs in which a statement holds."""
    if count in (0, n):
        return "holds" if count else "does not hold"
    return f"holds in {count} of {n}"


def _getter(run: pd.DataFrame, prefix: str) -> Getter:
    def get(model: str, quantity: str) -> float:
        return float(run.loc[model if model == "TRUE" else prefix + model, quantity])

    return get


def _spelled(claim: Claim, runs: list[pd.DataFrame], prefix: str) -> str:
    parts = []
    for quantity in dict.fromkeys(q for _, q in claim.shown):
        values = [
            f"{m} {np.median([_getter(run, prefix)(m, quantity) for run in runs]):.2g}"
            for m, q in claim.shown
            if q == quantity
        ]
        parts.append(f"{quantity} {', '.join(values)}")
    return "; ".join(parts)
