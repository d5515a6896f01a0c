"""Statements of the paper's sections 4.3, 4.4 and 5 on forecasts, as predicates on the numbers of a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pandas as pd
from _report import spread

#: the paper's two approaches, and ours: all on the same log
CONVENTIONAL = "OD, no disturbance"
HYBRIDS = {"two-stage here": "hybrid OD, LSTM", "default here": "default"}
#: a forecast that follows the measured profile correlates with it by more than this
PROFILE = 0.5
#: an error is not negligible from here on: five times the noise of the simulated sensor [K]
NEGLIGIBLE = 0.15

#: numbers that differ by a smaller share count as equal
ALIKE = 0.02

Pair = Callable[[str, str], float]  # of "c" (conventional) or "h" (hybrid) and a quantity


class Claim(NamedTuple):
    """One statement of the paper, on which log it is tried, when it holds, and the numbers that decide."""

    where: str
    log: str
    statement: str
    holds: Callable[[Pair, Pair | None], bool]
    shown: tuple[str, ...]  # quantities of both approaches
    beside: str | None = None  # a log that it is compared with


def less(quantity: str, by: float = 0.0) -> Callable[[Pair, Pair | None], bool]:
    """The hybrid's number is lower by more than so much, and by more than :data:`ALIKE`."""
    return lambda g, _: g("c", quantity) - g("h", quantity) > max(by, ALIKE * g("c", quantity))


def _follows(quantity: str) -> Callable[[Pair, Pair | None], bool]:
    return lambda g, _: min(g("c", quantity), g("h", quantity)) > PROFILE


def _measured(log: str) -> tuple[Claim, ...]:
    """The statements on the experiment, on one of our logs."""
    return (
        Claim("4.4", log, "hybrid reduces the temperature's RMSE", less("K"), ("K",)),
        Claim("4.4", log, "... by 1.3 K on average (tried: by half of that or more)", less("K", 0.65), ("K",)),
        Claim("4.4", log, "hybrid tells the required heat better", less("kW"), ("kW",)),
    )


CLAIMS = (
    Claim("4.3", "oakland", "both follow the temperature's profile", _follows("T correlation"), ("T correlation",)),
    Claim(
        "4.3",
        "oakland",
        "conventional diverges with time (18-24 h against 0-6 h, more than hybrid)",
        lambda g, _: g("c", "18-24 h K") - g("c", "0-6 h K") > max(0.0, g("h", "18-24 h K") - g("h", "0-6 h K")),
        ("0-6 h K", "18-24 h K"),
    ),
    Claim("4.3", "oakland", "conventional has 0.2 to 0.9 K more (tried: 0.2 or more)", less("K", 0.2), ("K",)),
    Claim("4.3", "oakland", "both follow the load's profile", _follows("load correlation"), ("load correlation",)),
    Claim("4.3", "oakland", "hybrid tells the load better", less("kW"), ("kW",)),
    Claim(
        "4.3",
        "oakland",
        "... at weekends above all (by more than on weekdays)",
        lambda g, _: (
            g("c", "weekend kW") - g("h", "weekend kW") > max(0.0, g("c", "weekday kW") - g("h", "weekday kW"))
        ),
        ("weekend kW", "weekday kW"),
    ),
    Claim(
        "4.3",
        "chicago",
        "both do worse in temperature than in the mild climate",
        lambda g, mild: mild is not None and all(g(who, "K") > mild(who, "K") for who in "ch"),
        ("K",),
        "oakland",
    ),
    Claim("4.3", "chicago", "hybrid reduces the RMSE by 0.3 to 2 K (tried: 0.3 or more)", less("K", 0.3), ("K",)),
    Claim(
        "4.3",
        "chicago",
        "hybrid reduces the load's error by 0.05 to 0.18 kW (tried: 0.05 or more)",
        less("kW", 0.05),
        ("kW", "6 h kW"),
    ),
    *_measured("home 2"),
    *_measured("home 3"),
    *_measured("small office"),
    *(
        Claim("5", log, f"errors remain (above {NEGLIGIBLE:g} K)", lambda g, _: g("h", "K") > NEGLIGIBLE, ("K",))
        for log in ("oakland", "chicago")
    ),
)

