"""SchedulePredictor: schedules of gain and conductance learned through the network, blended with ARX."""

from __future__ import annotations

from typing import Any, Literal, get_args

from .._arguments import store_arguments
from ..thermal import get_network
from ..thermal.parameters import known_values
from .base import Adapt, BaseHybrid
from .parameter_docs import shared_docs
from .schedule_scheme import ScheduleScheme

DEFAULT_NETWORK = "4R3C"  # network of the schedule model
#: what the forecasts are for
Purpose = Literal["forecast", "plan"]


@shared_docs
class SchedulePredictor(BaseHybrid):
    """Day-ahead forecast of temperature and load by the schedule model.

    Schedules of gain and conductance are learned through the network, on its forecast errors at all leads, and the
    forecast is blended with ARX; see :doc:`/explanation/schedule_model`.  Every forecast stays within the temperatures
    known so far, widened by their range and 2 K, and by 10 K at least.

    Where the training does not determine what a plant does, ``fit`` warns
    (:class:`~skhybrid.exceptions.ExcitationWarning`), takes a network of the usual size, and lets no other member of
    the blend say what that plant does.  A :class:`~skhybrid.exceptions.GainWarning` is given where a gain is
    unreliable: by ``fit`` where heat cools the zone, as it does if its sign is reversed, and with ``purpose="plan"``
    where no jumps of the heat determine it; by :meth:`affine_forecast` and :meth:`to_state_space` where the members of
    the blend disagree on it.

    Parameters
    ----------
    network : str or RCNetwork, default="4R3C"
        The thermal network.
    known : dict of str to float, optional
        Given capacities [kW], such as ``{"Q_h": 6.0}``; ``Q_h`` or ``Q_c`` of a plant that the training does not have
        is ignored, so that zones may share them.  Without one or measured heat, all heat is relative: the first stage
        that runs is taken to have 6 kW.
    %(purpose)s
    %(horizon)s
    adapt : {None, "linear", "full"}, default="full"
        What a forecast takes in from the history up to its origin.  None: the state.  ``"linear"``: also linear
        coefficients and ARX, solved again at every origin, weights by recent errors, and a share of what was missed one
        and two weeks ago.  ``"full"``: also the network and its filter, fitted again every ten days, and sooner when a
        short log has doubled.
    intervals : bool, default=True
        Whether ``fit`` learns the intervals of :meth:`predict_quantiles`.
    %(preprocess)s
    %(data)s
    %(origins)s
    %(prior)s

    Attributes
    ----------
    scheme_ : str
        ``"schedule"``.
    gray_box_ : ScheduledNetwork
        The fitted network with ``theta_`` (resistances [K/kW], capacitances [kWh/K]), ``disturbance_`` (of its filter),
        ``coef_`` (by channel) and ``schedule_`` (``gain`` [kW] and ``ua`` [kW/K] by day type and hour).
    forecaster_ : ScheduledNetwork
        The same: its schedules forecast the disturbance.
    weights_ : DataFrame
        Shares of network, both ARX and the daily profile by group of leads, as the training has them.
    %(gain)s
    %(fitted)s

    Examples
    --------
    >>> from skhybrid import SchedulePredictor
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=14, random_state=0)
    >>> model = SchedulePredictor(known={"Q_h": 6.0}).fit(office.X[:-96], office.y[:-96])
    >>> model.predict(office.X[-96:]).shape
    (96,)
    """

    def __init__(
        self, network="4R3C", *, known=None, purpose: Purpose = "forecast", horizon="1D", adapt: Adapt = "full",
        intervals=True, preprocess=None, columns=None, sampling_time=None, holidays=None, origin_step=None,
        max_missing=0.5, prior=None,
    ):  # fmt: skip
        store_arguments(self, locals())

    def _make_scheme(self) -> ScheduleScheme:
        return make_schedule_scheme(self)


def make_schedule_scheme(predictor: Any) -> ScheduleScheme:
    """The scheme of the schedule model, unfitted, by the parameters of a predictor."""
    purpose, prior = predictor.purpose, predictor.prior
    if purpose not in get_args(Purpose):
        raise ValueError(f"purpose={purpose!r} is neither 'forecast' nor 'plan'.")
    if prior is not None and not (hasattr(prior, "arx") and hasattr(prior, "network")):
        raise ValueError(f"prior={prior!r} must be a FleetPrior; learn one from fitted zones, or leave it out.")
    if prior is not None and purpose == "plan":
        raise ValueError(
            "prior= was learned for forecasts and would undo the pull of purpose='plan' on the gain; leave one out."
        )
    network = get_network(DEFAULT_NETWORK if predictor.network is None else predictor.network)
    given = known_values(predictor.known)
    for name in given:
        if not str(name).startswith("Q_"):
            raise ValueError(
                f"known= gives {name!r}, but the schedule model takes capacities such as 'Q_h' only; give a gray_box "
                "to fix other parameters of a network."
            )
    horizon, adapt = predictor.horizon, predictor.adapt
    return ScheduleScheme(network, known=given, horizon=horizon, adapt=adapt, purpose=purpose, prior=prior)
