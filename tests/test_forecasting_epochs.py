"""Compiled epochs against torch: automatic gradients, torch's Adam and clipping, and a plain loop over batches."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import torch
from torch import nn

from skhybrid.filtering.dense import ACTIVATIONS, activate, exp32
from skhybrid.forecasting import epochs, loop, nets, training
from skhybrid.forecasting.cases import NETWORKS, RECURRENT
from skhybrid.forecasting.compiled import room_of
from skhybrid.forecasting.epochs import Tables, train_epoch, validate
from skhybrid.forecasting.loop import LoopSettings, train_stack
from skhybrid.forecasting.nets import NetworkSpec, NetworkStack
from skhybrid.forecasting.windows import Windows

N_PAST, N_LEADS, N_COLUMNS = 5, 4, 3
N = 150  # more than the windows of a block


def _spec(kind, **settings):
    shape = {"n_past": N_PAST, "n_leads": N_LEADS, "n_past_columns": N_COLUMNS, "n_future_columns": N_COLUMNS}
    size = {"reads_zeta": True, "n_layers": 2, "hidden_size": 5, "activation": "relu", "dropout": 0.0}
    return NetworkSpec(**{"kind": kind} | shape | size | {"n_channels": 2, "filter_size": 3, "pool_size": 0} | settings)


def _windows(seed=0):
    g = torch.Generator().manual_seed(seed)
    shapes = {"zeta": (N_PAST + 1,), "past": (N_COLUMNS, N_PAST), "future": (N_COLUMNS, N_LEADS), "base": (N_LEADS,)}
    views = {name: torch.randn(N + 10, *shape, generator=g) for name, shape in shapes.items()}
    target = torch.randn(N + 10, N_LEADS, generator=g)
    target[torch.rand(target.shape, generator=g) < 0.1] = np.nan
    return Windows([views], [target], torch.arange(3, N + 3))


def _generators(*seeds):
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def _optimizer(stack):
    return torch.optim.Adam([stack.flat], lr=0.01)


def _epoch_of(kind, windows, batch_size, max_norm=1e9, seeds=(1, 2), **settings):
    stack = NetworkStack(_spec(kind, **settings), _generators(*seeds))
    tables, optimizer = Tables(windows, kind, stack.spec.reads_zeta), _optimizer(stack)
    return stack, optimizer, train_epoch(stack, tables, optimizer, batch_size, max_norm)


def _loss(stack, windows, rows, member):
    part = {name: value[windows.chosen[rows]][None] for name, value in windows.parts[0].items()}
    target, known = part.pop("target"), part.pop("known")
    alone = {name: value.expand(len(stack.members), *value.shape[1:]) for name, value in part.items()}
    errors = (stack(**alone)[member] - target[0]) * known[0]
    return (errors**2).sum() / known.sum(), float(known.sum())


_SETTINGS = [{}, {"reads_zeta": False, "n_layers": 1}, {"activation": "gelu"}]
_CNN = [
    {"pool_size": 4, "filter_size": 6, "reads_zeta": False},
    {"pool_size": 3, "n_channels": 5, "activation": "selu"},
    {"pool_size": 4, "n_channels": 7, "filter_size": 12, "activation": "gelu"},  # longer than what it reads at last
    {"n_channels": 2, "filter_size": 19},  # more than a tile is wide
]


@pytest.mark.parametrize(("kind", "settings"), [*product(NETWORKS, _SETTINGS), *product(["cnn"], _CNN)])
def test_an_epoch_is_a_plain_loop_over_batches_with_torch_s_gradient_and_adam(kind, settings):
    windows, batch_size, max_norm = _windows(), 40, 0.15  # the last batch is smaller; gradients are clipped
    stack, _, losses = _epoch_of(kind, windows, batch_size, max_norm, **settings)
    for member, seed in enumerate((1, 2)):
        (generator,) = _generators(seed)
        twin = NetworkStack(_spec(kind, **settings), [generator])
        order = torch.randperm(N, generator=generator)
        optimizer, squares, count, norms = _optimizer(twin), 0.0, 0.0, []
        for rows in order.split(batch_size):
            optimizer.zero_grad()
            loss, n_known = _loss(twin, windows, rows, 0)
            loss.backward()
            norms.append(float(nn.utils.clip_grad_norm_([twin.flat], max_norm)))
            optimizer.step()
            squares, count = squares + loss.item() * n_known, count + n_known
        assert max(norms) > max_norm
        assert losses[member] == pytest.approx(squares / count, rel=1e-4)
        torch.testing.assert_close(stack.flat[member], twin.flat[0], rtol=1e-3, atol=2e-5)


@pytest.mark.parametrize("kind", NETWORKS)
@pytest.mark.parametrize("activation", list(ACTIVATIONS))
def test_the_gradient_with_dropout_is_torch_s(kind, activation, monkeypatch):
    windows, share = _windows(), 0.3
    settings = {"activation": activation, "dropout": share, "hidden_size": 6}
    stack, optimizer, _ = _epoch_of(kind, windows, N, seeds=(4,), **settings)
    gradient = optimizer.state[stack.flat]["exp_avg"][0] / 0.1  # Adam's first moment behind one step
    (generator,) = _generators(4)
    twin = NetworkStack(_spec(kind, **settings), [generator])
    order = torch.randperm(N, generator=generator)
    shape = {"mlp": (2, N, 8), "cnn": (1, N, 8)}.get(kind, (N_LEADS, 8, N))
    mask = (torch.empty(shape).uniform_(generator=generator) >= share) / (1.0 - share)
    masks = iter(mask) if kind in ("mlp", "cnn") else iter([mask])
    monkeypatch.setattr(twin, "_mask", lambda *_: next(masks)[None])
    _loss(twin, windows, order, 0)[0].backward()
    assert gradient.abs().max() > 0
    torch.testing.assert_close(gradient, twin.flat.grad[0], rtol=1e-3, atol=2e-6)


@pytest.mark.parametrize("kind", NETWORKS)
def test_filling_stays_0_and_a_member_is_what_it_is_alone(kind):
    windows = _windows()
    stack, _, _ = _epoch_of(kind, windows, 32, seeds=(1, 2), dropout=0.2)
    alone, _, _ = _epoch_of(kind, windows, 32, seeds=(2,), dropout=0.2)
    assert torch.equal(stack.flat[1], alone.flat[0])
    named = stack.weights()
    for layer in (layer for layer in stack.layers if not layer.name.startswith("conv")):
        live = layer.rows[:, None] & layer.columns
        assert (named[f"{layer.name}.weight"][:, ~live] == 0).all()
        assert (named[f"{layer.name}.bias"][:, ~layer.columns] == 0).all()


@pytest.mark.parametrize("kind", NETWORKS)
def test_a_table_in_pieces_gives_the_same_numbers(kind, monkeypatch):
    windows = _windows()
    whole, _, losses = _epoch_of(kind, windows, 16, dropout=0.2)
    monkeypatch.setattr(epochs, "_MOST_NUMBERS", 40 * 16)
    monkeypatch.setattr(epochs, "_VALIDATED", 30)
    pieces = Tables(windows, kind, True)
    assert len(list(pieces.pieces(0, windows.chosen, 16))) > 3
    cut, _, again = _epoch_of(kind, windows, 16, dropout=0.2)
    assert torch.equal(whole.flat, cut.flat)
    assert again == pytest.approx(losses)
    with torch.no_grad():
        wanted = [float(_loss(whole.eval(), windows, torch.arange(N), member)[0]) for member in range(2)]
    assert validate(cut, pieces) == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize("kind", RECURRENT)
def test_what_was_left_in_the_memory_to_work_in_does_not_matter(kind):
    windows, found = _windows(), []
    for number in (None, np.nan, 3.0):
        stack = NetworkStack(_spec(kind), _generators(1, 2))
        room = room_of(kind, stack.shapes()[0], N_PAST, N_LEADS)
        room = None if number is None else np.full_like(room, number)
        tables, optimizer = Tables(windows, kind, True, room), _optimizer(stack)
        losses = [train_epoch(stack, tables, optimizer, 40, 1.0) for _ in range(2)]
        found.append((losses, validate(stack, tables), stack.flat.tolist()))
    assert np.isfinite(found[0][1]).all()
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("kind", NETWORKS)
def test_other_devices_are_trained_by_the_same_loop_of_torch_s_operators(kind, monkeypatch):
    """The loop that a GPU runs, here on the CPU: members leave it when they stop, as they leave the compiled one."""
    train = _windows()
    valid = train.choosing(torch.arange(N + 3, N + 10))
    settings = LoopSettings(0.03, 40, 40, 3)

    def found():
        return train_stack(NetworkStack(_spec(kind), _generators(1, 2, 3)), train, valid, settings)

    compiled = found()
    assert len({len(one.history) for one in compiled}) > 1
    for module in (loop, nets):
        monkeypatch.setattr(module, "DEVICE", "another")
    for one, other in zip(compiled, found(), strict=True):
        assert len(one.history) == len(other.history)
        for name in ("train_loss", "valid_loss"):
            losses = [[epoch[name] for epoch in trained.history] for trained in (one, other)]
            np.testing.assert_allclose(*losses, rtol=2e-3)
        assert one.valid_loss == pytest.approx(other.valid_loss, rel=2e-3)


def test_a_device_that_is_not_there_is_named():
    assert training.device_of("cpu") == "cpu"
    assert training.device_of("auto") == ("cuda" if torch.cuda.is_available() else "cpu")
    with pytest.raises(ValueError, match="device='abacus' is not to be had"):
        training.device_of("abacus")
    if not torch.cuda.is_available():
        with pytest.raises(ValueError, match="device='cuda' is not to be had"):
            training.device_of("cuda")


def test_exponential_and_activations_are_exact_to_single_precision():
    x = np.linspace(-87.0, 0.0, 4001, dtype=np.float32)
    np.testing.assert_allclose([exp32(value) for value in x], np.exp(x.astype(float)), rtol=3e-7)
    z = np.random.default_rng(0).normal(0.0, 3.0, (40, 25)).astype(np.float32)
    bias = np.linspace(-1.0, 1.0, 25, dtype=np.float32)
    for name, code in ACTIVATIONS.items():
        inner = torch.tensor(z.astype(float) + bias, requires_grad=True)
        wanted = getattr(nn.functional, name)(inner)
        wanted.sum().backward()
        slope, value = z.copy(), np.empty_like(z)
        activate(code, slope, bias, value)
        np.testing.assert_allclose(value, wanted.detach(), atol=2e-6)
        np.testing.assert_allclose(slope, inner.grad, atol=1e-6)
