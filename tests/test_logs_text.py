"""Logs in text files as loggers write them: separators, decimal signs, encodings, headers, units, dates and words."""

import bz2
import gzip
import lzma

import numpy as np
import pandas as pd
import pytest
from scipy import constants

from skhybrid.datasets import read_zone_csv
from skhybrid.logs import LogReport, read_log
from skhybrid.logs.cell_numbers import NumberColumn
from skhybrid.logs.conversion import channels_of, to_roles
from skhybrid.logs.readers.change_of_value import chosen_columns
from skhybrid.logs.stamp_cells import _day_first_by_order
from skhybrid.logs.unit_names import ENERGY, IRRADIATION

GERMAN = (
    "Datum;Uhrzeit;Raumtemperatur [°C];Heizung;Zähler [Wh]\r\n"
    "01.02.2024;00:00;20,5;ein;1.234,5\r\n"
    "01.02.2024;00:15;20,6;aus;12.300\r\n"
)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_german_log_in_any_encoding(write, encoding):
    log = read_log(write(GERMAN, encoding))
    assert log.format == "CSV"
    assert list(log.frame) == ["Raumtemperatur [°C]", "Heizung", "Zähler [Wh]"]
    assert log.frame.index.tolist() == [pd.Timestamp("2024-02-01 00:00"), pd.Timestamp("2024-02-01 00:15")]
    assert log.frame.index.name == "time"
    np.testing.assert_array_equal(log.frame, [[20.5, 1.0, 1234.5], [20.6, 0.0, 12300.0]])
    assert log.units == {"Raumtemperatur [°C]": "degC", "Zähler [Wh]": "Wh"}
    assert not log.notes
    assert not log.held


@pytest.mark.parametrize("sep", [",", ";", "\t", "|"])
@pytest.mark.parametrize("name", ["log.csv", "log.txt", "log"])
def test_separators(write, sep, name):
    text = f"time{sep}Room{sep}Text\n" + "".join(f"2024-01-01 0{k}:00{sep}2{k}.5{sep}a;b\n" for k in range(4))
    log = read_log(write(text if sep != ";" else text.replace("a;b", "ab"), name=name))
    assert log.frame["Room"].tolist() == [20.5, 21.5, 22.5, 23.5]
    assert any("'Text' is left out" in note for note in log.notes)


def test_a_second_column_of_stamps_is_left_out_with_one_of_them(write):
    """It has more different words than are counted, and the note showed only dots."""
    stamps = pd.date_range("2024-01-01", periods=3000, freq="15min")
    text = "UTC,Local time,room temperature\n" + "".join(f"{t},{t + pd.Timedelta('1h')},20.5\n" for t in stamps)
    assert "'Local time' is left out, since it holds text such as '2024-01-01 01:00:00'" in read_log(write(text)).notes


def test_a_line_of_means_leaves_the_separator(write):
    rows = "".join(f"2024-01-01 0{k}:00,2{k}.5,a;b\n" for k in range(4))
    log = read_log(write(f"time,Room,Text\n{rows}Mean,22.0,c;d\n"))
    assert log.frame["Room"].tolist() == [20.5, 21.5, 22.5, 23.5]


@pytest.mark.parametrize("line", [1, 2, 40])
@pytest.mark.parametrize("glued", [True, False])
def test_zeros_that_a_loss_of_power_left(write, line, glued):
    """A logger that loses power leaves a block of zeros where its last rows should be, and goes on after it."""
    if glued and int(pd.__version__.partition(".")[0]) < 3:
        pytest.skip("pandas before 3 ends a cell at a zero, so that the row after it has no stamp")
    stamps = pd.date_range("2024-02-01", periods=40, freq="1h")
    lines = ["time,room", *(f"{stamp},{20 + i / 10:.1f}" for i, stamp in enumerate(stamps)), ""]
    lines[line] = "\x00" * 512 + ("" if glued else "\n") + lines[line]
    log = read_log(write("\n".join(lines)))
    assert log.frame.index.equals(stamps.rename("time"))
    np.testing.assert_allclose(log.frame["room"], 20 + np.arange(40) / 10)
    with pytest.raises(ValueError, match=r"the format of 'none\.csv' is not one of"):
        read_log(write("\x00" * 512, name="none.csv"))


def test_preamble_and_words_of_errors(write):
    lines = ["Report;;;", "Site: House 3;;;", "Created;2024-02-03 10:00;;", "", "Time;Zone Temp (°F);Mode;Fan"]
    lines += [
        "1/30/2024 12:00:00 AM;70.1;heat;On",
        "1/30/2024 12:05:00 AM;ERR;off;Off",
        "1/30/2024 01:05:00 PM;---;off;on",
    ]
    lines += ["1/31/2024 01:05:00 PM;71.25;off;No Data", "Total;4;;"]
    log = read_log(write("\n".join(lines)))
    assert log.frame.index.tolist()[::2] == [pd.Timestamp("2024-01-30 00:00"), pd.Timestamp("2024-01-30 13:05")]
    np.testing.assert_array_equal(log.frame["Zone Temp (°F)"], [70.1, np.nan, np.nan, 71.25])
    np.testing.assert_array_equal(log.frame["Fan"], [1.0, 0.0, 1.0, np.nan])
    assert log.units == {"Zone Temp (°F)": "degF"}
    said = "\n".join(log.notes)
    assert "'Zone Temp (°F)': 2 cells such as 'ERR' taken as missing" in said
    assert log.modes == {"Mode"}  # "off" beside "heat" is no switch
    np.testing.assert_array_equal(log.frame["Mode"], [1.0, 0.0, 0.0, 0.0])
    assert "1 row without a time stamp left out" in said


