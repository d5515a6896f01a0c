"""Numbers in README and docs: each is in a table of ``benchmarks/results``, or is listed here with a reason."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))

import results  # noqa: E402

PAGES = sorted(str(p.relative_to(ROOT)) for p in [ROOT / "README.md", *(ROOT / "docs").rglob("*.rst")])
PAGES = [page for page in PAGES if not page.startswith(("docs/_", "docs/generated", "docs/auto_examples", "docs/sg_"))]
UNIT = r"(?:K|kW|kWh|degC|%|s|ms|MB|times)(?![\w/])"
NUMBER = re.compile(rf"(?<![\w.])(?:\d+\.\d+(?![\w.])|\d+(?= {UNIT}))")
INDENTED = re.compile(
    r"( *)(?:\.\. (?:code-block|math|literalinclude|image|frame|drawing|measured|\[\d|toctree)|(?!\.\. ).*::$|.*>>>)"
)
#: numbers that are no results: a part of the page's name, a pattern and the reason
NO_RESULTS = [
    ("", r"80 % intervals?|with 90 % intervals|[Ii]ntervals of nominal \d\d %", "a level"),
    ("", r"paper \(?\d\.\d|paper's scheme \(3\.1|Eqs. in \d\.\d|Python 3\.11", "a name"),
    ("README.md", r"differences under 5 % mean little", "a rule of thumb"),
    (
        "results/forecast.rst",
        r"targets were errors of at most .*? times those of the best|targets for its three ratios were [\d., ]+ and "
        r"[\d.]+",
        "chosen before the benchmark ran",
    ),
    (
        "explanation/gain.rst",
        r"jumps by 0\.3 of|loosely \(7 % at|1 \+ 0\.24 ln|h below 10 %|room by 1\.5 K|less than 0\.6 of the heat",
        "settings",
    ),
    ("results/control.rst", r"within 15 % .*? 25 %|\(95 % interval", "settings"),
    ("data_contract.rst", r"reflects 20 %", "a default"),
    ("data_contract.rst", r"differ from those .*? 0\.088", "asserted by tests/test_facades.py"),
    ("check_a_model.rst", r"below 0\.1 the text says", "a setting"),
    ("plan_an_experiment.rst", r"hold within 0\.5 K", "a setting"),
    ("explanation/rulings.rst", r"\(0\.1 here\)|Adam, 0\.003", "a setting"),
    ("thermostat.rst", r"if 1 kW moves .*? 2 kW\.", "an example"),
    ("thermostat.rst", r"less than 2 % of the highest load", "a setting"),
    ("schedule_model.rst", r"\[kW per 10 K\]|taken as 6 kW", "an example or a unit"),
    (
        "schedule_model.rst",
        r"at 20 % and 45 %|error of 0\.05 K|gives 0\.1 to|is 0\.3, and|or less count 3 %, and|less than 40 % of that",
        "settings",
    ),
    ("thermostat.rst", r"less than 0\.01 K", "a setting"),
    ("thermostat.rst", r"to 0\.01 K in the tests", "asserted by tests/test_schedule_scheme.py"),
    (
        "identifiability.rst",
        r"a quarter at 90 %|\d kW and 90 % of it between \S+ / 1\.1 and 6 \* 1\.1|above 1\.05",
        "settings",
    ),
    ("choose_a_disturbance_model.rst", r"with probability 0\.95 is", "a setting"),
    (
        "results/study.rst",
        r"^(.+?)(?= The Bayesian regression )|Limits .+",
        "the page of one study, with a test of its own (tests/test_benchmarks_selection_study.py)",
    ),
    ("read_the_report.rst", r"the 90 % interval of their ratio", "a level"),
    ("run_every_day.rst", r"0\.9 times the error", "a setting"),
    ("refused.rst", r"5 % of those", "a setting"),
    ("results/fleet.rst", r"at most 15 % of the cases", "a target"),
]


# ------------------------------------------------------------------------------------------------------------ sentences
def span(values: object, form: str = ".2f") -> str:
    """The least and the largest value."""
    numbers = np.asarray(values, dtype=float)
    return f"{numbers.min():{form}} to {numbers.max():{form}}"


def mean(values: pd.Series) -> float:
    """Geometric mean."""
    return float(np.exp(np.log(values.astype(float)).mean()))


RIDGE = "ridge on T_oa and set-point"  # a rule for the load alone, as yesterday's is


def readme() -> Iterator[str]:
    """Sentences of the README."""
    held = re.search(r"80 % intervals held \d+ % of the temperatures and \d+ % of the loads", results.note("demo"))[0]
    yield f"The {held}."


def held_buildings() -> tuple[pd.Series, pd.Series]:
    """Ratios to ARX and to ARX re-fitted on the buildings that were looked at once."""
    ratio = results.ratios()
    rows = ratio[ratio.index.str.startswith("held: ")]
    assert len(rows) == 36
    first = [rows[column].str.split().str[0].astype(float) for column in ("to ARX", "to ARX re-fitted")]
    return first[0], first[1]


def set_points_known() -> Iterator[str]:
    """Sentences on forecasts where only set-points are known."""
    known = results.table("set_points_known")["cov."].set_axis(["load", "temperature"], axis=1).astype(float) * 100
    switched = known.index.str.startswith("make_office")
    (of_both,) = set(known["load"][switched])
    yield (
        f"The 80 % intervals of the temperature held {span(known['temperature'], '.0f')} %. Those of the load held "
        f"{span(known['load'][~switched], '.0f')} % of the rows of six EnergyPlus runs, and "
        f"{of_both:.0f} % of those of the paper's office:"
    )
    running = results.table("set_points_known")["cov. running"].astype(float) * 100
    yield f"While the plant ran, or was forecast to run, they held {span(running, '.0f')} %."


def forecast() -> Iterator[str]:
    """Sentences of the page on forecasts."""
    yield from set_points_known()
    replayed = results.table("heat_replayed", "Ratio to the default, heat replayed").astype(float)
    many, refit = (replayed.loc["geometric mean", name] for name in ("ARX, multi-step, re-fitted", "ARX re-fitted"))
    yield f"leads ({many:.2f} times the default's error, geometric mean) and ARX re-fitted ({refit:.2f} times)."
    yield f"in Oakland, ARX re-fitted is better ({replayed.loc['make_office oakland', 'ARX re-fitted']:.2f})."
    shop = replayed.loc["retail_colorado_springs winter", "boosting on ARX"]
    yield f"In the shop in winter, boosting on ARX is better ({shop:.2f})."
    rivals = results.competitors().apply(lambda column: column.str.split().str[0].astype(float))
    ratio = rivals.div(rivals["default"], axis=0)
    home, new = ratio.index.str.contains("home"), ratio.index.str.contains("new")
    refit, boosted = ratio["ARX, multi-step, re-fitted"], ratio["boosting on ARX"]
    yield f"it has {span(refit[~home])} times the default's error in the offices and {span(refit[home])} times in the"
    yield (
        f"(winter {boosted['office winter, same control']:.2f}, summer {boosted['office summer, same control']:.2f}), "
        f"and are {span(100 * boosted[new] - 100, '.0f')} % worse under a new control."
    )
    home = float(results.ratios().loc["dutch home 3", "to ARX re-fitted"].split()[0])
    asked = results.table("forecast", "What is asked of the default (hybrid, full): ratio of errors")
    missed = asked.filter(like="best competitor").iloc[:, 0].str.contains("missed")
    with_calendar = missed.index.str.endswith(results.KNOWN)
    known = missed.groupby(missed.index.str.removesuffix(results.KNOWN)).last()  # rows with the calendar come later
    yield (
        f"(it is {100 * home - 100:.0f} % worse than ARX re-fitted), and the third on {missed[~with_calendar].sum()} "
        f"of the {sum(~with_calendar)} logs, on {known.sum()} if the models know the calendar."
    )
    worth = results.table("forecast", "Error with the calendar relative to that without it").loc["hybrid, full"]
    autumn = worth[worth.index.str.contains("autumn")].astype(float)
    yield f"the default's error in autumn falls by {span(100 - 100 * autumn, '.0f')} %:"
    arx, refitted = held_buildings()
    yield (
        f"The geometric mean of the ratios is {mean(arx):.2f} to ARX and {mean(refitted):.2f} to ARX re-fitted; the "
        f"worst are {arx.max():.2f} and {refitted.max():.2f}."
    )
    heads = ("heat known, as `make demo` has it", "heat known, with `[site]`")
    plain, site = (results.table("demo", head)["RMSE [K]"] for head in heads)
    assert plain["hybrid"] == site["hybrid"]
    yield f"error of ARX re-fitted from {plain['ARX re-fitted']} to {site['ARX re-fitted']} K and leaves the hybrid at"
    yield f"{site['hybrid']} K: the hybrid learns"


def identification() -> Iterator[str]:
    """Sentences of the page on identified parameters."""
    bias = results.table("coverage", "mean error [%]").query("climate == 'both'")["A_win"].astype(float)
    yield f"(their A_win is {np.floor(bias[['CONV', 'ID', 'OD']].min().round() / 10) * 10:.0f} % too large and more)"
    away = results.table("objectives", "Median distance from the truth [%]").set_index("objective", append=True)["C_za"]
    yield f"The C_za of ID is {float(away['ID', 'one_step']):.1f} % off with"
    yield f"and {float(away['ID', 'multi_step']):.0f} % off with"
    error = results.table("objectives", "Forecasts of a day").set_index("objective", append=True)["midnight median [K]"]
    yield f"({error['OD', 'multi_step']} K against {error['OD', 'one_step']} K)"
    held = results.table("objectives", "Coverage of the centre of the estimates by intervals of 90 % [%]")
    held = held[held["objective"] == "multi_step"].drop(columns="objective")
    yield f"contained the centre of the estimates in {span(held, '.0f')} % of these fits"


def intervals() -> Iterator[str]:
    """Sentences of the page on intervals."""
    tables = (results.table("intervals", f"{of}, default")["hybrid"].astype(float) for of in INTERVALS)
    covered, width = tables
    home = width.index.str.contains("home")
    yield f"the 80 % intervals of the default cover {span(100 * covered, '.0f')} % of the measurements."
    yield f"They are {span(width[~home], '.1f')} K wide in offices and {span(width[home], '.1f')} K in homes"


INTERVALS = ("Coverage of 80 % intervals [-]", "Width of 80 % intervals [K]")


def study() -> Iterator[str]:
    """Sentences of the page on the study."""
    effects = results.table("selection_bayes", "Effects [K]").astype(float)
    yield f"is then {span(effects['std, groups'] / effects['std, rows'], '.1f')} times as large"
    past = effects.loc["past-w"]
    yield f"probability {past['P(reduces), groups']:.2f} instead of {past['P(reduces), rows']:.2f}"
    cost = results.table("selection_bayes", "2736 candidates, 76 cases").loc["RobustnessComparison"].astype(float)
    yield (
        f"take {cost['seconds']:.0f} s on one of two busy cores, {cost['seconds of the processor']:.0f} s of it "
        "processor time"
    )


def online_updating() -> Iterator[str]:
    """Sentences of the page on online updating."""
    found = results.table("online_updating", "Day-ahead RMSE [K] around a change of schedule")
    later = found.set_index("model", append=True)["later / before"].astype(float)
    hours, both = "three hours later", "three hours later, closed on Friday and Saturday"
    yield (
        f"has {later[hours, 'adapted']:.2f} times its earlier error, the frozen one {later[hours, 'frozen']:.2f} "
        f"times; without any change the same weeks have {later['no change', 'adapted']:.2f} times the earlier error."
    )
    yield f"it is {later[both, 'adapted']:.2f} against {later[both, 'frozen']:.2f}"
    yield (f"with ridge ends at {later[hours, 'two-stage, adapted']:.2f} and {later[both, 'two-stage, adapted']:.2f}.")
    alarms = results.table("online_updating", "Drift signal of the frozen model")["alarm after [d]"]
    changed = alarms[alarms.index != "no change"]
    days = changed[changed != "none"].astype(int)
    false = (alarms["no change"] != "none").sum()
    assert len(changed) - len(days) == 1
    yield (
        f"drift {days.min()} to {days.max()} days after the change in {len(days)} of {len(changed)} logs, and never in "
        f"the other one; in {false} of the {len(alarms['no change'])} offices it also signalled drift without a change."
    )


SENTENCES = {
    f"docs/results/{page.__name__}.rst": page for page in (forecast, identification, intervals, study, online_updating)
} | {"README.md": readme}


# ----------------------------------------------------------------------------------------------------------------- text
def prose(page: str) -> str:
    """The text of a page on one line, without code, formulas, tables of the README and addresses."""
    lines, inside = [], None
    fenced = False
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        fenced ^= line.startswith("```")
        indent = len(line) - len(line.lstrip())
        if inside is not None and line.strip() and indent <= inside:
            inside = None
        if inside is None and (page.endswith(".rst") and (found := INDENTED.match(line))):
            inside = len(found[1])
            line = "" if line.lstrip().startswith("..") else line
        elif inside is not None or fenced or (page.endswith(".md") and line.startswith(("|", "```"))):
            continue
        lines.append(line.strip())
    text = " ".join(" ".join(lines).split())
    return re.sub(
        r"``.*?``|(?<!`)`[^`]+`(?!_)|:math:`.*?`|\]\(.*?\)|https?://\S+|doi:\S+|`[^`]*<http[^`]*`__", "_", text
    )


# ---------------------------------------------------------------------------------------------------------------- tests
@pytest.mark.parametrize("page", SENTENCES)
def test_sentences_have_the_numbers_of_the_tables(page):
    text = prose(page)
    for sentence in SENTENCES[page]():
        assert sentence in text, f"{page} should say: {sentence}"


@pytest.mark.parametrize("page", PAGES)
def test_every_number_is_in_a_table_or_has_a_reason(page):
    text = prose(page)
    known = [re.escape(sentence) for sentence in SENTENCES.get(page, lambda: ())()]
    known += [pattern for part, pattern, _ in NO_RESULTS if part in page]
    covered = [found.span() for pattern in known for found in re.finditer(pattern, text)]
    loose = [n for n in NUMBER.finditer(text) if not any(a <= n.start() < b for a, b in covered)]
    where = [text[max(0, n.start() - 50) : n.end() + 30] for n in loose]
    assert not loose, f"{page}: take from a table of benchmarks/results, or name the reason in NO_RESULTS: {where}"


def test_tables_of_the_readme_are_those_of_the_benchmarks():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    found = [line for line in lines if re.match(r"\|.*\d\.\d", line)]
    expected = [results.table("demo", "set-points known, as `make demo` has it"), results.demo_in_short()]
    rows = [[key, *row] for frame in expected for key, row in zip(frame.index, frame.to_numpy(), strict=True)]
    assert [results.cells(line) for line in found] == rows
    for frame in expected:
        assert "| " + " | ".join([frame.index.name, *frame.columns]) + " |" in lines


@pytest.mark.parametrize("page", [page for page in PAGES if page.endswith(".rst")])
def test_pages_hold_no_typed_copies_of_tables(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    typed = re.findall(r"^ +- [<>±]?\d+\.\d+.*$", text, re.M)
    assert not typed, f"{page}: show the table by '.. frame:: results: ...' instead of {typed}"
