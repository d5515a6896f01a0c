"""What a worker does: identify a network on a split, and fit and score candidates that share it."""

from __future__ import annotations

import time
import traceback
import uuid
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils import _safe_indexing

from ...forecasting import DisturbanceForecaster
from ...forecasting.cases import RECURRENT, resolve_case
from ...forecasting.joint_fit import fit_each
from ...hybrid import HybridPredictor
from .fingerprint import as_plain
from .store import Result, Task

try:
    import cloudpickle
except ImportError:  # before 1.6, joblib brought its own
    from joblib.externals import cloudpickle

#: the parameter of a candidate that is an estimator of its own, fitted and scored beside those of the matrix.
RIVAL = "rival"
#: unpacked things that a worker keeps at most: the data, and the networks of the splits that it works on
_KEPT = 32
#: sizes with which the time grows that a candidate takes to fit
_COSTLY = ("n_layers", "hidden_size", "n_channels", "filter_size", "max_epochs", "n_repeats", "n_estimators")
_unpacked: OrderedDict[str, Any] = OrderedDict()


class Shared:
    """Something large that many tasks need: packed once, sent to a worker once, unpacked there once.

    It is packed into one array, which joblib's own workers map from disk, and tells its size, by which Dask and Ray
    know to keep it where it has been sent.  Pass the same object to every task.

    Parameters
    ----------
    value : object
        What is shared; nobody may change it.
    """

    def __init__(self, value: Any) -> None:
        self._value = value
        self._key = uuid.uuid4().hex
        self._packed = np.frombuffer(cloudpickle.dumps(value), dtype=np.uint8)

    def __getstate__(self) -> dict[str, Any]:
        return {"_key": self._key, "_packed": self._packed}

    def __sizeof__(self) -> int:
        return object.__sizeof__(self) + self._packed.nbytes

    def get(self) -> Any:
        """The value."""
        if "_value" in vars(self):
            return self._value
        if self._key not in _unpacked:
            _unpacked[self._key] = cloudpickle.loads(self._packed.tobytes())
            while len(_unpacked) > _KEPT:
                _unpacked.popitem(last=False)
        return _unpacked[self._key]


class Problem(NamedTuple):
    """What all tasks of a search share."""

    estimator: Any
    X: Any
    y: Any
    splits: list[tuple[np.ndarray, np.ndarray]]  # train and test rows
    scorer: Callable[..., Any]
    trains: bool = False  # whether networks are among the candidates

    def rows(self, split: int, part: int) -> tuple[Any, Any]:
        """X and y of a split: part 0 trains, part 1 tests."""
        chosen = self.splits[split][part]
        return _safe_indexing(self.X, chosen), None if self.y is None else _safe_indexing(self.y, chosen)

    def candidate(self, params: Mapping[str, Any]) -> Any:
        """The estimator with parameters set; those that are estimators are cloned, as scikit-learn's searches do."""
        if RIVAL in params:
            return clone(params[RIVAL])
        return clone(self.estimator).set_params(**clone(dict(params), safe=False))


def forecaster_prefix(estimator: Any) -> str:
    """What stands before a forecaster's parameters.

    Parameters
    ----------
    estimator : estimator

    Returns
    -------
    str

    Raises
    ------
    ValueError
        If the estimator has no forecaster of the disturbance.
    """
    if isinstance(estimator, DisturbanceForecaster):
        return ""
    if isinstance(estimator, HybridPredictor):
        return "forecaster__"
    if isinstance(estimator, Pipeline):
        name, last = estimator.steps[-1]
        return f"{name}__{forecaster_prefix(last)}"
    raise ValueError(
        f"{type(estimator).__name__} has no forecaster of the disturbance; give a HybridPredictor, a Pipeline that "
        "ends in one, or a DisturbanceForecaster, or parameter grids instead of a design matrix."
    )


