"""Training of a forecaster's networks: validation, z-scores, corrections, repeats, and equal fits in any worker."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from joblib import Parallel, delayed
from threadpoolctl import threadpool_info

from skhybrid import GrayBoxRC, HybridPredictor
from skhybrid._arguments import draw_seed
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.forecasting import DisturbanceForecaster, fit_many
from skhybrid.forecasting.networks import jobs as jobs_module
from skhybrid.forecasting.networks.jobs import discounted_share, train_networks
from skhybrid.forecasting.networks.training import EarlyStoppingPerNetwork
from skhybrid.forecasting.training_job import Split, TrainingJob, chronological_split, repeat_seeds


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


# ------------------------------------------------------------------------------------------------------------ training
@pytest.mark.parametrize(("n_days", "told"), [(7, True), (8, False)])
def test_a_case_that_reads_further_back_than_the_table_says_so(n_days, told):
    office = make_office(n_days=n_days, sampling_time="1h", random_state=0)
    forecaster = DisturbanceForecaster("lstm", "case09", hidden_size=2, max_epochs=1, residual_of=None)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", SkhybridWarning)
        forecaster.fit(office.X, office.heat_gain)
    found = [str(one.message) for one in said if "of the past" in str(one.message)]
    assert bool(found) == told
    if told:
        assert found[0].startswith("case09 reads 7 days of the past, which no row of a table of 7 days has")


def test_the_validation_block_is_the_end_after_a_gap_of_one_horizon():
    assert chronological_split(1000, 24, 0.2, 24) == Split(train_end=776, valid_start=800, valid_end=1000)
    assert chronological_split(1000, 24, 0.0, 24) == Split(1000, None)
    assert chronological_split(80, 24, 0.2, 24) == Split(80, None)  # too short
    assert chronological_split(200, 48, 0.3, 24) == Split(200, None)  # would leave less than two horizons to learn
    assert chronological_split(480, 24, 0.9, 24) == Split(480, None)
    with pytest.raises(ValueError, match=r"validation_fraction=0\.9 of 240 rows leaves none before a gap"):
        chronological_split(240, 24, 0.9, 24)


def test_rows_without_a_target_at_the_end_are_not_those_of_validation():
    X, y = hourly(28)
    later = y.where(np.arange(len(y)) < 21 * 24)
    settings = {"max_epochs": 12, "patience": 3, "residual_of": None, "random_state": 0, "max_missing": 0.6}
    forecaster = DisturbanceForecaster("mlp", learning_rate=0.02, **settings)
    whole = forecaster.fit(X, later).repeats_.iloc[0]
    known = forecaster.fit(X.iloc[: 21 * 24], y.iloc[: 21 * 24]).repeats_.iloc[0]
    assert whole["best_epoch"] == known["best_epoch"] > 1
    assert whole["valid_loss"] == pytest.approx(known["valid_loss"], rel=1e-4)
    early = y.where(np.arange(len(y)) > 14 * 24)
    with pytest.raises(ValueError, match=r"y contains NaN in all of its first \d+ rows, which train a network"):
        forecaster.set_params(validation_fraction=0.5).fit(X, early)


@pytest.mark.parametrize("validation_fraction", [0.0, 0.2])
def test_a_training_that_diverges_is_no_model(validation_fraction):
    X, y = hourly(20)
    settings = {"max_epochs": 3, "validation_fraction": validation_fraction, "residual_of": None, "random_state": 0}
    wild = DisturbanceForecaster("mlp", learning_rate=1e15, **settings)
    with pytest.raises(ValueError, match=r"training diverged with learning_rate=1000000000000000.0; give a lower one"):
        wild.fit(X, y)
    found = fit_many([wild, DisturbanceForecaster("mlp", **settings)], X, y, on_error="return")
    assert isinstance(found[0], ValueError)
    assert found[1].n_epochs_ == 3


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


def test_the_best_epoch_is_that_of_the_weights_that_are_kept():
    X, y = hourly(21)  # errors fall from epoch to epoch, but by next to nothing
    network = DisturbanceForecaster("mlp", residual_of=None, max_epochs=8, learning_rate=1e-7, dropout=0.0)
    network.set_params(random_state=0).fit(X, y)
    kept, losses = network.repeats_.iloc[0], [row["valid_loss"] for row in network.history_]
    assert losses[int(kept["best_epoch"]) - 1] == kept["valid_loss"] > min(losses)


def test_z_scores_see_the_training_block_only():
    X, y = hourly(28)
    split = chronological_split(len(X), 24, 0.2, 24)
    settings = {"residual_of": None, "max_epochs": 1, "hidden_size": 3, "random_state": 0}
    one = DisturbanceForecaster("mlp", **settings).fit(X, y)
    moved = X.copy()
    moved.iloc[split.valid_start :, :2] *= 0.5
    moved.iloc[split.valid_start :, 2] += 50.0
    two = DisturbanceForecaster("mlp", **settings).fit(moved, moved["zeta"])
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
    forecaster = DisturbanceForecaster("mlp", max_epochs=2, random_state=0)
    with pytest.warns(SkhybridWarning, match=r"0\.2 of 72 rows leaves too few .* dropped, and 'ridge' forecasts alone"):
        forecaster.fit(X, y)
    assert forecaster.network_weight_ == 0.0
    np.testing.assert_array_equal(forecaster.predict(X), DisturbanceForecaster("ridge").fit(X, y).predict(X))


def test_a_network_alone_on_a_short_table_is_warned_of_its_few_epochs():
    X, y = hourly(3)
    forecaster = DisturbanceForecaster("mlp", residual_of=None, random_state=0)
    with pytest.warns(SkhybridWarning, match=r"0\.2 of 72 rows leaves too few .* trained for 20 epochs, whatever"):
        forecaster.fit(X, y)
    assert forecaster.n_epochs_ == 20
    with warnings.catch_warnings():
        warnings.simplefilter("error", SkhybridWarning)
        forecaster.set_params(validation_fraction=0.0).fit(X, y)  # as it was asked for


def test_a_filter_longer_than_the_inputs_is_refused():
    X, y = hourly(7)
    with pytest.raises(ValueError, match=r"filter_size=10000 is more than the \d+ values of this case"):
        DisturbanceForecaster("cnn", filter_size=10_000, max_epochs=1).fit(X, y)


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
    def interrupt(self, net, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(EarlyStoppingPerNetwork, "on_epoch_begin", interrupt, raising=False)
    X, y = hourly(10)
    with pytest.raises(KeyboardInterrupt):
        DisturbanceForecaster("mlp", max_epochs=2, random_state=0).fit(X, y)


# ------------------------------------------------------------------------------------------------- repeats and stacks
QUICK = {"max_epochs": 3, "patience": 2, "learning_rate": 0.02, "random_state": 3}


def _same(one, other, row=0):
    """Whether the first network of one forecaster is, to rounding, one of the other's."""
    pairs = [(one._network.weights[n][0], w[row]) for n, w in other._network.weights.items()]
    return all(np.allclose(a, b, rtol=1e-4, atol=1e-5) for a, b in pairs)


