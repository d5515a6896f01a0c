"""Several measured temperatures and several disturbances at once, on the gallery's two rooms."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from skhybrid import (
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    persistence,
)

EXAMPLE = Path(__file__).parents[1] / "examples" / "plot_two_zones.py"
OUTPUTS = ["T_north", "T_south"]


@pytest.fixture(scope="module")
def rooms():
    """Names of the example after it ran."""
    matplotlib.use("Agg")
    return runpy.run_path(str(EXAMPLE))


@pytest.mark.slow
def test_every_parameter_is_recovered(rooms):
    error = rooms["model"].theta_ / pd.Series(rooms["truth"]) - 1
    assert error.abs().max() < 0.10
    assert rooms["model"].starts_["reached_best"].sum() >= 2


def test_each_gain_is_estimated_apart(rooms):
    zeta = rooms["model"].estimate_disturbance(rooms["X"], smooth=True)
    assert list(zeta.columns) == ["zeta_north", "zeta_south"]
    correlation = np.corrcoef(zeta.to_numpy().T, rooms["gain"].T)[:2, 2:]
    assert (np.diag(correlation) > 0.9).all()
    assert (np.abs(correlation[[0, 1], [1, 0]]) < 0.5).all()
    assert list(rooms["model"].transform(rooms["X"]).columns[-2:]) == ["zeta_north", "zeta_south"]


def test_simulation_with_the_true_gains_is_the_matrix_exponential(rooms):
    X, flat, truth, gain = (rooms[name] for name in ("X", "flat", "truth", "gain"))
    model = GrayBoxRC(flat, known=truth).fit(X, X[OUTPUTS])
    found = model.simulate(X, heat_gain=gain, initial_state=[18.0, 18.0, 18.0, 18.0])
    c = flat.matrices(truth, X.columns)
    n, m = c.B.shape
    whole = expm(np.block([[c.A, c.B], [np.zeros((m, n + m))]]) * 0.25)
    state, expected = np.full(4, 18.0), []
    for row, heat in zip(X[list(flat.inputs(X.columns))].to_numpy(), gain, strict=True):
        expected.append(state[2:])
        state = whole[:n, :n] @ state + whole[:n, n:] @ [*row, *heat]
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_gains_of_a_frame_are_found_by_name(rooms):
    X, model = rooms["X"][:96], rooms["model"]
    gain = pd.DataFrame(rooms["gain"][:96], X.index, ["north", "south"])
    expected = model.simulate(X, gain.to_numpy())
    for frame in (gain.iloc[:, ::-1], gain.add_prefix("zeta_").iloc[:, ::-1], gain.add_prefix("heat_gain_")):
        np.testing.assert_array_equal(model.simulate(X, frame), expected)
    for frame in (gain.set_axis(OUTPUTS, axis=1), gain.assign(zeta_south=0.0), gain[["north"]]):
        with pytest.raises(ValueError, match=r"heat_gain has the columns .* give one for each of 'north', 'south'"):
            model.simulate(X, frame)
    with pytest.raises(ValueError, match=r"heat_gain has shape \(\), but X has 96 rows; .* for each of north, south"):
        model.simulate(X, 1.0)


def test_predictions_have_a_column_a_room(rooms):
    X = rooms["X"].copy()
    model = rooms["model"]
    assert model.predict(X).shape == (len(X), 2)
    ahead = model.predict_from(X, [96, 200], "6h")
    assert ahead.shape == (2, 24, 2)
    X.iloc[97:, X.columns.get_indexer(OUTPUTS)] += 5.0  # what lies after an origin is not read
    np.testing.assert_array_equal(model.predict_from(X, [96], "6h")[0], ahead[0])
    assert model.score(X[: len(X) // 2], rooms["X"][OUTPUTS][: len(X) // 2]) < 1.0


def test_a_score_finds_the_rooms_by_name(rooms):
    model, X = rooms["model"], rooms["X"][:192]
    expected = model.score(X, X[OUTPUTS])
    assert model.score(X, X[OUTPUTS[::-1]]) == expected
    assert model.score(X, X[OUTPUTS].to_numpy()) == expected
    by_node = X[OUTPUTS].set_axis(list(model.network_.measured_names), axis=1)
    assert model.score(X, by_node.iloc[:, ::-1]) == expected
    with pytest.raises(ValueError, match="several temperatures are measured"):
        model.score(X, X[OUTPUTS].to_numpy().T)
    with pytest.raises(ValueError, match="different time stamps"):
        model.score(X, X[OUTPUTS].iloc[::-1])


@pytest.mark.parametrize("measured", [False, True])
def test_a_plan_for_several_rooms(rooms, measured):
    """Free response and gain have one more axis; so has the state-space model's output."""
    model, X = rooms["model"], rooms["X"]
    history, future = X[:-96], X[-96:]
    now = future[OUTPUTS].iloc[0].to_list() if measured else None
    space = model.to_state_space(history, future, T_za=now)
    q = np.random.default_rng(0).uniform(size=(96, len(space.inputs)))
    planned = future.assign(**dict(zip(space.inputs, q.T, strict=True)))
    found = model.affine_forecast(history, future, space.inputs, T_za=now)
    forecast = model.forecast(history, planned, T_za=now)
    assert found.gain.shape == (96, 96, len(space.inputs), 2)
    assert list(forecast.columns) == [*OUTPUTS, "zeta_north", "zeta_south"]
    for T in (found.temperature(q), space.simulate(q)[:-1]):
        np.testing.assert_allclose(T, forecast[OUTPUTS], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.zeta, forecast[["zeta_north", "zeta_south"]], rtol=0, atol=1e-9)


