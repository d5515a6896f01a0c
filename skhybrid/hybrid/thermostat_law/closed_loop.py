"""Forecast of temperature and load where only set-points are known: the thermostat acts inside it.

Members are the network under an ideal thermostat, what a learned law makes of that, a direct regression, and last
week; the blend has the weights of their errors so far, and its intervals are learned from what it missed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d

from ..._table import SETPOINT_ROLES, ZoneTable
from ..._time import rows_per_day, rows_per_hour
from ..._warnings import warn_user
from ...control import FREE, Band, Limits, LoadPaths, WantedPaths
from ...exceptions import PlanWarning, TooFewDaysError
from ...forecasting.intervals import PathClock
from ...forecasting.quantiles import path_clock
from ...forecasting.weather_error import WeatherError, weather_spreads
from ..blending.blend import blend_weights, by_lead, faded, lead_groups, moments
from ..joint_errors import JointErrors
from ..known_rows import KnownRows
from ..scheme import Boundary, Scheme
from ..setpoint_columns import UsualTemperature, band_of
from .closed_loop_paths import ClosedLoopPaths
from .law_errors import LawErrors, runs
from .law_features import LawRows
from .law_refits import WEEKS, IdealPaths, LawRefits, Weeks
from .member_intervals import MemberIntervals, MemberValues, StateIntervals, reaching
from .plant_capacity import PlantCapacity
from .plant_law import MEMBERS, PRIOR, PlantLaw, learn, make_pairs, member_errors, member_paths
from .possible_loads import PossibleLoads

_LEAST_DAYS = 7  # days of training that a law is learned from, at least
_LEAST_PAIRS = 100  # pairs of origin and lead with a measured temperature, at least
_EVERY = 3  # hours between the origins that are learned from
_FIT_SHARE = 2.0 / 3.0  # the law is fitted on this first share of the training and judged on the rest
_DAYS_BACK = 21  # days whose errors count
_WEEK_BEFORE = 8  # days before a row that are read for it: a week, and a day
#: independent errors per day of the load and of the temperature: of 2, 4, 8 and 24 the one whose 80 % intervals hold
#: 80 % on five EnergyPlus buildings
_INDEPENDENT_PER_DAY = (2.0, 4.0)
_LEADS = 18  # leads at which errors are evaluated
_RUNS = 0.02  # of the highest heat in training, from which on a plant runs
#: hours over which errors are averaged before they order samples, as a plant goes on and off: of 0, 2, 4, 6 and 8 the
#: one whose 80 % intervals of a day's kWh hold 80 % on five EnergyPlus buildings
_LASTING = 6
_FAR = (0.01, 0.99)  # levels of the temperatures between which a plant may act


class _TrainingTail(NamedTuple):
    """Errors and weights of the members on the last part of the training."""

    products: np.ndarray  # (2, n_groups, M, M) moments of their errors of load and temperature
    #: of load and temperature; empty after a short training
    intervals: tuple[StateIntervals, MemberIntervals] | tuple[()]
    joint: JointErrors | None  # of load and temperature in each row after the origin's
    least: float  # heat from which on a plant runs [kW]


class ClosedLoop:
    """A learned thermostat and plant; apart from caches it never changes."""

    def __init__(
        self,
        refits: LawRefits,
        tail: _TrainingTail,
        n_leads: int,
        training: ZoneTable,
        capacity: PlantCapacity,
        possible: PossibleLoads,
        usual: UsualTemperature | None = None,
    ) -> None:
        self._refits, self._tail, self.n_leads = refits, tail, n_leads
        self._capacity, self._possible = capacity, possible
        self.usual = usual  # that stands for set-points
        self._learned_to: pd.Timestamp | None = None if training.utc is None else training.utc[-1]
        self._per_day = rows_per_day(training.step)
        #: whether heating and cooling had set-points
        self._sides = [bool(np.isfinite(side).any()) for side in band_of(training)]

    @property
    def joint(self) -> JointErrors | None:
        """Errors that load and temperature made together; None after a short training."""
        return self._tail.joint

    @classmethod
    def fit(cls, scheme: Scheme, n_leads: int, usual: UsualTemperature | None = None) -> Self | None:
        """Learn from the training of a fitted scheme; None where it has no set-points, no heat or too few days.

        A ``usual`` temperature stands for the set-points of a plant that has none, and its heat may be constant.
        """
        training = scheme.rows.training if usual is None else usual.held(scheme.rows.training)
        band, heat = band_of(training), scheme.plant_heat(training)
        rows = LawRows.of(training, heat, band)
        moved = usual is not None or (np.isfinite(band).any() and np.ptp(heat) > 0.0)
        if not moved or training.n_rows < _LEAST_DAYS * rows.per_day:
            return None
        origins = np.arange(rows.per_day, training.n_rows - 1, _EVERY * rows_per_hour(training.step))
        capacity = PlantCapacity.of(scheme, training, rows, usual is not None)
        loads_from = scheme.adapting(None).load_paths_from(training, origins)
        within = capacity.at(rows, training.n_rows, origins)
        ideal = loads_from(origins, n_leads, WantedPaths(band, within, unforeseen=scheme.unforeseen))
        pairs = make_pairs(rows, origins, ideal, training.n_rows)
        begin = int(_FIT_SHARE * training.n_rows)
        if len(pairs.before(begin).ends) < _LEAST_PAIRS:
            return None
        later = origins >= begin
        leads, before = np.arange(n_leads), learn(pairs.before(begin), rows.per_day)
        values = member_errors(rows, origins[later], ideal.rows(later), before, leads)
        least = _RUNS * float(np.abs(heat).max())
        tail = _learn_tail(training, LawErrors.of(rows, origins[later], leads, values, least), least)
        law, possible = LawRefits(learn(pairs, rows.per_day), pairs), PossibleLoads.of(rows)
        return cls(law, tail, n_leads, training, capacity, possible, usual)

    def paths(
        self,
        scheme: Scheme,
        table: ZoneTable,
        origins: np.ndarray,
        n_leads: int,
        levels: np.ndarray | None = None,
        *,
        limits: tuple[float, float] | None = None,
        delivered: np.ndarray | None = None,
        boundary: Boundary = None,
        weather: WeatherError | None = None,
    ) -> ClosedLoopPaths:
        """Forecast load and temperature from increasing origins, with quantiles of the given levels.

        The set-points come as history of the table, which begins with the end of the known rows where it follows them.
        Heat is read before an origin only, the temperature up to it.  Column j of the load is the row ``origin + j``,
        of the temperature the end of that row.  Where other ``limits`` of the plant [kW] than those of the training
        change the network's ideal load and temperature, both forecasts change as much; so they do where the heat
        ``delivered`` (n_origins,) [kW] in the origins' own rows is known and differs from its forecast.  A ``boundary``
        holds neighbours' temperatures after each origin.  Errors of a forecast of the ``weather`` widen the quantiles.
        """
        if levels is not None and not self._tail.intervals:
            raise TooFewDaysError("no intervals of a load were learned: the training was too short; fit on more days.")
        table, rows = self._rows(scheme, table)
        spacing, weeks = _EVERY * rows_per_hour(table.step), self._weeks(table, rows)
        oldest = max(weeks.begin, int(origins[0]) - (_DAYS_BACK + 1) * rows.per_day)
        # forecasts whose errors count
        past = weeks.origins(oldest, oldest if scheme.adapt is None else int(origins[-1]), spacing)
        known, refits = np.union1d(past, origins), self._refits
        numbers = np.unique(weeks.numbers(known))
        laws = refits.known(rows, weeks, numbers) if scheme.adapt == "full" else dict.fromkeys(numbers, refits.law)
        new = [number for number, law in laws.items() if law is None]
        every = np.unique(np.concatenate([known, *(weeks.learning_origins(number, spacing) for number in new)]))
        loads_from, n_ideal = scheme.load_paths_from(table, every), max(n_leads, self.n_leads)
        capacity = self._capacity.at(rows, weeks.begin, every)
        asked = WantedPaths(rows.band, capacity, unforeseen=scheme.unforeseen)
        ideal = IdealPaths(every, loads_from(every, n_ideal, asked))  # the past knows what was measured
        capacity = self._capacity.at(rows, weeks.begin, origins)
        asked = asked._replace(limits=capacity, boundary=boundary or {})
        free = loads_from(origins, n_ideal, asked) if boundary else ideal.of(origins)
        laws |= refits.learn(rows, weeks, new, spacing, ideal)
        of_past, of_origins = IdealPaths(past, ideal.of(past)), IdealPaths(origins, free)
        errors, members = self._by_law(rows, weeks, laws, of_past, of_origins, n_leads)
        unshifted = np.zeros((2, len(origins), n_leads))
        wanted = _Wanted(table, rows, origins, members, free.zeta[:, :n_leads], capacity, unshifted)
        if limits is not None:
            asked = asked._replace(limits=capacity.within(*limits))
            shift = _between(loads_from(origins, n_leads, asked), free, n_leads)
            wanted = wanted._replace(shift=shift, limits=asked.limits)
        if delivered is not None:
            expected = self._blended(scheme, wanted, errors, weeks).paths.heat[:, 0]
            actual, forecast = (
                loads_from(origins, n_leads, asked._replace(delivered=q)) for q in (delivered, expected)
            )
            wanted = wanted._replace(shift=wanted.shift + _between(actual, forecast, n_leads))
        if levels is not None:
            wanted = wanted._replace(levels=levels, seen=self._capacity.seen(rows, weeks.begin, origins))
            if weather is not None:
                spread = self._weather_spread(scheme, table, origins, n_leads, limits, boundary, weather)
                wanted = wanted._replace(spread=spread)
        return self._blended(scheme, wanted, errors, weeks)

    def _by_law(
        self,
        rows: LawRows,
        weeks: Weeks,
        laws: Mapping[int, PlantLaw | None],
        past: IdealPaths,
        wanted: IdealPaths,
        n_leads: int,
    ) -> tuple[LawErrors, np.ndarray]:
        """Errors of the members in the past, and what they forecast (O, n_leads, 2, M), by the laws of the weeks."""
        leads = _leads(self.n_leads)
        missed = np.empty((len(past.origins), len(leads), 2, len(MEMBERS)))
        members = np.empty((len(wanted.origins), n_leads, 2, len(MEMBERS)))
        for number, law in laws.items():
            assert law is not None
            at, own = (weeks.numbers(of.origins) == number for of in (past, wanted))
            missed[at] = member_errors(rows, past.origins[at], past.paths.rows(at), law, leads)
            members[own] = member_paths(rows, wanted.origins[own], wanted.paths.rows(own), law, np.arange(n_leads))
        return LawErrors.of(rows, past.origins, leads, missed, self._tail.least), members

    def _rows(self, scheme: Scheme, table: ZoneTable) -> tuple[ZoneTable, LawRows]:
        """A table under the set-points that the law reads, and its rows."""
        table = table if self.usual is None else self.usual.held(table)
        return table, LawRows.of(table, scheme.plant_heat(table), self._learned_sides(band_of(table)))

    def _learned_sides(self, band: Band) -> Band:
        """The set-points of the sides that had some in training; loads of the other side are learned without them."""
        sides = []
        for side, role, free, learned, acts in zip(
            band, SETPOINT_ROLES, FREE, self._sides, self._capacity.acts, strict=True
        ):
            if not learned and acts and np.isfinite(side).any():
                warn_user(
                    f"{role} is not used, since the training has none: the thermostat is the one learned without it; "
                    f"fit on a log with {role}, or leave it out.",
                    PlanWarning,
                )
            sides.append(side if learned else np.full_like(side, free))
        return Band(*sides)

    def _weather_spread(
        self,
        scheme: Scheme,
        table: ZoneTable,
        origins: np.ndarray,
        n_leads: int,
        limits: tuple[float, float] | None,
        boundary: Boundary,
        weather: WeatherError,
    ) -> np.ndarray:
        """(O, 2, n_leads) of what errors of the weather change in load and temperature."""
        once = scheme.adapting(None)  # a change need not learn from the history

        def both(tables: Sequence[ZoneTable], origin: int) -> np.ndarray:
            at = np.array([origin])
            ahead = {role: values[np.searchsorted(origins, at)] for role, values in (boundary or {}).items()}
            own = (self.paths(once, table, at, n_leads, limits=limits, boundary=ahead) for table in tables)
            return np.array([np.concatenate(found.paths[:2]) for found in own])

        return weather_spreads(weather, table, origins, n_leads, both)

    def rows_back(self, known: KnownRows) -> int:
        """Largest number of known rows that a forecast reads."""
        since = known.n_rows - known.training.n_rows
        return min(since + _WEEK_BEFORE * self._per_day, (7 * (WEEKS + 1) + _WEEK_BEFORE) * self._per_day)

    def _weeks(self, table: ZoneTable, rows: LawRows) -> Weeks:
        """The weeks since the training, in rows of a table."""
        zero = begin = table.n_history
        if table.utc is not None and self._learned_to is not None:
            zero = round((self._learned_to - table.utc[0]) / table.step) + 1
            begin = table.stamps.n_until(self._learned_to) if table.n_history else 0
        return Weeks(zero, begin, rows.per_day)

    def _blended(self, scheme: Scheme, wanted: _Wanted, errors: LawErrors, weeks: Weeks) -> ClosedLoopPaths:
        """The members blended by what was known of their errors at each origin."""
        table, rows, members, n_leads = wanted.table, wanted.rows, wanted.members, wanted.members.shape[1]
        begin = weeks.zero if table.n_history else weeks.begin  # of new rows
        ranges = scheme.plausible(table, wanted.origins)
        if len(wanted.levels):
            wanted = wanted._replace(levels=np.append(wanted.levels, _FAR))
        n_levels = len(wanted.levels)
        out = np.empty((2, len(wanted.origins), n_leads, 1 + n_levels))
        for i, origin in enumerate(wanted.origins):
            known = errors.until(int(origin), int(origin) - (_DAYS_BACK + 1) * rows.per_day)
            shares = self._shares(known, (origin - begin) / rows.per_day, (origin - known.ends) / rows.per_day)
            for quantity in range(2):
                weights = by_lead(shares[quantity], self.n_leads, n_leads)
                path = np.sum(members[i, :, quantity] * weights, axis=-1) + wanted.shift[quantity, i]
                out[quantity, i] = path[:, None]
                if n_levels:
                    recent = self._recent(table, known, shares, quantity)
                    out[quantity, i, :, 1:] += self._offsets(wanted, i, quantity, weights, recent)
            ahead = rows.band.rows(np.minimum(origin + np.arange(n_leads), len(rows.T) - 1))
            out[1, i] = ranges.of_row(i).around(ahead).clip(out[1, i])
            if n_levels:
                far = out[1, i, :, -len(_FAR) :].T
                out[0, i, :, 1:] = self._possible.nearest(out[0, i, :, 1:], ahead, rows.T[origin], *far)
            lowest, highest = wanted.limits.lower[i], wanted.limits.upper[i]
            heats, cools = self._acting(ahead)
            within = np.where(cools, lowest, max(lowest, 0.0)), np.where(heats, highest, min(highest, 0.0))
            out[0, i] = np.clip(out[0, i], within[0][:, None], within[1][:, None])
        paths = LoadPaths(out[0, ..., 0], out[1, ..., 0], wanted.zeta)
        return ClosedLoopPaths(paths, *(out[..., 1 : -len(_FAR)] if n_levels else ()))

    def _acting(self, band: Band) -> list[np.ndarray]:
        """Whether the plant may heat, and cool, in some rows: not on a side that had set-points and has none there."""
        return [np.isfinite(side) | (not learned) for side, learned in zip(band, self._sides, strict=True)]

    def _shares(self, known: LawErrors, days: float, age: np.ndarray) -> np.ndarray:
        """(2, n_groups, M) weights for load and temperature, so many days after the training."""
        groups, share = lead_groups(known.leads + 1, self.n_leads), faded(age)
        found = []
        for quantity, products in enumerate(self._tail.products):
            since = moments(known.values[:, :, quantity], groups, share)
            found.append(blend_weights(products * faded(np.array(days)) + since, PRIOR))
        return np.array(found)

    def _recent(self, table: ZoneTable, known: LawErrors, shares: np.ndarray, quantity: int) -> MemberValues | None:
        """Errors of forecasts whole days apart, with these shares; None where there are none."""
        if not len(known.origins):
            return None
        daily = slice(None, None, -max(1, 24 // _EVERY))
        weights = shares[quantity][lead_groups(known.leads + 1, self.n_leads)]
        clock = _clock(table, known.origins[daily], known.leads)
        return MemberValues(known.values[daily, :, quantity], weights, clock, known.runs[daily])

    def _offsets(
        self, wanted: _Wanted, i: int, quantity: int, weights: np.ndarray, recent: MemberValues | None
    ) -> np.ndarray:
        """(n_leads, n_levels) quantiles of the error of the path from the ``i``-th origin."""
        table, origin, levels = wanted.table, wanted.origins[i], wanted.levels
        spread = None if wanted.spread is None else wanted.spread[i, quantity]
        clock, now = path_clock(table, origin[None], len(weights)), origin * table.step_hours / 24.0
        acts = runs(wanted.members[i, None, :, 0], self._tail.least)
        paths = MemberValues(wanted.members[i, None, :, quantity], weights, clock, acts)
        offsets = self._tail.intervals[quantity].offsets(paths, levels, recent, now, spread)
        # trees give no load beyond those that they learned from, but the network does
        if quantity == 0 and wanted.seen is not None:
            ideal, lowest, highest = wanted.members[i, :, 0, 0], wanted.seen.lower[i], wanted.seen.upper[i]
            farther = np.where(np.clip(ideal, lowest, highest) != ideal, ideal - paths.of_blend()[0], 0.0)
            offsets = reaching(offsets, farther, levels)
        return offsets


class _Wanted(NamedTuple):
    """Origins in a table, and what the members forecast from them."""

    table: ZoneTable
    rows: LawRows
    origins: np.ndarray
    members: np.ndarray  # (O, L, 2, M) load [kW] and temperature [degC]
    zeta: np.ndarray  # (O, L)
    limits: Limits  # (O,) of the plant [kW]
    shift: np.ndarray  # (2, O, L) of load and temperature by other limits of the plant
    levels: np.ndarray = np.empty(0)  # of quantiles, none where they are not asked for
    seen: Limits | None = None  # (O,) least and most heat that the trees may have learned from [kW], for quantiles
    spread: np.ndarray | None = None  # (O, 2, L) of what errors of the weather change in load and temperature


def _between(paths: LoadPaths, others: LoadPaths, n_leads: int) -> np.ndarray:
    """(2, O, n_leads) difference of load and temperature."""
    return np.stack([a[:, :n_leads] - b[:, :n_leads] for a, b in zip(paths[:2], others[:2], strict=True)])


def _leads(n_leads: int) -> np.ndarray:
    """Leads, counted from 0, at which errors are evaluated."""
    return np.unique(np.round(np.linspace(0, n_leads - 1, min(n_leads, _LEADS))).astype(np.int64))


def _clock(table: ZoneTable, origins: np.ndarray, leads: np.ndarray) -> PathClock:
    """Lead, hour and day of the ends of the rows at some leads."""
    lead, slot, day, _ = path_clock(table, origins, int(leads[-1]) + 1)
    return PathClock(lead[:, leads], slot[:, leads], day[:, leads])


def _learn_tail(training: ZoneTable, every: LawErrors, least: float) -> _TrainingTail:
    """Moments and intervals from errors of the last part of the training, which are known at all leads."""
    n_leads, per_day = len(every.leads), 24.0 / training.step_hours
    errors = every.at(_leads(n_leads))
    groups, share = lead_groups(errors.leads + 1, n_leads), faded((training.n_rows - 1 - errors.ends) / per_day)
    products = np.stack([moments(errors.values[:, :, q], groups, share) for q in range(2)])
    clock, shares = _clock(training, errors.origins, errors.leads), [blend_weights(one, PRIOR) for one in products]
    load, T = (MemberValues(errors.values[:, :, q], shares[q][groups], clock, errors.runs) for q in range(2))
    of_load = StateIntervals.learn(load, _INDEPENDENT_PER_DAY[0])
    of_T = MemberIntervals.learn(T, _INDEPENDENT_PER_DAY[1])
    if of_load is None or of_T is None:
        return _TrainingTail(products, (), None, least)
    return _TrainingTail(products, (of_load, of_T), _joint_errors(training, every, shares), least)


def _joint_errors(training: ZoneTable, errors: LawErrors, shares: Sequence[np.ndarray]) -> JointErrors | None:
    """Errors of the blend in the rows after each origin whose forecast ends within the training."""
    n_leads = len(errors.leads)
    whole = errors.ends[:, -1] < training.n_rows
    load, T = (np.sum(errors.values[whole, :, q] * by_lead(shares[q], n_leads, n_leads), axis=-1) for q in range(2))
    load = np.column_stack([load[:, 1:], load[:, -1:]])  # lead 0 is that of the origin's own row
    both, n_rows = np.stack([load, T], axis=-1), _LASTING * rows_per_hour(training.step)
    lasting = uniform_filter1d(both, n_rows, axis=1, mode="nearest")
    return JointErrors.of(lasting, training.index, errors.origins[whole])
