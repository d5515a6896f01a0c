"""``objective="multi_step"``: errors against plain loops and the model's own forecasts, slopes against differences."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID, RCNetwork
from skhybrid.datasets import make_office
from skhybrid.filtering import Model, multi_step_sensitivities
from skhybrid.identification import profile_likelihood
from skhybrid.identification.fitting.starts import random_starts
from skhybrid.identification.uncertainty.standard_errors import jackknife_covariance

pytestmark = pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
KINDS = [GrayBoxRC, InputDisturbanceID, OutputDisturbanceID]
KNOWN = {"Q_h": 6.0}
#: somewhere near the office
VALUES = {
    "C_w": 4.0, "C_m": 3.0, "C_za": 1.0, "R_zw": 1.2, "R_zm": 1.0, "R_wo": 5.0, "R_zo": 9.0, "f": 0.3, "A_win": 3.0,
    "Q_c": -5.0, "sigma_x": 0.02, "sigma_zeta": 0.3, "rho_1": 0.95, "rho_gap": -0.2, "T0_w": 23.0,
}  # fmt: skip
S, N, STATES, INPUTS, P = 2, 60, 4, 3, 3
ORIGINS, LEADS = np.array([5, 6, 20, 31, 50, 58]), np.array([1, 2, 7, 20])


# ------------------------------------------------------------------------------------------------------- the kernel
def drawn_model(rng, outputs):
    """S stable models with everything a derivative may pass through."""
    A = rng.normal(size=(S, STATES, STATES))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max(axis=1)[:, None, None]
    root, turn = rng.normal(size=(S, STATES, STATES)), rng.normal(size=(S, STATES, STATES, P))
    return Model(
        A=A,
        B=rng.normal(size=(S, STATES, INPUTS)),
        C=rng.normal(size=(outputs, STATES)),
        K=0.1 * rng.normal(size=(S, STATES, outputs)),
        Q=0.1 * root @ np.swapaxes(root, 1, 2),
        R=rng.uniform(0.1, 0.5, outputs),
        P0=np.eye(STATES),
        s0=rng.normal(size=(S, STATES)),
        dA=0.1 * rng.normal(size=(S, STATES, STATES, P)),
        dB=rng.normal(size=(S, STATES, INPUTS, P)),
        dK=0.1 * rng.normal(size=(S, STATES, outputs, P)),
        dQ=0.02 * (turn + np.swapaxes(turn, 1, 2)),
        ds0=rng.normal(size=(S, STATES, P)),
    )


@pytest.fixture(scope="module", params=[1, 2], ids=["one output", "two outputs"])
def case(request):
    rng = np.random.default_rng(request.param)
    y = rng.normal(size=(N, request.param))
    y[[0, 7, 8, 30, 31]] = np.nan
    y[12, 0] = np.nan  # of two outputs only one is missing
    return drawn_model(rng, request.param), rng.normal(size=(N, INPUTS)), y


def plain_forecasts(m, b, inputs, y, filtered):
    """(O, L, o): filter up to every origin with joint updates, then simulate; NaN after the last row."""
    out = np.full((len(ORIGINS), len(LEADS), y.shape[1]), np.nan)
    for a, origin in enumerate(ORIGINS):
        s, cov = m.s0[b].copy(), m.P0.copy()
        for k in range(origin + 1):
            seen = np.isfinite(y[k])
            e, C = y[k, seen] - m.C[seen] @ s, m.C[seen]
            if k < filtered:
                gain = cov @ C.T @ np.linalg.inv(C @ cov @ C.T + np.diag(m.R[seen]))
                s, cov = m.A[b] @ (s + gain @ e) + m.B[b] @ inputs[k], cov - gain @ C @ cov
                cov = m.A[b] @ cov @ m.A[b].T + m.Q[b]
            else:
                s = m.A[b] @ s + m.B[b] @ inputs[k] + m.K[b][:, seen] @ e
        for k in range(origin + 1, min(origin + LEADS[-1] + 1, N)):
            if k - origin in LEADS:
                out[a, list(LEADS).index(k - origin)] = m.C @ s
            s = m.A[b] @ s + m.B[b] @ inputs[k]
    return out


@pytest.mark.parametrize("filtered", [0, 25, N], ids=["constant gain", "both", "filter"])
def test_errors_are_those_of_forecasts_by_a_plain_loop(case, filtered):
    m, inputs, y = case
    found = multi_step_sensitivities(m, inputs, y, filtered, False, ORIGINS, LEADS).errors
    rows = ORIGINS[:, None] + LEADS
    for b in range(S):
        expected = np.where(rows[..., None] < N, y[np.minimum(rows, N - 1)], np.nan)
        expected = expected - plain_forecasts(m, b, inputs, y, filtered)
        missing = np.isnan(expected)
        assert 3 < missing.sum() < missing.size / 2
        assert (found[b][missing] == 0).all()
        np.testing.assert_allclose(found[b][~missing], expected[~missing], rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("filtered", [0, N], ids=["constant gain", "filter"])
def test_slopes_are_exact(case, filtered):
    m, inputs, y = case
    found = multi_step_sensitivities(m, inputs, y, filtered, False, ORIGINS, LEADS).derrors
    step = 1e-5
    for q in range(P):
        ends = []
        for t in (step, -step):
            moved = {name: getattr(m, name) + t * getattr(m, f"d{name}")[..., q] for name in ("A", "B", "K", "Q", "s0")}
            ends.append(multi_step_sensitivities(m._replace(**moved), inputs, y, filtered, False, ORIGINS, LEADS))
        expected = (ends[0].errors - ends[1].errors) / (2 * step)
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(found[..., q], expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


# ------------------------------------------------------------------------------------------------------ the problem
@pytest.fixture(scope="module")
def office():
    return make_office(n_days=12, sampling_time="30min", random_state=3)


@pytest.fixture(scope="module")
def holed(office):
    """The office of six days with single rows, three hours and every target of one night missing."""
    X, y = office.X.iloc[:288].copy(), office.y.iloc[:288].copy()
    y.iloc[[5, 100, 103, *range(140, 146), *range(200, 212), 287]] = np.nan
    return X.assign(T_za=y), y


def problem_of(model, X, y):
    return model._make_problem(*model._prepare(X, y))[0]


@pytest.mark.parametrize("network", ["2R2C", "4R3C"])
@pytest.mark.parametrize("kind", KINDS)
def test_jacobian_is_exact(kind, network, holed):
    problem = problem_of(kind(network, known=KNOWN, objective="multi_step", random_state=0), *holed)
    x = np.array([p.to_free(VALUES.get(p.name, p.default)) for p in problem.searched])
    found = problem.linearised(x)[1]
    moved = [[problem.residuals(x + k * d) for k in (-2, -1, 1, 2)] for d in 1e-3 * np.eye(len(x))]
    expected = np.array([(a - 8 * b + 8 * c - d) / 12e-3 for a, b, c, d in moved]).T
    scale = np.abs(expected).max(axis=0)
    assert (scale > 1e-4).all()  # every parameter moves something, so that the comparison can fail
    assert (np.abs(found - expected) / scale).max() < 1e-6
    merit, matrix, half = problem.evaluate(x[None])
    e = problem.residuals(x)
    assert merit[0] == pytest.approx(e @ e)
    np.testing.assert_allclose(half[0], expected.T @ e, rtol=1e-4, atol=1e-5 * np.abs(half).max())
    np.testing.assert_allclose(matrix[0], found.T @ found, rtol=1e-9, atol=1e-9 * np.abs(matrix).max())


@pytest.mark.parametrize("kind", KINDS)
def test_errors_are_those_of_the_models_own_forecasts(kind, holed):
    """The errors are those of ``predict_from`` on the same rows, from a start about which as much is known."""
    X, y = holed
    model = kind(known=KNOWN, objective="multi_step", n_starts=2, random_state=0)
    model.set_params(warmup="30D" if kind is GrayBoxRC else "1D").fit(X, y)
    problem, (sample,) = problem_of(model, X, y), problem_of(model, X, y).samples
    values = {**model.theta_, **model.disturbance_}
    errors = problem.residuals(np.array([p.to_free(values[p.name]) for p in problem.searched]))
    if kind is not OutputDisturbanceID:  # whose first state is the one that was searched; the others start cold
        X = X.set_index(X.index + pd.Timedelta("364D"))
    forecasts = model.predict_from(X, sample.origins, "1D")[:, sample.leads - 1]
    rows = np.minimum(sample.origins[:, None] + sample.leads, len(y) - 1)
    expected = np.where(np.isfinite(forecasts), y.to_numpy()[rows] - forecasts, np.nan)
    seen = np.isfinite(expected)
    assert 0.5 < seen.mean() < 0.99
    # OD keeps its first measurement smoothed, by some microkelvins
    near = 1e-4 if kind is OutputDisturbanceID else 1e-8
    np.testing.assert_allclose(errors[seen.ravel()], expected[seen], rtol=0, atol=near)
    assert (errors[~seen.ravel()] == 0).all()
    assert model.loss_ == pytest.approx(errors @ errors, rel=1e-9)
    assert problem.days[-1] + 1 == (6 if kind is OutputDisturbanceID else 5)


def test_stretches_are_forecast_each_by_itself(office):
    model = InputDisturbanceID(known=KNOWN, objective="multi_step")
    parts = [slice(0, 150), slice(170, 400)]
    X, y = (pd.concat([table.iloc[part] for part in parts]) for table in (office.X, office.y))
    whole = problem_of(model, X, y)
    segments = [problem_of(model, office.X.iloc[part], office.y.iloc[part]) for part in parts]
    x = random_starts(whole.searched, 1, np.random.RandomState(0))[0]
    np.testing.assert_allclose(whole.residuals(x), np.concatenate([p.residuals(x) for p in segments]), rtol=1e-12)
    starts = zip(whole.experiment.breaks, whole.samples, strict=True)
    days = [(origin + first) // 48 for first, sample in starts for origin in sample.origins for _ in sample.leads]
    np.testing.assert_array_equal(whole.days, np.unique(days, return_inverse=True)[1])


@pytest.mark.parametrize("kind", KINDS)
def test_two_rooms_are_forecast_at_once(kind, office):
    """Rooms that nothing connects: the errors are those of each by itself."""
    ends = {"a": {"R_a": ("a", "T_oa")}, "b": {"R_b": ("b", "T_oa")}}
    rooms, resistors = ("a", "b"), ends["a"] | ends["b"]
    both = RCNetwork("rooms", {"a": "C_a", "b": "C_b"}, resistors, measured=rooms, disturbed=rooms, heated="a")
    y = pd.DataFrame({"T_a": office.y, "T_b": office.y.iloc[::-1].to_numpy()}, index=office.X.index).iloc[:200]
    y.iloc[[21, 23], 0], y.iloc[[71, 75], 1] = np.nan, np.nan  # off the hours, so that all have the same origins
    X = office.X.iloc[:200][["T_oa"]]
    values = {"C_a": 1.0, "C_b": 2.0, "R_a": 5.0, "R_b": 8.0, "sigma_x": 0.1, "sigma_zeta": 0.2} | VALUES

    def errors(network, target):
        problem = problem_of(kind(network, objective="multi_step"), X, target)
        found = problem.residuals(np.array([p.to_free(values[p.name]) for p in problem.searched]))
        return found.reshape(-1, target.to_numpy()[0].size)

    found = errors(both, y)
    for j, (room, resistors) in enumerate(ends.items()):
        alone = RCNetwork(room, {room: f"C_{room}"}, resistors, measured=room, disturbed=room, heated=room)
        expected = errors(alone, y[f"T_{room}"])
        assert expected.std() > 0.1
        np.testing.assert_allclose(found[:, j], expected[:, 0], rtol=1e-9, atol=1e-9)


def test_origins_are_hourly_and_leads_reach_the_horizon(office):
    model = InputDisturbanceID(known=KNOWN, objective="multi_step", horizon="6h", warmup="12h")
    (sample,) = problem_of(model, office.X, office.y).samples
    assert (np.diff(sample.origins) == 2).all()
    assert sample.origins[0] == 24
    assert (sample.leads[0], sample.leads[-1]) == (1, 12)
    (day,) = problem_of(model.set_params(horizon=None), office.X, office.y).samples
    assert day.leads[-1] == 48


def test_a_slow_thermometer_is_compared_where_it_reports(office):
    """One measurement in three, off the hours: most targets are measured all the same."""
    y = office.y.where(np.arange(len(office.y)) % 3 == 1)
    model = InputDisturbanceID(known=KNOWN, objective="multi_step", max_missing=0.7, horizon="18h")
    problem = problem_of(model, office.X, y)
    since_first = y.to_numpy()[1:]  # the first measured row is the first that is read
    assert np.isfinite(since_first[problem.samples[0].origins]).all()
    assert problem.n_counted > 20


def test_overlapping_forecasts_count_for_less(office):
    """Errors one step ahead are all independent; at longer leads they share noise."""
    near = problem_of(InputDisturbanceID(known=KNOWN, objective="multi_step", horizon="30min"), office.X, office.y)
    far = problem_of(InputDisturbanceID(known=KNOWN, objective="multi_step"), office.X, office.y)
    assert near.n_counted == near.n_entries == 11 * 24
    assert 11 < far.n_counted < 11 * 24 / 3
    assert (near.overlap, far.overlap) == (2, 2)
    free = np.array([p.to_free(p.default) for p in far.searched])
    expected = np.sum(far.residuals(free) ** 2) / (far.n_counted - len(free))
    assert far.noise(free) == pytest.approx(expected)


# ------------------------------------------------------------------------------------------------------- the fits
@pytest.mark.parametrize("kind", KINDS)
def test_without_noise_the_building_is_found(kind, office):
    rng, n = np.random.default_rng(0), 8 * 48
    index = pd.date_range("2023-03-06", periods=n, freq="30min")
    X = pd.DataFrame({"T_oa": 5 + 5 * np.sin(np.arange(n) / 48 * 2 * np.pi)}, index=index)
    X["q_sol"] = np.clip(np.sin((np.arange(n) % 48 / 48 - 0.25) * 2 * np.pi), 0, None) * rng.uniform(0.2, 0.7, n)
    X["u_heat"] = np.repeat(rng.integers(0, 2, n // 8), 8)
    X["u_cool"] = np.repeat(rng.integers(0, 2, n // 12), 12) * (1 - X["u_heat"])
    X["T_za"] = 20.0
    truth = GrayBoxRC(known=office.theta).fit(X, X["T_za"])
    y = truth.simulate(X, initial_state=[21.0, 20.0])
    model = kind(known=KNOWN, n_starts=10, random_state=0, objective="multi_step").fit(X.assign(T_za=y), y)
    assert (model.theta_ / pd.Series(office.theta) - 1).abs().max() < 0.01
    assert np.sqrt(model.loss_ / 2000) < 0.02


@pytest.fixture(scope="module")
def split():
    whole = make_office(n_days=21, random_state=0)
    return (whole.X.iloc[:1344], whole.y.iloc[:1344]), (whole.X.iloc[1344:], whole.y.iloc[1344:])


def test_forecasts_are_better_and_parameters_worse(split):
    """One seed of benchmarks/objectives.py: forecasts of a day, made every hour of the week after the training."""
    (X, y), (X2, y2) = split
    origins = np.arange(0, len(X2) - 96, 4)
    truth = y2.to_numpy()[origins[:, None] + np.arange(1, 97)]
    rmse, noise, area = {}, {}, {}
    for objective in ("one_step", "multi_step"):
        model = InputDisturbanceID(known=KNOWN, n_starts=10, horizon="1D", random_state=0, objective=objective)
        model.fit(X, y)
        rmse[objective] = np.sqrt(np.mean((model.predict_from(X2, origins) - truth) ** 2))
        noise[objective], area[objective] = model.noise_std_, model.theta_["A_win"]
        e = model.innovations(X)["innovation"]
        assert model.noise_std_ == pytest.approx(e.iloc[96:].std(), rel=0.15)  # of errors one step ahead, either way
    assert rmse["multi_step"] < 0.7 * rmse["one_step"]
    assert noise["one_step"] < noise["multi_step"]
    assert abs(area["one_step"] - 3.0) < abs(area["multi_step"] - 3.0)


def test_standard_errors_know_that_forecasts_overlap(split):
    """Were the forecasts independent, the errors would be a fraction of these."""
    (X, y), _ = split
    model = GrayBoxRC(known=KNOWN, n_starts=4, random_state=0, objective="multi_step").fit(X, y)
    problem = problem_of(model, X, y)
    values = {**model.theta_, **model.disturbance_}
    x = np.array([p.to_free(values[p.name]) for p in problem.searched])
    e, J = problem.linearised(x)
    naive = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * (e @ e) / len(e))
    relative = (model.theta_std_ / model.theta_.abs())[[p.name for p in problem.searched]].to_numpy()
    assert (relative > 3 * naive).all()
    assert np.isfinite(relative).all()


def test_neighbouring_blocks_add_their_products():
    rng = np.random.default_rng(0)
    moves = rng.normal(size=(12, 2))
    moves[1:, 0] += moves[:-1, 0]  # goes together with its neighbour; the other does not
    moves[1:, 1] -= moves[:-1, 1]
    variance = sum(moves[i, 0] ** 2 for i in range(12))
    for lag, weight in ((1, 2 / 3), (2, 1 / 3)):
        variance += 2 * weight * sum(moves[i, 0] * moves[i + lag, 0] for i in range(12 - lag))
    found, plain = jackknife_covariance(moves, 2), jackknife_covariance(moves)
    assert found[0, 0] == pytest.approx(11 / 12 * variance)
    assert found[0, 0] > plain[0, 0]
    assert found[1, 1] == pytest.approx(plain[1, 1])  # never smaller
    correlation = [c[0, 1] / np.sqrt(c[0, 0] * c[1, 1]) for c in (found, plain)]
    assert correlation[0] == pytest.approx(correlation[1])
    np.testing.assert_allclose(plain, 11 / 12 * moves.T @ moves)
    np.testing.assert_allclose(jackknife_covariance(1e-3 * moves, 2), 1e-6 * found)  # in any unit


# ------------------------------------------------------------------------------------------------------- bad input
def test_what_cannot_be_is_refused(office):
    X, y = office.X, office.y
    with pytest.raises(ValueError, match="objective='day' is neither 'one_step' nor 'multi_step'"):
        GrayBoxRC(objective="day").fit(X, y)
    with pytest.raises(ValueError, match="horizon='50min' is not a positive multiple of the sampling time of 30 min"):
        InputDisturbanceID(objective="multi_step", horizon="50min").fit(X, y)
    lonely = y.iloc[:10].where(np.arange(10) < 2)  # the first origin lies after the last measurement
    with pytest.raises(ValueError, match="finds no measurement of y after another one"):
        InputDisturbanceID(known=KNOWN, objective="multi_step", max_missing=0.9).fit(X.iloc[:10], lonely)
    with pytest.raises(TypeError, match="objective"):
        PeriodicDisturbanceID(objective="multi_step")


def test_errors_of_forecasts_are_no_likelihood(office):
    model = InputDisturbanceID(known=KNOWN, n_starts=1, random_state=0, objective="multi_step").fit(office.X, office.y)
    with pytest.raises(ValueError, match='objective="multi_step" has no likelihood'):
        profile_likelihood(model, office.X, office.y, "C_za")


def test_a_prior_holds_what_few_errors_do_not(office):
    """A tight prior wins over the forecasts, and the sign of its pull is that of the prior."""
    plain = GrayBoxRC(known=KNOWN, n_starts=2, random_state=0, objective="multi_step").fit(office.X, office.y)
    held = clone(plain).set_params(priors={"A_win": (3.0, 1.05)}).fit(office.X, office.y)
    assert held.theta_["A_win"] == pytest.approx(3.0, rel=0.05)
    assert plain.theta_["A_win"] > 1.2 * held.theta_["A_win"]
