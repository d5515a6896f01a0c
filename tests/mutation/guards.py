"""Tests that guard each numerical module: where a mutant of the module should fail.

The first pattern that a module's path in ``skhybrid`` matches is taken; quick tests stand first, for a run stops at the
first failure.  ``COMPILED`` modules run as plain Python, for numba keeps compiled callers of a kernel that has changed.
"""

GUARDS = {
    "_kernels/covariance.py": ["test_kernels", "test_scheduled"],
    "_kernels/discretize.py": ["test_kernels", "test_identification_gradients"],
    "_kernels/kalman.py": ["test_kernels", "test_identification"],
    "_kernels/leads.py": ["test_scheduled"],
    "_kernels/multi_step.py": ["test_multi_step"],
    "_kernels/predictor.py": ["test_predictor"],
    "_kernels/recursion.py": ["test_kernels", "test_forecasting_arx", "test_load"],
    "_kernels/tracker.py": ["test_scheduled", "test_load"],
    "thermal/*.py": ["test_thermal", "test_thermal_networks", "test_two_zones"],
    "identification/scheduled/*.py": ["test_scheduled", "test_schedule_scheme"],
    "identification/experiment*.py": ["test_experiment_design", "test_identification"],
    "identification/excitation.py": ["test_experiment_design", "test_identification"],
    "identification/information.py": ["test_experiment_design", "test_uncertainty"],
    "identification/diagnostics.py": ["test_diagnostics"],
    "identification/residual_tests.py": ["test_diagnostics"],
    "identification/load.py": ["test_load", "test_identification"],
    "identification/setpoints.py": ["test_load"],
    "identification/multi_step.py": ["test_multi_step"],
    "identification/response.py": ["test_response"],
    "identification/uncertainty.py": ["test_uncertainty"],
    "identification/profile.py": ["test_uncertainty"],
    "identification/priors.py": ["test_uncertainty"],
    "identification/*.py": ["test_identification_gradients", "test_identification", "test_two_zones"],
    "forecasting/arx.py": ["test_forecasting_arx"],
    "forecasting/intervals.py": ["test_intervals"],
    "forecasting/quantiles.py": ["test_intervals"],
    "forecasting/rivals.py": ["test_forecasting_rivals", "test_forecasting_common"],
    "forecasting/features.py": ["test_forecasting_cases", "test_forecasting_common", "test_forecasting_nets"],
    "forecasting/*.py": ["test_forecasting_common", "test_forecasting_training", "test_forecasting_nets"],
    "hybrid/drift.py": ["test_drift"],
    "hybrid/*.py": ["test_hybrid", "test_schedule_scheme", "test_online_updating", "test_intervals"],
    "model_selection/splitters.py": ["test_model_selection"],
    "_rolling.py": ["test_rolling", "test_hybrid"],
    "_clock.py": ["test_contract", "test_rolling"],
}
COMPILED = ("_kernels/*.py",)