def test_unit_lines_of_a_data_logger(write):
    lines = ['"TOA5","CR1000","CR1000","CPU:x.CR1"', '"TIMESTAMP","RECORD","AirTC_Avg","SlrW_Avg"']
    lines += ['"TS","RN","Deg C","W/m^2"', '"","","Avg","Avg"']
    lines += ['"2024-01-01 00:00:00",0,12.3,"NAN"', '"2024-01-01 00:15:00",1,12.4,5.1']
    log = read_log(write("\n".join(lines)))
    assert log.units == {"AirTC_Avg": "degC", "SlrW_Avg": "W/m2"}
    np.testing.assert_array_equal(log.frame["SlrW_Avg"], [np.nan, 5.1])


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("T_in_degC", "degC"), ("Zone Temp (F)", "degF"), ("ghi_kW_m2", "kW/m2"), ("GHI [W/m²]", "W/m2"), ("kW", "kW"),
        ("Power, W", "W"), ("Valve %", "percent"), ("Room K", None), ("Draw [kW]", "kW"), ("tower", None),
        ("low", None), ("Energy (kWh)", "kWh"), ("Heat MWH", "MWh"), ("CO2 (ppm)", None), ("Roof (east)", None),
        ("Solar {Btu/(h ft2)}", "Btu/(h ft2)"), ("Draw [mW]", None),
    ],
)  # fmt: skip
def test_units_in_names(write, name, unit):
    log = read_log(write(f"time;{name}\n2024-01-01 00:00;1\n2024-01-01 01:00;2\n"))
    assert log.units.get(name) == unit
    assert list(log.frame) == [name]


def test_units_of_lines_below_the_names(write):
    rows = [f"2024-01-01 0{k}:00;20;{k};1\n" for k in range(9)]
    log = read_log(write("Zeit;Raum;Heizung;T °C\n;°C;kWh;max\n" + "".join(rows)))
    assert log.units == {"Raum": "degC", "Heizung": "kWh", "T °C": "degC"}


@pytest.mark.parametrize("of_stamps", ["", "yyyy-mm-dd"])
def test_units_of_a_line_above_the_names(write, of_stamps):
    rows = [f"2024-01-01 0{k}:00;68;{k};1\n" for k in range(9)]
    log = read_log(write(f"Trend\n{of_stamps};°F;kWh;max\nZeit;Raum;Heizung;Wind\n" + "".join(rows)))
    assert log.units == {"Raum": "degF", "Heizung": "kWh"}
    assert list(log.frame) == ["Raum", "Heizung", "Wind"]


@pytest.mark.parametrize(
    ("above", "below", "names", "units"),
    [
        ("Time;Room;Heat;Sun", "°C;kW;W/m2;", ["Room", "Heat", "Sun"], ["degC", "kW", "W/m2"]),
        ("Time;Room;Heat;Sun", "°C;kW;W/m2", ["Room", "Heat", "Sun"], ["degC", "kW", "W/m2"]),
        ("Time;Room;Heat;Sun", ";°C;", ["Room", "Heat", "Sun"], ["degC", None, None]),
        ("Time;Room;Heat;Sun", "-;°C;kW;", ["Room", "Heat", "Sun"], ["degC", "kW", None]),
        ("Time;Room;Heat;Level", ";°C;north;low", ["Room °C", "Heat north", "Level low"], ["degC", None, None]),
        ("Time;Hall;;Heat", ";temp;set;kW", ["Hall temp", "Hall set", "Heat kW"], [None, None, "kW"]),
        ("Time;Hall;Sun;Heat", ";of floor;;kW", ["Hall of floor", "Sun", "Heat kW"], [None, None, "kW"]),
    ],
)
def test_a_second_line_with_units_and_names_or_none_for_the_stamps(write, above, below, names, units):
    """Units were those of the column after, and a line with a few names in it hid those above."""
    rows = "".join(f"2024-01-01 0{k}:00;20;{k};1\n" for k in range(9))
    log = read_log(write(f"{above}\n{below}\n{rows}"))
    assert list(log.frame) == names
    assert [log.units.get(name) for name in names] == units


def test_a_comma_before_three_digits_is_named(write):
    rows = [f'2024-01-01 0{k}:00,"20,06{k}"\n' for k in range(9)]
    log = read_log(write("time,T\n" + "".join(rows)))
    assert log.frame["T"].iloc[0] == 20060.0
    assert any("such as '20,068' are read as thousands" in note for note in log.notes)
    assert read_log(write("time,T\n" + "".join(rows)), decimal=",").frame["T"].iloc[0] == 20.06


def test_two_units_in_the_cells_of_a_column_are_refused(write):
    rows = [f"2024-01-01 0{k}:00,{'800 W' if k % 2 else '1.2 kW'}\n" for k in range(9)]
    with pytest.raises(ValueError, match="cells in kW and in W in the column 'Power'; export one unit"):
        read_log(write("Time,Power\n" + "".join(rows)))


