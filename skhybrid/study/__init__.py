"""A whole study: from a log and its settings to fitted models, a comparison, a forecast and a report."""

from .compared_models import StudyModel, Yesterday, make_models
from .data import StudyData, read_log, split_log
from .outputs import format_table, write_outputs
from .proposal import propose_settings
from .report import study_picture, verdict, write_report
from .run import StudyResult, run_study
from .settings import Settings, read_settings, settings_from

__all__ = [
    "Settings",
    "StudyData",
    "StudyModel",
    "StudyResult",
    "Yesterday",
    "format_table",
    "make_models",
    "propose_settings",
    "read_log",
    "read_settings",
    "run_study",
    "settings_from",
    "split_log",
    "study_picture",
    "verdict",
    "write_outputs",
    "write_report",
]
