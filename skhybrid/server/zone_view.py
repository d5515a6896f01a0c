"""The latest and the past forecasts of a zone folder, in the time zone of its log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._clock import in_time_zone
from ..zone import ZoneModel
from ..zone.forecast_archive import ForecastArchive
from ..zone.zone_state import archives_of

_PAST = pd.Timedelta(days=28)
_LEVELS = ["q_0.1", "q_0.9"]
#: columns of the archive -> their names in an answer
QUANTITIES = {
    "T_za": "T_za", "q_0.1": "T_za_low", "q_0.9": "T_za_high", "Q_hvac": "Q_hvac", "Q_hvac_0.1": "Q_hvac_low",
    "Q_hvac_0.9": "Q_hvac_high",
}  # fmt: skip


class ZoneView(NamedTuple):
    """A zone as it is now, alone or one of several."""

    name: str
    timezone: str | None
    step: pd.Timedelta
    scaled: bool  # whether the log fixes what a kW is
    origin: pd.Timestamp | None  # of the last forecast
    forecast: pd.DataFrame  # by time, with the columns of the archive; empty where there is none
    past: pd.DataFrame  # forecasts of the last four weeks that are over, and what was measured


def view_zones(archive: ForecastArchive, zone: ZoneModel) -> dict[str, ZoneView]:
    """Each zone as it is now, by the archive and the model of its folder; one zone by an empty name."""
    archives = archives_of(archive, zone)
    return {name: _view(archives[name], part) for name, part in zone.parts().items()}


def _view(archive: ForecastArchive, zone: ZoneModel) -> ZoneView:
    tz = zone.learned_until.tz
    last = archive.last_measured()
    since = pd.Timestamp(0) if last is None else last - _PAST
    past, origin, forecast = archive.finished(since), archive.last_origin(), archive.latest()
    past = past.assign(**{name: in_time_zone(pd.DatetimeIndex(past[name]), tz) for name in ("origin", "time")})
    forecast = forecast.set_axis(in_time_zone(forecast.index, tz), axis=0)
    return ZoneView(
        zone.settings.name,
        None if tz is None else str(tz),
        pd.Timedelta(zone.settings.step),
        zone.scaled,
        None if origin is None else in_time_zone(pd.DatetimeIndex([origin]), tz)[0],
        forecast.dropna(axis=1, how="all"),
        past,
    )


def plain_rows(views: Mapping[str, ZoneView]) -> list[dict[str, Any]]:
    """The rows of a forecast as plain values, those of several zones with names that end with the zone's.

    What is not known is None.
    """
    tables = []
    for zone, view in views.items():
        table = view.forecast.reindex(columns=list(QUANTITIES)).set_axis(list(QUANTITIES.values()), axis=1)
        tables.append(table.add_suffix(f"_{zone}" if zone else ""))
    table = pd.concat(tables, axis=1).round(4).astype(object)
    rows = table.where(table.notna(), None).to_dict("records")
    return [
        {"time": stamp.isoformat()} | {str(k): v for k, v in row.items()}
        for stamp, row in zip(table.index, rows, strict=True)
    ]


def compared(past: pd.DataFrame) -> pd.DataFrame:
    """Past forecasts of temperature as a back-test."""
    names = {"T_za": "y_pred", "T_za_measured": "y_true"}
    rows = past[["origin", "time", *names, *_LEVELS]].rename(columns=names)
    return rows if np.isfinite(rows["q_0.1"]).any() else rows.drop(columns=_LEVELS)