@pytest.mark.parametrize(
    ("first", "second", "at"),
    [
        ("05-Jan-2024 13:00", "05-Jan-2024 13:15", "2024-01-05 13:00"),
        ("DT#2024-01-05-13:00:00", "DT#2024-01-05-13:15:00", "2024-01-05 13:00"),
        ("2024-01-05_13:00:00", "2024-01-05_13:15:00", "2024-01-05 13:00"),
        ("Mon 05 Feb 2024 13:00:00", "Mon 05 Feb 2024 14:00:00", "2024-02-05 13:00"),
        ("Montag, 5. März 2024 13:00", "Montag, 5. März 2024 14:00", "2024-03-05 13:00"),
        ("March 5, 2024 01:00 PM", "March 5, 2024 02:00 PM", "2024-03-05 13:00"),
        ("31/12/2023 11:30 p.m.", "01/01/2024 12:30 a.m.", "2023-12-31 23:30"),
        ("31/12/2023 11:30 p. m.", "01/01/2024 12:30 a. m.", "2023-12-31 23:30"),
        ("20240105T130000", "20240105T140000", "2024-01-05 13:00"),
        ("31.01.2024 24:00", "01.02.2024 01:00", "2024-02-01 00:00"),
        ("1704459600", "1704463200", "2024-01-05 13:00Z"),
        ("1704459600000", "1704463200000", "2024-01-05 13:00Z"),
        ("2024-01-05T13:00:00+01:00", "2024-01-05T14:00:00+01:00", "2024-01-05 13:00+01:00"),
        ("2024-01-05T13:00:00-05:00 New_York", "2024-01-05T14:00:00-05:00 New_York", "2024-01-05 13:00-05:00"),
        ("2024-01-05T13:00:00Z UTC", "2024-01-05T14:00:00Z UTC", "2024-01-05 13:00Z"),
        ("2024-01-05 13:00:00 UTC", "2024-01-05 14:00:00 UTC", "2024-01-05 13:00Z"),
        ("5. 1. 2024 13:00", "5. 1. 2024 14:00", "2024-01-05 13:00"),
        ("05.01.2024. 13:00", "05.01.2024. 14:00", "2024-01-05 13:00"),
        ("2024. 01. 05. 13:00", "2024. 01. 05. 14:00", "2024-01-05 13:00"),
        ("24-01-05 13:00", "24-01-06 14:00", "2024-01-05 13:00"),
        ("05-01-24 13:00", "06-01-24 14:00", "2024-01-05 13:00"),
    ],
)
def test_forms_of_dates(write, first, second, at):
    log = read_log(write(f"when;x\n{first};1\n{second};2\n"))
    assert log.frame.index[0] == pd.Timestamp(at)
    assert log.frame["x"].tolist() == [1.0, 2.0]


def test_order_of_day_and_month_shows_in_the_log(write):
    days = [f"0{d}/02/2024 00:00,{d}\n" for d in range(1, 8)]
    log = read_log(write("time,x\n" + "".join(days)))
    assert log.frame.index[-1] == pd.Timestamp("2024-02-07")
    assert any("the day first" in note for note in log.notes)
    with pytest.raises(ValueError, match="pass dayfirst=True or dayfirst=False"):
        read_log(write("time,x\n" + days[0]))
    assert read_log(write("time,x\n" + days[1]), dayfirst=False).frame.index[0] == pd.Timestamp("2024-02-02")


def test_dates_with_the_year_first_have_no_other_order(write):
    stamps = pd.date_range("2024-02-08", periods=200, freq="1h")
    path = write(pd.DataFrame({"T_za": 20.0}, stamps.rename("time")).to_csv())
    assert (read_log(path, dayfirst=True).frame.index == stamps).all()
    assert (read_zone_csv(path, dayfirst=True).index == stamps).all()
    rows = "".join(f"{t if t.day <= 12 else t.strftime('%d/%m/%Y %H:%M')},20\n" for t in stamps)  # as Excel leaves them
    with pytest.raises(ValueError, match="Excel exchanges day and month where it can") as caught:
        read_log(write("time,T_za\n" + rows))
    assert "such as '2024-02-08 00:00:00' and '13/02/2024 00:00'" in str(caught.value)


def test_autumn_hour_of_a_log_that_runs_backwards(write):
    truth = pd.date_range("2023-10-28 12:00", "2023-10-29 12:00", freq="15min", tz="Europe/Amsterdam")
    rows = [f"{t:%Y-%m-%d %H:%M},{k}" for k, t in enumerate(truth)]
    log = read_log(write("\n".join(["time,T", *rows[::-1]])), timezone="Europe/Amsterdam")
    assert (log.frame.index == truth).all()
    assert log.frame["T"].tolist() == list(range(len(truth)))
    bare = read_log(write("\n".join(["time,T", *rows])))
    assert bare.frame.index.is_monotonic_increasing
    assert sum("2023-10-29 02:" in finding.text for finding in LogReport(bare).findings) == 1
    other = read_log(write("\n".join(["time,T", *rows[:20], *rows[40:], *rows[20:40]])))
    assert any("stamps go back 1 time, first at 2023-10-28 17:00" in note for note in other.notes)


