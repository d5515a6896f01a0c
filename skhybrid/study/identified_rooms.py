"""An identified building of several zones: each room, and what it exchanges with its neighbours."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd

from .._table import is_plant
from ..identification import RoomFits, find_adjacency, identify_rooms
from ..thermal import building_network
from .compared_models import make_gray_box
from .identified_building import UNSCALED, describe, has_scale, identified_only, not_identified, remark_on
from .settings import Settings
from .zone_part import roles_of

_GIVEN = ("known", "bounds")  # parameters of an identification by the name of a network's parameter


class IdentifiedRooms(NamedTuple):
    """The rooms of a building, identified from its log."""

    rooms: pd.DataFrame  # index (zone, quantity): value, std, unit, remark
    partitions: pd.DataFrame  # index (zone, neighbour): value, std [W/K], unit, remark; heat that they exchange per K
    found: bool  # whether the pairs were found in the log, since no floor plan was given

    @property
    def table(self) -> pd.DataFrame:
        """Quantities of the rooms, and what each two exchange, with the zone as a column."""
        rooms, between = self.rooms.reset_index("zone"), self.partitions.reset_index()
        between = between.set_index("exchange with " + between["neighbour"].astype(str)).drop(columns="neighbour")
        return pd.concat([rooms, between]).rename_axis("quantity")

    def as_dict(self) -> dict[str, Any]:
        """The rooms and their exchange as plain values."""
        rooms, partitions = identified_only(self.rooms), identified_only(self.partitions)
        zones = rooms.index.get_level_values("zone").unique()
        exchanged = zip(partitions.index, partitions.to_dict(orient="records"), strict=True)
        between = [{"zones": list(pair), **row} for pair, row in exchanged]
        return {"zones": {str(zone): rooms.loc[zone].to_dict(orient="index") for zone in zones}, "exchange": between}


def identify_zones(settings: Settings, rows: pd.DataFrame) -> IdentifiedRooms:
    """Identify every zone of a building, with its neighbours' temperatures as boundaries.

    ``rows`` have a column per role and no missing input.  The settings' ``adjacency`` says which zones exchange heat;
    else that is found in the rows, which takes ten days of them.  A ValueError names a room that cannot be identified.
    """
    temperatures = settings.roles_of("T_za")
    inputs, measured = rows.drop(columns=temperatures), rows[temperatures]
    pairs = _pairs(settings, inputs, measured)
    fits = _fitted(settings, pairs, inputs, measured)
    tables = {zone: _of_room(gray_box, zone) for zone, gray_box in fits.rooms.items()}
    rooms = pd.concat(tables, names=["zone", "quantity"])
    return IdentifiedRooms(rooms, _partitions(pairs, fits), settings.adjacency is None)


def _pairs(settings: Settings, inputs: pd.DataFrame, measured: pd.DataFrame) -> list[tuple[str, str]]:
    if settings.adjacency is not None:
        unique = {frozenset(pair): (str(pair[0]), str(pair[1])) for pair in settings.adjacency}
        return list(unique.values())
    found = find_adjacency(inputs, measured)
    return [(str(a), str(b)) for a, b in found.index[found["kept"]]]


def _fitted(settings: Settings, pairs: list[tuple[str, str]], inputs: pd.DataFrame, measured: pd.DataFrame) -> RoomFits:
    """The gray boxes of all rooms, each with what heats it and shines into it."""
    gray_box = make_gray_box(settings)
    solar, heated = {}, {}
    for zone in settings.zones:
        own = list(roles_of(map(str, inputs), settings, zone).values())
        sun = [role for role in own if role == f"q_sol_{zone}"] or [role for role in own if role == "q_sol"]
        solar[zone] = tuple(sun)
        heated[zone] = tuple(role for role in own if is_plant(role))
    network = building_network(settings.zones, pairs, room=gray_box.network, solar=solar, heated=heated)
    names = {parameter.name for parameter in network.parameters(map(str, inputs))}
    given = {name: _by_zone(value, names, settings.zones) for name in _GIVEN if (value := getattr(gray_box, name))}
    return identify_rooms(gray_box.set_params(network=network, **given), inputs, measured)


def _by_zone(given: Mapping[str, Any], names: Collection[str], zones: Sequence[str]) -> dict[str, Any]:
    """Values of parameters by the ``names`` of a building's; that of no zone's parameter holds for all zones."""
    own = {name: value for name, value in given.items() if name in names}
    others = {name: value for name, value in given.items() if name not in names}
    of_all = {name: [one for zone in zones if (one := f"{name}_{zone}") in names] or [name] for name in others}
    return {one: value for name, value in others.items() for one in of_all[name]} | own


def _of_room(gray_box: Any, zone: str) -> pd.DataFrame:
    """Quantities of a room by the names that a single zone has."""
    table = describe(gray_box)
    return table.set_axis([str(name).removesuffix(f"_{zone}").removesuffix("_to") for name in table.index])


def _partitions(pairs: list[tuple[str, str]], fits: RoomFits) -> pd.DataFrame:
    out = {}
    for a, b in pairs:
        name = f"R_{a}_{b}"
        R, std = float(fits.theta[name]), float(fits.theta_std[name])
        doubtful = [remark for zone in (a, b) if (remark := not_identified(fits.rooms[zone]).get(name))]
        value, error = 1000.0 / R, 1000.0 * std / R**2
        scaled = all(has_scale(fits.rooms[zone]) for zone in (a, b))
        remark = (UNSCALED if not scaled else "") or next(iter(doubtful), "") or remark_on("partition", value, error)
        out[a, b] = {"value": value, "std": error, "unit": "W/K", "remark": remark}
    index = pd.MultiIndex.from_tuples(list(out), names=["zone", "neighbour"])
    return pd.DataFrame(list(out.values()), index, columns=["value", "std", "unit", "remark"])
