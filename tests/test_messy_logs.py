"""Logs and weather as people have them: every one is read right, or refused in one useful sentence."""

import numpy as np
import pandas as pd
import pytest

from skhybrid._warnings import without_python
from skhybrid.datasets import load_dutch_home, make_office, read_zone_csv
from skhybrid.logs import LogReport, read_log
from skhybrid.logs.blank_setpoints import filled_setpoints
from skhybrid.logs.log_findings import doubts_on_log
from skhybrid.logs.naming import guess_role, unit_in_name
from skhybrid.logs.readers import columnar, delimited, spreadsheet, sql_table
from skhybrid.logs.setpoint_modes import COOLS, HEATS, in_force, kind_of_words, mode_of_plant, sides_of_plant
from skhybrid.logs.standstills import without_standstills
from skhybrid.logs.sun_clock import clock_jumps
from skhybrid.study import propose_settings, read_settings
from skhybrid.study import read_log as read_zone_log
from skhybrid.study.log_reading import metered_heat
from skhybrid.study.settings import settings_from
from skhybrid.zone.day_ahead import read_ahead

STAMPS = pd.date_range("2024-03-01", periods=60, freq="1h")
ROOM = 20.0 + np.arange(60) / 100.0


def rows_of(stamps, values=ROOM, sep=","):
    return "\n".join(f"{stamp}{sep}{value:.2f}" for stamp, value in zip(stamps, values, strict=False)) + "\n"


@pytest.mark.parametrize(
    ("names", "form", "year"),
    [
        ("Fecha;Hora", "%d/%m/%Y;%H.%M", 2024),
        ("time", "%Y%m%d%H", 2024),
        ("time", "%Y%m%d:%H%M", 2024),
        ("time", "%Y%m%dT%H%M%S", 2024),
        ("time", "%Y%m%d%H%M", 2024),
        ("Year;Month;Day;Hour;Minute", "%Y;%m;%d;%H;%M", 2024),
        ("Jahr;Monat;Tag;Stunde", "%Y;%m;%d;%H", 2024),
        ("Date;Hour", "%Y-%m-%d;%H", 2024),
        ("Date/Time", " %m/%d  %H:%M:%S", 2017),
        ("Zeit", "%d.%m.%Y %H:%M Uhr", 2024),
        ("Data", "%d marzo %Y %H:%M", 2024),
    ],
)
def test_stamps_in_parts_digits_and_without_a_year(write, names, form, year):
    log = read_log(write(f"{names};Room (°C)\n{rows_of(STAMPS.strftime(form), sep=';')}"))
    assert (log.frame.index == STAMPS.map(lambda stamp: stamp.replace(year=year))).all()
    np.testing.assert_allclose(log.frame["Room (°C)"], ROOM)
    assert [note for note in log.notes if "first" not in note] == (
        []
        if year == 2024
        else ["the stamps have no year: 2017 is assumed, which begins on a Sunday; give year = in [log]"]
    )


@pytest.mark.parametrize("names", ["Date,HE", "Year,Month,Day,Hour", "Date/Time"])
def test_hours_that_end_at_24_are_labelled_right(write, names):
    """Utilities and EnergyPlus stamp the end of an hour, and midnight as 24 o'clock of the day before."""
    forms = {"Date,HE": "%m/%d/%Y,{}", "Year,Month,Day,Hour": "%Y,%m,%d,{}", "Date/Time": "%m/%d  {:02d}:00:00"}
    ends = [stamp.strftime(forms[names]).format(stamp.hour + 1) for stamp in STAMPS]
    log = read_log(write(f"{names},Room\n{rows_of(ends)}"), **({"year": 2024} if names == "Date/Time" else {}))
    assert (log.frame.index == STAMPS + pd.Timedelta("1h")).all()
    assert log.label == "right"


@pytest.mark.parametrize(
    ("stamp", "step", "label"),
    [
        ("{:%Y-%m-%dT%H:%M:%SZ}", "1h", "left"),
        ("{:%Y-%m-%d %H:%M:%S+00:00}", "1h", "left"),
        ("{:%Y-%m-%d %H:%M} UTC", "1h", "left"),
        ("{:%Y-%m-%dT%H:%M:%S+02:00}", "2h", "right"),
        ("{:%Y-%m-%dT%H:%M:%SZ}", "1h", "right"),
    ],
)
@pytest.mark.parametrize("backwards", [False, True])
def test_the_label_is_guessed_from_stamps_as_they_are_written(write, stamp, step, label, backwards):
    """A log that begins at midnight in UTC begins an hour later in Berlin, as one does that is stamped at the end."""
    stamps = pd.date_range("2024-01-15", periods=len(ROOM), freq=step) + pd.Timedelta(step if label == "right" else 0)
    lines = rows_of([stamp.format(one) for one in stamps]).splitlines()
    log = read_log(write("Time,Room\n" + "\n".join(lines[::-1] if backwards else lines)), timezone="Europe/Berlin")
    report = LogReport(log)
    assert report.assumed_label == label
    assert any(f"; {label} is assumed." in finding.text for finding in report.findings)


def test_the_label_is_guessed_from_the_first_of_two_offsets(write):
    """Offsets of summer and winter make a log one in UTC, which begins at another hour."""
    local = pd.date_range("2024-03-30 01:00", periods=len(ROOM), freq="1h", tz="Europe/Berlin")
    report = LogReport(read_log(write("Time,Room\n" + rows_of([one.isoformat() for one in local]))))
    assert report.assumed_label == "right"


def test_a_year_without_a_number_goes_on_in_the_next(write):
    stamps = pd.date_range("2023-12-31 22:00", periods=4, freq="1h").strftime("%m/%d %H:%M:%S")
    log = read_log(write(f"Date/Time,Room\n{rows_of(stamps)}"), year=2023)
    assert log.frame.index[-1] == pd.Timestamp("2024-01-01 01:00")


@pytest.mark.parametrize("decimal", [".", ","])
def test_days_since_1900_are_read_where_the_name_says_stamps(write, decimal):
    serials = (STAMPS - pd.Timestamp("1899-12-30")) / pd.Timedelta("1D")
    cells = [f"{day:.6f};{room:.2f}".replace(".", decimal) for day, room in zip(serials, ROOM, strict=True)]
    log = read_log(write("Time;Room\n" + "\n".join(cells)))
    assert (log.frame.index == STAMPS).all()
    assert "days since 1900, as Excel counts them" in log.notes[0]
    with pytest.raises(ValueError, match="no cell that is a time stamp"):  # a meter counts so too
        read_log(write("Meter;Room\n" + "\n".join(cells)))


def test_a_temperature_is_no_time_of_day(write):
    with pytest.raises(ValueError, match="has 1 distinct stamp"):
        LogReport(read_log(write("Date,Room\n" + "".join(f"2024-03-01,{18 + k / 100:.2f}\n" for k in range(20)))))


def test_epochs_count_before_a_local_clock_and_may_have_blanks(write):
    seconds = [f"{stamp.value // 10**6} ;{stamp:%Y/%m/%d %H:%M:%S}" for stamp in STAMPS]
    log = read_log(write(f"Timestamp;Timezone : Europe/Berlin;Temperature\n{rows_of(seconds, sep=';')}"))
    assert (log.frame.index == STAMPS.tz_localize("UTC")).all()
    assert list(log.frame) == ["Temperature"]


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_epochs_in_parts_of_a_second(write, unit):
    for name in ("time", f"timestamp_{unit}", f"unix {unit}", "unixtime"):
        log = read_log(write(f"{name},Room\n{rows_of(STAMPS.as_unit(unit).asi8)}"))
        assert (log.frame.index == STAMPS.tz_localize("UTC")).all()


def test_digits_with_the_sign_of_utc(write):
    log = read_log(write(f"time,Room\n{rows_of(STAMPS.strftime('%Y%m%dT%H%M%SZ'))}"))
    assert (log.frame.index == STAMPS.tz_localize("UTC")).all()


@pytest.mark.parametrize(
    ("name", "ending", "zone", "offset"),
    [("Time (UTC+1)", "", None, 1), ("time", " CET", "Europe/Berlin", 1), ("time (UTC)", "", "Europe/Berlin", 0)],
)
def test_zones_of_a_zone_csv(write, name, ending, zone, offset):
    path = write(f"{name},T_za\n{rows_of([f'{stamp}{ending}' for stamp in STAMPS])}")
    found = read_zone_csv(path, timezone=zone).index
    assert (found == (STAMPS - pd.Timedelta(hours=offset)).tz_localize("UTC")).all()


def test_a_zone_csv_guesses_no_year(write):
    with pytest.raises(ValueError, match="write it as 2024-01-31"):
        read_zone_csv(write(f"Date/Time,T_za\n{rows_of(STAMPS.strftime('%m/%d  %H:%M:%S'))}"))


def test_a_decimal_comma_before_a_unit(write):
    """Three decimals are no thousands where the file has a decimal comma."""
    cells = [f"{stamp};Power;{ROOM[k] / 10:.3f}".replace(".", ",") + " kW" for k, stamp in enumerate(STAMPS)]
    log = read_log(write("Zeit;Name;Wert\n" + "\n".join(cells)))
    np.testing.assert_allclose(log.frame["Power"], ROOM / 10.0, atol=6e-4)


