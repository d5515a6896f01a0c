"""Display of the frequency response to every input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from ..identification import frequency_response
from ._response_display import ResponseDisplay, inputs_of, responses_of, style_of, unit_of
from ._style import grid_or_new, shared_legend, tidy

#: labelled periods of the axis [s].
_TICKS = {600.0: "10 min", 3600.0: "1 h", 21600.0: "6 h", 86400.0: "1 d", 604800.0: "1 wk", 2592000.0: "30 d"}


class BodeDisplay(ResponseDisplay):
    """Magnitude and phase of the response of a temperature to every input, by the period of the input.

    Create it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    responses : mapping of label to DataFrame of complex
        Frequency responses, as returned by :func:`skhybrid.identification.frequency_response`.

    Attributes
    ----------
    ax_ : ndarray of matplotlib Axes
        Axes that :meth:`plot` drew on: one per input, or two (magnitude, phase) with ``phase=True``.
    figure_ : matplotlib Figure
        Figure of the axes.
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
        """Compute the responses of models and draw them.

        Parameters
        ----------
        estimator : fitted identification, StateSpace or mapping
            A model, or a mapping of label to model.
        truth : StateSpace or fitted identification, optional
            True model, drawn as a broad line below the others with the label "true"; see
            :func:`skhybrid.identification.make_state_space`.
        periods : sequence of timedelta-like, optional
            Periods of the input; by default from 10 minutes (or two steps of the model) to 30 days.
        output : int, default=0
            Index of the measured temperature, for models with several.
        ax : array of matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        BodeDisplay
        """
        respond = partial(frequency_response, periods=periods, output=output)
        return cls(responses_of(estimator, truth, respond)).plot(ax, **kwargs)

    def plot(
        self,
        ax: Any = None,
        *,
        inputs: Sequence[str] | None = None,
        phase: bool = False,
        decibel: bool = False,
        title: str | None = None,
    ) -> BodeDisplay:
        """Draw one panel per input.

        Parameters
        ----------
        ax : array of matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        inputs : sequence of str, optional
            Inputs to draw; default is those of any model.
        phase : bool, default=False
            Whether to draw the phase [degrees] next to the magnitude.
        decibel : bool, default=False
            Whether to draw magnitudes in decibels instead of on a logarithmic axis.
        title : str, optional
            Title of the figure.

        Returns
        -------
        BodeDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        names = inputs_of(self.responses, inputs)
        n_each = 2 if phase else 1
        n_cols = 2 if phase or len(names) == 4 else 3
        axes = grid_or_new(ax, n_each * len(names), n_cols, (4.2, 2.4))
        for number, name in enumerate(names):
            self._draw_magnitude(axes[n_each * number], name, decibel)
            if phase:
                self._draw_phase(axes[n_each * number + 1], name)
        for panel in axes:
            _period_axis(panel, self.responses)
        for panel in axes[-n_cols:]:
            panel.set_xlabel("period of the input")
        shared_legend(axes, title)
        self.ax_, self.figure_ = axes, axes[0].figure
        return self

    def _draw_magnitude(self, ax: Any, name: str, decibel: bool) -> None:
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

    def _draw_phase(self, ax: Any, name: str) -> None:
        for label, frame in self.responses.items():
            if name in frame:
                # unwrap from the longest period, where the phase is near zero, to the shortest
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
