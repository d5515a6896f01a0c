"""Physical parameters: a value is apart from its metadata (unit, bounds, sign, how it is searched)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd


@dataclass(frozen=True)
class Parameter:
    """What is known of a parameter before any data.

    Attributes
    ----------
    name : str
        The paper's symbol, such as ``C_w``.
    unit : str
        In square brackets in tables, such as ``kWh/K``.
    lower, upper : float
        Bounds of the value itself; for a negative parameter both are negative.
    description : str
    transform : {"log", "identity"}
        ``"log"`` searches the logarithm of the magnitude.
    """

    name: str
    unit: str
    lower: float
    upper: float
    description: str = ""
    transform: str = "log"

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise ValueError(f"bounds of {self.name} are ({self.lower}, {self.upper}); the lower must be the smaller.")
        if self.transform == "log" and not self.lower * self.upper > 0:
            raise ValueError(
                f"bounds of {self.name} are ({self.lower}, {self.upper}); both must have one sign and not be zero."
            )

    @property
    def sign(self) -> float:
        """-1 where the parameter is negative, else 1."""
        return -1.0 if self.transform == "log" and self.upper < 0 else 1.0

    @property
    def default(self) -> float:
        """The middle of the bounds, on the scale that is searched."""
        return float(self.from_free(0.5 * sum(self.free_bounds)))

    @property
    def free_bounds(self) -> tuple[float, float]:
        """Bounds on the scale that is searched."""
        ends = sorted((float(self.to_free(self.lower)), float(self.to_free(self.upper))))
        return ends[0], ends[1]

    def to_free(self, value: float) -> float:
        """From the value to the scale that is searched.

        Parameters
        ----------
        value : float

        Returns
        -------
        float
        """
        return float(np.log(value * self.sign)) if self.transform == "log" else float(value)

    def from_free(self, free: float) -> float:
        """From the scale that is searched to the value.

        Parameters
        ----------
        free : float

        Returns
        -------
        float
        """
        return float(self.sign * np.exp(free)) if self.transform == "log" else float(free)

    def slope(self, value: float) -> float:
        """Derivative of the value by what is searched.

        Parameters
        ----------
        value : float

        Returns
        -------
        float
        """
        return float(value) if self.transform == "log" else 1.0

    def bounded(self, bounds: tuple[float, float] | None) -> Parameter:
        """The same parameter within other bounds.

        Parameters
        ----------
        bounds : tuple of (lower, upper) or None
            None leaves it as it is.

        Returns
        -------
        Parameter
        """
        if bounds is None:
            return self
        lower, upper = sorted(float(b) for b in bounds)
        return replace(self, lower=lower, upper=upper)


def parameter_table(parameters: Sequence[Parameter]) -> pd.DataFrame:
    """Name, unit, bounds, transform and meaning, one row a parameter."""
    rows = [(p.name, p.unit, p.lower, p.upper, p.transform, p.description) for p in parameters]
    return pd.DataFrame(rows, columns=["name", "unit", "lower", "upper", "transform", "description"]).set_index("name")
