"""The shipped EnergyPlus run: labels, truth apart from inputs, credit, size, and the public names."""

from importlib.resources import files

import numpy as np
import pandas as pd
import pytest

from skhybrid import datasets
from skhybrid.datasets import load_small_office


@pytest.fixture(scope="module")
def office():
    return load_small_office()


def test_shape_and_names(office):
    assert list(office.X.columns) == ["T_oa", "q_sol", "Q_hvac", "T_za"]
    assert (office.y.name, office.heat_gain.name) == ("T_za", "heat_gain")
    assert len(office.X) == 119 * 96
    assert str(office.X.index[0]) == "2018-08-20 00:00:00-06:00"
    assert (np.diff(office.X.index.as_unit("ns").asi8) == 15 * 60 * 10**9).all()
    for table in (office.X, office.y, office.heat_gain, office.frame):
        assert table.index.equals(office.X.index)
        assert np.isfinite(table.to_numpy()).all()
        assert table.to_numpy().dtype == np.float64


def test_truth_is_never_an_input(office):
    assert not any(np.allclose(office.heat_gain, office.X[c]) for c in office.X)
    assert not {"heat_gain", "people"} & set(office.X.columns)
    assert office.heat_gain.min() > 1


@pytest.mark.parametrize("control", ["irregular", "shifted"])
def test_against_the_year_long_table(shared_data, control):
    raw = pd.read_csv(shared_data / f"small_office_chicago_{control}.csv", index_col=0)
    raw.index = pd.to_datetime(raw.index)
    shipped = load_small_office(control)
    step = pd.Timedelta("15min")
    stamps = shipped.X.index
    at_stamp, at_end = raw.reindex(stamps), raw.reindex(stamps + step)
    np.testing.assert_allclose(shipped.X["T_za"], at_stamp["T_in_degC"], atol=6e-4)
    np.testing.assert_allclose(shipped.X["T_oa"], at_stamp["T_out_degC"], atol=6e-3)
    np.testing.assert_allclose(shipped.X["q_sol"], at_end["ghi_kW_m2"], atol=6e-5)
    np.testing.assert_allclose(shipped.X["Q_hvac"], at_end["q_hvac_kW"], atol=6e-4)
    np.testing.assert_allclose(shipped.heat_gain, at_end["truth_gains_kW"], atol=6e-4)
    np.testing.assert_allclose(shipped.frame["stage_cool"], at_end["stage_cool"], atol=6e-5)


def test_the_set_point_changes_on_the_hour(office):
    """Left labels: the reference plan starts at 06:00, not at 06:15."""
    rises = office.frame.index[office.frame["set_heat"].diff() > 0]
    assert set(rises.strftime("%H:%M")) == {"06:00"}


def test_the_other_control_shares_weather_and_people(office):
    shifted = load_small_office("shifted")
    pd.testing.assert_frame_equal(shifted.X[["T_oa", "q_sol"]], office.X[["T_oa", "q_sol"]])
    pd.testing.assert_series_equal(shifted.frame["people"], office.frame["people"])
    assert (shifted.X["T_za"] - office.X["T_za"]).abs().mean() > 0.3
    assert shifted.frame["set_cool"].nunique() > office.frame["set_cool"].nunique()


def test_unknown_control():
    with pytest.raises(ValueError, match="control='other' is unknown; choose 'irregular' or 'shifted'"):
        load_small_office("other")


def test_callers_cannot_change_each_others_copy(office):
    mine = load_small_office()
    mine.X.iloc[:, :] = 0
    assert load_small_office().X["T_za"].mean() > 15
    assert mine.y.mean() > 15


def test_credit_and_size(office):
    for words in ("EnergyPlus", "Deru et al. (2011)", "LBNL", "DOE"):
        assert words in office.DESCR
    assert sum(len(f.read_bytes()) for f in files("skhybrid.datasets").joinpath("data").iterdir()) < 1_000_000


def test_public_names():
    assert sorted(datasets.__all__) == datasets.__all__
    for name in datasets.__all__:
        assert getattr(datasets, name).__doc__
