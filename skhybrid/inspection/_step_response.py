"""Display of the step response to every input."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import pandas as pd

from ..identification import step_response
from ._response_display import ResponseDisplay, inputs_of, responses_of, style_of, unit_of
from ._style import grid_or_new, shared_legend, tidy


class StepResponseDisplay(ResponseDisplay):
    """Temperature after a unit step of every input, from rest.

    Create it with :meth:`from_estimator` or :meth:`from_predictions`.

    Parameters
    ----------
    responses : mapping of label to DataFrame
        Step responses, as returned by :func:`skhybrid.identification.step_response`.

    Attributes
    ----------
    ax_ : ndarray of matplotlib Axes
        Axes that :meth:`plot` drew on, one per input.
    figure_ : matplotlib Figure
        Figure of the axes.
    """

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        *,
        truth: Any = None,
        duration: Any = "12h",
        output: int = 0,
        ax: Any = None,
        **kwargs: Any,
    ) -> StepResponseDisplay:
        """Compute the responses of models and draw them.

        Parameters
        ----------
        estimator : fitted identification, StateSpace or mapping
            A model, or a mapping of label to model.
        truth : StateSpace or fitted identification, optional
            True model, drawn as a broad line below the others with the label "true"; see
            :func:`skhybrid.identification.make_state_space`.
        duration : timedelta-like, default="12h"
            Time after the step.
        output : int, default=0
            Index of the measured temperature, for models with several.
        ax : array of matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        StepResponseDisplay
        """
        respond = partial(step_response, duration=duration, output=output)
        return cls(responses_of(estimator, truth, respond)).plot(ax, **kwargs)

    def plot(
        self, ax: Any = None, *, inputs: Sequence[str] | None = None, title: str | None = None
    ) -> StepResponseDisplay:
        """Draw one panel per input.

        Parameters
        ----------
        ax : array of matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        inputs : sequence of str, optional
            Inputs to draw; default is those of any model.
        title : str, optional
            Title of the figure.

        Returns
        -------
        StepResponseDisplay
            The display, with ``ax_`` and ``figure_``.
        """
        names = inputs_of(self.responses, inputs)
        n_cols = 2 if len(names) == 4 else 3
        axes = grid_or_new(ax, len(names), n_cols, (4.2, 2.4))
        hours = {label: pd.TimedeltaIndex(frame.index) / pd.Timedelta("1h") for label, frame in self.responses.items()}
        longest = max(time.max() for time in hours.values())
        for panel, name in zip(axes, names, strict=True):
            for label, frame in self.responses.items():
                if name in frame:
                    panel.plot(hours[label], frame[name], label=label, **style_of(label, self.responses))
            tidy(panel, ylabel=f"temperature [{unit_of(name)}]", title=name)
            panel.axhline(0.0, color="#999999", linewidth=0.6, zorder=0)
            panel.set_xlim(0, longest)
            if longest % 6 == 0:
                panel.set_xticks(range(0, int(longest) + 1, max(3, int(longest) // 4)))
        for panel in axes[-n_cols:]:
            panel.set_xlabel("time since the step [h]")
        shared_legend(axes, title)
        self.ax_, self.figure_ = axes, axes[0].figure
        return self