@pytest.mark.parametrize(
    ("form", "zone"),
    [("%d-%b-%y %I:%M:%S %p %Z", "America/Chicago"), ("%Y-%m-%d %H:%M:%S %Z", "Europe/London"),
     ("%d.%m.%Y %H:%M %Z", "Europe/Berlin")],
)  # fmt: skip
@pytest.mark.parametrize("hours", [-1, 1])  # the order of the rows
def test_stamps_that_end_with_the_name_of_their_zone(write, form, zone, hours):
    """As Niagara writes them; the name tells the two passes of the autumn hour apart, also where rows are missing."""
    truth = pd.date_range("2024-03-29", "2024-11-07", freq="15min", tz=zone)
    truth = truth[(truth < truth[-400]) | (np.arange(len(truth)) % 3 == 0)]
    truth = truth[(truth < "2024-04-07") | (truth > "2024-10-20")][::hours]  # the weeks in which the clocks change
    names = {"CEST": "MESZ", "CET": "MEZ"}
    rows = [f"{' '.join(names.get(w, w) for w in t.strftime(form).split())};{k}" for k, t in enumerate(truth)]
    log = read_log(write("\n".join(["Timestamp;T", *rows])), timezone=zone)
    assert (log.frame.index == truth.sort_values()).all()
    assert log.frame["T"].tolist() == list(range(len(truth)))[::hours]


@pytest.mark.parametrize(
    ("name", "offset"),
    [("Timestamp (UTC)", 0), ("time_utc", 0), ("Zeit [UTC+1]", 1), ("Date GMT-06:00", -6), ("time_local (UTC+1)", None),
     ("Time", None)],
)  # fmt: skip
def test_an_offset_in_the_name_of_the_stamps(write, name, offset):
    """They were taken as local, hours off."""
    log = read_log(write(f"{name},T\n2024-01-01 12:00,1\n2024-01-01 13:00,2\n"), timezone="Europe/Berlin")
    hour = 12 if offset is None else 12 - offset + 1
    assert log.frame.index[0] == pd.Timestamp(f"2024-01-01 {hour}:00", tz="Europe/Berlin")
    assert any("stamps are UTC" in note for note in log.notes) == (offset is not None)


def test_a_date_on_the_first_row_of_each_day(write, monkeypatch):
    """As merged cells of a spreadsheet leave it; the rest of a log was left out."""
    truth = pd.date_range("2024-02-27", periods=300, freq="15min")
    dates = pd.Series(truth.strftime("%d/%m/%Y")).where(truth.strftime("%H:%M") == "00:00", "")
    rows = "".join(f"{day},{t:%H:%M},{k}\n" for k, (day, t) in enumerate(zip(dates, truth, strict=True)))
    for n in (10**6, 50):
        monkeypatch.setattr("skhybrid.logs.readers.delimited.rows_of_piece", lambda _, n=n: n)
        log = read_log(write("Date,Time,T\n" + rows + "Average,,20\n"))
        assert (log.frame.index == truth).all()
        assert log.frame["T"].tolist() == list(range(300))
    assert any("without a date taken as of the date above" in note for note in log.notes)


def test_direction_of_a_log_is_seen_with_its_own_order_of_day_and_month(write):
    truth = pd.date_range("2024-10-05", "2024-11-04", freq="1h", tz="Europe/Berlin")  # with months first: May to April
    rows = [f"{t:%d.%m.%Y %H:%M};{k}" for k, t in enumerate(truth)]
    log = read_log(write("\n".join(["Zeit;T", *rows])), timezone="Europe/Berlin")
    assert (log.frame.index == truth).all()
    assert log.frame["T"].tolist() == list(range(len(truth)))
    assert not log.notes


def test_long_log_with_the_newest_row_first_in_autumn(write):
    truth = pd.date_range("2023-10-29 00:00", "2023-10-29 06:00", freq="15min", tz="Europe/Amsterdam")
    rows = [f"{t:%Y-%m-%d %H:%M},a,{k}" for k, t in enumerate(truth)]
    log = read_log(write("\n".join(["time,point,value", *rows[::-1]])), timezone="Europe/Amsterdam")
    assert (log.frame.index == truth).all()
    assert log.frame["a"].tolist() == list(range(len(truth)))


def test_of_several_columns_of_stamps_the_one_with_a_usual_name_counts(write):
    rows = [f"2024-01-01T00:00:00Z,2024-01-02T00:00:00Z,2024-01-01T0{k}:00:00Z,2{k}.5" for k in range(6)]
    log = read_log(write("\n".join(["_start,_stop,_time,room", *rows])))  # a query of InfluxDB
    assert log.frame.index.hour.tolist() == list(range(6))


@pytest.mark.parametrize(
    "form",
    [
        "%m/%d/%Y %I:%M %p",
        "%d/%m/%Y %I:%M:%S %p",
        "%m/%d/%y %I:%M%p",
        "%Y-%m-%d %I:%M %p",
        "%d-%b-%y %H:%M",
        "%d.%m.%y %H:%M:%S",
        "%d-%b-%Y %I:%M %p",
    ],
)
def test_half_days_and_years_of_two_digits_have_one_format_in_all_rows(write, monkeypatch, form):
    """Each row was guessed for itself, which took ten times as long."""
    tried, to_datetime = [], pd.to_datetime
    monkeypatch.setattr(pd, "to_datetime", lambda *of, **by: tried.append(by.get("format")) or to_datetime(*of, **by))
    stamps = pd.date_range("2024-01-25 22:00", periods=1000, freq="15min")
    path = write("time,T\n" + "".join(f"{stamp:{form}},20.5\n" for stamp in stamps))
    assert (read_log(path).frame.index == stamps).all()
    assert "mixed" not in tried


