"""Units as loggers write them, and the names that the package gives them."""

from __future__ import annotations

import re

_SPELLINGS = {
    "degC": ("c", "degc", "deg_c", "celsius", "degcelsius", "gradc", "gradcelsius", "℃"),
    "degF": ("f", "degf", "deg_f", "fahrenheit", "degfahrenheit", "℉"),
    "K": ("K", "kelvin"),
    "kW/m2": ("kw/m2", "kwm-2", "kw/sqm", "kw/mq", "kw_m2"),
    "W/m2": ("w/m2", "wm-2", "w/sqm", "w/mq", "watt/m2", "watts/m2", "w_m2"),
    "Btu/(h ft2)": ("btu/(hft2)", "btu/hft2", "btu/h/ft2", "btu/hr/ft2", "btu/(hrft2)"),
    "percent": ("%", "percent", "pct", "prozent"),
    "-": ("-", "fraction", "0-1", "0..1"),
    "kW": ("kw", "kilowatt", "kilowatts", "kwt", "kwth", "kwh/h"),
    "W": ("w", "watt", "watts"),
    "MW": ("MW", "megawatt", "megawatts"),
    "Btu/h": ("btu/h", "btu/hr", "btuh", "btu_h", "btu_hr"),
    "kBtu/h": ("kbtu/h", "kbtu/hr", "kbtuh", "kbtu_h", "kbtu_hr", "mbh"),
    "kcal/h": ("kcal/h", "kcal/hr"),
    "kJ/h": ("kj/h", "kj/hr"),
    "MJ/h": ("mj/h", "mj/hr"),
    "GJ/h": ("gj/h", "gj/hr"),
    "Gcal/h": ("gcal/h", "gcal/hr"),
    "MMBtu/h": ("mmbtu/h", "mmbtu/hr"),
    "tons": ("tons", "ton", "tonr", "rt", "tonsrefrigeration", "tonsofrefrigeration"),
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
#: units of energy [kWh]: per row, or a counter where the readings only rise; they become kW once the step is known
ENERGY = {"kWh": 1.0, "Wh": 1e-3, "MWh": 1e3, "J": 1e-6 / 3.6, "kJ": 1e-3 / 3.6, "MJ": 1.0 / 3.6, "GJ": 1e3 / 3.6}
ENERGY |= {"kcal": 1.163e-3, "Gcal": 1163.0, "MMBtu": 293.0710702}
ENERGY |= {"Btu": 2.930710702e-4, "kBtu": 0.2930710702, "therm": 29.30710702, "ton-h": 3.516852842}
#: units of a counter [kWh], also where a few rows or a standing meter do not show that it is one
COUNTERS = {f"{unit} counter": factor for unit, factor in ENERGY.items()}
#: units of the irradiation of each row [kWh/m2], which becomes irradiance likewise
IRRADIATION = {"Wh/m2": 1e-3, "kWh/m2": 1.0, "J/cm2": 1.0 / 360.0, "kJ/m2": 1.0 / 3600.0, "MJ/m2": 1.0 / 3.6}
_ENERGIES = {name.lower(): name for name in (*ENERGY, *IRRADIATION)} | {
    **dict.fromkeys(("therms", "thm"), "therm"),
    **dict.fromkeys(("kwhs", "kwhr", "kwhrs", "kw-h", "kw-hr", "kilowatt-hours", "kilowatthours"), "kWh"),
    **dict.fromkeys(("watt-hours", "watthours"), "Wh"),
    **dict.fromkeys(("btus", "btu's"), "Btu"),
    **dict.fromkeys(("ton-hours", "ton-hour", "ton-hr", "tonhours", "tonhr", "tonh", "rth"), "ton-h"),
}
#: units that a unit line may hold and no channel is converted from
_FOREIGN = (
    "l|lit(?:er|re)s?|gal|kg|ppm|ppb|k?lux|k?lx|pa|kpa|hpa|mbar|bar|psi|m3/h|m3|ccf|l/s|l/h|l/min|cfm|m/s|km/h|mph|mm|"
    "%rh|rh"
)
_OTHERS = (
    f"{_FOREIGN}|mw|a|ma|v|mv|volts|hz|rpm|s|sec|min|h|hr|ts|rn|smp|avg|tot|std|max|none|units?|einheit|bool|enum|"
    "on/off|0/1"
)
_IS_FOREIGN = re.compile(rf"(?:{_FOREIGN})\Z", re.IGNORECASE)
_OTHER = re.compile(rf"(?:{_OTHERS})\Z", re.IGNORECASE)
#: a text that is surely a unit of power or energy, known or not
_OF_POWER = re.compile(r"[kMGTm]{0,2}(?:W|J|cal|Btu|VA)(?:h|hrs?|s)?(?:[\s/*·^²_-].*)?\Z", re.IGNORECASE)
_LAST = re.compile(r"(?<=[\s_])([kM]?Wh?/\S+|[kMG]?J/\S+|[kG]?cal/\S+|[kM]{0,2}Btu\S*)\Z", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[({]([^\[\](){}]*(?:\([^()]*\))?[^\[\](){}]*)[\])}]\s*\Z")
_ENDING = re.compile(
    r"(°\s?[CF]|(?<=\bt)[CF]|(?<=_t)[CF]|%|(?:(?<=[\s_,/])|\A)(?:deg_?\s?[CF]|k?W_m2|k?Wh?/m(?:2|²|\^2)|[kM]?J/c?m(?:2|²|\^2)|percent|pct|k?W|m[3³]|Celsius|"
    r"Fahrenheit|(?i:tons?|[km]?wh|[mg]j|k?btu[/_]?hr?|k?btu|therms?)))\s*\Z"
)
_SYMBOLS = str.maketrans({**dict.fromkeys("Â^·⋅*", ""), "²": "2", "³": "3", "°": "deg", "º": "deg", "⁻": "-"})


def unit_named(text: object) -> str | None:
    """The unit that a text such as "°F" or "[W/m²]" spells, in the words of ``UnitConverter``; None for another."""
    spelt = _plain(str(text))
    return _UNITS.get(spelt) or (None if spelt == "mW" else _UNITS.get(spelt.lower()))


def unit_or_energy(text: object) -> str | None:
    """The unit that a text spells, or one of :data:`ENERGY` or :data:`IRRADIATION`; None for another."""
    return unit_named(text) or _ENERGIES.get(_plain(str(text)).lower())


def unit_text(name: str) -> str | None:
    """The unit in the name of a channel, as it stands there: in brackets at the end, or a plain ending."""
    found = _BRACKETS.search(name)
    if found and (found[1].strip() and is_unit(found[1])):
        return found[1].strip()
    if (ending := _ENDING.search(name)) or ((ending := _LAST.search(name)) and is_unit(ending[1])):
        return ending[1]
    return unit_text(name[: found.start()]) if found else None  # EnergyPlus ends with (TimeStep)


def is_unit(text: str) -> bool:
    """Whether a cell of a unit line is a unit."""
    return unit_or_energy(text) is not None or bool(_OTHER.match(_plain(text)))


def strange_unit(name: str) -> str | None:
    """A unit of power or energy at the end of a name that no list here has; None for any other text."""
    found = _BRACKETS.search(name)
    texts = _LAST.findall(name) if found is None else [found[1].strip()]
    return next((text for text in texts if _OF_POWER.match(text) and not is_unit(text)), None)


def is_foreign(text: str) -> bool:
    """Whether a text is the unit of a quantity that no model reads, such as m3 or hPa."""
    return bool(_IS_FOREIGN.match(_plain(text)))


def _plain(text: str) -> str:
    text = text.strip()
    if len(text) > 2 and (text[0], text[-1]) in (("[", "]"), ("(", ")"), ("{", "}")):
        text = text[1:-1]
    return re.sub(r"\s+", "", text.translate(_SYMBOLS))
