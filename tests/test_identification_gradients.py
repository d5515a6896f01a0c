"""Objectives of the identifications: exact derivatives, and the periodic one against a dense Gaussian."""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import block_diag, expm
from scipy.optimize import lsq_linear

from skhybrid.identification.disturbance_models import (
    HIDDEN_SD,
    MEASURED_SD,
    Conventional,
    InputRandomWalk,
    OutputARMA,
    first_covariance,
)
from skhybrid.identification.experiment import Experiment
from skhybrid.identification.fitting.gauss_newton import minimise_together
from skhybrid.identification.fitting.periodic_channels import PeriodicChannel, physical
from skhybrid.identification.fitting.periodic_likelihood import PRIOR_LOG_SD, PeriodicProblem
from skhybrid.identification.fitting.prediction_errors import PredictionErrorProblem
from skhybrid.identification.gain_model import (
    DAY_PRIOR,
    DAY_TYPES,
    HOUR_CLASSES,
    LEVEL_SD,
    N_HARMONICS,
    SIGMA_PRIOR,
    VENTILATION_SD,
    VarianceModel,
    gain_parameters,
    profile_basis,
)
from skhybrid.thermal import RCNetwork, get_network

ROLES = ("T_oa", "q_sol", "u_cool", "u_heat")
NETWORKS = ("1R1C", "2R2C", "4R3C")
VALUES = {
    "C_w": 4.0, "C_m": 3.0, "C_za": 1.0, "R_zw": 1.2, "R_zm": 1.0, "R_wo": 5.0, "R_zo": 9.0, "f": 0.3, "A_win": 3.0,
    "Q_h": 6.0, "Q_c": -5.0,
    "sigma_x": 0.02, "sigma_zeta": 0.3, "rho_1": 0.95, "rho_gap": -0.2, "rho_2": 0.9, "T0_w": 21.0, "T0_m": 22.0,
    "tau": 4.0, "sigma_y": 0.05, "sigma_profile_weekday": 0.3, "sigma_profile_weekend": 0.2,
    **{f"sigma_{c}": 0.2 + 0.03 * i for hours in HOUR_CLASSES.values() for i, c in enumerate(hours.names)},
    **{f"day_{d}": 0.3 - 0.2 * d for d in range(6)},
}  # fmt: skip


def drawn_experiment(name, n_rows, step, start="2023-07-07 12:00", seed=0):
    """A room that a network with known parameters has, with missing measurements and inputs of every kind."""
    rng, network = np.random.default_rng(seed), get_network(name)
    time = pd.date_range(start, periods=n_rows, freq=step)  # a Friday
    hour, hours = time.hour + time.minute / 60, pd.Timedelta(step) / pd.Timedelta("1h")
    heating = rng.integers(0, 2, n_rows)
    columns = {
        "T_oa": 15.0 + 5.0 * np.sin((hour - 9) * np.pi / 12) + rng.normal(size=n_rows),
        "q_sol": np.clip(np.sin((hour - 6) * np.pi / 12), 0, None) * rng.uniform(0.2, 0.6, n_rows),
        "u_heat": heating * rng.uniform(0.1, 1.0, n_rows),
        "u_cool": (1 - heating) * rng.uniform(0.1, 1.0, n_rows),
    }
    inputs = np.column_stack([*(columns[r] for r in network.inputs(ROLES)), np.zeros(n_rows)])
    d = network.discrete(VALUES, ROLES, hours)
    gain = 0.5 + np.asarray((hour > 8) & (time.day_of_week < 5)) + 0.2 * rng.normal(size=n_rows)
    x, y = np.full(len(network.nodes), 22.0), np.empty(n_rows)
    for k in range(n_rows):
        y[k] = x[network.nodes.index("za")] + 0.03 * rng.normal()
        x = d.A @ x + d.B @ inputs[k] + d.B[:, -1] * gain[k]
    y[[1, n_rows // 3, n_rows // 3 + 1, n_rows - 3]] = np.nan
    return Experiment(y, inputs, ROLES, hours, time.hour.to_numpy(np.int64), np.asarray(time.day_of_week >= 5))


def differences(function, x, step=1e-3):
    """Fourth-order central differences by each entry of x, stacked last."""
    columns = []
    for unit in np.eye(len(x)) * step:
        f = [np.asarray(function(x + k * unit)) for k in (-2, -1, 1, 2)]
        columns.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step))
    return np.array(columns).T


