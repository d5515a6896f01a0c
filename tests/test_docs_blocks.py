"""Blocks of code in README, documentation and docstrings: each runs, page by page.

A page whose code takes minutes says so ("takes about 3 minutes") and runs by hand:
``SKHYBRID_SLOW_PAGES=1 pytest tests/test_docs_blocks.py``.
"""

from __future__ import annotations

import doctest
import importlib
import os
import re
import warnings
from contextlib import suppress
from pathlib import Path
from unittest import SkipTest

import pytest
from sybil import Sybil
from sybil.parsers import markdown, rest

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


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_docstrings_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(importlib.import_module(name), optionflags=OPTIONS)
    assert found.attempted
    assert not found.failed
