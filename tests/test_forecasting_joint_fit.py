"""Many forecasters fitted together: each as alone, in any order and among any others, and failures one by one."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch
from sklearn.base import clone
from sklearn.linear_model import Ridge
from threadpoolctl import threadpool_info

from skhybrid.forecasting import DisturbanceForecaster, ModelCase, fit_many, forecaster
from skhybrid.forecasting.networks import jobs

QUICK = {"max_epochs": 3, "patience": 2, "learning_rate": 0.02, "hidden_size": 6, "residual_of": None}
SMALL = {"n_channels": 2, "filter_size": 3, "pool_size": 4}


def hourly(n_days=9, seed=0):
    """Weekday gains, an effect of weather, and noise."""
    rng = np.random.default_rng(seed)
    index = pd.date_range("2023-07-03", periods=24 * n_days, freq="1h")
    T_oa = 15 + 6 * np.sin(2 * np.pi * (index.hour - 9) / 24) + rng.normal(size=len(index))
    q_sol = np.clip(np.sin(np.pi * (index.hour - 6) / 12), 0, None) * rng.uniform(0.2, 0.8, len(index))
    gains = np.where(index.day_of_week >= 5, 0.5, 2.0) * ((index.hour >= 8) & (index.hour < 18))
    zeta = gains + 0.1 * (15 - T_oa) + q_sol + 0.1 * rng.normal(size=len(index))
    X = pd.DataFrame({"T_oa": T_oa, "q_sol": q_sol, "zeta": zeta}, index=index)
    return X, X["zeta"]


def candidate(model, case="case01", seed=0, **settings):
    return DisturbanceForecaster(model, case, random_state=seed, **QUICK | SMALL | settings)


def assert_same(one, other, X):
    """Equal to rounding: weights, history, share of the correction, forecasts."""
    assert one._network.weights.keys() == other._network.weights.keys()
    for name, weight in one._network.weights.items():
        np.testing.assert_allclose(weight, other._network.weights[name], rtol=1e-4, atol=1e-5)
    for epoch, own in zip(one.history_, other.history_, strict=True):
        assert epoch == pytest.approx(own, rel=1e-4)
    assert one.n_epochs_ == other.n_epochs_
    assert one.network_weight_ == pytest.approx(other.network_weight_, abs=1e-3)
    pd.testing.assert_frame_equal(one.repeats_, other.repeats_, rtol=1e-4)
    np.testing.assert_allclose(one.predict(X), other.predict(X), rtol=1e-4, atol=1e-4)


@pytest.fixture
def stacks(monkeypatch):
    """Number of networks in each stack that was trained."""
    sizes, whole = [], jobs.train_stack
    monkeypatch.setattr(jobs, "train_stack", lambda stack, *a: sizes.append(len(stack.specs)) or whole(stack, *a))
    return sizes


VARIANTS = [
    {"activation": "relu", "dropout": 0.1},
    {"activation": "gelu", "dropout": 0.0},
    {"activation": "selu", "dropout": 0.4},
    {"activation": "relu", "dropout": 0.3, "seed": 5, "n_repeats": 2},
]


@pytest.mark.parametrize("model", ["mlp", "cnn", "rnn", "lstm"])
@pytest.mark.parametrize("sizes", [{}, {"n_layers": 2, "hidden_size": 9, "batch_size": 50}])
def test_each_is_what_it_is_alone(model, sizes, stacks):
    X, y = hourly()
    candidates = [candidate(model, **sizes | variant) for variant in VARIANTS]
    together = fit_many(candidates, X, y)
    assert stacks == [5]  # one stack in spite of other activations, dropout and repeats
    for one, unfitted in zip(together, candidates, strict=True):
        assert_same(one, clone(unfitted).fit(X, y), X)
    assert not np.array_equal(together[0].predict(X), together[3].predict(X))


@pytest.mark.parametrize("model", ["rnn", "lstm"])
def test_recurrent_networks_of_several_cases_share_a_stack(model, stacks):
    X, y = hourly()
    candidates = [candidate(model, case, residual_of="ridge") for case in ("case01", "case02", "case03", "case06")]
    together = fit_many(candidates, X, y)
    assert stacks == [4]
    for one, unfitted in zip(together, candidates, strict=True):
        assert_same(one, clone(unfitted).fit(X, y), X)
    assert len({one.history_[-1]["train_loss"] for one in together}) == 4


def mixed():
    """Frameworks, cases, layers, encodings, baselines and horizons that share no stack, and some that do."""
    return [
        candidate("mlp"),
        candidate("lstm", "case07"),
        candidate("mlp", "case03", hidden_size=7),
        candidate("mlp", seed=3),
        DisturbanceForecaster("ridge"),
        candidate("lstm", "case12", activation="selu"),
        candidate("mlp", residual_of="profile", time_encoding="onehot"),
        candidate("rnn", residual_of="ridge", horizon="12h"),
        candidate("mlp", validation_fraction=0.3),
        candidate("rnn", ModelCase("no past of zeta", 1, ("how",), ("how", "T_oa"))),
        DisturbanceForecaster(Ridge(), horizon="6h"),
    ]


@pytest.mark.slow
def test_order_and_other_candidates_change_nothing():
    X, y = hourly(14)
    alone = [clone(one).fit(X, y).predict(X) for one in mixed()]
    assert len({forecast.tobytes() for forecast in alone}) == len(alone)
    for order in (range(11), reversed(range(11)), (3, 8, 0), (5, 1, 7)):
        numbers = list(order)
        candidates = mixed()
        for i, one in zip(numbers, fit_many([candidates[i] for i in numbers], X, y), strict=True):
            np.testing.assert_allclose(one.predict(X), alone[i], rtol=1e-4, atol=1e-4)


def test_large_stacks_are_cut_and_networks_stop_one_by_one(stacks, monkeypatch):
    monkeypatch.setitem(jobs._LARGEST_STACK, "cpu", 4)
    X, y = hourly()
    candidates = [
        candidate("mlp", seed=seed, max_epochs=40, activation=a) for a in ("relu", "gelu") for seed in range(5)
    ]
    together = fit_many(candidates, X, y)
    assert len(stacks) == 3
    assert sum(stacks) == 10
    assert len({one.n_epochs_ for one in together}) > 1
    for i in (0, 4, 9):
        assert_same(together[i], clone(candidates[i]).fit(X, y), X)


def test_what_is_shared_is_computed_once(monkeypatch):
    calls = []
    for module, name in ((jobs, "window_columns"), (jobs, "scaled_views"), (forecaster, "fit_baseline")):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, n=name, f=whole, **k: calls.append(n) or f(*a, **k))
    X, y = hourly()
    sizes = [{"hidden_size": n, "activation": a} for n in (4, 8) for a in ("relu", "selu")]
    fit_many([candidate("mlp", residual_of="ridge", **size) for size in sizes], X, y)
    assert sorted(calls) == ["fit_baseline", "fit_baseline", "scaled_views", "window_columns"]


# ------------------------------------------------------------------------------------------------------------ failures
def failing():
    X, y = hourly()
    return X, y, [candidate("mlp"), candidate("mlp", "case16"), candidate("mlp", dropout=2.0), candidate("mlp", seed=1)]


def test_what_fails_stands_in_its_place_and_the_others_are_fitted():
    X, y, candidates = failing()
    found = fit_many(candidates, X, y, on_error="return")
    assert isinstance(found[1], ValueError)
    assert "u_heat" in str(found[1])  # case16 reads the modes of a plant, which this table lacks
    assert isinstance(found[2], ValueError)
    assert "dropout=2.0" in str(found[2])
    for i in (0, 3):
        assert_same(found[i], clone(candidates[i]).fit(X, y), X)


def test_a_stack_that_fails_leaves_the_others(monkeypatch):
    whole = jobs.train_stack

    def fails(stack, *rest):
        if stack.spec.hidden_size == 7:
            raise MemoryError("too large")
        return whole(stack, *rest)

    monkeypatch.setattr(jobs, "train_stack", fails)
    X, y = hourly()
    found = fit_many([candidate("mlp", hidden_size=7), candidate("mlp")], X, y, on_error="return")
    assert isinstance(found[0], MemoryError)
    assert_same(found[1], candidate("mlp").fit(X, y), X)
    with pytest.raises(MemoryError, match="too large"):
        fit_many([candidate("mlp", hidden_size=7), candidate("mlp")], X, y)


def test_the_first_failure_is_raised_on_demand(stacks):
    X, y, candidates = failing()
    with pytest.raises(ValueError, match="u_heat"):
        fit_many(candidates, X, y)
    assert stacks == []  # before anything is trained
    with pytest.raises(ValueError, match="on_error='ignore' is not known"):
        fit_many(candidates, X, y, on_error="ignore")


# -------------------------------------------------------------------------------------------------------------- manners
def test_candidates_and_all_that_is_global_are_left_as_they_are():
    X, y = hourly()
    before = X.copy()
    state, threads, pools = torch.get_rng_state(), torch.get_num_threads(), threadpool_info()
    numpy_state = np.random.get_state()[1].copy()  # noqa: NPY002
    candidates = [candidate("mlp"), candidate("lstm")]
    one, two = (fit_many(iter(candidates), X, y) for _ in range(2))
    for first, second, unfitted in zip(one, two, candidates, strict=True):
        assert_same(first, second, X)
        assert not hasattr(unfitted, "history_")
    pd.testing.assert_frame_equal(X, before)
    assert torch.equal(torch.get_rng_state(), state)
    assert torch.get_num_threads() == threads
    assert [pool["num_threads"] for pool in threadpool_info()] == [pool["num_threads"] for pool in pools]
    np.testing.assert_array_equal(np.random.get_state()[1], numpy_state)  # noqa: NPY002


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (candidate("mlp"), "forecasters is one DisturbanceForecaster; give a list of them"),
        ([Ridge()], r"forecasters holds Ridge\(\), which is no DisturbanceForecaster"),
        ({"a": candidate("mlp")}, "forecasters holds 'a', which is no DisturbanceForecaster"),
    ],
)
def test_what_is_no_forecaster_is_named(given, said):
    with pytest.raises(ValueError, match=said):
        fit_many(given, *hourly())


def test_nothing_to_fit_is_an_empty_list():
    assert fit_many([], *hourly()) == []
