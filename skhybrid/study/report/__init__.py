"""A study as one self-contained HTML page."""

from .figures import study_picture
from .words import verdict
from .zone_page import write_report

__all__ = ["study_picture", "verdict", "write_report"]
