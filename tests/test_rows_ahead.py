"""Weather, plans and outages at the end of a log: what a forecast reads of them, and what its user is told."""

from __future__ import annotations

import re
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.fleet import model_rows
from skhybrid.study.settings import settings_from
from skhybrid.study.thermostat import Schedule
from skhybrid.study.unread_rows import Unread
from skhybrid.study.zone_part import log_columns
from skhybrid.zone import ZoneModel, day_ahead
from skhybrid.zone.complete_rows import complete_rows
from skhybrid.zone.day_ahead import _unused
from skhybrid.zone.dead_meters import without_further_temperatures
from skhybrid.zone.other_units import refuse_other_units
from skhybrid.zone.training_rows import training_rows
from skhybrid.zone.wanted_setpoints import idle_setpoints

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning"),
    pytest.mark.usefixtures("quick_fits"),
]
DAY, N = 24, 15 * 24  # rows of a day, and of the log
SETTINGS = {
    "step": "1h",
    "columns": {
        "T_za": "room", "T_oa": "AI01", "q_sol": "AI02", "Q_hvac": "heat", "T_heat_set": "low", "T_cool_set": "high",
    },
    "units": {"T_oa": "degF"},
}  # fmt: skip
SCHEDULE = Schedule.of_text("20,26")


@pytest.fixture(scope="module")
def frame():
    """A cold office by the hour, by role."""
    office = make_office(20, "chicago", start="2023-01-09", random_state=3, sampling_time="1h", excitation=None)
    X = office.X.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=6.0 * office.X["u_heat"] - 6.0 * office.X["u_cool"])
    return X.join(office.setpoints)


@pytest.fixture(scope="module")
def zone(frame):
    return ZoneModel.fit(settings_from(SETTINGS), frame[:N])


def tomorrow(frame, path, names=None, *, degF=False, shift=0):
    """Weather of the day after the log as a CSV."""
    rows = frame[["T_oa", "q_sol"]][N - 1 : N + DAY + 2].rename_axis("time")
    rows = rows.assign(T_oa=32.0 + 1.8 * rows["T_oa"] if degF else rows["T_oa"])
    rows = rows.set_axis(rows.index + pd.Timedelta(hours=shift)).rename(columns=names or {})
    rows.to_csv(path)
    return path


def assert_same(found, expected):
    np.testing.assert_allclose(found.frame.to_numpy(float), expected.frame.to_numpy(float), atol=1e-6)


def test_weather_with_the_columns_of_the_log_has_their_units_and_label(frame, zone, tmp_path):
    """14 to 24 degF look like a mild day in degC."""
    plain = day_ahead(zone, frame[:N], tomorrow(frame, tmp_path / "plain.csv"), SCHEDULE)
    named = {"T_oa": "AI01", "q_sol": "AI02"}
    assert_same(day_ahead(zone, frame[:N], tomorrow(frame, tmp_path / "f.csv", named, degF=True), SCHEDULE), plain)
    ending = ZoneModel(zone.predictor, settings_from({**SETTINGS, "label": "right"}))
    path = tomorrow(frame, tmp_path / "right.csv", named, degF=True)
    late = day_ahead(ending, frame[:N], path, SCHEDULE)
    assert not np.allclose(late.frame["q_sol"], plain.frame["q_sol"])
    np.testing.assert_allclose(late.frame["T_oa"], plain.frame["T_oa"])


def test_intervals_allow_for_errors_of_the_weather_by_the_configuration(frame, zone, tmp_path):
    path = tomorrow(frame, tmp_path / "weather.csv")
    plain = day_ahead(zone, frame[:N], path, SCHEDULE).frame
    careful = ZoneModel(zone.predictor, settings_from({**SETTINGS, "weather_error": "high"}))
    wider = day_ahead(careful, frame[:N], path, SCHEDULE).frame
    np.testing.assert_allclose(wider[["T_za", "Q_hvac"]], plain[["T_za", "Q_hvac"]])
    for quantity in ("q", "Q_hvac"):
        widths = [(f[f"{quantity}_0.9"] - f[f"{quantity}_0.1"]).mean() for f in (plain, wider)]
        assert widths[1] > 1.02 * widths[0]
    with pytest.raises(ValueError, match="weather_error='much' is not one of 'low', 'medium', 'high'"):
        settings_from({**SETTINGS, "weather_error": "much"})


