"""A study as one self-contained HTML page."""

from .figures import study_picture
from .html import write_report
from .verdict import verdict

__all__ = ["study_picture", "verdict", "write_report"]
