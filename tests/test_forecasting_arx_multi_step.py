"""Multi-step ARX: slopes against finite differences, re-fits against a full one, and tables of every kind."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from skhybrid import persistence
from skhybrid._table import read_table
from skhybrid.filtering import forecast_sample
from skhybrid.forecasting import ARXRegressor, arx_multi_step
from skhybrid.forecasting.arx_design import ARXDesign, Moments
from skhybrid.forecasting.arx_multi_step import (
    MultiStepFit,
    MultiStepProblem,
    Penalties,
    RecursiveMultiStep,
    fit_multi_step,
)


def room(n_days=21, step_minutes=15, seed=0, noise=0.02, gain=1.0):
    """A 2R2C room with sun and a gain on weekdays."""
    rng = np.random.default_rng(seed)
    index = pd.date_range("2023-01-02", periods=n_days * 1440 // step_minutes, freq=f"{step_minutes}min")
    hour, dt = (index.hour + index.minute / 60.0).to_numpy(), step_minutes / 60.0
    T_oa = 5 + 5 * np.sin(2 * np.pi * (hour - 9) / 24) + rng.normal(size=len(index))
    q_sol = np.clip(np.sin(np.pi * (hour - 7) / 10), 0, None) * rng.uniform(0.2, 0.6, len(index))
    u_heat = ((hour >= 6) & (hour < 20)) * rng.uniform(0.3, 1.0, len(index))
    people = gain * ((hour >= 9) & (hour < 17) & (index.day_of_week < 5))
    T, T_w = np.full(len(index), 20.0), 18.0
    for k in range(len(index) - 1):
        heat = (T_w - T[k]) / 1.5 + (T_oa[k] - T[k]) / 8 + 4 * u_heat[k] + people[k] + 2.0 * q_sol[k]
        T[k + 1] = T[k] + dt * heat / 3 + noise * rng.normal()
        T_w += dt * ((T[k] - T_w) / 1.5 + (T_oa[k] - T_w) / 4) / 20
    return pd.DataFrame({"T_oa": T_oa, "q_sol": q_sol, "u_heat": u_heat, "T_za": T}, index=index)


def problem_of(X, n_lags=5):
    """The problem of a training table, its view, and coefficients near the one-step solution."""
    table = read_table(ARXRegressor(), X, reset=True)
    design = ARXDesign.of_training(table, X["T_za"].to_numpy(), n_lags, 3, True, daily=True)
    problem = MultiStepProblem.of_training(design, table, 96)
    view = design.view(table, X["T_za"].to_numpy())
    coef = Moments.of(design.pairs(view)).solution(problem.penalty(Penalties(1.0, 10.0, 1.0)))
    return problem, view, coef


def forecasts(problem, view, coef, origins, span):
    return problem.forecasts(view, coef, problem.targets(view, origins, span))


def moments(problem, view, *of):
    return problem.moments(view, forecasts(problem, view, *of))


def rmse(model, X, y):
    origins = np.arange(0, len(X) - 96, 12)
    truth = y.to_numpy()[origins[:, None] + np.arange(1, 97)]
    return float(np.sqrt(((model.predict_from(X, origins) - truth) ** 2).mean()))


def test_the_slopes_are_those_of_finite_differences():
    X = room(8).assign(T_za=lambda X: X["T_za"].mask(np.random.default_rng(1).random(len(X)) < 0.2))
    problem, view, coef = problem_of(X)
    origins, span = problem.origins(0, view.end), (40, view.end - 50)
    sums = moments(problem, view, coef, origins, span)
    gradient = 2.0 * (sums.gram @ coef - sums.cross)
    for j in (0, 1, 4, 5, 12, 14, 18, 25, 70, len(coef) - 1):
        away = np.zeros(len(coef))
        away[j] = 1e-6 * max(1.0, abs(coef[j]))
        ends = [forecasts(problem, view, coef + sign * away, origins, span).squares for sign in (1.0, -1.0)]
        assert gradient[j] == pytest.approx((ends[0] - ends[1]) / (2.0 * away[j]), rel=1e-4, abs=1e-3)


def test_sums_of_parts_are_those_of_the_whole():
    problem, view, coef = problem_of(room(8))
    origins, ends = problem.origins(0, view.end), (0, 200, 500, view.end)
    whole = moments(problem, view, coef, origins, (0, view.end))
    parts = [moments(problem, view, coef, origins, span) for span in pairwise(ends)]
    np.testing.assert_allclose(sum(part.gram for part in parts), whole.gram, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(sum(part.cross for part in parts), whole.cross, rtol=1e-9, atol=1e-9)


def test_every_second_forecast_tells_as_much_as_all(monkeypatch):
    """In the units of penalties and priors."""
    X = room(35)
    cut = 28 * 96
    models = []
    for most in (forecast_sample._MANY, np.inf):
        monkeypatch.setattr(forecast_sample, "_MANY", most)
        models.append(ARXRegressor(objective="multi_step", alpha=1.0).fit(X[:cut], X["T_za"][:cut]))
    half, whole = models
    assert (len(half._fit.problem.leads), half._fit.problem.every) == (9, 8)
    assert (len(whole._fit.problem.leads), whole._fit.problem.every) == (18, 4)
    sums = [np.diag(model._fit.information().gram) for model in models]
    np.testing.assert_allclose(sums[0][:24], sums[1][:24], rtol=0.1)
    assert half._fit.noise == pytest.approx(whole._fit.noise, rel=0.1)
    errors = [rmse(model, X[cut:], X["T_za"][cut:]) for model in models]
    assert errors[0] == pytest.approx(errors[1], rel=0.02)


def test_a_fit_ends_at_its_optimum_after_few_steps(monkeypatch):
    X, seen, moments_at = room(), [], MultiStepProblem.moments
    table, T = read_table(ARXRegressor(), X, reset=True), X["T_za"].to_numpy()
    design = ARXDesign.of_training(table, T, 5, 3, True, daily=True)
    view, penalties = design.view(table, T), Penalties(1.0, 1000.0, 5.0)

    def counted(self, view, made):
        seen.append(made)
        return moments_at(self, view, made)

    monkeypatch.setattr(MultiStepProblem, "moments", counted)
    fit = fit_multi_step(design, table, view, 96, penalties, refits=False)
    assert len(seen) <= 1 + 4  # the start and four of at most six steps

    def objective(at):
        squares = fit.problem.training_forecasts(view, at.coef, view.end).squares
        penalty = fit.problem.penalty(penalties)
        return squares + arx_multi_step._quadratic(fit.pairs, fit.one_step, penalty, at.coef), squares

    (reached, squares), (least, _) = map(objective, (fit, fit.improved(view, view.end - 1, penalties, n_steps=6)))
    assert reached - least < 1e-3 * squares


def test_it_has_lower_errors_a_day_ahead_than_the_one_step_solution():
    X = room(35)
    cut = 28 * 96
    models = [ARXRegressor(objective=o).fit(X[:cut], X["T_za"][:cut]) for o in ("one_step", "multi_step")]
    one_step, multi_step = (rmse(model, X[cut:], X["T_za"][cut:]) for model in models)
    assert multi_step < 0.9 * one_step


def test_re_fits_learn_a_changed_gain_and_leave_the_estimator_alone():
    before, after = room(21), room(49, gain=3.0)
    cut = 21 * 96
    model = ARXRegressor(objective="multi_step", adapt="refit").fit(before, before["T_za"])
    later = after[cut:]
    kept = dict(vars(model))
    errors = rmse(model, later[14 * 96 :], later["T_za"][14 * 96 :])  # cold: only what its own rows tell
    origins = np.arange(14 * 96, len(later) - 96, 12)
    truth = later["T_za"].to_numpy()[origins[:, None] + np.arange(1, 97)]
    taught = float(np.sqrt(((model.predict_from(later, origins) - truth) ** 2).mean()))
    static = ARXRegressor(objective="multi_step").fit(before, before["T_za"])
    fixed = float(np.sqrt(((static.predict_from(later, origins) - truth) ** 2).mean()))
    assert taught < 0.6 * fixed
    assert taught < errors
    assert vars(model).keys() == kept.keys()
    assert all(value is kept[name] for name, value in vars(model).items())


def test_the_sums_are_re_fitted_when_a_day_after_the_training_is_complete(monkeypatch):
    problem, view, coef = problem_of(room(8))
    zero = np.zeros((len(coef), len(coef)))
    fit = MultiStepFit(problem, coef, Moments(zero, zero[0]), Moments(zero, zero[0]), Penalties(1.0, 10.0, 1.0), 1.0)
    recursive, begin, begun = RecursiveMultiStep(fit, 6 * 96), 6 * 96, []
    origins = MultiStepProblem.origins

    def noted(self, first, stop):
        begun.append(int(origins(self, first, stop)[0]))
        return origins(self, first, stop)

    monkeypatch.setattr(MultiStepProblem, "origins", noted)
    recursive.advance(view, begin + 94)
    assert recursive.coef() is coef  # the last row of the day is not known
    recursive.advance(view, begin + 95)
    assert np.abs(recursive.coef() - coef).max() > 1e-6
    assert begun == [begin - 1]  # the forecast from the last row of the training


@pytest.mark.slow
def test_daily_re_fits_come_near_a_fit_of_everything(monkeypatch):
    monkeypatch.setattr(arx_multi_step, "_HISTORY_WEIGHT", 1.0)
    monkeypatch.setattr(arx_multi_step, "_HALF_LIFE_DAYS", 1e9)
    cut = 14 * 96
    X = pd.concat([room(14), room(28, gain=2.0)[cut:]])
    table = read_table(ARXRegressor(), X, reset=True)
    T = X["T_za"].to_numpy()
    design = ARXDesign.of_training(table.rows(slice(0, cut)), T[:cut], 24, 8, True, daily=True)
    part, view = design.view(table.rows(slice(0, cut)), T[:cut]), design.view(table, T)
    fit = fit_multi_step(design, table.rows(slice(0, cut)), part, 96, None, True)
    recursive = RecursiveMultiStep(fit, cut)
    recursive.advance(view, len(X) - 1)
    origins, span = fit.problem.origins(0, len(X)), (0, len(X) - 1)
    sums = moments(fit.problem, view, fit.coef, origins, span)
    start = fit._replace(moments=sums, pairs=Moments.of(design.pairs(view)))
    whole = start.improved(view, len(X) - 1, fit.penalties)
    coefs = fit.coef, recursive.coef(), whole.coef
    squares = [forecasts(fit.problem, view, coef, origins, span).squares for coef in coefs]
    assert squares[2] < squares[1] < squares[0]
    assert squares[1] - squares[2] < 0.5 * (squares[0] - squares[2])


@pytest.mark.parametrize("adapt", [None, "refit"])
@pytest.mark.parametrize(
    "change",
    [
        lambda X: X.drop(columns="q_sol"),
        lambda X: X.drop(columns="T_oa"),
        lambda X: X[["u_heat", "T_za"]],
        lambda X: X.assign(q_sol_south=X["q_sol"] ** 2, T_ground=8.0, Q_floor=X["u_heat"].shift(4, fill_value=0.0)),
        lambda X: X.reset_index(drop=True),
        lambda X: X.assign(T_za=X["T_za"].mask(np.random.default_rng(0).random(len(X)) < 0.4)),
        lambda X: X[: 15 * 96].assign(T_za=lambda X: X["T_za"].where(np.arange(len(X)) % 500 > 100)),
        lambda X: X[: 7 * 96 + 30],
        lambda X: X[6 * 96 :],
        lambda X: X[6 * 96 + 80 :],
    ],
    ids=[
        "no sun",
        "no outdoor",
        "heat alone",
        "several",
        "no stamps",
        "scattered",
        "gaps",
        "30 rows",
        "a day",
        "16 rows",
    ],
)
def test_tables_of_every_kind(change, adapt):
    X = change(room(10))
    cut = max(len(X) - 3 * 96, 16)
    model = ARXRegressor(objective="multi_step", adapt=adapt, sampling_time="15min")
    model.fit(X[:cut].drop(columns="T_za"), X["T_za"][:cut])
    predicted = model.predict(X[cut:])
    reach = 3.0 * max(float(np.ptp(X["T_za"][:cut].dropna())), 1.0) + 1e-9
    assert X["T_za"][:cut].min() - reach <= predicted.min() <= predicted.max() <= X["T_za"][:cut].max() + reach


@pytest.mark.parametrize(("minutes", "horizon"), [(60, "1D"), (5, "6h"), (120, "2D"), (15, None)])
def test_other_steps_and_horizons(minutes, horizon):
    X = room(21, minutes)
    cut = len(X) * 2 // 3
    model = ARXRegressor(objective="multi_step", adapt="refit", horizon=horizon).fit(X[:cut], X["T_za"][:cut])
    later = X[cut:]
    assert np.sqrt(((model.predict(later) - later["T_za"]) ** 2).mean()) < 0.5 * later["T_za"].std()


def test_intervals_hold_what_they_say_and_a_file_brings_all_back(tmp_path):
    X = room(35)
    cut = 21 * 96
    model = ARXRegressor(objective="multi_step", adapt="refit").fit(X[:cut], X["T_za"][:cut])
    later = X[cut:]
    quantiles = model.predict_quantiles(later)
    inside = (quantiles[:, 0] <= later["T_za"]) & (later["T_za"] <= quantiles[:, 2])
    assert 0.72 < inside.mean() < 0.92
    persistence.save_model(model, tmp_path / "model")
    np.testing.assert_array_equal(persistence.load_model(tmp_path / "model").predict_quantiles(later), quantiles)


def test_a_given_penalty_is_kept_and_an_unknown_objective_named():
    X = room(10)
    assert ARXRegressor(objective="multi_step", alpha=7.0).fit(X, X["T_za"]).alpha_ == 7.0
    with pytest.raises(ValueError, match="objective='many' is not known; use 'one_step' or 'multi_step'"):
        ARXRegressor(objective="many").fit(X, X["T_za"])
