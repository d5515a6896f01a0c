"""Tiles of a product of small matrices, in the processor's registers.

A library's product lays both factors out anew in every call, which takes two fifths of the time of multiplying where
matrices have a hundred rows.  Here they lie ready, and a tile of up to 6 x 16 results stays in registers while the
factors go by.  Numba has no type for such a vector; these few instructions are written for its compiler directly.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

#: columns of a tile: with six rows twelve sums of eight numbers, which with what is multiplied fill sixteen registers.
COLUMNS = 16
#: numbers of a vector, and the side of a square that is turned.
LANES = 8
_VECTOR = ir.VectorType(ir.FloatType(), LANES)
_INDEX = ir.IntType(32)


def _add_product(builder: Any, factor: Any, vectors: list[Any], sums: list[Any]) -> None:
    """Add a number times the vectors to the sums."""
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    everywhere = ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES)
    wide = builder.shuffle_vector(builder.insert_element(nothing, factor, _INDEX(0)), nothing, everywhere)
    kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
    multiply_add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{LANES}f32")
    for vector, total in zip(vectors, sums, strict=True):
        builder.store(builder.call(multiply_add, [wide, vector, builder.load(total)]), total)


def _places(builder: Any, start: Any, stride: Any, n_rows: int) -> list[list[Any]]:
    """Where the vectors of each row begin."""
    offset = stride.type
    rows = [builder.gep(start, [builder.mul(stride, offset(r))]) for r in range(n_rows)]
    steps = [offset(column) for column in range(0, COLUMNS, LANES)]
    return [[builder.bitcast(builder.gep(row, [s]), _VECTOR.as_pointer()) for s in steps] for row in rows]


def _emit_tile(
    builder: Any, n_rows: int, packed: bool, a: Any, a_stride: Any, b: Any, b_stride: Any, c: Any, c_stride: Any,
    n: Any, n_groups: Any, b_group: Any,
) -> None:  # fmt: skip
    """Instructions of a tile; sums begin at 0 where ``packed``, else at what stands in ``c``."""
    offset = n.type
    places = _places(builder, c, c_stride, n_rows)
    sums = [[cgutils.alloca_once(builder, _VECTOR) for _ in row] for row in places]
    cells = list(zip(chain(*places), chain(*sums), strict=True))
    zero = ir.Constant(_VECTOR, [0.0] * LANES)
    for place, total in cells:
        builder.store(zero if packed else builder.load(place, align=4), total)
    with cgutils.for_range(builder, n_groups, intp=offset) as groups:
        group = builder.gep(b, [builder.mul(groups.index, b_group)])
        before = builder.mul(groups.index, n)
        with cgutils.for_range(builder, n, intp=offset) as loop:
            (here,) = _places(builder, builder.gep(group, [builder.mul(loop.index, b_stride)]), b_stride, 1)
            vectors = [builder.load(place, align=4) for place in here]
            k = builder.add(before, loop.index)
            for r in range(n_rows):
                if packed:
                    at = builder.add(builder.mul(k, offset(n_rows)), offset(r))
                else:
                    at = builder.add(k, builder.mul(a_stride, offset(r)))
                _add_product(builder, builder.load(builder.gep(a, [at])), vectors, sums[r])
    for place, total in cells:
        builder.store(builder.load(total), place, align=4)


def _tile(n_rows: int, packed: bool) -> Callable[..., None]:
    """A tile of ``n_rows``: ``c = a b`` where the rows of ``a`` are packed, else ``c += a b``.

    Its arguments are three runs of float32, each with the place of its first number and its stride from row to row
    (not used for a packed ``a``); how many numbers are multiplied for each result, in how many groups; and the stride
    from group to group of ``b``.
    """

    def plain(
        a: Any, a_at: int, a_stride: int, b: Any, b_at: int, b_stride: int, c: Any, c_at: int, c_stride: int, n: int,
        n_groups: int, b_group: int,
    ) -> None:  # fmt: skip
        rows, inner, columns = np.arange(n_rows)[:, None], np.arange(n * n_groups), np.arange(COLUMNS)
        left = a[a_at + (inner * n_rows + rows if packed else rows * a_stride + inner)]
        b_rows = b_at + inner // n * b_group + inner % n * b_stride
        result = left @ b[b_rows[:, None] + columns]
        places = c_at + rows * c_stride + columns
        c[places] = result if packed else c[places] + result

    if config.DISABLE_JIT:
        return plain

    @intrinsic
    def tile(
        context: Any, a: Any, a_at: Any, a_stride: Any, b: Any, b_at: Any, b_stride: Any, c: Any, c_at: Any,
        c_stride: Any, n: Any, n_groups: Any, b_group: Any,
    ) -> Any:  # fmt: skip
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            left, right, to = _starts(context, builder, (a, b, c), given[0:9:3], given[1:9:3])
            a_row, b_row, c_row = given[2:9:3]
            _emit_tile(builder, n_rows, packed, left, a_row, right, b_row, to, c_row, *given[9:])
            return context.get_dummy_value()

        three = [value for run in (a, b, c) for value in (run, types.intp, types.intp)]
        return types.void(*three, types.intp, types.intp, types.intp), generate

    return tile


def _starts(context: Any, builder: Any, kinds: Any, runs: Any, places: Any) -> list[Any]:
    """Pointers to numbers of arrays."""
    arrays = [context.make_array(kind)(context, builder, run) for kind, run in zip(kinds, runs, strict=True)]
    return [builder.gep(array.data, [at]) for array, at in zip(arrays, places, strict=True)]


def _turner() -> Callable[..., None]:
    """Eight rows of eight numbers become eight columns."""

    def plain(a: Any, a_at: int, a_stride: int, c: Any, c_at: int, c_stride: int) -> None:
        rows, columns = np.arange(LANES)[:, None], np.arange(LANES)
        c[c_at + rows * c_stride + columns] = a[a_at + columns * a_stride + rows]

    if config.DISABLE_JIT:
        return plain

    @intrinsic
    def turn(context: Any, a: Any, a_at: Any, a_stride: Any, c: Any, c_at: Any, c_stride: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            start, end = _starts(context, builder, (a, c), given[0:6:3], given[1:6:3])
            rows = [row[0] for row in _places(builder, start, given[2], LANES)]
            vectors = [builder.load(row, align=4) for row in rows]
            for distance in (4, 2, 1):
                vectors = _swap(builder, vectors, distance)
            for vector, row in zip(vectors, _places(builder, end, given[5], LANES), strict=True):
                builder.store(vector, row[0], align=4)
            return context.get_dummy_value()

        return types.void(a, types.intp, types.intp, c, types.intp, types.intp), generate

    return turn


def _swap(builder: Any, vectors: list[Any], distance: int) -> list[Any]:
    """Exchange the blocks beside the diagonal, as wide as ``distance``: all three of them turn a square."""
    lanes, found = range(LANES), list(vectors)
    lower = [c + LANES - distance if c & distance else c for c in lanes]
    upper = [c + LANES if c & distance else c + distance for c in lanes]
    for r in lanes:
        if not r & distance:
            pair = vectors[r], vectors[r + distance]
            for place, order in ((r, lower), (r + distance, upper)):
                found[place] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(_INDEX, LANES), order))
    return found


set_1, set_2, set_4, set_6 = (_tile(n, packed=True) for n in (1, 2, 4, 6))
add_1, add_2, add_4, add_6 = (_tile(n, packed=False) for n in (1, 2, 4, 6))
turn_square = _turner()
