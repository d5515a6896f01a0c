"""Identification of a zone's building from its log."""

from __future__ import annotations

from typing import Any

import pandas as pd

from ..study.compared_models import make_gray_box
from ..study.data import FACADES
from ..study.identified_building import describe
from ..study.settings import Settings
from .zone_model import complete_rows

_DAYS = 56


def describe_building(settings: Settings, frame: pd.DataFrame) -> pd.DataFrame:
    """Identify the network of the settings on the last weeks of a log, and describe it.

    Parameters
    ----------
    settings : Settings
    frame : DataFrame, one column per role

    Returns
    -------
    DataFrame
        Index: quantity; ``value``, ``std``, ``unit`` and ``remark``.
    """
    return describe(identify_building(settings, frame))


def identify_building(settings: Settings, frame: pd.DataFrame) -> Any:
    """The gray box of the settings, fitted on the last weeks of a log."""
    rows = complete_rows(frame)
    rows = rows[rows.index > rows.index[-1] - pd.Timedelta(days=_DAYS)]
    columns = [c for c in rows if str(c) not in (f"q_sol_{name}" for name in FACADES)]
    return make_gray_box(settings).fit(rows[columns], rows["T_za"])
