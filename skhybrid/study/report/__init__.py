"""A study as one self-contained HTML page."""

from .figures import study_picture
from .html import verdict, write_report

__all__ = ["study_picture", "verdict", "write_report"]
