"""Products of small matrices of float32 that are made over and over with the same weights.

Windows stand in columns, and there are a multiple of :data:`~.tiles.COLUMNS` of them.  Weights are packed once: six
rows are one panel, column by column.
"""

from __future__ import annotations

from numpy import ndarray

from ._compile import compiled_elements
from .tiles import (
    COLUMNS,
    ROWS,
    add_1,
    add_2,
    add_3,
    add_4,
    add_5,
    add_6,
    set_1,
    set_2,
    set_3,
    set_4,
    set_5,
    set_6,
    turn_square,
)

#: of the squares that are turned
_SIDE = 8


@compiled_elements
def round_up(n: int) -> int:
    """The next multiple of the columns of a tile."""
    return -(-n // COLUMNS) * COLUMNS


@compiled_elements
def pack_turned(weight: ndarray, bias: ndarray, panels: ndarray) -> None:
    """Pack the columns of ``weight`` (n_in, n_out) as rows, a number of ``bias`` behind each, unless there is none."""
    n_in, n_out = weight.shape
    n_inner = n_in + (len(bias) > 0)
    for first in range(0, n_out, ROWS):
        n = min(ROWS, n_out - first)
        for k in range(n_inner):
            at = first * n_inner + k * n
            for r in range(n):
                panels[at + r] = weight[k, first + r] if k < n_in else bias[first + r]


@compiled_elements
def pack(weight: ndarray, panels: ndarray) -> None:
    """Pack the rows of ``weight``."""
    n_rows, n_inner = weight.shape
    for first in range(0, n_rows, ROWS):
        n = min(ROWS, n_rows - first)
        for r in range(n):
            for k in range(n_inner):
                panels[first * n_inner + k * n + r] = weight[first + r, k]


@compiled_elements
def multiply(panels: ndarray, n_rows: int, x: ndarray, out: ndarray) -> None:
    """``out = A x``: packed ``A`` (n_rows, n), ``x`` (n, width), and the run of ``out`` (n_rows, width)."""
    n, width = x.shape
    run = x.reshape(x.size)
    for first in range(0, n_rows, ROWS):
        at, n_here = first * n, n_rows - first
        for j in range(0, width, COLUMNS):
            to = first * width + j
            if n_here >= 6:
                set_6(panels, at, 0, run, j, width, out, to, width, n)
            elif n_here == 5:
                set_5(panels, at, 0, run, j, width, out, to, width, n)
            elif n_here == 4:
                set_4(panels, at, 0, run, j, width, out, to, width, n)
            elif n_here == 3:
                set_3(panels, at, 0, run, j, width, out, to, width, n)
            elif n_here == 2:
                set_2(panels, at, 0, run, j, width, out, to, width, n)
            else:
                set_1(panels, at, 0, run, j, width, out, to, width, n)


@compiled_elements
def turn(x: ndarray, slices: ndarray) -> None:
    """Turn ``x`` (n_rows, width) into slices of 16 rows each, one behind the other: (width, 16)."""
    n_rows, width = x.shape
    run = x.reshape(x.size)
    for first in range(0, n_rows, _SIDE):
        to = first // COLUMNS * COLUMNS * width + first % COLUMNS
        if first + _SIDE <= n_rows:
            for k in range(0, width, _SIDE):
                turn_square(run, first * width + k, width, slices, to + k * COLUMNS, COLUMNS)
            continue
        for r in range(first, n_rows):
            for k in range(width):
                slices[to + k * COLUMNS + r - first] = x[r, k]


@compiled_elements
def add_outer(x: ndarray, slices: ndarray, n_columns: int, out: ndarray) -> None:
    """``out += x d.T``: ``x`` (n_rows, width), ``d`` in slices, and the run of ``out`` (n_rows, rounded n_columns)."""
    n_rows, width = x.shape
    run, stride = x.reshape(x.size), round_up(n_columns)
    for j in range(0, stride, COLUMNS):
        d = j * width
        for first in range(0, n_rows, ROWS):
            at, to, n_here = first * width, first * stride + j, n_rows - first
            if n_here >= 6:
                add_6(run, at, width, slices, d, COLUMNS, out, to, stride, width)
            elif n_here == 5:
                add_5(run, at, width, slices, d, COLUMNS, out, to, stride, width)
            elif n_here == 4:
                add_4(run, at, width, slices, d, COLUMNS, out, to, stride, width)
            elif n_here == 3:
                add_3(run, at, width, slices, d, COLUMNS, out, to, stride, width)
            elif n_here == 2:
                add_2(run, at, width, slices, d, COLUMNS, out, to, stride, width)
            else:
                add_1(run, at, width, slices, d, COLUMNS, out, to, stride, width)
