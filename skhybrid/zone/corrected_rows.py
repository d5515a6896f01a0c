"""Rows that a log has corrected since a model took them in."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._clock import on_clock_of
from ..study.settings import Settings
from .forecast_archive import ForecastArchive
from .zone_state import measured_rows

_ENOUGH = pd.Timedelta("3h")  # corrected rows that are worth a new fit
_CORRECTED_BY = 0.5  # of a temperature [K]
_SHARE = 0.1  # of a heat, relative to the largest of the week


def corrected_since(frame: pd.DataFrame, archive: ForecastArchive, settings: Settings) -> pd.Timestamp | None:
    """The first of the rows of the last week that are not as they were archived; None where they come to less than 3 h.

    The archive is on the clock of the log; a temperature that it lacks counts, as one that came late does.
    """
    last = archive.last_measured()
    if last is None:
        return None
    rows = measured_rows(frame, settings, on_clock_of(last, frame.index), last)
    if rows.empty:
        return None
    known = archive.measured(rows.index[0])
    if (pd.DatetimeIndex(known.index).tz is None) != (pd.DatetimeIndex(rows.index).tz is None):
        return None
    roles = [role for role in map(str, known) if role in rows and role.startswith(("T_za", "Q_hvac"))]
    before, now = known[roles].align(rows[roles], join="inner", axis=0)
    is_T = np.array([role.startswith("T_za") for role in roles])
    wide = np.where(is_T, _CORRECTED_BY, _SHARE * before.abs().max())
    differs = ((before - now).abs() > wide) | (before.isna() & now.notna() & is_T)
    found = before.index[differs.any(axis=1)]
    enough = len(found) * pd.Timedelta(settings.step) >= _ENOUGH
    return on_clock_of(found[0], rows.index) if enough else None