@pytest.mark.parametrize("name", ["temp", "Temperature (°F)", "t_air", "outdoor", "Außen"])
def test_a_temperature_in_a_weather_file_is_that_of_outdoors(name, frame, zone, tmp_path):
    """In a log a name such as "temp" says nothing of where; degF are found too."""
    plain = day_ahead(zone, frame[:N], tomorrow(frame, tmp_path / "plain.csv"), SCHEDULE)
    path = tomorrow(frame, tmp_path / "named.csv", {"T_oa": name, "q_sol": "ghi"}, degF="F" in name)
    rows = pd.read_csv(path).assign(humidity=40.0, feels_like_temp=3.0 if name == "temp" else None)
    rows.dropna(axis=1, how="all").to_csv(path, index=False)
    assert_same(day_ahead(zone, frame[:N], path, SCHEDULE), plain)
    either, humidity = rows.rename(columns={name: "temp_max"}), rows.rename(columns={name: "outdoor (%)"})
    for unclear in (
        either.assign(temp_min=1.0),
        either.assign(outdoor=1.0, outside=1.0)[["time", "outdoor", "outside", "ghi"]],
        humidity,
    ):
        unclear.to_csv(path, index=False)
        with pytest.raises(ValueError, match="T_oa is not known for the rows ahead"):
            day_ahead(zone, frame[:N], path, SCHEDULE)


def test_weather_that_jumps_from_that_of_the_log_is_told(frame, zone, tmp_path):
    rows = frame[["T_oa", "q_sol"]][N - 1 : N + DAY + 2].rename_axis("time")
    path = tmp_path / "w.csv"
    rows.assign(T_oa=rows["T_oa"] + 25.0).to_csv(path)
    assert any("T_oa jumps by 2" in text for text in day_ahead(zone, frame[:N], path, SCHEDULE).remarks)
    rows.to_csv(path)
    assert not any("jumps" in text for text in day_ahead(zone, frame[:N], path, SCHEDULE).remarks)


@pytest.mark.parametrize("names", [("temp", "ghi"), ("Temperatur", "Globalstrahlung")])
def test_the_only_temperature_of_a_weather_file_is_that_of_outdoors(frame, zone, tmp_path, names):
    plain = day_ahead(zone, frame[:N], tomorrow(frame, tmp_path / "plain.csv"), SCHEDULE)
    path = tomorrow(frame, tmp_path / "w.csv", dict(zip(("T_oa", "q_sol"), names, strict=True)))
    assert_same(day_ahead(zone, frame[:N], path, SCHEDULE), plain)


@pytest.mark.parametrize(("hours", "told"), [(0, False), (1, False), (2, True), (-6, True)])
def test_weather_with_another_clock_is_told_by_its_sun(frame, zone, tmp_path, hours, told):
    rows = frame[["T_oa", "q_sol"]][N - 1 - DAY : N + 2 * DAY].rename_axis("time")
    path = tmp_path / "w.csv"
    rows.set_axis(rows.index + pd.Timedelta(hours=hours)).to_csv(path)
    remarks = day_ahead(zone, frame[:N], path, SCHEDULE).remarks
    assert (
        any("of the sun ahead shines at hours of the day at which the log has none" in text for text in remarks) == told
    )


@pytest.mark.parametrize("place", ["weather", "log"])
def test_sun_in_another_unit_is_told(frame, zone, tmp_path, place):
    dim = frame.assign(q_sol=frame["q_sol"] / 1000.0)
    log = frame[:N] if place == "weather" else pd.concat([frame[: N - DAY], dim[N - DAY : N]])
    path = tomorrow(dim if place == "weather" else frame, tmp_path / "w.csv")
    what = "ahead" if place == "weather" else "of the last day of the log"
    remarks = day_ahead(zone, log, path, SCHEDULE).remarks
    assert [text for text in remarks if text.startswith("the sun")] == [
        text for text in remarks if f"sun {what}" in text
    ]
    assert any("check the unit of its column" in text for text in remarks)
    plain = day_ahead(zone, frame[:N], tomorrow(frame, tmp_path / "w.csv"), SCHEDULE)
    assert not any(text.startswith("the sun") for text in plain.remarks)


def test_new_rows_in_watts_are_refused_and_a_spike_is_not(frame, zone):
    heat = frame["Q_hvac"].where(np.arange(len(frame)) < N, 1000.0 * frame["Q_hvac"])
    model = deepcopy(zone)
    with pytest.raises(ValueError, match=r"'heat' reaches \d+ kW from .*: likely W rather than kW; correct the rows"):
        model.update(frame.assign(Q_hvac=heat)[: N + DAY])
    assert model.known_until == zone.known_until
    spike = frame["Q_hvac"].where(np.arange(len(frame)) != N + 9, 3000.0)
    assert model.update(frame.assign(Q_hvac=spike)[: N + DAY]) == DAY


