"""ZoneFleet: what single zones give, bit for bit, for tables, datasets and engines; faults cost their zones alone."""

from __future__ import annotations

import copy
import errno
import gc
import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from unittest import mock

import clusters
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skhybrid import ARXRegressor, HybridPredictor, _files
from skhybrid._warnings import warn_user
from skhybrid.cli import main
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.fleet import FleetFolder, FleetPrior, ZoneFleet, dispatch, zone_jobs
from skhybrid.fleet.fleet_folder import EXAMPLE
from skhybrid.fleet.fleet_status import ZoneStatus, status_table
from skhybrid.fleet.journal import Journal
from skhybrid.fleet.model_store import ModelStore
from skhybrid.fleet.zone_rows import read_rows
from skhybrid.model_selection import backtest
from skhybrid.study.spans import TRAINING_DAYS

pytestmark = pytest.mark.usefixtures("quick_fits")

DAY = 24
ZONES = {
    name: make_office(n_days=10, sampling_time="1h", start="2024-01-08", random_state=seed).X
    for seed, name in enumerate(("a", "b/1", "c"))
}
ARX = ARXRegressor()
HYBRID = HybridPredictor(network="1R1C", known={"Q_h": 6.0, "Q_c": -6.0})
TRAIN, NEW, AHEAD = slice(0, 7 * DAY), slice(7 * DAY, 8 * DAY), slice(8 * DAY, 9 * DAY)


def rows(which, zones=ZONES):
    return pd.concat([X[which].assign(zone=zone) for zone, X in zones.items()])


def future(which=AHEAD):
    return rows(which).drop(columns="T_za")


def of(table, zone, key="zone"):
    return table[table[key] == zone].drop(columns=key)


def spoiled(which=TRAIN):
    """Rows in which zone c has no weather at first, which nothing can fill."""
    X = rows(which)
    X.loc[(X["zone"] == "c") & (X.index <= X.index[3]), "T_oa"] = np.nan
    return X


@pytest.fixture(scope="module")
def _alone():
    return {zone: clone(HYBRID).fit(X[TRAIN], X[TRAIN]["T_za"]) for zone, X in ZONES.items()}


@pytest.fixture
def alone(_alone):
    """A single fitted model per zone."""
    return copy.deepcopy(_alone)


@pytest.fixture(scope="module")
def _fitted(tmp_path_factory):
    store = tmp_path_factory.mktemp("fleet")
    ZoneFleet(HYBRID, store=store).fit(rows(TRAIN))
    return store


@pytest.fixture
def fleet(_fitted, tmp_path):
    """A fleet of the same models, from its store alone."""
    return ZoneFleet(clone(HYBRID), store=shutil.copytree(_fitted, tmp_path / "store"))


# ------------------------------------------------------------------------------------------------------ as single zones
@pytest.mark.slow
def test_every_method_gives_what_single_zones_give(fleet, alone):
    X, history = rows(slice(7 * DAY, None)), rows(slice(0, 8 * DAY))
    found = {
        "predict": fleet.predict(X),
        "forecast": fleet.forecast(history, future()),
        "quantiles": fleet.forecast(None, future(NEW), quantiles=(0.1, 0.9)),
        "backtest": fleet.backtest(X, horizon="12h", quantiles=(0.1, 0.9)),
    }
    scores = fleet.score(X).set_index("zone")["score"]
    for zone, model in alone.items():
        own = ZONES[zone][7 * DAY :]
        expected = {
            "predict": pd.DataFrame({"T_za": model.predict(own)}, index=own.index),
            "forecast": model.forecast(ZONES[zone][: 8 * DAY], of(future(), zone)),
            "quantiles": model.forecast(None, of(future(NEW), zone), quantiles=(0.1, 0.9)),
            "backtest": backtest(model, own, own["T_za"], horizon="12h", quantiles=(0.1, 0.9)),
        }
        for name, table in expected.items():
            got = of(found[name], zone)
            got = got.reset_index(drop=True) if name == "backtest" else got
            pd.testing.assert_frame_equal(got, table, check_exact=True, check_freq=False, obj=f"{name} of {zone}")
        assert scores[zone] == model.score(own, own["T_za"])
    assert fleet.errors_ == {}


def test_new_rows_are_taken_in_as_by_a_single_zone(alone, fleet):
    fleet.update(rows(NEW)).update(rows(NEW))  # the second time they are known
    again = ZoneFleet(clone(HYBRID), store=fleet.store)
    found = again.forecast(None, future(), quantiles=(0.1, 0.9))
    for zone, X in ZONES.items():
        expected = alone[zone].update(X[NEW]).forecast(None, of(future(), zone), quantiles=(0.1, 0.9))
        pd.testing.assert_frame_equal(of(found, zone), expected, check_exact=True, check_freq=False)
    with pytest.raises(ValueError, match="no zone succeeded; 3 zones, the first a: "):
        again.update(rows(slice(9 * DAY, 10 * DAY)))  # a day is missing before them


@pytest.mark.slow
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda fleet: pickle.loads(pickle.dumps(fleet))])
def test_a_copy_without_a_store_keeps_its_models(copied):
    fleet = ZoneFleet(ARX).fit(rows(TRAIN))
    expected, folder = fleet.predict(future(NEW)), fleet.store_
    twin = copied(fleet)
    fleet.fit(rows(TRAIN, {"b/1": ZONES["b/1"]}))
    pd.testing.assert_frame_equal(twin.predict(future(NEW)), expected)
    own = twin.store_
    assert (own == folder) == (copied is copy.copy)
    del fleet, twin
    gc.collect()
    assert not any(map(os.path.exists, (folder, own))), "temporary folders are removed with the last that holds them"