# ------------------------------------------------------------------------------------------- CONV, ID and OD
def disturbance_of(kind, network):
    hidden = tuple(n for n in network.nodes if n != network.measured)
    return {
        "CONV": Conventional(20),
        "ID": InputRandomWalk(),
        "ID-noise": InputRandomWalk(measurement_sd=0.1),
        "OD": OutputARMA(hidden, (22.0,)),
        "OD-paper": OutputARMA(hidden, (22.0,), paper_box=True),
    }[kind]


@pytest.fixture(scope="module", params=NETWORKS)
def experiment(request):
    return request.param, drawn_experiment(request.param, 150, "30min")


@pytest.mark.parametrize("kind", ["CONV", "ID", "ID-noise", "OD", "OD-paper"])
@pytest.mark.parametrize("known", [(), ("Q_h", "R_zo")], ids=["free", "two known"])
def test_jacobian_is_exact(kind, known, experiment):
    name, e = experiment
    network = get_network(name)
    disturbance = disturbance_of(kind, network)
    searched = tuple(p for p in (*network.parameters(ROLES), *disturbance.own) if p.name not in known)
    problem = PredictionErrorProblem(network, e, disturbance, searched, {k: VALUES[k] for k in known})
    x = np.array([p.to_free(VALUES[p.name]) for p in searched])
    found, expected = problem.linearised(x)[1], differences(problem.residuals, x)
    assert found.shape == (len(e.y) - disturbance.first_counted(len(e.y)), len(searched))
    scale = np.abs(expected).max(axis=0)
    assert (scale > 1e-5).all()  # every parameter moves something, so that the comparison can fail
    assert (np.abs(found - expected) / scale).max() < 1e-6
    missing = ~np.isfinite(e.y[disturbance.first_counted(len(e.y)) :])
    assert missing.any()
    assert (found[missing] == 0).all()


def test_the_first_covariance_by_hand():
    network = get_network("2R2C")
    by_node = [0.25 if node == "za" else 4.0 for node in network.nodes]
    np.testing.assert_array_equal(first_covariance(network), np.diag(by_node))
    np.testing.assert_array_equal(first_covariance(network, 0.5), np.diag([*by_node, 0.25]))


def test_bounds_of_the_arma_model():
    """The longest memory is the same at any step, unless the box is the paper's."""
    for paper_box, second, longest in ((False, "rho_gap", 0.999**2), (True, "rho_2", 0.999)):
        own = OutputARMA(("w",), (22.0,), paper_box, hours=0.5).own
        found = {p.name: (p.lower, p.upper) for p in own}
        assert found == {"rho_1": (-longest, longest), second: (-0.999, 0.999), "T0_w": (2.0, 42.0)}


def problem_of(kind, name, e):
    network = get_network(name)
    disturbance = disturbance_of(kind, network)
    searched = (*network.parameters(ROLES), *disturbance.own)
    problem = PredictionErrorProblem(network, e, disturbance, searched, {})
    return problem, np.array([p.to_free(VALUES[p.name]) for p in searched])


