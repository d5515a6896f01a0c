"""Back-tests of several zones with only the set-points known: nothing measured later is read, in any zone."""

import re
from html import escape
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid import BuildingPredictor, HybridPredictor
from skhybrid.datasets import make_house
from skhybrid.exceptions import SkhybridWarning
from skhybrid.forecasting import WeatherError
from skhybrid.hybrid.thermostat_law import law_refits
from skhybrid.model_selection import backtest
from skhybrid.preprocessing import GapFiller
from skhybrid.schedule import schedule_loads
from skhybrid.study import Settings, StudyData, outputs, run_study, split_log, write_outputs
from skhybrid.study.compared_models import HYBRID, YESTERDAY, Yesterday
from skhybrid.study.doubts import Doubts
from skhybrid.study.load_rules import LAST_WEEK, USUAL
from skhybrid.study.load_rules import YESTERDAY as YESTERDAYS_LOAD
from skhybrid.study.next_day import unusable_setpoints
from skhybrid.study.outputs import format_result
from skhybrid.study.report.building_page import _setpoints_known as report_on
from skhybrid.study.report.words import percent_or_dash
from skhybrid.study.setpoints_known import SetpointsKnown
from skhybrid.study.zone_part import Study, zone_of
from skhybrid.zone.zone_backtest import backtest_zone

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning"),
    pytest.mark.usefixtures("quick_fits"),
]
KNOWN = "the weather and the set-points were known ahead, the heat was not"
ZONES = ["living", "kitchen", "bedroom"]
DAY, TRAINED = 24, 14 * 24
DOORS = [("living", "kitchen"), ("living", "bedroom")]
T_OF, Q_OF = ([f"{role}_{zone}" for zone in ZONES] for role in ("T_za", "Q_hvac"))
LEVELS = (0.1, 0.9)


@pytest.fixture(scope="module")
def log():
    house = make_house(24, 3, sampling_time="1h", random_state=0)
    stages = [name for name in house.X if name.startswith("u_heat_")]
    return house.X.drop(columns=stages).join(house.heat).join(house.setpoints)


@pytest.fixture(scope="module")
def model(log):
    return BuildingPredictor(adjacency=DOORS).fit(log[:TRAINED], log[T_OF][:TRAINED])


@pytest.fixture(scope="module")
def later(log):
    return log[TRAINED:]


@pytest.fixture(scope="module")
def as_usual(log):
    """A building with the rows after its training: no set-points in the kitchen, a bedroom that was not heated yet."""
    rows = log.drop(columns=log.filter(like="_set_kitchen").columns)
    rows.iloc[:TRAINED, rows.columns.get_loc("Q_hvac_bedroom")] = 0.0
    made = BuildingPredictor(HybridPredictor(network="1R1C"), adjacency=DOORS)
    return made.fit(rows[:TRAINED], rows[T_OF][:TRAINED]), rows[TRAINED:]


def values_of(found):
    for zone in found.values():
        yield from (*zone.paths, zone.heat_bands, zone.temperature_bands, *zone.plant.values())


def test_paths_of_all_zones_have_the_quantiles_and_errors_of_one_time(model, later):
    n, ahead = 40, later[:DAY].drop(columns=[*T_OF, *Q_OF])
    levels = list((np.arange(n) + 0.5) / n)
    frame, paths = model.forecast(None, ahead, quantiles=levels), model.sample(None, ahead, n, random_state=0)
    assert sorted(paths) == sorted([*T_OF, *Q_OF])
    for zone in ZONES:
        for role, prefix in (("T_za", "q"), ("Q_hvac", "Q_hvac")):
            drawn = paths[f"{role}_{zone}"].to_numpy().reshape(n, DAY)
            bands = frame[[f"{prefix}_{level:g}_{zone}" for level in levels]].to_numpy()
            np.testing.assert_array_equal(np.sort(drawn, axis=0).T, np.sort(bands, axis=1))
    pd.testing.assert_frame_equal(paths, model.sample(None, ahead, n, random_state=0))
    alone = model.own_["kitchen"]  # the errors of a zone are drawn from the same origins as those of the others
    np.testing.assert_array_equal(alone._law.joint.hours, model.own_["living"]._law.joint.hours)


