"""Rules that keep the source readable: one name per thing, small files and functions, no foreign private state."""

from __future__ import annotations

import ast
import importlib
import inspect
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sources import PACKAGE, PATHS, text_of, tree_of

#: modules that share a base name because they are about the same thing
SAME_THING = {
    "base",  # the base class of its folder
    "posterior",  # of the parameters: sampled in identification, drawn in inspection
}
#: functions that share a name because each does the same for its kind
SAME_FOR_ITS_KIND = {
    "looks_like",  # of a file, by each reader of logs
    "read",  # a file, by each reader of logs
    "read_log",  # with the columns of its source in logs, with those of a configuration in studies
}
#: layers of BaseHybrid, whose public methods one file does not hold
LAYERS = {"AffineFramesMixin", "FramesForecastMixin", "FramesReadingMixin"}
MOST_LINES, MOST_LINES_OF_A_FUNCTION = 400, 40


def body_length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body, its docstring left out."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 1


def foreign_private_writes(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Assignments to a private attribute of a foreign object: one that no class of the module sets on itself."""
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)]
    known = {node.attr for node in nodes if isinstance(node.ctx, ast.Store) and node.value.id in ("self", "cls")}
    for node in ast.walk(tree):
        targets = node.targets if isinstance(node, ast.Assign) else []
        if isinstance(node, ast.AugAssign | ast.AnnAssign):
            targets = [node.target]
        parts = [part for target in targets for part in ast.walk(target) if isinstance(part, ast.Attribute)]
        for part in parts:
            own = isinstance(part.value, ast.Name) and part.value.id in ("self", "cls")
            if part.attr.startswith("_") and not own and part.attr not in known:
                yield node.lineno, ast.unparse(part)


def test_no_two_modules_share_a_base_name():
    names = Counter(
        Path(path).stem.lstrip("_")
        for path in PATHS
        if not path.endswith(("__init__.py", "__main__.py")) and not path.startswith("cli/")  # which has commands
    )
    assert {name for name, count in names.items() if count > 1} <= SAME_THING


def test_no_two_classes_share_a_name():
    nodes = (node for path in PATHS for node in ast.walk(tree_of(path)))
    names = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef))
    assert not [name for name, count in names.items() if count > 1]


def test_a_mixin_has_several_users():
    """One that has a single user is a component of it, which is given what it needs."""
    classes = [node for path in PATHS for node in ast.walk(tree_of(path)) if isinstance(node, ast.ClassDef)]
    users = Counter(ast.unparse(base) for node in classes for base in node.bases)
    assert {node.name for node in classes if node.name.endswith("Mixin") and users[node.name] < 2} == LAYERS


def test_no_two_functions_share_a_name():
    names = Counter(
        node.name
        for path in PATHS
        for node in tree_of(path).body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not path.startswith("cli/")
    )
    assert {name for name, count in names.items() if count > 1} == SAME_FOR_ITS_KIND


def test_no_module_writes_private_state_of_another_object():
    writes = [(path, *write) for path in PATHS for write in foreign_private_writes(tree_of(path))]
    assert not writes


def test_a_foreign_write_is_seen():
    source = "self._a = 1\nother._b = 2\nthing.c = 3\nx, one._d[0] = 4, 5\n"
    assert [target for _, target in foreign_private_writes(ast.parse(source))] == ["other._b", "one._d"]


def test_files_and_functions_are_small():
    assert not [path for path in PATHS if text_of(path).count("\n") > MOST_LINES]
    nodes = ((path, node) for path in PATHS for node in ast.walk(tree_of(path)))
    lengths = {
        f"{path}:{node.lineno} {node.name}": body_length(node)
        for path, node in nodes
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert not {name: length for name, length in lengths.items() if length > MOST_LINES_OF_A_FUNCTION}


REPOSITORY = PACKAGE.parent
SCRIPTS = sorted(path for folder in ("benchmarks", "examples", "tools") for path in (REPOSITORY / folder).glob("*.py"))


def package_calls(tree: ast.AST) -> Iterator[tuple[ast.Call, Callable]]:
    """Calls of functions, classes and class methods that a script imports from the package by name."""
    imported = {
        alias.asname or alias.name: getattr(importlib.import_module(node.module), alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "skhybrid"
        for alias in node.names
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        if isinstance(called, ast.Name) and called.id in imported:
            yield node, imported[called.id]
        elif isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) and called.value.id in imported:
            yield node, getattr(imported[called.value.id], called.attr)


@pytest.mark.skipif(not SCRIPTS, reason="an installed package has no scripts")
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_script_calls_the_package_as_it_is(script):
    """Benchmarks that run for hours do not run with the tests; their calls at least fit the signatures."""
    for call, function in package_calls(ast.parse(script.read_text(encoding="utf-8"))):
        names = {keyword.arg: None for keyword in call.keywords if keyword.arg}
        starred = len(names) < len(call.keywords) or any(isinstance(value, ast.Starred) for value in call.args)
        bind = inspect.signature(function).bind_partial if starred else inspect.signature(function).bind
        positional = [value for value in call.args if not isinstance(value, ast.Starred)]
        try:
            bind(*positional, **names)
        except TypeError as error:
            pytest.fail(f"line {call.lineno}, {ast.unparse(call.func)}: {error}")


def without_encoding(tree: ast.AST) -> Iterator[int]:
    """Lines in which a text file is read or written in the encoding of the machine."""
    before = {"read_text": 0, "write_text": 1}  # arguments before that of the encoding
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr in before:
            given = len(call.args) > before[call.func.attr] or any(part.arg == "encoding" for part in call.keywords)
            if not given:
                yield call.lineno


def test_text_files_are_in_utf_8_on_every_machine():
    root = Path(__file__).parents[1]
    paths = [path for name in ("tests", "benchmarks", "examples", "tools") for path in (root / name).rglob("*.py")]
    trees = {str(path.relative_to(root)): ast.parse(path.read_text(encoding="utf-8")) for path in paths}
    trees |= {f"skhybrid/{path}": tree_of(path) for path in PATHS}
    found = [f"{path}:{line}" for path, tree in trees.items() for line in without_encoding(tree)]
    assert not found


def test_a_text_file_without_an_encoding_is_seen():
    written = "path.read_text()\npath.write_text(text)\npath.read_text(encoding='utf-8')"
    assert list(without_encoding(ast.parse(written))) == [1, 2]
