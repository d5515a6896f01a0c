"""Copies of objects that go on from a common state: a forecast makes a dozen of them per zone."""

from __future__ import annotations

from typing import TypeVar

_T = TypeVar("_T")


def shallow_copy(one: _T) -> _T:
    """A copy that shares all attributes, as ``copy.copy`` makes it of a plain object, in a tenth of the time."""
    made = object.__new__(type(one))
    made.__dict__.update(one.__dict__)
    return made
