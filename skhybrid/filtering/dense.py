"""An epoch of a network of dense layers (paper Eq. MLP) in one call, its gradient written out.

A step of a small network is some fifty operations of a tensor library, each of which takes longer to call than to
compute.  Here the products of matrices are left to BLAS, and bias, activation, its derivative and dropout are one pass.
Arrays are float32 and contiguous; the weights of a network are one row of numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ._compile import compiled_elements

#: codes of activations, by which a network is told what it has.
ACTIVATIONS = {"relu": 0, "selu": 1, "gelu": 2}

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_SELU_ALPHA, _SELU_SCALE = np.float32(1.6732632423543772), np.float32(1.0507009873554805)
_LOG2_E, _LN2_HIGH, _LN2_LOW = np.float32(1.4426950408889634), np.float32(0.693359375), np.float32(-2.12194440054691e-4)
_E2, _E3, _E4, _E5, _E6, _E7 = (np.float32(1.0 / f) for f in (2, 6, 24, 120, 720, 5040))
_MOVED, _BIAS, _SHIFT = np.float32(1.5 * 2**23), np.int32(127), np.int32(23)
_LEAST = np.float32(-87.0)  # beyond it exp is 0 in what follows
_SQRT_HALF, _DENSITY = np.float32(0.7071067811865476), np.float32(0.3989422804014327)
_NEW, _OLD_SQUARE, _NEW_SQUARE, _EPS = np.float32(0.1), np.float32(0.999), np.float32(0.001), np.float32(1e-8)
# Abramowitz and Stegun, Handbook of Mathematical Functions, 7.1.26: erf to 1.5e-7
_ERF_P = np.float32(0.3275911)
_A1, _A2, _A3, _A4, _A5 = (np.float32(a) for a in (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429))


@compiled_elements
def exp32(x: Any) -> Any:
    """``exp x`` in float32 of ``x <= 0``, without a branch or a call; NaN becomes 1."""
    x = max(x, _LEAST)
    moved = x * _LOG2_E + _MOVED  # so large that what is left of a fraction is rounded off: the last bits count
    n = moved - _MOVED
    r = x - n * _LN2_HIGH - n * _LN2_LOW
    p = ((((((_E7 * r + _E6) * r + _E5) * r + _E4) * r + _E3) * r + _E2) * r + _ONE) * r + _ONE
    return p * np.int32((np.float32(moved).view(np.int32) + _BIAS) << _SHIFT).view(np.float32)


@compiled_elements
def activate(kind: int, z: ndarray, bias: ndarray, out: ndarray) -> None:
    """``out = phi(z + bias)`` and ``z = phi'(z + bias)``, (n_windows, width) each."""
    n, width = z.shape
    for i in range(n):
        row, value = z[i], out[i]
        if kind == 0:
            for j in range(width):
                x = row[j] + bias[j]
                value[j] = max(x, _ZERO)
                row[j] = _ONE if x > _ZERO else _ZERO
        elif kind == 1:
            for j in range(width):
                x = row[j] + bias[j]
                below = _SELU_ALPHA * exp32(min(x, _ZERO))
                value[j] = _SELU_SCALE * (x if x > _ZERO else below - _SELU_ALPHA)
                row[j] = _SELU_SCALE * (_ONE if x > _ZERO else below)
        else:
            for j in range(width):
                x = row[j] + bias[j]
                bell = exp32(-_HALF * x * x)
                t = _ONE / (_ONE + _ERF_P * _SQRT_HALF * abs(x))
                tail = _HALF * bell * (((((_A5 * t + _A4) * t + _A3) * t + _A2) * t + _A1) * t)
                share = _ONE - tail if x > _ZERO else tail
                value[j] = x * share
                row[j] = share + x * _DENSITY * bell


@compiled_elements
def drop(share: float, uniform: ndarray, first: int, slope: ndarray, out: ndarray) -> None:
    """Dropout: what is drawn below ``share``, in the rows from ``first`` on, becomes 0; the rest is rescaled."""
    keep = np.float32(1.0 / (1.0 - share))
    least = np.float32(share)
    n, width = out.shape
    for i in range(n):
        drawn, value, d = uniform[first + i], out[i], slope[i]
        for j in range(width):
            factor = keep if drawn[j] >= least else _ZERO
            value[j] *= factor
            d[j] *= factor


