"""The verdict on a forecast: usable, use with care or not usable, for temperature and load, with reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._warnings import percent

NO_SCALE = "its kW have no certain scale, since no capacity of the plant is known"
USABLE, CARE, NOT = "usable", "use with care", "not usable"
WORST_FIRST = (NOT, CARE, USABLE)
_BLOCK = 2  # origins that are drawn together, since neighbours err alike
_DRAWS = 2000
_SURE = (0.05, 0.95)  # quantiles of the bootstrapped ratio of errors that bound its interval
_COVERAGE = (0.70, 0.90)  # shares of the measurements that sound 80 % intervals contain
_WORST_COVERAGE = 0.5
_FEW = 5  # with fewer origins nothing is sure


class Verdict(NamedTuple):
    """A judgement on one forecast, with reasons in plain words."""

    quantity: str  # "temperature" or "load"
    level: str
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join([f"{self.quantity}: {self.level}", *(f"  - {reason}" for reason in self.reasons)])


class Comparison(NamedTuple):
    """Ratio of a model's error to that of a simple rule, with its 90 % interval (0 to inf: too few to tell)."""

    rule: str
    ratio: float
    low: float
    high: float

    def words(self) -> str:
        """The comparison as a reason."""
        if np.isinf(self.ratio):
            return f"{self.rule} makes no error, as where a plant stays off"
        if self.low > 1.0:
            return f"{self.rule} is better: its error is {1.0 / self.ratio:.2f} times ours"
        if np.isinf(self.high):
            return f"its error is {self.ratio:.2f} times that of {self.rule}, over too few forecasts to judge by"
        span = f"90 % interval {self.low:.2f} to {self.high:.2f}"
        if self.high < 1.0:
            return f"its error is {self.ratio:.2f} times that of {self.rule} ({span})"
        return f"it is not surely better than {self.rule} (ratio {self.ratio:.2f}, {span})"


def compare_errors(own: pd.Series, rule: pd.Series, blocks: pd.Series, name: str) -> Comparison:
    """Compare errors (n,) at the same rows, by a bootstrap over neighbouring ``blocks`` (n,), origins or days."""
    known = (own.notna() & rule.notna()).to_numpy()
    squares = pd.DataFrame({"own": own[known] ** 2, "rule": rule[known] ** 2, "block": blocks[known].to_numpy()})
    sums = squares.groupby("block")[["own", "rule"]].sum().to_numpy()
    if not len(sums) or not sums.sum():
        return Comparison(name, np.nan, np.nan, np.nan)
    with np.errstate(divide="ignore"):  # a rule may make no error, such as that of a plant that stays off
        ratio = float(np.sqrt(np.divide(*sums.sum(axis=0))))
    if len(sums) <= _BLOCK:
        return Comparison(name, ratio, 0.0, np.inf)
    n_blocks = -(-len(sums) // _BLOCK)
    start = np.random.default_rng(0).integers(0, len(sums), (_DRAWS, n_blocks))
    drawn = (start[..., None] + np.arange(_BLOCK)).reshape(_DRAWS, -1) % len(sums)
    totals = sums[drawn].sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.sqrt(totals[:, 0] / totals[:, 1])
        low, high = np.nan_to_num(np.nanquantile(ratios, _SURE), nan=np.inf, posinf=np.inf)  # between two inf: nan
    return Comparison(name, ratio, float(low), float(high))


def judge(
    quantity: str,
    comparisons: Sequence[Comparison],
    *,
    n_origins: int,
    coverage: float | None = None,
    doubts: Sequence[str] = (),
) -> Verdict:
    """A verdict on a temperature or load from comparisons with simple rules and from what else is known.

    ``coverage`` is the share of measurements inside the 80 % intervals; ``doubts`` are further reasons to take care.
    """
    known = [c for c in comparisons if not np.isnan(c.ratio)]
    if not known:
        why = f"there is nothing to compare the {quantity} with" if n_origins else "no past forecast can be scored yet"
        return Verdict(quantity, CARE, (why, *doubts))
    hardest = max(known, key=lambda c: c.ratio)
    reasons = [hardest.words()]
    care = hardest.high >= 1.0
    failed = 1.0 < hardest.low < np.inf  # where a plant stays off, a rule makes no error
    few = n_origins < _FEW
    if few:
        care, reasons = True, [*reasons, f"it was tested on {n_origins} forecast{'s' * (n_origins != 1)} only"]
    if coverage is not None and not _COVERAGE[0] <= coverage <= _COVERAGE[1]:
        care, failed = True, failed or coverage < _WORST_COVERAGE
        reasons.append(f"its 80 % intervals contained {percent(coverage)} of the measurements")
    reasons += doubts
    return Verdict(quantity, NOT if failed and not few else CARE if care or doubts else USABLE, tuple(reasons))


def judge_temperature(
    own: pd.DataFrame, yesterday: pd.DataFrame, coverage: float | None = None, doubts: Sequence[str] = ()
) -> Verdict:
    """The verdict on a back-test beside that of the day before, at the same origins."""
    error, rule = ((frame["y_pred"] - frame["y_true"]).reset_index(drop=True) for frame in (own, yesterday))
    compared = compare_errors(error, rule, own["origin"].reset_index(drop=True), "yesterday's temperature")
    n_origins = own.loc[own["y_true"].notna(), "origin"].nunique()
    return judge("temperature", [compared], n_origins=n_origins, coverage=coverage, doubts=doubts)


def judge_load_errors(
    own: pd.Series,
    rules: Mapping[str, pd.Series],
    blocks: pd.Series,
    *,
    scaled: bool,
    coverage: float | None = None,
    doubts: Sequence[str] = (),
) -> Verdict:
    """The verdict on loads by errors at the same rows, of which ``blocks`` are the days or the origins."""
    compared = [compare_errors(own, error, blocks, name) for name, error in rules.items()]
    reasons = [*([] if scaled else [NO_SCALE]), *doubts]
    return judge("load", compared, n_origins=blocks.nunique(), coverage=coverage, doubts=reasons)


def worst_first(levels: Mapping[str, list[str]]) -> list[str]:
    """Zones by the worst of their levels, those without any last; else in their order."""
    return sorted(levels, key=lambda zone: min(map(WORST_FIRST.index, levels[zone]), default=len(WORST_FIRST)))


def worst(verdicts: Sequence[Verdict]) -> str:
    """The worst level of some verdicts."""
    return min((one.level for one in verdicts), key=WORST_FIRST.index)


def named_by_zone(verdicts: Mapping[str, Sequence[Verdict]]) -> list[Verdict]:
    """The verdicts of all zones in their order, each with the zone in its quantity."""
    pairs = ((zone, one) for zone, found in verdicts.items() for one in found)
    return [one._replace(quantity=f"{one.quantity} of {zone}") for zone, one in pairs]


def zones_in_words(verdicts: Mapping[str, Sequence[Verdict]]) -> str:
    """The number of zones that are usable, and those that are not."""
    levels = {zone: worst(found) for zone, found in verdicts.items()}
    of_level = {level: [zone for zone, own in levels.items() if own == level] for level in (USABLE, CARE, NOT)}
    n, n_usable = len(levels), len(of_level[USABLE])
    words = [
        {n: f"All {n} zones are usable", 0: "No zone is usable without care"}.get(
            n_usable, f"{n_usable} of {n} zones are usable"
        )
    ]
    words += [f"{level}: {', '.join(of_level[level])}" for level in (NOT, CARE) if of_level[level]]
    return "; ".join(words) + "."
