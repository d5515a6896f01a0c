"""Rows of a log that are in other units than those that the zone knows."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._ranges import is_in_watts
from .._table import is_plant, listed
from ..study.settings import Settings
from ..study.zone_part import log_columns
from .forecast_archive import ForecastArchive

_OTHER = 5.0  # median difference of the same temperatures, beyond what a sensor is corrected by [K]


def refuse_other_temperatures(frame: pd.DataFrame, archive: ForecastArchive, settings: Settings) -> None:
    """Refuse a log whose temperatures are others than those that the archive, on its clock, has of the same rows."""
    known = archive.measured(frame.index[0])
    if known.empty:
        return
    for role in settings.roles_of("T_za"):
        away = float((frame[role] - known[role]).abs().median()) if role in known else 0.0
        if away > _OTHER:
            raise ValueError(
                f"{role} of the log is {away:.0f} K from what the archive has of the same rows: has its column or its "
                "unit changed? Correct the log, or say in zone.toml how it is read now."
            )


def refuse_watts(new: pd.DataFrame, covered: dict[str, tuple[float, float]], settings: Settings) -> None:
    """Refuse new rows whose heat is in W beside what the training ``covered``, usually and not at a single spike."""
    for role in (role for role in new if is_plant(role) and str(role).startswith("Q_") and role in covered):
        heat = np.abs(new[role].to_numpy(dtype=np.float64))
        running = heat[heat > 0.0]
        if len(running) and is_in_watts(np.array([np.median(running)]), covered[role]):
            raise ValueError(
                f"{listed(log_columns([role], settings)) or role} reaches {heat.max():.4g} kW from {new.index[0]} on, "
                f"and {max(map(abs, covered[role])):.4g} kW in what the model learned from: likely W rather than kW; "
                "correct the rows, or give the unit under [units] of the configuration."
            )
