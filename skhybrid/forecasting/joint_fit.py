"""Many forecasters of the same rows, fitted together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from sklearn.base import clone

from .._arguments import check_verbose
from .._threads import one_blas_thread
from .forecaster import DisturbanceForecaster
from .training_job import TrainingJob


@one_blas_thread
def fit_many(
    forecasters: Iterable[DisturbanceForecaster], X: Any, y: Any, *, on_error: str = "raise", verbose: int = 0
) -> list[Any]:
    """Fit many forecasters to the same rows, such as the candidates of a search.

    Each becomes what ``clone(forecaster).fit(X, y)`` is; networks agree with it to rounding.  What they share is
    computed once: the windows of a case, and the baseline that networks correct.  Networks of equal shape (framework,
    history, layers and widths) are trained as one stack, which each leaves when its own early stopping says so.
    Activation, dropout and seed may differ within a stack, as may the number of layers of MLPs, and the case of RNNs
    and LSTMs.

    One thread computes.  To keep several cores busy, give each process some of the forecasters, those of equal shape
    to one process.

    Parameters
    ----------
    forecasters : iterable of DisturbanceForecaster
        Candidates; they are cloned, and left as they are.
    X : DataFrame or array-like of shape (n_samples, n_features)
    y : Series or array-like of shape (n_samples,)
        Disturbance over each row [kW, or degC for an output disturbance].
    on_error : {"raise", "return"}, default "raise"
        ``"raise"`` raises the first exception, where possible before networks are trained; ``"return"`` puts it in the
        list in the place of its forecaster and fits the others.
    verbose : int, default 0
        1 shows a progress bar of epochs for each stack; the forecasters' own ``verbose`` is not read.

    Returns
    -------
    list of DisturbanceForecaster
        Fitted clones, in order; exceptions among them where ``on_error="return"``.

    Raises
    ------
    ValueError
        If ``on_error`` is neither, ``verbose`` a word, or a candidate of another kind.
    """
    check_verbose(verbose)
    if on_error not in ("raise", "return"):
        raise ValueError(f"on_error={on_error!r} is not known; use 'raise' or 'return'.")
    if not isinstance(forecasters, Iterable):
        raise ValueError(f"forecasters is one {type(forecasters).__name__}; give a list of them.")
    results: list[Any] = []
    jobs: dict[int, TrainingJob] = {}
    shared: dict[Any, Any] = {}
    for i, forecaster in enumerate(forecasters):
        try:
            one = clone(_checked(forecaster))
            job = one._begin(X, y, shared)
        except Exception as error:
            if on_error == "raise":
                raise
            one, job = error, None
        results.append(one)
        if job is not None:
            jobs[i] = job
    if jobs:
        from .networks.jobs import train_networks  # torch loads here

        for i, result in zip(jobs, train_networks(list(jobs.values()), verbose, on_error), strict=True):
            if isinstance(result, Exception):
                results[i] = result
            else:
                results[i]._take(result)
    return results


def _checked(forecaster: Any) -> DisturbanceForecaster:
    """A candidate as it is; another kind is refused."""
    if not isinstance(forecaster, DisturbanceForecaster):
        raise ValueError(f"forecasters holds {forecaster!r}, which is no DisturbanceForecaster; give these alone.")
    return forecaster


def fit_each(forecasters: Sequence[Any], X: Any, y: Any) -> list[Any]:
    """Fit several forecasters of one disturbance, networks of equal shape as one stack; others need not be ours."""
    if all(isinstance(forecaster, DisturbanceForecaster) for forecaster in forecasters):
        return fit_many(forecasters, X, y)
    return [forecaster.fit(X, y) for forecaster in forecasters]
