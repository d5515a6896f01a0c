"""A study as one self-contained HTML page."""

from .figures import building_picture, study_picture
from .words import verdict
from .zone_page import write_report

__all__ = ["building_picture", "study_picture", "verdict", "write_report"]
