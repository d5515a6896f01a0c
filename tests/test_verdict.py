"""The verdict on a forecast, from comparisons with simple rules by a bootstrap over blocks."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid.study.load_rules import RIDGE, YESTERDAY, rule_loads
from skhybrid.study.verdict import CARE, NOT, USABLE, compare_errors, judge


def _errors(size, n_blocks=20, seed=0):
    drawn = np.random.default_rng(seed).normal(size=24 * n_blocks)
    return pd.Series(size * drawn / np.sqrt(np.mean(drawn**2)))


BLOCKS = pd.Series(np.repeat(np.arange(20), 24))


def test_a_ratio_and_its_interval():
    found = compare_errors(_errors(0.5), _errors(1.0, seed=1), BLOCKS, "yesterday")
    assert found.ratio == pytest.approx(0.5)
    assert found.low < found.ratio < found.high < 0.7
    own = _errors(0.5).mask(np.arange(480) < 24)
    assert compare_errors(own, own * 2, BLOCKS, "twice").ratio == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("size", "given", "level", "words"),
    [
        (0.5, {}, USABLE, "of that of yesterday"),
        (1.0, {}, CARE, "not surely better"),
        (2.0, {}, NOT, "yesterday is better"),
        (0.5, {"coverage": 0.6}, CARE, "held 60 %"),
        (0.5, {"coverage": 0.4}, NOT, "held 40 %"),
        (0.5, {"doubts": ["its kW have no certain scale"]}, CARE, "no certain scale"),
        (0.5, {"n_origins": 3}, CARE, "3 forecasts only"),
    ],
)
def test_levels_and_their_reasons(size, given, level, words):
    compared = compare_errors(_errors(size), _errors(1.0, seed=1), BLOCKS, "yesterday")
    found = judge("temperature", [compared], **{"n_origins": 20, **given})
    assert found.level == level
    assert words in str(found)


def test_the_hardest_rule_counts():
    easy = compare_errors(_errors(0.5), _errors(4.0, seed=1), BLOCKS, "last week")
    hard = compare_errors(_errors(0.5), _errors(0.2, seed=1), BLOCKS, "yesterday")
    assert judge("load", [easy, hard], n_origins=20).level == NOT


def test_rules_for_the_load():
    index = pd.date_range("2024-01-01", periods=24 * 20, freq="1h")
    T_oa = pd.Series(5.0 + 5.0 * np.sin(np.arange(480) / 9.0), index=index)
    held = pd.Series(20.0, index=index)
    heat = 0.2 * (held - T_oa)
    frame = pd.DataFrame({"T_oa": T_oa})
    rules = rule_loads(frame[:360], frame[360:], heat, held)
    pd.testing.assert_series_equal(rules[YESTERDAY], heat.shift(24)[360:], check_names=False, check_freq=False)
    np.testing.assert_allclose(rules[RIDGE], heat[360:], atol=0.01)
    heat[360:] = 99.0  # what was delivered after training is not learned from
    np.testing.assert_allclose(rule_loads(frame[:360], frame[360:], heat, held)[RIDGE], rules[RIDGE])
