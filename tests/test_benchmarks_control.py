"""The arithmetic of the closed-loop study (benchmarks/control.py), without EnergyPlus."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import _control_report as report
import _controllers as controllers
import control
from _control_plant import held_setpoints, row_of, without_ramps
from _controllers import Impulse, Interface, Planner, Prediction, plan
from _energyplus import N_STEPS

from skhybrid import ARXRegressor
from skhybrid.datasets import make_office

GAIN = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0]])
WIDE = (-10.0, 10.0)
CASE = control.matrix()[0]
DAY = pd.Timedelta("1D")


def _planned(free, price, limits=WIDE, weight=50.0, band=(21.0, 24.0)):
    prediction = Prediction(np.full(3, free), GAIN)
    return plan(prediction, np.array([band, band]), np.array(price), limits, weight)


# -------------------------------------------------------------------------------------------------------------- plans
@pytest.mark.parametrize(
    ("free", "price", "options", "heat"),
    [
        (20.0, [8.0, 8.0], {}, [1.0, 0.5]),  # 1 K is missing, of which half is left a step later
        (20.0, [8.0, 40.0], {}, [2.0, 0.0]),  # 0.5 kW at 40 ct cost more than a further kW at 8 ct
        (20.0, [8.0, 8.0], {"limits": (0.0, 0.6)}, [0.6, 0.6]),
        (20.0, [8.0, 8.0], {"weight": 5.0}, [0.0, 0.0]),  # 1.5 K for 0.25 h are worth less than 2 ct
        (26.0, [8.0, 8.0], {}, [-2.0, -1.0]),
        (26.0, [8.0, 8.0], {"limits": (0.0, 5.0)}, [0.0, 0.0]),  # no cooling to be had
        (22.0, [8.0, 8.0], {}, [0.0, 0.0]),
    ],
)
def test_a_plan_is_the_one_by_hand(free, price, options, heat):
    found = _planned(free, price, **options)
    np.testing.assert_allclose(found.heat, heat, atol=1e-9)
    np.testing.assert_allclose(found.temperature, free + GAIN[1:, :2] @ heat, atol=1e-9)


def test_blocks_are_steps_for_four_hours_and_then_hours():
    block = controllers.blocks_of(96)
    np.testing.assert_array_equal(np.bincount(block), [1] * 16 + [4] * 20)


def test_the_thermostat_tracks_what_is_planned():
    band = np.array([21.0, 24.0])
    assert controllers.tracked(1.0, 22.0, band) == (22.0, 24.0)
    assert controllers.tracked(1.0, 23.9, band) == (23.9, pytest.approx(24.1))
    assert controllers.tracked(-1.0, 21.1, band) == (pytest.approx(20.9), 21.1)
    assert controllers.tracked(0.0, 22.5, band) == (21.0, 24.0)
    assert controllers.tracked(2.0, 20.5, band) == (21.0, 24.0)  # the most that the plant was thought to do
    assert controllers.tracked(-2.0, 24.5, band) == (21.0, 24.0)


def test_held_heat_is_that_of_now():
    affine = SimpleNamespace(free=np.full(3, 20.0), gain=GAIN[:, :, None], zeta=np.array([1.0, 0.5, 2.0]))
    asked = {}
    model = SimpleNamespace(affine_forecast=lambda *args, **settings: asked.update(settings) or affine)
    assert Interface(model).predict(None, 20.0).free is affine.free
    assert "member" not in asked
    held = Interface(model, "network", hold=True).predict(None, 20.0)
    np.testing.assert_allclose(held.free, [20.0, 20.0, 20.5])  # 0.5 kW more over the second step
    assert asked["member"] == "network"


def test_an_arx_is_affine_by_its_impulse_response():
    office = make_office(n_days=13, sampling_time="15min", random_state=1)
    heat = 6.0 * office.X["u_heat"] - 5.0 * office.X["u_cool"]
    X = office.X.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=heat)
    now = 11 * 96 + 7
    model = ARXRegressor(alpha=10.0).fit(X[:480], X["T_za"][:480])
    forecaster = Impulse(model)
    forecaster.observe(X[100:400])
    forecaster.observe(X[400:now])
    found = forecaster.predict(X[now : now + 97].drop(columns=["Q_hvac", "T_za"]), X["T_za"].iloc[now])
    assert len(forecaster.rows) == Impulse.HISTORY
    expected = model.predict_from(X[: now + 97], [now], "1D")[0]
    heat = heat[now : now + 97].to_numpy()
    np.testing.assert_allclose((found.free + found.gain @ heat)[1:], expected, rtol=0, atol=1e-9)
    assert found.free[0] == X["T_za"].iloc[now]


# ------------------------------------------------------------------------------------------------------ the loop itself
class _Room:
    """A room whose temperature goes 0.1 of the way to outdoors in a step and rises by 0.5 K/kW."""

    OUT, LOSS, RISE, LIMIT = 5.0, 0.1, 0.5, 4.0

    def __init__(self):
        self.seen = []

    def observe(self, rows):
        self.seen.append(rows)

    def predict(self, ahead, T):
        steps = np.arange(len(ahead))
        lag = steps[:, None] - steps - 1
        gain = np.where(lag >= 0, self.RISE * (1 - self.LOSS) ** np.maximum(lag, 0), 0.0)
        return Prediction(self.OUT + (T - self.OUT) * (1 - self.LOSS) ** steps, gain)

    def step(self, T, low, high):
        free = T + self.LOSS * (self.OUT - T)
        heat = np.clip((low - free) / self.RISE, 0.0, self.LIMIT) + np.clip((high - free) / self.RISE, -self.LIMIT, 0.0)
        return free + self.RISE * heat, heat


def test_a_planner_with_the_right_model_keeps_to_its_plan():
    """Rows that are observed follow each other, with the heat and temperature of the same step."""
    room, begin, n = _Room(), 96, 40
    index = pd.date_range("2018-01-01", periods=N_STEPS, freq="15min")
    band = np.tile([15.0, 24.0], (N_STEPS, 1))
    band[begin + 12 :, 0] = 19.0
    price = np.full(N_STEPS, 8.0)
    inputs = pd.DataFrame({"T_oa": _Room.OUT}, index)
    planner = Planner(room, inputs, band, price, (0.0, _Room.LIMIT), begin)
    assert planner(-1 - 50, 18.0, np.nan) == planner(50, 18.0, np.nan) == (15.0, 24.0)
    T, heat, log = 18.0, np.nan, []
    for row in range(begin, begin + n):
        before = T
        T, delivered = room.step(T, *planner(row, T, heat))
        heat = delivered
        log.append((before, delivered))
    T_za, Q = np.array(log).T
    seen = pd.concat(room.seen)
    assert seen.index.equals(index[begin : begin + 36])
    np.testing.assert_allclose(seen[["Q_hvac", "T_za"]].to_numpy(), np.column_stack([Q, T_za])[:36])
    ends = np.append(T_za[1:], T)
    assert controllers.discomfort(ends, band[begin : begin + n]).sum() < 1e-9
    everything = np.full((2, N_STEPS), np.nan)
    everything[:, begin : begin + n] = Q, T_za
    assert controllers.closed_loop_error(planner.kept, *everything) == {}  # no whole day yet
    kept = [(row, Prediction(p.free[:20], p.gain[:20, :20])) for row, p in planner.kept[:1]]
    row, prediction = kept[0]
    found = prediction.free + prediction.gain @ Q[:20]
    np.testing.assert_allclose(found, T_za[:20], atol=1e-9)


def test_the_error_in_the_loop_is_under_the_delivered_heat():
    n = 97
    prediction = Prediction(np.full(n, 20.0), np.tri(n, k=-1))
    heat = np.zeros(300)
    heat[110] = 2.0
    T = np.full(300, 20.0)
    T[111:] = 22.5
    found = controllers.closed_loop_error([(100, prediction)], heat, T)
    assert (found["RMSE 1 h"], found["RMSE 6 h"], found["RMSE 24 h"]) == (0.0, 0.5, 0.5)
    assert found["RMSE"] == pytest.approx(np.sqrt(86 * 0.25 / 96))


# -------------------------------------------------------------------------------------------------- judgement and rules
def test_discomfort_is_in_kelvin_hours():
    band = np.tile([21.0, 24.0], (4, 1))
    np.testing.assert_allclose(controllers.discomfort(np.array([20.0, 22.0, 26.0, 21.0]), band), [0.25, 0, 0.5, 0])


def test_peaks_are_on_working_days():
    index = pd.date_range("2018-01-05 09:45", periods=2, freq="15min").append(
        pd.DatetimeIndex(["2018-01-06 08:00", "2018-01-08 17:00"])
    )
    np.testing.assert_array_equal(controllers.prices(index, "winter"), [16.0, 8.0, 8.0, 16.0])
    np.testing.assert_array_equal(controllers.prices(index, "summer"), [8.0, 8.0, 8.0, 16.0])


def test_a_rule_is_early_before_people_and_peaks_alone():
    n = 4 * 96
    setpoints = np.tile([15.0, 27.0], (n, 1))
    for day in (0, 1):  # people from 7 to 20 h on two days; a peak from 17 h on three
        setpoints[day * 96 + 28 : day * 96 + 80] = [21.0, 24.0]
    price = np.full(n, 8.0)
    for day in range(3):
        price[day * 96 + 68 : day * 96 + 84] = 16.0
    expected = setpoints.copy()
    for day in (0, 1):
        expected[day * 96 + 24 : day * 96 + 28, 0] = 21.5
        expected[day * 96 + 64 : day * 96 + 68, 0] = 21.5
    np.testing.assert_array_equal(controllers.rule(setpoints, price, "winter", 1, 0.5), expected)
    summer = controllers.rule(setpoints, price, "summer", 1, 0.5)
    assert (summer[24:28] == [15.0, 23.5]).all()
    assert (summer[64:68] == [21.0, 23.5]).all()
    np.testing.assert_array_equal(controllers.rule(setpoints, price, "winter", 0, 0.0), setpoints)


def test_steps_toward_the_set_point_of_the_day_are_left_out():
    found = without_ramps(np.array([15.0, 18.0, 21.0, 20.0]), np.array([27.0, 25.0, 24.0, 27.0]))
    np.testing.assert_array_equal(found, [[15, 27], [15, 27], [21, 24], [15, 27]])


class _Recorded:
    """A plant that does nothing but note the days that were run."""

    def __init__(self):
        self.bands = {CASE.zone: np.tile([20.0, 24.0], (N_STEPS, 1))}
        self.bands[CASE.zone][::96, 0] = 21.0
        self.days = []

    def run(self, zone, first, last, policy, added=None):
        self.days.append((first, last))
        index = pd.date_range(first, last + DAY, freq="15min", inclusive="left")
        low = np.array([policy(row, 20.0, 0.0)[0] for row in row_of(first) + np.arange(len(index))])
        return pd.DataFrame({"Q_hvac": (low - 20.0) ** 2, "T_end": low}, index)


def test_rules_are_tuned_on_training_weeks_alone(tmp_path):
    bench = control.Bench(CASE, _Recorded(), tmp_path)
    bench.setpoints("tuned rule")
    first, last = (pd.Timestamp(day) for day in control.SEASONS["winter"][:2])
    days = bench.plant.days
    assert len(days) == 13
    assert all(first - DAY * 7 <= begin < end <= last for begin, end in days)
    bench.setpoints("tuned rule")
    assert len(days) == 13  # kept
    assert bench.setpoints("thermostat") is bench.band


def test_random_set_points_stand_in_the_last_training_weeks():
    last = pd.Timestamp(control.SEASONS["winter"][1])
    band = np.tile([15.6, 26.7], (N_STEPS, 1))
    found = control.excited(band, last, CASE)
    changed = np.flatnonzero((found != band).any(axis=1))
    assert (changed[0], changed[-1] + 1) == (row_of(last) - 13 * 96, row_of(last) + 96)
    assert (found[:, 1] - found[:, 0]).min() >= 0.2
    assert held_setpoints(found)(-1 - changed[0], 20.0, 0.0) == tuple(found[changed[0]])


# ------------------------------------------------------------------------------------------------------------- resuming
def test_a_stopped_run_goes_on_where_it_was(tmp_path):
    done, broken = [], [True]

    class Bench:
        def __init__(self, case):
            pass

        def assess(self, controller, fortnight):
            if broken[0] and len(done) == 4:
                raise KeyboardInterrupt
            done.append((controller, fortnight))
            return {"cost": 1.0}

        def warming(self):
            return {"gain 1 h": 1.0}

    with pytest.raises(KeyboardInterrupt):
        control.fill(CASE, tmp_path, Bench)
    broken[0] = False
    control.fill(CASE, tmp_path, Bench)
    assert done == list(control.rows_of(CASE))
    control.fill(CASE, tmp_path, lambda case: pytest.fail("there is nothing left to run"))
    row = control.read_row(control.path_of(tmp_path, CASE, "thermostat", 2))
    assert row == CASE._asdict() | {"controller": "thermostat", "fortnight": 2, "cost": 1.0}


# --------------------------------------------------------------------------------------------------------------- tables
def _rows(J, season="winter"):
    about = CASE._asdict() | {"season": season}
    return [
        about | {"controller": name, "fortnight": n, "cost": cost, "energy": 1.0, "K h": 1.0}
        for name, costs in J.items()
        for n, cost in enumerate(costs)
    ]


def test_differences_are_paired_by_fortnight():
    mean, low, high = report.interval(np.array([1.0, 2.0, 3.0]))
    assert (mean, low, high) == pytest.approx((2.0, 2.0 - 4.302653 / np.sqrt(3), 2.0 + 4.302653 / np.sqrt(3)))
    frame = report._frame(_rows({"tuned rule": [10, 20, 30], "MPC": [11, 22, 33], "late": [0, 0]}))
    assert set(frame["controller"]) == {"tuned rule", "MPC"}  # one fortnight of the other is missing
    found = report.differences(frame, "tuned rule", ["cost"])
    assert found.loc[("winter", "MPC", 3), "cost"] == "+2 (-0 to 4)"


def test_what_is_recovered_is_a_share_of_what_the_gains_save():
    J = {"tuned rule": [100, 100], "MPC, gains known": [80, 80], "MPC, hybrid": [90, 82]}
    found = report.recovered(report._frame(_rows(J) + _rows({k: v[::-1] for k, v in J.items()}, "summer")))
    assert found.loc[("winter", "MPC, hybrid"), "J at 50 ct"] == "70%"
    worse = report._frame(_rows(J | {"MPC, gains known": [100, 101]}))
    assert report.recovered(worse).loc[("winter", "MPC, hybrid"), "J at 50 ct"] == ""


def test_the_page_says_what_was_not_run(tmp_path):
    rows = _rows({"tuned rule": [10.0, 20.0, 30.0]})
    other = CASE._replace(season="summer")
    missing = [(CASE, "MPC, OD", 1), (CASE, "MPC, OD", 2)]
    missing += [(other, name, n) for name in ("tuned rule", "MPC, OD") for n in range(3)]
    report.write_results(rows, [], missing, 11, "command", tmp_path)
    text = (tmp_path / "control.md").read_text(encoding="utf-8")
    assert "Run: 3 of 11 rows" in text
    assert "| tuned rule | 20 | 1 | 1.00 | 40 | 70 | 220 | 3 |" in text
    assert "| winter | 106 | plain | 2, 3 | MPC, OD |" in text
    assert "| summer | 106 | plain | 1, 2, 3 | all |" in text