def test_a_back_test_is_the_forecast_from_each_origin(model, later):
    """Row by row, by the method that forecasts from one origin, after the first week's laws were learned anew."""
    frame = backtest(model, later, later[T_OF], start=later.index[5 * DAY], quantiles=LEVELS, heat_known=False)
    assert frame["origin"].nunique() == 4
    assert list(frame["zone"].unique()) == ZONES
    for origin in (5 * DAY, 8 * DAY):
        ahead = later[origin : origin + DAY].drop(columns=[*T_OF, *Q_OF])
        now = dict(zip(ZONES, later[T_OF].iloc[origin], strict=True))
        expected = model.forecast(later[:origin], ahead, now, quantiles=LEVELS)
        for zone in ZONES:
            own = frame[(frame["zone"] == zone) & (frame["origin"] == later.index[origin])]
            for name in ("T_za", "q_0.1", "q_0.9"):
                of_T = own["y_pred" if name == "T_za" else name]
                np.testing.assert_allclose(of_T.to_numpy()[:-1], expected[f"{name}_{zone}"].to_numpy()[1:], atol=1e-9)
            for name in ("Q_hvac", "Q_hvac_0.1", "Q_hvac_0.9"):
                load = own["Q_hvac_pred" if name == "Q_hvac" else name]
                # the rows ahead end before the end of the last step, by whose hour a band is wide
                np.testing.assert_allclose(load[:-1], expected[f"{name}_{zone}"][:-1], atol=1e-9)
            np.testing.assert_array_equal(own["y_true"], later[f"T_za_{zone}"][own["time"]])
            np.testing.assert_array_equal(own["Q_hvac_true"], later[f"Q_hvac_{zone}"][own["time"] - pd.Timedelta("1h")])


@pytest.mark.slow
@pytest.mark.parametrize("heat_known", [True, False])
def test_a_back_test_goes_on_from_the_training_that_is_in_its_table(model, log, later, heat_known):
    given = {"quantiles": LEVELS, "heat_known": heat_known, "start": later.index[0]}
    assert (model.n_known_of(log), model.n_known_of(later)) == (TRAINED, 0)
    frame = backtest(model, log, log[T_OF], **given)
    pd.testing.assert_frame_equal(frame, backtest(model, later, later[T_OF], **given))


@pytest.mark.slow
@pytest.mark.parametrize("limits", [None, (-2.0, 3.0), {"kitchen": (0.0, 1.0)}])
def test_loads_go_on_from_the_training_that_is_in_their_table(model, log, limits):
    rows = log[TRAINED - 2 * DAY - 5 : TRAINED + 2 * DAY]
    held = {zone: (rows[f"T_heat_set_{zone}"], None) for zone in ZONES}
    later, known = (
        {zone: (low[part], None) for zone, (low, _) in held.items()} for part in (slice(53, None), slice(53))
    )
    load = model.predict_load(rows, held, limits)
    pd.testing.assert_frame_equal(load[53:], model.predict_load(rows[53:], later, limits))
    pd.testing.assert_frame_equal(load[:53], model.predict_load(rows[:53], known, limits))


