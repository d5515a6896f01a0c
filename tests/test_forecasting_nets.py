"""The networks against plain loops of their equations, and what training must do."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch

from skhybrid.forecasting import DisturbanceForecaster
from skhybrid.forecasting.forecaster import draw_seed
from skhybrid.forecasting.nets import LocalDropout, NetworkSpec, build_network
from skhybrid.forecasting.training import Split, chronological_split, discounted_share
from skhybrid.forecasting.windows import Batches, Windows


def hourly(n_days, seed=0):
    """Weekday gains, an effect of weather, and noise."""
    rng = np.random.default_rng(seed)
    index = pd.date_range("2023-07-03", periods=24 * n_days, freq="1h")
    T_oa = 15 + 6 * np.sin(2 * np.pi * (index.hour - 9) / 24) + rng.normal(size=len(index))
    q_sol = np.clip(np.sin(np.pi * (index.hour - 6) / 12), 0, None) * rng.uniform(0.2, 0.8, len(index))
    gains = np.where(index.day_of_week >= 5, 0.5, 2.0) * ((index.hour >= 8) & (index.hour < 18))
    zeta = gains + 0.1 * (15 - T_oa) + q_sol + 0.1 * rng.normal(size=len(index))
    X = pd.DataFrame({"T_oa": T_oa, "q_sol": q_sol, "zeta": zeta}, index=index)
    return X, X["zeta"]


def _spec(kind, **settings):
    shape = {"n_past": 6, "n_leads": 4, "n_past_columns": 3, "n_future_columns": 3, "reads_zeta": True}
    size = {"n_layers": 2, "hidden_size": 5, "activation": "relu", "dropout": 0.0}
    cnn = {"n_channels": 2, "filter_size": 3, "pool_size": 0}
    return NetworkSpec(**({"kind": kind} | shape | size | cnn | settings))


def _inputs(spec, n=7, seed=0):
    g = torch.Generator().manual_seed(seed)
    shapes = {
        "zeta": (n, spec.n_past + 1),
        "past": (n, spec.n_past_columns, spec.n_past),
        "future": (n, spec.n_future_columns, spec.n_leads),
        "base": (n, spec.n_leads),
    }
    return {name: torch.randn(shape, generator=g) for name, shape in shapes.items()}


def _sigmoid(v):
    return 1.0 / (1.0 + np.exp(-v))


def _cell(kind, weights, layer, x, h, c):
    """One step of torch's documented RNN and LSTM cells, in NumPy."""
    a = (
        weights[f"cell.weight_ih_l{layer}"] @ x
        + weights[f"cell.bias_ih_l{layer}"]
        + weights[f"cell.weight_hh_l{layer}"] @ h
        + weights[f"cell.bias_hh_l{layer}"]
    )
    if kind == "rnn":
        return np.tanh(a), c
    i, f, g, o = np.split(a, 4)
    c = _sigmoid(f) * c + _sigmoid(i) * np.tanh(g)
    return _sigmoid(o) * np.tanh(c), c


