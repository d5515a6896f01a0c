"""Paths of a forecast: the quantiles of each row, in the order of errors that past forecasts made along a day."""

import numpy as np
import pandas as pd
import pytest

from skhybrid import DisturbanceForecaster, HybridPredictor, InputDisturbanceID, SchedulePredictor, TwoStagePredictor
from skhybrid.datasets import make_office
from skhybrid.exceptions import TooFewDaysError
from skhybrid.hybrid.joint_errors import JointErrors
from skhybrid.persistence import load_model, save_model

DAY, TRAINED = 24, 28 * 24
PLANT = ["u_heat", "u_cool"]
LEVELS = (0.1, 0.5, 0.9)


@pytest.fixture(scope="module", autouse=True)
def quick(quick_fits):
    """Models are learned in a moment."""


@pytest.fixture(scope="module")
def log():
    office = make_office(36, "chicago", start="2023-10-02", random_state=3, sampling_time="1h", excitation=None)
    return office.X.join(office.setpoints)


@pytest.fixture(scope="module")
def model(log):
    return SchedulePredictor("2R2C", known={"Q_h": 6.0}).fit(log[:TRAINED], log["T_za"][:TRAINED])


def ahead(log, first=TRAINED):
    """A day under set-points."""
    return log[first : first + DAY].drop(columns=[*PLANT, "T_za"])


def paths_of(samples, name):
    """(n_samples, n_rows) of a column."""
    return samples[name].to_numpy().reshape(samples.index.levshape)


@pytest.mark.parametrize("now", [None, 20.5])
def test_each_row_has_the_quantiles_of_the_forecast(log, model, now):
    n = 40
    levels = list((np.arange(n) + 0.5) / n)
    frame = model.forecast(None, ahead(log), now, quantiles=levels)
    samples = model.sample(None, ahead(log), n, now, random_state=0)
    assert list(samples) == ["Q_hvac", "T_za"]
    assert samples.index.names == ["sample", "time"]
    pd.testing.assert_index_equal(samples.loc[3].index, frame.index, check_names=False)
    for name, prefix in (("T_za", "q_"), ("Q_hvac", "Q_hvac_")):
        bands = frame[[f"{prefix}{level:g}" for level in levels]].to_numpy()
        np.testing.assert_array_equal(np.sort(paths_of(samples, name), axis=0).T, np.sort(bands, axis=1))


def test_under_given_heat_a_path_is_one_of_temperatures(log, model):
    future = log[TRAINED : TRAINED + DAY].drop(columns="T_za")
    samples = model.sample(None, future, 200, random_state=0)
    assert list(samples) == ["T_za"]
    frame = model.forecast(None, future, quantiles=LEVELS)
    found = np.quantile(paths_of(samples, "T_za"), LEVELS, axis=0).T
    np.testing.assert_allclose(found, frame[[f"q_{level}" for level in LEVELS]], atol=0.02)


def test_a_seed_fixes_the_paths_and_none_leaves_the_global_one_alone(log, model):
    first, again, other = (model.sample(None, ahead(log), 20, random_state=seed) for seed in (0, 0, 1))
    pd.testing.assert_frame_equal(first, again)
    assert not first.equals(other)
    position = np.random.get_state()[2]  # noqa: NPY002
    model.sample(None, ahead(log), 5)
    assert np.random.get_state()[2] == position  # noqa: NPY002


def test_errors_last_along_a_path(log, model):
    """Of temperatures, one row is near the next; so the mean of a day spreads more than of rows in any order."""
    future = log[TRAINED : TRAINED + DAY].drop(columns="T_za")
    T = paths_of(model.sample(None, future, 300, random_state=0), "T_za")
    apart = np.random.default_rng(0).permuted(T, axis=0)
    assert T.mean(axis=1).std() > 2.0 * apart.mean(axis=1).std()
    ranks = pd.DataFrame(T).rank()
    assert ranks[12].corr(ranks[13]) > 0.8


def test_a_saved_model_draws_the_same_paths(log, model, tmp_path):
    save_model(model, tmp_path / "model.skops")
    again = load_model(tmp_path / "model.skops")
    for future in (ahead(log), log[TRAINED : TRAINED + DAY].drop(columns="T_za")):
        found, expected = (one.sample(None, future, 20, random_state=0) for one in (again, model))
        pd.testing.assert_frame_equal(found, expected)


