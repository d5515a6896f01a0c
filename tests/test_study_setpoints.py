"""Studies of logs with set-points: scored as users forecast, with the weather and the set-points known alone."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from skhybrid.cli import main
from skhybrid.datasets import make_office
from skhybrid.study import Settings, results, run, run_study, split_log
from skhybrid.study.compared_models import HYBRID, YESTERDAY, identified_by, make_models
from skhybrid.study.day_energy import day_energy
from skhybrid.study.load_rules import LAST_WEEK, USUAL, past_loads
from skhybrid.study.load_rules import YESTERDAY as YESTERDAYS_LOAD
from skhybrid.study.outputs import format_result, write_outputs, write_report
from skhybrid.study.report.figures import held_figure
from skhybrid.zone import zone_backtest
from skhybrid.zone.zone_backtest import ZoneBacktest, backtest_zone

pytestmark = pytest.mark.usefixtures("quick_fits")
KNOWN = "the weather and the set-points were known ahead, the heat was not"
TRAIN, TEST = {"end": "2023-10-22"}, {"start": "2023-10-23", "end": "2023-10-29"}


@pytest.fixture(scope="module")
def log():
    office = make_office(29, "chicago", start="2023-10-02", random_state=3, sampling_time="1h", excitation=None)
    return office.X.join(office.setpoints)


def settings_of(log, **given):
    estimator = {"name": "input", "known": {"Q_h": 6.0, "Q_c": -6.0}, "n_starts": 1}
    columns = {role: role for role in log}
    return Settings(columns=columns, step="1h", train=TRAIN, test=TEST, estimator=estimator, **given)


@pytest.fixture(scope="module")
def result(log):
    settings = settings_of(log)
    return run_study(settings, split_log(log, settings))


@pytest.fixture
def few_models(monkeypatch):
    """Studies compare the hybrid with yesterday alone, and identify."""

    def few(settings, memory=None):
        kept = {HYBRID, YESTERDAY, identified_by(settings)}
        return [one for one in make_models(settings, memory) if one.label in kept]

    monkeypatch.setattr(run, "make_models", few)


@pytest.mark.parametrize("holidays", [None, ["2024-03-08", "2024-04-01"]])
def test_rules_for_the_load_are_those_of_a_plain_loop(holidays):
    """A holiday is of the kind of a weekend's days."""
    index = pd.date_range("2024-03-01", periods=24 * 40, freq="1h", tz="Europe/Berlin")
    heat = pd.Series(np.random.default_rng(0).normal(size=len(index)), index)
    heat.iloc[24 * 8 + 3] = np.nan
    origins = index[[24 * 9, 24 * 20 + 5, 24 * 31]]
    lead = pd.to_timedelta(np.tile(np.arange(1, 49), len(origins)), unit="h")
    origin = origins.repeat(48)
    frame = pd.DataFrame({"origin": origin, "lead": lead, "time": origin + lead})
    found = past_loads(heat, frame, holidays)
    hour, day = pd.Timedelta("1h"), pd.Timedelta("1D")
    for row in frame.itertuples():
        begin = row.time - hour
        days = 1 if row.lead <= day else 2
        for name, back in ((YESTERDAYS_LOAD, days * day), (LAST_WEEK, 7 * day)):
            np.testing.assert_equal(found[name][row.Index], heat[begin - back])
        past = heat[: row.origin - hour]
        free = [stamp.day_of_week >= 5 or f"{stamp:%Y-%m-%d}" in (holidays or ()) for stamp in (begin, *past.index)]
        alike = past[(past.index.hour == begin.hour) & (np.array(free[1:]) == free[0])]
        assert found[USUAL][row.Index] == pytest.approx(alike.mean())