@pytest.mark.parametrize("names", [("Zeit", "Zeit"), ("Room time", "Outdoor time", "Meter time")])
def test_trends_side_by_side_have_stamps_of_their_own(write, names):
    apart = pd.Timedelta("7min")
    n = len(names)
    lines = [";".join(f"{name};channel {j}" for j, name in enumerate(names))]
    for k in range(60):
        pairs = [(STAMPS[k] + j * apart, ROOM[k] + j) if k < 60 - j else ("", "") for j in range(n)]
        lines.append(";".join(f"{stamp};{value}" for stamp, value in pairs))
    lines.insert(40, lines[0])  # of an export that was put below another
    log = read_log(write("\n".join(lines)))
    assert f"{n} columns of stamps" in log.notes[0]
    for j in range(n):
        known = log.frame[f"channel {j}"].dropna()
        assert (known.index == STAMPS[: 60 - j] + j * apart).all()
        np.testing.assert_allclose(known, ROOM[: 60 - j] + j)


@pytest.mark.parametrize("colon", ["", ":"])
def test_points_that_a_list_above_the_table_names(write, colon):
    """Trend reports of Siemens number their columns; the one of dates, with <> before its name, was refused."""
    points = [("ZN-T", "degF"), ("OA-T", ""), ("HTG VLV POS", "")]
    above = [f'"Point_{k}{colon}","{name}","{unit}","15 minutes"' for k, (name, unit) in enumerate(points, 1)]
    rows = [
        f'"{stamp:%m/%d/%Y}","{stamp:%H:%M:%S}","{1.8 * value + 32.0:.2f}","No Data","50"'
        for stamp, value in zip(STAMPS, ROOM, strict=True)
    ]
    lines = ['"Key   Name:Suffix"', *above, '"Time Interval:","15 Minutes"', '""']
    header, end = '"<>Date","Time","Point_1","Point_2","Point_3"', '" *** End of Report ***"'
    log = read_log(write("\n".join([*lines, header, *rows, end])), dayfirst=False)
    assert list(log.frame) == [name for name, _ in points]
    assert dict(log.units) == {"ZN-T": "degF"}
    assert (log.frame.index == STAMPS).all()
    np.testing.assert_allclose(log.frame["ZN-T"], 1.8 * ROOM + 32.0, atol=0.01)


@pytest.mark.parametrize(
    "header",
    [",result,table,_time,_value,_field", "_time,statistic_id,mean,unit", "_time,Name Path,Object Name,Object Value",
     "_time,item,_value", "_time,topic,payload", "_time,Trend Point,Value"],
)  # fmt: skip
def test_long_tables_of_databases(write, header):
    names = header.split(",")
    cells = {"_time": STAMPS.strftime("%Y-%m-%dT%H:%M:%SZ"), "_value": ROOM, "mean": ROOM, "_field": "room_temp"}
    cells |= {"Name Path": "NAE1/room_temp", "Object Name": "room_temp", "Object Value": [f"{v} deg C" for v in ROOM]}
    cells |= {"Trend Point": "room_temp", "Value": ROOM, "item": "room_temp", "topic": "room_temp", "payload": ROOM}
    frame = pd.DataFrame({"": "", "result": "", "table": 0, "statistic_id": "room_temp", "unit": "°C"} | cells)
    log = read_log(write(header + "\n" + frame[names].to_csv(index=False, header=False)))
    np.testing.assert_allclose(log.frame["room_temp"], ROOM)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(512), "a workbook of Excel before 2007; open it in Excel"),
        (b"PK\x03\x04" + bytes(range(256)), "a ZIP archive; unpack it"),
        (b"%PDF-1.7 " + bytes(range(256)), "a PDF; export the log as CSV"),
        (b"<html><table><tr><td>20.1</td></tr></table></html>", "a web page or XML"),
        (
            b"climate,room=hall T=20.1,RH=45 1704067200000000000\n" * 3,
            "InfluxDB's line protocol; query it as annotated",
        ),
        (b'2024-01-01T00:00:00Z zigbee2mqtt/hall {"T":20.1,"RH":45}\n' * 3, "lines with JSON in them"),
        (b"".join(b'"2024-01-01 00:%02d;20,1"\n' % k for k in range(9)), "take the quotes around each row away"),
    ],
)
def test_files_that_are_no_tables_are_told(tmp_path, content, told):
    (tmp_path / "log.xls").write_bytes(content)
    with pytest.raises(ValueError, match=told):
        read_log(tmp_path / "log.xls")


@pytest.mark.parametrize(("unit", "factor"), [("", 1.0), (" (°F)", 1.8), (" (K)", 1.0)])
def test_fill_values_are_missing_and_told(write, unit, factor):
    """They are no refusal that names a class of Python, and no unit is guessed from them."""
    room = factor * ROOM + {"": 0.0, " (°F)": 32.0, " (K)": 273.15}[unit]
    frame = pd.DataFrame(
        {f"Room temp{unit}": room, "Heating stage": np.arange(60) % 2, "Solar (W/m2)": 940.0 + np.arange(60)}, STAMPS
    )
    for place, (row, code) in enumerate([(7, -9999.0), (9, -9999.0), (11, 9.96921e36)]):
        frame.iloc[row, place] = code
    frame.iloc[13, 2] = -999.0
    report = LogReport(read_log(write(frame.rename_axis("time").to_csv())))
    missing = report.frame.isna()
    assert missing.sum().tolist() == [1, 1, 2]
    assert missing.iloc[7, 0]
    np.testing.assert_allclose(report.frame["T_za"].dropna(), np.delete(ROOM, 7), atol=1e-9)
    assert report.frame["u_heat"].max() == 1.0
    assert report.frame["q_sol"].max() == 0.999
    told = [f.text for f in report.findings if "taken as missing" in f.text]
    assert told[0] == "1 value such as -9999 taken as missing."
    assert len(told) == 3


@pytest.mark.parametrize(
    ("column", "values", "failed"),
    [
        ("Room temp", [85.0], True),
        ("Room temp", [127.0, -127.0, 127.0], True),
        ("Room temp", [-40.0] * 12, True),
        ("Room temp", [0.0] * 12, True),
        ("Room temp (°F)", [185.0], True),
        ("Room temp", [85.0, 86.0, 87.0], False),  # a sensor that moves is in another unit
        ("Room temp", [68.0, 68.0], False),  # 20 degC
        ("Room temp", [45.0], True),
        ("Room temp", [5.0], True),
        ("Room temp", [45.0, 45.0], False),  # `check` warns of it
        ("Room temp", [14.0], False),  # a window
        ("Outdoor temp", [0.0], True),
        ("Heating setpoint", [0.0], False),  # off
        ("Cooling setpoint", [0.0] * 12, True),
        ("Heating setpoint", [85.0], True),
        ("Heat meter (kW)", [2e3], True),
        ("Heat meter (kW)", [100.0], False),
        ("Solar (kW/m2)", [30.0], True),
    ],
)
def test_values_of_a_failed_sensor_are_missing_and_told(column, values, failed):
    """One of 85 degC stopped every fit; of 1 % at 0 degC, forecasts had twice the error."""
    factor, offset = (1.8, 32.0) if "°F" in column else (0.01, 0.0) if "Solar" in column else (1.0, 0.0)
    spoilt = factor * np.tile(ROOM, 3) + offset
    spoilt[30 : 30 + len(values)] = values
    report = LogReport(pd.DataFrame({column: spoilt}, pd.date_range("2024-03-01", periods=180, freq="1h")))
    assert report.frame.isna().sum().sum() == len(values) * failed
    assert any(f"such as {values[0]:g} taken as missing" in found.text for found in report.findings) == failed


@pytest.mark.parametrize(
    ("units", "warns"),
    [
        ({"T_za": "degF"}, True),
        ({"T_za": "degF", "T_oa": "degC"}, False),
        ({"T_za": "degF", "T_oa": "degF"}, False),
        ({}, False),
    ],
)
def test_an_outdoor_temperature_without_a_unit_beside_a_room_in_degf_is_warned_of(write, recwarn, units, warns):
    """The check takes it for degF too; a fit read 29 degF of January as 29 degC."""
    frame = pd.DataFrame({"Zone": 1.8 * ROOM + 32.0, "Outside": 30.0 + np.arange(60) / 10.0}, STAMPS)
    columns = {"T_za": "Zone", "T_oa": "Outside"}
    settings = settings_from({"name": "z", "columns": columns, "units": units, "step": "1h"})
    read_zone_log(write(frame.rename_axis("time").to_csv()), settings)
    assert any("T_oa has no unit and is read in degC" in str(w.message) for w in recwarn) == warns


@pytest.mark.parametrize(
    ("plant", "of_plant", "low", "told"),
    [
        ("Q_heat", 1.0, 30.0, True),  # 32 to 46 degF
        ("Q_hvac", 1.0, 30.0, True),
        ("Q_hvac", -1.0, 30.0, False),  # a desert
        ("Q_cool", 1.0, 30.0, False),
        ("u_cool", 1.0, 30.0, False),
        ("u_cool", 0.0, 30.0, True),
        ("Q_heat", 1.0, 15.0, False),
    ],
)
def test_it_is_never_always_hotter_outdoors_than_in_a_room_that_nothing_cools(plant, of_plant, low, told):
    """A cold season in degF, below the values that no degC have, was taken for a hot one."""
    hours = np.arange(60) % 24
    frame = pd.DataFrame({"T_za": ROOM, "T_oa": low + 0.6 * hours, plant: of_plant * (hours < 6)}, STAMPS)
    text = f"T_oa goes from {low:.0f} to {low + 13.8:.0f} degC, always above T_za, though nothing cools: is it in degF?"
    assert any(found.text.startswith(text) for found in LogReport(frame).findings) == told
    assert any(text in doubt for doubt in doubts_on_log(frame, ["T_za"])) == told


