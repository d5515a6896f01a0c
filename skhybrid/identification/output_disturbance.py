"""Identification with an ARMA(1,1) disturbance on the output (OD)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pandas as pd

from .._arguments import is_number, store_arguments
from .._table import ZoneTable
from ..thermal import Parameter, RCNetwork
from .base import SearchResult
from .disturbance_models import FIRST, OutputARMA, first_name, take_searched
from .experiment import Experiment
from .filtered_network import ForecastStart
from .gain_filter import GainFilter
from .least_squares import LeastSquaresIdentifier
from .one_step_errors import Innovations, arma_innovations, arma_prediction
from .shared_docs import shared_docs


@shared_docs
class OutputDisturbanceID(LeastSquaresIdentifier):
    """Identification with an ARMA(1,1) disturbance on the output (OD, paper 2.2.3).

    The network runs open loop; what the unmeasured heat does to the temperature is filtered white noise.  The sum of
    squared errors of the innovations form of Eq. 11, ``y_hat(k+1|k) = C x(k+1) + zeta(k+1)``, is minimised.  After
    missing measurements errors are weighted by their larger variance, which the gain of the predictor follows.

    Parameters
    ----------
    %(network)s
    %(search)s
    %(data)s
    %(runs)s
    rho_box : {"stable", "paper"}, default="stable"
        Search ``(rho_1, rho_1 - rho_2)``, each within (-0.999, 0.999) at a step of 15 minutes, where the predictor is
        stable; or the paper's box for ``(rho_1, rho_2)``, which also holds unstable predictors.
    %(objective)s

    Attributes
    ----------
    %(theta)s
    disturbance_ : Series
        ``rho_1``, ``rho_2`` [-] and the hidden nodes' first temperatures [degC].
    %(weighted_loss)s
    %(fitted)s
    """

    _acts_on = "output"

    def __init__(
        self, network="2R2C", *, known=None, bounds=None, n_starts=50, horizon=None, warmup="1D", columns=None,
        sampling_time=None, n_jobs=None, random_state=None, verbose=0, origin_step=None, max_missing=0.5, priors=None,
        rho_box: Literal["stable", "paper"] = "stable", objective: Literal["one_step", "multi_step"] = "one_step",
    ):  # fmt: skip
        store_arguments(self, locals())

    def _disturbance(self, network: RCNetwork, experiment: Experiment) -> OutputARMA:
        if self.rho_box not in ("stable", "paper"):
            raise ValueError(f"rho_box={self.rho_box!r} is neither 'stable' nor 'paper'.")
        for name in {p.name for p in self._own_parameters()} & {*(self.known or {})}:
            if not is_number(value := self.known[name]) or not -1.0 < value < 1.0:
                raise ValueError(f"known= gives {name} the value {value!r}; it must lie between -1 and 1.")
        hidden = tuple(node for node in network.nodes if node not in network.measured_nodes)
        firsts = tuple(float(segment.firsts.mean()) for segment in experiment.segments)
        return OutputARMA(hidden, firsts, self.rho_box == "paper", experiment.hours)

    def _own_parameters(self) -> tuple[Parameter, ...]:
        return OutputARMA((), (), self.rho_box == "paper").own

    def _is_own(self, name: str) -> bool:
        # an earlier fit has a first temperature per segment of its own table
        return super()._is_own(name) or name == "rho_2" or str(name).startswith(FIRST)

    def _store(self, found: SearchResult) -> GainFilter:
        kalman = super()._store(found)
        own = self.disturbance_
        if "rho_2" not in own:
            self.disturbance_ = pd.concat([own, pd.Series({"rho_2": own["rho_1"] - own["rho_gap"]})])
        return kalman

    def _first_state(self, smooth: Any, number: int) -> np.ndarray:
        """The fit's own first state: a measured node at its measurement, the hidden ones as they were searched."""
        state = smooth.nodes[0].copy()
        take_searched(state, self.network_, self.disturbance_, number)
        return state

    def _begin_at(self, experiment: Experiment, kalman: GainFilter) -> None:
        """First temperatures of hidden nodes as the smoother has them, for no search found those of this table."""
        own = {name: value for name, value in self.disturbance_.items() if not str(name).startswith(FIRST)}
        for number, rows in enumerate(experiment.segments):
            nodes = kalman.run(rows, kalman.cold(rows.firsts), smooth=True).nodes[0]
            for node, value in zip(self.network_.nodes, nodes, strict=True):
                if node not in self.network_.measured_nodes:
                    own[first_name(node, number)] = float(value)
        self.disturbance_ = pd.Series(own, dtype=np.float64)

    def _rows_remembered(self, outputs: np.ndarray) -> int:
        """As many as leave nothing of what the ARMA predictor knew before: a measured row leaves ``rho_1 - rho_2``."""
        share = min(abs(float(self.disturbance_["rho_1"] - self.disturbance_["rho_2"])), 1.0)
        left = np.cumprod(np.where(np.isfinite(outputs[::-1]), share, 1.0), axis=0).max(axis=1)
        enough = int(np.argmax(np.append(left, 0.0) < np.finfo(np.float64).eps)) + 1
        return max(enough, super()._rows_remembered(outputs))

    def _innovations(self, table: ZoneTable, segment: int | None) -> Innovations:
        return arma_innovations(self.filtered_network_, table, segment, dict(self.disturbance_), self.noise_std_)

    def _forecast_start(self, table: ZoneTable, origins: np.ndarray, n: int) -> ForecastStart:
        """The network open loop, and the output disturbance that decays by ``rho_1``."""
        known = self.filtered_network_
        experiment, kalman = known.experiment(table), known.kalman
        rho_1, rho_2 = float(self.disturbance_["rho_1"]), float(self.disturbance_["rho_2"])
        states = known.open_loop(experiment, known.open_start(table))
        zeta = arma_prediction(experiment.outputs - states[:-1, kalman.measured], rho_1, rho_2).states
        offset = zeta[origins + 1][:, None] * (rho_1 ** np.arange(n))[:, None]
        return ForecastStart(states[origins], np.zeros((len(origins), n, kalman.n_gains)), offset, zeta[origins])
