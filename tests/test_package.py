"""The package of itself: versions, addresses, classifiers and requirements."""

from __future__ import annotations

import contextlib
import re
import tomllib
from importlib.metadata import PackageNotFoundError, metadata, version
from itertools import chain
from pathlib import Path

import pytest
from click.testing import CliRunner
from packaging.specifiers import SpecifierSet

import skhybrid
from skhybrid.cli import _group

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CONSTRAINTS = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()


def test_versions_agree():
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text("utf-8"), re.M)[1]
    assert cited == PROJECT["version"]
    assert CliRunner().invoke(_group(), ["--version"]).output.strip() == f"skhybrid {skhybrid.__version__}"


def test_show_versions_names_everything_that_can_be_installed(capsys):
    skhybrid.show_versions()
    shown = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert shown[:3] == ["skhybrid", "python", "system"]
    assert {"numpy", "scikit-learn", "torch", "pymc"} <= set(shown)
    assert len(shown) == len(set(shown))
    assert not {"pytest", "ruff", "sphinx"} & set(shown)


def test_the_changelog_has_the_version():
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert headings[:2] == ["Unreleased", PROJECT["version"].partition(".dev")[0]]


@pytest.mark.parametrize("name", ["LICENSE", "CITATION.cff", "SECURITY.md", "CODE_OF_CONDUCT.md", "skhybrid/py.typed"])
def test_what_a_stranger_looks_for_is_there(name):
    assert (ROOT / name).is_file()


def test_classifiers_name_every_tested_python():
    versions = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", c)]
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    assert re.search(r"python: (\[.*\])", workflow)[1] == str(versions).replace("'", '"')
    assert PROJECT["requires-python"] == f">={versions[0]}"


def test_constraints_name_every_requirement():
    pinned = {line.partition("==")[0].lower().replace("_", "-") for line in CONSTRAINTS}
    lines = [*PROJECT["dependencies"], *chain.from_iterable(PROJECT["optional-dependencies"].values())]
    needed = {re.split(r"[^\w-]", line)[0].lower() for line in lines} - {"skhybrid"}
    assert needed <= pinned


def test_constraints_install_on_the_oldest_python_of_the_package():
    """A pin that needs a later patch release of Python stops every installation of it."""
    oldest = PROJECT["requires-python"].removeprefix(">=") + ".0"
    wanted = {}
    for name, _, pin in (line.partition("==") for line in CONSTRAINTS if "==" in line):
        with contextlib.suppress(PackageNotFoundError):
            wanted[name] = metadata(name).get("Requires-Python", "") if version(name) == pin else ""
    assert len(wanted) > 20
    assert {name: python for name, python in wanted.items() if oldest not in SpecifierSet(python)} == {}
