"""The work of one task of a search: identify a network on a split, or fit and score candidates on it."""

from __future__ import annotations

import ctypes
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.metrics import get_scorer
from sklearn.pipeline import Pipeline
from sklearn.utils import _safe_indexing

from ..._table import ZoneTable, as_numbers, refuse_huge
from ...forecasting import DisturbanceForecaster
from ...forecasting.joint_fit import fit_each
from ...parallel.shared import Shared
from ..later_measurements import refuse_later_measurements
from ..single_reading import read_alike, read_once, reading_of, takes_tables
from .candidates import BASELINE, forecaster_prefix, last_step
from .store import Result, Task


@dataclass(frozen=True)
class MeasuredRmse:
    """Root-mean-square error of ``predict`` over the measured rows, in the unit of y; with ``sign=-1`` a score."""

    sign: float = 1.0

    def __call__(self, estimator: Any, X: Any, y: Any) -> float:
        """Score a fitted estimator on a table and its target (n_samples,), NaN where missing."""
        measured = as_numbers(y, "y")
        refuse_huge(measured, "y")
        if not np.isfinite(measured).any():
            raise ValueError("y holds no measurement to score against; choose rows in which T_za was measured.")
        predicted = np.asarray(estimator.predict(X), dtype=np.float64)
        measured = measured.reshape(predicted.shape)
        if np.isnan(predicted[np.isfinite(measured)]).any():
            raise ValueError(f"{type(estimator).__name__} predicts NaN in measured rows, so that it has no score.")
        return self.sign * float(np.sqrt(np.nanmean((predicted - measured) ** 2)))


_PASS_ON = (MeasuredRmse, type(get_scorer("r2")))  # scorers that only pass X on to ``predict``
#: loads torch and skorch before the first task: joblib restarts a worker whose memory has grown by 300 MB after a task
_TRAINING = "skhybrid.forecasting.networks.jobs"


class _SplitTable(NamedTuple):
    """The rows of a split, from the first to the last, as they were read."""

    table: ZoneTable
    first_row: int  # of X

    def rows(self, chosen: np.ndarray) -> ZoneTable:
        return self.table.rows(slice(int(chosen[0]) - self.first_row, int(chosen[-1]) + 1 - self.first_row))


@dataclass
class Problem:
    """Data and settings that all tasks of a search share."""

    estimator: Any
    X: Any
    y: Any
    splits: list[tuple[np.ndarray, np.ndarray]]  # train and test rows
    scorer: Callable[..., Any]
    has_networks: bool = False  # whether neural networks are among the candidates
    _read: dict[int, _SplitTable | None] = field(default_factory=dict, init=False, repr=False)  # by split

    def training_rows(self, split: int, models: Sequence[Any]) -> tuple[Any, Any]:
        """X and y that models are fitted on."""
        return self._rows(self.splits[split][0], self._split_table(split, models))

    def test_rows(self, split: int, model: Any) -> tuple[Any, Any]:
        """X and y that a model is scored on; a scorer of the caller's own gets X as the caller gave it."""
        scorers = getattr(self.scorer, "_scorers", {"score": self.scorer}).values()
        passes_on = all(isinstance(one, _PASS_ON) for one in scorers)
        return self._rows(self.splits[split][1], self._split_table(split, [model]) if passes_on else None)

    def _rows(self, chosen: np.ndarray, read: _SplitTable | None) -> tuple[Any, Any]:
        X = _safe_indexing(self.X, chosen) if read is None else read.rows(chosen)
        return X, _safe_indexing(self.y, chosen)

    def _split_table(self, split: int, models: Sequence[Any]) -> _SplitTable | None:
        """The split as it was read for the first task; None where a model must read its rows itself."""
        if not takes_tables(self.estimator) or not read_alike(models, reading_of(self.estimator)):
            return None
        if split not in self._read:
            self._read[split] = self._read_split(*self.splits[split])
        return self._read[split]

    def _read_split(self, train: np.ndarray, test: np.ndarray) -> _SplitTable | None:
        if not all(len(rows) and (np.diff(rows) == 1).all() for rows in (train, test)):
            return None
        first, last = int(min(train[0], test[0])), int(max(train[-1], test[-1]))
        read = read_once(_safe_indexing(self.X, np.arange(first, last + 1)), **reading_of(self.estimator))
        return _SplitTable(read, first) if isinstance(read, ZoneTable) else None

    def candidate(self, params: Mapping[str, Any]) -> Any:
        """The estimator with parameters set; those that are estimators are cloned, as scikit-learn's searches do."""
        if BASELINE in params:
            return clone(params[BASELINE])
        return clone(self.estimator).set_params(**clone(dict(params), safe=False))


