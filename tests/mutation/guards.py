"""Tests that guard each numerical module: where a mutant of the module should fail.

The first pattern that matches a module's path in ``skhybrid`` is taken; quick tests stand first, because a run stops at
the first failure.  An entry is a file of tests, or a part of one by an expression of ``-k``.  ``COMPILED`` modules run
as plain Python, because numba keeps compiled callers of a changed kernel.
"""

_FILTERS = ["test_filtering", "test_predictor"]
_SCHEDULE = ["test_schedule_model", "test_schedule_scheme -k as_of_the_morning or better_than_the_mean"]
_OBJECTIVES = [
    "test_identification_gradients",
    "test_diagnostics",
    "test_identification -k not (starts or search)",
    "test_identification -k takes_what",
]
_FORECASTERS = "test_forecasting_common -k not (checks or processes or global or torch or network)"
_UPDATES = "test_online_updating -k whole_table or averaged or learns_the_new or leaves_the_model"

_CLOSED_LOOP = "test_set_points_known -k not (refused or other_schemes or saved)"
_BY_THE_CLOCK = "test_daily_work -k clock or cannot_be or outdoor or user_is_told or electricity_becomes"
_LOGS = ["test_log_report", "test_logs_text", "test_datasets_regularize", "test_datasets_readers"]
_SOURCES = ["test_logs_home_automation", "test_logs_sources -k not postgres", "test_logs_thermostats"]
_ZONE = "test_zone_folder -k not kill and not command_line and not second_tick and not errors_grow"
_BOOSTING = "test_forecasting_common -k boosting and not (checks or processes or global or torch)"
_BAYES = "test_model_selection_bayes -k not (quadrature or probabilities or real or beginning or divergences or saved)"

