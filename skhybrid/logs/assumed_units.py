"""Units that a log does not state, by its values."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from .._ranges import range_of
from .._table import is_stage
from .conversion import Channel, contract_unit, row_hours
from .counters import is_counter, usual_peak
from .naming import FEW_FOR_PERCENT, NAMED_BY_ROLE, OF_PLANT, PLACE_ALONE, SURE, Guess, guess_role

_LEAST_PERCENT = 20.0  # that is neither kW/m2 nor the kW of a room
_TEMPERATURES = {"T_za": (8.0, 35.0), "T_oa": (-40.0, 45.0)}  # of a room and outdoors [degC]
_BYTE = 255.0  # of a valve on a bus, in whole numbers
_STAGE_STEPS = (1.0, 10.0, 60.0, 100.0)
_FASTEST, _FEWEST = 4.0, 24  # mean move of outdoor air within an hour, in any degree, and values that show it
_WARM = 42.0  # median of a temperature [degC] that is in another unit, or counts
_PARTS = ((0.1, "tenths", 120.0, 255.0), (0.01, "hundredths", 1200.0, 3500.0))  # of a degree: the median of a room


def assumed_unit(values: pd.Series, role: str, factor: float, is_contract: bool) -> tuple[str | None, float, str]:
    """A unit and a factor from values, with a sentence on why, or ""; a role's own name stands for its unit."""
    known = values.to_numpy(dtype=np.float64)
    known = known[np.isfinite(known)]
    if not len(known) or (is_stage(role) and factor != 1.0):
        return None, factor, ""
    if is_stage(role) and known.max() > 1.0 and (np.diff(known) >= 0.0).all() and is_counter(values):
        why = f"values only rise, as those of a counter; if it counts heat, give Q_{role[2:]} and its unit"
        return None, factor, f"{why}, such as 'kWh counter', and the kWh of a count under [scale]"
    if is_stage(role) and factor == 1.0 and set(np.unique(known)) == {1.0, 2.0}:
        return None, factor, f"values are 1 and 2, as codes of states; write 1 where it runs and 0 elsewhere for {role}"
    if is_stage(role):
        return _of_stage(float(known.min()), float(known.max()), role, factor)
    if role == "T_oa" and factor == 1.0 and _moves_by_tenths(values):
        return None, 0.1, "whole numbers that move by several in an hour are those of tenths of a degree"
    if role.startswith("T_"):
        return _of_temperature(known, role, factor)
    low, high = float(known.min()), float(known.max())
    if role.startswith("Q_") and is_counter(values):
        return "kWh", factor, "values only rise: a counter in kWh is assumed"
    limit = 2.0 if role.startswith("q_sol") else 200.0
    if role.startswith(("q_sol", "Q_")) and usual_peak(np.abs(known[known != 0.0])) > limit:
        unit = "W/m2" if role.startswith("q_sol") else "W"
        return unit, factor, f"values reach {max(high, -low):.0f}: {unit} is assumed"
    return None, factor, "" if is_contract else f"no unit is stated: {contract_unit(role)} is assumed"


def reread_values(
    guesses: Mapping[str, Guess], stated: Mapping[str, str | None], frame: pd.DataFrame
) -> dict[str, Guess]:
    """Guesses from names without a unit whose values tell: powers in percent are stages, irradiance in percent is none.

    What is named after a plant alone is its heat where its values are those of no stage.
    """
    found = dict(guesses)
    bare = frame[[name for name, guess in guesses.items() if guess.reason == OF_PLANT and stated[name] is None]]
    tops = bare.max().where(bare.min() >= 0.0)
    in_percent = bool(((tops > _LEAST_PERCENT) & (tops <= _STAGE_STEPS[-1])).any())  # so are all of their kind
    for name, guess in guesses.items():
        if stated[name] is None and guess.certainty < SURE and guess.reason != NAMED_BY_ROLE:
            known, role = frame[name].dropna(), str(guess.role)
            low, high = known.min(), known.max()
            if guess.reason == OF_PLANT and _is_heat(known, in_percent):
                why = FEW_FOR_PERCENT if high <= _LEAST_PERCENT else "are those of no stage"
                reason = f"its name is that of a plant, and its values up to {high:.5g} {why}"
                found[name] = guess._replace(role=f"Q_{role[2:]}", reason=reason)
            if not (len(known) and low >= 0.0 and _LEAST_PERCENT < high <= 100.0):
                continue
            if role.startswith(("Q_heat", "Q_cool")) and (known % 1.0 == 0.0).all():
                reason = "its name is that of a power, but its values are whole numbers up to 100, as those of a stage"
                found[name] = Guess(f"u_{role[2:]}", guess.certainty, reason)
            elif role.startswith("q_sol"):
                why = f"values up to {high:g} may be percent, or W/m2 of a dark season"
                found[name] = Guess(None, 0, f"{why}; give {role} and its unit, or 0.01 under [scale] for percent")
    return _with_places(found, stated, frame)


