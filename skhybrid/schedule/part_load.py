"""Part-load curves: heat of a stage that is not in proportion to the stage."""

from __future__ import annotations

import numpy as np
from sklearn.isotonic import isotonic_regression

#: least slope of a part-load curve, as a share of the proportional one
_LEAST_SLOPE = 0.5


def knot_name(role: str, knot: float) -> str:
    """Name of the channel of one knot of a stage's part-load curve."""
    return f"{role}_{knot:.2g}"


def deviation(stage: np.ndarray, knot: float, largest: float) -> np.ndarray:
    """Deviation of a part-load curve from proportional heat: largest at the knot, 0 at stage 0 and from ``largest`` on.

    So the heat of the full stage stays that of its capacity, and a stage that was not seen stays proportional.
    """
    return np.minimum(stage, knot) - np.minimum(stage, largest) * knot / largest


def increasing_curve(curve: np.ndarray, proportional: np.ndarray) -> np.ndarray:
    """The nearest curve that increases everywhere, between the same ends.

    A part-load curve is learned from rooms whose thermostat chose the stage.  Where it is flat or falling, many stages
    give the same heat, and the first of them may be far below the one at which a building runs.
    """
    least = _LEAST_SLOPE * proportional
    return isotonic_regression(curve - least, y_min=0.0, y_max=proportional[-1] - least[-1]) + least
