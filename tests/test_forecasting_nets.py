"""The stacked networks against plain loops of their equations and against torch's own layers."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from skhybrid.forecasting.nets import NetworkSpec, NetworkStack
from skhybrid.forecasting.windows import Batches, Windows, padded_windows


def _spec(kind, **settings):
    shape = {"n_past": 6, "n_leads": 4, "n_past_columns": 3, "n_future_columns": 3, "reads_zeta": True}
    size = {"n_layers": 2, "hidden_size": 5, "activation": "relu", "dropout": 0.0}
    cnn = {"n_channels": 2, "filter_size": 3, "pool_size": 0}
    return NetworkSpec(**({"kind": kind} | shape | size | cnn | settings))


def _generators(*seeds):
    return [torch.Generator().manual_seed(seed) for seed in seeds]


def _inputs(spec, n_members=2, n=7, seed=0):
    g = torch.Generator().manual_seed(seed)
    shapes = {
        "zeta": (n_members, n, spec.n_past + 1),
        "past": (n_members, n, spec.n_past_columns, spec.n_past),
        "future": (n_members, n, spec.n_future_columns, spec.n_leads),
        "base": (n_members, n, spec.n_leads),
    }
    return {name: torch.randn(shape, generator=g) for name, shape in shapes.items()}


def _weights(stack, member):
    """Weights of a member by name, without the filling, and how many numbers filling has that are not 0."""
    named, filling = {}, 0
    for layer in stack.layers:
        weight, bias = (stack.weights()[f"{layer.name}.{part}"][member].detach() for part in ("weight", "bias"))
        if not layer.name.startswith("conv"):
            live = layer.rows[:, None] & layer.columns
            filling += int((weight[~live] != 0).sum()) + int((bias[~layer.columns] != 0).sum())
            weight, bias = weight[layer.rows][:, layer.columns], bias[layer.columns]
        named[f"{layer.name}.weight"], named[f"{layer.name}.bias"] = weight, bias
    return named, filling


def _forecast(stack, inputs):
    with torch.no_grad():
        return stack.eval()(**inputs)


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
    """Paper Eqs. RNN and LSTM for one window, step by step."""
    h, c = np.zeros((2, spec.n_layers, spec.hidden_size))
    outputs = []
    for k in range(spec.n_past + spec.n_leads):
        lead = k - spec.n_past
        before = zeta[k] if lead <= 0 else outputs[-1]  # zeta(k - 1): measured up to the origin
        columns = past[:, k] if lead < 0 else future[:, lead]
        x = np.append(before, columns) if spec.reads_zeta else columns
        for i in range(spec.n_layers):
            gates = np.append(x, h[i]) @ weights[f"cell{i}.weight"] + weights[f"cell{i}.bias"]
            h[i], c[i] = _cell(spec.kind, gates, c[i])
            x = h[i]
        if lead >= 0:
            z = np.maximum(x @ weights["hidden.weight"] + weights["hidden.bias"], 0.0)
            outputs.append(base[lead] + (z @ weights["out.weight"] + weights["out.bias"])[0])
    return outputs


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
@pytest.mark.parametrize("reads_zeta", [True, False])
def test_decoding_is_the_plain_loop_of_the_paper_s_equation(kind, reads_zeta):
    spec = _spec(kind, reads_zeta=reads_zeta)
    stack, inputs = NetworkStack(spec, _generators(1, 2)), _inputs(spec)
    got = _forecast(stack, inputs)
    for member in range(2):
        weights = {name: value.double().numpy() for name, value in _weights(stack, member)[0].items()}
        for w in range(3):
            window = [inputs[name][member, w].double().numpy() for name in ("zeta", "past", "future", "base")]
            np.testing.assert_allclose(got[member, w], _plain_loop(spec, weights, *window), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
def test_the_cell_is_torch_s_own(kind):
    """nn.RNN and nn.LSTM, to which the paper refers, have gates in the order i, f, g, o and a second bias."""
    spec = _spec(kind, n_layers=1, hidden_size=4)
    stack, inputs = NetworkStack(spec, _generators(1)), _inputs(spec, n_members=1)
    weights, _ = _weights(stack, 0)
    order = torch.arange(16).view(4, 4)[[0, 1, 3, 2]].flatten() if kind == "lstm" else torch.arange(4)
    cell = (nn.RNN if kind == "rnn" else nn.LSTM)(4, 4, batch_first=True)
    with torch.no_grad():
        cell.weight_ih_l0.copy_(weights["cell0.weight"][:4, order].T)
        cell.weight_hh_l0.copy_(weights["cell0.weight"][4:, order].T)
        cell.bias_ih_l0.copy_(weights["cell0.bias"][order])
        cell.bias_hh_l0.zero_()
        x = torch.cat([inputs["zeta"][0, :, :-1, None], inputs["past"][0].transpose(1, 2)], dim=2)
        first = torch.cat([inputs["zeta"][0, :, -1:], inputs["future"][0, :, :, 0]], dim=1)
        h = cell(torch.cat([x, first[:, None]], dim=1))[0][:, -1]
        head = _linear(weights, "out")(torch.relu(_linear(weights, "hidden")(h)))
        wanted = inputs["base"][0, :, 0] + head[:, 0]
    np.testing.assert_allclose(_forecast(stack, inputs)[0, :, 0], wanted, atol=1e-6)


_TORCH = {"relu": nn.ReLU(), "selu": nn.SELU(), "gelu": nn.GELU()}


def _linear(weights, name):
    weight = weights[f"{name}.weight"]
    layer = nn.Linear(*weight.shape)
    layer.load_state_dict({"weight": weight.T, "bias": weights[f"{name}.bias"]})
    return layer


def _psi(inputs, member):
    return torch.cat(
        [inputs["zeta"][member][:, 1:], *(inputs[n][member].flatten(1) for n in ("past", "future"))], dim=1
    )


@pytest.mark.parametrize("activation", list(_TORCH))
def test_mlp_is_the_paper_s_equation(activation):
    spec = _spec("mlp", n_future_columns=2, activation=activation, n_leads=5)
    stack, inputs = NetworkStack(spec, _generators(1, 2)), _inputs(spec)
    got = _forecast(stack, inputs)
    for member in range(2):
        weights, _ = _weights(stack, member)
        names = ["hidden0", "hidden1", "out"]
        layers = [layer for name in names for layer in (_linear(weights, name), _TORCH[activation])][:-1]
        with torch.no_grad():
            wanted = inputs["base"][member] + nn.Sequential(*layers)(_psi(inputs, member))
        np.testing.assert_allclose(got[member], wanted, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("pool_size", [0, 4, 100])
@pytest.mark.parametrize("filter_size", [6, 3])
def test_cnn_is_the_paper_s_equation(filter_size, pool_size):
    """One convolution more than layers, each followed by the pool (where the vector is long enough) and phi."""
    spec = _spec("cnn", filter_size=filter_size, pool_size=pool_size)
    stack, inputs = NetworkStack(spec, _generators(1, 2)), _inputs(spec)
    got = _forecast(stack, inputs)
    for member in range(2):
        weights, _ = _weights(stack, member)
        z = _psi(inputs, member)[:, None]
        with torch.no_grad():
            for i in range(3):
                conv = nn.Conv1d(1 if i == 0 else 2, 2, filter_size, padding=filter_size // 2)
                conv.load_state_dict({"weight": weights[f"conv{i}.weight"], "bias": weights[f"conv{i}.bias"]})
                z = conv(z)
                z = torch.relu(nn.MaxPool1d(pool_size)(z) if 1 < pool_size <= z.shape[2] else z)
            head = nn.Sequential(nn.Flatten(), _linear(weights, "hidden"), nn.ReLU(), _linear(weights, "out"))
            wanted = inputs["base"][member] + head(z)
        np.testing.assert_allclose(got[member], wanted, rtol=1e-4, atol=1e-5)


# --------------------------------------------------------------------------------------------------- weights, dropout
@pytest.mark.parametrize("kind", ["mlp", "cnn", "rnn", "lstm"])
def test_initial_weights_are_torch_s_default_from_each_member_s_generator(kind):
    torch.manual_seed(0)
    before = torch.get_rng_state()
    stack = NetworkStack(_spec(kind, hidden_size=50), _generators(1, 2, 1))
    assert torch.equal(torch.get_rng_state(), before)
    assert torch.equal(stack.flat[0], stack.flat[2])
    weights, filling = _weights(stack, 0)
    other, _ = _weights(stack, 1)
    assert filling == 0
    for layer in stack.layers:
        bound = layer.fan_in**-0.5
        for part in ("weight", "bias"):
            values = weights[f"{layer.name}.{part}"]
            assert not torch.equal(values, other[f"{layer.name}.{part}"])
            assert values.abs().max() <= bound
        assert weights[f"{layer.name}.weight"].abs().max() > 0.6 * bound
    assert [layer.fan_in for layer in stack.layers] == {
        "mlp": [6 * 4 + 4 * 3, 50, 50],
        "cnn": [3, 6, 6, 2 * 36, 50],
        "rnn": [50, 50, 50, 50],
        "lstm": [50, 50, 50, 50],
    }[kind]


@pytest.mark.parametrize("kind", ["mlp", "cnn", "rnn", "lstm"])
def test_no_member_s_gradient_holds_anything_of_another_s_and_filling_has_none(kind):
    spec = _spec(kind, dropout=0.3, activation="gelu")
    inputs = _inputs(spec, n=32)
    stack = NetworkStack(spec, _generators(1, 2)).train()
    (stack(**inputs) ** 2).sum().backward()
    alone = NetworkStack(spec, _generators(2)).train()
    (alone(**{name: value[1:] for name, value in inputs.items()}) ** 2).sum().backward()
    torch.testing.assert_close(stack.flat.grad[1:], alone.flat.grad)
    gradients = NetworkStack(spec, _generators(0, 0))
    gradients.flat.data.copy_(stack.flat.grad)
    assert _weights(gradients, 0)[1] == 0
    assert stack.flat.grad.abs().max() > 0


def test_dropout_drops_its_share_and_rescales():
    before = torch.get_rng_state()
    stack = NetworkStack(_spec("mlp", dropout=0.4), _generators(0, 1))
    mask = stack.train()._mask(20_000)
    for member in mask:
        assert float((member == 0).float().mean()) == pytest.approx(0.4, abs=0.02)
        assert float(member.mean()) == pytest.approx(1.0, abs=0.02)
    assert not torch.equal(mask[0], mask[1])
    assert stack.eval()._mask(5) is None
    assert torch.equal(torch.get_rng_state(), before)


@pytest.mark.parametrize("kind", ["mlp", "cnn", "rnn", "lstm"])
def test_a_correction_begins_at_the_baseline(kind):
    spec = _spec(kind)
    inputs = _inputs(spec)
    assert torch.equal(_forecast(NetworkStack(spec, _generators(1, 2), corrects=True), inputs), inputs["base"])


# --------------------------------------------------------------------------------------------------- windows, batches
def test_batches_are_slices_of_the_chosen_windows():
    views = {"zeta": torch.arange(200.0)[:, None]}
    target = torch.arange(200.0)[:, None].clone()
    target[60] = np.nan
    windows = Windows([views], [target], torch.arange(50, 150))
    stack = NetworkStack(_spec("mlp"), _generators(0, 1))
    plain = list(Batches(windows, 70, stack))
    assert [batch.target.shape for batch in plain] == [(2, 70, 1), (2, 30, 1)]
    assert [batch.n_known.tolist() for batch in plain] == [[69, 69], [30, 30]]
    shown = [batch.inputs["zeta"][0, :n][:, 0] for batch, n in zip(plain, (70, 30), strict=True)]
    assert torch.cat(shown).tolist() == list(range(50, 150))
    for batch in plain:
        assert torch.equal(batch.known.sum(dim=(1, 2)), batch.n_known)
        assert torch.equal(batch.target * batch.known, batch.inputs["zeta"] * batch.known)
    shuffled = Batches(windows, 70, stack, shuffled=True)
    one, two = (
        [
            pair
            for batch, n in zip(shuffled, (70, 30), strict=True)
            for pair in batch.inputs["zeta"][:, :n, 0].T.tolist()
        ]
        for _ in range(2)
    )
    for order in (*zip(*one, strict=True), *zip(*two, strict=True)):
        assert sorted(order) == list(range(50, 150))
    assert one != two
    assert [pair[0] for pair in one] != [pair[1] for pair in one]


def test_members_of_several_tables_read_their_own():
    views = [{"zeta": torch.full((40, 1), float(i))} for i in range(3)]
    windows = Windows(views, [view["zeta"] for view in views], torch.arange(40))
    stack = NetworkStack(_spec("mlp"), _generators(0, 1, 2))
    stack.keep([0, 2])
    (batch,) = Batches(windows, 64, stack)
    assert batch.inputs["zeta"][..., 0].unique(dim=1).flatten().tolist() == [0.0, 2.0]


def test_windows_are_runs_of_padded_rows():
    values = np.arange(12.0).reshape(6, 2)
    windows = padded_windows(values, 2, 1, 3)
    padded = np.vstack([np.zeros((2, 2)), values, np.zeros((1, 2))])
    wanted = np.array([padded[i : i + 3].T for i in range(7)])
    np.testing.assert_array_equal(windows, wanted)
    np.testing.assert_array_equal(padded_windows(values[:, 0], 2, 1, 3), wanted[:, 0])


# ----------------------------------------------------------------------------------------------- the written gradient
@pytest.mark.parametrize("kind", ["rnn", "lstm"])
@pytest.mark.parametrize("reads_zeta", [True, False])
@pytest.mark.parametrize("activation", list(_TORCH))
def test_the_written_gradient_of_decoding_is_the_automatic_one(kind, reads_zeta, activation):
    spec = _spec(kind, reads_zeta=reads_zeta, activation=activation, dropout=0.3, hidden_size=4)
    stack, inputs = NetworkStack(spec, _generators(1, 2)).train(), _inputs(spec)
    aim = torch.randn(2, 7, spec.n_leads, generator=_generators(0)[0])
    ((stack(**inputs) - aim) ** 2).sum().backward()
    twin = NetworkStack(spec, _generators(1, 2)).train()
    mask = twin._mask(spec.n_leads, 4, 7)
    weights = twin.weights()
    for member in range(2):
        loss = 0.0
        for w in range(7):
            named = {
                name: value[member, :, :4] if name == "out.weight" else value[member] for name, value in weights.items()
            }
            window = [inputs[name][member, w] for name in ("zeta", "past", "future", "base")]
            found = _differentiable_loop(spec, named, mask[member, :, :, w], _TORCH[activation], *window)
            loss = loss + ((found - aim[member, w]) ** 2).sum()
        loss.backward(retain_graph=True)
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
            gates = torch.cat([x, h[i]]) @ weights[f"cell{i}.weight"] + weights[f"cell{i}.bias"]
            if spec.kind == "rnn":
                h[i] = torch.tanh(gates)
            else:
                i_gate, f_gate, o_gate, g = gates.split(n)
                c[i] = torch.sigmoid(f_gate) * c[i] + torch.sigmoid(i_gate) * torch.tanh(g)
                h[i] = torch.sigmoid(o_gate) * torch.tanh(c[i])
            x = h[i]
        if lead >= 0:
            z = phi(x @ weights["hidden.weight"] + weights["hidden.bias"]) * mask[lead]
            outputs.append(base[lead] + (z @ weights["out.weight"] + weights["out.bias"])[0])
    return torch.stack(outputs)
