"""Rows at the end of a log that have temperatures but not all inputs, as while a meter is silent."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._table import listed

BRIDGED = pd.Timedelta("12h")  # longest outage that is bridged: a filter is worse off when it starts anew


class Unread(NamedTuple):
    """Rows at the end of a log whose temperatures are known, but not all inputs."""

    inputs: tuple[str, ...]  # names of columns
    origin: pd.Timestamp  # the last row with all inputs
    first: pd.Timestamp
    last: pd.Timestamp
    n_rows: int

    @classmethod
    def of(cls, rows: pd.DataFrame, columns_of: Callable[[list[str]], list[str]] = list) -> Unread | None:
        """Of rows of inputs up to the last temperature; None if all are known, or no row has all.

        ``columns_of`` gives the columns of the log with some roles.
        """
        missing = rows.isna()
        n_rows = int(np.argmin(missing.any(axis=1).to_numpy()[::-1])) if len(rows) else 0
        if not n_rows:
            return None
        absent = [str(role) for role, gone in missing.iloc[-n_rows:].any().items() if gone]
        names = tuple(columns_of(absent)) or tuple(absent)
        return cls(names, rows.index[-n_rows - 1], rows.index[-n_rows], rows.index[-1], n_rows)

    @property
    def is_step(self) -> bool:
        """Whether it is the last step only, which may be under way."""
        return self.n_rows == 1

    def __str__(self) -> str:
        return (
            f"no values of {listed(self.inputs)} since {self.first}, although temperatures are known until "
            f"{self.last}: forecasts start from {self.origin}"
        )

    def refuse_long(self) -> None:
        """Refuse a forecast if temperatures go on for more than twelve hours without the inputs."""
        if self.last - self.origin > BRIDGED:
            raise ValueError(f"{self}; see that they are logged again, or fit a model without them.")
