"""Refusal of new rows whose values are likely in another unit than those that a model knows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from .._ranges import is_in_watts
from .._table import is_plant

_BRIGHTER = 20.0  # times the highest sun that is known, which sun in W/m2 usually exceeds, and no summer does
_BEYOND = 20.0  # by which degF exceed the highest temperature that is known in degC [K]


def refuse_changed_units(
    new: pd.DataFrame,
    known: pd.DataFrame,
    covered: Mapping[str, tuple[float, float]],
    named: Mapping[str, str],
    remedy: str,
) -> None:
    """Refuse new rows in degF, W/m2 or W beside what a model learned from, usually and not at a single spike.

    ``new`` and ``known`` rows have a column per role, ``covered`` is the lowest and highest value of each in training,
    ``named`` is what messages call some roles, and ``remedy`` is what else than correcting the rows a user may do.
    """
    roles = list(map(str, new))
    for role in (role for role in roles if role.startswith(("T_za", "T_oa"))):
        most = np.fmax(known[role].max() if role in known else np.nan, covered.get(role, (np.nan, np.nan))[1])
        if new[role].median() > most + _BEYOND:
            at_most = f"{most:.4g} degC in what the model knows"
            raise _other_unit(new[role], named, "degC", at_most, "degF", remedy)
    for role in (role for role in roles if role.startswith("q_sol") and role in covered):
        sun, most = new[role][new[role] > 0.0], covered[role][1]
        if sun.median() > _BRIGHTER * most > 0.0:
            at_most = f"{most:.4g} kW/m2 in what the model learned from"
            raise _other_unit(new[role], named, "kW/m2", at_most, "W/m2", remedy)
    for role in (role for role in roles if is_plant(role) and role.startswith("Q_") and role in covered):
        heat = new[role].abs()
        running = heat[heat > 0.0]
        if len(running) and is_in_watts(np.array([running.median()]), covered[role]):
            at_most = f"{max(map(abs, covered[role])):.4g} kW in what the model learned from"
            raise _other_unit(heat, named, "kW", at_most, "W", remedy)


def _other_unit(
    new: pd.Series, named: Mapping[str, str], unit: str, known: str, likely: str, remedy: str
) -> ValueError:
    """The refusal of new values of a role, which are to be in a unit, beside those that are ``known``."""
    role = str(new.name)
    return ValueError(
        f"{named.get(role) or role} reaches {new.max():.4g} {unit} from {new.index[0]} on, and {known}: likely "
        f"{likely} rather than {unit}; correct the rows, or {remedy}."
    )
