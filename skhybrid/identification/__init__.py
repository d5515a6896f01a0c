"""Identification of a thermal network under heat gains that nobody measures."""

from .adjacency import find_adjacency
from .conventional import GrayBoxRC
from .diagnostics.report import Diagnostics, diagnose, diagnose_residuals
from .diagnostics.residual_tests import autocorrelation, cross_correlation, cumulative_periodogram, ljung_box
from .experiment_design.plan import ExperimentPlan, plan_experiment
from .experiment_design.zone import GainStatistics
from .input_disturbance import InputDisturbanceID
from .output_disturbance import OutputDisturbanceID
from .periodic import PeriodicDisturbanceID
from .rooms import RoomFits, identify_rooms
from .state_space import StateSpace, frequency_response, make_state_space, step_response
from .uncertainty.identifiability import Identifiability
from .uncertainty.posterior import Posterior, sample_posterior
from .uncertainty.profile_likelihood import ProfileLikelihood, profile_likelihood

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
    "RoomFits",
    "StateSpace",
    "autocorrelation",
    "cross_correlation",
    "cumulative_periodogram",
    "diagnose",
    "diagnose_residuals",
    "find_adjacency",
    "frequency_response",
    "identify_rooms",
    "ljung_box",
    "make_state_space",
    "plan_experiment",
    "profile_likelihood",
    "sample_posterior",
    "step_response",
]
