"""Exit codes, the lines that commands write to stderr, and a stop by a signal that no library can swallow."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from typing import Any

DONE, FAILED, MISUSED, STOPPED = 0, 1, 2, 130
_received: list[int] = []  # signals received so far


class Progress:
    """Writes steps to stderr, each with the time since the beginning; nothing if ``quiet``."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.begun = time.perf_counter()

    def __call__(self, number: int, total: int, text: str) -> None:
        """Write that a step begins."""
        self.note(f"[{number}/{total}] {time.perf_counter() - self.begun:6.1f} s  {text}")

    def note(self, text: str) -> None:
        """Write a line."""
        if _received:  # a compiler's callback may have swallowed the KeyboardInterrupt
            raise KeyboardInterrupt
        if not self.quiet:
            print(text, file=sys.stderr, flush=True)


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--quiet``."""
    parser.add_argument("-q", "--quiet", action="store_true", help="write no progress to stderr")


def report_error(text: str) -> None:
    """Write the one line on stderr that says what went wrong."""
    print(f"skhybrid: error: {text}", file=sys.stderr)


def one_line(text: object) -> str:
    """A message without its line breaks."""
    return " ".join(str(text).split())


def stop_on_signals() -> None:
    """Let SIGINT and SIGTERM raise KeyboardInterrupt."""
    signal.signal(signal.SIGTERM, _stop)
    signal.signal(signal.SIGINT, _stop)


def _stop(number: int, frame: Any) -> None:
    _received.append(number)
    raise KeyboardInterrupt
