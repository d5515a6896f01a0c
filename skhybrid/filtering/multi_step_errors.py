"""Errors of the innovations-form predictor several steps ahead, with exact sensitivities.

A forecast from row o begins with the predicted state of row o + 1 and simulates: ``y_hat[o + h] = C s_h``,
``s_1 = s[o + 1 | o]``, ``s_{j+1} = A s_j + B v[o + j]``.  With x the states of one simulation over all rows, this is
``y_hat[o + h] = C x[o + h] + C A^(h-1) (s[o + 1 | o] - x[o + 1])``: a run of the predictor and a simulation serve all
forecasts, and each forecast adds the product of a row with a state.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._compile import compiled
from .innovations import one_start, run_predictor
from .rows import store_row


class LeadErrors(NamedTuple):
    """Errors of S starts at every origin, lead and output, and their exact derivatives by each of p parameters."""

    errors: np.ndarray  # (S, O, L, o); 0 where nothing was measured, or after the last row
    derrors: np.ndarray  # (S, O, L, o, p)


@compiled
def output_powers(A, dA, C, powers):
    """``C A^h`` (L, o, n) at increasing powers h >= 0, and its derivatives (L, o, n, p); ``C`` (o, n) has none."""
    (o, n), p, L = C.shape, dA.shape[2], len(powers)
    rows, drows = np.empty((L, o, n)), np.empty((L, o, n, p))
    row, drow, new, dnew = C.copy(), np.zeros((o, n, p)), np.empty((o, n)), np.empty((o, n, p))
    at = 0
    for h in range(powers[-1] + 1):
        if h == powers[at]:
            for j in range(o):
                store_row(row[j], drow[j], rows[at], drows[at], j)
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
def lead_rows(F, dF, node, leads):
    """Rows ``c F^h`` (L, m) at increasing leads h, where c measures state ``node``, and their derivatives (L, m, p)."""
    c = np.zeros((1, F.shape[0]))
    c[0, node] = 1.0
    rows, drows = output_powers(F, dF, c, leads)
    return rows[:, 0].copy(), drows[:, 0].copy()


@compiled
def _add_forecasts(simulated, dsimulated, known, dknown, rows, drows, y, origins, leads, errors, derrors):
    """Write the errors of one start's forecasts: those of the simulation, less the part ``known`` at the origin.

    ``simulated`` (N, o) are errors of the simulation, ``known`` (O, n) differences of the states after each origin.
    """
    N, o = y.shape
    n, p = dknown.shape[1:]
    for a in range(len(origins)):
        for h in range(len(leads)):
            k = origins[a] + leads[h]
            if k >= N:
                break
            for j in range(o):
                if np.isnan(y[k, j]):
                    continue
                e = simulated[k, j]
                for q in range(p):
                    derrors[a, h, j, q] = dsimulated[k, j, q]
                for i in range(n):
                    x, c = known[a, i], rows[h, j, i]
                    e -= c * x
                    for q in range(p):
                        derrors[a, h, j, q] -= c * dknown[a, i, q] + drows[h, j, i, q] * x
                errors[a, h, j] = e


@compiled
def multi_step_sensitivities(model, inputs, y, n_filtered, exact, origins, leads):
    """Errors of forecasts at increasing ``origins`` and ``leads`` >= 1, and their exact derivatives, for S starts.

    Model, inputs, measurements and ``n_filtered`` are as in :func:`one_step_sensitivities`; ``exact`` makes the
    constant gain the exact one after missing rows, as ``with_variances`` does there.
    """
    (S, n, p), (N, o) = model.ds0.shape, y.shape
    n_origins, L, n_variances = len(origins), len(leads), N if exact else 0
    errors, derrors = np.zeros((S, n_origins, L, o)), np.zeros((S, n_origins, L, o, p))
    simulated, dsimulated = np.empty((N, o)), np.empty((N, o, p))
    innovations, dinnovations = np.empty((N, o)), np.empty((N, o, p))
    variances, dvariances = np.empty((n_variances, o)), np.empty((n_variances, o, p))
    start, dstart = np.empty((n_origins, n)), np.empty((n_origins, n, p))
    known, dknown = np.empty((n_origins, n)), np.empty((n_origins, n, p))
    no_gain, dno_gain = np.zeros((n, o)), np.zeros((n, o, p))
    for b in range(S):
        for values in (simulated, innovations):  # a row without a measurement keeps its 0
            values[:] = 0.0
        for slopes in (dsimulated, dinnovations, dvariances):
            slopes[:] = 0.0
        simulation = one_start(model, b, no_gain, dno_gain)
        out = (simulated, dsimulated, variances, dvariances)
        run_predictor(simulation, inputs, y, 0, False, *out, origins, start, dstart)
        predictor = one_start(model, b, model.K[b], model.dK[b])
        out = (innovations, dinnovations, variances, dvariances)
        run_predictor(predictor, inputs, y, n_filtered, exact, *out, origins, known, dknown)
        known -= start
        dknown -= dstart
        rows, drows = output_powers(model.A[b], model.dA[b], model.C, leads - 1)
        _add_forecasts(simulated, dsimulated, known, dknown, rows, drows, y, origins, leads, errors[b], derrors[b])
    return LeadErrors(errors, derrors)
