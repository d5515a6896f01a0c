"""The comparison picks the network that made the data, counts what it says it counts, and looks at nothing held out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from scipy import stats
from sklearn.linear_model import Ridge
from sklearn.model_selection import KFold

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.identification import make_state_space
from skhybrid.model_selection import RollingOriginSplit, compare_models
from skhybrid.model_selection.assessment import Assessment, hold_out, log_density
from skhybrid.model_selection.recommendation import _within_standard_error, likelihood_ratio, nesting, recommend
from skhybrid.model_selection.splitters import default_split

pytestmark = pytest.mark.usefixtures("quick_fits")

SMALL = {"C_w": 6.0, "C_za": 1.0, "R_zw": 1.5, "R_zo": 6.0, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0}


def _log(network, theta, n_days=10, seed=0):
    """An hourly log of a network with nothing but white noise on its thermometer."""
    office = make_office(n_days=n_days, random_state=seed, sampling_time="1h")
    model = make_state_space(network, theta, sampling_time="1h")
    s, y = np.array([20.0, 22.0]), []
    for row in office.X[["T_oa", "q_sol", "u_heat", "u_cool"]].to_numpy():
        y.append(s[1])
        s = model.A @ s + model.B @ np.append(row, 0.0)
    y = pd.Series(y, index=office.X.index) + 0.05 * np.random.default_rng(seed).normal(size=len(y))
    return office.X.assign(T_za=y), y


def _conventional(network="2R2C", **known):
    return GrayBoxRC(network, known={"Q_h": 6.0} | known, n_starts=6, random_state=0)


@pytest.mark.slow
@pytest.mark.parametrize(("network", "more"), [("2R2C", {}), ("3R2C", {"R_wo": 4.0})])
def test_of_a_nested_pair_the_one_that_made_the_data_is_recommended(network, more):
    X, y = _log(network, SMALL | more)
    found = compare_models({name: _conventional(name) for name in ("2R2C", "3R2C")}, X, y)
    assert found.recommended == found.table.index[0] == network
    (test,) = found.tests.to_dict("records")
    assert (test["smaller"], test["larger"], test["extra"]) == ("2R2C", "3R2C", "R_wo")
    assert (test["p_value"] < 1e-6) == (network == "3R2C")
    assert test["white"]
    gain = found.table["log_likelihood"]["3R2C"] - found.table["log_likelihood"]["2R2C"]
    assert test["statistic"] == pytest.approx(max(0.0, 2 * gain))
    assert ("need R_wo" if more else "do not need R_wo") in found.reason


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=8, random_state=2)


@pytest.fixture(scope="module")
def compared(office):
    settings = {"known": {"Q_h": 6.0}, "n_starts": 3, "random_state": 0}
    models = {
        "CONV": GrayBoxRC(**settings),
        "ID": InputDisturbanceID(**settings),
        "OD": OutputDisturbanceID(**settings),
        "broken": OutputDisturbanceID("9R9C", **settings),
    }
    return compare_models(models, office.X, office.y, cv=RollingOriginSplit(train="5D", test="3D"))


def test_the_office_ranks_its_identifications(compared, office):
    table = compared.table
    assert table["log_likelihood"].idxmin() == "CONV"  # it carries no heat that comes and goes
    assert compared.recommended == table["cv_log_score"].idxmax() == table.index[0]
    assert compared.recommended != "CONV"
    assert table["cv_log_score"].is_monotonic_decreasing
    np.testing.assert_allclose(table["aic"], 2 * table["n_parameters"] - 2 * table["log_likelihood"])
    n = len(office.y) - 96  # the day in which CONV finds its state is left out for all
    np.testing.assert_allclose(table["bic"] - table["aic"], (np.log(n) - 2) * table["n_parameters"])
    assert (table["cv_rmse"] > 0.1).all()
    assert (table["seconds"] > 0).all()
    assert "not white" in compared.reason or table.loc[compared.recommended, "whiteness_p"] >= 0.01
    assert ("nested pairs:" in str(compared)) == (len(compared.tests) > 0)


def test_the_likelihood_is_that_of_the_common_rows(compared, office):
    model = compared.estimators["OD"]
    errors = model.innovations(office.X).iloc[96:]
    expected = stats.norm.logpdf(errors["innovation"], scale=errors["std"]).sum()
    assert compared.table.loc["OD", "log_likelihood"] == pytest.approx(expected)


def test_parameters_are_counted(compared):
    # seven of eight are free, and the variance; sigma_x and sigma_zeta; rho_1, rho_2 and the first wall temperature
    assert compared.table["n_parameters"].to_dict() == {"CONV": 8, "ID": 10, "OD": 11}
    singular = compared.estimators["OD"].identifiability_.singular_values
    assert compared.table.loc["OD", "condition"] == pytest.approx(singular.max() / singular.min())


def test_a_model_that_fails_does_not_end_the_comparison(compared):
    assert set(compared.table.index) == {"CONV", "ID", "OD"}
    assert list(compared.errors) == ["broken"]
    assert "9R9C" in compared.errors["broken"]
    assert "broken failed: ValueError" in str(compared)
    html = compared._repr_html_()
    assert "<table" in html
    assert "broken failed" in html


def test_the_result_does_not_depend_on_the_number_of_jobs(office):
    rows = slice(0, 192)
    models = [OutputDisturbanceID(n, known={"Q_h": 6.0}, n_starts=2, random_state=0) for n in ("1R1C", "2R2C")]
    one = compare_models(models, office.X[rows], office.y[rows])
    with parallel_config(backend="threading"):
        two = compare_models(models, office.X[rows], office.y[rows], n_jobs=2)
    pd.testing.assert_frame_equal(one.table.drop(columns="seconds"), two.table.drop(columns="seconds"))
    # two days are too few to hold anything out
    assert one.table["cv_rmse"].isna().all()
    assert "lowest BIC" in one.reason
    assert set(one.table.index) == {"OutputDisturbanceID 1R1C", "OutputDisturbanceID 2R2C"}


def test_nothing_after_an_origin_is_read(office):
    estimator = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=2, random_state=0)
    train, test = np.arange(5 * 96), np.arange(5 * 96, 8 * 96)
    score, frame = hold_out(estimator, office.X, office.y, train, test, "1D", "6h")
    row = 6 * 96 + 24  # the sixth origin
    X, y = office.X.copy(), office.y.copy()
    X.iloc[row + 1 :, X.columns.get_loc("T_za")] += 5.0
    y.iloc[row + 1 :] += 5.0
    score_after, frame_after = hold_out(estimator, X, y, train, test, "1D", "6h")
    early = frame["origin"] <= office.X.index[row]
    assert early.any()
    assert not early.all()
    pd.testing.assert_series_equal(frame.loc[early, "y_pred"], frame_after.loc[early, "y_pred"])
    pd.testing.assert_series_equal(score.loc[: X.index[row]], score_after.loc[: X.index[row]])
    assert len(score) == len(test)


def test_a_simpler_model_is_taken_where_it_is_as_good():
    X, y = _log("2R2C", SMALL)
    exact = {"C_w": 6.0, "C_za": 1.0, "R_zw": 1.5, "R_zo": 6.0, "f": 0.3, "A_win": 3.0, "Q_c": -6.0}
    found = compare_models({"free": _conventional(), "known": _conventional(**exact)}, X, y)
    assert found.recommended == "known"
    (test,) = found.tests.to_dict("records")
    assert test["distribution"] == "chi2(7)"
    assert test["p_value"] > 0.01


def test_for_forecasts_the_held_out_error_decides(office):
    models = {
        "CONV": GrayBoxRC(known=office.theta),
        "OD": OutputDisturbanceID(known=office.theta, n_starts=1, random_state=0),
    }
    found = compare_models(models, office.X, office.y, purpose="forecast")
    assert found.table["cv_rmse"].notna().all()
    assert "held-out forecast error" in found.reason
    assert found.table["cv_rmse"].is_monotonic_increasing or "as good" in found.reason


# --------------------------------------------------------------------------------------------------------------- parts
@pytest.fixture(scope="module")
def fitted(office):
    def fit(cls, network, known=None, **settings):
        return cls(network, known=known or {"Q_h": 6.0}, n_starts=1, random_state=0, **settings).fit(
            office.X[:288], office.y[:288]
        )

    return {
        "2R2C": fit(OutputDisturbanceID, "2R2C"),
        "2R2C f": fit(OutputDisturbanceID, "2R2C", {"Q_h": 6.0, "f": 0.3}),
        "3R2C": fit(OutputDisturbanceID, "3R2C"),
        "3R3C": fit(OutputDisturbanceID, "3R3C"),
        "paper": fit(OutputDisturbanceID, "3R2C", rho_box="paper"),
        "ID": fit(InputDisturbanceID, "3R2C"),
        "wide R_wo": fit(OutputDisturbanceID, "3R2C", bounds={"R_wo": (0.1, 1e4)}),
        "wide R_zo": fit(OutputDisturbanceID, "3R2C", bounds={"R_zo": (0.1, 1e4)}),
    }


@pytest.mark.parametrize(
    ("small", "large", "expected"),
    [
        ("2R2C", "3R2C", (("R_wo",), ())),
        ("3R2C", "2R2C", None),
        ("2R2C f", "2R2C", ((), ("f",))),
        ("2R2C", "2R2C f", None),
        ("2R2C f", "3R2C", (("R_wo",), ("f",))),
        ("3R2C", "3R3C", None),
        ("2R2C", "paper", None),
        ("2R2C", "ID", None),
        ("2R2C", "wide R_wo", (("R_wo",), ())),
        ("2R2C", "wide R_zo", None),
    ],
)
def test_nestedness_is_read_from_the_networks(fitted, small, large, expected):
    assert nesting(fitted[small], fitted[large]) == expected


def test_the_law_at_the_edge_is_a_mixture():
    gain = 1.5
    assert likelihood_ratio(gain, 0, 2)[2] == pytest.approx(stats.chi2.sf(3.0, 2))
    assert likelihood_ratio(gain, 1, 0)[2] == pytest.approx(0.5 * stats.chi2.sf(3.0, 1))
    assert likelihood_ratio(-gain, 1, 0)[::2] == (0.0, 1.0)
    # by simulation: two normal means that cannot be negative
    z = np.maximum(np.random.default_rng(0).normal(size=(200_000, 2)), 0.0)
    simulated = np.mean((z**2).sum(axis=1) > 3.0)
    assert likelihood_ratio(gain, 2, 0)[2] == pytest.approx(simulated, abs=0.002)


@pytest.mark.parametrize(
    ("p_value", "white", "doubted"), [(0.01, False, True), (0.01, True, False), (0.4, False, False)]
)
def test_a_test_on_errors_that_are_not_white_is_doubted(p_value, white, doubted):
    table = pd.DataFrame({"n_parameters": [4, 5], "whiteness_p": 0.5, "flat": "", "at_bound": ""}, ["small", "large"])
    table = table.assign(cv_rmse=0.5, cv_log_score=[1.0, 2.0], bic=0.0)
    test = {"smaller": "small", "larger": "large", "extra": "R_wo", "p_value": p_value, "white": white}
    name, reason = recommend(dict.fromkeys(table.index, Assessment()), table, pd.DataFrame([test]), "parameters", 0.05)
    assert name == ("large" if p_value < 0.05 else "small")
    assert ("overstated since their errors are not white" in reason) == doubted


def test_as_good_is_within_a_standard_error_of_the_days():
    index = pd.date_range("2024-01-01", periods=4 * 24, freq="1h")
    by_day = np.repeat([0.3, -0.1, 0.2, 0.0], 24)  # mean 0.1, standard error 0.0913
    best = Assessment(held_out=pd.Series(0.0, index))
    assert not _within_standard_error(Assessment(held_out=pd.Series(-by_day, index)), best, "cv_log_score")
    assert _within_standard_error(Assessment(held_out=pd.Series(0.02 - by_day, index)), best, "cv_log_score")
    assert not _within_standard_error(Assessment(held_out=pd.Series(0.02 - by_day, index)), best, "bic")
    assert not _within_standard_error(Assessment(), best, "cv_log_score")


def test_days_of_an_array_have_as_many_rows_as_its_step_says():
    by_day = np.repeat([0.3, -0.1, 0.2, 0.0], 24)
    hourly = SimpleNamespace(sampling_time_=pd.Timedelta("1h"))
    best, other = (Assessment(estimator=hourly, held_out=pd.Series(values)) for values in (0.0 * by_day, -by_day))
    assert not _within_standard_error(other, best, "cv_log_score")
    assert _within_standard_error(Assessment(held_out=pd.Series(0.02 - by_day)), best, "cv_log_score")


def test_log_density_adds_what_was_measured():
    frame = pd.DataFrame({"innovation": [0.1, np.nan], "std": [0.2, np.nan]})
    np.testing.assert_allclose(log_density(frame), [stats.norm.logpdf(0.1, scale=0.2), np.nan])
    both = pd.DataFrame({"innovation_a": [0.1], "innovation_b": [np.nan], "std_a": [0.2], "std_b": [np.nan]})
    np.testing.assert_allclose(log_density(both), stats.norm.logpdf(0.1, scale=0.2))


def test_test_blocks_are_a_sixth_in_whole_days(office):
    for X, n_train in ((make_office(n_days=14, random_state=0).X, 10 * 96), (office.X, 4 * 96)):
        found = default_split(X, "1D")
        blocks = [(len(train), test[0], test[-1]) for train, test in found.split(X)]
        assert blocks == [(n_train + k, n_train + k, n_train + k + 2 * 96 - 1) for k in (0, 2 * 96)]
    assert default_split(office.X[: 5 * 96], "1D") is None


@pytest.mark.parametrize("begin", ["2024-03-01", "2024-10-25"])
def test_test_blocks_begin_at_midnight_when_the_clocks_change_in_them(begin):
    first = pd.Timestamp(begin, tz="America/Chicago")
    X = pd.DataFrame(index=pd.date_range(first, first + pd.DateOffset(days=11), freq="1h", inclusive="left"))
    blocks = [(X.index[test[0]], X.index[test[-1]]) for _, test in default_split(X, "1D").split(X)]
    hour = pd.Timedelta("1h")
    assert blocks == [(first + pd.DateOffset(days=n), first + pd.DateOffset(days=n + 2) - hour) for n in (7, 9)]


def test_wrong_settings_are_refused(office):
    with pytest.raises(ValueError, match="there is no estimator"):
        compare_models({}, office.X, office.y)
    for given in ([Ridge()], {"0": Ridge()}):
        with pytest.raises(TypeError, match="estimators holds a Ridge, which identifies no network"):
            compare_models(given, office.X, office.y)
    for given in (["1R1C"], "1R1C", {"a": "1R1C"}):
        with pytest.raises(TypeError, match="estimators holds '1R1C', which identifies no network"):
            compare_models(given, office.X, office.y)
    with pytest.raises(ValueError, match="estimators is one GrayBoxRC; give a list of those to compare"):
        compare_models(GrayBoxRC(), office.X, office.y)
    with pytest.raises(ValueError, match="estimators is one NoneType; give a list of those to compare"):
        compare_models(None, office.X, office.y)
    with pytest.raises(ValueError, match="two estimators are called GrayBoxRC 2R2C"):
        compare_models([GrayBoxRC(), GrayBoxRC()], office.X, office.y)
    with pytest.raises(ValueError, match="purpose='fun' is neither"):
        compare_models([GrayBoxRC()], office.X, office.y, purpose="fun")
    with pytest.raises(ValueError, match="level=5 is not between 0 and 1"):
        compare_models([GrayBoxRC()], office.X, office.y, level=5)
    with pytest.raises(ValueError, match="level='high' is not between 0 and 1"):
        compare_models([GrayBoxRC()], office.X, office.y, level="high")
    for cv in (3, "rolling"):
        with pytest.raises(ValueError, match=rf"cv={cv!r} must be a splitter into consecutive rows, such as RollingO"):
            compare_models([GrayBoxRC()], office.X, office.y, cv=cv)
    for scattered in (KFold(3), KFold(3, shuffle=True, random_state=0)):
        with pytest.raises(ValueError, match=r"cv=KFold.* does not test on consecutive rows after those of the train"):
            compare_models([GrayBoxRC()], office.X, office.y, cv=scattered)
    with pytest.raises(ValueError, match=r"X has no time stamps, by which test blocks are cut; .* pass cv=."):
        compare_models([GrayBoxRC(sampling_time="15min")], office.X.to_numpy(), office.y)
    with pytest.raises(ValueError, match=r"no model could be fitted.*9R9C"):
        compare_models([PeriodicDisturbanceID("9R9C")], office.X, office.y)


def test_a_target_of_one_column_stands_for_the_measurement(office):
    without = office.X[:288].drop(columns="T_za")
    model = GrayBoxRC("1R1C", known={"Q_h": 6.0}, n_starts=1)
    cv = RollingOriginSplit(train="2D", test="1D")
    column, series = (
        compare_models([model], without, y, cv=cv, horizon="6h") for y in (office.y[:288].to_frame(), office.y[:288])
    )
    assert column.errors == series.errors == {}
    pd.testing.assert_frame_equal(column.table.drop(columns="seconds"), series.table.drop(columns="seconds"))
