"""Displays of forecasts: measured and forecast temperature over days, the error by lead, and a single day ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .._table import as_numbers, float_columns, listed
from .._time import read_instant
from ..model_selection import backtest, score_backtest
from ._display import Display, frames_by_label, refuse_no_numbers, refuse_no_times, refuse_other_zones
from ._style import (
    COLORS,
    MARKERS,
    MEASURED,
    axes_or_new,
    bands,
    heading,
    legend,
    line_style,
    shared_legend,
    tidy,
    time_axis,
)

_NO_STAMPS, _NO_ZONE = "row numbers", "no time zone"
_SIDES = {"T_heat_set": "heating set-point", "T_cool_set": "cooling set-point"}  # of a thermostat, by role


class ForecastDisplay(Display):
    """Measured zone temperature and the forecasts of one or several models.

    Parameters
    ----------
    frames : mapping of label to DataFrame
        Back-tests, as returned by :func:`skhybrid.model_selection.backtest`; if they have quantiles, the bands between
        these are shaded.  With a column ``zone`` there is a panel per zone.

    %(attributes)s
    """

    def __init__(self, frames: Mapping[str, pd.DataFrame]) -> None:
        self.frames = dict(frames)

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Any,
        y: Any,
        *,
        horizon: Any = "1D",
        origin_step: Any = "1D",
        quantiles: Sequence[float] | None = None,
        ax: Any = None,
        **kwargs: Any,
    ) -> ForecastDisplay:
        """Back-test fitted estimators and draw their forecasts; each zone of several has a panel.

        %(backtest)s
        quantiles : sequence of float, optional
            As in :func:`skhybrid.model_selection.backtest`.
        %(drawing)s
        """
        return cls.from_predictions(_run_backtests(estimator, X, y, horizon, origin_step, quantiles), ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, frames: Mapping[str, pd.DataFrame] | pd.DataFrame, *, ax: Any = None, **kwargs: Any
    ) -> ForecastDisplay:
        """Draw back-tests that have been made.

        Parameters
        ----------
        frames : DataFrame or mapping of label to DataFrame
            Back-tests with the columns origin, time, y_true and y_pred, ``q_...`` for bands, and ``zone`` where there
            are several.
        %(drawing)s
        """
        return cls(_labelled(frames, ("origin", "time"))).plot(ax, **kwargs)

    def plot(
        self, ax: Any = None, *, start: Any = None, end: Any = None, unit: str = "degC", title: str | None = None
    ) -> ForecastDisplay:
        """Draw the measured temperature and each model's forecasts, from origins whose spans do not overlap.

        If a back-test has quantiles, the pairs around its median are shaded and labelled with their probability.

        %(ax)s
        start, end : timestamp, optional
            Limits of the time to draw.
        unit : str
            Unit in the label of the axis.
        %(title)s
        """
        chosen = {label: _within(_without_overlap(frame), start, end) for label, frame in self.frames.items()}
        given = next(iter(self.frames.values()))
        zones = list(given["zone"].unique()) if "zone" in given else []
        axes = axes_or_new(ax, (9.0, 2.0 * len(zones) + 0.9 if zones else 3.6), max(1, len(zones)))
        panels = np.ravel(np.asarray(axes, dtype=object))
        for panel, zone in zip(panels, zones or [None], strict=True):
            of_zone = {
                label: frame if zone is None else frame[frame["zone"] == zone] for label, frame in chosen.items()
            }
            _draw_forecasts(panel, of_zone)
            tidy(panel, ylabel=f"zone temperature [{unit}]" if zone is None else f"{zone} [{unit}]")
        time_axis(panels[-1], pd.Index(pd.concat([frame["time"] for frame in chosen.values()])))
        if zones:
            shared_legend(panels, title)
        else:
            legend(axes, title)
        return self._drawn_on(axes)


def _draw_forecasts(ax: Any, frames: Mapping[str, pd.DataFrame]) -> None:
    """One zone: the measurement, and the forecasts by label."""
    all_times = pd.concat(list(frames.values())).drop_duplicates("time").sort_values("time")
    seen = _apart(all_times)
    if "zone" not in seen or seen["y_true"].notna().any():
        ax.plot(seen["time"], seen["y_true"], color=MEASURED, linewidth=1.6, label="measured")
    for number, (label, frame) in enumerate(frames.items()):
        style, spans = line_style(number, beside_measured=True), _apart(frame)
        ax.plot(spans["time"], spans["y_pred"], linewidth=1.3, label=label, **style)
        bands(ax, spans["time"], spans, style["color"], label if len(frames) > 1 else "")
    for origin in all_times["origin"].unique():
        ax.axvline(origin, color="#888888", linewidth=0.8, linestyle="--", zorder=0.5)


def _apart(frame: pd.DataFrame) -> pd.DataFrame:
    """Forecasts of one zone in the order of time, with a row without values before a span that begins after a gap."""
    begins = frame.loc[frame["origin"] > frame["time"].shift(), "origin"]
    return pd.concat([frame, pd.DataFrame({"origin": begins, "time": begins})]).sort_values("time", kind="stable")


@dataclass(eq=False, repr=False)
class LeadErrorDisplay(Display):
    """Root mean square error by lead of one or several back-tests.

    Parameters
    ----------
    errors : DataFrame; errors [K] by lead, one column per model

    %(attributes)s
    """

    errors: pd.DataFrame

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: Any,
        y: Any,
        *,
        horizon: Any = "1D",
        origin_step: Any = "1D",
        ax: Any = None,
        **kwargs: Any,
    ) -> LeadErrorDisplay:
        """Back-test fitted estimators and draw their errors by lead.

        %(backtest)s
        %(drawing)s
        """
        return cls.from_predictions(_run_backtests(estimator, X, y, horizon, origin_step), ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, frames: Mapping[str, pd.DataFrame] | pd.DataFrame, *, ax: Any = None, **kwargs: Any
    ) -> LeadErrorDisplay:
        """Draw the errors of back-tests that have been made.

        Parameters
        ----------
        frames : DataFrame or mapping of label to DataFrame
            Back-tests with the columns lead, y_true and y_pred.
        %(drawing)s
        """
        labelled = _labelled(frames, ("lead",))
        errors = {label: score_backtest(frame, by="lead")["rmse"] for label, frame in labelled.items()}
        return cls(pd.DataFrame(errors)).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> LeadErrorDisplay:
        """Draw one line per model.

        %(ax)s
        %(title)s
        """
        ax = axes_or_new(ax, (7.0, 3.6))
        hours = pd.TimedeltaIndex(self.errors.index) / pd.Timedelta("1h")
        for number, (label, values) in enumerate(self.errors.items()):
            marks = {"marker": MARKERS[number % len(MARKERS)], "markersize": 4.5, "markevery": (2 * number, 12)}
            ax.plot(hours, values, linewidth=1.5, label=label, **line_style(number), **marks)
        tidy(ax, ylabel="RMSE of temperature [K]", xlabel="lead [h]")
        ax.set_xlim(0, hours.max())
        ax.set_ylim(bottom=0)
        if hours.max() % 6 == 0:
            ax.set_xticks(range(0, int(hours.max()) + 1, 6 if hours.max() > 12 else 3))
        legend(ax, title)
        return self._drawn_on(ax)


@dataclass(eq=False, repr=False)
class DayAheadDisplay(Display):
    """Forecast of one day: zone temperature, and the heat needed to hold the set-point.

    Parameters
    ----------
    forecast : DataFrame
        Forecast by time: ``T_za`` [degC] and, if there are any, its quantiles ``q_0.1`` ... [degC] and the load
        ``Q_hvac`` [kW], with its quantiles ``Q_hvac_0.1`` and ``Q_hvac_0.9``, and a thermostat's ``T_heat_set`` and
        ``T_cool_set`` [degC].
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
        refuse_no_numbers(forecast, ("T_za",), ("Q_hvac", "Q_hvac_0.1", "Q_hvac_0.9"), "the forecast")
        if measured is not None:
            float_columns(measured, ("T_za",), "measured")
            theirs, ours = _clock(measured.index), _clock(forecast.index)
            if theirs != ours and {theirs, ours} & {_NO_STAMPS, _NO_ZONE}:  # two zones are drawn as they should
                raise ValueError(f"measured has another clock ({theirs}) than the forecast ({ours}); convert one.")
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
        panels = np.ravel(np.asarray(axes, dtype=object))
        self._draw_temperature(panels[0])
        if self.n_axes == 2:
            self._draw_load(panels[1])
        time_axis(panels[-1], self.forecast.index)
        heading(panels[0], title)
        return self._drawn_on(axes)

    def _draw_temperature(self, ax: Any) -> None:
        if self.measured is not None and self.measured["T_za"].notna().any():
            ax.plot(self.measured.index, self.measured["T_za"], color=MEASURED, linewidth=1.6, label="measured")
        style = line_style(0, beside_measured=True)
        ax.plot(self.forecast.index, self.forecast["T_za"], linewidth=1.8, label="forecast", **style)
        bands(ax, self.forecast.index, self.forecast, COLORS[0])
        if self.setpoint is not None:
            ax.plot(self.forecast.index, self._held(), color=COLORS[2], linestyle=":", linewidth=1.4, label="set-point")
        for role, label in _SIDES.items():
            if role in self.forecast:
                ax.step(self.forecast.index, self.forecast[role], where="post", color="#777777", lw=1.0, label=label)
        tidy(ax, ylabel="zone temperature [degC]")
        legend(ax)

    def _held(self) -> np.ndarray:
        """The set-point in every row of the forecast."""
        held, index = self.setpoint, self.forecast.index
        if isinstance(held, pd.Series):
            if not held.index.isin(index).any():
                raise ValueError("setpoint has no time of the forecast; give it the time stamps of the forecast.")
            held = held.reindex(index)
        values = as_numbers(held, "setpoint")
        if values.shape not in ((), (len(index),)):
            raise ValueError(f"setpoint has the shape {values.shape}; give a number, or one for each row.")
        return np.broadcast_to(values, len(index))

    def _draw_load(self, ax: Any) -> None:
        if self.measured is not None and "Q_hvac" in self.measured and self.measured["Q_hvac"].notna().any():
            given = self.measured["Q_hvac"]
            ax.step(given.index, given, where="post", color=MEASURED, linewidth=1.2, label="delivered")
        load = self.forecast["Q_hvac"]
        style = {"color": COLORS[1], "linestyle": "--", "linewidth": 1.6}
        label = "forecast" if any(role in self.forecast for role in _SIDES) else "needed (forecast)"
        ax.step(load.index, load, where="post", label=label, **style)
        edges = [self.forecast.get(f"Q_hvac_{level}", load) for level in (0.1, 0.9)]
        band: dict[str, Any] = {"step": "post", "color": COLORS[1], "linewidth": 0}
        if any(edge is load for edge in edges):
            ax.fill_between(load.index, load, alpha=0.15, **band)
        else:
            ax.fill_between(load.index, *edges, alpha=0.22, label="80 % interval", **band)
        ax.axhline(0.0, color="#888888", linewidth=0.8)
        tidy(ax, ylabel="heat [kW]\n(+ heating, − cooling)")
        legend(ax)


