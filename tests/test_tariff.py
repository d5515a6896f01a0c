"""Cost of a day's plant energy at one price and at prices by the clock."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid.study.settings import settings_from
from skhybrid.study.tariff import energy_cost

COLUMNS = {"T_za": "T_za", "T_oa": "T_oa"}


def _forecast(n=48, load=2.0, start="2024-01-05", **more):
    """Hours from a Friday on."""
    index = pd.date_range(start, periods=n, freq="1h")
    return pd.DataFrame({"Q_hvac": np.full(n, load), "T_oa": np.zeros(n), **more}, index=index)


def test_the_price_of_the_hour_applies_to_heat_where_no_performance_is_given():
    tariff = {"price": {"6:00": 0.4, "22:00": 0.2}, "weekend": 0.1, "currency": "EUR"}
    cost = energy_cost(_forecast(), tariff, {}, None)
    assert cost.value == pytest.approx(2.0 * (16 * 0.4 + 8 * 0.2 + 24 * 0.1))
    assert cost.entries() == {"cost of heat [EUR]": 20.8}
    holiday = energy_cost(_forecast(), tariff, {}, ["2024-01-05"])
    assert holiday.value == pytest.approx(2.0 * 48 * 0.1)


def test_a_price_that_changes_within_a_step_counts_for_its_minutes():
    tariff = {"price": {"7:30": 0.4, "22:15": 0.2}}
    hourly = energy_cost(_forecast(24), tariff, {}, None)
    assert hourly.value == pytest.approx(2.0 * (14.75 * 0.4 + 9.25 * 0.2))
    last = energy_cost(_forecast(4, start="2024-01-05 20:30"), tariff, {}, None)  # the last step ends after midnight
    assert last.value == pytest.approx(2.0 * (1.75 * 0.4 + 2.25 * 0.2))


def test_it_applies_to_electricity_where_a_performance_is_given():
    plant = {"cop": [[-10, 2.0], [10, 4.0]], "eer": 5.0}
    heated = energy_cost(_forecast(24), {"price": 0.3}, plant, None)
    assert heated.value == pytest.approx(24 * 2.0 / 3.0 * 0.3)
    assert heated.entries() == {"cost of electricity": 4.8}
    cooled = energy_cost(_forecast(24, load=-2.0), {"price": 0.3}, plant, None)
    assert cooled.value == pytest.approx(24 * 2.0 / 5.0 * 0.3)


def _paths(*loads, names=("Q_hvac",), n=24):
    """Paths of constant loads: a tuple of these for each zone."""
    index = pd.MultiIndex.from_product([range(len(loads)), _forecast(n).index], names=["sample", "time"])
    return pd.DataFrame(np.repeat(np.reshape(loads, (len(loads), -1)), n, axis=0), index, list(names))


def test_paths_of_the_load_give_the_cost_an_interval():
    loads = np.linspace(-1.0, 4.0, 11)
    cost = energy_cost(_forecast(24), {"price": 0.5}, {}, None, paths=_paths(*loads))
    expected = np.quantile(12.0 * np.abs(loads), [0.1, 0.9])
    np.testing.assert_allclose(cost.interval, expected)
    assert cost.entries()["cost of heat, 80 % interval"] == expected.round(2).tolist()
    pumped = energy_cost(_forecast(24), {"price": 0.5}, {"cop": 4.0, "eer": 2.0}, None, paths=_paths(*loads))
    np.testing.assert_allclose(
        pumped.interval, np.quantile(12.0 * np.where(loads > 0, loads / 4, -loads / 2), [0.1, 0.9])
    )
    assert energy_cost(_forecast(24), {"price": 0.5}, {}, None).interval is None


def test_the_cost_of_several_zones_is_that_of_all():
    rooms = _forecast(24, Q_hvac_hall=1.0, Q_hvac_attic=-2.0).drop(columns="Q_hvac")
    zones = ["hall", "attic", "cellar"]
    assert energy_cost(rooms, {"price": 0.5}, {}, None, zones).value == pytest.approx(24 * 0.5 * 3.0)
    paths = _paths((1.0, -2.0), (3.0, -4.0), names=["Q_hvac_hall", "Q_hvac_attic"])
    both = energy_cost(rooms, {"price": 0.5}, {}, None, zones, paths)
    np.testing.assert_allclose(both.interval, np.quantile([36.0, 84.0], [0.1, 0.9]))
    assert energy_cost(rooms, {"price": 0.5}, {}, None, ["cellar"]) is None


def test_without_a_tariff_or_a_load_there_is_no_cost():
    assert energy_cost(_forecast(), {}, {}, None) is None
    assert energy_cost(_forecast().drop(columns="Q_hvac"), {"price": 0.3}, {}, None) is None


@pytest.mark.parametrize(
    ("tariff", "message"),
    [({"currency": "EUR"}, "needs the price"), ({"price": "0.3"}, "must be a price"), ({"prize": 1}, "unknown key"),
     ({"price": {"25:00": 0.3}}, "not a clock time"), ({"price": {"6:00": True}}, "not a price of a kWh"),
     ({"price": float("nan")}, "not a price of a kWh"), ({"price": 0.3, "currency": 3}, "text in quotes")],
)  # fmt: skip
def test_tariffs_that_cannot_be(tariff, message):
    with pytest.raises(ValueError, match=message):
        settings_from({"columns": COLUMNS, "tariff": tariff})
