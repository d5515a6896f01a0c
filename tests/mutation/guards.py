"""Tests that guard each numerical module: where a mutant of the module should fail.

The first pattern that matches a module's path in ``skhybrid`` is taken; quick tests stand first, because a run stops at
the first failure.  ``COMPILED`` modules run as plain Python, because numba keeps compiled callers of a changed kernel.
"""

_FILTERS = ["test_filtering", "test_predictor"]
_SCHEDULE = ["test_schedule_model", "test_schedule_scheme"]
_IDENTIFICATION = ["test_identification_gradients", "test_identification", "test_two_zones"]

GUARDS = {
    "filtering/horizon_errors.py": ["test_horizon_errors", "test_schedule_model"],
    "filtering/lead_rows.py": ["test_horizon_errors", "test_multi_step"],
    "filtering/multi_step_errors.py": ["test_multi_step"],
    "filtering/simulation.py": ["test_filtering", "test_forecasting_arx"],
    "filtering/load_paths.py": ["test_filtering", "test_load"],
    "filtering/*.py": _FILTERS,
    "thermal/*.py": ["test_thermal", "test_thermal_networks", "test_two_zones"],
    "control/*.py": ["test_load", "test_schedule_scheme"],
    "schedule/*.py": _SCHEDULE,
    "identification/experiment_design/*.py": ["test_experiment_design"],
    "identification/diagnostics/dynamic_response.py": ["test_response"],
    "identification/diagnostics/*.py": ["test_diagnostics"],
    "identification/uncertainty/*.py": ["test_uncertainty"],
    "identification/fitting/forecast_errors.py": ["test_multi_step"],
    "identification/fitting/priors.py": ["test_uncertainty"],
    "identification/loads.py": ["test_load", "test_identification"],
    "identification/*.py": _IDENTIFICATION,
    "forecasting/arx*.py": ["test_forecasting_arx"],
    "forecasting/recursive_arx.py": ["test_forecasting_arx"],
    "forecasting/intervals.py": ["test_intervals"],
    "forecasting/quantiles.py": ["test_intervals"],
    "forecasting/baselines.py": ["test_forecasting_baselines", "test_forecasting_common"],
    "forecasting/ridge.py": ["test_forecasting_baselines", "test_forecasting_common"],
    "forecasting/features.py": ["test_forecasting_cases", "test_forecasting_common", "test_networks_modules"],
    "hybrid/drift.py": ["test_drift"],
    "hybrid/*.py": ["test_schedule_scheme", "test_hybrid", "test_online_updating", "test_intervals"],
    "model_selection/splitters.py": ["test_model_selection"],
    "_rolling.py": ["test_rolling", "test_hybrid"],
    "_time.py": ["test_contract", "test_rolling"],
}
COMPILED = ("filtering/*.py",)
