"""A zone folder over HTTP: every route, what is refused, who is let in, and the page in a browser."""

from __future__ import annotations

import asyncio
import base64
import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time
import tomllib
from html import escape
from html.parser import HTMLParser
from pathlib import Path

import httpx
import numpy as np
import pandas as pd
import pytest
from fastapi.testclient import TestClient

from skhybrid._warnings import warn_user, warnings_to
from skhybrid.cli import main
from skhybrid.exceptions import SkhybridWarning
from skhybrid.server.app import make_app
from skhybrid.server.listen import check_token, is_loopback
from skhybrid.study import propose_settings
from skhybrid.study.settings import Settings
from skhybrid.zone import DayAhead, ZoneFolder, posted_rows, zone_folder
from skhybrid.zone.forecast_archive import EVEN, POSTED, open_archive
from skhybrid.zone.posted_rows import read_posted

pytestmark = [
    pytest.mark.filterwarnings("ignore::skhybrid.exceptions.ExcitationWarning"),  # few days of heat
    pytest.mark.usefixtures("quick_fits"),
]
DAYS = 10  # of the log that the zone has learned from
SCHEDULE = "20,25"
TOKEN = "0123456789abcdef-token"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def log(hourly_office):
    return hourly_office.iloc[: 24 * 20]


def until(log, day):
    """The log up to the end of a day, with the weather of the day after it."""
    rows = log.iloc[: 24 * (day + 1)].copy()
    rows.loc[rows.index[24 * day] :, rows.columns.difference(["T_oa", "q_sol"])] = np.nan
    return rows


def _like_the_day_before(zone, log, weather=None, schedule=None):
    """A forecast that costs nothing."""
    now = log.history.iloc[-1]
    index = pd.date_range(now.name, periods=25, freq="1h")[1:]
    wave = np.sin(np.arange(24) / 4)
    found = {"T_za": now["T_za"] + wave, "q_0.1": now["T_za"] + wave - 1, "q_0.9": now["T_za"] + wave + 1}
    return DayAhead(pd.DataFrame({**found, "Q_hvac": 1 + wave}, index), {}, ())


@pytest.fixture
def cheap(monkeypatch):
    monkeypatch.setattr(zone_folder, "forecast_day", _like_the_day_before)


@pytest.fixture(scope="module")
def made(log, tmp_path_factory):
    """A zone from eight days of log with forecasts of three days, the last of which is real."""
    place = tmp_path_factory.mktemp("made")
    folder = place / "kitchen"
    until(log, DAYS - 2).to_csv(place / "log.csv")
    config = place / "zone.toml"
    config.write_text(
        propose_settings(place / "log.csv").replace('name = "log"', 'name = "kitchen <b>&"'), encoding="utf-8"
    )
    zone = ZoneFolder.init(folder, place / "log.csv", config)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zone_folder, "forecast_day", _like_the_day_before)
        for day in (DAYS - 2, DAYS - 1):
            until(log, day).to_csv(place / "log.csv")
            zone.tick(place / "log.csv")
    until(log, DAYS).to_csv(place / "log.csv")
    zone.tick(place / "log.csv", schedule=SCHEDULE)
    return folder


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path / "kitchen")
    return tmp_path / "kitchen"


def client_of(folder, **given):
    return TestClient(make_app(folder, **given), base_url="http://127.0.0.1:8765", raise_server_exceptions=False)


@pytest.fixture
def client(folder, cheap):
    return client_of(folder)


def as_json(rows):
    """Rows as a program posts them."""
    plain = rows.astype(object).where(rows.notna(), None).to_dict("records")
    return [{"time": stamp.isoformat(), **row} for stamp, row in zip(rows.index, plain, strict=True)]


# ------------------------------------------------------------------------------------------------------------- reading
def test_the_forecast_has_stamps_with_offsets_intervals_and_units(made, log):
    found = client_of(made).get("/forecast").json()
    rows = pd.DataFrame(found["rows"])
    origin = log.index[24 * DAYS - 1]
    assert found["origin"] == origin.isoformat() == "2018-09-26T23:00:00-06:00"
    assert list(rows["time"]) == [(origin + pd.Timedelta(hours=h)).isoformat() for h in range(1, 25)]
    assert (rows["T_za_low"] <= rows["T_za"]).all()
    assert (rows["T_za"] <= rows["T_za_high"]).all()
    assert (rows["Q_hvac_low"] <= rows["Q_hvac_high"]).all()
    assert found["units"]["T_za_high"] == "degC"
    assert found["units"]["Q_hvac"] == "kW"
    assert (found["name"], found["step_minutes"], found["interval"], found["scaled"]) == ("kitchen <b>&", 60, 0.8, True)
    with open_archive(made / "archive.sqlite") as archive:
        np.testing.assert_allclose(rows["T_za"], archive.latest()["T_za"], atol=1e-4)