def dense_gaussian(kind, name, e, values):
    """Mean (N,) and covariance (N, N) of all rows; for OD in units of its own noise."""
    network, N = get_network(name), len(e.y)
    n, za = len(network.nodes), network.nodes.index("za")
    d = network.discrete(values, e.roles, e.hours)
    x = np.full(n, e.firsts.mean())
    if kind == "OD":
        for node in disturbance_of("OD", network).hidden:
            x[network.nodes.index(node)] = values[f"T0_{node}"]
    mean = np.empty(N)
    for k in range(N):
        mean[k] = x[za]
        x = d.A @ x + d.B @ e.inputs[k]
    if kind == "OD":
        rho_1, rho_2 = values["rho_1"], values["rho_1"] - values["rho_gap"]
        turn = np.eye(N)
        for k in range(1, N):
            for i in range(k):
                turn[k, i] = rho_2 * rho_1 ** (k - 1 - i)
        return mean, turn @ turn.T
    # the walk is the last input; every shock of a state reaches all later rows
    big = np.block([[d.A, d.B[:, -1:]], [np.zeros((1, n)), np.eye(1)]])
    first = np.append(np.full(n, HIDDEN_SD), 1.0)
    first[za] = MEASURED_SD
    reach = [np.linalg.matrix_power(big, k)[za] for k in range(N)]
    covariance = (0.25**2 / (e.hours * 3600.0)) * np.eye(N)
    shock = np.append(np.full(n, values["sigma_x"]), values["sigma_zeta"])
    for born in range(N):
        sd = first if born == 0 else shock
        rows = np.zeros((N, n + 1))
        rows[born:] = np.array(reach[: N - born]) * sd
        covariance += rows @ rows.T
    return mean, covariance


@pytest.mark.parametrize("kind", ["OD", "ID"])
def test_with_missing_rows_the_sum_of_squares_is_the_likelihood(kind, experiment):
    """``-n/2 log(loss)`` differs between two points as the Gaussian likelihood with the noise level at its optimum."""
    name, e = experiment
    problem, x = problem_of(kind, name, e)
    assert problem.weighted
    seen = np.isfinite(e.y)
    n, found, expected = int(seen.sum()), [], []
    for point in (x, x + 0.05 * np.cos(np.arange(len(x)))):
        mean, V = dense_gaussian(kind, name, e, problem.values(point))
        root = np.linalg.cholesky(V[np.ix_(seen, seen)])
        z, variances = np.linalg.solve(root, (e.y - mean)[seen]), np.diag(root) ** 2
        expected.append(-0.5 * n * np.log(z @ z) - 0.5 * np.log(variances).sum())
        loss, _, _ = problem.evaluate(point[None])
        assert loss[0] == pytest.approx(np.sum(problem.residuals(point) ** 2), rel=1e-12)
        found.append(-0.5 * n * np.log(loss[0]))
        assert problem.mean_variance(point) == pytest.approx(np.exp(np.log(variances).mean()), rel=1e-9)
    assert abs(expected[1] - expected[0]) > 0.1
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], abs=1e-8)


@pytest.mark.parametrize("kind", ["CONV", "OD"])
def test_where_no_row_is_missing_between_others_errors_count_as_they_are(kind, experiment):
    name, e = experiment
    whole = pd.Series(e.y).interpolate().to_numpy(copy=True)
    whole[[0, 1, -1]] = np.nan  # before the first measured row, and after the last
    problem, x = problem_of(kind, name, e._replace(y=whole))
    assert not problem.weighted
    assert problem.mean_variance(x) == 1.0
    apart = problem_of(kind, name, e._replace(y=np.where(np.arange(len(e.y)) < 70, whole, np.nan)))[0]
    assert not apart.weighted
    # the errors of the first rows know nothing of what is missing later
    gap = whole.copy()
    gap[80:90] = np.nan
    other, _ = problem_of(kind, name, e._replace(y=gap))
    assert other.weighted == (kind != "CONV")
    first = problem.disturbance.first_counted(len(e.y))
    ratio = other.residuals(x)[2 : 80 - first] / problem.residuals(x)[2 : 80 - first]
    if kind != "CONV":  # one ratio until the gap
        np.testing.assert_allclose(ratio, np.sqrt(other.mean_variance(x)), rtol=1e-9)
        assert ratio[0] > 1.001
    if kind == "CONV":
        np.testing.assert_allclose(ratio, 1.0, rtol=1e-12)


