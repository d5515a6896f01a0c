"""An epoch of a CNN (paper Eq. CNN) in one call, its gradient written out.

A convolution is a product of matrices once the numbers under each place of the filter stand in a column.  Windows take
turns, so that their columns stay in the cache, and meet in the head, which is a network of dense layers
(:mod:`skhybrid._kernels.dense`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ._compile import compiled_elements, compiled_sums
from .dense import (
    AdamStep,
    DenseShape,
    DenseWindows,
    activate,
    adam_step,
    count_known,
    dense_backward,
    dense_forward,
    gather,
    make_windows,
    matrix,
    square_errors,
)

_ZERO = np.float32(0.0)
#: windows of a block, which the head reads at once.
_BLOCK = 32
#: up to so many rows, loops are quicker than BLAS.
_THIN = 16


class ConvShape(NamedTuple):
    """A network: its convolutions and its head."""

    places: ndarray  # int, (n_conv, 4): begin of a filter, its numbers, channels out, begin of its bias
    lengths: ndarray  # int, (n_conv, 3): places of the input, of the convolution, and of what is pooled
    filter_size: int
    pool_size: int  # of layers that shorten their input by pooling
    head: DenseShape


class _Room(NamedTuple):
    """What a block keeps from forward to back, by convolution; a row may be longer than needed."""

    columns: ndarray  # (n_numbers,): of one window
    d_columns: ndarray  # (n_numbers,)
    z: ndarray  # (n_numbers,): of one window, before the pool, and its gradient
    filters: ndarray  # (n_numbers,): the gradient that one window adds
    values: ndarray  # (n_conv, n_numbers): by window, channel and place
    slopes: ndarray  # (n_conv, n_numbers)
    chosen: ndarray  # int32, (n_conv, n_numbers): where the pool found its greatest
    d: ndarray  # (2, n_numbers): of one window
    none: ndarray  # zeros, as many as there are places


@compiled_elements
def _make_room(shape: ConvShape, n_block: int) -> _Room:
    n_conv, in_columns, in_z, in_values, in_filters = len(shape.places), 1, 1, 1, 1
    for k in range(n_conv):
        n_numbers, n_channels = shape.places[k, 1], shape.places[k, 2]
        in_columns = max(in_columns, n_numbers * shape.lengths[k, 1])
        in_z = max(in_z, n_channels * shape.lengths[k, 1])
        in_values = max(in_values, n_channels * shape.lengths[k, 2])
        in_filters = max(in_filters, n_channels * n_numbers)
    return _Room(
        np.empty(in_columns, dtype=np.float32),
        np.empty(in_columns, dtype=np.float32),
        np.empty(in_z, dtype=np.float32),
        np.empty(in_filters, dtype=np.float32),
        np.empty((n_conv, in_values * n_block), dtype=np.float32),
        np.empty((n_conv, in_values * n_block), dtype=np.float32),
        np.empty((n_conv, in_values * n_block), dtype=np.int32),
        np.empty((2, in_values), dtype=np.float32),
        np.zeros(in_values, dtype=np.float32),
    )


# ---------------------------------------------------------------------------------------------------- thin products
@compiled_elements
def _times(weight: ndarray, x: ndarray, out: ndarray) -> None:
    """``out = weight x``; BLAS is slow where the weight is thin."""
    n_out, n_in = weight.shape
    if n_out > _THIN and n_in > _THIN:
        np.dot(weight, x, out)
        return
    n = x.shape[1]
    for i in range(n_out):
        to = out[i]
        to[:] = _ZERO
        r = 0
        while r + 3 < n_in:
            a, b, c, d = weight[i, r], weight[i, r + 1], weight[i, r + 2], weight[i, r + 3]
            x0, x1, x2, x3 = x[r], x[r + 1], x[r + 2], x[r + 3]
            for j in range(n):
                to[j] += a * x0[j] + b * x1[j] + c * x2[j] + d * x3[j]
            r += 4
        while r < n_in:
            a, x0 = weight[i, r], x[r]
            for j in range(n):
                to[j] += a * x0[j]
            r += 1


@compiled_elements
def _times_turned(weight: ndarray, d: ndarray, out: ndarray) -> None:
    """``out = weight' d``."""
    n_in, n_out = weight.shape
    if n_in > _THIN:
        np.dot(weight.T, d, out)
        return
    for r in range(n_out):
        to = out[r]
        to[:] = _ZERO
        for i in range(n_in):
            a, x = weight[i, r], d[i]
            for j in range(len(to)):
                to[j] += a * x[j]