def test_new_sun_in_watts_is_refused(frame, zone):
    """A model that took it in would keep it after the log is mended."""
    model = deepcopy(zone)
    with pytest.raises(ValueError, match=r"'AI02' reaches \d\S* kW/m2 from .*: likely W/m2 rather than kW/m2; correct"):
        model.update(frame.assign(q_sol=1000.0 * frame["q_sol"])[: N + DAY])
    assert model.known_until == zone.known_until
    assert model.update(frame.assign(q_sol=8.0 * frame["q_sol"].clip(upper=0.12))[: N + DAY]) == DAY  # a bright month


def test_a_last_temperature_that_leaps_is_refused_and_an_earlier_one_is_not(frame, zone):
    """A file that is read while it is written may end within a number: 2 for 21.3 would be the origin of a forecast."""
    model, day = deepcopy(zone), frame[N : N + DAY]
    cut = day["T_za"].where(np.arange(DAY) < DAY - 1, 2.0)
    for rows in (day.assign(T_za=cut), frame.assign(T_za=cut.combine_first(frame["T_za"]))[: N + DAY]):
        with pytest.raises(ValueError, match=f"'room' leaps from 17.97 to 2 degC in the last row, {day.index[-1]}"):
            model.update(rows)
        with pytest.raises(ValueError, match="'room' leaps"):
            day_ahead(zone, rows, schedule=SCHEDULE)
    assert model.known_until == zone.known_until
    assert model.update(frame.assign(T_za=cut.combine_first(frame["T_za"]))[: N + DAY + 1]) == DAY + 1
    after = deepcopy(zone)  # an outage, after which a room may be cold
    assert after.update(day.assign(T_za=cut.where(np.arange(DAY) != DAY - 2))) == DAY


def test_new_rows_in_fahrenheit_or_on_another_clock_are_refused(frame, zone):
    """Rows of one day alone show no other unit than the model knows, those that overlap it no other clock."""
    model, day = deepcopy(zone), frame[N : N + DAY]
    for role in ("T_za", "T_oa"):
        with pytest.raises(ValueError, match=r"reaches \d\d\S* degC from .* likely degF rather than degC; correct"):
            model.update(day.assign(**{role: 1.8 * day[role] + 32.0}))
    for hours, words in ((-2, "2 h later"), (5, "5 h earlier")):
        with pytest.raises(ValueError, match=f"T_za of the log is that which the model has {words}: has the clock"):
            model.update(frame[: N + DAY].shift(freq=f"{hours}h"))
    with pytest.raises(ValueError, match="K from what the model has of the same rows"):
        model.update(frame[: N + DAY].assign(T_za=1.8 * frame["T_za"] + 32.0))
    assert model.known_until == zone.known_until
    drifted = frame["T_za"].where(np.arange(len(frame)) >= N, frame["T_za"] + 0.3)  # a sensor that was corrected
    assert model.update(frame.assign(T_za=drifted)[: N + DAY]) == DAY


def test_a_model_learns_from_rows_that_it_has_taken_in(frame, zone):
    model = deepcopy(zone)
    assert model.update(frame[: N + DAY]) == DAY
    assert model.learned_until == zone.known_until
    assert model.update(frame[: N + DAY], relearn=True) == 0
    assert model.learned_until == frame.index[N + DAY - 1]
    with pytest.raises(ValueError, match="no row of the log has all inputs"):
        model.update(frame[: N + DAY].assign(T_oa=np.nan), relearn=True)


def test_a_meter_without_values_is_named_by_its_column(frame):
    columns = {"T_za": "room", "T_oa": "outdoors", "Q_heat": "Heat Meter", "Q_cool": "Cold Meter"}
    rows = frame[["T_oa", "q_sol", "Q_hvac"]][:DAY].copy()
    rows.iloc[-3:, 1:] = np.nan
    settings = settings_from({**SETTINGS, "columns": columns, "units": {}})
    found = Unread.of(rows, lambda roles: log_columns(roles, settings))
    assert found.inputs == ("Heat Meter", "Cold Meter")


def test_a_log_without_its_room_is_refused(frame):
    with pytest.raises(ValueError, match="the log has no room temperature, T_za"):
        complete_rows(frame.drop(columns="T_za"))


