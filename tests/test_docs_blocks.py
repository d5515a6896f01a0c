"""Blocks of code in README, documentation and docstrings: each runs, page by page.

A page whose code takes minutes says so ("takes about 3 minutes") and runs by hand:
``SKHYBRID_SLOW_PAGES=1 pytest tests/test_docs_blocks.py``.
"""

from __future__ import annotations

import doctest
import importlib
import os
import re
import shlex
import warnings
from contextlib import suppress
from pathlib import Path
from textwrap import dedent
from unittest import SkipTest

import pytest
from sybil import Sybil
from sybil.parsers import markdown, rest

from skhybrid.cli import main

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[1]
SLOW = re.compile(r"code of this page takes about \d+\s+minutes")
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
REST = [rest.PythonCodeBlockParser(), rest.DocTestParser(OPTIONS), rest.SkipParser()]
PAGES = [
    ROOT / "README.md",
    *(p for p in sorted((ROOT / "docs").rglob("*.rst")) if not {"generated", "auto_examples"} & {*p.parts}),
]
WITH_CODE = [p for p in PAGES if re.search(r"code-block:: py|```python", p.read_text("utf-8"))]
MODULES = sorted(
    ".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for p in (ROOT / "skhybrid").rglob("*.py")
    if ">>>" in p.read_text("utf-8")
)


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch):
    if SLOW.search(page.read_text("utf-8")) and not os.environ.get("SKHYBRID_SLOW_PAGES"):
        pytest.skip("a page of minutes: SKHYBRID_SLOW_PAGES=1 runs it")
    plt = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.chdir(tmp_path)
    parsers = [markdown.PythonCodeBlockParser()] if page.suffix == ".md" else REST
    document = Sybil(parsers=parsers).parse(page)
    document.namespace["ROOT"] = ROOT
    examples = list(document.examples())
    assert examples
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for example in examples:
            with suppress(SkipTest):  # a block that says why it is skipped, such as one for a cluster
                example.evaluate()
    plt.close("all")


def test_the_output_on_the_first_pages_is_that_of_the_commands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    start = ROOT / "docs" / "start" / "index.rst"
    next(iter(Sybil(parsers=REST).parse(start).examples())).evaluate()  # writes the log
    text = start.read_text("utf-8").replace("\\\n", "")  # with commands over several lines on one
    for command in re.findall(r"^   \$ skhybrid (.+)$", text, re.MULTILINE):
        assert main(shlex.split(command)) == 0
    printed = capsys.readouterr().out.splitlines()
    for page in (start, ROOT / "docs" / "how_to" / "your_log.rst"):
        shown = re.search(r"code-block:: text\n\n(   +room.+?)\n\n(?=\S)", page.read_text("utf-8"), re.DOTALL)
        lines = [line for line in dedent(shown[1]).splitlines() if line not in ("", "...")]
        assert len(lines) > 3
        for line in lines:
            assert any(_reads_alike(line, other) for other in printed), line


def test_the_plan_of_an_experiment_is_the_one_shown(capsys):
    page = ROOT / "docs" / "how_to" / "plan_an_experiment.rst"
    next(iter(Sybil(parsers=REST).parse(page).examples())).evaluate()
    shown = re.search(r"code-block:: text\n\n(.+?)\n\n(?=\S)", page.read_text("utf-8"), re.DOTALL)
    lines, printed = dedent(shown[1]).splitlines(), capsys.readouterr().out.splitlines()
    assert len(lines) == len(printed) > 3
    assert all(map(_reads_alike, lines, printed))


def _reads_alike(line: str, other: str) -> bool:
    """Whether two lines have the same words, and numbers that differ by rounding at most."""
    words, others = line.split(), other.split()
    return len(words) == len(others) and all(map(_alike, words, others))


def _alike(word: str, other: str) -> bool:
    with suppress(ValueError):
        return float(word) == pytest.approx(float(other), abs=0.02)
    return word == other


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_docstrings_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(importlib.import_module(name), optionflags=OPTIONS)
    assert found.attempted
    assert not found.failed
