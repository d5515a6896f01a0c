"""Display of measured and forecast temperature over days."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from ..model_selection import backtest
from ._style import MEASURED, axes_or_new, bands, heading, legend, line_style, tidy, time_axis


class ForecastDisplay:
    """Measured zone temperature and the forecasts of one or several models.

    Create it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    frames : mapping of label to DataFrame
        Back-tests, as returned by :func:`skhybrid.model_selection.backtest`; if they have quantiles, the bands between
        these are shaded.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that :meth:`plot` drew on.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    ax_: Any
    figure_: Any

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
        """Back-test fitted estimators and draw their forecasts.

        Parameters
        ----------
        estimator : fitted estimator or mapping
            A fitted estimator, or a mapping of label to fitted estimator.
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows.
        y : Series or array-like of shape (n_samples,)
            Measured zone temperature [degC].
        horizon, origin_step : timedelta-like
            As in :func:`skhybrid.model_selection.backtest`.
        quantiles : sequence of float, optional
            As in :func:`skhybrid.model_selection.backtest`.
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        ForecastDisplay
        """
        return cls.from_predictions(run_backtests(estimator, X, y, horizon, origin_step, quantiles), ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, frames: Mapping[str, pd.DataFrame] | pd.DataFrame, *, ax: Any = None, **kwargs: Any
    ) -> ForecastDisplay:
        """Draw back-tests that have been made.

        Parameters
        ----------
        frames : DataFrame or mapping of label to DataFrame
            Back-tests with the columns origin, lead, time, y_true and y_pred, and ``q_...`` for bands.
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        ForecastDisplay
        """
        return cls(labelled(frames)).plot(ax, **kwargs)

    def plot(
        self, ax: Any = None, *, start: Any = None, end: Any = None, unit: str = "degC", title: str | None = None
    ) -> ForecastDisplay:
        """Draw the measured temperature and each model's forecasts, from origins whose spans do not overlap.

        If a back-test has quantiles, the pairs around its median are shaded and labelled with their probability.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        start, end : timestamp, optional
            Limits of the time to draw.
        unit : str
            Unit in the label of the axis.
        title : str, optional
            Title of the figure.

        Returns
        -------
        ForecastDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        ax = axes_or_new(ax, (9.0, 3.6))
        chosen = {label: _within(_without_overlap(frame), start, end) for label, frame in self.frames.items()}
        first = next(iter(chosen.values()))
        ax.plot(first["time"], first["y_true"], color=MEASURED, linewidth=1.6, label="measured")
        n_entries = 1 + len(chosen)
        for number, (label, frame) in enumerate(chosen.items()):
            style = line_style(number)
            ax.plot(frame["time"], frame["y_pred"], linewidth=1.3, label=label, **style)
            n_entries += bands(ax, frame["time"], frame, style["color"], label if len(chosen) > 1 else "")
        for origin in first["origin"].unique():
            ax.axvline(origin, color="#bbbbbb", linewidth=0.6, zorder=0)
        tidy(ax, ylabel=f"zone temperature [{unit}]")
        time_axis(ax, pd.Index(first["time"]))
        legend(ax, n_entries)
        heading(ax, title)
        self.ax_, self.figure_ = ax, ax.figure
        return self


def labelled(frames: Mapping[str, pd.DataFrame] | pd.DataFrame) -> Mapping[str, pd.DataFrame]:
    """Return back-tests by label; a single one is labelled "forecast"."""
    found = {"forecast": frames} if isinstance(frames, pd.DataFrame) else dict(frames)
    if not found or any(frame.empty for frame in found.values()):
        raise ValueError("there is no back-test to draw; pass at least one, with at least one origin.")
    return found


def run_backtests(
    estimator: Any, X: Any, y: Any, horizon: Any, origin_step: Any, quantiles: Sequence[float] | None = None
) -> dict[str, pd.DataFrame]:
    """Back-test one fitted estimator, or each of a mapping."""
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
    zone = getattr(frame["time"].dt, "tz", None) if pd.api.types.is_datetime64_any_dtype(frame["time"]) else None
    for limit, is_end in ((start, False), (end, True)):
        if limit is None:
            continue
        stamp = limit if not isinstance(limit, str) else pd.Timestamp(limit)
        if zone is not None and getattr(stamp, "tzinfo", None) is None:
            stamp = pd.Timestamp(stamp).tz_localize(zone)
        frame = frame[frame["time"] <= stamp] if is_end else frame[frame["time"] >= stamp]
    if frame.empty:
        raise ValueError(f"no forecast lies between start={start!r} and end={end!r}.")
    return frame