def test_points_with_blanks_after_their_name(write):
    text = "time,point,value\n2024-01-01 00:00,room ,1\n2024-01-01 00:00,heat,7\n2024-01-01 01:00,room ,2\n"
    assert read_log(write(text), columns=["room"]).frame["room"].tolist() == [1.0, 2.0]


def test_unknown_zone_of_a_log_with_offsets(write):
    with pytest.raises(ValueError, match="timezone='Mars/Base' is unknown"):
        read_log(write("time,point,value\n2024-01-01T00:00Z,a,1\n2024-01-01T01:00Z,a,2\n"), timezone="Mars/Base")


def test_pieces_are_put_together(write, monkeypatch):
    stamps = pd.date_range("2024-01-01", periods=3500, freq="5min")
    cells = [f"{k % 50}.25" if k != 2900 else "Bad" for k in range(3500)]
    text = "time,a,b\n" + "".join(f"{t},{c},1\n" for t, c in zip(stamps, cells, strict=True))
    monkeypatch.setattr("skhybrid.logs.assembly._CELLS", 3000)
    monkeypatch.setattr("skhybrid.logs.stamps._BLOCK", 700)
    log = read_log(write(text), columns=["a"])
    assert list(log.frame) == ["a"]
    assert (log.frame.index == stamps).all()
    assert np.flatnonzero(log.frame["a"].isna()).tolist() == [2900]
    assert log.frame["a"].iloc[-1] == 3499 % 50 + 0.25
    with pytest.raises(ValueError, match=r"row 3002 of 'log.csv': the time stamp '2024-13-01 1' is not a date"):
        read_log(write(text.replace(str(stamps[3000]), "2024-13-01 1")))


def test_compressed_and_headless(write, tmp_path):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(b"2024-01-01 00:00,1,2\n2024-01-01 01:00,3,4\n"))
    log = read_log(path)
    assert list(log.frame) == ["column 2", "column 3"]
    assert any("there is no header" in note for note in log.notes)


@pytest.mark.parametrize(("kind", "pack"), [("gz", gzip.compress), ("bz2", bz2.compress), ("xz", lzma.compress)])
def test_a_damaged_compressed_file_is_refused(tmp_path, kind, pack):
    """Bytes that are wrong, and an end that is missing; zlib's error and bz2's were not caught."""
    rows = "".join(
        f"{stamp},{k % 97}.{k % 7}\n" for k, stamp in enumerate(pd.date_range("2024", periods=5000, freq="1h"))
    )
    packed = pack(("time,T_za\n" + rows).encode())
    wrong = packed[:60] + b"\xff" * 40 + packed[100:]
    for content in (wrong, packed[: len(packed) // 2]):
        path = tmp_path / f"log.csv.{kind}"
        path.write_bytes(content)
        for read in (read_log, read_zone_csv):
            with pytest.raises(ValueError, match=r"'log\.csv\.\w+' is a damaged compressed file \(.*\); copy it again"):
                read(path)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"dayfirst": "no"}, "dayfirst='no' must be True or False"),  # counted as True
        ({"timezone": 1}, "timezone=1 is unknown; write it as 'Europe/Amsterdam'"),  # was a second from UTC
        ({"year": 0}, "year=0 "),  # was 2017
        ({"year": "2024"}, "year='2024' "),
    ],
)
def test_options_of_the_wrong_kind_are_refused(write, given, says):
    path = write("time,T_za\n" + "".join(f"01/{k:02d} 10:00,{20 + k % 3}\n" for k in range(1, 20)))
    with pytest.raises(ValueError, match=says):
        read_log(path, **given)


LONG = """time,point,value
2024-01-01 00:00:03,AHU1.T,20.1
2024-01-01 00:00:03,AHU1.Fan,on
2024-01-01 00:00:03,AHU1.Mode,heat
2024-01-01 01:10:04,AHU1.T,20.4
2024-01-01 01:11:30,AHU1.T,20.5
2024-01-01 02:10:04,AHU1.Fan,off
2024-01-01 09:10:04,AHU1.Fan,on
2024-01-01 09:12:04,AHU1.Fan,off
2024-01-01 09:12:10,AHU1.T,ERR
2024-01-01 12:12:10,AHU1.T,19.0
"""


@pytest.mark.parametrize("grouped", [False, True])
def test_long_log_of_changes(write, grouped):
    lines = LONG.splitlines()
    body = sorted(lines[1:], key=lambda line: line.split(",")[1]) if grouped else lines[1:]
    log = read_log(write("\n".join([lines[0], *body])))
    assert log.format == "change of value"
    assert set(log.frame) == {"AHU1.T", "AHU1.Fan", "AHU1.Mode"} == log.held | log.modes
    assert log.frame["AHU1.Fan"].dropna().tolist() == [1.0, 0.0, 1.0, 0.0]
    assert log.frame["AHU1.T"].dropna().tolist() == [20.1, 20.4, 20.5, 19.0]
    assert log.frame.index.is_unique
    assert log.frame.index.is_monotonic_increasing
    assert list(read_log(write("\n".join([lines[0], *body])), columns=["AHU1.T"]).frame) == ["AHU1.T"]