class DenseWindows(NamedTuple):
    """Windows that a network reads, and what it is to say of them; rows in any order."""

    psi: ndarray  # (n_windows, n_inputs)
    base: ndarray  # (n_windows, n_leads): forecast that is corrected
    target: ndarray  # (n_windows, n_leads), 0 where unknown
    known: ndarray  # (n_windows, n_leads): 1 where the target is known, else 0


class DenseShape(NamedTuple):
    """A network: where its layers lie in its row of weights, its activation and its dropout."""

    places: ndarray  # int, (n_layers + 1, 4): where a weight begins, its inputs and outputs, where its bias begins
    kind: int
    share: float


class AdamStep(NamedTuple):
    """Adam as torch documents it (its default betas and eps), and the norm to which gradients are clipped."""

    learning_rate: float
    n_done: int  # steps before these
    max_norm: float


@compiled_elements
def matrix(numbers: ndarray, at: int, n_rows: int, n_columns: int) -> ndarray:
    """Numbers from ``at`` on as a matrix."""
    return numbers[at : at + n_rows * n_columns].reshape(n_rows, n_columns)


@compiled_elements
def dense_forward(
    row: ndarray, shape: DenseShape, psi: ndarray, drawn: ndarray, first: int, slopes: ndarray, hidden: ndarray,
    out: ndarray,
) -> None:  # fmt: skip
    """``W_xi h + b_xi``; derivatives and values of hidden layers are kept, dropout included."""
    places, n_layers = shape.places, len(shape.places) - 1
    n, width = len(psi), places[0, 2]
    h = psi
    for k in range(n_layers):
        at, n_in, n_out, bias_at = places[k]
        slope, value = matrix(slopes[k], 0, n, width), matrix(hidden[k], 0, n, width)
        np.dot(h, matrix(row, at, n_in, n_out), slope)
        activate(shape.kind, slope, row[bias_at : bias_at + n_out], value)
        if len(drawn):
            drop(shape.share, drawn[k], first, slope, value)
        h = value
    at, n_in, n_out, bias_at = places[n_layers]
    np.dot(h, matrix(row, at, n_in, n_out), out)
    for i in range(n):
        for j in range(n_out):
            out[i, j] += row[bias_at + j]


@compiled_elements
def dense_backward(
    row: ndarray, shape: DenseShape, psi: ndarray, slopes: ndarray, hidden: ndarray, d_out: ndarray, spare: ndarray,
    gradient: ndarray,
) -> ndarray:  # fmt: skip
    """The gradient of the weights from that of the outputs; filling is left alone.

    Returned is that of the lowest layer before its activation.
    """
    places, n_layers = shape.places, len(shape.places) - 1
    n, width, d = len(psi), places[0, 2], d_out
    for k in range(n_layers, -1, -1):
        at, n_in, n_out, bias_at = places[k]
        below = matrix(hidden[k - 1], 0, n, width) if k else psi
        np.dot(below.T, d, matrix(gradient, at, n_in, n_out))
        gradient[bias_at : bias_at + n_out] = _ZERO
        for i in range(n):
            for j in range(n_out):
                gradient[bias_at + j] += d[i, j]
        if k:
            carried, slope = matrix(spare[k % 2], 0, n, width), matrix(slopes[k - 1], 0, n, width)
            np.dot(d, matrix(row, at, n_in, n_out).T, carried)
            for i in range(n):
                for j in range(width):
                    carried[i, j] *= slope[i, j]
            d = carried
    return d


@compiled_elements
def adam_step(row: ndarray, moments: tuple[ndarray, ndarray], gradient: ndarray, adam: AdamStep, n_done: int) -> None:
    """A step down the clipped gradient."""
    norm = np.sqrt(np.dot(gradient, gradient))
    clip = np.float32(min(adam.max_norm / (norm + 1e-6), 1.0))
    t = n_done + 1
    step = np.float32(adam.learning_rate / (1.0 - 0.9**t))
    scale = np.float32(1.0 / np.sqrt(1.0 - 0.999**t))
    first, second = moments
    for i in range(len(row)):
        g = clip * gradient[i]
        m = first[i] + _NEW * (g - first[i])
        v = second[i] * _OLD_SQUARE + _NEW_SQUARE * (g * g)
        first[i], second[i] = m, v
        row[i] -= step * m / (np.sqrt(v) * scale + _EPS)


@compiled_elements
def gather(windows: DenseWindows, rows: ndarray, room: DenseWindows) -> None:
    """Copy windows into ``room``."""
    for i in range(len(rows)):
        w = rows[i]
        room.psi[i], room.base[i] = windows.psi[w], windows.base[w]
        room.target[i], room.known[i] = windows.target[w], windows.known[w]


