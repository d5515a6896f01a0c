"""FleetPrior: fitted zones as a prior of a new one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

from .._arguments import is_number
from .._warnings import several, warn_user
from ..exceptions import SkhybridWarning
from ..forecasting.arx_prior import ARXPrior, ZoneEvidence, ZoneSums
from ..schedule import NetworkPrior, NetworkSums

_PSEUDO_ZONES = 5.0  # strength with which covariances are shrunk to their diagonals
_LEAST = pd.Timedelta(days=2)  # with less, regressions leave nothing, and a zone seems known for certain
_FAR = float(np.log(100.0))  # beyond it a nameplate is in another unit
_FACTOR = float(np.exp(1.645))  # of a 90 % interval, per standard deviation of a logarithm


@dataclass(frozen=True, repr=False, eq=False)
class FleetPrior(Mapping[str, tuple[float, float]]):
    """Knowledge of fitted zones for a new one that has a few days of data.

    It is learned from fitted predictors, never from their rows, and passed to a predictor as ``prior``::

        prior = FleetPrior.learn(models, sizes=nameplates)
        HybridPredictor(prior=prior.for_nameplate(8.0)).fit(three_days, three_days["T_za"])

    As a mapping it holds the median and the 90 % factor of each resistance [K/kW] and capacitance [kWh/K] of the
    network, which is what a gray box takes as ``priors``.

    Attributes
    ----------
    n_zones : int
        Zones that it was learned from.
    regressions : dict of str to ARXPrior
        Coefficients of ARX by objective.
    resistances : NetworkPrior or None
        Parameters and coefficients of the network per nameplate.
    ratio : tuple of (float, float)
        Mean and standard deviation of log(size / nameplate).
    nameplates : tuple of (float, float) or None
        Mean and standard deviation of log(nameplate); None where no sizes were given.
    nameplate : float or None
        Nameplate of the zone that it is meant for [kW].
    """

    n_zones: int
    regressions: dict[str, ARXPrior]
    resistances: NetworkPrior | None
    ratio: tuple[float, float]
    nameplates: tuple[float, float] | None
    nameplate: float | None = None

    @classmethod
    def learn(
        cls, models: Iterable[Any], sizes: Iterable[float] | None = None, names: Iterable[str] | None = None
    ) -> Self:
        """Learn from fitted zones; those that learned from less than two days are left out.

        Parameters
        ----------
        models : iterable of HybridPredictor, SchedulePredictor, ARXRegressor, or Pipelines that end with one
            Fitted on logs with the same columns and the same step, and with the same network.
        sizes : iterable of float, optional
            A nameplate of each zone: the heat of its plant [kW], or any other figure that grows as the zone does.
        names : iterable of str, optional
            What messages call the zones.

        Raises
        ------
        ValueError
            If there are fewer than two models of two days, or they or their sizes do not go together.
        """
        return cls.of_evidence([evidence_and_span(model) for model in models], sizes, names)

    @classmethod
    def of_evidence(
        cls,
        read: Sequence[tuple[ZoneEvidence, pd.Timedelta]],
        sizes: Iterable[float] | None = None,
        names: Iterable[str] | None = None,
    ) -> Self:
        """As :meth:`learn`, from what was read of each model.

        Parameters
        ----------
        read : sequence of (ZoneEvidence, Timedelta), the evidence of each zone and the span that it learned from
        sizes, names : as in :meth:`learn`
        """
        called = [f"model {i}" for i in range(len(read))] if names is None else list(names)
        log_plates = _log_sizes(sizes, called)
        kept = _long_enough([span for _, span in read], called)
        evidence, log_plates, called = [read[i][0] for i in kept], log_plates[kept], [called[i] for i in kept]
        networks = [zone.network for zone in evidence if zone.network is not None]
        if networks and len(networks) < len(evidence):
            raise ValueError("models mixes predictors with a network and ARXRegressors; give models of one kind.")
        log_sizes = np.array([n.log_size for n in networks]) if networks else log_plates
        found = {}
        for objective in ("one_step", "multi_step"):
            here = [i for i, zone in enumerate(evidence) if objective in zone.regressions]
            if len(here) > 1:
                sums = [evidence[i].regressions[objective] for i in here]
                found[objective] = _regression(sums, log_sizes[here], [called[i] for i in here])
        network = _network(networks, log_plates) if networks else None
        ratio = log_sizes - log_plates
        nameplates = None if sizes is None else _spread(log_plates)
        return cls(len(evidence), found, network, _spread(ratio), nameplates)

    def for_nameplate(self, size: float) -> Self:
        """The prior of a zone of a known size.

        Parameters
        ----------
        size : float
            Its nameplate, in the unit of the ``sizes`` that were given to :meth:`learn`.

        Raises
        ------
        ValueError
            If it is not a positive number, or no sizes were given.
        """
        if not (is_number(size) and size > 0):
            raise ValueError(f"size={size!r} must be a positive number.")
        if self.nameplates is None:
            raise ValueError(
                "this prior was learned without sizes, so that a nameplate says nothing; pass sizes to learn."
            )
        usual, spread = self.nameplates
        if abs(np.log(size) - usual) > max(_FAR, 3.0 * spread):
            warn_user(
                f"size={size:g} is far from the sizes of the fleet, {np.exp(usual):.3g} on average; check its unit.",
                SkhybridWarning,
            )
        return replace(self, nameplate=float(size))

    @property
    def arx(self) -> dict[str, ARXPrior]:
        """Prior of the coefficients of ARX, by objective."""
        (log_plate, spread), (ratio, ratio_spread) = self._log_nameplate, self.ratio
        size = log_plate + ratio, float(np.hypot(spread, ratio_spread))
        return {objective: prior.sized(*size) for objective, prior in self.regressions.items()}

    @property
    def network(self) -> NetworkPrior | None:
        """Prior of parameters and coefficients of the network with schedules; None where none was fitted."""
        return None if self.resistances is None else self.resistances.scaled(*self._log_nameplate)

    def __getitem__(self, name: str) -> tuple[float, float]:
        prior, own = self.network, list(self)
        if prior is None or name not in own:
            raise KeyError(name)
        k = prior.names.index(name)
        return float(np.exp(prior.centre[k])), float(_FACTOR ** np.sqrt(prior.covariance[k, k]))

    def __iter__(self) -> Iterator[str]:
        if self.resistances is None:
            raise ValueError(
                "this prior was learned from ARX alone and knows no network; learn it from HybridPredictors."
            )
        network = self.resistances.network
        return iter((*network.capacitances.values(), *network.resistors))

    def __len__(self) -> int:
        return len(list(iter(self)))

    @property
    def _log_nameplate(self) -> tuple[float, float]:
        if self.nameplate is not None:
            return float(np.log(self.nameplate)), 0.0
        return self.nameplates or (0.0, 0.0)

    def __repr__(self) -> str:
        plate = "" if self.nameplate is None else f", nameplate={self.nameplate:g} kW"
        return f"FleetPrior({self.n_zones} zones{plate})"


def evidence_and_span(model: Any) -> tuple[ZoneEvidence, pd.Timedelta]:
    """Evidence of a fitted zone, and the span that it learned from."""
    last = model[-1] if isinstance(model, Pipeline) else model
    found = getattr(last, "evidence_", None)
    if not isinstance(found, ZoneEvidence):
        raise ValueError(
            f"models holds a {type(last).__name__} from which no prior is learned; give fitted HybridPredictors of the "
            "schedule model, SchedulePredictors or ARXRegressors."
        )
    return found, last.training_.n_rows * last.training_.step


def _log_sizes(sizes: Iterable[float] | None, names: Sequence[str]) -> np.ndarray:
    if sizes is None:
        return np.zeros(len(names))
    given = list(sizes)
    if len(given) != len(names):
        raise ValueError(f"sizes has {len(given)} numbers for {len(names)} models; give one per model.")
    for name, size in zip(names, given, strict=True):
        if not (is_number(size) and size > 0):
            raise ValueError(f"sizes gives {name} the size {size!r}; every size must be a positive number.")
    return np.log(np.array(given, dtype=np.float64))


def _long_enough(spans: Sequence[pd.Timedelta], names: Sequence[str]) -> list[int]:
    """Numbers of the zones that learned from two days or more; the others are warned of, fewer than two refused."""
    kept = [i for i, span in enumerate(spans) if span >= _LEAST]
    if len(kept) < 2:
        raise ValueError(
            f"models holds {several(len(kept), 'zone')} that learned from two days or more; a prior needs "
            "at least two of them."
        )
    short = [name for i, name in enumerate(names) if i not in kept]
    if short:
        warn_user(
            f"{several(len(short), 'zone')} of {len(names)} learned from less than two days and are left out, "
            f"the first {short[0]}.",
            SkhybridWarning,
        )
    return kept


def _spread(values: np.ndarray) -> tuple[float, float]:
    return float(values.mean()), float(values.std(ddof=1))


def _regression(sums: Sequence[ZoneSums], log_sizes: np.ndarray, names: Sequence[str]) -> ARXPrior:
    for zone, name in zip(sums[1:], names[1:], strict=True):
        sums[0].kind.refuse_other(zone.kind, names[0], name, "zones")
    return ARXPrior.learn(sums, log_sizes, _PSEUDO_ZONES)


def _network(zones: Sequence[NetworkSums], log_plates: np.ndarray) -> NetworkPrior:
    for zone in zones[1:]:
        if zone.names != zones[0].names:
            raise ValueError(
                f"models holds the networks {zones[0].network.name} and {zone.network.name}; give models of one."
            )
    return NetworkPrior.learn(zones, log_plates, _PSEUDO_ZONES)