def test_a_long_log_with_a_column_of_units(write):
    lines = ["time,point,value,unit"]
    for k in range(30):
        at = pd.Timestamp("2024-01-01") + pd.Timedelta(minutes=7 * k + k % 3)
        lines += [f"{at},heat,{1200 + k},kWh", f"{at},sun,{k * 10},W/m²", f"{at},out,{40 + k},{'°F' if k else ''}"]
        lines += [f"{at},air,{1013 + k},hPa", f"{at},fan,{k},AHU 1"]
    log = read_log(write("\n".join(lines)))
    assert log.units == {"heat": "kWh", "sun": "W/m2", "out": "degF"}
    with pytest.raises(ValueError, match="cells in kWh and in Wh in the column 'heat'"):
        read_log(write("\n".join([*lines, "2024-01-02 00:00,heat,1300000,Wh"])))


def test_long_log_with_other_names_and_even_values(write):
    rows = [f"2024-01-01 {k:02}:00;{p};{k},5" for p in ("a", "b") for k in range(12)]
    path = write("\n".join(["Zeit;Kennung;Messung", *rows]))
    log = read_log(path, format="change of value", point_column="Kennung", value_column="Messung")
    assert log.frame["b"].tolist() == [k + 0.5 for k in range(12)]
    assert not log.held  # even values are samples, not changes
    with pytest.raises(ValueError, match="no column that is surely the point among 'Zeit', 'Kennung', 'Messung'"):
        read_log(path, format="change of value")


def test_grouped_long_log_in_autumn(write):
    truth = pd.date_range("2023-10-28 20:00", "2023-10-29 06:00", freq="20min", tz="Europe/Amsterdam")
    rows = [f"{t:%Y-%m-%d %H:%M},{p},{k}" for p in ("a", "b") for k, t in enumerate(truth)]
    log = read_log(write("\n".join(["time,point,value", *rows])), timezone="Europe/Amsterdam")
    assert (log.frame.index == truth).all()
    assert log.frame["b"].tolist() == list(range(len(truth)))


@pytest.mark.parametrize(
    ("hours", "is_held"),
    [
        ((6, 19), True),
        ((6, 18), True),
        ((6, 9, 17, 22), True),
        (range(24), False),
        (range(0, 24, 3), False),
        ((0,), False),
    ],
)
def test_a_channel_with_a_few_values_a_day_is_held_beside_fine_ones(write, hours, is_held):
    """Set-points by the clock; but not the weather of each hour, nor one reading a day."""
    stamps = pd.date_range("2024-01-01", "2024-01-15", freq="10min", inclusive="left")
    rows = [
        f"{t},{20 + k % 3}," + (str(k % 2) if t.hour in hours and t.minute == 0 else "") for k, t in enumerate(stamps)
    ]
    assert read_log(write("\n".join(["time,T,set", *rows]))).held == ({"set"} if is_held else frozenset())


def test_a_long_log_that_is_polled_and_written_on_change(write):
    """Its values come at multiples of five minutes, most of them one apart."""
    stamps = pd.date_range("2024-01-01", periods=4 * 288, freq="5min")
    hour = np.arange(len(stamps)) / 12.0
    rng = np.random.default_rng(0)
    series = {
        "sun": np.round(
            500.0 * np.clip(np.sin(2.0 * np.pi * hour / 24.0), 0.0, None) + rng.normal(0.0, 9.0, len(hour))
        ),
        "room": np.round(20.0 + np.sin(hour / 4.0) + rng.normal(0.0, 0.04, len(hour)), 1),
        "hall": 18.0 + rng.normal(0.0, 0.1, len(hour)),
    }
    series["sun"][np.sin(2.0 * np.pi * hour / 24.0) <= 0.0] = 0.0
    rows = ["time,point,value"]
    for name, values in series.items():
        kept = rng.random(len(values)) > 0.05 if name == "hall" else np.append(True, values[1:] != values[:-1])
        rows += [f"{t},{name},{value}" for t, value in zip(stamps[kept], values[kept], strict=True)]
    assert read_log(write("\n".join(rows))).held == {"room", "sun"}  # the hall is a sensor with failures


def test_wide_log_of_changes(write):
    rows = [
        "00:00:00,20,1",
        "00:03:10,20.5,",
        "00:04:00,,0",
        "03:10:00,21,",
        "03:10:00,,1",
        "05:00:07,21.5,",
        "05:00:59,,0",
    ]
    text = "time,T,fan\n" + "".join(f"2024-01-01 {row}\n" for row in rows)
    log = read_log(write(text))
    assert log.held == {"T", "fan"}
    assert log.frame.loc["2024-01-01 03:10:00"].tolist() == [21.0, 1.0]  # two rows of one stamp
    assert read_log(write(text), held=["fan"]).held == {"fan"}
    assert read_log(write(text), held=False).held == frozenset()
    with pytest.raises(ValueError, match="held= names 'fen', which is not a channel"):
        read_log(write(text), held=["fen"])


