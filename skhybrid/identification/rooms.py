"""Identification of a building room by room, with the neighbours' measured temperatures as boundaries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from sklearn.base import clone

from .._arguments import check_n_jobs
from .._table import checked_columns, listed, refuse_order
from ..thermal import RCNetwork, get_network, room_network
from .base import NetworkIdentifier
from .experiment import temperatures_by_role


class RoomFits(NamedTuple):
    """Parameters of a building that was identified room by room.

    Attributes
    ----------
    theta : Series
        Every parameter of the building that the rooms have.  Of a partition it is the mean of what both rooms say, on
        the scale of its logarithm, weighted by their standard errors.
    theta_std : Series
        Standard errors.
    rooms : dict of zone to estimator
        The fitted gray box of each room.
    """

    theta: pd.Series
    theta_std: pd.Series
    rooms: dict[str, Any]


def identify_rooms(estimator: NetworkIdentifier, X: Any, y: Any, n_jobs: int | None = None) -> RoomFits:
    """Identify a building room by room: each with its neighbours' measured temperatures as boundaries.

    The effort grows with the number of rooms, where that of a fit of the whole grows with its cube.  Each room has its
    own disturbance.

    Parameters
    ----------
    estimator : NetworkIdentifier
        Such as :class:`PeriodicDisturbanceID` of a :func:`~skhybrid.thermal.building_network`; it is not fitted.
    X : DataFrame of shape (n_samples, n_features)
        Weather, sun and heat of all rooms.
    y : DataFrame of shape (n_samples, n_zones)
        Measured temperatures [degC] by ``T_za_<zone>`` or ``<zone>``.  Where a neighbour's is missing
        it is interpolated.
    n_jobs : int, optional
        Rooms fitted in parallel.

    Returns
    -------
    RoomFits
        ``theta`` can be the ``known`` of a gray box of the whole building, which then only learns its disturbance, or
        the ``theta_init`` of its fit.

    Raises
    ------
    ValueError
        If the network is no building, rooms are coupled by nodes that are not measured, heat in kW is shared, or y
        lacks a zone.
    """
    check_n_jobs(n_jobs)
    if not isinstance(estimator, NetworkIdentifier):
        raise ValueError(f"estimator={estimator!r} is no identification, such as InputDisturbanceID; give one.")
    network = get_network(estimator.network)
    if not network.zones:
        raise ValueError(f"the network {network.name} has no zones; make it by thermal.building_network.")
    if not isinstance(X, pd.DataFrame):
        raise ValueError("X must be a DataFrame; a room's columns are found by name.")
    if X.columns.nlevels > 1:
        raise ValueError(f"the columns of X have {X.columns.nlevels} levels; give each column one name (X.set_axis).")
    roles = {column: role for role, column in checked_columns(estimator.columns).items()}
    read = {column: roles.get(column, column) for column in X.columns}
    _refuse_what_rooms_cannot_tell(network, read.values())
    names = dict(zip(network.measured_names, network.history_roles, strict=True))
    if not isinstance(y, pd.DataFrame):
        raise ValueError(f"y must be a DataFrame; give one with the columns {listed(names.values())}.")
    refuse_order(y.index, X.index)
    if len(y) != len(X):
        raise ValueError(f"X has {len(X)} rows, but y has {len(y)}; give the same rows of both.")
    measured = temperatures_by_role(y, names).set_axis(X.index)
    between = measured.interpolate(limit_direction="both")
    jobs = [
        delayed(_fit_room)(estimator, room_network(network, zone), X, read, measured[f"T_za_{zone}"], between)
        for zone in network.zones
    ]
    rooms = dict(zip(network.zones, Parallel(n_jobs=n_jobs)(jobs), strict=True))
    return RoomFits(*_combined(rooms.values()), rooms)


def _refuse_what_rooms_cannot_tell(network: RCNetwork, roles: Iterable[str]) -> None:
    for name, ends in network.resistors.items():
        hidden = set(ends) & set(network.nodes) - set(network.measured_nodes)
        inside = any(set(ends) & set(network.nodes) <= set(nodes) for nodes in network.zones.values())
        if hidden and not inside:
            raise ValueError(
                f"{name} joins rooms at {', '.join(sorted(hidden))}, which is not measured; fit the whole building "
                "as one network."
            )
    heated = network.heated if isinstance(network.heated, Mapping) else {}
    shared = [role for role, target in heated.items() if isinstance(target, Mapping)]
    for role in roles:
        if role in shared and role.startswith("Q_"):
            raise ValueError(f"column {role!r} is heat that rooms share; fit the whole building as one network.")


def _fit_room(
    estimator: NetworkIdentifier,
    room: RCNetwork,
    X: pd.DataFrame,
    read: Mapping[Any, str],
    y: pd.Series,
    between: pd.DataFrame,
) -> NetworkIdentifier:
    """The gray box of one room, which reads its own columns and its neighbours' temperatures."""
    neighbours = [role for role in room.boundaries if role in between]
    wanted = {*room.boundaries, *room.solar, *room.heated} - {*neighbours}
    table = X[[column for column, role in read.items() if role in wanted]].join(between[neighbours])
    own = {p.name for p in room.parameters(wanted)}
    foreign = {p.name for p in get_network(estimator.network).parameters(read.values())} - own
    settings = {
        name: {key: value for key, value in given.items() if key not in foreign}
        for name in ("known", "bounds", "priors")
        if (given := getattr(estimator, name))
    }
    columns = {role: column for role, column in dict(estimator.columns or {}).items() if role in wanted}
    return clone(estimator).set_params(network=room, columns=columns or None, **settings).fit(table, y)


def _combined(rooms: Iterable[NetworkIdentifier]) -> tuple[pd.Series, pd.Series]:
    """Values and standard errors of all rooms; means of what two say, weighted on the scale of the logarithm."""
    found = pd.concat([pd.DataFrame({"theta": room.theta_, "std": room.theta_std_}) for room in rooms])
    twice = found.index.duplicated(keep=False)
    once, both = found[~twice], found[twice]
    weight = (both["std"] / both["theta"]).fillna(np.inf).clip(1e-9, 1e9) ** -2
    total = weight.groupby(level=0, sort=False).sum()
    mean = np.exp((weight * np.log(both["theta"])).groupby(level=0, sort=False).sum() / total)
    least = both["std"].groupby(level=0, sort=False).min()  # NaN or infinite where neither room tells
    std = (mean / np.sqrt(total)).where(np.isfinite(least), least)
    return pd.concat([once["theta"], mean]).rename("theta"), pd.concat([once["std"], std]).rename("std")