@pytest.mark.parametrize("zone", ["", "_hall"])
def test_set_points_are_held_where_rows_lack_them(frame, zone):
    rows = frame[:DAY].rename(columns={role: role + zone for role in ("T_za", "T_heat_set", "T_cool_set")})
    held = rows[f"T_heat_set{zone}"].iloc[[0]].reindex(rows.index)
    found = complete_rows(rows.assign(**{f"T_heat_set{zone}": held}), [f"T_za{zone}"])
    assert found[f"T_heat_set{zone}"].tolist() == [held.iloc[0]] * DAY


def test_heat_that_a_model_was_learned_without_may_have_any_unit(frame):
    watts = frame[:DAY].assign(Q_hvac=5000.0)
    refuse_other_units(watts, frame[:DAY], {}, settings_from(SETTINGS))
    with pytest.raises(ValueError, match="likely W rather than kW"):
        refuse_other_units(watts, frame[:DAY], {"Q_hvac": (-6.0, 6.0)}, settings_from(SETTINGS))


@pytest.mark.parametrize(("last", "refused"), [(5, False), (9, True)])
def test_set_points_ahead_are_held_over_a_short_gap(frame, zone, tmp_path, last, refused):
    """As on the day on which the clocks of a log without a time zone go forward."""
    rows = frame[["T_oa", "q_sol"]][N - 1 : N + DAY + 2].rename_axis("time")
    low = pd.Series(18.0, rows.index).mask(np.arange(len(rows)) > 12, 21.0)
    low = low.mask((np.arange(len(rows)) > 3) & (np.arange(len(rows)) <= last))
    rows.assign(low=low, high=26.0).to_csv(tmp_path / "w.csv")
    if refused:
        with pytest.raises(ValueError, match=r"T_heat_set \(set-point\) is missing in \d of the rows ahead"):
            day_ahead(zone, frame[:N], tmp_path / "w.csv")
    else:
        found = day_ahead(zone, frame[:N], tmp_path / "w.csv").frame
        assert found["T_heat_set"].tolist() == [18.0] * 12 + [21.0] * 12


def test_limits_of_the_plant_reach_the_room(frame, zone, tmp_path):
    path = tomorrow(frame, tmp_path / "w.csv")
    free = day_ahead(zone, frame[:N], path, SCHEDULE).frame
    most = 0.5 * free["Q_hvac"].max()
    weak = ZoneModel(zone.predictor, settings_from({**SETTINGS, "plant": {"most_heat": float(most)}}))
    held = day_ahead(weak, frame[:N], path, SCHEDULE).frame
    assert held["Q_hvac"].max() <= most + 1e-9
    assert held["Q_hvac_0.9"].max() <= most + 1e-9
    assert (held["T_za"] - free["T_za"]).min() < -0.3
    assert (held["T_za"] <= free["T_za"] + 0.05).all()
    strong = ZoneModel(zone.predictor, settings_from({**SETTINGS, "plant": {"most_heat": 100.0}}))
    pd.testing.assert_frame_equal(day_ahead(strong, frame[:N], path, SCHEDULE).frame, free)


def test_measured_heat_in_a_row_without_weather_is_no_plan(frame, zone, tmp_path):
    path = tomorrow(frame, tmp_path / "w.csv")
    log = frame[:N].copy()
    log.iloc[-1, log.columns.get_loc("T_oa")] = np.nan
    held = ZoneModel(zone.predictor, settings_from({**SETTINGS, "thermostat": {"heat": 20.0, "cool": 26.0}}))
    found = day_ahead(held, log, path)
    assert len(found.frame) == DAY
    assert "Q_hvac" in found.frame
    with pytest.raises(ValueError, match="T_oa is not known for the rows ahead"):
        day_ahead(held, log)


def test_weather_from_midnight_follows_a_log_whose_last_heat_is_not_known(frame, zone, tmp_path):
    """A meter that counts tells the heat of a row with the next reading; the log has the weather of this row."""
    log = frame[:N].assign(Q_hvac=frame["Q_hvac"].where(frame.index < frame.index[N - 1]))
    whole = day_ahead(zone, log, tomorrow(frame, tmp_path / "whole.csv"), SCHEDULE)
    frame.loc[frame.index[N] :, ["T_oa", "q_sol"]].rename_axis("time").to_csv(tmp_path / "tomorrow.csv")
    found = day_ahead(zone, log, tmp_path / "tomorrow.csv", SCHEDULE)
    assert found.frame.index[0] == frame.index[N - 1]
    assert_same(found, whole)