def test_the_status_is_that_of_the_command(made, capsys):
    found = client_of(made).get("/status").json()
    assert main(["zone", "status", str(made), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {key: found[key] for key in ("name", "last row", "last forecast from", "learned until")} == {
        key: told[key] for key in ("name", "last row", "last forecast from", "learned until")
    }
    assert found["verdicts"] == told["verdicts"]
    assert [one["quantity"] for one in found["verdicts"]] == ["temperature", "load"]
    assert found["last four weeks"]["forecasts"] == told["last four weeks"]["forecasts"] == 2
    assert found["last four weeks"]["temperature [K]"] == told["last four weeks"]["temperature [K]"]


def test_the_status_has_the_errors_of_stages(made, monkeypatch):
    told, stage = ZoneFolder(made).status(), {"rmse": 0.1, "bias": 0.0, "coverage": None}
    told["last four weeks"]["u_heat [-]"] = stage
    monkeypatch.setattr(ZoneFolder, "status", lambda _: told)
    assert client_of(made).get("/status").json()["last four weeks"]["u_heat [-]"] == stage


def test_the_page_loads_the_model_once_and_opens_the_archive_once(made, monkeypatch):
    loaded, load, opened = [], ZoneFolder.load, []
    monkeypatch.setattr(ZoneFolder, "load", lambda self: loaded.append(self) or load(self))
    monkeypatch.setattr(sqlite3, "connect", lambda *a, c=sqlite3.connect, **k: opened.append(a) or c(*a, **k))
    client = client_of(made)
    assert client.get("/").status_code == client.get("/").status_code == 200
    assert (len(loaded), len(opened)) == (1, 1)


def test_openapi_tells_units_and_the_docs_page_needs_nothing_from_elsewhere(made):
    client = client_of(made)
    described = client.get("/openapi.json").json()
    assert set(described["paths"]) == {"/rows", "/forecast", "/status"}
    schemas = described["components"]["schemas"]
    assert "[degC]" in schemas["ForecastRow"]["properties"]["T_za_low"]["description"]
    assert "[kW]" in schemas["ForecastRow"]["properties"]["Q_hvac"]["description"]
    assert schemas["Row"]["required"] == ["time"]
    assert set(described["paths"]["/rows"]["post"]["requestBody"]["content"]) == {"application/json", "text/csv"}
    page = client.get("/docs").text
    for part in ("POST /rows", "T_za_low", "<script", "http://", "https://"):
        assert (part in page) == (part in ("POST /rows", "T_za_low"))


class _Tags(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.addresses = [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "action")]


def test_the_page_shows_forecast_past_and_verdict_and_is_safe(made):
    answer = client_of(made).get("/")
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "script" not in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    text = answer.text
    assert "kitchen &lt;b&gt;&amp;" in text
    assert "<b>&" not in text
    for part in (
        "Temperature: ",
        "Load: ",
        "The day to come",
        "Forecast from Thursday 27 September 2018, 00:00",
        "is over, from Wednesday 26 September 2018, 00:00",
        "Forecast and measured",
        "80 % interval",
        "more than a day old",
    ):
        assert part in text
    read = _Tags()
    read.feed(text)
    assert read.tags.count("svg") == 6  # three figures in two widths
    assert not {"script", "link", "iframe", "form", "img"} & set(read.tags)
    assert set(read.addresses) == {"/forecast", "/status", "/docs"}
    identifiers = [part.split('"')[0] for part in text.split(' id="')[1:]]
    assert len(identifiers) == len(set(identifiers))


def test_the_page_shows_the_energy_of_the_forecast_with_its_interval(made):
    with open_archive(ZoneFolder(made).archive) as archive:
        known = archive.latest_energy()
        forecast = archive.latest()
    (one,) = [one for one in known if one.interval is not None]
    low, high = one.interval
    assert low < one.value < high
    sums = {"heating": forecast["Q_hvac"].clip(lower=0.0).sum(), "cooling": -forecast["Q_hvac"].clip(upper=0.0).sum()}
    assert one.value == pytest.approx(sums[one.kind])
    said = f"{one.kind} needed in that time; 80 % interval {low:.0f} to {high:.0f} kWh"
    assert f"<b>{one.value:.0f}\u00a0kWh</b><span>{said}</span>" in client_of(made).get("/").text


# ------------------------------------------------------------------------------------------------------------- posting
def test_a_refusal_names_keys_of_the_configuration(log, client):
    rows = until(log, DAYS + 1)[24 * DAYS : 24 * DAYS + 3]
    answer = client.post("/rows", json=as_json(rows.assign(T_za=1.8 * rows["T_za"] + 32.0)))
    assert answer.status_code == 422
    assert "give its unit under [units] of the configuration" in answer.json()["detail"]
    assert "skhybrid.preprocessing" not in answer.json()["detail"]


def test_posted_rows_do_what_a_tick_does(log, folder, cheap, tmp_path):
    shutil.copytree(folder, tmp_path / "ticked")
    ticked, posted = ZoneFolder(tmp_path / "ticked"), ZoneFolder(folder)
    rows = until(log, DAYS + 1)
    rows.to_csv(tmp_path / "log.csv")
    ticked.tick(tmp_path / "log.csv")
    client = client_of(folder)
    first = client.post("/rows", json=as_json(rows.iloc[24 * DAYS : 24 * DAYS + 5])).json()
    assert (first["rows"], first["new_steps"]) == (5, 5)
    assert first["forecast_from"] == rows.index[24 * DAYS + 4].isoformat()
    alone = client.post("/rows", json=as_json(rows.iloc[24 * DAYS + 5 : 24 * DAYS + 6])).json()
    assert alone["new_steps"] == 1
    again = client.post("/rows", json=as_json(rows.iloc[24 * DAYS : 24 * DAYS + 6])).json()
    assert (again["new_steps"], again["forecast_from"]) == (0, None)
    rest = rows.iloc[24 * DAYS + 6 :].to_csv()  # with the weather ahead
    answer = client.post("/rows", content=rest, headers={"Content-Type": "text/csv; charset=utf-8"})
    assert answer.status_code == 200
    assert (answer.json()["rows"], answer.json()["new_steps"]) == (42, 18)
    with open_archive(ticked.archive) as one, open_archive(posted.archive) as other:
        pd.testing.assert_frame_equal(one.latest(), other.latest())
        since = pd.Timestamp(0)
        pd.testing.assert_frame_equal(one.measured(since), other.measured(since))
        pd.testing.assert_frame_equal(one.log(EVEN), other.log(EVEN))
    assert posted.load().known_until == ticked.load().known_until == rows.index[24 * (DAYS + 1) - 1]


@pytest.mark.parametrize("kind", ["a tick", "an old row"])
def test_rows_of_the_log_between_posted_ones_stay(kind, log, client, folder, tmp_path):
    """No line between two posted rows replaces what the log has there."""
    first = 24 * DAYS + 8
    given = until(log, DAYS + 1).iloc[: first + 3]
    if kind == "a tick":
        client.post("/rows", json=as_json(log.iloc[24 * DAYS : first]))
    given.to_csv(tmp_path / "log.csv")
    ZoneFolder(folder).tick(tmp_path / "log.csv")
    if kind == "an old row":
        client.post("/rows", json=as_json(log.iloc[first - 1 : first]))
    assert client.post("/rows", json=as_json(log.iloc[first + 3 : first + 5])).json()["new_steps"] == 2
    with open_archive(folder / "archive.sqlite") as archive:
        kept = archive.log(EVEN)
    np.testing.assert_allclose(kept[list(log)].iloc[-10:], log.iloc[first - 5 : first + 5], atol=1e-9)
    assert kept.index[-1] == log.index[first + 4]


def test_a_post_puts_its_rows_on_even_steps_once(log, client, monkeypatch):
    """Also to bridge its gaps; the weather ahead is put there by itself."""
    measured = []

    def counted(frame, *given, made=posted_rows.on_even_steps):
        measured.append("T_za" in frame and frame["T_za"].notna().any())
        return made(frame, *given)

    monkeypatch.setattr(posted_rows, "on_even_steps", counted)
    rows = log.iloc[24 * DAYS : 24 * DAYS + 5].drop(log.index[24 * DAYS + 2])
    assert client.post("/rows", json=as_json(rows)).json()["new_steps"] == 5
    assert sum(measured) == 1


def test_rows_that_a_kill_left_in_the_model_alone_are_forecast_from(log, client, folder):
    """The model is saved before the archive keeps the rows."""
    before = (folder / "archive.sqlite").read_bytes()
    rows = as_json(log.iloc[24 * DAYS : 24 * DAYS + 3])
    first = client.post("/rows", json=rows).json()
    (folder / "archive.sqlite").write_bytes(before)
    again = client.post("/rows", json=rows).json()
    assert again["forecast_from"] == first["forecast_from"] == log.index[24 * DAYS + 2].isoformat()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stamps", "remarks"),
    [
        (["2024-10-27T02:30:00"], ["2024-10-27 02:30:00 comes twice in Europe/Amsterdam and is read as summer time"]),
        (["2024-10-27T02:30:00", "2024-10-27T02:30:00"], []),
        (["2024-10-27T02:30:00+01:00"], []),
        (["2024-10-27T03:30:00"], []),
    ],
)
def test_a_row_alone_in_the_hour_that_comes_twice_is_named(stamps, remarks, tmp_path):
    """Rows that were posted one by one were both of summer time, and the second replaced the first in silence."""
    path, said = tmp_path / "rows.csv", []
    path.write_text("time,T_za,T_oa\n" + "".join(f"{stamp},20,5\n" for stamp in stamps), encoding="utf-8")
    settings = Settings(columns={"T_za": "T_za", "T_oa": "T_oa"}, timezone="Europe/Amsterdam")
    with warnings_to(said.append):
        assert len(read_posted(path, settings, [], plain=True)[0]) == len(stamps)
    assert [str(text).partition(";")[0] for text in said] == remarks


def test_rows_finer_than_the_step_count_when_it_is_whole(log, client, folder):
    fine = log.iloc[24 * DAYS : 24 * DAYS + 30].resample("10min").interpolate()
    day = client.post("/rows", json=as_json(fine.iloc[: 24 * 6])).json()
    assert day["new_steps"] == 24
    taken = [client.post("/rows", json=as_json(fine.iloc[i : i + 1])).json()["new_steps"] for i in range(144, 156)]
    assert taken == [0, 0, 0, 0, 0, 1] * 2
    with open_archive(folder / "archive.sqlite") as archive:
        hour, kept = archive.log(EVEN), archive.log(POSTED)
    for first in (72, 150):  # noon of the first day, and the last hour
        assert hour.loc[fine.index[first], "q_sol"] == pytest.approx(fine["q_sol"].iloc[first : first + 6].mean())
        assert hour.loc[fine.index[first], "T_za"] == fine["T_za"].iloc[first]
    assert kept.index[-1] - kept.index[0] <= pd.Timedelta(hours=26)  # the rest is kept at the step


@pytest.mark.slow
@pytest.mark.parametrize(("step", "taken"), [("15min", [0, 0, 0, 1] * 2), ("1h", [0, 2, 1])])
def test_rows_that_come_one_by_one_count_once_their_step_is_known(step, taken, log, client, folder):
    """The first of them alone may be a whole hour or a part of it."""
    rows = log.iloc[24 * DAYS :].resample(step).interpolate().iloc[: len(taken)]
    assert [
        client.post("/rows", json=as_json(rows.iloc[i : i + 1])).json()["new_steps"] for i in range(len(rows))
    ] == taken
    with open_archive(folder / "archive.sqlite") as archive:
        first = archive.log(EVEN).loc[rows.index[0]]
    assert first["q_sol"] == pytest.approx(rows["q_sol"].loc[: rows.index[0] + pd.Timedelta("59min")].mean())


def test_remarks_are_those_of_the_rows_and_not_of_another_request(log, client, monkeypatch):
    """A page that is read while rows are taken in may warn, too."""
    post = ZoneFolder.post

    def with_warnings(*given, **named):
        reader = threading.Thread(target=warn_user, args=("of a page", SkhybridWarning))
        warn_user("of these rows", SkhybridWarning)
        reader.start()
        reader.join()
        warn_user("of these rows", SkhybridWarning)
        return post(*given, **named)

    monkeypatch.setattr(ZoneFolder, "post", with_warnings)
    with pytest.warns(SkhybridWarning, match="of a page"):
        found = client.post("/rows", json=as_json(log.iloc[24 * DAYS : 24 * DAYS + 3])).json()
    assert found["remarks"].count("of these rows") == 1
    assert "of a page" not in found["remarks"]


def test_a_column_that_the_configuration_loses_is_not_learned_from_again(log, client, folder):
    """The new model needed the sun of the kept log, which nobody posts any more."""
    lines = (folder / "zone.toml").read_text(encoding="utf-8").splitlines()
    (folder / "zone.toml").write_text(
        "\n".join(line for line in lines if not line.startswith("q_sol")), encoding="utf-8"
    )
    rows = log.iloc[24 * DAYS : 24 * DAYS + 4].drop(columns="q_sol")
    first = client.post("/rows", json=as_json(rows.iloc[:2])).json()
    assert (first["new_steps"], first["fitted_again_because"]) == (2, "zone.toml has changed")
    assert client.post("/rows", json=as_json(rows.iloc[2:])).json()["new_steps"] == 2


def test_rows_without_weather_to_come_are_kept_and_the_answer_says_so(log, folder):
    client = client_of(folder, schedule=SCHEDULE)
    found = client.post("/rows", json=as_json(log.iloc[24 * DAYS : 24 * DAYS + 3])).json()
    assert (found["new_steps"], found["forecast_from"]) == (3, None)
    assert any("there is no new forecast: the weather" in text for text in found["remarks"])
    ahead = log.iloc[24 * DAYS + 3 : 24 * DAYS + 30].assign(
        T_za=np.nan, Q_hvac=np.nan, T_heat_set=np.nan, T_cool_set=np.nan
    )
    found = client.post("/rows", json=as_json(ahead)).json()
    assert found["new_steps"] == 0
    assert found["forecast_from"] == log.index[24 * DAYS + 2].isoformat()
    assert client.get("/forecast").json()["origin"] == found["forecast_from"]
    assert not any("--setpoint" in text for text in found["remarks"])
    night = client.post("/rows", json=as_json(ahead.assign(T_heat_set=15.0, Q_hvac=0.0))).json()
    assert "'Q_hvac', 'T_heat_set' of the rows ahead are not used, since --setpoint is given" in night["remarks"]


def test_rows_without_an_input_are_named_in_the_answer(log, client):
    rows = log.iloc[24 * DAYS : 24 * DAYS + 2].assign(Q_hvac=np.nan)
    found = client.post("/rows", json=as_json(rows)).json()
    assert found["new_steps"] == 0
    assert any(f"no values of 'Q_hvac' since {rows.index[0]}" in text for text in found["remarks"])


def test_rows_of_one_stamp_are_one_row_and_unknown_columns_are_named(log, client, folder):
    row, later = as_json(log.iloc[24 * DAYS : 24 * DAYS + 2])
    parts = [{"time": row["time"], name: row[name]} for name in row if name != "time"]
    found = client.post("/rows", json=[*parts, {**later, "T_zaa": 20.0}]).json()
    assert "the posted 'T_zaa' was not read; the columns are those of zone.toml." in found["remarks"]
    with open_archive(folder / "archive.sqlite") as archive:
        kept = archive.log(POSTED).loc[log.index[24 * DAYS]]
    assert kept["T_za"] == pytest.approx(row["T_za"], rel=1e-14)
    assert kept["q_sol"] == pytest.approx(row["q_sol"], rel=1e-14)


def test_a_code_for_no_value_is_named_in_the_answer(log, client):
    found = client.post("/rows", json=as_json(log.iloc[24 * DAYS : 24 * DAYS + 2].assign(T_za=[-9999.0, 20.0]))).json()
    assert "posted T_za: 1 value such as -9999 taken as missing." in found["remarks"]


BAD = {
    "not JSON": (b"{", "application/json", 422, "the rows cannot be read: the body: invalid JSON"),
    "no list": (b'{"time": "2018-09-27T00:00:00-06:00"}', "application/json", 422, "input should be a valid array"),
    "no rows": (b"[]", "application/json", 422, "at least 1 item"),
    "no stamp": (b'[{"T_za": 20}]', "application/json", 422, "time of 0: field required"),
    "text for a number": (b'[{"time": "2018-09-27", "T_za": "off"}]', "application/json", 422, "T_za of 0: .*number"),
    "true for a number": (b'[{"time": "2018-09-27", "T_za": true}]', "application/json", 422, "T_za of 0: .* a number"),
    "a stamp alone": (b'[{"time": "2018-09-27"}]', "application/json", 422, "^no posted row has a value"),
    "a word for true": (b'[{"time": "2018-09-27", "T_za": true}]', "application/json", 422, "T_za of 0: true or false"),
    "one line": (b"time,T_za", "text/csv", 422, "^the body has one line only"),
    "not finite": (b'[{"time": "2018-09-27", "T_za": Infinity}]', "application/json", 422, "finite number"),
    "a column missing": (b'[{"time": "2018-09-27T00:00-06:00", "T_za": 20}]', "application/json", 422, "T_oa is to be"),
    "not CSV": (b"\x1f\x8b\x08 packed", "text/csv", 422, "not text in UTF-8"),
    "packed": (b"BZh91AY&SY", "text/csv", 422, "the body is not CSV"),
    "empty": (b"", "text/csv", 422, "the body is not CSV"),
    "another type": (b"<rows/>", "text/xml", 415, "neither application/json nor text/csv"),
    "a form": (b"a=1", "application/x-www-form-urlencoded", 415, "neither"),
    "too large": (b"[" + b" " * (8 * 2**20), "application/json", 413, "more than 8 MiB"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_wrong_body_is_refused_in_one_sentence(case, made, cheap):
    body, kind, code, words = BAD[case]
    answer = client_of(made).post("/rows", content=body, headers={"Content-Type": kind})
    assert answer.status_code == code
    assert re.search(words, answer.json()["detail"]), answer.json()
    assert "\n" not in answer.json()["detail"]


def test_a_client_that_leaves_within_a_body_raises_no_error_in_the_server(made):
    headers = [(b"host", b"127.0.0.1"), (b"content-type", b"application/json")]
    scope = {"type": "http", "method": "POST", "path": "/rows", "query_string": b"", "headers": headers}
    come = iter([{"type": "http.request", "body": b"[{", "more_body": True}, {"type": "http.disconnect"}])
    sent = []

    async def receive():
        return next(come)

    async def send(message):
        sent.append(message)

    asyncio.run(make_app(made)(scope, receive, send))
    assert sent[0]["status"] == 400
    assert b"the connection ended before the body was complete" in sent[1]["body"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"T_za": 68.0}, r"T_za holds 68 degC in 1 row \(first at 2018-09-27 00:00:00-06:00\)"),
        ({"T_oa": 150.0}, "T_oa holds 150 degC"),
        ({"time": "2018-09-27T00:00:00"}, "the log of this zone has a time zone; post stamps with an offset"),
        ({"time": "2101-01-01T00:00:00-06:00"}, "2101-01-01 .* lies in the future"),
        ({"time": "yesterday"}, "time of 0: 'yesterday' is not a date and time such as 2024"),
        ({"time": "03/04/2019 00:00"}, "time of 0: '03/04/2019 00:00' is not a date and time"),
    ],
)
def test_a_wrong_row_is_refused_and_changes_nothing(change, words, log, client, folder):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    if change.get("time") == "2018-09-27T00:00:00":
        text = (folder / "zone.toml").read_text(encoding="utf-8")
        (folder / "zone.toml").write_text(text.replace("timezone =", "# timezone ="), encoding="utf-8")
        before["zone.toml"] = (folder / "zone.toml").read_bytes()
    answer = client.post("/rows", json=[as_json(log.iloc[24 * DAYS : 24 * DAYS + 1])[0] | change])
    assert answer.status_code == 422
    assert re.search(words, answer.json()["detail"]), answer.json()
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_rows_in_another_unit_than_the_log_are_refused(log, client, folder):
    before = (folder / "archive.sqlite").read_bytes()
    rows = log.iloc[24 * DAYS : 24 * DAYS + 6]
    answer = client.post("/rows", json=as_json(rows.assign(T_za=1.8 * rows["T_za"] + 32.0)))
    assert answer.status_code == 422
    assert (
        f"T_za changes its unit at {rows.index[0]}, degC on one side and degF on the other" in answer.json()["detail"]
    )
    assert (folder / "archive.sqlite").read_bytes() == before


