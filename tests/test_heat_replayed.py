"""The bench with replayed heat (``benchmarks/heat_replayed.py``): its synthetic logs, origins and tables."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import heat_replayed
from heat_replayed import DAY, DEFAULT, OWN, REPLAYED

from skhybrid import ARXRegressor
from skhybrid.datasets import make_office

DRIVEN = ["u_heat", "u_cool"]


@pytest.fixture(scope="module")
def row():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(heat_replayed, "OFFICE_WEEKS", (1, 3))
        yield heat_replayed._office("chicago")


def test_the_usual_log_is_that_of_the_office_and_other_peoples_heat_replaces_its_own(row):
    usual = make_office(28, "chicago", start="2023-09-04", random_state=7000).X
    pd.testing.assert_frame_equal(pd.concat([row.data.train, row.own]), usual, check_freq=False)
    later = row.data.later
    weather = ["T_oa", "q_sol"]
    pd.testing.assert_frame_equal(later[weather], row.own[weather])
    day = np.arange(len(later)) // DAY + 7
    driven = (later[DRIVEN] != row.own[DRIVEN]).any(axis=1).to_numpy()
    assert np.mean(driven[day % 3 > 0]) > 0.05
    assert (later["T_za"] - row.own["T_za"]).abs().max() > 0.3
    assert (later["T_za"] - row.own["T_za"]).abs().max() < 8.0


def test_no_forecast_that_is_scored_reaches_a_day_of_the_own_thermostat(row):
    day = np.arange(len(row.data.later)) // DAY + 7
    assert len(row.origins) >= 12
    assert row.data.later.index[row.origins].min() >= row.data.start
    for origin in row.origins:
        assert (day[origin : origin + DAY] % 3 > 0).all()
    assert {origin % DAY for origin in row.origins} == set(heat_replayed.ORIGINS)


def test_the_same_heat_gives_the_same_run():
    """A replay of the stages that the thermostat chose changes nothing."""
    from skhybrid.datasets._gains import draw_gains
    from skhybrid.datasets._office import _simulate_office

    office = make_office(3, sampling_time="5min", noise_std=0.0, random_state=1)
    gains = draw_gains(office.X.index, np.random.default_rng(2))
    outside = office.X[["T_oa", "q_sol"]]
    run = _simulate_office(outside, office.setpoints, gains)
    again = _simulate_office(outside, office.setpoints, gains, run[DRIVEN].to_numpy())
    pd.testing.assert_frame_equal(run, again)
    half = run[DRIVEN].to_numpy() * 0.5
    half[288:] = np.nan
    weaker = _simulate_office(outside, office.setpoints, gains, half)
    np.testing.assert_array_equal(weaker[DRIVEN][:288], half[:288])
    assert set(np.unique(weaker[DRIVEN][288:])) <= {0.0, 1.0}


def test_runs_are_kept_and_told_as_ratios_to_the_default(row, tmp_path, monkeypatch, capsys):
    class Wide(ARXRegressor):
        """Forecasts 1 K too high, in an interval that holds every or no measurement."""

        def predict_from(self, X, origins, horizon=None):
            return X["T_za"].to_numpy()[np.asarray(origins)[:, None] + np.arange(1, DAY + 1)] + 1.0

        def predict_quantiles_from(self, X, origins, levels, horizon):
            inside = X["T_za"].equals(row.own["T_za"])
            return self.predict_from(X, origins)[..., None] + np.array([-2.0, 0.0 if inside else -1.5])

    monkeypatch.setattr(heat_replayed, "COMPARED", {DEFAULT: lambda *_: Wide(), "ARX": lambda *_: ARXRegressor()})
    monkeypatch.setattr(heat_replayed, "rows", lambda folders: {row.data.name: lambda: row})
    arguments = ["--store", str(tmp_path / "kept"), "--results", str(tmp_path)]
    heat_replayed.main(arguments)
    shown = heat_replayed.tables(tmp_path / "kept", [row.data.name])
    rmse = shown["RMSE [K], heat replayed"].loc[row.data.name]
    assert rmse[DEFAULT] == pytest.approx(1.0, abs=1e-3)
    assert shown["Ratio to the default, heat replayed"].loc["geometric mean", "ARX"] == pytest.approx(rmse["ARX"], 2e-3)
    coverage = shown["Coverage of the default's 80 % intervals"].loc[row.data.name]
    assert (coverage[REPLAYED], coverage[OWN], coverage["origins"]) == (0.0, 1.0, len(row.origins))
    capsys.readouterr()
    heat_replayed.main(arguments)
    assert "K" not in capsys.readouterr().out.replace(str(tmp_path), "")  # nothing ran again
    assert "heat replayed, hour 24" in (tmp_path / "heat_replayed.md").read_text(encoding="utf-8")


def test_the_network_alone_reads_no_temperature_after_an_origin(row):
    train, later = row.data.train, row.data.later
    model = heat_replayed.NetworkAlone(known={"Q_h": 6.0}).fit(train, train["T_za"])
    origins = row.origins[:1]
    paths = model.predict_from(later, origins)
    assert paths.shape == (1, DAY)
    at = origins[:, None] + np.arange(1, DAY + 1)
    assert np.sqrt(np.mean((paths - later["T_za"].to_numpy()[at]) ** 2)) < 2.0
    changed = later.copy()
    changed.loc[changed.index[origins[-1] + 1 :], "T_za"] += 5.0
    np.testing.assert_array_equal(paths, model.predict_from(changed, origins))