def test_its_prior_is_that_of_its_models(alone, fleet):
    models = [model for _, model in sorted(alone.items())]
    found, wanted = fleet.prior({"c": 3.0, "a": 6.0, "b/1": 5.0}), FleetPrior.learn(models, [6.0, 5.0, 3.0])
    assert list(found) == list(wanted)
    np.testing.assert_allclose(list(found.values()), list(wanted.values()))
    assert fleet.prior().n_zones == 3
    with pytest.raises(ValueError, match=r"zone 'd', of which the store has no model"):
        fleet.prior({"d": 6.0})
    with pytest.raises(ValueError, match="models holds 0 zones"):
        fleet.prior({})
    with pytest.raises(ValueError, match=r"sizes=\[3.0, 4.0\] must be a mapping of zones to their nameplates"):
        fleet.prior([3.0, 4.0])
    with pytest.raises(ValueError, match="sizes gives zone 'c' the size 0"):
        fleet.prior({"a": 3.0, "c": 0.0})
    numbered = ZoneFleet(ARX).fit(dict(enumerate(X[TRAIN] for X in ZONES.values())))
    assert numbered.prior({0: 3.0, 2: 4.0}).n_zones == 2


def test_a_long_update_is_saved_with_the_model(monkeypatch, alone, fleet):
    monkeypatch.setattr("skhybrid.fleet.model_store._MOST_ROWS", 30)
    lengths = []
    for day in (7, 8):
        fleet.update(rows(slice(day * DAY, (day + 1) * DAY)))
        lengths.append(len(ModelStore(fleet.store).journal("a").rows))
    assert lengths == [24, 0]
    X = ZONES["a"]
    last = slice(9 * DAY, None)
    expected = alone["a"].update(X[7 * DAY : 9 * DAY]).forecast(None, X[last].drop(columns="T_za"))
    pd.testing.assert_frame_equal(
        of(fleet.forecast(None, future(last)), "a"), expected, check_exact=True, check_freq=False
    )


def test_an_estimator_without_update_forecasts_from_the_rows_that_it_was_given():
    fleet = ZoneFleet(ARX).fit(rows(TRAIN)).update(rows(NEW))
    X = ZONES["a"]
    model = clone(ARX).fit(X[TRAIN], X[TRAIN]["T_za"])
    expected = model.predict_from(X[7 * DAY : 9 * DAY], [DAY - 1])[0]
    np.testing.assert_array_equal(of(fleet.forecast(None, future()), "a")["T_za"], expected)
    np.testing.assert_array_equal(
        of(fleet.predict(rows(AHEAD)), "a")["T_za"], model.predict(X[7 * DAY : 9 * DAY])[DAY:]
    )
    with pytest.raises(ValueError, match="ARXRegressor forecasts under given heat only; leave out setpoint"):
        fleet.forecast(None, future(), setpoint=21.0)


def test_tables_and_datasets_are_read_alike(tmp_path):
    X = rows(TRAIN)
    y = X["T_za"]
    expected = ZoneFleet(ARX).fit(X).predict(rows(NEW))
    given = {
        "with y": (X.drop(columns="T_za").assign(T_za=y), y),
        "y as an array": (X, y.to_numpy()),
        "tables": ((part for _, part in X.groupby("zone")), None),
        "pairs": ([(zone, table[TRAIN]) for zone, table in ZONES.items()], None),
        "a mapping": ({zone: table[TRAIN] for zone, table in ZONES.items()}, None),
        "indexed": (X.set_index("zone", append=True), None),
    }
    data = tmp_path / "data"
    X.rename_axis("time").reset_index().to_parquet(data, partition_cols=["zone"], index=False)
    given["a dataset"] = (data, None)
    for what, (table, target) in given.items():
        fleet = ZoneFleet(ARX).fit(table, target)
        pd.testing.assert_frame_equal(fleet.predict(rows(NEW)), expected, check_exact=True, obj=what)
    numbered = rows(NEW).assign(house=rows(NEW)["zone"].map({"a": 1, "b/1": 2, "c": 3})).drop(columns="zone")
    found = ZoneFleet(ARX, "house").fit(numbered).predict(numbered)
    assert found["house"].unique().tolist() == [1, 2, 3]


def test_a_target_of_its_own_is_learned_and_rows_after_the_last_measurement_are_not():
    X = rows(TRAIN).drop(columns="T_za")
    y = rows(TRAIN)["T_za"]
    assert ZoneFleet(ARX).fit(X, y).errors_ == {}
    longer = rows(slice(0, 8 * DAY))
    longer.loc[longer.index >= ZONES["a"].index[7 * DAY], "T_za"] = np.nan
    found = ZoneFleet(ARX).fit(longer).predict(rows(NEW))
    pd.testing.assert_frame_equal(found, ZoneFleet(ARX).fit(rows(TRAIN)).predict(rows(NEW)), check_exact=True)
    short = ZoneFleet(ARX).fit(longer, last="5D").predict(rows(NEW))
    expected = ZoneFleet(ARX).fit(rows(slice(2 * DAY, 7 * DAY))).predict(rows(NEW))
    pd.testing.assert_frame_equal(short, expected, check_exact=True)


