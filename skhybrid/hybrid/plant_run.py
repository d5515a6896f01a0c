"""Loads of a plant that keeps set-points: as its thermostat was learned, or as an ideal one gives them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import ZoneTable, plant_roles
from ..control import Band, Limits, LoadPaths
from ..exceptions import TooFewDaysError
from ..forecasting.quantiles import load_quantile_columns, quantile_columns
from ..forecasting.weather_error import WeatherError
from .scheme import Scheme
from .setpoint_columns import band_of, with_band
from .thermostat_law.closed_loop import ClosedLoop


class Wanted(NamedTuple):
    """Wishes for a forecast of rows ahead."""

    now: float | None = None  # temperature measured in the first row, where it is [degC]
    levels: np.ndarray | None = None  # of quantiles
    weather: WeatherError | None = None  # by which they are wider


@dataclass(frozen=True)
class PlantRun:
    """A plant over a scheme, which keeps set-points by the law that was learned, or where none was by the network."""

    scheme: Scheme
    law: ClosedLoop | None

    def with_earlier(self, table: ZoneTable) -> ZoneTable:
        """The table after all known rows that the law reads."""
        rows = self.scheme.rows
        return table if self.law is None else rows.with_earlier(table, self.law.rows_back(rows))

    def ahead(
        self, table: ZoneTable, index: pd.Index, wanted: Wanted, limits: tuple[float, float] | None
    ) -> pd.DataFrame:
        """The forecast of the last rows of a table, which have the ``index``; the first may be measured now."""
        (now, levels, weather), n_ahead = wanted, len(index)
        origin = np.array([table.n_rows - n_ahead - (now is None)])
        # the heat of the last known row has been delivered; that of a row whose temperature is now is to be decided
        delivered = None if now is not None else self.scheme.plant_heat(table)[origin]
        if self.law is None:
            if levels is not None:
                raise TooFewDaysError(
                    "intervals of a load need a learned thermostat: fit on a week or more with T_heat_set or "
                    "T_cool_set."
                )
            return self._ideal(table, int(origin[0]), limits, delivered).iloc[-n_ahead:].set_axis(index)
        n_leads = n_ahead + (now is None)
        found = self.law.paths(
            self.scheme, table, origin, n_leads, levels, limits=limits, delivered=delivered, weather=weather
        )
        if now is not None:
            found = found.after(now)
        heat, temperature, zeta = found.paths
        path = LoadPaths(heat[:, -n_ahead:], temperature[:, :n_ahead], zeta[:, -n_ahead:])
        out = _delivered(self.scheme.heat_frame(index, path))
        if levels is None or found.heat_bands is None or found.temperature_bands is None:
            return out
        return _with_bands(out, levels, found.temperature_bands[0, :n_ahead], found.heat_bands[0, -n_ahead:])

    def _ideal(
        self, table: ZoneTable, origin: int, limits: tuple[float, float] | None, delivered: np.ndarray | None
    ) -> pd.DataFrame:
        """The least heat that keeps the set-points, where no law was learned."""
        free = self._limits(table.n_rows - origin)
        if limits is not None:
            free = free.within(*limits)
        if delivered is not None:
            for side in free:
                side[:1] = delivered
        band = band_of(table).rows(slice(origin, None))
        return _delivered(self.scheme.required_heat(table, np.array([origin]), band, free))

    def _limits(self, n_rows: int) -> Limits:
        """Limits of a plant whose heat was measured: one that never cooled in training, or never heated, does not."""
        inputs = self.scheme.rows.training.inputs
        roles = plant_roles(inputs)
        heat = np.sum([inputs[role] for role in roles], axis=0) if roles else np.zeros(1)
        measured = all(role.startswith("Q_") for role in roles)
        cools, heats = (not measured or (sign * heat).max() > 0.0 for sign in (-1.0, 1.0))
        lowest, highest = -np.inf if cools or not heats else 0.0, np.inf if heats or not cools else 0.0
        return Limits.constant(lowest, highest, n_rows)

    def held(
        self, table: ZoneTable, origins: np.ndarray, band: Band, limits: Limits | None, levels: np.ndarray | None
    ) -> pd.DataFrame:
        """The load that keeps the rows of a table after its history within a band, each origin up to the next one."""
        index = table.index[table.n_history :]
        within = self._limits(len(index)) if limits is None else limits
        load = self.scheme.required_heat(table, origins, band, within).set_axis(index)
        if self.law is not None and limits is None and not np.array_equal(*band):
            return self._learned_load(table, origins, band, load, levels)
        if levels is not None:
            raise ValueError(
                "intervals of a load need a learned thermostat: fit on a week or more with T_heat_set or T_cool_set, "
                "give setpoint as a pair, and no limits."
            )
        return load

    def _learned_load(
        self, table: ZoneTable, origins: np.ndarray, band: Band, load: pd.DataFrame, levels: np.ndarray | None
    ) -> pd.DataFrame:
        """An ideal ``load`` with what the learned plant does in its place, each origin up to the next one."""
        assert self.law is not None
        spans = np.diff(np.append(origins, table.n_rows))
        found = self.law.paths(self.scheme, with_band(table, band), origins, int(spans.max()), levels)
        lead = np.concatenate([np.arange(n) for n in spans])
        of = np.repeat(np.arange(len(origins)), spans)
        at_origin, before = lead == 0, np.maximum(lead - 1, 0)
        T = np.where(at_origin, load["T_za"], found.paths.temperature[of, before])
        path = LoadPaths(found.paths.heat[of, lead][None], T[None], load["zeta"].to_numpy()[None])
        frame = _delivered(self.scheme.heat_frame(load.index, path))
        load = load.assign(**{str(name): frame[name] for name in frame})
        if levels is None or found.heat_bands is None or found.temperature_bands is None:
            return load
        bands = np.where(at_origin[:, None], T[:, None], found.temperature_bands[of, before])
        return _with_bands(load, levels, bands, found.heat_bands[of, lead])


def _delivered(load: pd.DataFrame) -> pd.DataFrame:
    """The columns of a load without what would be needed, the temperature first."""
    names = [str(name) for name in load if name != "T_za" and not str(name).endswith("_unclipped")]
    return load[["T_za", *names]]


def _with_bands(load: pd.DataFrame, levels: np.ndarray, temperature: np.ndarray, heat: np.ndarray) -> pd.DataFrame:
    """A load with quantiles (n_rows, n_levels), which may be hundreds: ``q_0.1`` of T_za, and ``Q_hvac_0.1``."""
    names = [*quantile_columns(levels), *load_quantile_columns(levels)]
    return load.join(pd.DataFrame(np.hstack([temperature, heat]), load.index, names))
