"""The heat that neighbours save a zone under set-points, by a model that is learned in full."""

import pytest

from skhybrid import BuildingPredictor
from skhybrid.datasets import make_house

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")]
DAY, TRAINED = 24, 14 * 24


def test_a_zone_needs_less_heat_beside_a_warmer_one():
    house = make_house(24, 3, sampling_time="1h", random_state=0)
    stages = [name for name in house.X if name.startswith("u_heat_")]
    log = house.X.drop(columns=stages).join(house.heat).join(house.setpoints)
    T_of = [f"T_za_{zone}" for zone in ("living", "kitchen", "bedroom")]
    model = BuildingPredictor(adjacency=[("living", "kitchen"), ("living", "bedroom")])
    model.fit(log[:TRAINED], log[T_of][:TRAINED])
    later, origin = log[TRAINED:], 2 * DAY
    warmer = later.copy()
    warmer.loc[warmer.index[origin] :, "T_heat_set_living"] += 4.0
    one, two = (model.closed_loop_from(rows, [origin])["kitchen"].paths for rows in (later, warmer))
    assert two.temperature.mean() > one.temperature.mean()
    assert two.heat.mean() < 0.9 * one.heat.mean()
