"""The clock of a log, judged by the sun: the hour of its noon, and days on which that hour changes for good."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd

from .._clock import hour_of_day

_NOON = (9.5, 14.5)  # hours between which the middle of a day's sun lies, on any wall clock
_LIGHT = 0.005  # of the highest irradiance, above which it is day
_BESIDE, _FEWEST = 10, 5  # days on each side of a change that show it, and the least of them with a known noon
_LEAST_JUMP = 0.6  # hours, which neither seasons nor clouds bring from one week to the next, and
_SAME = pd.Timedelta("3D")  # between two signs of one change, of which the sun's may be late
_CLEAR = 3.0  # times what noons vary by within these days


def noon_text(known: pd.Series) -> str | None:
    """A sentence on a sun that is not highest around noon by the log's clock, or never shines; None for any other."""
    index = pd.DatetimeIndex(known.index)
    hour = index.hour + index.minute / 60.0
    sun = known.clip(lower=0.0).to_numpy()
    if sun.sum() <= 0.0:
        return "the sun never shines."
    angle = 2.0 * np.pi * np.asarray(hour) / 24.0
    middle = np.angle(np.sum(sun * np.exp(1j * angle))) * 24.0 / (2.0 * np.pi) % 24.0
    if _NOON[0] <= middle <= _NOON[1]:
        return None
    text = f"the sun culminates at {int(middle)}:{int(middle % 1 * 60):02d} by the log's clock"
    utc = " If the stamps are UTC, name their column 'time (UTC)'." if index.tz is None else ""
    return f"{text}; is the time zone right?{utc}"


def jump_texts(known: pd.Series, told: Iterable[pd.Timestamp] = ()) -> Iterator[str]:
    """A sentence on each day from which on the sun rises and sets at other hours, as where a clock was set.

    There is none beside stamps of which the user is ``told``.
    """
    for day, hours in clock_jumps(known):
        if any(abs(day - stamp) < _SAME for stamp in told):
            continue
        way = f"{'later' if hours > 0 else 'earlier'} by the log's clock than before"
        text = f"from {day:%Y-%m-%d} on, the sun rises and sets about {round(2.0 * abs(hours)) / 2.0:g} h {way}"
        if pd.DatetimeIndex(known.index).tz is None:
            yield f"{text}: was the clock set, as for daylight saving? Give timezone, or correct the stamps."
        else:
            yield f"{text}: was the clock set, or has it no daylight saving? Correct the stamps, or the time zone."


def clock_jumps(sun: pd.Series) -> list[tuple[pd.Timestamp, float]]:
    """Days from which on the middle between sunrise and sunset is at another hour, and by how many hours.

    Daylight saving of a known time zone is no such change.
    """
    if not (sun > 0.0).any():
        return []
    noons, found = _noons(sun), []
    both = np.array([[_move(noons[way].to_numpy(), day) for way in noons] for day in range(len(noons))]).reshape(-1, 2)
    moves = np.where(both.prod(axis=1) > 0.0, both.mean(axis=1), 0.0)
    while moves.any():
        at = int(np.argmax(np.abs(moves)))
        found.append((noons.index[at], float(moves[at])))
        moves[max(at - _BESIDE, 0) : at + _BESIDE] = 0.0
    return sorted(found)


def _move(noons: np.ndarray, day: int) -> float:
    """Change of the hour of noon (n,) from the days before a day to those from it on [h]; 0 where it is not clear."""
    before, after = noons[max(day - _BESIDE, 0) : day], noons[day : day + _BESIDE]
    before, after = (part[np.isfinite(part)] for part in (before, after))
    if min(len(before), len(after)) < _FEWEST:
        return 0.0
    move = after.mean() - before.mean()
    varies = np.sqrt((before.var() + after.var()) / 2.0)
    return float(move) if abs(move) > max(_LEAST_JUMP, _CLEAR * varies / np.sqrt(len(after))) else 0.0


def _noons(sun: pd.Series) -> pd.DataFrame:
    """Hour in the middle between first and last light of each day, and in the middle of its sun; by UTC where known.

    Clouds of a few mornings move the latter, those of a dark season the former.
    """
    index = pd.DatetimeIndex(sun.index)
    zone = None if index.tz is None else index[0].utcoffset()
    clock = index if zone is None else index.tz_convert("UTC").tz_localize(None) + zone  # without daylight saving
    light = (sun > _LIGHT * sun.quantile(0.999)).to_numpy()
    hours, values = hour_of_day(clock)[light], sun.to_numpy()[light]
    days = pd.DataFrame({"hour": hours, "sun": values, "both": hours * values}).groupby(clock.normalize()[light])
    between, sums = (days["hour"].min() + days["hour"].max()) / 2.0, days[["both", "sun"]].sum()
    whole = pd.date_range(clock.min().normalize(), clock.max().normalize(), freq="D")
    return pd.DataFrame({"light": between, "sun": sums["both"] / sums["sun"]}).reindex(whole)
