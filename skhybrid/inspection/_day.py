"""Display of a day-ahead forecast."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

from ._display import Display
from ._style import COLORS, MEASURED, axes_or_new, bands, heading, legend, tidy, time_axis


@dataclass(eq=False, repr=False)
class DayAheadDisplay(Display):
    """Forecast of one day: zone temperature, and the heat needed to hold the set-point.

    Parameters
    ----------
    forecast : DataFrame
        Forecast by time: ``T_za`` [degC] and, if there are any, its quantiles ``q_0.1`` ... [degC] and the load
        ``Q_hvac`` [kW].
    measured : DataFrame, optional
        Measurements by time: ``T_za`` [degC] and, if there is any, ``Q_hvac`` [kW]; may begin before the forecast.
    setpoint : Series or float, optional
        Set-point that the load holds [degC].

    %(attributes)s
    """

    forecast: pd.DataFrame
    measured: pd.DataFrame | None = None
    setpoint: Any = None

    @classmethod
    def from_predictions(
        cls,
        forecast: pd.DataFrame,
        *,
        measured: pd.DataFrame | None = None,
        setpoint: Any = None,
        ax: Any = None,
        **kwargs: Any,
    ) -> DayAheadDisplay:
        """Draw a forecast that has been made.

        Parameters
        ----------
        forecast, measured, setpoint
            As in the class.
        %(drawing)s
        """
        return cls(forecast, measured, setpoint).plot(ax, **kwargs)

    @property
    def n_axes(self) -> int:
        """Number of axes that :meth:`plot` draws on."""
        return 2 if "Q_hvac" in self.forecast else 1

    def plot(self, ax: Any = None, *, title: str | None = None) -> DayAheadDisplay:
        """Draw the temperature and, if there is one, the load.

        %(ax)s
        %(title)s
        """
        axes = axes_or_new(ax, (9.0, 2.6 * self.n_axes + 0.6), self.n_axes)
        above = axes[0] if self.n_axes == 2 else axes
        self._draw_temperature(above)
        if self.n_axes == 2:
            self._draw_load(axes[1])
        time_axis(axes[1] if self.n_axes == 2 else above, self.forecast.index)
        heading(above, title)
        return self._drawn_on(axes)

    def _draw_temperature(self, ax: Any) -> None:
        if self.measured is not None and self.measured["T_za"].notna().any():
            ax.plot(self.measured.index, self.measured["T_za"], color=MEASURED, linewidth=1.6, label="measured")
        ax.plot(self.forecast.index, self.forecast["T_za"], color=COLORS[0], linewidth=1.8, label="forecast")
        n_bands = bands(ax, self.forecast.index, self.forecast, COLORS[0])
        if self.setpoint is not None:
            setpoint = pd.Series(self.setpoint, index=self.forecast.index)
            ax.plot(setpoint.index, setpoint, color=COLORS[2], linestyle=":", linewidth=1.4, label="set-point")
        tidy(ax, ylabel="zone temperature [degC]")
        legend(ax, 3 + n_bands)

    def _draw_load(self, ax: Any) -> None:
        if self.measured is not None and "Q_hvac" in self.measured and self.measured["Q_hvac"].notna().any():
            given = self.measured["Q_hvac"]
            ax.step(given.index, given, where="post", color=MEASURED, linewidth=1.2, label="delivered")
        load = self.forecast["Q_hvac"]
        ax.step(load.index, load, where="post", color=COLORS[1], linewidth=1.6, label="needed (forecast)")
        ax.fill_between(load.index, load, step="post", color=COLORS[1], alpha=0.15, linewidth=0)
        ax.axhline(0.0, color="#888888", linewidth=0.8)
        tidy(ax, ylabel="heat [kW]\n(+ heating, − cooling)")
        legend(ax, 2)
