"""Displays of a fitted identification: tests of its one-step errors, and the profile likelihood of a parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from .._warnings import percent
from ..identification import Diagnostics, ProfileLikelihood, diagnose, profile_likelihood
from ..identification.diagnostics.residual_tests import Z95
from ._display import Display, refuse_other
from ._style import COLORS, MEASURED, axes_or_new, grid_or_new, legend, tidy, time_axis

_BAND = {"color": "#999999", "alpha": 0.25, "linewidth": 0}
_OUTSIDE = COLORS[1]


@dataclass(eq=False, repr=False)
class ResidualDisplay(Display):
    """Tests of the standardised one-step errors of an identification.

    The panels show the errors over time, their quantiles against the normal distribution, their autocorrelation and
    cumulative periodogram, and their correlation with every input.

    Parameters
    ----------
    diagnostics : Diagnostics
        As returned by :func:`skhybrid.identification.diagnose` or
        :func:`skhybrid.identification.diagnose_residuals`.

    %(attributes)s
    """

    diagnostics: Diagnostics

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: Any, *, max_lag: Any = "1D", ax: Any = None, **kwargs: Any
    ) -> ResidualDisplay:
        """Diagnose a fitted identification and draw it.

        Parameters
        ----------
        estimator : fitted identification
        X : DataFrame or array-like of shape (n_samples, n_features)
            Consecutive rows with the measured temperature in column ``T_za``.
        max_lag : timedelta-like, default="1D"
            Longest lag of the correlations.
        %(drawing)s
        """
        return cls(diagnose(estimator, X, max_lag=max_lag)).plot(ax, **kwargs)

    @classmethod
    def from_predictions(cls, diagnostics: Diagnostics, *, ax: Any = None, **kwargs: Any) -> ResidualDisplay:
        """Draw diagnostics that have been computed.

        Parameters
        ----------
        diagnostics : Diagnostics
        %(drawing)s
        """
        refuse_other(diagnostics, Diagnostics, "diagnostics", "skhybrid.identification.diagnose")
        return cls(diagnostics).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, title: str | None = None) -> ResidualDisplay:
        """Draw four panels, and one per input.

        %(ax)s
        title : str, optional
            Title of a new figure; default is the name of the model.

        Returns
        -------
        Display
            With ``ax_`` and ``figure_``.
        """
        found = self.diagnostics
        inputs = list(found.cross_correlation.columns.unique("input"))
        n_panels = 4 + len(inputs)
        axes = grid_or_new(ax, n_panels, 4 if n_panels in (4, 7, 8) else 3, (3.5, 2.5), share=False)
        _draw_time(axes[0], found.standardised)
        _draw_quantiles(axes[1], found.standardised.dropna().to_numpy())
        _draw_correlation(axes[2], found.autocorrelation["acf"], found.autocorrelation["band"], "autocorrelation")
        _draw_periodogram(axes[3], found.cumulative_periodogram)
        for panel, name in zip(axes[4:], inputs, strict=True):
            part = found.cross_correlation[name]
            _draw_correlation(panel, part["ccf"], part["band"], f"correlation with {name}")
            panel.axvline(0.0, color="#999999", linewidth=0.8)
            panel.set_xlabel("lag of the error after the input [h]")
        if ax is None:
            axes[0].figure.suptitle(title or found.name, x=0.01, ha="left", fontsize="medium", fontweight="bold")
        return self._drawn_on(axes)


def _draw_time(ax: Any, z: pd.Series) -> None:
    place = z.index if isinstance(z.index, pd.DatetimeIndex) else np.arange(len(z))
    ax.axhspan(-Z95, Z95, **_BAND)
    ax.plot(place, z.to_numpy(), color=MEASURED, linewidth=0.6)
    tidy(ax, ylabel="error / its std [-]", title="standardised one-step errors")
    time_axis(ax, z.index)


def _draw_quantiles(ax: Any, z: np.ndarray) -> None:
    expected = stats.norm.ppf((np.arange(1, len(z) + 1) - 0.5) / len(z))
    ends = expected[[0, -1]]
    ax.plot(ends, ends, color=COLORS[0], linewidth=1.0)
    ax.plot(expected, np.sort(z), ".", color=MEASURED, markersize=2.5)
    tidy(ax, ylabel="error / its std [-]", xlabel="standard normal quantile [-]", title="quantiles")


def _draw_correlation(ax: Any, values: pd.Series, band: pd.Series, title: str) -> None:
    """Draw bars, with those outside the 95 % band highlighted."""
    hours = (pd.TimedeltaIndex(values.index) / pd.Timedelta("1h")).to_numpy()
    outside = values.abs().to_numpy() > band.to_numpy()
    ax.fill_between(hours, -band, band, **_BAND)
    for chosen, color in ((~outside, MEASURED), (outside, _OUTSIDE)):
        ax.vlines(hours[chosen], 0.0, values.to_numpy()[chosen], color=color, linewidth=1.2)
    ax.axhline(0.0, color="#999999", linewidth=0.8)
    ax.margins(x=0.01)
    tidy(ax, ylabel="correlation [-]", xlabel="lag [h]", title=title)
    if hours.max() % 6 == 0 and hours.max() <= 48:
        ax.set_xticks(np.arange(np.ceil(hours.min() / 6), hours.max() / 6 + 0.01) * 6)


def _draw_periodogram(ax: Any, table: pd.DataFrame) -> None:
    frequency = table.index.to_numpy()
    low, high = table["expected"] - table["band"], table["expected"] + table["band"]
    ax.fill_between(frequency, low, high, **_BAND)
    ax.plot(frequency, table["expected"], color="#999999", linewidth=0.8)
    inside = ((table["cumulative"] - table["expected"]).abs() <= table["band"]).all()
    ax.plot(frequency, table["cumulative"], color=MEASURED if inside else _OUTSIDE, linewidth=1.4)
    ax.set_xlim(0.0, frequency[-1])
    ax.set_ylim(0.0, 1.0)
    tidy(ax, ylabel="share of the variance [-]", xlabel="frequency [1/h]", title="cumulative periodogram")


@dataclass(eq=False, repr=False)
class ProfileDisplay(Display):
    """Deviance of the fit with one parameter held at values around its best.

    Parameters
    ----------
    profile : ProfileLikelihood; as returned by :func:`skhybrid.identification.profile_likelihood`

    %(attributes)s
    """

    profile: ProfileLikelihood

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: Any, y: Any, parameter: str, *, level: float = 0.9, ax: Any = None, **kwargs: Any
    ) -> ProfileDisplay:
        """Compute the profile and draw it.

        Parameters
        ----------
        estimator : GrayBoxRC, InputDisturbanceID, OutputDisturbanceID or PeriodicDisturbanceID
            Fitted on ``X`` and ``y``; if it is not fitted, a clone of it is.
        X : DataFrame of shape (n_samples, n_features)
        y : array-like of shape (n_samples,)
            Measured temperature [degC].
        parameter : str
            Name of a parameter, such as ``"C_w"``.
        level : float, default=0.9
        %(drawing)s
        """
        found = profile_likelihood(estimator, X, y, parameter, level=level, values=6)  # for a smooth curve
        return cls.from_predictions(found, ax=ax, **kwargs)

    @classmethod
    def from_predictions(cls, profile: ProfileLikelihood, *, ax: Any = None, **kwargs: Any) -> ProfileDisplay:
        """Draw a profile that has been computed.

        Parameters
        ----------
        profile : ProfileLikelihood; as returned by :func:`skhybrid.identification.profile_likelihood`
        %(drawing)s
        """
        refuse_other(profile, ProfileLikelihood, "profile", "skhybrid.identification.profile_likelihood")
        return cls(profile).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, truth: float | None = None, title: str | None = None) -> ProfileDisplay:
        """Draw the deviance, its threshold and the interval.

        %(ax)s
        truth : float, optional
            True value, if it is known, drawn as a dotted line.
        %(title)s
        """
        ax, found = axes_or_new(ax, (6.0, 3.6)), self.profile
        curve = found.curve["deviance"].sort_index()
        shown = curve[curve <= 3.0 * found.threshold]
        ax.plot(shown.index, shown, color=COLORS[0], marker="o", markersize=3.5, linewidth=1.6, label="deviance")
        level = percent(found.level, ".3g")
        ax.axhline(found.threshold, color=MEASURED, linewidth=1.0, linestyle="--", label=f"{level} threshold")
        interval = np.array([found.lower, found.upper])
        span = np.where(np.isfinite(interval), interval, ax.get_xlim())
        inside = f"{level} interval: {found.lower:.3g} to {found.upper:.3g}"
        ax.axvspan(*span, color=COLORS[0], alpha=0.12, linewidth=0, label=inside)
        ax.axvline(found.best, color=COLORS[0], linewidth=0.8)
        if truth is not None:
            ax.axvline(truth, color=COLORS[1], linewidth=1.4, linestyle=":", label=f"true value {truth:.3g}")
        tidy(ax, ylabel="deviance [-]", xlabel=f"{found.parameter} [{found.unit}]")
        ax.set_ylim(bottom=0.0)
        legend(ax, title)
        return self._drawn_on(ax)