def test_a_log_that_ends_before_what_the_model_has_seen_is_told(frame, zone, tmp_path):
    weather = tmp_path / "w.csv"
    frame[["T_oa", "q_sol"]].rename_axis("time").to_csv(weather)
    early = day_ahead(zone, frame[: N - 2 * DAY], weather, SCHEDULE)
    text = f"the last complete row of the log is {early.frame.index[0] - pd.Timedelta('1h')}, and the model"
    assert any(remark.startswith(text) for remark in early.remarks)


def test_one_of_two_set_points_is_refused(frame, zone, tmp_path):
    path = tomorrow(frame, tmp_path / "w.csv")
    with pytest.raises(ValueError, match=r"T_cool_set is not given for the rows ahead, .* such as --setpoint 21,24"):
        day_ahead(zone, frame[:N], path, Schedule.of_text("21"))
    with pytest.raises(ValueError, match="or fill in 'low', 'high' in the rows ahead"):
        day_ahead(zone, frame[:N], path)


@pytest.mark.parametrize(("begin", "told"), [(N + 5, True), (30, False)])  # the log's report tells those of the past
def test_blank_set_points_of_a_plan_are_told(frame, zone, tmp_path, begin, told):
    names = {role: name for role, name in SETTINGS["columns"].items() if role in frame}
    log = frame[: N + DAY].assign(T_oa=32.0 + 1.8 * frame["T_oa"])
    log.loc[log.index[N:], ["T_za", "Q_hvac"]] = np.nan
    log.loc[log.index[begin : begin + 5], "T_heat_set"] = np.nan
    log.rename(columns=names).rename_axis("time").to_csv(tmp_path / "log.csv")
    found = day_ahead(zone, tmp_path / "log.csv")
    text = f"T_heat_set is missing in 5 rows, first {log.index[begin]}: that of the week before or after is taken"
    assert len(found.frame) == DAY
    assert any(remark.startswith(text) for remark in found.remarks) == told


def test_a_log_with_one_set_point_is_forecast_with_it(frame, tmp_path):
    log, path = frame.drop(columns="T_cool_set"), tomorrow(frame, tmp_path / "w.csv")
    columns = {role: name for role, name in SETTINGS["columns"].items() if role != "T_cool_set"}
    heated = ZoneModel.fit(settings_from({**SETTINGS, "columns": columns}), log[:N])
    assert heated.thermostat_learned
    given = day_ahead(heated, log[:N], path, Schedule.of_text("6:00=21,22:00=17")).frame
    assert given["Q_hvac_0.1"].lt(given["Q_hvac_0.9"]).any()
    rows = given[["T_oa", "q_sol", "T_heat_set"]]
    core = heated.predictor.forecast(heated.readable(log[:N]).history, rows, quantiles=(0.1, 0.9))
    np.testing.assert_allclose(given["Q_hvac"], core["Q_hvac"])
    by_clock = {**SETTINGS, "columns": columns, "thermostat": {"heat": {"6:00": 21.0, "22:00": 17.0}}}
    planned = day_ahead(ZoneModel(heated.predictor, settings_from(by_clock)), log[:N], path).frame
    pd.testing.assert_frame_equal(planned, given)
    both = day_ahead(heated, log[:N], path, SCHEDULE)  # of a house that is only heated
    assert "T_cool_set" not in both.frame
    assert "T_cool_set of --setpoint is left out, since nothing cooled in the training" in both.remarks
    assert not any("left out" in text for text in day_ahead(heated, log[:N], path, Schedule.of_text("20")).remarks)
    with pytest.raises(ValueError, match=r"T_heat_set is not given for the rows ahead, .* such as --setpoint 21\."):
        day_ahead(heated, log[:N], path, Schedule.of_text(",24"))


def test_set_points_of_several_zones_are_left_out_in_one_sentence(frame):
    idle = {"T_cool_set_hall": "cooled", "T_heat_set_loft": "heated", "T_cool_set_loft": "cooled"}
    assert list(_unused(frame[:0], settings_from(SETTINGS), SCHEDULE, idle)) == [
        "T_cool_set_hall, T_cool_set_loft of --setpoint are left out, since nothing cooled in the training",
        "T_heat_set_loft of --setpoint is left out, since nothing heated in the training",
    ]


