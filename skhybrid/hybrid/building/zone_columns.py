"""Columns of a building's zones, told apart by their names, and which zones are neighbours."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils import check_consistent_length

from ..._last_known import carried_forward
from ..._table import (
    SETPOINT_ROLES,
    as_numbers,
    as_pandas,
    ending_zone,
    is_plant,
    is_stage,
    listed,
    numeric,
    refuse_exchanged,
    role_of,
    same_values,
)
from ..._warnings import warn_user
from ...exceptions import RoleWarning
from ...thermal.declaration import capacity_name
from ...thermal.joined_rooms import checked_pairs
from ..scheme import NEXT as NEXT

MEASURED = "T_za_"  # before a zone's name: the role of its measured temperature
_SETPOINTS = tuple(f"{role}_" for role in SETPOINT_ROLES)
_OWN_PLANTS = ("Q_hvac_", "u_heat_", "u_cool_")
_MOST_FOUND = 3  # neighbours of a zone that are taken from data
_LEAST_CORRELATION = 0.2  # of the temperatures' changes


@dataclass(frozen=True)
class ZoneColumns:
    """The zones of a frame and their columns: a column whose name ends with that of a zone is its own."""

    zones: tuple[str, ...]
    columns: Mapping[str, Any]  # role -> column

    @classmethod
    def of(cls, X: Any, names: tuple[str, ...], columns: Mapping[str, Any] | None) -> ZoneColumns:
        """Columns of X for zones of these ``names``, by their own names or ``columns`` by role."""
        for name in names:
            if not re.fullmatch(r"\w+", name) or names.count(name) > 1:
                raise ValueError(f"y has the zone {name!r}; give each zone one column, named in letters and digits.")
        given = {role: column for role, column in (columns or {}).items() if column is not None}
        here = [c for c in X.columns if role_of(c)] if isinstance(X, pd.DataFrame) else []
        by_role = {str(c): c for c in here if c not in given.values()} | given
        measured = [role.removeprefix(MEASURED) for role in by_role if role.startswith(MEASURED)]
        if measured:
            for found, others, where in ((measured, names, "y"), (names, measured, "X")):
                absent = [name for name in found if name not in others]
                if absent:
                    raise ValueError(
                        f"{where} has no temperature of the zone {absent[0]!r}; X has those of {listed(measured)}, y "
                        f"of {listed(names)}: give both the same zones."
                    )
        return cls(names, by_role)

    def owner(self, role: str) -> str | None:
        """The zone to which a role belongs; None where all share it."""
        own = is_plant(role) or role.startswith(("q_sol_", MEASURED, *_SETPOINTS))
        return ending_zone(role, self.zones) if own else None

    def is_history(self, role: str) -> bool:
        """Whether a role is a temperature that is measured, or a set-point."""
        return role.startswith((MEASURED, *_SETPOINTS)) and self.owner(role) is not None

    def of_zone(self, zone: str) -> dict[str, Any]:
        """The column of each role as a predictor of that zone alone has it; None for columns of other zones.

        Its own temperature and set-points hold in place of shared ones; its own plant runs beside a shared one.
        """
        owners = {role: self.owner(role) for role in self.columns}
        out = {role: self.columns[role] for role, owner in owners.items() if owner is None}
        for role, owner in owners.items():
            if owner == zone:
                plain = self._plain(role, zone)
                out[role if plain in out and is_plant(role) else plain] = self.columns[role]
        # the plants of others would be read by their names, their temperatures are not
        others = (role for role, owner in owners.items() if owner not in (None, zone) and role not in out)
        return out | {role: None for role in others if not role.startswith(MEASURED)}

    def in_zone(self, zone: str, given: Mapping[str, Any]) -> dict[str, Any]:
        """The parameter ``columns`` of a predictor of that zone alone, by the one that was ``given``."""
        own = self.of_zone(zone)
        moved = {column for role, column in own.items() if given.get(role) != column and column is not None}
        return {role: column for role, column in given.items() if column not in moved} | own

    def known_in_zone(self, zone: str, given: Mapping[str, Any]) -> dict[str, Any]:
        """Parameters that are ``given`` as known, by the names that they have for a predictor of that zone alone.

        ``Q_h_<zone>``, the capacity of a zone's own stage, holds in place of ``Q_h``, that of all zones.
        """
        roles = {column: role for role, column in self.of_zone(zone).items() if column is not None}
        stages = [role for role in self.columns if is_stage(role) and self.owner(role) is not None]
        own = {capacity_name(role): roles.get(self.columns[role]) for role in stages}
        shared = {name: value for name, value in given.items() if name not in own}
        return shared | {capacity_name(role): given[name] for name, role in own.items() if role and name in given}

    @staticmethod
    def _plain(role: str, zone: str) -> str:
        """A zone's role without its name: ``Q_hvac`` for ``Q_hvac_north`` and ``Q_north``."""
        base = role.removesuffix(f"_{zone}")
        return {"Q": "Q_hvac", "q_sol": role}.get(base, base if role_of(base) else role)

    def measured(self, zone: str) -> Any:
        """The column of a zone's measured temperature."""
        return self.columns.get(MEASURED + zone, self.columns.get("T_za", MEASURED + zone))

    def known(self, X: Any, y: Any = None) -> pd.DataFrame:
        """Measured temperature of each zone (n, n_zones), NaN where missing [degC]: the target y, or those in X."""
        if y is not None:
            given = temperatures_of(y, X, list(self.zones))
            check_consistent_length(X, given)
            self.refuse_exchanged(X, given)
            return given
        own, here = {zone: self.measured(zone) for zone in self.zones}, getattr(X, "columns", ())
        T = {zone: as_numbers(X[c], str(c)) if c in here else np.full(len(X), np.nan) for zone, c in own.items()}
        return pd.DataFrame(T, getattr(X, "index", None))

    def planned(self, rows: pd.DataFrame, roles: Sequence[str]) -> np.ndarray:
        """(n, n_roles) heat and stages in rows ahead, 0 where a column is absent."""
        columns = [self.columns[role] for role in roles]
        return np.column_stack([as_numbers(rows[c], str(c)) if c in rows else np.zeros(len(rows)) for c in columns])

    @property
    def shared_plants(self) -> list[str]:
        """Columns of stages and heat of plants that serve several zones."""
        shared = [role for role in self.columns if is_plant(role) and self.owner(role) is None]
        return [str(self.columns[role]) for role in shared if len(self.zones) > 1]

    def refuse_shared_plants(self) -> None:
        """Refuse set-points where a plant serves several zones."""
        if self.shared_plants:
            raise ValueError(
                f"column {self.shared_plants[0]!r} is of a plant that several zones share, which cannot hold the "
                "set-points of each; give its stages or heat ahead to forecast, or plan them with affine_forecast and "
                "an optimiser."
            )

    def warn_of_no_zone(self) -> None:
        """Warn of set-points of no zone, and of shared plants named as a zone's own where a zone has none such."""
        for role, column in self.columns.items():
            kind = next((kind for kind in (*_SETPOINTS, *_OWN_PLANTS) if role.startswith(kind)), None)
            lacking = [zone for zone in self.zones if f"{kind}{zone}" not in self.columns]
            if kind is None or self.owner(role) or (kind in _OWN_PLANTS and not 0 < len(lacking) < len(self.zones)):
                continue
            so = "is not read" if kind in _SETPOINTS else "counts as a plant that all zones share"
            warn_user(
                f"column {column!r} ends with the name of no zone and {so}; the zones are {listed(self.zones)}: rename "
                "it if it is of one of them.",
                RoleWarning,
            )

    def refuse_exchanged(self, X: Any, T: pd.DataFrame) -> None:
        """Refuse targets (n, n_zones) of which one is the temperature of another zone in X, and not of its own."""
        own = {zone: self.columns.get(MEASURED + zone) for zone in self.zones}
        here = {zone: column for zone, column in own.items() if column in getattr(X, "columns", ())}
        if len(here) < 2 or not (len(X) == len(T) and X.columns.is_unique and T.columns.is_unique):
            return
        try:
            measured = {zone: numeric(X[column]) for zone, column in here.items()}
            wanted = {zone: numeric(T[zone]) for zone in here}
        except ValueError:  # the zone's predictor says which column holds no numbers
            return
        refuse_exchanged(measured, wanted)

    def input_of(self, role: str) -> list[tuple[str, str]]:
        """The zones that a plant's role acts on, and the role as each of them has it."""
        owner, column = self.owner(role), self.columns[role]
        zones = self.zones if owner is None else (owner,)
        return [(zone, next(own for own, c in self.of_zone(zone).items() if c == column)) for zone in zones]


