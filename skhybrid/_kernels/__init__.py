"""Numerical kernels: arrays in, NamedTuples out."""

from .channels import ChannelAdjoint, ChannelFilter, filter_channels, filter_channels_adjoint
from .discretize import Discrete, discretize, divided_difference
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
from .tracker import track_path

__all__ = [
    "ChannelAdjoint",
    "ChannelFilter",
    "Discrete",
    "LeadErrors",
    "LeadSensitivity",
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
    "iterate_lags",
    "kalman_track",
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
    "track_path",
]
