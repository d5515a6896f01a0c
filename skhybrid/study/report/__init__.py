"""A study as one self-contained HTML page."""

from .building_page import write_building_report
from .figures import study_picture
from .words import verdict
from .zone_page import write_zone_report

__all__ = ["study_picture", "verdict", "write_building_report", "write_zone_report"]