def read_temperatures(y: Any, X: Any) -> pd.DataFrame:
    """A target as a frame (n, n_zones) by zone; an array's columns are named as those of X in order, or numbered."""
    if y is None:
        raise ValueError("This estimator requires y to be passed, but the target y is None.")
    y = as_pandas(y, "y")
    if isinstance(y, pd.DataFrame):
        by_place = {j: _unless_bools(y.iloc[:, j]) for j in range(y.shape[1])}  # a name may come twice
        return pd.DataFrame(by_place, y.index).set_axis([str(c).removeprefix(MEASURED) for c in y.columns], axis=1)
    if isinstance(y, pd.Series):
        return y.to_frame("zone" if y.name in (None, "T_za") else str(y.name).removeprefix(MEASURED))
    values = as_numbers(np.asanyarray(y), "y")
    if not values.ndim:
        raise ValueError(f"y={y!r} is a single value; give a temperature for each row.")
    values = values.reshape(len(values), -1)
    here = [c for c in X.columns if str(c).startswith(MEASURED)] if isinstance(X, pd.DataFrame) else []
    if here and len(here) != values.shape[1]:
        raise ValueError(f"y has {values.shape[1]} columns, X {len(here)} named {MEASURED}<zone>; give one per zone.")
    index = X.index if isinstance(X, pd.DataFrame) and len(X) == len(values) else None
    names = [str(c).removeprefix(MEASURED) for c in here] or [f"zone_{j}" for j in range(values.shape[1])]
    return pd.DataFrame(values, index, names)