def _labelled(frames: Mapping[str, pd.DataFrame] | pd.DataFrame, needed: Sequence[str]) -> Mapping[str, pd.DataFrame]:
    """Return back-tests by label, with the ``needed`` columns; a single one is labelled "forecast"."""
    found = frames_by_label(frames, "forecast", "frames", "skhybrid.model_selection.backtest")
    if not found or any(frame.empty for frame in found.values()):
        raise ValueError("there is no back-test to draw; pass at least one, with at least one origin.")
    for frame in found.values():
        float_columns(frame, ("y_true", "y_pred"), "the back-test")
        refuse_no_times(frame, needed)
    if "time" in needed:
        refuse_other_zones(found)
    if "time" in needed and len(clocks := {_clock(frame["time"]): label for label, frame in found.items()}) > 1:
        raise ValueError(
            f"the back-tests {listed(clocks.values())} have different clocks: {listed(clocks)}; bring X to one "
            "(tz_localize, tz_convert)."
        )
    return found


def _clock(time: Any) -> str:
    """The clock of time stamps or row numbers, in words."""
    index = pd.Index(time)
    if not isinstance(index, pd.DatetimeIndex):
        return _NO_STAMPS
    return _NO_ZONE if index.tz is None else str(index.tz)


def _run_backtests(
    estimator: Any, X: Any, y: Any, horizon: Any, origin_step: Any, quantiles: Sequence[float] | None = None
) -> dict[str, pd.DataFrame]:
    models = estimator if isinstance(estimator, Mapping) else {type(estimator).__name__: estimator}
    return {
        label: backtest(model, X, y, horizon=horizon, origin_step=origin_step, quantiles=quantiles)
        for label, model in models.items()
    }


def _without_overlap(frame: pd.DataFrame) -> pd.DataFrame:
    """Keep the forecasts from origins whose spans do not overlap, in the order of time."""
    spans = frame.groupby("origin", sort=True)["time"].max()
    kept, reached = [], None
    for origin, last in spans.items():
        if reached is None or origin >= reached:
            kept.append(origin)
            reached = last
    return frame[frame["origin"].isin(kept)].sort_values("time")


def _within(frame: pd.DataFrame, start: Any, end: Any) -> pd.DataFrame:
    times = pd.Index(frame["time"])
    if start is not None:
        frame = frame[frame["time"] >= read_instant(start, times, "start", "the back-test")]
    if end is not None:
        frame = frame[frame["time"] <= read_instant(end, times, "end", "the back-test")]
    if frame.empty:
        raise ValueError(f"no forecast lies between start={start!r} and end={end!r}.")
    return frame
