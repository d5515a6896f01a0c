"""HybridPredictor: the front that selects the schedule model or the two-stage scheme."""

from __future__ import annotations

from .schedule_predictor import make_schedule_scheme
from .scheme import Scheme
from .two_stage_predictor import BaseTwoStage, TwoStagePredictor


class HybridPredictor(BaseTwoStage):
    """Day-ahead forecast of temperature and load: a thermal network and a forecast of its unmeasured heat.

    The front of two estimators.  It takes the schedule model (:class:`SchedulePredictor`) unless a gray box, a
    forecaster or an output disturbance is given, and then the paper's two stages (:class:`TwoStagePredictor`).  A
    parameter that does nothing in the selected scheme is refused at ``fit``.

    Parameters
    ----------
    gray_box : estimator, optional
        An identification of this package, for the two-stage scheme; there the default is ``PeriodicDisturbanceID()``.
    forecaster : estimator, optional
        A regressor of the disturbance, for the two-stage scheme; there the default is
        ``DisturbanceForecaster("ridge")``.
    network : str or RCNetwork, optional
        The thermal network: by default 4R3C for the schedule model, 2R2C for the two-stage scheme, where it is refused
        beside a ``gray_box``, which has its own.
    known : dict of str to float, optional
        Parameters that are given, such as ``{"Q_h": 6.0}`` [kW]; capacities only for the schedule model.  It never
        changes the scheme.
    disturbance : {"input", "output"}, default="input"
        Whether the disturbance is heat on the zone [kW] or an addition to its temperature [K]; ``"output"`` takes the
        two-stage scheme.
    horizon : timedelta-like, default="1D"
        How far ahead ``predict`` looks; None forecasts from the first row on.
    adapt : {None, "linear", "full"}, default="full"
        What a forecast takes in from the history up to its origin; see the two estimators.
    intervals : bool, default=True
        Whether ``fit`` learns the intervals of :meth:`predict_quantiles`.  They cost the schedule model and baselines
        next to nothing; a network or a regressor is trained a second time for them.
    memory : str or joblib.Memory, optional
        Where identifications are kept (two-stage scheme; refused for the schedule model, which identifies nothing).
    n_jobs : int, optional
        Passed to a gray box that has none (two-stage scheme; refused for the schedule model, which runs on one core).
    random_state : int, RandomState or None
        Passed to parts that have none.  The schedule model draws nothing at random: every seed gives the same.
    verbose : int, default=0
        1 shows progress, of which the schedule model has none.
    columns : dict of role to column, optional
        Columns whose names are not their roles; default is the gray box's own ``columns``.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps; default is the gray box's own.
    origin_step : timedelta-like, optional
        Distance of forecast origins; default = ``horizon``.
    max_missing : float, default=0.5
        Highest share of missing measurements.

    Attributes
    ----------
    scheme_ : str
        ``"schedule"`` or ``"two-stage"``.
    gray_box_ : estimator
        The fitted network of the selected scheme: a :class:`~skhybrid.schedule.ScheduledNetwork`, or the identified
        gray box.
    forecaster_ : estimator
        The fitted forecaster of the disturbance; of the schedule model the same as ``gray_box_``, whose schedules it
        is.
    weights_ : DataFrame
        Shares of the blend's members by group of leads (schedule model only).
    zeta_ : Series
        The training disturbance [kW, or K for an output disturbance].
    sampling_time_, disturbance_step_ : Timedelta
        Steps of the table and of the disturbance.
    intervals_ : LeadIntervals
        Errors on left-out days of the training, from which quantiles are made.

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

    def _make_scheme(self) -> Scheme:
        if self._takes_two_stages():
            return self._two_stage_scheme()
        for name, reason in (("memory", "identifies nothing"), ("n_jobs", "runs on one core")):
            if getattr(self, name) is not None:
                raise ValueError(
                    f"{name}={getattr(self, name)!r} does nothing with the schedule model, which {reason}; leave it "
                    "out, or give a gray_box or a forecaster for the two-stage scheme."
                )
        if self.disturbance != "input":
            raise ValueError(f"disturbance={self.disturbance!r} is neither 'input' nor 'output'.")
        return make_schedule_scheme(self.network, self.known, self.horizon, self.adapt)

    def _takes_two_stages(self) -> bool:
        return self.gray_box is not None or self.forecaster is not None or self.disturbance == "output"

    def _refuse_nested(self, part: str, name: str) -> None:
        if not self._takes_two_stages():
            raise ValueError(
                f"{name} does nothing with the schedule model, which has no {part}; give a {part} for the two-stage "
                "scheme."
            )


def takes_two_stages(estimator: BaseTwoStage) -> bool:
    """Whether an estimator, fitted or not, identifies a gray box first and then fits a forecaster.

    Parameters
    ----------
    estimator : TwoStagePredictor or HybridPredictor

    Returns
    -------
    bool
    """
    return isinstance(estimator, TwoStagePredictor) or (
        isinstance(estimator, HybridPredictor) and estimator._takes_two_stages()
    )