def outside_params(estimator: Any, params: Mapping[str, Any]) -> tuple[dict[str, Any], Any]:
    """The parameters by which a network is identified, and the model of the forecaster.

    Parameters
    ----------
    estimator : estimator
    params : Mapping of str to object
        Of a candidate.

    Returns
    -------
    outside : dict
        All but those of the forecaster and the kind of disturbance.
    model : object
        None where the candidate does not say.
    """
    try:
        prefix = forecaster_prefix(estimator)
    except ValueError:
        return dict(params), None
    before = prefix.removesuffix("forecaster__")
    own = (f"{before}forecaster", f"{before}disturbance")
    outside = {name: value for name, value in params.items() if name not in own and not name.startswith(prefix)}
    return outside, params.get(f"{prefix}model", params.get(own[0]))


def shares_network(estimator: Any, params: Mapping[str, Any]) -> bool:
    """Whether a candidate identifies a network first, which others may share; else it is fitted whole.

    Parameters
    ----------
    estimator : estimator
    params : Mapping of str to object
        Of the candidate.

    Returns
    -------
    bool
    """
    try:
        made = _hybrid(clone(estimator).set_params(**clone(dict(params), safe=False)))
        return isinstance(made, HybridPredictor) and made.scheme == "published"
    except (ValueError, TypeError, AttributeError):  # its fit will say what is wrong
        return False


def stack_of(params: Mapping[str, Any]) -> tuple[str, ...]:
    """What candidates are sorted by, so that those of equal shape, which train as one stack, stand together.

    Parameters
    ----------
    params : Mapping of str to object
        Of a candidate.

    Returns
    -------
    tuple of str
        The case (of a recurrent network its history alone), then the sizes, then what leaves the shape as it is.
    """
    own = _own(params)
    model, case = own.pop("model", None), own.pop("case", None)
    history = f"{_days(model, case)} d" if isinstance(model, str) and model in RECURRENT else str(case)
    alike = {name: own.pop(name, None) for name in ("activation", "dropout", "random_state")}
    return (history, as_plain(dict(sorted(own.items()))), str(case), as_plain(alike))


def effort_of(params: Mapping[str, Any]) -> float:
    """A rough measure of the time that a candidate takes, for the longest are begun first.

    Whoever begins with the shortest waits at the end for one worker that has begun the longest last.

    Parameters
    ----------
    params : Mapping of str to object
        Of a candidate.

    Returns
    -------
    float
        The product of those of its sizes with which the time grows, and of the days that its case reads.
    """
    own = _own(params)
    sizes = [value for name in _COSTLY if isinstance(value := own.get(name), int | float) and value > 0]
    return float(np.prod([*sizes, _days(own.get("model"), own.get("case")) or 1]))


