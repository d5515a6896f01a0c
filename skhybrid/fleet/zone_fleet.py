"""``ZoneFleet``: one fitted model per zone, for any number of zones."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from os import PathLike
from typing import Any, Self

import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.exceptions import NotFittedError

from .. import __version__
from .._arguments import as_mapping, store_arguments
from .._transaction import unchanged_on_failure
from ..parallel.stored_settings import VERSION, as_plain, is_estimator
from .dispatch import ZoneOutcome, causes, run, warn_of_failed
from .fleet_page import write_fleet_page
from .fleet_status import COLUMNS, status_table, zone_status
from .long_table import joined_zones
from .model_store import ModelStore, TemporaryStore
from .prior import FleetPrior, evidence_and_span
from .zone_jobs import backtest_stored, fit_zone, forecast_zone, predict_zone, score_zone, tick_zone, update_zone
from .zone_rows import ZoneFiles, zone_files

_UNFITTED = "the store has no model of it; fit it first."


class ZoneFleet(BaseEstimator):
    """A clone of an estimator per zone, fitted and kept in a folder; a zone that fails does not stop the others.

    ``X`` is one of: a long table whose column ``key`` names the zone of each row; the path of a Parquet dataset with a
    folder per zone (``DIR/zone=kitchen/*.parquet``, time as index or in the column ``time``); tables, each with the
    column ``key``; or pairs of a zone and its table.  ``y`` is aligned with a long table; without it, and for the other
    kinds, it is the column ``T_za``.  Each zone may have its own step and time zone.  Gaps of inputs of up to three
    hours are filled, as :class:`~skhybrid.preprocessing.GapFiller` does.  Rows to learn from or to take in may also
    have outages of up to four days: inputs are interpolated there, and no temperature is known.  Methods return one
    long table with the columns that the estimator gives, and the key.

    Work is spread by joblib: over ``n_jobs`` processes, or a cluster by ``joblib.parallel_config(backend="dask")`` or
    ``"ray"``.  Workers read rows and models from files, so all must see the store and the dataset; tables are first
    written to the folder for temporary files.

    Parameters
    ----------
    estimator : estimator
        Such as :class:`~skhybrid.hybrid.HybridPredictor`.
    key : str, default="zone"
        Column of a long table, or name of the folders of a dataset.
    store : path-like, optional
        Folder of the models.  A fit that was killed goes on where it was: zones with the same rows are not fitted
        again.  Another fleet can use the models without a fit.  None: a temporary folder, removed with the fleet and
        its shallow copies; deep copies and pickles have the models in them.
    fallback : estimator, optional
        Simple model of zones for which ``estimator`` cannot be fitted, such as
        :class:`~skhybrid.forecasting.ARXRegressor`.
    n_jobs : int, optional
        Number of processes, as joblib counts them.

    Attributes
    ----------
    errors_ : dict
        By zone, why it could not be fitted, also where the fallback took over, or why the last call failed for it.
        Each call warns of the zones that it failed for.
    warnings_ : dict
        By zone, the warnings of the last call.
    zones_ : list of str
        Names of the zones that have a model.
    store_ : str
        The folder of the models.

    Examples
    --------
    >>> import pandas as pd
    >>> from skhybrid import ARXRegressor
    >>> from skhybrid.datasets import make_office
    >>> from skhybrid.fleet import ZoneFleet
    >>> offices = {name: make_office(n_days=8, sampling_time="1h", random_state=i).X for i, name in enumerate("ab")}
    >>> X = pd.concat([rows.assign(zone=name) for name, rows in offices.items()])
    >>> fleet = ZoneFleet(ARXRegressor()).fit(X)
    >>> fleet.predict(X).columns.tolist()
    ['zone', 'T_za']
    """

    def __init__(
        self, estimator: Any, key: str = "zone", *, store: Any = None, fallback: Any = None, n_jobs: int | None = None
    ) -> None:
        store_arguments(self, locals())

    @unchanged_on_failure
    def fit(self, X: Any, y: Any = None, *, last: Any = None) -> Self:
        """Fit a clone per zone; zones that the store holds with the same rows and parameters are left as they are.

        Rows after the last measurement are left out where the target is the column ``T_za``: they are plans.

        Parameters
        ----------
        X : DataFrame, path-like, or iterable of DataFrame or of (zone, DataFrame)
        y : array-like of shape (n_rows,), optional
            Measured zone temperature [degC], aligned with a long table.
        last : timedelta-like, optional
            Learn from this span at the end of each zone only.

        Raises
        ------
        ValueError
            If no zone can be fitted, X has no zones, or the store is of another estimator.
        OSError
            If the disk is full, or another fleet is at work in the store; finished zones are kept.
        """
        self._check_key()
        self._folder = self._new_folder()
        self._fit_errors: dict[Any, str] = {}
        self.errors_: dict[Any, str] = {}
        with zone_files(X, y, self.key) as files, self._models.locked(self._settings(), new=True):
            found = self._run(fit_zone, files.by_zone, files, (self.estimator, self.fallback, last), of="fit")
            whys = {files.labels[o.zone]: o.value for o in found if o.value is not None}
            self.errors_ = self._fit_errors = {**self.errors_, **whys}
            self._models.keep_failures("fit", {str(zone): why for zone, why in self.errors_.items()})
            self._models.keep_failures("tick", {o.zone: None for o in found if o.error is None})
            self.warnings_ |= {z: ("the fallback forecasts it.", *self.warnings_.get(z, ())) for z in whys}
        taken = f", and the fallback took over for {len(whys)} of them" if whys else ""
        warn_of_failed([o._replace(error=o.error or o.value) for o in found], f"could not be fitted{taken}")
        return self

    def predict(self, X: Any) -> pd.DataFrame:
        """Forecast every row, as the estimator's ``predict`` does.

        Parameters
        ----------
        X : as in :meth:`fit`

        Returns
        -------
        DataFrame with the stamps of X
            The key and ``T_za`` [degC].
        """
        return self._table(predict_zone, X, None)

    def forecast(
        self,
        history: Any,
        future: Any,
        T_za: float | None = None,
        setpoint: Any = None,
        quantiles: Sequence[float] | None = None,
    ) -> pd.DataFrame:
        """Forecast rows ahead, as the estimator's ``forecast`` does.

        An estimator without ``forecast`` forecasts the temperature by ``predict_from``.

        Parameters
        ----------
        history, future : as X in :meth:`fit`
            Rows up to the origin, and those after it; ``history=None``: all that is known from fit and update.
        T_za, setpoint, quantiles
            As in :meth:`skhybrid.hybrid.HybridPredictor.forecast`, for all zones.

        Returns
        -------
        DataFrame with the stamps of future
            The key and the columns of the estimator's forecast, such as ``T_za`` [degC].
        """
        self._models.check(self._settings())
        given = {"T_za": T_za, "setpoint": setpoint, "quantiles": quantiles}
        past = nullcontext(None) if history is None else zone_files(history, None, self.key)
        with zone_files(future, None, self.key) as files, past as before:
            calls = {z: (path,) if before is None else (path, before.paths.get(z)) for z, path in files.paths.items()}
            lost = {zone: "history has no rows of it." for zone, paths in calls.items() if None in paths}
            return self._joined(self._run(forecast_zone, calls, files, (given,), lost=lost), files)

    def update(self, X: Any) -> Self:
        """Let the models take in new rows, as the estimator's ``update`` does, and score the forecasts of these rows.

        Parameters
        ----------
        X : as in :meth:`fit`
            Rows that follow the known ones, with ``T_za``.  Rows that a zone has just taken in are not taken in again.
        """
        with zone_files(X, None, self.key) as files, self._models.locked(self._settings()):
            warn_of_failed(self._run(update_zone, files.by_zone, files))
        return self

    def tick(self, X: Any) -> pd.DataFrame:
        """Take in what was measured since, and forecast the rows after the last measurement.

        ``warnings_`` tells for which zones nothing new was measured, and which have no forecast.

        Parameters
        ----------
        X : as in :meth:`fit`
            All rows, or those since the fit; after the last ``T_za`` those ahead, with weather, and plans.

        Returns
        -------
        DataFrame with the stamps ahead
            The key and the columns of the estimator's forecast, with 80 % intervals where they were learned.
        """
        with zone_files(X, None, self.key) as files, self._models.locked(self._settings()):
            found = self._run(tick_zone, files.by_zone, files, of="tick")
            done = {files.labels[o.zone]: o.value for o in found if o.value is not None}
            if not all(one.first for one in done.values()):  # on the day of the fit all is known already
                silent = {zone: one.silent for zone, one in done.items() if one.silent}
                self.warnings_ |= {z: (text, *self.warnings_.get(z, ())) for z, text in silent.items()}
            absent = [zone for zone in self.zones_ if zone not in files.paths]
            self.warnings_ |= dict.fromkeys(absent, ("there are no rows of it.",))
            return self._joined([o._replace(value=o.value and o.value.forecast) for o in found], files, of="tick")

    def score(self, X: Any, y: Any = None) -> pd.DataFrame:
        """Score each zone as the estimator's ``score`` does.

        Parameters
        ----------
        X, y : as in :meth:`fit`

        Returns
        -------
        DataFrame of the key and ``score``, one row per zone
        """
        return self._table(score_zone, X, y).reset_index(drop=True)

    def backtest(self, X: Any, y: Any = None, **settings: Any) -> pd.DataFrame:
        """Forecast from every origin, as :func:`skhybrid.model_selection.backtest` does.

        Parameters
        ----------
        X, y : as in :meth:`fit`
        **settings
            ``horizon``, ``origin_step``, ``start``, ``quantiles``, ``whole``, ``weather_error`` and ``heat_known``.

        Returns
        -------
        DataFrame of the key and the columns of a back-test
        """
        return self._table(backtest_stored, X, y, settings).reset_index(drop=True)

    def status(self, page: str | PathLike[str] | None = None, data: Any = None) -> pd.DataFrame:
        """Say how each zone is doing, the worst first.

        Parameters
        ----------
        page : path-like, optional
            HTML file to write, with a small chart per zone.
        data : as X in :meth:`fit`, optional
            Its zones are listed even where they have no model.

        Returns
        -------
        DataFrame, one row per zone
            The key; ``verdict`` (usable, use with care, not usable) and ``reasons``; ``last_row``; ``rmse_yesterday``
            of the forecasts of the last day of which half of the rows or more are known, ``rmse_training`` on left-out
            training days [K]; ``coverage`` of the 80 % intervals in the last four weeks [-]; and ``drift``, whether
            errors have grown.
        """
        self._check_key()
        self._models.check(self._settings())
        zones = self.zones_
        files = ZoneFiles(dict.fromkeys(zones, ""), {zone: zone for zone in zones})
        outcomes = self._run(zone_status, dict.fromkeys(zones, ()), files, all_may_fail=True)
        found = {o.zone: o.value for o in outcomes if o.error is None}
        failed = self._models.failures("fit") | {str(zone): why for zone, why in getattr(self, "errors_", {}).items()}
        if data is not None:
            with zone_files(data, None, self.key) as given:
                failed = dict.fromkeys(given.paths.keys() - zones, _UNFITTED) | failed
        table = status_table(found, {"fit": failed, "tick": self._models.failures("tick")}, self.key)
        if page is not None:
            write_fleet_page(page, table, {zone: one.recent for zone, one in found.items()}, self.key)
        return table

    def prior(self, sizes: Mapping[str, float] | None = None) -> FleetPrior:
        """Learn from the fitted zones what is usual, for a new zone with a few days of data.

        Parameters
        ----------
        sizes : mapping of zone to float, optional
            Nameplate of each zone [kW]; zones that it leaves out are left out.

        Returns
        -------
        FleetPrior
            Of the zones that the estimator, not the fallback, was fitted on for two days or more.

        Raises
        ------
        ValueError
            If ``sizes`` names a zone without a model, or as :meth:`FleetPrior.learn`.

        Warns
        -----
        SkhybridWarning
            Of zones whose files are damaged; they are left out.
        """
        models = self._models
        given = sizes.to_dict() if isinstance(sizes, pd.Series) else sizes
        named = as_mapping("sizes", given, "zones to their nameplates")
        plates = None if sizes is None else {str(zone): size for zone, size in named.items()}
        zones = models.zones() if plates is None else list(plates)
        unknown = [zone for zone in zones if not models.has(zone)]
        if unknown:
            raise ValueError(f"sizes names zone {unknown[0]!r}, of which the store has no model; leave it out.")
        read = {zone: evidence_and_span(model) for zone, model in models.fitted(zones)}
        sizes_read = None if plates is None else [plates[zone] for zone in read]
        return FleetPrior.of_evidence(list(read.values()), sizes_read, [f"zone {zone!r}" for zone in read])

    @property
    def zones_(self) -> list[str]:
        """Names of the zones that have a model."""
        return self._models.zones()

    @property
    def store_(self) -> str:
        """The folder of the models."""
        if not hasattr(self, "_folder"):
            if self.store is None:
                raise NotFittedError("this ZoneFleet is not fitted; call fit, or give the store of a fitted one.")
            self._folder = self._new_folder()
        return os.fspath(self._folder)

    def __sklearn_is_fitted__(self) -> bool:
        return bool((hasattr(self, "_folder") or self.store is not None) and self.zones_)

    @property
    def _models(self) -> ModelStore:
        return ModelStore(self.store_)

    def _new_folder(self) -> str | TemporaryStore:
        return TemporaryStore() if self.store is None else os.path.abspath(self.store)  # workers may run elsewhere

    def _check_key(self) -> None:
        if self.key in COLUMNS:
            raise ValueError(f"key={self.key!r} is a column of the status itself; give the fleet another key.")

    def _settings(self) -> dict[str, str]:
        """Settings that a store must have been made with."""
        for name, given in [("estimator", self.estimator), ("fallback", self.fallback)]:
            if not is_estimator(given) and (name, given) != ("fallback", None):
                raise ValueError(f"{name}={given!r} must be an estimator, such as HybridPredictor().")
        params = self.estimator.get_params(deep=False)
        found = {f"parameter {name}": as_plain(value) for name, value in params.items()}
        fixed = {"estimator": as_plain(type(self.estimator)), "fallback": as_plain(self.fallback)}
        return {**fixed, **found, f"{VERSION}skhybrid": __version__}

    def _table(self, job: Callable[..., Any], X: Any, y: Any, *given: Any) -> pd.DataFrame:
        self._models.check(self._settings())
        with zone_files(X, y, self.key) as files:
            return self._joined(self._run(job, files.by_zone, files, given), files)

    def _run(
        self,
        job: Callable[..., Any],
        paths: Mapping[str, tuple[Any, ...]],
        files: ZoneFiles,
        given: Iterable[Any] = (),
        *,
        of: str = "",
        all_may_fail: bool = False,
        lost: Mapping[str, str] | None = None,
    ) -> list[ZoneOutcome]:
        """Outcomes by the order of the zones; sets ``errors_`` and ``warnings_``; a job without files gets no paths.

        Those of the last fit stay in ``errors_``.  Those of a fit or a tick that fails for all zones are kept.
        """
        models, failed = self._models, dict(lost or {})
        known: dict[Any, str] = {}
        if of != "fit":
            known = getattr(self, "_fit_errors", {})
            why = models.failures("fit") | {str(label): text for label, text in known.items()}
            failed |= {zone: why.get(zone, _UNFITTED) for zone in paths if not models.has(zone)}
        calls = {
            zone: (job, (zone, self.store_, *([own] if own else []), *given))
            for zone, own in paths.items()
            if zone not in failed
        }
        found = {zone: ZoneOutcome(zone, error=text) for zone, text in failed.items()}
        for outcome in run(calls, self.n_jobs):
            found[outcome.zone] = outcome
        ordered = [found[zone] for zone in paths]
        self.errors_ = {**known, **{files.labels[o.zone]: o.error for o in ordered if o.error is not None}}
        self.warnings_ = {files.labels[o.zone]: o.warnings for o in ordered if o.warnings}
        if ordered and not all_may_fail and all(o.error is not None for o in ordered):
            if of:  # the store tells why, also of a call that raises
                models.keep_failures(of, {o.zone: o.error for o in ordered})
            raise ValueError(f"no zone succeeded; {causes(ordered)}")
        return ordered

    def _joined(self, outcomes: Sequence[ZoneOutcome], files: ZoneFiles, *, of: str = "") -> pd.DataFrame:
        tables = {files.labels[o.zone]: o.value for o in outcomes if o.value is not None}
        made, failed = joined_zones(tables, self.key)
        self.errors_ |= failed
        told = [o._replace(error=failed.get(files.labels[o.zone], o.error)) for o in outcomes]
        if of:
            self._models.keep_failures(of, {o.zone: o.error for o in told})
        warn_of_failed(told)
        return made
