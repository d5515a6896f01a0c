"""Logs in JSON, each made from one table and compared with the CSV of that table."""

import gzip
import json

import numpy as np
import pandas as pd
import pytest

from skhybrid.datasets import read_zone_csv
from skhybrid.logs import LogReport, read_log

STAMPS = pd.date_range("2024-03-30 12:00", periods=96, freq="15min", tz="UTC", name="time")
WAVE = np.sin(np.arange(96) / 8)
WIDE = pd.DataFrame(
    {
        "living temp": (20.0 + WAVE).round(2),
        "kitchen temp": (21.0 - WAVE).round(2),
        "living heating (kW)": (1.0 + WAVE).round(2),
        "kitchen heating (kW)": (1.0 - WAVE).round(2),
        "outdoor temp": (5.0 + 3.0 * WAVE).round(1),
    },
    STAMPS,
)
SECONDS = [int(stamp.timestamp()) for stamp in STAMPS]
TEXTS = [stamp.isoformat() for stamp in STAMPS]
ROWS = WIDE.set_axis(TEXTS, axis=0).rename_axis("time").reset_index()
ROLES = ["T_za_living", "T_za_kitchen", "Q_heat_living", "Q_heat_kitchen", "T_oa"]
ROOMS = ("living", "kitchen")


def of_role(role):
    """The values (96,) of a role."""
    return WIDE.iloc[:, ROLES.index(role)].tolist()


def prometheus(series):
    """An answer of query_range: series by their labels."""
    result = [{"metric": m, "values": [[s, str(v)] for s, v in zip(SECONDS, own, strict=True)]} for m, own in series]
    return {"status": "success", "data": {"resultType": "matrix", "result": result}}


def exported(metric, values, first=0, stamps=None):
    """A line of an export of VictoriaMetrics, which may write several for one series."""
    at = [1000 * s for s in SECONDS[first : first + len(values)]] if stamps is None else stamps
    return json.dumps({"metric": metric, "values": values, "timestamps": at})


def influx(series):
    """An answer of InfluxDB 1 to one statement."""
    return {"results": [{"statement_id": 0, "series": series}]}


def climate(rows, *more, **tags):
    """A series of InfluxDB of temperatures and powers."""
    return {"name": "climate", "tags": tags, "columns": ["time", "temp", "heating (kW)", *more], "values": rows}


def of_room(room):
    """The stamps, temperatures and powers of a room, row by row."""
    return list(map(list, zip(TEXTS, of_role(f"T_za_{room}"), of_role(f"Q_heat_{room}"), strict=True)))


def openhab(name, values):
    """The persistence of an item."""
    states = [{"time": 1000 * s, "state": str(v)} for s, v in zip(SECONDS, values, strict=True)]
    return {"name": name, "datapoints": "96", "data": states}


def graphite(name, values):
    """A target of Graphite's render API."""
    return {"target": name, "tags": {}, "datapoints": [[v, s] for s, v in zip(SECONDS, values, strict=True)]}


WEATHER = {
    "name": "weather",
    "columns": ["time", "T_out"],
    "values": list(map(list, ROWS[["time", "outdoor temp"]].to_numpy())),
}
METRICS = [
    ({"__name__": name, "room": room, "instance": f"{room}:9100", "job": "esp"}, of_role(f"{role}_{room}"))
    for room in ROOMS
    for name, role in (("room_temperature_celsius", "T_za"), ("heating_power_kilowatts", "Q_heat"))
]
OUTDOOR = ({"__name__": "outdoor_temp", "instance": "a"}, of_role("T_oa"))
ITEMS = dict(
    zip(("Living_Temp", "Kitchen_Temp", "Living_Heating_kW", "Kitchen_Heating_kW", "Outdoor_Temp"), ROLES, strict=True)
)
FORMS = {
    "records": ROWS.to_json(orient="records"),
    "indented records": ROWS.to_json(orient="records", indent=1),
    "lines": ROWS.to_json(orient="records", lines=True),
    "split": WIDE.to_json(orient="split", date_format="iso"),
    "columns": WIDE.to_json(orient="columns", date_format="iso"),
    "rows": WIDE.to_json(orient="index", date_format="iso"),
    "table": WIDE.to_json(orient="table"),
    "columns with numbers": ROWS.to_json(),
    "lists": json.dumps(ROWS.to_dict(orient="list")),
    "rows in an object": json.dumps({"count": 96, "rows": ROWS.to_dict(orient="records")}),
    "numbers as text": ROWS.astype(str).map(lambda cell: cell.replace(".", ",")).to_json(orient="records"),
    "nested": json.dumps([{"time": row.pop("time"), "home": row} for row in ROWS.to_dict(orient="records")]),
    "points": ROWS.melt("time", var_name="sensor").to_json(orient="records"),
    "zones": json.dumps(
        [
            {"time": t, "zone": room, "temp": v, "heating (kW)": q, "outdoor temp": out}
            for room in ROOMS
            for (t, v, q), out in zip(of_room(room), of_role("T_oa"), strict=True)
        ]
    ),
    "Prometheus": json.dumps(prometheus([*METRICS, OUTDOOR])),
    "VictoriaMetrics": "\n".join(
        exported(m, own[k : k + 40], k) for m, own in [*METRICS, OUTDOOR] for k in (0, 40, 80)
    ),
    "InfluxDB": json.dumps(influx([*(climate(of_room(r), room=r) for r in ROOMS), WEATHER])),
    "InfluxDB without groups": json.dumps(
        influx([climate([[*row, r] for r in ROOMS for row in of_room(r)], "room"), WEATHER])
    ),
    "InfluxDB in chunks": "\n".join(
        json.dumps(influx([{"columns": list(ROWS), "values": ROWS.iloc[k : k + 40].to_numpy().tolist()}]))
        for k in (0, 40, 80)
    ),
    "Graphite": json.dumps([graphite(name, of_role(role)) for name, role in ITEMS.items()]),
    "openHAB": json.dumps([openhab(name, of_role(role)) for name, role in ITEMS.items()]),
    "lists by point": json.dumps({name: openhab("", of_role(role))["data"] for name, role in ITEMS.items()}),
}