def test_a_plant_holds_set_points_where_it_acted_or_will_and_those_of_the_log():
    spans = {
        "": {"u_cool": (0.0, 1.0)},
        "hall": {"u_heat": (0.0, 1.0), "T_oa": (-9.0, 9.0)},
        "attic": {"q_sol": (0.0, 1.0)},
    }
    of_log = settings_from({"columns": {"T_za": "room", "T_oa": "out", "T_cool_set": "high"}})
    parts = {zone: SimpleNamespace(covered=span.copy, settings=of_log) for zone, span in spans.items()}
    assert idle_setpoints(pd.DataFrame(), parts) == {"T_heat_set": "heated"}
    for one in parts.values():
        one.settings = replace(of_log, columns={})
    assert idle_setpoints(pd.DataFrame(), parts) == {"T_heat_set": "heated", "T_cool_set_hall": "cooled"}
    assert idle_setpoints(pd.DataFrame({"Q_hvac": [-1.0], "Q_hvac_hall": -0.5}), parts) == {"T_heat_set": "heated"}


@pytest.fixture(scope="module")
def earlier(frame):
    """A model that has not seen the last rows of the log."""
    return ZoneModel.fit(settings_from(SETTINGS), frame[: N - 60])


def test_a_short_outage_is_bridged_and_told(frame, earlier, tmp_path):
    """Nine rows alone say less of the state than these and those before an outage of five hours."""
    path, gap = tomorrow(frame, tmp_path / "w.csv"), slice(N - 14, N - 9)
    logs = frame[:N], frame[:N].drop(frame.index[gap]), frame[N - 9 : N]
    whole, bridged, alone = (day_ahead(earlier, log, path, SCHEDULE) for log in logs)
    assert any(f"no complete rows from {frame.index[gap][0]} to" in text for text in bridged.remarks)
    change, change_alone = ((one.frame["T_za"] - whole.frame["T_za"]).abs().mean() for one in (bridged, alone))
    assert change < 0.9 * change_alone
    long = day_ahead(earlier, frame[:N].drop(frame.index[N - 40 : N - 9]), path, SCHEDULE)
    assert any("starts from the last 9 h, since rows are missing before" in text for text in long.remarks)


@pytest.mark.parametrize("silent", ["Q_hvac", "q_sol"])
def test_heat_is_kept_in_an_outage_of_the_weather_and_not_the_reverse(frame, earlier, silent):
    """As in a fleet; either way a row without all inputs has no temperature."""
    log, inputs, held = frame[:N].copy(), ["T_oa", "q_sol", "Q_hvac"], ["T_heat_set", "T_cool_set"]
    gap, gone = log.index[N - 14 : N - 9], log.index[N - 12]
    wanted = log.copy()
    wanted.loc[gap, [*(inputs if silent == "Q_hvac" else [silent]), "T_za"]] = np.nan
    wanted.loc[gone] = np.nan
    wanted = wanted.assign(**wanted[inputs].interpolate(), **wanted[held].ffill())
    log.loc[gap, silent] = np.nan
    log = log.drop(gone)
    new = earlier.readable(log).following(earlier.known_rows(), earlier.known_until)
    for found in (earlier.readable(log).history, training_rows(log, earlier.settings, 56), new):
        pd.testing.assert_frame_equal(found[log.columns], wanted.loc[found.index], check_freq=False, check_names=False)
    of_fleet = model_rows._bridged(log.drop(columns=held), earlier.predictor)
    pd.testing.assert_frame_equal(of_fleet[[*inputs, "T_za"]], wanted[[*inputs, "T_za"]], check_freq=False)


def test_an_input_that_ends_before_the_temperatures_is_named(frame, zone, tmp_path):
    path, log = tmp_path / "w.csv", frame[:N].copy()
    frame[["T_oa", "q_sol"]][N - DAY :].rename_axis("time").to_csv(path)
    heat = log.columns.get_loc("Q_hvac")
    log.iloc[-3:, heat] = np.nan
    said = f"no values of 'heat' since {log.index[-3]}, .* until {log.index[-1]}: forecasts start from {log.index[-4]}"
    found = day_ahead(zone, log, path, SCHEDULE)
    assert re.search(said, found.remarks[0])
    assert found.frame.index[0] == log.index[-3]
    log.iloc[-13:, heat] = np.nan
    with pytest.raises(ValueError, match=r"no values of 'heat' since .*: forecasts start from .*; see that they are"):
        day_ahead(zone, log)  # there is no weather either
    for rows in (frame[:N], frame[:N].assign(Q_hvac=frame["Q_hvac"][: N - 1])):  # the last step may be under way
        assert not any("no values" in text for text in day_ahead(zone, rows, path, SCHEDULE).remarks)


