"""Warnings and errors that a user can catch by name."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from types import FrameType

_PACKAGE = str(Path(__file__).parent)


class SkhybridWarning(UserWarning):
    """Base of every warning of this package."""


class UnitWarning(SkhybridWarning):
    """A column's range suggests another unit than its role has (degF, W/m2, percent)."""


class RoleWarning(SkhybridWarning):
    """Columns were given roles by position because no name matched a role."""


class ScaleNotIdentifiableWarning(SkhybridWarning):
    """No parameter or measured heat fixes the scale of the network (design ruling 3)."""


class ExcitationWarning(SkhybridWarning):
    """The table does not move a parameter, so that the fit cannot know it."""


class ModelFileError(ValueError):
    """A saved model is truncated, altered, of another version, or not a model at all."""


def warn_user(message: str, category: type[SkhybridWarning]) -> None:
    """Warn at the line that called into this package, however deep in it the cause was found.

    Parameters
    ----------
    message : str
    category : type
    """
    level, frame = 1, sys._getframe()
    while frame.f_code.co_filename.startswith(_PACKAGE):
        outer: FrameType | None = frame.f_back
        if outer is None:
            break
        level, frame = level + 1, outer
    warnings.warn(message, category, stacklevel=level)
