"""A whole study: from a log and its settings to fitted models, a comparison, a forecast and a report."""

from .compared_models import StudyModel, Yesterday, make_models
from .log_reading import read_log
from .log_split import StudyData, split_log
from .outputs import write_outputs, write_report
from .proposal import propose_settings
from .results import StudyResult
from .run import run_study
from .settings import Settings, read_settings

__all__ = [
    "Settings",
    "StudyData",
    "StudyModel",
    "StudyResult",
    "Yesterday",
    "make_models",
    "propose_settings",
    "read_log",
    "read_settings",
    "run_study",
    "split_log",
    "write_outputs",
    "write_report",
]