@compiled_sums
def _add_product(d: ndarray, x: ndarray, spare: ndarray, out: ndarray) -> None:
    """``out += d x'``, (n_out, n_in) of rows of numbers."""
    n_out, n_in = out.shape
    if n_out > _THIN:
        product = matrix(spare, 0, n_out, n_in)
        np.dot(d, x.T, product)
        for i in range(n_out):
            for r in range(n_in):
                out[i, r] += product[i, r]
        return
    n = d.shape[1]
    for i in range(n_out):
        left = d[i]
        for r in range(n_in):
            right, total = x[r], _ZERO
            for j in range(n):
                total += left[j] * right[j]
            out[i, r] += total


# ------------------------------------------------------------------------------------------------------- convolutions
@compiled_elements
def _reach(k: int, padding: int, n_in: int, n_out: int) -> tuple[int, int]:
    """The places of the output at which number ``k`` of the filter lies within the input."""
    return max(0, padding - k), min(n_out, n_in + padding - k)


@compiled_elements
def _unfold(x: ndarray, size: int, columns: ndarray) -> None:
    """The numbers of the channels ``x`` under each place of the filter; 0 beyond the ends."""
    n_in, n_out = x.shape[1], columns.shape[1]
    for r in range(len(columns)):
        source, to, k = x[r // size], columns[r], r % size
        first, last = _reach(k, size // 2, n_in, n_out)
        to[:first] = _ZERO
        for j in range(first, last):
            to[j] = source[j + k - size // 2]
        to[last:] = _ZERO


@compiled_elements
def _fold(columns: ndarray, size: int, x: ndarray) -> None:
    """The gradient of the input from that of its columns."""
    n_in, n_out = x.shape[1], columns.shape[1]
    x[:] = _ZERO
    for r in range(len(columns)):
        source, to, k = columns[r], x[r // size], r % size
        first, last = _reach(k, size // 2, n_in, n_out)
        for j in range(first, last):
            to[j + k - size // 2] += source[j]


@compiled_elements
def _pool(z: ndarray, size: int, out: ndarray, chosen: ndarray) -> None:
    """The greatest of each group of places, the first of equals; what is left over at the end is dropped."""
    for c in range(len(z)):
        for p in range(out.shape[1]):
            best, value = p * size, z[c, p * size]
            for j in range(p * size + 1, (p + 1) * size):
                larger = z[c, j] > value
                best, value = j if larger else best, z[c, j] if larger else value
            out[c, p], chosen[c, p] = value, best


@compiled_elements
def _forward(row: ndarray, shape: ConvShape, psi: ndarray, room: _Room) -> ndarray:
    """What the head reads of a block, (n_windows, n_channels * n_places)."""
    last = len(shape.places) - 1
    for w in range(len(psi)):
        x = psi[w].reshape(1, psi.shape[1])
        for k in range(last + 1):
            at, n_numbers, n_channels, bias_at = shape.places[k]
            n_places, n_out = shape.lengths[k, 1], shape.lengths[k, 2]
            size = n_channels * n_out
            columns, z = matrix(room.columns, 0, n_numbers, n_places), matrix(room.z, 0, n_channels, n_places)
            slope, value = (
                matrix(room.slopes[k], w * size, n_channels, n_out),
                matrix(room.values[k], w * size, n_channels, n_out),
            )
            _unfold(x, shape.filter_size, columns)
            if n_out == n_places:
                _times(matrix(row, at, n_channels, n_numbers), columns, slope)
            else:
                _times(matrix(row, at, n_channels, n_numbers), columns, z)
                _pool(z, shape.pool_size, slope, matrix(room.chosen[k], w * size, n_channels, n_out))
            for c in range(n_channels):
                slope[c] += row[bias_at + c]
            activate(shape.head.kind, slope, room.none[:n_out], value)
            x = value
    return matrix(room.values[last], 0, len(psi), shape.head.places[0, 1])


@compiled_elements
def _backward(row: ndarray, shape: ConvShape, psi: ndarray, d_flat: ndarray, room: _Room, gradient: ndarray) -> None:
    """Add the gradient of the filters, from that of what the head reads, (n_windows, n_channels * n_places)."""
    last = len(shape.places) - 1
    for w in range(len(psi)):
        d = matrix(d_flat[w], 0, shape.places[last, 2], shape.lengths[last, 2])
        for k in range(last, -1, -1):
            at, n_numbers, n_channels, bias_at = shape.places[k]
            n_places, n_out = shape.lengths[k, 1], shape.lengths[k, 2]
            size, dz = n_channels * n_out, d
            slope = matrix(room.slopes[k], w * size, n_channels, n_out)
            for c in range(n_channels):
                total = _ZERO
                for j in range(n_out):
                    d[c, j] *= slope[c, j]
                    total += d[c, j]
                gradient[bias_at + c] += total
            if n_out != n_places:
                dz = matrix(room.z, 0, n_channels, n_places)
                dz[:] = _ZERO
                chosen = matrix(room.chosen[k], w * size, n_channels, n_out)
                for c in range(n_channels):
                    for j in range(n_out):
                        dz[c, chosen[c, j]] = d[c, j]
            x = psi[w].reshape(1, psi.shape[1])
            if k:
                below = shape.places[k - 1, 2] * shape.lengths[k - 1, 2]
                x = matrix(room.values[k - 1], w * below, shape.places[k - 1, 2], shape.lengths[k - 1, 2])
            columns = matrix(room.columns, 0, n_numbers, n_places)
            _unfold(x, shape.filter_size, columns)
            _add_product(dz, columns, room.filters, matrix(gradient, at, n_channels, n_numbers))
            if k:
                d_columns = matrix(room.d_columns, 0, n_numbers, n_places)
                _times_turned(matrix(row, at, n_channels, n_numbers), dz, d_columns)
                d = matrix(room.d[k % 2], 0, len(x), x.shape[1])
                _fold(d_columns, shape.filter_size, d)


@compiled_elements
def conv_epoch(
    row: ndarray, moments: tuple[ndarray, ndarray], shape: ConvShape, windows: DenseWindows, order: ndarray,
    drawn: ndarray, batch_size: int, adam: AdamStep,
) -> tuple[float, float]:  # fmt: skip
    """One epoch of one network; arguments and results as those of :func:`~skhybrid._kernels.dense.dense_epoch`.

    ``drawn`` is (1, n, width), for the head, or empty.
    """
    room, block = _make_room(shape, _BLOCK), make_windows(_BLOCK, windows)
    n_inputs, width, n_out = shape.head.places[0, 1], shape.head.places[0, 2], shape.head.places[1, 2]
    slopes, hidden = np.empty((1, _BLOCK * width), dtype=np.float32), np.empty((1, _BLOCK * width), dtype=np.float32)
    spare, of_flat = np.empty((2, _BLOCK * width), dtype=np.float32), np.empty(_BLOCK * n_inputs, dtype=np.float32)
    gradient, of_head = np.empty_like(row), np.zeros_like(row)
    head = matrix(row, shape.head.places[0, 0], n_inputs, width)
    total, count = 0.0, 0.0
    for batch in range(-(-len(order) // batch_size)):
        end = min((batch + 1) * batch_size, len(order))
        n_known = count_known(windows.known, order[batch * batch_size : end])
        gradient[:] = _ZERO
        for start in range(batch * batch_size, end, _BLOCK):
            n = min(_BLOCK, end - start)
            if n != len(block.psi):
                block = make_windows(n, windows)
            gather(windows, order[start : start + n], block)
            out = np.empty((n, n_out), dtype=np.float32)
            d_out = np.zeros_like(out)
            flat = _forward(row, shape, block.psi, room)
            dense_forward(row, shape.head, flat, drawn, start, slopes, hidden, out)
            total += square_errors(block, out, n_known, d_out)
            d = dense_backward(row, shape.head, flat, slopes, hidden, d_out, spare, of_head)
            for i in range(shape.head.places[0, 0], len(row)):
                gradient[i] += of_head[i]
            d_flat = matrix(of_flat, 0, n, n_inputs)
            np.dot(d, head.T, d_flat)
            _backward(row, shape, block.psi, d_flat, room, gradient)
        adam_step(row, moments, gradient, adam, adam.n_done + batch)
        count += n_known
    return total, count


@compiled_elements
def conv_forecasts(row: ndarray, shape: ConvShape, windows: DenseWindows, rows: ndarray) -> ndarray:
    """Forecasts (n, n_leads) of the windows ``rows`` (n,); nothing drops."""
    n_leads, width = windows.target.shape[1], shape.head.places[0, 2]
    room, nothing = _make_room(shape, _BLOCK), np.empty((0, 0, 0), dtype=np.float32)
    slopes, hidden = np.empty((1, _BLOCK * width), dtype=np.float32), np.empty((1, _BLOCK * width), dtype=np.float32)
    found = np.empty((len(rows), n_leads), dtype=np.float32)
    for start in range(0, len(rows), _BLOCK):
        n = min(_BLOCK, len(rows) - start)
        block = make_windows(n, windows)
        gather(windows, rows[start : start + n], block)
        out = np.empty((n, shape.head.places[1, 2]), dtype=np.float32)
        dense_forward(row, shape.head, _forward(row, shape, block.psi, room), nothing, 0, slopes, hidden, out)
        found[start : start + n] = block.base + out[:, :n_leads]
    return found
