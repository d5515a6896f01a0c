"""Products of small matrices of float32 that are made over and over with the same weights.

Weights are packed once: six rows are one panel, column by column; what is left over are panels of four, two and one.
Columns, of windows or places, are taken by whole tiles: nobody looks whether memory ends before, so that who calls has
room for it.
"""

from __future__ import annotations

from numpy import ndarray

from ._compile import compiled_elements
from .tiles import COLUMNS, LANES, add_1, add_2, add_4, add_6, set_1, set_2, set_4, set_6, turn_square


@compiled_elements
def round_up(n: int) -> int:
    """The next multiple of the columns of a tile."""
    return -(-n // COLUMNS) * COLUMNS


@compiled_elements
def _rows(n_left: int) -> int:
    """Rows of the next panel."""
    return 6 if n_left >= 6 else 4 if n_left >= 4 else min(n_left, 2)


@compiled_elements
def pack_turned(weight: ndarray, bias: ndarray, panels: ndarray) -> None:
    """Pack the columns of ``weight`` (n_in, n_out) as rows, a number of ``bias`` behind each."""
    n_in, n_out = weight.shape
    n_inner, first = n_in + 1, 0
    while first < n_out:
        n = _rows(n_out - first)
        for k in range(n_inner):
            at = first * n_inner + k * n
            for r in range(n):
                panels[at + r] = weight[k, first + r] if k < n_in else bias[first + r]
        first += n


@compiled_elements
def pack(weight: ndarray, panels: ndarray) -> None:
    """Pack the rows of ``weight``."""
    (n_rows, n_inner), first = weight.shape, 0
    while first < n_rows:
        n = _rows(n_rows - first)
        for r in range(n):
            for k in range(n_inner):
                panels[first * n_inner + k * n + r] = weight[first + r, k]
        first += n


@compiled_elements
def _set_tiles(
    panels: ndarray, n_rows: int, b: ndarray, b_at: int, b_stride: int, n: int, n_groups: int, b_group: int,
    out: ndarray, out_stride: int, n_columns: int,
) -> None:  # fmt: skip
    """``out = A B`` tile by tile; ``A`` is packed, the last tile may write beyond ``n_columns``."""
    first = 0
    while first < n_rows:
        at, n_here = first * n * n_groups, _rows(n_rows - first)
        for j in range(0, n_columns, COLUMNS):
            start, to = b_at + j, first * out_stride + j
            if n_here == 6:
                set_6(panels, at, 0, b, start, b_stride, out, to, out_stride, n, n_groups, b_group)
            elif n_here == 4:
                set_4(panels, at, 0, b, start, b_stride, out, to, out_stride, n, n_groups, b_group)
            elif n_here == 2:
                set_2(panels, at, 0, b, start, b_stride, out, to, out_stride, n, n_groups, b_group)
            else:
                set_1(panels, at, 0, b, start, b_stride, out, to, out_stride, n, n_groups, b_group)
        first += n_here


@compiled_elements
def multiply(panels: ndarray, n_rows: int, x: ndarray, out: ndarray) -> None:
    """``out = A x``: ``A`` (n_rows, n) packed, ``x`` (n, width) of whole tiles, ``out`` the run of (n_rows, width)."""
    n, width = x.shape
    _set_tiles(panels, n_rows, x.reshape(x.size), 0, width, n, 1, 0, out, width, width)


@compiled_elements
def correlate(
    panels: ndarray, n_rows: int, size: int, x: ndarray, first: int, n_places: int, out: ndarray, stride: int
) -> None:
    """``out[r, p] = sum of A[r, c, f] x[c, first + p + f]`` over channels c and the ``size`` numbers f of a filter.

    ``A`` is packed; ``x`` is (n_channels, n), of which so much is read as the last of whole tiles needs; ``out`` is a
    run, from row to row ``stride``.
    """
    n_channels, n = x.shape
    _set_tiles(panels, n_rows, x.reshape(x.size), first, 1, size, n_channels, n, out, stride, n_places)


@compiled_elements
def turn(x: ndarray, slices: ndarray) -> None:
    """Turn ``x`` (n_rows, width) into slices of 16 rows each, one behind the other: (width, 16)."""
    n_rows, width = x.shape
    run = x.reshape(x.size)
    for first in range(0, n_rows, LANES):
        to = first // COLUMNS * COLUMNS * width + first % COLUMNS
        if first + LANES <= n_rows:
            for k in range(0, width, LANES):
                turn_square(run, first * width + k, width, slices, to + k * COLUMNS, COLUMNS)
            continue
        for r in range(first, n_rows):
            for k in range(width):
                slices[to + k * COLUMNS + r - first] = x[r, k]


@compiled_elements
def _add_tiles(
    a: ndarray, a_at: int, a_stride: int, n_rows: int, b: ndarray, b_at: int, b_stride: int, n: int, out: ndarray,
    out_at: int, out_stride: int,
) -> None:  # fmt: skip
    """``out += A B`` for the columns of one tile."""
    first = 0
    while first < n_rows:
        at, to, n_here = a_at + first * a_stride, out_at + first * out_stride, _rows(n_rows - first)
        if n_here == 6:
            add_6(a, at, a_stride, b, b_at, b_stride, out, to, out_stride, n, 1, 0)
        elif n_here == 4:
            add_4(a, at, a_stride, b, b_at, b_stride, out, to, out_stride, n, 1, 0)
        elif n_here == 2:
            add_2(a, at, a_stride, b, b_at, b_stride, out, to, out_stride, n, 1, 0)
        else:
            add_1(a, at, a_stride, b, b_at, b_stride, out, to, out_stride, n, 1, 0)
        first += n_here


@compiled_elements
def add_outer(x: ndarray, slices: ndarray, n_columns: int, out: ndarray) -> None:
    """``out += x d.T``: ``x`` (n_rows, width), ``d`` in slices, and the run of ``out`` (n_rows, rounded n_columns)."""
    n_rows, width = x.shape
    run, stride = x.reshape(x.size), round_up(n_columns)
    for j in range(0, stride, COLUMNS):
        _add_tiles(run, 0, width, n_rows, slices, j * width, COLUMNS, width, out, j, stride)


@compiled_elements
def add_correlation(d: ndarray, first: int, n_places: int, x: ndarray, at: int, size: int, out: ndarray) -> None:
    """``out[r, c, f] += sum of d[r, first + p] x[c, at + p + f]`` over places p.

    Of ``x`` (n_channels, n) so much is read as whole tiles need; ``out`` is a run, ``size`` rounded up.
    """
    (n_rows, d_stride), (n_channels, n), rounded = d.shape, x.shape, round_up(size)
    left, right = d.reshape(d.size), x.reshape(x.size)
    for c in range(n_channels):
        for f in range(0, rounded, COLUMNS):
            to = c * rounded + f
            _add_tiles(left, first, d_stride, n_rows, right, c * n + at + f, 1, n_places, out, to, n_channels * rounded)
