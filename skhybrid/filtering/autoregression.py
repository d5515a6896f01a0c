"""Autoregression with inputs, iterated over a horizon within bounds."""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def iterate_lags(begin, coefs, driven, lowest, highest):
    """Iterate several autoregressions, each with its own coefficients.

    Parameters
    ----------
    begin : ndarray of shape (n, n_lags)
        Last known values, the oldest first.
    coefs : ndarray of shape (n, n_lags)
        Effect of each of them on the change over the next step, the oldest first.
    driven : ndarray of shape (n, n_leads)
        Change over each step by everything else.
    lowest, highest : float
        Bounds of the values.

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
            change = driven[i, lead]
            for lag in range(n_lags):
                change += coefs[i, lag] * values[lead + lag]
            values[n_lags + lead] = min(max(values[n_lags + lead - 1] + change, lowest), highest)
        out[i] = values[n_lags:]
    return out