@pytest.mark.parametrize("repeats", [False, True])
def test_wide_log_with_blank_cells_where_nothing_changed(write, repeats):
    """Nothing in it is repeated; where something is, a blank cell is a failure."""
    stamps = pd.date_range("2024-01-01", periods=400, freq="15min")
    hour = np.arange(400) / 4.0
    table = pd.DataFrame(
        {"room": 20.0 + np.sin(hour / 4.0), "sun": 300.0 * np.sin(hour / 3.8).clip(0.0)}, stamps
    ).round(1)
    blank = table.eq(table.shift())
    text = (
        table.mask(blank).assign(outdoor=np.round(hour, 2), fan=1.0 if repeats else np.nan).rename_axis("time").to_csv()
    )
    log = read_log(write(text))
    assert blank.mean().min() > 0.2
    assert log.held == (set() if repeats else {"room", "sun", "outdoor", "fan"})


def test_a_switch_among_temperatures_has_no_value(write):
    """The sensor is off; for a stage off is 0."""
    rows = "".join(f"2024-01-01 {h:02d}:00,{20 + h / 10},{h % 2}\n" for h in range(20))
    log = read_log(write("time,room,stage\n" + rows + "2024-01-01 20:00,off,off\n2024-01-01 21:00,True,on\n"))
    found = to_roles(log, channels_of(log, {"T_za": "room", "u_heat": "stage"}))
    assert found["T_za"].isna().tolist() == 20 * [False] + 2 * [True]
    assert found["u_heat"].iloc[-2:].tolist() == [0.0, 1.0]
    assert "'room': 2 cells such as 'True' read as 1 or 0, and as missing in a temperature" in log.notes


def test_words_that_say_when_a_plant_heats(write):
    rows = "".join(f"2024-01-01 {h:02d}:00,{20 + h / 10},{'Heating' if h > 9 else 'Idle'}\n" for h in range(20))
    log = read_log(write("time,room,status\n" + rows))
    assert log.frame["status"].tolist() == 10 * [0.0] + 10 * [1.0]
    both = read_log(write("time,room,status\n" + rows + "2024-01-01 20:00,22,Cooling\n"))
    assert both.frame["status: heating"].tolist() == 10 * [0.0] + 10 * [1.0] + [0.0]
    assert both.frame["status: cooling"].tolist() == 20 * [0.0] + [1.0]
    assert "the words of 'status' are read as the stages 'status: heating' and 'status: cooling'" in both.notes
    other = read_log(write("time,room,status\n" + rows + "2024-01-01 20:00,22,Cooling\n2024-01-01 21:00,22,Boost\n"))
    (note,) = [note for note in other.notes if "left out" in note]
    assert note.endswith("; if it says when the plant ran, write columns of 1 and 0 for heating and cooling")


def test_a_temperature_of_true_and_false_alone_has_no_value(write):
    """They are switches in any file, also where pandas reads the whole column as booleans."""
    rows = "".join(f"2024-01-01 {h:02d}:00,{h % 2 == 1},{h % 2 == 0}\n" for h in range(20))
    log = read_log(write("time,room,stage\n" + rows))
    found = to_roles(log, channels_of(log, {"T_za": "room", "u_heat": "stage"}))
    assert found["T_za"].isna().all()
    assert found["u_heat"].tolist() == 10 * [1.0, 0.0]


