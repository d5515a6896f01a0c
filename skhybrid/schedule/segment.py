"""Rows of a table as the schedule model reads them, in deviations from a reference temperature."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._table import ZoneTable
from .channels import ChannelPlan, Channels, known_heat, make_channels


class Segment(NamedTuple):
    """Consecutive rows, in deviations from a reference temperature."""

    plan: ChannelPlan
    channels: Channels
    boundary: np.ndarray  # (N, nb) boundary temperatures [K]
    heat: np.ndarray  # (N,) known heat into the heated node [kW]
    y: np.ndarray  # (N,) measured temperature [K], 0 where missing
    seen: np.ndarray  # (N,) bool, whether a row was measured

    @property
    def n_rows(self) -> int:
        return len(self.y)

    def between(self, begin: int, end: int) -> Segment:
        """Rows from ``begin`` on, before ``end``."""
        rows = slice(begin, end)
        channels = self.channels._replace(series=self.channels.series[rows])
        return Segment(self.plan, channels, self.boundary[rows], self.heat[rows], self.y[rows], self.seen[rows])


def make_segment(
    plan: ChannelPlan, table: ZoneTable, T: np.ndarray, reference: float, like: Channels | None = None
) -> Segment:
    """Segment of a table and its measured temperature ``T`` (N,) [degC], NaN where missing.

    ``like`` are the channels of another segment under the same plan.
    """
    columns = [table.inputs[b] - reference for b in plan.network.boundaries]
    boundary = np.column_stack(columns) if columns else np.empty((table.n_rows, 0))
    seen = np.isfinite(T)
    measured = np.where(seen, T - reference, 0.0)
    return Segment(plan, make_channels(plan, table, like), boundary, known_heat(plan, table), measured, seen)


class NumberedSegment(NamedTuple):
    """Rows known by their numbers: those after the training rows, or of another table."""

    segment: Segment
    begin: int  # first row that the training has not seen
    joined: bool  # whether the rows before ``begin`` are the training's own
    first: int = 0  # number of the segment's first row, where the segment holds the last rows only
    whole: Callable[[], Segment] | None = None  # makes the segment of all rows from 0 on, where ``first`` is not 0

    def between(self, begin: int, end: int) -> Segment:
        if begin >= self.first:
            return self.segment.between(begin - self.first, end - self.first)
        assert self.whole is not None
        return self.whole().between(begin, end)
