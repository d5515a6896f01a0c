"""An epoch of an RNN or LSTM (paper Eqs. RNN and LSTM) in one call, its gradient written out.

Step k reads a column for every layer: of the lowest the disturbance before k and the features of row k, of another what
the layer below has just put out; then the layer's own state, and a 1 that the bias is multiplied with.  Windows lie
last in memory, so that every gate is one run of numbers, and go through in blocks of as many whole tiles as it takes;
what is left over of the last tile is zeros, which no error reaches.  The weights of a network are one row of numbers;
products read them packed anew for every batch, forward with the bias beside them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ._compile import compiled_elements
from .dense import AdamStep, activate, adam_step, count_known, matrix
from .gates import lstm_backward, lstm_forward, rnn_backward, rnn_forward
from .products import add_outer, multiply, pack, pack_turned, round_up, turn

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
#: windows of a block; the last one of a batch may have fewer.  Twice as many would need more than the cache for an LSTM
#: of 4 x 60, and take as long.  A multiple of a tile's columns.
_BLOCK = 64


class RecurrentWindows(NamedTuple):
    """Windows that a network reads, and what it is to say of them; rows in any order."""

    zeta: ndarray  # (n_windows, n_past + 1): disturbance up to the origin
    past: ndarray  # (n_windows, n_columns, n_past)
    future: ndarray  # (n_windows, n_columns, n_leads)
    base: ndarray  # (n_windows, n_leads): forecast that is corrected
    target: ndarray  # (n_windows, n_leads), 0 where unknown
    known: ndarray  # (n_windows, n_leads): 1 where the target is known, else 0
    room: ndarray  # numbers to work in, as many as recurrent_room says, or none: each call takes its own


class RecurrentShape(NamedTuple):
    """A network: where its layers lie in its row of weights, and what they are."""

    places: ndarray  # int, (n_layers + 2, 4), as those of DenseShape; the head's two stand last
    n_gates: int  # 1 an RNN, 4 an LSTM
    kind: int  # activation of the head
    share: float  # dropout
    reads_zeta: bool


class _Weights(NamedTuple):
    """The weights of cells and of the head's hidden layer as a batch reads them, and room for their gradient."""

    begins: ndarray  # int, (n_layers + 1,): where a layer begins in ``forward``
    forward: ndarray  # (n_out, n_in + 1) a layer, packed: the bias is the last column
    backward: ndarray  # (n_in, n_out) a layer, packed; of the lowest the rows of its state only
    at_gradient: ndarray  # int, (n_layers + 1,): where a layer begins in ``gradient``
    gradient: ndarray  # (n_in + 1, n_out) a layer, its rows rounded up to a multiple of a tile's columns
    slices: ndarray  # what a gradient is turned into


class _Room(NamedTuple):
    """What a block keeps from forward to back; ``columns`` of the lowest layer apart, for it has other rows."""

    lowest: ndarray  # (n_steps + 1, n_inputs + n + 1, n_block)
    columns: ndarray  # (n_layers - 1, n_steps + 1, 2 n + 1, n_block)
    gates: ndarray  # (n_layers, n_steps, n_gates n n_block)
    c: ndarray  # (n_layers, n_steps + 1, n n_block), LSTM
    tanh_c: ndarray  # (n_layers, n_steps, n n_block), LSTM
    slopes: ndarray  # (n_leads, n, n_block), of the head
    hidden: ndarray  # (n_leads, n, n_block)
    outputs: ndarray  # (n_leads, n_block)


@compiled_elements
def _make_weights(places: ndarray) -> _Weights:
    n = len(places) - 1
    begins, at_gradient = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    n_weights, n_gradient, widest = 0, 0, 0
    for k in range(n):
        n_inner, n_out = places[k, 1] + 1, places[k, 2]
        begins[k], at_gradient[k] = n_weights, n_gradient
        n_weights, n_gradient = n_weights + n_inner * n_out, n_gradient + n_inner * round_up(n_out)
        widest = max(widest, round_up(n_out))
    forward, backward = np.empty(n_weights, dtype=np.float32), np.empty(n_weights, dtype=np.float32)
    gradient, slices = np.empty(n_gradient, dtype=np.float32), np.zeros(widest * _BLOCK, dtype=np.float32)
    return _Weights(begins, forward, backward, at_gradient, gradient, slices)


