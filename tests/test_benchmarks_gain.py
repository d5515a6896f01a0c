"""The benchmark of gains (``benchmarks/gain.py``): what a step test reads, of plants and of forecasts."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import _step_tests as steps
import gain

from skhybrid.datasets import _office as office_module
from skhybrid.datasets import make_office

SIDE = 20.0  # of the square floor [m]


class _Ramp:
    """A plant that warms by 0.01 K/kW per step from the begin of a step on, and whose unit gives back a share of it."""

    def __init__(self, answer=0.0):
        corners = [{"vertex_x_coordinate": x, "vertex_y_coordinate": y, "vertex_z_coordinate": 0.0}
                   for x, y in ((0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE))]  # fmt: skip
        floor = {"zone_name": "Z", "surface_type": "Floor", "vertices": corners}
        self.document, self.answer = {"BuildingSurface:Detailed": {"floor": floor}}, answer

    def respond(self, zone, heat, added, days):
        runs = np.zeros(len(added))
        for k in np.flatnonzero(added):
            runs[k] = runs[k - 1] + 1.0
        columns = {"T:Z": 20.0 + 0.01 * runs * added / 1000.0, "heating:Z": 0.0, "cooling:Z": self.answer * added}
        return pd.DataFrame(columns, heat.index)


def _log():
    index = pd.date_range("2018-01-01 00:15", periods=steps.N_STEPS, freq="15min")
    return pd.DataFrame({"heating:Z": 1000.0, "cooling:Z": 0.0}, index)


def _zone():
    return steps.Building("b_z", "m", "c", ("Z",), "office", 1)


def test_a_response_counts_from_the_begin_of_its_step():
    found = steps.step_gains(_Ramp(), _zone(), "winter", _log())
    assert len(found) == 12
    assert set(found["start_h"]) == {0, 7, 14, 21}
    assert [str(day) for day in found["day"].unique()] == ["2018-02-27", "2018-03-08", "2018-03-17"]
    for name, n_steps in zip(found.columns[4:], (1, 4, 16, 48, 96), strict=True):
        np.testing.assert_allclose(found[name], 0.01 * n_steps, rtol=1e-9)


def test_a_plant_that_answers_a_step_is_refused():
    with pytest.raises(RuntimeError, match="answered a step of 4000 W with 80 W"):
        steps.step_gains(_Ramp(answer=0.02), _zone(), "winter", _log())


def test_only_the_terminal_of_the_zone_gets_a_schedule():
    kind = "AirTerminal:SingleDuct:VAV:Reheat"
    document = {
        "ZoneHVAC:EquipmentConnections": {
            z: {"zone_name": z, "zone_conditioning_equipment_list_name": f"list {z}"} for z in "AB"
        },
        "ZoneHVAC:EquipmentList": {
            f"list {z}": {"equipment": [{"zone_equipment_name": "exhaust fan"}, {"zone_equipment_name": f"unit {z}"}]}
            for z in "AB"
        },
        "ZoneHVAC:AirDistributionUnit": {
            f"unit {z}": {"air_terminal_object_type": kind, "air_terminal_name": f"box {z}"} for z in "AB"
        },
        kind: {f"box {z}": {"availability_schedule_name": "ALWAYS_ON", "x": 1} for z in "AB"},
    }
    changed = steps._with_schedule_of_terminal(document, "B", "open B")
    assert changed[kind]["box B"] == {"availability_schedule_name": "open B", "x": 1}
    assert changed[kind]["box A"] == document[kind]["box A"]
    assert document[kind]["box B"]["availability_schedule_name"] == "ALWAYS_ON"


def test_the_response_of_the_office_is_that_of_its_simulation(monkeypatch):
    """The stages that the thermostat chose are replayed, once with a kW more."""
    begin, arguments = 3 * 288 + 84, []
    simulate = office_module._simulate_office
    monkeypatch.setattr(office_module, "_simulate_office", lambda *a: (arguments.append(a), simulate(*a))[1])
    fine = make_office(5, "chicago", start=gain.OFFICE_START, sampling_time="5min", random_state=2)
    stages = fine.X[["u_heat", "u_cool"]].to_numpy()
    more = stages.copy()
    more[begin : begin + 288, 0] += 1.0 / 6.0
    base, moved = (simulate(*arguments[0][:3], replay)["T_za"].to_numpy() for replay in (stages, more))
    expected = (moved - base)[begin + 3 * gain.ROWS_AHEAD]
    np.testing.assert_allclose(gain._response(gain.air_conductance(fine)[begin:]), expected, rtol=1e-3)


def test_a_step_in_a_forecast_begins_at_its_origin():
    """A model that adds up the heat from the origin on answers with the number of leads."""
    seen = []

    def predict_from(X, origins, horizon):
        seen.append((len(X), X["Q_hvac"].iloc[: origins[0]].sum()))
        return np.cumsum(X["Q_hvac"].to_numpy()[origins[0] :])[None, : gain.DAY]

    later = pd.DataFrame({"T_za": 20.0, "Q_hvac": np.arange(300.0)})
    found = gain._step(SimpleNamespace(predict_from=predict_from), later, 150)
    np.testing.assert_allclose(found, [1, 4, 16, 48, 96])
    assert seen[0] == seen[1] == (150 + gain.DAY + 1, np.arange(150.0).sum())
