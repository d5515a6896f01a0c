"""Display of the error by lead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from ..model_selection import score_backtest
from ._forecast import labelled, run_backtests
from ._style import axes_or_new, heading, legend, line_style, tidy


class LeadErrorDisplay:
    """Root mean square error by lead of one or several back-tests.

    Create it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    errors : DataFrame
        Errors [K] by lead, one column per model.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that :meth:`plot` drew on.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    ax_: Any
    figure_: Any

    def __init__(self, errors: pd.DataFrame) -> None:
        self.errors = errors

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
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        LeadErrorDisplay
        """
        return cls.from_predictions(run_backtests(estimator, X, y, horizon, origin_step), ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, frames: Mapping[str, pd.DataFrame] | pd.DataFrame, *, ax: Any = None, **kwargs: Any
    ) -> LeadErrorDisplay:
        """Draw the errors of back-tests that have been made.

        Parameters
        ----------
        frames : DataFrame or mapping of label to DataFrame
            Back-tests with the columns origin, lead, time, y_true and y_pred.
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        LeadErrorDisplay
        """
        errors = {label: score_backtest(frame, by="lead")["rmse"] for label, frame in labelled(frames).items()}
        return cls(pd.DataFrame(errors)).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> LeadErrorDisplay:
        """Draw one line per model.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        title : str, optional
            Title of the figure.

        Returns
        -------
        LeadErrorDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        ax = axes_or_new(ax, (7.0, 3.6))
        hours = pd.TimedeltaIndex(self.errors.index) / pd.Timedelta("1h")
        for number, (label, values) in enumerate(self.errors.items()):
            ax.plot(hours, values, linewidth=1.6, label=label, **line_style(number))
        tidy(ax, ylabel="RMSE of temperature [K]", xlabel="lead [h]")
        ax.set_xlim(0, hours.max())
        ax.set_ylim(bottom=0)
        if hours.max() % 6 == 0:
            ax.set_xticks(range(0, int(hours.max()) + 1, 6 if hours.max() > 12 else 3))
        legend(ax, self.errors.shape[1])
        heading(ax, title)
        self.ax_, self.figure_ = ax, ax.figure
        return self