def _with_places(guesses: dict[str, Guess], stated: Mapping[str, str | None], frame: pd.DataFrame) -> dict[str, Guess]:
    """Guesses with columns named after the room or outdoors alone, where their values are those of its temperature."""
    roles = {guess.role for guess in guesses.values()}
    alone = [name for name, guess in guesses.items() if guess.reason == PLACE_ALONE and stated[name] is None]
    for role, (least, most) in _TEMPERATURES.items():
        own = [name for name in alone if guess_role(f"{name} temp").role == role]
        if len(own) == 1 and role not in roles:
            known = frame[own[0]].dropna()
            if len(known) and known.between(least, most).all() and (known % 1.0 != 0.0).any():
                reason = "its name says where it measures, and its values are those of a temperature in degC"
                guesses = guesses | {own[0]: Guess(role, 1, reason)}
    return guesses


def _is_heat(known: pd.Series, in_percent: bool) -> bool:
    """Whether the values of a plant are beyond those of a stage, or have decimals and are few for a percentage.

    They are no few where those of a column of this kind are ``in_percent``.
    """
    low, high = known.min(), known.max()
    few, whole = 1.0 < high <= _LEAST_PERCENT and not in_percent, (known % 1.0 == 0.0).all()
    many = high > (_BYTE if whole else _STAGE_STEPS[-1])
    return bool(low >= 0.0 and (many or (few and not whole)) and not (np.diff(known) >= 0.0).all())


def _of_stage(low: float, high: float, role: str, factor: float) -> tuple[str | None, float, str]:
    top = next((step for step in _STAGE_STEPS if high <= step), None)
    if low < range_of(role).lowest * max(1.0, high):
        why = f"values from {low:g} to {high:g} are not those of a stage; give Q_{role[2:]} and its unit if it is heat"
        return None, factor, why
    if top == 1.0:
        return None, factor, ""
    if top is None:
        why = (
            f"values reach {high:g}, beyond 100 %; give {role} and 1 / its full scale under [scale] if it is a "
            f"stage, or Q_{role[2:]} and its unit if it is heat"
        )
        return None, factor, why
    why = f"values reach {high:g}: percent is assumed, so kW have no certain scale"
    return "percent", factor, f"{why}; if it is heat, give Q_{role[2:]} and its unit"


def _moves_by_tenths(values: pd.Series) -> bool:
    """Whether an outdoor temperature in whole numbers moves more within an hour than air does, in tenths."""
    known = values.dropna()
    hour = round(1.0 / row_hours(known)) if len(known) > _FEWEST else 0
    moves = np.abs(known.to_numpy()[hour:] - known.to_numpy()[:-hour]) if hour else np.zeros(1)
    return bool((known % 1.0 == 0.0).all() and _FASTEST < moves.mean() < 10.0 * _FASTEST)


def _of_temperature(known: np.ndarray, role: str, factor: float) -> tuple[str | None, float, str]:
    low, high, middle = float(known.min()), float(known.max()), float(np.median(known))
    lasting = float(pd.Series(known).rolling(5, center=True, min_periods=1).median().max())  # no spike of a sensor
    are = f"values from {low:.0f} to {high:.0f} are those of"
    is_outdoor = role == "T_oa"
    if not (middle > _WARM or (is_outdoor and lasting > range_of(role).usual_highest)):
        return None, factor, ""
    for part, name, least, most in _PARTS:
        if factor == 1.0 and least <= middle <= most and not is_outdoor:
            return None, part, f"{are} {name} of a degree"
    return ("K" if low > 200.0 else "degF"), factor, f"{are} {'K' if low > 200.0 else 'degF'}"


def outdoor_as_room(
    channels: list[Channel], frame: pd.DataFrame, assumed: Mapping[str, str], own: Collection[str]
) -> tuple[list[Channel], str]:
    """Channels whose outdoor temperature is read as that of the rooms, and a sentence on why, or "".

    On cold days values do not show degF, nor tenths of a degree where all are whole numbers.  ``own`` are roles that
    have columns of their names, which stand for their units.
    """
    rooms = [c for c in channels if c.role.split("_")[:2] == ["T", "za"]]
    outdoor = next((c for c in channels if c.role == "T_oa"), None)
    if outdoor is None or not rooms:
        return channels, ""
    parts = [c.scale for c in rooms if c.role in assumed and c.scale != 1.0]
    values, in_degF = frame[outdoor.name].dropna(), {c.role for c in rooms if c.unit == "degF"}
    if parts and outdoor.scale == 1.0 and (outdoor.unit is None or "T_oa" in assumed) and (values % 1.0 == 0.0).all():
        same, why = outdoor._replace(unit=None, scale=parts[0]), "whole numbers are taken as parts of a degree"
    elif outdoor.unit is None and in_degF and ("T_oa" not in own or in_degF & set(assumed)):
        same, why = outdoor._replace(unit="degF"), "no unit is stated: degF is assumed"
    else:
        return channels, ""
    return [same if c is outdoor else c for c in channels], f"{why}, as of the room"
