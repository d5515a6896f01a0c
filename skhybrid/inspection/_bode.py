"""Frequency response of the measured temperature to every input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from ..identification import frequency_response
from ._style import grid_or_new, shared_legend, tidy
from ._systems import ResponseDisplay, inputs_of, responses_of, style_of, unit_of

#: periods that the axis names
_TICKS = {600.0: "10 min", 3600.0: "1 h", 21600.0: "6 h", 86400.0: "1 d", 604800.0: "1 wk", 2592000.0: "30 d"}


class BodeDisplay(ResponseDisplay):
    """Magnitude (and phase) of the temperature's response to every input, by the period of the input.

    Make it with :meth:`from_estimator`, :meth:`from_state_space` or :meth:`from_predictions`.

    Parameters
    ----------
    responses : mapping of label to DataFrame of complex
        As :func:`skhybrid.identification.frequency_response` gives them.

    Attributes
    ----------
    ax_ : ndarray of matplotlib Axes
        One panel an input, or two (magnitude, phase) with ``phase=True``, after :meth:`plot`.
    figure_ : matplotlib Figure
        The figure that holds them.
    """

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        *,
        truth: Any = None,
        periods: Any = None,
        output: int = 0,
        ax: Any = None,
        **kwargs: Any,
    ) -> BodeDisplay:
        """Draw fitted identifications.

        Parameters
        ----------
        estimator : fitted identification
            Or a mapping of label to fitted identification or :class:`~skhybrid.identification.StateSpace`.
        truth : StateSpace or fitted identification, optional
            Drawn as a broad line beneath, with the label "true"; see
            :func:`skhybrid.identification.make_state_space`.
        periods : sequence of timedelta-like, optional
            By default from 10 minutes (or two steps of the model) to 30 days.
        output : int, default=0
            Which measured temperature, for models with several.
        ax : array of matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        BodeDisplay
        """
        respond = partial(frequency_response, periods=periods, output=output)
        return cls(responses_of(estimator, truth, respond)).plot(ax, **kwargs)

    @classmethod
    def from_state_space(
        cls,
        state_space: Any,
        *,
        truth: Any = None,
        periods: Any = None,
        output: int = 0,
        ax: Any = None,
        **kwargs: Any,
    ) -> BodeDisplay:
        """Draw discrete models.

        Parameters
        ----------
        state_space : StateSpace
            Or a mapping of label to StateSpace.
        truth : StateSpace, optional
            Drawn as a broad line beneath.
        periods : sequence of timedelta-like, optional
            By default from 10 minutes (or two steps of the model) to 30 days.
        output : int, default=0
            Which measured temperature, for models with several.
        ax : array of matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        BodeDisplay
        """
        return cls.from_estimator(state_space, truth=truth, periods=periods, output=output, ax=ax, **kwargs)

    def plot(
        self,
        ax: Any = None,
        *,
        inputs: Sequence[str] | None = None,
        phase: bool = False,
        decibel: bool = False,
        title: str | None = None,
    ) -> BodeDisplay:
        """Draw one panel an input.

        Parameters
        ----------
        ax : array of matplotlib Axes, optional
            Where to draw; default is a new figure.
        inputs : sequence of str, optional
            Which inputs; default is all that any model has.
        phase : bool, default=False
            Whether the phase [degrees] stands beside every magnitude.
        decibel : bool, default=False
            Magnitudes as ``20 log10`` instead of on a logarithmic axis.
        title : str, optional
            Above the picture.

        Returns
        -------
        BodeDisplay
            With ``ax_`` and ``figure_``.
        """
        names = inputs_of(self.responses, inputs)
        n_each = 2 if phase else 1
        axes = grid_or_new(ax, n_each * len(names), 2 if phase or len(names) == 4 else 3, (4.2, 2.4))
        for number, name in enumerate(names):
            self._magnitude(axes[n_each * number], name, decibel)
            if phase:
                self._phase(axes[n_each * number + 1], name)
        for panel in axes:
            _period_axis(panel, self.responses)
        n_cols = 2 if phase or len(names) == 4 else 3
        for panel in axes[-n_cols:]:
            panel.set_xlabel("period of the input")
        shared_legend(axes, title)
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _magnitude(self, ax: Any, name: str, decibel: bool) -> None:
        for label, frame in self.responses.items():
            if name in frame:
                size = np.abs(frame[name].to_numpy())
                ax.plot(
                    _seconds(frame),
                    20 * np.log10(size) if decibel else size,
                    label=label,
                    **style_of(label, self.responses),
                )
        if not decibel:
            ax.set_yscale("log")
        tidy(ax, ylabel=f"dB re 1 {unit_of(name)}" if decibel else f"magnitude [{unit_of(name)}]", title=name)

    def _phase(self, ax: Any, name: str) -> None:
        for label, frame in self.responses.items():
            if name in frame:
                # from the longest period, where the phase is known, to the shortest
                angle = np.unwrap(np.angle(frame[name].to_numpy())[::-1])[::-1]
                ax.plot(_seconds(frame), np.degrees(angle), label=label, **style_of(label, self.responses))
        tidy(ax, ylabel="phase [degrees]", title=name)


def _seconds(frame: pd.DataFrame) -> np.ndarray:
    return (pd.TimedeltaIndex(frame.index) / pd.Timedelta("1s")).to_numpy()


def _period_axis(ax: Any, responses: Mapping[str, pd.DataFrame]) -> None:
    from matplotlib.ticker import NullLocator

    ax.set_xscale("log")
    ends = [(_seconds(frame).min(), _seconds(frame).max()) for frame in responses.values()]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    ax.set_xlim(low, high)
    shown = {place: text for place, text in _TICKS.items() if low <= place <= high}
    if len(shown) > 1:
        ax.set_xticks(list(shown), list(shown.values()))
        ax.xaxis.set_minor_locator(NullLocator())
