"""Faults of a log: in its clock, its gaps, its sensors and its units."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._ranges import is_in_watts, range_of
from .._table import SETPOINT_ROLES, is_cooling, is_plant, is_stage
from .._time import SHORTEST_GAP, spell
from .._warnings import percent, several
from .column_spans import lost_columns
from .counters import counter_jumps, counter_resets, counter_tick
from .even_steps import own_steps
from .naming import DOUBTFUL, FEW_FOR_PERCENT, OF_A_MODE, OF_FUEL, PART_OF_SUN
from .standstills import room_standstills, standstills
from .sun_clock import jump_texts, noon_text

_UNCHANGED = pd.Timedelta("3D")  # no sun and hardly a plant is the same for so long
_JUMP = {"T_za": 4.0, "T_oa": 6.0}  # change within half an hour, and back, that no air makes [K]
_LONG_GAP = 4.0  # steps without a row, from which on a gap is named
_ABSENT = 0.02  # share of rows without a value, from which on it is named
_CLASHING = 0.1  # share of rows with the stamp of another one that no change of clocks brings
_LONELY = 0.01  # rows far from all others, relative to these, whose stamps may be wrong
_SPRING, _AUTUMN, _MORNING = 3, (10, 11), 4  # months, and the hour of the night before which clocks are set
_MOST_NAMED = 5  # findings of one kind that are listed
_INDOORS = (10.0, 32.0)  # outdoor temperatures that stay within are like those of a room [degC]
_COLDER = 5.0  # a room is not that much colder than it ever is outdoors, and moves more, at once [K]
_MORE_MOVED = 1.5  # range of the room's temperature relative to that outdoors
_TOO_LITTLE = 0.01  # kW of a plant, and kW/m2 of the sun of a log
RUNS = 0.1  # heat, relative to its peaks, from which on a plant runs
_OFTEN = 0.05  # share of the rows in which a plant heats or cools
_ONE_PERCENT = 0.0101  # a stage that never gets further is a fraction, read as percent
_COARSE = 6.0  # hours of a step of a counter, beyond which the course of a day is lost


class Finding(NamedTuple):
    """One remark on a log."""

    level: str  # "error": must be mended; "warning": may spoil a model; "note"
    where: str  # column, or "clock"
    text: str


def clock_findings(
    index: pd.DatetimeIndex, step: pd.Timedelta, label: str | None, assumed: str = "left"
) -> Iterator[Finding]:
    """Remarks on stamps as the log has them, in the order of the log; ``assumed`` is their label where it has none."""
    if back := len(stamps_going_back(index)):
        yield Finding("note", "clock", f"stamps go back {several(back, 'time')}; rows are sorted.")
    changes, again = daylight_changes(index), index[index.duplicated()]
    if twice := len(again := again[~again.normalize().isin(changes.normalize())]):
        occur = f"{several(twice, 'stamp')} {'occurs' if twice == 1 else 'occur'} twice"
        text = f"{occur}, first {again[0]}; the first value of each column is used."
        yield Finding("warning", "clock", text)
    ordered = index.sort_values().unique()
    steps = own_steps(ordered, step.total_seconds())
    for row in np.flatnonzero(np.diff(steps))[:_MOST_NAMED]:
        distance = spell(pd.Timedelta(seconds=round(steps[row + 1])))
        yield Finding("note", "clock", f"from {ordered[row + 1]} on, a row comes every {distance}.")
    if index.tz is None:
        text = "stamps have no time zone; give timezone = a local one, so that hours and holidays are right."
        if len(changes):
            hour = "an hour is missing after" if changes[0].month == _SPRING else "an hour occurs twice from"
            shown = f"the clock of the stamps has daylight saving: {hour} {changes[0]}"
            text = f"{shown}; give timezone = its zone, so that this hour, days and holidays are right."
        yield Finding("warning", "clock", text)
    elif not is_local(index):
        text = f"stamps are in {index.tz}, without daylight saving; give timezone = the local zone"
        yield Finding(
            "note", "clock", f"{text}, so that hours, days and set-points by the clock are those of the room."
        )
    if label is None:
        text = "the log does not say whether a stamp begins (left) or ends (right) the interval of its means"
        yield Finding("note", "clock", f"{text}; {assumed} is assumed.")


def clash(frame: pd.DataFrame) -> str | None:
    """A sentence where many rows have the stamp of another one and other values; None where few have.

    Stamps that are cut to minutes, among rows that come faster, are no clash.
    """
    if frame.empty:
        return None
    index = pd.DatetimeIndex(frame.index)
    again, stamps = index.duplicated(), index.unique().sort_values()
    if again.mean() <= _CLASHING or len(stamps) < 2 or (stamps[1:] - stamps[:-1]).min() <= pd.Timedelta("1min"):
        return None
    later, first = frame[again], frame[~again].loc[index[again]]
    other = (later.to_numpy() != first.to_numpy()) & later.notna().to_numpy() & first.notna().to_numpy()
    rows = np.flatnonzero(other.any(axis=1))
    if len(rows) <= _CLASHING * len(frame):
        return None
    text = f"{len(rows)} of {len(frame)} rows have the stamp of another row and other values"
    asked = "is the time of day, AM or PM, or the name of the room in another column?"
    points = "if a column names points, give it as point_column in [log], with format = 'change of value'"
    remedy = f"Give each row a stamp of its own, and each room its columns; {points}."
    return f"{text}, first {later.index[rows[0]]}: {asked} {remedy}"


def is_local(index: pd.DatetimeIndex) -> bool:
    """Whether stamps have the zone of a place, which knows of daylight saving, and not a fixed offset."""
    return "/" in (zone := str(index.tz)) and not zone.startswith("Etc/")


def stamps_going_back(index: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Stamps that are earlier than the one before, but for those of a clock that was put back for the winter."""
    back = index[1:][index[1:] < index[:-1]]
    return back[~back.normalize().isin(daylight_changes(index).normalize())]