@compiled_elements
def _pack(row: ndarray, places: ndarray, weights: _Weights) -> None:
    """Copy the weights of a batch, and begin their gradient at 0."""
    weights.gradient[:] = _ZERO
    n = places[-1, 1]
    for k in range(len(places) - 1):
        at, n_in, n_out, bias_at = places[k]
        weight = matrix(row, at, n_in, n_out)
        pack_turned(weight, row[bias_at : bias_at + n_out], weights.forward[weights.begins[k] :])
        pack(weight if k else weight[n_in - n :], weights.backward[weights.begins[k] :])


@compiled_elements
def _put_back(weights: _Weights, places: ndarray, gradient: ndarray) -> None:
    """The gradients of weights and biases go where these lie."""
    for k in range(len(places) - 1):
        at, n_in, n_out, bias_at = places[k]
        found = matrix(weights.gradient, weights.at_gradient[k], n_in + 1, round_up(n_out))
        for i in range(n_in):
            gradient[at + i * n_out : at + (i + 1) * n_out] = found[i, :n_out]
        gradient[bias_at : bias_at + n_out] = found[n_in, :n_out]


@compiled_elements
def _add_gradient(column: ndarray, d: ndarray, weights: _Weights, layer: int) -> None:
    """Add the gradient of a layer's weight and bias, whose inputs were ``column`` and whose outputs have ``d``."""
    turn(d, weights.slices)
    add_outer(column, weights.slices, len(d), weights.gradient[weights.at_gradient[layer] :])


@compiled_elements
def recurrent_room(shape: RecurrentShape, n_past: int, n_leads: int) -> int:
    """Of how many numbers the memory is that a block of windows needs.

    Fresh memory for every epoch would take the system as long to hand out as a small network takes to compute.
    """
    n_layers, n_steps, n = len(shape.places) - 2, n_past + n_leads, shape.places[-1, 1]
    n_kept = n_layers if shape.n_gates == 4 else 0
    n_rows = (n_steps + 1) * (shape.places[0, 1] + 1 + (n_layers - 1) * (2 * n + 1) + n_kept * n)
    return _BLOCK * (n_rows + n_steps * n * (n_layers * shape.n_gates + n_kept) + n_leads * (2 * n + 1))


@compiled_elements
def _cut(numbers: ndarray, at: int, n: int) -> tuple[ndarray, int]:
    """So many numbers from ``at`` on, and where they end."""
    return numbers[at : at + n], at + n


@compiled_elements
def _make_room(shape: RecurrentShape, windows: RecurrentWindows, n_block: int) -> _Room:
    """Lay out what a block needs; the states before the first step are 0."""
    n_past, n_leads = windows.past.shape[2], windows.future.shape[2]
    n_layers, n_steps, n = len(shape.places) - 2, n_past + n_leads, shape.places[-1, 1]
    n_kept, n_run, n_rows = n_layers if shape.n_gates == 4 else 0, n * n_block, shape.places[0, 1] + 1
    size = recurrent_room(shape, n_past, n_leads)
    numbers = windows.room if len(windows.room) >= size else np.empty(size, dtype=np.float32)
    lowest, at = _cut(numbers, 0, (n_steps + 1) * n_rows * n_block)
    columns, at = _cut(numbers, at, (n_layers - 1) * (n_steps + 1) * (2 * n + 1) * n_block)
    gates, at = _cut(numbers, at, n_layers * n_steps * shape.n_gates * n_run)
    c, at = _cut(numbers, at, n_kept * (n_steps + 1) * n_run)
    tanh_c, at = _cut(numbers, at, n_kept * n_steps * n_run)
    slopes, at = _cut(numbers, at, n_leads * n_run)
    hidden, at = _cut(numbers, at, n_leads * n_run)
    outputs, at = _cut(numbers, at, n_leads * n_block)
    room = _Room(
        lowest.reshape(n_steps + 1, n_rows, n_block),
        columns.reshape(n_layers - 1, n_steps + 1, 2 * n + 1, n_block),
        gates.reshape(n_layers, n_steps, shape.n_gates * n_run),
        c.reshape(n_kept, n_steps + 1, n_run),
        tanh_c.reshape(n_kept, n_steps, n_run),
        slopes.reshape(n_leads, n, n_block),
        hidden.reshape(n_leads, n, n_block),
        outputs.reshape(n_leads, n_block),
    )
    room.lowest[0], room.lowest[:, -1] = _ZERO, _ONE
    for k in range(n_layers - 1):
        room.columns[k, 0], room.columns[k, :, -1] = _ZERO, _ONE
    for k in range(n_kept):
        room.c[k, 0] = _ZERO
    return room


