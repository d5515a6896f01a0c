"""The pieces of the forecast bench (benchmarks/): what its numbers are, and that no model is shown what it must not."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm
from scipy.stats import bootstrap
from sklearn.base import BaseEstimator

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import _forecast_tables
import forecast
import learning_curve
import set_points_known
from _forecast_baselines import Held, LeftAlone, Oracle, Yesterday
from _forecast_data import DataSet, Truth, data_sets, split
from _forecast_models import MODELS, Model, bounds_for
from _forecast_ratios import BLOCK, blocks_of, drawn_rows, paired, ratio
from _forecast_store import Errors, Run, assess, by_hour, is_done, load_errors, read_run, write_run
from _n4sid import N4SID

from skhybrid import GrayBoxRC
from skhybrid.datasets import make_office

STAGES = {"u_heat": 6.0, "u_cool": -6.0}


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=11, random_state=3)


@pytest.fixture
def data(office):
    """Eight days of training, three days after them."""
    X, rows = office.X, 8 * 96
    truth = Truth(office.heat_gain, office.gain_parts["air"], office.states)
    return DataSet("tiny", X[:rows], X[rows:], X.index[rows], "5h", capacity=STAGES, truth=truth)


def errors_of(squares, start="2024-01-01", step="7h"):
    origin = pd.Index(pd.date_range(start, periods=len(squares), freq=step).astype(str))
    return Errors(origin, np.asarray(squares, dtype=float), np.full(np.shape(squares), 4))


# ------------------------------------------------------------------------------------------------------ intervals
def test_ratio_and_interval_agree_with_scipy_where_origins_are_drawn_singly():
    rng = np.random.default_rng(0)
    common = rng.gamma(2.0, size=(180, 1))  # both err on the same days: the pairs matter
    mine, other = common * rng.gamma(8.0, size=(180, 24)), common * rng.gamma(9.0, size=(180, 24))
    step = str(BLOCK.components.days * 24) + "h"  # a block is one origin
    found = ratio([errors_of(mine, step=step)], [errors_of(other, step=step)], "any")

    def statistic(a, b, axis=-1):
        return np.sqrt(a.sum(axis=axis) / b.sum(axis=axis))

    sums = (mine.sum(axis=1), other.sum(axis=1))
    truth = bootstrap(
        sums, statistic, paired=True, vectorized=True, confidence_level=0.9, method="percentile", random_state=1
    ).confidence_interval
    assert found.value == pytest.approx(statistic(*sums))
    width = truth.high - truth.low
    assert found.low == pytest.approx(truth.low, abs=0.1 * width)
    assert found.high == pytest.approx(truth.high, abs=0.1 * width)


def test_blocks_are_runs_of_consecutive_origins_and_every_origin_is_as_likely():
    rows = drawn_rows(50, 7, 4000, np.random.default_rng(0))
    assert rows.shape == (4000, 50)
    for draw in rows[:20]:
        for first in range(0, 50, 7):
            block = draw[first : first + 7]
            assert [(block[0] + i) % 50 for i in range(len(block))] == list(block)
    share = np.bincount(rows.ravel(), minlength=50) / rows.size
    np.testing.assert_allclose(share, 1 / 50, rtol=0.1)


def test_a_block_lasts_three_days():
    assert [blocks_of(errors_of(np.ones((9, 24)), step=s).origin) for s in ("5h", "25h", "7D")] == [14, 3, 1]


def test_two_models_are_compared_at_their_common_origins_and_only_with_the_same_measurements():
    mine, other = errors_of(np.arange(48.0).reshape(2, 24)), errors_of(np.ones((3, 24)))
    first, second, common = paired(mine, other)
    assert len(common) == 2
    assert list(first) == [np.arange(24).sum(), np.arange(24, 48).sum()]
    assert list(second) == [24.0, 24.0]
    with pytest.raises(ValueError, match="different rows"):
        paired(mine, other._replace(count=other.count + 1))


# --------------------------------------------------------------------------------------------------------- errors
def test_errors_by_hour_ahead_are_those_of_a_plain_loop():
    rng = np.random.default_rng(1)
    origin, lead = np.repeat(list("abc"), 100), np.tile(np.arange(1, 101), 3)
    error = rng.normal(size=300)
    error[rng.random(300) < 0.2] = np.nan
    found = by_hour(origin, np.ceil(lead / 4), error)  # rows of 15 min; 25 hours, of which 24 count
    for i, name in enumerate("abc"):
        for hour in range(1, 25):
            mine = [
                e for o, k, e in zip(origin, lead, error, strict=True) if o == name and 4 * hour - 4 < k <= 4 * hour
            ]
            known = [e for e in mine if np.isfinite(e)]
            assert found.count[i, hour - 1] == len(known)
            assert found.square[i, hour - 1] == pytest.approx(sum(e**2 for e in known))
    assert _forecast_tables.rmse(found) == pytest.approx(np.sqrt(np.nanmean(error[lead <= 96] ** 2)))


def test_a_load_that_is_one_kilowatt_off_has_an_error_of_one_kilowatt_at_every_hour(data):
    class Off(BaseEstimator):
        def __init__(self, origin_step=None):
            self.origin_step = origin_step

        def predict_load(self, X, setpoint, limits):
            # known stages, 1 kW too much at first and then too little
            extra = np.where(np.arange(len(X)) < 96, 1.0, -1.0) / 6.0
            return pd.DataFrame({"u_heat": X["u_heat"] + extra, "u_cool": X["u_cool"]})

    found, mean = load_errors(Off(), data, data.later)
    np.testing.assert_allclose(found.square, found.count)  # each squared error is 1 kW2
    assert found.count[0].tolist() == [4] * 24
    assert mean == pytest.approx((6.0 * (data.later["u_heat"] - data.later["u_cool"]).abs())[:-1].mean())


# ----------------------------------------------------------------------------------------------------- the oracle
def independent_simulation(theta, step_hours, state, rows, gains):
    """The TRUE network by the exponential of the augmented matrix (paper 2.1)."""
    p, M = theta, np.zeros((7, 7))
    M[0, :2] = [-1 / (p["C_w"] * p["R_zw"]), 1 / (p["C_w"] * p["R_zw"])]
    M[1, :2] = [1 / (p["C_za"] * p["R_zw"]), -(1 / p["R_zw"] + 1 / p["R_zo"]) / p["C_za"]]
    M[0, 3] = (1 - p["f"]) * p["A_win"] / p["C_w"]
    M[1, 2:] = np.array([1 / p["R_zo"], p["f"] * p["A_win"], p["Q_h"], p["Q_c"], 1.0]) / p["C_za"]
    step, out = expm(M * step_hours), []
    for row, gain in zip(rows, gains, strict=True):
        state = (step @ np.concatenate([state, row, [gain]]))[:2]
        out.append(state[1])
    return np.array(out)


def test_the_oracle_is_the_true_network_under_the_mean_gains_of_its_hour():
    office = make_office(n_days=16, sampling_time="5min", random_state=5)
    day = 288
    train, later = office.X[: 14 * day], office.X[14 * day :]
    oracle = Oracle(Truth(office.heat_gain, office.gain_parts["air"], office.states)).fit(train, train["T_za"])
    seen: dict[tuple[int, int], list[float]] = {}
    for stamp, heat in office.heat_gain[: 14 * day].items():
        seen.setdefault((stamp.day_of_week, stamp.hour), []).append(heat)
    for origin in (0, 100):
        ahead = later.iloc[origin : origin + day]
        gains = [np.mean(seen[stamp.day_of_week, stamp.hour]) for stamp in ahead.index]
        state = office.states.loc[later.index[origin]].to_numpy()
        inputs = ahead[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy()
        expected = independent_simulation(office.theta, 1 / 12, state, inputs, gains)
        np.testing.assert_allclose(oracle.predict_from(later, [origin])[0], expected, atol=1e-9)


def test_the_oracle_without_gains_is_the_run_itself():
    office = make_office(n_days=9, sampling_time="5min", pattern="none", random_state=5)
    train, later = office.X[: 7 * 288], office.X[7 * 288 :]
    truth = Truth(office.heat_gain, office.gain_parts["air"], office.states)
    path = Oracle(truth).fit(train, train["T_za"]).predict_from(later, [10])[0]
    np.testing.assert_allclose(path, office.states.loc[later.index[11:299], "T_za"], atol=1e-9)


def test_the_oracle_with_air_takes_the_heat_of_air_from_its_conductance(office):
    air = 0.05 * (office.X["T_oa"] - office.states["T_za"])
    oracle = Oracle(Truth(air + 0.4, air, office.states), knows_air=True).fit(office.X, office.y)
    np.testing.assert_allclose(oracle.conductance_, 0.05, rtol=1e-9)
    np.testing.assert_allclose(oracle.level_, 0.4, rtol=1e-9)


# ---------------------------------------------------------------------------------------------------------- leaks
RIVALS = {
    "yesterday": Yesterday(),
    "held": Held(),
    "alone": LeftAlone(GrayBoxRC(known={"Q_h": 6.0}, n_starts=1, random_state=0)),
    "N4SID": N4SID(),
}


@pytest.mark.parametrize("name", RIVALS)
def test_no_model_reads_a_temperature_after_the_origin(name, data):
    model = RIVALS[name].fit(data.train, data.train["T_za"])
    origins = np.array([0, 50])
    usual = model.predict_from(data.later, origins)
    other = data.later.assign(T_za=np.where(np.arange(len(data.later)) > 50, 99.0, data.later["T_za"]))
    assert np.array_equal(model.predict_from(other, origins), usual)
    assert usual.shape == (2, 96)
    assert np.isfinite(usual).all()


def test_yesterday_is_the_row_of_a_day_before_also_across_the_end_of_training(data):
    model = Yesterday().fit(data.train, data.train["T_za"])
    whole = pd.concat([data.train, data.later])["T_za"]
    for origin in (0, 40, 130):
        day_before = whole[data.later.index[origin] - pd.Timedelta("1D") :].iloc[1:97]
        np.testing.assert_array_equal(model.predict_from(data.later, [origin])[0], day_before)


class Spy(BaseEstimator):
    """Remembers what it was shown."""

    seen: list = []  # noqa: RUF012

    def fit(self, X, y):
        Spy.seen.append((X, y))
        self.fitted_ = True
        return self

    def predict_from(self, X, origins, horizon=None):
        Spy.seen.append((X, origins))
        return np.zeros((len(origins), 96))


def test_a_fit_sees_training_rows_only_and_no_beam_or_sky(data):
    Spy.seen.clear()
    dressed = DataSet(
        data.name, data.train.assign(dni=0.1), data.later.assign(dni=0.1), data.start, "5h", truth=data.truth
    )
    run = assess(dressed, "spy", Model(lambda data, seed: Spy(), "networks"), 0, "a")
    (X, y), (later, origins) = Spy.seen
    assert X.index[-1] < data.start
    assert list(X.columns) == list(later.columns) == ["T_oa", "q_sol", "u_heat", "u_cool", "T_za"]
    assert y.index.equals(X.index)
    assert (later.index[origins] >= data.start).all()
    assert np.array_equal(np.diff(origins), np.full(len(origins) - 1, 20))  # 5 h
    rows = origins[:, None] + np.arange(1, 97)
    assert run.temperature.square.sum() == pytest.approx((later["T_za"].to_numpy()[rows] ** 2).sum())
    assert run.facts["predict_ms"] >= 0.0


def test_another_control_begins_one_step_later_so_that_it_follows_no_training(office):
    spans = ("2023-07-08", "2023-07-11", "2023-07-13", "2023-07-14")
    same = split("a", office.X, office.X, spans, "5h")
    new = split("b", office.X, office.X.copy(), spans, "5h")
    assert same.train.index[-1] == pd.Timestamp("2023-07-11 23:45")
    assert same.later.index[0] == pd.Timestamp("2023-07-12 00:00")
    assert new.later.index[0] == pd.Timestamp("2023-07-12 00:15")
    assert same.start == new.start == pd.Timestamp("2023-07-13")
    assert same.later.index[-1] == pd.Timestamp("2023-07-14 23:45")


def test_further_buildings_are_read_with_their_place_spans_and_right_labels(tmp_path):
    folder = tmp_path / "held"
    folder.mkdir()
    stamps = pd.date_range("2018-01-01 00:15", periods=12 * 96, freq="15min", tz="Etc/GMT+5")
    ramp = np.arange(len(stamps), dtype=float)
    for control, offset in (("irregular", 0.0), ("shifted", 1e4)):
        names = ["T_in_degC", "T_out_degC", "ghi_kW_m2", "dni_kW_m2", "dhi_kW_m2", "q_hvac_kW", "truth_gains_kW"]
        table = pd.DataFrame(dict.fromkeys(names, ramp + offset), index=stamps.map(pd.Timestamp.isoformat))
        table.rename_axis("timestamp").to_csv(folder / f"shop_{control}.csv")
    spans = {"train_start": "2018-01-02", "train_end": "2018-01-05", "test_start": "2018-01-07"}
    row = {"name": "shop", "latitude": 40.0, "longitude": -75.0, "season": "winter", "test_end": "2018-01-10"}
    pd.DataFrame([row | spans]).to_csv(folder / "meta.csv", index=False)
    found = {n: load for n, load in data_sets([folder]).items() if n.startswith("held: ")}
    assert list(found) == ["held: shop winter, same control", "held: shop winter, new control"]
    same, new = (load(0) for load in found.values())
    assert same.site == new.site == (40.0, -75.0)
    assert "truth_gains_kW" not in same.train
    assert same.start == pd.Timestamp("2018-01-07 00:00-05:00")
    # a temperature holds at its stamp; heat is the mean of the 15 min that end at the stamp
    first = same.train.iloc[0]
    assert same.train.index[0] == pd.Timestamp("2018-01-02 00:00-05:00")
    assert (first["T_za"], first["Q_hvac"]) == (95.0, 96.0)
    pd.testing.assert_frame_equal(new.train, same.train)
    assert new.later["T_za"].min() > 1e4
    assert same.limits() == (0.0, float(same.later["Q_hvac"].max()))


# ---------------------------------------------------------------------------------------------------------- store
def test_a_run_is_read_as_it_was_written_and_redone_by_another_tag(tmp_path):
    rng = np.random.default_rng(0)
    errors = errors_of(rng.random((5, 24)))
    load = errors_of(rng.random((2, 24)))
    facts = {"data": "home, 2", "model": "ARX re-fitted", "seed": 1, "tag": "x", "fit_seconds": 0.5, "load_mean": 2.0}
    assert not is_done("home, 2", "ARX re-fitted", 1, None, tmp_path)
    path = write_run(Run(facts, errors, load), tmp_path)
    back = read_run(path)
    assert back.facts == facts
    for mine, truth in ((back.temperature, errors), (back.load, load)):
        assert list(mine.origin) == list(truth.origin)
        np.testing.assert_allclose(mine.square, truth.square, rtol=1e-6)
        np.testing.assert_array_equal(mine.count, truth.count)
    assert is_done("home, 2", "ARX re-fitted", 1, None, tmp_path)
    assert is_done("home, 2", "ARX re-fitted", 1, "x", tmp_path)
    assert not is_done("home, 2", "ARX re-fitted", 1, "y", tmp_path)
    assert not is_done("home, 2", "ARX", 1, None, tmp_path)


def test_names_are_chosen_by_beginning_or_pattern():
    names = ["ARX", "ARX re-fitted", "ridge"]
    assert forecast.chosen(names, ["ARX"]) == ["ARX"]
    assert forecast.chosen(names, ["AR*"]) == forecast.chosen(names, ["A"]) == ["ARX", "ARX re-fitted"]
    with pytest.raises(SystemExit, match="'nobody'"):
        forecast.chosen(names, ["nobody"])


def test_the_command_fills_what_is_missing_and_writes_tables_and_a_picture(data, tmp_path, monkeypatch, capsys):
    loads = []
    other = replace(data, name="dev: tiny summer, new control")
    loaders = {d.name: lambda seed, d=d: loads.append(seed) or d for d in (data, other)}
    monkeypatch.setattr(forecast, "data_sets", lambda buildings: loaders)
    arguments = ["--models", "yesterday", "ARX", "ARX re-fitted", "oracle", "--store", str(tmp_path / "store")]
    arguments += ["--results", str(tmp_path)]
    forecast.main(arguments)
    assert loads == [0, 0]
    text = (tmp_path / "forecast.md").read_text(encoding="utf-8")
    assert "Times" in text
    assert (tmp_path / "forecast.png").stat().st_size > 5000
    assert "Ratio to ARX, further buildings, dev" in text
    table = pd.read_csv(tmp_path / "forecast.csv").set_index(["data", "model"]).loc["tiny"]
    assert list(table.index) == ["yesterday", "ARX", "ARX re-fitted", "oracle"]
    later, T = data.later, data.later["T_za"].to_numpy()
    whole = pd.concat([data.train, later])["T_za"].to_numpy()
    truth = [
        (T[o + k] - whole[8 * 96 + o + k - 96]) ** 2
        for o in range(0, len(T), 20)
        for k in range(1, 97)
        if o + 96 < len(T)
    ]
    assert table.loc["yesterday", "rmse"] == pytest.approx(np.sqrt(np.mean(truth)), rel=1e-3)
    assert table.loc["ARX", "to_arx"] == 1.0
    assert table.loc["yesterday", "to_arx"] == pytest.approx(
        table.loc["yesterday", "rmse"] / table.loc["ARX", "rmse"], rel=2e-3
    )
    forecast.main(arguments)  # all is there
    assert loads == [0, 0]
    forecast.main([*arguments, "--tag", "new", "--data", "tiny", "--models", "ARX"])
    assert loads == [0, 0, 0]
    capsys.readouterr()


def test_each_lead_is_compared_with_the_best_competitor_there():
    facts = {"data": "tiny", "seed": 0}
    levels = {"hybrid, full": np.full(24, 2.0), "ARX": np.full(24, 2.5), "N4SID": np.full(24, 2.2)}
    levels["ARX"][5] = 1.0  # better only six hours ahead
    levels["oracle"] = np.full(24, 0.1)  # is no competitor
    runs = {("tiny", m): [Run(facts, errors_of(np.tile(level**2, (9, 1))), None)] for m, level in levels.items()}
    (row,) = _forecast_tables.beside_the_best(runs).to_dict("records")
    assert row.pop("best competitor") == "N4SID"
    assert row == {"all leads": "0.91", "1 h": "0.91", "6 h": "2.00", "12 h": "0.91", "24 h": "0.91"}
    (goal,) = _forecast_tables.goals(runs).to_dict("records")
    assert goal["to best competitor, at most 0.95"].startswith("0.91 ")
    assert goal["to ARX re-fitted, at most 0.95"] == ""


def test_lengths_of_training_end_at_one_date_and_share_their_test(monkeypatch, tmp_path):
    run = make_office(n_days=22, random_state=1).X  # from 8 July
    cut = {days: learning_curve._cut(lambda: run, "log", "2023-07-16", days, "7h") for days in (3, 7)}
    for days, found in cut.items():
        assert len(found.train) == days * 96
        assert found.train.index[-1] == pd.Timestamp("2023-07-15 23:45")
        assert found.later.index[0] == found.start == pd.Timestamp("2023-07-16")
    pd.testing.assert_frame_equal(cut[3].later, cut[7].later)
    monkeypatch.setattr(
        learning_curve, "cases", lambda: {("log", "2023-07-16", days): lambda d=d: d for days, d in cut.items()}
    )
    arguments = ["--models", "yesterday", "ARX", "--store", str(tmp_path / "store"), "--results", str(tmp_path)]
    learning_curve.main(arguments)
    table = pd.read_csv(tmp_path / "learning_curve.csv").set_index(["days", "model"])
    assert len(table) == 4
    # yesterday does not learn, and is the best simple one here
    assert table.loc[(3, "yesterday"), "rmse"] == table.loc[(7, "yesterday"), "rmse"]
    expected = table.loc[(7, "ARX"), "rmse"] / table.loc[(7, "yesterday"), "rmse"]
    assert table.loc[(7, "ARX"), "to_best_simple"] == pytest.approx(expected, rel=2e-3)
    assert (tmp_path / "learning_curve.png").stat().st_size > 5000


def test_bounds_move_with_the_plant_and_leave_their_products_alone(data):
    assert bounds_for(data) is None  # stages only
    heated = data.train.assign(Q_hvac=np.linspace(-30.0, 12.0, len(data.train)))
    found = bounds_for(replace(data, train=heated))  # five times the paper's 6 kW
    assert found["C_w"] == found["C_za"] == (0.5, 200.0)
    assert found["R_zw"] == found["R_zo"] == (0.02, 8.0)
    assert found["A_win"] == (0.5, 125.0)
    small = bounds_for(replace(data, train=data.train.assign(Q_hvac=1.0)))
    assert small["C_w"] == (0.1, 40.0)


def test_every_model_of_the_bench_can_be_made_and_cloned_apart(data):
    for name, spec in MODELS.items():
        if spec.applies(data):
            assert spec.make(data, 0) is not spec.make(data, 0), name


def test_the_task_without_heat_finds_its_logs():
    assert {"make_office oakland", "make_office chicago"} <= set(set_points_known.logs([]))
