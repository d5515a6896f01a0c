"""The training rows and the test rows of a study: the spans that its settings give, in the rows that were measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from .._time import LONGEST_BRIDGE, even_step
from ..preprocessing.bridges import bridged, complete, stretches
from .settings import Settings

TRAINING_DAYS = 56  # at the end of a log: longer ones bring seasons that tomorrow does not have
NO_ROWS = "no row of the log has all inputs and a temperature; skhybrid check shows which are missing."


def train_and_test(frame: pd.DataFrame, settings: Settings) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The training rows and the test rows of a log; without settings, two thirds and one third of the days.

    A ValueError says that a span has no rows, or that the test begins before the training ends.
    """
    if frame.empty:
        raise ValueError(NO_ROWS)
    train, test = dict(settings.train), dict(settings.test)
    if "end" not in train and "start" not in test:
        days = pd.DatetimeIndex(frame.index).normalize().unique()
        train["end"] = days[max(1, round(len(days) * 2 / 3)) - 1].date()
    first, second = _rows(frame, train, "train"), _rows(frame, test, "test")
    if "end" not in train:
        first = first.loc[first.index < second.index[0]]
    if "start" not in test:
        second = second.loc[second.index > first.index[-1]]
    for name, rows in (("train", first), ("test", second)):
        if rows.empty:
            raise ValueError(f"[{name}] has no rows; the log spans {frame.index[0]} to {frame.index[-1]}.")
    if second.index[0] <= first.index[-1]:
        raise ValueError(f"[test] begins at {second.index[0]}, but [train] ends at {first.index[-1]}.")
    return first, second


def _rows(frame: pd.DataFrame, span: Mapping[str, Any], name: str) -> pd.DataFrame:
    start, end = (None if span.get(key) is None else str(span[key]) for key in ("start", "end"))
    try:
        rows = frame.loc[start:end]
    except (KeyError, ValueError, TypeError, AttributeError):  # the last for NaT
        raise ValueError(f"[{name}] start = {start!r}, end = {end!r} are not dates such as 2021-11-30.") from None
    if rows.empty:
        raise ValueError(
            f"[{name}] from {start or 'the start'} to {end or 'the end'} has no rows; the log spans "
            f"{frame.index[0]} to {frame.index[-1]}."
        )
    return rows


def cut_spans(measured: pd.DataFrame, settings: Settings) -> Iterator[str]:
    """Remarks on spans of the settings that reach beyond the measured rows, which cut them."""
    first, last = measured.index[0], measured.index[-1]
    for name, span in (("train", settings.train), ("test", settings.test)):
        start, end = (_wall_time(span.get(key, "NaT"), last.tz) for key in ("start", "end"))
        if start < first.tz_localize(None).normalize():
            yield f"[{name}] start = {span['start']} is before the first measured row; it starts at {first}."
        if end > last.tz_localize(None):
            yield f"[{name}] end = {span['end']} is after the last measured row; it ends at {last}."


def _wall_time(stamp: Any, timezone: Any) -> pd.Timestamp:
    """A date or stamp of the settings on the log's clock."""
    read = pd.Timestamp(str(stamp))
    return read if read.tz is None else read.tz_convert(timezone).tz_localize(None)


def over_outages(rows: pd.DataFrame, settings: Settings) -> pd.DataFrame:
    """Training rows with bridges over outages of the inputs; longer ones stay missing, for the models to refuse."""
    temperatures = settings.roles_of("T_za")
    known = complete(rows, temperatures)
    inside = len(known) > 1 and known.index[0] == rows.index[0] and known.index[-1] == rows.index[-1]
    if not inside or len(stretches(known, LONGEST_BRIDGE)) > 1:
        return rows
    step = even_step(pd.DatetimeIndex(rows.index))
    return bridged(rows, step, temperatures, settings.setpoints).set_axis(rows.index)
