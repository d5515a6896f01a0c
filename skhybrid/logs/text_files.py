"""Text files of any encoding, compressed or not."""

from __future__ import annotations

import bz2
import codecs
import gzip
import io
import lzma
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import IO, Any
from zipfile import BadZipFile

_SAMPLE = 1 << 18  # bytes that tell the encoding
_BINARY = re.compile(rb"[\x01-\x08\x0e-\x1f]")  # what no text has; zeros alone are left where a logger lost power
_COMPRESSED: dict[bytes, Any] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ": lzma.open}
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


def existing(path: str | PathLike[str]) -> tuple[Path, str]:
    """A file that exists, and its name as messages show it."""
    file = Path(path)
    if file.is_dir():
        raise FileNotFoundError(f"{str(file)!r} is a folder; give a file in it.")
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}.")
    return file, repr(file.name)


def open_bytes(path: Path) -> IO[bytes]:
    """The bytes of a file, decompressed."""
    with path.open("rb") as file:
        begin = file.read(6)
    for mark, opened in _COMPRESSED.items():
        if begin.startswith(mark):
            return opened(path, "rb")
    return path.open("rb")


def open_text(path: Path) -> io.TextIOWrapper:
    """The text of a file in UTF-8, decompressed, its line ends as they are."""
    return io.TextIOWrapper(open_bytes(path), encoding="utf-8-sig", newline="")


def numbered_lines(path: Path, n: int) -> Iterator[list[tuple[int, str]]]:
    """The lines of a text file in any encoding and their numbers from 0 on, ``n`` at a time."""
    with damage_refused(repr(path.name)), open_bytes(path) as file:
        lines = enumerate(io.TextIOWrapper(file, encoding_of(path) or "utf-8", errors="replace"))
        while part := list(islice(lines, n)):
            yield part


def text_of(path: Path) -> str:
    """The whole text of a file in any encoding, decompressed."""
    with damage_refused(repr(path.name)), open_bytes(path) as file:
        return file.read().decode(encoding_of(path) or "utf-8", errors="replace").replace("\r\n", "\n")


@contextmanager
def damage_refused(where: str) -> Iterator[None]:
    """Refuse a compressed file that turns out to be damaged in the block; other errors of the system pass."""
    try:
        yield
    except (EOFError, OSError, lzma.LZMAError, zlib.error, BadZipFile) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        raise ValueError(f"{where} is a damaged compressed file ({error}); copy it again.") from error


def encoding_of(path: Path) -> str | None:
    """The encoding of a text file: UTF-8, UTF-16 or cp1252; None for a binary file."""
    return _encoding(_sample(path))


def head_of(path: Path, size: int = 8192) -> str:
    """The whole lines in the first ``size`` characters of a text file; '' for a binary file."""
    sample = _sample(path)
    encoding = _encoding(sample)
    if encoding is None:
        return ""
    text = sample.decode(encoding, errors="replace").replace("\x00", "")
    if len(text) > size and "\n" in text[:size]:
        text = text[: text[:size].rindex("\n") + 1]
    return text[:size].replace("\r\n", "\n").replace("\r", "\n")


def _sample(path: Path) -> bytes:
    with damage_refused(repr(path.name)), open_bytes(path) as file:
        return file.read(_SAMPLE)


def _encoding(sample: bytes) -> str | None:
    for mark, name in _MARKS.items():
        if sample.startswith(mark):
            return name
    if b"\x00" in sample:
        for first, name in ((1, "utf-16-le"), (0, "utf-16-be")):
            half = sample[first::2]
            if half.count(0) > 0.8 * len(half) and not sample[1 - first :: 2].count(0):
                return name
        sample = sample.replace(b"\x00", b"")
        if not sample or _BINARY.search(sample):
            return None
    with suppress(UnicodeDecodeError):
        codecs.getincrementaldecoder("utf-8")().decode(sample)
        return "utf-8"
    return "cp1252"
