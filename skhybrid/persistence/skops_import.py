"""The import of skops, without torch."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from threading import get_ident
from types import ModuleType
from typing import Any


class _TorchIsAbsent(MetaPathFinder):
    """Hide torch from the imports of one thread."""

    def __init__(self) -> None:
        self._thread = get_ident()

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> None:
        if fullname == "torch" and get_ident() == self._thread:
            raise ModuleNotFoundError("torch is hidden while skops is imported", name="torch")


def import_skops() -> Any:
    """Import ``skops.io`` without torch, which takes scikit-learn two seconds when skops lists its estimators."""
    finder = _TorchIsAbsent()
    sys.meta_path.insert(0, finder)
    try:
        import skops.io
    finally:
        sys.meta_path.remove(finder)
    return skops.io
