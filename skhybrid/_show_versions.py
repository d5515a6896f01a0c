"""Versions for a bug report."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version

#: extras for work on the package itself, and those that name others
_NOT_SHOWN = re.compile(r"""extra == ["'](test|lint|docs|dev|all)["']""")


def show_versions() -> None:
    """Print the versions of Python, of this package and of the packages that it can use, for a bug report.

    Nothing is imported: the versions are those of the installed packages.

    Examples
    --------
    >>> import skhybrid
    >>> skhybrid.show_versions()  # doctest: +ELLIPSIS
    skhybrid ...
    python ...
    """
    lines = [
        ("skhybrid", _version_of("skhybrid")),
        ("python", platform.python_version()),
        ("system", platform.platform()),
    ]
    lines += [(name, _version_of(name)) for name in _requirements()]
    width = max(len(name) for name, _ in lines)
    sys.stdout.write("".join(f"{name:{width}} {found}\n" for name, found in lines))


def _requirements() -> Iterator[str]:
    """Names of the packages that this one needs or can use, each once."""
    try:
        lines = requires("skhybrid") or []
    except PackageNotFoundError:  # a source tree that is not installed
        return
    names = [re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in lines if not _NOT_SHOWN.search(line)]
    yield from dict.fromkeys(names)


def _version_of(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
