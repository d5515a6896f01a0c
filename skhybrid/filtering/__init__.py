"""Compiled physics: discretisation, predictors, filters, forecast errors and load paths; arrays in, NamedTuples out."""

from .autoregression import iterate_lags
from .channel_filter import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .discretization import Discrete, discretize, divided_difference
from .forecast_sample import ForecastSample, hourly_sample
from .horizon_errors import (
    FilteredSeries,
    FilterGains,
    InputStates,
    LeadSensitivity,
    filter_gains,
    filter_series,
    lead_errors,
    lead_sensitivities,
    simulate_inputs,
)
from .innovations import Model, Prediction, Sensitivity, one_step_errors, one_step_sensitivities
from .inverse_load import LoadPath, simulate_inverse
from .kalman import Filtered, Smoothed, kalman_filter, smooth_states
from .lead_rows import lead_rows
from .lq_path import solve_lq_path
from .multi_step_errors import LeadErrors, multi_step_sensitivities
from .simulation import simulate_path

__all__ = [
    "ChannelAdjoint",
    "ChannelFilter",
    "Discrete",
    "FilterGains",
    "Filtered",
    "FilteredSeries",
    "ForecastSample",
    "InputStates",
    "LeadErrors",
    "LeadSensitivity",
    "LoadPath",
    "Model",
    "Prediction",
    "Sensitivity",
    "Smoothed",
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
    "multi_step_sensitivities",
    "one_step_errors",
    "one_step_sensitivities",
    "simulate_inputs",
    "simulate_inverse",
    "simulate_path",
    "smooth_states",
    "solve_lq_path",
]
