"""Frequency and step responses agree with scipy.signal and with closed forms; their pictures show them."""

from __future__ import annotations

import warnings
from copy import deepcopy

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from scipy import signal

from skhybrid import GrayBoxRC, HybridPredictor, RCNetwork, TwoStagePredictor
from skhybrid.datasets import make_office
from skhybrid.exceptions import PlanWarning, UnitWarning
from skhybrid.forecasting import DisturbanceForecaster
from skhybrid.identification import StateSpace, frequency_response, make_state_space, step_response
from skhybrid.inspection import BodeDisplay, StepResponseDisplay

pytestmark = pytest.mark.usefixtures("closed_figures")

OFFICE = {
    "C_w": 14.0, "C_za": 1.0, "R_zw": 1.0, "R_zo": 8.6, "f": 0.3, "A_win": 3.0, "Q_h": 6.0, "Q_c": -6.0,
}  # fmt: skip


@pytest.fixture
def office():
    return make_state_space("2R2C", OFFICE)


def _scipy(model, output=0):
    return model.A, model.B, model.C[[output]], model.D[[output]]


# ------------------------------------------------------------------------------------------------------- the numbers
@pytest.mark.filterwarnings("ignore::scipy.signal.BadCoefficients")  # scipy goes by way of a transfer function
def test_the_frequency_response_is_scipys(office):
    periods = pd.to_timedelta([0.5, 1, 3, 24, 168, 720], unit="h")
    found = frequency_response(office, periods)
    assert list(found.columns) == list(office.input_names) == ["T_oa", "q_sol", "u_heat", "u_cool", "heat_gain"]
    step = office.sampling_time / pd.Timedelta("1s")
    w = 2 * np.pi * step / (periods / pd.Timedelta("1s")).to_numpy()
    for j, name in enumerate(office.input_names):
        A, B, C, D = _scipy(office)
        transfer = signal.dlti(A, B[:, [j]], C, D[:, [j]], dt=step)
        _, expected = signal.dfreqresp(transfer, w=w)
        np.testing.assert_allclose(found[name], expected, rtol=1e-6)


def test_the_step_response_is_scipys(office):
    found = step_response(office, "12h")
    assert found.index[-1] == pd.Timedelta("12h")
    _, expected = signal.dstep((*_scipy(office), 1.0), n=49)
    for name, values in zip(office.input_names, expected, strict=True):
        np.testing.assert_allclose(found[name], values[:, 0], rtol=1e-10, atol=1e-12)


def test_a_sinusoid_comes_out_with_the_magnitude_and_the_phase(office):
    period, hours = 6.0, np.arange(0, 2400, 0.25)
    gain = frequency_response(office, ["6h"])["u_heat"].iloc[0]
    x, path = np.zeros(2), []
    for k in range(len(hours)):
        path.append(office.C[0] @ x)
        x = office.A @ x + office.B[:, 2] * np.sin(2 * np.pi * hours[k] / period)
    expected = np.abs(gain) * np.sin(2 * np.pi * hours / period + np.angle(gain))
    np.testing.assert_allclose(path[-96:], expected[-96:], atol=1e-6)


def test_the_slowest_response_is_the_steady_state(office):
    slow = frequency_response(office, ["20000D"]).iloc[0]
    # all heat leaves through R_zo, wherever it enters
    np.testing.assert_allclose(slow.abs(), [1.0, 8.6 * 3.0, 8.6 * 6.0, 8.6 * 6.0, 8.6], rtol=1e-3)
    np.testing.assert_allclose(step_response(office, "200D").iloc[-1], [1.0, 25.8, 51.6, -51.6, 8.6], rtol=1e-6)


def test_the_default_periods_begin_at_two_steps_and_shorter_ones_are_refused(office):
    assert frequency_response(office).index[0] == pd.Timedelta("30min")
    fast = make_state_space("2R2C", OFFICE, sampling_time="1min")
    assert frequency_response(fast).index[[0, -1]].tolist() == [pd.Timedelta("10min"), pd.Timedelta("30D")]
    with pytest.raises(ValueError, match="shorter than two steps of the model"):
        frequency_response(office, ["20min"])


