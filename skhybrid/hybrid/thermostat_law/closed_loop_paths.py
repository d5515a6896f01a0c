"""Forecasts of load and temperature under set-points, with their quantiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..._table import ZoneTable, is_plant
from ...control import LoadPaths
from ..scheme import Scheme


class ClosedLoopPaths(NamedTuple):
    """Forecasts from some origins, with quantiles where they were wanted."""

    paths: LoadPaths
    heat_bands: np.ndarray | None = None  # (O, L, n_levels) [kW]
    temperature_bands: np.ndarray | None = None  # (O, L, n_levels) [degC]
    #: (O, L) stages [-] and heat [kW] by name, as in ``predict_load``; empty where they were not asked for
    plant: Mapping[str, np.ndarray] = MappingProxyType({})
    #: (O, L) what was measured of the plant by role in the same rows; NaN after the last one
    measured: Mapping[str, np.ndarray] = MappingProxyType({})

    @classmethod
    def joined(cls, parts: Sequence[ClosedLoopPaths]) -> ClosedLoopPaths:
        """Forecasts from the origins of all parts, which are alike."""

        def whole(values: Sequence[np.ndarray | None]) -> np.ndarray | None:
            known = [v for v in values if v is not None]
            return np.concatenate(known) if known else None

        by_name = [part.plant for part in parts], [part.measured for part in parts]
        return cls(
            LoadPaths(*map(np.concatenate, zip(*(part.paths for part in parts), strict=True))),
            whole([part.heat_bands for part in parts]),
            whole([part.temperature_bands for part in parts]),
            *({name: np.concatenate([of[name] for of in each]) for name in each[0]} for each in by_name),
        )

    def by_role(self, scheme: Scheme, table: ZoneTable, origins: np.ndarray) -> ClosedLoopPaths:
        """With the stages and the heat of each part of the plant, and what a table has of them; NaN after its end."""
        shape, flat = self.paths.heat.shape, LoadPaths(*(part.reshape(1, -1) for part in self.paths))
        frame = scheme.heat_frame(pd.RangeIndex(flat.heat.size), flat)
        names = [name for name in map(str, frame) if is_plant(name) and not name.endswith("_unclipped")]
        rows = origins[:, None] + np.arange(shape[1])
        there, at = rows < table.n_rows, np.minimum(rows, table.n_rows - 1)
        measured = {role: np.where(there, v[at], np.nan) for role, v in table.inputs.items() if is_plant(role)}
        plant = {name: np.where(there, frame[name].to_numpy().reshape(shape), np.nan) for name in names}
        return self._until(there, rows + 1 < table.n_rows)._replace(plant=plant, measured=measured)

    def _until(self, acts: np.ndarray, ends: np.ndarray) -> ClosedLoopPaths:
        """With NaN where a row of the plant (O, L), or the stamp of a temperature (O, L), is not there."""

        def cut(there: np.ndarray, v: Any) -> Any:
            return None if v is None else np.where(there.reshape(*there.shape, *[1] * (v.ndim - 2)), v, np.nan)

        heat, T, zeta = self.paths
        paths = LoadPaths(cut(acts, heat), cut(ends, T), cut(acts, zeta))
        return ClosedLoopPaths(paths, cut(acts, self.heat_bands), cut(ends, self.temperature_bands))

    def after(self, T_za: float) -> ClosedLoopPaths:
        """With the temperature at the origin before those at the ends of its rows."""

        def extended(T: np.ndarray) -> np.ndarray:
            return np.concatenate([np.full_like(T[:, :1], T_za), T], axis=1)

        bands = None if self.temperature_bands is None else extended(self.temperature_bands)
        paths = self.paths._replace(temperature=extended(self.paths.temperature))
        return self._replace(paths=paths, temperature_bands=bands)