def test_a_study_scores_the_task_without_heat_and_judges_by_it(result, log):
    held = result.setpoints_known
    assert set(held.table.index) == {HYBRID, YESTERDAY, YESTERDAYS_LOAD, LAST_WEEK, USUAL}
    assert held.unit == "kW"
    frame = held.frame
    measured = 6.0 * (log["u_heat"] - log["u_cool"])[frame["time"] - pd.Timedelta("1h")].to_numpy()
    np.testing.assert_allclose(held.load, measured)
    own = 6.0 * (frame["u_heat_pred"] - frame["u_cool_pred"])
    assert held.table.loc[HYBRID, "load_rmse"] == pytest.approx(np.sqrt(((own - measured) ** 2).mean()))
    error = frame["y_pred"] - frame["y_true"]
    assert held.table.loc[HYBRID, "rmse"] == pytest.approx(np.sqrt((error**2).mean()))
    assert held.table.loc[HYBRID, "load_rmse"] < held.table.drop(index=HYBRID)["load_rmse"].min()
    assert [one.reasons[0] for one in result.verdicts] == [KNOWN, KNOWN]
    ratio = held.table["rmse"][HYBRID] / held.table["rmse"][YESTERDAY]
    assert f"{ratio:.2f} times that of yesterday's temperature" in result.verdicts[0].reasons[1]


@pytest.mark.usefixtures("few_models", "empty_pictures")
def test_a_study_under_weather_forecasts_says_so_and_has_wider_intervals(result, log, tmp_path):
    settings = settings_of(log, weather_error="high")
    off = run_study(settings, split_log(log, settings))
    assert off.verdicts[0].reasons[0] == KNOWN.replace("the weather", "a forecast of the weather (high errors)")
    assert "With a forecast of the weather (high errors) and the set-points known" in off.setpoints_known.words
    for forecast, exact in ((off.setpoints_known.frame, result.setpoints_known.frame), (off.forecast, result.forecast)):
        assert (forecast["q_0.9"] - forecast["q_0.1"]).mean() > 1.02 * (exact["q_0.9"] - exact["q_0.1"]).mean()
    pd.testing.assert_series_equal(off.forecast["T_za"], result.forecast["T_za"])  # of a day whose weather was measured
    write_outputs(off, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "was given a forecast of the weather (high errors) and the set-points" in page


def test_the_next_day_is_forecast_under_its_set_points(result, log):
    forecast = result.forecast
    assert {"T_heat_set", "T_cool_set", "Q_hvac", "T_za_measured", "Q_hvac_delivered"} <= set(forecast)
    assert "setpoint" not in forecast
    ahead = log.loc[forecast.index].drop(columns=["u_heat", "u_cool", "T_za"])
    expected = result.model.forecast(result.data.history, ahead)
    np.testing.assert_allclose(forecast["T_za"], expected["T_za"])


def test_the_report_has_intervals_of_the_energy_and_the_cost_of_the_next_day(log, few_models, monkeypatch, tmp_path):
    heated = log.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=6.0 * log["u_heat"] - 6.0 * log["u_cool"])
    settings = settings_of(heated, tariff={"price": 0.3})
    found, computed = run_study(settings, split_log(heated, settings)), []
    once = results.energy_cost
    monkeypatch.setattr(results, "energy_cost", lambda *given: computed.append(once(*given)) or computed[-1])
    (energy, *_), paths = day_energy(found.forecast["Q_hvac"]), found.load_paths["Q_hvac"]
    low, high = paths.clip(lower=0.0).groupby("sample").sum().quantile([0.1, 0.9])
    assert (energy.kind, low < energy.value < high) == ("heating", True)
    write_outputs(found, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f"<b>{energy.value:.0f}\u00a0kWh</b>" in page
    assert f"heating needed that day; 80 % interval {low:.0f} to {high:.0f} kWh" in page
    cost = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))["next_day_cost"]
    assert len(computed) == 1
    assert cost["interval"] == pytest.approx(0.3 * paths.abs().groupby("sample").sum().quantile([0.1, 0.9]))


def test_paths_of_loads_without_a_scale_are_not_drawn(log, few_models, monkeypatch):
    """No page shows the energy of stages of zones without a capacity."""
    own, calls = [name for name in log if name not in ("T_oa", "q_sol")], []
    rooms = [(log[own] + [0.5 * k * name.startswith("T_") for name in own]).add_suffix(f"_{k}") for k in range(2)]
    house = pd.concat([log[["T_oa", "q_sol"]], *rooms], axis=1)
    settings = dataclasses.replace(settings_of(house), estimator=with_stages({}))
    monkeypatch.setattr(run, "paths_of_next_day", lambda *given: calls.append(given))
    found = run_study(settings, split_log(house, settings))
    assert (found.scaled, found.load_paths, calls) == (False, None, [])


