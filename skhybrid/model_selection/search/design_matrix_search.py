"""``DesignMatrixSearchCV``: a grid search that can be resumed, shared between processes and watched while it runs."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
import pandas as pd
from scipy.stats import rankdata
from sklearn.base import clone
from sklearn.exceptions import FitFailedWarning
from sklearn.model_selection import ParameterGrid, check_cv
from sklearn.model_selection._search import BaseSearchCV
from sklearn.utils.validation import indexable

from ..._arguments import as_mapping, check_bool, check_integer, check_verbose, store_arguments
from ..._transaction import unchanged_on_failure
from ..._warnings import first_sentence
from ...forecasting.named_models import is_network, require_networks
from ...hybrid import HybridPredictor
from ...hybrid.predictor import takes_two_stages
from ...parallel.workers import Workers
from ..splitters import default_split
from .candidates import BASELINE, forecaster_prefix, last_step, model_of, settings_of
from .design_matrix import IDENTITY, DesignMatrix
from .halving import SearchOutcome, check_halving, run_all, run_halving
from .runner import Runner
from .store import ResultStore
from .tasks import MeasuredRmse, Problem


class DesignMatrixSearchCV(BaseSearchCV):
    """Search over a design matrix: it can be resumed and distributed, and goes on where candidates fail.

    It gives the results of ``GridSearchCV`` over the same candidates, bit for bit if every ``random_state`` is a
    number, but reads each split once, identifies the network of each split once, and trains only forecasters after
    that.  Results are stored as they finish: a search that was stopped or killed continues where it was, and several
    processes may share one store.

    Parallel work is left to joblib: ``n_jobs`` processes, or a cluster by ``joblib.parallel_config(backend="dask")``.

    Parameters
    ----------
    estimator : HybridPredictor, Pipeline that ends in one, or DisturbanceForecaster
        With parameter grids instead of a design matrix, any regressor.
    matrix : DesignMatrix, dict or list of dict
        From :func:`design_matrix`, or parameter grids as ``GridSearchCV`` takes them.
    cv : splitter, iterable or int, optional
        Default: two test blocks at the end, each a sixth of the table in whole days, and all rows before a block as its
        training (:class:`RollingOriginSplit`).  An int, as in ``GridSearchCV``, for plain regressors alone.
    store : path-like, optional
        SQLite file of results on a local disk, created if it does not exist.  None: results are kept in memory.
    n_jobs : int, optional
        Number of processes, as joblib counts them.
    scoring : str, callable, list or dict, optional
        As in ``GridSearchCV``; default is the negative root-mean-square error [K] of ``predict`` over measured rows.
    refit : bool, str or callable, default True
        As in ``GridSearchCV``.
    error_score : float or "raise", default NaN
        Score of a candidate that fails, whose error is in ``results_``; ``"raise"`` ends the search, and tries again
        what failed in an earlier run with this store.
    halving : int or tuple of (int, int), optional
        Stop hopeless networks early: all are trained for this many epochs, then the best third by RMSE for three times
        as many, and so on up to ``max_epochs``.  The second number of a pair takes the place of three.  A stopped
        network is never the best; a warning says how many there are, and ``halving_`` at which rung.
    baselines : mapping of str to regressor, optional
        Further estimators, such as ``{"arx": ARXRegressor()}``, fitted and scored on the same splits.  They are rows of
        ``results_`` without a case, which :func:`select_case` ranks with the others, but none can be the best.
        Beside forecasters, one without ``predict_from`` fails if it reads the measurements of the row that it predicts.
    retry_failed : bool, default False
        Whether to try again the candidates that failed in an earlier run with this store.
    chunk_size : int, default 12
        Most candidates of one framework that a worker takes at once; a kill loses the chunks in work.
    verbose : int, default 1
        0 shows nothing, 1 a progress bar with the rate and the time left.

    Attributes
    ----------
    cv_results_ : dict
        As of ``GridSearchCV``; with ``halving`` also ``stopped_at``.
    results_ : DataFrame
        One row per candidate, then one per baseline: the columns of the design matrix, ``rmse`` [K] (mean over splits),
        ``split0_rmse`` ..., ``n_epochs`` and ``fit_time`` [s] (means), ``stopped_at`` (epochs at which halving
        stopped it, else NaN) and ``error`` (of a split that failed, else None).
    halving_ : DataFrame
        One row per rung: ``max_epochs``, ``n_candidates``, ``n_stopped`` and ``worst_kept`` RMSE [K]; empty without
        halving.
    best_estimator_, best_params_, best_score_, best_index_, scorer_, n_splits_, refit_time_, multimetric_
        As of ``GridSearchCV``.

    Examples
    --------
    >>> from skhybrid import GrayBoxRC, HybridPredictor
    >>> from skhybrid.datasets import make_office
    >>> from skhybrid.model_selection import DesignMatrixSearchCV, design_matrix
    >>> office = make_office(n_days=14, random_state=0)
    >>> estimator = HybridPredictor(GrayBoxRC(n_starts=2, random_state=0))
    >>> search = DesignMatrixSearchCV(estimator, design_matrix(["ridge", "profile"], disturbance="input"), verbose=0)
    >>> search.fit(office.X, office.y).results_["framework"].tolist()
    ['ridge', 'profile']
    """

    return_train_score = False

    def __init__(
        self, estimator: Any, matrix: Any, *, cv: Any = None, store: Any = None, n_jobs: int | None = None,
        scoring: Any = None, refit: Any = True, error_score: Any = np.nan, halving: Any = None, baselines: Any = None,
        retry_failed: bool = False, chunk_size: int = 12, verbose: int = 1,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    @unchanged_on_failure
    def fit(self, X: Any, y: Any = None) -> Self:
        """Fit and score all candidates that the store does not hold yet, and fit the best one on the whole table.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows; for a :class:`~skhybrid.hybrid.HybridPredictor` with ``T_za`` as history.
        y : array-like of shape (n_samples,), target

        Raises
        ------
        ValueError
            If y is missing, the store was made with other data or settings, a setting is unknown, ``cv`` is an int
            for a model of rows in time, a design matrix is given for the schedule model, or every candidate fails on
            every split.
        """
        if y is None:
            raise ValueError("DesignMatrixSearchCV requires y to be passed, but the target y is None.")
        self._check_settings()
        scorer, metric = self._get_scorers()
        X, y = indexable(X, y)
        candidates = self._candidates()
        networks = {one for params in candidates if is_network(one := model_of(self.estimator, params))}
        for name in sorted(networks):
            require_networks(name)
        problem = Problem(clone(self.estimator), X, y, self._splits(X, y), scorer, bool(networks))
        outcome, baselines = self._run(problem, candidates)
        self._assemble(candidates, outcome, baselines)
        if callable(self.scoring) and self.multimetric_:
            self._check_refit_for_multimetric(dict.fromkeys(self._metrics(outcome)))
            metric = self.refit
        if self.refit or not self.multimetric_:
            self.best_index_ = self._select_best_index(self.refit, metric, self.cv_results_)
            if not callable(self.refit):
                self.best_score_ = self.cv_results_[f"mean_test_{metric}"][self.best_index_]
            self.best_params_ = self.cv_results_["params"][self.best_index_]
        if self.refit:
            self._refit(problem)
        self.scorer_ = getattr(scorer, "_scorers", scorer)
        return self

    @property
    def n_features_in_(self) -> int:  # documented without the terms of scikit-learn's glossary
        """Number of columns of X; only with ``refit``."""
        return super().n_features_in_

    def _check_settings(self) -> None:
        check_integer("chunk_size", self.chunk_size)
        check_bool("retry_failed", self.retry_failed)
        check_verbose(self.verbose)
        as_mapping("baselines", self.baselines, "names to regressors, such as {'arx': ARXRegressor()}")
        given = self.error_score
        if not (isinstance(given, Real) and not isinstance(given, bool)) and given != "raise":
            raise ValueError(f"error_score={given!r} must be a number, such as NaN, or 'raise'.")
        refit, scoring = self.refit, self.scoring
        one_metric = scoring is None or isinstance(scoring, str)  # scikit-learn checks those of several
        named = isinstance(refit, str) and (not one_metric or refit in ("score", scoring))
        if not (named or isinstance(refit, bool | np.bool_) or callable(refit)):
            raise ValueError(f"refit={refit!r} is no metric of scoring={scoring!r}; give True, False or a callable.")

    def _get_scorers(self) -> tuple[Any, Any]:
        return (MeasuredRmse(-1.0), "score") if self.scoring is None else super()._get_scorers()

    def _splits(self, X: Any, y: Any) -> list[tuple[np.ndarray, np.ndarray]]:
        cv, model = self.cv, last_step(self.estimator)
        if isinstance(cv, Integral) and hasattr(model, "sampling_time"):  # of rows in time
            raise ValueError(
                f"cv={cv!r} also trains on rows after those of the test, which a forecast must not know; give a "
                "splitter in time order, such as RollingOriginSplit()."
            )
        if cv is None:
            cv = default_split(X, getattr(model, "horizon", None) or "1D")
            if cv is None:
                raise ValueError("X is too short for two test blocks of one day and a training of two; pass cv=.")
        splits = list(check_cv(cv, y, classifier=False).split(X, y))
        self.n_splits_ = len(splits)
        return splits

    def _candidates(self) -> list[dict[str, Any]]:
        if isinstance(self.matrix, DesignMatrix):
            found, model = self.matrix.candidates(forecaster_prefix(self.estimator)), last_step(self.estimator)
            schedules = isinstance(model, HybridPredictor) and not takes_two_stages(model)
            if schedules and (self.matrix.table["disturbance"] == "input").any():
                raise ValueError(
                    "without a gray_box or a forecaster, HybridPredictor is the schedule model, which has no "
                    "forecaster to choose; give one of them, or a TwoStagePredictor()."
                )
            return found
        found = list(ParameterGrid(self.matrix))
        if not found:
            raise ValueError("the parameter grid is empty; give at least one candidate.")
        return found

    def _run(
        self, problem: Problem, candidates: Sequence[dict[str, Any]]
    ) -> tuple[SearchOutcome, SearchOutcome | None]:
        settings = settings_of(self.estimator, problem.X, problem.y, problem.splits, self.scoring)
        rule = None if self.halving is None else check_halving(self.halving)
        with ResultStore(self.store, settings) as store, Workers(self.n_jobs) as workers:
            catch_errors = not (isinstance(self.error_score, str) and self.error_score == "raise")
            if self.retry_failed or not catch_errors:  # a stored error cannot be raised again
                store.forget_failed()
            runner = Runner(problem, store, workers, self.chunk_size, catch_errors, self.verbose > 0)
            baselines = None
            if self.baselines:
                baselines = run_all(runner.run, [{BASELINE: one} for one in self.baselines.values()])
            if rule is None:
                return run_all(runner.run, candidates), baselines
            return run_halving(runner.run, problem.estimator, candidates, *rule), baselines

    @staticmethod
    def _metrics(outcome: SearchOutcome) -> list[str]:
        good = next((one for row in outcome.results for one in row if one.error is None), None)
        if good is None:
            cause = first_sentence(_error_told(outcome.results[0][0].error))
            raise ValueError(f"every candidate failed (error_score='raise' shows where), the first with {cause}.")
        return list(good.scores)

    def _assemble(
        self, candidates: list[dict[str, Any]], outcome: SearchOutcome, baselines: SearchOutcome | None
    ) -> None:
        """Set ``cv_results_``, ``results_`` and ``halving_``; warn of failed and stopped candidates."""
        names = self._metrics(outcome)
        self.multimetric_ = names != ["score"]
        out = []
        for one in (one for row in outcome.results for one in row):
            scores = one.scores if one.error is None else dict.fromkeys(names, self.error_score)
            test_scores = scores if self.multimetric_ else scores["score"]
            out.append({"fit_time": one.fit_time, "score_time": one.score_time, "test_scores": test_scores})
        self.cv_results_ = self._format_results(candidates, self.n_splits_, out)
        self.halving_ = outcome.rungs
        tables = [self._table(self._identity(candidates), outcome)]
        if baselines is not None:
            names = list(self.baselines)
            tables.append(self._table(pd.DataFrame({"framework": names, "name": names}), baselines))
        self.results_ = tables[0] if len(tables) == 1 else _one_table(tables)
        failed = self.results_["error"].notna()
        if failed.any():
            first = _error_told(self.results_["error"][failed].iloc[0])
            warnings.warn(
                f"{failed.sum()} of {len(failed)} candidates failed (see results_['error']), the first with: {first}",
                FitFailedWarning,
                stacklevel=4,
            )
        if len(outcome.rungs):
            self._rank_stopped_last(outcome.stopped_at)

    def _identity(self, candidates: list[dict[str, Any]]) -> pd.DataFrame:
        if isinstance(self.matrix, DesignMatrix):
            table = self.matrix.table
            if forecaster_prefix(self.estimator) == "":  # a forecaster alone has no kind of disturbance
                table = table[~table.drop(columns="disturbance").duplicated()].assign(disturbance=None)
            return table
        names = dict.fromkeys(name for candidate in candidates for name in candidate)
        return pd.DataFrame([{name: c.get(name, np.nan) for name in names} for c in candidates])

    @staticmethod
    def _table(table: pd.DataFrame, outcome: SearchOutcome) -> pd.DataFrame:
        rmse = np.array([[one.rmse for one in row] for row in outcome.results])
        epochs = [[np.nan if one.n_epochs is None else one.n_epochs for one in row] for row in outcome.results]
        errors = [next((one.error for one in row if one.error is not None), None) for row in outcome.results]
        return table.reset_index(drop=True).assign(
            rmse=rmse.mean(axis=1),
            **{f"split{i}_rmse": column for i, column in enumerate(rmse.T)},
            n_epochs=np.mean(epochs, axis=1),
            fit_time=[float(np.mean([one.fit_time for one in row])) for row in outcome.results],
            stopped_at=outcome.stopped_at,
            error=pd.Series(errors, dtype=object),
        )

    def _rank_stopped_last(self, stopped_at: np.ndarray) -> None:
        """Rank stopped candidates after the others: scores after fewer epochs cannot be compared with theirs."""
        stopped = np.isfinite(stopped_at)
        self.cv_results_["stopped_at"] = stopped_at
        for name in [name for name in self.cv_results_ if name.startswith("rank_test_")]:
            score = np.nan_to_num(self.cv_results_[name.replace("rank", "mean", 1)], nan=-np.inf)
            ranks = np.empty(len(score), dtype=np.int32)
            ranks[~stopped] = rankdata(-score[~stopped], method="min")
            ranks[stopped] = rankdata(-score[stopped], method="min") + (~stopped).sum()
            self.cv_results_[name] = ranks
        warnings.warn(
            f"halving stopped {stopped.sum()} of {len(stopped)} candidates early; they were scored after fewer epochs "
            "(see results_['stopped_at'] and halving_).",
            stacklevel=5,
        )

    def _refit(self, problem: Problem) -> None:
        started = time.perf_counter()
        self.best_estimator_ = problem.candidate(self.best_params_).fit(problem.X, problem.y)
        self.refit_time_ = time.perf_counter() - started
        if hasattr(self.best_estimator_, "feature_names_in_"):
            self.feature_names_in_ = self.best_estimator_.feature_names_in_


def _error_told(text: Any) -> str:
    """The error at the end of a traceback on one line; its message may have several."""
    lines = str(text).rpartition("Traceback (most recent call last):\n")[2].strip("\n").splitlines()
    first = next((i for i, line in enumerate(lines) if not line.startswith(" ")), 0)
    return " ".join(" ".join(lines[first:]).split())


def _one_table(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Candidates and baselines as one table; baselines have neither case nor kind of disturbance."""
    table = pd.concat(tables, ignore_index=True)
    without = {name: table[name].astype(object) for name in IDENTITY[1:3] if name in table}
    return table.assign(**{name: column.where(column.notna(), None) for name, column in without.items()})
