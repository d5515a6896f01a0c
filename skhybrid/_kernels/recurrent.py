"""An epoch of an RNN or LSTM (paper Eqs. RNN and LSTM) in one call, its gradient written out.

Step k reads a column for every layer: of the lowest the disturbance before k and the features of row k, of another what
the layer below has just put out; then the layer's own state.  Windows lie last in memory, so that every row of a column
and every gate is one run of numbers, and go through in blocks that stay in the cache.  The weights of a network are one
row of numbers, read where they lie.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ._compile import compiled_elements
from .dense import AdamStep, activate, adam_step, count_known, matrix
from .gates import lstm_backward, lstm_forward, rnn_backward, rnn_forward

_ZERO = np.float32(0.0)
#: windows of a block, and of a last one that has no more than the smaller.
_BLOCK, _SMALL_BLOCK = 64, 32


class RecurrentWindows(NamedTuple):
    """Windows that a network reads, and what it is to say of them; rows in any order."""

    zeta: ndarray  # (n_windows, n_past + 1): disturbance up to the origin
    past: ndarray  # (n_windows, n_columns, n_past)
    future: ndarray  # (n_windows, n_columns, n_leads)
    base: ndarray  # (n_windows, n_leads): forecast that is corrected
    target: ndarray  # (n_windows, n_leads), 0 where unknown
    known: ndarray  # (n_windows, n_leads): 1 where the target is known, else 0


class RecurrentShape(NamedTuple):
    """A network: where its layers lie in its row of weights, and what they are."""

    places: ndarray  # int, (n_layers + 2, 4), as those of DenseShape; the head's two stand last
    n_gates: int  # 1 an RNN, 4 an LSTM
    kind: int  # activation of the head
    share: float  # dropout
    reads_zeta: bool


class _Room(NamedTuple):
    """What a block keeps from forward to back; ``columns`` of the lowest layer apart, for it has other rows."""

    lowest: ndarray  # (n_steps + 1, n_inputs + n, n_block)
    columns: ndarray  # (n_layers - 1, n_steps + 1, 2 n, n_block)
    gates: ndarray  # (n_layers, n_steps, n_gates n, n_block)
    c: ndarray  # (n_layers, n_steps + 1, n, n_block), LSTM
    tanh_c: ndarray  # (n_layers, n_steps, n, n_block), LSTM
    slopes: ndarray  # (n_leads, n, n_block), of the head
    hidden: ndarray  # (n_leads, n, n_block)
    outputs: ndarray  # (n_leads, n_block)


@compiled_elements
def _make_room(shape: RecurrentShape, n_past: int, n_leads: int, n_block: int) -> _Room:
    n_layers, n_steps, n = len(shape.places) - 2, n_past + n_leads, shape.places[-1, 1]
    n_kept = n_layers if shape.n_gates == 4 else 0
    return _Room(
        np.zeros((n_steps + 1, shape.places[0, 1], n_block), dtype=np.float32),
        np.zeros((n_layers - 1, n_steps + 1, 2 * n, n_block), dtype=np.float32),
        np.empty((n_layers, n_steps, shape.n_gates * n, n_block), dtype=np.float32),
        np.zeros((n_kept, n_steps + 1, n, n_block), dtype=np.float32),
        np.empty((n_kept, n_steps, n, n_block), dtype=np.float32),
        np.empty((n_leads, n, n_block), dtype=np.float32),
        np.empty((n_leads, n, n_block), dtype=np.float32),
        np.empty((n_leads, n_block), dtype=np.float32),
    )


@compiled_elements
def _load(windows: RecurrentWindows, rows: ndarray, shape: RecurrentShape, room: _Room) -> None:
    """Lay out the inputs of the lowest layer; a block that is not full repeats its first window."""
    n_past, n_columns = windows.past.shape[2], windows.past.shape[1]
    n_steps, first = len(room.lowest) - 1, int(shape.reads_zeta)
    for i in range(room.lowest.shape[2]):
        w = rows[i] if i < len(rows) else rows[0]
        if shape.reads_zeta:
            for s in range(n_past + 1):
                room.lowest[s, 0, i] = windows.zeta[w, s]
        for k in range(n_columns):
            for s in range(n_past):
                room.lowest[s, first + k, i] = windows.past[w, k, s]
            for s in range(n_past, n_steps):
                room.lowest[s, first + k, i] = windows.future[w, k, s - n_past]


@compiled_elements
def _last_rows(column: ndarray, n: int) -> ndarray:
    """The last ``n`` rows, as one run of memory."""
    first = (column.shape[0] - n) * column.shape[1]
    return column.reshape(column.size)[first:].reshape(n, column.shape[1])


@compiled_elements
def _drop(share: float, drawn: ndarray, first: int, n_live: int, slope: ndarray, out: ndarray) -> None:
    """Dropout: what is drawn below ``share`` becomes 0, the rest is rescaled; windows lie last."""
    keep, least = np.float32(1.0 / (1.0 - share)), np.float32(share)
    for r in range(len(out)):
        draws, value, d = drawn[r], out[r], slope[r]
        for i in range(n_live):
            factor = keep if draws[first + i] >= least else _ZERO
            value[i] *= factor
            d[i] *= factor


@compiled_elements
def _forward(
    row: ndarray, shape: RecurrentShape, windows: RecurrentWindows, rows: ndarray, drawn: ndarray, first: int,
    room: _Room,
) -> None:  # fmt: skip
    """Run the past, then the horizon, over which the network's own outputs stand in for ``zeta``."""
    n_layers, n = len(shape.places) - 2, shape.places[-1, 1]
    n_past, n_steps, n_block = windows.past.shape[2], len(room.lowest) - 1, room.lowest.shape[2]
    none = np.zeros(n_block, dtype=np.float32)
    hidden_at, _, _, hidden_bias = shape.places[n_layers]
    out_at, _, n_out, out_bias = shape.places[n_layers + 1]
    out_weight = matrix(row, out_at, n, n_out)[:, 0].copy()
    for s in range(n_steps):
        after = room.lowest[s + 1]
        for k in range(n_layers):
            at, n_in, n_all, bias_at = shape.places[k]
            column, gates, bias = room.lowest[s], room.gates[k, s], row[bias_at : bias_at + n_all]
            if k:
                column, after = room.columns[k - 1, s], room.columns[k - 1, s + 1]
            np.dot(matrix(row, at, n_in, n_all).T, column, gates)
            if shape.n_gates == 4:
                lstm_forward(gates, bias, room.c[k, s], room.c[k, s + 1], room.tanh_c[k, s], after, n_in - n)
            else:
                rnn_forward(gates, bias, after, n_in - n)
            if k + 1 < n_layers:
                for r in range(n):
                    room.columns[k, s, r] = after[n_in - n + r]
        lead = s - n_past
        if lead < 0:
            continue
        z, value = room.slopes[lead], room.hidden[lead]
        np.dot(matrix(row, hidden_at, n, n).T, _last_rows(after, n), z)
        for r in range(n):
            z[r] += row[hidden_bias + r]
        activate(shape.kind, z, none, value)
        if len(drawn):
            _drop(shape.share, drawn[lead], first, len(rows), z, value)
        forecast = room.outputs[lead]
        np.dot(out_weight, value, forecast)
        for i in range(n_block):
            w = rows[i] if i < len(rows) else rows[0]
            forecast[i] += row[out_bias] + windows.base[w, lead]
        if shape.reads_zeta:
            room.lowest[s + 1, 0] = forecast


