"""Numerical kernels: arrays in, NamedTuples out."""

from .channels import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .convolution import ConvShape, conv_epoch, conv_forecasts
from .dense import ACTIVATIONS, AdamStep, DenseShape, DenseWindows, dense_epoch, dense_forecasts
from .discretize import Discrete, discretize, divided_difference
from .gates import tanh32
from .kalman import Smoothed, kalman_track, smooth_states
from .leads import (
    LeadSensitivity,
    filter_gains,
    filter_series,
    lead_errors,
    lead_rows,
    lead_sensitivities,
    simulate_inputs,
)
from .multi_step import LeadErrors, multi_step_sensitivities
from .predictor import (
    Model,
    Prediction,
    Sensitivity,
    one_step_errors,
    one_step_sensitivities,
    simulate_inverse,
    simulate_path,
)
from .recurrent import RecurrentShape, RecurrentWindows, recurrent_epoch, recurrent_forecasts, recurrent_room
from .recursion import iterate_lags
from .tracker import track_path

__all__ = [
    "ACTIVATIONS",
    "AdamStep",
    "ChannelAdjoint",
    "ChannelFilter",
    "ConvShape",
    "DenseShape",
    "DenseWindows",
    "Discrete",
    "LeadErrors",
    "LeadSensitivity",
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
    "iterate_lags",
    "kalman_track",
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
    "tanh32",
    "track_path",
]