def _own(params: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters by their own names, without those of the steps that they belong to."""
    return {name.split("__")[-1]: value for name, value in params.items()}


def _days(model: Any, case: Any) -> int:
    """Days of history that a network's case reads; 0 of what has none."""
    with suppress(ValueError):
        return resolve_case(case, model).pattern_days
    return 0


def _hybrid(estimator: Any) -> Any:
    return estimator.steps[-1][1] if isinstance(estimator, Pipeline) else estimator


# ---------------------------------------------------------------------------------------------------------- the tasks
class Base(NamedTuple):
    """An identified network, or why there is none."""

    fitted: Any  # the estimator, with the quickest forecaster there is
    error: str | None


def identify(
    problem: Shared, name: str, params: Mapping[str, Any], split: int, careful: bool = True
) -> dict[tuple[str, int], Base]:
    """Identify the network of a split.

    Parameters
    ----------
    problem : Shared
        A Problem.
    name : str
        What the network is called.
    params : Mapping of str to object
        As :func:`outside_params` gives them.
    split : int
    careful : bool, default True
        Whether an error is told; else it is raised.

    Returns
    -------
    dict of (str, int) to Base
        By name and split.
    """
    given: Problem = problem.get()
    if given.trains:
        # joblib ends a worker that grows by 300 MB after its first task: what trains is loaded with the first
        import_module("skhybrid.forecasting.networks.jobs")
    try:
        base = given.candidate(params)
        prefix = forecaster_prefix(base)
        quick = DisturbanceForecaster("persistence", horizon=_hybrid(base).horizon or "1D")
        fitted = base.set_params(**{prefix.removesuffix("__"): quick}).fit(*given.rows(split, 0))
        return {(name, split): Base(fitted, None)}
    except Exception:
        if not careful:
            raise
        return {(name, split): Base(None, traceback.format_exc())}


def evaluate(
    problem: Shared, base: Shared | None, tasks: Mapping[Task, Mapping[str, Any]], split: int, careful: bool = True
) -> dict[Task, Result]:
    """Fit and score candidates on a split.

    Parameters
    ----------
    problem : Shared
        A Problem.
    base : Shared or None
        What :func:`identify` gave; None: each candidate is fitted whole.
    tasks : Mapping of Task to parameters
        Those of a base differ from it in forecaster and, all alike, in the kind of disturbance.
    split : int
    careful : bool, default True
        Whether an error becomes part of the result; else it is raised.

    Returns
    -------
    dict of Task to Result
    """
    given: Problem = problem.get()
    if base is not None and base.get().error is not None:
        return {task: failed(base.get().error) for task in tasks}
    started = time.perf_counter()
    try:
        models = _fit(given, None if base is None else base.get().fitted, list(tasks.values()), split)
    except Exception:
        if not careful:
            raise
        if len(tasks) == 1:
            return {task: failed(traceback.format_exc(), time.perf_counter() - started) for task in tasks}
        one_by_one = [evaluate(problem, base, {task: params}, split) for task, params in tasks.items()]
        return {task: result for found in one_by_one for task, result in found.items()}
    spent = (time.perf_counter() - started) / len(tasks)
    return {task: _score(given, model, split, spent, careful) for task, model in zip(tasks, models, strict=True)}


def _fit(given: Problem, fitted: Any, candidates: Sequence[Mapping[str, Any]], split: int) -> list[Any]:
    made = [given.candidate(params) for params in candidates]
    if fitted is None:
        return fit_each(made, *given.rows(split, 0))
    inner = [_hybrid(one) for one in made]
    models = _hybrid(fitted).with_forecasters([one.forecaster for one in inner], inner[0].disturbance)
    if not isinstance(fitted, Pipeline):
        return models
    name = fitted.steps[-1][0]
    return [Pipeline([*fitted.steps[:-1], (name, model)]) for model in models]


def _score(given: Problem, model: Any, split: int, fit_time: float, careful: bool) -> Result:
    X, y = given.rows(split, 1)
    started = time.perf_counter()
    try:
        scores = given.scorer(model, X, y)
        scores = dict(scores) if isinstance(scores, Mapping) else {"score": scores}
        error = next((value for value in scores.values() if isinstance(value, str)), None)  # of several, one may fail
        if error is not None:
            return failed(error, fit_time)
        rmse = -scores["score"] if given.scorer == MeasuredRmse(-1.0) else MeasuredRmse()(model, X, y)
    except Exception:
        if not careful:
            raise
        return failed(traceback.format_exc(), fit_time)
    scores = {name: float(value) for name, value in scores.items()}
    return Result(scores, rmse, fit_time, time.perf_counter() - started, _n_epochs(model), None)


def failed(error: str, fit_time: float = 0.0) -> Result:
    """The result of a candidate that raised an error.

    Parameters
    ----------
    error : str
        With its traceback.
    fit_time : float, default 0.0
        [s].

    Returns
    -------
    Result
    """
    return Result({}, float("nan"), fit_time, 0.0, None, error)


@dataclass(frozen=True)
class MeasuredRmse:
    """Scorer: root-mean-square error of ``predict`` over the rows that were measured, in the unit of y.

    Parameters
    ----------
    sign : float, default 1.0
        -1 makes a score of it, of which more is better.
    """

    sign: float = 1.0

    def __call__(self, estimator: Any, X: Any, y: Any) -> float:
        """Score a fitted estimator on a table and its target (n_samples,), NaN where missing."""
        error = np.asarray(estimator.predict(X), dtype=np.float64) - np.asarray(y, dtype=np.float64)
        return self.sign * float(np.sqrt(np.nanmean(error**2)))


def _n_epochs(model: Any) -> int | None:
    """Epochs of a network."""
    inner = _hybrid(model)
    forecaster = getattr(inner, "forecaster_", inner)
    return getattr(forecaster, "n_epochs_", None) or None