def test_the_outputs_tell_both_tasks(result, tmp_path):
    text = format_result(result)
    assert (
        text.index("known: weather, set-points")
        < text.index(result.setpoints_known.words)
        < text.index("known: weather, heat")
    )
    write_outputs(result, tmp_path / "out")
    tests = pd.read_csv(tmp_path / "out" / "backtest.csv")
    np.testing.assert_allclose(tests[f"{HYBRID}, set-points known"], result.setpoints_known.frame["y_pred"], atol=1e-3)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index("Accuracy in daily use") < page.index("Accuracy with the heat known")
    assert '"setpoints_known": {' in (tmp_path / "out" / "metrics.json").read_text(encoding="utf-8")


def test_the_back_test_command_scores_it_too(log, result):
    settings = settings_of(log)
    found = backtest_zone(settings, split_log(log, settings))
    pd.testing.assert_frame_equal(found.setpoints_known.table, result.setpoints_known.table)
    assert [one.reasons[0] for one in found.verdicts] == [KNOWN, KNOWN]


@pytest.mark.usefixtures("few_models")
def test_without_set_points_nothing_changes_and_without_a_thermostat_a_remark_says_so(log):
    plain = log.drop(columns=["T_heat_set", "T_cool_set"])
    settings = settings_of(plain)
    found = run_study(settings, split_log(plain, settings))
    assert found.setpoints_known is None
    assert KNOWN not in found.verdicts[0].reasons
    assert "known: weather" not in format_result(found)
    few = settings_of(log)
    few = Settings(**{**few.as_dict(), "train": {"start": "2023-10-18", "end": "2023-10-22"}})
    found = run_study(few, split_log(log, few))
    assert found.setpoints_known is None
    assert any("with only the set-points known were not tested: no thermostat was learned" in w for w in found.warnings)


def test_stages_without_a_capacity_are_scored_as_stages(log):
    settings = settings_of(log)
    settings = Settings(**{**settings.as_dict(), "estimator": {"name": "input", "n_starts": 1}})
    held = backtest_zone(settings, split_log(log, settings)).setpoints_known
    assert held.unit == "-"
    assert held.load.abs().max() <= 1.0
    assert "kW" not in held.words


def with_stages(known):
    return {"name": "input", "n_starts": 1, "known": known}


@pytest.mark.usefixtures("empty_pictures")
def test_a_card_shows_no_kw_where_the_load_is_stages(log, result, tmp_path):
    settings = Settings(**{**settings_of(log).as_dict(), "estimator": with_stages({"Q_h": 6.0})})
    held = backtest_zone(settings, split_log(log, settings)).setpoints_known
    assert held.unit == "-"
    assert "its stage by" in held.words
    write_report(tmp_path / "page.html", dataclasses.replace(result, setpoints_known=held))
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "stage RMSE [-]" in page
    assert "error of the heating or cooling load (RMSE)" not in page


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        ("2023-10-25 08:00", np.nan, "T_heat_set is missing in 1 row"),
        ("2023-10-25 08:00", 30.0, "T_heat_set is above T_cool_set"),
    ],
)
def test_the_back_test_command_says_why_set_points_were_not_tested(log, at, value, message):
    other = log.copy()
    other.loc[at, "T_heat_set"] = value
    settings = settings_of(other)
    found = backtest_zone(settings, split_log(other, settings))
    assert found.setpoints_known is None
    assert any("only the set-points known were not tested" in one and message in one for one in found.remarks)


