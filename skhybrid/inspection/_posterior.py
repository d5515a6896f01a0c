"""Displays of posteriors: effects in a regression on candidates, and the comparison of cases, as in the paper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import gaussian_kde

from .._arguments import check_integer, check_level, refuse_without
from .._table import as_numbers, float_columns
from .._warnings import percent
from ..model_selection import PatternExpressiveness, RobustnessComparison
from ._display import Display, refuse_other
from ._style import COLORS, MEASURED, axes_or_new, grid_or_new, legend, shared_legend, tidy

_GREY = "#8a8a8a"
_LEVELS = ("q_0.05", "q_0.25", "q_0.5", "q_0.75", "q_0.95")
_HEIGHT = 0.75  # height of the highest curve, as a fraction of a row


@dataclass(eq=False, repr=False)
class PosteriorDisplay(Display):
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

    %(attributes)s
    """

    draws: pd.DataFrame
    summary: pd.DataFrame
    log: bool = field(default=False, kw_only=True)

    @classmethod
    def from_estimator(cls, estimator: PatternExpressiveness, *, ax: Any = None, **kwargs: Any) -> PosteriorDisplay:
        """Draw a fitted regression.

        Parameters
        ----------
        estimator : PatternExpressiveness
        %(drawing)s
        """
        refuse_without(estimator, "draws_", "a PatternExpressiveness")
        return cls(estimator.draws_, estimator.summary_, log=estimator.log).plot(ax, level=estimator.level, **kwargs)

    @classmethod
    def from_predictions(
        cls, draws: pd.DataFrame, *, level: float = 0.9, log: bool = False, ax: Any = None, **kwargs: Any
    ) -> PosteriorDisplay:
        """Draw effects that have been sampled.

        Parameters
        ----------
        draws : DataFrame of shape (n_draws, n_terms); draws of the effects, one column per term
        level : float, default=0.9
        log : bool, default=False
        %(drawing)s
        """
        check_level(level)
        draws = float_columns(draws, getattr(draws, "columns", ()), "draws")
        if draws.empty:
            raise ValueError("draws has no rows or no columns; give draws of one term or more.")
        if draws.isna().any(axis=None):
            raise ValueError("draws holds NaN; drop these draws, such as with draws.dropna().")
        tail = 0.5 * (1.0 - level)
        ends = {"lower": draws.quantile(tail), "upper": draws.quantile(1.0 - tail)}
        summary = pd.DataFrame({"mean": draws.mean(), **ends, "probability_reduces": (draws < 0.0).mean()})
        return cls(draws, summary, log=log).plot(ax, level=level, **kwargs)

    def plot(self, ax: Any = None, *, level: float = 0.9, title: str | None = None) -> PosteriorDisplay:
        """Draw the densities, the intervals and the probability that each term reduces the error.

        %(ax)s
        level : float, default=0.9
            Probability of the interval in ``summary``, for the legend.
        %(title)s
        """
        terms = list(self.summary.index)
        ax = axes_or_new(ax, (6.4, 1.3 + 0.42 * len(terms)))
        for row, term in enumerate(terms):
            self._draw_term(ax, row, term)
        label = f"mean, {percent(level, '.3g')} interval"
        ax.plot([], [], color=MEASURED, linewidth=2.2, marker="o", markersize=4.5, label=label)
        ax.axvline(0.0, color="#CC0000", linewidth=1.1, label="no effect")
        ax.annotate("P(reduces)", (1.01, 1.0), xycoords="axes fraction", va="bottom", fontsize="small")
        ax.set_yticks(range(len(terms)), [str(term) for term in terms])
        ax.set_ylim(len(terms) - 0.5, -1.0)
        unit = "log RMSE [-]" if self.log else "RMSE [K]"
        tidy(ax, ylabel="", xlabel=f"change of {unit} (negative: smaller error)")
        legend(ax, title)
        return self._drawn_on(ax)

    def _draw_term(self, ax: Any, row: int, term: str) -> None:
        found = self.summary.loc[term]
        color = COLORS[0] if found["mean"] < 0.0 else COLORS[1]
        x, density = _density(self.draws[term].to_numpy())
        ax.fill_between(x, row, row - _HEIGHT * density, color=color, alpha=0.35, linewidth=0)
        ax.plot([found["lower"], found["upper"]], [row, row], color=color, linewidth=2.2, solid_capstyle="butt")
        ax.plot([found["mean"]], [row], color=color, marker="o", markersize=4.5)
        shown = f"{found['probability_reduces']:.3f}"
        ax.annotate(shown, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize="small")


