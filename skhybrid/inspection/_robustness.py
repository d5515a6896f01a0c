"""Display of the comparison of cases, as in paper Fig. robustness."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ..model_selection import RobustnessComparison
from ._style import COLORS, MEASURED, grid_or_new, shared_legend, tidy

_GREY = "#8a8a8a"


class RobustnessDisplay:
    """Errors of each case over its sizes (left), and the predicted difference between the best case and each (right).

    Cases are in the order of their medians; those that cannot be told from the best are blue.  A negative
    difference means that the best case is better.

    Parameters
    ----------
    errors : Series
        Errors [K] by case.
    difference : DataFrame
        Quantiles ``q_0.05``, ``q_0.25``, ``q_0.5``, ``q_0.75`` and ``q_0.95`` of the error of the best case minus that
        of each case [K], by case.
    probability : Series
        P(best case < case), by case.
    indistinguishable : list of str
        Cases that cannot be told from the best.

    Attributes
    ----------
    axes_ : ndarray of matplotlib Axes of shape (2,)
        Axes that :meth:`plot` drew on.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    def __init__(
        self, errors: pd.Series, difference: pd.DataFrame, probability: pd.Series, indistinguishable: list[str]
    ) -> None:
        self.errors = errors
        self.difference = difference
        self.probability = probability
        self.indistinguishable = indistinguishable

    @classmethod
    def from_estimator(cls, estimator: RobustnessComparison, *, ax: Any = None, **kwargs: Any) -> RobustnessDisplay:
        """Draw a fitted comparison.

        Parameters
        ----------
        estimator : RobustnessComparison
            Fitted comparison.
        ax : array of two matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        RobustnessDisplay
        """
        return cls.from_predictions(
            estimator.errors_,
            estimator.difference_,
            estimator.probability_,
            estimator.indistinguishable_,
            ax=ax,
            **kwargs,
        )

    @classmethod
    def from_predictions(
        cls,
        errors: pd.Series,
        difference: pd.DataFrame,
        probability: pd.Series,
        indistinguishable: list[str],
        *,
        ax: Any = None,
        **kwargs: Any,
    ) -> RobustnessDisplay:
        """Draw a comparison that has been made.

        Parameters
        ----------
        errors, difference, probability, indistinguishable
            As in the class.
        ax : array of two matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        RobustnessDisplay
        """
        return cls(errors, difference, probability, indistinguishable).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, n_cases: int | None = None, title: str | None = None) -> RobustnessDisplay:
        """Draw both panels.

        Parameters
        ----------
        ax : array of two matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        n_cases : int, optional
            Number of cases to draw, those with the lowest medians; default is all.
        title : str, optional
            Title of the figure.

        Returns
        -------
        RobustnessDisplay
            The display, with ``axes_`` and ``figure_``.
        """
        cases = list(self.probability.index[:n_cases])
        left, right = axes = grid_or_new(ax, 2, 2, (5.2, 1.2 + 0.22 * len(cases)), share=False)
        rows = np.arange(len(cases))
        colors = [COLORS[0] if case in self.indistinguishable else _GREY for case in cases]
        boxes = left.boxplot(
            [self.errors.loc[[case]].to_numpy() for case in cases],
            positions=rows,
            orientation="horizontal",
            widths=0.62,
            patch_artist=True,
            medianprops={"color": MEASURED, "linewidth": 1.2},
            flierprops={"marker": ".", "markersize": 3},
            manage_ticks=False,
        )
        for box, color in zip(boxes["boxes"], colors, strict=True):
            box.set(facecolor=color, alpha=0.45, edgecolor=color)
        self._draw_differences(right, cases, colors)
        for panel in axes:
            panel.set_ylim(len(cases) - 0.4, -0.8)
        left.set_yticks(rows, cases, fontsize="small")
        right.set_yticks(rows, [""] * len(cases))
        for color, label in ((COLORS[0], "cannot be told from the best"), (_GREY, "worse than the best")):
            left.plot([], [], color=color, alpha=0.6, linewidth=6.0, label=label)
        shared_legend(axes, title)
        tidy(left, ylabel="", xlabel="RMSE over sizes [K]")
        tidy(right, ylabel="", xlabel="best case minus this one [K] (negative: best is better)")
        self.axes_, self.figure_ = axes, left.figure
        return self

    def _draw_differences(self, ax: Any, cases: list[str], colors: list[str]) -> None:
        for row, (case, color) in enumerate(zip(cases, colors, strict=True)):
            low, left, middle, right, high = self.difference.loc[case].to_numpy()
            ax.plot([low, high], [row, row], color=color, linewidth=1.2)
            ax.plot([left, right], [row, row], color=color, linewidth=5.0, alpha=0.6, solid_capstyle="butt")
            ax.plot([middle], [row], color=MEASURED, marker="|", markersize=7)
            shown = "best" if row == 0 else f"{self.probability[case]:.3f}"
            ax.annotate(shown, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize="small")
        ax.annotate(
            "P(best is better)", (1.0, 1.005), xycoords="axes fraction", va="bottom", ha="right", fontsize="small"
        )
        ax.axvline(0.0, color="#CC0000", linewidth=1.1)
