"""Adjacency of rooms from data: conductances between them under a penalty that is chosen on held-out days."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import nnls
from sklearn.base import BaseEstimator
from sklearn.linear_model import lasso_path

from .._calendar import N_CELLS, day_type_hour, one_hot
from .._table import ZoneTable, ending_zone, is_instant, is_stage, plant_roles, read_table, read_targets
from .._time import rows_per_hour, spell
from ..filtering import low_pass
from .experiment import temperatures_by_role

_MEMORIES = (3.0, 12.0, 48.0)  # of a room's own mass [h]: without it, neighbours stand in for the mass
_DAY_PARTS = (8.0, 12.0, 16.0)  # hours at which the sun may be on a room's windows
_LEADS = 6  # hours ahead that the penalty is chosen on
_FOLDS = 5  # blocks of days held out in turn
_FEWEST_DAYS = 10
_PENALTIES = 40


def find_adjacency(X: Any, y: Any, zones: Sequence[str] | None = None) -> pd.DataFrame:
    """Find which rooms of a building exchange heat, and how much, from a log.

    A room's change of temperature over an hour is regressed on the differences to the other rooms and to outdoors, its
    own memory and heat, the sun by time of day, and the hour of weekdays and weekend days.  A conductance is the same
    from both sides and not negative; a penalty makes few of them.  Its strength has the fewest couplings whose
    forecasts of six hours, on days held out, are within a standard error of the best.

    Parameters
    ----------
    X : DataFrame of shape (n_samples, n_features)
        ``T_oa``, irradiance, and what heats each room, ``Q_hvac_<zone>`` [kW] or ``u_heat_<zone>``, with time stamps.
    y : DataFrame of shape (n_samples, n_zones)
        Measured temperatures [degC], columns ``T_za_<zone>`` or ``<zone>``.
    zones : sequence of str, optional
        The rooms; by default those of y.

    Returns
    -------
    DataFrame
        One row per pair of zones: ``conductance`` [kW/K], 0 where it is left out; ``std``, its standard error, by days,
        where it is left out that of a fit with all pairs; ``kept``.  Where no room has measured heat in kW the
        conductances are relative to the rooms' capacity [1/h].

    Raises
    ------
    ValueError
        If y has less than two zones, a zone is missing, the step does not divide an hour, or there are less than ten
        days on which all rooms were measured.

    Notes
    -----
    Neighbours resemble a room's own mass, and rooms that are used alike look coupled.  On five rooms in EnergyPlus with
    open doors it finds the large conductances and misses small ones; with closed doors it also invents some.  Take a
    floor plan where there is one, and leave a pair out where unsure.

    Examples
    --------
    >>> from skhybrid.datasets import make_house
    >>> house = make_house(n_days=21, zones=2, random_state=0)
    >>> found = find_adjacency(house.X, house.y)
    >>> found.index[found["kept"]].tolist()
    [('living', 'kitchen')]
    """
    rooms = _read(X, y, zones)
    pairs = list(combinations(rooms.names, 2))
    days = np.unique(rooms.day)
    everything = _Regression.of(rooms, pairs, np.ones(len(rooms.day), dtype=bool))
    paths = everything.path()
    errors = np.full((paths.shape[1], len(days)), np.nan)
    for block in np.array_split(days, _FOLDS):
        held = np.isin(rooms.day, block)
        training = _Regression.of(rooms, pairs, ~held)
        for j, chosen in enumerate(paths.T):
            errors[j, block] = training.forecast_errors(rooms, training.conductances(chosen), held)[block]
    kept = paths[:, _sparsest(errors, paths.sum(axis=0))].copy()
    conductance, std = everything.conductances(kept), everything.standard_errors(np.ones(len(pairs), dtype=bool))
    std[kept] = everything.standard_errors(kept)
    kept &= conductance > 0
    index = pd.MultiIndex.from_tuples(pairs, names=["zone", "neighbour"])
    return pd.DataFrame({"conductance": conductance, "std": std, "kept": kept}, index=index)


def _sparsest(errors: np.ndarray, size: np.ndarray) -> int:
    """The candidate with the fewest couplings whose held-out errors by day are within a standard error of the best."""
    errors = errors[:, np.isfinite(errors).all(axis=0)]
    worse = errors - errors[np.argmin(errors.mean(axis=1))]
    within = worse.mean(axis=1) <= worse.std(axis=1) / np.sqrt(worse.shape[1])
    return int(min(np.flatnonzero(within), key=lambda j: size[j]))


class _Rooms(NamedTuple):
    """Hourly rows of all rooms."""

    names: tuple[str, ...]
    T: np.ndarray  # (N, z) temperatures at the stamp [degC], interpolated where missing
    seen: np.ndarray  # (N, z) whether they were measured
    heat: np.ndarray  # (N, z) measured heat [kW]
    outside: np.ndarray  # (N, k) temperatures of outdoors and other boundaries [degC]
    others: list[np.ndarray]  # per room (N, .) what else acts: stages, sun, calendar
    day: np.ndarray  # (N,) number of the day


def _read(X: Any, y: Any, zones: Sequence[str] | None) -> _Rooms:
    given = [str(c).removeprefix("T_za_") for c in getattr(y, "columns", ())] if zones is None else zones
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise ValueError(f"zones={zones!r} must be the names of two zones or more, such as ['living', 'kitchen'].")
    names = tuple(dict.fromkeys(given))
    if not isinstance(y, pd.DataFrame) or len(names) < 2:
        raise ValueError("y needs the temperatures of two zones or more; give a DataFrame with a column per zone.")
    roles = tuple(f"T_za_{name}" for name in names)
    table = read_table(
        BaseEstimator(),
        X,
        reset=True,
        needed=lambda role: not role.startswith("T_za_"),
        min_rows=2,
        history_roles=("T_za", "zeta", *roles),
    )
    T = read_targets(temperatures_by_role(y, dict(zip(names, roles, strict=True))), table, roles)
    if pd.Timedelta("1h") % table.step:
        raise ValueError(
            f"X has a step of {spell(table.step)}, which does not divide an hour; resample it with "
            "skhybrid.datasets.regularize."
        )
    per = rows_per_hour(table.step)
    n = table.n_rows // per
    days = n / 24
    if table.utc is None or days < _FEWEST_DAYS:
        stamps = " and no time stamps" if table.utc is None else ""
        raise ValueError(f"X has {days:.3g} days{stamps}; give {_FEWEST_DAYS} or more, with time stamps.")
    T = T[: n * per : per]
    seen = np.isfinite(T).all(axis=1)
    n_seen = len(np.unique(_day(n)[:-1][seen[:-1] & seen[1:]]))
    if n_seen < _FEWEST_DAYS:
        raise ValueError(f"y has all rooms measured at once on {n_seen} days only; give {_FEWEST_DAYS} or more.")
    hourly = {role: v[: n * per].reshape(n, per).mean(axis=1) for role, v in table.inputs.items()}
    return _arrange(names, T, hourly, table, per)


def _arrange(
    names: tuple[str, ...], T: np.ndarray, hourly: dict[str, np.ndarray], table: ZoneTable, per: int
) -> _Rooms:
    n = len(T)
    cell = day_type_hour(table)[: n * per : per]
    calendar = one_hot(cell, N_CELLS)
    parts = np.exp(-0.5 * ((cell[:, None] % 24 - np.array(_DAY_PARTS)) / 2.5) ** 2)
    sun = [v[:, None] * parts for role, v in hourly.items() if role.startswith("q_sol")]
    owner = {role: ending_zone(role, names) for role in hourly}
    plant = plant_roles(hourly)
    outside = [v for role, v in hourly.items() if is_instant(role)]
    heat, others = np.zeros((n, len(names))), []
    for i, name in enumerate(names):
        heat[:, i] = sum(hourly[role] for role in plant if owner[role] == name and role.startswith("Q_"))
        acting = [hourly[r] for r in plant if (owner[r] == name and is_stage(r)) or owner[r] is None]
        columns = [*acting, *(_smoothed(v) for v in (*acting, heat[:, i]))]
        others.append(np.column_stack([*columns, *sun, calendar]))
    filled = pd.DataFrame(T).interpolate(limit_direction="both").to_numpy()
    return _Rooms(names, filled, np.isfinite(T), heat, np.array(outside).reshape(-1, n).T, others, _day(n))


def _day(n: int) -> np.ndarray:
    """(n,) number of the day, from the first row on, of hourly rows."""
    return np.arange(n) // 24


def _smoothed(values: np.ndarray) -> np.ndarray:
    """Exponential mean of the values before each row, over about four hours."""
    return low_pass(np.concatenate([values[:1], values[:-1]]), 1.0 - 1.0 / 4.0, values[0])


class _Regression(NamedTuple):
    """The hourly changes of all rooms without what the rooms themselves explain, on the differences of the pairs."""

    change: list[np.ndarray]  # per room (N,), over its standard deviation
    between: list[np.ndarray]  # per room (N, P)
    own: list[np.ndarray]  # per room (m,) coefficients of its own columns without couplings
    own_between: list[np.ndarray]  # per room (m, P) what a coupling of 1 kW/K takes off them
    per_kw: np.ndarray  # (z,) change of temperature by a kW over an hour [K]
    day: list[np.ndarray]
    pairs: np.ndarray  # (P, 2)

    @classmethod
    def of(cls, rooms: _Rooms, pairs: list[tuple[str, str]], rows: np.ndarray) -> _Regression:
        places = np.array([[rooms.names.index(a), rooms.names.index(b)] for a, b in pairs])
        plain, per_kw = [], np.full(len(rooms.names), np.nan)
        for i in range(len(rooms.names)):
            used = rows[:-1] & rows[1:] & rooms.seen[:-1].all(axis=1) & rooms.seen[1:, i]
            change, own, between = np.diff(rooms.T[:, i]), _own_columns(rooms, i), _differences(rooms.T, places, i)
            plain.append((change[used], own[:-1][used], between[:-1][used], rooms.day[:-1][used]))
            found = np.linalg.lstsq(np.hstack([plain[i][1], plain[i][2]]), plain[i][0], rcond=1e-9)[0]
            if rooms.heat[:, i].any() and found[0] > 0:
                per_kw[i] = found[0]
        known = per_kw[np.isfinite(per_kw)]
        per_kw[~np.isfinite(per_kw)] = np.median(known) if len(known) else 1.0
        out = cls([], [], [], [], per_kw, [day for *_, day in plain], places)
        for i, (change, own, between, _) in enumerate(plain):
            both = np.column_stack([change, per_kw[i] * between])
            explained = np.linalg.lstsq(own, both, rcond=1e-9)[0]
            left = both - own @ explained
            left /= max(left[:, 0].std(), 1e-9)
            out.change.append(left[:, 0])
            out.between.append(left[:, 1:])
            out.own.append(explained[:, 0])
            out.own_between.append(explained[:, 1:])
        return out

    def path(self) -> np.ndarray:
        """(P, J) pairs that a weaker and weaker penalty keeps; it is less on those that the data tell well."""
        everyone = np.ones(len(self.pairs), dtype=bool)
        size = np.maximum(self.conductances(everyone), self.standard_errors(everyone))
        A, b = np.vstack(self.between) * size, np.concatenate(self.change)
        strongest = max(float(np.max(A.T @ b)), 1e-9) / len(b)  # that keeps none
        found = lasso_path(A, b, alphas=strongest * np.geomspace(1.0, 1e-4, _PENALTIES), positive=True)[1]
        return np.unique(np.column_stack([np.zeros(len(self.pairs)), found]) > 0, axis=1)

    def conductances(self, kept: np.ndarray) -> np.ndarray:
        """(P,) conductances of the kept pairs without penalty, not negative [kW/K]."""
        out = np.zeros(len(kept))
        if kept.any():
            out[kept] = nnls(np.vstack(self.between)[:, kept], np.concatenate(self.change))[0]
        return out

    def standard_errors(self, kept: np.ndarray) -> np.ndarray:
        """Standard errors of the kept pairs, from the sums of the days."""
        if not kept.any():
            return np.zeros(0)
        A, b, day = np.vstack(self.between)[:, kept], np.concatenate(self.change), np.concatenate(self.day)
        bread = np.linalg.pinv(A.T @ A)
        score = A * (b - A @ (bread @ (A.T @ b)))[:, None]
        daily = pd.DataFrame(score).groupby(day).sum().to_numpy()
        return np.sqrt(np.diag(bread @ daily.T @ daily @ bread))

    def forecast_errors(self, rooms: _Rooms, conductance: np.ndarray, held: np.ndarray) -> np.ndarray:
        """(days,) mean squared errors of the rooms' forecasts from every hour of the held-out days; NaN elsewhere."""
        n = len(rooms.T) - _LEADS
        origins = np.flatnonzero(held[:n] & held[_LEADS:] & rooms.seen[:n].all(axis=1))
        total = np.zeros(len(origins))
        for i in range(len(rooms.names)):
            own = self.own[i] - self.own_between[i] @ conductance
            total += _room_errors(rooms, i, own, self.per_kw[i] * conductance, self.pairs, origins)
        daily = pd.Series(total).groupby(rooms.day[origins]).mean()
        return daily.reindex(range(rooms.day[-1] + 1)).to_numpy()