# --------------------------------------------------------------------------------------------------------------- faults
def test_a_bad_zone_says_what_it_says_alone_and_the_others_go_on(tmp_path):
    bad = spoiled()
    with pytest.raises(ValueError) as said:
        clone(ARX).fit(of(bad, "c"), of(bad, "c")["T_za"])
    fleet = ZoneFleet(ARX, store=tmp_path)
    with pytest.warns(SkhybridWarning, match="1 of 3 zones could not be fitted, see errors_; zone c: "):
        fleet.fit(bad)
    assert fleet.errors_ == {"c": str(said.value)}
    assert fleet.predict(rows(NEW))["zone"].unique().tolist() == ["a", "b/1"]
    assert fleet.errors_ == {"c": str(said.value)}
    assert fleet.status().iloc[0][["zone", "verdict", "reasons"]].tolist() == ["c", "not usable", str(said.value)]
    before = fleet.fit(rows(TRAIN)).predict(rows(NEW))
    with pytest.warns(SkhybridWarning, match="1 of 3 zones"):
        fleet.fit(bad)
    pd.testing.assert_frame_equal(
        fleet.predict(rows(NEW)), before, check_exact=True
    )  # a fit that fails changes nothing
    status = fleet.status().set_index("zone")
    assert status["reasons"]["c"].startswith(f"its last fit failed ({str(said.value)[:-1]}); ")


def test_a_fit_that_fails_for_all_zones_leaves_the_fleet_as_it_was():
    fleet = ZoneFleet(ARX).fit({"a": ZONES["a"][TRAIN]})
    before = fleet.predict({"a": ZONES["a"][NEW]})
    with pytest.raises(ValueError, match="no zone succeeded"):
        fleet.fit({"a": ZONES["a"][TRAIN].assign(T_oa=np.nan)})
    with pytest.raises(ValueError, match="X is a int"):
        fleet.fit(3)
    assert fleet.errors_ == {}
    pd.testing.assert_frame_equal(fleet.predict({"a": ZONES["a"][NEW]}), before, check_exact=True)


def test_a_fit_that_fails_for_all_zones_tells_every_cause_with_its_number_of_zones():
    """One zone's cause was told, as if it were that of all."""
    X = ZONES["a"][TRAIN]
    still = [X.assign(T_oa=X["T_oa"].mask(X.index == X.index[row], -999.0)) for row in (30, 50)]
    with pytest.raises(ValueError) as said:
        ZoneFleet(ARX).fit({"none": X[:0], "a": still[0], "b": still[1]})
    wanted = r"no zone succeeded; 2 zones, the first a: .*T_oa.* -999 .*\. zone none: there are no rows; .*\."
    assert re.fullmatch(wanted, str(said.value)), str(said.value)


def test_the_status_tells_why_no_zone_could_be_fitted(tmp_path):
    fleet = ZoneFleet(ARX, store=tmp_path / "store")
    with pytest.raises(ValueError, match=r"no zone succeeded; .*T_oa"):
        fleet.fit({"a": ZONES["a"][TRAIN].assign(T_oa=np.nan)})
    with pytest.raises(ValueError, match=r"no zone succeeded; .*q_sol"):
        fleet.fit({"a": ZONES["a"][TRAIN].assign(q_sol=np.nan)})
    assert "q_sol" in ModelStore(tmp_path / "store").failures("fit")["a"]


@pytest.mark.parametrize(
    ("X", "said"),
    [
        (ZONES["a"][NEW], "the rows begin at 2024-01-15 00:00:00, but the last known one is 2024-01-15 23:00:00; "),
        (ZONES["a"][slice(7 * DAY + 6, 9 * DAY)], "the rows begin at 2024-01-15 06:00:00, but the last known one is "),
        (ZONES["a"][AHEAD].tz_localize("UTC"), "the last known row has the time zone None, these rows UTC"),
        (ZONES["a"][AHEAD].reset_index(drop=True), "give both or neither."),
        (ZONES["a"][:0], "there are no rows; give those after the known ones."),
    ],
)
def test_rows_that_do_not_follow_are_refused_for_an_estimator_without_update(X, said):
    fleet = ZoneFleet(ARX).fit({"a": ZONES["a"][TRAIN]}).update({"a": ZONES["a"][NEW].assign(q_sol=0.0)})
    ahead = {"a": ZONES["a"][AHEAD].drop(columns="T_za")}
    before = fleet.forecast(None, ahead)
    with pytest.raises(ValueError) as error:
        fleet.update({"a": X})
    assert said in str(error.value)
    pd.testing.assert_frame_equal(fleet.forecast(None, ahead), before, check_exact=True)


def test_a_fallback_takes_over(tmp_path):
    class Failing(HybridPredictor):
        def _read(self, X, *args, **named):
            raise ValueError("too hard")

    with pytest.warns(SkhybridWarning, match="the fallback took over for 3 of them"):
        fleet = ZoneFleet(Failing(), fallback=ARX, store=tmp_path).fit(rows(TRAIN))
    assert fleet.errors_ == dict.fromkeys(ZONES, "too hard")
    expected = ZoneFleet(ARX).fit(rows(TRAIN)).forecast(rows(NEW), future())
    pd.testing.assert_frame_equal(fleet.forecast(rows(NEW), future()), expected, check_exact=True)
    assert fleet.status()["reasons"].str.contains("the fallback forecasts it, because too hard").all()


