"""Findings of the paper's section 4.2 as predicates on our numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import pandas as pd

CASE01 = "DEEP_AR_LSTM_FORECAST-case01"
#: probability from which a claim counts as shown, as in the package's own rules
SHOWN = 0.95

Facts = Mapping[str, float]


class Claim(NamedTuple):
    """One statement of the paper, when it holds, and the numbers that decide."""

    statement: str
    holds: Callable[[Facts], bool]
    shown: tuple[str, ...]


def _likely(name: str) -> Callable[[Facts], bool]:
    return lambda f: f[name] > 0.5


def _unlikely(name: str) -> Callable[[Facts], bool]:
    return lambda f: f[name] < 0.5


def _surely(name: str) -> Callable[[Facts], bool]:
    return lambda f: f[name] >= SHOWN


CLAIMS = (
    Claim("CNN reduces the error against MLP in most samples", _likely("P(CNN)"), ("P(CNN)",)),
    Claim("LSTM reduces it", _likely("P(LSTM)"), ("P(LSTM)",)),
    Claim("RNN does not reduce it", _unlikely("P(RNN)"), ("P(RNN)",)),
    Claim(
        "LSTM has the stronger effect than RNN",
        lambda f: f["effect LSTM [K]"] < f["effect RNN [K]"],
        ("effect LSTM [K]", "effect RNN [K]"),
    ),
    Claim("time features reduce the error (0.95 or more)", _surely("P(time)"), ("P(time)",)),
    Claim("future weather reduces it (0.95 or more)", _surely("P(future-w)"), ("P(future-w)",)),
    Claim("a longer pattern tends to increase it", _unlikely("P(pattern)"), ("P(pattern)",)),
    Claim("past weather tends to increase it", _unlikely("P(past-w)"), ("P(past-w)",)),
    Claim("ID has lower errors than OD (0.95 or more)", _surely("P(ID)"), ("P(ID)",)),
    Claim(
        "RNN and LSTM have the narrower error distributions over sizes",
        lambda f: f["sigma, RNN and LSTM"] < f["sigma, MLP and CNN"],
        ("sigma, RNN and LSTM", "sigma, MLP and CNN"),
    ),
    Claim(
        "hour of week is better than day of week and weekday",
        lambda f: f["log how/dow"] < 0.0 and f["log how/weekday"] < 0.0,
        ("log how/dow", "log how/weekday"),
    ),
    Claim(
        f"{CASE01} (ID) cannot be told from the best",
        lambda f: f["P(best beats LSTM-case01)"] < SHOWN,
        ("P(best beats LSTM-case01)", "rank of LSTM-case01"),
    ),
    Claim(f"the rules choose {CASE01} (ID)", lambda f: f["LSTM-case01 chosen"] > 0, ("LSTM-case01 chosen",)),
    Claim("more hidden layers of the LSTM reduce the error", _likely("P(LSTM n_layers)"), ("P(LSTM n_layers)",)),
    Claim(
        "its width has no effect or a bad one",
        lambda f: f["P(LSTM hidden_size)"] < SHOWN,
        ("P(LSTM hidden_size)",),
    ),
    Claim(
        "hybrid has 0.3 K less than conventional (OD, no disturbance), or better",
        lambda f: f["OD, no disturbance [K]"] - f["chosen [K]"] >= 0.3,
        ("OD, no disturbance [K]", "chosen [K]"),
    ),
    Claim(
        "... than OD alone, whose disturbance persists (not a claim of the paper)",
        lambda f: f["OD alone [K]"] - f["chosen [K]"] >= 0.3,
        ("OD alone [K]", "chosen [K]"),
    ),
)


def judge(facts: Mapping[str, Facts], claims: tuple[Claim, ...] = CLAIMS) -> pd.DataFrame:
    """One row per statement, one column per scope (a climate, or both): the verdict and its numbers."""
    rows = []
    for claim in claims:
        row = {"the paper says": claim.statement}
        for scope, known in facts.items():
            if any(name not in known for name in claim.shown):
                row[scope] = "not applicable to this part"
                continue
            numbers = ", ".join(f"{name} {known[name]:.3g}" for name in claim.shown)
            row[scope] = f"{'holds' if claim.holds(known) else 'does not hold'}: {numbers}"
        rows.append(row)
    return pd.DataFrame(rows).set_index("the paper says")
