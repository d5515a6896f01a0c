"""Display of the schedules learned by the default model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ._style import axes_or_new, heading, legend, line_style, tidy

_PANELS = {"gain": "unmeasured heat [kW]", "ua": "additional conductance\n[kW/K]"}
_HOURS = 24


class ScheduleDisplay:
    """Unmeasured heat and additional conductance to outdoors by hour of working days and weekends.

    Create it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    schedule : DataFrame
        ``gain`` [kW] and ``ua`` [kW/K] by day type and hour, as in ``gray_box_.schedule_`` of a
        :class:`~skhybrid.HybridPredictor`.

    Attributes
    ----------
    ax_ : ndarray of matplotlib Axes
        Axes that :meth:`plot` drew on: heat above, conductance below.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    ax_: Any
    figure_: Any

    def __init__(self, schedule: pd.DataFrame) -> None:
        self.schedule = schedule

    @classmethod
    def from_estimator(cls, estimator: Any, *, ax: Any = None, **kwargs: Any) -> ScheduleDisplay:
        """Draw the schedules of a fitted predictor.

        Parameters
        ----------
        estimator : fitted HybridPredictor
            A predictor of the default scheme.
        ax : array of two matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        ScheduleDisplay

        Raises
        ------
        ValueError
            If the predictor has learned no schedules.
        """
        check_is_fitted(estimator)
        schedule = getattr(getattr(estimator, "gray_box_", None), "schedule_", None)
        if schedule is None:
            raise ValueError(
                f"{type(estimator).__name__} has learned no schedules; draw a predictor of the default scheme, "
                "HybridPredictor()."
            )
        return cls.from_predictions(schedule, ax=ax, **kwargs)

    @classmethod
    def from_predictions(cls, schedule: pd.DataFrame, *, ax: Any = None, **kwargs: Any) -> ScheduleDisplay:
        """Draw schedules that have been learned.

        Parameters
        ----------
        schedule : DataFrame
            ``gain`` [kW] and ``ua`` [kW/K] by day type and hour.
        ax : array of two matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        ScheduleDisplay
        """
        return cls(schedule).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> ScheduleDisplay:
        """Draw both schedules, with one line per type of day.

        Parameters
        ----------
        ax : array of two matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        title : str, optional
            Title of the figure.

        Returns
        -------
        ScheduleDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        axes = axes_or_new(ax, (9.0, 4.6), len(_PANELS))
        days = list(dict.fromkeys(self.schedule.index.get_level_values("day")))
        for panel, (kind, label) in zip(axes, _PANELS.items(), strict=True):
            for number, day in enumerate(days):
                by_hour = self.schedule[kind].xs(day, level="day").to_numpy()
                edges = np.append(by_hour, by_hour[-1])  # so that the last hour has its width
                panel.step(np.arange(_HOURS + 1), edges, where="post", linewidth=1.6, label=day, **line_style(number))
            panel.axhline(0.0, color="#888888", linewidth=0.8)
            tidy(panel, ylabel=label)
        axes[-1].set(xlim=(0, _HOURS), xticks=range(0, _HOURS + 1, 3), xlabel="local hour [h]")
        legend(axes[0], len(days))
        heading(axes[0], title)
        self.ax_, self.figure_ = axes, axes[0].figure
        return self
