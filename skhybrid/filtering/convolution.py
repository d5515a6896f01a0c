"""An epoch of a CNN (paper Eq. CNN) in one call, its gradient written out.

Windows take turns, so that their channels stay in the cache, and meet in the head, which is a network of dense layers
(:mod:`skhybrid.filtering.dense`).  Channels have zeros before and behind them, as many as a filter and the last whole
tile of places reach (:mod:`skhybrid.filtering.products`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ._compile import compiled_elements
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
from .products import add_correlation, correlate, pack, round_up

_ZERO = np.float32(0.0)
#: windows of a block, which the head reads at once.
_BLOCK = 32


class ConvShape(NamedTuple):
    """A network: its convolutions and its head."""

    places: ndarray  # int, (n_conv, 4): begin of a filter, its numbers, channels out, begin of its bias
    lengths: ndarray  # int, (n_conv, 3): places of the input, of the convolution, and of what is pooled
    filter_size: int
    pool_size: int  # of layers that shorten their input by pooling
    head: DenseShape


class _Room(NamedTuple):
    """What a block keeps from forward to back, by convolution; a row may be longer than needed."""

    inputs: ndarray  # (1, n): of one window, zeros around them
    z: ndarray  # (n_numbers,): of one window, before the pool
    values: ndarray  # (n_conv, n_numbers): by window, channel and place; zeros around those that a convolution reads
    slopes: ndarray  # (n_conv, n_numbers): by window, channel and place, whole tiles
    chosen: ndarray  # int32, (n_conv, n_numbers): where the pool found its greatest
    d: ndarray  # (2, n_numbers): the gradient of one window, by channel and place, whole tiles
    spread: ndarray  # (n_conv, n_numbers): that before the pool, zeros around it
    none: ndarray  # zeros, as many as there are places


class _Filters(NamedTuple):
    """Filters as a batch reads them, and room for their gradient."""

    begins: ndarray  # int, (n_conv,): where a convolution begins in ``forward`` and ``backward``
    forward: ndarray  # (n_channels, n_before x size) a convolution, packed
    backward: ndarray  # (n_before, n_channels x size), each filter from its end, packed
    flipped: ndarray  # the same before it is packed
    at_gradient: ndarray  # int, (n_conv,): where a convolution begins in ``gradient``
    gradient: ndarray  # (n_channels, n_before, size rounded up) a convolution


@compiled_elements
def _with_margins(n_places: int, size: int) -> int:
    """Length of a channel with zeros around it; there is a place more behind a convolution of an even size."""
    return round_up(n_places + 1) + 2 * round_up(size)


@compiled_elements
def _make_room(shape: ConvShape, n_block: int) -> _Room:
    n_conv, size = len(shape.places), shape.filter_size
    in_z, in_values, in_slopes, in_spread, in_d = 1, 1, 1, 1, 1
    for k in range(n_conv):
        n_channels, (n_in, n_places, n_out) = shape.places[k, 2], shape.lengths[k]
        in_z = max(in_z, n_channels * round_up(n_places))
        in_values = max(in_values, n_channels * _with_margins(n_out, size))
        in_slopes = max(in_slopes, n_channels * round_up(n_out))
        in_spread = max(in_spread, n_channels * _with_margins(n_in, size))
        in_d = max(in_d, shape.places[k - 1, 2] * round_up(n_in))
    return _Room(
        np.zeros((1, _with_margins(shape.lengths[0, 0], size)), dtype=np.float32),
        np.empty(in_z, dtype=np.float32),
        np.zeros((n_conv, in_values * n_block), dtype=np.float32),
        np.empty((n_conv, in_slopes * n_block), dtype=np.float32),
        np.empty((n_conv, in_slopes * n_block), dtype=np.int32),
        np.empty((2, in_d), dtype=np.float32),
        np.zeros((n_conv, in_spread), dtype=np.float32),
        np.zeros(in_slopes, dtype=np.float32),
    )


@compiled_elements
def _make_filters(shape: ConvShape) -> _Filters:
    n, size = len(shape.places), shape.filter_size
    begins, at_gradient = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    n_weights, n_gradient, most = 0, 0, 0
    for k in range(n):
        n_here = shape.places[k, 1] * shape.places[k, 2]
        begins[k], at_gradient[k] = n_weights, n_gradient
        n_weights, n_gradient = n_weights + n_here, n_gradient + n_here // size * round_up(size)
        most = max(most, n_here)
    forward, backward = np.empty(n_weights, dtype=np.float32), np.empty(n_weights, dtype=np.float32)
    flipped, gradient = np.empty(most, dtype=np.float32), np.empty(n_gradient, dtype=np.float32)
    return _Filters(begins, forward, backward, flipped, at_gradient, gradient)


@compiled_elements
def _pack(row: ndarray, shape: ConvShape, filters: _Filters) -> None:
    """Copy the filters of a batch, and begin their gradient at 0."""
    filters.gradient[:] = _ZERO
    size = shape.filter_size
    for k in range(len(shape.places)):
        at, n_numbers, n_channels, _ = shape.places[k]
        weight = matrix(row, at, n_channels, n_numbers)
        pack(weight, filters.forward[filters.begins[k] :])
        n_before = n_numbers // size
        flipped = matrix(filters.flipped, 0, n_before, n_channels * size)
        for i in range(n_channels):
            for c in range(n_before):
                for f in range(size):
                    flipped[c, i * size + size - 1 - f] = weight[i, c * size + f]
        pack(flipped, filters.backward[filters.begins[k] :])


@compiled_elements
def _put_back(filters: _Filters, shape: ConvShape, gradient: ndarray) -> None:
    """The gradient of filters goes where these lie."""
    size, rounded = shape.filter_size, round_up(shape.filter_size)
    for k in range(len(shape.places)):
        at, n_numbers, n_channels, _ = shape.places[k]
        for i in range(n_channels * n_numbers // size):
            begin = filters.at_gradient[k] + i * rounded
            gradient[at + i * size : at + (i + 1) * size] = filters.gradient[begin : begin + size]


@compiled_elements
def _pool(z: ndarray, size: int, out: ndarray, chosen: ndarray) -> None:
    """The greatest of each group of places, the first of equals; what is left over at the end is dropped."""
    for c in range(len(z)):
        for p in range(chosen.shape[1]):
            best, value = p * size, z[c, p * size]
            for j in range(p * size + 1, (p + 1) * size):
                larger = z[c, j] > value
                best, value = j if larger else best, z[c, j] if larger else value
            out[c, p], chosen[c, p] = value, best


@compiled_elements
def _value(shape: ConvShape, room: _Room, k: int, w: int) -> tuple[ndarray, int]:
    """What a convolution says of a window, by channel, and the place at which that begins."""
    n_channels, n_out = shape.places[k, 2], shape.lengths[k, 2]
    is_last = k == len(shape.places) - 1
    stride = n_out if is_last else _with_margins(n_out, shape.filter_size)
    value = matrix(room.values[k], w * n_channels * stride, n_channels, stride)
    return value, 0 if is_last else shape.filter_size // 2


@compiled_elements
def _input(shape: ConvShape, psi: ndarray, room: _Room, k: int, w: int) -> ndarray:
    """What a convolution reads of a window, zeros around it."""
    if k:
        return _value(shape, room, k - 1, w)[0]
    first = shape.filter_size // 2
    room.inputs[0, first : first + psi.shape[1]] = psi[w]
    return room.inputs


@compiled_elements
def _forward(row: ndarray, filters: _Filters, shape: ConvShape, psi: ndarray, room: _Room) -> ndarray:
    """What the head reads of a block, (n_windows, n_channels * n_places)."""
    for w in range(len(psi)):
        for k in range(len(shape.places)):
            x, (_, n_places, n_out) = _input(shape, psi, room, k, w), shape.lengths[k]
            n_channels, bias_at = shape.places[k, 2:]
            panels, size, stride = filters.forward[filters.begins[k] :], shape.filter_size, round_up(n_out)
            run = room.slopes[k, w * n_channels * stride : (w + 1) * n_channels * stride]
            slope, (value, first) = run.reshape(n_channels, stride), _value(shape, room, k, w)
            if n_out == n_places:
                correlate(panels, n_channels, size, x, 0, n_places, run, stride)
            else:
                correlate(panels, n_channels, size, x, 0, n_places, room.z, round_up(n_places))
                chosen = matrix(room.chosen[k], w * n_channels * n_out, n_channels, n_out)
                _pool(matrix(room.z, 0, n_channels, round_up(n_places)), shape.pool_size, slope, chosen)
            for c in range(n_channels):
                z = slope[c, :n_out].reshape(1, n_out)
                z[0] += row[bias_at + c]
                activate(shape.head.kind, z, room.none[:n_out], value[c, first : first + n_out].reshape(1, n_out))
    last = len(shape.places) - 1
    return matrix(room.values[last], 0, len(psi), shape.head.places[0, 1])


@compiled_elements
def _spread(shape: ConvShape, room: _Room, k: int, w: int, d: ndarray) -> ndarray:
    """The gradient of a convolution before its pool, zeros around it."""
    n_channels, (n_in, n_places, n_out), size = shape.places[k, 2], shape.lengths[k], shape.filter_size
    spread = matrix(room.spread[k], 0, n_channels, _with_margins(n_in, size))
    chosen = matrix(room.chosen[k], w * n_channels * n_out, n_channels, n_out)
    for c in range(n_channels):
        to = spread[c, size - 1 : size - 1 + n_places]
        if n_out == n_places:
            to[:] = d[c, :n_out]
            continue
        to[:] = _ZERO
        for j in range(n_out):
            to[chosen[c, j]] = d[c, j]
    return spread


@compiled_elements
def _backward(
    filters: _Filters, shape: ConvShape, psi: ndarray, d_flat: ndarray, room: _Room, gradient: ndarray
) -> None:
    """Add the gradient of filters and biases, from that of what the head reads, (n_windows, n_channels * n_places)."""
    last, size = len(shape.places) - 1, shape.filter_size
    for w in range(len(psi)):
        d = matrix(d_flat[w], 0, shape.places[last, 2], shape.lengths[last, 2])
        for k in range(last, -1, -1):
            n_channels, bias_at = shape.places[k, 2:]
            n_in, n_places, n_out = shape.lengths[k]
            slope = matrix(room.slopes[k], w * n_channels * round_up(n_out), n_channels, round_up(n_out))
            for c in range(n_channels):
                total, of_place, factor = _ZERO, d[c], slope[c]
                for j in range(n_out):
                    of_place[j] *= factor[j]
                    total += of_place[j]
                gradient[bias_at + c] += total
            spread, x = _spread(shape, room, k, w, d), _input(shape, psi, room, k, w)
            add_correlation(spread, size - 1, n_places, x, 0, size, filters.gradient[filters.at_gradient[k] :])
            if k:
                panels, d_run, stride = filters.backward[filters.begins[k] :], room.d[k % 2], round_up(n_in)
                correlate(panels, len(x), size, spread, size // 2, n_in, d_run, stride)
                d = matrix(d_run, 0, len(x), stride)


@compiled_elements
def conv_epoch(
    row: ndarray, moments: tuple[ndarray, ndarray], shape: ConvShape, windows: DenseWindows, order: ndarray,
    drawn: ndarray, batch_size: int, adam: AdamStep,
) -> tuple[float, float]:  # fmt: skip
    """One epoch of one network; arguments and results as those of :func:`~skhybrid.filtering.dense.dense_epoch`.

    ``drawn`` is (1, n, width), for the head, or empty.
    """
    room, block = _make_room(shape, _BLOCK), make_windows(_BLOCK, windows)
    n_inputs, width, n_out = shape.head.places[0, 1], shape.head.places[0, 2], shape.head.places[1, 2]
    slopes, hidden = np.empty((1, _BLOCK * width), dtype=np.float32), np.empty((1, _BLOCK * width), dtype=np.float32)
    spare, of_flat = np.empty((2, _BLOCK * width), dtype=np.float32), np.empty(_BLOCK * n_inputs, dtype=np.float32)
    gradient, of_head, filters = np.empty_like(row), np.zeros_like(row), _make_filters(shape)
    head = matrix(row, shape.head.places[0, 0], n_inputs, width)
    total, count = 0.0, 0.0
    for batch in range(-(-len(order) // batch_size)):
        end = min((batch + 1) * batch_size, len(order))
        n_known = count_known(windows.known, order[batch * batch_size : end])
        gradient[:] = _ZERO
        _pack(row, shape, filters)
        for start in range(batch * batch_size, end, _BLOCK):
            n = min(_BLOCK, end - start)
            if n != len(block.psi):
                block = make_windows(n, windows)
            gather(windows, order[start : start + n], block)
            out = np.empty((n, n_out), dtype=np.float32)
            d_out = np.zeros_like(out)
            flat = _forward(row, filters, shape, block.psi, room)
            dense_forward(row, shape.head, flat, drawn, start, slopes, hidden, out)
            total += square_errors(block, out, n_known, d_out)
            d = dense_backward(row, shape.head, flat, slopes, hidden, d_out, spare, of_head)
            for i in range(shape.head.places[0, 0], len(row)):
                gradient[i] += of_head[i]
            d_flat = matrix(of_flat, 0, n, n_inputs)
            np.dot(d, head.T, d_flat)
            _backward(filters, shape, block.psi, d_flat, room, gradient)
        _put_back(filters, shape, gradient)
        adam_step(row, moments, gradient, adam, adam.n_done + batch)
        count += n_known
    return total, count


@compiled_elements
def conv_forecasts(row: ndarray, shape: ConvShape, windows: DenseWindows, rows: ndarray) -> ndarray:
    """Forecasts (n, n_leads) of the windows ``rows`` (n,); nothing drops."""
    n_leads, width = windows.target.shape[1], shape.head.places[0, 2]
    room, nothing = _make_room(shape, _BLOCK), np.empty((0, 0, 0), dtype=np.float32)
    slopes, hidden = np.empty((1, _BLOCK * width), dtype=np.float32), np.empty((1, _BLOCK * width), dtype=np.float32)
    found, filters = np.empty((len(rows), n_leads), dtype=np.float32), _make_filters(shape)
    _pack(row, shape, filters)
    for start in range(0, len(rows), _BLOCK):
        n = min(_BLOCK, len(rows) - start)
        block = make_windows(n, windows)
        gather(windows, rows[start : start + n], block)
        out = np.empty((n, shape.head.places[1, 2]), dtype=np.float32)
        flat = _forward(row, filters, shape, block.psi, room)
        dense_forward(row, shape.head, flat, nothing, len(nothing), slopes, hidden, out)  # 0 would compile it anew
        found[start : start + n] = block.base + out[:, :n_leads]
    return found
