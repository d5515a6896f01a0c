"""Displays of the unmeasured heat: an estimate by hour of the week, and the schedules learned by the default model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._arguments import refuse_without
from .._table import as_numbers, float_columns
from .._time import same_stamps, wall_clock
from ._display import Display, refuse_other
from ._style import COLORS, MEASURED, WEEKDAYS, axes_or_new, legend, line_style, tidy

_PANELS = {"gain": "scheduled heat [kW]", "ua": "scheduled conductance\n[kW/K]"}
_HOURS = 24


@dataclass(eq=False, repr=False)
class DisturbanceWeekDisplay(Display):
    """Median and spread of an estimated disturbance by hour of the week, with the truth if it is known.

    Parameters
    ----------
    week : DataFrame
        Columns ``low``, ``median``, ``high`` and, if known, ``truth``, by hour of the week (0 is Monday 00:00).
    unit : str

    %(attributes)s
    """

    week: pd.DataFrame
    unit: str = "kW"

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
        %(drawing)s
        """
        gray_box = getattr(estimator, "gray_box_", estimator)
        if hasattr(gray_box, "schedule_"):
            raise ValueError(
                f"{type(estimator).__name__} learned schedules and estimates no disturbance; draw a ScheduleDisplay."
            )
        names = getattr(gray_box, "feature_names_in_", None)
        if names is not None and isinstance(X, pd.DataFrame) and set(names) <= set(X.columns):
            others = [column for column in X if column not in set(names)]  # T_za, where y stood in for it in the fit
            X = X[[*names, *others]]  # a predictor may have passed the columns to its gray box in another order
        refuse_without(gray_box, "estimate_disturbance", "an identification, such as OutputDisturbanceID")
        zeta = gray_box.estimate_disturbance(X, kind=kind, smooth=smooth)
        return cls.from_predictions(zeta, truth=truth, unit="kW" if kind == "input" else "K", ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, zeta: pd.Series, *, truth: Any = None, unit: str = "kW", ax: Any = None, **kwargs: Any
    ) -> DisturbanceWeekDisplay:
        """Draw a disturbance that has been estimated, by hour of the week.

        Parameters
        ----------
        zeta : Series
            The disturbance, with time stamps.
        truth : Series or array-like of shape (n_samples,), optional
            True disturbance of every row.
        unit : str
        %(drawing)s
        """
        refuse_other(zeta, pd.Series, "zeta", "estimate_disturbance")
        return cls(_week(zeta, truth), unit).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> DisturbanceWeekDisplay:
        """Draw the median, the range of 80 % of the weeks, and the truth.

        %(ax)s
        %(title)s
        """
        ax = axes_or_new(ax, (9.0, 3.2))
        hours = self.week.index.to_numpy(dtype=float)
        spread = {"label": "10 to 90 % of the weeks", "color": COLORS[0], "alpha": 0.2, "linewidth": 0}
        ax.fill_between(hours, self.week["low"], self.week["high"], step="post", **spread)
        ax.step(hours, self.week["median"], where="post", color=COLORS[0], linewidth=1.6, label="median estimate")
        if "truth" in self.week:
            line = {"color": MEASURED, "linestyle": "--", "linewidth": 1.2}
            ax.step(hours, self.week["truth"], where="post", label="truth (mean)", **line)
        ax.axhline(0.0, color="#888888", linewidth=0.8)
        what = "temperature disturbance" if self.unit == "K" else "unmeasured heat"
        tidy(ax, ylabel=f"{what} [{self.unit}]", xlabel="day of the week (local time)")
        ax.set_xlim(0, 168)
        ax.set_xticks(np.arange(0, 169, 24), minor=True)
        ax.set_xticks(np.arange(12, 168, 24), WEEKDAYS)
        ax.grid(False, axis="x")
        ax.grid(True, axis="x", which="minor", color="#dddddd", linewidth=0.6)
        ax.tick_params(axis="x", which="major", length=0)
        legend(ax, title)
        return self._drawn_on(ax)


def _week(zeta: pd.Series, truth: Any) -> pd.DataFrame:
    """Compute median, 10th and 90th percentile by hour of the week, and the mean of the truth."""
    index = zeta.index
    if not isinstance(index, pd.DatetimeIndex):
        raise ValueError("the disturbance has no time stamps, so its hours are unknown; give X a DatetimeIndex.")
    wall = wall_clock(index)
    hour = wall.day_of_week * 24 + wall.hour
    groups = pd.Series(as_numbers(zeta, "the disturbance")).groupby(np.asarray(hour))
    week = pd.DataFrame({"low": groups.quantile(0.1), "median": groups.median(), "high": groups.quantile(0.9)})
    if truth is not None:
        known = as_numbers(truth, "truth")
        if known.shape != (len(zeta),):
            raise ValueError(f"truth has the shape {known.shape}, but the disturbance has {len(zeta)} rows.")
        stamps = getattr(truth, "index", None)
        if isinstance(stamps, pd.DatetimeIndex) and not same_stamps(stamps, index):
            raise ValueError("truth has other time stamps than the disturbance; align it, as by reindex, before.")
        week["truth"] = pd.Series(known).groupby(np.asarray(hour)).mean()
    held = int(np.diff(week.index).min()) if len(week) > 1 else 1  # hours that a value stands for; others stay empty
    return week.reindex(range(169), method="ffill", limit=held)


@dataclass(eq=False, repr=False)
class ScheduleDisplay(Display):
    """Unmeasured heat and additional conductance to outdoors by hour of working days and weekends.

    Parameters
    ----------
    schedule : DataFrame
        ``gain`` [kW] and ``ua`` [kW/K] by day type and hour, as in ``gray_box_.schedule_`` of a
        :class:`~skhybrid.hybrid.HybridPredictor`.

    %(attributes)s
    """

    schedule: pd.DataFrame

    @classmethod
    def from_estimator(cls, estimator: Any, *, ax: Any = None, **kwargs: Any) -> ScheduleDisplay:
        """Draw the schedules of a fitted predictor.

        Parameters
        ----------
        estimator : fitted HybridPredictor
        %(drawing)s
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
            As in the class.
        %(drawing)s
        """
        float_columns(schedule, _PANELS, "the schedule")
        return cls(schedule).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> ScheduleDisplay:
        """Draw both schedules, with one line per type of day.

        %(ax)s
        %(title)s
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
        legend(axes[0], title)
        return self._drawn_on(axes)