def test_errors_of_the_weather_forecast_are_those_of_each_origin_in_all_zones(model, later):
    given = {"start": later.index[4 * DAY], "quantiles": LEVELS, "heat_known": False}
    exact = backtest(model, later[: 6 * DAY + 1], later[T_OF][: 6 * DAY + 1], **given)
    off = backtest(model, later[: 6 * DAY + 1], later[T_OF][: 6 * DAY + 1], weather_error="high", **given)
    same = ["origin", "lead", "time", "zone", "y_true", "Q_hvac_true"]
    pd.testing.assert_frame_equal(off[same], exact[same])
    widths = [(f["q_0.9"] - f["q_0.1"]).groupby(f["zone"]).mean() for f in (off, exact)]
    assert (widths[0] > 1.01 * widths[1]).all()
    origin, ahead = 5 * DAY, later[: 6 * DAY + 1].copy()
    for own in model.own_.values():
        seen = WeatherError("high").forecast(own._read_X(later[: 6 * DAY + 1]), origin, DAY).inputs
        ahead = ahead.assign(
            **{own._column_of(role): seen[role] for role in seen if role.startswith(("T_oa", "q_sol"))}
        )
    assert (ahead.iloc[: origin + 1] == later.iloc[: origin + 1]).all(axis=None)
    found = model.closed_loop_from(ahead, [origin], "1D")["kitchen"]
    chosen = off[(off["zone"] == "kitchen") & (off["origin"] == later.index[origin])]
    np.testing.assert_allclose(chosen["y_pred"], found.paths.temperature[0], atol=1e-9)


@pytest.mark.filterwarnings("default::skhybrid.exceptions.SkhybridWarning")
def test_plants_whose_thermostat_was_not_learned_run_as_usual(as_usual):
    """Beside thermostats: the kitchen has no set-points, and the bedroom was never heated in training."""
    model, later = as_usual
    assert model.thermostat_learned_ == {"living": True, "kitchen": False, "bedroom": False}
    told = "'kitchen', 'bedroom': no thermostat was learned, as the training had no set-points"
    with pytest.warns(SkhybridWarning, match=told):
        frame = backtest(model, later, later[T_OF], start=later.index[2 * DAY], quantiles=LEVELS, heat_known=False)
    assert frame.notna().all(axis=None)
    missed = (frame["Q_hvac_pred"] - frame["Q_hvac_true"]).groupby(frame["zone"]).std()
    assert missed["kitchen"] < 0.7 * frame["Q_hvac_true"].groupby(frame["zone"]).std()["kitchen"]
    origin = 5 * DAY
    ahead = later[origin : origin + DAY].drop(columns=[*T_OF, *Q_OF])
    now = dict(zip(ZONES, later[T_OF].iloc[origin], strict=True))
    found = model.forecast(later[:origin], ahead, now, quantiles=LEVELS)
    for zone in ZONES:
        own = frame[(frame["zone"] == zone) & (frame["origin"] == later.index[origin])]
        np.testing.assert_allclose(own["y_pred"].to_numpy()[:-1], found[f"T_za_{zone}"].to_numpy()[1:], atol=1e-9)
        np.testing.assert_allclose(own["Q_hvac_0.9"][:-1], found[f"Q_hvac_0.9_{zone}"][:-1], atol=1e-9)
    same = model.forecast(later[:origin], ahead, now, {"living": later["T_heat_set_living"].iloc[0], "kitchen": None})
    assert same["Q_hvac_kitchen"].mean() == pytest.approx(found["Q_hvac_kitchen"].mean(), rel=0.3)
    planned = model.forecast(later[:origin], ahead.assign(Q_hvac_kitchen=0.0), now)
    assert "Q_hvac_kitchen" not in planned
    assert planned["T_za_kitchen"].mean() < found["T_za_kitchen"].mean() - 1.0


@pytest.mark.parametrize("case", ["thermostats", "as usual"])
@pytest.mark.parametrize("origin", [3 * DAY + 5, 7 * DAY, pytest.param(7 * DAY + 1, marks=pytest.mark.slow)])
def test_nothing_measured_after_an_origin_is_read_in_any_zone(model, later, as_usual, case, origin, monkeypatch):
    """Also not by what is learned at the beginning of a week, nor to judge the forecasts of the days before.

    A load that is held for hours, as in rooms with slow heaters, looks ahead the farthest.
    """
    monkeypatch.setattr(schedule_loads, "steps_ahead", lambda *system: 6)
    model, later = as_usual if case == "as usual" else (model, later)
    other = later_changed(later, origin)
    other.loc[other.index[origin + DAY] :, other.filter(like="_set_").columns] -= 2.0  # after the horizon
    found = [forgetful(model).closed_loop_from(rows, [2 * DAY, origin], "1D", LEVELS) for rows in (later, other)]
    for first, second in zip(*map(values_of, found), strict=True):
        np.testing.assert_array_equal(first, second)