def test_energies_per_row_are_left_to_the_log(log, client, folder):
    text = (folder / "zone.toml").read_text(encoding="utf-8")
    (folder / "zone.toml").write_text(text + '\n[units]\nQ_hvac = "kWh"\n', encoding="utf-8")
    answer = client.post("/rows", json=as_json(log.iloc[24 * DAYS : 24 * DAYS + 1]))
    assert answer.status_code == 422
    assert "Q_hvac is logged in kWh" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("old", "new"),
    [("name =", "name = #"), ("name =", 'colour = "red"\nname ='), ("timezone = ", 'timezone = "Europe/Berln"  # ')],
)
def test_a_configuration_that_cannot_be_used_is_no_fault_of_the_rows(old, new, log, client, folder):
    """It was answered with 422, as though the rows were wrong."""
    rows = as_json(log.iloc[24 * DAYS : 24 * DAYS + 1])
    whole = (folder / "zone.toml").read_text(encoding="utf-8")
    (folder / "zone.toml").write_text(whole.replace(old, new, 1), encoding="utf-8")
    answer = client.post("/rows", json=rows)
    assert answer.status_code == 500
    assert re.search(r"^zone\.toml.*; mend it and post the rows again\.$", answer.json()["detail"]), answer.json()
    (folder / "zone.toml").write_text(whole, encoding="utf-8")
    assert client.post("/rows", json=rows).status_code == 200