def test_a_temperature_that_no_model_reads_may_end(frame, zone, tmp_path):
    """A dead sensor in the attic shortened the training and stopped the forecasts of a model that does not read it."""
    attic = frame["T_oa"].where(np.arange(len(frame)) < N - 4 * DAY)
    settings = settings_from({**SETTINGS, "columns": {**SETTINGS["columns"], "T_attic": "attic"}})
    model = ZoneModel.fit(settings, frame[:N].assign(T_attic=attic))
    assert (model.learned_until, model.covered()) == (zone.learned_until, zone.covered())
    path = tomorrow(frame, tmp_path / "weather.csv")
    found = day_ahead(model, frame[:N].assign(T_attic=attic), path, SCHEDULE)
    assert_same(found, day_ahead(zone, frame[:N], path, SCHEDULE))
    assert model.update(frame[: N + DAY].assign(T_attic=attic)) == DAY
    network = {"capacitances": {"za": "C_za"}, "resistors": {"R_zo": ["za", "T_oa"], "R_zc": ["za", "T_attic"]}}
    reads = replace(settings, network={**network, "measured": "za"})
    found = without_further_temperatures(frame[:N].assign(T_attic=attic, T_oa_roof=attic), reads)
    assert list(found) == [*frame, "T_attic"]


def test_an_update_goes_on_after_a_short_outage(frame, earlier):
    zone = deepcopy(earlier)
    log = frame[:N].drop(frame.index[N - 55 : N - 50])
    assert zone.update(log) == 55
    assert zone.known_until == frame.index[N - 1]
    late = ZoneModel.fit(settings_from(SETTINGS), frame[: N - 110])
    with pytest.raises(ValueError, match=f"after {frame.index[N - 106]}, .*with skhybrid fit, on rows after that"):
        late.update(frame[:N].drop(frame.index[N - 105 : N - 9]))
    alone, joined = deepcopy(late), deepcopy(late)
    assert deepcopy(late).update(frame[N - 110 : N]) == 110
    assert alone.update(frame[N - 105 : N]) == 105  # rows of a day alone, after a short outage
    assert joined.update(frame[:N].drop(frame.index[N - 110 : N - 105])) == 105
    ahead = frame[["T_oa", "q_sol", "Q_hvac"]][N : N + DAY]
    pd.testing.assert_frame_equal(alone.predictor.forecast(None, ahead), joined.predictor.forecast(None, ahead))


def test_an_update_goes_on_over_an_outage_of_days(frame, earlier, tmp_path):
    """Inputs are interpolated, and set-points hold, and no temperature is known."""
    zone, alone = deepcopy(earlier), deepcopy(earlier)
    gap = slice(N - 60, N - 5)  # right after the known rows
    rows = frame[:N].copy()
    rows.iloc[gap] = np.nan
    held = rows[["T_heat_set", "T_cool_set"]].ffill()
    rows = rows.interpolate().assign(**held, T_za=rows["T_za"])
    assert zone.update(frame[:N].drop(frame.index[gap])) == 5
    alone.predictor.update(rows[N - 60 :].drop(columns=[c for c in rows if c not in alone.settings.columns]))
    ahead = frame[["T_oa", "q_sol", "Q_hvac"]][N : N + DAY]
    pd.testing.assert_frame_equal(zone.predictor.forecast(None, ahead), alone.predictor.forecast(None, ahead))
    found = day_ahead(zone, frame[:N].drop(frame.index[gap]), tomorrow(frame, tmp_path / "w.csv"), SCHEDULE)
    assert not any("starts from the last" in text for text in found.remarks)  # the model knows the rows before


def test_irradiance_of_a_zone_s_own_is_read_from_the_weather(frame, tmp_path):
    rows = frame.drop(columns=["Q_hvac", "T_heat_set", "T_cool_set"]).rename(columns={"q_sol": "q_sol_south"})
    columns = {"T_za": "T_za", "T_oa": "T_oa", "q_sol_south": "q_sol_south"}
    zone = ZoneModel.fit(settings_from({"step": "1h", "columns": columns}), rows[:N])
    path = tomorrow(frame, tmp_path / "w.csv", {"q_sol": "q_sol_south"})
    found = day_ahead(zone, rows[:N], path)  # a room without a plant needs no set-point
    assert found.frame["T_za"].notna().all()
    assert "Q_hvac" not in found.frame
    assert not any("thermostat" in text or "capacity" in text for text in found.remarks)
    with pytest.raises(ValueError, match="no heating or cooling, so that --setpoint does nothing"):
        day_ahead(zone, rows[:N], path, SCHEDULE)


