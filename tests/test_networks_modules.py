"""The stacked networks against plain loops of their equations and against torch's own layers."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from skhybrid.forecasting.networks.fitted import make_stack
from skhybrid.forecasting.networks.recurrent import LSTMStep, RNNStep, doubled_for_tanh
from skhybrid.forecasting.networks.spec import NetworkSpec
from skhybrid.forecasting.networks.training import WindowBatches, draw_kept
from skhybrid.forecasting.networks.windows import Windows, WindowTable, WindowViews, network_inputs, padded_windows


def _spec(kind, **settings):
    shape = {"n_past": 6, "n_leads": 4, "n_past_columns": 3, "n_future_columns": 3, "reads_zeta": True}
    size = {"n_layers": 2, "hidden_size": 5, "activation": "relu", "dropout": 0.0}
    cnn = {"n_channels": 2, "filter_size": 3, "pool_size": 0}
    return NetworkSpec(**({"kind": kind} | shape | size | cnn | settings))


def _generators(*seeds):
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def _stack(specs, *seeds, corrects=False):
    """A stack of networks with a seed each; one spec is that of all."""
    specs = specs if isinstance(specs, list) else [specs] * len(seeds)
    return make_stack(specs).draw_weights(_generators(*seeds), corrects)


def _windows(spec, n_networks=2, n=7, seed=0):
    g = torch.Generator().manual_seed(seed)
    shapes = {
        "zeta": (n_networks, n, spec.n_past + 1),
        "past": (n_networks, n, spec.n_past_columns, spec.n_past),
        "future": (n_networks, n, spec.n_future_columns, spec.n_leads),
        "base": (n_networks, n, spec.n_leads),
    }
    return {name: torch.randn(shape, generator=g) for name, shape in shapes.items()}


def _inputs(spec, windows):
    read = [windows[name] for name in ("zeta", "past", "future")]
    return {"inputs": network_inputs(spec.kind, spec.reads_zeta, *read), "base": windows["base"]}


def _weights(stack, row):
    return {name: values[row].detach() for name, values in stack.weights().items()}


def _forecast(stack, windows):
    with torch.no_grad():
        return stack(**_inputs(stack.spec, windows))


# ------------------------------------------------------------------------------------------------------- the equations
def _sigmoid(v):
    return 1.0 / (1.0 + np.exp(-v))


def _cell(kind, gates, c):
    if kind == "rnn":
        return np.tanh(gates), c
    i, f, o, g = np.split(gates, 4)
    c = _sigmoid(f) * c + _sigmoid(i) * np.tanh(g)
    return _sigmoid(o) * np.tanh(c), c


def _plain_loop(spec, weights, zeta, past, future, base):
    """Paper Eqs. 21 and 22 for one window, step by step."""
    h, c = np.zeros((2, spec.n_layers, spec.hidden_size))
    outputs = []
    for k in range(spec.n_past + spec.n_leads):
        lead = k - spec.n_past
        before = zeta[k] if lead <= 0 else outputs[-1]  # zeta(k - 1): measured up to the origin
        columns = past[:, k] if lead < 0 else future[:, lead]
        x = np.append(before, columns) if spec.reads_zeta else columns
        for i in range(spec.n_layers):
            gates = weights[f"cell{i}.weight"] @ np.append(x, h[i]) + weights[f"cell{i}.bias"]
            h[i], c[i] = _cell(spec.kind, gates, c[i])
            x = h[i]
        if lead >= 0:
            z = np.maximum(weights["hidden.weight"] @ x + weights["hidden.bias"], 0.0)
            outputs.append(base[lead] + (weights["out.weight"] @ z + weights["out.bias"])[0])
    return outputs


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
@pytest.mark.parametrize("reads_zeta", [True, False])
def test_decoding_is_the_plain_loop_of_the_paper_s_equation(kind, reads_zeta):
    spec = _spec(kind, reads_zeta=reads_zeta)
    stack, windows = _stack(spec, 1, 2), _windows(spec)
    got = _forecast(stack, windows)
    for row in range(2):
        weights = {name: value.double().numpy() for name, value in _weights(stack, row).items()}
        for w in range(3):
            window = [windows[name][row, w].double().numpy() for name in ("zeta", "past", "future", "base")]
            np.testing.assert_allclose(got[row, w], _plain_loop(spec, weights, *window), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
def test_the_cell_is_torch_s_own(kind):
    """nn.RNN and nn.LSTM, to which the paper refers, have gates in the order i, f, g, o and a second bias."""
    spec = _spec(kind, n_layers=1, hidden_size=4)
    stack, windows = _stack(spec, 1), _windows(spec, n_networks=1)
    weights = _weights(stack, 0)
    order = torch.arange(16).view(4, 4)[[0, 1, 3, 2]].flatten() if kind == "lstm" else torch.arange(4)
    cell = (nn.RNN if kind == "rnn" else nn.LSTM)(4, 4, batch_first=True)
    with torch.no_grad():
        cell.weight_ih_l0.copy_(weights["cell0.weight"][order, :4])
        cell.weight_hh_l0.copy_(weights["cell0.weight"][order, 4:])
        cell.bias_ih_l0.copy_(weights["cell0.bias"][order])
        cell.bias_hh_l0.zero_()
        x = torch.cat([windows["zeta"][0, :, :-1, None], windows["past"][0].transpose(1, 2)], dim=2)
        first = torch.cat([windows["zeta"][0, :, -1:], windows["future"][0, :, :, 0]], dim=1)
        h = cell(torch.cat([x, first[:, None]], dim=1))[0][:, -1]
        head = _linear(weights, "out")(torch.relu(_linear(weights, "hidden")(h)))
        wanted = windows["base"][0, :, 0] + head[:, 0]
    np.testing.assert_allclose(_forecast(stack, windows)[0, :, 0], wanted, atol=1e-6)


_TORCH = {"relu": nn.ReLU(), "selu": nn.SELU(), "gelu": nn.GELU()}


def _linear(weights, name):
    weight = weights[f"{name}.weight"]
    layer = nn.Linear(*weight.T.shape)
    layer.load_state_dict({"weight": weight, "bias": weights[f"{name}.bias"]})
    return layer


def _psi(windows, row):
    return torch.cat([windows["zeta"][row][:, 1:], *(windows[n][row].flatten(1) for n in ("past", "future"))], dim=1)


@pytest.mark.parametrize("activation", list(_TORCH))
def test_mlp_is_the_paper_s_equation(activation):
    spec = _spec("mlp", n_future_columns=2, activation=activation, n_leads=5)
    stack, windows = _stack(spec, 1, 2), _windows(spec)
    got = _forecast(stack, windows)
    for row in range(2):
        weights = _weights(stack, row)
        names = ["hidden0", "hidden1", "out"]
        layers = [layer for name in names for layer in (_linear(weights, name), _TORCH[activation])][:-1]
        with torch.no_grad():
            wanted = windows["base"][row] + nn.Sequential(*layers)(_psi(windows, row))
        np.testing.assert_allclose(got[row], wanted, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("pool_size", [0, 4, 100])
@pytest.mark.parametrize("filter_size", [6, 3])
def test_cnn_is_the_paper_s_equation(filter_size, pool_size):
    """One convolution more than layers, each followed by the pool (where the vector is long enough) and phi."""
    spec = _spec("cnn", filter_size=filter_size, pool_size=pool_size)
    stack, windows = _stack(spec, 1, 2), _windows(spec)
    got = _forecast(stack, windows)
    for row in range(2):
        weights = _weights(stack, row)
        z = _psi(windows, row)[:, None]
        with torch.no_grad():
            for i in range(3):
                conv = nn.Conv1d(1 if i == 0 else 2, 2, filter_size, padding=filter_size // 2)
                conv.load_state_dict({"weight": weights[f"conv{i}.weight"], "bias": weights[f"conv{i}.bias"]})
                z = conv(z)
                z = torch.relu(nn.MaxPool1d(pool_size)(z) if 1 < pool_size <= z.shape[2] else z)
            head = nn.Sequential(nn.Flatten(), _linear(weights, "hidden"), nn.ReLU(), _linear(weights, "out"))
            wanted = windows["base"][row] + head(z)
        np.testing.assert_allclose(got[row], wanted, rtol=1e-4, atol=1e-5)


# --------------------------------------------------------------------------------------------------- weights, dropout
@pytest.mark.parametrize("kind", ["mlp", "cnn", "rnn", "lstm"])
@pytest.mark.parametrize("hidden_size", [50, 52])
def test_initial_weights_are_torch_s_default_from_each_network_s_generator(kind, hidden_size):
    torch.manual_seed(0)
    before = torch.get_rng_state()
    stack = _stack(_spec(kind, hidden_size=hidden_size), 1, 2, 1)
    assert torch.equal(torch.get_rng_state(), before)
    assert torch.equal(stack.flat[0], stack.flat[2])
    weights, other = _weights(stack, 0), _weights(stack, 1)
    for layer in stack.layers:
        bound = layer.fan_in**-0.5
        for part in ("weight", "bias"):
            values = weights[f"{layer.name}.{part}"]
            assert not torch.equal(values, other[f"{layer.name}.{part}"])
            assert values.abs().max() <= bound
        assert weights[f"{layer.name}.weight"].abs().max() > 0.6 * bound
    n = hidden_size
    assert [layer.fan_in for layer in stack.layers] == {
        "mlp": [6 * 4 + 4 * 3, n, n],
        "cnn": [3, 6, 6, 2 * 36, n],
        "rnn": [n, n, n, n],
        "lstm": [n, n, n, n],
    }[kind]


def test_the_draws_of_a_seed_are_those_of_widths_rounded_up_to_four():
    """Networks of a seed stay what they were when weights were stored in multiples of four."""
    weights = _weights(_stack(_spec("rnn", n_layers=1, hidden_size=5), 7), 0)
    (g,) = _generators(7)

    def drawn(bound, *shape):
        return torch.empty(*shape).uniform_(-bound, bound, generator=g)

    cell = drawn(5**-0.5, 4 + 8, 8)
    assert torch.equal(weights["cell0.weight"], torch.cat([cell[:4, :5], cell[4:9, :5]]).T)
    assert torch.equal(weights["cell0.bias"], drawn(5**-0.5, 8)[:5])
    assert torch.equal(weights["hidden.weight"], drawn(5**-0.5, 8, 8)[:5, :5].T)
    drawn(5**-0.5, 8)
    assert torch.equal(weights["out.weight"], drawn(5**-0.5, 8, 4)[:5, :1].T)


MIXED = [{"activation": "relu"}, {"activation": "gelu", "dropout": 0.3}, {"activation": "selu", "dropout": 0.1}]


@pytest.mark.parametrize("kind", ["mlp", "cnn", "rnn", "lstm"])
def test_a_network_s_forecast_and_gradient_are_the_same_alone_and_in_a_stack(kind):
    specs = [_spec(kind, **settings) for settings in MIXED]
    windows = _windows(specs[0], n_networks=3, n=32)
    stack = _stack(specs, 1, 2, 3)
    kept = draw_kept(stack, 32, _generators(4, 5, 6))
    together = stack(**_inputs(specs[0], windows), kept=kept)
    (together**2).sum().backward()
    for row, spec in enumerate(specs):
        alone = _stack(spec, row + 1)
        own = {name: values[row : row + 1] for name, values in _inputs(spec, windows).items()}
        dropped = draw_kept(alone, 32, _generators(row + 4))
        found = alone(**own, kept=None if dropped is None else dropped)
        (found**2).sum().backward()
        assert alone.flat.grad.abs().max() > 0
        torch.testing.assert_close(together[row : row + 1], found, rtol=1e-5, atol=1e-6)
        torch.testing.assert_close(stack.flat.grad[row : row + 1], alone.flat.grad, rtol=1e-4, atol=1e-4)


def test_networks_of_unequal_shape_share_no_stack():
    with pytest.raises(ValueError, match="equal shape"):
        make_stack([_spec("mlp"), _spec("mlp", hidden_size=6)])
    with pytest.raises(ValueError, match="equal shape"):
        make_stack([_spec("lstm", n_layers=1), _spec("lstm", n_layers=2)])
    with pytest.raises(ValueError, match="deepest networks of a stack must come last"):
        make_stack([_spec("mlp", n_layers=2), _spec("mlp", n_layers=1)])


def test_dropout_drops_its_share_and_rescales():
    before = torch.get_rng_state()
    stack = _stack([_spec("mlp", dropout=share) for share in (0.4, 0.4, 0.0)], 0, 1, 2)
    found = draw_kept(stack, 4000, _generators(0, 1, 2))
    assert found.shape == (3, 2, 5, 4000)
    for factors in found[:2]:
        assert float((factors == 0).float().mean()) == pytest.approx(0.4, abs=0.02)
        assert float(factors.mean()) == pytest.approx(1.0, abs=0.02)
    assert not torch.equal(found[0], found[1])
    assert (found[2] == 1).all()
    assert draw_kept(_stack(_spec("mlp"), 0), 40, _generators(0)) is None
    assert torch.equal(torch.get_rng_state(), before)


@pytest.mark.parametrize("kind", ["mlp", "cnn", "rnn", "lstm"])
def test_a_correction_begins_at_the_baseline(kind):
    windows = _windows(_spec(kind))
    assert torch.equal(_forecast(_stack(_spec(kind), 1, 2, corrects=True), windows), windows["base"])


# --------------------------------------------------------------------------------------------------- windows, batches
def _table(values, target=None):
    """A table of an MLP that reads one number per window."""
    views = WindowViews(
        torch.stack([values, values], dim=1), values[:, None, None][:, :0], values[:, None, None][:, :0]
    )
    return WindowTable("mlp", True, views, torch.zeros(len(values), 1), values[:, None] if target is None else target)


def test_batches_are_slices_of_the_chosen_windows():
    values = torch.arange(200.0)
    target = values[:, None].clone()
    target[60] = np.nan
    windows, stack = Windows([_table(values, target)], torch.arange(50, 150)), _stack(_spec("mlp", dropout=0.5), 0, 1)
    plain = list(WindowBatches(windows, 70, stack))
    assert [target.shape for _, target in plain] == [(2, 70, 1), (2, 30, 1)]
    assert all("kept" not in inputs for inputs, _ in plain)
    assert torch.cat([inputs["inputs"][1, :, 0] for inputs, _ in plain]).tolist() == list(range(50, 150))
    for inputs, target in plain:
        known = torch.isfinite(target)
        assert (~known).sum() == 2 * (60 in inputs["inputs"][0])
        assert torch.equal(target[known], inputs["inputs"][known])
    shuffled = WindowBatches(windows, 70, stack, _generators(0, 1))
    one, two = (torch.cat([inputs["inputs"][..., 0] for inputs, _ in shuffled], dim=1).tolist() for _ in range(2))
    for order in (*one, *two):
        assert sorted(order) == list(range(50, 150))
    assert one != two
    assert one[0] != one[1]


def test_networks_of_several_tables_read_their_own():
    first, second = (Windows([_table(torch.full((40,), float(i)))], torch.arange(40)) for i in range(2))
    windows, stack = Windows.joined([first, second, second, first, second]), _stack(_spec("mlp"), 0, 1, 2, 3, 4)
    assert len(windows.tables) == 2
    stack.keep([0, 2, 3, 4])
    for generators in (None, _generators(0, 1, 2, 3, 4)):
        ((inputs, target),) = WindowBatches(windows, 64, stack, generators)
        for found in (inputs["inputs"], target):
            assert found[..., 0].unique(dim=1).flatten().tolist() == [0.0, 1.0, 0.0, 1.0]


def test_a_table_too_large_for_memory_is_cut_batch_by_batch(monkeypatch):
    from skhybrid.forecasting.networks import windows as module

    g = torch.Generator().manual_seed(0)
    views = WindowViews(*(torch.randn(30, *shape, generator=g) for shape in ((7,), (3, 6), (3, 4))))
    for kind in ("mlp", "lstm"):
        found = []
        for limit in (10**9, 1):
            monkeypatch.setattr(module, "_MOST_IN_MEMORY", limit)
            table = WindowTable(kind, True, views, torch.zeros(30, 4), torch.zeros(30, 4))
            found.append(table.inputs(torch.tensor([3, 29, 0])))
        assert torch.equal(*found)


def test_windows_are_runs_of_padded_rows():
    values = np.arange(12.0).reshape(6, 2)
    windows = padded_windows(values, 2, 1, 3)
    padded = np.vstack([np.zeros((2, 2)), values, np.zeros((1, 2))])
    wanted = np.array([padded[i : i + 3].T for i in range(7)])
    np.testing.assert_array_equal(windows, wanted)
    np.testing.assert_array_equal(padded_windows(values[:, 0], 2, 1, 3), wanted[:, 0])


# ---------------------------------------------------------------------------------------------- the written gradients
@pytest.mark.parametrize(("step", "n_gates"), [(RNNStep, 1), (LSTMStep, 4)])
def test_the_written_gradient_of_a_step_is_that_of_finite_differences(step, n_gates):
    g = torch.Generator().manual_seed(0)
    shapes = ((2, n_gates * 3, 5), (2, 5, 4), (2, 3, 4))
    given = [torch.randn(*shape, generator=g, dtype=torch.float64, requires_grad=True) for shape in shapes]
    assert torch.autograd.gradcheck(lambda weight, z, c: step.apply(weight, doubled_for_tanh(weight, 3), z, c), given)


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
@pytest.mark.parametrize("reads_zeta", [True, False])
@pytest.mark.parametrize("activation", list(_TORCH))
def test_the_gradient_of_decoding_is_that_of_the_plain_loop(kind, reads_zeta, activation):
    spec = _spec(kind, reads_zeta=reads_zeta, activation=activation, dropout=0.3, hidden_size=4)
    stack, windows = _stack(spec, 1, 2), _windows(spec)
    aim = torch.randn(2, 7, spec.n_leads, generator=_generators(0)[0])
    kept = draw_kept(stack, 7, _generators(3, 4))
    ((stack(**_inputs(spec, windows), kept=kept) - aim) ** 2).sum().backward()
    twin = _stack(spec, 1, 2)
    weights, loss = twin.weights(), 0.0
    for row in range(2):
        named = {name: values[row] for name, values in weights.items()}
        for w in range(7):
            window = [windows[name][row, w] for name in ("zeta", "past", "future", "base")]
            found = _differentiable_loop(spec, named, kept[row, :, :, w], _TORCH[activation], *window)
            loss = loss + ((found - aim[row, w]) ** 2).sum()
    loss.backward()
    assert twin.flat.grad.abs().max() > 0
    torch.testing.assert_close(stack.flat.grad, twin.flat.grad, rtol=1e-4, atol=1e-5)


def _differentiable_loop(spec, weights, mask, phi, zeta, past, future, base):
    """The plain loop above in torch, with dropout."""
    n = spec.hidden_size
    h, c = [[torch.zeros(n)] * spec.n_layers for _ in range(2)]
    outputs = []
    for k in range(spec.n_past + spec.n_leads):
        lead = k - spec.n_past
        before = zeta[k] if lead <= 0 else outputs[-1]
        columns = past[:, k] if lead < 0 else future[:, lead]
        x = torch.cat([before[None], columns]) if spec.reads_zeta else columns
        for i in range(spec.n_layers):
            gates = weights[f"cell{i}.weight"] @ torch.cat([x, h[i]]) + weights[f"cell{i}.bias"]
            if spec.kind == "rnn":
                h[i] = torch.tanh(gates)
            else:
                i_gate, f_gate, o_gate, g = gates.split(n)
                c[i] = torch.sigmoid(f_gate) * c[i] + torch.sigmoid(i_gate) * torch.tanh(g)
                h[i] = torch.sigmoid(o_gate) * torch.tanh(c[i])
            x = h[i]
        if lead >= 0:
            z = phi(weights["hidden.weight"] @ x + weights["hidden.bias"]) * mask[lead]
            outputs.append(base[lead] + (weights["out.weight"] @ z + weights["out.bias"])[0])
    return torch.stack(outputs)