def test_the_heat_of_the_row_of_an_origin_is_not_read(model, later):
    """But for rounding: what a radiator gives off is computed with it, and it is taken off again."""
    origin = 3 * DAY
    other = later.copy()
    other.iloc[origin, [other.columns.get_loc(name) for name in Q_OF]] = 30.0
    found = (model.closed_loop_from(rows, [2 * DAY, origin], "1D", LEVELS) for rows in (later, other))
    for first, second in zip(*map(values_of, found), strict=True):
        np.testing.assert_allclose(first, second, rtol=0.0, atol=1e-12)


def forgetful(model):
    """The model without the laws that it learned of later weeks."""
    for one in (*model.own_.values(), *(coupled.model for coupled in model.coupled_.values())):
        one._running()._law._refits._found = {}
    return model


def later_changed(rows, origin):
    """Rows with other temperatures and heat in all zones after an origin."""
    out, rng = rows.copy(), np.random.default_rng(0)
    out.iloc[origin + 1 :, out.columns.get_indexer(T_OF + Q_OF)] = rng.uniform(5.0, 35.0, (len(out) - origin - 1, 6))
    return out


def test_a_zone_follows_the_forecast_of_its_neighbours(model, later):
    origin, warmer = 2 * DAY, later.copy()
    warmer.loc[warmer.index[origin] :, "T_heat_set_living"] += 4.0  # the neighbour's plan
    one, two = (model.closed_loop_from(rows, [origin])["kitchen"].paths for rows in (later, warmer))
    assert two.temperature.mean() > one.temperature.mean()
    alone = model.without_neighbours()
    one, two = (alone.closed_loop_from(rows, [origin])["kitchen"].paths for rows in (later, warmer))
    np.testing.assert_array_equal(one.temperature, two.temperature)
    own = model.own_["kitchen"].closed_loop_from(later, [origin], "1D", LEVELS)
    found = alone.closed_loop_from(later, [origin], "1D", LEVELS)["kitchen"]
    np.testing.assert_array_equal(found.paths.heat, own.paths.heat)
    np.testing.assert_array_equal(found.heat_bands, own.heat_bands)


def test_origins_of_a_week_share_its_laws(model, later, monkeypatch):
    learned = []
    monkeypatch.setattr(law_refits, "learn", lambda *a, learn=law_refits.learn: learned.append(1) or learn(*a))
    forgetful(model)
    for _ in range(2):
        backtest(model, later, later[T_OF], start=later.index[5 * DAY], origin_step="12h", heat_known=False)
        assert len(learned) == len(model.own_) + len(model.coupled_)  # ten days after the training: one week is over


def test_a_zone_without_a_plant_is_free_and_has_no_load(log, model):
    rows = log.drop(columns=["Q_hvac_bedroom", *log.filter(regex="_set_bedroom").columns])
    quick = BuildingPredictor(HybridPredictor(network="1R1C"), adjacency=DOORS[1:])
    free = quick.fit(rows[:TRAINED], rows[T_OF][:TRAINED])
    later = rows[TRAINED : TRAINED + 3 * DAY]
    frame = backtest(free, later, later[T_OF], quantiles=LEVELS, heat_known=False).set_index("zone")
    assert frame.loc["bedroom", ["Q_hvac_true", "Q_hvac_pred", "Q_hvac_0.1"]].isna().all(axis=None)
    assert frame.loc["bedroom", ["y_pred", "q_0.1", "q_0.9"]].notna().all(axis=None)
    assert frame.loc["living"].notna().all(axis=None)
    own = free.coupled_["bedroom"]
    driven = own.model.predict_from(
        free._zones.with_measured(later),
        [0],
        boundary={"T_next_living": free.own_["living"].closed_loop_from(later, [0]).paths.temperature},
    )
    share, alone = own.share(DAY), free.own_["bedroom"].predict_from(later, [0])
    expected = (1.0 - share) * alone + share * driven
    np.testing.assert_allclose(frame.loc["bedroom", "y_pred"][:DAY], expected[0], atol=1e-9)