def test_tables_of_other_libraries_and_stamps_in_a_column_are_those_of_pandas():
    pa = pytest.importorskip("pyarrow")
    expected = ZoneFleet(ARX).fit(rows(TRAIN)).predict(rows(AHEAD))
    by_column = [rows(which).rename_axis("time").reset_index() for which in (TRAIN, AHEAD)]
    pairs = [[(zone, pa.table(X[which])) for zone, X in ZONES.items()] for which in (TRAIN, AHEAD)]
    for train, ahead in (by_column, map(pa.table, by_column), pairs):
        pd.testing.assert_frame_equal(ZoneFleet(ARX).fit(train).predict(ahead), expected, check_names=False)


def test_a_column_that_comes_twice_is_named():
    """The message was one of pandas, of a mismatch of lengths."""
    twice = pd.concat([rows(TRAIN), rows(TRAIN)[["T_oa"]]], axis=1)
    with pytest.raises(ValueError, match="the first a: column 'T_oa' appears twice in X; keep one of them"):
        ZoneFleet(ARX).fit(twice)


@pytest.mark.parametrize(
    ("X", "said"),
    [
        ([("a", ZONES["a"]), ("a", ZONES["a"])], "zone 'a' comes twice; join its rows in one table."),
        (pd.concat([rows(TRAIN).assign(zone=1), rows(TRAIN).assign(zone="1")]), "zone '1' comes twice"),
        (ZONES["a"], "X needs one column 'zone' with the name of each row's zone; it has T_oa, "),
        (rows(TRAIN).assign(zone=None), "column 'zone' names no zone in 504 rows, the first at 2024-01-08"),
        (rows(slice(0, 0)), "there is no zone; give a table with rows."),
        ({"": ZONES["a"]}, "a zone has an empty name; name it, or leave its rows out."),
        ([1], "X holds a int; give tables, or pairs"),
        ("nowhere", "nowhere is not a folder; give a Parquet dataset with one folder per zone, as zone=kitchen."),
    ],
)
def test_what_is_no_fleet_is_refused(X, said):
    with pytest.raises(ValueError) as error:
        ZoneFleet(ARX).fit(X)
    assert said in str(error.value)
    with pytest.raises(ValueError, match="X has 504 rows, but y has the shape"):
        ZoneFleet(ARX).fit(rows(TRAIN), [1.0])


def test_faults_of_a_dataset_cost_their_zones_alone(tmp_path):
    rows(TRAIN).to_parquet(tmp_path, partition_cols=["zone"])
    corrupt = next((tmp_path / "zone=c").glob("*.parquet"))
    corrupt.write_bytes(corrupt.read_bytes()[:-200])
    (tmp_path / "zone=empty").mkdir()
    (tmp_path / "zone=notes.txt").write_text("no folder", encoding="utf-8")
    with pytest.warns(SkhybridWarning, match="2 of 4 zones could not"):
        fleet = ZoneFleet(ARX).fit(tmp_path)
    assert fleet.zones_ == ["a", "b/1"]
    assert fleet.errors_["c"].startswith(f"{corrupt} cannot be read as a Parquet file (")
    assert fleet.errors_["empty"].endswith(
        "zone=empty holds no Parquet file; write the rows of the zone there, or remove the folder."
    )


def test_files_of_a_zone_are_joined_by_their_stamps(tmp_path):
    folder = tmp_path / "zone=a"
    folder.mkdir()
    X = ZONES["a"]
    X[:100].to_parquet(folder / "1.parquet")
    X[90 : TRAIN.stop].to_parquet(folder / "2.parquet")
    pd.testing.assert_frame_equal(read_rows(folder), X[TRAIN], check_freq=False)
    X[:100].set_axis(X.index[:100].where(np.arange(100) != 50), axis=0).to_parquet(folder / "1.parquet")
    assert read_rows(folder).index.isna().sum() == 1  # for the estimator to refuse
    X[:100].reset_index(drop=True).to_parquet(folder / "1.parquet")
    with pytest.raises(ValueError, match=r"1\.parquet has no time stamps, by which the files of a zone are joined"):
        read_rows(folder)


def test_a_zone_without_rows_or_with_a_stamp_twice_is_refused_as_alone():
    twice = ZONES["a"][TRAIN].iloc[[*range(20), 19, *range(20, 100)]]
    with pytest.raises(ValueError) as said:
        clone(ARX).fit(twice, twice["T_za"])
    with pytest.warns(SkhybridWarning, match="2 of 3 zones"):
        fleet = ZoneFleet(ARX).fit({"a": ZONES["a"][TRAIN], "none": ZONES["a"][:0], "twice": twice})
    assert fleet.errors_["twice"] == str(said.value)
    assert fleet.errors_["none"] == "there are no rows; write those of the zone, or leave it out."
    with pytest.raises(ValueError, match="no zone succeeded; zone none: "):
        ZoneFleet(ARX).fit({"none": ZONES["a"][:0]})


