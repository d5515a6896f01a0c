"""Roles and units that the names of a log's columns suggest, in many languages."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .._table import ending_zone, is_stage
from ..preprocessing._units import UNITS
from . import role_words as said
from .unit_names import ENERGY, IRRADIATION, is_foreign, is_unit, strange_unit, unit_or_energy, unit_text

#: letters that are no others with an accent
_LETTERS = {"ß": "ss", "ø": "o", "ł": "l", "æ": "ae", "ı": "i"}
#: Chinese, Japanese and Korean words, and beginnings of Cyrillic and Greek ones, of which the rest is left out
_SCRIPTS = {
    "room temp": "室温",
    "room": "室内|房间|실내|комнат|помещен|внутрен|кімнат|εσωτερικ",
    "outdoor": "室外|外気|실외|외기|наружн|улиц|уличн|внешн|зовнішн|външн|εξωτερικ",
    "temp": "温度|気?温|온도|температур|θερμοκρασ",
    "set": "設定|设定|설정|уставк|заданн|задани",
    "solar": "日射|太阳辐射|太阳|辐射|일사|солнечн|сонячн|ηλιακ",
    "heating": "暖房|制热|供热|供暖|采暖|加热|난방|отоплен|опален|нагрев|θερμανσ|θέρμανσ",
    "cooling": "冷房|制冷|供冷|냉방|охлажден|охолодж|ψυξ|ψύξ",
    "valve": "阀|밸브|клапан",
    "power": "功率|출력|мощност|потужн",
    "electricity": "電力|电力|전력|электр|електр",
    "humid": "湿度|습도|влажн|волог|υγρασ",
    "supply": "供水|送风|給水|подач",
    "return": "回水|回风|обратн",
}
_WORD_OF_SCRIPT = [(re.compile(texts, re.IGNORECASE), f" {word} ") for word, texts in _SCRIPTS.items()]
#: spellings of times that a plant ran
_TIMES = {**dict.fromkeys(("s", "sec", "seconds"), "s"), **dict.fromkeys(("min", "minutes"), "min")}
_OF_INTERVAL = r"\b(?:avg|mean|last|first)"  # a function of the values of a row, such as avg(temp)
_PRESENT = r"(\w[ _]\w.*)\.(?:PV|[pP]resentValue)$"  # ZONE_TEMP.PV is no photovoltaics
#: zones of Modelica, by the element of an array, as in hea[2].Q_flow and TRooAir[2], or as in zon2.T and yHea2
_NUMBERED_ZONE = re.compile(
    r"(\b(?:zon|roo|rom|hea|coo)|[TQPyu]\w*(?:Roo|Zon|Air|Hea|Coo)\w*)\[(\d+)\]|(?<![a-z])(?:[zZ]one?|ZONE|[rR]oom?|ROOM)(?=\d)|"
    r"(?<=[QPy]Hea)(?=\d)|(?<=[QPy]Coo)(?=\d)"
)
_PLACES = "room|zone|out|amb(?:ient)?|set|setheat|setcool|int|ext|air"  # after the T of a temperature
_IN_WATTS = re.compile(r"(?i)(?:power|heat|cool|heating|cooling|load|rate|hvac|leistung|heizung|flow)[ _](w|watts?)$")
_OF_SHELLY = re.compile(r"(?<![^\W_])a(?:power|(energy))(?![^\W_])")  # active, of a switch or meter
_NOT_READ = "no model reads such a quantity"
UNPLACED = "a temperature, but its name does not say of what"
PLACE_ALONE = "its name says where it measures, but not what"
_OF_WATER = "; from a flow of water and its temperatures of supply and return, write a column of heat [kW]"
_OF_FUEL = (
    "; if it counts the fuel of the heating, give Q_heat, its unit as 'kWh counter', and the kWh of one under [scale]"
)
_OF_PULSES = "; if they are those of a heat meter, give Q_heat, its unit as 'kWh', and the kWh of one under [scale]"
_HINTS = dict.fromkeys(("m3", "ccf"), _OF_FUEL) | dict.fromkeys(("l/h", "l/min", "l/s", "m3/h"), _OF_WATER)

_OF_FLOOR = "its unit is that of heat per area; give {0}, its unit as 'W', and the area [m2] under [scale]"
_STRANGE = (
    "its unit {0!r} is not known; give its role, another unit, such as 'kW', and the factor to that under [scale]"
)
_SPEED = re.compile(r"\bfreq|\brpm\b|speed|drehzahl|\bhz\b")  # of a compressor that heats or cools
#: a power of ten after a sign of multiplication, or before a unit in brackets
_NUMBER = r"(10{1,4}|0[.,]0{0,3}1)"
_FACTOR = re.compile(rf"(?:[*×]|(?<![^\W_])[xX]) ?_?{_NUMBER}(?![^\W_]|[.,]\d)|[(\[]{_NUMBER} ?[kM]?(?:W|J|Btu)")

#: the reason where a column has the name of its role, whose unit it then has
NAMED_BY_ROLE = "it is named after its role"

#: reasons where a column may be a part only of what its role needs
PART_OF_SUN = "its name is that of a part of the sun's irradiance"
OF_A_MODE = "its name is that of the set-point of one mode"
#: reasons of stages: of a name of one, and of a name that says no more than that something heats or cools
OF_STAGE = "its name is that of a stage or valve"
OF_PLANT = "its name says that it heats or cools, but not in which quantity"
#: the end of the reason where the values of a plant, which may be a valve that hardly opens, are taken for kW
FEW_FOR_PERCENT = "have decimals and are few for a percentage"
#: ends of reasons where the name of a column has a word of another quantity
DOUBTFUL = "in its name may say that it is another quantity"
OF_FUEL = "in its name or unit may say that it counts the fuel"

#: the ends of reasons: where another column has the role, and where a set-point may be that of heating or of cooling
TAKEN = "was taken for the same quantity"
FOR_HEATING = "taken for heating"

#: the certainty of a role that was given
SURE = 99

#: names of roles that nobody chooses by accident, as ``T_ctrl`` is
_STANDARD = re.compile(r"T_(oa|za|heat_set|cool_set)|q_sol(_\w+)?|[uQ]_(heat|cool|hvac)")

#: roles that exclude one: a stage adds nothing to the heat that it delivered
_EXCLUDED: dict[str, tuple[str, ...]] = {"u_heat": ("Q_heat", "Q_hvac"), "u_cool": ("Q_cool", "Q_hvac")}
_EXCLUDED |= {"Q_hvac": ("Q_heat", "Q_cool"), "Q_heat": ("Q_hvac",), "Q_cool": ("Q_hvac",)}


class Guess(NamedTuple):
    """The role of a column, or none, with the reason in words."""

    role: str | None
    certainty: int
    reason: str
    is_electricity: bool = False


def unit_in_name(name: str) -> str | None:
    """The unit that a name ends with or has in brackets, such as ``Zone Temp (°F)``; None if it has none."""
    text = unit_text(name)
    if text is None and (first := re.match(r"(°[CF]|%|k?W|kWh)\s", name)):  # InfluxDB's measurement is a unit
        text = first[1]
    if text is None and strange_unit(name) is None:
        last = re.search(r"[ _(\[]([A-Za-z]+)[)\]]?$", name)
        is_time = last and last[1].lower() in _TIMES and len(last[1]) > 1 and not re.search(r"(?i)temp", name)
        text = last[1] if last and is_time else None  # temp_min is a minimum
    if text is None and (inner := re.search(r"(?i)(?<![a-z/])(kwh?|mwh|wh)(?![a-z/]|-h|[ _]*(m2|m²|per m))", name)):
        text = inner[1]  # such as Heating_kWh_15min
    if text is None and (power := _IN_WATTS.search(name)):
        text = power[1]
    if text is None and (shelly := _OF_SHELLY.search(name)):
        text = "Wh" if shelly[1] else "W"
    return None if text is None else unit_or_energy(text) or _TIMES.get(text.lower())


def factor_in_name(name: str) -> float | None:
    """The factor in a name such as ``gas_x10``, by which values are to be multiplied or divided; None for none."""
    found = _FACTOR.search(name)
    return None if found is None else float((found[1] or found[2]).replace(",", "."))


def plain(name: str) -> str:
    """A name as small words without accents, brackets and signs: ``"Außentemp. (°C)"`` is ``"aussentemp"``."""
    text = re.sub(rf"{_OF_INTERVAL}\(([^)]*)\)", r"\1", name)
    text = _NUMBERED_ZONE.sub(lambda of: f"{of[1] or ''} zone {of[2] or ''}", text)
    text = re.sub(r"\(LGR S/N.*LBL: ([^)]*)\)", r" \1 ", text)  # the label of a HOBO logger
    text = re.sub(r"[\[(]([^\])]*)[\])]", _no_unit, re.sub(_PRESENT, r"\1", text))
    text = re.sub(
        rf"\bT(?=(?i:{_PLACES})(?![a-z]))|\bt(?=(amb|set|airm))|(?<![A-Z])[TQ](?=[A-Z][a-z])", r"\g<0> ", text
    )
    text = re.sub(r"(?i)(?<=set)(?=(heat|cool|hea|coo)\b)|(?<=\bair)(?=mean)", " ", text)
    text = re.sub(r"(?i)(?<=htg|clg|znt|eat|ool)(?=sp\b|setp)", " ", text)
    for letter, letters in _LETTERS.items():
        text = text.replace(letter, letters)
    for script, word in _WORD_OF_SCRIPT:
        text = script.sub(word, text)
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    words = " ".join(re.sub(r"[^0-9A-Za-z]+", " ", text).lower().split())
    return re.sub(r"(temp\w*|\boat) pv$", r"\1", words)  # a process value


def _no_unit(brackets: re.Match[str]) -> str:
    """The words in brackets that are no unit, such as those of a function or place."""
    text = brackets[1].strip()
    return " " if is_unit(text) and text.lower() not in ("std", "max") else f" {text} "


def guess_role(name: str, unit: str | None = None) -> Guess:
    """The role that a name and a unit suggest."""
    if _STANDARD.fullmatch(name):
        return Guess(name, 10, NAMED_BY_ROLE)
    words = plain(name)
    if unit is None and is_foreign(stated := unit_text(name) or ""):
        return Guess(None, 0, f"no model reads {stated}{_HINTS.get(stated.lower().replace('³', '3'), '')}")
    if unit is None and (strange := strange_unit(name)) is not None:
        return Guess(None, 0, _STRANGE.format(strange))
    if re.search(rf"{said.OTHER}|{said.PULSES}", words):
        of_pulses = re.search(said.PULSES, words) and f"it counts pulses{_OF_PULSES}"
        return Guess(None, 0, of_pulses or _NOT_READ)
    cool, wanted = (bool(re.search(pattern, words)) for pattern in (said.COOL, said.SET))
    heat = _heats(words, cool)
    is_meter = (heat or cool) and unit is None and unit_text(name) is None and _is_of_heat_meter(words)
    of = "power" if is_meter else _kind(words, unit)
    if of in ("temperature", None) and re.search(said.STREAM, words):
        return Guess(None, 0, _NOT_READ)
    if of == "temperature":
        return _set_point(words, heat, cool) if wanted else _temperature(words)
    if of == "irradiance":
        return _irradiance(words, heat, cool)
    if of == "power" and not wanted and (heat or cool or re.search(said.PLANT, words)):
        return _power(words, unit, heat, cool)
    if of == "power":
        return Guess(None, 0, "its name does not say whether it heats or cools the room; if so, give Q_heat or Q_cool")
    if of in ("stage", None) and heat and cool:
        return Guess(None, 0, "its name says that it heats and that it cools; give u_heat, u_cool or Q_hvac")
    speed = _SPEED.search(f"{words} {unit_text(name) or ''}".lower())
    if cool and "compressor" in words and not heat and speed and not re.search(r"cool|chill", words):
        return Guess(None, 0, "its name does not say whether it heats or cools the room; if so, give u_heat or u_cool")
    if of in ("stage", None) and (heat or cool) and not wanted:
        return Guess("u_cool" if cool else "u_heat", 2 if of else 1, OF_STAGE if of else OF_PLANT)
    if of == "stage" and re.search(r"valve|ventil(?!at|az|ac|o? ?conv)|venttiil|klep|vanne|radiat", words):
        return Guess("u_heat", 1, "its name is that of a valve, taken for a radiator's")
    if re.search(said.ROOM, words) or re.search(said.OUT, words):
        return Guess(None, 0, PLACE_ALONE)
    return Guess(None, 0, "its name says nothing of a role")


def _irradiance(words: str, heat: bool, cool: bool) -> Guess:
    if (heat or cool) and not re.search(said.SUN, words):
        return Guess(None, 0, _OF_FLOOR.format("Q_cool" if cool else "Q_heat"))
    if re.search(said.NO_IRRADIANCE, words):
        return Guess(None, 0, _NOT_READ)
    if re.search(said.PART_OF_SUN, words):
        return Guess("q_sol", 2, PART_OF_SUN)
    return Guess("q_sol", 3, "its name or unit is that of irradiance")


def _heats(words: str, cool: bool) -> bool:
    """Whether a name says that it heats; the cooling of a heat pump does not, but an air conditioner may."""
    is_of_cooling = cool and not re.search(r"\bac\b|air ?con|climati", words)
    return bool(re.search(said.HEAT, re.sub(said.HEAT_PUMP, "", words) if is_of_cooling else words))


def _power(words: str, unit: str | None, heat: bool, cool: bool) -> Guess:
    """The role of a power or energy of the plant."""
    is_delivered = bool(re.search(said.DELIVERED, words)) or unit in ("tons", "ton-h")
    electric = bool(re.search(said.ELECTRICITY, words)) and not is_delivered
    one_way = "Q_heat" if heat and not cool else "Q_cool" if cool and not heat else "Q_hvac"
    role = "Q_hvac" if "hvac" in words and not (cool or "heating" in words) else one_way
    reason = f"its {'name' if unit is None else 'unit'} is that of a power or energy"
    certainty = 2 + is_delivered
    for pattern, end in ((said.LIMIT, DOUBTFUL), *(() if is_delivered else ((said.FUEL, OF_FUEL),))):
        if found := re.search(pattern, f"{words} {unit}"):
            reason, certainty = f"{found[0]!r} {end}", 1
    return Guess(role, certainty, reason + " (electricity?)" * electric, electric)


def _is_of_heat_meter(words: str) -> bool:
    """Whether a name is that of a meter, and not of one that counts hours or starts."""
    return bool(re.search(said.METER, words)) and not re.search(said.COUNTS, words)


def _temperature(words: str) -> Guess:
    """The role of a temperature that is measured."""
    of_plant = re.search(rf"\w*({said.HEAT}|{said.COOL})\w*", words)
    if of_plant or re.search(said.VESSEL, words):
        words = re.sub(r"\b(in|out)\b", "", words)
    of_room = re.search(said.ROOM.replace(r"|in|int|", "|"), words)
    doubt = re.search(rf"\w*({said.OTHER_THAN_AIR})\w*", words) or (of_room and of_plant)
    certainty, doubted = (2, f"{doubt[0]!r} {DOUBTFUL}") if doubt else (3, "")
    if re.search(said.OUTDOORS, words) or (re.search(said.OUT, words) and not of_room):
        return Guess("T_oa", certainty, doubted or "its name is that of the outdoor temperature")
    if re.search(said.ROOM, words):
        return Guess("T_za", certainty, doubted or "its name is that of a room's temperature")
    return Guess(None, 1, UNPLACED)


def _set_point(words: str, heat: bool, cool: bool) -> Guess:
    """The role of a set-point."""
    if re.search(rf"{said.OF_WATER_SET}|{said.OUTDOORS}|\boat?\b|exter", words) and not re.search(said.ROOM, words):
        return Guess(None, 0, "its name is that of a set-point of the plant, not of a room")
    lower, upper = (bool(re.search(pattern, words)) for pattern in (said.LOWER, said.UPPER))
    if heat == cool and lower != upper:
        return Guess("T_cool_set" if upper else "T_heat_set", 2, "its name is that of one of two set-points")
    if heat == cool and _preference(words) < 0:
        return Guess("T_heat_set", 0, OF_A_MODE)
    if heat == cool:
        return Guess("T_heat_set", 1, f"its name is that of a set-point, {FOR_HEATING}")
    reason = "its name is that of a set-point" if _preference(words) >= 0 else OF_A_MODE
    return Guess("T_cool_set" if cool else "T_heat_set", 3 + _preference(words), reason)


def _preference(words: str) -> int:
    """Whether a set-point is the one in force (1), or that of a mode or a limit (-1), which may be out of force."""
    return bool(re.search(said.IN_FORCE, words)) - bool(re.search(said.OF_A_MODE, words))


def _kind(words: str, unit: str | None) -> str | None:
    if unit in ENERGY or (unit in UNITS and UNITS[unit].kind == "power"):
        return "power"
    if unit in IRRADIATION:
        return "irradiance"
    if unit in UNITS and UNITS[unit].kind != "fraction":
        return UNITS[unit].kind
    if re.search(said.SUN, words) and not re.search(said.TEMPERATURE, words):
        return "irradiance"
    if unit in ("percent", "s", "min") or re.search(said.STAGE, re.sub(said.READING, r"\1", words)):
        return "stage"
    if re.search(said.TEMPERATURE, words) or re.search(said.SET_POINT, words):
        return "temperature"
    return "power" if re.search(said.POWER, words) else None


def one_column_each(guesses: Mapping[str, Guess], zones: Sequence[str] = ()) -> dict[str, Guess]:
    """Guesses in which each role has one column: that which was given, or the most certain one, then the first.

    A role that all of some ``zones`` would share is not guessed beside that of a zone.
    """
    found, taken = dict(guesses), dict[str, str]()
    rank = {c: (-g.certainty, g.is_electricity, is_stage(g.role)) for c, g in guesses.items()}
    for column in sorted(guesses, key=rank.__getitem__):
        role, certainty = guesses[column].role, guesses[column].certainty
        if role is None:
            continue
        rivals = _rivals(role, () if certainty == SURE else zones)
        rival = next((taken[r] for r in rivals if r in taken), None)
        if rival is None:
            taken[role] = column
        else:
            found[column] = Guess(None, 1, f"{rival!r} {TAKEN}")
    return found


def _rivals(role: str, zones: Sequence[str]) -> list[str]:
    """The roles that exclude one, itself among them: of its zone, or of any zone if it is shared."""
    zone = ending_zone(role, zones)
    own = "" if zone is None else f"_{zone}"
    plain_role = role.removesuffix(own)
    among = [own] if own or role == "q_sol" else ["", *(f"_{one}" for one in zones)]
    return [one + end for one in (plain_role, *_EXCLUDED.get(plain_role, ())) for end in among]
