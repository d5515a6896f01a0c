"""Numerical kernels: arrays in, NamedTuples out."""

from .channels import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .dense import ACTIVATIONS, AdamStep, DenseShape, DenseWindows, dense_epoch, dense_errors
from .discretize import Discrete, discretize, divided_difference
from .gates import lstm_backward, lstm_forward, rnn_backward, rnn_forward, tanh32
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
from .recursion import iterate_lags

__all__ = [
    "ACTIVATIONS",
    "AdamStep",
    "ChannelAdjoint",
    "ChannelFilter",
    "DenseShape",
    "DenseWindows",
    "Discrete",
    "LeadErrors",
    "LeadSensitivity",
    "Model",
    "Prediction",
    "Sensitivity",
    "Smoothed",
    "dense_epoch",
    "dense_errors",
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
    "lstm_backward",
    "lstm_forward",
    "multi_step_sensitivities",
    "one_step_errors",
    "one_step_sensitivities",
    "rnn_backward",
    "rnn_forward",
    "simulate_inputs",
    "simulate_inverse",
    "simulate_path",
    "smooth_states",
    "tanh32",
]
