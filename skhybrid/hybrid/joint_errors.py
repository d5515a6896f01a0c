"""Errors that past forecasts made together along a day, after which the samples of a forecast are ordered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .._arguments import check_integer, random_numbers
from .._clock import hour_of_day
from .._last_known import held_paths
from .._time import wall_clock

_NEAR = 1.5  # hours of the day within which errors are drawn
_LEAST_DRAWN = 10  # forecasts from about that hour of the day, below which those of any are drawn


class JointErrors(NamedTuple):
    """Errors of past forecasts of one or several quantities: how long they last, and which come together."""

    values: np.ndarray  # (n_origins, n_leads, n_quantities) float16, of which the order counts
    hours: np.ndarray  # (n_origins,) hour of the day of each origin

    @classmethod
    def of(cls, errors: np.ndarray, index: pd.Index, origins: np.ndarray) -> Self | None:
        """Of forecasts (n_origins, n_leads, n_quantities) from some rows; None where there are none.

        An error that is not known is the last known one before it.
        """
        if not len(origins):
            return None
        values = np.stack([held_paths(of_one) for of_one in np.moveaxis(errors, -1, 0)], axis=-1)
        return cls(values.astype(np.float16), origin_hours(index)[origins])

    def samples(self, bands: Mapping[str, pd.DataFrame], hour: float, rng: np.random.RandomState) -> pd.DataFrame:
        """A row per sample and row ahead, by the quantiles (n_rows, n_samples) of each quantity."""
        paths = self.in_order(np.stack([band.to_numpy() for band in bands.values()], axis=-1), hour, rng)
        index = next(iter(bands.values())).index
        each = [pd.Index(range(len(paths)), name="sample"), index.rename(index.name or "time")]
        return pd.DataFrame(paths.reshape(-1, len(bands)), pd.MultiIndex.from_product(each), list(bands))

    def in_order(self, bands: np.ndarray, hour: float, rng: np.random.RandomState) -> np.ndarray:
        """(n_samples, n_rows, n_quantities) paths from as many quantiles of each row (n_rows, n_samples, n_quantities).

        Each has in every row the rank that the error of one past forecast from about that ``hour`` has among those
        that are drawn (the Schaake shuffle, Clark et al. 2004, J. Hydrometeorology 5, 243-262).  After the last lead
        its error holds on.
        """
        n_rows, n_samples, _ = bands.shape
        near = np.flatnonzero(np.abs((self.hours - hour + 12) % 24 - 12) <= _NEAR)
        near = near if len(near) >= _LEAST_DRAWN else np.arange(len(self.hours))
        leads = np.minimum(np.arange(n_rows), self.values.shape[1] - 1)
        drawn = self.values[rng.choice(near, n_samples)][:, leads]
        by_size = np.lexsort((rng.random_sample(drawn.shape), drawn), axis=0)  # equal errors, as of no load, by chance
        return np.take_along_axis(bands.swapaxes(0, 1), np.argsort(by_size, axis=0), axis=0)


class SampleMixin:
    """``sample`` of predictors that forecast quantiles; a subclass gives ``forecast`` and ``_samples``."""

    forecast: Callable[..., pd.DataFrame]
    _samples: Callable[..., pd.DataFrame]

    def sample(
        self,
        history: pd.DataFrame | None,
        future: pd.DataFrame,
        n_samples: int = 100,
        T_za: Any = None,
        setpoint: Any = None,
        *,
        weather_error: Any = None,
        limits: Any = None,
        random_state: Any = None,
    ) -> pd.DataFrame:
        """Draw paths of a forecast, whose sums, peaks and costs have the uncertainty of a whole day.

        Each row of the paths has the quantiles of :meth:`forecast`.  Along a path these are ordered after the errors of
        one forecast of training days that the model was not fitted on, so that errors last as long as they do.

        Parameters
        ----------
        history, future
            As in :meth:`forecast`.
        n_samples : int, default=100
        T_za, setpoint, weather_error, limits
            As in :meth:`forecast`.
        random_state : int, RandomState or None

        Returns
        -------
        DataFrame of n_samples * n_future rows
            Indexed by ``sample`` and the index of ``future``: ``T_za`` [degC], and under a thermostat ``Q_hvac`` [kW].
            Of several zones, names end with the zone's, and errors are those that all zones made together.

        Raises
        ------
        ValueError
            As in :meth:`forecast`.
        TooFewDaysError
            If no intervals were learned, or not the thermostat of a zone that is to keep set-points.

        Examples
        --------
        >>> from skhybrid import HybridPredictor
        >>> from skhybrid.datasets import make_office
        >>> office = make_office(n_days=22, random_state=0)
        >>> model = HybridPredictor(known={"Q_h": 6.0}).fit(office.X[:-96], office.y[:-96])
        >>> paths = model.sample(None, office.X[-96:], random_state=0)
        >>> paths["T_za"].groupby("sample").max().quantile([0.1, 0.9]).shape  # of the highest temperature
        (2,)
        """
        check_integer("n_samples", n_samples)
        rng, levels = random_numbers(random_state), list((np.arange(n_samples) + 0.5) / n_samples)
        given = {"weather_error": weather_error, "limits": limits}
        frame = self.forecast(history, future, T_za, setpoint, levels, **given)
        return self._samples(frame, levels, T_za, rng)


def origin_hours(index: pd.Index) -> np.ndarray:
    """(n,) hour of the day, 0 without stamps."""
    if not isinstance(index, pd.DatetimeIndex):
        return np.zeros(len(index))
    return hour_of_day(wall_clock(index))