def test_the_back_test_command_writes_remarks_as_warnings(log, tmp_path, monkeypatch, capsys):
    log.to_csv(tmp_path / "log.csv", index_label="time")
    columns = "".join(f'{role} = "{role}"\n' for role in log)
    spans = '[train]\nend = "2023-10-22"\n[test]\nstart = "2023-10-23"\n'
    (tmp_path / "zone.toml").write_text(f'step = "1h"\n[columns]\n{columns}{spans}', encoding="utf-8")
    found = ZoneBacktest(
        pd.DataFrame({"rmse": [0.3]}, [HYBRID]), pd.DataFrame(), None, (), "kW", None, ("no set-points",)
    )
    monkeypatch.setattr(zone_backtest, "backtest_zone", lambda *given: found)
    command = ["backtest", str(tmp_path / "log.csv"), "--config", str(tmp_path / "zone.toml")]
    assert main(command) == 0
    assert "warning: no set-points" in capsys.readouterr().err
    assert main([*command, "--strict"]) == 1


@pytest.mark.usefixtures("few_models")
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.nan, "T_heat_set is missing at 2023-10-30 08:00:00"),
        (30.0, "T_heat_set is above T_cool_set at 2023-10-30 08:00:00"),
    ],
)
def test_a_next_day_without_set_points_is_under_its_heat_and_a_remark_says_so(log, value, message):
    other = log.copy()
    other.loc["2023-10-30 08:00", "T_heat_set"] = value
    settings = settings_of(other)
    found = run_study(settings, split_log(other, settings))
    assert found.setpoints_known is not None
    assert "setpoint" in found.forecast
    assert f"the next day is forecast under its known heat: {message}" in found.warnings


def test_a_rule_that_knows_no_load_leaves_the_others_scored(log):
    other = log.copy()
    other.loc["2023-10-21 05:00":"2023-10-22 23:00", "T_oa"] = np.nan
    given = {"train": {"end": "2023-10-15"}, "test": {"start": "2023-10-23", "end": "2023-10-28"}}
    settings = Settings(**{**settings_of(other).as_dict(), **given})
    held = backtest_zone(settings, split_log(other, settings)).setpoints_known
    assert held.loads[LAST_WEEK].isna().all()
    assert held.table["load_rmse"].drop([LAST_WEEK, YESTERDAY]).notna().all()
    assert USUAL in held.words


def test_the_interval_of_a_whole_load_is_not_drawn_around_a_part_of_it(result):
    held = result.setpoints_known
    for frame, n_bands in ((held.frame, 1), (held.frame.assign(Q_total_pred=0.0), 0)):
        figure = held_figure(frame, held.load, held.loads[HYBRID], "kW")
        assert len(figure.axes[1].collections) == n_bands


def test_rows_ahead_without_set_points_are_the_next_day(log):
    ahead = log.copy()
    ahead.loc["2023-10-30":, ["T_za", "T_heat_set", "T_cool_set"]] = np.nan
    data = split_log(ahead, settings_of(ahead))
    assert not data.held_out
    assert data.future.index[0] == pd.Timestamp("2023-10-30")
    assert data.future["u_heat"].notna().all()


@pytest.mark.usefixtures("few_models")
def test_rows_ahead_without_heat_are_the_next_day_under_its_set_points(log):
    """The whole study was refused: the heat of a day to come is what a user does not know."""
    ahead = log.copy()
    ahead.loc["2023-10-30":, ["T_za", "u_heat", "u_cool"]] = np.nan
    settings = settings_of(ahead)
    found = run_study(settings, split_log(ahead, settings))
    assert not found.data.held_out
    assert found.forecast.index[0] == pd.Timestamp("2023-10-30")
    assert {"T_heat_set", "T_cool_set", "Q_hvac"} <= set(found.forecast)
    assert "T_za_measured" not in found.forecast
    expected = found.model.forecast(found.data.history, found.data.future.drop(columns=["u_heat", "u_cool", "T_za"]))
    np.testing.assert_allclose(found.forecast["T_za"], expected["T_za"])


def test_a_log_ends_with_its_set_points_where_the_room_was_measured_after_them(log):
    other = log.copy()
    other.loc["2023-10-30 12:00":, "T_heat_set"] = np.nan
    data = split_log(other, settings_of(other))
    assert data.held_out
    assert data.future.index[-1] < pd.Timestamp("2023-10-30")
