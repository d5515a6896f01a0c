"""Who may import whom, read from the source; and what an import loads, seen in a subprocess."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from sources import PATHS, tree_of

import skhybrid

#: modules that every part but the filters may import.
BASE = {
    "_arguments", "_calendar", "_clock", "_docs", "_files", "_holidays", "_joining", "_json", "_last_known", "_ranges",
    "_rolling", "_shallow", "_sqlite", "_summary", "_table", "_threads", "_time", "_transaction", "_warnings",
    "exceptions",
}  # fmt: skip
#: part of the package -> the parts that it may import, besides itself and BASE.  The table has no cycle.
MAY_IMPORT: dict[str, set[str]] = {
    "thermal": {"filtering"},
    "control": {"filtering"},
    "identification": {"filtering", "thermal", "control"},
    "schedule": {"filtering", "thermal", "control"},
    "forecasting": {"filtering"},
    "hybrid": {"filtering", "thermal", "control", "identification", "schedule", "forecasting"},
    "persistence": set(),
    "preprocessing": set(),
    "logs": {"preprocessing"},
    "datasets": {"thermal", "preprocessing", "logs"},
    "parallel": set(),
    "model_selection": {"identification", "forecasting", "hybrid", "parallel"},
    "inspection": {"thermal", "identification", "forecasting", "hybrid", "model_selection"},
    "study": {
        "thermal", "identification", "forecasting", "hybrid", "persistence", "preprocessing", "logs", "datasets",
        "model_selection", "inspection",
    },
    "zone": {
        "forecasting", "hybrid", "persistence", "preprocessing", "logs", "datasets", "model_selection", "study",
    },
    "fleet": {
        "forecasting", "schedule", "hybrid", "persistence", "parallel", "model_selection", "preprocessing", "study",
    },
    "server": {"study", "zone"},
    "cli": {
        "thermal", "identification", "forecasting", "hybrid", "persistence", "preprocessing", "logs", "datasets",
        "model_selection", "inspection", "study", "zone", "fleet", "server",
    },
}  # fmt: skip
#: these may import less than BASE.
STRICT = {
    "filtering": set(),
    "exceptions": set(),
    "_arguments": set(),
    "_calendar": {"_clock", "_table", "_time"},
    "_clock": {"_time"},
    "_docs": set(),
    "_files": set(),
    "_holidays": {"_clock", "_time"},
    "_json": set(),
    "_last_known": set(),
    "_warnings": {"exceptions"},
    "_shallow": set(),
    "_sqlite": set(),
    "_time": set(),
    "_threads": set(),
    "_transaction": set(),
    "_ranges": {"_warnings", "exceptions"},
    "_target": {"_arguments", "_time", "_warnings", "exceptions"},
    "_columns": {"_arguments", "_warnings", "exceptions"},
    "_table": {"_clock", "_columns", "_holidays", "_ranges", "_target", "_time", "exceptions"},
    "_summary": {"_holidays", "_table", "_time"},
    "_joining": {"_arguments", "_clock", "_ranges", "_table", "_time", "_warnings", "exceptions"},
    "_rolling": {"_joining", "_summary", "_table", "_threads", "_time", "exceptions"},
}
#: parts that read fitted estimators through what is public.
READERS = {"model_selection", "inspection", "study", "zone", "fleet", "server", "cli"}
_BAYES = (
    "identification/uncertainty/posterior.py",
    "model_selection/choice/pattern_expressiveness.py",
    "model_selection/choice/robustness_comparison.py",
)
#: a heavy library -> the files that may import it.
HOMES = {
    "torch": ("forecasting/networks/",),
    "skorch": ("forecasting/networks/",),
    "pymc": _BAYES,
    "arviz": _BAYES,
    "pytensor": ("identification/uncertainty/posterior.py",),
    "matplotlib": ("inspection/",),
    "holidays": ("_holidays.py",),
    "click": ("cli/",),
    "openpyxl": ("logs/readers/spreadsheet.py",),
    "pyarrow": ("logs/readers/columnar.py", "fleet/zone_rows.py"),
    "sqlalchemy": ("logs/readers/sql_table.py",),
    "fastapi": ("server/app.py",),
    "starlette": ("server/app.py", "server/guard.py"),
    "pydantic": ("server/app.py", "server/schemas.py"),
    "uvicorn": ("server/listen.py",),
}


class Import(NamedTuple):
    """One imported name: ``module`` absolute, ``name`` None for ``import module``."""

    module: str
    name: str | None
    line: int
    on_load: bool  # run when the module is loaded, not inside a function or under TYPE_CHECKING

    @property
    def top(self) -> str:
        return self.module.split(".")[0]


def imports_of(tree: ast.AST, package: str) -> Iterator[Import]:
    """Every import in a module that lives in ``package``, relative ones resolved."""

    def walk(node: ast.AST, on_load: bool) -> Iterator[Import]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                yield from (Import(alias.name, None, child.lineno, on_load) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                module = child.module or ""
                if child.level:
                    above = package.split(".")[: len(package.split(".")) - child.level + 1]
                    module = ".".join([*above, *([module] if module else [])])
                yield from (Import(module, alias.name, child.lineno, on_load) for alias in child.names)
            else:
                deferred = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
                typing_only = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
                yield from walk(child, on_load and not deferred and not typing_only)

    return walk(tree, True)


@cache
def _modules() -> dict[str, list[Import]]:
    """The imports of every module of the package."""
    return {path: list(imports_of(tree_of(path), ".".join(["skhybrid", *path.split("/")[:-1]]))) for path in PATHS}


def _part(path: str) -> str:
    """The part of the package that a file or a dotted name belongs to: "thermal", "cli", "_table" ..."""
    return path.removesuffix(".py").replace("/", ".").split(".")[0]


def _inner(imports: list[Import]) -> Iterator[tuple[str, Import]]:
    """(part imported, import) for the imports of this package itself."""
    for one in imports:
        if one.top == "skhybrid":
            path = one.module.split(".")[1:] or [one.name or ""]
            yield path[0], one


def _shown(path: str, one: Import) -> str:
    return f"{path}:{one.line} imports {one.module}{'' if one.name is None else '.' + one.name}"


# ----------------------------------------------------------------------------------------------------- the reader
def test_the_reader_of_imports_sees_every_kind():
    source = """
