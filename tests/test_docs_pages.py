"""Pages of the documentation: titles, alternative texts, and equations without a network."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import jinja2
import pytest

DOCS = Path(__file__).resolve().parents[1] / "docs"
sys.path.insert(0, str(DOCS / "_ext"))

import commands  # noqa: E402
import mathml  # noqa: E402
import used_on  # noqa: E402

CONF = f"import sys; sys.path.insert(0, {str(DOCS / '_ext')!r}); extensions = ['whole_pages', 'mathml']"


def build(folder: Path, page: str) -> subprocess.CompletedProcess:
    """Build a site of one page; warnings are errors."""
    (folder / "conf.py").write_text(CONF + "; html_math_renderer = 'mathml'", encoding="utf-8")
    (folder / "index.rst").write_text(page, encoding="utf-8")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-b", "html", folder, folder / "out"]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("Words under no title.\n", "has no title"),
        ("Title\n=====\n\n.. image:: a.png\n", "no :alt: text"),
        ("Title\n=====\n\n.. math:: x_k\n\n.. image:: a.png\n   :alt: a line\n", ""),
    ],
)
def test_a_page_without_a_title_or_a_picture_without_words_fails_the_build(tmp_path, page, said):
    (tmp_path / "a.png").write_bytes(b"")
    done = build(tmp_path, page)
    assert said in done.stderr
    assert bool(done.returncode) == bool(said)
    if not said:
        html = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
        assert '<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">' in html
        assert "<script" not in html.partition("<math")[2].partition("</math>")[0]


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.rst")), ids=lambda page: page.relative_to(DOCS).as_posix())
def test_what_a_page_refers_to_exists(page):
    for role, name in re.findall(r":(mod|class|func|meth|data|exc|attr):`~?(skhybrid[\w.]*)`", page.read_text("utf-8")):
        assert pkgutil.resolve_name(name) is not None
        parent, _, last = name.rpartition(".")
        found = getattr(pkgutil.resolve_name(parent), last)  # a function may hide the module of its name
        assert inspect.ismodule(found) == (role == "mod"), f"{name} is a {type(found).__name__}"


def test_an_index_stands_beside_the_letter_under_an_accent():
    found = mathml._mathml(r"\hat x_{k}")
    assert "munderover" not in found
    assert found.index("<mover") < found.index("<mi>k</mi>")


@pytest.mark.parametrize(("name", "page"), [("LeadErrorDisplay", "how_to/tune"), ("ModelCase", "how_to/add_a_case")])
def test_the_page_of_a_class_leads_to_the_pages_that_use_it(name, page):
    template = (DOCS / "_templates" / "autosummary" / "class.rst").read_text("utf-8")
    template = template.replace("escape | underline", "escape")
    shown = jinja2.Template(template).render(objname=name, pages=used_on.pages_by_name(DOCS))
    assert f"\n- :doc:`/{page}`\n" in shown


@pytest.mark.parametrize(
    "page", sorted({*(DOCS / "how_to").glob("*.rst")} - {DOCS / "how_to" / "index.rst"}), ids=lambda page: page.stem
)
def test_a_how_to_page_ends_with_what_to_read_next(page):
    assert ":doc:`" in page.read_text("utf-8").rstrip().rpartition("\n\n")[2]


def test_the_page_of_the_command_line_has_every_command():
    found = dict(commands.helps())
    modules = {path.stem for path in (DOCS.parent / "skhybrid" / "cli").glob("[!_]*.py")}
    assert {name.split()[1] for name in found if " " in name} == modules
    assert "--overwrite " in found["skhybrid check"]
    assert "--refit-after " in found["skhybrid zone tick"]
    assert ".. commands::" in (DOCS / "reference" / "commands.rst").read_text("utf-8")


@pytest.mark.parametrize("example", sorted((DOCS.parent / "examples").glob("plot_*.py")), ids=lambda path: path.stem)
def test_a_figure_over_time_says_whose_time(example):
    text = example.read_text("utf-8")
    dates = r"autofmt_xdate\(|DateFormatter\(|tick_params\(axis=\"x\""
    assert len(re.findall(dates, text)) == text.count('xlabel("local time")')


def test_the_source_of_a_module_links_back_to_the_pages_of_one():
    """Sphinx keeps one module for all links from a source; a name that another module documents too is left out."""
    settings = ast.parse((DOCS / "conf.py").read_text(encoding="utf-8"))
    given = {ast.unparse(one.targets[0]): one.value for one in settings.body if isinstance(one, ast.Assign)}
    left_out = ast.literal_eval(given["_WITHOUT_SOURCE"])
    found = {}
    for name in re.findall(r"^   (skhybrid\.\w+)$", (DOCS / "api.rst").read_text(encoding="utf-8"), re.M):
        module = importlib.import_module(name)
        for own in set(module.__all__) - {one for of, one in left_out if of == name}:
            found.setdefault(getattr(getattr(module, own), "__module__", own), set()).add(name)
    assert [source for source, modules in found.items() if len(modules) > 1] == []
