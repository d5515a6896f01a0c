"""Files of a fleet that were damaged, removed or written by others, and rows that a zone must not take in."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skhybrid import ARXRegressor
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.fleet import ZoneFleet
from skhybrid.fleet.journal import Journal
from skhybrid.fleet.zone_rows import read_rows
from skhybrid.persistence import model_file, save_model

pytestmark = pytest.mark.usefixtures("quick_fits")

DAY = 24
ZONES = {
    name: make_office(n_days=9, sampling_time="1h", start="2024-01-08", random_state=seed).X
    for seed, name in enumerate("abc")
}
TRAINING = {zone: X[: 7 * DAY] for zone, X in ZONES.items()}
ZONE = ZONES["a"]


@pytest.fixture
def fleet(tmp_path):
    return ZoneFleet(ARXRegressor(), store=tmp_path / "store").fit(TRAINING)


@pytest.mark.parametrize("damage", [lambda file: file.write_bytes(b"half"), lambda file: file.unlink()])
def test_a_fit_replaces_a_model_file_that_cannot_be_read(damage, fleet):
    before = fleet.predict(ZONES)
    damage(Path(fleet.store_) / "a.skops")
    assert fleet.predict(ZONES)["zone"].unique().tolist() == ["b", "c"]
    assert set(fleet.errors_) == {"a"}
    fleet.fit(TRAINING)
    pd.testing.assert_frame_equal(fleet.predict(ZONES), before, check_exact=True)


def test_a_prior_does_without_a_zone_whose_file_is_damaged(fleet):
    (Path(fleet.store_) / "b.skops").write_bytes(b"half")
    with pytest.warns(SkhybridWarning, match="left out: 'b', of which a file in .*store is damaged; fit again"):
        assert fleet.prior().n_zones == 2


def test_a_prior_reads_each_file_once(fleet, monkeypatch):
    opened = []

    def noted(read):
        return lambda path: opened.append(Path(path).name) or read(path)

    monkeypatch.setattr(model_file, "_read", noted(model_file._read))
    monkeypatch.setattr(Journal, "load", noted(Journal.load))
    assert fleet.prior({"a": 3.0, "c": 5.0}).n_zones == 2
    assert opened == ["a.npz", "a.skops", "c.npz", "c.skops"]


def test_the_status_lists_zones_also_where_no_model_can_be_read(fleet):
    for zone in ZONES:
        (Path(fleet.store_) / f"{zone}.skops").write_bytes(b"half")
    found = fleet.status()
    assert found["verdict"].tolist() == ["not usable"] * 3
    assert found["reasons"].str.contains("is not a skhybrid model file").all()


def test_a_fit_that_goes_on_builds_no_model(fleet, monkeypatch):
    """The checksum says whether a file is whole; a model took 8 to 17 ms."""
    monkeypatch.setattr("skhybrid.fleet.model_store.load_model", lambda path: pytest.fail(f"{path} was loaded"))
    monkeypatch.setattr(ARXRegressor, "fit", lambda *_: pytest.fail("a zone was fitted again"))
    assert fleet.fit(TRAINING).zones_ == list(ZONES)


def test_a_file_of_another_program_is_no_zone(fleet, tmp_path):
    store = Path(fleet.store_)
    np.savez(store / "weather.npz", T_oa=np.zeros(3))
    (store / "notes.npz").write_text("of mine", encoding="utf-8")
    save_model(ARXRegressor().fit(ZONE, ZONE["T_za"]), store / "alone.skops")
    (store / "c.skops").unlink()  # a zone without its model is one
    assert fleet.zones_ == list(ZONES)
    assert fleet.status()["zone"].tolist() == ["c", "a", "b"]


@pytest.mark.parametrize("key", ["verdict", "reasons", "last_row"])
def test_a_key_that_the_status_has_as_a_column_is_refused(key, tmp_path):
    fleet = ZoneFleet(ARXRegressor(), key, store=tmp_path / "new")
    with pytest.raises(ValueError, match=f"key='{key}' is a column of the status itself; give the fleet another key"):
        fleet.fit(pd.concat([X.assign(**{key: zone}) for zone, X in TRAINING.items()]))
    assert not (tmp_path / "new").exists()
    with pytest.raises(ValueError, match=f"key='{key}'"):
        fleet.status()


@pytest.mark.parametrize("text", ["", "[1]", "3"])
def test_a_damaged_list_of_failures_stops_no_zone(text, fleet):
    before = fleet.predict(ZONES)
    (Path(fleet.store_) / "failures.json").write_text(text, encoding="utf-8")
    with pytest.warns(
        SkhybridWarning, match=r"failures\.json cannot be read, so why a fit of zones failed is unknown; fit again"
    ):
        pd.testing.assert_frame_equal(fleet.predict(ZONES), before, check_exact=True)


@pytest.mark.parametrize("damage", [lambda file: file.write_bytes(b""), lambda file: file.unlink()])
def test_models_without_the_settings_that_they_were_made_with_are_refused(damage, fleet):
    damage(Path(fleet.store_) / "fleet.sqlite")
    other = ZoneFleet(ARXRegressor(n_lags=3), store=fleet.store_)
    for call in (other.fit, other.tick, other.predict):
        with pytest.raises(
            ValueError, match=r"has models, but fleet\.sqlite, which tells what they were made with, is"
        ):
            call(TRAINING)


def test_a_database_of_another_program_is_refused_and_left_as_it_is(tmp_path):
    path = tmp_path / "fleet.sqlite"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE note (text)")
    before = path.read_bytes()
    fleet = ZoneFleet(ARXRegressor(), store=tmp_path)
    for call in (fleet.fit, fleet.predict):
        with pytest.raises(OSError, match=r"fleet\.sqlite is a database of another program, with a table 'note'; "):
            call(TRAINING)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ([0, *range(22, 0, -1), 23], "the index goes back in time"),
        ([0, 1, *range(1, 24)], "the index has duplicates"),
        (range(0, 24, 2), "X has a sampling time of 2 h"),
    ],
)
def test_rows_that_nothing_could_follow_are_not_taken_in_where_a_forecast_covers_them(order, said, fleet):
    """An ARX model takes in rows without reading them; its zone could not be forecast any more."""
    new = ZONE[7 * DAY : 8 * DAY]
    fleet.tick({"a": pd.concat([TRAINING["a"], new.assign(T_za=np.nan)])})
    with pytest.raises(ValueError, match=said):
        fleet.update({"a": new.iloc[list(order)]})
    fleet.update({"a": new})
    assert len(fleet.forecast(None, {"a": ZONE[8 * DAY : 9 * DAY].drop(columns="T_za")})) == DAY


def test_hidden_folders_of_a_dataset_are_no_rows(tmp_path):
    ZONE.to_parquet(tmp_path / "rows.parquet")
    for name in ("_temporary", ".ipynb_checkpoints"):
        (tmp_path / name / "0").mkdir(parents=True)
        (tmp_path / name / "0" / "rows.parquet").write_bytes(b"half")
    pd.testing.assert_frame_equal(read_rows(tmp_path), ZONE, check_freq=False)
