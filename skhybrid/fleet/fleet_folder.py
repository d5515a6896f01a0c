"""A folder with the data, the configuration and the models of a fleet."""

from __future__ import annotations

import tomllib
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from .._files import atomic_path, write_text
from ..forecasting import ARXRegressor
from ..hybrid import HybridPredictor
from ..study.keys import check_keys
from ..study.spans import TRAINING_DAYS
from .zone_fleet import ZoneFleet
from .zone_rows import zone_files

_KEYS = ("key", "days", "fallback", "estimator")
_MOST_DAYS = 36_500  # a century
EXAMPLE = """# skhybrid fleet: data/ holds a folder per zone, such as data/zone=kitchen/*.parquet, in degC, kW and kW/m2
key = "zone"       # name of these folders
days = 56          # of training, at the end of the data
fallback = true    # an ARX model of zones for which the estimator cannot be fitted

[estimator]        # parameters of skhybrid.HybridPredictor
horizon = "1D"
# columns = {T_za = "room", T_oa = "outdoors"}   # where columns are not named after their roles
# known = {Q_h = 6.0, Q_c = -6.0}   # capacities [kW] at stage 1, the same in all zones
"""


class FleetTick(NamedTuple):
    """The result of a tick.

    Parameters
    ----------
    forecast : DataFrame, the forecasts of all zones
    errors : dict, why zones failed
    warnings : dict, such as that nothing new was measured
    """

    forecast: pd.DataFrame
    errors: dict[str, str]  # by zone
    warnings: dict[str, tuple[str, ...]]  # by zone


class FleetFolder:
    """A folder that holds ``data/`` (a Parquet dataset), ``fleet.toml``, ``store/`` and what commands write.

    Parameters
    ----------
    path : path-like
    n_jobs : int, optional
        Number of processes.
    """

    def __init__(self, path: str | PathLike[str], n_jobs: int | None = None) -> None:
        self.path, self.n_jobs = Path(path), n_jobs
        self.data, self.config, self.store = (self.path / name for name in ("data", "fleet.toml", "store"))
        self.forecast, self.page = self.path / "forecast.parquet", self.path / "status.html"

    def fit(self) -> ZoneFleet:
        """Fit the zones of the data that have new rows; the others keep their models.

        Raises
        ------
        ValueError, OSError
            If there are no data, the folder is that of a zone, the configuration is refused, or as
            :meth:`ZoneFleet.fit`.
        """
        self._refuse_zone()
        if not self.data.is_dir():
            raise FileNotFoundError(
                f"{self.path} has no folder data; put a Parquet dataset there, with a folder per zone such as "
                "data/zone=kitchen."
            )
        if not self.config.exists():
            with zone_files(self.data, None, "zone"):  # a folder without zones is left as it is
                write_text(self.config, EXAMPLE)
        fleet, days = self.read()
        return fleet.fit(self.data, last=days)

    def tick(self) -> FleetTick:
        """Take in what was measured since, forecast the rows after it, and write ``forecast.parquet``.

        Raises
        ------
        ValueError, OSError
            As :meth:`ZoneFleet.tick`.
        """
        fleet, _ = self.read()
        found = fleet.tick(self.data)
        with atomic_path(self.forecast) as made:
            found.to_parquet(made)
        return FleetTick(found, fleet.errors_, fleet.warnings_)

    def status(self) -> pd.DataFrame:
        """The status of every zone, the worst first, and the page ``status.html``.

        Raises
        ------
        ValueError, OSError
            If no zone has a model, or as :meth:`read`.
        """
        fleet, _ = self.read()
        if not fleet.zones_:
            raise FileNotFoundError(f"{self.path} holds no model yet; make them with skhybrid fleet fit {self.path}.")
        return fleet.status(page=self.page, data=self.data if self.data.is_dir() else None)

    def read(self) -> tuple[ZoneFleet, pd.Timedelta]:
        """The fleet of the configuration, and how many days its models learn from.

        Raises
        ------
        OSError, ValueError
            If there is no configuration, it cannot be used, or the folder is that of a zone.
        """
        self._refuse_zone()
        if not self.config.exists():
            raise FileNotFoundError(f"{self.path} holds no fleet; make it with skhybrid fleet fit {self.path}.")
        try:
            given = tomllib.loads(self.config.read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"{self.config} cannot be read ({error}); correct it.") from None
        self._check(given)
        params = given.get("estimator", {})
        fallback = ARXRegressor(columns=params.get("columns")) if given.get("fallback", True) else None
        days = pd.Timedelta(days=given.get("days", TRAINING_DAYS))
        fleet = ZoneFleet(
            HybridPredictor(**params), given.get("key", "zone"), store=self.store, fallback=fallback, n_jobs=self.n_jobs
        )
        return fleet, days

    def _refuse_zone(self) -> None:
        if (self.path / "archive.sqlite").exists() and not self.config.exists():
            raise FileExistsError(
                f"{self.path} is the folder of one zone or building; use skhybrid zone, or give another folder."
            )

    def _check(self, given: dict[str, Any]) -> None:
        estimator = given.get("estimator", {})
        if not isinstance(estimator, dict):
            raise ValueError(f"estimator in {self.config} must be a table; write its parameters below [estimator].")
        try:
            check_keys("", given, _KEYS)
            check_keys("estimator", estimator, HybridPredictor().get_params(deep=False))
        except ValueError as error:
            raise ValueError(f"{self.config}: {error}") from None
        key, days, fallback = given.get("key", "zone"), given.get("days", TRAINING_DAYS), given.get("fallback", True)
        wanted = {
            "key": ("a name in quotes", isinstance(key, str) and key != ""),
            "days": (f"a number up to {_MOST_DAYS}", type(days) in (int, float) and 0 < days <= _MOST_DAYS),
            "fallback": ("true or false", isinstance(fallback, bool)),
        }
        for name, (what, right) in wanted.items():
            if not right:
                raise ValueError(f"{name} = {given[name]!r} in {self.config} is not {what}; correct it.")
