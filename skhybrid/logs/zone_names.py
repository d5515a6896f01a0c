"""Zones of a log whose columns differ by the name of a room, and the role of each of their columns."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence

from .._table import ending_zone, is_plant, plant_roles
from ..preprocessing._units import UNITS
from .naming import NAMED_BY_ROLE, SURE, TAKEN, UNPLACED, Guess, guess_role, one_column_each, plain
from .role_words import COOL, HEAT, OTHER_THAN_AIR, TEMPERATURE
from .unit_names import ENERGY

_NO_ZONES = {
    "heat", "cool", "heating", "cooling", "htg", "clg", "hhw", "chw", "min", "max", "mean", "low", "high", "set", "sp",
    "actual", "target",
}  # fmt: skip
_ANY_ROOM = ("room", "zone", "raum", "zimmer", "kamer", "piece")  # "living room temp" is like "kitchen temp"
#: "room 1" is the zone room1, and "bedroom 2" bedroom2
_NUMBERED = re.compile(rf"\b([a-z]*(?:{'|'.join(_ANY_ROOM)})|office|buero|bureau|chambre|flat|apartment) (\d+)\b")
_MOST_WORDS = 3  # of the name of a room, such as "master bedroom"
#: words that, among several, name no room but what is measured there, and last words that do so
_NO_ROOM, _NO_PLACE = re.compile(rf"{TEMPERATURE}|{HEAT}|{COOL}"), re.compile(OTHER_THAN_AIR)
#: a name that says of a temperature no more than that it is measured, and of air
_TEMPERATURE_ALONE = re.compile(
    r"((air|luft|temp\w*|lufttemp\w*|lampotila|teplota|t|avg|mean|actual|current|measured|value|ist|\d+) ?)+"
)
_OWN = ("u_heat", "u_cool", "Q_hvac", "Q_heat", "Q_cool", "T_heat_set", "T_cool_set")


def shared_plants(roles: Iterable[str], zones: Collection[str]) -> list[str]:
    """Those roles of plants that end with the name of none of several zones."""
    return [role for role in roles if not any(role.endswith(f"_{zone}") for zone in zones)]


def plants_of_room(roles: Iterable[object], zone: str) -> list[str]:
    """The plants that act on a room: its own, else those that rooms share; all of them where ``zone`` is empty.

    ``zone`` is the end of the room's roles, such as ``"_hall"``; roles of other rooms are known by their temperatures.
    """
    names = list(map(str, roles))
    plants = plant_roles(names)
    if not zone:
        return plants
    room = zone.removeprefix("_")
    rooms = {room, *(name.removeprefix("T_za_") for name in names if name.startswith("T_za_"))}
    owners = {role: ending_zone(role, rooms) for role in plants}
    return [r for r in plants if owners[r] == room] or [r for r in plants if owners[r] is None]


def zone_roles(units: Mapping[str, str | None]) -> dict[str, str]:
    """Column of each role with the zone's name, such as ``T_za_kitchen``; empty unless two rooms have plants."""
    zones = _zones(units)
    found: dict[str, str] = {}
    words = {c: words_of(c, zones) for c in units}
    for zone, measured in zones.items():
        of_zone = {c: u for c, u in units.items() if zone in words[c] and c != measured}
        own = one_column_each({name: _guess_of(name, zone, unit) for name, unit in of_zone.items()})
        found |= {f"T_za_{zone}": measured} | {f"{g.role}_{zone}": name for name, g in own.items() if g.role}
    if len([zone for zone in zones if any(f"{role}_{zone}" in found for role in _OWN[:5])]) < 2:
        return {}
    others = {c: unit for c, unit in units.items() if not set(words[c]) & set(zones)}
    # what bears the name of a room that is none of the zones is not shared by them
    rooms = {word for c, unit in others.items() if guess_role(c, unit).role == "T_za" for word in words[c]}
    rooms -= {word for measured in zones.values() for word in words[measured]}
    others = {c: unit for c, unit in others.items() if not set(words[c]) & rooms}
    shared = {g.role: c for c, g in assign_zone_roles(others).items() if g.role is not None and g.role != "T_za"}
    return shared | found


def further_rooms(units: Mapping[str, str | None], columns: Mapping[str, str]) -> list[str]:
    """Columns with the temperatures of other rooms than that of ``T_za``, unless a plant bears the name of that room.

    ``columns`` are those that were found, by role.
    """
    room = columns.get("T_za", "")
    others = [name for name, unit in units.items() if guess_role(name, unit).role == "T_za"]
    others = [name for name in others if _without_unit(name) != _without_unit(room)]
    words_of_plants = {word for role, name in columns.items() if is_plant(role) for word in plain(name).split()}
    own_words = set(plain(room).split()).difference(*(plain(name).split() for name in others))
    return [] if not words_of_plants or own_words & words_of_plants else others


def _without_unit(name: str) -> str:
    """A name without the unit of its temperature, of which an export may have two."""
    return re.sub(r"\b(celsius|fahrenheit|deg ?[cf]|[cf])\b", "", plain(name))


def zones_of(roles: Iterable[str]) -> list[str]:
    """The zones whose temperatures are among some roles; none where ``T_za`` is the only zone's."""
    roles = list(roles)
    return [] if "T_za" in roles else [role.removeprefix("T_za_") for role in roles if role.startswith("T_za_")]


