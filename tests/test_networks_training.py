"""Training of a stack against a plain loop of batches with torch's automatic gradients, clipping and Adam."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import torch
from torch import nn

from skhybrid.forecasting.cases import NETWORKS
from skhybrid.forecasting.networks import training
from skhybrid.forecasting.networks.fitted import make_stack
from skhybrid.forecasting.networks.jobs import torch_device
from skhybrid.forecasting.networks.spec import NetworkSpec
from skhybrid.forecasting.networks.training import TrainingSettings, draw_kept, train_stack
from skhybrid.forecasting.networks.windows import Windows, WindowTable, WindowViews

N_PAST, N_LEADS, N_COLUMNS, N = 5, 4, 3, 150


def _spec(kind, **settings):
    shape = {"n_past": N_PAST, "n_leads": N_LEADS, "n_past_columns": N_COLUMNS, "n_future_columns": N_COLUMNS}
    size = {"reads_zeta": True, "n_layers": 2, "hidden_size": 5, "activation": "relu", "dropout": 0.0}
    return NetworkSpec(**{"kind": kind} | shape | size | {"n_channels": 2, "filter_size": 3, "pool_size": 0} | settings)


def _windows(spec, seed=0, unknown=0.1):
    """Windows to train on, of which a share of the targets is unknown, and windows that validate."""
    g = torch.Generator().manual_seed(seed)
    shapes = ((N_PAST + 1,), (N_COLUMNS, N_PAST), (N_COLUMNS, N_LEADS), (N_LEADS,), (N_LEADS,))
    *views, base, target = (torch.randn(N + 10, *shape, generator=g) for shape in shapes)
    target[torch.rand(target.shape, generator=g) < unknown] = np.nan
    table = WindowTable(spec.kind, spec.reads_zeta, WindowViews(*views), base, target)
    return Windows([table], torch.arange(3, N + 3)), Windows([table], torch.arange(N + 3, N + 10))


def _generators(*seeds):
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def _trained(specs, seeds, settings, validates=False, unknown=0.1):
    train, valid = _windows(specs[0], unknown=unknown)
    generators = _generators(*seeds)
    stack = make_stack(specs).draw_weights(generators)
    return train_stack(stack, generators, train, valid if validates else None, settings)


def _loss(stack, windows, rows, kept):
    """Mean squared error of a stack of one, and how many targets are known."""
    inputs, target = windows.take(windows.chosen[rows][None], [0])
    factors = {} if kept is None else {"kept": kept}
    known = torch.isfinite(target)
    return ((stack(**inputs, **factors) - target)[known] ** 2).mean(), int(known.sum())


def _plain_loop(spec, seed, settings, max_norm, unknown):
    """Weights, losses and largest gradient norm of one network after a loop that one would write."""
    (generator,) = _generators(seed)
    twin, (windows, _) = make_stack([spec]).draw_weights([generator]), _windows(spec, unknown=unknown)
    optimizer, losses, norms = torch.optim.Adam([twin.flat], lr=settings.learning_rate), [], []
    for _ in range(settings.max_epochs):
        order, squares, count = torch.randperm(N, generator=generator), 0.0, 0
        kept = draw_kept(twin, N, [generator])
        for start in range(0, N, settings.batch_size):
            part = slice(start, start + settings.batch_size)
            optimizer.zero_grad()
            loss, n_known = _loss(twin, windows, order[part], None if kept is None else kept[..., part])
            loss.backward()
            norms.append(float(nn.utils.clip_grad_norm_([twin.flat], max_norm)))
            optimizer.step()
            squares, count = squares + loss.item() * n_known, count + n_known
        losses.append(squares / count)
    return {name: values[0] for name, values in twin.weights().items()}, losses, max(norms)


_SETTINGS = [{}, {"reads_zeta": False, "n_layers": 1, "dropout": 0.3}, {"activation": "gelu", "dropout": 0.1}]
_CNN = [
    {"pool_size": 4, "filter_size": 6, "reads_zeta": False},
    {"pool_size": 3, "n_channels": 5, "activation": "selu", "dropout": 0.2},
    {"pool_size": 4, "n_channels": 7, "filter_size": 12, "activation": "gelu"},  # longer than its last input
    {"n_channels": 2, "filter_size": 19},
]


@pytest.mark.parametrize(
    ("kind", "changes", "unknown"),
    [*product(NETWORKS, _SETTINGS, [0.1]), *product(["cnn"], _CNN, [0.1]), *product(["mlp", "lstm"], _SETTINGS, [0.0])],
)
def test_training_is_a_plain_loop_over_batches(kind, changes, unknown, monkeypatch):
    max_norm = 0.15
    monkeypatch.setattr(training, "_MAX_NORM", max_norm)
    spec, settings = _spec(kind, **changes), TrainingSettings(0.01, 40, 2, 10)  # the last batch is smaller
    for seed, found in zip((1, 2), _trained([spec] * 2, (1, 2), settings, unknown=unknown), strict=True):
        weights, losses, norm = _plain_loop(spec, seed, settings, max_norm, unknown)
        assert norm > max_norm  # gradients are clipped
        assert [epoch["train_loss"] for epoch in found.history] == pytest.approx(losses, rel=1e-4)
        assert np.isnan(found.valid_loss)
        for name, values in weights.items():
            torch.testing.assert_close(found.weights[name], values, rtol=1e-3, atol=5e-5)


MIXED = [{"activation": "relu"}, {"activation": "gelu", "dropout": 0.3}, {"activation": "selu", "dropout": 0.1}, {}]


DEPTHS = [{"n_layers": 1, "dropout": 0.3}, {"n_layers": 1}, {"n_layers": 2, "activation": "selu"}]
DEPTHS += [{"n_layers": 4, "activation": "gelu", "dropout": 0.1}]


@pytest.mark.parametrize(("kind", "mixed"), [*product(NETWORKS, [MIXED]), ("mlp", DEPTHS), ("mlp", DEPTHS[:3])])
def test_a_network_is_the_same_alone_and_in_a_stack(kind, mixed):
    """Others beside it, for an MLP also of other depths, and those that leave earlier, change rounding only."""
    specs, settings = [_spec(kind, **changes) for changes in mixed], TrainingSettings(0.02, 40, 12, 3)
    together = _trained(specs, range(1, len(specs) + 1), settings, validates=True)
    assert len({len(one.history) for one in together}) > 1  # they stop one by one
    for seed, (spec, found) in enumerate(zip(specs, together, strict=True), start=1):
        (alone,) = _trained([spec], (seed,), settings, validates=True)
        assert len(found.history) == len(alone.history)
        for name in ("train_loss", "valid_loss"):
            losses = [[epoch[name] for epoch in one.history] for one in (found, alone)]
            np.testing.assert_allclose(*losses, rtol=1e-4)
        assert found.valid_loss == pytest.approx(alone.valid_loss, rel=1e-4)
        assert list(found.weights) == list(alone.weights)
        for name, values in alone.weights.items():
            torch.testing.assert_close(found.weights[name], values, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("kind", NETWORKS)
def test_the_kept_weights_are_those_of_the_lowest_validation_error(kind):
    spec, settings = _spec(kind), TrainingSettings(0.03, 40, 40, 3)
    _, valid = _windows(spec)
    for found in _trained([spec] * 3, (1, 2, 3), settings, validates=True):
        losses = [epoch["valid_loss"] for epoch in found.history]
        assert [epoch["epoch"] for epoch in found.history] == list(range(1, len(losses) + 1))
        best = 0
        for epoch, loss in enumerate(losses):
            best = epoch if loss < losses[best] * (1.0 - 1e-4) else best  # a smaller gain does not count
        assert len(losses) == min(best + 1 + settings.patience, settings.max_epochs)
        stack = make_stack([spec]).set_weights({name: values[None] for name, values in found.weights.items()})
        with torch.no_grad():
            loss, _ = _loss(stack, valid, torch.arange(len(valid)), None)
        assert found.valid_loss == pytest.approx(losses[best]) == pytest.approx(float(loss), rel=1e-4)


def test_a_device_that_cannot_be_used_is_named():
    assert torch_device("cpu") == "cpu"
    assert torch_device("auto") == ("cuda" if torch.cuda.is_available() else "cpu")
    with pytest.raises(ValueError, match="device='abacus' cannot be used here"):
        torch_device("abacus")
    if not torch.cuda.is_available():
        with pytest.raises(ValueError, match="device='cuda' cannot be used here"):
            torch_device("cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
@pytest.mark.parametrize("kind", NETWORKS)
def test_a_gpu_trains_the_same_network(kind):
    spec = _spec(kind)  # nothing drops: generators of another device draw other numbers
    settings = TrainingSettings(0.01, N, 3, 10)  # one batch, whose order does not matter
    one, other = (_trained([spec], (1,), settings._replace(device=device)) for device in ("cpu", "cuda"))
    for name, values in one[0].weights.items():
        torch.testing.assert_close(other[0].weights[name], values, rtol=1e-3, atol=1e-4)
