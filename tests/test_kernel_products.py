"""Products of small matrices in tiles, against NumPy's in float64; and the same modules uncompiled."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from skhybrid.filtering.products import (
    add_correlation,
    add_outer,
    correlate,
    multiply,
    pack,
    pack_turned,
    round_up,
    turn,
)
from skhybrid.filtering.tiles import COLUMNS

#: inputs, outputs, windows: every number of rows that is left over by panels of six, and squares that are not whole
SIZES = [
    (n_in, n_out, width) for n_in, n_out in zip(range(5, 12), range(18, 11, -1), strict=True) for width in (16, 48)
]
SIZES += [(121, 240, 64), (1, 1, 16)]


def _draw(n_in, n_out, width):
    rng = np.random.default_rng(n_in)
    shapes = {"weight": (n_in, n_out), "bias": n_out, "x": (n_in, width), "d": (n_out, width)}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def _error(found, expected):
    return np.max(np.abs(found - expected)) / np.max(np.abs(expected))


@pytest.mark.parametrize("size", SIZES)
def test_the_weights_of_a_layer_forward_bias_included(size):
    n_in, n_out, width = size
    given = _draw(*size)
    panels, out = np.empty(n_out * (n_in + 1), np.float32), np.full(n_out * width, np.nan, np.float32)
    pack_turned(given["weight"], given["bias"], panels)
    multiply(panels, n_out, np.vstack([given["x"], np.ones((1, width), np.float32)]), out)
    expected = given["weight"].T.astype(float) @ given["x"] + given["bias"][:, None]
    assert _error(out.reshape(n_out, width), expected) < 3e-6


@pytest.mark.parametrize("size", SIZES)
def test_the_weights_of_a_layer_backward(size):
    n_in, n_out, width = size
    given = _draw(*size)
    panels, out = np.empty(n_in * n_out, np.float32), np.full(n_in * width, np.nan, np.float32)
    pack(given["weight"], panels)
    multiply(panels, n_in, given["d"], out)
    assert _error(out.reshape(n_in, width), given["weight"].astype(float) @ given["d"]) < 3e-6


@pytest.mark.parametrize("size", SIZES)
def test_the_gradient_of_a_layer_is_added_to_what_is_there(size):
    n_in, n_out, width = size
    given = _draw(*size)
    slices, out = np.zeros(round_up(n_out) * width, np.float32), np.ones(n_in * round_up(n_out), np.float32)
    turn(given["d"], slices)
    add_outer(given["x"], slices, n_out, out)
    found = out.reshape(n_in, round_up(n_out))
    assert _error(found[:, :n_out], 1.0 + given["x"].astype(float) @ given["d"].T) < 3e-6
    np.testing.assert_array_equal(found[:, n_out:], 1.0)  # of columns that nobody has


@pytest.mark.parametrize(("n_out", "n_in", "filter_size", "n_places"), [(7, 3, 6, 40), (10, 1, 12, 16), (3, 2, 19, 5)])
def test_a_filter_forward_and_its_gradient(n_out, n_in, filter_size, n_places):
    length, first = round_up(n_places) + 2 * round_up(filter_size), 2
    rng = np.random.default_rng(n_out)
    weight, x = (rng.normal(size=s).astype(np.float32) for s in ((n_out, n_in * filter_size), (n_in, length)))
    under = np.stack([x[:, first + p : first + p + filter_size].ravel() for p in range(n_places)], axis=1)
    panels, out = np.empty(weight.size, np.float32), np.full(n_out * round_up(n_places), np.nan, np.float32)
    pack(weight, panels)
    correlate(panels, n_out, filter_size, x, first, n_places, out, round_up(n_places))
    found = out.reshape(n_out, round_up(n_places))[:, :n_places]
    assert _error(found, weight.astype(float) @ under) < 3e-6
    gradient = np.ones(n_out * n_in * round_up(filter_size), np.float32)
    add_correlation(np.pad(found, [(0, 0), (5, 9)]), 5, n_places, x, first, filter_size, gradient)
    summed = gradient.reshape(n_out, n_in, -1)[:, :, :filter_size].reshape(n_out, -1)
    assert _error(summed, 1.0 + found.astype(float) @ under.T) < 3e-6


def test_turning_is_exact():
    d = np.arange(21 * 32, dtype=np.float32).reshape(21, 32)
    slices = np.zeros(round_up(21) * 32, np.float32)
    turn(d, slices)
    found = slices.reshape(2, 32, COLUMNS)
    np.testing.assert_array_equal(np.vstack([found[0].T, found[1].T])[:21], d)


def test_nothing_is_written_beside_the_result():
    given, guard = _draw(5, 7, 16), np.full(7 * 16 + 40, 3.0, np.float32)
    panels = np.empty(7 * 6, np.float32)
    pack_turned(given["weight"], given["bias"], panels)
    multiply(panels, 7, np.ones((6, 16), np.float32), guard)
    np.testing.assert_array_equal(guard[7 * 16 :], 3.0)


def test_uncompiled_kernels_say_the_same():
    code = (
        "import importlib.util, numba; assert numba.config.DISABLE_JIT\n"
        f"spec = importlib.util.spec_from_file_location('here', {__file__!r})\n"
        "here = importlib.util.module_from_spec(spec); spec.loader.exec_module(here)\n"
        "for size in here.SIZES[::3]:\n"
        "    here.test_the_weights_of_a_layer_forward_bias_included(size)\n"
        "    here.test_the_weights_of_a_layer_backward(size)\n"
        "    here.test_the_gradient_of_a_layer_is_added_to_what_is_there(size)\n"
        "here.test_a_filter_forward_and_its_gradient(7, 3, 6, 40)\n"
        "here.test_turning_is_exact()\n"
        "print('all five')"
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "all five", done.stderr[-2000:]
