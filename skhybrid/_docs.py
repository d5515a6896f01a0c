"""Documentation of parameters and attributes that several classes share."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from inspect import cleandoc
from textwrap import indent
from typing import TypeVar

_Class = TypeVar("_Class", bound=type)
_PLACE = re.compile(r"^( *)%\((\w+)\)s$", re.MULTILINE)


def docs_from(blocks: Mapping[str, str]) -> Callable[[_Class], _Class]:
    """Class decorator that puts ``blocks[name]`` into the docstring where a line ``%(name)s`` asks for it."""

    def fill(cls: _Class) -> _Class:
        cls.__doc__ = filled(cls.__doc__, blocks)
        return cls

    return fill


def filled(text: str | None, blocks: Mapping[str, str]) -> str | None:
    """A docstring, None under ``python -OO``, with ``blocks[name]`` in place of each line ``%(name)s``."""
    return text and _PLACE.sub(lambda place: indent(cleandoc(blocks[place[2]]), place[1]), text)