@pytest.mark.parametrize(
    ("column", "peak", "code", "failed"),
    [
        ("Heat meter (kW)", 5.0, 65535.0, True),
        ("Heat meter (kW)", 30.0, 655.35, True),
        ("Heat meter (W)", 5000.0, -32768.0, True),
        ("Heat meter (W)", 30_000.0, 65535.0, True),
        ("Heat meter (W)", 50_000.0, 65535.0, False),
        ("Heat meter (kW)", 10.0, 32.767, True),
        ("Heat meter (kW)", 400.0, 327.67, False),
        ("Heating valve (%)", 100.0, 3276.7, True),
        ("Solar (W/m2)", 900.0, 655.35, False),
        ("Outdoor temp", 30.0, 32.767, False),
    ],
)
def test_the_end_of_a_register_is_missing_and_told(column, peak, code, failed):
    """20 rows of 65535 W became 65.5 kW of heat, and those of 65535 kW stopped every fit."""
    values = peak * (0.6 + 0.4 * np.sin(np.arange(600.0)))
    values[30:610:30] = code
    report = LogReport(pd.DataFrame({column: values}, pd.date_range("2024-03-01", periods=600, freq="1h")))
    assert report.frame.isna().sum().sum() == 19 * failed
    assert any(f"19 values such as {code:g} taken as missing" in f.text for f in report.findings) == failed


@pytest.mark.parametrize(("role", "spike"), [("Q_hvac", 500.0), ("q_sol", 30.0)])
def test_a_spike_does_not_make_a_column_one_of_watts(role, spike):
    """Of one row of 500 kW, all heat was a thousandth."""
    values = 0.5 + 0.2 * np.sin(np.arange(180.0))
    values[7] = spike
    report = LogReport(pd.DataFrame({role: values}, pd.date_range("2024-03-01", periods=180, freq="1h")))
    np.testing.assert_allclose(report.frame[role], np.where(values == spike, np.nan, values))


@pytest.mark.parametrize("decimal", [".", ","])
def test_cells_that_end_with_a_sign_of_degrees(write, decimal):
    rows = "".join(f"{stamp};{room:.2f}°\n".replace(".", decimal) for stamp, room in zip(STAMPS, ROOM, strict=True))
    np.testing.assert_allclose(read_log(write("time;Room\n" + rows)).frame["Room"], ROOM)


def test_a_named_column_of_points_needs_no_name_of_values(write):
    rows = "".join(
        f"{stamp},{what},{value}\n" for stamp in STAMPS for what, value in (("Room", 20.5), ("Outdoor", 5.0))
    )
    options = {"format": "change of value", "point_column": "what"}
    assert list(read_log(write("time,what,value\n" + rows), **options).frame) == ["Room", "Outdoor"]


def test_a_row_for_each_point_is_refused(write):
    rows = f";{';'.join(STAMPS.astype(str))}\nRoom;{';'.join(map(str, ROOM))}\nSun;{';'.join(map(str, ROOM))}\n"
    with pytest.raises(ValueError, match=r"line 1 of 'log.csv' holds all time stamps; exchange rows and columns"):
        read_log(write(rows))


def test_a_row_for_each_day_is_refused(write):
    rows = "".join(f"2024-01-{day:02d},20.1,20.2,20.3\n" for day in range(1, 9))
    with pytest.raises(ValueError, match="a row for each day and a column for each time of day, such as '00:00'"):
        read_log(write("Date,00:00,08:00,16:00\n" + rows))


@pytest.mark.parametrize("decimal", [".", ","])
def test_cells_that_end_with_their_status(write, decimal):
    """Niagara writes it after each value; no column held numbers."""
    cells = [f"{stamp};{room:.2f} °C {{ok}}".replace(".", decimal) for stamp, room in zip(STAMPS, ROOM, strict=True)]
    cells[7] = cells[7].replace("{ok}", "{down,stale}")
    log = read_log(write("time;Room\n" + "\n".join(cells)))
    np.testing.assert_allclose(log.frame["Room"], np.where(np.arange(60) == 7, np.nan, ROOM))
    with pytest.raises(ValueError, match=r"no column of numbers .*; its cells are such as '20.00 of 30'"):
        read_log(write("time;Room\n" + rows_of(STAMPS, sep=";").replace("\n", " of 30\n")))


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        ("time;Room;Room Quality;Power", "{};{};{};1.5"),
        ("time;Room;Status;Power;Status", "{};{};{};1.5;Good"),
        ("tag;time;value;quality", "Room;{};{};{}"),
    ],
)
@pytest.mark.parametrize(("good", "bad"), [("Good", "Bad"), ("OK", "Comm fault"), (192, 0)])
def test_values_of_bad_quality_are_missing(write, header, rows, good, bad):
    """A historian writes 0 or the last value beside the word."""
    at = np.arange(60) % 10 == 3
    cells = zip(STAMPS, np.where(at, 0.0, ROOM), np.where(at, bad, good), strict=True)
    log = read_log(write("\n".join([header, *(rows.format(*row) for row in cells)])))
    np.testing.assert_allclose(log.frame["Room"].reindex(STAMPS), np.where(at, np.nan, ROOM))
    assert any("6 cells such as" in note for note in log.notes)


def test_each_of_two_columns_judges_the_values_of_a_long_table(write):
    judged = {3: "bad,ok", 5: "good,fault", 7: "bad,fault"}
    rows = [f"2024-01-15 {h:02d}:00,room temp,{20 + h / 10},{judged.get(h, 'good,ok')}" for h in range(24)]
    log = read_log(write("\n".join(["time,point,value,quality,status", *rows])))
    assert list(np.flatnonzero(log.frame["room temp"].isna())) == list(judged)


@pytest.mark.parametrize(
    ("header", "end"),
    [
        ("Room;Room Quality;Room Status;Power", ";1.5"),
        ("Room;Quality;Status;Power;Quality;Status", ";1.5;good;ok"),
    ],
)
def test_each_of_two_columns_judges_the_values_of_a_channel(write, header, end):
    judged = {3: "bad;ok", 5: "good;fault", 7: "bad;fault"}
    rows = [f"{stamp};{ROOM[k]};{judged.get(k, 'good;ok')}{end}" for k, stamp in enumerate(STAMPS)]
    log = read_log(write("\n".join([f"time;{header}", *rows])))
    assert list(np.flatnonzero(log.frame["Room"].isna())) == list(judged)
    assert log.frame["Power"].notna().all()


def test_the_state_of_a_plant_after_a_quality_judges_nothing(write):
    rows = [f"{stamp};{ROOM[k]};good;1.5;good;{'fault' if k < 5 else 'ok'}" for k, stamp in enumerate(STAMPS)]
    log = read_log(write("time;Room;Room Quality;Power;Power Quality;Boiler status\n" + "\n".join(rows)))
    assert log.frame["Power"].notna().all()


def test_the_state_of_a_plant_is_no_quality(write):
    cells = [f"{stamp};{ROOM[k]};{'fault' if k < 5 else 'ok'};7" for k, stamp in enumerate(STAMPS)]
    log = read_log(write("time;Room;Boiler status;Status\n" + "\n".join(cells)))
    np.testing.assert_allclose(log.frame["Room"], ROOM)


def test_rows_that_are_no_data_are_left_out(write):
    """Footers with a number in their first cell were refused."""
    rows = rows_of(STAMPS).splitlines()
    rows[20:20] = ["", "Page 3 of 9", "time,Room"]
    log = read_log(write("\n".join(["time,Room", *rows, "Total,1200", "60 rows,", "Created on 2024-03-03 12:00"])))
    np.testing.assert_allclose(log.frame["Room"], ROOM)


def daily(values):
    """A log of ten days by the hour with a role whose values are made of the hour of the day."""
    stamps = pd.date_range("2024-03-01", periods=240, freq="1h", name="time")
    room = 20.0 + np.sin(np.arange(240) / 9.0)
    return {"T_za": room, "T_oa": room - 15.0, **{role: of(stamps) for role, of in values.items()}}, stamps


@pytest.mark.parametrize(
    ("role", "values", "is_zero"),
    [
        ("q_sol", lambda t: np.where((t.hour > 6) & (t.hour < 18), 0.2, np.nan), True),
        ("Q_heat", lambda t: np.where((t.hour > 5) & (t.hour < 22), 2.0 + 0.1 * t.hour, np.nan), True),
        ("u_heat", lambda t: np.where(t.hour % 3 > 0, 0.5, np.nan), True),
        ("Q_heat", lambda t: np.where(t.hour > 5, 2.0 * (t.hour < 22), np.nan), False),  # it is 0 in other rows
        ("Q_heat", lambda t: np.where(t.day > 3, 2.0, np.nan), False),  # an outage
        ("Q_heat", lambda t: np.where(t.hour % 3 == 0, 2.0, np.nan), False),  # it has a row every three hours
        ("T_floor", lambda t: np.where(t.hour > 5, 25.0, np.nan), False),
    ],
)
def test_inputs_that_are_blank_where_they_are_0(write, role, values, is_zero):
    """A log whose sun is blank at night was refused, and heat of a plant that is off was interpolated."""
    columns, stamps = daily({role: values})
    path = write(pd.DataFrame(columns, stamps).to_csv())
    known = values(stamps)
    report = LogReport(read_log(path), {name: name for name in columns})
    np.testing.assert_allclose(report.frame[role], np.where(np.isnan(known) & is_zero, 0.0, known))
    assert any("hardly ever 0: taken as 0 there" in found.text for found in report.findings) == is_zero


def test_energy_of_a_row_and_power_in_watts_may_be_9999(write):
    heat = np.where(np.arange(60) == 7, 9999.0, 6000.0 + 50.0 * np.arange(60))
    path = write(pd.DataFrame({"HVAC (W)": heat}, STAMPS).rename_axis("time").to_csv())
    assert LogReport(read_log(path)).frame["Q_hvac"].iloc[7] == 9.999