# -------------------------------------------------------------------------------------------------------- periodic
#: known, and solved inside
SETTINGS = {
    "all inside": ({"Q_h": 6.0}, ("Q_c", "A_win")),
    "area searched": ({"Q_h": 6.0}, ("Q_c",)),
    "none inside": ({"Q_h": 6.0, "A_win": 2.0}, ()),
    "everything inside": ({"R_zo": 9.0}, ("Q_h", "Q_c", "A_win")),
}


def periodic_problem(name, e, setting, heat_scale=1.3, hours="3h"):
    network = get_network(name)
    fixed, inner = SETTINGS[setting]
    solved = {*fixed, *inner, *({"f"} if "A_win" in inner else ())}
    classes = HOUR_CLASSES[hours]
    own = gain_parameters(len(VarianceModel.of(e, classes).first_rows), classes)
    searched = tuple(p for p in (*network.parameters(ROLES), *own) if p.name not in solved)
    problem = PeriodicProblem(network, e, searched, fixed, inner, heat_scale, hours=hours)
    return problem, np.array([p.to_free(VALUES[p.name]) for p in searched])


def assert_exact_gradient(problem, x):
    found, expected = problem.evaluate(x)[1], differences(lambda v: problem.evaluate(v)[0], x)
    moved = np.abs(expected) > 1e-4
    assert moved[[p.name[0] in "CRf" or p.name in ("tau", "sigma_y") for p in problem.searched]].all()
    assert moved.mean() > 0.9  # else there would be little to compare
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("hours", HOUR_CLASSES)
@pytest.mark.parametrize("setting", SETTINGS)
def test_periodic_gradient_is_exact(setting, hours, experiment):
    name, e = experiment
    assert_exact_gradient(*periodic_problem(name, e, setting, hours=hours))


def test_periodic_gradient_is_exact_over_stretches():
    e = drawn_experiment("2R2C", 150, "30min")._replace(breaks=(0, 50, 90))
    assert_exact_gradient(*periodic_problem("2R2C", e, "all inside"))


def test_stretches_forget_each_other():
    """Rows after a gap start anew: with all else known, the objective of two segments is the sum of theirs."""
    e = drawn_experiment("2R2C", 144, "30min", start="2023-07-06")  # three days, cut at a midnight
    split = e._replace(breaks=(0, 48))
    # hardly any profile, so that nothing but the searched parameters is shared
    tiny = 1e-6
    losses = []
    for segment, days in ((split, (0, 1, 2)), (e.rows(slice(0, 48)), (0,)), (e.rows(slice(48, 144)), (1, 2))):
        names = {f"day_{d}": VALUES[f"day_{day}"] for d, day in enumerate(days)}
        problem, _ = periodic_problem("2R2C", segment, "none inside", heat_scale=tiny)
        values = {p.name: names.get(p.name, VALUES[p.name]) for p in problem.searched}
        x = np.array([p.to_free(values[p.name]) for p in problem.searched])
        prior = 0.5 * float((((x - problem.centre) / problem.spread) ** 2).sum())
        losses.append(problem.evaluate(x)[0] - prior)
    assert losses[0] == pytest.approx(losses[1] + losses[2], rel=1e-6)


