"""scikit-learn's own checks on every estimator that holds a thermal network."""

from __future__ import annotations

import pytest
from scipy.optimize import minimize
from sklearn.linear_model import Ridge
from sklearn.utils.estimator_checks import parametrize_with_checks

from skhybrid import (
    BuildingPredictor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    InputDisturbanceID,
    OutputDisturbanceID,
    PeriodicDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
)
from skhybrid.identification.fitting import periodic_likelihood, prediction_errors

#: the checks feed arrays, which have no time stamps
STEP = {"sampling_time": "15min"}
ESTIMATORS = [
    GrayBoxRC(n_starts=1, random_state=0, **STEP),
    InputDisturbanceID(n_starts=1, random_state=0, **STEP),
    OutputDisturbanceID(n_starts=1, random_state=0, **STEP),
    PeriodicDisturbanceID(n_starts=1, random_state=0, **STEP),
    HybridPredictor(**STEP),
    BuildingPredictor(SchedulePredictor(**STEP)),
    SchedulePredictor(**STEP),
    TwoStagePredictor(
        InputDisturbanceID(n_starts=1, random_state=0),
        DisturbanceForecaster(Ridge(), random_state=0),
        random_state=0,
        **STEP,
    ),
]
MULTI_STEP = [
    method(n_starts=1, random_state=0, objective="multi_step", **STEP)
    for method in (GrayBoxRC, InputDisturbanceID, OutputDisturbanceID)
]
ROWS_ARE_TIME_STEPS = "rows are consecutive time steps: their order is information, and a part of them has another past"


def _expected(estimator):
    return {
        "check_methods_sample_order_invariance": ROWS_ARE_TIME_STEPS,
        "check_methods_subset_invariance": ROWS_ARE_TIME_STEPS,
    }


@pytest.fixture(scope="module", autouse=True)
def few_steps(quick_fits):
    """Searches of parameters stop after a few steps too, since no check asks for the minimum."""
    together = prediction_errors.minimise_together

    def of_least_squares(evaluate, starts, low, high, max_evaluations, tolerance):
        return together(evaluate, starts, low, high, min(max_evaluations, 4), tolerance)

    def of_the_likelihood(*given, options, **more):
        return minimize(*given, options=options | {"maxiter": 3}, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction_errors, "minimise_together", of_least_squares)
        patch.setattr(periodic_likelihood, "minimize", of_the_likelihood)
        yield


@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
@parametrize_with_checks(ESTIMATORS, expected_failed_checks=_expected)
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
@parametrize_with_checks(MULTI_STEP, expected_failed_checks=_expected)
def test_scikit_learn_checks_of_the_other_objective(estimator, check):
    check(estimator)
