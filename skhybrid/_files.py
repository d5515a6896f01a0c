"""Files that are replaced in one step, and errors that name them."""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Path of a temporary file, which replaces ``path`` when the block ends and is removed if it fails.

    The folder is created if needed, a file that is replaced keeps its permissions, and an OSError names the path.
    """
    target = Path(path)
    with named_in_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=target.suffix, dir=target.parent)
        os.close(handle)
        made = Path(name)
        try:
            yield made
            with open(made, "rb") as file:
                os.fsync(file.fileno())  # a disk may tell only now that it is full
            made.chmod(_permissions(target))
            os.replace(made, target)
        finally:
            made.unlink(missing_ok=True)


def _permissions(path: Path) -> int:
    """Those of a file that is there, or those that a new one gets."""
    if path.exists():
        return stat.S_IMODE(path.stat().st_mode)
    mask = os.umask(0o022)
    os.umask(mask)
    return 0o666 & ~mask


@contextmanager
def named_in_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Let an OSError of the block name ``path``: a full disk names no file, and others name a temporary one."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, f"cannot write: {os.strerror(error.errno)}", os.fspath(path)) from error
