"""TwoStagePredictor: the paper's scheme, an identified network driven by a forecast of its disturbance."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, Self

from sklearn.base import BaseEstimator, clone
from sklearn.frozen import FrozenEstimator
from sklearn.utils.validation import check_is_fitted

from .._arguments import check_n_jobs, check_verbose, store_arguments
from .._threads import one_blas_thread
from ..forecasting import DisturbanceForecaster
from ..forecasting.named_models import check_parameters, refuse_unread, require_networks
from ..identification import PeriodicDisturbanceID
from .base import Adapt, BaseHybrid
from .parameter_docs import shared_docs
from .parts import clone_part
from .scheme import Scheme
from .two_stage_scheme import TwoStageScheme


class BaseTwoStage(BaseHybrid):
    """Base of the predictors that take a gray box and a forecaster."""

    def __init__(
        self, gray_box=None, forecaster=None, *, network=None, known=None,
        disturbance: Literal["input", "output"] = "input", horizon="1D", adapt: Adapt = "full", intervals=True,
        preprocess=None, memory=None, columns=None, sampling_time=None, holidays=None, n_jobs=None, random_state=None,
        verbose=0, origin_step=None, max_missing=0.5,
    ):  # fmt: skip
        store_arguments(self, locals())

    def set_params(self, **params: Any) -> Self:
        """Set parameters, also those of parts, given or default (``forecaster__hidden_size``).

        A default part whose parameters are set still takes ``network`` and ``known``, or ``horizon``, from here.

        Parameters
        ----------
        **params : dict

        Raises
        ------
        ValueError
            If a parameter is unknown or does nothing in the scheme; the estimator is then what it was.
        """
        before = self.get_params()
        try:
            return self._set(params)
        except Exception:
            super().set_params(**before)  # with the parameters of the parts
            raise

    def _set(self, params: dict[str, Any]) -> Self:
        nested = {name: value for name, value in params.items() if "__" in name}
        super().set_params(**{name: value for name, value in params.items() if name not in nested})
        for part, make in (("gray_box", _default_gray_box), ("forecaster", _default_forecaster)):
            names = [name for name in nested if name.startswith(f"{part}__")]
            if names and getattr(self, part) is None:
                if not self._takes_two_stages():
                    raise ValueError(
                        f"{names[0]} does nothing with the schedule model, which has no {part}; give a {part} for the "
                        "two-stage scheme."
                    )
                setattr(self, part, make())
        return super().set_params(**nested)

    def _takes_two_stages(self) -> bool:
        return True

    def _reading(self) -> dict[str, Any]:
        own = super()._reading()
        return {name: getattr(self.gray_box, name, None) if given is None else given for name, given in own.items()}

    def _make_scheme(self) -> Scheme:
        check_n_jobs(self.n_jobs)
        check_verbose(self.verbose)
        if self.disturbance not in ("input", "output"):
            raise ValueError(f"disturbance={self.disturbance!r} is neither 'input' nor 'output'.")
        if not (self.memory is None or isinstance(self.memory, str | PathLike) or hasattr(self.memory, "cache")):
            raise ValueError(f"memory={self.memory!r} must be a folder or a joblib.Memory.")
        parts = self._gray_box_part(), self._forecaster_part()
        return TwoStageScheme(*parts, disturbance=self.disturbance, adapt=self.adapt, memory=self.memory)

    def _gray_box_part(self) -> Any:
        given = _default_gray_box() if self.gray_box is None else self.gray_box
        wanted = "an identification; give one such as PeriodicDisturbanceID('2R2C')"
        gray_box = clone_part("gray_box", given, ("estimate_disturbance", "network"), wanted)
        if self.network is not None and gray_box.network is not None:
            raise ValueError("network= does nothing beside a gray_box, which has its own; set it there.")
        if self.known is not None:
            if isinstance(gray_box, FrozenEstimator):
                raise ValueError("known= does nothing beside a frozen gray_box, which is not identified; leave it out.")
            if gray_box.known is not None:
                raise ValueError("known= does nothing beside a gray_box that has its own; set it there.")
        network = PeriodicDisturbanceID().network if self.network is None else self.network
        return self._part(gray_box, network=network, known=self.known)

    def _forecaster_part(self) -> Any:
        given = _default_forecaster() if self.forecaster is None else self.forecaster
        # a regressor, or its name, is likely the model of a forecaster
        is_model = isinstance(given, str) or (hasattr(given, "predict") and not isinstance(given, type))
        wanted = f"a DisturbanceForecaster; give DisturbanceForecaster({given if is_model else 'ridge'!r})"
        forecaster = clone_part("forecaster", given, ("fit", "predict_from"), wanted)
        if isinstance(forecaster, DisturbanceForecaster):
            check_parameters(forecaster)
            refuse_unread(forecaster)
            require_networks(forecaster.model, forecaster.device)
        return self._part(forecaster, horizon=self.horizon or "1D")

    def _part(self, part: Any, **passed: Any) -> Any:
        """A part with what it can take over from this estimator, where its own is None."""
        params = part.get_params(deep=False)
        passed |= {"n_jobs": self.n_jobs, "random_state": self.random_state, "holidays": self._reading()["holidays"]}
        wanted = {name: value for name, value in passed.items() if name in params and params[name] is None}
        if self.verbose and not params.get("verbose", True):
            wanted["verbose"] = self.verbose
        if "max_missing" in params:  # checked of y here; of a left-out week or an outage more may be missing
            wanted["max_missing"] = 1.0
        part.set_params(**wanted)
        return part  # FrozenEstimator.set_params returns nothing

    @one_blas_thread
    def with_forecasters(self, forecasters: Sequence[Any], disturbance: str | None = None) -> list[Self]:
        """Fit other forecasters on this fitted estimator's disturbance; the network is not identified again.

        They forecast to the bit as after a fit of each, but have no intervals (two-stage scheme only).

        Parameters
        ----------
        forecasters : sequence of estimator
            Regressors of the disturbance, unfitted; they are cloned.
        disturbance : {"input", "output"}, optional
            Default is this estimator's own.

        Returns
        -------
        list of estimators
            One per forecaster, fitted; they share nothing that changes.

        Raises
        ------
        ValueError
            If this estimator has taken the schedule model, or rows were taken in since ``fit``.
        TypeError
            If ``forecasters`` is one estimator.
        """
        check_is_fitted(self)
        scheme = self._scheme
        if isinstance(forecasters, str | BaseEstimator):
            raise TypeError(f"forecasters={forecasters!r} must be a sequence of forecasters; give [forecaster].")
        if not isinstance(scheme, TwoStageScheme):
            raise ValueError("the schedule model learns network and disturbance as one, and has no other forecaster.")
        if scheme.rows.latest is not scheme.rows.training:
            raise ValueError("rows were taken in since fit; fit again before other forecasters are fitted.")
        kind = self.disturbance if disturbance is None else disturbance
        made = [clone(self).set_params(forecaster=one, disturbance=kind) for one in forecasters]
        read = ("n_features_in_", "feature_names_in_", "preprocess_", "_n_before")
        for one, fitted in zip(made, scheme.with_forecasters([m._forecaster_part() for m in made], kind), strict=True):
            vars(one).update({name: value for name, value in vars(self).items() if name in read})
            one._take(fitted, intervals=False)
        return made


# what is None in a default part is taken over from the predictor whenever that is fitted
def _default_gray_box() -> PeriodicDisturbanceID:
    return PeriodicDisturbanceID(network=None)


def _default_forecaster() -> DisturbanceForecaster:
    return DisturbanceForecaster("ridge", horizon=None)


@shared_docs
class TwoStagePredictor(BaseTwoStage):
    """Day-ahead forecast of temperature and load by the paper's scheme.

    The gray box is identified, the disturbance that it leaves is estimated (causally, as later in use), averaged over
    hours and learned by the forecaster; a forecast drives the network with the forecast disturbance (paper
    Eqs. 17 and 18).  See :doc:`/explanation/method`.

    Parameters
    ----------
    %(stages)s
    network : str or RCNetwork, optional
        Network of a gray box that has none, "2R2C"; refused beside a ``gray_box`` that has one.
    known : dict of str to float, optional
        Parameters of the gray box that are given, where it has none of its own.
    %(disturbance)s
    %(horizon)s
    adapt : {None, "linear", "full"}, default="full"
        What a forecast takes in from the history up to its origin.  None: the state and the recent disturbance.
        ``"linear"``: also, a baseline such as ``"ridge"`` is fitted again for every full week of history, on all rows
        or, where clearly better, the last weeks.  ``"full"``: as ``"linear"``; :meth:`partial_fit` also identifies the
        network again and trains any forecaster anew.
    intervals : bool, default=True
        Whether ``fit`` learns the intervals of :meth:`predict_quantiles` from forecasters fitted without a part of the
        training: a baseline without each week, others, trained a second time, without the last quarter.
    %(preprocess)s
    %(memory)s
    %(data)s
    %(parts)s
    %(origins)s

    Attributes
    ----------
    scheme_ : str
        ``"two-stage"``.
    gray_box_, forecaster_ : estimator
        The identified network and the fitted forecaster of its disturbance.
    %(fitted)s

    Examples
    --------
    >>> from skhybrid import InputDisturbanceID, TwoStagePredictor
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=14, random_state=0)
    >>> model = TwoStagePredictor(InputDisturbanceID(known={"Q_h": 6.0}, n_starts=2), random_state=0)
    >>> model.fit(office.X[:-96], office.y[:-96]).predict(office.X[-96:]).shape
    (96,)
    """

    @classmethod
    def conventional(cls, gray_box: Any, **settings: Any) -> Self:
        """The paper's conventional approach: a gray box under no disturbance (zeta = 0) after each origin.

        It is not the gray box alone (``gray_box.predict``), whose identified disturbance persists: that of
        :class:`~skhybrid.identification.OutputDisturbanceID` decays by its ARMA model, that of
        :class:`~skhybrid.identification.InputDisturbanceID` stays.

        Parameters
        ----------
        gray_box : estimator
            The identification.
        **settings : dict
            Other parameters, such as ``horizon``.
        """
        settings = {"adapt": None, "intervals": False} | settings
        return cls(gray_box, DisturbanceForecaster("none", horizon=settings.get("horizon", "1D") or "1D"), **settings)