@compiled_elements
def _load(windows: RecurrentWindows, rows: ndarray, shape: RecurrentShape, room: _Room) -> None:
    """Lay out the inputs of the lowest layer."""
    n_past, n_columns = windows.past.shape[2], windows.past.shape[1]
    n_steps, first = len(room.lowest) - 1, int(shape.reads_zeta)
    room.lowest[:, : first + n_columns, len(rows) :] = _ZERO
    for i in range(len(rows)):
        w = rows[i]
        if shape.reads_zeta:
            for s in range(n_past + 1):
                room.lowest[s, 0, i] = windows.zeta[w, s]
        for k in range(n_columns):
            for s in range(n_past):
                room.lowest[s, first + k, i] = windows.past[w, k, s]
            for s in range(n_past, n_steps):
                room.lowest[s, first + k, i] = windows.future[w, k, s - n_past]


@compiled_elements
def _run(column: ndarray, first: int, n: int) -> ndarray:
    """Rows of a column as one run of memory."""
    width = column.shape[1]
    return column.reshape(column.size)[first * width : (first + n) * width]


@compiled_elements
def _drop(share: float, drawn: ndarray, first: int, slope: ndarray, out: ndarray) -> None:
    """Dropout: what is drawn below ``share`` becomes 0, the rest is rescaled; windows lie last, some drew nothing."""
    keep, least = np.float32(1.0 / (1.0 - share)), np.float32(share)
    for r in range(len(out)):
        draws, value, d = drawn[r], out[r], slope[r]
        for i in range(min(len(value), len(draws) - first)):
            factor = keep if draws[first + i] >= least else _ZERO
            value[i] *= factor
            d[i] *= factor


@compiled_elements
def _forward(
    row: ndarray, weights: _Weights, shape: RecurrentShape, windows: RecurrentWindows, rows: ndarray, drawn: ndarray,
    first: int, room: _Room,
) -> None:  # fmt: skip
    """Run the past, then the horizon, over which the network's own outputs stand in for ``zeta``."""
    n_layers, n = len(shape.places) - 2, shape.places[-1, 1]
    n_past, n_steps = windows.past.shape[2], len(room.lowest) - 1
    for s in range(n_steps):
        after = room.lowest[s + 1]
        for k in range(n_layers):
            n_in, n_all = shape.places[k, 1], shape.places[k, 2]
            column, gates = room.lowest[s], room.gates[k, s]
            if k:
                column, after = room.columns[k - 1, s], room.columns[k - 1, s + 1]
            multiply(weights.forward[weights.begins[k] :], n_all, column, gates)
            h = _run(after, n_in - n, n)
            if shape.n_gates == 4:
                lstm_forward(gates, room.c[k, s], room.c[k, s + 1], room.tanh_c[k, s], h)
            else:
                rnn_forward(gates, h)
            if k + 1 < n_layers:
                _run(room.columns[k, s], 0, n)[:] = h
        lead = s - n_past
        if lead >= 0:
            _head(row, weights, shape, windows, rows, _run(after, len(after) - n - 1, n + 1), drawn, first, lead, room)
            if shape.reads_zeta:
                room.lowest[s + 1, 0] = room.outputs[lead]