#: log -> why its numbers are not the paper's; a field is the median of "{method|quantity}"
WHY = {
    "oakland": (
        "the size of the gap is that of the unmeasured gain, which the paper does not list: without a disturbance "
        "even the TRUE network is {TRUE, no disturbance|K} K off. OD took the mean gain of the summer into its "
        "parameters and is {OD, no disturbance|K} K off in winter, {OD, no disturbance|weekend K} K at weekends and "
        "{OD, no disturbance|weekday K} K on weekdays. Here the office is empty at weekends, so that there is less "
        "for a hybrid to win then than on weekdays."
    ),
    "chicago": (
        "as in Oakland; the TRUE network without a disturbance is {TRUE, no disturbance|K} K off, OD "
        "{OD, no disturbance|K} K. Whatever forecasts its disturbance is asked for a season that it never saw: the "
        "mean week of the summer leaves {hybrid OD, profile|K} K, ridge on calendar and weather {hybrid OD, ridge|K} "
        "K, the LSTM {hybrid OD, LSTM|K} K, and OD alone, whose disturbance persists, {OD alone|K} K."
    ),
    "home 2": (
        "where the identified network without a disturbance is {OD, no disturbance|K} K off, there is no 1.3 K to win. "
        "The thermostat moves by 0.1 K in 15 min whether it is heated or not (a standard deviation), and the heat "
        "that would follow each of these moves is {OD, no disturbance|load %} % of the mean off. The default, which "
        "takes no heat for noise, is {default|load %} % off with a correlation of {default|load correlation}: this "
        "log does not tell a load."
    ),
    "home 3": (
        "where the identified network without a disturbance is {OD, no disturbance|K} K off, there is no 1.3 K to win. "
        "The load is {OD, no disturbance|load %} % of the mean off, {default|load %} % with the default."
    ),
    "small office": (
        "the network of OD without a disturbance is {OD, no disturbance|K} K off, a gap of the paper's size. The "
        "load is off by {OD, no disturbance|load %} % of its mean and by {default|load %} % with the default: five "
        "zones are one here, some of them cooled while others are heated."
    ),
}


def judge(claims: tuple[Claim, ...], runs: dict[str, list[pd.DataFrame]]) -> pd.DataFrame:
    """Judge statements for the two-stage scheme and for the default, with the numbers.

    Parameters
    ----------
    claims : tuple of Claim
        Those on logs that were not run are left out.
    runs : dict of list of DataFrame
        For each log a frame a seed: rows methods, columns quantities.

    Returns
    -------
    DataFrame
        A row a claim, index ``paper``; columns ``log``, ``it says``, one a hybrid with the verdict and "conventional
        -> hybrid", medians (lowest to highest).
    """
    rows = []
    for claim in claims:
        if claim.log not in runs or (claim.beside is not None and claim.beside not in runs):
            continue
        row = {"paper": claim.where, "log": claim.log, "it says": claim.statement}
        for column, method in HYBRIDS.items():
            frames = runs[claim.log]
            others = runs[claim.beside] if claim.beside is not None else [None] * len(frames)
            held = [
                claim.holds(_pair(f, method), None if o is None else _pair(o, method))
                for f, o in zip(frames, others, strict=False)  # seeds that both logs were run with
            ]
            row[column] = f"{verdict(sum(held), len(held))}: {_spelled(claim, frames, method)}"
        rows.append(row)
    return pd.DataFrame(rows).set_index("paper")


def verdict(count: int, n: int) -> str:
    """The verdict in words, from the number of runs in which a statement holds; there is none where they disagree."""
    if count in (0, n):
        return "holds" if count else "does not hold"
    return f"no verdict (holds in {count} of {n})"


def _pair(frame: pd.DataFrame, hybrid: str) -> Pair:
    return lambda who, quantity: float(frame.loc[CONVENTIONAL if who == "c" else hybrid, quantity])


def _spelled(claim: Claim, frames: list[pd.DataFrame], method: str) -> str:
    """Each quantity as conventional -> hybrid, medians (lowest to highest) over the runs."""
    parts = []
    for quantity in claim.shown:
        both = [spread([_pair(f, method)(who, quantity) for f in frames]) for who in "ch"]
        parts.append(f"{quantity} {both[0]} -> {both[1]}")
    return ", ".join(parts)
