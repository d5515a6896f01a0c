"""Identification of a zone's building from its log."""

from __future__ import annotations

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
    rows = complete_rows(frame)
    rows = rows[rows.index > rows.index[-1] - pd.Timedelta(days=_DAYS)]
    gray_box = make_gray_box(settings)
    columns = [c for c in rows if str(c) not in (f"q_sol_{name}" for name in FACADES)]
    return describe(gray_box.fit(rows[columns], rows["T_za"]))
