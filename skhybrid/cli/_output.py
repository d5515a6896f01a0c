"""Exit codes, the lines that commands write to stderr, and a stop by a signal that no library can swallow."""

from __future__ import annotations

import os
import signal
import sys
import time
from typing import Any

DONE, FAILED, MISUSED, STOPPED = 0, 1, 2, 130
_received: list[int] = []  # signals received so far
_unended: list[str] = []  # the line of progress that the terminal shows without a line break


class Progress:
    """Writes steps to stderr: a line with the time left on a terminal, else one line each; nothing if ``quiet``."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.begun = time.perf_counter()
        self.n_warnings = 0

    def __call__(self, number: int, total: int, text: str) -> None:
        """Write that a step begins."""
        elapsed = time.perf_counter() - self.begun
        left = f", about {elapsed / (number - 1) * (total - number + 1):.0f} s left" if number > 1 else ""
        line = f"[{number}/{total}] {elapsed:6.1f} s  {text}"
        if self.quiet or not sys.stderr.isatty():
            self.note(line)
            return
        check_stopped()
        print(f"\r\033[K{line}{left}", end="", file=sys.stderr, flush=True)
        _unended.append(line)
        if number == total:
            end_line()

    def note(self, text: str) -> None:
        """Write a line."""
        check_stopped()
        if not self.quiet:
            end_line()
            print(text, file=sys.stderr, flush=True)

    def warn(self, text: str) -> None:
        """Write a warning, which ``--strict`` counts."""
        self.n_warnings += 1
        self.note(f"warning: {one_line(text)}")


def end_line() -> None:
    """End the line of progress, so that what follows has a line of its own."""
    if _unended:
        _unended.clear()
        print(file=sys.stderr, flush=True)


def report_error(text: str) -> None:
    """Write the one line on stderr that says what went wrong."""
    end_line()
    print(f"skhybrid: error: {text}", file=sys.stderr)


def report_stop() -> int:
    """Write that the command was stopped; its exit code."""
    _raise_again_every(0.0)
    end_line()
    print("skhybrid: stopped", file=sys.stderr)
    return STOPPED


def one_line(text: object) -> str:
    """A message without its line breaks, and without the name of the class that it begins with."""
    from .._warnings import without_python  # here, since signals are handled by now

    return " ".join(without_python(text).split())


def stop_on_signals() -> None:
    """Let SIGINT and SIGTERM end the command, by a SystemExit that is raised again until it is no longer swallowed.

    A KeyboardInterrupt would not do: one that is raised in a library's ``exec`` changes the exit code of CPython.
    """
    _received.clear()
    for name in ("SIGTERM", "SIGINT", "SIGALRM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _stop)


def end_on_signals(code: int) -> None:
    """Let a signal end the process with this exit code at once: the command has ended, only the interpreter has not."""
    _raise_again_every(0.0)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: os._exit(code))


def is_stopped() -> bool:
    """Whether a signal has been received."""
    return bool(_received)


def check_stopped() -> None:
    """Stop if a signal has been received: a library or a compiler's callback may have swallowed the exception."""
    if _received:
        raise SystemExit(STOPPED)


def _stop(number: int, frame: Any) -> None:
    _received.append(number)
    _raise_again_every(1.0)
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, SystemExit):
        error = error.__context__
    if error is None:  # otherwise it is on its way, and must not interrupt the removal of temporary files
        raise SystemExit(STOPPED)


def _raise_again_every(seconds: float) -> None:
    if _received and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds, seconds)