def test_a_fit_tells_what_it_leaves_out_and_doubts(frame):
    """Rows beyond a long outage, a sensor that stands still, and temperatures under each other's name."""
    rows = frame[N - 12 * DAY : N].drop(frame.index[N - 10 * DAY : N - 5 * DAY])
    rows.iloc[-2 * DAY :, list(rows).index("T_za")] = 20.0
    with pytest.warns(SkhybridWarning) as caught:
        ZoneModel.fit(settings_from(SETTINGS), rows)
    texts = [str(w.message) for w in caught]
    assert any("is the sensor stuck? Such rows are taken as missing" in text for text in texts)
    first, last = rows.index[2 * DAY], rows.index[-2 * DAY]
    words = f"learned from {first} to {last} alone, and not from 48 complete rows beyond outages of more than four days"
    assert any(words in text for text in texts), texts
    swapped = frame[:N].rename(columns={"T_za": "T_oa", "T_oa": "T_za"})
    with pytest.warns(SkhybridWarning, match="are the two columns swapped"), suppress(ValueError):
        ZoneModel.fit(settings_from(SETTINGS), swapped)


def test_outages_within_the_training_are_bridged(frame):
    gone = [*range(100, 110), *range(200, 230)]
    whole, held = frame[:N], ["T_heat_set", "T_cool_set"]
    with pytest.warns(SkhybridWarning, match=f"over 2 outages, the first from {frame.index[99]} to {frame.index[110]}"):
        rows = training_rows(frame[:N].drop(frame.index[gone]), settings_from(SETTINGS), 56)
    assert rows.index.equals(whole.index)
    known = rows.index.difference(frame.index[gone])
    pd.testing.assert_frame_equal(rows.loc[known], whole.loc[known, rows.columns], check_names=False, check_freq=False)
    bridges = rows.loc[frame.index[gone]]
    assert bridges["T_za"].isna().all()
    assert bridges.drop(columns="T_za").notna().all(axis=None)
    assert (bridges.loc[frame.index[100:110], held] == whole.loc[frame.index[99], held]).all(axis=None)
    middle = whole["T_oa"].iloc[[99, 110]].to_numpy() @ [6 / 11, 5 / 11]
    assert bridges.loc[frame.index[104], "T_oa"] == pytest.approx(middle)


def test_a_log_of_outages_is_learned_from_by_its_longest_stretch(frame):
    kept = np.arange(N) % (2 * DAY) >= 42
    kept[: 4 * DAY] = True
    words = f"from {frame.index[0]} to {frame.index[4 * DAY - 1]} alone.* beyond outages, of which the last begin at"
    with pytest.warns(SkhybridWarning, match=words):
        rows = training_rows(frame[:N][kept], settings_from(SETTINGS), 56)
    assert len(rows) == 4 * DAY
    kept[2 * DAY : 4 * DAY] = False
    with pytest.raises(
        ValueError, match=r"of the 56 days before .*, the log has 2.0 days with all of .*; a model needs 3"
    ):
        training_rows(frame[:N][kept], settings_from(SETTINGS), 56)


def test_a_column_without_values_is_named(frame):
    with pytest.raises(ValueError, match=r"'AI02' \(q_sol\) has no values in the log; log it, or take it out"):
        ZoneModel.fit(settings_from(SETTINGS), frame[:N].assign(q_sol=np.nan))
    columns = {"Q_heat" if role == "Q_hvac" else role: name for role, name in SETTINGS["columns"].items()}
    with pytest.raises(ValueError, match=r"'heat' \(Q_hvac\) has no values"):
        ZoneModel.fit(settings_from({**SETTINGS, "columns": columns}), frame[:N].assign(Q_hvac=np.nan))


@pytest.fixture(scope="module")
def short(frame):
    return ZoneModel.fit(settings_from(SETTINGS), frame[N - 4 * DAY : N])


def test_meters_of_heat_and_cold_are_forecast_as_one(frame, short, tmp_path):
    """The model reads Q_hvac, which is not among the columns of the log."""
    columns = {"Q_heat" if role == "Q_hvac" else role: name for role, name in SETTINGS["columns"].items()}
    metered = ZoneModel(short.predictor, settings_from({**SETTINGS, "columns": columns}))
    path = tomorrow(frame, tmp_path / "w.csv")
    assert_same(*(day_ahead(zone, frame[:N], path, SCHEDULE) for zone in (metered, short)))


def test_a_log_too_short_for_its_thermostat_is_not_said_to_have_no_set_points(frame, short, tmp_path):
    assert "too short" in short.facts()["thermostat"]
    remarks = day_ahead(short, frame[:N], tomorrow(frame, tmp_path / "w.csv"), SCHEDULE).remarks
    assert any("an ideal one" in text and "too short" in text for text in remarks)
