"""The rows of a log that a zone's model learns from, with warnings of those that it leaves out or may be wrong."""

from __future__ import annotations

import pandas as pd

from .._table import is_plant, listed
from .._time import LONGEST_BRIDGE
from .._warnings import several, warn_user
from ..exceptions import SkhybridWarning
from ..logs.log_findings import doubts_on_log
from ..preprocessing.bridges import bridged, complete, stretches
from ..study.log_split import with_facades
from ..study.settings import Settings
from ..study.zone_part import log_columns
from .complete_rows import up_to_measured
from .dead_meters import without_dead_meters

_LEAST_DAYS = 3


def refuse_empty(frame: pd.DataFrame, settings: Settings) -> None:
    """Refuse a log of whose inputs, or rooms, one has no value at all."""
    for role in map(str, frame):
        if frame[role].isna().all() and (role in settings.columns or is_plant(role)):
            names = listed(log_columns([role], settings) or [role])
            raise ValueError(f"{names} ({role}) has no values in the log; log it, or take it out of [columns].")


def training_rows(frame: pd.DataFrame, settings: Settings, days: int) -> pd.DataFrame:
    """The last ``days`` of a log between outages of more than four days, with bridges over shorter ones.

    On a bridge the inputs are interpolated and no temperature is known.  Of several parts between long outages the
    longest is taken, also where a later one has three weeks: it gains by its age about what it loses by fewer rows.
    If bridges would be most of that part, the longest stretch without any outage is taken; less than three complete
    days are refused.
    """
    rooms = settings.roles_of("T_za")
    for doubt in doubts_on_log(frame, [role for role in rooms if role in frame]):
        warn_user(doubt, SkhybridWarning)
    alive = without_dead_meters(frame, settings)
    refuse_empty(alive, settings)
    whole = up_to_measured(with_facades(alive, settings), rooms)
    rows = complete(whole, rooms)
    step, day = pd.Timedelta(settings.step), pd.Timedelta("1D")
    last = rows[rows.index > rows.index[-1] - days * day] if len(rows) else rows
    known, beyond = max(stretches(last, LONGEST_BRIDGE), key=len), "outages of more than four days"
    if len(known) and 2 * len(known) * step <= known.index[-1] - known.index[0]:
        known, beyond = max(stretches(last, step), key=len), "outages"
    if len(known) * step < _LEAST_DAYS * day:
        raise ValueError(
            f"of the {days} days before {frame.index[-1]}, the log has {len(known) * step / day:.1f} days with all of "
            f"{', '.join(map(str, known))}; a model needs {_LEAST_DAYS} (see skhybrid check)."
        )
    if n_out := len(last) - len(known):
        recent = last[last.index > known.index[-1]]
        among = f", of which the last begin at {recent.index[0]}" if len(recent) else ""
        warn_user(
            f"learned from {known.index[0]} to {known.index[-1]} alone, and not from {several(n_out, 'complete row')} "
            f"beyond {beyond}{among} (skhybrid check shows the gaps).",
            SkhybridWarning,
        )
    parts = stretches(known, step)
    if n_bridges := len(parts) - 1:
        first = f"{parts[0].index[-1]} to {parts[1].index[0]}"
        warn_user(
            f"learned over {several(n_bridges, 'outage')}, the first from {first}: the inputs are interpolated there, "
            "and no temperature is known.",
            SkhybridWarning,
        )
    return bridged(whole.loc[known.index[0] : known.index[-1]], step, rooms, settings.setpoints)
