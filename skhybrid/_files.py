"""Files that are replaced in one step."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Path of a temporary file that replaces ``path`` if the block ends without an error, and else is removed."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=target.suffix, dir=target.parent)
    os.close(handle)
    made = Path(name)
    try:
        yield made
        mask = os.umask(0o022)
        os.umask(mask)
        made.chmod(0o666 & ~mask)
        os.replace(made, target)
    finally:
        made.unlink(missing_ok=True)
