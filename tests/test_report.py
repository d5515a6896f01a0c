"""The report holds all it shows, escapes what it is given, and says what the numbers say."""

from __future__ import annotations

import base64
import re
import shutil
import subprocess
from dataclasses import replace
from datetime import date
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from skhybrid.study import StudyData, StudyResult, write_report
from skhybrid.study.report import study_picture, verdict
from skhybrid.study.report.figures import backtest_figure, day_figure, lead_figure, schedule_figure
from skhybrid.study.report.words import flat
from skhybrid.study.settings import settings_from
from skhybrid.study.tariff import Cost

INDEX = pd.date_range("2024-01-01", periods=24, freq="1h", tz="UTC")


SCHEDULE = pd.DataFrame(
    {"gain": 1.5, "ua": -0.1},
    index=pd.MultiIndex.from_product([("weekday", "weekend"), range(24)], names=["day", "hour"]),
)
WEIGHTS = pd.DataFrame({"network": [0.75, 0.5, 0.25], "ARX": [0.25, 0.5, 0.75]})
PARAMETERS = pd.DataFrame(
    {"value": [6.0], "std": [0.1], "unit": ["kW"], "description": ["capacity"], "remark": ["given beforehand"]},
    index=["Q_h"],
)


def _model(schedule=SCHEDULE, weights=WEIGHTS):
    """The model of a study with what it has learned."""
    return SimpleNamespace(gray_box_=SimpleNamespace(schedule_=schedule), weights_=weights)


def _study(name="Zone 7", identification="PeriodicDisturbanceID", **changes):
    """A study with an identification of some class."""
    frame = pd.DataFrame(
        {
            "origin": INDEX[0],
            "lead": pd.to_timedelta(np.arange(1, 25), unit="h"),
            "time": INDEX + pd.Timedelta("1h"),
            "y_true": 20.0,
            "y_pred": 20.5,
            "q_0.1": np.where(np.arange(24) < 6, 20.1, 19.9),
            "q_0.9": 21.0,
        }
    )
    table = pd.DataFrame(
        {
            "rmse": [0.5, 0.7],
            "mae": [0.4, 0.6],
            "load_rmse": [1.25, np.nan],
            "seconds": [3.0, 0.004],
            "note": ["", "box"],
        },
        index=["hybrid", "ARX"],
    )
    forecast = pd.DataFrame(
        {"T_za": 20.0, "Q_hvac": 2.0, "Q_hvac_delivered": 1.5, "T_za_measured": 20.1, "setpoint": 21.0}, index=INDEX
    )
    rows = pd.DataFrame({"T_oa": 5.0, "Q_hvac": 2.0, "T_za": 20.0}, INDEX)
    study = StudyResult(
        settings=settings_from({"name": name, "columns": {role: role for role in rows}, "network": {"name": "2R2C"}}),
        data=StudyData(rows, rows, INDEX[0], rows, rows, rows["T_za"], held_out=True),
        model=_model(),
        frames={"hybrid": frame, "ARX": frame},
        table=table,
        forecast=forecast,
        warnings=["the scale is not identifiable"],
        identification=type(identification, (), {})(),
        zeta=pd.Series(1.0, index=INDEX),
        parameters=PARAMETERS,
        building=PARAMETERS.drop(columns="description"),
    )
    return replace(study, **changes)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, _study())
    return path.read_text(encoding="utf-8")


class Reader(HTMLParser):
    """Tags that are open, addresses, and text."""

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.text, self.alts = [], [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "srcset", "action")]
        self.alts += [value for name, value in attrs if name == "alt"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def _read(page):
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


def test_it_refers_to_nothing_outside_itself(page):
    reader = _read(page)
    assert len(reader.addresses) == len(reader.alts) == 5
    for address in reader.addresses:
        kind, content = address.split(",", 1)
        assert kind == "data:image/png;base64"
        assert base64.b64decode(content).startswith(b"\x89PNG")
    assert not re.search(r"https?://|@import|url\(", page)


def test_it_tells_the_numbers(page):
    text = " ".join(_read(page).text)
    for wanted in ("0.50 K", "1.25 kW", "48\u00a0kWh", "Q_h", "given beforehand", "the scale is not identifiable"):
        assert wanted in text
    for wanted in (
        "Zone 7",
        "train",
        f"{INDEX[0]} to {INDEX[-1]}",
        "network.name",
        "2R2C",
        "Monday 1 January 2024",
        "last complete day of the log",
        "0 to 2\u00a0h 75\u00a0% 25\u00a0% 2 to 8\u00a0h 50\u00a0% 50\u00a0% 8 to 24\u00a0h",
        "it contained 75\u00a0% of the",
        "Q_h [kW]",
        "separate identification (PeriodicDisturbanceID)",
    ):
        assert wanted in text
    assert "timezone" not in text
    assert page.index("<td>hybrid</td>") < page.index("<td>ARX</td>")
    assert page.count('<tr class="best">') == 1


def test_settings_name_holidays_as_days():
    settings = {"holidays": [date(2023, 10, 9), date(2023, 10, 10)], "load": {"setpoint": [20, 26]}}
    assert flat(settings) == {"holidays": "2023-10-09, 2023-10-10", "load.setpoint": [20, 26]}


@pytest.mark.usefixtures("empty_pictures")
def test_what_it_is_given_is_escaped(tmp_path):
    evil = "<script>alert(1)</script>"
    study = _study(evil, evil, warnings=[evil], model=_model(weights=WEIGHTS.rename(columns={"ARX": evil})))
    values = study.parameters.assign(remark=evil, unit=evil)
    study = replace(study, table=study.table.assign(note=evil), parameters=values, building=values)
    write_report(tmp_path / "r.html", study)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "&lt;script&gt;" in page


@pytest.mark.usefixtures("empty_pictures")
def test_it_does_without_what_is_not_there(tmp_path):
    study = _study(warnings=[])
    frames = {name: frame.drop(columns=["q_0.1", "q_0.9"]) for name, frame in study.frames.items()}
    own = {"identification": study.model.gray_box_, "forecast": study.forecast[["T_za"]], "frames": frames}
    write_report(tmp_path / "r.html", replace(study, **own))
    text = " ".join(_read((tmp_path / "r.html").read_text(encoding="utf-8")).text)
    assert "kWh" not in text.replace("kWh/K", "")
    for absent in ("Warnings", "Learned schedules", "contained", "separate identification"):
        assert absent not in text
    assert "the day after the last measurement" in text


def test_the_same_study_gives_the_same_file(tmp_path):
    for name in ("a", "b"):
        write_report(tmp_path / name, _study())
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


@pytest.mark.parametrize("columns", [["T_za", "Q_hvac"], ["T_za"]])
def test_one_picture_of_a_study(tmp_path, columns):
    study = _study()
    study_picture(tmp_path / "p.png", study.frames, study.forecast[columns], title="Zone 7")
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("own", "other", "words"),
    [
        (0.4, 0.5, "forecasts best: its error is 0.40 K, 20 % less than the next best, ARX"),
        (0.5, 0.4, "Another model forecasts better here: the error of ARX is 0.40 K"),
        (0.4, 0.405, "equally well, within the noise"),
        (0.4, 0.415, "equally well, within the noise"),
        (0.4, np.nan, "day-ahead temperature error of the hybrid model is 0.40 K"),
    ],
)
def test_the_verdict_is_what_the_table_says(own, other, words):
    assert words in verdict(pd.DataFrame({"rmse": [own, other]}, index=["hybrid", "ARX"]))


