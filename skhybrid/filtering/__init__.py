"""Compiled physics: discretisation, predictors, filters, forecast errors and load paths; arrays in, NamedTuples out."""

from .channel_filter import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .discretization import Discrete, discretize, divided_difference
from .forecast_sample import ForecastSample, hourly_sample
from .horizon_errors import filter_gains, filter_series, lead_errors, lead_sensitivities, simulate_inputs
from .innovations import Model, Prediction, Sensitivity, one_step_errors, one_step_sensitivities
from .kalman import kalman_filter, smooth_states
from .load_paths import simulate_inverse, solve_lq_path
from .multi_step_errors import lead_rows, multi_step_sensitivities
from .normal_equations import cholesky_root, learn_normal, shrunk_covariance, solve_positive_definite, with_products
from .regression_slopes import regression_slopes
from .simplex import simplex_weights
from .simulation import iterate_lags, low_pass, simulate_path
from .tree_sums import sum_of_leaves
