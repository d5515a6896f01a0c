"""Tomorrow and past forecasts of a zone folder, in the time zone of its log."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..study.settings import is_scaled
from ..zone import ZoneFolder, ZoneModel
from ..zone.forecast_archive import open_archive

_PAST = pd.Timedelta(days=28)
_LEVELS = ["q_0.1", "q_0.9"]


class ZoneView(NamedTuple):
    """A zone as it is now."""

    name: str
    timezone: str | None
    step: pd.Timedelta
    scaled: bool  # whether the log fixes what a kW is
    origin: pd.Timestamp | None  # of the last forecast
    forecast: pd.DataFrame  # by time, with the columns of the archive; empty where there is none
    past: pd.DataFrame  # forecasts of the last four weeks that have run out, and what was measured


def view_zone(folder: ZoneFolder, zone: ZoneModel) -> ZoneView:
    """A zone as it is now, by the model of its folder.

    Raises
    ------
    OSError
        If the archive cannot be read.
    """
    tz = zone.learned_until.tz
    scaled = is_scaled(zone.covered(), zone.settings.capacities)
    with open_archive(folder.archive) as archive:
        last = archive.last_measured()
        since = pd.Timestamp(0) if last is None else last - _PAST
        past, origin, forecast = archive.finished(since), archive.last_origin(), archive.latest()
    past = past.assign(
        **{name: _local(pd.DatetimeIndex(pd.to_datetime(past[name])), tz) for name in ("origin", "time")}
    )
    forecast = forecast.set_axis(_local(forecast.index, tz), axis=0)
    return ZoneView(
        zone.settings.name,
        None if tz is None else str(tz),
        pd.Timedelta(zone.settings.step),
        scaled,
        None if origin is None else _local(pd.DatetimeIndex([origin]), tz)[0],
        forecast.dropna(axis=1, how="all"),
        past,
    )


def _local(index: Any, tz: Any) -> pd.DatetimeIndex:
    index = pd.DatetimeIndex(index)
    return index if index.tz is None or tz is None else index.tz_convert(tz)


def plain_rows(forecast: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a forecast as plain values; what is not known is None."""
    names = {"T_za": "T_za", "q_0.1": "T_za_low", "q_0.9": "T_za_high"}
    names |= {"Q_hvac": "Q_hvac", "Q_hvac_0.1": "Q_hvac_low", "Q_hvac_0.9": "Q_hvac_high"}
    table = forecast.reindex(columns=list(names)).set_axis(list(names.values()), axis=1).round(4).astype(object)
    rows = table.where(table.notna(), None).to_dict("records")
    return [
        {"time": stamp.isoformat()} | {str(k): v for k, v in row.items()}
        for stamp, row in zip(forecast.index, rows, strict=True)
    ]


def compared(past: pd.DataFrame) -> pd.DataFrame:
    """Past forecasts of temperature as a back-test."""
    names = {"T_za": "y_pred", "T_za_measured": "y_true"}
    rows = past[["origin", "time", *names, *_LEVELS]].rename(columns=names)
    return rows if np.isfinite(rows["q_0.1"]).any() else rows.drop(columns=_LEVELS)
