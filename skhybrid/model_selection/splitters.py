"""Cross-validation that keeps rows in time order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
from sklearn.model_selection import BaseCrossValidator
from sklearn.utils.validation import _num_samples

from .._arguments import check_bool, check_integer, is_integer, store_arguments
from .._time import even_step, positive_duration, read_duration, rows_of, wall_clock

_DAY = pd.Timedelta("1D")


class RollingOriginSplit(BaseCrossValidator):
    """Contiguous training and test blocks that roll forward through time.

    A split is a training block, a gap, and a test block; the next split begins one ``step`` later.  The first training
    block begins at the first row, so that blocks of whole days keep the time of day at which the table begins.  That
    holds when the clocks change, since durations of a day or more are counted by the local clock of the table.

    Parameters
    ----------
    train, test : timedelta-like or int, default="28D" and "1D"
        Length of a block, as a duration or as a number of rows, which the clock does not change.
    gap : timedelta-like or int, default="0D"
        Rows left out between training and test block.
    step : timedelta-like or int, optional
        Distance from one split to the next; default = ``test``, so that test blocks touch and never overlap.
    n_splits : int, optional
        Keep only this many splits, the newest; default is every split that fits.
    sampling_time : timedelta-like, optional
        The step of a table without time stamps, by which durations become rows; a ``DatetimeIndex`` has its own.
    expanding : bool, default=False
        Whether every training block begins at the first row and so grows.

    Examples
    --------
    >>> import numpy as np
    >>> from skhybrid.model_selection import RollingOriginSplit
    >>> cv = RollingOriginSplit(train="3D", test="1D", sampling_time="1h")
    >>> [(int(train[0]), int(train[-1]), int(test[0]), int(test[-1])) for train, test in cv.split(np.zeros((120, 1)))]
    [(0, 71, 72, 95), (24, 95, 96, 119)]
    """

    def __init__(
        self, *, train: Any = "28D", test: Any = "1D", gap: Any = "0D", step: Any = None, n_splits: int | None = None,
        sampling_time: Any = None, expanding: bool = False,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    def split(self, X: Any, y: Any = None, groups: Any = None) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Consecutive row numbers (train, test) of every split, in time order.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; its ``DatetimeIndex`` gives the sampling time where it has one.
        y, groups : ignored

        Raises
        ------
        ValueError
            If X is too short, a length is not a positive multiple of the sampling time, ``n_splits`` is not a positive
            integer, or ``expanding`` neither True nor False.
        """
        check_bool("expanding", self.expanding)
        train, test, gap, step = self._lengths(X)
        row = _row_by_clock(X)
        for number in self._used_splits(X):
            first = number * step
            end = first + train
            begin = end + gap
            yield np.arange(0 if self.expanding else row(first), row(end)), np.arange(row(begin), row(begin + test))

    def get_n_splits(self, X: Any = None, y: Any = None, groups: Any = None) -> int:
        """The number of splits.

        Parameters
        ----------
        X, y, groups : optional
            Only X counts; it is needed unless ``n_splits`` was given.

        Raises
        ------
        ValueError
            As :meth:`split`, or if X and ``n_splits`` are missing.
        """
        if X is not None:
            return len(self._used_splits(X))
        if (wanted := self._wanted()) is None:
            raise ValueError("the number of splits depends on the length of X: pass X, or give n_splits=.")
        return int(wanted)

    def _wanted(self) -> int | None:
        """The number of splits that are asked for; None: all that fit."""
        if self.n_splits is not None:
            check_integer("n_splits", self.n_splits)
        return self.n_splits

    def _lengths(self, X: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Lengths of the training block, the test block and the gap, and from one split to the next."""
        sampling = _sampling_time(X, self.sampling_time)
        test = _length(self.test, sampling, "test")
        step = test if self.step is None else _length(self.step, sampling, "step")
        return _length(self.train, sampling, "train"), test, _length(self.gap, sampling, "gap", least=0), step

    def _used_splits(self, X: Any) -> np.ndarray:
        """Numbers of the splits that are used, counted from the first that fits."""
        train, test, gap, step = self._lengths(X)
        row, whole = _row_by_clock(X), train + gap + test
        wanted = self._wanted() or 1
        n_rows, needed = _num_samples(X), int(row(whole + (wanted - 1) * step))
        if n_rows < needed:
            sampling = _sampling_time(X, self.sampling_time)
            days = None if sampling is None else sampling / pd.Timedelta("1D")
            needs, has = (f"{n} rows" + ("" if days is None else f" ({n * days:.3g} days)") for n in (needed, n_rows))
            plural = "split needs" if wanted == 1 else "splits need"
            raise ValueError(
                f"X is too short: {wanted} {plural} {needs} of train={self.train!r}, gap={self.gap!r} and "
                f"test={self.test!r}, but X has {has}."
            )
        ends = row(whole + np.arange(n_rows)[:, None] * step)
        n_fit = int((ends <= n_rows).sum())
        return np.arange(0 if self.n_splits is None else n_fit - wanted, n_fit)


def _sampling_time(X: Any, given: Any) -> pd.Timedelta | None:
    """The step of X, or the given one; None where neither is known."""
    index = getattr(X, "index", None)
    if isinstance(index, pd.DatetimeIndex) and len(index) > 1:
        return even_step(index)
    return None if given is None else positive_duration(given, "sampling_time")


def _length(length: Any, sampling: pd.Timedelta | None, name: str, least: int = 1) -> np.ndarray:
    """A length, (2,) int: as a number of rows, and as a number of steps of the local clock, of which one is 0."""
    if is_integer(length):
        if length < least:
            raise ValueError(f"{name}={length!r} must be at least {least} row(s).")
        return np.array([length, 0])
    if least == 0 and read_duration(length, name) == pd.Timedelta(0):
        return np.array([0, 0])
    if sampling is None:
        raise ValueError(
            f"X has no two time stamps, by which {name}={length!r} would be rows; give it a DatetimeIndex and more "
            "rows, or pass sampling_time= or numbers of rows."
        )
    n = rows_of(length, sampling, name)
    return np.array([0, n] if n * sampling >= _DAY else [n, 0])  # an hour may be missing on the clock, a day is not


def _clock_steps(X: Any) -> np.ndarray:
    """(n_rows,) whole steps by the local clock from the first row to each; an hour that the clock repeats adds none."""
    index, sampling = getattr(X, "index", None), _sampling_time(X, None)
    if sampling is None or not isinstance(index, pd.DatetimeIndex):
        return np.arange(_num_samples(X))
    wall = wall_clock(index)
    return np.maximum.accumulate(np.asarray((wall - wall[0]) // sampling))


def _row_by_clock(X: Any) -> Callable[[np.ndarray], Any]:
    """The row that lies a length (..., 2) after the first one, also beyond the end of X."""
    steps = _clock_steps(X)
    end = steps.max(initial=-1) + 1

    def row(length: np.ndarray) -> Any:
        n_rows, by_clock = np.moveaxis(length, -1, 0)
        return np.searchsorted(steps, by_clock) + np.maximum(by_clock - end, 0) + n_rows

    return row


def default_split(X: Any, horizon: Any) -> RollingOriginSplit | None:
    """Two test blocks at the end, each a sixth of the table in whole days, and all rows before a block as training.

    None where the table is too short for test blocks of a day and a horizon and two days of training.
    """
    sampling = _sampling_time(X, None)
    if sampling is None:
        raise ValueError("X has no time stamps, by which test blocks are cut; give it a DatetimeIndex, or pass cv=.")
    day, n_steps = rows_of("1D", sampling, "the test block"), int(_clock_steps(X)[-1]) + 1
    n_test = max(n_steps // 6 // day * day, day + rows_of(horizon, sampling))
    n_train = n_steps - 2 * n_test
    if n_train < 2 * day:
        return None
    return RollingOriginSplit(train=n_train * sampling, test=n_test * sampling, n_splits=2, expanding=True)