@pytest.mark.parametrize(
    ("name", "values", "role", "told"),
    [
        ("solarIntensity", ROOM * 4.0, None, "may be percent, or W/m2 of a dark season"),
        ("solarIntensity (W/m2)", ROOM * 4.0, "q_sol", "irradiance"),
        ("q_sol", ROOM * 4.0, "q_sol", "W/m2 is assumed"),
        (
            "heatingPower",
            np.roll(np.arange(60.0), 1),
            "u_heat",
            "as those of a stage; values reach 59: percent is assumed",
        ),
        ("heatingPower", 30.0 + 0.5 * np.arange(60) * (-1) ** np.arange(60), "Q_heat", "kW is assumed"),
        ("heatingPower (kW)", np.arange(60.0), "Q_heat", "power or energy"),
    ],
)
def test_percent_without_a_unit_is_neither_irradiance_nor_heat(name, values, role, told):
    report = LogReport(pd.DataFrame({name: values}, STAMPS))
    assert report.columns.loc[name, "role"] == role
    assert told in report.columns.loc[name, "reason"]


def test_cooling_with_both_signs_is_the_heat_of_the_plant():
    frame = pd.DataFrame({"T_za": ROOM, "Cooling power (kW)": np.sin(np.arange(60.0))}, STAMPS)
    (found,) = (f for f in LogReport(frame).findings if f.level == "error")
    assert found.text == "goes from -1 to 0.9999 kW: if it heats and cools, give it as Q_hvac, positive where it heats."
    settings = settings_from(
        {"name": "z", "columns": {"T_za": "a", "T_oa": "b", "Q_cool": "Cooling power (kW)"}, "step": "1h"}
    )
    with pytest.raises(ValueError, match=r"Cooling power \(kW\) \(Q_cool\) is often positive and often negative"):
        metered_heat(frame.rename(columns={"Cooling power (kW)": "Q_cool"}), settings)


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "ValueError-like: T_za holds 999 degC: set such values to NaN, or convert the column with "
            "skhybrid.preprocessing.UnitConverter.",
            "leave such cells of the log empty, or give its unit under [units] of the configuration.",
        ),
        (
            "UnitWarning: convert it with skhybrid.preprocessing.UnitConverter.",
            "give its unit under [units] of the configuration.",
        ),
        (
            "pass one, such as known={'Q_h': nameplate kW}, or",
            "such as known = { Q_h = nameplate kW } in [estimator], or",
        ),
        ("stays at its default; pass it in known= or add days", "pass it in known of [estimator] or add days"),
        ("holidays= has 'x', which is no date.", "holidays in the configuration has 'x', which is no date."),
        ("holidays= (int) is neither.", "holidays in the configuration (int) is neither."),
        ("pass its name as time_column=.", "pass its name as time_column = in the configuration."),
        ("give that as timezone=, such as 'UTC'.", "give that as timezone = in the configuration, such as 'UTC'."),
        ("dayfirst=True or dayfirst=False.", "dayfirst = true or dayfirst = false."),
        ("pass its separator, such as sep=';'.", "pass its separator, such as sep = ';'."),
        (
            "name that as point_column=; needs table= or query=",
            "as point_column = in [log]; needs table = in [log] or query = in [log]",
        ),
        ("read them with table='statistics'.", "read them with table = 'statistics' in [log]."),
        ("or pass setpoint= for an ideal plant.", "or pass --setpoint for an ideal plant."),
        ("do not plan with it; fit with purpose='plan'; let it run.", "do not plan with it; let it run."),
        (
            "there is no timezone = here, and 21,24 of --setpoint",
            "there is no timezone = here, and 21,24 of --setpoint",
        ),
    ],
)
def test_those_who_use_no_python_are_told_what_they_can_do(said, shown):
    assert without_python(said).endswith(shown)
    assert "UnitWarning" not in without_python(said)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("ZONE_TEMP.PV", "T_za"),
        ("OUTDOOR TEMP.PresentValue", "T_oa"),
        ("sensor.pv", None),
        ("OAT_PV", "T_oa"),
        ("Space Temperature Active", "T_za"),
        ("Space Temperature Setpoint Active", "T_heat_set"),
        ("Heating active", "u_heat"),
        ("Plug load (kW)", None),  # it was the plant's heat
        ("Zone load (kW)", "Q_hvac"),
        ("Sonnenscheindauer [min]", None),  # it was the sun, as were those below
        ("sensor.sun_solar_elevation", None),
        ("Sun blind position (%)", None),
        ("Site Horizontal Infrared Radiation Rate per Area [W/m2](TimeStep)", None),
        ("Sonneneinstrahlung", "q_sol"),
        ("Globalstrahlung Stundenmittel", "q_sol"),
        ("HeatFlow (kBTU/hr)", "Q_heat"),
        ("Heat flow temp (°C)", None),
        ("R001'RTemp [°C]", "T_za"),
        ("Puissance CVC (kW)", "Q_hvac"),
        ("Potencia climatización (kW)", "Q_hvac"),
        ("Puissance climatisation (kW)", "Q_cool"),
        ("Consigna calefacción", "T_heat_set"),
        ("Consigna frío", "T_cool_set"),
        ("Setpunt koeling", "T_cool_set"),
        ("drybulb", "T_oa"),
        ("Outdoor Wetbulb Temp", None),  # it came before the dry bulb beside it
        ("Temp ext prévision", None),
        ("Setpoint shift", None),
        ("Boiler oil (l)", None),  # it was a stage
        ("Heat meter pulses", None),
        ("Compressor frequency [Hz]", None),  # it cooled
        ("Heating (W/m2)", None),  # it was the sun
        ("Apparent temperature outdoor", None),
        ("Troom_C", "T_za"),
        ("Teplota v místnosti", "T_za"),
        ("Venkovní teplota", "T_oa"),
        ("Žádaná teplota", "T_heat_set"),
        ("Topení", "u_heat"),
        ("Temp, °F (LGR S/N: 10, SEN S/N: 12, LBL: Outdoor)", "T_oa"),
    ],
)
def test_names_of_building_systems(name, role):
    assert guess_role(name, unit_in_name(name)).role == role


def test_of_two_columns_the_one_that_is_measured_counts():
    names = ["Max heating power (kW)", "Heating power (kW)", "Outdoor ground temp", "Outdoor air temp"]
    roles = LogReport(pd.DataFrame(np.tile(ROOM[:, None], 4), STAMPS, names)).roles
    assert roles == {"Q_heat": names[1], "T_oa": names[3]}


def test_outdoor_air_in_tenths_of_a_degree_without_a_room(write):
    """KNMI writes T in 0.1 degC; on a cold day no value is too high."""
    outdoor = np.round(60.0 + 70.0 * np.sin(np.arange(60) / 4.0))
    report = LogReport(pd.DataFrame({"Outdoor temperature": outdoor}, STAMPS))
    np.testing.assert_allclose(report.frame["T_oa"], outdoor / 10.0)
    slow = LogReport(pd.DataFrame({"Outdoor temperature": np.round(outdoor / 10.0)}, STAMPS))
    np.testing.assert_allclose(slow.frame["T_oa"], np.round(outdoor / 10.0))


@pytest.mark.parametrize(("name", "hours"), [("period_end", 1), ("time", 0)])
def test_weather_whose_stamps_end_its_hours(write, name, hours):
    """Solcast stamps the end; the irradiance of the hour before it belongs to its beginning."""
    sun = 100.0 + np.arange(60)
    frame = pd.DataFrame({"air_temp": ROOM, "ghi": sun}, (STAMPS + pd.Timedelta(hours=hours)).rename(name))
    settings = settings_from({"name": "z", "columns": {"T_za": "a", "T_oa": "b"}, "step": "1h"})
    found = read_ahead(write(frame.to_csv()), settings, None, 2024)
    np.testing.assert_allclose(found["q_sol"].reindex(STAMPS[1:-2]), sun[1:-2] / 1000.0)


def blank_at_night(plant, zone=""):
    """A log of a week whose set-points are blank from 22 to 6 h, with its plant."""
    stamps = pd.date_range("2024-03-04", periods=7 * 24, freq="1h", name="time")
    day = (stamps.hour >= 6) & (stamps.hour < 22)
    room = 17.0 + 4.0 * day + 0.01 * np.arange(len(stamps)) % 0.5
    frame = pd.DataFrame({f"T_za{zone}": room, "T_oa": 5.0, f"T_heat_set{zone}": np.where(day, 21.0, np.nan)}, stamps)
    return frame.assign(**{name: values(day, stamps) for name, values in plant.items()}), day


@pytest.mark.parametrize("zone", ["", "_hall"])
@pytest.mark.parametrize(
    ("plant", "filled"),
    [
        ({"Q_hvac": lambda day, t: 2.0 * day}, True),
        ({"Q_hvac": lambda day, t: np.where(day, 2.0, -1.0)}, True),  # it cools at night
        ({"Q_hvac": lambda day, t: 2.0 - day}, False),
        ({"u_heat": lambda day, t: 0.5 * day, "u_cool": lambda day, t: 1.0 - day}, True),
        ({"u_heat": lambda day, t: np.where(day, 0.5, np.nan)}, False),
        ({}, False),
    ],
)
def test_a_blank_set_point_of_a_plant_that_is_off(plant, filled, zone):
    """Held at 21 degC, the errors of a forecast under set-points were three times those with the true set-back."""
    frame, day = blank_at_night({f"{role}{zone}": values for role, values in plant.items()}, zone)
    found, remarks = filled_setpoints(frame)
    held = np.where(np.isin(np.arange(len(day)), [*range(6), 166, 167]), np.nan, 21.0)  # neither before nor after
    np.testing.assert_array_equal(found[f"T_heat_set{zone}"], np.where(day, 21.0, 14.0) if filled else held)
    rows = "56 rows in which the plant is off: 14 degC" if filled else "48 rows, first 2024-03-04 22:00:00: that of the"
    assert remarks[0].remark.startswith(f"T_heat_set{zone} is missing in {rows}")
    assert len(remarks) == 1
    assert found.drop(columns=f"T_heat_set{zone}").equals(frame.drop(columns=f"T_heat_set{zone}"))


