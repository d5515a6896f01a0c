"""Identification of a zone's building from its log."""

from __future__ import annotations

from typing import Any

import pandas as pd

from ..study.compared_models import make_gray_box
from ..study.identified_rooms import IdentifiedRooms, identify_zones
from ..study.log_split import FACADES
from ..study.settings import Settings
from ..study.spans import NO_ROWS, TRAINING_DAYS
from .complete_rows import complete_rows
from .dead_meters import without_dead_meters, without_further_temperatures


def describe_rooms(settings: Settings, frame: pd.DataFrame) -> IdentifiedRooms:
    """Identify the rooms of a building on the last weeks of a log, and describe them."""
    rows = complete_rows(without_further_temperatures(frame, settings), settings.roles_of("T_za"))
    if rows.empty:
        rows = complete_rows(without_dead_meters(frame, settings), settings.roles_of("T_za"))
    return identify_zones(settings, _last_weeks(rows))


def identify_building(settings: Settings, frame: pd.DataFrame) -> Any:
    """The gray box of the settings, fitted on the last weeks of a log.

    A ValueError says that no row has all inputs and a temperature, or that the network cannot be fitted.
    """
    rows = _last_weeks(complete_rows(without_further_temperatures(frame, settings)))
    return make_gray_box(settings).fit(rows.drop(columns=[*FACADES], errors="ignore"), rows["T_za"])


def _last_weeks(rows: pd.DataFrame) -> pd.DataFrame:
    if rows.empty:
        raise ValueError(NO_ROWS)
    return rows[rows.index > rows.index[-1] - pd.Timedelta(days=TRAINING_DAYS)]
