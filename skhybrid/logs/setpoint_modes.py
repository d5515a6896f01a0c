"""Words and plants that say whether a set-point heats or cools: one thermostat in winter and summer."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES, is_cooling, plant_roles
from .._time import wall_clock
from .naming import FOR_HEATING, guess_role
from .zone_names import plants_of_room, words_of

MODE = "mode"  # the role, or mode_<zone>: which set-points are in force
HEATS, COOLS, OFF, BOTH = 1.0, -1.0, 0.0, 2.0  # its values
NEVER = dict(zip(SETPOINT_ROLES, (5.0, 40.0), strict=True))  # set-points at which no plant runs [degC]
_IDLE = frozenset(("idle", "standby"))
_ACTIONS = _IDLE | {"heating", "cooling", "off"}
_WORDS = {
    HEATS: "heat heating heizen heizbetrieb winter verwarmen verwarming chauffage chauffer hiver riscaldamento "
    "inverno calefaccion calefacción invierno emergency_heat aux_heat",
    COOLS: "cool cooling kühlen kuehlen kühlung kühlbetrieb sommer summer koelen koeling zomer froid climatisation "
    "refroidissement été raffreddamento raffrescamento estate refrigeracion refrigeración frio frío verano",
    BOTH: "auto automatic automatik heat_cool heat/cool heatcool auto_changeover",
    OFF: "off aus uit arrêt arret spento apagado dry fan fan_only vent idle standby",
}
_CODES = {word.replace("_", " "): code for code, words in _WORDS.items() for word in words.split()}
_NAME = re.compile(r"(?i)mode|modus|modo|betriebsart|season|saison|change ?over|regime|setting")
_OTHER_NAME = re.compile(r"(?i)\bfan|dhw|water|wasser|valve|pump")  # whose modes are not the thermostat's
_MIXED_DAY, _MIXED = 0.1, 0.1  # share of a day's running on its lesser side; share of days with more than that


def code_of(word: str) -> float | None:
    """The mode that a word says; None for another word."""
    return _CODES.get(word.strip().lower().replace("_", " ").removesuffix(" mode"))


def action_name(name: str, side: str) -> str:
    """The name of the stage of heating or cooling that the words of a column say."""
    return f"{name}: {side}"


def with_actions(frame: pd.DataFrame, wanted: Iterable[str]) -> pd.DataFrame:
    """Channels with those of heating and cooling that are wanted, where a plant only heats or is idle in these rows.

    Its words are then a switch of one side, under the name of the column alone.
    """
    for name in map(str, frame):
        found = {action_name(name, side): on for side, on in (("heating", frame[name]), ("cooling", 0.0 * frame[name]))}
        frame = frame.assign(**{one: found[one] for one in wanted if one in found and one not in frame})
    return frame


def kind_of_words(name: str, words: Iterable[str]) -> str | None:
    """The meaning of a column of words: the ``"mode"`` of a thermostat, the ``"action"`` of its plant, or None."""
    said = {word.lower() for word in words}
    codes, is_named = {code_of(word) for word in said}, bool(_NAME.search(name))
    if not said or None in codes or _OTHER_NAME.search(name):
        return None
    if COOLS not in codes and (said <= _ACTIONS or HEATS not in codes):  # a switch, or auto and off
        return MODE if is_named and not said & _IDLE else None
    return "action" if said & _IDLE or (said <= _ACTIONS and not is_named) else MODE


def shared_zones(columns: Mapping[str, str]) -> list[str]:
    """The endings, such as ``""`` or ``"_hall"``, of zones whose two set-points are one of the columns, by role."""
    heat, cool = SETPOINT_ROLES
    zones = [role.removeprefix(heat) for role in columns if role.startswith(heat)]
    return [zone for zone in zones if columns.get(cool + zone) == columns[heat + zone]]


def one_role_each(columns: Mapping[str, str]) -> dict[str, str]:
    """The columns by role without cooling set-points that are those of heating."""
    twins = {SETPOINT_ROLES[1] + zone for zone in shared_zones(columns)}
    return {role: name for role, name in columns.items() if role not in twins}


def further_roles(
    columns: Mapping[str, str], frame: Callable[[], pd.DataFrame], modes: pd.DataFrame
) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Roles of modes, and of single set-points that cool too, with reasons and doubts by column.

    ``columns`` are those that were found by role, and ``frame`` gives their values, which are read for a single
    set-point alone; ``modes`` are channels that say a mode.
    """
    heat, cool = SETPOINT_ROLES
    told = [str(name) for name in modes if modes[name].isin((HEATS, COOLS)).any()]
    found, reasons, doubts = {}, {}, {}
    zones = _zones_of(columns)
    words = {name: words_of(name, [zone.strip("_") for zone in zones]) for name in told}
    for zone in zones:
        own = [name for name in told if zone.strip("_") in words[name]] or told
        mode = own[0] if len(own) == 1 else None
        if mode is not None:
            found[MODE + zone * (len(told) > 1)] = mode
        name = columns.get(heat + zone, "")
        if cool + zone in columns or not guess_role(name).reason.endswith(FOR_HEATING):
            continue
        sides, is_clear = sides_of_plant(frame(), zone)
        if mode is not None and (modes[mode].isin((COOLS, BOTH)).any() or COOLS in sides):
            found[cool + zone], reasons[name] = name, f"it heats or cools as {mode!r} says"
        elif mode is None and is_clear and len(sides) > 1:
            found[cool + zone] = name
            reasons[name] = "it heats or cools as the plant did on the last day before"
        elif mode is None and len(sides) > 1:
            doubts[name] = (
                "is one set-point, but the plant heats and cools on the same days: add a column that says heat, cool, "
                "auto or off, or a column for each set-point."
            )
    return found, reasons, doubts


