"""Properties of every forecaster: scikit-learn's checks, no leak, repeatability, pickling, missing history."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings
from itertools import product

import numpy as np
import pandas as pd
import pytest
from joblib import Parallel, delayed
from sklearn.base import clone
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from skhybrid import HybridPredictor
from skhybrid.forecasting import ARXRegressor, BoostedRegressor, DisturbanceForecaster

ROWS_ARE_TIME_STEPS = "rows are consecutive time steps: their order is information, and a part of them has another past"
BASELINES = ("ridge", "profile", "last_week", "persistence", "none")
NETWORKS = ("mlp", "cnn", "rnn", "lstm")
TINY = {"max_epochs": 2, "hidden_size": 4, "n_channels": 2, "random_state": 0}


def _expected(estimator):
    # Without a measured past, baselines forecast each row by its time alone, and ARX learns nothing from 20 rows.
    one_step = getattr(estimator, "objective", None) == "one_step"
    if one_step or getattr(estimator, "model", None) in BASELINES[1:]:
        return {}
    return {
        "check_methods_sample_order_invariance": ROWS_ARE_TIME_STEPS,
        "check_methods_subset_invariance": ROWS_ARE_TIME_STEPS,
    }


@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
@parametrize_with_checks(
    [
        *[DisturbanceForecaster(model, sampling_time="1h") for model in BASELINES],
        DisturbanceForecaster(Ridge(), random_state=0, sampling_time="1h"),
        DisturbanceForecaster("lstm", sampling_time="1h", **TINY),
        DisturbanceForecaster("cnn", residual_of=None, sampling_time="1h", **TINY),
        ARXRegressor(sampling_time="15min"),
        ARXRegressor(adapt="refit", sampling_time="15min"),
        ARXRegressor(objective="multi_step", adapt="refit", sampling_time="15min"),
        BoostedRegressor(residual_of="arx", max_iter=10, sampling_time="15min", random_state=0),
    ],
    expected_failed_checks=_expected,
)
def test_scikit_learn_checks(estimator, check):
    np.random.seed(0)  # noqa: NPY002 - a check shuffles rows by the global generator
    check(estimator)


# ------------------------------------------------------------------------------------------------------------- tables
def hourly(n_days=28, seed=0, start="2023-07-03", tz="Europe/Amsterdam"):
    """Weather and a disturbance with a weekly pattern, an effect of weather and a slow random part."""
    rng = np.random.default_rng(seed)
    time = pd.date_range(start, periods=24 * n_days, freq="1h", tz=tz)
    hour, weekend = time.hour.to_numpy(), time.day_of_week.to_numpy() >= 5
    T_oa = 15 + 6 * np.sin(2 * np.pi * (hour - 9) / 24) + 0.3 * np.cumsum(rng.normal(size=len(time)))
    q_sol = np.clip(np.sin(np.pi * (hour - 6) / 12), 0, None) * rng.uniform(0.2, 0.8, len(time))
    slow = np.zeros(len(time))
    for k in range(1, len(time)):
        slow[k] = 0.95 * slow[k - 1] + 0.1 * rng.normal()
    gains = np.where(weekend, 0.5, 2.0) * ((hour >= 8) & (hour < 18))
    zeta = gains + 0.1 * (15 - T_oa) + q_sol + slow
    u_heat = (T_oa < 14).astype(float)
    X = pd.DataFrame({"T_oa": T_oa, "q_sol": q_sol, "u_heat": u_heat, "zeta": zeta}, index=time)
    return X, X["zeta"].rename("y")


def zone(n_days=21, seed=0):
    """A 1R1C room with a weekly gain, at 15 min."""
    rng = np.random.default_rng(seed)
    time = pd.date_range("2023-01-02", periods=96 * n_days, freq="15min")
    T_oa = 5 + 5 * np.sin(2 * np.pi * (np.arange(len(time)) / 96 - 0.4))
    u_heat = ((time.hour >= 6) & (time.hour < 20)).astype(float) * rng.uniform(0.3, 1.0, len(time))
    gain = 1.0 * ((time.hour >= 9) & (time.hour < 17) & (time.day_of_week < 5))
    T = np.full(len(time), 20.0)
    for k in range(len(time) - 1):
        T[k + 1] = T[k] + 0.25 * ((T_oa[k] - T[k]) / 6 + 4 * u_heat[k] + gain[k]) / 3 + 0.01 * rng.normal()
    X = pd.DataFrame({"T_oa": T_oa, "q_sol": 0.0, "u_heat": u_heat, "T_za": T}, index=time)
    return X, X["T_za"].rename("y")


FORECASTERS = [
    *[DisturbanceForecaster(model) for model in BASELINES],
    DisturbanceForecaster(HistGradientBoostingRegressor(max_iter=30), random_state=0),
    *[DisturbanceForecaster(model, residual_of=None, **TINY) for model in NETWORKS],
    DisturbanceForecaster("lstm", case="case09", **TINY),
    DisturbanceForecaster("mlp", case="case16", **TINY),
]
MODELS = [
    *FORECASTERS,
    ARXRegressor(),
    ARXRegressor(adapt="refit"),
    ARXRegressor(adapt="refit", objective="multi_step"),
]
MODELS += [BoostedRegressor(residual_of=base, max_iter=30, random_state=0) for base in (None, "arx")]


def _data(model):
    return zone() if isinstance(model, ARXRegressor | BoostedRegressor) else hourly()


def _name(model):
    if isinstance(model, BoostedRegressor):
        return f"boosting-{model.residual_of}"
    kind = "arx" if isinstance(model, ARXRegressor) else str(model.model).split("(")[0]
    objective = "-multi_step" * (getattr(model, "objective", None) == "multi_step")
    return f"{kind}-{getattr(model, 'adapt', None) or getattr(model, 'case', None) or ''}{objective}"


@pytest.fixture(params=MODELS, ids=_name, scope="module")
def fitted(request):
    """A model fitted on all but the last seven days, the data, and the row at which the tests begin."""
    X, y = _data(request.param)
    cut = len(X) - 7 * len(X.loc[X.index[0] : X.index[0] + pd.Timedelta("1D")]) + 7
    model = clone(request.param).fit(X.iloc[:cut], y.iloc[:cut])
    if hasattr(model, "network_weight_") and model.residual_of is not None:
        model.network_weight_ = 1.0  # so that the network is looked at even where it does not help
    return model, X, y, cut


# ------------------------------------------------------------------------------------------------------------- leaks
def test_nothing_after_an_origin_is_read(fitted):
    model, X, _, cut = fitted
    history = "T_za" if "T_za" in X else "zeta"
    later = X.iloc[cut:].copy()
    for origin in (0, 30, 100):
        noisy = later.copy()
        noisy.iloc[origin + 1 :, noisy.columns.get_loc(history)] = np.random.default_rng(1).uniform(
            -29, 59, len(noisy) - origin - 1
        )
        np.testing.assert_array_equal(model.predict_from(noisy, [origin]), model.predict_from(later, [origin]))
        noisy.iloc[origin + 1 :, noisy.columns.get_loc(history)] = np.nan
        np.testing.assert_array_equal(model.predict_from(noisy, [origin]), model.predict_from(later, [origin]))


def test_the_row_of_the_origin_is_read(fitted):
    model, X, _, cut = fitted
    if getattr(model, "model", None) in ("profile", "last_week", "none"):
        pytest.skip("this baseline does not look at the row of the origin for the next day")
    history = "T_za" if "T_za" in X else "zeta"
    later = X.iloc[cut:].copy()
    moved = later.copy()
    moved.iloc[30, moved.columns.get_loc(history)] += 3.0
    assert not np.array_equal(model.predict_from(moved, [30]), model.predict_from(later, [30]))


def test_an_origin_forecasts_alike_alone_and_among_others(fitted):
    model, X, _, cut = fitted
    later = X.iloc[cut:]
    alone = model.predict_from(later, [60])
    np.testing.assert_allclose(model.predict_from(later, [20, 60, 90])[1], alone[0], rtol=1e-5, atol=1e-5)


# ------------------------------------------------------------------------------------- histories that are not all there
def test_missing_history_is_defined(fitted):
    model, X, _, cut = fitted
    history = "T_za" if "T_za" in X else "zeta"
    later = X.iloc[cut:].copy()
    later[history] = np.nan
    assert np.isfinite(model.predict(later)).all()
    cold = later.set_axis(later.index + pd.Timedelta("400D"))  # far from the training table
    assert np.isfinite(model.predict(cold)).all()
    later.iloc[:50, later.columns.get_loc(history)] = X[history].iloc[cut : cut + 50]
    assert np.isfinite(model.predict(later)).all()


def test_any_number_of_leads_is_forecast(fitted):
    model, X, _, cut = fitted
    later = X.iloc[cut:]
    day = model.predict_from(later, [3])
    for hours in (1, 25, 60):
        paths = model.predict_from(later, [3], horizon=f"{hours}h")
        assert np.isfinite(paths).all()
        shared = min(paths.shape[1], day.shape[1])
        np.testing.assert_allclose(paths[:, :shared], day[:, :shared], rtol=1e-5, atol=1e-5)
    assert np.isnan(model.predict_from(later, [len(later) - 1])).all()


def test_predict_is_made_of_forecasts_from_local_midnights(fitted):
    model, X, _, cut = fitted
    later = X.iloc[cut:]
    predicted = model.predict(later)
    midnights = np.flatnonzero((later.index.hour == 0) & (later.index.minute == 0))
    origin = int(midnights[2])
    per_day = int(midnights[3] - midnights[2])
    np.testing.assert_allclose(
        predicted[origin + 1 : origin + per_day + 1], model.predict_from(later, [origin])[0], rtol=1e-5, atol=1e-5
    )


def test_a_model_can_be_pickled(fitted):
    model, X, _, cut = fitted
    copy = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(copy.predict(X.iloc[cut:]), model.predict(X.iloc[cut:]))


# ----------------------------------------------------------------------------------------------------------- the future
@pytest.mark.parametrize("fitted", FORECASTERS, ids=_name, indirect=True)
def test_forecast_of_history_and_future_is_predict_from_its_last_row(fitted):
    model, X, _, cut = fitted
    history, future = X.iloc[cut : cut + 31], X.iloc[cut + 31 : cut + 31 + 24]
    series = model.forecast(history, future.drop(columns="zeta"))
    assert series.index.equals(future.index)
    assert series.name == "zeta"
    np.testing.assert_allclose(series, model.predict_from(X.iloc[cut:], [30])[0], rtol=1e-5, atol=1e-5)
    # The kept end of the training table is as good a history as all of it.
    kept, whole = (model.forecast(past, X.iloc[cut : cut + 24]) for past in (None, X.iloc[:cut]))
    np.testing.assert_allclose(kept, whole, rtol=1e-5, atol=1e-5)


def test_a_forecast_needs_no_plant_ahead_where_the_case_reads_its_past_only():
    X, y = hourly()
    model = DisturbanceForecaster("mlp", case="case16", residual_of=None, **TINY).fit(X.iloc[:-48], y.iloc[:-48])
    history, future = X.iloc[-200:-48], X.iloc[-48:].drop(columns="zeta")
    known, unknown = (model.forecast(history, ahead[:24]) for ahead in (future, future.drop(columns="u_heat")))
    np.testing.assert_array_equal(known, unknown)
    with pytest.raises(ValueError, match="no column 'u_heat'"):  # the second day reads the plant of the first
        model.forecast(history, future.drop(columns="u_heat"))


def test_forecast_refuses_a_gap_a_missing_column_and_what_is_no_table():
    X, y = hourly(14)
    model = DisturbanceForecaster("ridge").fit(X.iloc[:200], y.iloc[:200])
    with pytest.raises(ValueError, match="it must begin one step of 1 h later"):
        model.forecast(X.iloc[200:210], X.iloc[212:230])
    with pytest.raises(ValueError, match="has time stamps and the training table has none, or the reverse"):
        model.forecast(X.iloc[200:210].reset_index(drop=True), X.iloc[210:230])
    with pytest.raises(ValueError, match="X has no column 'q_sol', which the training table has"):
        model.forecast(X.iloc[200:210], X.iloc[210:230].drop(columns="q_sol"))
    with pytest.raises(ValueError, match="history is a ndarray; give a pandas DataFrame"):
        model.forecast(X.iloc[200:210].to_numpy(), X.iloc[210:230])
    with pytest.raises(ValueError, match="history and future need at least one row each"):
        model.forecast(X.iloc[200:210], X.iloc[:0])


def test_forecast_refuses_what_would_start_it_without_a_past_or_a_clock():
    X, y = hourly(14)
    model = DisturbanceForecaster("persistence").fit(X.iloc[:200], y.iloc[:200])
    with pytest.raises(ValueError, match="X has no column 'zeta'"):
        model.forecast(X.iloc[210:220].drop(columns="zeta"), X.iloc[220:230])
    following = model.forecast(X.iloc[200:220].drop(columns="zeta"), X.iloc[220:230])  # the past is the training's end
    np.testing.assert_array_equal(following, np.full(10, y.iloc[199]))
    for history in (None, X.iloc[210:220]):
        with pytest.raises(ValueError, match="has time stamps and the training table has none, or the reverse"):
            model.forecast(history, X.iloc[220:230].reset_index(drop=True))


@pytest.mark.parametrize(
    ("history", "future", "message"),
    [
        (slice(200, 210), slice(212, 230), "rows are missing: index 209 is followed by 212"),
        (slice(200, 210), slice(205, 230), "not in time order: index 209 is followed by 205"),
    ],
)
def test_forecast_refuses_row_numbers_that_do_not_go_on(history, future, message):
    X, y = (data.reset_index(drop=True) for data in hourly(14))
    model = DisturbanceForecaster("profile", sampling_time="1h").fit(X.iloc[:200], y.iloc[:200])
    with pytest.raises(ValueError, match=message):
        model.forecast(X.iloc[history], X.iloc[future])
    following = model.forecast(X.iloc[200:210], X.iloc[210:230])
    np.testing.assert_array_equal(following, model.predict_from(X.iloc[200:230], [9], "20h")[0])


def test_history_may_come_from_the_target():
    X, y = hourly(14)
    without = X.drop(columns="zeta")
    model = DisturbanceForecaster("persistence").fit(without.iloc[:250], y.iloc[:250])
    assert model.predict(without.iloc[250:])[0] == y.iloc[249]
    series = model.forecast(X.iloc[250:260], without.iloc[260:270])
    np.testing.assert_array_equal(series, np.full(10, y.iloc[259]))


# -------------------------------------------------------------------------------------------------------- repeatability
def _fit_and_predict(model, X, y):
    return model.fit(X.iloc[:400], y.iloc[:400]).predict(X.iloc[400:])


@pytest.mark.slow
def test_a_network_is_the_same_to_the_bit_in_other_processes_and_threads():
    X, y = hourly()
    models = [DisturbanceForecaster(m, residual_of=None, **{**TINY, "hidden_size": 20}) for m in NETWORKS]
    here = [_fit_and_predict(model, X, y) for model in models]
    for backend in ("threading", "loky"):
        there = Parallel(n_jobs=2, backend=backend)(delayed(_fit_and_predict)(model, X, y) for model in models)
        for a, b in zip(here, there, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("model", NETWORKS)
def test_torch_s_global_state_is_neither_read_nor_changed(model):
    import torch

    X, y = hourly(14)
    forecaster = DisturbanceForecaster(model, residual_of=None, dropout=0.5, **TINY)
    seen = []
    for seed in (1, 2):
        torch.manual_seed(seed)
        before, threads = torch.get_rng_state(), torch.get_num_threads()
        seen.append(forecaster.fit(X, y).predict(X))
        assert torch.equal(torch.get_rng_state(), before)
        assert torch.get_num_threads() == threads
    np.testing.assert_array_equal(*seen)
    other = forecaster.set_params(random_state=1).fit(X, y).predict(X)
    forecaster.set_params(random_state=0)
    assert not np.array_equal(other, seen[0])


def test_numpy_s_global_state_is_left_alone():
    X, y = hourly(14)
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    DisturbanceForecaster("mlp", max_epochs=1).fit(X, y)
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


WITHOUT_TORCH = """
import sys
sought = []
class Blocked:  # None in sys.modules would stop scipy, which looks there for torch
    def find_spec(self, name, *_):
        if name.split(".")[0] in ("torch", "skorch"):
            sought.append(name)
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocked())
import numpy as np
from sklearn.linear_model import Ridge
from skhybrid.forecasting import ARXRegressor, DisturbanceForecaster, fit_many, list_cases, list_sizes
from skhybrid.forecasting.named_models import networks_available, require_networks
from skhybrid.model_selection.search.candidates import settings_of
X = np.random.default_rng(0).normal(size=(24 * 10, 2)); y = X.sum(axis=1)
names = ("ridge", "profile", "last_week", "persistence", Ridge())
models = [DisturbanceForecaster(m, sampling_time="1h") for m in names]
for model in [*fit_many(models, X, y), ARXRegressor(sampling_time="1h").fit(X, y)]:
    assert np.isfinite(model.predict(X)).all()