@pytest.mark.usefixtures("empty_pictures")
def test_it_shows_what_the_day_costs(tmp_path):
    study = _study()
    study.next_day_cost = Cost(4.218, (3.5, 5.014), "electricity", "EUR")
    write_report(tmp_path / "r.html", study)
    text = " ".join(_read((tmp_path / "r.html").read_text(encoding="utf-8")).text)
    assert "4.22\u00a0EUR" in text
    assert "cost of the electricity for it; 80 % interval 3.50 to 5.01" in text


def test_lines_of_a_figure_differ_without_colour():
    study = _study()
    names = ["hybrid", *(f"another model with a long name {n}" for n in range(4))]
    frames = dict.fromkeys(names, study.frames["hybrid"])
    day = study.forecast.assign(**{"q_0.1": 19.0, "q_0.9": 21.0})
    for figure in (day_figure(day), backtest_figure(frames), lead_figure(frames), schedule_figure(SCHEDULE)):
        for ax in figure.axes:
            lines = [line for line in ax.lines if not line.get_label().startswith("_")]
            looks = [(str(line._dash_pattern), line.get_marker()) for line in lines]
            assert len(set(looks)) == len(looks) > 1
        figure.draw_without_rendering()
        for ax in figure.axes:  # a long legend must not squeeze the axes
            assert ax.get_position().width > 0.8


_MEASURE = """<iframe src="phone.html" style="width:390px;height:900px"></iframe>
<iframe src="paper.html" style="width:688px;height:900px"></iframe><pre id="found"></pre><script>onload = () => {
const parts = [...document.querySelectorAll("iframe")].map(f => { const d = f.contentDocument;
  const clipped = [...d.querySelectorAll(".wide")].filter(e => e.scrollWidth > e.clientWidth + 1).length;
  return d.documentElement.scrollWidth - f.clientWidth + " " + clipped; });
document.getElementById("found").textContent = parts.join("; "); }</script>"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs a browser")
def test_it_fits_a_phone_and_its_tables_fit_the_paper(tmp_path):
    """A page of A4 with margins of 14 mm is 688 px wide."""
    study = _study()
    long = "a description of some length, as they are in a study"
    table = study.table.rename(index={"ARX": "black box (ARX), fitted at every origin"}).assign(note=long)
    values, frames = study.parameters.assign(description=long, remark=long), {"hybrid": study.frames["hybrid"]}
    write_report(tmp_path / "phone.html", replace(study, table=table, frames=frames, parameters=values))
    page = (tmp_path / "phone.html").read_text(encoding="utf-8")
    (tmp_path / "paper.html").write_text(page.replace("@media print", "@media screen"), encoding="utf-8")
    (tmp_path / "both.html").write_text(_MEASURE, encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--dump-dom"]
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    run = subprocess.run(
        ["chromium", *flags, profile, "--virtual-time-budget=4000", f"file://{tmp_path / 'both.html'}"],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    wider_on_phone, wider_on_paper, clipped_on_paper = re.search(
        r'id="found">(-?\d+) \d+; (-?\d+) (\d+)<', run.stdout
    ).groups()
    assert int(wider_on_phone) <= 0
    assert int(wider_on_paper) <= 0
    assert int(clipped_on_paper) == 0


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize("remark", ["", "given"])
def test_a_column_of_remarks_is_left_out_where_there_are_none(tmp_path, remark):
    study = _study()
    values = study.parameters.assign(remark=remark)
    write_report(tmp_path / "r.html", replace(study, parameters=values, building=values))
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert (">remark</th>" in page) == bool(remark)
    assert ">description</th>" in page