def test_periodic_gradient_is_exact_for_two_rooms():
    """Two measured temperatures, two disturbed nodes, each with a gain state and a profile of its own."""
    rooms = ("a", "b")
    network = RCNetwork(
        "rooms",
        {"a": "C_a", "b": "C_b"},
        {"R_ab": rooms, "R_a": ("a", "T_oa"), "R_b": ("b", "T_oa")},
        measured=rooms,
        disturbed=rooms,
        heated="a",
    )
    one = drawn_experiment("2R2C", 100, "1h")
    rng = np.random.default_rng(3)
    y = np.column_stack([one.y, 21.0 + np.cumsum(0.1 * rng.normal(size=100))])
    y[10:14, 1] = np.nan
    columns = [one.inputs[:, 0], one.inputs[:, 2], np.zeros(100), np.zeros(100)]
    e = one._replace(y=y, inputs=np.column_stack(columns), roles=("T_oa", "u_heat"))
    values = VALUES | {f"day_{d}": 0.1 * d for d in range(6)} | {"C_a": 1.0, "C_b": 1.5, "R_ab": 2.0, "R_a": 6.0}
    values |= {"R_b": 8.0}
    classes = HOUR_CLASSES["day_night"]
    own = gain_parameters(len(VarianceModel.of(e, classes).first_rows), classes)
    searched = tuple(p for p in (*network.parameters(e.roles), *own) if p.name != "Q_h")
    problem = PeriodicProblem(network, e, searched, {"Q_h": 6.0}, ())
    x = np.array([p.to_free(values[p.name]) for p in searched])
    assert problem.evaluate(x)[2].beta.shape == (2 * (2 * (1 + 2 * N_HARMONICS) + 1),)
    assert_exact_gradient(problem, x)


def test_periodic_gradient_is_exact_over_the_shares_of_measured_heat():
    """Measured heat has no capacity, but its share to each node is searched."""
    walls = {"w": "C_w", "za": "C_za"}, {"R_zw": ("za", "w"), "R_zo": ("za", "T_oa")}
    network = RCNetwork("radiant", *walls, heated={"za": "f_air", "w": None})
    one = drawn_experiment("2R2C", 150, "30min")
    columns = [one.inputs[:, 0], 6.0 * one.inputs[:, 2], np.zeros(150)]
    e = one._replace(inputs=np.column_stack(columns), roles=("T_oa", "Q_hvac"))
    classes = HOUR_CLASSES["day_night"]
    own = gain_parameters(len(VarianceModel.of(e, classes).first_rows), classes)
    searched = (*network.parameters(e.roles), *own)
    assert "f_air" in [p.name for p in searched]
    problem = PeriodicProblem(network, e, searched, {}, ())
    assert_exact_gradient(problem, np.array([p.to_free({**VALUES, "f_air": 0.6}[p.name]) for p in searched]))


@pytest.mark.parametrize("name", NETWORKS)
def test_periodic_gradient_is_exact_where_a_sign_binds(name):
    """Cooling that the data would have heat: its coefficient stays at 0, and the gradient is that of the rest."""
    e = drawn_experiment(name, 150, "30min")
    j = get_network(name).inputs(ROLES).index("u_cool")
    inputs = e.inputs.copy()
    inputs[:, j] *= -1.0
    problem, x = periodic_problem(name, e._replace(inputs=inputs), "all inside")
    _, found, linear = problem.evaluate(x)
    place = [c.name for c in problem.layout.channels].index("Q_c")
    assert linear.beta[place] == 0.0
    expected = differences(lambda v: problem.evaluate(v)[0], x)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


# ------------------------------------------------------------------- a dense computation of the periodic objective
def hold(A, B, hours):
    """Zero-order hold by the matrix exponential."""
    n, m = B.shape
    big = expm(hours * np.block([[A, B], [np.zeros((m, n + m))]]))
    return big[:n, :n], big[:n, n:]


