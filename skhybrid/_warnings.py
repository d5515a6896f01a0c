"""Warnings that point at the line of the user, and texts of warnings and errors as parts of other messages."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from types import FrameType
from typing import Any
from weakref import finalize

from .exceptions import SkhybridWarning

_zone: ContextVar[str] = ContextVar("zone", default="")
_receiver: ContextVar[Callable[[SkhybridWarning], object] | None] = ContextVar("receiver", default=None)
_dropped: ContextVar[tuple[type[SkhybridWarning], ...]] = ContextVar("dropped", default=())
_PACKAGE = __name__.partition(".")[0]
_OF_LOG = "point_column|value_column|held|table|query|entities|utc_offset|sheet"  # options of readers
_OF_ESTIMATOR = "known|bounds|priors|warmup|n_starts"
_PLAIN = "timezone|time_column|dayfirst|sep|decimal|holidays|weather_error"
#: words of a message for those who call the package, and what they are for those who write a configuration
_IN_CONFIGURATION = (
    (r"^(?:[A-Z][a-z]+){2,}[A-Z]*: ", ""),
    (r"set such values to NaN", "leave such cells of the log empty"),
    (
        r"convert (?:it|the column) with skhybrid\.preprocessing\.UnitConverter",
        "give its unit under [units] of the configuration",
    ),
    (r"\bknown=\{'(\w+)': ([^}]*)\}", r"known = { \1 = \2 } in [estimator]"),
    (rf"\b({_OF_ESTIMATOR})=(?![\w'(\[{{])", r"\1 of [estimator]"),
    (rf"\b({_OF_LOG})=(?![\w'(\[])", r"\1 = in [log]"),
    (rf"\b({_OF_LOG})=('[^']*'|\w+)", r"\1 = \2 in [log]"),
    (rf"\b({_PLAIN})=(?= has | \()", r"\1 in the configuration"),
    (rf"\b({_PLAIN})=(?![\w'(\[])", r"\1 = in the configuration"),
    (rf"\b({_PLAIN}|{_OF_ESTIMATOR})=(?=[\w'(\[])", r"\1 = "),
    (r"(?<= = )(True|False)\b", lambda found: found[0].lower()),
    (r"fit with purpose='plan'; ", ""),
    (r"(?<!-)\bsetpoint=(?:None)?", "--setpoint"),
)
#: what was said of objects of which it is said once, by their identity: two that are equal are not one
_said: dict[int, set[str]] = {}
#: packages between the user and this one: what fits an estimator, and what runs jobs
_BETWEEN = frozenset({"concurrent", "contextlib", "joblib", "multiprocessing", "sklearn", "skorch", "threading"})


def without_python(message: object) -> str:
    """A message for those who use no Python: without the name of its class, and with what they can do to a log."""
    text = str(message)
    for said, shown in _IN_CONFIGURATION:
        text = re.sub(said, shown, text)
    return text


def several(n: int, thing: str) -> str:
    """A number of things, such as "1 row" and "2 rows"."""
    return f"{n} {thing}{'' if n == 1 else 's'}"


def percent(share: float, form: str = ".0f") -> str:
    """A share, such as "80 %"; a level, which may be 0.975, needs the form ".3g"."""
    return f"{100 * share:{form}} %"


@contextmanager
def _held(variable: ContextVar[Any], value: Any) -> Iterator[None]:
    """Hold a value in a context variable for the block."""
    outer = variable.set(value)
    try:
        yield
    finally:
        variable.reset(outer)


def warnings_of_zone(zone: str) -> AbstractContextManager[None]:
    """Name a zone in the warnings of the block."""
    return _held(_zone, zone)


@contextmanager
def warnings_joined() -> Iterator[None]:
    """Give each warning of the block once, with the names of all zones that share it."""
    zones: dict[tuple[type[SkhybridWarning], str, bool], dict[str, None]] = {}

    def receive(warning: SkhybridWarning) -> None:
        zone = _zone.get()
        message = str(warning).removeprefix(_named(zone))
        zones.setdefault((type(warning), message, bool(zone)), {})[zone] = None

    try:
        with warnings_to(receive):
            yield
    finally:
        for (category, message, _), names in zones.items():
            warn_user(_named(*names) + message, category)


def warnings_to(receiver: Callable[[SkhybridWarning], object]) -> AbstractContextManager[None]:
    """Give the package's warnings of the block to a function; those of other threads go where they went.

    ``warnings.catch_warnings`` would take the warnings of all threads, and leave them caught where two blocks overlap.
    """
    return _held(_receiver, receiver)


def kept_warnings(work: Callable[..., Any], *args: Any) -> tuple[Any, list[SkhybridWarning]]:
    """The result of some work and the package's warnings in it, which another process would show by itself."""
    told: list[SkhybridWarning] = []
    with warnings_to(told.append):
        return work(*args), told


def warn_of_zone(zone: str, told: Iterable[SkhybridWarning]) -> None:
    """Give the warnings that work on a zone has kept."""
    with warnings_of_zone(zone):
        for warning in told:
            warn_user(str(warning).removeprefix(_named(zone)), type(warning))


def warnings_dropped(*categories: type[SkhybridWarning]) -> AbstractContextManager[None]:
    """Drop the warnings of the block that are of some classes, since the user is told otherwise."""
    return _held(_dropped, (*_dropped.get(), *categories))


@contextmanager
def recorded_warnings() -> Iterator[list[warnings.WarningMessage]]:
    """Record every warning of the block, repeated ones too; if the block fails they are shown as usual."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield caught
    except Exception:
        for w in caught:
            warnings.warn_explicit(w.message, w.category, w.filename, w.lineno)
        raise


def ignore(warning: SkhybridWarning) -> None:
    """Receive a warning of which the user knows."""


def raise_warning(warning: SkhybridWarning) -> None:
    """Receive a warning as an error."""
    raise warning


def warn_user(message: str, category: type[SkhybridWarning]) -> None:
    """Warn at the user's line that led to this package, however deep in the package the cause was found.

    In another process or thread there is none: there it is the first line outside of the package.
    """
    if issubclass(category, _dropped.get()):
        return
    if (receiver := _receiver.get()) is not None:
        receiver(category(_named(_zone.get()) + message))
        return
    first, level, frame = 0, 1, sys._getframe()
    while _package_of(frame) in _BETWEEN or _package_of(frame) == _PACKAGE:
        if not first and _package_of(frame) != _PACKAGE:
            first = level
        outer: FrameType | None = frame.f_back
        if outer is None:
            level = first or level
            break
        level, frame = level + 1, outer
    warnings.warn(_named(_zone.get()) + message, category, stacklevel=level)


def warn_once(message: str, category: type[SkhybridWarning], of: Any) -> None:
    """Warn as :func:`warn_user` does, of one object once: a control loop asks for the same every step.

    Python's own memory of what was shown at a line is lost whenever any library catches warnings.
    """
    if id(of) not in _said:
        _said[id(of)] = set()
        finalize(of, _said.pop, id(of)).atexit = False
    if message not in _said[id(of)] and not issubclass(category, _dropped.get()):
        warn_user(message, category)
        _said[id(of)].add(message)


def _named(*zones: str) -> str:
    """The beginning of a message about zones of a building; empty where it is about none."""
    return f"zone{'s' * (len(zones) > 1)} {', '.join(map(repr, zones))}: " if any(zones) else ""


def _package_of(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


def first_sentence(text: str) -> str:
    """The first sentence of an error's text without its full stop, to be part of another message."""
    return " ".join(text.split()).partition(". ")[0].removesuffix(".")
