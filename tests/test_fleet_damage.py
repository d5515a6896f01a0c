"""Files of a fleet that were damaged, removed or written by others."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pandas as pd
import pytest

from skhybrid import ARXRegressor
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.fleet import ZoneFleet

DAY = 24
ZONES = {
    name: make_office(n_days=9, sampling_time="1h", start="2024-01-08", random_state=seed).X
    for seed, name in enumerate("abc")
}
TRAINING = {zone: X[: 7 * DAY] for zone, X in ZONES.items()}


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


def test_the_status_lists_zones_also_where_no_model_can_be_read(fleet):
    for zone in ZONES:
        (Path(fleet.store_) / f"{zone}.skops").write_bytes(b"half")
    found = fleet.status()
    assert found["verdict"].tolist() == ["not usable"] * 3
    assert found["reasons"].str.contains("is not a skhybrid model file").all()


@pytest.mark.parametrize("text", ["", "[1]", "3"])
def test_a_damaged_list_of_failures_stops_no_zone(text, fleet):
    before = fleet.predict(ZONES)
    (Path(fleet.store_) / "failures.json").write_text(text)
    with pytest.warns(SkhybridWarning, match=r"failures\.json cannot be read, so why zones could not be fitted"):
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
