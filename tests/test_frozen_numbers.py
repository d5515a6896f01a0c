"""Frozen numbers: what the package computed before a change of its code, it computes after it.

The functions are in ``make_frozen_numbers.py``, the numbers in ``frozen/numbers.json``.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

_spec = importlib.util.spec_from_file_location(
    "make_frozen_numbers", Path(__file__).with_name("make_frozen_numbers.py")
)
frozen = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(frozen)

FROZEN = frozen.read()
#: of the largest value of a series
EXACT = 1e-9
#: sections whose search ends in a flat valley: the same code finds the frozen numbers to the bit, but another order of
#: a sum, or the BLAS of another processor, moves the place where the search stops (seen: up to a tenth of these)
FLAT = {
    "two_stage_output-small_office": 1e-6,
    "two_stage_output-home_2": 1e-7,
    "two_stage_output-home_3": 1e-8,
    "conventional-home_2": 1e-6,
    "conventional-home_3": 1e-5,
    "periodic-small_office": 1e-6,
    "periodic-home_2": 1e-7,
    "periodic-home_3": 1e-8,
    "input_disturbance-small_office": 1e-6,
    "input_disturbance-home_2": 1e-8,
    "multi_step-office": 1e-6,
}
#: of standard errors, which invert a matrix that is close to singular, and beside it, for parameters at their bounds
STANDARD_ERROR = 1e-5, 1e-8
#: networks are float32 and their sums may be taken in another order: of the spread of the series
ROUNDING = 1e-3
_ROUNDED = ("networks", "search_networks")
#: compared value by value, as each has a unit of its own
_EACH = ("theta", "disturbance", "weight", "weights", "noise_std", "alpha")


def allowed(section, key, expected):
    """Largest difference of each value from the frozen one."""
    if section.startswith(_ROUNDED):
        return ROUNDING * max(np.nanstd(expected), 0.01 * np.nanmax(np.abs(expected)))
    if key == "theta_std":
        return STANDARD_ERROR[0] * np.abs(expected) + STANDARD_ERROR[1]
    share = FLAT.get(section, EXACT)
    if key.rpartition("/")[2] in _EACH:
        return share * np.abs(expected)
    return share * np.nanmax(np.abs(expected))


def excess(section, key, found, expected):
    """The largest deviation, in units of what is allowed."""
    assert found.shape == expected.shape, key
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected), err_msg=key)
    changed = np.isfinite(expected) & (found != expected)
    limit = np.broadcast_to(allowed(section, key, expected), expected.shape)
    with np.errstate(divide="ignore"):
        return float(np.max(np.abs(found - expected)[changed] / limit[changed], initial=0.0))


def test_every_section_is_frozen():
    assert list(FROZEN) == list(frozen.SECTIONS)


def _marked(section):
    """Of what is not the default, one building is enough for a quick run."""
    quick = section.startswith("schedule") or section.endswith(("-office", "conventional-small_office"))
    return pytest.param(section, marks=[] if quick else pytest.mark.slow)


@pytest.mark.parametrize("section", [_marked(section) for section in frozen.SECTIONS])
def test_numbers_are_those_that_were_frozen(section):
    if section.endswith(frozen.HOMES) and not frozen.SHARED_DATA.is_dir():
        pytest.skip("reference data (../shared/data) is not on this machine")
    found, expected = frozen.compute(section), FROZEN[section]
    assert list(found) == list(expected)
    away = {key: worst for key in expected if (worst := excess(section, key, found[key], expected[key])) > 1.0}
    assert not away, f"times the tolerance: {away}"