def test_a_post_during_a_tick_is_told_so(log, client, folder):
    with open_archive(folder / "archive.sqlite") as archive, archive.transaction():
        answer = client.post("/rows", json=as_json(log.iloc[24 * DAYS : 24 * DAYS + 1]))
        assert client.get("/forecast").status_code == client.get("/").status_code == 200  # reading needs no lock
    assert answer.status_code == 409
    assert "another command is at work" in answer.json()["detail"]
    assert answer.headers["retry-after"] == "5"


def test_a_zone_without_a_forecast_and_one_that_cannot_be_read(folder):
    client = client_of(folder)
    with open_archive(folder / "archive.sqlite") as archive:
        archive.database.execute("DELETE FROM forecast")
    assert client.get("/forecast").status_code == 404
    assert "There is no forecast yet" in client.get("/").text
    assert client.get("/status").json()["yesterday's forecast"] is None
    (folder / "model.skops").write_bytes(b"PK")
    answer = client.get("/status")
    assert answer.status_code == 500
    assert "run skhybrid zone init again" in answer.json()["detail"]


# ----------------------------------------------------------------------------------------------------- who is let in
def _basic(token):
    return {"Authorization": "Basic " + base64.b64encode(f"any:{token}".encode()).decode()}


@pytest.mark.parametrize(
    ("headers", "reads", "posts"),
    [
        ({"Authorization": f"Bearer {TOKEN}"}, 200, 415),
        ({"Authorization": f"bearer {TOKEN}", "Host": "zone.example.org"}, 200, 415),  # after a proxy
        (_basic(TOKEN), 200, 401),  # browsers send it for other sites too
        ({}, 401, 401),
        ({"Authorization": f"Bearer {TOKEN}x"}, 401, 401),
        ({"Authorization": "Bearer "}, 401, 401),
        ({"Authorization": f"Bearer {TOKEN}\u00e9".encode()}, 401, 401),
        ({"Authorization": "Basic ???"}, 401, 401),
        (_basic("wrong"), 401, 401),
    ],
)  # fmt: skip
def test_a_token_is_needed_where_one_is_set(headers, reads, posts, made):
    client = client_of(made, token=TOKEN)
    for path in ("/", "/forecast", "/status", "/docs", "/openapi.json", "/nowhere")[reads == 200 :]:
        wanted = 404 if path == "/nowhere" and reads == 200 else reads
        answer = client.get(path, headers=headers)
        assert answer.status_code == wanted
        if wanted == 401:
            assert answer.headers["www-authenticate"].startswith("Basic")
            assert "the token is missing or wrong" in answer.json()["detail"]
    assert client.post("/rows", headers={"Content-Type": "text/xml"} | headers).status_code == posts


