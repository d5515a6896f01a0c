"""Scores of back-tests, counted by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid.study.scores import coverage_of, error_table, errors_by_model, has_intervals, side_by_side

HOURS = pd.date_range("2024-01-01", periods=4, freq="h")


def frame(error, **columns):
    measured = np.array([20.0, 21.0, np.nan, 23.0])
    shared = {"origin": HOURS[0], "lead": HOURS - HOURS[0], "time": HOURS, "y_true": measured}
    return pd.DataFrame({**shared, "y_pred": measured + error, **columns})


def test_errors_are_those_of_forecasts_that_every_model_made():
    late = frame(np.array([np.nan, 1.0, 1.0, -3.0]))
    table = error_table(errors_by_model({"a": frame(2.0), "b": late}))
    assert table.loc["a"].to_dict() == {"rmse": 2.0, "mae": 2.0}
    assert table.loc["b"].to_dict() == {"rmse": pytest.approx(np.sqrt(5.0)), "mae": 2.0}
    with pytest.raises(ValueError, match="no forecast of the test span meets a measurement"):
        errors_by_model({"a": frame(np.nan)})


def test_coverage_counts_measured_rows_and_is_none_without_intervals_or_measurements():
    band = frame(0.0, **{"q_0.1": 20.0, "q_0.9": [22.0, 22.0, 22.0, 22.0]})
    assert has_intervals(band)
    assert coverage_of(band) == pytest.approx(2 / 3)
    assert coverage_of(frame(0.0)) is None
    assert coverage_of(band.assign(y_true=np.nan)) is None


def test_all_forecasts_in_one_table():
    one = side_by_side({"a": frame(1.0), "b": frame(2.0)})
    assert [*one] == ["origin", "lead", "time", "y_true", "a", "b"]
    assert one["lead"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert [*side_by_side({"a": frame(1.0, zone="north")})][:3] == ["origin", "zone", "lead"]