@pytest.mark.parametrize("model", ["mlp", "cnn", "rnn", "lstm"])
@pytest.mark.parametrize("sizes", [{}, {"n_layers": 2, "hidden_size": 10, "activation": "gelu", "batch_size": 50}])
def test_a_repeat_is_what_it_is_alone(model, sizes):
    X, y = hourly(9)
    settings = QUICK | sizes | {"residual_of": None}
    several = DisturbanceForecaster(model, n_repeats=3, repeats="mean", **settings).fit(X, y)
    assert not _same(several, several, row=1)
    for i, seed in enumerate(repeat_seeds(3, 3)):
        alone = DisturbanceForecaster(model, **settings | {"random_state": seed}).fit(X, y)
        assert _same(alone, several, row=i)
        row = several.repeats_.iloc[i]
        assert (row["seed"], row["n_epochs"]) == (seed, alone.n_epochs_)
        assert alone.repeats_["valid_loss"][0] == min(e["valid_loss"] for e in alone.history_)
        assert row["valid_loss"] == pytest.approx(alone.repeats_["valid_loss"][0], rel=1e-5)


@pytest.mark.parametrize("repeats", ["best", "mean"])
def test_a_refit_trains_on_all_rows_as_long_as_validation_found_best(repeats):
    X, y = hourly(14)
    settings = QUICK | {"residual_of": None, "max_epochs": 12}
    several = {"n_repeats": 3, "repeats": repeats}
    first = DisturbanceForecaster("mlp", **settings, **several).fit(X, y)
    again = DisturbanceForecaster("mlp", refit=True, **settings, **several).fit(X, y)
    pd.testing.assert_frame_equal(first.repeats_, again.repeats_)
    assert not _same(first, again)
    used = first.repeats_[first.repeats_["used"]]
    n_epochs = round(used["best_epoch"].median())
    kept = np.argmin([epoch["valid_loss"] for epoch in first.history_]) + 1
    assert kept == first.repeats_.loc[first.repeats_["valid_loss"].idxmin(), "best_epoch"]
    for row, seed in enumerate(used["seed"]):
        whole = settings | {"validation_fraction": 0.0, "max_epochs": n_epochs, "random_state": int(seed)}
        assert _same(DisturbanceForecaster("mlp", **whole).fit(X, y), again, row=row)