def assign_zone_roles(
    units: Mapping[str, str | None], given: Mapping[str, str] | None = None, of_format: Mapping[str, str] | None = None
) -> dict[str, Guess]:
    """The role of each column, each role once: those given, those of the format, the most certain, then the first.

    ``units`` are those of the columns in their order; ``given`` and ``of_format`` are columns by role.  If several
    zones are given, the role of a column with the name of one ends with it.
    """
    zones = zones_of(given or {})
    known = {column: Guess(role, SURE, "this format names it so") for role, column in (of_format or {}).items()}
    known = {column: guess for column, guess in known.items() if guess.role not in (given or {})}
    for own, column in (given or {}).items():
        known[column] = Guess(own, SURE, NAMED_BY_ROLE if own == column else "it was given")
    found = one_column_each({c: known.get(c) or guess_in_zone(c, unit, zones) for c, unit in units.items()}, zones)
    return found if known else _with_room(found)


def _with_room(guesses: dict[str, Guess]) -> dict[str, Guess]:
    """The guesses, with the one temperature of which nothing is said as the room's, if only that outdoors is found."""
    alone: dict[tuple[str, str], str] = {}
    for column, guess in guesses.items():
        bare = _without_unit(column).strip()
        if guess.reason == UNPLACED and _TEMPERATURE_ALONE.fullmatch(bare):
            # an export may have one temperature in two units, of which the first is read
            alone.setdefault((bare, column if bare == plain(column) else ""), column)
    roles = {guess.role for guess in guesses.values()}
    if len(alone) != 1 or "T_oa" not in roles or "T_za" in roles:
        return guesses
    room = Guess("T_za", 1, "a temperature, taken for the room's, since another is that outdoors")
    return guesses | {next(iter(alone.values())): room}


def zone_guesses(units: Mapping[str, str | None], roles: Mapping[str, str]) -> dict[str, Guess]:
    """The role of each column, or none, by the column of each role."""
    by_name = {name: role for role, name in roles.items()}
    zones = zones_of(roles)
    found = {}
    for name, unit in units.items():
        role, guess = by_name.get(name), guess_in_zone(name, unit, zones)
        reason = guess.reason
        if role is None and guess.role is not None:
            reason = f"another column {TAKEN}"
        elif role == name:
            reason = NAMED_BY_ROLE
        elif role is not None and guess.role is None:  # without the room, its name may be that of any temperature
            reason = guess_role(f"room temp {name}", unit).reason
        found[name] = Guess(role, guess.certainty, reason, role is not None and guess.is_electricity)
    return found


def guess_in_zone(name: str, unit: str | None, zones: Sequence[str]) -> Guess:
    """The role that a name and a unit suggest; of a column with the name of a zone, it ends with that of the zone."""
    words = words_of(name, map(str.lower, zones))
    zone = next((zone for zone in zones if zone.lower() in words), None)
    if zone is None:
        return guess_role(name, unit)
    guess = _guess_of(name, zone, unit)
    return guess if guess.role is None else guess._replace(role=f"{guess.role}_{zone}")


def _zones(units: Mapping[str, str | None]) -> dict[str, str]:
    """Temperature column of each zone: the largest set of columns whose names differ in the words of a room only.

    Of sets as large, that of the surest temperatures of air.
    """
    alike: dict[tuple[str, ...], dict[str, str]] = defaultdict(dict)
    for name, unit in units.items():
        words = [word for word in words_of(name) if word not in _ANY_ROOM]
        if not _is_room(name, unit):
            continue
        for n in range(1, _MOST_WORDS + 1):
            for k in range(len(words) - n + 1):
                room = words[k : k + n]
                if all(map(_may_name, room)) and (n == 1 or not _no_room(room)):
                    alike[(*words[:k], "", *words[k + n :], str(unit))].setdefault("_".join(room), name)
    return max(alike.values(), key=lambda rooms: (len(rooms), *map(_certainty, rooms.values())), default={})


def _certainty(name: str) -> int:
    """The certainty that a column that may be the temperature of some room is that of its air."""
    return guess_role(f"room temp {name}").certainty


def _may_name(word: str) -> bool:
    return not word.isdigit() and len(word) > 1 and word not in _NO_ZONES


def _no_room(words: Sequence[str]) -> bool:
    """Whether several words name no room."""
    return any(map(_NO_ROOM.search, words)) or bool(_NO_PLACE.search(words[-1]))


def words_of(name: str, zones: Iterable[str] = ()) -> list[str]:
    """The words of a name, those of each zone as one: ``master_bedroom`` is not ``bedroom``."""
    text = _NUMBERED.sub(r"\1\2", plain(name))
    for zone in sorted(zones, key=len, reverse=True):
        text = re.sub(rf"\b{' '.join(words_of(zone))}\b", zone, text)
    return text.split()


def _is_room(name: str, unit: str | None) -> bool:
    """Whether a column may be the temperature of some room: one by its unit or words, and no other quantity."""
    guess = guess_role(f"room temp {name}", unit)
    return guess.role == "T_za" and guess_role(name, unit).role in (None, "T_za")


def _guess_of(name: str, zone: str, unit: str | None) -> Guess:
    """The guess of a zone's column, by its name without the zone's."""
    spelled = re.sub(r"(?<=[a-z])(?=\d)|_", r"[\\W_]*", re.escape(zone))
    rest = re.sub(rf"(?i)[\W_]*(?<![^\W_]){spelled}(?![^\W_])", "", name)
    guess = guess_role(rest, unit)
    if guess.role in (*_OWN, "q_sol"):
        return guess
    power = rest == "Q" or unit in ENERGY or (unit in UNITS and UNITS[unit].kind == "power")
    of_plant = guess_role(f"hvac {rest}", unit or "kW")
    if power and of_plant.role == "Q_hvac":
        return of_plant
    return guess if guess.role is None else Guess(None, 0, f"another column {TAKEN}")