def dense_objective(name, e, values, inner, heat_scale):
    """The periodic objective from the joint Gaussian of all measurements at once.

    Negative log marginal likelihood (without 2 pi), plain coefficients by generalised least squares, their covariance,
    and the posterior mean of the profile.
    """
    network, N = get_network(name), len(e.y)
    nodes = network.nodes
    n, za = len(nodes), nodes.index("za")
    full = {**VALUES, **values}
    continuous = network.matrices(full, ("T_oa",))
    per_node = np.diag(1.0 / continuous.capacitance)
    Ad, Bd = hold(continuous.A, np.column_stack([continuous.B[:, 0], per_node]), e.hours)
    outdoor, heat = Bd[:, 0], Bd[:, 1:]
    power = [np.linalg.matrix_power(Ad, k) for k in range(N + 1)]

    def response(node, series):
        """Measured temperature after heat [kW] on a node."""
        return np.array([sum(power[k - 1 - j][za] @ heat[:, node] * series[j] for j in range(k)) for k in range(N)])

    column = dict(zip(network.inputs(ROLES), e.inputs.T, strict=False))
    mean = np.array([power[k][za].sum() * e.firsts.mean() for k in range(N)])
    mean += np.array([sum(power[k - 1 - j][za] @ outdoor * column["T_oa"][j] for j in range(k)) for k in range(N)])
    plain = []
    for parameter, role in (("A_win", "q_sol"), ("Q_h", "u_heat"), ("Q_c", "u_cool")):
        if parameter == "A_win":
            left = 1.0 - (full["f"] if "f" in network.solar.values() else 0.0)
            shares = [(nodes.index(node), full[f] if f else left) for node, f in network.solar.items()]
        else:
            shares = [(za, 1.0)]
        if parameter in inner:  # a coefficient of its own for every node that it heats
            plain += [response(node, column[role]) for node, _ in shares]
        else:
            mean += full[parameter] * sum(share * response(node, column[role]) for node, share in shares)
    plain = np.array(plain).reshape(-1, N).T

    cell = e.hour_of_day + 24 * e.weekend
    cells = np.array([response(za, (cell == j).astype(float)) for j in range(48)]).T
    # a cyclic walk of unit steps, of which the slow waves are kept: their variance in closed form
    lag = 2 * np.pi * np.subtract.outer(np.arange(24), np.arange(24)) / 24
    waves = range(1, N_HARMONICS + 1)
    walk = sum(np.cos(k * lag) / 24 / (1 - np.cos(2 * np.pi * k / 24)) for k in waves)
    steps = np.array([full[f"sigma_profile_{kind}"] for kind in DAY_TYPES]) * heat_scale
    profile = np.kron(np.eye(2), np.full((24, 24), (LEVEL_SD * heat_scale) ** 2)) + np.kron(np.diag(steps**2), walk)
    last = pd.Series(e.y).ffill().to_numpy()
    busy = (e.hour_of_day >= 6) & (e.hour_of_day < 21) & ~e.weekend
    air = response(za, np.where(busy, column["T_oa"] - last, 0.0))
    cells = np.column_stack([cells, air])
    profile = block_diag(profile, (VENTILATION_SD * heat_scale) ** 2)

    day = np.cumsum(np.append(0, np.diff(e.hour_of_day) < 0))
    own = [
        full[f"sigma_{'weekend' if w else 'weekday'}_{3 * (h // 3):02d}"] * np.exp(full[f"day_{d}"])
        for h, w, d in zip(e.hour_of_day, e.weekend, day, strict=True)
    ]
    sigma = np.array(own) * heat_scale
    phi = np.exp(-e.hours / full["tau"])
    shocks = np.append(sigma[0] ** 2, sigma[:-1] ** 2 * (1 - phi**2))  # of g in row 0, then of every step
    lags = np.subtract.outer(np.arange(N), np.arange(N))
    to_gain = np.tril(phi ** np.maximum(lags, 0))
    gain = to_gain @ np.diag(shocks) @ to_gain.T
    through = np.array([response(za, unit) for unit in np.eye(N)]).T
    first = np.full(n, HIDDEN_SD)
    first[za] = MEASURED_SD
    free = np.array([power[k][za] for k in range(N)])
    V = through @ gain @ through.T + free @ np.diag(first**2) @ free.T + full["sigma_y"] ** 2 * np.eye(N)
    V += cells @ profile @ cells.T

    seen = np.isfinite(e.y)
    V, D, r = V[np.ix_(seen, seen)], plain[seen], (e.y - mean)[seen]
    covariance = np.linalg.inv(D.T @ np.linalg.solve(V, D)) if D.shape[1] else np.zeros((0, 0))
    beta = covariance @ (D.T @ np.linalg.solve(V, r))
    left_over = np.linalg.solve(V, r - D @ beta)
    loss = 0.5 * (np.linalg.slogdet(V)[1] + (r - D @ beta) @ left_over)
    return loss, beta, covariance, profile @ cells[seen].T @ left_over


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("name", NETWORKS)
def test_periodic_objective_is_the_marginal_likelihood(name, setting):
    e = drawn_experiment(name, 45, "1h", start="2023-07-07 10:00")  # the end of a Friday, and most of the weekend
    problem, x = periodic_problem(name, e, setting)
    loss, _, linear = problem.evaluate(x)
    expected, beta, covariance, profile = dense_objective(name, e, problem.values(x), problem.inner, 1.3)
    signs = np.array([c.sign for c in problem.layout.channels[: problem.layout.n_plain]])
    assert (beta * signs >= 0).all()  # else the two would solve different problems
    # a normal prior of the logarithms holds what the data do not: in the middle of the bounds, or a stated one
    prior = 0.0
    for v, p in zip(x, problem.searched, strict=True):
        middle, sd = np.log(np.sqrt(p.lower * p.upper)) if p.transform == "log" else 0.0, PRIOR_LOG_SD
        if p.name.startswith("day_"):
            middle, sd = DAY_PRIOR
        elif p.name.removeprefix("sigma_") in HOUR_CLASSES[problem.hours].names:
            middle, sd = SIGMA_PRIOR
        elif p.unit in ("-", "m2", "kW"):
            continue
        prior += ((v - middle) / sd) ** 2 / 2
    assert loss == pytest.approx(expected + prior, rel=1e-9)
    k = problem.layout.n_plain
    np.testing.assert_allclose(linear.beta[:k], beta, rtol=1e-6)
    rounding = 1e-6 * np.abs(covariance).max(initial=0)
    np.testing.assert_allclose(linear.covariance[:k, :k], covariance, rtol=1e-5, atol=rounding)
    hours = profile_basis()[0] @ linear.beta[k:-1]
    np.testing.assert_allclose(np.append(hours, linear.beta[-1]), profile, rtol=1e-6, atol=1e-7)