def daylight_changes(index: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Stamps without a zone at which a Sunday's night misses an hour in spring or has one twice in autumn."""
    if index.tz is not None:
        return index[:0]
    ordered, again = index.sort_values().unique(), index[index.duplicated()].unique()
    distance = ordered[1:] - ordered[:-1]
    usual, days = distance.to_series().median(), again.normalize()
    again = again[days.value_counts().reindex(days).to_numpy() <= pd.Timedelta("1h") / usual]
    before = ordered[:-1][distance == usual + pd.Timedelta("1h")]
    found = pd.DatetimeIndex(before[before.month == _SPRING].append(again[again.month.isin(_AUTUMN)])).sort_values()
    found = found[(found.day_of_week == 6) & (found.hour < _MORNING)]
    return found[~found.normalize().duplicated()]


def gaps_of(index: pd.DatetimeIndex, step: pd.Timedelta) -> pd.DataFrame:
    """Gaps of the rows: last stamp before, first after, and hours."""
    ordered = index.sort_values().unique()
    wide = np.flatnonzero(ordered[1:] - ordered[:-1] > _LONG_GAP * step)
    before, after = ordered[wide], ordered[wide + 1]
    return pd.DataFrame({"last": before, "next": after, "hours": (after - before) / pd.Timedelta("1h")})


def gap_findings(gaps: pd.DataFrame, index: pd.DatetimeIndex) -> Iterator[Finding]:
    """Remarks on the gaps of the rows, and on a few rows that are further from the others than these are long."""
    if gaps.empty:
        return
    widest = gaps.iloc[int(gaps["hours"].to_numpy().argmax())]
    text = f"{several(len(gaps), 'gap')}; the longest lasts {widest['hours']:.1f} h from {widest['last']}."
    yield Finding("note", "clock", text)
    few, others = sorted((index[index <= widest["last"]], index[index > widest["last"]]), key=len)
    if len(few) <= _LONELY * len(others) and widest["next"] - widest["last"] > others.max() - others.min():
        text = f"{several(len(few), 'row')} from {few.min()} on, {widest['hours'] / 24.0:.0f} days from all others"
        yield Finding("warning", "clock", f"{text}: are these stamps right?")


def sensor_findings(
    role: str,
    name: str,
    values: pd.Series,
    even: pd.Series | None = None,
    controlled: pd.Series | None = None,
    counts: bool = False,
) -> Iterator[Finding]:
    """Remarks on one column in its contract unit.

    ``even`` are its values at even steps, where it is held, and ``controlled`` the rows of :func:`controlled_rows`;
    ``counts`` says that the column is a counter.
    """
    known = values.dropna()
    if known.empty:
        yield Finding("error" if role in ("T_za", "T_oa") else "warning", name, "no row has a number.")
        return
    missing = (values if even is None else even).isna()
    if missing.mean() > _ABSENT:
        yield Finding("note", name, f"{percent(missing.mean())} of the rows have no value.")
    elif len(longest := _longest_run(missing[missing.index <= known.index.max()])):  # rows ahead need no value
        span = f"from {longest[0]} to {longest[-1]}"
        yield Finding("note", name, f"no value {span}; gaps of more than 3 h are not filled.")
    yield from _beyond(role, name, known)
    yield from _standing_still(role, name, values, controlled)
    if role in _JUMP:
        yield from _jumping(name, known, _JUMP[role])
    if role.startswith("q_sol"):
        jumps = jump_texts(known, daylight_changes(pd.DatetimeIndex(known.index)))
        yield from (Finding("warning", name, text) for text in (noon_text(known), *jumps) if text)
    if role.startswith(("q_sol", "u_", "Q_")):
        yield from _odd_power(role, name, known, counts)


def _odd_power(role: str, name: str, known: pd.Series, counts: bool) -> Iterator[Finding]:
    """Remarks on what never changes or hardly runs, heating that is always negative, switches, and W called kW."""
    low, high = float(known.min()), float(known.max())
    if known.index.max() - known.index.min() >= _UNCHANGED and low == high != 0.0:
        yield Finding("warning", name, f"is {low:.4g} in all rows: does the sensor or meter work?")
    elif role.startswith("Q_heat") and low < 0.0 >= high:
        text = f"heat into the room is positive, but this is never: give [scale] {role} = -1 if its sign is reversed"
        yield Finding("warning", name, f"{text}, or Q_cool if it is cooling.")
    elif role.startswith(("Q_heat", "Q_cool")) and has_both_signs(known):
        text = f"goes from {low:.4g} to {high:.4g} kW: if it heats and cools, give it as Q_hvac, positive where it"
        yield Finding("error" if role.startswith("Q_cool") else "warning", name, f"{text} heats.")
    elif role.startswith(("q_sol", "Q_")) and 0.0 < max(high, -low) < _TOO_LITTLE:
        unit = "kW/m2" if role.startswith("q_sol") else "kW"
        text = f"reaches {1e3 * max(high, -low):.2g} {unit[1:]} only: is it in {unit}? Then give that as its unit"
        yield Finding("warning", name, f"{text} under [units] of {role}.")
    elif is_stage(role) and 0.0 < high <= _ONE_PERCENT:
        yield Finding("warning", name, f"reaches {100 * high:.2g} % only: is it a fraction? Then give '-' as its unit.")
    elif role.startswith("Q_") and low == 0.0 and high == 1.0 and known.nunique() == 2:
        yield Finding("warning", name, "is 0 or 1 kW in all rows: is it a switch? Then give it as u_heat or u_cool.")
    elif role.startswith("Q_") and is_in_watts(known.to_numpy(dtype=np.float64), None):
        asked = "does it count Wh? Then give 'Wh counter'" if counts else "are they W? Then give that"
        yield Finding("warning", name, f"values reach {max(high, -low):.4g} kW: {asked} as its unit.")


def has_both_signs(heat: pd.Series) -> bool:
    """Whether the values of a plant are often above and often below 0 [kW], beside their largest."""
    runs = heat[heat.abs() > RUNS * heat.abs().quantile(0.99)]
    return bool(len(runs)) and min((runs > 0.0).mean(), (runs < 0.0).mean()) > _OFTEN


def electricity_finding(name: str) -> Finding:
    """A remark on a column that seems to be electricity."""
    remedy = "give a coefficient of performance ([plant] electricity = true, cop = 3.0) or another column"
    return Finding("warning", name, f"this seems to be electricity, not heat: {remedy}.")


def _longest_run(missing: pd.Series) -> pd.DatetimeIndex:
    """Stamps of the longest run of missing rows, empty where none lasts long enough to break a log in two."""
    index, gone = pd.DatetimeIndex(missing.index), missing.to_numpy()
    n_known = np.cumsum(~gone)  # the same in all rows of a run
    runs = np.bincount(n_known[gone], minlength=1)
    longest = index[gone & (n_known == runs.argmax())]
    usual = index.to_series().diff().median()
    return longest if len(longest) and longest[-1] - longest[0] + usual > SHORTEST_GAP else index[:0]


def counter_findings(name: str, readings: pd.Series) -> Iterator[Finding]:
    """Remarks on the jumps of a counter [kWh], its resets, and its steps where they are coarse."""
    if (coarse := counter_tick(readings)) is not None:
        level, text = "note" if coarse[1] <= _COARSE else "warning", "its heat is spread over that time; log a finer"
        steps = f"counts in steps of {coarse[0]:g} kWh, one in about {coarse[1]:.2g} h"
        yield Finding(level, name, f"{steps}: {text} meter if there is one.")
    at = counter_jumps(readings)
    if len(at):
        more = f" and at {len(at) - 1} more; these rows are" if len(at) > 1 else "; that row is"
        text = f"the counter jumps at {at[0]}{more} left out: was the meter replaced, or did a reading fail?"
        yield Finding("warning", name, text)
    at = counter_resets(readings)
    if len(at):
        more = f", and {len(at) - 1} more" if len(at) > 1 else ""
        text = f"the counter falls at {at[0]}{more}: it was set to zero, or replaced; the heat just before"
        yield Finding("note", name, f"{text} is not known.")


def _jumping(name: str, known: pd.Series, least: float) -> Iterator[Finding]:
    """Values that leave those before and after them, or a step that no air makes."""
    near = known.index[1:] - known.index[:-1] <= pd.Timedelta("30min")
    change = np.where(near, np.diff(known.to_numpy(dtype=np.float64)), 0.0)
    back = np.append(change[1:], 0.0)
    spike = (np.minimum(np.abs(change), np.abs(back)) > least) & (change * back < 0.0)
    at = np.flatnonzero(spike | (np.abs(change) > 2.0 * least))
    if len(at):
        worst = at[np.abs(change[at]).argmax()]
        text = f"jumps by {change[worst]:+.1f} K at {known.index[int(worst) + 1]}"
        yield Finding(
            "warning", name, f"{text} ({several(len(at), 'such row')}); is the sensor loose, or a cell wrong?"
        )


def _beyond(role: str, name: str, known: pd.Series) -> Iterator[Finding]:
    """Values beyond physics, and a column that changes its unit."""
    kind = range_of(role)
    bad = (known < kind.lowest) | (known > kind.highest)
    if role.startswith("T_") and (switch := unit_switch(known)) is not None:
        text = f"seems to change its unit at {switch}: degC on one side, degF on the other"
        yield Finding("error", name, f"{text}; split the log there, or correct the column.")
    elif bad.any():
        worst = float(known[bad].iloc[0])
        unit = "" if kind.unit == "-" else f" {kind.unit}"
        text = f"{several(int(bad.sum()), 'value')} beyond {kind.lowest:g} to {kind.highest:g}{unit}"
        yield Finding("error", name, f"{text}, first {worst:.4g} at {known.index[int(bad.to_numpy().argmax())]}.")


def unit_switch(temperature: pd.Series) -> pd.Timestamp | None:
    """The stamp at which a column goes from one of degC and degF to the other, and stays there for a day."""
    values = temperature.to_numpy(dtype=np.float64)
    high = values > 45.0
    turns = np.flatnonzero(high[1:] != high[:-1]) + 1
    for turn in turns:
        a, b = values[:turn], values[turn:]
        if min(len(a), len(b)) < 4:
            continue
        low, top = sorted((np.median(a[-96:]), np.median(b[:96])))
        if top > 45.0 > low and abs((top - 32.0) / 1.8 - low) < 6.0:
            return pd.Timestamp(pd.DatetimeIndex(temperature.index)[int(turn)])
    return None


def swap_findings(name: str, role: str, frame: pd.DataFrame) -> Iterator[Finding]:
    """A remark where a room's temperature is that of outdoors, the two are swapped, or that of outdoors is in degF.

    ``frame`` has a column per role.  Where they are swapped, outdoors is always as warm as a room, while the room moves
    more, and is at times far colder.  Degrees Fahrenheit of a cold season are always above a room that nothing cools.
    """
    room, outdoor = frame[role], frame["T_oa"]
    if not (room.notna().any() and outdoor.notna().any()):
        return
    if np.array_equal(room.to_numpy(), outdoor.to_numpy(), equal_nan=True):
        yield Finding("error", name, f"{room.name} and {outdoor.name} hold the same values; one is of another column.")
        return
    (room_low, room_high), (low, high) = (values.quantile([0.01, 0.99]) for values in (room, outdoor))
    like_room = _INDOORS[0] <= low < high <= _INDOORS[1]
    if like_room and room_high - room_low > _MORE_MOVED * (high - low) and room_low < low - _COLDER:
        text = f"{room.name} goes from {room_low:.0f} to {room_high:.0f} degC while {outdoor.name} stays within"
        yield Finding("warning", name, f"{text} {low:.0f} to {high:.0f} degC: are the two columns swapped?")
    if low > room_high and not _cools(frame):
        text = f"T_oa goes from {low:.0f} to {high:.0f} degC, always above {role}, though nothing cools"
        yield Finding("warning", name, f"{text}: is it in degF? Then give its unit.")


def _cools(frame: pd.DataFrame) -> bool:
    """Whether some plant of a log by role cools."""
    plants = {str(role): values for role, values in frame.items() if is_plant(role)}
    return any((v > 0.0).any() if is_cooling(r) else (v < 0.0).any() for r, v in plants.items())


def set_point_findings(frame: pd.DataFrame) -> Iterator[Finding]:
    """Remarks on set-points of 0 degC, and on those that heat to more than they cool to; columns are roles."""
    heat, cool = SETPOINT_ROLES
    for role in (role for role in frame if str(role).startswith(SETPOINT_ROLES)):
        n = int((frame[role] == 0.0).sum())
        if n and frame[role].max() > 0.0:
            yield Finding(
                "warning", str(role), f"is 0 degC in {several(n, 'row')}: if the plant is off then, leave them empty."
            )
    zones = [str(role).removeprefix(heat) for role in frame if str(role).startswith(heat)]
    for low, high in ((heat + zone, cool + zone) for zone in zones if cool + zone in frame):
        crossed = frame.index[frame[low] > frame[high]]
        if len(crossed):
            text = f"is above {high} in {several(len(crossed), 'row')}, first at {crossed[0]}: are they swapped?"
            yield Finding("error", low, text)


def doubts_on_log(frame: pd.DataFrame, rooms: Sequence[str]) -> Iterator[str]:
    """Remarks on a log at even stamps, beside those on its temperatures: columns that end, and a clock that was set."""
    yield from doubts_on_temperatures(frame, rooms)
    yield from (f"{role} {text}" for role, text in lost_columns(frame))
    sun = next((str(role) for role in frame if str(role).startswith("q_sol")), None)
    yield from () if sun is None else (f"{sun}: {text}" for text in jump_texts(frame[sun].dropna()))


def unused_findings(given: Mapping[str, Mapping[str, Any]], roles: Collection[str]) -> Iterator[Finding]:
    """Warn of roles with a given unit or scale that no column has."""
    for what, by_role in given.items():
        for role in by_role:
            if role not in roles:
                yield Finding(
                    "warning", role, f"its {what} is given, but no column has this role; name its column too."
                )


def partial_findings(reasons: Mapping[str, str]) -> Iterator[Finding]:
    """A remark on each column that is a part only of what its role needs, by the reasons for the roles of columns."""
    for name, reason in reasons.items():
        if reason == PART_OF_SUN:
            text = "is a part of the sun's irradiance, by its name: if the log has the direct and the diffuse part,"
            yield Finding("warning", name, f"{text} give the global irradiance on the horizontal.")
        elif reason == OF_A_MODE:
            text = "is the set-point of one mode, by its name: if it is not always in force, write the one that is"
            yield Finding("warning", name, f"{text} in one column.")
        elif FEW_FOR_PERCENT in reason:
            text = "so kW are assumed; if it is a valve or stage in percent, give it as u_heat or u_cool, and its unit"
            yield Finding("warning", name, f"{reason}, {text} as 'percent'.")
        elif DOUBTFUL in reason:
            yield Finding("warning", name, f"{reason}: if so, give the column that is right.")
        elif OF_FUEL in reason:
            text = "if so, give the efficiency of the boiler, such as 0.9, for its role under [scale]"
            yield Finding("warning", name, f"{reason}: {text}.")


def doubts_on_temperatures(frame: pd.DataFrame, rooms: Sequence[str]) -> Iterator[str]:
    """Remarks on temperatures at even stamps: the longest standstill of each, and a room that is that of outdoors."""
    for role in (role for role in (*rooms, "T_oa") if role in frame):
        found = standstills(role, frame[role]) if role == "T_oa" else room_standstills(frame, role)
        if len(found):
            at = found.iloc[int((found["last"] - found["first"]).to_numpy().argmax())]
            text = f"{role} is {at['value']:.4g} degC from {at['first']} to {at['last']}: is the sensor stuck?"
            yield text + ("" if role == "T_oa" else " Such rows are taken as missing.")
    for role in rooms if "T_oa" in frame else ():
        yield from (finding.text for finding in swap_findings(role, role, frame))


def _standing_still(role: str, name: str, values: pd.Series, controlled: pd.Series | None) -> Iterator[Finding]:
    for first, last, value in standstills(role, values, controlled).head(_MOST_NAMED).itertuples(index=False):
        hours = (last - first) / pd.Timedelta("1h")
        text = f"stays at {value:.4g} {range_of(role).unit} for {hours:.0f} h from {first}: is the sensor stuck?"
        yield Finding("warning", name, text + (" These rows are taken as missing." if role == "T_za" else ""))
