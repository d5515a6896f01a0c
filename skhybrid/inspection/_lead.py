"""How the error grows with the lead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from ..model_selection import score_backtest
from ._forecast import _backtests, _labelled
from ._style import axes_or_new, legend, line_style, tidy


class LeadErrorDisplay:
    """Root mean square error by lead, for one or several back-tests.

    Make it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    errors : DataFrame
        One column a model, the lead as index; values in [K].

    Attributes
    ----------
    ax_ : matplotlib Axes
        What was drawn on, after :meth:`plot`.
    figure_ : matplotlib Figure
        The figure that holds it.
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
        """Back-test a fitted estimator and draw its error by lead.

        Parameters
        ----------
        estimator : fitted estimator
            Or a mapping of label to fitted estimator.
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows.
        y : Series or array-like of shape (n_samples,)
            Measured zone temperature [degC].
        horizon, origin_step : timedelta-like
            As in :func:`skhybrid.model_selection.backtest`.
        ax : matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        LeadErrorDisplay
        """
        return cls.from_predictions(_backtests(estimator, X, y, horizon, origin_step), ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls, frames: Mapping[str, pd.DataFrame] | pd.DataFrame, *, ax: Any = None, **kwargs: Any
    ) -> LeadErrorDisplay:
        """Draw the errors of back-tests that were made already.

        Parameters
        ----------
        frames : DataFrame or mapping of label to DataFrame
            Back-tests with the columns origin, lead, time, y_true and y_pred.
        ax : matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        LeadErrorDisplay
        """
        errors = {label: score_backtest(frame, by="lead")["rmse"] for label, frame in _labelled(frames).items()}
        return cls(pd.DataFrame(errors)).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> LeadErrorDisplay:
        """Draw one line a model.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; default is a new figure.
        title : str, optional
            Above the picture.

        Returns
        -------
        LeadErrorDisplay
            With ``ax_`` and ``figure_``.
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
        if title:
            ax.set_title(title, loc="left", fontsize="medium", fontweight="bold", pad=30)
        self.ax_, self.figure_ = ax, ax.figure
        return self