HEAD = "time,T,x\n"


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", {}, "'log.csv' is empty; export it again"),
        ("\x00\x01\x02\x00\x07", {}, "the format of 'log.csv' is not one of Home Assistant, ecobee"),
        ("\n \n\n", {}, "'log.csv' is empty; export it again"),
        (HEAD, {}, "'log.csv' has one line only, and no row with a time stamp below it"),
        ("a b\nc d\n", {}, "no rows of two or more cells; pass its separator, such as sep=';'"),
        ("T,x\n1,2\n3,4\n", {}, "no cell that is a time stamp"),
        (
            HEAD + "2024-01-01,1,2\n",
            {"columns": ["y"]},
            "columns= names 'y', which is not in 'log.csv'; its channels are",
        ),
        (HEAD + "2024-01-01,1,2\n", {"columns": "T"}, "columns='T' is one text; give a list"),
        (HEAD + "2024-01-01,1,2\n", {"columns": True}, "columns=True is no list; give a list of channels"),
        (HEAD + "2024-01-01,1,2\n", {"held": 5}, "held=5 is no list; give a list of channels"),
        (HEAD + "2024-01-01,1,2\n", {"time_column": "zeit"}, "time_column= names 'zeit', which is not in 'log.csv'"),
        (HEAD + "2024-01-01,1,2\n", {"sheet": 1}, "format CSV takes no option 'sheet'; it takes sep, decimal, columns"),
        (HEAD + "2024-01-01,1,2\n", {"format": "XML"}, "format='XML' is not one of 'Home Assistant'"),
        (HEAD + "2024-01-01,1,2\n", {"timezone": "Mars/Base"}, "timezone='Mars/Base' is unknown"),
        (
            HEAD + 3 * "2024-01-01,1,2\n" + "2024-01-01,1,2,9\n",
            {},
            r"cannot be read as CSV \(Expected 3 fields in line 5, saw 4\); correct that line, or name an added column",
        ),
        (
            HEAD + 3 * "2024-01-01 00:00,20,5,21,5\n",
            {},
            "line 1 of 'log.csv' names 3 columns, but the rows have 5 cells",
        ),
        (
            HEAD + 3 * "2024-01-01 00:00,1,2\n" + "time,x,T\n2024-01-01 01:00,2,1\n",
            {},
            "line 5 of 'log.csv' names the columns anew, and 'x' at another place; split the file there",
        ),
        (HEAD + "2024-01-01,a,b\n", {}, "has no column of numbers beside its time stamps"),
        (HEAD + "2024-01-01 00:00,1,2\n\n\n2024-01-01 99:00,1,2\n", {}, "row 5 of 'log.csv'"),
        (HEAD + "2024-01-01 00:00 CET,1,2\n", {}, r"'log.csv' has time stamps with a zone by name \(CET\)"),
        (
            HEAD + "2024-01-01 00:00 CET,1,2\n2024-01-01 01:00 CEST,1,2\n",
            {"timezone": "Europe/Berlin"},
            "row 3 of 'log.csv': '2024-01-01 01:00 CEST' is in CEST, but Europe/Berlin has CET then; give",
        ),
        (
            HEAD + "2024-01-01 00:00,1,2\n2024-01-01 99:00,1,2\n",
            {},
            "row 3 of 'log.csv': the time stamp .* is not a date",
        ),
    ],
)
def test_one_sentence_for_a_bad_file(write, text, options, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_log(write(text), **options)
    assert "\n" not in str(caught.value)


def test_a_first_row_without_a_stamp_is_not_the_header(write):
    """Its numbers became the names of the columns, and ``read_zone_csv`` ended with a TypeError."""
    path = write("time,T_za,T_oa\n,20,2\n" + "".join(f"2024-01-01 0{k}:00,2{k},{k}\n" for k in range(4)))
    assert list(read_log(path).frame) == ["T_za", "T_oa"]
    with pytest.raises(ValueError, match=r"row 2 of 'log\.csv': the time stamp is empty"):
        read_zone_csv(path)


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read_log(tmp_path / "none.csv")
    with pytest.raises(FileNotFoundError, match="is a folder; give a file in it"):
        read_log(tmp_path)


def test_a_named_column_of_points_must_be_there():
    assert chosen_columns(["t", "name", "reading"], "name", "reading", "log") == ("name", "reading")
    with pytest.raises(ValueError, match=r"log has no column 'sensor'.*pass point_column="):
        chosen_columns(["t", "name", "reading"], "sensor", "reading", "log")
    with pytest.raises(ValueError, match=r"among 't', 'x{37}\.\.\.'; pass"):  # of a damaged file
        chosen_columns(["t", "x" * 5000], "sensor", "reading", "log")


def test_numbers_are_read_as_they_are_and_months_above_twelve_decide():
    channel = NumberColumn()
    channel.add(pd.Series([1.125, np.nan]), ",")  # no text, in which 1.125 were 1125
    np.testing.assert_array_equal(channel.values(), [1.125, np.nan])
    assert _day_first_by_order(pd.Series(["01/12/2024", "02/12/2024"])) is True
    assert _day_first_by_order(pd.Series(["01/13/2024", "02/13/2024"])) is None


def test_names_that_occur_twice_follow_those_of_the_rooms_above_them(write):
    """Exports with merged cells name the room in a line of its own."""
    rows = "".join(f"2024-03-0{d} {h:02d}:00;{h / 3:.1f};2{h % 3}.5;19.{h % 5}\n" for d in (1, 2) for h in range(24))
    log = read_log(write(";Weather;Office;Meeting room\nTime;Outdoor;Temperature;Temperature\n;°C;°C;°C\n" + rows))
    assert list(log.frame) == ["Weather Outdoor", "Office Temperature", "Meeting room Temperature"]
    assert set(log.units.values()) == {"degC"}
    plain = read_log(write("Site;A;B;C\nTime;Outdoor;Office;Meeting room\n" + rows))
    assert list(plain.frame) == ["Outdoor", "Office", "Meeting room"]  # no name occurs twice
    alike = read_log(write("Time;Outdoor;Room;Room\n" + rows))
    assert list(alike.frame) == ["Outdoor", "Room", "Room (2)"]


def test_units_of_energy_are_those_of_physics():
    kWh, Btu = constants.kilo * constants.hour, constants.Btu_IT
    joules = {"kWh": kWh, "Wh": constants.hour, "MWh": 1e3 * kWh, "J": 1.0, "MJ": 1e6, "GJ": 1e9, "Btu": Btu, "kJ": 1e3}
    joules |= {"Gcal": 1e9 * constants.calorie_IT, "MMBtu": 1e6 * Btu}
    joules |= {"kcal": 1e3 * constants.calorie_IT, "kBtu": 1e3 * Btu, "therm": 1e5 * Btu, "ton-h": 12e3 * Btu}
    assert pytest.approx({unit: joules[unit] / kWh for unit in ENERGY}, rel=1e-9) == ENERGY
    per_m2 = {"Wh/m2": constants.hour, "kWh/m2": kWh, "J/cm2": 1e4, "kJ/m2": 1e3, "MJ/m2": 1e6}
    assert pytest.approx({unit: per_m2[unit] / kWh for unit in IRRADIATION}, rel=1e-9) == IRRADIATION