def _memories(T: np.ndarray) -> np.ndarray:
    """(N, 3) slow means of a room's own temperature, up to the row."""
    return np.column_stack([low_pass(T, 1.0 - 1.0 / h, T[0]) for h in _MEMORIES])


def _own_columns(rooms: _Rooms, i: int) -> np.ndarray:
    """(N, m) what acts on room i but the other rooms, its heat first."""
    T = rooms.T[:, [i]]
    return np.column_stack([rooms.heat[:, i], rooms.outside - T, _memories(T[:, 0]) - T, rooms.others[i]])


def _differences(T: np.ndarray, pairs: np.ndarray, i: int) -> np.ndarray:
    """(N, P) temperature of the other room of each pair over that of room i; 0 for pairs without it."""
    first, second = pairs.T
    return (T[:, second] - T[:, first]) * (first == i) + (T[:, first] - T[:, second]) * (second == i)


def _room_errors(
    rooms: _Rooms, i: int, own: np.ndarray, coupling: np.ndarray, pairs: np.ndarray, origins: np.ndarray
) -> np.ndarray:
    """(origins,) mean squared error of a room's forecast, its neighbours' temperatures being measured."""
    k, m = rooms.outside.shape[1], len(_MEMORIES)
    outer, memory, others = own[1 : 1 + k], own[1 + k : 1 + k + m], own[1 + k + m :]
    T, slow = rooms.T[origins, i].copy(), _memories(rooms.T[:, i])[origins]
    total = np.zeros(len(origins))
    given = own[0] * rooms.heat[:, i] + rooms.outside @ outer + rooms.others[i] @ others
    mine = ((pairs == i).any(axis=1)) * coupling
    other = np.where(pairs[:, 0] == i, pairs[:, 1], pairs[:, 0])
    given = given + rooms.T[:, other] @ mine
    for lead in range(_LEADS):
        rows = origins + lead
        T = T + given[rows] + slow @ memory - T * (outer.sum() + memory.sum() + mine.sum())
        slow = slow + (T[:, None] - slow) / np.array(_MEMORIES)
        total += np.where(rooms.seen[rows + 1, i], (T - rooms.T[rows + 1, i]) ** 2, 0.0) / _LEADS
    return total