def test_a_zone_whose_name_ends_that_of_another_has_its_own_plant_alone():
    """The heater of a master bedroom was taken for one of the bedroom, since its role ends with that name too."""
    frame, day = blank_at_night({"Q_hvac_bedroom": lambda day, t: 2.0 * day}, "_bedroom")
    other = {"T_za_master_bedroom": 20.0, "Q_hvac_master_bedroom": 1.0 + np.arange(len(frame)) % 3}
    found, _ = filled_setpoints(frame.assign(**other))
    np.testing.assert_array_equal(found["T_heat_set_bedroom"], np.where(day, 21.0, 14.0))
    stuck = frame.assign(**other, T_za_bedroom=21.0, T_heat_set_bedroom=21.0, Q_hvac_bedroom=0.0)
    assert without_standstills(stuck, "T_za_bedroom").isna().sum() == len(frame) - 1
    mode, _ = mode_of_plant(stuck.assign(Q_hvac_bedroom=-1.0), "_bedroom")
    assert set(mode) == {COOLS}


def test_a_blank_set_point_is_that_of_the_plants_of_its_room():
    """The plants of other rooms counted as its own: by the end of their names, or where it had none."""
    heats = {"u_heat_hall": lambda day, t: 0.5 * day, "u_heat_big_hall": lambda day, t: 1.0 - day}
    frame, day = blank_at_night(heats, "_hall")
    found = filled_setpoints(frame.assign(T_za_big_hall=frame["T_za_hall"]))[0]
    np.testing.assert_array_equal(found["T_heat_set_hall"], np.where(day, 21.0, 14.0))
    unheated = frame.assign(T_za_attic=10.0, T_heat_set_attic=frame["T_heat_set_hall"])
    assert "T_heat_set_attic is missing in 48 rows, first" in filled_setpoints(unheated)[1][-1].remark
    # heat that is named by the room alone is negative where it cools
    frame, day = blank_at_night({"Q_hall": lambda day, t: np.where(day, 2.0, -1.0)}, "_hall")
    np.testing.assert_array_equal(filled_setpoints(frame)[0]["T_heat_set_hall"], np.where(day, 21.0, 14.0))


def test_a_blank_set_point_that_rooms_share_is_that_of_all_their_plants():
    """It was held over the night, as that of a single zone is not."""
    heats = {f"u_heat_{zone}": lambda day, t: 0.5 * day for zone in ("hall", "attic")}
    frame, day = blank_at_night(heats, "_hall")
    frame = frame.rename(columns={"T_heat_set_hall": "T_heat_set"}).assign(T_za_attic=frame["T_za_hall"] - 2.0)
    np.testing.assert_array_equal(filled_setpoints(frame)[0]["T_heat_set"], np.where(day, 21.0, 12.0))
    runs = frame.assign(u_heat_attic=1.0 - 0.5 * day)
    assert filled_setpoints(runs)[0]["T_heat_set"].min() == 21.0


@pytest.mark.parametrize("role", ["Q_hvac_hall", "Q_heat_hall", "Q_hall"])
@pytest.mark.parametrize("mode", ["mode", "mode_hall"])
def test_heat_of_a_room_cools_where_its_mode_says_so(role, mode):
    """Heat that is named by the room alone stayed positive, as if cold were heat."""
    stamps = pd.date_range("2024-06-01", periods=48, freq="1h")
    signs = np.where(np.arange(48) < 24, 1.0, -1.0)
    log = pd.DataFrame({"T_za_hall": 20.0, "T_oa": 9.0, role: 2.0, mode: signs, "T_za_attic": 20.0}, stamps)
    assert in_force(log, [], [])[role].tolist() == (2.0 * signs).tolist()


def test_the_mode_of_a_room_is_that_of_its_own_plant():
    """A room whose name ends with that of another has plants of its own."""
    stamps = pd.date_range("2024-06-01", periods=96, freq="1h")
    log = pd.DataFrame({"T_za_hall": 20.0, "u_heat_hall": 0.5, "T_za_big_hall": 20.0, "u_cool_big_hall": 1.0}, stamps)
    assert sides_of_plant(log, "_hall") == ({HEATS}, True)
    assert sides_of_plant(log, "_big_hall") == ({COOLS}, True)


def test_single_blanks_of_a_set_point_are_gaps():
    frame, _ = blank_at_night({"Q_hvac": lambda day, t: 0.0 * day})
    frame["T_heat_set"] = np.where(np.arange(len(frame)) % 10 == 3, np.nan, 21.0)
    assert filled_setpoints(frame)[1] == []


def test_set_points_that_are_not_logged_for_a_week_are_those_of_another_week():
    """In one room of a building: a study was refused, and other commands held the last one, of the night."""
    stamps = pd.date_range("2024-03-04", periods=21 * 24, freq="1h")
    true = np.where((stamps.hour >= 6) & (stamps.day_of_week < 5), 21.0, 17.0)
    true[15 * 24 :] += 1.0  # so that the week after is not the one before
    log = pd.DataFrame({"T_za_hall": 20.0, "Q_hvac_hall": 1.0, "T_heat_set_hall": true}, stamps)
    log.iloc[8 * 24 : 15 * 24, 2] = np.nan
    found, ((remark, _),) = filled_setpoints(log)
    np.testing.assert_array_equal(found["T_heat_set_hall"], true)
    assert remark.startswith("T_heat_set_hall is missing in 168 rows, first 2024-03-12 00:00:00: that of the week")


def test_blank_set_points_are_filled_where_a_log_is_read(write):
    frame, _ = blank_at_night({"Q_hvac": lambda day, t: 2.0 * day})
    path = write(frame.to_csv())
    settings = settings_from({"name": "z", "columns": {role: role for role in frame}, "step": "1h"})
    rows, report = read_zone_log(path, settings)
    assert rows["T_heat_set"].min() == 14.0
    assert "14 degC, which the room does not reach, is taken there" in report
    assert any("14 degC" in found.text for found in LogReport(read_log(path)).findings)


