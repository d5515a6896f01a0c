"""Errors of the innovations-form predictor several steps ahead, with exact sensitivities.

A forecast from row o takes the state that the rows up to o lead to expect of row o + 1, and runs on without errors:
``y_hat[o + h] = C s_h``, ``s_1 = s[o + 1 | o]``, ``s_{j+1} = A s_j + B v[o + j]``.  With x the states of one run over
all rows that no error corrects, this is ``y_hat[o + h] = C x[o + h] + C A^(h-1) (s[o + 1 | o] - x[o + 1])``: two
runs serve all forecasts, and each adds the product of a row with a state.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .innovations import _advance


class LeadErrors(NamedTuple):
    """Errors of S starts at every origin, lead and output, and their exact derivatives by each of p parameters."""

    errors: np.ndarray  # (S, O, L, o); 0 where nothing was measured, or behind the last row
    derrors: np.ndarray  # (S, O, L, o, p)


@compiled
def _lead_rows(A, dA, C, leads):
    """``C A^(h-1)`` of every lead h (increasing), (L, o, n), and its derivatives (L, o, n, p)."""
    (o, n), p, L = C.shape, dA.shape[2], len(leads)
    rows, drows = np.empty((L, o, n)), np.empty((L, o, n, p))
    row, drow, new, dnew = C.copy(), np.zeros((o, n, p)), np.empty((o, n)), np.empty((o, n, p))
    at = 0
    for h in range(1, leads[-1] + 1):
        if h == leads[at]:
            for j in range(o):
                for i in range(n):
                    rows[at, j, i] = row[j, i]
                    for q in range(p):
                        drows[at, j, i, q] = drow[j, i, q]
            at += 1
        for j in range(o):
            for i in range(n):
                value = 0.0
                for q in range(p):
                    dnew[j, i, q] = 0.0
                for r in range(n):
                    value += row[j, r] * A[r, i]
                    for q in range(p):
                        dnew[j, i, q] += drow[j, r, q] * A[r, i] + row[j, r] * dA[r, i, q]
                new[j, i] = value
        row, new, drow, dnew = new, row, dnew, drow
    return rows, drows


@compiled
def _collect(open_, dopen, held, dheld, rows, drows, y, origins, leads, errors, derrors):
    """Errors of one start: of the open run, less what was known of its error at the origin."""
    N, o = y.shape
    n, p = dheld.shape[1:]
    for a in range(len(origins)):
        for h in range(len(leads)):
            k = origins[a] + leads[h]
            if k >= N:
                break
            for j in range(o):
                if np.isnan(y[k, j]):
                    continue
                e = open_[k, j]
                for q in range(p):
                    derrors[a, h, j, q] = dopen[k, j, q]
                for i in range(n):
                    x, c = held[a, i], rows[h, j, i]
                    e -= c * x
                    for q in range(p):
                        derrors[a, h, j, q] -= c * dheld[a, i, q] + drows[h, j, i, q] * x
                errors[a, h, j] = e


@compiled
def multi_step_sensitivities(model, inputs, y, filtered, exact, origins, leads):
    """Errors of forecasts and their exact derivatives, for S starts over one segment of rows.

    Parameters
    ----------
    model : Model
        With a leading axis of S starts, and p parameters; p may be 0.
    inputs : ndarray of shape (N, m)
    y : ndarray of shape (N, o)
        Measurements, NaN where missing.
    filtered : int
        Rows below this number have Kalman's gain, the others ``K``.
    exact : bool
        Whether the constant gain is the exact one behind missing rows, as in ``one_step_sensitivities``.
    origins, leads : ndarray of int, shape (O,) and (L,)
        Increasing; the first lead is 1 or more.

    Returns
    -------
    LeadErrors
    """
    A, B, C, K, Q, R, P0, s0, dA, dB, dK, dQ, ds0 = model
    (S, n), p, (N, o) = A.shape[:2], dA.shape[3], y.shape
    n_origins, L, weighed = len(origins), len(leads), N if exact else 0
    errors, derrors = np.zeros((S, n_origins, L, o)), np.zeros((S, n_origins, L, o, p))
    open_, dopen, own, down = np.empty((N, o)), np.empty((N, o, p)), np.empty((N, o)), np.empty((N, o, p))
    variances, dvariances = np.empty((weighed, o)), np.empty((weighed, o, p))
    free, held = np.empty((n_origins, n)), np.empty((n_origins, n))
    dfree, dheld = np.empty((n_origins, n, p)), np.empty((n_origins, n, p))
    none, dnone = np.zeros((n, o)), np.zeros((n, o, p))
    for b in range(S):
        for values in (open_, own):  # a row without a measurement keeps its 0
            values[:] = 0.0
        for slopes in (dopen, down, dvariances):
            slopes[:] = 0.0
        still = (A[b], B[b], C, none, Q[b], R, P0, s0[b], dA[b], dB[b], dnone, dQ[b], ds0[b])
        _advance(still, inputs, y, 0, False, open_, dopen, variances, dvariances, origins, free, dfree)
        one = (A[b], B[b], C, K[b], Q[b], R, P0, s0[b], dA[b], dB[b], dK[b], dQ[b], ds0[b])
        _advance(one, inputs, y, filtered, exact, own, down, variances, dvariances, origins, held, dheld)
        held -= free
        dheld -= dfree
        rows, drows = _lead_rows(A[b], dA[b], C, leads)
        _collect(open_, dopen, held, dheld, rows, drows, y, origins, leads, errors[b], derrors[b])
    return LeadErrors(errors, derrors)