import numpy.linalg
from ..thermal import RCNetwork as network
from . import rivals
if TYPE_CHECKING:
    import torch
def f():
    from skhybrid._table import read_table
class A:
    def g(self):
        import matplotlib
try:
    import pymc
except ImportError:
    raise
"""
    seen = {(i.module, i.name, i.on_load) for i in imports_of(ast.parse(source), "skhybrid.forecasting")}
    assert seen == {
        ("numpy.linalg", None, True),
        ("skhybrid.thermal", "RCNetwork", True),
        ("skhybrid.forecasting", "rivals", True),
        ("torch", None, False),
        ("skhybrid._table", "read_table", False),
        ("matplotlib", None, False),
        ("pymc", None, True),
    }


def test_the_table_of_layers_has_no_cycle():
    left = {part: set(allowed) - set(STRICT) for part, allowed in MAY_IMPORT.items()}
    while left:
        lowest = {part for part, allowed in left.items() if not allowed}
        assert lowest, f"a cycle among {sorted(left)}"
        left = {part: allowed - lowest for part, allowed in left.items() if part not in lowest}


# ------------------------------------------------------------------------------------------------------ the layers
# the root names every part, lazily; the subprocess tests below hold it to loading none of them
def test_a_module_imports_only_the_layers_below_it():
    wrong = []
    for path, imports in _modules().items():
        part = _part(path)
        if part == "__init__":
            continue
        allowed = {"cli"} if part == "__main__" else STRICT.get(part, MAY_IMPORT.get(part, set()) | BASE)
        # `from . import x` at the root level may name an attribute of the root itself, such as __version__
        known = {part, "__version__", *allowed}
        wrong += [_shown(path, one) for imported, one in _inner(imports) if imported not in known]
    assert not wrong, "\n".join(wrong)


#: folders of hybrid that are below its predictors -> the modules of hybrid that they may import, besides their own.
BELOW_PREDICTORS = {
    "blending": {"plausible_range", "scheme"},
    "thermostat_law": {"blending", "joint_errors", "known_rows", "scheme", "setpoint_columns"},
}


def test_the_folders_of_hybrid_have_layers():
    """Blending and the thermostat's law know no predictor, and no predictor of one zone knows a building."""
    for path in (path for path in PATHS if path.startswith("hybrid/")):
        own = path.split("/")[1]
        pieces = [one.module.split(".")[2:3] for part, one in _inner(_modules()[path]) if part == "hybrid"]
        imported = {piece for found in pieces for piece in found}
        if own in BELOW_PREDICTORS:
            assert imported - {own} <= BELOW_PREDICTORS[own], path
        elif own not in ("building", "__init__.py"):
            assert "building" not in imported, path