def test_the_front_and_two_stages_draw_paths(log):
    train = log[:TRAINED].drop(columns=["T_heat_set", "T_cool_set"])
    future = log[TRAINED : TRAINED + DAY].drop(columns=["T_za", "T_heat_set", "T_cool_set"])
    gray_box = InputDisturbanceID("1R1C", known={"Q_h": 6.0}, n_starts=1)
    for model in (HybridPredictor(network="1R1C"), TwoStagePredictor(gray_box, DisturbanceForecaster("profile"))):
        samples = model.fit(train, train["T_za"]).sample(train, future, 10, random_state=0)
        assert samples.shape == (10 * DAY, 1)
        assert np.isfinite(samples.to_numpy()).all()


def test_what_cannot_be_drawn_is_refused(log, model):
    with pytest.raises(ValueError, match="n_samples=0 must be an integer of at least 1"):
        model.sample(None, ahead(log), 0)
    with pytest.raises(ValueError, match="random_state='a' must be an integer"):
        model.sample(None, ahead(log), 5, random_state="a")
    future = log[TRAINED : TRAINED + DAY].drop(columns="T_za")
    without = SchedulePredictor("1R1C", intervals=False).fit(log[:TRAINED], log["T_za"][:TRAINED])
    with pytest.raises(TooFewDaysError, match="intervals=False"):
        without.sample(None, future, 5)


# ------------------------------------------------------------------------------------------------------ joint errors
def made(n_origins=60, n_leads=4, n_quantities=2, seed=0):
    """Errors from an origin every 3 h."""
    values = np.random.default_rng(seed).normal(size=(n_origins, n_leads, n_quantities)).round(2)
    index = pd.date_range("2024-01-01", periods=3 * n_origins, freq="1h")
    return values, JointErrors.of(values, index, np.arange(0, 3 * n_origins, 3))


def test_paths_have_the_ranks_of_errors_from_about_the_hour():
    values, joint = made()
    n, rows = 25, 6
    bands = np.arange(n)[None, :, None] + 100.0 * np.arange(rows)[:, None, None] + 1000.0 * np.arange(2)
    paths = joint.in_order(bands, 13.0, np.random.RandomState(3))
    assert paths.shape == (n, rows, 2)
    near = [k for k in range(60) if 3 * k % 24 == 12]
    drawn = np.random.RandomState(3).choice(near if len(near) >= 10 else range(60), n)
    for row in range(rows):
        lead = min(row, 3)
        for q in range(2):
            errors = values[drawn, lead, q].astype(np.float16)
            ranks = paths[:, row, q] - 100.0 * row - 1000.0 * q
            assert sorted(ranks) == list(range(n))
            assert (np.diff(errors[np.argsort(ranks)]) >= 0.0).all()


def test_errors_of_any_hour_serve_where_few_are_from_about_it():
    values, joint = made()
    few = JointErrors(joint.values, np.where(np.arange(60) < 9, 0.0, 12.0))
    bands = np.zeros((4, 400, 2)) + np.arange(400)[:, None]
    drawn = np.random.RandomState(0).choice(np.arange(60), 400)
    first = few.in_order(bands, 0.0, np.random.RandomState(0))[:, 0, 0]
    errors = values[drawn, 0, 0].astype(np.float16)
    assert (np.diff(errors[np.argsort(first)]) >= 0.0).all()


def test_equal_errors_are_ordered_by_chance():
    """Hours without load have no error; the order of one must not go on into the next."""
    joint = JointErrors(np.zeros((20, 2, 1), dtype=np.float16), np.zeros(20))
    paths = joint.in_order(np.zeros((2, 500, 1)) + np.arange(500)[:, None], 0.0, np.random.RandomState(0))[..., 0]
    assert abs(np.corrcoef(paths.T)[0, 1]) < 0.2


def test_a_missing_error_is_the_one_before_it():
    errors = np.array([[[1.0], [np.nan], [3.0]], [[np.nan], [2.0], [np.nan]]])
    found = JointErrors.of(errors, pd.RangeIndex(5), np.array([1, 3]))
    np.testing.assert_array_equal(found.values[..., 0], [[1.0, 1.0, 3.0], [2.0, 2.0, 2.0]])
    np.testing.assert_array_equal(found.hours, [0.0, 0.0])
    assert JointErrors.of(errors[:0], pd.RangeIndex(5), np.array([], dtype=int)) is None
