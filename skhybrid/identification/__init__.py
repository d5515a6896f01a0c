"""Identification of a thermal network in spite of heat that nobody measures."""

from .base import StateSpace
from .diagnostics import Diagnostics, diagnose, diagnose_residuals
from .experiment_design import ExperimentPlan, plan_experiment
from .identifiability import Identifiability
from .information import GainStatistics
from .least_squares import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID
from .periodic_estimator import PeriodicDisturbanceID
from .posterior import Posterior, sample_posterior
from .profile import ProfileLikelihood, profile_likelihood
from .residual_tests import autocorrelation, cross_correlation, cumulative_periodogram, ljung_box
from .response import frequency_response, make_state_space, step_response

__all__ = [
    "Diagnostics",
    "ExperimentPlan",
    "GainStatistics",
    "GrayBoxRC",
    "Identifiability",
    "InputDisturbanceID",
    "OutputDisturbanceID",
    "PeriodicDisturbanceID",
    "Posterior",
    "ProfileLikelihood",
    "StateSpace",
    "autocorrelation",
    "cross_correlation",
    "cumulative_periodogram",
    "diagnose",
    "diagnose_residuals",
    "frequency_response",
    "ljung_box",
    "make_state_space",
    "plan_experiment",
    "profile_likelihood",
    "sample_posterior",
    "step_response",
]