for model in ("ridge", "profile", "last_week", "persistence"):
    DisturbanceForecaster(model, sampling_time="1h").fit(X, y).predict(X)
assert not sought and "matplotlib" not in sys.modules, sought
assert not networks_available() and sought
list_cases("lstm"), list_sizes("lstm"), settings_of(models[0], X, y, [], None)
require_networks("ridge"), require_networks(Ridge())
for model in ("mlp", "cnn", "rnn", "lstm"):
    for ask in (lambda: DisturbanceForecaster(model).fit("no table", None), lambda: require_networks(model)):
        try:
            ask()
        except ImportError as error:
            print(error)
"""


def test_without_torch_all_but_networks_works_and_these_name_the_extra_at_once():
    """Baselines do not even look for torch or skorch."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_TORCH], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    wanted = 'model={!r} needs torch and skorch; install them with pip install "skhybrid[networks]".'
    assert done.stdout.splitlines() == [wanted.format(model) for model in NETWORKS for _ in range(2)]


# -------------------------------------------------------------------------------------------------------------- errors
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"model": "transformer"}, r"model='transformer' is not known; use mlp, cnn, rnn, lstm, profile"),
        ({"model": Ridge}, "nor a regressor instance"),
        ({"model": StandardScaler()}, r"model=StandardScaler\(\) is neither .* nor a regressor instance"),
        ({"case": "case18"}, r"case='case18' is not known for model='lstm'; use case01"),
        ({"activation": "tanh"}, r"activation='tanh' is not known; use one of 'relu', 'selu', 'gelu'"),
        ({"residual_of": "arima"}, r"residual_of='arima' is not known; use one of None, 'profile'"),
        ({"time_encoding": "fourier"}, "time_encoding='fourier' is not known"),
        ({"hidden_size": 0}, "hidden_size=0 must be an integer of at least 1"),
        ({"refit": "no"}, "refit='no' must be True or False"),
        ({"dropout": 1.0}, r"dropout=1.0 is outside \[0, 1\)"),
        ({"validation_fraction": None}, r"validation_fraction=None is outside \[0, 1\)"),
        ({"validation_fraction": 0}, r"validation_fraction=0 leaves no rows .* residual_of='ridge' to use"),
        ({"learning_rate": "fast"}, r"learning_rate='fast' is outside \(0, inf\)"),
        ({"random_state": "a"}, "random_state='a' must be an integer from 0 to 4294967295, a RandomState or None"),
        ({"random_state": -1}, "random_state=-1 must be an integer from 0 to 4294967295"),
        ({"horizon": "90min"}, "not a positive multiple of the sampling time"),
    ],
)
def test_a_wrong_setting_is_named_with_its_choices(settings, message):
    X, y = hourly(7)
    with pytest.raises(ValueError, match=message):
        DisturbanceForecaster(**settings).fit(X, y)