@compiled_elements
def make_windows(n: int, windows: DenseWindows) -> DenseWindows:
    """Room for ``n`` windows."""
    n_leads = windows.target.shape[1]
    psi = np.empty((n, windows.psi.shape[1]), dtype=np.float32)
    base, target, known = (
        np.empty((n, n_leads), dtype=np.float32),
        np.empty((n, n_leads), dtype=np.float32),
        np.empty((n, n_leads), dtype=np.float32),
    )
    return DenseWindows(psi, base, target, known)


@compiled_elements
def count_known(known: ndarray, rows: ndarray) -> float:
    """How many targets of the windows ``rows`` are known."""
    count = 0.0
    for w in rows:
        for lead in range(known.shape[1]):
            count += known[w, lead]
    return count


@compiled_elements
def square_errors(batch: DenseWindows, out: ndarray, n_known: float, d_out: ndarray) -> float:
    """Sum of squared errors of known targets; ``d_out`` becomes the gradient of their mean over ``n_known``."""
    n, n_leads = batch.target.shape
    total = 0.0
    scale = np.float32(2.0 / max(n_known, 1.0))
    for i in range(n):
        for j in range(n_leads):
            e = (batch.base[i, j] + out[i, j] - batch.target[i, j]) * batch.known[i, j]
            d_out[i, j] = scale * e
            total += e * e
    return total


@compiled_elements
def dense_epoch(
    row: ndarray, moments: tuple[ndarray, ndarray], shape: DenseShape, windows: DenseWindows, order: ndarray,
    drawn: ndarray, batch_size: int, adam: AdamStep,
) -> tuple[float, float]:  # fmt: skip
    """One epoch of one network.

    Parameters
    ----------
    row : ndarray of shape (n_weights,)
        Its weights, which are changed.
    moments : (ndarray, ndarray), each of shape (n_weights,)
        Adam's, which are changed.
    shape : DenseShape
        The network.
    windows : DenseWindows
        The table.
    order : ndarray of int, shape (n,)
        Windows in the order in which batches take them.
    drawn : ndarray of shape (n_layers, n, width) or (0, 0, 0)
        Uniform draws on [0, 1), of which those below ``shape.share`` drop their number; empty: nothing drops.
    batch_size : int
        Windows of a batch.
    adam : AdamStep
        Its settings.

    Returns
    -------
    total, count : float
        Sum of squared errors of the known targets, each before its batch's step, and their number.
    """
    n, n_layers, width = len(order), len(shape.places) - 1, shape.places[0, 2]
    most = min(batch_size, n)
    slopes = np.empty((n_layers, most * width), dtype=np.float32)
    hidden, spare = np.empty_like(slopes), np.empty((2, most * width), dtype=np.float32)
    gradient = np.zeros_like(row)
    total, count, n_done = 0.0, 0.0, adam.n_done
    room = make_windows(most, windows)
    for start in range(0, n, most):
        rows = order[start : start + most]
        if len(rows) < most:
            room = make_windows(len(rows), windows)
        gather(windows, rows, room)
        out = np.empty((len(rows), shape.places[n_layers, 2]), dtype=np.float32)
        d_out = np.zeros_like(out)
        dense_forward(row, shape, room.psi, drawn, start, slopes, hidden, out)
        n_known = count_known(windows.known, rows)
        total += square_errors(room, out, n_known, d_out)
        count += n_known
        dense_backward(row, shape, room.psi, slopes, hidden, d_out, spare, gradient)
        adam_step(row, moments, gradient, adam, n_done)
        n_done += 1
    return total, count


@compiled_elements
def dense_forecasts(row: ndarray, shape: DenseShape, windows: DenseWindows, rows: ndarray) -> ndarray:
    """Forecasts (n, n_leads) of the windows ``rows`` (n,); nothing drops."""
    n, n_layers, width = len(rows), len(shape.places) - 1, shape.places[0, 2]
    slopes = np.empty((n_layers, n * width), dtype=np.float32)
    room = make_windows(n, windows)
    gather(windows, rows, room)
    out = np.empty((n, shape.places[n_layers, 2]), dtype=np.float32)
    dense_forward(row, shape, room.psi, np.empty((0, 0, 0), dtype=np.float32), 0, slopes, np.empty_like(slopes), out)
    return room.base + out[:, : room.base.shape[1]]