def test_a_second_output_has_a_response_of_its_own(office):
    both = StateSpace(
        office.A, office.B, np.eye(2), np.zeros((2, 5)), office.state_names, office.input_names, office.sampling_time
    )
    _, expected = signal.dstep((*_scipy(both, 0), 1.0), n=5)
    np.testing.assert_allclose(step_response(both, "1h")["q_sol"], expected[1][:, 0])  # the wall
    pd.testing.assert_frame_equal(step_response(both, output=1), step_response(office))
    pd.testing.assert_frame_equal(frequency_response(both, output=1), frequency_response(office))


def test_an_identification_responds_as_its_state_space():
    data = make_office(n_days=3, random_state=0)
    model = GrayBoxRC(known=data.theta).fit(data.X, data.y)
    made = make_state_space("2R2C", data.theta)
    pd.testing.assert_frame_equal(step_response(model), step_response(made))
    pd.testing.assert_frame_equal(frequency_response(model), frequency_response(made))


@pytest.mark.parametrize("respond", [frequency_response, step_response])
def test_an_output_that_is_not_measured_is_refused(respond, office):
    for output in (1, -1, "za"):
        with pytest.raises(ValueError, match=f"output={output!r} must be an integer from 0 to 0"):
            respond(office, output=output)


def test_one_period_needs_no_list(office):
    pd.testing.assert_frame_equal(frequency_response(office, "1D"), frequency_response(office, ["1D"]))
    with pytest.raises(ValueError, match=r"periods=24 has no unit; give a duration such as"):
        frequency_response(office, 24)


def test_what_has_no_response_is_refused():
    with pytest.raises(ValueError, match=r"theta lacks R_zo, A_win: .* under the inputs T_oa, q_sol"):
        make_state_space("1R1C", {"C_za": 1.0}, roles=["T_oa", "q_sol"])


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [("Q_c", 6.0, "< 0: cooling is negative, write -6.0"), ("f", 1.5, "at most 1"), ("A_win", -3.0, "> 0"),
     ("R_zo", 0.0, "> 0"), ("C_w", "4", "it must be a number")],
)  # fmt: skip
def test_a_parameter_that_cannot_be_is_refused(name, value, message):
    with pytest.raises(ValueError, match=f"theta gives {name} the value {value!r}; .*{message}"):
        make_state_space("2R2C", OFFICE | {name: value})


def test_a_parameter_may_be_what_a_fit_holds_it_at_and_watts_are_warned_of():
    assert (make_state_space("2R2C", OFFICE | {"A_win": 0.0, "Q_c": 0.0}).B[:, [1, 3]] == 0).all()
    with pytest.warns(UnitWarning, match="theta gives Q_h 6000 kW: likely W"):
        make_state_space("2R2C", OFFICE | {"Q_h": 6000})
    with pytest.raises(ValueError, match="int is neither a StateSpace nor"):
        step_response(3)


def test_rows_ahead_have_no_response_of_their_own():
    office = make_office(n_days=3, random_state=0)
    model = GrayBoxRC(known=office.theta).fit(office.X[:200], office.y[:200])
    ahead = model.to_state_space(None, office.X[200:210].drop(columns="T_za"))
    for response in (frequency_response, step_response):
        with pytest.raises(ValueError, match="ControlModel is neither a StateSpace nor"):
            response(ahead)


def test_one_role_is_a_name_or_a_sequence():
    shed = {"C_za": 2.0, "R_zo": 5.0}
    assert make_state_space("1R1C", shed, roles="T_oa").input_names == ("T_oa", "heat_gain")


# ------------------------------------------------------------------------------------------------------ the pictures
def _lines(ax):
    return {line.get_label(): line for line in ax.get_lines() if not line.get_label().startswith("_")}


def test_magnitudes_are_drawn_beside_the_truth(office):
    other = make_state_space("2R2C", OFFICE | {"C_w": 3.0})
    display = BodeDisplay.from_estimator({"small wall": other}, truth=office)
    assert [ax.get_title(loc="left") for ax in display.ax_] == list(office.input_names)
    units = ["K/K", "K per kW/m2", "K per stage", "K per stage", "K/kW"]
    assert [ax.get_ylabel() for ax in display.ax_] == [f"magnitude [{unit}]" for unit in units]
    assert display.ax_[0].get_xscale() == display.ax_[0].get_yscale() == "log"
    for label, model in (("true", office), ("small wall", other)):
        line = _lines(display.ax_[2])[label]
        expected = frequency_response(model)["u_heat"]
        np.testing.assert_allclose(line.get_xdata(), expected.index.total_seconds())
        np.testing.assert_allclose(line.get_ydata(), np.abs(expected))
    (legend,) = display.figure_.legends
    assert [text.get_text() for text in legend.get_texts()] == ["true", "small wall"]