class IdentifiedNetwork(NamedTuple):
    """A thermal network that candidates share, or why there is none."""

    fitted: Any  # the estimator, with a forecaster that takes no time to fit; None after an error
    error: str | None


def identify(
    problem: Shared, name: str, params: Mapping[str, Any], split: int, catch_errors: bool = True
) -> dict[tuple[str, int], IdentifiedNetwork]:
    """``{(name, split): network}``, identified on a split by the parameters of :func:`identification_params`."""
    given: Problem = problem.get()
    if given.has_networks:
        import_module(_TRAINING)
    try:
        estimator = given.candidate(params)
        prefix = forecaster_prefix(estimator)
        quick = DisturbanceForecaster("persistence", horizon=last_step(estimator).horizon or "1D")
        outer = prefix.removesuffix("forecaster__")
        estimator.set_params(**{f"{outer}forecaster": quick, f"{outer}intervals": False})
        return {(name, split): IdentifiedNetwork(estimator.fit(*given.training_rows(split, [estimator])), None)}
    except Exception:
        if not catch_errors:
            raise
        return {(name, split): IdentifiedNetwork(None, traceback.format_exc())}


def evaluate(
    problem: Shared,
    network: Shared | None,
    tasks: Mapping[Task, Mapping[str, Any]],
    split: int,
    catch_errors: bool = True,
) -> dict[Task, Result]:
    """Fit and score candidates on a split: as a whole, or with a ``network`` that they share only their forecasters."""
    given: Problem = problem.get()
    shared: IdentifiedNetwork | None = None if network is None else network.get()
    if shared is not None and shared.error is not None:
        return {task: failed(shared.error) for task in tasks}
    started = time.perf_counter()
    try:
        models = _fit(given, None if shared is None else shared.fitted, list(tasks.values()), split)
    except Exception:
        if not catch_errors:
            raise
        if len(tasks) == 1:
            return {task: failed(traceback.format_exc(), time.perf_counter() - started) for task in tasks}
        one_by_one = [evaluate(problem, network, {task: params}, split) for task, params in tasks.items()]
        return {task: result for found in one_by_one for task, result in found.items()}
    spent = (time.perf_counter() - started) / len(tasks)
    with suppress(OSError, AttributeError):  # memory back to Linux: joblib restarts a worker that has grown by 300 MB
        ctypes.CDLL(None).malloc_trim(0)
    return {task: _score(given, model, split, spent, catch_errors) for task, model in zip(tasks, models, strict=True)}


def _fit(given: Problem, fitted: Any, candidates: Sequence[Mapping[str, Any]], split: int) -> list[Any]:
    made = [given.candidate(params) for params in candidates]
    if fitted is None:
        return fit_each(made, *given.training_rows(split, made))
    inner = [last_step(one) for one in made]
    models = last_step(fitted).with_forecasters([one.forecaster for one in inner], inner[0].disturbance)
    if not isinstance(fitted, Pipeline):
        return models
    return [Pipeline([*fitted.steps[:-1], (fitted.steps[-1][0], model)]) for model in models]


def _score(given: Problem, model: Any, split: int, fit_time: float, catch_errors: bool) -> Result:
    X, y = given.test_rows(split, model)
    started = time.perf_counter()
    try:
        if hasattr(last_step(given.estimator), "predict_from"):
            _refuse_leak(model, X, y)
        scores = given.scorer(model, X, y)
        scores = dict(scores) if isinstance(scores, Mapping) else {"score": scores}
        error = next((value for value in scores.values() if isinstance(value, str)), None)  # of several, one may fail
        if error is not None:
            return failed(error, fit_time)
        rmse = -scores["score"] if given.scorer == MeasuredRmse(-1.0) else MeasuredRmse()(model, X, y)
    except Exception:
        if not catch_errors:
            raise
        return failed(traceback.format_exc(), fit_time)
    scores = {name: float(value) for name, value in scores.items()}
    inner = last_step(model)
    n_epochs = getattr(getattr(inner, "forecaster_", inner), "n_epochs_", None) or None
    return Result(scores, rmse, fit_time, time.perf_counter() - started, n_epochs, None)


def _refuse_leak(model: Any, X: Any, y: Any) -> None:
    """Refuse what is compared with forecasts and reads the measurements of the row that it predicts."""
    if hasattr(last_step(model), "predict_from") or len(X) < 2:
        return
    predicted = np.asarray(model.predict(X), dtype=np.float64)
    refuse_later_measurements(model, X, as_numbers(y, "y").ravel(), predicted, np.arange(len(X) - 1), 1)


def failed(error: str, fit_time: float = 0.0) -> Result:
    """The result of a candidate that raised an error, given with its traceback."""
    return Result({}, float("nan"), fit_time, 0.0, None, error)