@pytest.mark.parametrize(
    ("host", "code"),
    [
        ("127.0.0.1:8765", 200),
        ("localhost", 200),
        ("[::1]:8765", 200),
        ("evil.example:8765", 400),
        ("127.0.0.1.evil.example", 400),
    ],
)
def test_without_a_token_only_names_of_this_machine_are_answered(host, code, made):
    assert client_of(made).get("/openapi.json", headers={"Host": host}).status_code == code


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-site"}, 403),
        ({"Origin": "http://127.0.0.1:8765", "Sec-Fetch-Site": "same-origin"}, 415),
        ({}, 415),
    ],
)
def test_a_page_of_another_site_may_not_post(headers, code, made):
    for given in ({}, {"token": TOKEN}):
        sent = headers | {"Content-Type": "text/plain", "Authorization": f"Bearer {TOKEN}"}
        answer = client_of(made, **given).post("/rows", content=b"[]", headers=sent)
        assert answer.status_code == code
        assert "access-control-allow-origin" not in answer.headers


def test_the_address_and_the_token_on_the_command_line(made, tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("SKHYBRID_TOKEN", raising=False)
    assert all(map(is_loopback, ("127.0.0.1", "127.9.9.9", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "192.168.1.20", "zone.example")))
    check_token("127.0.0.1", None)
    check_token("0.0.0.0", TOKEN)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        for arguments, words in (
            ([str(made), "--host", "0.0.0.0"], "others can reach 0.0.0.0, so a token is needed"),
            ([str(made), "--token", "short"], "the token needs 16 or more"),
            ([str(made), "--token", "with a space in the middle"], "without a space"),
            ([str(made), "--port", port], f"cannot listen on 127.0.0.1, port {port}"),
            ([str(tmp_path / "none")], "holds no zone; make it with skhybrid zone init"),
            ([str(made), "--setpoint", "x"], "set-point"),
        ):
            assert main(["serve", *arguments]) == 1
            assert words in capsys.readouterr().err
    monkeypatch.setenv("SKHYBRID_TOKEN", "weak")
    assert main(["serve", str(made)]) == 1
    assert "the token needs 16" in capsys.readouterr().err


def test_a_missing_extra_is_named(made, monkeypatch, capsys):
    for name in [one for one in sys.modules if one.startswith(("uvicorn", "skhybrid.server.app"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert main(["serve", str(made), "--port", "0"]) == 1
    assert 'install them with pip install "skhybrid[serve]"' in capsys.readouterr().err


def test_the_extra_is_pinned():
    root = Path(__file__).resolve().parents[1]
    extras = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    pins = (root / "constraints.txt").read_text(encoding="utf-8")
    assert "serve" in extras["all"][0]
    for one in extras["serve"]:
        assert f"\n{one.split('>')[0]}==" in pins


# -------------------------------------------------------------------------------------------- a real server and browser
@pytest.fixture(scope="module")
def address(made):
    """The address of a server in a process of its own."""
    arguments = [sys.executable, "-m", "skhybrid", "serve", str(made), "--port", "0", "--json"]
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=usual) as server:
        lines = [server.stdout.readline() for _ in range(4)]
        yield json.loads("".join(lines))["address"]
        server.send_signal(signal.SIGINT if os.name == "posix" else signal.SIGTERM)
        assert server.wait(20) == 130
        assert "stopped" in server.stderr.read()


def _until_it_answers(address):
    for _ in range(100):
        try:
            return httpx.get(address + "openapi.json", timeout=20)
        except httpx.ConnectError:
            time.sleep(0.1)
    raise AssertionError("no answer")


@pytest.mark.slow
def test_a_server_answers_over_a_socket(address):
    answer = _until_it_answers(address)
    assert answer.status_code == 200
    assert "server" not in answer.headers
    assert httpx.get(address + "forecast", timeout=20).json()["name"] == "kitchen <b>&"
    assert httpx.post(address + "rows", json=[{}], timeout=20).status_code == 422
    assert httpx.get(address, headers={"Host": "evil.example"}, timeout=20).status_code == 400


def _browse(*arguments):
    common = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"]
    return subprocess.run(
        [CHROMIUM, *common, *arguments], capture_output=True, text=True, timeout=60, check=True
    ).stdout


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
@pytest.mark.parametrize("width", [1200, 390])
def test_the_page_in_a_browser_at_desktop_and_phone_width(width, address, tmp_path):
    _until_it_answers(address)
    page = httpx.get(address, timeout=30).text.replace('http-equiv="refresh"', "")
    # a frame of the width, since a browser's window is never as narrow as a phone
    measure = """<script>addEventListener("load", () => {
      const shown = frame.contentDocument, root = shown.documentElement;
      const figures = [...shown.querySelectorAll("svg")].filter(one => one.getBoundingClientRect().width > 0);
      const sizes = [...shown.querySelectorAll("svg text")].filter(one => one.getBoundingClientRect().width > 0)
        .map(one => one.getBoundingClientRect().height);
      document.title = JSON.stringify({scroll: root.scrollWidth, client: root.clientWidth, figures: figures.length,
        widest: Math.max(...figures.map(one => one.getBoundingClientRect().right)), smallest: Math.min(...sizes)});
    })</script>"""
    style, inside = f"width:{width}px;height:3000px;border:0", escape(page, quote=True)
    frame = f'<iframe id="frame" style="{style}" srcdoc="{inside}"></iframe>'
    (tmp_path / "frame.html").write_text(f"<!DOCTYPE html><title>-</title>{measure}{frame}", encoding="utf-8")
    dom = _browse(f"--window-size={width},3000", "--dump-dom", (tmp_path / "frame.html").as_uri())
    found = json.loads(dom.split("<title>")[1].split("</title>")[0])
    assert found["client"] == width
    assert found["scroll"] <= width
    assert found["figures"] == 3
    assert found["widest"] <= width
    assert found["smallest"] >= 8.0  # px, so that numbers at the axes can be read


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
def test_the_policy_lets_the_browser_draw_the_page(address, tmp_path):
    _until_it_answers(address)
    picture = tmp_path / "page.png"
    _browse("--window-size=1200,2400", f"--screenshot={picture}", address)
    from matplotlib.image import imread

    pixels = imread(picture)[..., :3]
    blue = (pixels[..., 2] - pixels[..., 0] > 0.5).sum()
    assert blue > 2000  # lines and bands of the forecast, whose colours are styles in the figures
