"""A linear recursion that is bounded: an autoregression driven by inputs."""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def iterate_lags(begin, coefs, driven, lowest, highest):
    """Go on with each of several series by its own coefficients.

    Parameters
    ----------
    begin : ndarray of shape (n, n_lags)
        Last values, the oldest first.
    coefs : ndarray of shape (n, n_lags)
        What each of them adds to the next step, the oldest first.
    driven : ndarray of shape (n, n_leads)
        What everything else adds to each step.
    lowest, highest : float
        Values are held within these.

    Returns
    -------
    ndarray of shape (n, n_leads)
    """
    n, n_leads = driven.shape
    n_lags = begin.shape[1]
    out, values = np.empty((n, n_leads)), np.empty(n_lags + n_leads)
    for i in range(n):
        values[:n_lags] = begin[i]
        for lead in range(n_leads):
            step = driven[i, lead]
            for lag in range(n_lags):
                step += coefs[i, lag] * values[lead + lag]
            values[n_lags + lead] = min(max(values[n_lags + lead - 1] + step, lowest), highest)
        out[i] = values[n_lags:]
    return out