def test_baselines_ignore_the_settings_of_networks():
    """A design matrix sets those of the training once; values that no network could have are refused all the same."""
    X, y = hourly(7)
    DisturbanceForecaster("profile", "no such case", activation="gelu", hidden_size=3, max_epochs=2).fit(X, y)
    wrong = {"dropout": "abc", "max_epochs": object(), "device": [], "hidden_size": -1, "activation": "none"}
    for (name, value), model in product(wrong.items(), ("ridge", Ridge())):
        with pytest.raises(ValueError, match=f"{name}="):
            DisturbanceForecaster(model, **{name: value}).fit(X, y)


@pytest.mark.parametrize("model", [ARXRegressor(), BoostedRegressor(residual_of="arx", max_iter=5)], ids=_name)
def test_a_few_rows_are_warned_of_once(model):
    """A fit on a day was silent, and its forecasts were off by several kelvin."""
    X, y = zone(4)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        clone(model).fit(X[:120], y[:120])
        HybridPredictor(network="1R1C", intervals=False).fit(X[:120], y[:120])
        clone(model).fit(X[:192], y[:192])
    few = [str(w.message) for w in told if "are few" in str(w.message)]
    assert few == [f"{type(model).__name__}: 30 h of rows are few, so that forecasts are a guess; add days."]