def test_phase_and_decibels_on_request(office):
    display = BodeDisplay.from_estimator(office, inputs=["u_cool"], phase=True, decibel=True)
    size, phase = display.ax_
    found = frequency_response(office)["u_cool"]
    np.testing.assert_allclose(_lines(size)["StateSpace"].get_ydata(), 20 * np.log10(np.abs(found)))
    angle = _lines(phase)["StateSpace"].get_ydata()
    np.testing.assert_allclose(np.exp(1j * np.radians(angle)), found / np.abs(found), atol=1e-9)
    assert np.abs(np.diff(angle)).max() < 20  # no jump of a whole turn


def test_step_responses_are_drawn_for_models_with_different_inputs(office):
    shed = RCNetwork("shed", {"za": "C_za"}, {"R": ("za", "T_oa")})
    bare = make_state_space(shed, {"C_za": 1.0, "R": 5.0}, roles=["T_oa"], sampling_time="1h")
    display = StepResponseDisplay.from_estimator({"office": office, "shed": bare}, duration="6h")
    panels = dict(zip(office.input_names, display.ax_, strict=True))
    np.testing.assert_allclose(_lines(panels["T_oa"])["shed"].get_ydata(), 1 - np.exp(-np.arange(7) / 5.0))
    assert set(_lines(panels["u_heat"])) == {"office"}
    assert display.ax_[0].get_xlim() == (0, 6)
    again = StepResponseDisplay.from_predictions(display.responses, inputs=["T_oa"])
    assert len(again.ax_) == 1


def test_a_display_says_what_it_cannot_draw(office):
    for inputs in ("T_oa", []):
        with pytest.raises(ValueError, match="is not a list of inputs; the models have T_oa"):
            StepResponseDisplay.from_estimator(office, inputs=inputs)
    with pytest.raises(ValueError, match="inputs= names 'u_hot', but the models have T_oa"):
        BodeDisplay.from_estimator(office, inputs=["u_hot"])
    with pytest.raises(ValueError, match="ax has 1 axes, but this display needs 5"):
        StepResponseDisplay.from_estimator(office, ax=plt.figure().add_subplot())
    with pytest.raises(ValueError, match="there is no model to draw"):
        BodeDisplay.from_estimator({})


# ------------------------------------------------------------------------------------------------------- hybrids
@pytest.fixture(scope="module")
def hybrid():
    """A hybrid and the rows after its training."""
    data = make_office(n_days=12, climate="chicago", start="2023-01-08", sampling_time="1h", random_state=0)
    X = data.X.assign(Q_hvac=6.0 * data.X["u_heat"] - 6.0 * data.X["u_cool"]).drop(columns=["u_heat", "u_cool"])
    n = 9 * 24
    model = HybridPredictor(random_state=0, intervals=False).fit(X[:n], X["T_za"][:n])
    return model, X[n:]


def test_the_step_response_of_a_hybrid_is_that_of_its_forecasts(hybrid):
    model, X = hybrid
    display = StepResponseDisplay.from_estimator(model, X=X, duration="10h", truth=None)
    assert set(display.responses) == {"blend", "network"}
    n_origins = (len(X) - 11) // 6 + 1
    running, future = deepcopy(model), X[12:23]
    running.update(X[:12])
    base = running.forecast(None, future)["T_za"]
    more = running.forecast(None, future.assign(Q_hvac=future["Q_hvac"] + 0.5))["T_za"]
    third = display.by_origin["blend"][2]["Q_hvac"]
    np.testing.assert_allclose(third, 2 * (more - base), rtol=0, atol=1e-9)
    assert third.index[-1] == pd.Timedelta("10h")
    network = running.to_state_space(None, future)
    path = network.simulate(np.ones(11)) - network.simulate(np.zeros(11))
    np.testing.assert_allclose(display.by_origin["network"][2]["Q_hvac"], path[:-1, 0], rtol=0, atol=1e-9)
    (panel,) = display.ax_
    values = np.array([frame["Q_hvac"] for frame in display.by_origin["blend"]])
    assert len(values) == n_origins
    np.testing.assert_allclose(_lines(panel)["blend"].get_ydata(), values.mean(axis=0))
    edges = panel.collections[list(display.responses).index("blend")].get_paths()[0].vertices[:, 1]
    assert edges.max() == pytest.approx(values.max())
    assert np.ptp(values[:, -1]) > 0  # it learns from day to day
    assert {f"blend, {n_origins} origins", "network"} <= {t.get_text() for t in display.figure_.legends[0].get_texts()}


