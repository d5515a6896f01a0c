"""Logs in workbooks, Parquet files and databases."""

import datetime as dt
import re
import sqlite3
import sys

import numpy as np
import openpyxl
import pandas as pd
import pytest
import sqlalchemy as sa

from skhybrid.logs import read_log

INDEX = pd.date_range("2024-01-05", periods=40, freq="15min", name="time")
FRAME = pd.DataFrame({"Room (°C)": np.linspace(19, 22, 40).round(2), "valve": np.arange(40) % 2 == 1}, index=INDEX)


# ------------------------------------------------------------------------------------------------------------- Excel
@pytest.fixture
def workbook(tmp_path):
    """A workbook with a cover sheet, and a table under a title with a line of units."""
    book = openpyxl.Workbook()
    book.active.title = "Cover"
    book.active.append(["Building 7", "exported", dt.date(2024, 2, 1)])
    sheet = book.create_sheet("Data")
    sheet.append(["Trend report"])
    sheet.append([])
    sheet.append([None, "Room", "Valve", "Remark"])
    sheet.append([None, "°F", "%", None])
    for k, stamp in enumerate(INDEX):
        sheet.append([stamp.to_pydatetime(), 68.5 + k, k % 2 == 1, "n/a" if k else None])
    sheet["B7"] = "#N/A"
    other = book.create_sheet("Other")
    other.append(["Datum", "Zeit", "T"])
    for k in range(3):
        other.append([dt.date(2024, 1, 5), dt.time(k, 30), f"2{k},5"])
    book.save(tmp_path / "log.xlsx")
    return tmp_path / "log.xlsx"


def test_excel(workbook):
    log = read_log(workbook)
    assert log.format == "Excel"
    assert (log.frame.index == INDEX).all()
    assert log.units == {"Room": "degF", "Valve": "percent"}
    assert log.frame["Room"].iloc[[0, 1, 3]].tolist() == [68.5, 69.5, 71.5]
    assert np.isnan(log.frame["Room"].iloc[2])
    assert log.frame["Valve"].tolist() == [k % 2 for k in range(40)]
    said = "\n".join(log.notes)
    assert "read from sheet 'Data'" in said
    assert "not read: 'Other'" in said
    assert "'Room': 1 cell such as '#N/A'" in said
    assert list(read_log(workbook, columns=["Valve"]).frame) == ["Valve"]


