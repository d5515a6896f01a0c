"""Parts of the work with one zone: what a network says of a building, errors of forecasts, back-test and search."""

from __future__ import annotations

import os
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid import GrayBoxRC
from skhybrid.cli.zone import _errors
from skhybrid.datasets import make_office
from skhybrid.model_selection import design_matrix
from skhybrid.study import identified_building, run, scores
from skhybrid.study.day_energy import Energy
from skhybrid.study.log_split import StudyData
from skhybrid.study.settings import settings_from
from skhybrid.zone import zone_backtest, zone_search, zone_state
from skhybrid.zone.forecast_archive import open_archive
from skhybrid.zone.forecast_scores import _verdict, errors_of

KNOWN = {"C_za": 2.0, "R_zo": 5.0, "A_win": 3.0, "Q_h": 6.0, "Q_c": -4.0}
SETTINGS = settings_from({"columns": {"T_za": "T_za", "T_oa": "T_oa"}})


def test_a_building_of_one_resistance_by_hand():
    office = make_office(n_days=3, random_state=0)
    model = GrayBoxRC("1R1C", known=KNOWN).fit(office.X, office.y)
    cov = pd.DataFrame(0.0, model.theta_.keys(), model.theta_.keys())
    cov.loc["R_zo", "R_zo"], cov.loc["C_za", "C_za"] = 0.5**2, 1.0
    model.theta_cov_ = cov.to_numpy()
    found = identified_building.describe(model)
    assert found.loc["heat loss", "value"] == pytest.approx(1000.0 / 5.0)
    assert found.loc["heat loss", "std"] == pytest.approx(1000.0 / 5.0**2 * 0.5, rel=1e-3)
    assert found.loc["time constant 1", "value"] == pytest.approx(2.0 * 5.0)
    assert found.loc["time constant 1", "std"] == pytest.approx(np.hypot(2.0 * 0.5, 5.0 * 1.0), rel=1e-3)
    assert found.loc["solar aperture", "value"] == pytest.approx(3.0)
    assert found.loc["capacity Q_h", ["value", "unit"]].tolist() == [6.0, "kW"]
    assert found.loc["heat capacity C_za", "value"] == 2.0
    assert found.loc["heat capacity C_za", "std"] == pytest.approx(1.0)
    model.theta_cov_ = np.full(cov.shape, np.nan)
    assert identified_building.describe(model)["std"].isna().all()


@pytest.mark.parametrize(
    ("value", "std", "words"),
    [
        (5.0, 0.0, ""),
        (5000.0, np.nan, ""),
        (4.9, 0.0, "implausible"),
        (5001.0, 0.0, "implausible"),
        (100.0, 31.0, "uncertain"),
        (100.0, 101.0, "not identified"),
        (100.0, np.inf, "not identified"),
    ],
)
def test_remarks_on_a_heat_loss(value, std, words):
    found = identified_building.remark_on("heat loss [W/K]", value, std)
    assert found.startswith(words)
    assert bool(found) == bool(words)


def _finished(origins, predicted, measured):
    frame = pd.DataFrame({"origin": origins, "T_za": predicted, "T_za_measured": measured})
    return frame.assign(**{"q_0.1": frame["T_za"] - 1.0, "q_0.9": frame["T_za"] + 1.0}).reindex(
        columns=[*frame, "q_0.1", "q_0.9", "Q_hvac", "Q_hvac_measured", "Q_hvac_0.1", "Q_hvac_0.9"]
    )


def test_errors_of_finished_forecasts_by_hand():
    rows = _finished(["2024-01-01", "2024-01-01", "2024-01-02"], [20.0, 21.0, 22.0], [20.1, 20.8, 23.2])
    assert errors_of(rows) == {"temperature [K]": {"rmse": 0.705, "bias": -0.367, "coverage": 0.667}, "load [kW]": None}
    newest = errors_of(rows[rows["origin"] == "2024-01-02"])
    assert newest["temperature [K]"] == {"rmse": 1.2, "bias": -1.2, "coverage": 0.0}


def test_a_status_tells_one_coverage():
    rows = _finished(["2024-01-01"] * 2500, 20.0, np.where(np.arange(2500) < 1537, 20.5, 22.0))  # 61.48 % inside
    values = rows["T_za"], rows["T_za_measured"], rows["T_za"] + 2.0
    verdict = _verdict("temperature", rows, values, [])
    assert any("contained 62 %" in reason for reason in verdict.reasons)
    assert "62 % of the measurements" in _errors(errors_of(rows)["temperature [K]"])


def test_a_status_counts_the_forecasts_of_four_weeks_and_tells_a_silent_thermometer(monkeypatch, tmp_path):
    stamps = pd.date_range("2024-01-01", periods=60 * 24, freq="1h")
    quiet = {"statistic": 0.0, "threshold": 4.0, "drifted": False, "since": pd.NaT, "kind": ""}
    monkeypatch.setattr(zone_state, "drift_days", lambda model: pd.DataFrame(quiet, stamps[:1]))
    monkeypatch.setattr(zone_state, "verdicts_of", lambda *given: [SimpleNamespace(_asdict=lambda: given[-1])])
    model = SimpleNamespace(settings=SETTINGS, predictor=None, zones=(), learned_until=stamps[0])
    model.parts = lambda: {"": model}
    rows = pd.DataFrame({"T_za": 20.0, "Q_hvac": 1.0}, stamps)
    with open_archive(tmp_path / "archive.sqlite") as archive, archive.transaction():
        assert zone_state.status_of(archive, model)["last four weeks"] is None
        archive.add_measured(rows)
        for day in (10, 50):
            archive.add_forecast(stamps[24 * day], rows.iloc[24 * day + 1 : 24 * day + 25])
        found = zone_state.status_of(archive, model)
        assert (found["last measured"], found["drift"]["drifted"], found["verdicts"]) == (None, False, [[]])
        assert found["last four weeks"]["forecasts"] == 1
        archive.add_measured(rows.assign(T_za=np.nan).iloc[-100:])
        found = zone_state.status_of(archive, model)
    assert found["last measured"] == f"{stamps[-101]} (4 days ago)"
    assert found["drift"] == {}
    assert found["verdicts"] == [[f"no temperature was measured since {found['last measured']}"]]


