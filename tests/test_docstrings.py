"""Every public class, function, method and property has a numpydoc docstring that agrees with its signature."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from types import ModuleType

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

import skhybrid
from skhybrid._docs import filled

PACKAGES = [skhybrid.__name__] + [
    f"skhybrid.{name}" for name in skhybrid.__all__ if isinstance(getattr(skhybrid, name), ModuleType)
]
#: no docstring; a parameter that is not documented; one that does not exist; another order; a summary that is missing.
CHECKED = {"GL08", "PR01", "PR02", "PR03", "SS01"}


def _ours(member: object) -> bool:
    function = member.fget if isinstance(member, property) else member
    return getattr(function, "__module__", "").startswith("skhybrid")


def _members(path: str, cls: type) -> Iterator[str]:
    for name, member in inspect.getmembers(cls):
        documented = inspect.isroutine(member) or isinstance(member, property)
        if documented and not name.startswith("_") and _ours(member):
            yield f"{path}.{name}"


def _names(module: ModuleType) -> list[str]:
    """The names that a package lists, or the public ones that a plain module defines."""
    defined = [
        n for n, v in vars(module).items() if not n.startswith("_") and _ours(v) and v.__module__ == module.__name__
    ]
    return list(getattr(module, "__all__", defined))


def _public() -> Iterator[str]:
    seen = set()  # what the root takes from a package is looked at there
    for package in map(import_module, reversed(PACKAGES)):
        for name in _names(package):
            value = getattr(package, name)
            path = f"{package.__name__}.{name}"
            if id(value) in seen or (not inspect.isroutine(value) and not inspect.isclass(value)):
                continue
            seen.add(id(value))
            yield path
            if inspect.isclass(value):
                yield from _members(path, value)


PUBLIC = sorted(_public())


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_lists_its_public_names_and_says_what_it_is(package):
    module = import_module(package)
    assert module.__doc__
    if hasattr(module, "__path__"):
        assert list(module.__all__) == sorted(set(module.__all__))


def _undocumented(path: str) -> set[str]:
    """Fields of a record (a dataclass or a NamedTuple) that its section Attributes does not name."""
    cls = _load(path)
    if not inspect.isclass(cls) or not (is_dataclass(cls) or hasattr(cls, "_fields")):
        return set(inspect.signature(cls).parameters)
    documented = {name.strip() for item in get_doc_object(cls)["Attributes"] for name in item.name.split(",")}
    return set(inspect.signature(cls).parameters) - documented


def _load(path: str) -> object:
    package, *rest = path.removeprefix("skhybrid.").split(".")
    found = getattr(skhybrid, package)
    for name in rest:
        found = getattr(found, name)
    return found


@pytest.mark.parametrize("path", PUBLIC)
def test_a_docstring_agrees_with_the_signature(path):
    problems = {code: text for code, text in validate(path)["errors"] if code in CHECKED}
    if "PR01" in problems and not _undocumented(path):  # a record whose fields are its attributes
        del problems["PR01"]
    assert not problems


def test_a_summary_says_what_a_function_does_or_returns():
    root = Path(__file__).parents[1]
    sources = [path for part in ("skhybrid", "benchmarks", "tests") for path in (root / part).rglob("*.py")]
    begins = re.compile(r'"""(What|How|Which|Where) .*')
    found = [f"{path}: {begin[0]}" for path in sources for begin in begins.finditer(path.read_text("utf-8"))]
    assert not found


def test_a_name_that_a_text_gives_exists():
    """Messages and docstrings send users to classes and functions by their full names."""
    sources = (Path(__file__).parents[1] / "skhybrid").rglob("*.py")
    given = re.compile(r"(?<![\w./-])skhybrid(?:\.\w+)+")
    for name in sorted({name for path in sources for name in given.findall(path.read_text("utf-8"))}):
        resolve_name(name)


def _wrong(given: int) -> int:
    """Return the number.

    Parameters
    ----------
    other : int
        Not in the signature.
    """
    return given


def test_a_docstring_that_disagrees_is_seen():
    seen = {code for code, _ in validate(get_doc_object(_wrong))["errors"]}
    assert {"PR01", "PR02"} <= seen


def test_a_shared_block_is_indented_like_the_line_that_asks_for_it():
    block = """
        m : int
            How many.
        """
    text = filled("One.\n\n    %(what)s\n    n : int", {"what": block})
    assert text == "One.\n\n    m : int\n        How many.\n    n : int"