def test_the_frequency_response_of_a_hybrid_is_that_of_a_planned_sinusoid(hybrid):
    model, X = hybrid
    display = BodeDisplay.from_estimator({"office": model}, X=X, periods=["4h", "20h"], origin_step="1D", phase=True)
    ahead = model.affine_forecast(None, X[:41])
    wave = np.exp(2j * np.pi / 4 * np.arange(41))  # begins 40 h earlier, in place of long before
    answer = ahead.temperature(wave.real) - ahead.free + 1j * (ahead.temperature(wave.imag) - ahead.free)
    found = display.by_origin["office, blend"][0]["Q_hvac"].iloc[0]
    assert abs(answer[-1] / (found * wave[-1]) - 1) < 0.15
    space = model.to_state_space(None, X[:41])
    system = StateSpace(space.A, space.B, space.C, np.zeros((1, 1)), space.states, space.inputs, space.sampling_time)
    exact = frequency_response(system, ["4h", "20h"])
    np.testing.assert_allclose(display.by_origin["office, network"][0], exact, rtol=0.01)
    assert all(ax.collections for ax in display.ax_)
    assert BodeDisplay.from_estimator(model, X=X, ax=None).responses["blend"].index[-1] == pd.Timedelta("1D")


def test_the_network_of_a_hybrid_responds_with_its_bends_as_the_blend_does():
    """With purpose="plan" the members have nearly the same response."""
    data = make_office(n_days=14, sampling_time="30min", random_state=4)
    n = 12 * 48
    model = HybridPredictor(known={"Q_h": 6.0, "Q_c": -5.0}, purpose="plan", intervals=False)
    model.fit(data.X[:n], data.y[:n])
    for display, longer in ((StepResponseDisplay, {"duration": "6h"}), (BodeDisplay, {"periods": ["6h"]})):
        with warnings.catch_warnings():
            warnings.simplefilter("error", PlanWarning)  # what the plant did is no plan
            found = display.from_estimator(model, X=data.X[n:], origin_step="1D", **longer).responses
        np.testing.assert_allclose(found["network"], found["blend"], rtol=0.15)


def test_the_legend_of_two_zones_fits_its_figure():
    frame = pd.DataFrame({"Q_hvac": [0.0, 1.0]}, pd.to_timedelta(["0h", "1h"]))
    labels = [f"{zone}, {member}" for zone in ("living", "kitchen") for member in ("network", "blend")]
    figure = StepResponseDisplay(dict.fromkeys(labels, frame), dict.fromkeys(labels, [frame] * 4)).plot().figure_
    figure.canvas.draw()
    assert figure.legends[0].get_window_extent().x1 <= figure.bbox.width


def test_a_hybrid_needs_rows_after_its_training(hybrid):
    model, X = hybrid
    with pytest.raises(ValueError, match="pass X, the table of rows after its training"):
        StepResponseDisplay.from_estimator(model)
    with pytest.raises(ValueError, match=r"X has 5 rows, but the response needs 13 \(13 h\)"):
        StepResponseDisplay.from_estimator(model, X=X[:5])
    with pytest.raises(ValueError, match=r"HybridPredictor is neither a StateSpace .*; .*StepResponseDisplay draws"):
        step_response(model)


def test_a_two_stage_predictor_is_its_network():
    data = make_office(n_days=4, sampling_time="1h", random_state=0)
    model = TwoStagePredictor(GrayBoxRC(known=data.theta), DisturbanceForecaster("profile")).fit(
        data.X[:72], data.y[:72]
    )
    display = StepResponseDisplay.from_estimator(model, X=data.X[72:], duration="6h", truth=model.gray_box_)
    assert set(display.responses) == {"true", "network"}
    found, expected = display.responses["network"], display.responses["true"]
    np.testing.assert_allclose(found, expected[list(found)], rtol=0, atol=1e-9)
