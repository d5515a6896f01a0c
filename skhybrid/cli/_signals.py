"""A stop by Ctrl-C or SIGTERM that no library can swallow."""

from __future__ import annotations

import signal
from typing import Any

#: signals received so far
_received: list[int] = []


def stop_on_signals() -> None:
    """Let SIGINT and SIGTERM raise KeyboardInterrupt."""
    signal.signal(signal.SIGTERM, _stop)
    signal.signal(signal.SIGINT, _stop)


def raise_if_stopped() -> None:
    """Raise KeyboardInterrupt if a signal has come; a compiler's callback may have swallowed the first one."""
    if _received:
        raise KeyboardInterrupt


def _stop(number: int, frame: Any) -> None:
    _received.append(number)
    raise KeyboardInterrupt
