"""Display of a disturbance by hour of the week."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._time import ASSUMED_START
from ._style import COLORS, MEASURED, WEEKDAYS, axes_or_new, heading, legend, tidy


class DisturbanceWeekDisplay:
    """Median and spread of an estimated disturbance by hour of the week, with the truth if it is known.

    Create it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    week : DataFrame
        Columns ``low``, ``median``, ``high`` and, if known, ``truth``, by hour of the week (0 is Monday 00:00).
    unit : str
        Unit of the disturbance.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that :meth:`plot` drew on.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    ax_: Any
    figure_: Any

    def __init__(self, week: pd.DataFrame, unit: str = "kW") -> None:
        self.week = week
        self.unit = unit

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Any,
        *,
        truth: Any = None,
        kind: str = "input",
        smooth: bool = True,
        ax: Any = None,
        **kwargs: Any,
    ) -> DisturbanceWeekDisplay:
        """Estimate the disturbance of a table and draw it by hour of the week.

        Parameters
        ----------
        estimator : fitted estimator
            A gray box, or a predictor with one in ``gray_box_``.
        X : DataFrame
            Consecutive rows with the measured ``T_za``.
        truth : Series or array-like of shape (n_samples,), optional
            True disturbance, if it is known [kW].
        kind : {"input", "output"}, default="input"
            Heat into the zone [kW], or a shift of the measured temperature [K].
        smooth : bool, default=True
            Whether each estimate uses the whole table, or only the rows up to its own.
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        DisturbanceWeekDisplay
        """
        gray_box = getattr(estimator, "gray_box_", estimator)
        names = getattr(gray_box, "feature_names_in_", None)
        if names is not None and isinstance(X, pd.DataFrame) and set(names) <= set(X.columns):
            X = X[list(names)]  # a predictor may have passed the columns to its gray box in another order
        zeta = gray_box.estimate_disturbance(X, kind=kind, smooth=smooth)
        unit = "kW" if kind == "input" else "K"
        return cls.from_predictions(zeta, truth=truth, unit=unit, ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, zeta: pd.Series, *, truth: Any = None, unit: str = "kW", ax: Any = None, **kwargs: Any
    ) -> DisturbanceWeekDisplay:
        """Draw a disturbance that has been estimated, by hour of the week.

        Parameters
        ----------
        zeta : Series
            The disturbance; without time stamps it is assumed to begin on a Monday at 00:00 with a step of 15 min.
        truth : Series or array-like of shape (n_samples,), optional
            True disturbance of every row.
        unit : str
            Unit of the disturbance.
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        DisturbanceWeekDisplay
        """
        return cls(_week(pd.Series(zeta), truth), unit).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> DisturbanceWeekDisplay:
        """Draw the median, the range of 80 % of the weeks, and the truth.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        title : str, optional
            Title of the figure.

        Returns
        -------
        DisturbanceWeekDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        ax = axes_or_new(ax, (9.0, 3.2))
        hours = self.week.index.to_numpy(dtype=float)
        ax.fill_between(
            hours, self.week["low"], self.week["high"], step="post", color=COLORS[0], alpha=0.2, linewidth=0,
            label="10 to 90 % of the weeks",
        )  # fmt: skip
        ax.step(hours, self.week["median"], where="post", color=COLORS[0], linewidth=1.6, label="median estimate")
        if "truth" in self.week:
            ax.step(
                hours,
                self.week["truth"],
                where="post",
                color=MEASURED,
                linestyle="--",
                linewidth=1.2,
                label="truth (mean)",
            )
        ax.axhline(0.0, color="#888888", linewidth=0.8)
        tidy(ax, ylabel=f"unmeasured heat [{self.unit}]", xlabel="day of the week (local time)")
        ax.set_xlim(0, 168)
        ax.set_xticks(np.arange(0, 169, 24), minor=True)
        ax.set_xticks(np.arange(12, 168, 24), WEEKDAYS)
        ax.grid(False, axis="x")
        ax.grid(True, axis="x", which="minor", color="#dddddd", linewidth=0.6)
        ax.tick_params(axis="x", which="major", length=0)
        legend(ax, 3)
        heading(ax, title)
        self.ax_, self.figure_ = ax, ax.figure
        return self


def _week(zeta: pd.Series, truth: Any) -> pd.DataFrame:
    """Compute median, 10th and 90th percentile by hour of the week, and the mean of the truth."""
    index = zeta.index
    if isinstance(index, pd.DatetimeIndex):
        wall = index.tz_localize(None) if index.tz is not None else index
    else:
        wall = pd.DatetimeIndex(ASSUMED_START + np.arange(len(zeta)) * pd.Timedelta("15min"))
    hour = wall.day_of_week * 24 + wall.hour
    groups = pd.Series(zeta.to_numpy(dtype=float)).groupby(np.asarray(hour))
    week = pd.DataFrame({"low": groups.quantile(0.1), "median": groups.median(), "high": groups.quantile(0.9)})
    if truth is not None:
        known = np.asarray(truth, dtype=float)
        if known.shape != (len(zeta),):
            raise ValueError(f"truth has the shape {known.shape}, but the disturbance has {len(zeta)} rows.")
        week["truth"] = pd.Series(known).groupby(np.asarray(hour)).mean()
    return week.reindex(range(169), method="ffill")
