"""Counters of energy: failed readings and replaced meters are left out, and what a plant does is not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid.exceptions import UnitWarning
from skhybrid.logs import LogReport
from skhybrid.logs.counters import counter_jumps, is_counter, power_of_counter
from skhybrid.logs.log_findings import counter_findings
from skhybrid.logs.naming import factor_in_name
from skhybrid.study import read_log
from skhybrid.study.settings import settings_from

N = 960


def counter(energy, start=0.0, step="15min"):
    """Readings before each of the energies (n,) per row."""
    readings = start + np.append(0.0, np.cumsum(energy))[:-1]
    return pd.Series(readings, pd.date_range("2024-01-15", periods=len(readings), freq=step, tz="UTC", name="time"))


@pytest.fixture
def plant():
    """A plant of 6 kW that is on for about a third of the time, in energies per quarter of an hour."""
    return np.where(np.random.default_rng(1).random(N) < 0.3, 1.5, 0.0)


def _check(readings, at, truth, n_missing):
    """Compare the stamps that jump, and the power of all other rows."""
    assert counter_jumps(readings).tolist() == readings.index[at].tolist()
    power = power_of_counter(readings)[:-1]
    known = np.isfinite(power)
    assert (~known).sum() == n_missing
    np.testing.assert_allclose(power[known], truth[:-1][known], atol=1e-9)


@pytest.mark.parametrize("start", [14.0, 83214.0])
def test_a_reading_that_falls_and_comes_back_is_left_out(plant, start):
    readings = counter(plant, start)
    readings.iloc[400] = 0.0
    truth = plant / 0.25
    truth[399] = truth[399:401].mean()  # from the reading before to the one after
    _check(readings, [400], truth, 1)
    for row in (500, 501, 502, 700):
        readings.iloc[row] = 0.0
    truth[499], truth[699] = truth[499:503].mean(), truth[699:701].mean()
    _check(readings, [400, 500, 700], truth, 5)


@pytest.mark.parametrize("rise", [600.0, 6500.0])
def test_a_meter_that_was_replaced_is_left_out(plant, rise):
    readings = counter(plant, 83214.0)
    readings.iloc[300:] += rise
    _check(readings, [300], plant / 0.25, 1)
    readings.iloc[600] += 90000.0  # one reading alone: neither the rise to it nor the fall from it counts
    _check(readings, [300, 600], plant / 0.25, 3)
    readings.iloc[800:] -= readings.iloc[800]  # a new meter begins at zero
    _check(readings, [300, 600], plant / 0.25, 4)


def test_a_meter_that_rises_in_every_row_may_be_replaced():
    readings = counter(np.ones(N))
    readings.iloc[300:] += 600.0
    assert counter_jumps(readings).tolist() == [readings.index[300]]


def test_a_standing_meter_with_a_failed_reading_stands_still():
    readings = counter(np.zeros(N), 800.0)
    readings.iloc[50] = 0.0
    _check(readings, [50], np.zeros(N), 1)


def _late(n):
    energy = np.full(N, 0.0125)  # 50 W of losses at rest, and 4 kW at the end
    energy[N - n :] = 1.0
    return energy


@pytest.mark.parametrize(
    "energy",
    [
        np.where(np.arange(N) % 200 == 199, 1.0, 0.0),  # ticks of 1 kWh
        np.where(np.arange(N) < N - 5, 0.0, 2.0),  # a plant that starts late
        np.where(np.arange(N) < N - 1, 0.0, 5.0),
        np.where(np.arange(N) == N - 2, 9.0, 0.0),
        _late(2),
        _late(40),
        np.where(np.arange(N) % 96 < 4, 30.0, 0.05),  # 120 kW for an hour each day, and 0.2 kW at rest
        np.where(np.arange(N) % 96 == 30, 2.0, 0.0),  # one row each day
        np.random.default_rng(0).lognormal(0.0, 1.0, N) / 4.0,
    ],
)
def test_what_a_plant_does_is_no_jump(energy):
    _check(counter(energy, 12345.0), [], energy / 0.25, 0)


@pytest.mark.parametrize("tick", [1.0, 10.0])
def test_steps_of_a_coarse_counter_are_spread(tick):
    """A meter that counts 10 kWh says nothing until the next, which is no 40 kW in a quarter of an hour."""
    truth = 1.2 + np.sin(np.arange(N) / 96.0)  # [kW]
    exact = np.append(0.0, 0.25 * truth.cumsum())
    readings = counter(np.diff(tick * np.floor(exact / tick), append=0.0), 700.0)
    power = power_of_counter(readings)[:-1]
    used = readings.iloc[-1] - readings.iloc[0]
    assert used <= 0.25 * np.nansum(power) < used + tick
    assert np.abs(power - truth).mean() < 0.2  # as steps of 40 kW it is 2
    # every step of the counter is reached when it was
    np.testing.assert_array_less(np.abs(0.25 * power.cumsum() - exact[1:]), tick)
    (found,) = counter_findings("meter", readings)
    assert found.text.startswith(f"counts in steps of {tick:g} kWh, one in about")
    # a day's course is lost where the next step takes a good part of the day
    seldom = readings.set_axis(readings.index[0] + 2 * (readings.index - readings.index[0]))
    assert [found.level for found in counter_findings("meter", seldom)] == ["warning" if tick == 10.0 else "note"]


def test_a_counter_that_is_set_to_zero_is_no_failed_reading():
    """Once a day, also where the whole heat of a day falls into one row."""
    energy = np.where(np.arange(N) % 96 == 0, 12.0, 0.1)
    readings = counter(energy)
    readings = readings - readings.groupby(readings.index.date).transform("first")
    _check(readings, [], energy / 0.25, 9)


def test_small_rises_at_once_and_gaps_are_no_jumps(plant):
    """A log of changes may have two rises within a second; after a gap the heat of days comes at once."""
    readings = counter(plant, 500.0)
    twin = readings.iloc[[100]].shift(freq="1s") + 0.01
    assert counter_jumps(pd.concat([readings, twin]).sort_index()).empty
    gap = readings.drop(readings.index[200:700])
    assert counter_jumps(gap).empty
    assert power_of_counter(gap)[199] == pytest.approx(plant[199:700].sum() / (501 * 0.25))


@pytest.mark.parametrize(("unit", "factor"), [("kWh", 1.0), ("Wh", 1e3), ("MWh", 1e-3)])
def test_the_report_names_the_counter_and_the_stamp(plant, unit, factor):
    readings = counter(plant, 83214.0)
    readings.iloc[300:] += 600.0
    readings.iloc[500] = 0.0
    log = pd.DataFrame({"Room temp (C)": 20.0 + np.sin(np.arange(N) / 15), f"Heat meter [{unit}]": readings * factor})
    report = LogReport(log)
    (found,) = [f for f in report.findings if f.where == f"Heat meter [{unit}]"]
    assert found.level == "warning"
    assert found.text == (
        "the counter jumps at 2024-01-18 03:00:00+00:00 and at 1 more; these rows are left out: was the meter "
        "replaced, or did a reading fail?"
    )
    assert report.frame["Q_heat"].max() == pytest.approx(6.0)


def _of_the_day(rows_per_day):
    energy = np.where(np.arange(40 * rows_per_day) % 7 < 3, 1.0, 0.0)
    readings = counter(energy, step=pd.Timedelta("1D") / rows_per_day)
    return readings - readings.groupby(readings.index.date).transform("first")


def _with_failed():
    readings = counter(np.where(np.arange(N) % 50 == 49, 1.0, 0.0), 800.0)
    readings.iloc[[100, 333, 555, 801]] = 0.0
    return readings


@pytest.mark.parametrize(
    ("readings", "expected"),
    [
        (_of_the_day(24), True),
        (_of_the_day(96), True),
        (_of_the_day(24) + 1.5, True),  # it keeps some of its reading
        (_with_failed(), True),
        (counter(np.ones(N)).where(np.arange(N) < 500, counter(np.ones(N)) - 500.0), True),
        (pd.Series(np.where(np.arange(N) % 200 < 15, 2.5, 0.0), counter(np.ones(N)).index), False),  # kW, few runs
        (pd.Series(np.minimum(np.arange(N) % 120, 15) * (np.arange(N) % 120 < 40), counter(np.ones(N)).index), False),
        (pd.Series((np.arange(N) % 400 < 200) * 1.0, counter(np.ones(N)).index), False),  # a switch
        (counter(np.where(np.arange(N) % 9 == 8, -2.5, 1.0)), False),  # a level that rises by more than it falls
    ],
)
def test_what_is_a_counter(readings, expected):
    """One that is set to zero at midnight is a counter; a plant that seldom runs, or ramps up and stops, is none."""
    assert is_counter(readings) is expected


def test_rows_that_occur_twice_lose_no_power(plant):
    readings = counter(plant, 500.0)
    power = power_of_counter(pd.concat([readings, readings.iloc[100:110]]).sort_index(kind="stable"))
    assert np.isnan(power).sum() == 1
    assert np.nansum(power_of_counter(readings)) == pytest.approx(np.nansum(np.delete(power, range(101, 121, 2))))


@pytest.mark.parametrize(
    ("name", "factor"),
    [("heat_x10", 10.0), ("Heat energy x0,1", 0.1), ("Heat (kWh × 100)", 100.0), ("Heat [0.01 MWh]", 0.01),
     ("kWh*10", 10.0), ("box10", None), ("room_x101", None), ("T (10 m)", None), ("fan_2x10kW", None), ("x10.5", None)],
)  # fmt: skip
def test_the_factor_in_a_name(name, factor):
    assert factor_in_name(name) == factor


def test_a_factor_in_a_name_is_told_until_one_is_given(plant, tmp_path):
    """It may multiply or divide; heat was read a tenth of what it was, in silence."""
    room = 20.0 + np.sin(np.arange(N) / 9.0)
    log = pd.DataFrame({"room temp": room, "outdoor temp": room - 9.0, "heat_energy_x10": counter(plant) / 10.0})
    text = "the factor 10 in its name is not applied; under [scale] give Q_heat = 10 to multiply by it, 0.1 to divide"
    told = [f for f in LogReport(log).findings if f.where == "heat_energy_x10" and text in f.text]
    assert [f.level for f in told] == ["warning"]
    assert not any("factor" in f.text for f in LogReport(log, scale={"Q_heat": 10.0}).findings)
    log.to_csv(tmp_path / "log.csv")
    given = {"columns": LogReport(log).roles, "units": {"Q_heat": "kWh counter"}}
    with pytest.warns(UnitWarning, match=r"'heat_energy_x10': the factor 10 in its name is not applied"):
        read_log(tmp_path / "log.csv", settings_from(given))
    heat = read_log(tmp_path / "log.csv", settings_from({**given, "scale": {"Q_heat": 10}}))[0]["Q_hvac"]
    np.testing.assert_allclose(heat[:-1], plant[:-1] / 0.25)