def refused(model, rows, match, **given):
    with pytest.raises(ValueError, match=re.escape(match)):
        backtest(model, rows, rows[T_OF], heat_known=False, **given)


def test_what_cannot_be_forecast_without_heat_is_refused(log, model, later):
    missing = later.filter(regex="^(?!T_heat_set_kitchen|T_cool_set_kitchen)")
    refused(model, missing, "zone 'kitchen': T_heat_set_kitchen is missing in 240 rows")
    holed = later.assign(T_heat_set_living=later["T_heat_set_living"].where(np.arange(len(later)) != 7))
    refused(model, holed, "zone 'living': T_heat_set_living is missing in 1 row")
    with pytest.raises(ValueError, match="zone 'living': origins must be increasing row numbers"):
        model.closed_loop_from(later, [5, 2])


@pytest.mark.parametrize(
    ("given", "columns", "match"),
    [
        ({}, {"Q_hvac_living": "u_heat", "Q_hvac_kitchen": None, "Q_hvac_bedroom": None}, "column 'u_heat' is of a pl"),
        ({}, dict.fromkeys(Q_OF), "no zone had heating or cooling in training, so that heat_known=False does nothing"),
        (
            {"preprocess": GapFiller("2h")},
            {},
            "heat_known=False needs a hybrid predictor of one zone, or of a building",
        ),
    ],
)
def test_a_building_that_cannot_be_run_by_its_thermostats_is_refused(log, given, columns, match):
    kept = {name: name for name in log} | columns
    rows = log[[name for name, new in kept.items() if new]].rename(columns=kept)
    quick = HybridPredictor(network="1R1C", intervals=False, **given)
    made = BuildingPredictor(quick, adjacency=[]).fit(rows[:TRAINED], rows[T_OF][:TRAINED])
    refused(made, rows[TRAINED:], match)


# ------------------------------------------------------------------------------------------------------------ the study
def settings_of(log, **given):
    columns = {name: name for name in log}
    spans = {"train": {"end": "2023-11-17"}, "test": {"start": "2023-11-18", "end": "2023-11-23"}}
    estimator = {"name": "conventional", "n_starts": 2}
    return Settings(columns=columns, step="1h", estimator=estimator, network={"name": "1R1C"}, **spans, **given)


def yesterday_of(log, later, start):
    parts = []
    for zone in ZONES:
        model = Yesterday().fit(log[:TRAINED].rename(columns={f"T_za_{zone}": "T_za"}))
        rows = later[[f"T_za_{zone}"]].set_axis(["T_za"], axis=1)
        parts.append(backtest(model, rows, rows["T_za"], start=start).assign(zone=zone))
    return pd.concat(parts, ignore_index=True)


def study_of(settings, train, later, start, remarks):
    held = later[T_OF].set_axis(ZONES, axis=1)
    return Study(settings, StudyData(train, later, start, train, later, held, held_out=True), remarks)