def _unless_bools(column: pd.Series) -> Any:
    """A column of a target as float64; True and False, which a zone's predictor refuses, as they are."""
    return column if column.dtype == bool else numeric(column, f"column {column.name!r} of y")


def with_temperatures(X: Any, T: pd.DataFrame, columns: Mapping[str, Any] | None) -> Any:
    """X with the temperatures T (n, n_zones) of several zones as the history of each, where X has none itself."""
    roles = (*(columns or {}), *getattr(X, "columns", ()))
    if not isinstance(X, pd.DataFrame) or T.shape[1] == 1 or any(str(r).startswith("T_za") for r in roles):
        return X
    return X.assign(**{MEASURED + str(zone): values.to_numpy() for zone, values in T.items()})


def temperatures_of(y: Any, X: Any, zones: list[str]) -> pd.DataFrame:
    """A target as a frame (n, n_zones) of the ``zones`` that were learned, in their order."""
    T = read_temperatures(y, X)
    if set(zones) <= set(T.columns):
        return T[zones]
    if T.shape[1] != len(zones) or (hasattr(y, "columns") and len(zones) > 1):
        raise ValueError(f"y has the columns {listed(T.columns)}; give one for each of {listed(zones)}.")
    return T.set_axis(zones, axis=1)


def neighbours_of(zones: Sequence[str], adjacency: Iterable[Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """The neighbours of each zone by pairs of zones."""
    out: dict[str, list[str]] = {zone: [] for zone in zones}
    for one, other in checked_pairs(adjacency, zones):
        out[one].append(other)
        out[other].append(one)
    return {zone: tuple(found) for zone, found in out.items()}


def found_neighbours(T: pd.DataFrame) -> dict[str, tuple[str, ...]]:
    """Up to three zones whose temperatures (n, n_zones) change most like a zone's own from hour to hour.

    What all zones do at an hour of the day, such as warming up in the morning, is taken off first.  Zones of the same
    temperature are none: nothing shows what flows between them.
    """
    same = _same_temperatures(T)
    if not isinstance(T.index, pd.DatetimeIndex) or len(T) < 2:
        return {str(zone): tuple(str(z) for z in T if z != zone and {str(z), str(zone)} not in same) for zone in T}
    hourly = T.resample("h").mean().diff()
    unusual = hourly - hourly.groupby(pd.DatetimeIndex(hourly.index).hour).transform("mean")
    r = unusual.corr().to_numpy(copy=True)
    np.fill_diagonal(r, -1.0)
    names = [str(zone) for zone in T]
    for one, other in same:
        i, j = names.index(one), names.index(other)
        r[i, j] = r[j, i] = -1.0
    ranked = np.argsort(-r, axis=1)[:, :_MOST_FOUND]
    return {z: tuple(names[j] for j in ranked[i] if r[i, j] > _LEAST_CORRELATION) for i, z in enumerate(names)}


def refuse_same(T: pd.DataFrame, neighbours: Mapping[str, Sequence[str]]) -> None:
    """Refuse neighbours whose temperatures (n, n_zones) are the same."""
    for pair in _same_temperatures(T):
        if any(pair == {zone, other} for zone, others in neighbours.items() for other in others):
            raise ValueError(
                f"the zones {listed(sorted(pair))} of adjacency have the same temperature, so that nothing shows what "
                "flows between them; leave the pair out, or give each zone its own measurements."
            )


def _same_temperatures(T: pd.DataFrame) -> list[set[str]]:
    """Pairs of zones whose temperatures (n, n_zones) are equal in nearly all rows, as of one sensor."""
    measured = {str(zone): values.to_numpy(dtype=np.float64) for zone, values in T.items()}
    return [{one, other} for one, other in combinations(measured, 2) if same_values(measured[one], measured[other])]


def carried_on(T: np.ndarray, last: float) -> np.ndarray:
    """Temperatures (n,) in which the last known one stands where one is missing; ``last`` before the first."""
    known = carried_forward(T)
    seen = np.isfinite(known)
    return np.where(seen, known, last if np.isfinite(last) or not seen.any() else known[np.argmax(seen)])


def setpoints_by_zone(given: Any) -> Any:
    """The pair of each zone from columns such as ``T_heat_set_north``; what has none of them as it is."""
    if not isinstance(given, pd.DataFrame):
        return given
    pairs: dict[str, dict[str, Any]] = {}
    for name, column in given.items():
        role = next((role for role in SETPOINT_ROLES if str(name).startswith(f"{role}_")), None)
        if role is not None:
            pairs.setdefault(str(name).removeprefix(f"{role}_"), dict.fromkeys(SETPOINT_ROLES))[role] = column
    if not pairs:
        return given
    if sum(side is not None for pair in pairs.values() for side in pair.values()) < given.shape[1]:
        raise ValueError(
            f"setpoint has the columns {listed(given)}; give T_heat_set_<zone> and T_cool_set_<zone> only, each once."
        )
    return {zone: tuple(pair.values()) for zone, pair in pairs.items()}
