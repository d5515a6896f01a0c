"""Profile likelihood of one parameter, with its interval."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..identification import ProfileLikelihood, profile_likelihood
from ._style import COLORS, MEASURED, axes_or_new, legend, tidy


class ProfileDisplay:
    """How the fit worsens where one parameter is held away from its best value.

    Parameters
    ----------
    profile : ProfileLikelihood

    Attributes
    ----------
    ax_ : matplotlib Axes
    figure_ : matplotlib Figure
    """

    def __init__(self, profile: ProfileLikelihood) -> None:
        self.profile = profile

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: Any, y: Any, parameter: str, *, level: float = 0.9, ax: Any = None, **kwargs: Any
    ) -> ProfileDisplay:
        """Compute the profile and draw it.

        Parameters
        ----------
        estimator : GrayBoxRC, InputDisturbanceID, OutputDisturbanceID or PeriodicDisturbanceID
            Fitted on ``X`` and ``y``; one that is not fitted is cloned and fitted.
        X : DataFrame of shape (n_samples, n_features)
        y : array-like of shape (n_samples,)
            Measured temperature [degC].
        parameter : str
            Such as ``"C_w"``.
        level : float, default=0.9
            Of the interval.
        ax : matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        ProfileDisplay
        """
        found = profile_likelihood(estimator, X, y, parameter, level=level)
        if found.lower * found.upper > 0 and np.isfinite([found.lower, found.upper]).all():
            between = np.geomspace(found.lower, found.upper, 8)[1:-1]  # inner points, for a smooth curve
            found = profile_likelihood(estimator, X, y, parameter, level=level, values=list(between))
        return cls.from_predictions(found, ax=ax, **kwargs)

    @classmethod
    def from_predictions(cls, profile: ProfileLikelihood, *, ax: Any = None, **kwargs: Any) -> ProfileDisplay:
        """Draw a profile that has been computed.

        Parameters
        ----------
        profile : ProfileLikelihood
        ax : matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        ProfileDisplay
        """
        return cls(profile).plot(ax, **kwargs)

    def plot(self, ax: Any = None, *, truth: float | None = None, title: str | None = None) -> ProfileDisplay:
        """Draw the deviance, its threshold and the interval.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; default is a new figure.
        truth : float, optional
            True value, where it is known, as a dotted line.
        title : str, optional
            Above the picture.

        Returns
        -------
        ProfileDisplay
            With ``ax_`` and ``figure_``.
        """
        ax, found = axes_or_new(ax, (6.0, 3.6)), self.profile
        curve = found.curve["deviance"].sort_index()
        shown = curve[curve <= 3.0 * found.threshold]
        ax.plot(shown.index, shown, color=COLORS[0], marker="o", markersize=3.5, linewidth=1.6, label="deviance")
        ax.axhline(found.threshold, color=MEASURED, linewidth=1.0, linestyle="--", label=f"{found.level:.0%} threshold")
        span = [
            x if np.isfinite(x) else edge for x, edge in zip((found.lower, found.upper), ax.get_xlim(), strict=True)
        ]
        inside = f"{found.level:.0%} interval: {found.lower:.3g} to {found.upper:.3g}"
        ax.axvspan(*span, color=COLORS[0], alpha=0.12, linewidth=0, label=inside)
        ax.axvline(found.best, color=COLORS[0], linewidth=0.8)
        if truth is not None:
            ax.axvline(truth, color=COLORS[1], linewidth=1.4, linestyle=":", label=f"true value {truth:.3g}")
        tidy(ax, ylabel="deviance [-]", xlabel=f"{found.parameter} [{found.unit}]")
        ax.set_ylim(bottom=0.0)
        legend(ax, 2)
        if title:
            ax.set_title(title, loc="left", fontsize="medium", fontweight="bold", pad=46)
        self.ax_, self.figure_ = ax, ax.figure
        return self
