"""Exit codes, the lines that commands write to stderr, and a stop by a signal that no library can swallow."""

from __future__ import annotations

import argparse
import os
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
        check_stopped()
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
    _received.clear()
    signal.signal(signal.SIGTERM, _stop)
    signal.signal(signal.SIGINT, _stop)


def end_on_signals(code: int) -> None:
    """Let a signal end the process with this exit code at once: the command has ended, only the interpreter has not."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: os._exit(code))


def is_stopped() -> bool:
    """Whether a signal has been received."""
    return bool(_received)


def check_stopped() -> None:
    """Stop if a signal has been received: a library or a compiler's callback may have swallowed the interrupt."""
    if _received:
        raise KeyboardInterrupt


def _stop(number: int, frame: Any) -> None:
    _received.append(number)
    raise KeyboardInterrupt