@pytest.mark.parametrize("mixed", [False, True])
def test_numbers_that_a_workbook_keeps_as_text(tmp_path, mixed):
    """With three decimals and a comma they are no thousands, unless other cells are numbers with a point."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["time", "Room", "Stage"])
    for stamp, room in zip(STAMPS, ROOM, strict=True):
        book.active.append([f"{stamp:%d.%m.%Y %H:%M}", f"{room:.3f}".replace(".", ","), 0.5 if mixed else 1])
    book.save(tmp_path / "log.xlsx")
    log = read_log(tmp_path / "log.xlsx")
    np.testing.assert_allclose(log.frame["Room"], ROOM * (1000.0 if mixed else 1.0))
    assert any("are read as thousands; if they are decimals" in note for note in log.notes) == mixed


def test_two_values_of_a_point_at_a_stamp_are_refused(write):
    """Of rooms that another column tells apart, the last was taken."""
    lines = [f"{stamp};temperature;{ROOM[k] + room};{room}" for k, stamp in enumerate(STAMPS) for room in (0, 1)]
    path = write("time;point;value;room\n" + "\n".join(lines))
    with pytest.raises(ValueError, match="two or more values of 'temperature' at 60 stamps"):
        read_log(path)
    assert list(read_log(path, point_column="room").frame) == ["0", "1"]


@pytest.mark.parametrize("reader", [delimited, spreadsheet, columnar, sql_table])
@pytest.mark.parametrize("share", [0.4, 0.8])
@pytest.mark.parametrize(
    ("zones", "apart", "grouped"),
    [
        (("Hall", "Kitchen"), 0, False),
        (("Hall", "Kitchen"), 20, False),
        (("Hall", "Kitchen"), 0, True),
        ((1, 2), 0, False),
    ],
)
def test_a_row_for_each_zone_and_stamp(tmp_path, monkeypatch, reader, share, zones, apart, grouped):
    """The rows of all rooms were mixed in one column of each quantity, with a note on stamps that occur twice."""
    table = pd.DataFrame(
        [
            (stamp + pd.Timedelta(minutes=apart * room), zone, ROOM[k] + room, 21 - room, 5 + k / 10)
            for k, stamp in enumerate(STAMPS)
            for room, zone in enumerate(zones)
        ],
        columns=["timestamp", "zone", "temperature [°C]", "setpoint [°C]", "outdoor temp [°C]"],
    )
    if grouped:
        table = table.sort_values(["zone", "timestamp"])
    path = tmp_path / "log.xlsx"
    size, write = {
        delimited: ("_HEAD", lambda: table.to_csv(path, index=False, sep=";")),
        spreadsheet: ("_HEAD", lambda: table.to_excel(path, index=False)),
        columnar: ("SAMPLE", lambda: table.to_parquet(path, index=False)),
        sql_table: ("SAMPLE", lambda: table.to_sql("log", f"sqlite:///{path}", index=False)),
    }[reader]
    write()
    # the head is of one zone, or of one and a part of the next, where rows are grouped
    monkeypatch.setattr(reader, size, int(share * (path.stat().st_size if reader is delimited else len(table))))
    log = read_log(path)
    own = [f"zone {zone}" if zone == room + 1 else zone for room, zone in enumerate(zones)]
    quantities = ["temperature [°C]", "setpoint [°C]"]
    assert set(log.frame) == {f"{zone} {one}" for zone in own for one in quantities} | {"outdoor temp [°C]"}
    assert set(log.units) == set(log.frame)
    for room, zone in enumerate(own):
        at = STAMPS + pd.Timedelta(minutes=apart * room)
        np.testing.assert_allclose(log.frame.loc[at, f"{zone} temperature [°C]"], ROOM + room)
        np.testing.assert_allclose(log.frame.loc[at, "outdoor temp [°C]"], 5 + np.arange(60) / 10)
    assert any("a row for each 'zone'" in note for note in log.notes)


def test_a_zone_without_a_quantity_has_no_column_of_it_and_halves_of_a_day_are_no_zones(write):
    rows = "".join(f"{stamp};Hall;20.5;21\n{stamp};Outside;5.5;\n" for stamp in STAMPS)
    log = read_log(write(f"time;zone;temperature;setpoint\n{rows}"))
    assert list(log.frame) == ["Hall temperature", "Outside temperature", "Hall setpoint"]
    clock = [(stamp.strftime("%Y-%m-%d %I:%M"), stamp.strftime("%p")) for stamp in STAMPS]
    rows = "".join(f"{time};{half};20.5;21\n" for time, half in clock)
    assert list(read_log(write(f"time;AM/PM;temperature;setpoint\n{rows}")).frame) == ["temperature", "setpoint"]


@pytest.mark.parametrize(("header", "row"), [("id;ts;val;ack;q\n", "{1};{0};{2};true;0\n"), ("", "{0} home/{1} {2}\n")])
def test_a_row_for_each_value_of_a_point_that_has_no_usual_name(write, header, row):
    """Of ioBroker and MQTT: all values were mixed in one column."""
    points = {"hall.temp": ROOM, "outdoor.temp": ROOM - 15.0}
    rows = (row.format(stamp, name, values[k]) for k, stamp in enumerate(STAMPS) for name, values in points.items())
    log = read_log(write(header + "".join(rows)))
    assert [name.removeprefix("home/") for name in log.frame] == list(points)
    np.testing.assert_allclose(log.frame.to_numpy(), np.stack(list(points.values()), axis=1))


def test_the_points_of_a_long_sheet_are_no_zones(tmp_path):
    points = {"Room temp": ROOM, "Outdoor temp": ROOM - 15.0}
    rows = [(stamp, name, values[k]) for k, stamp in enumerate(STAMPS) for name, values in points.items()]
    pd.DataFrame(rows, columns=["time", "point", "value"]).to_excel(tmp_path / "log.xlsx", index=False)
    assert list(read_log(tmp_path / "log.xlsx").frame) == list(points)


def test_a_numbered_sensor_is_no_zone(write):
    rows = "".join(f"{stamp};{k};{ROOM[k]};45\n" for stamp in STAMPS for k in (1, 2))
    assert list(read_log(write(f"time;sensor_id;temp;rh\n{rows}")).frame)[:2] == ["sensor 1 temp", "sensor 2 temp"]


@pytest.mark.parametrize("words", [("heat", "off"), ("on", "off")])
def test_words_that_are_no_zones(write, words):
    rows = "".join(f"{stamp};{words[k % 2]};{ROOM[k]}\n" for k, stamp in enumerate(STAMPS))
    log = read_log(write(f"time;thermostat;room temp\n{rows}"))
    np.testing.assert_allclose(log.frame["room temp"], ROOM)


def test_a_state_of_a_thermostat_is_no_zone(write):
    """The temperatures under ``auto`` and ``manual`` became those of two rooms."""
    rows = "".join(f"{stamp};{('auto', 'manual')[k // 15 % 2]};{ROOM[k]}\n" for k, stamp in enumerate(STAMPS))
    log = read_log(write(f"time;thermostat;room temp\n{rows}"))
    assert list(log.frame) == ["room temp"]
    np.testing.assert_allclose(log.frame["room temp"], ROOM)


def test_a_zone_of_a_row_that_has_no_stamp_is_named_by_its_line(write):
    rows = "".join(f"{stamp};{zone};20.5;21\n" for stamp in STAMPS for zone in ("Hall", "Bath"))
    with pytest.raises(ValueError, match=r"row 122 of 'log\.csv': the time stamp '2024-13-45' is not a date"):
        read_log(write(f"time;zone;temperature;setpoint\n{rows}2024-13-45;Hall;20.5;21\n"))


def test_a_table_with_fewer_names_than_cells_is_refused_in_a_sentence(write):
    with pytest.raises(ValueError, match="has no column of numbers beside its time stamps"):
        read_log(write('ol",\n"24-10-19 11:00:00","",'))


@pytest.mark.parametrize("header", ["id,time,Room,Outdoor", ",time,Room,Outdoor"])
def test_names_that_lie_beside_their_cells_are_refused(write, header):
    lines = [f"{stamp},{ROOM[k]},5.0" for k, stamp in enumerate(STAMPS)]
    with pytest.raises(ValueError, match="names the column after its time stamps 'time'"):
        read_log(write("\n".join([header, *lines])))
    log = read_log(write("\n".join([header, *(f"{k},{row}" for k, row in enumerate(lines))])))
    np.testing.assert_allclose(log.frame["Room"], ROOM)


def test_a_table_in_markdown(write):
    rows = [f"| {stamp} | {ROOM[k]:.2f} | 5.0 |" for k, stamp in enumerate(STAMPS)]
    log = read_log(write("\n".join(["| time | Room (°C) | HVAC kW |", "| :--- | ---: | ---: |", *rows])))
    np.testing.assert_allclose(log.frame["Room (°C)"], ROOM)


def one_set_point(cools_from=30, both_from=60, n=24):
    """A log of sixty days with one set-point, which heats, and cools from a day on; the true set-points."""
    stamps = pd.date_range("2024-03-01", periods=60 * n, freq=pd.Timedelta("1D") / n, name="time")
    day = np.arange(len(stamps)) // n
    cools, both, runs = day >= cools_from, day >= both_from, (stamps.hour > 7) & (stamps.hour < 18) & (day % 7 > 1)
    want = np.where(cools, 24.0, 20.0) + (stamps.hour > 6)
    columns = {"Room temp": 21.0 + 2.0 * cools, "Outdoor temp": np.where(cools, 26.0, 4.0), "T_set": want}
    plant = {"Heating stage": 0.5 * runs * (~cools | both), "Cooling stage": 0.5 * np.roll(runs, 1) * (cools | both)}
    true = pd.DataFrame({"T_heat_set": np.where(cools, 5.0, want), "T_cool_set": np.where(cools, want, 40.0)}, stamps)
    return pd.DataFrame(columns | plant, stamps), cools, true


WORDS = {
    "hvac_mode": ("heat", "cool", "off"),
    "Betriebsart": ("Heizen", "Kühlen", "Aus"),
    "season": ("winter", "summer", ""),
}


@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize("held", [False, True])
def test_one_set_point_heats_or_cools_as_the_mode_says(write, name, held):
    """It was that of heating in summer too, and nothing cooled: the room of a day ahead was 1 K off in place of 0.2."""
    frame, cools, true = one_set_point(n=96 if held else 24)
    off = (np.arange(len(frame)) % 960 < 12) & bool(WORDS[name][2])
    frame[name] = np.where(off, WORDS[name][2], np.where(cools, WORDS[name][1], WORDS[name][0]))
    frame.iloc[-24:, [0, 3, 4]] = np.nan  # rows ahead
    if held:  # written where they change
        frame[["T_set", name]] = frame[["T_set", name]].where(frame[["T_set", name]].ne(frame[["T_set", name]].shift()))
    path = write(frame.to_csv())
    report = LogReport(read_log(path))
    assert report.roles.items() >= {"T_heat_set": "T_set", "T_cool_set": "T_set", "mode": name}.items()
    assert any(f"it heats or cools as {name!r} says" in found.text for found in report.findings)
    config = write(propose_settings(path, report), name="zone.toml")
    rows = read_zone_log(path, read_settings(config))[0]
    if off.any():
        true = true.assign(T_heat_set=true["T_heat_set"].mask(off, 5.0), T_cool_set=true["T_cool_set"].mask(off, 40.0))
    pd.testing.assert_frame_equal(rows[list(true)], true, check_freq=False, check_names=False)


def test_the_mode_of_a_room_is_not_that_of_another_whose_name_has_its_name(write):
    """The bedroom had none, as two modes have its name."""
    house, rooms = one_set_point()[0], ("bedroom", "master bedroom", "kitchen")
    frame = pd.concat([house.drop(columns="Outdoor temp").add_prefix(f"{room} ") for room in rooms], axis=1)
    modes = {
        f"{room} mode": np.where(np.arange(len(frame)) // 24 % 9 == k, "cool", "heat") for k, room in enumerate(rooms)
    }
    roles = LogReport(read_log(write(frame.assign(**{"Outdoor temp": house["Outdoor temp"]}, **modes).to_csv()))).roles
    assert {role: name for role, name in roles.items() if role.startswith("mode")} == {
        f"mode_{room.replace(' ', '_')}": f"{room} mode" for room in rooms
    }


def test_one_set_point_heats_or_cools_as_the_plant_did(write):
    frame, cools, true = one_set_point()
    frame.iloc[-24:, [0, 3, 4]] = np.nan
    path = write(frame.to_csv())
    report = LogReport(read_log(path))
    told = [found for found in report.findings if found.where == "T_set"]
    assert [(found.level, "as the plant did" in found.text) for found in told] == [("note", True)]
    rows = read_zone_log(path, read_settings(write(propose_settings(path, report), name="zone.toml")))[0]
    first = np.flatnonzero(cools)[:24]  # the heat of the day itself comes after the origins of its forecasts
    true.iloc[first, true.columns.get_loc("T_heat_set")] = frame["T_set"].to_numpy()[first]
    true.iloc[first, true.columns.get_loc("T_cool_set")] = 40.0
    pd.testing.assert_frame_equal(rows[list(true)], true, check_freq=False, check_names=False)


def test_one_set_point_of_a_plant_that_heats_and_cools_on_the_same_days_is_asked_about():
    report = LogReport(one_set_point(both_from=10)[0])
    (told,) = [found for found in report.findings if found.where == "T_set"]
    assert told.text.startswith("is one set-point, but the plant heats and cools on the same days: add a column that")
    assert "T_cool_set" not in report.roles
    heats = LogReport(one_set_point(cools_from=90)[0].drop(columns="Cooling stage"))
    assert not [found for found in heats.findings if found.where == "T_set"]


@pytest.mark.parametrize(
    ("name", "words", "kind"),
    [
        ("HVAC mode", ("auto", "off"), "mode"),
        ("HVAC mode", ("heating", "idle"), None),
        ("Boiler", ("heating", "off"), None),
        ("HVAC mode", ("heat", "cool", "off"), "mode"),
        ("HVAC", ("heating", "cooling", "idle"), "action"),
    ],
)
def test_words_of_a_mode_and_of_an_action(name, words, kind):
    assert kind_of_words(name, words) == kind


def test_the_mode_of_a_fan_is_not_that_of_a_thermostat(write):
    frame, *_ = one_set_point(cools_from=90)
    frame["Fan mode"] = np.where(np.arange(len(frame)) % 9, "auto", "off")
    assert "mode" not in LogReport(read_log(write(frame.to_csv()))).roles


@pytest.mark.parametrize(
    ("header", "told"),
    [
        ("time,Humidity,Outdoor", "line 32 of 'log.csv' names the columns anew, and 'Humidity' in place of 'Room'"),
        ("Date,Room temp,Outdoor temp", "and 'Room temp' in place of 'Room'; split the file there"),
        ("time,Outdoor,Room", "and 'Outdoor' at another place"),
        ("time,Room,Outdoor", None),
        ("Logger restarted by,Smith,", None),
        ("Created,31.10.2023,", None),  # above the next table of an export
    ],
)
def test_a_header_that_changes_in_mid_file_is_refused(write, header, told):
    """The humidity below a second header was taken for the room's temperature."""
    rows = [f"{stamp},{ROOM[k]:.2f},5.0" for k, stamp in enumerate(STAMPS)]
    path = write("\n".join(["time,Room,Outdoor", *rows[:30], header, *rows[30:]]))
    if told is None:
        np.testing.assert_allclose(read_log(path).frame["Room"], ROOM)
    else:
        with pytest.raises(ValueError, match=told):
            read_log(path)


