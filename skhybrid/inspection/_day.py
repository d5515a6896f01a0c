"""The next day: temperature above, heating and cooling below."""

from __future__ import annotations

from typing import Any

import pandas as pd

from ._style import COLORS, MEASURED, axes_or_new, bands, legend, tidy, time_axis


class DayAheadDisplay:
    """Forecast of one day: zone temperature, and the heat that holds the set-point.

    Make it with :meth:`from_predictions`.

    Parameters
    ----------
    forecast : DataFrame
        Index = time; column ``T_za`` [degC], ``q_0.1`` ... [degC] where its quantiles were forecast, and ``Q_hvac``
        [kW] where a load was.
    measured : DataFrame, optional
        Index = time; ``T_za`` [degC] and ``Q_hvac`` [kW] where they are known; may begin before the forecast.
    setpoint : Series or float, optional
        Temperature that the load holds [degC].

    Attributes
    ----------
    ax_ : matplotlib Axes or ndarray of Axes
        What was drawn on, after :meth:`plot`: one, or two where there is a load.
    figure_ : matplotlib Figure
        The figure that holds them.
    """

    ax_: Any
    figure_: Any

    def __init__(self, forecast: pd.DataFrame, measured: pd.DataFrame | None = None, setpoint: Any = None) -> None:
        self.forecast = forecast
        self.measured = measured
        self.setpoint = setpoint

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
        """Draw a forecast that was made already.

        Parameters
        ----------
        forecast : DataFrame
            Index = time; column ``T_za`` [degC], ``q_0.1`` ... where its quantiles were forecast, and ``Q_hvac`` [kW]
            where a load was.
        measured : DataFrame, optional
            Index = time; the same columns, where they are known.
        setpoint : Series or float, optional
            Temperature that the load holds [degC].
        ax : matplotlib Axes, or two of them where there is a load, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        DayAheadDisplay
        """
        return cls(forecast, measured, setpoint).plot(ax, **kwargs)

    @property
    def n_axes(self) -> int:
        """How many axes :meth:`plot` draws on."""
        return 2 if "Q_hvac" in self.forecast else 1

    def plot(self, ax: Any = None, *, title: str | None = None) -> DayAheadDisplay:
        """Draw the temperature and, where there is one, the load.

        Parameters
        ----------
        ax : matplotlib Axes, or two of them where there is a load, optional
            Where to draw; default is a new figure.
        title : str, optional
            Above the picture.

        Returns
        -------
        DayAheadDisplay
            With ``ax_`` and ``figure_``.
        """
        axes = axes_or_new(ax, (9.0, 2.6 * self.n_axes + 0.6), self.n_axes)
        above = axes[0] if self.n_axes == 2 else axes
        last = above
        self._temperature(above)
        if self.n_axes == 2:
            last = axes[1]
            self._load(last)
        time_axis(last, self.forecast.index)
        if title:
            above.set_title(title, loc="left", fontsize="medium", fontweight="bold", pad=30)
        self.ax_, self.figure_ = axes, above.figure
        return self

    def _temperature(self, ax: Any) -> None:
        if self.measured is not None and self.measured["T_za"].notna().any():
            ax.plot(self.measured.index, self.measured["T_za"], color=MEASURED, linewidth=1.6, label="measured")
        ax.plot(self.forecast.index, self.forecast["T_za"], color=COLORS[0], linewidth=1.8, label="forecast")
        n_bands = bands(ax, self.forecast.index, self.forecast, COLORS[0])
        if self.setpoint is not None:
            held = pd.Series(self.setpoint, index=self.forecast.index)
            ax.plot(held.index, held, color=COLORS[2], linestyle=":", linewidth=1.4, label="set-point")
        tidy(ax, ylabel="zone temperature [degC]")
        legend(ax, 3 + n_bands)

    def _load(self, ax: Any) -> None:
        if self.measured is not None and "Q_hvac" in self.measured and self.measured["Q_hvac"].notna().any():
            ax.step(
                self.measured.index,
                self.measured["Q_hvac"],
                where="post",
                color=MEASURED,
                linewidth=1.2,
                label="delivered",
            )
        load = self.forecast["Q_hvac"]
        ax.step(load.index, load, where="post", color=COLORS[1], linewidth=1.6, label="needed (forecast)")
        ax.fill_between(load.index, load, step="post", color=COLORS[1], alpha=0.15, linewidth=0)
        ax.axhline(0.0, color="#888888", linewidth=0.8)
        tidy(ax, ylabel="heat [kW]\n(+ heating, − cooling)")
        legend(ax, 2)
