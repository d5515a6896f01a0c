"""The outcome of a call: accepted and finite, refused in one sentence, or a failure that is named."""

from __future__ import annotations

import dis
import os
import re
import signal
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import sklearn
from sklearn.base import BaseEstimator
from sklearn.exceptions import FitFailedWarning, UndefinedMetricWarning

import skhybrid
from skhybrid.hybrid import AffineForecast, ControlModel

ACCEPTED, REFUSED = "accepted", "refused"
PLAUSIBLE = (-60.0, 100.0)  # forecasts of a room [degC]
_PACKAGE, _SKLEARN = (str(Path(module.__file__).parent) + os.sep for module in (skhybrid, sklearn))
#: scikit-learn's checks of arguments, whose words are its own
_SKLEARN_CHECKS = tuple(_SKLEARN + part for part in ("utils", "base.py", "metrics"))
_RAISE = dis.opmap["RAISE_VARARGS"]
_SECONDS = 120  # of the processor: no call on such small tables takes longer, not even where numba compiles


class Outcome(NamedTuple):
    """Outcome of a call."""

    kind: str  # ACCEPTED, REFUSED or a failure
    detail: str = ""

    @property
    def failed(self) -> bool:
        return self.kind not in (ACCEPTED, REFUSED)


class Printed(Exception):
    """A refusal that the command line has printed."""


class TooLong(BaseException):
    """A call took too long."""


def observe(call: Callable[[], Any], judge: Callable[[Any, bool], str | None], seconds: float = _SECONDS) -> Outcome:
    """Call, and say what came of it; ``judge(result, warned)`` names what is wrong with a result."""
    try:
        with warnings.catch_warnings(record=True) as seen, _limit(seconds):
            warnings.simplefilter("always")
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("always", FitFailedWarning)  # a RuntimeWarning that a search gives on purpose
            result = call()
            warned = any(issubclass(w.category, skhybrid.exceptions.UnitWarning) for w in seen)
            wrong = judge(result, warned)
            if wrong == "NaN in the result" and any(issubclass(w.category, UndefinedMetricWarning) for w in seen):
                wrong = None  # the R2 of fewer than two measured rows, as scikit-learn has it
    except Exception as error:
        return refusal(error)
    except TooLong:
        return Outcome(f"takes longer than {seconds:g} s")
    return Outcome(ACCEPTED) if wrong is None else Outcome(wrong)


def refusal(error: Exception) -> Outcome:
    """Whether an error is a refusal: raised on purpose, as a ValueError or TypeError of one sentence."""
    frames, text = list(traceback.walk_tb(error.__traceback__)), str(error)
    place, last = frames[-1][0].f_code.co_filename, error.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    raised = last is not None and last.tb_frame.f_code.co_code[last.tb_lasti] == _RAISE
    on_purpose = place.startswith(_SKLEARN_CHECKS) or (place.startswith(_PACKAGE) and raised)
    own_type = type(error).__module__.startswith("skhybrid.")
    usual_type = isinstance(error, ValueError | TypeError) and not isinstance(error, np.linalg.LinAlgError)
    printed = isinstance(error, Printed)
    if not printed and not ((own_type or usual_type) and on_purpose):
        codes = [frame.f_code for frame, _ in frames]
        own = next((code for code in reversed(codes) if code.co_filename.startswith(_PACKAGE)), codes[-1])
        where = f"{own.co_filename.removeprefix(_PACKAGE)}:{own.co_name}"
        return Outcome(f"{type(error).__name__} in {where}: {_generic(text)}", text)
    if (printed or place.startswith(_PACKAGE)) and (
        not text or "\n" in text or len(text) > 700 or _sentences(text) > 1
    ):
        return Outcome(f"not one sentence: {_generic(text)}", text)
    return Outcome(REFUSED, text)


def _sentences(text: str) -> int:
    outside = re.sub(r"'[^']*'|\([^)]*\)", "", text)
    return 1 + len(re.findall(r"[.!?] +[A-Z]", outside))


def _generic(text: str) -> str:
    """The first words of a message without its numbers, so that one cause is one kind."""
    return re.sub(r"'[^']*'|[-+]?\d[\d.:e+\-]*", "#", " ".join(text.split()))[:80]


@contextmanager
def _limit(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: Any) -> None:
        raise TooLong

    # of the processor, since other work may hold a call up; and much longer of the clock, since it may wait
    timers = ((signal.SIGPROF, signal.ITIMER_PROF, seconds), (signal.SIGALRM, signal.ITIMER_REAL, 10.0 * seconds))
    before = [signal.signal(number, stop) for number, _, _ in timers]
    for _, timer, most in timers:
        signal.setitimer(timer, most)
    try:
        yield
    finally:
        for (number, timer, _), handler in zip(timers, before, strict=True):
            signal.setitimer(timer, 0.0)
            signal.signal(number, handler)


def numbers_in(result: Any) -> Iterator[tuple[str, np.ndarray]]:
    """All numbers of a result, by name."""
    if isinstance(result, pd.DataFrame):
        for name, column in result.items():
            if pd.api.types.is_float_dtype(column):
                yield str(name), column.to_numpy(dtype=np.float64, na_value=np.nan)
    elif isinstance(result, pd.Series):
        yield from numbers_in(result.to_frame(str(result.name)))
    elif isinstance(result, np.ndarray) and result.dtype.kind == "f":
        yield "", result
    elif isinstance(result, float | np.floating):
        yield "", np.array(result)
    elif isinstance(result, tuple):
        for part in result:
            yield from numbers_in(part)
    elif isinstance(result, AffineForecast | ControlModel):
        yield from numbers_in(tuple(vars(result).values()))


def wrong_numbers(result: Any, *, missing: bool = False, temperature: tuple[str, ...] = ()) -> str | None:
    """Fault of the numbers of a result: not finite (NaN where ``missing`` is), or no room temperature."""
    for name, values in numbers_in(result):
        if np.isinf(values).any() or (not missing and np.isnan(values).any()):
            return f"{'inf' if np.isinf(values).any() else 'NaN'} in the result{f' ({name})' if name else ''}"
        known = values[np.isfinite(values)]
        is_temperature = name in temperature or (name.startswith("q_") and "q_" in temperature)
        if is_temperature and len(known) and not (known.min() >= PLAUSIBLE[0] and known.max() <= PLAUSIBLE[1]):
            return f"beyond {PLAUSIBLE[0]:g} to {PLAUSIBLE[1]:g} degC{f' ({name})' if name else ''}"
    return None


def state(estimator: BaseEstimator | None) -> dict[str, int]:
    """Attributes of an estimator, to see whether a call changed them."""
    return {} if estimator is None else {name: id(value) for name, value in vars(estimator).items()}


class Tally:
    """Counts of outcomes, and one example of each failure."""

    def __init__(self, content: dict[str, Any] | None = None) -> None:
        content = content or {}
        self.counts: dict[str, Counter[str]] = {k: Counter(v) for k, v in content.get("counts", {}).items()}
        self.examples: dict[str, str] = dict(content.get("examples", {}))

    def add(self, group: str, outcome: Outcome) -> bool:
        """Count an outcome; whether it is a failure that was not seen before."""
        self.counts.setdefault(group, Counter())[outcome.kind] += 1
        return outcome.failed and outcome.kind not in self.examples

    def as_dict(self) -> dict[str, Any]:
        return {"counts": self.counts, "examples": self.examples}

    def failures(self) -> Counter[str]:
        """Number of times that each failure was seen."""
        total = sum(self.counts.values(), Counter())
        return Counter({kind: n for kind, n in total.items() if kind not in (ACCEPTED, REFUSED)})