def test_boosting_without_a_lead_to_learn_from_repeats_what_it_adds_to():
    """Rows of ten seconds in a few minutes: of the leads up to a day, half of the rows hold none."""
    X = zone()[0].iloc[:48]
    X = X.set_axis(pd.date_range("2024-01-01", periods=len(X), freq="10s"))
    model = BoostedRegressor(max_iter=3).fit(X, X["T_za"])
    assert model.booster_ is None
    np.testing.assert_allclose(model.predict_from(X, [23], "1min"), X["T_za"].iloc[23])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"max_iter": "abc"}, "max_iter='abc' must be an integer of at least 1"),
        ({"max_iter": 0}, "max_iter=0 must be an integer of at least 1"),
        ({"learning_rate": "fast"}, r"learning_rate='fast' is outside \(0, inf\)"),
    ],
)
def test_a_wrong_setting_of_boosting_is_named(settings, message):
    with pytest.raises(ValueError, match=message):
        BoostedRegressor(**settings).fit(*zone())


def test_a_role_that_the_case_needs_is_named():
    X, y = hourly(7)
    with pytest.raises(ValueError, match="role 'T_oa' is missing"):
        DisturbanceForecaster("lstm", **TINY).fit(X.drop(columns="T_oa"), y)
    with pytest.raises(ValueError, match="role 'u_heat', 'u_cool' or 'Q_hvac' is missing"):
        DisturbanceForecaster("mlp", case="case16", **TINY).fit(X.drop(columns="u_heat"), y)
    DisturbanceForecaster("lstm", case="case02", **TINY).fit(X[["zeta"]], y)


def test_missing_targets_are_left_out_up_to_a_share():
    X, y = hourly(21)
    holes = y.copy()
    holes.iloc[50:120] = np.nan
    for model in ("ridge", "profile", "mlp"):
        forecaster = DisturbanceForecaster(model, **TINY)
        assert np.isfinite(forecaster.fit(X.assign(zeta=holes), holes).predict(X)).all()
    holes.iloc[: 24 * 15] = np.nan
    with pytest.raises(ValueError, match=r"more than max_missing=0\.5"):
        forecaster.fit(X, holes)


def test_trees_that_forecast_nothing_are_few():
    """Steps of a random walk cannot be forecast, so that the last third is for few trees."""
    index = pd.date_range("2024-01-01", periods=20 * 24, freq="1h")
    y = pd.Series(20.0 + 0.3 * np.random.default_rng(0).normal(size=len(index)).cumsum(), index)
    X = pd.DataFrame({"T_oa": 0.0, "T_za": y}, index)
    assert BoostedRegressor(horizon="3h", max_iter=40, random_state=0).fit(X, y).n_iter_ < 20