def _zones_of(roles: Iterable[object]) -> list[str]:
    """The endings of zones with a set-point or a meter of heat."""
    sides, names = (*NEVER, "Q_hvac", "Q_heat"), set(map(str, roles))
    rooms = {name.removeprefix("T_za") for name in names if name.startswith("T_za_")}
    by_room = {room for room in rooms if f"Q{room}" in names}
    return sorted(by_room | {name.removeprefix(side) for name in names for side in sides if name.startswith(side)})


def sides_of_plant(frame: pd.DataFrame, zone: str) -> tuple[set[float], bool]:
    """The sides, heating or cooling, on which the plant runs, and whether most days have one side alone."""
    mode, is_clear = mode_of_plant(frame, zone)
    return ({HEATS, COOLS} if (mode == BOTH).any() else set(mode.dropna())), is_clear


def in_force(frame: pd.DataFrame, shared: Collection[str], held: Collection[str]) -> pd.DataFrame:
    """Columns by role without the mode, whose set-points are in force where it says so, and else at ``NEVER``.

    Where it cools, so does a meter of the plant that is never negative and has none of cold beside it.
    ``shared`` are the endings, such as ``""`` or ``"_hall"``, of zones whose two set-points are one column; without a
    mode, the plant that ran on the last day before says which it is.  ``held`` roles are logged by change.
    """
    out = frame.drop(columns=[role for role in frame if str(role).partition("_")[0] == MODE])
    for zone in _zones_of(out):
        own = next((frame[role] for role in (MODE + zone, MODE) if role in frame), None)
        if own is not None and not {f"Q_cool{zone}", f"u_cool{zone}"} & set(out):
            named = (f"Q_hvac{zone}", f"Q_heat{zone}", f"Q{zone}")
            meters = [role for role in named if role in out and not out[role].min() < 0.0]
            out = out.assign(**{role: out[role].where(own.ffill().bfill() != COOLS, -out[role]) for role in meters})
        if own is None and zone not in shared:
            continue
        mode = mode_of_plant(out, zone)[0] if own is None else own.ffill().bfill()
        for (side, never), able in zip(NEVER.items(), (HEATS, COOLS), strict=True):
            if (role := side + zone) in out:
                values = out[role].ffill() if role in held else out[role]
                out = out.assign(**{role: values.where(mode.isin((able, BOTH)), never).where(mode.notna())})
    return out


def mode_of_plant(frame: pd.DataFrame, zone: str) -> tuple[pd.Series, bool]:
    """The mode of each row by the last day before on which a plant ran, and whether most days have one side alone.

    The day itself would say what is delivered after the origin of a forecast.  The mode is both where heating and
    cooling are mixed, and NaN where no plant runs.
    """
    plants = plants_of_room(frame, zone) or plant_roles(frame)
    heat, cold = np.zeros((2, len(frame)))
    for role in plants:
        values = frame[role].to_numpy(dtype=np.float64)
        signed = (
            np.nan_to_num(values / (np.nanquantile(np.abs(values), 0.99) or 1.0)) if frame[role].any() else heat * 0.0
        )
        signed = -np.abs(signed) if is_cooling(role) else signed
        heat, cold = heat + signed.clip(min=0.0), cold - signed.clip(max=0.0)
    days = wall_clock(pd.DatetimeIndex(frame.index)).normalize()
    sums = pd.DataFrame({HEATS: heat, COOLS: cold}).groupby(np.asarray(days)).sum()
    ran = sums.sum(axis=1) > 0.0
    is_mixed = sums.min(axis=1)[ran] > _MIXED_DAY * sums.sum(axis=1)[ran]
    is_clear = bool(ran.any() and is_mixed.mean() <= _MIXED)
    side = sums.idxmax(axis=1) if is_clear else pd.Series(BOTH, sums.index)
    of_days = side.astype(np.float64).where(ran).ffill().shift(1).bfill()
    return pd.Series(of_days.reindex(days).to_numpy(), frame.index), is_clear