def _density(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimate the density of draws, scaled to a maximum of 1; draws that are all equal have a single line."""
    if np.ptp(draws) == 0.0:
        return np.full(2, draws[0]), np.ones(2)
    low, high = np.quantile(draws, [0.001, 0.999])
    x = np.linspace(low - 0.15 * (high - low), high + 0.15 * (high - low), 200)
    density = gaussian_kde(draws)(x)
    return x, density / density.max()


@dataclass(eq=False, repr=False)
class RobustnessDisplay(Display):
    """Errors of each case over its sizes (left), and the predicted difference between the best case and each (right).

    Cases are in the order of their medians; those that are indistinguishable from the best are blue.  A negative
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
        Cases that are indistinguishable from the best.

    %(attributes)s
    """

    errors: pd.Series
    difference: pd.DataFrame
    probability: pd.Series
    indistinguishable: list[str]

    @classmethod
    def from_estimator(cls, estimator: RobustnessComparison, *, ax: Any = None, **kwargs: Any) -> RobustnessDisplay:
        """Draw a fitted comparison.

        Parameters
        ----------
        estimator : RobustnessComparison
        %(drawing)s
        """
        refuse_without(estimator, "probability_", "a RobustnessComparison")
        found = estimator.errors_, estimator.difference_, estimator.probability_, estimator.indistinguishable_
        return cls(*found).plot(ax, **kwargs)

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
        %(drawing)s
        """
        float_columns(difference, _LEVELS, "difference")
        for name, given in (("errors", errors), ("probability", probability)):
            refuse_other(given, pd.Series, name, "a RobustnessComparison")
            as_numbers(given, name)
        for name, index in (("errors", errors.index), ("difference", difference.index)):
            if len(absent := probability.index.difference(index)):
                raise ValueError(f"{name} has no case {absent[0]!r}, which probability has; give one.")
        return cls(errors, difference, probability, indistinguishable).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, n_cases: int | None = None, title: str | None = None) -> RobustnessDisplay:
        """Draw both panels.

        %(ax)s
        n_cases : int, optional
            Number of cases to draw, those with the lowest medians; default is all.
        %(title)s
        """
        if n_cases is not None:
            check_integer("n_cases", n_cases)
        cases = list(self.probability.index[:n_cases])
        left, right = axes = grid_or_new(ax, 2, 2, (5.2, 1.2 + 0.22 * len(cases)), share=False)
        rows = np.arange(len(cases))
        colors = [COLORS[0] if case in self.indistinguishable else _GREY for case in cases]
        boxes = left.boxplot(
            [self.errors.loc[[case]].dropna().to_numpy() for case in cases],
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
        for color, label in ((COLORS[0], "indistinguishable from the best"), (_GREY, "worse than the best")):
            left.plot([], [], color=color, alpha=0.6, linewidth=6.0, label=label)
        shared_legend(axes, title)
        tidy(left, ylabel="", xlabel="RMSE over sizes [K]")
        tidy(right, ylabel="", xlabel="best case minus this one [K] (negative: best is better)")
        return self._drawn_on(axes)

    def _draw_differences(self, ax: Any, cases: list[str], colors: list[str]) -> None:
        for row, (case, color) in enumerate(zip(cases, colors, strict=True)):
            low, left, middle, right, high = self.difference.loc[case, list(_LEVELS)].to_numpy()
            ax.plot([low, high], [row, row], color=color, linewidth=1.2)
            ax.plot([left, right], [row, row], color=color, linewidth=5.0, alpha=0.6, solid_capstyle="butt")
            ax.plot([middle], [row], color=MEASURED, marker="|", markersize=7)
            shown = "best" if row == 0 else f"{self.probability[case]:.3f}"
            ax.annotate(shown, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize="small")
        ax.annotate(
            "P(best is better)", (1.0, 1.005), xycoords="axes fraction", va="bottom", ha="right", fontsize="small"
        )
        ax.axvline(0.0, color="#CC0000", linewidth=1.1)
