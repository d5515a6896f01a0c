"""The networks of a fitted forecaster one by one, and the one that validation chooses."""

from __future__ import annotations

from copy import copy

from skhybrid import HybridPredictor


def single_networks(model: HybridPredictor) -> list[HybridPredictor]:
    """A predictor for each network of one whose forecaster averages several; the networks share all else."""
    found = []
    for i in range(int(model.forecaster_.repeats_["used"].sum())):
        alone, scheme, forecaster = copy(model), copy(model._scheme), copy(model.forecaster_)
        forecaster._network = copy(forecaster._network)
        weights = model.forecaster_._network.weights
        forecaster._network.weights = {name: value[i : i + 1] for name, value in weights.items()}
        scheme.forecaster_ = forecaster
        alone._scheme = scheme
        found.append(alone)
    return found


def chosen_network(model: HybridPredictor, each: list[HybridPredictor]) -> HybridPredictor:
    """The network with the lowest validation error: what ``repeats="best"`` keeps."""
    return each[int(model.forecaster_.repeats_["valid_loss"].to_numpy().argmin())]
