"""Warnings and errors of the package."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from types import FrameType

_PACKAGE = str(Path(__file__).parent)


class SkhybridWarning(UserWarning):
    """Base class of all warnings of this package."""


class UnitWarning(SkhybridWarning):
    """The range of a column suggests a unit other than its role's (degF, W/m2, percent)."""


class RoleWarning(SkhybridWarning):
    """Columns were assigned roles by position because no name matched a role."""


class ScaleNotIdentifiableWarning(SkhybridWarning):
    """Neither a known parameter nor measured heat fixes the scale of the network."""


class ExcitationWarning(SkhybridWarning):
    """The data do not excite a parameter, so the fit cannot determine it."""


class ModelFileError(ValueError):
    """A model file is truncated, altered, from another version, or not a model file at all."""


def warn_user(message: str, category: type[SkhybridWarning]) -> None:
    """Warn at the user's line that called this package, however deep in the package the cause was found.

    Parameters
    ----------
    message : str
        Text of the warning.
    category : type
        Class of the warning.
    """
    level, frame = 1, sys._getframe()
    while frame.f_code.co_filename.startswith(_PACKAGE):
        outer: FrameType | None = frame.f_back
        if outer is None:
            break
        level, frame = level + 1, outer
    warnings.warn(message, category, stacklevel=level)
