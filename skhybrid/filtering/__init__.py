"""Compiled physics: discretisation, predictors, filters, forecast errors and load paths; arrays in, NamedTuples out."""

from .autoregression import iterate_lags
from .channel_filter import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .convolution import ConvShape, conv_epoch, conv_forecasts
from .dense import ACTIVATIONS, AdamStep, DenseShape, DenseWindows, dense_epoch, dense_forecasts
from .discretization import Discrete, discretize, divided_difference
from .forecast_sample import ForecastSample, hourly_sample
from .gates import tanh32
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
from .recurrent import RecurrentShape, RecurrentWindows, recurrent_epoch, recurrent_forecasts, recurrent_room
from .simulation import simulate_path

__all__ = [
    "ACTIVATIONS",
    "AdamStep",
    "ChannelAdjoint",
    "ChannelFilter",
    "ConvShape",
    "DenseShape",
    "DenseWindows",
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
    "RecurrentShape",
    "RecurrentWindows",
    "Sensitivity",
    "Smoothed",
    "conv_epoch",
    "conv_forecasts",
    "dense_epoch",
    "dense_forecasts",
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
    "recurrent_epoch",
    "recurrent_forecasts",
    "recurrent_room",
    "simulate_inputs",
    "simulate_inverse",
    "simulate_path",
    "smooth_states",
    "solve_lq_path",
    "tanh32",
]
