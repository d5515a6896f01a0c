"""Working days of a training that look like holidays are named."""

import warnings

import numpy as np
import pandas as pd
import pytest

from skhybrid import BuildingPredictor, HybridPredictor, SchedulePredictor
from skhybrid._warnings import without_python
from skhybrid.datasets import load_dutch_home, make_office
from skhybrid.exceptions import SkhybridWarning

CLOSED = ["2023-11-23", "2023-11-24"]
USED = "used like a weekend"


@pytest.fixture(scope="module")
def office():
    """Six weeks of an office that is closed on a Thursday and a Friday."""
    return make_office(42, "chicago", start="2023-11-01", random_state=0, excitation=None, holidays=CLOSED)


def told(fit):
    """Warnings of a fit about days."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit()
    return [str(w.message) for w in caught if issubclass(w.category, SkhybridWarning) and USED in str(w.message)]


def model(**settings):
    return SchedulePredictor(known={"Q_h": 6.0}, intervals=False, **settings)


def test_days_on_which_an_office_was_closed_are_named(office):
    (text,) = told(lambda: model().fit(office.X, office.y))
    assert text.startswith("2023-11-23 and 2023-11-24 were used like a weekend; if the building was closed, holidays=")


def test_a_day_that_holidays_name_is_not(office):
    assert told(lambda: model(holidays=CLOSED).fit(office.X, office.y)) == []
    (text,) = told(lambda: model(holidays="US").fit(office.X, office.y))  # Thanksgiving, and not the day after
    assert "2023-11-24" in text
    assert "2023-11-23" not in text


def test_a_local_day_is_named_in_any_time_zone(office):
    X = office.X.tz_localize("Pacific/Auckland")
    (text,) = told(lambda: model().fit(X, X["T_za"]))
    assert text.startswith("2023-11-23 and 2023-11-24")


def test_an_office_without_a_holiday_and_a_home_have_none():
    office = make_office(28, "oakland", start="2023-09-04", random_state=0, excitation=None)
    home = load_dutch_home(2).X[-28 * 96 :]
    assert told(lambda: model().fit(office.X, office.y)) == []
    assert told(lambda: HybridPredictor(intervals=False).fit(home, home["T_za"])) == []


def test_rows_without_dates_have_none(office):
    rows = office.X.reset_index(drop=True)
    assert told(lambda: model(sampling_time="15min").fit(rows, rows["T_za"])) == []


def test_a_training_without_a_weekend_has_none(office):
    rows = office.X["2023-11-20":"2023-11-24"]
    assert told(lambda: model().fit(rows, rows["T_za"])) == []


def test_a_training_too_short_to_leave_days_out_has_none(office):
    rows = office.X["2023-11-25":"2023-11-27"]
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        assert told(lambda: model().fit(rows, rows["T_za"])) == []


def test_a_building_says_it_once_with_its_zones(office):
    zones = {"a": office.X, "b": office.X + np.where(office.X.columns == "T_za", 0.5, 0.0)}
    X = pd.concat(
        [
            office.X[["T_oa", "q_sol"]],
            *(z.drop(columns=["T_oa", "q_sol"]).add_suffix(f"_{n}") for n, z in zones.items()),
        ],
        axis=1,
    )
    y = X[["T_za_a", "T_za_b"]].set_axis(["a", "b"], axis=1)
    building = BuildingPredictor(HybridPredictor(known={"Q_h": 6.0}, intervals=False), adjacency=[])
    (text,) = told(lambda: building.fit(X, y))
    assert text.startswith("zones 'a', 'b': 2023-11-23 and 2023-11-24 were")


def test_who_writes_a_configuration_reads_its_key(office):
    (text,) = told(lambda: model().fit(office.X, office.y))
    assert "holidays in the configuration (a country, a state or dates) should name" in without_python(text)
