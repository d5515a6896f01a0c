"""The daily work of a fleet: what a tick says of zones without new rows, files of a dataset, names, and refusals."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skhybrid import ARXRegressor, HybridPredictor
from skhybrid._time import SHORTEST_GAP
from skhybrid.cli import main
from skhybrid.datasets import make_office
from skhybrid.exceptions import FleetWarning, SkhybridWarning
from skhybrid.fleet import ZoneFleet, model_rows, model_store
from skhybrid.fleet.fleet_status import status_table, zone_status
from skhybrid.fleet.journal import Journal
from skhybrid.fleet.model_store import ModelStore
from skhybrid.fleet.zone_rows import read_rows

pytestmark = pytest.mark.usefixtures("quick_fits")

DAY = 24
ZONES = {
    name: make_office(n_days=11, sampling_time="1h", start="2024-01-08", random_state=seed).X
    for seed, name in enumerate("abc")
}
ARX = ARXRegressor()
ZONE = ZONES["a"]


def upto(measured, ahead, zone="a"):
    """Rows of a zone, those after the measured ones without a temperature."""
    X = ZONES[zone][: measured + ahead].copy()
    X.loc[X.index[measured:], "T_za"] = np.nan
    return X


def everywhere(which):
    return {zone: X[which] for zone, X in ZONES.items()}


@pytest.fixture
def fleet(tmp_path):
    return ZoneFleet(ARX, store=tmp_path / "store").fit(everywhere(slice(0, 7 * DAY)))


# ----------------------------------------------------------------------------------------------------------- the tick
def test_a_tick_names_the_zones_without_new_rows_and_those_without_a_forecast(fleet):
    X = {"a": upto(8 * DAY, DAY), "b": upto(7 * DAY, DAY, "b")}
    found = fleet.tick(X)
    assert set(found["zone"]) == {"a", "b"}
    assert fleet.errors_ == {}
    assert fleet.warnings_ == {
        "b": ("nothing was measured after 2024-01-14 23:00:00, the last known row.",),
        "c": ("there are no rows of it.",),
    }
    fleet.tick({"a": upto(9 * DAY, DAY), "b": upto(8 * DAY, 0, "b"), "c": upto(8 * DAY, DAY, "c")})
    assert fleet.warnings_ == {
        "b": ("there is no forecast, since no rows follow 2024-01-15 23:00:00; give the weather to come.",)
    }


def test_temperatures_as_text_are_read_by_a_tick_as_by_a_fit(fleet):
    """As a dataset holds them that was written from texts; a word is refused with its column."""
    X = upto(8 * DAY, DAY)
    text = X["T_za"].astype(object).where(X["T_za"].isna(), X["T_za"].astype(str))
    with pytest.raises(ValueError, match="column 'T_za' is not numeric"):
        fleet.tick({"a": X.assign(T_za=text.where(X.index != X.index[7 * DAY], "bad"))})
    assert len(fleet.tick({"a": X.assign(T_za=text)})) == DAY
    assert fleet.errors_ == {}


@pytest.mark.parametrize(
    ("role", "convert", "said"),
    [
        ("T_za", lambda v: 1.8 * v + 32.0, r"'room' reaches \d\S* degC from .*: likely degF rather than degC"),
        ("T_oa", lambda v: 1.8 * v + 32.0, "'T_oa' reaches .*: likely degF rather than degC"),
        ("q_sol", lambda v: 1000.0 * v, "'q_sol' reaches .*: likely W/m2 rather than kW/m2"),
        ("Q_hvac", lambda v: 1000.0 * v, "'Q_hvac' reaches .*: likely W rather than kW"),
    ],
)
def test_rows_in_another_unit_are_refused_as_by_one_zone(role, convert, said, tmp_path):
    """They were taken in with a warning, and the forecasts after them were tens of kelvin off."""
    heat = 0.5 + 5.0 * ZONE["u_heat"]
    X = ZONE.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=heat).rename(columns={"T_za": "room"})
    X.loc[X.index[8 * DAY :], "room"] = np.nan
    fleet = ZoneFleet(ARXRegressor(columns={"T_za": "room"}), store=tmp_path).fit({"a": X[: 7 * DAY]})
    name = {"T_za": "room"}.get(role, role)
    new = X[7 * DAY : 9 * DAY]
    other = new.assign(**{name: convert(new[name])})
    for call in (fleet.tick, fleet.update):
        with pytest.raises(ValueError, match=f"{said}; correct the rows, or convert them as those before"):
            call({"a": other if call == fleet.tick else other[:DAY]})
    assert len(fleet.tick({"a": new})) == DAY


def test_a_short_gap_of_an_input_is_filled_as_readers_of_logs_do(tmp_path):
    """Linearly for the weather, with its last value for a set-point, and never for what is measured."""
    columns = {"T_oa": "outdoor", "T_za": "room", "T_heat_set": "wanted"}
    names = {role: column for role, column in columns.items() if role in ZONE}
    X = ZONE.assign(wanted=np.where(np.arange(len(ZONE)) % DAY < 6, 18.0, 21.0)).rename(columns=names)
    X.loc[X.index[9 * DAY :], "room"] = np.nan
    holed, filled, row = X.copy(), X.copy(), 8 * DAY + 5
    for at in (30, row):
        holed.loc[X.index[at : at + 3], ["outdoor", "q_sol", "wanted"]] = np.nan
        filled.loc[X.index[at : at + 3], ["outdoor", "q_sol"]] = np.linspace(
            *X[["outdoor", "q_sol"]].iloc[[at - 1, at + 3]].to_numpy(), 5
        )[1:4]
        filled.loc[X.index[at : at + 3], "wanted"] = X["wanted"].iloc[at - 1]
    holed.loc[X.index[50:52], "room"] = filled.loc[X.index[50:52], "room"] = np.nan
    found = []
    for given in (holed, filled):
        made = ZoneFleet(clone(ARX).set_params(columns=columns), store=tmp_path / str(len(found)))
        made.fit({"a": given[: 7 * DAY]}).update({"a": given[7 * DAY : 8 * DAY]})
        found.append(made.tick({"a": given}))
        assert made.errors_ == {}
    pd.testing.assert_frame_equal(*found)
    pd.testing.assert_frame_equal(model_rows._filled(holed, made.estimator, SHORTEST_GAP), filled)


def test_set_points_ahead_stand_for_the_heat(tmp_path):
    """The heat is a column of the zone, and its cells are empty in the plan."""
    X = ZONE.assign(Q_hvac=6.0 * (ZONE["u_heat"] - ZONE["u_cool"])).drop(columns=["u_heat", "u_cool"])
    X = X.assign(T_heat_set=np.where(np.arange(len(X)) % DAY < 6, 18.0, 21.0), T_cool_set=26.0)
    fleet = ZoneFleet(HybridPredictor(intervals=False), store=tmp_path / "store").fit({"a": X[: 8 * DAY]})
    rows = X[: 9 * DAY].copy()
    rows.loc[rows.index[8 * DAY :], ["T_za", "Q_hvac"]] = np.nan
    found = fleet.tick({"a": rows})
    assert fleet.errors_ == {}
    assert found["Q_hvac"].notna().all()


@pytest.mark.parametrize(
    ("set_points", "blank", "instead"),
    [
        (True, ["u_heat", "u_cool", "T_heat_set"], "set-points"),
        (True, ["u_cool"], "set-points"),
        (False, ["u_heat", "u_cool"], "fit the zone again on a week or more of rows with heat and set-points"),
    ],
)
def test_a_tick_without_a_plan_says_what_its_rows_lack(set_points, blank, instead, tmp_path):
    X = ZONE.assign(T_heat_set=21.0) if set_points else ZONE
    fleet = ZoneFleet(HybridPredictor(intervals=False), store=tmp_path / "store").fit({"a": X[: 8 * DAY]})
    rows = (X if set_points else X.assign(T_heat_set=21.0))[: 9 * DAY].copy()
    rows.loc[rows.index[8 * DAY :], ["T_za", *blank]] = np.nan
    absent = ", ".join(repr(name) for name in ("u_heat", "u_cool") if name in blank)
    said = f"nothing says what the plant does after {rows.index[8 * DAY - 1]}: fill in {absent} there, or {instead}."
    with pytest.raises(ValueError, match=re.escape(said)):
        fleet.tick({"a": rows})


def test_the_heat_of_the_last_step_may_be_unknown(tmp_path):
    """A meter that counts tells it with the next reading; this step is then the first that is forecast."""
    X = ZONE.assign(Q_hvac=6.0 * (ZONE["u_heat"] - ZONE["u_cool"])).drop(columns=["u_heat", "u_cool"])
    X = X.assign(T_heat_set=np.where(np.arange(len(X)) % DAY < 6, 18.0, 21.0), T_cool_set=26.0)
    counted = [X[: n * DAY].assign(Q_hvac=X["Q_hvac"].where(X.index < X.index[n * DAY - 1])) for n in (8, 9)]
    model = HybridPredictor(intervals=False)
    fleet = ZoneFleet(model, store=tmp_path / "store").fit({"a": counted[0]})
    alone = clone(model).fit(X[: 8 * DAY - 1], X["T_za"][: 8 * DAY - 1])
    np.testing.assert_array_equal(fleet.predict({"a": X})["T_za"], alone.predict(X))
    fleet.tick({"a": counted[0]})
    assert "there is no forecast" in str(fleet.warnings_)
    ahead = X[9 * DAY : 10 * DAY].assign(T_za=np.nan, Q_hvac=np.nan)
    found = fleet.tick({"a": pd.concat([counted[1], ahead])})
    assert fleet.errors_ == {}
    assert list(found.index) == list(X.index[9 * DAY - 1 : 10 * DAY])


def test_a_meter_that_is_silent_at_the_end_stops_no_zone(tmp_path):
    """Forecasts start from the last row with all inputs, as in the folder of one zone, for up to twelve hours."""
    X = ZONE.assign(T_heat_set=np.where(np.arange(len(ZONE)) % DAY < 6, 18.0, 21.0), T_cool_set=26.0)
    silent = [X[: n * DAY].assign(u_heat=X["u_heat"].where(X.index < X.index[n * DAY - 5])) for n in (8, 9)]
    model, meters = HybridPredictor(intervals=False), ["T_za", "u_heat", "u_cool"]
    alone = clone(model).fit(X[: 8 * DAY - 5], X["T_za"][: 8 * DAY - 5])
    fleet = ZoneFleet(model, store=tmp_path / "store").fit({"a": silent[0]})
    assert "no values of 'u_heat' since" in str(fleet.warnings_)
    ahead = X[9 * DAY : 10 * DAY].assign(**dict.fromkeys(meters, np.nan))
    found = fleet.tick({"a": pd.concat([silent[1], ahead])})
    alone.update(X[8 * DAY - 5 : 9 * DAY - 5])
    expected = alone.forecast(None, X[9 * DAY - 5 : 10 * DAY].drop(columns=meters))
    np.testing.assert_array_equal(found["T_za"], expected["T_za"])
    long = X[: 9 * DAY].assign(u_heat=X["u_heat"].where(X.index < X.index[9 * DAY - 13]))
    with pytest.raises(ValueError, match=r"no values of 'u_heat' since .*; see that they are logged again"):
        fleet.tick({"a": pd.concat([long, ahead])})
    fleet.update({"a": X[9 * DAY - 5 : 9 * DAY + 8].assign(u_cool=X["u_cool"].where(X.index < X.index[9 * DAY + 3]))})
    known = alone.update(X[9 * DAY - 5 : 9 * DAY + 3]).known_until_
    assert fleet.status()["last_row"].tolist() == [known]


def test_a_column_that_the_model_does_not_read_shortens_nothing(tmp_path):
    """It ended the training where it ended, and took the temperatures of its own outages."""
    X = ZONE[: 8 * DAY].assign(T_attic=np.linspace(5.0, 9.0, 8 * DAY))
    holed = X.assign(T_attic=X["T_attic"].where((np.arange(8 * DAY) < 7 * DAY) & (np.arange(8 * DAY) // 6 != 9)))
    model = HybridPredictor(intervals=False)
    fleet = ZoneFleet(model, store=tmp_path / "store").fit({"a": holed})
    assert "T_attic" not in str(fleet.warnings_)
    alone = clone(model).fit(X, X["T_za"])
    later = ZONE[8 * DAY :].assign(T_attic=np.nan)
    np.testing.assert_array_equal(fleet.predict({"a": later})["T_za"], alone.predict(later))
    read = ZoneFleet(clone(ARX), store=tmp_path / "arx").fit({"a": holed})
    assert "no values of 'T_attic' since" in str(read.warnings_)


def test_a_zone_learns_over_outages_of_days(tmp_path):
    """Inputs are interpolated and set-points held, and no temperature of the outage is known."""
    X = ZONE[: 8 * DAY].assign(T_heat_set=np.where(np.arange(8 * DAY) % DAY < 6, 18.0, 21.0)).rename_axis("time")
    absent, unmeasured = slice(2 * DAY, 2 * DAY + 20), slice(4 * DAY, 6 * DAY)
    holed = X.copy()
    holed.iloc[unmeasured, list(X).index("q_sol")] = np.nan
    holed = holed.drop(X.index[absent])
    wanted = X.copy()
    wanted.iloc[absent] = np.nan
    wanted.iloc[unmeasured, [list(X).index("q_sol"), list(X).index("T_za")]] = np.nan
    inputs = wanted.drop(columns=["T_za", "T_heat_set"]).interpolate("time")
    wanted = wanted.assign(**inputs, T_heat_set=wanted["T_heat_set"].ffill())
    found = model_rows._bridged(holed, ARX)
    pd.testing.assert_frame_equal(found, wanted, check_freq=False)
    fleet = ZoneFleet(ARX, store=tmp_path / "store").fit({"a": holed})
    assert fleet.errors_ == {}
    alone = clone(ARX).fit(wanted, wanted["T_za"])
    np.testing.assert_array_equal(fleet.predict({"a": X})["T_za"], alone.predict(X))
    long = X.drop(X.index[DAY : 6 * DAY])
    assert model_rows._bridged(long, ARX).index.equals(long.index)
    unread = X.assign(humidity=np.where(np.arange(8 * DAY) % 40 < 20, np.nan, 50.0), T_attic=np.nan)
    pd.testing.assert_series_equal(model_rows._bridged(unread, ARX)["T_za"], X["T_za"], check_freq=False)


@pytest.mark.parametrize("clock", [None, "Europe/Amsterdam"])
def test_rows_that_are_absent_for_a_short_time_stop_no_zone(clock, tmp_path):
    whole = upto(8 * DAY, DAY).tz_localize(clock).rename_axis("time")
    places = [30, 31, 7 * DAY + 4]
    missing = whole.copy()
    missing.iloc[places] = np.nan
    found = []
    for number, given in enumerate((whole.drop(whole.index[places]), missing)):
        made = ZoneFleet(ARX, store=tmp_path / str(number)).fit({"a": given[given.index < whole.index[7 * DAY]]})
        found.append(made.tick({"a": given}))
        assert made.errors_ == {}
    pd.testing.assert_frame_equal(*found, check_freq=False)


def test_a_long_gap_of_an_input_is_refused_with_its_column_and_stamp(fleet):
    X = upto(8 * DAY, DAY)
    X.loc[X.index[8 * DAY + 5 : 8 * DAY + 9], "T_oa"] = np.nan  # of the weather to come
    fleet.tick({"a": X, "b": upto(8 * DAY, DAY, "b")})
    assert fleet.errors_["a"].startswith("column 'T_oa' contains NaN in 4 rows (first at 2024-01-16 05:00:00)")
    assert list(fleet.errors_) == ["a"]


@pytest.mark.parametrize("kind", [ARX, HybridPredictor(intervals=False)])
@pytest.mark.parametrize("begin", [7 * DAY, 7 * DAY + 5])  # after the known rows, and within the new ones
def test_a_tick_goes_on_over_an_outage(kind, begin, tmp_path):
    """As with rows whose inputs are interpolated and whose temperatures are not known."""
    X, gap = upto(9 * DAY, DAY), slice(begin, begin + 30)
    bridged = X.copy()
    bridged.iloc[gap] = np.nan
    bridged = bridged.interpolate().assign(T_za=X["T_za"].mask(bridged["T_za"].isna()))
    found = []
    for number, given in enumerate((X.drop(X.index[gap]), bridged)):
        fleet = ZoneFleet(kind, store=tmp_path / str(number)).fit({"a": ZONE[: 7 * DAY]})
        found.append(fleet.tick({"a": given}))
        assert fleet.errors_ == {}
        assert fleet.status()["last_row"][0] == X.index[9 * DAY - 1]
    pd.testing.assert_frame_equal(*found, check_freq=False)
    late = ZoneFleet(kind, store=tmp_path / "late").fit({"a": ZONE[: 7 * DAY]})
    with pytest.raises(ValueError, match=r"begin at 2024-01-15 01:00:00, .* known one is 2024-01-14 23:00:00; give it"):
        late.tick({"a": X[7 * DAY + 1 :]})


def test_after_an_outage_of_many_days_a_zone_learns_from_the_rows_after_it(tmp_path):
    X, fleet = ZONE, ZoneFleet(ARX, store=tmp_path)
    fleet.fit({"a": X[: 3 * DAY]})
    gap = slice(3 * DAY, 7 * DAY + 1)
    words = f"there are no rows between {X.index[3 * DAY - 1]} and {X.index[7 * DAY + 1]}, .* once rows of three days"
    short = upto(9 * DAY, DAY).drop(X.index[gap])
    for use in (fleet.tick, fleet.fit):
        with pytest.raises(ValueError, match=words):
            use({"a": short})
    fleet.fit({"a": X.drop(X.index[gap])})
    assert fleet.warnings_ == {
        "a": (f"learned from {X.index[7 * DAY + 1]} on, after an outage of more than four days.",)
    }
    alone = clone(ARX).fit(X[7 * DAY + 1 :], X["T_za"][7 * DAY + 1 :])
    np.testing.assert_array_equal(fleet.predict({"a": X})["T_za"], alone.predict(X))
    fleet.fit({"a": X[: 10 * DAY + 1].drop(X.index[gap])})  # its rows are those of three days
    with pytest.raises(ValueError, match=words):
        fleet.fit({"a": X[: 10 * DAY].drop(X.index[gap])})


def test_on_the_day_of_the_fit_no_zone_is_warned_of(fleet):
    ahead = {zone: upto(7 * DAY, DAY, zone) for zone in ZONES}
    fleet.tick(ahead)
    assert fleet.warnings_ == {}
    fleet.tick(ahead)  # a second time it is news
    assert list(fleet.warnings_) == list(ZONES)


def test_files_of_a_zone_are_in_the_order_of_their_numbers(tmp_path):
    for number in (9, 10):
        ZONE[:5].assign(T_oa=float(number)).to_parquet(tmp_path / f"day-{number}.parquet")
    assert (read_rows(tmp_path)["T_oa"] == 10.0).all()


def test_the_command_says_which_zones_have_nothing_new(tmp_path, capsys):
    def put(zone, X, name):
        (tmp_path / "data" / f"zone={zone}").mkdir(parents=True, exist_ok=True)
        X.to_parquet(tmp_path / "data" / f"zone={zone}" / f"{name}.parquet")

    (tmp_path / "fleet.toml").write_text(
        '[estimator]\nnetwork = "1R1C"\nintervals = false\nknown = {Q_h = 6, Q_c = -6}\n', encoding="utf-8"
    )
    for zone in "ab":
        put(zone, upto(7 * DAY, DAY, zone), "1")
    assert main(["fleet", "fit", str(tmp_path), "-q"]) == 0
    put("a", upto(8 * DAY, DAY), "2")
    capsys.readouterr()
    assert main(["fleet", "tick", str(tmp_path)]) == 0
    shown = capsys.readouterr()
    assert "with warnings: 1\n" in shown.out
    assert shown.err == "warning: b: nothing was measured after 2024-01-14 23:00:00, the last known row.\n"
    assert main(["fleet", "tick", str(tmp_path), "--json", "--strict"]) == 1
    assert set(json.loads(capsys.readouterr().out)["warnings"]) == {"a", "b"}


def test_no_process_at_all_is_refused(tmp_path, capsys):
    assert main(["fleet", "fit", str(tmp_path), "--jobs", "0"]) == 2
    assert "'--jobs': 0 processes do no work; give 1 or more, or -1 for every core" in capsys.readouterr().err


def test_a_folder_without_models_says_what_to_do(tmp_path, capsys):
    (tmp_path / "fleet.toml").write_text("", encoding="utf-8")
    assert main(["fleet", "status", str(tmp_path)]) == 1
    assert capsys.readouterr().err.endswith(f"holds no model yet; make them with skhybrid fleet fit {tmp_path}.\n")


@pytest.mark.parametrize("command", ["fit", "tick", "status"])
def test_the_folder_of_a_zone_is_refused(command, tmp_path, capsys):
    (tmp_path / "archive.sqlite").touch()
    (tmp_path / "data" / "zone=a").mkdir(parents=True)
    assert main(["fleet", command, str(tmp_path)]) == 1
    assert "is the folder of one zone or building; use skhybrid zone, or give another" in capsys.readouterr().err
    assert not (tmp_path / "fleet.toml").exists()


def test_a_status_as_json_has_null_for_a_zone_without_rows(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(
        "skhybrid.fleet.FleetFolder.status", lambda self: status_table({}, {"fit": {"a": "no rows"}}, "zone")
    )
    assert main(["fleet", "status", str(tmp_path), "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["zone"], found["last_row"], found["coverage"]) == ("a", None, None)


def test_the_status_tells_of_a_model_of_a_few_rows(fleet):
    fleet.fit({"new": ZONE[:3]})
    reasons = fleet.status().set_index("zone")["reasons"]
    assert "it learned from 3 rows of 1 h only" in reasons["new"]
    assert "it learned" not in reasons["a"]


def test_a_new_fit_keeps_the_errors_of_past_forecasts(fleet):
    fleet.tick({"a": upto(8 * DAY, DAY)})
    fleet.tick({"a": upto(9 * DAY, DAY)})
    before = fleet.status().set_index("zone").loc["a"]
    fleet.fit({"a": upto(9 * DAY, DAY)})
    after = fleet.status().set_index("zone").loc["a"]
    assert after["rmse_yesterday"] == before["rmse_yesterday"] > 0.0
    assert after["coverage"] == before["coverage"]
    assert np.isnan(fleet.fit(everywhere(slice(0, 7 * DAY))).status()["rmse_yesterday"]).all()  # it ends before them


def test_the_error_of_yesterday_rests_on_half_a_day_or_more(fleet):
    fleet.update({"b": ZONES["b"][7 * DAY : 7 * DAY + 1]})
    assert fleet.status()["rmse_yesterday"].isna().all()
    for end, day in ((8 * DAY + 11, 0), (8 * DAY + 12, 1)):
        fleet.update({"a": ZONE[:end][7 * DAY if day == 0 else end - 1 :]})
        days = ModelStore(fleet.store).journal("a").facts["days"]
        assert [one["n"] for one in days] == [DAY, 11 + day]
        assert fleet.status().set_index("zone").loc["a", "rmse_yesterday"] == days[day]["rmse"]


@pytest.mark.parametrize("measured", [True, False])
def test_rows_after_a_gap_are_refused_also_without_a_temperature(fleet, measured):
    """The rows that a regression keeps would have a gap, and no forecast could be made any more."""
    fleet.update({"a": ZONE[7 * DAY : 8 * DAY]})
    rows = ZONE[9 * DAY : 10 * DAY]
    with pytest.raises(ValueError, match="2024-01-15 23:00:00 is followed by 2024-01-17 00:00:00"):
        fleet.update({"a": rows if measured else rows.assign(T_za=np.nan)})
    fleet.update({"a": ZONE[8 * DAY : 9 * DAY].assign(T_za=np.nan)})
    assert len(fleet.predict({"a": ZONE[9 * DAY : 10 * DAY]})) == DAY
    assert fleet.status().set_index("zone").loc["a", "last_row"] == ZONE.index[9 * DAY - 1]


def test_the_chart_has_each_row_once(fleet):
    fleet.tick({"a": upto(8 * DAY, DAY)})
    fleet.tick({"a": upto(8 * DAY + 6, 0)})  # nothing follows, so the last forecast stays
    recent = zone_status("a", fleet.store_).recent
    assert recent.index.is_unique
    assert recent.index[-1] == ZONE.index[9 * DAY - 1]


def test_a_model_is_never_read_beside_the_journal_of_another(monkeypatch, fleet):
    """A status or forecast may read a zone while a fit or tick saves it."""
    store, real = ModelStore(fleet.store), model_store.load_model
    model, journal = store.load("a")
    journal.facts["n"] = 0
    store.save("a", model.set_params(alpha=0.5), journal)
    calls = []

    def meanwhile(path):
        calls.append(path)
        if len(calls) == 1:
            store.save("a", real(path).set_params(alpha=0.7), Journal({**journal.facts, "n": 1}))
        return real(path)

    monkeypatch.setattr(model_store, "load_model", meanwhile)
    found, its = store.load("a")
    assert (found.alpha, its.facts["n"]) == (0.7, 1)


# ------------------------------------------------------------------------------------------------------------ datasets
def test_files_with_other_time_zones_are_joined_in_utc(tmp_path):
    winter, summer = ZONE[:100].tz_localize("+01:00"), ZONE[100:168].tz_localize("+01:00").tz_convert("+02:00")
    winter.to_parquet(tmp_path / "1.parquet")
    summer.to_parquet(tmp_path / "2.parquet")
    expected = ZONE[:168].tz_localize("+01:00").tz_convert("UTC")
    pd.testing.assert_frame_equal(read_rows(tmp_path), expected, check_freq=False)
    ZONE[100:168].to_parquet(tmp_path / "2.parquet")
    with pytest.raises(
        ValueError, match=r"2\.parquet has stamps without a time zone, but other files of the zone have"
    ):
        read_rows(tmp_path)


def test_rows_in_another_time_zone_are_taken_in(tmp_path):
    """Such as those of summer, where each stamp has its offset from UTC; the results are those in one time zone."""
    fleets = [ZoneFleet(ARX).fit({"a": ZONE[: 7 * DAY].tz_localize("+01:00")}) for _ in range(2)]
    for day in (7, 8, 9):
        rows = upto((day + 1) * DAY, DAY).tz_localize("+01:00")
        found, expected = fleets[0].tick({"a": rows.tz_convert("UTC")}), fleets[1].tick({"a": rows})
        pd.testing.assert_frame_equal(found, expected, check_exact=True)
    later = {"a": ZONE[10 * DAY :].tz_localize("+01:00").tz_convert("+02:00")}
    made = [fleet.predict(later) for fleet in fleets]
    pd.testing.assert_frame_equal(*made, check_exact=True)
    assert (made[0].index == later["a"].index).all()
    assert len(fleets[0].forecast(None, {"a": later["a"].drop(columns="T_za")})) == DAY


@pytest.mark.parametrize("name", ["", "__HIVE_DEFAULT_PARTITION__"])
def test_rows_without_a_zone_are_refused_in_a_dataset_too(tmp_path, name):
    for zone in ("a", name):
        (tmp_path / f"zone={zone}").mkdir()
    ZONE[:168].to_parquet(tmp_path / "zone=a" / "1.parquet")
    assert ZoneFleet(ARX).fit(tmp_path).errors_ == {}  # an empty folder has no rows
    ZONE[:168].to_parquet(tmp_path / f"zone={name}" / "1.parquet")
    with pytest.raises(ValueError, match=f"zone={name} holds rows that name no zone; name it, or remove the folder"):
        ZoneFleet(ARX).fit(tmp_path)


# --------------------------------------------------------------------------------------------------- names, arguments
def test_a_name_that_is_too_long_for_a_file_costs_its_zone_alone(tmp_path):
    long, longest = "комната " * 6, "x" * 230
    with pytest.warns(SkhybridWarning, match="1 of 3 zones could not be fitted"):
        fleet = ZoneFleet(ARX, store=tmp_path).fit(dict.fromkeys(("a", longest, long), ZONE[:168]))
    said = "its name takes 258 characters as a file name, and at most 230 are possible; shorten it."
    assert fleet.errors_ == {long: said}
    new = dict.fromkeys(("a", longest, long), ZONE[168:192])
    assert set(fleet.predict(new)["zone"]) == {"a", longest}
    assert fleet.errors_ == {long: said}


def test_names_of_any_kind_come_back_as_they_were(tmp_path):
    names = [3, 2.5, "b/1", "a b", " a", "комната", "A", "a", "..", ".a", "a%2Fb", ("b", 1)]
    fleet = ZoneFleet(ARX, store=tmp_path).fit((name, ZONE[:168]) for name in names)
    assert list(fleet.predict((name, ZONE[168:192]) for name in names)["zone"].unique()) == names
    assert fleet.zones_ == sorted(map(str, names))


def test_names_that_the_disk_does_not_tell_apart_share_no_model(tmp_path, monkeypatch):
    """As on macOS and Windows, where the model of the last zone was that of both."""
    monkeypatch.setattr(model_store, "_stem", str.lower)
    with pytest.warns(FleetWarning, match="zone A: the file of its model is that of zone 'a'; "):
        fleet = ZoneFleet(ARX, store=tmp_path).fit({"a": ZONE[:168], "A": ZONES["b"][:168]})
    alone = clone(ARX).fit(ZONE[:168], ZONE["T_za"][:168])
    found = fleet.predict(dict.fromkeys("aA", ZONE[168:192]))
    assert found["zone"].unique().tolist() == ["a"]
    np.testing.assert_array_equal(found["T_za"], alone.predict(ZONE[168:192]))


@pytest.mark.parametrize("given", [None, ARXRegressor, "arx"])
def test_what_is_no_estimator_is_refused(given):
    with pytest.raises(ValueError, match=r"estimator=.* must be an estimator, such as HybridPredictor\(\)"):
        ZoneFleet(given).fit({"a": ZONE})
    if given is not None:
        with pytest.raises(ValueError, match=r"fallback=.* must be an estimator"):
            ZoneFleet(ARX, fallback=given).fit({"a": ZONE})
