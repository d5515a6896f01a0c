"""The studies of the paper's sections: verdicts, what is kept of a run, and data that are absent."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import _reference_data
import _study_offices
import day_totals
import gain
import heat_replayed
import paper_forecast
import paper_identification
import set_points_known
from _paper_forecast_claims import CLAIMS, judge


def test_a_run_of_one_seed_has_no_statement_that_holds_in_some_seeds():
    judged = pd.DataFrame(
        {"where": ["Table 1", "step"], "the paper says": ["a", "b"], "here": ["holds: 1", "does not hold: 2"]}
    ).set_index("where")
    judged["the paper's numbers"] = "holds: 1"
    note = paper_identification.verdict_note(judged)
    assert "**Agrees in some seeds only** (0 of 2)" in note
    assert "**Agrees with the paper in every seed** (1 of 2)\n\n- Table 1: a" in note


def test_absent_reference_data_end_a_study_with_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(_reference_data, "SHARED", tmp_path)
    with pytest.raises(SystemExit, match=r"TMY3.epw is absent, .* or leave this log out with --logs"):
        paper_forecast.LOGS["oakland"](0)
    with pytest.raises(SystemExit, match=r"dutch_home_2.csv is absent"):
        paper_forecast.LOGS["home 2"](0)
    monkeypatch.setattr(sys, "argv", ["paper_identification.py", "--seeds", "1"])
    with pytest.raises(SystemExit, match="or choose --embedded"):
        paper_identification.main()


@pytest.mark.parametrize("study", [day_totals, gain, heat_replayed, set_points_known])
def test_a_study_of_no_known_log_stops_and_leaves_its_results(study, tmp_path):
    kept = ["--store", str(tmp_path / "store"), "--results", str(tmp_path)]
    with pytest.raises(SystemExit, match=r"nothing is called 'nobody'; there are .*make_office oakland"):
        study.main(["--data", "nobody", *kept])
    with pytest.raises(SystemExit, match=r"has no meta.csv; make it with make_buildings.py"):
        study.main(["--buildings", str(tmp_path), *kept])
    assert not list(tmp_path.glob("*.md"))


def _run(conventional, hybrid):
    rows = {"OD, no disturbance": conventional, "hybrid OD, LSTM": hybrid, "default": hybrid}
    return pd.DataFrame({name: {"K": value} for name, value in rows.items()}).T


def test_there_is_a_verdict_only_where_the_offices_agree():
    claim = tuple(c for c in CLAIMS if c.statement.startswith("hybrid reduces the RMSE by 0.3"))
    said = judge(claim, {"chicago": [_run(2.0, 1.5), _run(2.2, 1.8), _run(2.1, 1.2)]})["two-stage here"].iloc[0]
    assert said == "holds: K 2.1 (2 to 2.2) -> 1.5 (1.2 to 1.8)"
    said = judge(claim, {"chicago": [_run(2.0, 1.5), _run(2.2, 2.1)]})["two-stage here"].iloc[0]
    assert said.startswith("no verdict (holds in 1 of 2): K")


def test_a_stopped_comparison_goes_on_where_it_was(tmp_path, monkeypatch):
    fitted = []

    def made(climate, data, repeats):
        return dict.fromkeys(_study_offices.MODELS, lambda: climate)

    def score(model, data):
        if len(fitted) == 10:
            raise KeyboardInterrupt
        fitted.append(model)
        return {"rmse": 1.0 + len(fitted), "lowest": 1.0, "highest": 2.0, "seconds": 0.1}

    monkeypatch.setattr(_study_offices, "office", lambda climate, number: None)
    monkeypatch.setattr(_study_offices, "models", made)
    monkeypatch.setattr(_study_offices, "score", score)
    with pytest.raises(KeyboardInterrupt):
        _study_offices.run(tmp_path, ["oakland", "chicago"], 2, 10)
    assert len(_study_offices.read(tmp_path)) == 10
    fitted.append("the next one")
    _study_offices.run(tmp_path, ["oakland", "chicago"], 2, 10)
    results = _study_offices.read(tmp_path)
    assert len(results) == 4 * len(_study_offices.MODELS)
    assert not results.duplicated(["climate", "office", "model", "repeats"]).any()
    table = _study_offices.comparison(results)
    assert set(table.loc["oakland", "best in"]) == {"2 of 2 offices", "0 of 2 offices"}
    assert table.loc["chicago", "model"].iloc[0] == "the choice"


def test_the_runs_of_a_method_are_kept_by_their_number_of_repeats(tmp_path, monkeypatch):
    calls = []

    def forecast(model, log):
        calls.append(model)
        return pd.DataFrame({"temperature": [1.0]})

    made = {"OD alone": lambda: "gray", "hybrid OD, LSTM": lambda: "lstm"}
    forecast_frame = lambda model, log: _with_attrs(forecast(model, log))  # noqa: E731
    monkeypatch.setattr(paper_forecast, "ROWS", tmp_path)
    monkeypatch.setattr(paper_forecast, "methods", lambda log, seed, repeats: made)
    monkeypatch.setattr(paper_forecast, "forecast", forecast_frame)
    given = SimpleNamespace(again=None, repeats=2, report=False, methods=None)
    for repeats, expected in ((2, ["gray", "lstm"]), (2, []), (10, ["lstm"])):
        calls.clear()
        given.repeats = repeats
        assert set(paper_forecast.kept("oakland", None, 0, given)) == set(made)
        assert calls == expected


def _with_attrs(frame):
    frame.attrs = {"fit": 0.0}
    return frame


def test_the_networks_of_a_method_are_told_apart_from_its_runs():
    rng = np.random.default_rng(0)
    index = pd.date_range("2024-01-01", periods=96, freq="15min")
    X = pd.DataFrame({"T_za": 20 + rng.normal(size=96), "Q_hvac": 1.0}, index=index)
    log = SimpleNamespace(after=X, heat=lambda table: table["Q_hvac"])
    said = pd.DataFrame({"temperature": X["T_za"] + 0.5, "load": 1.0, "plan": np.nan}, index=index)
    said.attrs = {"fit": 1.0, "predict": 1.0, "networks": [0.3, 0.5, 0.9]}
    found = paper_forecast.measure(said, log)
    assert found["K"] == pytest.approx(0.5)
    assert [found[f"network {word} K"] for word in paper_forecast.NETWORKS] == [0.3, 0.5, 0.9]