@compiled_elements
def _add_outer(column: ndarray, d: ndarray, ones: ndarray, spare: ndarray, gradient: ndarray, place: ndarray) -> None:
    """Add the gradient of a layer's weight and bias, whose inputs were ``column`` and whose outputs have ``d``."""
    at, n_in, n_out, bias_at = place
    product = matrix(spare, 0, n_in, n_out)
    np.dot(column, d.T, product)
    whole = matrix(gradient, at, n_in, n_out)
    for i in range(n_in):
        for j in range(n_out):
            whole[i, j] += product[i, j]
    gradient[bias_at : bias_at + n_out] += np.dot(d, ones)


@compiled_elements
def _backward(row: ndarray, shape: RecurrentShape, d_out: ndarray, room: _Room, gradient: ndarray) -> None:
    """Add the gradient of the weights, from that of the forecasts (n_leads, n_block), last step to first."""
    n_layers, n = len(shape.places) - 2, shape.places[-1, 1]
    n_leads, n_block = d_out.shape
    n_steps, most = len(room.lowest) - 1, max(room.lowest.shape[1], 2 * n)
    n_past = n_steps - n_leads
    dh = np.zeros((n_layers, n, n_block), dtype=np.float32)
    dc, dz = np.zeros_like(dh), np.empty((n, n_block), dtype=np.float32)
    d_gates = np.empty((shape.n_gates * n, n_block), dtype=np.float32)
    d_column, spare = np.empty(most * n_block, dtype=np.float32), np.empty(most * n * 4, dtype=np.float32)
    ones, given = np.ones(n_block, dtype=np.float32), np.empty(n_block, dtype=np.float32)
    of_zeta = np.zeros(n_block, dtype=np.float32)
    hidden_at = shape.places[n_layers, 0]
    out_at, _, n_out, out_bias = shape.places[n_layers + 1]
    for s in range(n_steps - 1, -1, -1):
        lead = s - n_past
        if lead >= 0:
            for i in range(n_block):
                given[i] = d_out[lead, i] + of_zeta[i]
            of_weight = np.dot(room.hidden[lead], given)
            for r in range(n):
                weight = row[out_at + r * n_out]
                gradient[out_at + r * n_out] += of_weight[r]
                for i in range(n_block):
                    dz[r, i] = weight * given[i] * room.slopes[lead, r, i]
            gradient[out_bias] += np.dot(given, ones)
            top = room.columns[n_layers - 2, s + 1] if n_layers > 1 else room.lowest[s + 1]
            _add_outer(_last_rows(top, n), dz, ones, spare, gradient, shape.places[n_layers])
            dh[n_layers - 1] += np.dot(matrix(row, hidden_at, n, n), dz)
        for k in range(n_layers - 1, -1, -1):
            at, n_in, n_all, _ = shape.places[k]
            column = room.columns[k - 1, s] if k else room.lowest[s]
            if shape.n_gates == 4:
                lstm_backward(room.gates[k, s], room.c[k, s], room.tanh_c[k, s], dh[k], dc[k], d_gates)
            else:
                rnn_backward(room.gates[k, s], dh[k], d_gates)
            _add_outer(column, d_gates, ones, spare, gradient, shape.places[k])
            below = matrix(d_column, 0, n_in, n_block)
            np.dot(matrix(row, at, n_in, n_all), d_gates, below)
            for r in range(n):
                dh[k, r] = below[n_in - n + r]
            if k:
                for r in range(n):
                    dh[k - 1, r] += below[r]
        if shape.reads_zeta:
            of_zeta[:] = d_column[:n_block]