@compiled_elements
def _head(
    row: ndarray, weights: _Weights, shape: RecurrentShape, windows: RecurrentWindows, rows: ndarray, state: ndarray,
    drawn: ndarray, first: int, lead: int, room: _Room,
) -> None:  # fmt: skip
    """The forecast of a lead, from the state of the highest layer and a 1."""
    n = shape.places[-1, 1]
    z, value, forecast = room.slopes[lead], room.hidden[lead], room.outputs[lead]
    n_block = len(forecast)
    panels = weights.forward[weights.begins[len(shape.places) - 2] :]
    multiply(panels, n, state.reshape(n + 1, n_block), z.reshape(z.size))
    activate(shape.kind, z, np.zeros(n_block, dtype=np.float32), value)
    if len(drawn):
        _drop(shape.share, drawn[lead], first, z, value)
    at, _, n_out, bias_at = shape.places[-1]
    np.dot(matrix(row, at, n, n_out)[:, 0].copy(), value, forecast)
    for i in range(len(rows)):
        forecast[i] += row[bias_at] + windows.base[rows[i], lead]


@compiled_elements
def _backward(
    row: ndarray, weights: _Weights, shape: RecurrentShape, d_out: ndarray, room: _Room, gradient: ndarray
) -> None:
    """Add the gradient of the weights, from that of the forecasts (n_leads, n_block), last step to first."""
    n_layers, n = len(shape.places) - 2, shape.places[-1, 1]
    n_leads, n_block = d_out.shape
    n_steps, n_run = len(room.lowest) - 1, n * n_block
    n_past = n_steps - n_leads
    # of a layer's inputs: those from below first, its state last
    below = np.zeros((n_layers, 2 * n_run), dtype=np.float32)
    dc, d_top = np.zeros((n_layers, n_run), dtype=np.float32), np.zeros(n_run, dtype=np.float32)
    d_gates, of_zeta = np.empty(shape.n_gates * n_run, dtype=np.float32), np.zeros(n_block, dtype=np.float32)
    for s in range(n_steps - 1, -1, -1):
        lead = s - n_past
        if lead >= 0:
            top = room.columns[n_layers - 2, s + 1] if n_layers > 1 else room.lowest[s + 1]
            _head_backward(row, weights, shape, d_out[lead] + of_zeta, top, lead, room, d_top, gradient)
        else:
            d_top[:] = _ZERO
        for k in range(n_layers - 1, -1, -1):
            at, _, n_all, _ = shape.places[k]
            column, above = room.columns[k - 1, s] if k else room.lowest[s], d_top
            if k + 1 < n_layers:
                above = below[k + 1, :n_run]
            later = below[k, n_run:]
            if shape.n_gates == 4:
                lstm_backward(room.gates[k, s], room.c[k, s], room.tanh_c[k, s], later, above, dc[k], d_gates)
            else:
                rnn_backward(room.gates[k, s], later, above, d_gates)
            d = d_gates.reshape(n_all, n_block)
            _add_gradient(column, d, weights, k)
            panels = weights.backward[weights.begins[k] :]
            if k:
                multiply(panels, 2 * n, d, below[k])
                continue
            multiply(panels, n, d, later)  # nobody asks for the features'
            if shape.reads_zeta and lead > 0:
                np.dot(row[at : at + n_all], d, of_zeta)


@compiled_elements
def _head_backward(
    row: ndarray, weights: _Weights, shape: RecurrentShape, given: ndarray, top: ndarray, lead: int, room: _Room,
    d_top: ndarray, gradient: ndarray,
) -> None:  # fmt: skip
    """Add the gradient of the head from that of a lead's forecast; ``d_top`` becomes that of the highest layer."""
    n, n_block = shape.places[-1, 1], len(given)
    layer, (out_at, _, n_out, out_bias) = len(shape.places) - 2, shape.places[-1]
    of_weight, dz = np.dot(room.hidden[lead], given), np.empty((n, n_block), dtype=np.float32)
    for r in range(n):
        weight = row[out_at + r * n_out]
        gradient[out_at + r * n_out] += of_weight[r]
        slope, d = room.slopes[lead, r], dz[r]
        for i in range(n_block):
            d[i] = weight * given[i] * slope[i]
    gradient[out_bias] += given.sum()
    _add_gradient(_run(top, len(top) - n - 1, n + 1).reshape(n + 1, n_block), dz, weights, layer)
    multiply(weights.backward[weights.begins[layer] :], n, dz, d_top)