@pytest.mark.parametrize("kind", ["rnn", "lstm"])
def test_decoding_is_the_plain_loop_of_the_paper_s_equation(kind):
    spec = _spec(kind)
    module = build_network(spec, torch.Generator().manual_seed(1)).eval()
    weights = {name: value.double().numpy() for name, value in module.state_dict().items()}
    inputs = _inputs(spec)
    with torch.no_grad():
        got = module(**inputs).numpy()
    zeta, past, future, base = (inputs[name].double().numpy() for name in ("zeta", "past", "future", "base"))
    for w in range(len(zeta)):
        h, c = np.zeros((2, 5)), np.zeros((2, 5))
        outputs = []
        for k in range(spec.n_past + spec.n_leads):
            if k < spec.n_past:  # zeta(k - 1) is measured
                x = np.append(zeta[w, k], past[w, :, k])
            else:  # ... and then the last measured value, or the network's own output
                lead = k - spec.n_past
                x = np.append(outputs[-1] if outputs else zeta[w, -1], future[w, :, lead])
            for layer in range(2):
                h[layer], c[layer] = _cell(kind, weights, layer, x, h[layer], c[layer])
                x = h[layer]
            if k >= spec.n_past:
                z = np.maximum(weights["head.0.weight"] @ x + weights["head.0.bias"], 0.0)
                correction = weights["head.3.weight"] @ z + weights["head.3.bias"]
                outputs.append(base[w, k - spec.n_past] + correction[0])
        np.testing.assert_allclose(got[w], outputs, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("activation", "phi"), [("relu", lambda v: np.maximum(v, 0.0)), ("selu", None), ("gelu", None)]
)
def test_mlp_is_the_paper_s_equation(activation, phi):
    spec = _spec("mlp", n_future_columns=2, activation=activation)
    module = build_network(spec, torch.Generator().manual_seed(1)).eval()
    inputs = _inputs(spec)
    with torch.no_grad():
        got = module(**inputs).numpy()
    if phi is None:
        phi = {"selu": torch.selu, "gelu": torch.nn.functional.gelu}[activation]
        phi = lambda v, f=phi: f(torch.from_numpy(v)).numpy()  # noqa: E731
    n = len(got)
    psi = np.hstack(
        [inputs["zeta"][:, 1:].numpy(), inputs["past"].reshape(n, -1).numpy(), inputs["future"].reshape(n, -1).numpy()]
    )
    layers = [layer for layer in module.modules() if isinstance(layer, torch.nn.Linear)]
    for i, layer in enumerate(layers):
        psi = psi @ layer.weight.detach().numpy().T + layer.bias.detach().numpy()
        psi = phi(psi) if i < len(layers) - 1 else psi
    np.testing.assert_allclose(got, inputs["base"].numpy() + psi, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("pool_size", [0, 4, 100])
@pytest.mark.parametrize("filter_size", [6, 3])
def test_cnn_has_one_convolution_more_than_layers(filter_size, pool_size):
    spec = _spec("cnn", filter_size=filter_size, pool_size=pool_size)
    module = build_network(spec, torch.Generator().manual_seed(1)).eval()
    convolutions = [layer for layer in module.modules() if isinstance(layer, torch.nn.Conv1d)]
    assert len(convolutions) == spec.n_layers + 1
    assert [c.in_channels for c in convolutions] == [1, 2, 2]
    assert module(**_inputs(spec)).shape == (7, spec.n_leads)


def test_initial_weights_and_dropout_come_from_the_generator():
    torch.manual_seed(0)
    before = torch.get_rng_state()
    first, same, other = (
        build_network(_spec("lstm"), torch.Generator().manual_seed(seed)).state_dict() for seed in (1, 1, 2)
    )
    assert torch.equal(torch.get_rng_state(), before)
    for name, value in first.items():
        assert torch.equal(value, same[name])
        assert not torch.equal(value, other[name])
        fan_in = 5 if not name.startswith("head") else {"head.0": 5, "head.3": 5}[name[:6]]
        assert value.abs().max() <= fan_in**-0.5
    drop = LocalDropout(0.4, torch.Generator().manual_seed(0))
    z = drop(torch.ones(20_000))
    assert float((z == 0).float().mean()) == pytest.approx(0.4, abs=0.02)
    assert float(z.mean()) == pytest.approx(1.0, abs=0.02)
    assert torch.equal(drop.eval()(torch.ones(5)), torch.ones(5))
    assert torch.equal(torch.get_rng_state(), before)


def test_a_correction_begins_at_the_baseline():
    spec = _spec("lstm")
    inputs = _inputs(spec)
    module = build_network(spec, torch.Generator().manual_seed(1), corrects=True).eval()
    assert torch.equal(module(**inputs), inputs["base"])


def test_batches_are_slices_of_the_chosen_windows():
    views = {"zeta": torch.arange(20.0)[:, None]}
    windows = Windows(views, torch.arange(20.0)[:, None], torch.arange(5, 15))
    plain = [batch[0]["zeta"][:, 0].tolist() for batch in Batches(windows, 4)]
    assert plain == [[5, 6, 7, 8], [9, 10, 11, 12], [13, 14]]
    shuffled = Batches(windows, 4, torch.Generator().manual_seed(0))
    one, two = ([v for batch in shuffled for v in batch[1][:, 0].tolist()] for _ in range(2))
    assert sorted(one) == sorted(two) == list(range(5, 15))
    assert one != two


# ------------------------------------------------------------------------------------------------------------ training
def test_the_validation_block_is_the_end_behind_a_gap_of_one_horizon():
    assert chronological_split(1000, 24, 0.2, 24) == Split(train_end=776, valid_start=800)
    assert chronological_split(1000, 24, 0.0, 24) == Split(1000, None)
    assert chronological_split(80, 24, 0.2, 24) == Split(80, None)  # too short
    assert chronological_split(200, 48, 0.3, 24) == Split(200, None)  # would leave less than two horizons to learn


@pytest.mark.parametrize(("model", "epochs"), [("mlp", 25), ("cnn", 25), ("rnn", 10), ("lstm", 10)])
def test_a_network_learns_a_weekly_signal(model, epochs):
    X, y = hourly(28)
    cut = 21 * 24
    settings = {"max_epochs": epochs, "learning_rate": 0.02, "batch_size": 64, "dropout": 0.0, "random_state": 0}
    forecaster = DisturbanceForecaster(model, residual_of=None, **settings).fit(X.iloc[:cut], y.iloc[:cut])
    losses = [row["train_loss"] for row in forecaster.history_]
    assert losses[-1] < 0.5 * losses[0]
    assert forecaster.n_epochs_ == epochs
    assert forecaster.network_weight_ == 1.0
    later = X.iloc[cut:]
    error = forecaster.predict(later) - y.iloc[cut:]
    assert np.sqrt((error**2).mean()) < 0.8 * y.iloc[cut:].std()


def test_the_best_epoch_is_kept_and_training_stops():
    X, y = hourly(28)
    forecaster = DisturbanceForecaster(
        "mlp",
        residual_of=None,
        hidden_size=60,
        dropout=0.0,
        max_epochs=200,
        patience=5,
        learning_rate=0.02,
        random_state=0,
    )
    forecaster.fit(X, y)
    assert forecaster.n_epochs_ < 200
    validation = [row["valid_loss"] for row in forecaster.history_]
    split = chronological_split(len(X), 24, 0.2, 24)
    origins = np.arange(split.valid_start - 1, len(X) - 24)
    forecaster._tail = forecaster._tail.rows(slice(0, 1))  # so that the table itself is all the history
    paths = forecaster.predict_from(X, origins)
    errors = paths - y.to_numpy()[origins[:, None] + np.arange(1, 25)]
    z_scored = errors / y.iloc[: split.train_end].std(ddof=0)
    assert np.mean(z_scored**2) == pytest.approx(min(validation), rel=1e-3)


def test_z_scores_see_the_training_block_only():
    X, y = hourly(28)
    split = chronological_split(len(X), 24, 0.2, 24)
    settings = {"residual_of": None, "max_epochs": 1, "hidden_size": 3, "random_state": 0}
    one = DisturbanceForecaster("mlp", **settings).fit(X, y)
    moved = X.copy()
    moved.iloc[split.train_end + 24 :] += 1.0
    two = DisturbanceForecaster("mlp", **settings).fit(moved, y + (np.arange(len(y)) >= split.valid_start) * 50.0)
    np.testing.assert_array_equal(one.predict(X.iloc[:200]), two.predict(X.iloc[:200]))


@pytest.mark.parametrize("residual_of", ["ridge", "profile"])
def test_a_correction_is_never_worse_on_the_validation_block(residual_of):
    X, y = hourly(28)
    settings = {"residual_of": residual_of, "max_epochs": 15, "learning_rate": 0.02, "random_state": 0}
    forecaster = DisturbanceForecaster("mlp", **settings).fit(X, y)
    weight = forecaster.network_weight_
    assert 0.0 <= weight <= 1.0
    # The baseline that the network corrected had not seen the validation block.
    split = chronological_split(len(X), 24, 0.2, 24)
    early = DisturbanceForecaster(residual_of).fit(X.iloc[: split.train_end], y.iloc[: split.train_end])
    table = forecaster._read_X(X)
    origins = np.arange(split.valid_start - 1, len(X) - 24)
    base = early._base.forecast(table, origins, 24)
    truth = y.to_numpy()[origins[:, None] + np.arange(1, 25)]
    correction = forecaster._network.forecast(table, origins, 24, base, early._base.expected(table)) - base
    errors = [np.mean((base + w * correction - truth) ** 2) for w in (weight, 0.0)]
    assert errors[0] < errors[1] or weight == 0.0
    assert weight <= np.clip(np.sum(correction * (truth - base)) / np.sum(correction**2), 0, 1)
    assert np.any(correction != 0.0)
    other = DisturbanceForecaster("mlp", **settings | {"residual_of": None}).fit(X, y)
    assert other.network_weight_ == 1.0


def test_the_share_of_a_correction_is_its_slope_less_a_standard_error():
    power = np.ones(60)
    assert discounted_share(0.5 * power, power, 6) == pytest.approx(0.5)
    assert discounted_share(2.0 * power, power, 6) == 1.0
    assert discounted_share(-power, power, 6) == 0.0
    assert discounted_share(0.0 * power, 0.0 * power, 6) == 0.0
    assert discounted_share(np.nan * power, power, 6) == 0.0
    # With blocks of equal power the jackknife error is that of a mean of block means.
    slopes = np.array([0.2, 0.9, 0.5, 0.7, 0.4, 0.6])
    expected = slopes.mean() - slopes.std(ddof=1) / np.sqrt(6)
    assert discounted_share(np.repeat(slopes, 10), power, 6) == pytest.approx(expected)


def test_a_correction_of_noise_is_dropped_or_small():
    rng = np.random.default_rng(0)
    X, y = hourly(28)
    noise = y * 0 + rng.normal(size=len(y))
    forecaster = DisturbanceForecaster("mlp", max_epochs=30, random_state=0).fit(X.assign(zeta=noise), noise)
    alone = DisturbanceForecaster("ridge").fit(X.assign(zeta=noise), noise)
    difference = forecaster.predict(X) - alone.predict(X)
    assert np.sqrt((difference**2).mean()) < 0.3


def test_a_dropped_network_leaves_the_baseline_of_all_rows():
    X, y = hourly(3)  # too short for a validation block
    forecaster = DisturbanceForecaster("mlp", max_epochs=2, random_state=0).fit(X, y)
    assert forecaster.network_weight_ == 0.0
    np.testing.assert_array_equal(forecaster.predict(X), DisturbanceForecaster("ridge").fit(X, y).predict(X))


def test_a_progress_bar_is_shown_on_demand(capsys):
    X, y = hourly(10)
    DisturbanceForecaster("mlp", max_epochs=2, verbose=1, random_state=0).fit(X, y)
    assert "epochs" in capsys.readouterr().err
    DisturbanceForecaster("mlp", max_epochs=2, random_state=0).fit(X, y)
    silent = capsys.readouterr()
    assert silent.out == silent.err == ""


def test_a_seed_is_an_integer_whatever_is_given():
    assert draw_seed(5) == 5
    assert draw_seed(np.random.RandomState(0)) == draw_seed(np.random.RandomState(0))
    assert draw_seed(None) != draw_seed(None)


def test_an_interruption_by_the_user_ends_the_fit(monkeypatch):
    from skhybrid.forecasting import training

    def interrupt(self, net, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(training.GradientNormClipping, "on_epoch_begin", interrupt, raising=False)
    X, y = hourly(10)
    with pytest.raises(KeyboardInterrupt):
        DisturbanceForecaster("mlp", max_epochs=2, random_state=0).fit(X, y)
