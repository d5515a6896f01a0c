"""Derivatives of an autoregression's forecasts by its coefficients.

A coefficient changes each temperature step ahead by its column of that row, and a changed step k rows before a target
changes the target by ``impulse[k]``.  Forecasts of one target share what later origins see of a column with known
rows; a lagged temperature is, beyond the origin, the newest one some rows earlier.
"""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def _write_known_columns(rows, impulse, every, leads, factors, place, out):
    """Slopes by the coefficients of columns (N, m) whose rows ahead are known, from the last origin to the first."""
    (N, m), n_leads = rows.shape, leads[-1]
    used = np.zeros(n_leads + 1, np.bool_)
    for lead in leads:
        for h in range(lead, 0, -every):
            used[h] = True
    size, first = n_leads + every, out.shape[1] - m
    sums = np.zeros((size, m))  # of the target in row t at t % size; an origin adds the rows up to the next one
    for a in range((N - 1) // every, -1, -1):
        begin = a * every
        for h in range(1, min(n_leads, N - begin) + 1):
            if not used[h]:
                continue
            total = sums[(begin + h) % size]
            if h <= every:
                total[:] = 0.0
            for k in range(min(every, h)):
                effect, row = impulse[h - 1 - k], rows[begin + k]
                for j in range(m):
                    total[j] += effect * row[j]
        if a < len(place):
            for i in range(len(leads)):
                if place[a, i] >= 0:
                    total = sums[(begin + leads[i]) % size]
                    for j in range(m):
                        out[place[a, i], first + j] = factors[a, i] * total[j]


@compiled
def _write_lags(T, n_lags, impulse, leads, factors, place, out):
    """Slopes by the coefficients of lags: of each origin's last ``n_lags`` temperatures and of those forecast."""
    n_leads = leads[-1]
    sums = np.empty(n_lags + n_leads)  # of the target h rows ahead, by a lag, at n_lags - 1 + h - lag
    for a in range(len(T)):
        past, ahead = T[a, : n_lags - 1], T[a, n_lags - 1 :]
        sums[:] = 0.0
        for k in range(n_leads):
            after, value = sums[n_lags + k :], ahead[k]
            for h in range(n_leads - k):
                after[h] += impulse[h] * value
        i = 0
        for h in range(1, n_leads + 1):
            # temperatures before the origin, of which a later target sees one lag more
            here, effect = sums[h:], impulse[h - 1]
            for r in range(n_lags - 1):
                here[r] += effect * past[r]
            if h < leads[i]:
                continue
            if place[a, i] >= 0:
                for lag in range(n_lags):
                    out[place[a, i], lag] = factors[a, i] * here[n_lags - 1 - lag]
            i += 1


@compiled
def regression_slopes(T, rows, impulse, every, leads, factors):
    """Derivatives (n, n_lags + m) of forecasts of O origins, ``every`` rows apart, at L increasing leads.

    Row a of ``T`` (O, n_lags + n_leads - 1) has the temperatures up to an origin and those forecast, the oldest first;
    ``rows`` (N, m) are the other columns from the first origin on, up to the last row that is known.  The n forecasts
    whose ``factors`` (O, L) are not 0 are kept in their order, multiplied by them; a forecast that
    needs later rows has 0.
    """
    n_lags, m = T.shape[1] - leads[-1] + 1, rows.shape[1]
    place, n = np.empty(factors.shape, np.int64), 0
    for a in range(len(factors)):
        for i in range(len(leads)):
            place[a, i] = -1
            if factors[a, i] != 0.0:
                place[a, i] = n
                n += 1
    out = np.zeros((n, n_lags + m))
    _write_known_columns(rows, impulse, every, leads, factors, place, out)
    _write_lags(T, n_lags, impulse, leads, factors, place, out)
    return out