GUARDS = {
    "filtering/rows.py": ["test_horizon_errors", "test_filtering"],
    "filtering/tree_sums.py": ["test_set_points_known -k trees_as_arrays"],
    "filtering/forecast_sample.py": ["test_schedule_model -k hourly_origins", "test_multi_step -k hourly_and_leads"],
    "filtering/channel_filter.py": ["test_identification_gradients -k periodic"],
    "filtering/horizon_errors.py": ["test_horizon_errors"],
    "filtering/lead_rows.py": ["test_horizon_errors", "test_multi_step -k plain_loop or slopes"],
    "filtering/multi_step_errors.py": ["test_multi_step -k plain_loop or slopes"],
    "filtering/simulation.py": ["test_filtering", "test_forecasting_arx"],
    "filtering/load_paths.py": ["test_filtering", "test_load"],
    "filtering/normal_prior.py": ["test_fleet_prior"],
    "filtering/*.py": _FILTERS,
    "thermal/*.py": ["test_thermal", "test_thermal_networks", "test_identification_gradients", "test_two_zones"],
    "control/affine.py": ["test_affine"],
    "control/*.py": ["test_load", "test_schedule_scheme"],
    "schedule/schedule_loads.py": ["test_schedule_scheme -k load and not default or each_origin"],
    "schedule/*.py": _SCHEDULE,
    "identification/experiment_design/*.py": ["test_experiment_design"],
    "identification/diagnostics/dynamic_response.py": ["test_response"],
    "identification/diagnostics/*.py": ["test_diagnostics"],
    "identification/uncertainty/*.py": ["test_uncertainty"],
    "identification/fitting/forecast_errors.py": ["test_multi_step"],
    "identification/fitting/priors.py": ["test_uncertainty"],
    "identification/fitting/*.py": _OBJECTIVES,
    "identification/rolling_state.py": ["test_identification -k copy_follows", _UPDATES],
    "identification/periodic.py": [*_OBJECTIVES, "test_uncertainty"],
    "identification/loads.py": ["test_load", "test_identification"],
    "identification/*.py": [*_OBJECTIVES, "test_two_zones"],
    "forecasting/arx_multi_step.py": [
        "test_forecasting_arx_multi_step -k slopes or sums or lower or penalty or complete"
    ],
    "forecasting/arx_prior.py": ["test_fleet_prior"],
    "forecasting/arx*.py": ["test_forecasting_arx", "test_gain"],
    "forecasting/boost*.py": [_BOOSTING],
    "hybrid/thermostat_law/boosted_trees.py": ["test_set_points_known -k trees_as_arrays", _BOOSTING],
    "forecasting/pair_regressor.py": [_FORECASTERS],
    "forecasting/weather_error.py": ["test_weather_error"],
    "forecasting/joint_fit.py": ["test_forecasting_joint_fit"],
    "forecasting/intervals.py": ["test_intervals"],
    "forecasting/quantiles.py": ["test_intervals"],
    "forecasting/baselines.py": ["test_forecasting_baselines", _FORECASTERS],
    "forecasting/ridge.py": ["test_forecasting_baselines", _FORECASTERS],
    "forecasting/cases.py": ["test_forecasting_cases", "test_design_matrix"],
    "forecasting/features.py": ["test_forecasting_cases", _FORECASTERS, "test_networks_modules"],
    "hybrid/drift.py": ["test_drift"],
    "hybrid/plausible_range.py": ["test_runaways -k range or clipped"],
    "hybrid/hourly_aggregation.py": ["test_online_updating -k averaged", _UPDATES],
    "hybrid/weekly_refit.py": ["test_online_updating -k forecast_the_last_week", _UPDATES, "test_hybrid -k full_weeks"],
    "hybrid/blending/blend.py": [
        "test_schedule_scheme -k simplex or nothing_is_known or far_worse or groups_of_leads or fade"
    ],
    "hybrid/blending/rolling_blend.py": ["test_schedule_scheme -k fade or loops or residual"],
    "hybrid/blending/members.py": ["test_schedule_scheme -k block or refitted or morning or short_training"],
    "hybrid/thermostat_law/closed_loop.py": [_CLOSED_LOOP],
    "hybrid/thermostat_law/plant_law.py": [_CLOSED_LOOP],
    "hybrid/thermostat_law/law_features.py": [_CLOSED_LOOP],
    "hybrid/known_rows.py": ["test_online_updating -k last_stamp", _UPDATES],
    "hybrid/blending/daily_profile.py": ["test_schedule_scheme -k daily_profile"],
    "hybrid/thermostat_law/law_refits.py": [_CLOSED_LOOP],
    "hybrid/affine_frames.py": ["test_affine"],
    "hybrid/frames_forecast.py": [
        "test_daily_work -k never_cooled",
        "test_hybrid",
        "test_load",
        "test_set_points_known",
    ],
    "hybrid/blending/numbered_table.py": [_CLOSED_LOOP],
    "hybrid/*.py": ["test_schedule_scheme", "test_hybrid", "test_online_updating", "test_intervals"],
    "model_selection/splitters.py": ["test_model_selection -k not processes"],
    "model_selection/scorers.py": ["test_manners -k scorer"],
    "model_selection/backtest.py": ["test_model_selection -k not processes"],
    "model_selection/weather_paths.py": ["test_weather_error"],
    "model_selection/compare.py": ["test_compare"],
    "model_selection/recommendation.py": ["test_compare"],
    "model_selection/choice/*.py": [_BAYES],
    "model_selection/assessment.py": ["test_model_selection", "test_compare"],
    "preprocessing/_sun.py": ["test_facades"],
    "preprocessing/_gaps.py": ["test_preprocessing"],
    "datasets/_office.py": ["test_datasets_office"],
    "datasets/_thermostat_plan.py": ["test_datasets_office"],
    "datasets/_gains.py": ["test_datasets_office"],
    "datasets/_weather.py": ["test_datasets_weather", "test_datasets_small_office"],
    "datasets/_small_office.py": ["test_datasets_small_office"],
    "datasets/_benchmark.py": ["test_datasets_benchmark"],
    "logs/stamps.py": ["test_datasets_readers"],
    "logs/even_steps.py": ["test_datasets_regularize"],
    "logs/*.py": [*_LOGS, *_SOURCES],
    "study/judgement.py": ["test_verdict", "test_daily_work -k verdict"],
    "study/load_rules.py": ["test_verdict"],
    "study/verdict.py": ["test_verdict"],
    "study/plant.py": [_BY_THE_CLOCK],
    "study/thermostat.py": [_BY_THE_CLOCK],
    "zone/building.py": ["test_zone_tools"],
    "zone/zone_backtest.py": ["test_zone_tools"],
    "zone/zone_search.py": ["test_zone_tools"],
    "zone/rows_ahead.py": [_BY_THE_CLOCK, _ZONE],
    "zone/zone_folder.py": ["test_zone_tools", _ZONE],
    "zone/*.py": [_ZONE, "test_daily_work -k not texts and not sun and not command_line"],
    "_calendar.py": ["test_holidays", "test_forecasting_baselines", "test_contract"],
    "_last_known.py": ["test_forecasting_arx -k missing", "test_forecasting_baselines"],
    "_rolling.py": ["test_rolling", "test_hybrid"],
    "_time.py": ["test_contract", "test_rolling"],
}
COMPILED = ("filtering/*.py",)