@pytest.mark.parametrize("apart", [True, False])
def test_sheets_that_go_on_are_read_together(tmp_path, apart):
    """Of a sheet per month only the first was read; sheets of the same stamps are rooms."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for k, name in enumerate(("Jan", "Feb")):
        sheet = book.create_sheet(name)
        sheet.append(["Time", "Room"])
        for stamp in INDEX[20 * k : 20 * k + 20] if apart else INDEX[:20]:
            sheet.append([stamp.to_pydatetime(), 20.5 + k])
    book.save(tmp_path / "log.xlsx")
    log = read_log(tmp_path / "log.xlsx")
    assert log.frame["Room"].tolist() == [20.5] * 20 + [21.5] * 20 * apart
    said = "read from sheets 'Jan', 'Feb'" if apart else "not read: 'Feb', which also hold tables; put all columns in"
    assert any(said in note for note in log.notes)


@pytest.mark.parametrize(
    ("columns", "points"),
    [
        (["Value [°C]", "Value"], ["Room temp", "Heat meter"]),
        (["Zone", "Power (kW)"], ["Zone", "Power (kW)"]),
    ],
)
def test_a_sheet_for_each_point(tmp_path, columns, points):
    """One of them was read, as a column named Value."""
    book = openpyxl.Workbook()
    book.active.append(["exported", dt.date(2024, 2, 1)])
    for sheet, column, begin in zip(("Room temp", "Heat meter"), columns, (0, 1), strict=True):
        table = book.create_sheet(sheet)
        table.append(["Timestamp", column, "Quality"])
        for k, stamp in enumerate(INDEX[begin:]):
            table.append([stamp.to_pydatetime(), 20.5 + k + begin, "good" if k else "bad"])
    book.save(tmp_path / "log.xlsx")
    log = read_log(tmp_path / "log.xlsx")
    assert list(log.frame) == points
    np.testing.assert_array_equal(log.frame[points[0]], [np.nan, *(20.5 + np.arange(1, 40))])
    np.testing.assert_array_equal(log.frame[points[1]], [np.nan, np.nan, *(20.5 + np.arange(2, 40))])
    assert log.units == ({"Room temp": "degC"} if columns[0].startswith("Value") else {"Power (kW)": "kW"})
    assert any("read from sheets 'Room temp', 'Heat meter', one for each point" in note for note in log.notes)
    assert list(read_log(tmp_path / "log.xlsx", sheet="Heat meter").frame) == [columns[1]]


def test_sheet_of_a_workbook(workbook, tmp_path):
    log = read_log(workbook, sheet="Other")
    assert log.frame.index.tolist() == [pd.Timestamp(f"2024-01-05 0{k}:30") for k in range(3)]
    assert log.frame["T"].tolist() == [20.5, 21.5, 22.5]
    assert read_log(workbook, sheet=2).frame.equals(log.frame)
    with pytest.raises(ValueError, match="no sheet 'Dates'; its sheets are 'Cover', 'Data', 'Other'"):
        read_log(workbook, sheet="Dates")
    with pytest.raises(ValueError, match=r"sheet 'Cover' of 'log\.xlsx' has no column of numbers"):
        read_log(workbook, sheet=0)
    broken = tmp_path / "broken.xlsx"
    broken.write_bytes(workbook.read_bytes()[:-200])
    with pytest.raises(ValueError, match="cannot be read as an Excel workbook"):
        read_log(broken, format="Excel")


# ----------------------------------------------------------------------------------------------------------- Parquet
@pytest.mark.parametrize("zone", [None, "Europe/Amsterdam"])
@pytest.mark.parametrize("indexed", [True, False])
def test_parquet(tmp_path, zone, indexed, monkeypatch):
    monkeypatch.setattr("skhybrid.logs.assembly._CELLS", 30)
    frame = FRAME.tz_localize(zone).assign(note="a", spare=pd.NA)
    frame = frame if indexed else frame.reset_index().rename(columns={"time": "moment"})
    frame.to_parquet(tmp_path / "log", row_group_size=7)
    log = read_log(tmp_path / "log")
    assert log.format == "Parquet"
    assert (log.frame.index == FRAME.index.tz_localize(zone)).all()
    assert str(log.frame.index.tz) == str(zone)
    np.testing.assert_array_equal(log.frame[list(FRAME)], FRAME.astype(float))
    assert log.units == {"Room (°C)": "degC"}
    assert list(read_log(tmp_path / "log", columns=["valve"]).frame) == ["valve"]
    with pytest.raises(ValueError, match="columns= names 'x', which is not in 'log'"):
        read_log(tmp_path / "log", columns=["x"])


def test_a_room_in_the_index_of_a_parquet_file_names_its_rows(tmp_path):
    """It was left out, and the rows of all rooms were mixed."""
    rooms = pd.concat({"Hall": FRAME, "Bath": FRAME + 1.0}, names=["room"]).astype(float)
    rooms.to_parquet(tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    assert set(log.frame) == {f"{room} {name}" for room in ("Hall", "Bath") for name in FRAME}
    np.testing.assert_array_equal(log.frame["Bath Room (°C)"], FRAME["Room (°C)"] + 1.0)


@pytest.mark.parametrize("words", [["auto", "manual"], ["heat", "off"], ["HP1"], [[1, 2]]])
@pytest.mark.parametrize("kind", ["parquet", "db", "xlsx"])
def test_a_column_of_text_beside_one_room_names_no_zones(tmp_path, kind, words):
    path, state = tmp_path / f"log.{kind}", [words[k // 8 % len(words)] for k in range(len(FRAME))]
    frame = FRAME.assign(thermostat=state if kind == "parquet" else list(map(str, state))).reset_index()
    if kind == "parquet":
        frame.to_parquet(path)
    elif kind == "db":
        frame.to_sql("log", f"sqlite:///{path}", index=False)
    else:
        frame.to_excel(path, index=False)
    log = read_log(path)
    np.testing.assert_array_equal(log.frame["Room (°C)"], FRAME["Room (°C)"])
    assert not any("a row for each" in note for note in log.notes)


def test_long_parquet(tmp_path):
    long = FRAME.astype(float).melt(ignore_index=False, var_name="point", value_name="value")
    long["unit"] = long["point"].map({"valve": "%"})
    long.to_parquet(tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    np.testing.assert_array_equal(log.frame, FRAME.astype(float))
    assert log.units == {"Room (°C)": "degC", "valve": "percent"}
    (tmp_path / "log.parquet").write_bytes((tmp_path / "log.parquet").read_bytes()[:-40])
    with pytest.raises(ValueError, match=r"'log.parquet' cannot be read as a Parquet file"):
        read_log(tmp_path / "log.parquet")


# --------------------------------------------------------------------------------------------------------- databases
def _fill(engine, zoned=False):
    """A wide table, a long one and an empty one."""
    frame = FRAME.tz_localize("UTC") if zoned else FRAME
    with engine.begin() as connection:
        frame.rename(columns={"Room (°C)": "Room"}).to_sql("wide", connection)
        long = frame.astype(float).melt(ignore_index=False, var_name="sensor", value_name="reading")
        long.assign(unit=long["sensor"].map({"valve": "%"})).to_sql("long", connection)
        connection.execute(sa.text("CREATE TABLE blank (time TIMESTAMP, x FLOAT)"))


@pytest.fixture
def sqlite(tmp_path):
    engine = sa.create_engine(f"sqlite:///{tmp_path / 'log.db'}")
    _fill(engine)
    engine.dispose()
    return f"sqlite:///{tmp_path / 'log.db'}"


@pytest.fixture(scope="module")
def postgres(tmp_path_factory):
    """The URL of a real server that listens on a socket in a folder of its own."""
    try:
        import pgserver

        server = pgserver.get_server(tmp_path_factory.mktemp("pg"), cleanup_mode="delete")
    except Exception as error:  # no binary for this machine, or it may not start here
        pytest.skip(f"no PostgreSQL server runs here: {error}")
    url = server.get_uri().replace("postgresql://", "postgresql+psycopg://")
    engine = sa.create_engine(url)
    _fill(engine, zoned=True)
    engine.dispose()
    yield url
    server.cleanup()


def test_sqlite(sqlite, tmp_path, monkeypatch):
    monkeypatch.setattr("skhybrid.logs.readers.sql_table.SAMPLE", 9)
    monkeypatch.setattr("skhybrid.logs.readers.sql_table._PIECE", 7)
    log = read_log(sqlite, table="wide")
    assert log.format == "SQL"
    assert (log.frame.index == INDEX).all()
    np.testing.assert_array_equal(log.frame, FRAME.astype(float))
    np.testing.assert_array_equal(read_log(sqlite, table="long").frame, FRAME.astype(float))
    assert read_log(sqlite, table="long").units["valve"] == "percent"
    few = read_log(tmp_path / "log.db", query="SELECT time AS t, Room FROM wide WHERE valve = 1", time_column="t")
    assert few.frame["Room"].tolist() == FRAME["Room (°C)"].tolist()[1::2]
    assert not list(tmp_path.glob("log.db-*"))


def test_the_only_table_of_a_database_needs_no_name(tmp_path):
    engine = sa.create_engine(f"sqlite:///{tmp_path / 'one.db'}")
    FRAME.to_sql("wide", engine)
    engine.dispose()
    np.testing.assert_array_equal(read_log(f"sqlite:///{tmp_path / 'one.db'}").frame, FRAME.astype(float))


def test_postgres(postgres):
    log = read_log(postgres, table="wide", timezone="Europe/Amsterdam")
    assert (log.frame.index == INDEX.tz_localize("UTC")).all()
    assert log.frame.index[0].hour == 1
    np.testing.assert_array_equal(log.frame, FRAME.astype(float))
    long = read_log(postgres, table="public.long", columns=["valve"])
    assert long.frame["valve"].tolist() == FRAME["valve"].astype(float).tolist()
    exact = read_log(postgres, query='SELECT time, CAST("Room" AS NUMERIC(6, 2)) AS room FROM wide ORDER BY time DESC')
    assert exact.frame["room"].tolist() == FRAME["Room (°C)"].tolist()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "needs table= or query=; its tables are 'blank', 'long', 'wide'"),
        ({"table": "x"}, "has no table 'x'; its tables are"),
        ({"table": "blank"}, "table 'blank' has no rows"),
        ({"table": "wide", "query": "SELECT 1"}, "table= and query= were both given"),
        ({"query": "SELECT x FROM nowhere"}, "cannot be read"),
        ({"table": "wide", "columns": ["y"]}, "columns= names 'y', which is not in table 'wide'"),
        ({"table": "wide", "format": "CSV"}, "a URL is read as SQL"),
    ],
)
def test_refusals_of_a_database(sqlite, options, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_log(sqlite, **options)
    assert "\n" not in str(caught.value)


def test_a_password_is_never_shown(postgres):
    host = re.search(r"host=(.*)", postgres)[1]
    urls = [
        f"postgresql+psycopg://nobody:s3cr3t@/postgres?host={host}",
        "postgresql+psycopg://me:s3cr3t@localhost:1/none",
        "postgresql+nodriver://me:s3cr3t@localhost:1/none",
        "nobase://me:s3cr3t@localhost:1/none",
        "postgresql+psycopg://me:s3cr3t@localhost:port/none",
    ]
    for url in urls:
        with pytest.raises((ValueError, ImportError)) as caught:
            read_log(url, table="wide")
        assert "s3cr3t" not in f"{caught.value}"
        assert caught.value.__suppress_context__


def test_a_missing_file_is_not_made(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read_log(f"sqlite:///{tmp_path / 'none.db'}", table="wide")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("library", "extra"), [("openpyxl", "files"), ("pyarrow", "files"), ("sqlalchemy", "sql")])
def test_a_missing_library_is_named_with_its_extra(library, extra, tmp_path, monkeypatch):
    sources = {"openpyxl": "log.xlsx", "pyarrow": "log.parquet", "sqlalchemy": "log.db"}
    path = tmp_path / sources[library]
    if library == "openpyxl":
        openpyxl.Workbook().save(path)
    elif library == "pyarrow":
        FRAME.to_parquet(path)
    else:
        with sqlite3.connect(path) as connection:
            connection.execute("CREATE TABLE t (x)")
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=rf'pip install "skhybrid\[{extra}\]"'):
        read_log(path)
