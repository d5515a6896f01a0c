"""HybridPredictor: the front that selects the schedule model or the two-stage scheme."""

from __future__ import annotations

from .._arguments import check_verbose, store_arguments
from .base import Adapt
from .parameter_docs import shared_docs
from .schedule_predictor import Purpose, make_schedule_scheme
from .scheme import Scheme
from .two_stage_predictor import BaseTwoStage


@shared_docs
class HybridPredictor(BaseTwoStage):
    """Day-ahead forecast of temperature and load: a thermal network and a forecast of its unmeasured heat.

    It uses the schedule model (:class:`SchedulePredictor`).  If a gray box, a forecaster or an output disturbance is
    given, it uses the paper's two stages instead (:class:`TwoStagePredictor`).  A parameter that does nothing in the
    selected scheme is refused at ``fit``, such as ``memory`` and ``n_jobs`` for the schedule model.

    Parameters
    ----------
    %(stages)s
    network : str or RCNetwork, optional
        Default is 4R3C for the schedule model, 2R2C for the two-stage scheme; refused if the ``gray_box`` has one.
    known : dict of str to float, optional
        Values of parameters that are known, such as ``{"Q_h": 6.0}`` [kW]; the schedule model takes capacities only.
        ``Q_h`` or ``Q_c`` of a plant that the training does not have is ignored, so that several zones may share one
        setting; any other name that the network does not have is refused.
    %(purpose)s
    %(disturbance)s
    %(horizon)s
    adapt : {None, "linear", "full"}, default="full"
        What a forecast takes in from the history up to its origin; see the two estimators.
    intervals : bool, default=True
        Whether ``fit`` learns the intervals of :meth:`predict_quantiles`; networks and regressors are trained a second
        time for them.
    %(preprocess)s
    %(memory)s
    %(data)s
    %(parts)s
    %(origins)s
    %(prior)s

    Attributes
    ----------
    scheme_ : str
        ``"schedule"`` or ``"two-stage"``.
    gray_box_, forecaster_ : estimator
        The identified network and the fitted forecaster of its disturbance; of the schedule model both are the same
        network with its schedules, as :class:`SchedulePredictor` lists.
    weights_ : DataFrame
        Shares of the blend's members by group of leads; as the next two, of the schedule model only.
    %(gain)s
    %(fitted)s

    Examples
    --------
    >>> from skhybrid import HybridPredictor
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=14, random_state=0)
    >>> model = HybridPredictor(known={"Q_h": 6.0}).fit(office.X[:-96], office.y[:-96])
    >>> model.scheme_
    'schedule'
    >>> tomorrow = model.predict(office.X[-96:])
    >>> tomorrow.shape
    (96,)
    """

    def __init__(
        self, gray_box=None, forecaster=None, *, network=None, known=None, purpose: Purpose = "forecast",
        disturbance="input", horizon="1D", adapt: Adapt = "full", intervals=True, preprocess=None, memory=None,
        columns=None, sampling_time=None, holidays=None, n_jobs=None, random_state=None, verbose=0, origin_step=None,
        max_missing=0.5, prior=None,
    ):  # fmt: skip
        store_arguments(self, locals())

    def _make_scheme(self) -> Scheme:
        if self._takes_two_stages() or self.disturbance != "input":
            if self.purpose != "forecast":
                raise ValueError(
                    f"purpose={self.purpose!r} does nothing with the two-stage scheme, whose gain is that of the "
                    "identified network for any purpose; leave it out."
                )
            if self.prior is not None:
                raise ValueError("prior= does nothing with the two-stage scheme; give it as priors= of the gray box.")
            return super()._make_scheme()
        check_verbose(self.verbose)
        for name, reason in (("memory", "identifies nothing"), ("n_jobs", "runs on one core")):
            if getattr(self, name) is not None:
                raise ValueError(
                    f"{name}={getattr(self, name)!r} does nothing with the schedule model, which {reason}; leave it "
                    "out, or give a gray_box or a forecaster for the two-stage scheme."
                )
        return make_schedule_scheme(self)

    def _takes_two_stages(self) -> bool:
        return self.gray_box is not None or self.forecaster is not None or self.disturbance == "output"


def takes_two_stages(estimator: BaseTwoStage) -> bool:
    """Whether an estimator, fitted or not, identifies a gray box first and then fits a forecaster."""
    return isinstance(estimator, BaseTwoStage) and estimator._takes_two_stages()
