"""Logs of thermostats and building systems: readers of every format, and the way to one column per role."""

from .even_steps import regularize
from .formats import read_log
from .log_report import LogReport
from .raw_log import RawLog
from .zone_csv import read_zone_csv, to_left_label

__all__ = ["LogReport", "RawLog", "read_log", "read_zone_csv", "regularize", "to_left_label"]