@pytest.mark.parametrize(
    ("role", "rows", "told"),
    [
        ("T_oa", slice(120, None), "T_oa has no value after 2024-03-05 23:00:00, but T_za goes on to 2024-03-10 23:00"),
        ("q_sol", slice(0, 96), "q_sol has no value before 2024-03-05 00:00:00, but T_za begins at 2024-03-01 00:00"),
        ("T_za", slice(100, None), "T_za has no value after 2024-03-05 03:00:00, but Q_heat goes on to 2024-03-10"),
        ("T_za", slice(200, None), None),  # rows ahead with a plan
        ("T_oa", slice(230, None), None),
        ("T_oa", slice(216, None), None),  # it ends a day before
    ],
)
def test_a_column_that_is_lost_in_mid_file_is_named_with_its_stamp(role, rows, told):
    """``check`` said that half of its rows have no value, and studies took the first half of the log."""
    columns, stamps = daily({"q_sol": lambda t: 0.1 + 0.0 * t.hour, "Q_heat": lambda t: 1.0 * (t.hour > 5)})
    frame = pd.DataFrame(columns, stamps)
    frame.iloc[rows, frame.columns.get_loc(role)] = np.nan
    said = [text for text in doubts_on_log(frame, ["T_za"]) if "no value" in text]
    assert [text.startswith(told or "-") for text in said] == ([True] if told else [])
    found = [f"{finding.where} {finding.text}" for finding in LogReport(frame).findings if finding.level == "warning"]
    assert any(text.startswith(told or "-") for text in found) == (told is not None)


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
@pytest.mark.parametrize("hours", [0.0, 1.0, -1.0])
def test_a_clock_that_was_set_is_told_by_the_sun(zone, hours):
    office = make_office(60, "chicago", start="2023-03-01", random_state=0, sampling_time="1h").X
    stamps = pd.DatetimeIndex(office.index)
    stamps = stamps.where(stamps < "2023-04-05", stamps + pd.Timedelta(hours=hours))
    if zone:  # a log in standard time whose wall clock has daylight saving
        stamps = stamps.tz_localize("Etc/GMT-1").tz_convert(zone)
    told = [text for text in doubts_on_log(office.set_axis(stamps), ["T_za"]) if "sun" in text]
    way = "later" if hours > 0 else "earlier"
    assert len(told) == (hours != 0.0)
    assert all(text.startswith("q_sol: from 2023-04-05 on, the sun rises and sets about 1 h " + way) for text in told)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_daylight_saving_of_a_known_zone_is_no_clock_that_was_set(number):
    sun = load_dutch_home(number).X["q_sol"]
    assert clock_jumps(sun) == []
    wall = clock_jumps(sun.set_axis(pd.DatetimeIndex(sun.index).tz_localize(None)))
    assert [day for day, _ in wall] == ([pd.Timestamp("2021-10-31")] if number > 1 else [])


@pytest.mark.parametrize("form", ["({:.2f})", "{:.2f}-"])
def test_negative_numbers_of_accounts(write, form):
    """4.10- was 4.10 without a unit."""
    outdoor = ROOM - 20.3
    cells = [form.format(-value) if value < 0.0 else f"{value:.2f}" for value in outdoor]
    log = read_log(write("time;Outdoor\n" + "\n".join(f"{t};{x}" for t, x in zip(STAMPS, cells, strict=True))))
    np.testing.assert_allclose(log.frame["Outdoor"], outdoor)


@pytest.mark.parametrize(("on", "off"), [("VRAI", "FAUX"), ("Sí", "No"), ("Zapnuto", "Vypnuto"), ("På", "Av")])
def test_switches_in_other_languages(write, on, off):
    cells = [f"{stamp};{on if k % 2 else off}" for k, stamp in enumerate(STAMPS)]
    assert read_log(write("time;Heating\n" + "\n".join(cells))).frame["Heating"].tolist() == 30 * [0.0, 1.0]


def test_stamps_of_the_last_second_end_their_rows(write):
    """Means over an hour that are stamped 00:59:59 came an hour late."""
    log = read_log(write("time,Room\n" + rows_of(STAMPS + pd.Timedelta("59min59s"))))
    assert (log.frame.index == STAMPS + pd.Timedelta("1h")).all()
    assert log.label == "right"
    assert read_log(write("time,Room\n" + rows_of(STAMPS + pd.Timedelta("59s")))).label is None


def test_a_name_of_two_lines(write):
    rows = rows_of(STAMPS, sep=";").replace("\n", ";5\n")
    log = read_log(write('time;"Room\ntemp";Outdoor\n' + rows))
    np.testing.assert_allclose(log.frame["Room temp"], ROOM)


def test_points_one_below_the_other_are_an_error(write):
    """Of three points, the values of the first were taken, with a warning of stamps that occur twice."""
    parts = [f"Trend;{name}\nTime;Value\n" + rows_of(STAMPS, ROOM + k, sep=";") for k, name in enumerate("abc")]
    told = [found.text for found in LogReport(read_log(write("\n".join(parts)))).findings if found.level == "error"]
    assert told[0].startswith("120 of 180 rows have the stamp of another row and other values")


def test_a_meter_that_the_mode_makes_negative_is_no_mistake():
    """The report asked to give its heat as Q_hvac, which has a sign, but a meter of electricity has none."""
    mode = np.repeat([1.0, -1.0], 30)
    frame = pd.DataFrame({"T_za": ROOM, "T_oa": ROOM - 15.0, "hp": np.arange(60) % 3.0, "m": mode}, STAMPS)
    columns = {"T_za": "T_za", "T_oa": "T_oa", "Q_heat": "hp", "mode": "m"}
    columns |= dict.fromkeys(("T_heat_set", "T_cool_set"), "set")
    report = LogReport(frame.assign(set=21.0), columns)
    assert report.frame["Q_heat"].min() < 0.0 < report.frame["Q_heat"].max()
    assert not [found for found in report.findings if "goes from" in found.text]


