"""Zones of a fleet that fail: one warning per call, lines of a command, and the status until they succeed."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from skhybrid import ARXRegressor, HybridPredictor
from skhybrid.cli import main
from skhybrid.datasets import make_office
from skhybrid.exceptions import FleetWarning, SkhybridWarning
from skhybrid.fleet import ZoneFleet

pytestmark = pytest.mark.usefixtures("quick_fits")

DAY = 24
ZONES = {
    name: make_office(n_days=10, sampling_time="1h", start="2024-01-08", random_state=seed).X
    for seed, name in enumerate("abc")
}
TRAIN, NEW = slice(0, 7 * DAY), slice(7 * DAY, 8 * DAY)
CONFIG = """[estimator]
network = "1R1C"
intervals = false
known = {Q_h = 6000, Q_c = -6.0}
"""


def everywhere(which, spoiled=()):
    """Rows of all zones; some have an input without values, which nothing can fill."""
    return {zone: X[which].assign(T_oa=np.nan) if zone in spoiled else X[which] for zone, X in ZONES.items()}


def ahead(which=slice(8 * DAY, 9 * DAY)):
    return {zone: X.drop(columns="T_za") for zone, X in everywhere(which, "bc").items()}


def unmeasured(which, spoiled=()):
    """Rows that are measured but for their last day."""
    X = everywhere(which, spoiled)
    return {zone: one.assign(T_za=one["T_za"].where(one.index < one.index[-DAY])) for zone, one in X.items()}


@pytest.fixture
def fleet(tmp_path):
    return ZoneFleet(ARXRegressor(), store=tmp_path / "store").fit(everywhere(TRAIN))


@pytest.mark.parametrize(
    "call",
    [
        lambda fleet: fleet.predict(everywhere(NEW, "bc")),
        lambda fleet: fleet.forecast(everywhere(NEW), ahead()),
        lambda fleet: fleet.update(everywhere(NEW, "bc")),
        lambda fleet: fleet.tick(unmeasured(slice(0, 9 * DAY), "bc")),
        lambda fleet: fleet.score(everywhere(NEW, "bc")),
        lambda fleet: fleet.backtest(everywhere(NEW, "bc"), horizon="6h"),
    ],
    ids=["predict", "forecast", "update", "tick", "score", "backtest"],
)
def test_each_call_warns_once_of_the_zones_that_failed(call, fleet):
    """They were in ``errors_`` only: who read the returned table saw nothing."""
    with pytest.warns(FleetWarning) as told:
        call(fleet)
    (said,) = [str(w.message) for w in told if issubclass(w.category, FleetWarning)]
    assert said == f"2 of 3 zones failed, see errors_; 2 zones, the first b: {fleet.errors_['b']}"
    assert set(fleet.errors_) == {"b", "c"}


@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.FleetWarning")
def test_weather_ahead_without_a_value_is_no_column_that_is_absent(tmp_path):
    fleet = ZoneFleet(HybridPredictor(network="1R1C", intervals=False), store=tmp_path).fit(everywhere(TRAIN))
    rows = unmeasured(slice(7 * DAY, 9 * DAY))
    rows["b"].loc[rows["b"].index[-DAY:], "T_oa"] = np.nan
    assert set(fleet.tick(rows)["zone"]) == {"a", "c"}
    assert fleet.errors_["b"].startswith("column 'T_oa' is empty: it contains NaN in all 24 rows")


def test_a_zone_that_is_left_out_of_the_table_for_its_clock_is_told_of(fleet):
    X = everywhere(NEW)
    aware = ZoneFleet(ARXRegressor()).fit({"utc": ZONES["a"][TRAIN].tz_localize("UTC"), **everywhere(TRAIN)})
    with pytest.warns(FleetWarning, match="1 of 4 zones failed, see errors_; zone utc: its stamps have a time zone"):
        aware.predict({"utc": ZONES["a"][NEW].tz_localize("UTC"), **X})


def put(folder, which, zones=ZONES, name="1"):
    for zone, X in zones.items():
        (folder / "data" / f"zone={zone}").mkdir(parents=True, exist_ok=True)
        X[which].to_parquet(folder / "data" / f"zone={zone}" / f"{name}.parquet")


def test_a_command_says_once_what_it_says_of_several_zones(tmp_path, capsys):
    """A nameplate of all zones was warned of for each; a zone that failed was named by its line and by a warning."""
    (tmp_path / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    put(tmp_path, TRAIN)
    put(tmp_path, TRAIN, {"bad": ZONES["a"].assign(T_oa=np.nan)})
    assert main(["fleet", "fit", str(tmp_path)]) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning: ")]
    assert [line.partition(": column")[0] for line in told if "T_oa" in line] == ["warning: bad"]
    assert [line for line in told if "Q_h" in line] == [
        "warning: a, b, c: known of [estimator] gives Q_h 6000 kW: likely W; give it in kW."
    ]


def test_a_command_says_what_is_to_be_done_in_the_folder(tmp_path, capsys):
    """It pointed at the rows ahead of a dead thermometer, at [units], which fleet.toml has none of, and at y."""
    (tmp_path / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    hot = ZONES["a"].assign(T_za=ZONES["a"]["T_za"] * 1.8 + 32.0)
    plans = ZONES["a"].assign(T_za=np.nan, u_heat=ZONES["a"]["u_heat"].where(np.arange(len(ZONES["a"])) < 6 * DAY))
    put(tmp_path, TRAIN, {"dead": plans, "hot": hot, "other": ZONES["a"].rename(columns=str.lower)})
    assert main(["fleet", "fit", str(tmp_path)]) == 0
    told = capsys.readouterr().err
    assert f"dead: column 'T_za', the measured temperature, is empty in all {7 * DAY} rows; see that it is" in told
    assert "likely degF rather than degC; write it to data in the unit of its role, or check the sensor." in told
    assert "name it by columns = { T_za = ... } in [estimator] of fleet.toml." in told


def test_a_fit_names_the_zones_that_the_fallback_forecasts(tmp_path, capsys):
    (tmp_path / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    put(tmp_path, TRAIN, {zone: X.drop(columns="q_sol") for zone, X in ZONES.items()})
    put(tmp_path, TRAIN, {"a": ZONES["a"]})
    assert main(["fleet", "fit", str(tmp_path)]) == 0
    assert "warning: b, c: the fallback forecasts it.\n" in capsys.readouterr().err


@pytest.mark.slow
def test_the_status_tells_why_a_zone_failed_in_the_last_tick_until_it_succeeds_again(tmp_path, capsys):
    """Each command is a process of its own, and only the lines of that of the tick told it."""
    (tmp_path / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    put(tmp_path, TRAIN)
    days = unmeasured(slice(7 * DAY, 9 * DAY)), unmeasured(slice(8 * DAY, 10 * DAY))
    assert main(["fleet", "fit", str(tmp_path), "-q"]) == 0
    put(tmp_path, slice(None), days[0] | {"b": days[0]["b"].assign(T_oa=np.nan)}, "2")
    assert main(["fleet", "tick", str(tmp_path), "-q"]) == 0
    for call, told in (("status", True), ("tick", False), ("fit", False)):
        if call == "tick":
            put(tmp_path, slice(None), days[0], "2")
        if call == "fit":
            put(tmp_path, slice(None), {"b": days[1]["b"].assign(T_oa=np.nan)}, "3")
            assert main(["fleet", "tick", str(tmp_path), "-q"]) == 0
            put(tmp_path, slice(None), days[1], "3")
        assert main(["fleet", call, str(tmp_path), "-q"]) == 0
        capsys.readouterr()
        assert main(["fleet", "status", str(tmp_path), "-q"]) == 0
        said = [capsys.readouterr().out, unescape((tmp_path / "status.html").read_text(encoding="utf-8"))]
        assert ["b: its last tick failed (no values of 'T_oa' since" in said[0], "tick failed" in said[1]] == [told] * 2


def test_a_tick_of_some_zones_keeps_why_others_failed_and_forgets_zones_that_were_dropped(fleet):
    failing, fine = everywhere(NEW, "bc"), everywhere(NEW)
    with pytest.raises(ValueError, match="no zone succeeded"):
        fleet.tick({zone: failing[zone] for zone in "bc"})
    fleet.tick({"a": fine["a"]})
    reasons = ZoneFleet(ARXRegressor(), store=fleet.store).status().set_index("zone")["reasons"]
    assert reasons.str.startswith("its last tick failed (").to_dict() == {"a": False, "b": True, "c": True}
    assert not reasons.str.contains(r"\.[;)]").any(), "a sentence ends within another"
    for file in Path(fleet.store_).glob("c.*"):
        file.unlink()
    fleet.tick({"b": fine["b"]})
    assert set(fleet.status()["zone"]) == {"a", "b"}
    assert not fleet.status()["reasons"].str.contains("tick failed").any()


def test_a_store_of_another_version_is_told_of_once_in_each_call(fleet):
    with closing(sqlite3.connect(Path(fleet.store_) / "fleet.sqlite")) as database, database:
        database.execute("UPDATE setting SET value = '0.0.1' WHERE name = 'version of skhybrid'")
    for call in (fleet.update, fleet.predict, fleet.status):
        with pytest.warns(SkhybridWarning, match=r"comes from other versions: .* is 0\.0\.1 there") as told:
            call(*([] if call == fleet.status else [everywhere(NEW)]))
        assert len(told) == 1