# ------------------------------------------------------------------------------------------- what both stand on
def test_areas_and_fractions_of_solved_coefficients():
    """Two windows' worth of heat into two nodes are an area and its fraction."""
    plain = [PeriodicChannel("A_win:f", 0), PeriodicChannel("Q_h", 0), PeriodicChannel("A_win", 1)]

    def found(beta):
        theta, turn = physical(plain, {"C_za": 2.0}, beta)
        return np.array([theta[name] for name in ("A_win", "f", "Q_h")]), theta, turn

    for beta in (np.array([1.5, 6.0, 0.5]), np.array([0.2, 3.0, 4.0])):
        values, theta, turn = found(beta)
        np.testing.assert_allclose(values, [beta[0] + beta[2], beta[0] / (beta[0] + beta[2]), beta[1]], rtol=1e-12)
        assert theta["C_za"] == 2.0
        slopes = differences(lambda b: found(b)[0], beta)
        np.testing.assert_allclose([turn[name] for name in ("A_win", "f", "Q_h")], slopes, atol=1e-9)
    assert found(np.zeros(3))[1]["f"] == 0.5  # of no area


def test_bounded_least_squares_from_every_corner():
    """A start on a bound leaves it where the descent points inward."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        A, b = 0.3 * rng.normal(size=(12, 3)), rng.normal(size=12)

        def evaluate(x, A=A, b=b):
            e = x @ A.T - b
            return (e * e).sum(axis=1), np.tile(A.T @ A, (len(x), 1, 1)), e @ A

        corners = np.array(list(product((-1.0, 1.0), repeat=3)))
        expected = lsq_linear(A, b, (-1.0, 1.0), tol=1e-14)
        for minimum in minimise_together(evaluate, corners, -np.ones(3), np.ones(3), 200, 1e-13):
            assert minimum.converged
            assert minimum.loss == pytest.approx(2.0 * expected.cost, rel=1e-9)
            np.testing.assert_allclose(minimum.free, expected.x, atol=1e-4)
