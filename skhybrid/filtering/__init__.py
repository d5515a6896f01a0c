"""Compiled physics: discretisation, predictors, filters, forecast errors and load paths; arrays in, NamedTuples out."""

from .channel_filter import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .discretization import Discrete, discretize, divided_difference
from .forecast_sample import ForecastSample, hourly_sample
from .horizon_errors import filter_gains, filter_series, lead_errors, lead_sensitivities, simulate_inputs
from .innovations import Model, Prediction, Sensitivity, one_step_errors, one_step_sensitivities
from .kalman import kalman_filter, smooth_states
from .lead_rows import lead_rows
from .load_paths import simulate_inverse, solve_lq_path
from .multi_step_errors import multi_step_sensitivities
from .normal_equations import cholesky_root, solve_positive_definite, with_products
from .normal_prior import learn_normal, shrunk_covariance
from .regression_slopes import regression_slopes
from .simplex import simplex_weights
from .simulation import iterate_lags, low_pass, simulate_path
from .tree_sums import sum_of_leaves

__all__ = [
    "ChannelAdjoint",
    "ChannelFilter",
    "Discrete",
    "ForecastSample",
    "Model",
    "Prediction",
    "Sensitivity",
    "cholesky_root",
    "discretize",
    "divided_difference",
    "filter_channels",
    "filter_channels_adjoint",
    "filter_gains",
    "filter_series",
    "hourly_sample",
    "iterate_lags",
    "kalman_filter",
    "lead_errors",
    "lead_rows",
    "lead_sensitivities",
    "learn_normal",
    "low_pass",
    "multi_step_sensitivities",
    "one_step_errors",
    "one_step_sensitivities",
    "regression_slopes",
    "shrunk_covariance",
    "simplex_weights",
    "simulate_inputs",
    "simulate_inverse",
    "simulate_path",
    "smooth_states",
    "solve_lq_path",
    "solve_positive_definite",
    "sum_of_leaves",
    "with_products",
]