def test_the_archive_keeps_the_energy_of_the_last_forecast_in_any_clock(tmp_path):
    stamps = pd.date_range("2024-01-01", periods=24, freq="1h", tz="Europe/Berlin")
    rows = pd.DataFrame({"T_za": 20.0}, stamps)
    energy = [Energy("heating", 8.0, (5.0, 12.0)), Energy("cooling", 1.0, None)]
    with open_archive(tmp_path / "archive.sqlite") as archive, archive.transaction():
        assert archive.latest_energy() == []
        archive.add_forecast(stamps[0], rows[1:], energy=energy[1:])
        archive.add_forecast(stamps[0], rows[1:], energy=energy)
        assert archive.latest_energy() == energy
        archive.keep_clock(None, stamps.tz)
        assert archive.latest_energy() == energy
        archive.add_forecast(stamps[5].tz_localize(None), rows[6:].tz_localize(None))
        assert archive.latest_energy() == []


def _data():
    stamps = pd.date_range("2024-01-01", periods=96, freq="1h")
    whole = pd.DataFrame({"T_za": 20.0, "T_oa": 5.0}, stamps)
    return StudyData(whole[:48], whole[48:], stamps[72], whole, whole[-1:], whole["T_za"], False)


def test_a_back_test_compares_errors_at_the_same_rows(monkeypatch):
    errors = {
        zone_backtest.HYBRID: np.array([0.0, 3.0, -4.0, np.nan]),
        zone_backtest.YESTERDAY: np.array([1.0, -1.0, 5.0, 9.0]),
    }
    asked = {}

    def forecasts(model, X, y, quantiles=None, **given):
        asked[model.label] = quantiles
        origins = pd.to_datetime(["2024-01-04 00:00", "2024-01-04 01:00", "2024-01-04 02:00", "2024-01-04 03:00"])
        frame = pd.DataFrame({"origin": origins, "y_true": 20.0, "y_pred": 20.0 + errors[model.label]})
        spread = {} if quantiles is None else {f"q_{q:g}": frame["y_pred"] + 7.0 * (q - 0.5) for q in quantiles}
        return frame.assign(**spread)

    class Model:
        def __init__(self, label):
            self.label = label

        def fit(self, X, y):
            return self

    models = [SimpleNamespace(label=label, estimator=Model(label), note="") for label in (*errors, "another one")]
    monkeypatch.setattr(zone_backtest, "make_models", lambda settings: models)
    monkeypatch.setattr(scores, "backtest", forecasts)
    monkeypatch.setattr(run.Doubts, "of", lambda *given, **settings: run.Doubts([], []))
    said = []
    found = zone_backtest.backtest_zone(SETTINGS, _data(), lambda *words: said.append(words[:2]))
    assert said == [(1, 3), (2, 3), (3, 3)]
    assert asked == {zone_backtest.HYBRID: scores.INTERVAL, zone_backtest.YESTERDAY: None}
    expected = {zone_backtest.HYBRID: (np.sqrt(25 / 3), 7 / 3), zone_backtest.YESTERDAY: (3.0, 7 / 3)}
    for label, numbers in expected.items():
        assert found.table.loc[label].tolist() == pytest.approx(numbers)
    assert found.table.index[0] == zone_backtest.HYBRID
    assert found.coverage == 0.25
    assert zone_backtest.backtest_zone(SETTINGS, _data()).table.equals(found.table)


def test_a_search_trains_on_the_training_rows_and_keeps_its_results(monkeypatch, tmp_path):
    made = []

    class Search:
        def __init__(self, estimator, cases, **settings):
            made.append(settings)

        def fit(self, X, y):
            self.results_ = pd.DataFrame({"name": ["b", "a"], "rmse": [2.0, 1.0]})
            return self

    monkeypatch.setattr(zone_search, "DesignMatrixSearchCV", Search)
    store = tmp_path / "of one" / "zone"
    for _ in range(2):
        found = zone_search.search_zone(
            SETTINGS, _data(), store, design_matrix(["ridge"], size="small", disturbance="input"), 1
        )
    assert found["name"].tolist() == ["a", "b"]
    assert found.index.tolist() == [0, 1]
    ((training, scored),) = made[0]["cv"]
    assert (training[-1], scored[0], scored[-1]) == (47, 72, 95)
    assert made[0]["store"].parent == store
    assert made[0]["refit"] is False


@pytest.mark.skipif(os.name != "posix", reason="it has no device that is a file")
def test_a_search_whose_folder_cannot_be_made_says_what_to_do():
    with pytest.raises(OSError, match=r"store /dev/null/zone/search.sqlite cannot be created .* give the path of anot"):
        zone_search.search_zone(
            SETTINGS, _data(), "/dev/null/zone", design_matrix(["ridge"], size="small", disturbance="input"), 1
        )