def test_a_forecast_under_given_disturbances(rooms):
    model, X = rooms["model"], rooms["X"]
    cold = model.drive(X, [300], np.zeros((1, 8, 2)))
    warm = model.drive(X, [300], np.array([[[1.0, 0.0]] * 8]))
    assert cold.shape == (1, 8, 2)
    rise = (warm - cold)[0]
    assert (rise[:, 0] > rise[:, 1]).all()  # the heated room more than its neighbour, which also warms
    assert (rise[1:, 1] > 0).all()
    with pytest.raises(ValueError, match=r"two rooms has 2 of kind 'input'"):
        model.drive(X, [300], np.zeros((1, 8)))


def test_output_disturbances_are_carried_apart(rooms):
    X = rooms["X"].iloc[:480]
    model = OutputDisturbanceID(rooms["flat"], known=rooms["truth"], horizon="1D", random_state=0).fit(X, X[OUTPUTS])
    zeta = model.estimate_disturbance(X, kind="output")
    assert list(zeta.columns) == ["zeta_north", "zeta_south"]
    outputs = model.simulate(X) + zeta.to_numpy()
    np.testing.assert_allclose(outputs, X[OUTPUTS], atol=1e-9)
    assert np.isfinite(model.predict(X)).all()


def test_a_room_whose_sensor_fails(rooms):
    X, y = rooms["X"], rooms["X"][OUTPUTS].copy()
    y.iloc[::2, 0] = np.nan
    model = OutputDisturbanceID(rooms["flat"], known={"Q_h_north": 5.0}, n_starts=5, random_state=0, max_missing=0.6)
    error = model.fit(X, y).theta_ / pd.Series(rooms["truth"]) - 1
    assert error[["C_n", "C_s", "R_ns"]].abs().max() < 0.15


@pytest.mark.slow
def test_periodic_gains_of_two_rooms(rooms):
    """Each room has a gain state, a profile and a ventilation of its own."""
    X, flat = rooms["X"], rooms["flat"]
    model = PeriodicDisturbanceID(flat, known={"Q_h_north": 5.0}, n_starts=1, horizon="1D", random_state=0)
    model.fit(X, X[OUTPUTS])
    error = model.theta_ / pd.Series(rooms["truth"]) - 1
    assert error.abs().max() < 0.10
    assert model.gain_found_
    assert model.profile_.shape == (24, 4)
    assert list(model.ventilation_.index) == ["north", "south"]
    zeta = model.estimate_disturbance(X, smooth=True)
    assert list(zeta.columns) == ["zeta_north", "zeta_south"]
    left_over = zeta.to_numpy() - rooms["gain"]
    assert (left_over.std(axis=0) < 0.3 * rooms["gain"].std(axis=0)).all()
    ahead = model.predict(X)
    assert ahead.shape == (len(X), 2)
    assert np.sqrt(np.mean((ahead - X[OUTPUTS]) ** 2, axis=0)).max() < 1.5
    changed = X.copy()
    changed.iloc[97:, X.columns.get_indexer(OUTPUTS)] += 5.0  # what lies after an origin is not read
    both = [model.predict_from(table, [96], "6h") for table in (X, changed)]
    assert both[0].shape == (1, 24, 2)
    np.testing.assert_array_equal(*both)


def test_targets_by_name_or_by_order(rooms):
    X, truth = rooms["X"].iloc[:200], rooms["truth"]
    fit = lambda y: GrayBoxRC(rooms["flat"], known=truth).fit(X, y).initial_state_  # noqa: E731
    by_name = fit(X[OUTPUTS[::-1]])
    np.testing.assert_array_equal(by_name, fit(X[OUTPUTS].to_numpy()))
    with pytest.raises(ValueError, match=r"y has shape \(200,\), but several temperatures are measured: give T_north"):
        fit(X["T_north"])


def test_state_space_and_file(rooms, tmp_path):
    model = rooms["model"]
    space = model.to_state_space()
    assert space.C.shape == (2, 4)
    assert space.input_names[-2:] == ("heat_gain_north", "heat_gain_south")
    persistence.save_model(model, tmp_path / "rooms.skops")
    again = persistence.load_model(tmp_path / "rooms.skops")
    np.testing.assert_array_equal(again.predict(rooms["X"]), model.predict(rooms["X"]))


def test_loads_of_several_zones_are_refused(rooms):
    with pytest.raises(ValueError, match="several zones, whose loads depend on one another"):
        rooms["model"].predict_load(rooms["X"], 21.0)


def test_a_hybrid_of_several_zones_is_refused(rooms):
    with pytest.raises(ValueError, match="several measured temperatures"):
        HybridPredictor(InputDisturbanceID(rooms["flat"])).fit(rooms["X"], rooms["X"][OUTPUTS])