def test_a_refit_keeps_the_share_of_the_correction():
    X, y = hourly(14)
    first, again = (DisturbanceForecaster("mlp", refit=refit, **QUICK).fit(X, y) for refit in (False, True))
    assert again.network_weight_ == first.network_weight_
    assert again.history_ == first.history_
    assert _same(fit_many([again], X, y)[0], again)


def test_networks_stop_one_by_one():
    X, y = hourly(14)
    settings = QUICK | {"residual_of": None, "max_epochs": 60, "hidden_size": 40}
    several = DisturbanceForecaster("mlp", n_repeats=6, repeats="mean", **settings).fit(X, y)
    assert len(set(several.repeats_["n_epochs"])) > 1
    last = int(several.repeats_["n_epochs"].to_numpy().argmax())
    alone = DisturbanceForecaster("mlp", **settings | {"random_state": repeat_seeds(3, 6)[last]}).fit(X, y)
    assert _same(alone, several, row=last)


def test_the_best_repeat_forecasts_or_the_mean_of_all():
    X, y = hourly(14)
    settings = QUICK | {"residual_of": None, "n_repeats": 3}
    best = DisturbanceForecaster("mlp", **settings).fit(X, y)
    mean = DisturbanceForecaster("mlp", repeats="mean", **settings).fit(X, y)
    lowest = int(mean.repeats_["valid_loss"].to_numpy().argmin())
    assert best.repeats_["used"].tolist() == [i == lowest for i in range(3)]
    assert mean.repeats_["used"].all()
    assert _same(best, mean, row=lowest)
    alone = [
        DisturbanceForecaster("mlp", **QUICK | {"random_state": s, "residual_of": None}) for s in repeat_seeds(3, 3)
    ]
    each = [one.fit(X, y).predict(X) for one in alone]
    np.testing.assert_allclose(mean.predict(X), np.mean(each, axis=0), atol=1e-5)
    np.testing.assert_allclose(best.predict(X), each[lowest], atol=1e-5)


def test_the_mean_of_networks_is_what_the_share_of_a_correction_is_found_for():
    X, y = hourly(21)
    settings = QUICK | {"residual_of": "profile", "n_repeats": 3, "repeats": "mean", "dropout": 0.0}
    forecaster = DisturbanceForecaster("mlp", **settings).fit(X, y)
    split = chronological_split(len(X), 24, 0.2, 24)
    early = DisturbanceForecaster("profile").fit(X.iloc[: split.train_end], y.iloc[: split.train_end])
    origins = np.arange(split.valid_start - 1, len(X) - 24)
    table = forecaster._read_X(X)
    base = early._base.forecast(table, origins, 24)
    correction = forecaster._network.forecast(table, origins, 24, base, early._base.expected(table)) - base
    left = y.to_numpy()[origins[:, None] + np.arange(1, 25)] - base
    share = discounted_share((correction * left).sum(axis=1), (correction**2).sum(axis=1), len(origins) // 24)
    assert forecaster.network_weight_ == pytest.approx(share, abs=1e-3)
    assert 0.0 < share < 1.0


def test_jobs_of_equal_shape_are_trained_as_one_and_each_as_alone(monkeypatch):
    sizes, whole = [], jobs_module.train_stack
    monkeypatch.setattr(
        jobs_module, "train_stack", lambda stack, *a: sizes.append(len(stack.specs)) or whole(stack, *a)
    )
    settings = QUICK | {"residual_of": None}
    jobs, alone = [], []
    for seed, hidden in ((0, 8), (1, 8), (2, 12)):
        X, y = hourly(14, seed)
        alone.append(DisturbanceForecaster("rnn", hidden_size=hidden, **settings).fit(X, y))
        table = alone[-1]._read_X(X)
        split = chronological_split(len(X), 24, 0.2, 24)
        jobs.append(TrainingJob(alone[-1], table, y.to_numpy(), None, split, 24, (3,)))
    sizes.clear()
    together = train_networks(jobs)
    assert sizes == [2, 1]
    for one, job in zip(alone, together, strict=True):
        for epoch, own in zip(job.history, one.history_, strict=True):
            assert epoch == pytest.approx(own, rel=1e-5)
        for name, weight in job.network.weights.items():
            np.testing.assert_allclose(weight, one._network.weights[name], rtol=1e-4, atol=1e-5)


# ------------------------------------------------------------------------------------------------ where it is trained
def _fitted(model):
    X, y = hourly(10)
    return DisturbanceForecaster(model, n_repeats=2, repeats="mean", **QUICK | {"max_epochs": 2}).fit(X, y).predict(X)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["loky", "threading"])
