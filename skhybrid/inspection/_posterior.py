"""Display of the effects in a regression on candidates, as in paper Figs. regression and model_size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ..model_selection import PatternExpressiveness
from ._style import COLORS, MEASURED, axes_or_new, heading, legend, tidy

#: height of the highest curve, as a fraction of a row.
_HEIGHT = 0.75


class PosteriorDisplay:
    """Posterior density of the effect of each term on the error, with its interval.

    Negative effects reduce the error.

    Parameters
    ----------
    draws : DataFrame of shape (n_draws, n_terms)
        Draws of the effects, one column per term.
    summary : DataFrame
        ``mean``, ``lower``, ``upper`` and ``probability_reduces`` by term, as in ``PatternExpressiveness.summary_``.
    log : bool, default=False
        Whether the effects are on log(rmse).

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that :meth:`plot` drew on.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    def __init__(self, draws: pd.DataFrame, summary: pd.DataFrame, *, log: bool = False) -> None:
        self.draws = draws
        self.summary = summary
        self.log = log

    @classmethod
    def from_estimator(cls, estimator: PatternExpressiveness, *, ax: Any = None, **kwargs: Any) -> PosteriorDisplay:
        """Draw a fitted regression.

        Parameters
        ----------
        estimator : PatternExpressiveness
            Fitted regression.
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        PosteriorDisplay
        """
        return cls(estimator.draws_, estimator.summary_, log=estimator.log).plot(ax, level=estimator.level, **kwargs)

    @classmethod
    def from_predictions(
        cls, draws: pd.DataFrame, *, level: float = 0.9, log: bool = False, ax: Any = None, **kwargs: Any
    ) -> PosteriorDisplay:
        """Draw effects that have been sampled.

        Parameters
        ----------
        draws : DataFrame of shape (n_draws, n_terms)
            Draws of the effects, one column per term.
        level : float, default=0.9
            Probability of the interval.
        log : bool, default=False
            Whether the effects are on log(rmse).
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        PosteriorDisplay
        """
        tail = 0.5 * (1.0 - level)
        summary = pd.DataFrame(
            {
                "mean": draws.mean(),
                "lower": draws.quantile(tail),
                "upper": draws.quantile(1.0 - tail),
                "probability_reduces": (draws < 0.0).mean(),
            }
        )
        return cls(draws, summary, log=log).plot(ax, level=level, **kwargs)

    def plot(self, ax: Any = None, *, level: float = 0.9, title: str | None = None) -> PosteriorDisplay:
        """Draw the densities, the intervals and the probability that each term reduces the error.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        level : float, default=0.9
            Probability of the interval in ``summary``, for the legend.
        title : str, optional
            Title of the figure.

        Returns
        -------
        PosteriorDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        terms = list(self.summary.index)
        ax = axes_or_new(ax, (6.4, 1.3 + 0.42 * len(terms)))
        for row, term in enumerate(terms):
            self._draw_term(ax, row, term)
        ax.plot([], [], color=MEASURED, linewidth=2.2, marker="o", markersize=4.5, label=f"mean, {level:.0%} interval")
        ax.axvline(0.0, color="#CC0000", linewidth=1.1, label="no effect")
        ax.annotate("P(reduces)", (1.01, 1.0), xycoords="axes fraction", va="bottom", fontsize="small")
        ax.set_yticks(range(len(terms)), [str(term) for term in terms])
        ax.set_ylim(len(terms) - 0.5, -1.0)
        unit = "log RMSE [-]" if self.log else "RMSE [K]"
        tidy(ax, ylabel="", xlabel=f"change of {unit} (negative: smaller error)")
        legend(ax, 2)
        heading(ax, title, pad=24)
        self.ax_, self.figure_ = ax, ax.figure
        return self

    def _draw_term(self, ax: Any, row: int, term: str) -> None:
        found = self.summary.loc[term]
        color = COLORS[0] if found["mean"] < 0.0 else COLORS[1]
        x, density = _density(self.draws[term].to_numpy())
        ax.fill_between(x, row, row - _HEIGHT * density, color=color, alpha=0.35, linewidth=0)
        ax.plot([found["lower"], found["upper"]], [row, row], color=color, linewidth=2.2, solid_capstyle="butt")
        ax.plot([found["mean"]], [row], color=color, marker="o", markersize=4.5)
        shown = f"{found['probability_reduces']:.3f}"
        ax.annotate(shown, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize="small")


def _density(draws: np.ndarray, n_points: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Estimate the density of draws, scaled to a maximum of 1."""
    from scipy.stats import gaussian_kde

    low, high = np.quantile(draws, [0.001, 0.999])
    x = np.linspace(low - 0.15 * (high - low), high + 0.15 * (high - low), n_points)
    density = gaussian_kde(draws)(x)
    return x, density / density.max()
