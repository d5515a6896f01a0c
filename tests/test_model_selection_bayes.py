"""The Bayesian part of model selection, against closed forms, dense Gaussians, plain loops and quadrature."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.integrate import trapezoid
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from skhybrid.exceptions import SkhybridWarning
from skhybrid.forecasting import ModelCase
from skhybrid.identification.uncertainty import posterior
from skhybrid.identification.uncertainty.posterior import refuse_bad_chains
from skhybrid.inspection import PosteriorDisplay, RobustnessDisplay
from skhybrid.model_selection import (
    PatternExpressiveness,
    RobustnessComparison,
    select_case,
)
from skhybrid.model_selection.choice import pattern_expressiveness, robustness_comparison
from skhybrid.model_selection.choice.case_rules import (
    _baselines,
    _choose_by_rules,
    _overview,
    _with_helpful_ingredients,
)
from skhybrid.model_selection.choice.regression_terms import build_terms
from skhybrid.model_selection.choice.results_table import finished, ingredients
from skhybrid.persistence import load_model, save_model

pytestmark = pytest.mark.usefixtures("closed_figures")

pytest.importorskip("pymc")
FEW = {"draws": 200, "tune": 150, "chains": 2, "random_state": 0}


def _name(framework, case):
    return f"DEEP_{'AR_' if framework == 'lstm' else ''}{framework.upper()}_FORECAST-{case}"


@pytest.fixture(scope="module")
def results():
    """Candidates of four sizes of seven cases, whose errors are known sums plus noise."""
    rng = np.random.default_rng(1)
    rows = []
    for framework, case in [
        ("mlp", "case01"), ("mlp", "case02"), ("mlp", "case03"), ("mlp", "case10"),
        ("lstm", "case01"), ("lstm", "case02"), ("lstm", "case03"), ("lstm", "case09"),
    ]:  # fmt: skip
        for kind in ("input", "output"):
            known = ingredients(pd.DataFrame({"framework": [framework], "case": [case], "disturbance": [kind]})).iloc[0]
            centre = 1.0 - 0.2 * known["time"] - 0.25 * known["future-w"] + 0.01 * known["pattern"]
            centre -= 0.1 * (kind == "input") + 0.05 * (framework == "lstm")
            for hidden_size in (10, 20, 40, 60):
                error = centre + 0.03 * rng.standard_normal()
                rows.append((framework, case, kind, _name(framework, case), hidden_size, error))
    return pd.DataFrame(rows, columns=["framework", "case", "disturbance", "name", "hidden_size", "rmse"])


@pytest.fixture(scope="module")
def regression(results):
    return PatternExpressiveness(draws=500, tune=300, chains=3, random_state=0).fit(results)


@pytest.fixture(scope="module")
def errors():
    """Log-normal errors of cases with few and many sizes, close to and far from the best."""
    rng = np.random.default_rng(2)
    made = {"case01": (0.40, 0.1, 12), "case02": (0.43, 0.2, 3), "case03": (0.47, 0.05, 36), "case04": (1.5, 0.3, 6)}
    made["case05"] = (0.5, 0.1, 4)
    rows = [(case, m * np.exp(s * rng.standard_normal())) for case, (m, s, n) in made.items() for _ in range(n)]
    return pd.DataFrame(rows, columns=["case", "rmse"])


@pytest.fixture(scope="module")
def comparison(errors):
    return RobustnessComparison(random_state=0).fit(errors)


# ------------------------------------------------------------------------------------------------------ the regression
def _closed_form(X, y, prior_scale):
    """Normal-inverse-gamma posterior of standardised terms: mean, scale and degrees of freedom of their t."""
    X = np.column_stack([np.ones(len(y)), (X - X.mean(axis=0)) / X.std(axis=0)])
    y_mean, y_var = y.mean(), y.var(ddof=1)
    precision = X.T @ X + np.eye(X.shape[1]) / prior_scale**2
    mean = np.linalg.solve(precision, X.T @ (y - y_mean))
    shape = 0.5 + 0.5 * len(y)
    rate = 0.5 * y_var + 0.5 * ((y - y_mean) @ (y - y_mean) - mean @ precision @ mean)
    return mean, np.sqrt(rate / shape * np.diag(np.linalg.inv(precision))), 2.0 * shape, rate / (shape - 1.0)


def test_effects_agree_with_the_conjugate_closed_form(results, regression):
    columns = ingredients(results).assign(LSTM=(results["framework"] == "lstm").astype(float))
    summary = regression.summary_
    assert list(summary.index) == ["LSTM", "time", "pattern", "past-w", "future-w", "ID"]
    X, y = columns[list(summary.index)].to_numpy(float), results["rmse"].to_numpy()
    mean, scale, dof, variance = _closed_form(X, y, 10.0)
    unit = X.std(axis=0)
    posterior = stats.t(dof, mean[1:] / unit, scale[1:] / unit)
    noise = posterior.std() / np.sqrt(summary["ess"])
    assert (np.abs(summary["mean"] - posterior.mean()) < 4.0 * noise).all()
    np.testing.assert_allclose(summary["std"], posterior.std(), rtol=0.1)
    for column, level in (("lower", 0.05), ("upper", 0.95)):
        noise = np.sqrt(level * (1.0 - level) / summary["ess"]) / posterior.pdf(posterior.ppf(level))
        assert (np.abs(summary[column] - posterior.ppf(level)) < 4.0 * noise).all()
    share = posterior.cdf(0.0)
    noise = np.sqrt(share * (1.0 - share) / summary["ess"])
    assert (np.abs(summary["probability_reduces"] - share) < 4.0 * noise + 1e-3).all()
    assert (regression.draws_["sigma"] ** 2).mean() == pytest.approx(variance, rel=0.05)
    assert regression.draws_["intercept"].mean() == pytest.approx(y.mean() + mean[0], abs=1e-3)


def test_effects_say_what_was_put_in(regression):
    put_in = {"LSTM": -0.05, "time": -0.2, "pattern": 0.01, "past-w": 0.0, "future-w": -0.25, "ID": -0.1}
    summary = regression.summary_
    assert (np.abs(summary["mean"] - pd.Series(put_in)) < 4.0 * summary["std"]).all()
    assert regression.reference_ == {"framework": "mlp"}
    assert regression.n_candidates_ == 64
    assert "InverseGamma(0.5" in regression.priors_["sigma"]


def _density_differences(model, points):
    """Log density of a PyMC model at some points, less that at the first; its transforms are taken out."""
    density = model.compile_logp(jacobian=False, mode="FAST_COMPILE")
    values = []
    for point in points:
        inside = {}
        for variable in model.free_RVs:
            value, transform = model.rvs_to_values[variable], model.rvs_to_transforms[variable]
            given = np.asarray(point[variable.name], float)
            inside[value.name] = given if transform is None else np.log(given)
        values.append(float(density(inside)))
    return np.array(values) - values[0]


@pytest.mark.parametrize("grouped", [False, True], ids=["rows", "groups"])
def test_the_density_is_that_of_the_dense_gaussian(grouped):
    rng = np.random.default_rng(3)
    X = np.column_stack([np.ones(17), rng.standard_normal((17, 2))])
    y, groups = rng.standard_normal(17), rng.permutation(np.arange(17) % 5)
    X[:, 2] = groups - groups.mean()  # one term that does not vary within a group
    model, _ = pattern_expressiveness.regression_model(X, y, 1.3, 4.0, groups if grouped else None)
    points = [
        {"variance": v, "sigma_group": s, "coefficients": rng.standard_normal(3)}
        for v, s in [(1.0, 0.5), (0.3, 1.7), (2.2, 0.1)]
    ]
    found = _density_differences(model, points)
    expected = []
    for p in points:
        v, s2 = p["variance"], p["sigma_group"] ** 2 if grouped else 0.0
        covariance = v * np.eye(17) + s2 * (groups[:, None] == groups)
        value = stats.multivariate_normal(X @ p["coefficients"], covariance).logpdf(y)
        value += stats.norm(0, 4.0 * np.sqrt(v + s2)).logpdf(p["coefficients"]).sum()
        value += stats.invgamma(0.5, scale=0.5 * 1.3**2).logpdf(v)
        expected.append(value + (stats.halfnorm(scale=1.3).logpdf(p["sigma_group"]) if grouped else 0.0))
    np.testing.assert_allclose(found, np.array(expected) - expected[0], rtol=1e-8)


# ------------------------------------------------------------------------------------------------------------ its terms
def _terms(results, terms="ingredients", interactions=(), cases=(), best_sizes=None):
    return build_terms(results, terms, interactions, cases, best_sizes)


def test_ingredients_are_those_of_the_paper():
    table = pd.DataFrame(
        [("mlp", "case02", "input"), ("cnn", "case21", "output"), ("lstm", "case02", "input")],
        columns=["framework", "case", "disturbance"],
    )
    found = ingredients(table)
    assert list(found.columns) == ["time", "pattern", "past-w", "future-w", "ID"]
    assert found.to_numpy().tolist() == [[0, 4, 0, 1, 1], [1, 7, 1, 1, 0], [1, 1, 0, 0, 1]]
    own = ModelCase("mine", 3, ("T_oa",), ("hod",))
    assert ingredients(table.assign(case="mine"), [own]).iloc[0].tolist() == [1, 0, 1, 0, 1]
    assert own.history == 3


def test_baselines_and_what_does_not_vary_stay_out(results):
    baseline = results.iloc[[0]].assign(framework="ridge", case=None, name="ridge", rmse=0.1)
    table = pd.concat([results[results["disturbance"] == "input"], baseline], ignore_index=True)
    terms = _terms(table)
    assert len(terms.columns) == 32
    assert "ID" not in terms.columns
    assert terms.left_out == {"ID": "ID is the same in all candidates."}


def test_terms_that_always_go_together_are_named(results):
    with pytest.warns(SkhybridWarning, match="cannot separate future-w from past-w"):
        terms = _terms(results[results["framework"] == "lstm"])
    assert list(terms.columns) == ["time", "pattern", "past-w", "ID"]
    assert terms.left_out["future-w"] == "it cannot be separated from past-w."


def test_interactions_are_products_of_centred_terms(results):
    terms = _terms(results, interactions=[("framework", "time"), ("framework", "future-w")])
    assert list(terms.columns)[-1] == "LSTM:time"
    lstm, time = terms.columns["LSTM"], terms.columns["time"]
    np.testing.assert_allclose(terms.columns["LSTM:time"], (lstm - lstm.mean()) * (time - time.mean()))
    assert set(terms.left_out) == {"LSTM:future-w"}  # no MLP does without the weather to come
    everything = _terms(results, interactions="all").columns
    centred = everything - everything.mean()
    assert np.linalg.matrix_rank(centred.to_numpy()) == everything.shape[1]


def test_sizes_are_terms_too(results):
    table = results.assign(activation=np.where(np.arange(len(results)) % 2, "selu", "relu"), filter_size=np.nan)
    terms = _terms(table, "sizes")
    assert list(terms.columns) == ["hidden_size", "activation=selu"]
    assert terms.reference == {"activation": "relu"}
    by_framework = _terms(results.drop(columns="case"), ["framework", "hidden_size"])  # which need no case
    assert list(by_framework.columns) == ["LSTM", "hidden_size"]
    with pytest.raises(ValueError, match="hidden_size is NaN in 1 of 64 candidates; pass the rows of one framework"):
        _terms(table.assign(hidden_size=[np.nan, *table["hidden_size"][1:]]), "sizes")
    assert list(_terms(results, ["time"]).columns) == ["time"]  # the first that is read from the cases


def test_the_best_sizes_of_each_case(results):
    terms = _terms(results, best_sizes=2)
    expected = results.groupby(["name", "disturbance"])["rmse"].apply(lambda e: sorted(e)[:2])
    assert sorted(terms.rmse) == sorted(error for pair in expected for error in pair)


@pytest.mark.parametrize(
    ("settings", "change", "message"),
    [
        ({"terms": "all"}, {}, "terms='all' is neither"),
        ({"terms": ["depth"]}, {}, "term 'depth' is neither an ingredient"),
        ({"interactions": [("time", "depth")]}, {}, "not a pair of two of the terms"),
        ({"interactions": [("time", "ID", "past-w")]}, {}, "not a pair of two of the terms"),
        ({"level": 1.5}, {}, "level=1.5 is not between"),
        ({"level": "high"}, {}, "level='high' is not between"),
        ({"prior_scale": "wide"}, {}, r"prior_scale='wide' is outside \(0, inf\)"),
        ({"chains": 1}, {}, "chains=1 is less than 2"),
        ({"draws": 2.5}, {}, "draws=2.5 must be an integer of at least 1"),
        ({"best_sizes": 0}, {}, "best_sizes=0 must be an integer of at least 1"),
        ({"best_sizes": 2.5}, {}, "best_sizes=2.5 must be an integer"),
        ({"log": "yes"}, {}, "log='yes' must be True or False"),
        ({"group": "house"}, {}, "group names 'house'"),
        ({"group": "rmse"}, {}, "groups of 64 candidates"),
        ({}, {"case": "case99"}, "'case99' is not known"),
        ({}, {"framework": "forest"}, "case 'case01' of framework 'forest' is not one of the paper's"),
        ({}, {"case": None}, "no row of results has a case"),
        ({}, {"disturbance": "heat"}, "disturbance holds 'heat'"),
        ({}, {"rmse": 0.5}, "all 64 errors are equal"),
        ({}, {"rmse": -1.0}, "rmse of row 0 is -1.0"),
        ({}, {"rmse": "bad"}, "rmse of row 0 is bad"),
        ({}, {"rmse": np.nan}, "no candidate with an error"),
        pytest.param({}, {"stopped_at": 5}, "trained to the end", marks=pytest.mark.filterwarnings("ignore")),
    ],
)
def test_bad_input_is_named(results, settings, change, message):
    with pytest.raises(ValueError, match=message):
        PatternExpressiveness(**settings).fit(results.assign(**change))


def test_a_missing_column_and_too_few_rows_are_named(results):
    with pytest.raises(ValueError, match="no column 'case'; it has framework"):
        PatternExpressiveness().fit(results.drop(columns="case"))
    with pytest.raises(ValueError, match="are too few for"):
        PatternExpressiveness(["time", "ID"]).fit(results.iloc[[0, 4, 8]])
    with pytest.raises(TypeError, match="results is a list"):
        PatternExpressiveness().fit([1.0])


def test_failed_candidates_are_counted(results):
    with pytest.warns(SkhybridWarning, match="2 of 64 candidates have no rmse"):
        left = finished(results.assign(rmse=[np.nan, np.nan, *results["rmse"][2:]]))
    assert list(left.index) == list(range(2, 64))
    with pytest.warns(SkhybridWarning, match="1 of 64 candidates were stopped early"):
        left = finished(results.assign(stopped_at=[20.0, *[np.nan] * 63]))
    assert list(left.index) == list(range(1, 64))


# ------------------------------------------------------------------------------------------------------ the comparison
def _grid(log_errors, n=45):
    """Weights of (mu, sigma) on a grid: the posterior of one case, by quadrature."""
    count, centre = len(log_errors), log_errors.mean()
    spread = max(log_errors.std(ddof=1), 0.02)
    log_sigma = np.linspace(np.log(spread) - 3.0, np.log(4.0), 2 * n)
    sigma = np.exp(log_sigma)[:, None]
    mu = centre + sigma / np.sqrt(count) * np.linspace(-6.0, 6.0, n)  # the grid widens with sigma
    log_weight = np.zeros(mu.shape)
    for value in log_errors:
        log_weight += stats.norm.logpdf(value, mu, sigma)
    log_weight += stats.norm.logpdf(mu, 0, 10) + stats.halfnorm.logpdf(sigma) + 2.0 * np.log(sigma)  # d mu, d log sigma
    weight = np.exp(log_weight - log_weight.max())
    return mu, np.broadcast_to(sigma, mu.shape), weight / weight.sum()


def test_probabilities_agree_with_quadrature_to_a_hundredth(errors, comparison):
    grids = {case: _grid(np.log(part["rmse"].to_numpy())) for case, part in errors.groupby("case")}
    medians = errors.groupby("case")["rmse"].median()
    assert comparison.best_ == medians.idxmin()
    steps = np.linspace(-3.0, 3.0, 1500)  # log error, finely enough for the narrowest density

    def predicted(case):
        mu, sigma, weight = (part.ravel() for part in grids[case])
        keep = weight > 1e-7
        z = (steps[:, None] - mu[keep]) / sigma[keep]
        return stats.norm.cdf(z) @ weight[keep], (stats.norm.pdf(z) / sigma[keep]) @ weight[keep]

    cdf_best, _ = predicted(comparison.best_)
    for case in medians.index:
        _, density = predicted(case)
        expected = trapezoid(cdf_best * density, steps)
        assert comparison.probability_[case] == pytest.approx(expected, abs=0.01), case
    assert list(comparison.probability_.index) == list(medians.sort_values().index)


def test_the_cases_indistinguishable_from_the_best(comparison):
    below = comparison.probability_ < 0.95
    assert comparison.indistinguishable_ == list(below.index[below])
    assert comparison.indistinguishable_[0] == comparison.best_
    assert "case04" not in comparison.indistinguishable_
    assert comparison.probability_[comparison.best_] == 0.5
    assert comparison.probability_below("case03", 0.47) == pytest.approx(0.5, abs=0.15)
    assert comparison.probability_below("case03", 5.0) > 0.999
    with pytest.raises(ValueError, match="case 'case99' is not one of those compared: 'case01', "):
        comparison.probability_below("case99", 0.4)
    with pytest.raises(ValueError, match=r"error=-0.4 is not a positive number \[K\]"):
        comparison.probability_below("case03", -0.4)
    with pytest.raises(NotFittedError):
        RobustnessComparison().probability_below("case03", 0.4)
    assert (comparison.difference_["q_0.5"].drop(comparison.best_) < 0.0).all()
    assert comparison.summary_["n_sizes"].to_dict()["case05"] == 4


def test_the_density_is_that_of_one_error_at_a_time(errors):
    spreads = robustness_comparison._spreads(pd.Series(errors["rmse"].to_numpy(), index=errors["case"]))
    model, _ = robustness_comparison._model(spreads)
    rng = np.random.default_rng(4)
    points = [{"sigma": s * rng.uniform(0.5, 2.0, 5), "z": rng.standard_normal(5)} for s in (0.2, 0.6, 1.1)]
    found = _density_differences(model, points)
    expected = []
    for p in points:
        value = 0.0
        for i, case in enumerate(spreads.medians.index):
            logs, sigma = np.log(errors.loc[errors["case"] == case, "rmse"]), p["sigma"][i]
            width = sigma / np.sqrt(len(logs))
            mu = logs.mean() + width * p["z"][i]
            value += stats.lognorm.logpdf(np.exp(logs), sigma, scale=np.exp(mu)).sum()
            value += stats.norm(0, 10).logpdf(mu) + stats.halfnorm.logpdf(sigma) + np.log(width)  # d mu / d z
        expected.append(value)
    np.testing.assert_allclose(found, np.array(expected) - expected[0], rtol=1e-8)


@pytest.mark.slow
def test_a_seed_repeats_a_fit_and_global_random_states_stay(errors):
    few = errors[errors["case"].isin(["case01", "case03"])]
    np.random.seed(7)  # noqa: NPY002
    before = np.random.get_state()  # noqa: NPY002
    made = [RobustnessComparison(**FEW).fit(few)]
    after = np.random.get_state()  # noqa: NPY002
    assert before[2] == after[2]
    np.testing.assert_array_equal(before[1], after[1])
    np.random.seed(8)  # noqa: NPY002
    made.append(clone(made[0]).fit(few))
    made.append(RobustnessComparison(**{**FEW, "random_state": 1}).fit(few))
    pd.testing.assert_frame_equal(made[0].draws_["mu"], made[1].draws_["mu"])
    pd.testing.assert_frame_equal(made[0].difference_, made[1].difference_)
    assert not made[0].draws_["mu"].equals(made[2].draws_["mu"])


@pytest.mark.parametrize(
    ("settings", "rows", "message"),
    [
        ({"level": 0.4}, [("a", 1.0), ("b", 2.0)], "level=0.4 is not between"),
        ({"level": "high"}, [("a", 1.0), ("b", 2.0)], "level='high' is not between"),
        ({"by": "name"}, [("a", 1.0), ("b", 2.0)], "no column 'name'"),
        ({}, [("a", 1.0), ("a", 1.0), ("b", 2.0)], "all 2 errors of 'a' are equal, .*leave the case out"),
        ({}, [(None, 1.0), ("b", 2.0)], "case of row 0 is empty"),
        ({}, [("a", 0.0), ("b", 2.0)], "rmse of row 0 is"),
        ({"chains": 1}, [("a", 1.0), ("b", 2.0)], "chains=1 is less than 2"),
        ({"draws": 0}, [("a", 1.0), ("b", 2.0)], "draws=0 must be an integer of at least 1"),
        ({"tune": -1}, [("a", 1.0), ("b", 2.0)], "tune=-1 must be an integer of at least 0"),
    ],
)
def test_bad_input_of_a_comparison_is_named(settings, rows, message):
    with pytest.raises(ValueError, match=message):
        RobustnessComparison(**settings).fit(pd.DataFrame(rows, columns=["case", "rmse"]))


def test_a_spread_that_no_error_shows_is_warned_of(monkeypatch):
    monkeypatch.setattr(posterior, "draw_chains", lambda *args, **kwargs: _chains(2))
    table = pd.DataFrame({"case": ["a", "b"], "rmse": [1.0, 2.0]})
    with pytest.warns(
        SkhybridWarning, match="every case has one size, so that the spread of its errors is the prior's"
    ):
        RobustnessComparison(draws=300, chains=2).fit(table)


def test_a_random_state_of_any_kind_seeds_the_sampler(monkeypatch):
    seeds = []
    sampler = SimpleNamespace(sample=lambda **given: seeds.append(given["random_seed"]))
    monkeypatch.setattr(posterior, "import_pymc", lambda: sampler)
    for state in (5, np.random.RandomState(0), np.random.RandomState(0)):
        posterior.draw_chains(None, {}, random_state=state)
    assert seeds[0] == 5
    assert isinstance(seeds[1], int)
    assert seeds[1] == seeds[2]
    with pytest.raises(ValueError, match="random_state='seven' must be an integer"):
        posterior.draw_chains(None, {}, random_state="seven")


def test_cases_of_several_frameworks_are_not_lumped(results):
    with pytest.raises(
        ValueError, match=r"'case01' contains candidates with 2 values of .*pass by=\('name', 'disturbance'\)"
    ):
        RobustnessComparison().fit(results)
    with pytest.raises(ValueError, match="case of row 1 is empty; leave out rows without a case, such as baselines"):
        RobustnessComparison().fit(pd.DataFrame({"case": ["a", None], "rmse": [0.5, 0.6]}))


# -------------------------------------------------------------------------------------------------------- bad chains
def _chains(n_cases, *, apart=0.0, diverging=0, draws=300):
    """Results that a sampler might hand back: independent draws, chains that are apart, divergences."""
    import arviz as az

    rng = np.random.default_rng(0)
    mu = rng.standard_normal((2, draws, n_cases)) + apart * np.arange(2)[:, None, None]
    flags = np.zeros((2, draws), bool)
    flags[0, :diverging] = True
    sigma = np.exp(0.1 * rng.standard_normal((2, draws, n_cases)))
    groups = {"posterior": {"mu": mu, "sigma": sigma}, "sample_stats": {"diverging": flags}}
    return az.from_dict(**groups) if az.__version__.startswith("0.") else az.from_dict(groups)


@pytest.mark.parametrize(
    ("chains", "message"),
    [
        ({"apart": 1.0}, "chains disagree about mu of case0"),
        ({"diverging": 1}, "1 draws diverged"),
        ({"apart": np.nan}, "chains disagree"),
    ],
)
def test_bad_chains_are_errors_and_leave_nothing_half_fitted(errors, monkeypatch, chains, message):
    given = _chains(5, **chains)
    attempts = []
    monkeypatch.setattr(posterior, "draw_chains", lambda *args, **kwargs: attempts.append(kwargs) or given)
    comparison = RobustnessComparison(draws=given.posterior.sizes["draw"], chains=2)
    with pytest.raises(RuntimeError, match=message):
        comparison.fit(errors)
    assert not [name for name in vars(comparison) if name.endswith("_")]
    steps = [one["target_accept"] for one in attempts]
    assert steps == ([0.97, 0.995] if "diverging" in chains else [0.97])  # smaller steps were tried


def test_with_many_sizes_larger_steps_are_tried_first(errors, monkeypatch):
    attempts = []
    given = _chains(3, diverging=1)
    monkeypatch.setattr(posterior, "draw_chains", lambda *args, **kwargs: attempts.append(kwargs) or given)
    with pytest.raises(RuntimeError, match="diverged"):
        RobustnessComparison(draws=300, chains=2).fit(errors[errors["case"].isin(["case01", "case03", "case04"])])
    assert [one["target_accept"] for one in attempts] == [0.8, 0.99]


def test_a_comparison_can_be_saved(errors, monkeypatch, tmp_path):
    monkeypatch.setattr(posterior, "draw_chains", lambda *args, **kwargs: _chains(5))
    fitted = RobustnessComparison(draws=300, chains=2).fit(errors)
    save_model(fitted, tmp_path / "comparison.skh")
    again = load_model(tmp_path / "comparison.skh")
    pd.testing.assert_series_equal(again.probability_, fitted.probability_)
    pd.testing.assert_frame_equal(again.draws_["mu"], fitted.draws_["mu"])


def test_a_real_chain_that_is_too_short_is_an_error(results):
    with pytest.raises(RuntimeError, match="raise"):
        PatternExpressiveness(["hidden_size"], draws=10, tune=10, chains=2, random_state=0).fit(results)


def test_divergences_are_read_by_the_checker():
    good = pd.DataFrame({"r_hat": [1.0, 1.01], "ess": [400.0, 500.0]}, index=["time", "ID"])
    refuse_bad_chains(good, "or pray")
    with pytest.raises(RuntimeError, match=r"3 draws diverged.*raise tune=, or pray\."):
        refuse_bad_chains(good, "or pray", 3)
    with pytest.raises(RuntimeError, match="draws of time are worth 90 independent ones"):
        refuse_bad_chains(good.assign(ess=[90.0, 500.0]), "or pray")


# ---------------------------------------------------------------------------------------------------------- the choice
@pytest.fixture(scope="module")
def overview(results):
    return _overview(results, ())


def _fake_regression(left_out=None, **probabilities):
    table = pd.Series(probabilities, name="probability_reduces").to_frame()
    return SimpleNamespace(summary_=table, left_out_=left_out or {})


def test_cases_without_what_helps_drop_out(overview):
    helpful = {"time": 0.99, "pattern": 1.0, "past-w": 0.9, "future-w": 0.97, "ID": 0.999, "LSTM": 0.2}
    kept, wanted, reasons = _with_helpful_ingredients(overview, _fake_regression(**helpful), 0.95)
    assert wanted == {"time": 1, "future-w": 1, "ID": 1}
    assert sorted(kept) == sorted(
        f"{_name(*c)} input"
        for c in [("mlp", "case01"), ("mlp", "case03"), ("mlp", "case10"), ("lstm", "case01"), ("lstm", "case09")]
    )
    assert reasons[0].startswith("These reduce the error (with their probabilities): time features (0.990)")


def test_od_is_asked_for_where_it_is_better_and_the_impossible_is_waived(overview):
    kept, wanted, reasons = _with_helpful_ingredients(overview, _fake_regression(ID=0.01, time=0.5), 0.95)
    assert wanted == {"ID": 0}
    assert "OD (0.990)" in reasons[0]
    assert all(key.endswith(" output") for key in kept)
    poor = overview[overview["time"] == 0]
    kept, wanted, reasons = _with_helpful_ingredients(poor, _fake_regression(time=0.96, ID=0.99), 0.95)
    assert wanted == {"ID": 1}
    assert reasons[1] == "No case has all of these, so time features is not required."
    assert len(kept) == len(poor) / 2
    kept, wanted, reasons = _with_helpful_ingredients(overview, _fake_regression(time=0.6), 0.95)
    assert (len(kept), wanted) == (16, {})
    assert "No ingredient reduces the error" in reasons[0]


def _fake_comparison(overview, keys):
    order = overview.loc[keys].sort_values("median").index
    return SimpleNamespace(best_=order[0], indistinguishable_=list(order), probability_=overview["median"])


@pytest.mark.parametrize(
    ("left", "chosen", "said"),
    [
        (
            ["mlp case10 input", "lstm case09 output", "mlp case03 output"],
            "mlp case03 output",
            "history among these is 4 d",
        ),
        (["lstm case01 input", "lstm case01 output"], "lstm case01 input", "ID is as good as OD"),
        (["lstm case01 output", "mlp case10 input"], "lstm case01 output", "Only OD is left"),
        (["lstm case01 input", "mlp case01 input"], "lstm case01 input", "lstm has the best effect"),
        (
            ["mlp case02 input", "mlp case03 input"],
            "mlp case03 input",
            "2 cases, the one with the lowest median",
        ),
        (["mlp case10 input"], "mlp case10 input", "indistinguishable from it: 0"),
    ],
)
def test_history_then_kind_then_framework_then_median_decide(overview, left, chosen, said):
    keys = {
        f"{f} {c} {d}": f"{_name(f, c)} {d}" for f, c, d in overview[["framework", "case", "disturbance"]].to_numpy()
    }
    robust = _fake_comparison(overview, [keys[one] for one in left])
    found, reasons = _choose_by_rules(overview, robust, {"mlp": 0.0, "lstm": -0.1})
    assert found == keys[chosen]
    assert any(said in reason for reason in reasons), reasons
    assert any("Only OD is left" in reason for reason in reasons) == found.endswith("output")
    assert any("the one with the lowest median" in reason for reason in reasons) == ("lowest median" in said)


@pytest.mark.parametrize(
    ("medians", "chosen"),
    [
        ({"case01": 0.50, "case04": 0.49, "case05": 0.48, "case06": 0.47}, "case04"),
        ({"case01": 0.49, "case05": 0.48, "case06": 0.47}, "case01"),
        ({"case05": 0.48, "case06": 0.47}, "case06"),
    ],
)
def test_hour_of_week_is_preferred_to_day_of_week_and_weekday(medians, chosen):
    rows = [("lstm", case, "input", _name("lstm", case), m) for case, m in medians.items() for _ in range(2)]
    overview = _overview(pd.DataFrame(rows, columns=["framework", "case", "disturbance", "name", "rmse"]), ())
    found, reasons = _choose_by_rules(overview, _fake_comparison(overview, list(overview.index)), {"lstm": 0.0})
    assert found == f"{_name('lstm', chosen)} input"
    assert any(reason.startswith("Hour of week tells") for reason in reasons) == ("case01" in medians)


def test_baselines_are_ranked_by_their_error(results):
    rows = results.iloc[:3].assign(
        framework=["arx", "ridge", "profile"], name=["arx", "ridge", "profile"], case=None, rmse=[0.5, 0.3, 0.9]
    )
    rows["disturbance"] = [None, "input", "input"]
    robust = SimpleNamespace(probability_below=lambda chosen, error: error)
    baselines = _baselines(rows, robust, "x", 0.95)
    assert list(baselines.index) == ["ridge input", "arx", "profile input"]
    assert _baselines(rows, robust, "x", 0.6)["sufficient"].tolist() == [True, True, False]


@pytest.mark.slow
def test_a_choice_from_beginning_to_end(results):
    baselines = pd.DataFrame({"framework": ["ridge", "profile"], "name": ["ridge", "profile"], "rmse": [0.32, 1.2]})
    baselines = baselines.assign(case=None, disturbance="input")
    table = pd.concat([results, baselines], ignore_index=True)
    choice = select_case(table, draws=300, tune=200, chains=2, random_state=0)
    assert (choice.name, choice.disturbance) == ("DEEP_AR_LSTM_FORECAST-case01", "input")
    assert (
        choice.median
        == results.query("framework == 'lstm' and case == 'case01' and disturbance == 'input'").rmse.median()
    )
    assert set(choice.size) == {"hidden_size"}
    assert isinstance(choice.size["hidden_size"], int)
    assert choice.sufficient_baseline == "ridge input"
    assert choice.expressiveness.n_candidates_ == 16 * 3  # the three best sizes of each case
    assert choice.expressiveness.draws_["sigma_group"].between(0.0, 0.05).mean() > 0.9  # the cases have no other cause
    assert choice.table["median"].is_monotonic_increasing
    assert choice.table["verdict"].value_counts().to_dict()["chosen"] == 1
    assert choice.table.loc["profile input", "verdict"] == "worse than the choice"
    assert choice.table.loc["DEEP_MLP_FORECAST-case02 output", "verdict"] == "lacks time features, ID"
    assert str(choice).startswith("DEEP_AR_LSTM_FORECAST-case01 (ID), median error 0.4")
    n_left = (~choice.table["verdict"].str.startswith("lacks") & (choice.table["kind"] == "case")).sum()
    assert 0 < n_left < (choice.table["kind"] == "case").sum()
    assert f"Of {n_left} cases left, DEEP_AR_LSTM_FORECAST-case01 (ID) has the lowest median error" in str(choice)
    assert "A baseline is sufficient: ridge input, with 0.320 K, is better than the choice" in str(choice)


def test_a_case_of_ones_own_is_declared_and_not_named(results):
    with pytest.raises(ValueError, match="cases= has 'case01'; give cases of your own, as ModelCase"):
        select_case(results, cases=["case01"])


@pytest.mark.parametrize(
    ("change", "message"),
    [({"case": None}, "nothing but baselines"), ({"only": 1}, "every case of results has one size")],
)
def test_a_choice_needs_cases_and_sizes(results, change, message):
    table = results.drop_duplicates(["name", "disturbance"]) if "only" in change else results.assign(**change)
    with pytest.raises(ValueError, match=message):
        select_case(table)
    with pytest.raises(ValueError, match="level=1 is not between"):
        select_case(table, level=1)


# ------------------------------------------------------------------------------------------------------------ pictures
def test_the_posterior_is_drawn_term_by_term(regression):
    display = PosteriorDisplay.from_estimator(regression, title="office")
    ax = display.ax_
    assert [label.get_text() for label in ax.get_yticklabels()] == list(regression.summary_.index)
    assert "change of RMSE [K]" in ax.get_xlabel()
    shown = {text.get_text() for text in ax.texts}
    assert {f"{p:.3f}" for p in regression.summary_["probability_reduces"]} <= shown
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["mean, 90 % interval", "no effect"]
    ends = [line.get_xdata() for line in ax.get_lines() if len(line.get_xdata()) == 2]
    first = regression.summary_.iloc[0]
    assert any(np.array_equal(end, [first["lower"], first["upper"]]) for end in ends)
    again = PosteriorDisplay.from_predictions(regression.draws_[["time", "ID"]], log=True)
    assert "log RMSE [-]" in again.ax_.get_xlabel()
    assert again.summary.loc["time", "upper"] == pytest.approx(regression.summary_.loc["time", "upper"])


def test_the_robustness_is_drawn_in_order_of_medians(comparison):
    display = RobustnessDisplay.from_estimator(comparison)
    left, right = display.ax_
    assert [label.get_text() for label in left.get_yticklabels()] == list(comparison.probability_.index)
    assert "RMSE over sizes [K]" in left.get_xlabel()
    faces = [patch.get_facecolor()[:3] for patch in left.patches]
    blue = [case in comparison.indistinguishable_ for case in comparison.probability_.index]
    assert [face == faces[0] for face in faces] == blue
    worst = comparison.probability_.index[-1]
    assert f"{comparison.probability_[worst]:.3f}" in {text.get_text() for text in right.texts}
    few = RobustnessDisplay.from_estimator(comparison, n_cases=2)
    assert len(few.ax_[0].patches) == 2
