"""Conventional identification: simulation errors, no disturbance (CONV)."""

from __future__ import annotations

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._time import rows_covering, spell
from .._warnings import warn_user
from ..exceptions import ExcitationWarning
from ..thermal import RCNetwork
from .disturbance_models import Conventional
from .experiment import Experiment
from .filtered_network import ForecastStart
from .gain_filter import GainFilter, without_disturbance
from .least_squares import LeastSquaresIdentifier
from .one_step_errors import Innovations, simulation_errors
from .shared_docs import shared_docs

_LEAST_TOLD = pd.Timedelta("1D")  # of less than two days of rows it is told that they are few


@shared_docs
class GrayBoxRC(LeastSquaresIdentifier):
    """Conventional gray box: simulation errors, no disturbance (CONV, paper 2.2.1).

    A Kalman filter over the first day sets the state, then the network is simulated; the sum of squared simulation
    errors is minimised within bounds from many random starts.  Missing measurements are left out of the sum.

    Parameters
    ----------
    %(network)s
    %(search)s
    %(data)s
    %(runs)s
    %(objective)s

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        Empty: there is no disturbance model.
    loss_ : float
        Sum of squared errors [K2].
    noise_std_ : float
        Standard deviation of the errors [K].
    %(fitted)s

    Examples
    --------
    >>> from skhybrid import GrayBoxRC
    >>> from skhybrid.datasets import make_office
    >>> office = make_office(n_days=4, random_state=0)
    >>> model = GrayBoxRC(known=office.theta).fit(office.X, office.y)
    >>> float(model.theta_["C_za"])
    1.0
    """

    _has_disturbance = False

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> Conventional:
        step = pd.Timedelta(hours=experiment.hours)
        setting = Conventional(rows_covering(self.warmup, step))
        longest = int(np.diff([*experiment.breaks, len(experiment.y)]).max())
        used = setting.filtered(longest)
        if used < setting.warmup_rows and used * step >= _LEAST_TOLD:
            warn_user(
                f"{type(self).__name__}: warmup={self.warmup!r} is more than half of the {spell(longest * step)} of "
                f"rows without a gap, so only {spell(used * step)} set the first state; give a shorter one, or more "
                "rows.",
                ExcitationWarning,
            )
        return setting

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return simulation_errors(self.filtered_network_, table, self._warmup_rows, self.noise_std_)

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The state from a Kalman filter over the last warm-up before each origin; no disturbance."""
        known, span = self.filtered_network_, self._warmup_rows
        kalman, experiment = known.kalman, known.experiment(table)
        free_run = known.open_loop(experiment, known.open_start(table))
        plain = without_disturbance(kalman, experiment.hours)
        states = [_state_at(plain, experiment, free_run, int(origin), span) for origin in origins]
        return ForecastStart.of_heat(
            np.array(states), np.zeros((len(origins), n, kalman.n_gains)), len(kalman.measured)
        )


def _state_at(plain: GainFilter, experiment: Experiment, free_run: np.ndarray, origin: int, span: int) -> np.ndarray:
    """Filtered over the warm-up before the origin; simulated where nothing was measured in it."""
    first = max(0, origin + 1 - span)
    last = experiment.rows(slice(first, origin + 1))
    if not np.isfinite(last.y).any():
        return free_run[origin]
    begin = plain.cold(last.firsts)
    if first == 0:
        begin = begin._replace(mean=np.append(free_run[0], np.zeros(plain.n_gains)))
    return plain.run(last, begin).nodes[-1]
