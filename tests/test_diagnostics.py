"""One-step errors are those of each predictor as a plain loop; their tests keep their level and say what is wrong."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID, RCNetwork
from skhybrid.datasets import make_office
from skhybrid.identification import (
    autocorrelation,
    cross_correlation,
    cumulative_periodogram,
    diagnose,
    diagnose_residuals,
    ljung_box,
    make_state_space,
)
from skhybrid.identification.one_step_errors import arma_prediction
from skhybrid.inspection import ResidualDisplay

STEP_H = 0.25


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=5, random_state=3)


@pytest.fixture(scope="module")
def gappy(office):
    y = office.y.copy()
    y.iloc[150:170] = np.nan
    y.iloc[300::7] = np.nan
    return office.X.assign(T_za=y), y


@pytest.fixture(scope="module")
def fitted(office, gappy):
    X, y = gappy
    known = office.theta
    return {
        "CONV": GrayBoxRC(known=known).fit(X, y),
        "OD": OutputDisturbanceID(known=known, n_starts=2, random_state=0).fit(X, y),
        "ID": InputDisturbanceID(known=known, n_starts=2, random_state=0).fit(X, y),
        "periodic": PeriodicDisturbanceID(known=known | {"tau": 4.0, "sigma_y": 0.05}, n_starts=1, random_state=0).fit(
            X, y
        ),
    }


def _network(office):
    model = make_state_space("2R2C", office.theta)
    return model.A, model.B, office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy() @ model.B[:, :4].T


# ---------------------------------------------------------------------------------------------------------- innovations
def test_errors_are_missing_where_the_measurement_is(fitted, gappy):
    X, y = gappy
    for name, model in fitted.items():
        found = model.innovations(X)
        assert list(found.columns) == ["innovation", "std"]
        expected = y.isna().to_numpy(copy=True)
        expected[: 96 if name == "CONV" else 0] = True
        np.testing.assert_array_equal(found["innovation"].isna(), expected)
        np.testing.assert_array_equal(found["std"].isna(), expected)
        assert (found["std"].dropna() > 0).all()


def raised(model, X):
    """Training errors, and by how much the standard deviation of each exceeds that of the steady state."""
    found = model.innovations(X).dropna()
    return found["innovation"], found["std"] / model.noise_std_


def test_the_squares_of_the_training_errors_are_the_loss(fitted, gappy):
    """Those of ID and OD over their variances, of which the geometric mean is left."""
    for name in ("CONV", "OD", "ID"):
        error, rise = raised(fitted[name], gappy[0])
        squares = ((np.exp(np.log(rise).mean()) * error / rise) ** 2).sum()
        assert squares == pytest.approx(fitted[name].loss_, rel=1e-9)
        assert (rise.max() > 1.2) == (name != "CONV")
        assert (rise.iloc[1] > 1.2) == (name == "ID")  # the wall of the first row is unknown


def test_standardised_training_errors_have_unit_variance(fitted, gappy):
    for name, n_own in (("CONV", 0), ("OD", 3), ("ID", 2)):  # of CONV without the rows from which it takes its state
        found = fitted[name].innovations(gappy[0]).dropna()
        error = found["innovation"]
        squares = ((error / found["std"]) ** 2).sum()
        assert squares == pytest.approx(len(error) - n_own, rel=1e-3)


@pytest.mark.parametrize("estimator", [GrayBoxRC, OutputDisturbanceID, InputDisturbanceID])
def test_a_table_with_a_gap_is_predicted_stretch_by_stretch(estimator, office):
    keep = np.r_[0:200, 300:480]
    X, y = office.X.iloc[keep], office.y.iloc[keep]
    settings = {} if estimator is GrayBoxRC else {"n_starts": 2, "random_state": 0}
    model = estimator(known=office.theta, **settings).fit(X, y)
    errors, (error, rise) = model.innovations(X), raised(model, X)
    squares = ((np.exp(np.log(rise).mean()) * error / rise) ** 2).sum()
    assert squares == pytest.approx(model.loss_, rel=1e-9)
    assert errors.index.equals(X.index)
    assert len(diagnose(model, X).standardised) == 480  # the gap counts as rows without a measurement


def test_two_rooms_have_errors_of_their_own():
    rooms = ("north", "south")
    flat = RCNetwork(
        "flat",
        {"north": "C_n", "south": "C_s"},
        {"R_ns": ("north", "south"), "R_no": ("north", "T_oa"), "R_so": ("south", "T_oa")},
        measured=rooms,
        disturbed=rooms,
        heated=rooms,
    )
    truth = {"C_n": 2.0, "C_s": 3.0, "R_ns": 4.0, "R_no": 8.0, "R_so": 6.0, "Q_h_north": 3.0}
    rng, index = np.random.default_rng(0), pd.date_range("2024-01-01", periods=240, freq="1h")
    X = pd.DataFrame({"T_oa": 5 + 3 * rng.normal(size=240), "u_heat_north": rng.uniform(size=240)}, index=index)
    model = make_state_space(flat, truth, roles=X.columns, sampling_time="1h")
    assert model.input_names == ("T_oa", "u_heat_north", "heat_gain_north", "heat_gain_south")
    s, path = np.array([20.0, 18.0]), []
    for row in X.to_numpy():
        path.append(s)
        s = model.A @ s + model.B @ np.append(row, [0.0, 0.0])
    X[["T_north", "T_south"]] = np.array(path) + [0.02, 0.1] * rng.normal(size=(240, 2))
    fitted = GrayBoxRC(flat, known=truth).fit(X, X[["T_north", "T_south"]])
    found = fitted.innovations(X)
    assert list(found.columns) == ["innovation_north", "innovation_south", "std_north", "std_south"]
    spread = found[["innovation_north", "innovation_south"]].std()
    assert spread["innovation_south"] == pytest.approx(0.1, rel=0.2)
    for output, room in enumerate(rooms):
        part = diagnose(fitted, X, output=output)
        np.testing.assert_array_equal(part.innovations["innovation"], found[f"innovation_{room}"])


def test_conv_simulates_after_a_day_of_filtering(fitted, office, gappy):
    A, _, forcing = _network(office)
    y = gappy[1].to_numpy()
    s, P, R = np.full(2, y[0]), np.diag([2.0, 0.5]) ** 2, 0.25**2 / 900
    predicted = np.empty(len(y))
    for k in range(len(y)):
        predicted[k] = s[1]
        if k < 96:
            gain = P[:, 1] / (P[1, 1] + R)
            s, P = s + gain * (y[k] - s[1]), P - np.outer(gain, P[1])
            P = A @ P @ A.T + 0.05**2 * np.eye(2)
        s = A @ s + forcing[k]
    errors = fitted["CONV"].innovations(gappy[0])["innovation"].to_numpy()
    np.testing.assert_allclose(errors[96:], (y - predicted)[96:], atol=1e-9)


def test_od_predicts_by_its_arma_model(fitted, office, gappy):
    A, _, forcing = _network(office)
    model, y = fitted["OD"], gappy[1].to_numpy()
    own = model.disturbance_
    a, b = own["rho_1"], own["rho_2"]
    # a textbook filter of the states (zeta, last error): y = C x + zeta + e
    big, drive = np.array([[a, b], [0.0, 0.0]]), np.array([0.0, 1.0])
    s, m, P = np.array([own["T0_w"], y[0]]), np.zeros(2), np.zeros((2, 2))
    errors, spreads = np.full(len(y), np.nan), np.full(len(y), np.nan)
    room, ahead = np.empty(len(y)), np.empty(len(y))
    for k in range(len(y)):
        m, P = (big @ m, big @ P @ big.T + np.outer(drive, drive)) if k else (m, np.outer(drive, drive))
        if np.isfinite(y[k]):
            errors[k], S = y[k] - s[1] - m.sum(), P.sum()
            spreads[k], gain = np.sqrt(S), P.sum(axis=1) / S
            m, P = m + gain * errors[k], P - np.outer(gain, P.sum(axis=0))
        room[k], ahead[k] = s[1], a * m[0] + b * m[1]  # without the disturbance; that of the next row
        s = A @ s + forcing[k]
    found = model.innovations(gappy[0])
    np.testing.assert_allclose(found["innovation"], errors, atol=1e-9)
    np.testing.assert_allclose(found["std"], model.noise_std_ * spreads, rtol=1e-9)
    for origin in (100, 160, 310):  # one of them within a gap
        path = model.predict_from(gappy[0], [origin], horizon="6h")[0]
        expected = room[origin + 1 : origin + 25] + ahead[origin] * a ** np.arange(24)
        np.testing.assert_allclose(path, expected, atol=1e-4)  # its gain settles


def test_id_filters_with_covariances_in_the_ratio_of_its_errors(fitted, office, gappy):
    A, B, forcing = _network(office)
    model, y = fitted["ID"], gappy[1].to_numpy()
    big = np.block([[A, B[:, 4:]], [np.zeros((1, 2)), np.eye(1)]])
    Q = np.diag(model.disturbance_[["sigma_x", "sigma_x", "sigma_zeta"]].to_numpy() ** 2)
    s, P, R = np.array([y[0], y[0], 0.0]), np.diag([2.0, 0.5, 1.0]) ** 2, 0.25**2 / 900
    errors, S = np.full(len(y), np.nan), np.empty(len(y))
    for k in range(len(y)):
        S[k] = P[1, 1] + R
        if np.isfinite(y[k]):
            errors[k] = y[k] - s[1]
            gain = P[:, 1] / S[k]
            s, P = s + gain * errors[k], P - np.outer(gain, P[1])
        s, P = big @ s + np.append(forcing[k], 0.0), big @ P @ big.T + Q
    found = model.innovations(gappy[0])
    np.testing.assert_allclose(found["innovation"], errors, atol=1e-8)
    scale = (found["std"] / np.sqrt(S)).dropna()
    np.testing.assert_allclose(scale, scale.iloc[0], rtol=1e-6)
    steady = found["std"].iloc[140]  # many rows after the start, before the first gap
    assert steady == pytest.approx(model.noise_std_, rel=1e-3)
    assert found["std"].iloc[170] > 1.5 * steady  # after twenty missing rows


def test_rows_after_the_training_table_begin_where_it_ended(office):
    model = OutputDisturbanceID(known=office.theta, n_starts=2, random_state=0).fit(office.X[:384], office.y[:384])
    after = model.innovations(office.X[384:])["innovation"]
    assert len(after) == 96
    assert abs(after.iloc[0]) < 5 * model.noise_std_
    whole = model.innovations(office.X)["innovation"].iloc[384:]
    np.testing.assert_allclose(after, whole, atol=0.02)  # the training's first row and its end are both estimates
    bare = office.X.drop(columns="T_za")
    with pytest.raises(ValueError, match="role 'T_za' is missing: innovations compare"):
        GrayBoxRC(known=office.theta).fit(bare, office.y).innovations(bare)


def test_a_copy_with_other_rows_begins_at_their_own_temperatures(office):
    """In two stretches of rows that are all 6 K colder, the errors are the same."""
    model = OutputDisturbanceID(known=office.theta, n_starts=2, random_state=0).fit(office.X[:192], office.y[:192])
    before, rows, found = model.disturbance_.copy(), np.r_[192:300, 350:480], []
    for colder in (0.0, 6.0):
        X = office.X.iloc[rows].copy()
        X[["T_oa", "T_za"]] -= colder
        copied = model.with_rows(X, X["T_za"])
        assert list(copied.disturbance_.index) == ["rho_1", "rho_gap", "rho_2", "T0_w", "T0_w_2"]
        assert copied.disturbance_["T0_w"] == pytest.approx(copied.initial_state_[0])
        found.append(copied.innovations(X)["innovation"])
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)
    pd.testing.assert_series_equal(model.disturbance_, before)


def test_the_variance_after_a_gap_is_that_of_the_predictor():
    """Both the process and the predictor are linear in white noise: their matrices give the variance."""
    rho_1, rho_2, n = 0.95, 0.7, 12
    seen = np.ones(n, dtype=bool)
    seen[[3, 4, 8]] = False
    process = np.eye(n)
    for k in range(1, n):
        for i in range(k):
            process[k, i] = rho_1 ** (k - 1 - i) * rho_2
    units = np.where(seen[:, None], np.eye(n), np.nan)  # a column an impulse, each a measured output of its own
    found = arma_prediction(units, rho_1, rho_2)
    turned = found.errors @ process
    covariance = turned[seen] @ turned[seen].T
    variance = found.variances[:, 0]
    np.testing.assert_allclose(np.diag(covariance), variance[seen])
    np.testing.assert_allclose(covariance - np.diag(np.diag(covariance)), 0.0, atol=1e-12)  # white
    assert variance[5] > 1.2


def test_the_errors_of_the_right_model_are_white_and_standard_normal():
    rng, office = np.random.default_rng(1), make_office(n_days=10, random_state=4)
    model = make_state_space("2R2C", office.theta)
    s, heat, y = np.array([22.0, 22.0]), 0.0, []
    for row in office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy():
        y.append(s[1] + 0.02 * rng.normal())
        s = model.A @ s + model.B @ np.append(row, heat)
        heat += 0.1 * rng.normal()
    X = office.X.assign(T_za=y)
    known = office.theta | {"sigma_x": 1e-6, "sigma_zeta": 0.1}
    right = InputDisturbanceID(known=known, measurement_sd=0.02).fit(X, X["T_za"])
    found = diagnose(right, X)
    assert found.tests.drop(index="normal (Jarque-Bera)")["passed"].all()
    assert found.standardised.std() == pytest.approx(1.0, abs=0.05)
    assert found.whiteness > 0.01
    assert found.findings[0].startswith("the errors are white")
    wrong = diagnose(GrayBoxRC(known=office.theta).fit(X, X["T_za"]), X)
    assert not wrong.tests.loc["white (Ljung-Box)", "passed"]
    assert "the model lacks a heat flow that comes and goes" in wrong.findings[0]


# --------------------------------------------------------------------------------------------------------- statistics
@pytest.fixture
def series():
    z = np.random.default_rng(0).normal(size=60)
    z[[5, 6, 30, 44]] = np.nan
    return z


def test_autocorrelation_counts_pairs_of_measured_rows(series):
    mean = np.nanmean(series)
    variance = np.nanmean((series - mean) ** 2)
    found = autocorrelation(series, 10)
    for lag in range(1, 11):
        products = [(series[t] - mean) * (series[t - lag] - mean) for t in range(lag, 60)]
        products = [p for p in products if np.isfinite(p)]
        assert found.loc[lag, "n_pairs"] == len(products)
        assert found.loc[lag, "acf"] == pytest.approx(np.mean(products) / variance)
        assert found.loc[lag, "band"] == pytest.approx(stats.norm.ppf(0.975) / np.sqrt(len(products)))


def test_every_other_row_leaves_the_odd_lags_open(series):
    series[::2] = np.nan
    found = autocorrelation(series, 4)
    assert found["acf"].isna().tolist() == [True, False, True, False]
    assert ljung_box(series, [4]).loc[4, "dof"] == 2


def test_without_gaps_it_is_the_textbook_ljung_box():
    z, n = np.random.default_rng(2).normal(size=80), 80
    centred = z - z.mean()
    r = [centred[k:] @ centred[:-k] / (centred @ centred) for k in range(1, 7)]
    statistic = n * (n + 2) * sum(r[k - 1] ** 2 / (n - k) for k in range(1, 7))
    found = ljung_box(z, [6], n_fitted=2).loc[6]
    assert found["statistic"] == pytest.approx(statistic)
    assert found["p_value"] == pytest.approx(stats.chi2.sf(statistic, 4))


def test_the_cumulative_periodogram_is_that_of_a_plain_sum():
    z = np.random.default_rng(3).normal(size=21)
    t, power = np.arange(21), []
    for j in range(1, 11):
        angle = 2 * np.pi * j * t / 21
        power.append((z @ np.cos(angle)) ** 2 + (z @ np.sin(angle)) ** 2)
    found = cumulative_periodogram(z)
    np.testing.assert_allclose(found["cumulative"], np.cumsum(power) / np.sum(power))
    np.testing.assert_allclose(found.index, np.arange(1, 11) / 21)
    uniform = stats.kstest(np.cumsum(power)[:-1] / np.sum(power), "uniform").statistic
    assert found.attrs["statistic"] == pytest.approx(uniform, abs=0.1)


def test_an_alternating_series_has_no_power_below_the_highest_frequency():
    found = cumulative_periodogram(np.tile([1.0, -1.0], 20))
    np.testing.assert_allclose(found["cumulative"], 0.0, atol=1e-9)
    assert found.attrs["statistic"] > 1.0
    assert found.attrs["p_value"] < 1e-4


@pytest.mark.parametrize("share_missing", [0.0, 0.3])
@pytest.mark.slow
def test_white_noise_is_refused_as_often_as_said(share_missing):
    rng, n = np.random.default_rng(4), 250
    box, spectrum = [], []
    for _ in range(200):
        z = np.where(rng.uniform(size=n) < share_missing, np.nan, rng.normal(size=n))
        box.append(ljung_box(z, [20])["p_value"].iloc[0])
        spectrum.append(cumulative_periodogram(z).attrs["p_value"])
    # 5 % of 200 within about 2.6 standard errors
    assert 0.01 < np.mean(np.array(box) < 0.05) < 0.09
    assert 0.01 < np.mean(np.array(spectrum) < 0.05) < 0.09


def _coloured(rng, n, root):
    x = np.zeros(n)
    for k in range(1, n):
        x[k] = root * x[k - 1] + rng.normal()
    return x


@pytest.mark.parametrize("missing", [None, slice(100, 140), slice(None, None, 3)])
def test_two_slow_series_are_not_taken_for_related(missing):
    rng, outside = np.random.default_rng(5), []
    for _ in range(60):
        errors, other = _coloured(rng, 500, 0.97), _coloured(rng, 500, 0.97)
        if missing is not None:
            errors[missing] = np.nan
        found = cross_correlation(errors, other, range(13))
        outside.append((found["ccf"].abs() > found["band"]).mean())
        np.testing.assert_allclose(found["t"], 1.959964 * found["ccf"] / found["band"])
    assert 0.02 < np.mean(outside) < 0.10  # 0.05; without whitening it is above 0.5


def test_a_lagged_effect_is_found_at_its_lag_and_side():
    rng = np.random.default_rng(6)
    cause = _coloured(rng, 2000, 0.9)
    shock = np.append(0.0, np.diff(cause))
    errors = rng.normal(size=2000) + 0.5 * np.roll(shock, 3)
    errors[400:420] = np.nan
    found = cross_correlation(errors, cause, range(-6, 7))
    assert found["t"].abs().idxmax() == 3
    assert found.loc[3, "ccf"] == pytest.approx(0.5 / np.sqrt(1.25), abs=0.06)


# --------------------------------------------------------------------------------------------------------------- words
def _white(n=1344, seed=7):
    index = pd.date_range("2023-07-01", periods=n, freq="15min", tz="Europe/Berlin")
    z = np.random.default_rng(seed).normal(size=n)
    return pd.DataFrame({"innovation": 0.1 * z, "std": 0.1}, index=index)


def test_an_input_that_is_badly_described_is_named_with_its_lags(office):
    frame = _white(len(office.X))
    frame.index = office.X.index
    sun = office.X["q_sol"].diff().fillna(0.0)
    frame["innovation"] += 0.1 * sum(6.0 * sun.shift(k).fillna(0.0) for k in (1, 2, 3, 4))
    found = diagnose_residuals(frame, office.X[["T_oa", "q_sol"]], name="test")
    assert not found.tests.loc["independent of q_sol", "passed"]
    assert found.tests.loc["independent of T_oa", "passed"]
    (said,) = [text for text in found.findings if "q_sol" in text]
    assert said.startswith("errors are correlated with q_sol at lags of 15 min to")
    assert "solar gain" in said


def test_what_comes_again_every_day_and_what_is_larger_by_day_is_said():
    frame = _white()
    hour = frame.index.hour
    frame["innovation"] += np.where(hour == 8, 0.15, 0.0)
    frame["innovation"] *= np.where((hour >= 12) & (hour < 18), 3.0, 1.0)
    found = diagnose_residuals(frame)
    text = str(found)
    assert "repeat from day to day" in text
    assert "from 12 to 18 h" in text
    assert "times as large as the model says" in text


def test_noise_taken_for_disturbance_shows_as_opposed_errors():
    frame = _white()
    frame["innovation"] -= 0.5 * frame["innovation"].shift().fillna(0.0)
    assert "successive errors are negatively correlated" in diagnose_residuals(frame).findings[0]
    frame = _white(seed=8)
    frame["innovation"] += 0.5 * frame["innovation"].shift(6).fillna(0.0)
    found = diagnose_residuals(frame)
    assert re.match(r"errors are correlated at a longer lag \(r = 0.4. at 90 min\)", found.findings[0])
    assert (found.ljung_box.index / pd.Timedelta("15min")).tolist() == [24, 48, 96]


def test_absent_stamps_are_rows_without_a_measurement():
    frame = _white()
    whole = frame.copy()
    whole.iloc[200:300] = np.nan
    pd.testing.assert_frame_equal(
        diagnose_residuals(frame.drop(index=frame.index[200:300])).autocorrelation,
        diagnose_residuals(whole).autocorrelation,
    )
    assert diagnose_residuals(frame.drop(index=frame.index[1])).sampling_time == frame.index[1] - frame.index[0]
    with pytest.raises(ValueError, match="is not a whole number of steps of 10 min after the first"):
        diagnose_residuals(frame, sampling_time="10min")
    with pytest.raises(ValueError, match=r"the row 2023-07-01 00:30:00.* comes twice or is not"):
        diagnose_residuals(frame.iloc[[0, 1, 2, 2, *range(3, len(frame))]])


def test_inputs_of_other_rows_are_refused():
    """Nothing would be left of them, and so no test of them."""
    frame = _white()
    inputs = pd.DataFrame({"T_oa": np.arange(len(frame), dtype=float) ** 2}, frame.index)
    assert "independent of T_oa" in diagnose_residuals(frame.drop(index=frame.index[5]), inputs).tests.index
    for other in (inputs.shift(freq="1D"), inputs.tz_localize(None), inputs.reset_index(drop=True)):
        with pytest.raises(ValueError, match="inputs has no row 2023-07-01 00:00:00"):
            diagnose_residuals(frame, other)
    with pytest.raises(ValueError, match="inputs is a ndarray; give a DataFrame"):
        diagnose_residuals(frame, inputs.to_numpy())


def test_a_lag_longer_than_the_series_has_no_correlation():
    rng = np.random.default_rng(0)
    found = cross_correlation(rng.normal(size=30), rng.normal(size=30), [-40, 0, 40])
    assert found["ccf"].notna().tolist() == [False, True, False]
    few = cross_correlation(rng.normal(size=30), rng.normal(size=30), [-28, -27])["ccf"]
    assert few.notna().tolist() == [False, True]  # of two pairs and of three


def test_diagnostics_print_one_screen_and_html(fitted, gappy):
    found = diagnose(fitted["CONV"], gappy[0])
    lines = str(found).splitlines()
    assert len(lines) < 30
    assert lines[0].startswith("GrayBoxRC: ")
    assert "independent of u_cool" in str(found)
    html = found._repr_html_()
    assert "<table" in html
    assert "<b>no</b>" in html
    assert 0.5 < found.share_outside <= 1.0


def test_too_little_is_refused(fitted, gappy):
    with pytest.raises(ValueError, match="output=1 must be an integer from 0 to 0"):
        diagnose(fitted["OD"], gappy[0], output=1)
    with pytest.raises(ValueError, match="2 values, too few, say nothing"):
        autocorrelation([1.0, 2.0, np.nan], 1)
    with pytest.raises(ValueError, match="the rows have no time stamps"):
        diagnose_residuals(_white().reset_index(drop=True))
    with pytest.raises(ValueError, match="most rows are at the stamp of the row before or earlier"):
        diagnose_residuals(_white().set_axis(_white().index[:1].repeat(len(_white()))))
    with pytest.raises(ValueError, match=r"lags=\[0\] must be row numbers of at least 1"):
        ljung_box(np.arange(9.0), [0])
    with pytest.raises(ValueError, match="errors has 9 rows and series 8"):
        cross_correlation(np.arange(9.0), np.arange(8.0), [1])


@pytest.mark.parametrize("lags", [24, [2.5]])
def test_lags_that_are_no_list_of_rows_are_refused(lags):
    z = np.arange(9.0)
    for test in (lambda: ljung_box(z, lags), lambda: cross_correlation(z, z, lags)):
        with pytest.raises(ValueError, match=r"lags=.* must be a list of whole numbers of rows, such as"):
            test()


def test_counts_and_shapes_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="n_lags=-1 must be an integer of at least 1"):
        autocorrelation(np.arange(9.0), -1)
    with pytest.raises(ValueError, match=r"the series has the shape \(5, 2\); give one column"):
        cumulative_periodogram(np.arange(10.0).reshape(5, 2))  # it was read as ten rows
    with pytest.raises(ValueError, match="n_fitted=-3 must be an integer of at least 0"):
        diagnose_residuals(_white(), n_fitted=-3)


# ------------------------------------------------------------------------------------------------------------- picture
def test_the_panels_show_the_tables(fitted, gappy):
    display = ResidualDisplay.from_estimator(fitted["OD"], gappy[0], max_lag="12h")
    found = display.diagnostics
    titles = [ax.get_title(loc="left") for ax in display.ax_]
    assert titles[:4] == ["standardised one-step errors", "quantiles", "autocorrelation", "cumulative periodogram"]
    assert titles[4:] == [f"correlation with {name}" for name in ("T_oa", "q_sol", "u_heat", "u_cool")]
    bars = np.sort(np.concatenate([c.get_segments() for c in display.ax_[2].collections[1:]])[:, 1, 1])
    np.testing.assert_allclose(bars, np.sort(found.autocorrelation["acf"]))
    np.testing.assert_allclose(display.ax_[0].get_lines()[0].get_ydata(), found.standardised)
    np.testing.assert_allclose(display.ax_[3].get_lines()[1].get_ydata(), found.cumulative_periodogram["cumulative"])
    again = ResidualDisplay.from_predictions(diagnose_residuals(_white()))
    assert len(again.ax_) == 4
    plt.close("all")


def test_the_cross_correlation_reaches_as_far_before_as_after():
    rng = np.random.default_rng(0)
    index = pd.date_range("2024-01-01", periods=400, freq="1h")
    errors = pd.DataFrame({"innovation": rng.normal(size=400), "std": 1.0}, index)
    found = diagnose_residuals(errors, pd.DataFrame({"T_oa": rng.normal(size=400)}, index))
    lags = found.cross_correlation.index
    assert lags[0] == -lags[-1]
    assert 0 * lags[0] in lags