@pytest.mark.parametrize(
    ("columns", "where", "told"),
    [
        ({"Heating status": 1.0 + np.arange(60) % 2}, None, None),
        ({"Solar (W/m2)": 0.5 + 0.2 * np.sin(np.arange(60))}, 0, "reaches 0.7 W/m2 only: is it in kW/m2?"),
        ({"HVAC (kW)": -3.0 * (np.arange(60) % 3 < 2)}, 0, "is negative in 67 % of the hours when it is 10 K colder"),
        ({"DNI (W/m2)": 400.0 + ROOM, "DHI (W/m2)": 100.0 + ROOM}, 0, "is a part of the sun's irradiance, by its name"),
        ({"Occ Heat SP": 21.0, "Unocc Heat SP": 17.0}, 0, "is the set-point of one mode, by its name"),
        (
            {"Radiator heat (kW)": ROOM, "Floor heating (kW)": np.sin(ROOM * 9)},
            1,
            "could be heat or cold of the plant beside",
        ),
        ({"Heat (kW)": ROOM, "Heating (W)": 1e3 * ROOM}, 1, None),  # the same in other units
        ({"Radiator heat (kW)": ROOM, "Floor heating (kW)": 0.0}, 1, None),  # it never ran
        (
            {
                "Radiator (kWh)": np.arange(60) // 2,
                "Floor heating (kWh)": np.cumsum(np.arange(60) % 7),
            },  # both only rise
            1,
            "could be heat or cold of the plant beside",
        ),
    ],
)
def test_columns_that_are_not_what_their_role_needs(columns, where, told):
    frame = pd.DataFrame({"Room temp": ROOM, "Outdoor temp": ROOM - 15.0, **columns}, STAMPS)
    report = LogReport(frame)
    warned = {
        (found.where, found.text) for found in report.findings if found.level == "warning" and found.where in columns
    }
    if told is None:
        assert not warned
    else:
        assert any(name == list(columns)[where] and text.startswith(told) for name, text in warned)
    assert "u_heat" not in report.roles  # codes of states are no percent


def test_a_meter_without_a_sign_cools_where_the_mode_says_so(write):
    """The electricity of a heat pump in summer was that of heating."""
    frame, cools, _ = one_set_point()
    heat = (frame["Heating stage"] + frame["Cooling stage"]).to_numpy()
    frame = frame[["Room temp", "Outdoor temp"]].assign(**{"HVAC (kW)": heat, "mode": np.where(cools, "cool", "heat")})
    report = LogReport(read_log(write(frame.to_csv())))
    np.testing.assert_allclose(report.frame["Q_hvac"], np.where(cools, -heat, heat))
    beside = frame.rename(columns={"HVAC (kW)": "Heating (kW)"}).assign(**{"Cooling stage": 1.0 * cools})
    np.testing.assert_allclose(LogReport(read_log(write(beside.to_csv()))).frame["Q_heat"], heat)


def test_the_action_of_a_plant_is_read_in_rows_that_lack_its_cooling(write):
    """A log of the weeks after has no word for it."""
    frame, *_ = one_set_point()
    heats = np.where(frame["Heating stage"] > 0.0, "heating", "idle")
    frame = frame.drop(columns=["Heating stage", "Cooling stage"])
    path = write(frame.assign(hvac_action=np.where(frame.index.day % 9 == 0, "cooling", heats)).to_csv())
    report = LogReport(read_log(path))
    assert report.roles["u_cool"] == "hvac_action: cooling"
    settings = read_settings(write(propose_settings(path, report), name="zone.toml"))
    rows = read_zone_log(write(frame.assign(hvac_action=heats).to_csv()), settings)[0]
    np.testing.assert_array_equal(rows["u_heat"], heats == "heating")
    np.testing.assert_array_equal(rows["u_cool"], 0.0)


@pytest.mark.parametrize("label", ["left", "right"])
def test_a_log_that_changes_its_step(write, label):
    fine = pd.date_range("2024-03-01", periods=480, freq="15min", tz="UTC")
    index = fine.append(pd.date_range("2024-03-06", periods=96, freq="1h", tz="UTC"))
    hours = np.where(index < "2024-03-06", 0.25, 1.0)
    log = pd.DataFrame({"Room temp [C]": 20.0, "Outdoor temp [C]": 5.0, "Heating energy [kWh]": 2.0 * hours}, index)
    log = log.assign(ghi=np.where(hours < 1.0, 0.1, np.arange(576) % 2))
    if label == "right":
        log.index += pd.to_timedelta(hours, unit="h")
    path = write(log.rename_axis("time").rename(columns={"ghi": "ghi [kW/m2]"}).to_csv())
    report = LogReport(read_log(path), label=label)
    assert "from 2024-03-06 00:00:00+00:00 on, a row comes every 1 h." in [finding.text for finding in report.findings]
    settings = settings_from({"columns": report.roles, "units": {"Q_heat": "kWh"}, "label": label, "step": "15min"})
    frame, _ = read_zone_log(path, settings)
    hourly = frame["2024-03-06":]
    assert (hourly["Q_hvac"] == 2.0).all()
    assert (frame["Q_hvac"] != 2.0).sum() == (label == "right")  # the last row of the first step
    assert (hourly["q_sol"] == hourly.index.hour % 2).all()


@pytest.mark.parametrize(
    ("header", "row", "unit"),
    [
        ("# time     tairmean\n", "  {h:12.6f}   {v:8.4f} \n", "h"),  # of IDA ICE, which was refused
        (" TIME\tTAIR\t\n h\tC\t\n", " {h:+.16E}\t{v:+.16E}\t\n", "h"),  # of TRNSYS
        ("time,TRooAir\n", "{s:.1f},{v:.4f}\n", "s"),  # of Modelica
        ("Time,Zone db T(C)\n", "{d:.6f},{v:.4f}\n", "d"),  # of ESP-r
        ("Time (min),Troom\n", "{m:.0f},{v:.4f}\n", "min"),
    ],
)
def test_the_time_of_a_simulation_counts_from_the_year_that_is_given(write, header, row, unit):
    stamps = pd.date_range("2018-09-24", periods=300, freq="15min", name="time")
    hours = (stamps - pd.Timestamp("2018-01-01")) / pd.Timedelta("1h")
    values = 20.0 + np.sin(np.arange(300) / 9.0)
    rows = (row.format(h=h, s=3600 * h, m=60 * h, d=1 + h / 24, v=v) for h, v in zip(hours, values, strict=True))
    path = write(header + "".join(rows))
    log = read_log(path, year=2018)
    assert (log.frame.index == stamps).all()
    np.testing.assert_allclose(log.frame.iloc[:, 0], values, atol=1e-4)
    assert any(f"are read as {unit} of the year 2017; give year =" in note for note in read_log(path).notes)


@pytest.mark.parametrize(
    ("name", "step"), [("Time [min]", "1h"), ("time [s]", "60s"), ("Time (h)", "60h"), ("time", "60s")]
)
def test_the_unit_in_the_name_of_a_time_counts(write, name, step):
    path = write(f"{name};T_room\n" + "".join(f"{60 * i};{20 + i % 7 / 10}\n" for i in range(50)))
    assert read_log(path).frame.index[1] - read_log(path).frame.index[0] == pd.Timedelta(step)


@pytest.mark.parametrize("column", ["index,T\n{k},20.5\n", "time,T\n{m},20.5\n", "time,T\n{k}7.5,20.5\n"])
def test_numbers_that_may_be_anything_are_no_time_of_a_simulation(write, column):
    header, row = column.split("\n")[:2]
    with pytest.raises(ValueError, match="no cell that is a time stamp"):
        read_log(write(f"{header}\n" + "".join(f"{row.format(k=k, m=15 * k)}\n" for k in range(50))))


def test_columns_in_line_with_dates(write):
    rows = "".join(
        f"{t:%Y-%m-%d %H:%M:%S}   {v:7.3f}     {k}\n" for k, (t, v) in enumerate(zip(STAMPS, ROOM, strict=True))
    )
    log = read_log(write(f"Date       Time       Room_temp   valve\n{rows}"))
    assert (log.frame.index == STAMPS).all()
    np.testing.assert_allclose(log.frame["Room_temp"], ROOM, atol=1e-3)
    assert log.frame["valve"].tolist() == list(range(len(ROOM)))


@pytest.mark.parametrize("form", ["%a %d/%b", "%d-%B"])
def test_days_and_months_without_a_year(write, form):
    """They were refused; IES writes them."""
    rows = "".join(f"{t.strftime(form)},{t:%H:%M},{v}\n" for t, v in zip(STAMPS, ROOM, strict=True))
    log = read_log(write(f"Date,Time,Air temperature\n{rows}"), year=STAMPS[0].year)
    assert (log.frame.index == STAMPS).all()
    np.testing.assert_allclose(log.frame["Air temperature"], ROOM)


@pytest.mark.parametrize("start", ["2018-10-01", "2023-12-30", "2020-02-27"])
def test_days_of_the_week_tell_the_year(write, start):
    """It was assumed to begin on a Sunday, and weekends were those of another year."""
    stamps = pd.date_range(start, periods=10 * 24, freq="1h")
    rows = "".join(f"{t:%a %d/%b},{t:%H:%M},{20 + t.hour / 10}\n" for t in stamps)
    log = read_log(write(f"Date,Time,Air temperature\n{rows}"))
    found = log.frame.index
    assert (found.strftime("%a %d/%b %H:%M") == stamps.strftime("%a %d/%b %H:%M")).all()
    now = pd.Timestamp.now()
    later = (t for k in range(1, now.year - stamps[0].year + 1) if (t := found[-1] + pd.DateOffset(years=k)) <= now)
    assert found[-1] <= now
    assert all(t.weekday() != found[-1].weekday() or t.is_leap_year != found[-1].is_leap_year for t in later)
    assert f"the stamps have no year: {found[0].year} is the last one with these days of the week" in str(log.notes)
    wrong = rows.replace("Mon", "Sat")
    assert "which begins on a Sunday" in str(read_log(write(f"Date,Time,Air temperature\n{wrong}")).notes)


def test_values_that_another_at_the_same_stamp_replaces_are_told(write):
    """The hour that a clock without a time zone shows twice was lost in silence."""
    stamps = pd.date_range("2023-10-28", periods=48, freq="1h", tz="Europe/Berlin").tz_localize(None)
    path = write("time,point,value\n" + "".join(f"{t},room,{20 + k}\n" for k, t in enumerate(stamps)))
    assert "'room' has two values at 1 stamp: the last one is read" in read_log(path).notes
    assert not read_log(path, timezone="Europe/Berlin").notes
