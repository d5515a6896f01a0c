"""Number of steps for which a load is held when the heat that meets a set-point is sought (paper Eq. inverseQ2)."""

from __future__ import annotations

import numpy as np

#: a load that overshoots by a larger share than this from step to step rings
RINGING = 0.25
#: largest growth per step of the state under an inverse that is stable
_GROWTH = 1.0 + 1e-6
#: longest hold of a load that is tried [steps]
MOST_AHEAD = 24


def steps_ahead(A: np.ndarray, heat: np.ndarray, c: np.ndarray) -> int:
    """Steps for which a load is assumed to be held when it is sought (1: paper Eq. inverseQ2 itself).

    The state under the load that meets every set-point at once follows ``A - b (c A) / (c b)``. A negative eigenvalue
    (heat that reaches the sensor through another node) makes each load overshoot and the next take it back; one above 1
    (heat that first moves the sensor the other way) makes the load run away. The shortest hold that damps both is
    taken.
    """
    held, power = np.array(heat, dtype=np.float64), np.array(A, dtype=np.float64)
    for ahead in range(1, MOST_AHEAD):
        effect = c @ held
        if effect != 0:
            inverse = np.linalg.eigvals(A - np.outer(heat, c @ power) / effect)
            if inverse.real.min() > -RINGING and np.abs(inverse).max() < _GROWTH:
                return ahead
        held, power = heat + A @ held, A @ power
    return MOST_AHEAD