def test_a_fit_is_the_same_to_the_bit_in_any_worker(backend):
    models = ["mlp", "lstm"]
    found = Parallel(n_jobs=2, backend=backend)(delayed(_fitted)(model) for model in models)
    for model, forecast in zip(models, found, strict=True):
        np.testing.assert_array_equal(forecast, _fitted(model))


PROGRAM = """
import sys, hashlib, torch
torch.set_num_threads(2)
sys.path.insert(0, {folder!r})
from test_forecasting_training import _fitted
print(*[hashlib.sha256(_fitted(model).tobytes()).hexdigest() for model in ("mlp", "lstm")])
assert torch.get_num_threads() == 2
"""


@pytest.mark.slow
def test_a_fit_is_the_same_to_the_bit_where_torch_has_two_threads():
    program = PROGRAM.format(folder=str(Path(__file__).parent))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [hashlib.sha256(_fitted(model).tobytes()).hexdigest() for model in ("mlp", "lstm")]


def test_nothing_global_is_left_changed():
    state, threads, pools = torch.get_rng_state(), torch.get_num_threads(), threadpool_info()
    numpy_state = np.random.get_state()[1].copy()  # noqa: NPY002
    seen = []
    other = threading.Thread(target=lambda: seen.append(torch.get_num_threads()))
    other.start()
    other.join()
    before = seen.pop()
    _fitted("mlp")
    again = threading.Thread(target=lambda: seen.append(torch.get_num_threads()))
    again.start()
    again.join()
    assert seen == [before]
    assert torch.equal(torch.get_rng_state(), state)
    assert torch.get_num_threads() == threads
    assert [pool["num_threads"] for pool in threadpool_info()] == [pool["num_threads"] for pool in pools]
    np.testing.assert_array_equal(np.random.get_state()[1], numpy_state)  # noqa: NPY002


def test_the_published_training():
    forecaster = DisturbanceForecaster.published("mlp", random_state=0)
    params = forecaster.get_params()
    wanted = {"n_repeats": 10, "max_epochs": 1000, "patience": 150, "residual_of": None, "repeats": "best"}
    assert {name: params[name] for name in wanted} == wanted
    with pytest.raises(ValueError, match="model='ridge' has no cases"):
        DisturbanceForecaster.published("ridge")
    X, y = hourly(28)
    n_valid = round(params["validation_fraction"] * len(X))
    assert n_valid == 7 * 24  # one week
    quick = DisturbanceForecaster.published("mlp", "case04", max_epochs=3, n_repeats=2, random_state=0).fit(X, y)
    assert quick.case_.name == "case04"
    assert quick.network_weight_ == 1.0
    assert len(quick.repeats_) == 2


def test_networks_forecast_an_output_disturbance_as_well_as_an_input_one():
    office = make_office(n_days=17, random_state=0)
    history, future = office.X.iloc[: 16 * 96], office.X.iloc[16 * 96 :].drop(columns="T_za")
    left = {}
    for kind in ("input", "output"):
        for name, settings in {"rnn": {"max_epochs": 2, "n_repeats": 2, "random_state": 0}, "profile": {}}.items():
            make = DisturbanceForecaster.published if name == "rnn" else DisturbanceForecaster
            forecaster = make(name, **settings)
            hybrid = HybridPredictor(
                GrayBoxRC(known=office.theta), forecaster, disturbance=kind, adapt=None, intervals=False
            )
            found = hybrid.fit(office.X.iloc[: 15 * 96], office.y.iloc[: 15 * 96]).forecast(history, future)
            assert np.isfinite(found.to_numpy()).all()
            left[kind, name] = found["T_za"] - found["zeta"] if kind == "output" else found["zeta"]
    # an output disturbance is added to what the network alone forecasts (Eq. 18), whoever forecasts it
    np.testing.assert_allclose(left["output", "rnn"], left["output", "profile"], atol=1e-8)
    assert not np.allclose(left["input", "rnn"], left["input", "profile"], atol=0.05)