def test_a_study_scores_each_zone_and_all_together(log, model, later):
    rows = later[: 6 * DAY]
    start, remarks = rows.index[DAY], []
    yesterday = yesterday_of(log, rows, start)
    held = SetpointsKnown.of(model, study_of(settings_of(log), log[:TRAINED], rows, start, remarks), yesterday)
    assert remarks == []
    frame = backtest(model, rows, rows[T_OF], start=start, quantiles=LEVELS, heat_known=False)
    of_all, errors = [], (frame["y_pred"] - frame["y_true"]) ** 2
    for zone, one in held.zones.items():
        own = frame[frame["zone"] == zone]
        assert one.table.loc[HYBRID, "rmse"] == pytest.approx(np.sqrt(errors[own.index].mean()))
        assert set(one.table.index) == {HYBRID, YESTERDAY, YESTERDAYS_LOAD, LAST_WEEK, USUAL}
        begin = own["time"] - pd.Timedelta("1h")
        past = log[f"Q_hvac_{zone}"]
        missed = own["Q_hvac_pred"] - own["Q_hvac_true"]
        assert one.table.loc[HYBRID, "load_rmse"] == pytest.approx(np.sqrt((missed**2).mean()))
        week = past[begin - pd.Timedelta("7D")].to_numpy() - past[begin].to_numpy()
        assert one.table.loc[LAST_WEEK, "load_rmse"] == pytest.approx(np.sqrt((week**2).mean()))
        inside = own["Q_hvac_true"].between(own["Q_hvac_0.1"], own["Q_hvac_0.9"])
        assert one.load_coverage == pytest.approx(inside.mean())
        of_all.append(missed)
    assert held.table.loc[HYBRID, "rmse"] == pytest.approx(np.sqrt(errors.mean()))
    assert held.table.loc[HYBRID, "load_rmse"] == pytest.approx(np.sqrt((pd.concat(of_all) ** 2).mean()))
    assert held.load_coverage == pytest.approx(np.mean([one.load_coverage for one in held.zones.values()]))
    assert f"errs by {np.sqrt(errors.mean()):.2f} K" in held.words
    assert held.usual_words == ""
    page = report_on(SimpleNamespace(setpoints_known=held, zones=pd.DataFrame(index=list(held.zones)), scaled=True))
    for one in held.zones.values():
        assert f"<td>{percent_or_dash(one.coverage)}</td>" in page
        assert f"<td>{percent_or_dash(one.load_coverage)}</td>" in page


def test_a_study_says_which_plants_run_as_usual(log, as_usual):
    model, later = as_usual
    bare = log.drop(columns=log.filter(like="_set_kitchen").columns)
    start, settings, remarks = later.index[DAY], settings_of(bare), []
    yesterday = yesterday_of(log, later[: 4 * DAY], start)
    held = SetpointsKnown.of(model, study_of(settings, bare[:TRAINED], later[: 4 * DAY], start, remarks), yesterday)
    assert remarks == []
    assert (
        held.usual_words == "No thermostat was learned of kitchen, bedroom; their heat is forecast as it usually was."
    )
    verdicts = held.zones["kitchen"].verdicts(zone_of(yesterday, "kitchen"), Doubts([], []), scaled=True)
    reason = "the weather was known ahead; no thermostat was learned, so the heat was forecast as usual"
    assert [one.reasons[0] for one in verdicts] == [reason, reason]
    assert unusable_setpoints(later[:DAY], settings) == ""


def test_without_set_points_there_is_no_such_test_and_wrong_ones_are_told(log, model, later):
    spans, yesterday = (log[:TRAINED], later[: 3 * DAY]), pd.DataFrame()
    start, settings = later.index[DAY], settings_of(log)
    bare = tuple(rows.drop(columns=rows.filter(like="_set_").columns) for rows in spans)
    remarks = []
    assert SetpointsKnown.of(model, study_of(settings, *bare, start, remarks), yesterday) is None
    assert remarks == []
    holed = spans[1].assign(T_heat_set_kitchen=np.nan)
    assert SetpointsKnown.of(model, study_of(settings, spans[0], holed, start, remarks), yesterday) is None
    (text,) = remarks
    assert text.startswith(
        "forecasts with only the set-points known were not tested: zone 'kitchen': T_heat_set_kitchen is mis"
    )
    assert unusable_setpoints(spans[1], settings) == ""
    assert unusable_setpoints(holed, settings) == f"zone 'kitchen': T_heat_set is missing at {holed.index[0]}"


