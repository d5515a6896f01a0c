"""Intervals around a blend follow how much its members differ."""

import numpy as np
import pytest

from skhybrid.forecasting.intervals import LeadIntervals, PathClock
from skhybrid.hybrid.thermostat_law.member_intervals import MemberIntervals, MemberValues

LEVELS = np.array([0.1, 0.9])
WEIGHTS = np.tile([0.25, 0.75], (24, 1))


def clock(n_origins: int) -> PathClock:
    """Forecasts of a day from each midnight."""
    lead = np.tile(np.arange(1.0, 25.0), (n_origins, 1))
    day = np.arange(n_origins)[:, None] + lead / 24.0
    return PathClock(lead, np.tile(np.arange(24), (n_origins, 1)), day)


def members(n_origins: int, rng: np.random.Generator) -> MemberValues:
    """Two members; on every other day they differ three times as much, and are three times as wrong."""
    size = np.where(np.arange(n_origins) % 2, 3.0, 1.0)[:, None, None]
    values = size * (rng.normal(size=(n_origins, 24, 1)) + np.array([1.0, -1.0 / 3.0]))
    return MemberValues(values, WEIGHTS, clock(n_origins))


def test_intervals_are_wider_where_members_disagree_and_hold_more_evenly():
    rng = np.random.default_rng(0)
    learned = MemberIntervals.learn(members(200, rng), 24.0)
    tested = members(200, rng)
    bands = np.array(
        [
            learned.offsets(tested._replace(values=tested.values[[i]], clock=clock(1)), LEVELS, None, 0.0, None)
            for i in range(200)
        ]
    )
    missed = tested.of_blend()
    held = (bands[..., 0] <= missed) & (missed <= bands[..., 1])
    width = (bands[..., 1] - bands[..., 0]).mean(axis=1)
    assert width[1::2].mean() > 1.25 * width[::2].mean()
    assert held.mean() == pytest.approx(0.8, abs=0.05)
    plain = LeadIntervals(independent_per_day=24.0).fit(missed, clock(200)).offsets(clock(1), LEVELS)
    of_plain = (plain[:, 0] <= missed) & (missed <= plain[:, 1])
    uneven = [abs(known[::2].mean() - known[1::2].mean()) for known in (held, of_plain)]
    assert uneven[0] < uneven[1] - 0.02


def test_members_that_always_agree_have_the_intervals_of_one():
    rng = np.random.default_rng(1)
    missed = rng.normal(size=(40, 24))
    alike = MemberValues(np.repeat(missed[..., None], 2, axis=-1), WEIGHTS, clock(40))
    learned = MemberIntervals.learn(alike, 24.0)
    path = MemberValues(np.full((1, 24, 2), 21.0), WEIGHTS, clock(1))
    found = learned.offsets(path, LEVELS, alike, 40.0, None)
    plain = LeadIntervals(independent_per_day=24.0).fit(missed, clock(40))
    np.testing.assert_allclose(found, plain.offsets(clock(1), LEVELS, (missed, clock(40)), 40.0), rtol=1e-9)


def test_a_missing_error_counts_neither_for_the_errors_nor_for_the_disagreement():
    rng = np.random.default_rng(2)
    values = members(40, rng).values
    values[3] = np.nan
    others = np.delete(np.arange(40), 3)
    with_gap = MemberIntervals.learn(MemberValues(values, WEIGHTS, clock(40)), 24.0)
    without = MemberIntervals.learn(MemberValues(values[others], WEIGHTS, clock(40).rows(others)), 24.0)
    assert with_gap.usual == pytest.approx(without.usual)
    np.testing.assert_allclose(with_gap.intervals.shape_, without.intervals.shape_)


def test_few_errors_give_no_intervals():
    values = np.full((40, 24, 2), np.nan)
    values[0, :10] = 1.0
    assert MemberIntervals.learn(MemberValues(values, WEIGHTS, clock(40)), 24.0) is None
