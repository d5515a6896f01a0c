"""Warnings that point at the line of the user."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from types import FrameType

from .exceptions import SkhybridWarning

_PACKAGE = str(Path(__file__).parent)


def warn_user(message: str, category: type[SkhybridWarning]) -> None:
    """Warn at the user's line that called this package, however deep in the package the cause was found."""
    level, frame = 1, sys._getframe()
    while frame.f_code.co_filename.startswith(_PACKAGE):
        outer: FrameType | None = frame.f_back
        if outer is None:
            break
        level, frame = level + 1, outer
    warnings.warn(message, category, stacklevel=level)