@pytest.mark.slow
def test_a_study_of_zones_with_set_points_judges_them_by_that_task(log, tmp_path, monkeypatch):
    settings = settings_of(log[: 21 * DAY], adjacency=[list(pair) for pair in DOORS])
    result = run_study(settings, split_log(log[: 21 * DAY], settings))
    held = result.setpoints_known
    assert all(one.reasons[0] == KNOWN for found in result.zone_verdicts.values() for one in found)
    assert {one.quantity for one in result.zone_verdicts["bedroom"]} == {"temperature", "load"}
    day = result.data.future
    plain = result.model.forecast(result.data.history, day.drop(columns=[*T_OF, *Q_OF]), quantiles=LEVELS)
    for name in plain:
        np.testing.assert_allclose(result.forecast[name], plain[name])
    assert "setpoint_living" not in result.forecast
    np.testing.assert_array_equal(result.forecast["T_heat_set_living"], day["T_heat_set_living"])
    pictures = []
    monkeypatch.setattr(outputs, "save_png", lambda figure, path: pictures.append((figure, path.touch())))
    write_outputs(result, tmp_path / "out")
    assert [ax.get_title(loc="right") for ax in pictures[0][0].axes[:3]] == ["back-test", "the next day", ""]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert (
        page.index(escape(held.words)) < page.index("Accuracy in daily use") < page.index("Accuracy with the heat kn")
    )
    assert "by the learned thermostats" in page
    tests = pd.read_csv(tmp_path / "out" / "backtest.csv")
    np.testing.assert_allclose(tests[f"{HYBRID}, set-points known"], held.frame["y_pred"], atol=1e-3)
    assert held.words in format_result(result)
    found = backtest_zone(settings, split_log(log[: 21 * DAY], settings))
    table = found.setpoints_known.table
    assert table.loc[HYBRID, "rmse_kitchen"] == pytest.approx(held.zones["kitchen"].table.loc[HYBRID, "rmse"])
    assert all(one.reasons[0] == KNOWN for one in found.verdicts)


@pytest.mark.slow
def test_zones_that_share_a_boiler_go_on_with_the_heat_known_and_say_so(log):
    heat = log[Q_OF].sum(axis=1)
    rows = log[: 21 * DAY].drop(columns=Q_OF).assign(u_heat=heat / heat.max())
    settings = settings_of(rows, adjacency=[])
    result = run_study(settings, split_log(rows, settings))
    assert result.setpoints_known is None
    what = "loads and forecasts with only the set-points known are left out"
    assert f"{what}: the zones share the plant of the column u_heat" in result.warnings
    assert {one.quantity for found in result.zone_verdicts.values() for one in found} == {"temperature"}


@pytest.mark.slow
def test_a_day_to_come_without_heat_is_forecast_under_the_set_points_of_all_zones(log):
    rows = log[: 21 * DAY].copy()
    day = rows.index[20 * DAY :]
    rows.loc[day, [*T_OF, *Q_OF]] = np.nan
    settings = settings_of(rows, adjacency=[list(pair) for pair in DOORS])
    result = run_study(settings, split_log(rows, settings))
    assert not result.data.held_out
    assert result.data.unplanned == Q_OF
    expected = result.model.forecast(result.data.history, rows.loc[day].drop(columns=[*T_OF, *Q_OF]))
    for name in (*T_OF, *Q_OF):
        np.testing.assert_allclose(result.forecast[name], expected[name])
    rows.loc[day[5], "T_heat_set_kitchen"] = np.nan
    why_not = r"Q_hvac_living is empty in the next day, .* zone 'kitchen': T_heat_set is missing"
    with pytest.raises(ValueError, match=why_not):
        run_study(settings, split_log(rows, settings))
