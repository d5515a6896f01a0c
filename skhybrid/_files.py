"""Files that are replaced in one step, and errors that name them."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Path of a temporary file, which replaces ``path`` when the block ends and is removed if it fails.

    The folder is created if needed, a file that is replaced keeps its permissions, and an OSError names the path.  A
    link stays one, and a pipe or a device is written to as it is.
    """
    target = Path(os.path.realpath(path))
    with named_in_errors(path):
        if target.exists() and not target.is_file():
            yield target
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        made = target.with_name(f".{target.name}.{secrets.token_hex(4)}{target.suffix}")
        made.touch(exist_ok=False)
        try:
            if target.exists():
                shutil.copymode(target, made)
            yield made
            with open(made, "rb") as file:
                os.fsync(file.fileno())  # a disk may tell only now that it is full
            os.replace(made, target)
        finally:
            made.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text to a file in one step, as :func:`atomic_path`."""
    with atomic_path(path) as made:
        made.write_text(text, encoding="utf-8", newline="")


def remove_leftovers(folder: Path, *names: str) -> None:
    """Remove temporary files of :func:`atomic_path` that a kill left, of files whose names fit patterns."""
    for name in names:
        for left in folder.glob(f".{name}.????????{Path(name).suffix}"):
            left.unlink(missing_ok=True)


@contextmanager
def named_in_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Let an OSError of the block name ``path``: a full disk names no file, and others name a temporary one."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, f"cannot write: {os.strerror(error.errno)}", os.fspath(path)) from error