def test_no_private_name_of_another_part_is_imported():
    known = {*STRICT, "__version__"}
    wrong = [
        _shown(path, one)
        for path, imports in _modules().items()
        for imported, one in _inner(imports)
        if imported != _part(path) and (one.name or "").startswith("_") and one.name not in known
    ]
    assert not wrong, "\n".join(wrong)


def test_a_reader_of_fitted_estimators_uses_public_modules_only():
    wrong = [
        _shown(path, one)
        for path, imports in _modules().items()
        for imported, one in _inner(imports)
        if _part(path) in READERS
        and imported != _part(path)
        and any(piece.startswith("_") for piece in one.module.split(".")[2:])
    ]
    assert not wrong, "\n".join(wrong)


def test_contributors_read_the_same_layers():
    text = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    lines = text[text.index("| room |") : text.index("## What a change needs")].splitlines()
    cells = [line.split("|")[1:-1] for line in lines if "|" in line][2:]
    (named, allowed) = ([set(re.findall(r"`(\w+)`", row[column])) for row in cells] for column in (0, 2))
    rooms = [room for (room,) in named]
    public = {part: {one for one in others if not one.startswith("_")} for part, others in MAY_IMPORT.items()}
    assert dict(zip(rooms, allowed, strict=True)) == {"filtering": set(), **public}
    assert not [room for place, room in enumerate(rooms) if not allowed[place] <= set(rooms[:place])], "stand too high"
    base, readers = "\n".join(line for line in lines if "|" not in line).split("base modules:")[1].split("\n\n`")
    assert set(re.findall(r"`(\w+)`", base)) == BASE
    assert set(re.findall(r"(\w+)`", readers)) == READERS


def test_filters_import_numpy_scipy_and_numba_only():
    allowed = {"numpy", "scipy", "numba", "skhybrid"} | set(sys.stdlib_module_names)
    wrong = [
        _shown(path, one)
        for path, imports in _modules().items()
        if _part(path) == "filtering"
        for one in imports
        if one.top not in allowed
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("library", sorted(HOMES))
def test_a_heavy_library_stays_where_it_lives(library):
    wrong = [
        _shown(path, one)
        for path, imports in _modules().items()
        if not path.startswith(HOMES[library])
        for one in imports
        if one.top == library
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("library", ["matplotlib", "pymc", "arviz", "pytensor", "openpyxl", "pyarrow", "sqlalchemy"])
def test_a_plotting_sampling_or_file_library_is_imported_inside_functions(library):
    wrong = [
        _shown(path, one)
        for path, imports in _modules().items()
        for one in imports
        if one.top == library and one.on_load
    ]
    assert not wrong, "\n".join(wrong)


# ------------------------------------------------------------------------------------------------ what an import loads
HEAVY = ("torch", "skorch", "pymc", "matplotlib", "fastapi", "uvicorn")


#: what one process does step by step; the last shows that a heavy library would be seen
STEPS = {
    "root": "import skhybrid",
    "every public name": "for name in skhybrid.__all__: getattr(skhybrid, name)",
    "command line": "import skhybrid.cli",
    "an estimator made": "from skhybrid import HybridPredictor\nHybridPredictor().get_params()",
    "a model file": "from skhybrid.persistence.skops_import import import_skops\nimport_skops().dumps([1.0])",
    "matplotlib": "import matplotlib",
}


def test_an_import_loads_no_heavy_library():
    told = f"print(*[name for name in {HEAVY!r} if name in sys.modules])"
    program = "\n".join(["import sys", *(f"{code}\n{told}" for code in STEPS.values())])
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    loaded = dict(zip(STEPS, done.stdout.splitlines(), strict=True))
    assert loaded == dict.fromkeys(STEPS, "") | {"matplotlib": "matplotlib"}


def test_the_root_names_what_it_holds():
    assert set(skhybrid.__all__) == set(dir(skhybrid))
    for name in skhybrid.__all__:
        assert getattr(skhybrid, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'GrayBox'"):
        skhybrid.GrayBox  # noqa: B018
