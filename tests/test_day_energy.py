"""Heating and cooling of a day, with intervals by paths of its load."""

import numpy as np
import pandas as pd
import pytest

from skhybrid.exceptions import TooFewDaysError
from skhybrid.study.day_energy import Energy, day_energy, energy_of_zones, paths_of_load
from skhybrid.study.report.html import energy_cards

DAY = pd.date_range("2024-01-05", periods=4, freq="30min")


def paths_of(loads, factors):
    """Paths that are multiples of the loads."""
    return pd.concat({k: loads * factor for k, factor in enumerate(factors)}, names=["sample"])


def test_the_larger_of_heating_and_cooling_has_an_interval():
    load = pd.Series([4.0, 2.0, -1.0, 0.0], DAY)
    heating, cooling = day_energy(load, paths_of(load, np.linspace(0.5, 1.5, 11)))
    assert heating == Energy("heating", 3.0, pytest.approx((1.8, 4.2)))
    assert cooling == Energy("cooling", 0.5, None)
    assert heating.card() == ("3\u00a0kWh", "heating needed that day; 80 % interval 2 to 4 kWh")
    assert cooling.card()[1] == "cooling needed that day"


def test_a_day_without_heat_says_so_and_one_row_is_an_hour():
    assert day_energy(pd.Series(0.0, DAY)) == [Energy("heating", 0.0, None)]
    assert day_energy(pd.Series(-2.0, DAY[:1]))[1] == Energy("cooling", 2.0, None)


def test_cards_have_the_energy_of_all_zones():
    loads = pd.DataFrame({"Q_hvac_a": [6.0, 6.0, 0.0, 0.0], "Q_hvac_b": [4.0, 0.0, -2.0, 0.0]}, DAY)
    (heat, words), (cold, _) = energy_cards(energy_of_zones(loads, paths_of(loads, [0.0, 1.0, 2.0])))
    assert (heat, cold) == ("8\u00a0kWh", "1\u00a0kWh")
    assert words == "heating needed that day; 80 % interval 2 to 14 kWh"
    assert energy_of_zones(loads[[]]) == []


def test_a_model_without_intervals_has_no_paths():
    class Short:
        def sample(self, *rows, **given):
            raise TooFewDaysError("the training was too short")

    assert paths_of_load(Short(), pd.DataFrame(), pd.DataFrame()) is None
