"""Identification with the unmeasured heat as a random walk in the filter (ID)."""

from __future__ import annotations

from typing import Literal

from .._arguments import is_number, store_arguments
from .._table import ZoneTable
from ..thermal import Parameter, RCNetwork
from .disturbance_models import InputRandomWalk, measurement_variance
from .experiment import Experiment
from .gain_filter import GainFilter
from .least_squares import LeastSquaresIdentifier
from .one_step_errors import Innovations, scaled_innovations, steady_variance
from .shared_docs import shared_docs


@shared_docs
class InputDisturbanceID(LeastSquaresIdentifier):
    """Identification with the unmeasured heat as a random-walk state (ID, paper 2.2.2).

    A Kalman filter carries the disturbance ``zeta`` [kW] on the disturbed node; the sum of squared one-step errors,
    weighted by the variances that the filter expects, is minimised over parameters and the two noise levels.  These
    differ in the first rows, where the hidden temperatures and ``zeta`` are unknown, and after missing ones.

    Parameters
    ----------
    %(network)s
    %(search)s
    %(data)s
    %(runs)s
    measurement_sd : float, optional
        Standard deviation of the thermometer [K]; default ``0.25 / sqrt(T_s)`` with ``T_s`` in seconds, as the paper.
    %(objective)s

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        ``sigma_x`` [K] and ``sigma_zeta`` [kW] over a step.
    %(weighted_loss)s
    %(fitted)s
    """

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=50, horizon=None, warmup="1D", columns=None,
        sampling_time=None, n_jobs=None, random_state=None, verbose=0, origin_step=None, max_missing=0.5, priors=None,
        measurement_sd=None, objective: Literal["one_step", "multi_step"] = "one_step",
    ):  # fmt: skip
        store_arguments(self, locals())

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> InputRandomWalk:
        sd = self.measurement_sd
        if sd is not None and not (is_number(sd) and sd > 0):
            raise ValueError(f"measurement_sd={sd!r} must be a positive number [K].")
        return InputRandomWalk(sd)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return InputRandomWalk().own

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return scaled_innovations(self.filtered_network_, table, segment, self.noise_std_)

    def _measurement_variance(self, hours: float) -> float:
        return measurement_variance(hours, self.measurement_sd)

    def _steady_variance(self, kalman: GainFilter) -> float:
        return steady_variance(kalman)

    def _walk(self, kalman: GainFilter, experiment: Experiment) -> tuple[float, float]:
        return float(self.disturbance_["sigma_x"]), float(self.disturbance_["sigma_zeta"])