def test_each_zone_has_its_own_step_and_clock():
    quarter = make_office(n_days=4, sampling_time="15min", start="2024-01-08", random_state=3).X
    zones = {
        "amsterdam": ZONES["a"].tz_localize("Europe/Amsterdam"),
        "chicago": quarter.tz_localize("America/Chicago"),
    }
    train = {zone: X[: 3 * len(X) // 4] for zone, X in zones.items()}
    later = {zone: X[3 * len(X) // 4 :] for zone, X in zones.items()}
    fleet = ZoneFleet(ARX).fit(train)
    found = fleet.predict(later)
    assert str(found.index.tz) == "UTC"
    for zone in zones:
        model = clone(ARX).fit(train[zone], train[zone]["T_za"])
        np.testing.assert_array_equal(of(found, zone)["T_za"], model.predict(later[zone]))
        assert (of(found, zone).index == later[zone].index).all()
    assert str(fleet.predict({"chicago": later["chicago"]}).index.tz) == "America/Chicago"
    assert str(fleet.backtest({**later}, horizon="6h")["time"].dt.tz) == "UTC"
    mixed = ZoneFleet(ARX).fit({**train, "nowhere": ZONES["c"][TRAIN]})
    found = mixed.predict({**later, "nowhere": ZONES["c"][NEW]})
    assert mixed.errors_ == {"nowhere": "its stamps have no time zone, but those of other zones have one; give it one."}
    assert "nowhere" not in set(found["zone"])
    naive = {name: ZONES[name][NEW] for name in ("a", "c")}
    mixed = ZoneFleet(ARX).fit({**{name: ZONES[name][TRAIN] for name in naive}, "chicago": train["chicago"]})
    assert set(mixed.predict({**naive, "chicago": later["chicago"]})["zone"]) == set(naive)
    assert mixed.errors_["chicago"].startswith("its stamps have a time zone, but those of most zones have none")


def test_a_full_disk_ends_the_work_and_leaves_no_partial_file(monkeypatch, tmp_path):
    real, written = os.fsync, []

    def full(handle):
        written.append(handle)
        if len(written) > 2:  # the files of the first zone are written
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(handle)

    monkeypatch.setattr(_files.os, "fsync", full)
    with pytest.raises(OSError, match="cannot write: No space left on device") as said:
        ZoneFleet(ARX, store=tmp_path).fit(rows(TRAIN))
    assert said.value.filename == str(tmp_path / "b%2F1+0.skops")
    assert {p.name for p in tmp_path.iterdir()} == {"a.skops", "a.npz", "fleet.sqlite"}
    monkeypatch.undo()
    assert ZoneFleet(ARX, store=tmp_path).fit(rows(TRAIN)).zones_ == ["a", "b/1", "c"]


def test_a_store_that_is_a_file_is_refused(tmp_path):
    path = tmp_path / "store"
    path.write_text("x", encoding="utf-8")
    with pytest.raises(ValueError, match="is a file; give a folder"):
        ZoneFleet(ARX, store=path).fit(rows(TRAIN))


@pytest.mark.parametrize("made", [True, False])
@pytest.mark.parametrize("call", ["update", "tick", "predict"])
def test_a_wrong_store_is_refused_and_left_as_it_is(call, made, tmp_path):
    if made:
        (tmp_path / "wrong").mkdir()
    words = "no zone succeeded; .* fit it first" if call == "predict" else "wrong has no models; fit the zones first"
    with pytest.raises(ValueError, match=words):
        getattr(ZoneFleet(ARX, store=tmp_path / "wrong"), call)(rows(NEW))
    assert [path.name for path in tmp_path.rglob("*")] == ["wrong"] * made


def test_two_fleets_on_one_store_are_refused(tmp_path):
    fleet = ZoneFleet(ARX, store=tmp_path).fit(rows(TRAIN))
    with (
        ModelStore(tmp_path).locked(fleet._settings()),
        pytest.raises(BlockingIOError, match="another fleet is at work"),
    ):
        ZoneFleet(ARX, store=tmp_path).update(rows(NEW))
    other = ZoneFleet(ARXRegressor(horizon="6h"), store=tmp_path)
    for call in (lambda: other.fit(rows(TRAIN)), lambda: other.predict(rows(NEW))):
        with pytest.raises(ValueError, match="parameter horizon is '1D' there and '6h' here; give another store"):
            call()


# ----------------------------------------------------------------------------------------------------- kills and deaths
PROGRAM = """
import sys
import pandas as pd
from skhybrid import ARXRegressor
from skhybrid.datasets import make_office
from skhybrid.fleet import ZoneFleet
X = make_office(n_days=10, sampling_time="1h", start="2024-01-08", random_state=0).X[:168]
tables = {f"zone {i}": X + 0.001 * i for i in range(16)}
estimator = ARXRegressor()
"""


def test_a_full_disk_during_an_update_costs_no_zone(monkeypatch, fleet):
    def full(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("skhybrid.fleet.model_store._MOST_ROWS", 10)
    with monkeypatch.context() as disk:
        disk.setattr("skhybrid.fleet.model_store.save_model", full)
        with pytest.raises(OSError, match="No space left"):
            fleet.update(rows(NEW))
    assert fleet.zones_ == list(ZONES)
    assert fleet.update(rows(NEW)).zones_ == list(ZONES)
    assert not fleet.errors_


def test_a_kill_between_the_steps_of_a_save_leaves_a_whole_pair(monkeypatch, tmp_path):
    store, X = ModelStore(tmp_path), ZONES["a"][TRAIN]
    kept = 0
    steps = [("skhybrid.fleet.model_store.save_model", 0), ("skhybrid.fleet.journal.Journal.save", 0)]
    steps += [("pathlib.Path.replace", 1), (None, 1)]  # the second number: whether the new pair is kept
    for n, (step, holds) in enumerate([(None, 1), *steps, *reversed(steps), *2 * steps[2:]], start=1):
        model = ARXRegressor(alpha=float(n)).fit(X, X["T_za"])
        with monkeypatch.context() as kill:
            if step is not None:
                kill.setattr(step, mock.Mock(side_effect=KeyboardInterrupt))
            with nullcontext() if step is None else pytest.raises(KeyboardInterrupt):
                store.save("a", model, Journal({"n": n}))
        kept = n if holds else kept
        found, journal = ModelStore(tmp_path).load("a")
        assert (found.alpha, journal.facts["n"], store.zones()) == (kept, kept, ["a"])


def test_a_store_removes_temporary_files_of_its_own_only(tmp_path):
    """A folder may be one that a user has for other things, too."""
    own = [".a.npz.0a1b2c3d.npz", ".a+1.skops.0a1b2c3d.skops", ".failures.json.0a1b2c3d.json"]
    others = {".env.local", ".a.npz.bak", ".data.npz", ".git.config.old", "a.npz"}
    for name in [*own, *others]:
        (tmp_path / name).touch()
    with ModelStore(tmp_path).locked({}, new=True):
        assert {path.name for path in tmp_path.iterdir()} - others == {"fleet.sqlite"}
    assert {path.name for path in tmp_path.iterdir()} > others


@pytest.mark.slow
def test_a_fleet_that_was_killed_goes_on_and_ends_the_same(tmp_path, monkeypatch):
    store = tmp_path / "store"
    program = PROGRAM + "ZoneFleet(estimator, store=sys.argv[1]).fit(tables)"
    left = os.environ | {"TMPDIR": str(tmp_path)}  # a killed process cannot remove the files of its rows
    process = subprocess.Popen([sys.executable, "-c", program, str(store)], env=left)
    until = time.monotonic() + 120
    while len(list(store.glob("[!.]*.npz"))) < 3 and time.monotonic() < until:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    finished = {file.name: file.stat().st_mtime_ns for file in store.glob("[!.]*.npz")}
    assert 3 <= len(finished) < 16
    names: dict = {}
    exec(PROGRAM, names)
    fitted = []
    monkeypatch.setattr(zone_jobs, "clone", lambda estimator: fitted.append(1) or clone(estimator))
    fleet = ZoneFleet(names["estimator"], store=store).fit(names["tables"])
    assert len(fitted) == 16 - len(finished)
    assert {name: (store / name).stat().st_mtime_ns for name in finished} == finished
    assert not list(store.glob(".*"))
    some = {zone: names["tables"][zone] for zone in ("zone 0", "zone 15")}
    expected = ZoneFleet(names["estimator"]).fit(some).predict(some)
    pd.testing.assert_frame_equal(fleet.predict(some), expected, check_exact=True)


def test_other_rows_or_new_ones_are_fitted_again(tmp_path, monkeypatch):
    fleet = ZoneFleet(ARX, store=tmp_path).fit(rows(TRAIN))
    fitted = []
    monkeypatch.setattr(zone_jobs, "clone", lambda estimator: fitted.append(1) or clone(estimator))
    fleet.fit(rows(TRAIN))
    assert len(fitted) == 0
    changed = rows(TRAIN)
    changed.iloc[3, 0] += 0.1
    fleet.fit(changed)
    assert len(fitted) == 1
    fleet.update(rows(NEW)).fit(changed)  # which is to forget the rows that were taken in
    assert len(fitted) == 4


# -------------------------------------------------------------------------------------------------------------- engines
CLUSTERS = [(clusters.processes, 2), (clusters.dask, None), (clusters.ray, None)]
ENGINES = pytest.mark.parametrize(("engine", "n_jobs"), CLUSTERS)


def test_zones_in_threads_keep_their_own_warnings():
    """``warnings.catch_warnings`` gave those of one to the other, and left its own filters where the two overlap."""
    both = threading.Barrier(2)

    def say(zone):
        both.wait(10)
        warn_user(f"of {zone}", SkhybridWarning)
        both.wait(10)

    filters = list(warnings.filters)
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda zone: dispatch.attempt(zone, say, zone), "ab"))
    assert [outcome.warnings for outcome in found] == [("of a",), ("of b",)]
    assert warnings.filters == filters


@pytest.mark.slow
@ENGINES
def test_a_worker_that_dies_costs_only_its_zone(tmp_path, engine, n_jobs):
    def die_at_b(zone, where):  # in here, so that a worker gets it whole and need not import these tests
        with open(os.path.join(where, zone), "a", encoding="utf-8") as file:
            file.write(".")
        if zone == "b":
            os.kill(os.getpid(), signal.SIGKILL)
        return zone

    calls = {zone: (die_at_b, (zone, str(tmp_path))) for zone in "abc"}
    with engine():
        found = {outcome.zone: outcome for outcome in dispatch.run(calls, n_jobs)}
    assert {zone for zone, outcome in found.items() if outcome.value == zone} == set("ac")
    assert found["b"].error.startswith("the worker died at this zone, twice")
    assert (tmp_path / "b").read_text(encoding="utf-8") == ".."


@pytest.fixture(scope="module")
def sequential():
    fleet = ZoneFleet(ARX).fit(rows(TRAIN))
    return fleet.forecast(rows(NEW), future(), quantiles=(0.1, 0.9))


@pytest.mark.slow
@ENGINES
def test_every_engine_gives_the_same(sequential, tmp_path, engine, n_jobs):
    with engine():
        fleet = ZoneFleet(ARX, store=tmp_path, n_jobs=n_jobs).fit(rows(TRAIN))
        found = fleet.forecast(rows(NEW), future(), quantiles=(0.1, 0.9))
    pd.testing.assert_frame_equal(found, sequential, check_exact=True)


# ------------------------------------------------------------------------------------------------------------- watching
def test_a_tick_takes_in_what_was_measured_and_forecasts_what_was_not(alone, fleet):
    X = rows(slice(0, 9 * DAY))
    X.loc[X.index >= ZONES["a"].index[8 * DAY], "T_za"] = np.nan
    found = fleet.tick(X)
    pd.testing.assert_frame_equal(fleet.tick(X), found, check_exact=True)
    for zone, model in alone.items():
        expected = model.update(ZONES[zone][NEW]).forecast(None, of(future(), zone), quantiles=(0.1, 0.9))
        pd.testing.assert_frame_equal(of(found, zone), expected, check_exact=True, check_freq=False)
    fleet.tick(rows(slice(0, 9 * DAY)))
    journal = ModelStore(fleet.store).journal("b/1")
    measured = ZONES["b/1"]["T_za"][AHEAD]
    error = of(found, "b/1")["T_za"] - measured
    day = journal.facts["days"][-1]
    assert day["day"] == str(measured.index[0].date())
    assert day["rmse"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert day["rule"] == pytest.approx(np.sqrt(np.mean((ZONES["b/1"]["T_za"][NEW].to_numpy() - measured) ** 2)))
    inside = measured.between(of(found, "b/1")["q_0.1"], of(found, "b/1")["q_0.9"]).mean()
    assert day["inside"] == pytest.approx(inside)
    assert [one["day"] for one in journal.facts["days"]] == ["2024-01-15", "2024-01-16"]
    assert journal.facts["days"][0]["n"] == DAY


@pytest.mark.parametrize("clocks", [("Etc/GMT+6", "Etc/GMT+6"), ("Europe/Berlin", "UTC")])
def test_a_tick_joins_rows_of_any_clock(clocks, tmp_path):
    X = ZONES["a"].tz_localize("UTC")
    fleet = ZoneFleet(ARX, store=tmp_path).fit({"a": X[TRAIN].tz_convert(clocks[0])})
    for end in (8, 9):
        fleet.tick({"a": X[: (end + 1) * DAY].assign(T_za=X["T_za"][: end * DAY]).tz_convert(clocks[1])})
    journal = ModelStore(fleet.store).journal("a")
    assert str(journal.rows.index.tz) == str(journal.scored.index.tz) == clocks[0]
    assert (journal.rows.index == X.index[7 * DAY : 9 * DAY]).all()


def test_the_status_tells_which_zone_lacks_the_last_day():
    days = pd.date_range("2024-01-15 23:00", periods=2, freq="1D")
    row = {
        "verdict": "usable",
        "rmse_yesterday": 0.1,
        "rmse_training": 0.1,
        "coverage": 0.8,
        "drift": False,
        "reasons": "",
    }
    found = {zone: ZoneStatus(row | {"last_row": last}, pd.DataFrame()) for zone, last in zip("ab", days, strict=True)}
    table = status_table(found, {}, "zone").set_index("zone")
    assert list(table["verdict"][["a", "b"]]) == ["use with care", "usable"]
    assert table["reasons"]["a"].startswith("its last row is 24 h older than the newest of the fleet")


def test_the_status_has_the_worst_zone_first(fleet, tmp_path):
    assert fleet.status()["rmse_yesterday"].isna().all()
    new = rows(slice(7 * DAY, 10 * DAY))
    shifted = (new["zone"] == "c") & (new.index >= ZONES["c"].index[9 * DAY])
    new.loc[shifted, "T_za"] += 6.0
    late = new[(new["zone"] != "a") | (new.index < ZONES["a"].index[8 * DAY])]
    fleet.update(late)
    found = fleet.status(page=tmp_path / "status.html")
    assert list(found) == [
        "zone",
        "verdict",
        "last_row",
        "rmse_yesterday",
        "rmse_training",
        "coverage",
        "drift",
        "reasons",
    ]
    assert found["zone"].iloc[0] == "c"
    row = found.set_index("zone").loc
    assert row["c"]["rmse_yesterday"] > 2.0 > row["b/1"]["rmse_yesterday"]
    assert row["c"]["coverage"] < row["b/1"]["coverage"]
    assert row["a"]["last_row"] == ZONES["a"].index[8 * DAY - 1]
    assert row["a"]["reasons"].startswith("its last row is 2 days older than the newest of the fleet; ")
    assert (found["rmse_training"] > 0.0).all()
    page = (tmp_path / "status.html").read_text(encoding="utf-8")
    assert page.index("<b>c</b>") < page.index("<b>b/1</b>")
    assert page.count("<svg") == 3
    assert "nan" not in page


# ------------------------------------------------------------------------------------------------------------- commands
CONFIG = """key = "zone"
days = 6
[estimator]
network = "1R1C"
known = {Q_h = 6.0, Q_c = -6.0}
"""


def put(data, which, name):
    for zone, X in list(ZONES.items())[:2]:
        folder = data / f"zone={zone.replace('/', '%2F')}"
        folder.mkdir(parents=True, exist_ok=True)
        X[which].to_parquet(folder / f"{name}.parquet")


def test_a_folder_of_a_fleet_works_from_day_to_day(tmp_path, capsys):
    folder = tmp_path / "houses"
    assert main(["fleet", "fit", str(folder)]) == 1
    assert "has no folder data; put a Parquet dataset there" in capsys.readouterr().err
    put(folder / "data", TRAIN, "first")
    (folder / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    assert main(["fleet", "fit", str(folder)]) == 0
    assert "zones: 2\nfailed: 0\n" in capsys.readouterr().out
    put(folder / "data", NEW, "second")
    plans = ZONES["a"][NEW].assign(T_za=np.nan, T_oa=99.0)
    plans.to_parquet(folder / "data" / "zone=a" / "planned.parquet")  # the measured rows, in "second", replace them
    ahead = folder / "data" / "zone=a" / "third.parquet"
    ZONES["a"][AHEAD].assign(T_za=np.nan).to_parquet(ahead)
    assert main(["fleet", "tick", str(folder), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.pop("warnings")["b/1"][0].startswith("there is no forecast, since no rows follow 2024-01-15 23:00:00")
    assert found == {"forecast zones": 1, "rows": 24, "failed": 0, "with warnings": 1, "errors": {}}
    X = ZONES["a"]
    model = clone(HYBRID).fit(X[DAY : 7 * DAY], X["T_za"][DAY : 7 * DAY]).update(X[NEW])
    expected = model.forecast(None, X[AHEAD].drop(columns="T_za"), quantiles=(0.1, 0.9))
    written = of(pd.read_parquet(folder / "forecast.parquet"), "a")
    pd.testing.assert_frame_equal(written, expected, check_exact=True, check_freq=False)
    assert main(["fleet", "status", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert "2024-01-15 23:00:00" in shown
    assert (folder / "status.html").exists()


@pytest.mark.parametrize("inside", ["data", "data/room=a", "data/zone="])
def test_a_folder_without_zones_is_left_as_it_is(tmp_path, capsys, inside):
    (tmp_path / inside).mkdir(parents=True)
    before = sorted(tmp_path.rglob("*"))
    assert main(["fleet", "fit", str(tmp_path)]) == 1
    assert "data has no folder zone=...; give a Parquet dataset partitioned by 'zone'" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


def test_columns_with_names_of_their_own_are_named_in_the_configuration(tmp_path, capsys):
    rows = ZONES["a"][TRAIN].rename(columns={"T_za": "room"})
    folder = tmp_path / "data" / "zone=a"
    folder.mkdir(parents=True)
    rows.to_parquet(folder / "first.parquet")
    (tmp_path / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    assert main(["fleet", "fit", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "the rows have no column 'T_za', the measured temperature, among " in said
    assert "'room'" in said
    assert "columns={'T_za': ...}" in said
    (tmp_path / "fleet.toml").write_text(f'{CONFIG}\ncolumns = {{T_za = "room"}}\n', encoding="utf-8")
    assert main(["fleet", "fit", str(tmp_path)]) == 0


def test_a_zone_that_could_not_be_fitted_stays_in_the_status(tmp_path, capsys):
    """Each command is a process of its own: why a zone failed is kept in the store."""
    folder = tmp_path / "houses"
    put(folder / "data", TRAIN, "first")
    bad = folder / "data" / "zone=bad"
    bad.mkdir()
    (bad / "first.parquet").write_bytes(b"PAR1 cut off")
    (folder / "fleet.toml").write_text(CONFIG, encoding="utf-8")
    FleetFolder(folder).fit()
    table = FleetFolder(folder).status().set_index("zone")
    assert table.index[0] == "bad"
    assert table.loc["bad", "verdict"] == "not usable"
    assert "cannot be read" in table.loc["bad", "reasons"]
    assert "bad" in (folder / "status.html").read_text(encoding="utf-8")
    bad.joinpath("first.parquet").unlink()
    ZONES["a"][TRAIN].to_parquet(bad / "first.parquet")
    FleetFolder(folder).fit()
    assert "bad" in set(FleetFolder(folder).status()["zone"])
    assert "failed" not in FleetFolder(folder).status().set_index("zone").loc["bad", "reasons"]
    new = folder / "data" / "zone=new"
    new.mkdir()
    ZONES["a"][TRAIN].to_parquet(new / "first.parquet")
    row = FleetFolder(folder).status().set_index("zone").loc["new"]
    assert row["verdict"] == "not usable"
    assert row["reasons"] == "the store has no model of it; fit it first."


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("days = [1", "fleet.toml cannot be read ("),
        ("zones = 3", "fleet.toml: unknown key 'zones'; "),
        ("[estimator]\nnetwork = '1R1C'\nepochs = 3", "fleet.toml: unknown key 'epochs' in [estimator]; "),
        ("days = true", "days = True in "),
        ("days = inf", "days = inf in "),
        ("days = -3", "is not a number up to 36500; correct it."),
        ("key = ''", "is not a name in quotes; correct it."),
        ("estimator = 3", "must be a table; write its parameters below [estimator]."),
    ],
)
def test_a_configuration_that_cannot_be_used_is_refused(text, said, tmp_path):
    (tmp_path / "fleet.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError) as error:
        FleetFolder(tmp_path).read()
    assert said in str(error.value)
    (tmp_path / "fleet.toml").write_text(EXAMPLE, encoding="utf-8")
    fleet, days = FleetFolder(tmp_path).read()
    assert (fleet.key, days, fleet.estimator.horizon) == ("zone", pd.Timedelta(days=TRAINING_DAYS), "1D")
    with pytest.raises(FileNotFoundError, match="holds no fleet; make it with skhybrid fleet fit"):
        FleetFolder(tmp_path / "nowhere").tick()