@compiled_elements
def _errors(windows: RecurrentWindows, rows: ndarray, outputs: ndarray, scale: float, d_out: ndarray) -> float:
    """Sum of squared errors of known targets; ``d_out`` becomes its gradient times ``scale``."""
    total = 0.0
    for i in range(len(rows)):
        w = rows[i]
        for lead in range(len(outputs)):
            e = (outputs[lead, i] - windows.target[w, lead]) * windows.known[w, lead]
            d_out[lead, i] = np.float32(2.0 * scale) * e
            total += e * e
    return total


@compiled_elements
def recurrent_epoch(
    row: ndarray, moments: tuple[ndarray, ndarray], shape: RecurrentShape, windows: RecurrentWindows, order: ndarray,
    drawn: ndarray, batch_size: int, adam: AdamStep,
) -> tuple[float, float]:  # fmt: skip
    """One epoch of one network; arguments and results as those of :func:`~skhybrid.filtering.dense.dense_epoch`.

    ``drawn`` is (n_leads, n, n_windows of the order), empty where nothing drops.
    """
    weights, gradient = _make_weights(shape.places), np.zeros_like(row)
    room = _make_room(shape, windows, round_up(min(_BLOCK, batch_size, len(order))))
    out_at, n, n_out, out_bias = shape.places[-1]
    total, count = 0.0, 0.0
    for batch in range(-(-len(order) // batch_size)):
        rows = order[batch * batch_size : (batch + 1) * batch_size]
        n_known = count_known(windows.known, rows)
        _pack(row, shape.places, weights)
        gradient[out_at : out_at + n * n_out] = _ZERO
        gradient[out_bias] = _ZERO
        for start in range(0, len(rows), _BLOCK):
            part = rows[start : start + _BLOCK]
            if round_up(len(part)) != room.lowest.shape[2]:
                room = _make_room(shape, windows, round_up(len(part)))
            d_out = np.zeros(room.outputs.shape, dtype=np.float32)
            _load(windows, part, shape, room)
            _forward(row, weights, shape, windows, part, drawn, batch * batch_size + start, room)
            total += _errors(windows, part, room.outputs, 1.0 / max(n_known, 1.0), d_out)
            _backward(row, weights, shape, d_out, room, gradient)
        _put_back(weights, shape.places, gradient)
        adam_step(row, moments, gradient, adam, adam.n_done + batch)
        count += n_known
    return total, count


@compiled_elements
def recurrent_forecasts(row: ndarray, shape: RecurrentShape, windows: RecurrentWindows, rows: ndarray) -> ndarray:
    """Forecasts (n, n_leads) of the windows ``rows`` (n,); nothing drops."""
    n_leads = windows.future.shape[2]
    found = np.empty((len(rows), n_leads), dtype=np.float32)
    nothing = np.empty((0, 0, 0), dtype=np.float32)
    weights = _make_weights(shape.places)
    _pack(row, shape.places, weights)
    room = _make_room(shape, windows, round_up(min(_BLOCK, len(rows))))
    for start in range(0, len(rows), _BLOCK):
        part = rows[start : start + _BLOCK]
        if round_up(len(part)) != room.lowest.shape[2]:
            room = _make_room(shape, windows, round_up(len(part)))
        _load(windows, part, shape, room)
        _forward(row, weights, shape, windows, part, nothing, len(nothing), room)  # a literal 0 would compile it anew
        for i in range(len(part)):
            found[start + i] = room.outputs[:, i]
    return found
