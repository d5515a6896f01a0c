"""The package's files: their text and what it parses to, read where a test asks for it and once per process."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import skhybrid

PACKAGE = Path(skhybrid.__file__).parent
#: every module, relative to the package
PATHS = sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py"))


@cache
def text_of(path: str) -> str:
    return (PACKAGE / path).read_text(encoding="utf-8")


@cache
def tree_of(path: str) -> ast.Module:
    return ast.parse(text_of(path))
