"""The public benchmark: its logs and splits, and the table that any estimator enters."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skhybrid import ARXRegressor
from skhybrid.datasets import load_benchmark, load_dutch_home, read_zone_csv
from skhybrid.datasets._benchmark import LOGS
from skhybrid.model_selection import RollingOriginSplit

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import leaderboard
import leaderboard_entries
from _forecast_data import DataSet, data_sets

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
SHIPPED = [name for name in LOGS if not name.startswith("make_office")]
#: rows of training and after it
FROZEN = {
    "office autumn, same control": (4032, 5952),
    "office autumn, new control": (4032, 5951),
    "dutch home 1": (1976, 1824),
    "dutch home 2": (3548, 2976),
    "dutch home 3": (3548, 2976),
    "make_office oakland": (2688, 17472),
    "make_office chicago": (2688, 17472),
}
SITES = {"office": (41.98, -87.92), "dutch": (52.1, 5.2)}


@pytest.mark.skipif(not SHARED.is_dir(), reason="the reference data are not beside the checkout")
@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_home_is_the_published_log(number):
    columns = {"T_oa": "T_out_degC", "q_sol": "ghi_kW_m2", "u_heat": "heat_cmd", "T_za": "T_in_degC"}
    published = read_zone_csv(SHARED / f"dutch_home_{number}.csv", columns, timezone="Europe/Amsterdam")
    home = load_dutch_home(number)
    pd.testing.assert_frame_equal(home.X, published.assign(u_heat=published["u_heat"] / 78.0))
    pd.testing.assert_series_equal(home.y, home.X["T_za"])
    assert "MIT" in home.DESCR


@pytest.mark.parametrize("name", SHIPPED)
def test_the_splits_are_frozen(name):
    log = load_benchmark([name])[name]
    assert (len(log.train), len(log.later)) == FROZEN[name]
    step = pd.Timedelta("15min")
    assert log.later.index[0] - log.train.index[-1] == (2 * step if "new" in name else step)
    assert (np.diff(log.later.index.asi8) == np.diff(log.later.index.asi8)[0]).all()
    assert log.start >= log.later.index[0]
    assert log.start == log.start.normalize()
    assert log.site == SITES[name.split()[0]]
    assert log.truth is None
    shared = data_sets()[name](0)  # the rows of benchmarks/forecast.py are the same
    pd.testing.assert_frame_equal(shared.train, log.train)
    assert (shared.start, shared.origin_step, shared.known) == (log.start, log.origin_step, log.known)


@pytest.mark.parametrize("climate", ["oakland", "chicago"])
def test_the_office_of_the_paper_has_four_weeks_and_half_a_year(climate):
    name = f"make_office {climate}"
    log = load_benchmark([name])[name]
    assert (len(log.train), len(log.later)) == FROZEN[name]
    assert log.start == log.later.index[0]
    assert log.site is None


def test_unknown_logs_are_refused():
    with pytest.raises(ValueError, match="names= has 'dutch home 4', but the logs are 'office autumn"):
        load_benchmark(names=["dutch home 4"])
    for names in ("dutch home 1", 3):  # the letters of a name were looked up
        with pytest.raises(ValueError, match=f"names={names!r} must be a list of names, such as"):
            load_benchmark(names)
    with pytest.raises(ValueError, match="seed='0' must be an integer of at least 0"):
        load_benchmark(["make_office oakland"], seed="0")
    for number in (4, 1.0, True):
        with pytest.raises(ValueError, match=f"number={number} must be 1, 2 or 3"):
            load_dutch_home(number)


class Thief(Ridge):
    """It repeats the room temperature where it is shown it."""

    def predict(self, X):
        return X["T_za"].to_numpy() if "T_za" in X else super().predict(X)


@pytest.fixture
def small(monkeypatch):
    """The benchmark with one short log."""
    log = load_benchmark(["dutch home 2"])["dutch home 2"]
    later = log.later[: 5 * 96]
    data = DataSet("dutch home 2", log.train[-10 * 96 :], later, log.start, "1D", known=log.known)
    monkeypatch.setattr(leaderboard, "data_sets", lambda: {"dutch home 2": lambda seed: data})
    monkeypatch.setattr(leaderboard, "LOGS", {"dutch home 2": None})
    return data


def test_an_estimator_enters_by_one_command(small, tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "from sklearn.linear_model import Ridge\n\ndef make():\n    return Ridge()\n", encoding="utf-8"
    )
    monkeypatch.setattr(sys, "path", sys.path.copy())
    leaderboard.main([f"{tmp_path / 'mine.py'}:make", "--name", "mine", "--results", str(tmp_path)])
    leaderboard.main(["skhybrid:ARXRegressor", "--results", str(tmp_path)])
    leaderboard.main(["skhybrid:ARXRegressor", "--results", str(tmp_path)])
    kept = pd.read_csv(tmp_path / "leaderboard.csv").set_index("model")
    assert list(kept.index) == ["ARXRegressor", "mine"]
    assert kept.loc["ARXRegressor", "K, 1 h"] < kept.loc["ARXRegressor", "K, 24 h"]
    table = (tmp_path / "leaderboard.md").read_text(encoding="utf-8")
    best, other = kept["K"].sort_values().index
    assert table.index(f"| {best} |") < table.index(f"| {other} |")
    assert not leaderboard.main(["skhybrid:ARXRegressor", "--logs", "dutch", "--results", str(tmp_path)])
    for absent in ("london", "2"):
        with pytest.raises(SystemExit, match=f"nothing is called '{absent}'; there are dutch home 2"):
            leaderboard.main(["skhybrid:ARXRegressor", "--logs", "dutch*", absent, "--results", str(tmp_path / "none")])
    assert not (tmp_path / "none").exists()
    with pytest.raises(SystemExit, match="there is no file"):
        leaderboard.main(["absent.py:make"])


def test_the_entries_of_the_table_are_estimators():
    name = leaderboard_entries.__name__
    own = [key for key, made in vars(leaderboard_entries).items() if getattr(made, "__module__", None) == name]
    assert len(own) == 5
    for key in own:
        leaderboard.estimator_of(f"{leaderboard_entries.__file__}:{key}")


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("no_such_module:make", "there is no module 'no_such_module'"),
        ("sklearn.linear_model", "'sklearn.linear_model' is neither module:name nor file.py:name"),
        ("sklearn.linear_model:Absent", "sklearn.linear_model has no 'Absent'"),
        ("sklearn.ensemble:VotingRegressor", "VotingRegressor cannot be called without arguments"),
        ("os:getcwd", "os:getcwd is no estimator of scikit-learn: str has no get_params"),
    ],
)
def test_what_is_no_estimator_is_refused_in_a_sentence(spec, message):
    with pytest.raises(SystemExit, match=message):
        leaderboard.estimator_of(spec)


def test_a_file_may_hold_dataclasses_and_import_its_neighbours(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", sys.path.copy())
    (tmp_path / "penalty_of_mine.py").write_text("ALPHA = 3.0\n", encoding="utf-8")
    (tmp_path / "model_of_mine.py").write_text(
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        "from penalty_of_mine import ALPHA\nfrom sklearn.linear_model import Ridge\n\n"
        "@dataclass\nclass Options:\n    alpha: float = ALPHA\n\n"
        "def make():\n    return Ridge(Options().alpha)\n",
        encoding="utf-8",
    )
    assert leaderboard.estimator_of(f"{tmp_path / 'model_of_mine.py'}:make").regressor.alpha == 3.0


def test_a_search_of_a_forecaster_is_shown_the_past(small, monkeypatch):
    cv = RollingOriginSplit(train="6D", test="1D")
    search = make_pipeline(GridSearchCV(ARXRegressor(alpha=10.0), {"n_lags": [24]}, cv=cv))
    monkeypatch.setattr(leaderboard, "search", search, raising=False)
    assert leaderboard.estimator_of("leaderboard:search") is search
    found = leaderboard.score(search[-1], small)
    assert found == leaderboard.score(ARXRegressor(alpha=10.0), small)


class Choosy(Ridge):
    """It forecasts only some rows."""

    def predict(self, X):
        return np.where(np.arange(len(X)) % 3, super().predict(X), np.nan)


def test_an_estimator_that_leaves_rows_out_or_adds_some_is_refused(small, monkeypatch):
    with pytest.raises(ValueError, match=r"128 of 384 forecasts are no number \(first at .*\); forecast every row"):
        leaderboard.score(leaderboard.WithoutTemperature(Choosy()), small)
    monkeypatch.setattr(Choosy, "predict", lambda self, X: np.zeros(len(X) - 1))
    with pytest.raises(ValueError, match="what Choosy predicts for 480 rows has the shape"):
        leaderboard.score(leaderboard.WithoutTemperature(Choosy()), small)


def test_a_table_of_no_results_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        leaderboard.main(["--table", "--results", str(tmp_path)])
    assert f"no result is kept in {tmp_path}; name an estimator" in capsys.readouterr().err


def test_the_temperature_of_the_row_that_is_forecast_is_not_shown(small):
    with pytest.raises(ValueError, match="Thief has no predict_from, and its predict reads column 'T_za'"):
        leaderboard.score(Thief(), small)
    hidden = leaderboard.score(leaderboard.WithoutTemperature(Thief()), small)
    assert hidden["K"] > 0.1
    assert np.isnan(hidden["coverage"])


def test_the_intervals_of_an_estimator_are_scored(small):
    found = leaderboard.score(ARXRegressor(), small)
    assert found["K"] > 0.0
    assert np.isnan(found["kW"])  # a signal has no kW
    if hasattr(ARXRegressor, "predict_quantiles_from"):
        assert 0.0 < found["coverage"] <= 1.0