@pytest.fixture
def write(tmp_path):
    """Write content in a file and return its path."""

    def written(content, name="log.json"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return written


@pytest.mark.parametrize("form", FORMS)
def test_json_is_read_as_the_csv_of_the_same_table(write, form):
    """It was refused."""
    of_csv = LogReport(read_log(write(ROWS.to_csv(index=False), "log.csv")))
    log = read_log(write(FORMS[form]))
    report = LogReport(log)
    assert log.format == "JSON"
    assert set(report.roles) == set(of_csv.roles) == set(ROLES)
    pd.testing.assert_frame_equal(report.frame[ROLES], of_csv.frame[ROLES], check_freq=False, check_index_type=False)


@pytest.mark.parametrize(
    "coded", [lambda t: t.encode("utf-8-sig"), lambda t: t.encode("utf-16"), lambda t: gzip.compress(t.encode())]
)
def test_json_in_any_encoding_or_compressed(write, coded):
    pd.testing.assert_frame_equal(read_log(write(coded(FORMS["lines"]))).frame, read_log(write(FORMS["records"])).frame)


def test_labels_and_units_of_prometheus_name_its_points(write):
    fahrenheit = [{"__name__": "room_temperature_fahrenheit", "room": room, "job": "esp"} for room in ROOMS]
    log = read_log(write(json.dumps(prometheus((metric, of_role("T_oa")) for metric in fahrenheit))))
    assert log.units == {f'room_temperature_fahrenheit{{room="{room}"}}': "degF" for room in ROOMS}
    told_by_target = [({"__name__": "temp", "instance": room}, of_role(f"T_za_{room}")) for room in ROOMS]
    assert list(read_log(write(json.dumps(prometheus(told_by_target)))).frame) == [
        f'temp{{instance="{room}"}}' for room in ROOMS
    ]
    assert list(read_log(write(json.dumps(prometheus([({}, of_role("T_oa"))])))).frame) == ["{}"]


def test_lists_in_records_are_left_out(write):
    """A list of a time and a value, such as a forecast, is no list of a point."""
    ahead = {"forecast": [{"time": TEXTS[0], "value": 1.0}], "limits": [5, 30]}
    log = read_log(write(json.dumps([row | ahead for row in ROWS.to_dict(orient="records")])))
    assert list(log.frame) == list(WIDE)
    assert sum("is left out, since it holds text" in note for note in log.notes) == 2


def test_values_without_a_number_are_missing(write):
    rows = ROWS.to_dict(orient="records")
    rows[3]["living temp"], rows[4]["living temp"], rows[5]["living temp"] = None, float("nan"), "unavailable"
    rows[6] = {"time": rows[6]["time"]}
    found = read_log(write(json.dumps(rows))).frame["living temp"]
    assert np.flatnonzero(found.isna()).tolist() == [3, 4, 5, 6]


@pytest.mark.parametrize("words", [["auto", "manual"], ["heat", "off"], ["HP1"], [[1, 2]], [{"name": "HP1"}]])
def test_text_beside_one_room_names_no_zones(write, words):
    room = ROWS[["time", "living temp"]].assign(thermostat=[words[k // 8 % len(words)] for k in range(96)])
    series = {"name": "home", "columns": list(room), "values": room.to_numpy().tolist()}
    for content in (room.to_dict(orient="records"), *([influx([series])] if isinstance(words[0], str) else [])):
        log = read_log(write(json.dumps(content)))
        name = next(name for name in log.frame if name.endswith("living temp"))
        np.testing.assert_array_equal(log.frame[name], WIDE["living temp"])
        assert not any("a row for each" in note for note in log.notes)


VECTOR = {"resultType": "vector", "result": [{"metric": {}, "value": [SECONDS[0], "20.1"]}]}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("[]", "holds no rows; export a time that has some"),
        (json.dumps({"name": "Living_Temp", "data": []}), "holds no rows"),
        (json.dumps(ROWS.head(1).to_dict(orient="records")), "holds one record; export one for each time stamp"),
        (FORMS["records"][:-9], r"is no complete JSON \(.*\); export it again"),
        (FORMS["lines"][:-9], r"is no complete JSON \(.* line 96 .*\); export it again"),
        ("[" * 100_000, r"is no complete JSON \(.*\); export it again"),
        ("{}", "is JSON of no known form; write it as records"),
        ("[null, null]", "is JSON of no known form"),
        (WIDE.to_json(orient="values", date_format="iso"), "is JSON of no known form"),
        ('{"home": {"living": {"temp": 20.1}}}', "is JSON of no known form"),
        (json.dumps({"time": TEXTS, "temp": [20.1]}), "is JSON of no known form"),
        ('[{"room": 1, "temp": 20.1}, {"room": 2, "temp": 20.2}]', "has no column of time stamps among 'room', 'temp'"),
        ('{"latitude": 52.1, "hourly": {"temperature_2m": [1]}}', "is a forecast of Open-Meteo, .*give it as weather"),
        (json.dumps({"status": "success", "data": VECTOR}), "is an answer without values over time; query a range"),
        (json.dumps(prometheus([])), "is an answer without values over time"),
        (exported({"__name__": "temp"}, []), "is an answer without values over time"),
        (exported(*OUTDOOR)[:-9], r"is no complete JSON \(.*\); export it again"),
        (f'{exported(*OUTDOOR)}\n{{"error": "timeout"}}', "is an answer .* error, 'timeout'; ask again"),
        (f'{exported(*OUTDOOR)}\n{{"time": "2024", "room": 20}}', "has '{\"time.* among series .* file of its own"),
        ('{"results": [{"statement_id": 0}]}', "is an answer without values over time"),
        (json.dumps(influx([WEATHER | {"values": []}])), "is an answer without values over time"),
        ('{"results": {"A": {"frames": []}}}', r"is an answer to a panel of Grafana; download its data as CSV"),
        ('[{"target": "room temp", "datapoints": []}]', "holds no rows"),
        ('{"error": "database not found: home"}', "is an answer .* error, 'database not found: home'; ask again"),
    ],
)  # fmt: skip
def test_json_that_is_no_log_is_refused_in_a_sentence(write, content, told):
    with pytest.raises(ValueError, match=rf"^'log\.json' {told}"):
        read_log(write(content))


@pytest.mark.parametrize("values", [[20.1, 20.2], "20.1"])
def test_an_export_without_a_value_for_each_stamp_is_refused(write, values):
    lines = [exported(*OUTDOOR), exported({"__name__": "temp", "room": "hall"}, values, stamps=[1000 * SECONDS[0]])]
    with pytest.raises(
        ValueError, match=r'^row 2 of .log\.json.: temp\{room="hall"\} has no value for each of its timest'
    ):
        read_log(write("\n".join(lines)))


@pytest.mark.parametrize("empty", ["Prometheus", "VictoriaMetrics", "Graphite"])
def test_a_series_without_values_is_left_out_with_a_note(write, empty):
    """Another one with values was refused with it."""
    none = ({"__name__": "dead"}, [])
    content = {
        "Prometheus": json.dumps(prometheus([METRICS[0]])).replace(
            "]}}", ', {"metric": {"__name__": "dead"}, "values": []}]}}'
        ),
        "VictoriaMetrics": "\n".join(exported(*one) for one in (none, METRICS[0])),
        "Graphite": json.dumps([{"target": "dead", "datapoints": []}, graphite("room_temp", METRICS[0][1])]),
    }
    log = read_log(write(content[empty]))
    assert len(log.frame.columns) == 1
    assert "'dead': left out, since there are no values" in log.notes


def test_a_reader_of_csv_says_who_reads_json(write):
    with pytest.raises(ValueError, match=r"'log\.json' is JSON; read it with skhybrid\.logs\.read_log"):
        read_zone_csv(write(FORMS["records"]))


def test_a_row_of_json_is_named_by_its_number(write):
    rows = ROWS.to_dict(orient="records")
    rows[9]["time"] = "2024-13-45T00:00:00Z"
    with pytest.raises(ValueError, match=r"row 10 of 'log\.json': the time stamp '2024-13-45T00:00:00Z' is not a date"):
        read_log(write(json.dumps(rows)))
