"""Messages about one zone of a building."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..._warnings import warn_once, warnings_of_zone
from ...exceptions import SkhybridWarning
from ..base import BaseHybrid


@contextmanager
def of_zone(zone: str) -> Iterator[None]:
    """Name the zone in errors and warnings of its predictor."""
    try:
        with warnings_of_zone(zone):
            yield
    except ValueError as error:
        raise type(error)(f"zone {zone!r}: {error}") from None


def warn_of_usual(model: BaseHybrid) -> None:
    """Warn, once per fit, of a plant that is forecast without set-points."""
    if model._has_usual_plant:
        warn_once(
            "no thermostat was learned, as the training had no set-points or the plant never ran: heat and temperature "
            "are forecast as they usually were at that hour and in that weather.",
            SkhybridWarning,
            model.training_,
        )