@compiled_elements
def _block_of(n_left: int) -> int:
    return _BLOCK if n_left > _SMALL_BLOCK else _SMALL_BLOCK


@compiled_elements
def _errors(windows: RecurrentWindows, rows: ndarray, outputs: ndarray, scale: float, d_out: ndarray) -> float:
    """Sum of squared errors of known targets; ``d_out`` becomes its gradient times ``scale``."""
    total = 0.0
    d_out[:] = _ZERO
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
    """One epoch of one network; arguments and results as those of :func:`~skhybrid._kernels.dense.dense_epoch`.

    ``drawn`` is (n_leads, n, n_windows of the order), empty where nothing drops.
    """
    n_past, n_leads = windows.past.shape[2], windows.future.shape[2]
    large, small = _make_room(shape, n_past, n_leads, _BLOCK), _make_room(shape, n_past, n_leads, _SMALL_BLOCK)
    gradient = np.empty_like(row)
    total, count = 0.0, 0.0
    for batch in range(-(-len(order) // batch_size)):
        rows = order[batch * batch_size : (batch + 1) * batch_size]
        n_known = count_known(windows.known, rows)
        gradient[:] = _ZERO
        start = 0
        while start < len(rows):
            n_block = _block_of(len(rows) - start)
            room, part = large if n_block == _BLOCK else small, rows[start : start + n_block]
            d_out = np.empty((n_leads, n_block), dtype=np.float32)
            _load(windows, part, shape, room)
            _forward(row, shape, windows, part, drawn, batch * batch_size + start, room)
            total += _errors(windows, part, room.outputs, 1.0 / max(n_known, 1.0), d_out)
            _backward(row, shape, d_out, room, gradient)
            start += n_block
        adam_step(row, moments, gradient, adam, adam.n_done + batch)
        count += n_known
    return total, count


@compiled_elements
def recurrent_forecasts(row: ndarray, shape: RecurrentShape, windows: RecurrentWindows, rows: ndarray) -> ndarray:
    """Forecasts (n, n_leads) of the windows ``rows`` (n,); nothing drops."""
    n_past, n_leads = windows.past.shape[2], windows.future.shape[2]
    found = np.empty((len(rows), n_leads), dtype=np.float32)
    nothing = np.empty((0, 0, 0), dtype=np.float32)
    room = _make_room(shape, n_past, n_leads, _block_of(len(rows)))
    start = 0
    while start < len(rows):
        n_block = _block_of(len(rows) - start)
        if n_block != room.lowest.shape[2]:
            room = _make_room(shape, n_past, n_leads, n_block)
        part = rows[start : start + n_block]
        _load(windows, part, shape, room)
        _forward(row, shape, windows, part, nothing, 0, room)
        for i in range(len(part)):
            found[start + i] = room.outputs[:, i]
        start += n_block
    return found
