"""Display of the profile likelihood of one parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._warnings import percent
from ..identification import ProfileLikelihood, profile_likelihood
from ._display import Display, refuse_other
from ._style import COLORS, MEASURED, axes_or_new, legend, tidy


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
