"""BuildingPredictor: day-ahead forecasts of all zones of a building, which exchange heat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Self

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from sklearn.base import clone
from sklearn.utils import Tags, check_consistent_length
from sklearn.utils.validation import check_is_fitted

from ..._arguments import check_n_jobs, store_arguments
from ..._rolling import r2_of_measured
from ..._table import as_numbers, as_pandas
from ..._threads import one_blas_thread
from ..._time import rows_of
from ..._transaction import unchanged_on_failure
from ..._warnings import kept_warnings, warn_of_zone, warnings_dropped, warnings_joined
from ...exceptions import GainWarning, PlanWarning
from ...forecasting.quantiles import LeftOut
from ...thermal import get_network
from ..base import BaseHybrid
from ..joint_errors import JointErrors
from ..parts import fit_preprocess
from ..predictor import HybridPredictor, takes_two_stages
from ..schedule_predictor import DEFAULT_NETWORK
from .base import BaseBuilding
from .building_tables import of_zone, tables_of_zones, with_neighbour_temperatures
from .coupled_zone import at_common_origins, couple, with_neighbours
from .zone_columns import (
    NEXT,
    ZoneColumns,
    found_neighbours,
    neighbours_of,
    read_temperatures,
    refuse_same,
    with_temperatures,
)

_SETTLED = 10  # days before the one on which the response to a neighbour is computed


class BuildingPredictor(BaseBuilding):
    """Day-ahead forecast of temperature and load of all zones of a building.

    Each zone has two predictors: one that knows only the zone itself, and one that takes its neighbours' temperatures
    as boundaries.  After the origin these boundaries are the forecasts of the neighbours' first predictors.  A zone's
    forecast is a blend of its two, weighted by their errors on left-out days of the training.

    Columns of one zone end with its name: ``T_za_north``, ``Q_hvac_north`` or ``Q_north``, ``u_heat_north``,
    ``q_sol_north``, ``T_heat_set_north``.  All others, such as ``T_oa``, ``q_sol``, a facade's irradiance or the stage
    ``u_heat`` of a boiler that serves several zones, are shared.  See :doc:`/how_to/several_zones`.

    Parameters
    ----------
    estimator : HybridPredictor, SchedulePredictor or TwoStagePredictor, optional
        The predictor of a zone; default ``HybridPredictor()``.  Its ``preprocess`` is applied to the whole table, once.
        In its ``known``, ``Q_h_north`` is the capacity of ``u_heat_north``, and ``Q_h`` that of zones without one.
        Zones of the two-stage scheme are forecast by themselves.
    adjacency : sequence of pairs of zones, optional
        Which zones exchange heat, by the floor plan; ``[]``: none.  Default: up to three zones whose temperatures
        change most like a zone's own; a floor plan is better.
    n_jobs : int, optional
        Number of zones that are fitted in parallel (joblib).

    Attributes
    ----------
    zones_ : list of str
    own_ : dict of str to estimator
        The fitted predictor of each zone by itself.
    coupled_ : dict of str to CoupledZone
        Of zones with neighbours: ``neighbours``, the fitted ``model``, ``shares``.
    shares_ : DataFrame
        Share of the forecast with neighbours, by zone and group of leads.
    n_features_in_, feature_names_in_

    Examples
    --------
    >>> from skhybrid import BuildingPredictor
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=16, random_state=0)
    >>> X = office.X.drop(columns="T_za")
    >>> y = office.y.to_frame("south").assign(north=office.y - 1.0)
    >>> X = X.assign(T_za_south=y["south"], T_za_north=y["north"])
    >>> building = BuildingPredictor().fit(X[:-96], y[:-96])
    >>> building.predict(X[-96:]).shape
    (96, 2)
    """

    def __init__(self, estimator=None, *, adjacency=None, n_jobs=None):
        store_arguments(self, locals())

    @unchanged_on_failure
    @warnings_joined()
    def fit(self, X: Any, y: Any) -> Self:
        """Learn from a training table.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows by the data contract.
        y : DataFrame or array-like of shape (n_samples, n_zones)
            Measured temperature of each zone [degC], NaN where missing; the columns of a frame are the zones' names, or
            ``T_za_<zone>``.  One-dimensional: a single zone.

        Raises
        ------
        ValueError
            If zones of X and y differ or are exchanged, ``adjacency`` names others, or a zone's table is refused.
        """
        template = HybridPredictor() if self.estimator is None else self.estimator
        if not isinstance(template, BaseHybrid):
            raise ValueError(f"estimator={template!r} must be a hybrid predictor; give a HybridPredictor or None.")
        check_n_jobs(self.n_jobs)
        X, y = self._read(X, reset=True), as_pandas(y, "y")
        check_consistent_length(X, y)
        self.preprocess_ = fit_preprocess(template.preprocess, X, y)
        T = read_temperatures(y, X := self._prepared(X))
        self._single = np.asanyarray(y).ndim == 1
        X = with_temperatures(X, T, template.columns)
        self._columns = ZoneColumns.of(X, tuple(T.columns), template.columns)
        self._columns.refuse_exchanged(X, T)
        self._columns.warn_of_no_zone()
        self.zones_ = list(self._columns.zones)
        neighbours = self._neighbours(T, takes_two_stages(template), X)
        self.coupled_, self._last = {}, dict.fromkeys(self.zones_, np.nan)
        self.own_ = self._work_by_zone({zone: (self._fit_zone, template, X, T[zone]) for zone in self.zones_})
        coupled = {zone: others for zone, others in neighbours.items() if others}
        X = self._zones.with_measured(X, T) if coupled else X
        among = {z: (self._fit_zone, template, X, T[z], others, self.own_[z]) for z, others in coupled.items()}
        self._couple(X, self._work_by_zone(among), neighbours)
        self._learn_usual()
        self._last, self.training_ = self._zones.last_after(T), self._zones.first.training_
        return self

    def _learn_usual(self) -> None:
        """Learn how plants without a learned thermostat usually run, where other zones have one."""
        if any(self.thermostat_learned_.values()):
            for model in (*self.own_.values(), *(one.model for one in self.coupled_.values())):
                if model._plant and not model.thermostat_learned_:
                    model._learn_usual()

    def _work_by_zone(self, works: Mapping[str, tuple[Any, ...]]) -> dict[str, Any]:
        """Results of a function and its arguments for each zone, with their warnings, on ``n_jobs`` workers."""
        made = Parallel(self.n_jobs)(delayed(kept_warnings)(*work) for work in works.values())
        for zone, (_, told) in zip(works, made, strict=True):
            warn_of_zone(zone, told)
        return {zone: found for zone, (found, _) in zip(works, made, strict=True)}

    def _neighbours(self, T: pd.DataFrame, by_itself: bool, X: Any) -> dict[str, tuple[str, ...]]:
        if self.adjacency is not None:
            found = neighbours_of(self.zones_, self.adjacency)
            if by_itself and any(found.values()):
                raise ValueError("adjacency does nothing with the two-stage scheme; leave it out.")
            refuse_same(T, found)
            return found
        if by_itself or not isinstance(X, pd.DataFrame) or len(self.zones_) == 1:
            return {}
        return found_neighbours(T.set_axis(X.index) if len(X) == len(T) else T)  # the rows of T may have no stamps

    def _fit_zone(
        self,
        template: BaseHybrid,
        X: Any,
        y: pd.Series,
        neighbours: tuple[str, ...] = (),
        like: BaseHybrid | None = None,
    ) -> BaseHybrid:
        """The predictor of a zone, by itself or with its neighbours, which then is ``like`` that by itself."""
        settings: dict[str, Any] = {"preprocess": None}
        if isinstance(X, pd.DataFrame):
            zone = str(y.name)
            settings["columns"] = self._columns.in_zone(zone, template.columns or {}) or None
            known = {name: value for name, value in template.get_params().items() if name.endswith("known") and value}
            settings |= {name: self._columns.known_in_zone(zone, value) or None for name, value in known.items()}
        if neighbours:
            network = get_network(template.get_params()["network"] or DEFAULT_NETWORK)
            settings |= {"network": with_neighbours(network, neighbours), "intervals": False}
        with of_zone(str(y.name)):
            return clone(template).set_params(**settings).fit(X, _target(X, y), like)

    def _couple(self, X: Any, models: Mapping[str, BaseHybrid], neighbours: Mapping[str, tuple[str, ...]]) -> None:
        """Weigh the forecasts with neighbours."""
        wanted = models or all(model.intervals for model in self.own_.values())
        own = {zone: model.left_out_errors() for zone, model in self.own_.items()} if wanted else {}
        errors: dict[str, LeftOut] = dict(own)
        for zone, model in models.items():
            others = neighbours[zone]
            with of_zone(zone), warnings_dropped(GainWarning, PlanWarning):  # nobody plans yet
                gain = self._response(X, model, others, own[zone])
            self.coupled_[zone], errors[zone] = couple(model, zone, others, own, gain)
        index = X.index if isinstance(X, pd.DataFrame) else pd.RangeIndex(len(X))
        self._joint = None
        if errors:
            origins, missed = at_common_origins(list(errors.values()))
            self._joint = JointErrors.of(np.stack(missed, axis=-1), index, origins)

    def _response(self, X: pd.DataFrame, model: BaseHybrid, neighbours: Sequence[str], own: LeftOut) -> np.ndarray:
        """(n_leads, n_leads, n_neighbours) gain of a zone's forecast by its neighbours, on the last day of training."""
        n_leads = own.errors.shape[1]
        if len(X) <= n_leads:  # too short for errors that it would act on
            return np.zeros((n_leads, n_leads, len(neighbours)))
        n_known = min(len(X) - n_leads, rows_of(f"{_SETTLED}D", model.sampling_time_))
        history, future = X[-n_leads - n_known : -n_leads], X[-n_leads:]
        return model.affine_forecast(history, future, [NEXT + other for other in neighbours]).gain

    def without_neighbours(self) -> Self:
        """A copy that forecasts each zone by itself.

        Returns
        -------
        BuildingPredictor
        """
        check_is_fitted(self)
        made = copy(self)
        made.coupled_ = {}
        return made

    @property
    def shares_(self) -> pd.DataFrame:
        """Share of the forecast with neighbours, by zone and group of leads."""
        return pd.DataFrame({zone: one.shares for zone, one in self._zones.coupled.items()}).T

    @property
    def known_until_(self) -> pd.Timestamp | None:
        """Stamp of the last row that the model knows, in the time zone of the training; None if that had no stamps."""
        return self._zones.first.known_until_

    def n_known_of(self, X: Any) -> int:
        """Count the first rows of a table that the models of all zones know, as :meth:`HybridPredictor.n_known_of`.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        """
        zones, X = self._zones, self._prepared(self._read(X))
        return min(zones.of_each(lambda model: model.n_known_of(X)).values())

    @property
    def thermostat_learned_(self) -> dict[str, bool]:
        """Whether the training had set-points of a zone, so that its thermostat was learned, by zone."""
        return self._zones.of_each(lambda model: model.thermostat_learned_)

    @unchanged_on_failure
    @warnings_joined()
    def partial_fit(self, X: Any, y: Any) -> Self:
        """Learn from new rows, as :meth:`HybridPredictor.partial_fit` does; shares of neighbours and intervals stay.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows that follow the last known one, or a later part of those that :meth:`update` has taken in.
        y : DataFrame or array-like of shape (n_samples, n_zones)
            Measured temperature of each zone [degC], NaN where missing; the first call fits.

        Raises
        ------
        ValueError
            As :meth:`fit` does, and if the rows do not follow; the estimator is then what it was.
        """
        if not hasattr(self, "own_"):
            return self.fit(X, y)
        X, before = self._prepared(self._read(X)), self.known_until_
        T = self._columns.known(X, y)
        among = self._zones.with_measured(X, T) if self.coupled_ else X

        def learned(zone: str, model: BaseHybrid, X: Any) -> BaseHybrid:
            with of_zone(zone):
                return copy(model).partial_fit(X, _target(X, T[zone]))

        own = self._work_by_zone({zone: (learned, zone, model, X) for zone, model in self.own_.items()})
        coupled = self._work_by_zone({zone: (learned, zone, one.model, among) for zone, one in self.coupled_.items()})
        self.own_ = own
        self.coupled_ = {zone: replace(one, model=coupled[zone]) for zone, one in self.coupled_.items()}
        self._learn_usual()
        if before is None or self.known_until_ != before:
            self._last = self._zones.last_after(T)
        self.training_ = self._zones.first.training_
        return self

    @unchanged_on_failure
    @warnings_joined()
    @one_blas_thread
    def update(self, X: Any, y: Any = None) -> Self:
        """Take in new rows, as :meth:`HybridPredictor.update` does.

        After a forecast, what new rows teach is computed at once, so that the next forecast of many zones is quick.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows that follow the last known one, with ``T_za_<zone>`` as measured, NaN where missing.
        y : DataFrame or array-like of shape (n_samples, n_zones), optional
            The measured temperatures, where X has none.

        Raises
        ------
        ValueError
            If the rows do not follow, or lack the measured temperature of a zone; the estimator is then what it was.
        """
        check_is_fitted(self)
        X = self._prepared(self._read(X))
        columns = map(self._columns.measured, self.zones_)
        absent = [column for column in columns if column not in getattr(X, "columns", ())]
        if y is None and absent:
            raise ValueError(
                f"X has no column {absent[0]!r}; give what was measured there or as y, with NaN where missing (rows "
                "ahead are for predict and forecast)."
            )
        T = self._columns.known(X, y)
        tables = None if y is not None else tables_of_zones(self.own_, self._columns, X, measured=True)
        X = self._zones.with_measured(X, T) if self.coupled_ and tables is None else X
        carried = self._zones.carried_on(T)

        def after(zone: str, model: BaseHybrid, neighbours: Sequence[str] = ()) -> BaseHybrid:
            with of_zone(zone):
                if tables is None:
                    return copy(model).update(X, _target(X, T[zone]))
                around = {other: carried[other] for other in neighbours}
                return model._copy_after(with_neighbour_temperatures(tables[zone], around))

        self.own_ = {zone: after(zone, model) for zone, model in self.own_.items()}
        coupled = self.coupled_.items()
        self.coupled_ = {zone: replace(one, model=after(zone, one.model, one.neighbours)) for zone, one in coupled}
        self._last = self._zones.last_after(T)
        if T[-1:].isna().to_numpy().any():
            known = pd.DataFrame(self._zones.of_each(lambda model: model.known_rows_["T_za"]))
            self._zones.warn_of_silent(known, len(T))
        return self

    def score(self, X: Any, y: Any, sample_weight: Any = None) -> float:
        """Coefficient of determination of :meth:`predict`, the mean of the zones; missing rows are left out.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        y : array-like of shape (n_samples, n_zones)
        sample_weight : array-like of shape (n_samples,), optional

        Raises
        ------
        ValueError
            If there is no row in which all zones were measured, or X or ``y`` cannot be read.
        """
        predicted = np.asarray(self.predict(X))
        measured = as_numbers(self._columns.known(X, y), "y").reshape(predicted.shape)
        return r2_of_measured(measured, predicted, sample_weight)

    @warnings_joined()
    def drift(self, X: Any = None) -> pd.DataFrame:
        """Report day by day whether what was learned of each zone still holds: :meth:`HybridPredictor.drift`.

        Parameters
        ----------
        X : DataFrame, optional

        Returns
        -------
        DataFrame
            With the zone as first level of the index.
        """
        zones, X = self._zones, None if X is None else self._prepared(self._read(X))
        return pd.concat(zones.of_each(lambda model: model.drift(X)), names=["zone"])

    def _facts(self) -> dict[str, str]:
        pairs = {tuple(sorted((zone, other))) for zone, one in self.coupled_.items() for other in one.neighbours}
        return {"zones": ", ".join(self.zones_), "neighbours": ", ".join(map("-".join, sorted(pairs))) or "none"}

    def _tables(self) -> dict[str, pd.DataFrame]:
        return {"share of the forecast with neighbours": self.shares_} if self.coupled_ else {}

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.target_tags.single_output = True
        tags.regressor_tags.poor_score = True  # scikit-learn's checks draw rows that are not consecutive time steps
        return tags


def _target(X: Any, T: pd.Series) -> Any:
    """A zone's temperatures as the target of X, whose rows have no stamps where it is an array."""
    return T if isinstance(X, pd.DataFrame) else T.to_numpy()
