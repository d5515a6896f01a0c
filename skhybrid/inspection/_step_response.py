"""Response of the measured temperature to a step of every input."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import pandas as pd

from ..identification import step_response
from ._style import grid_or_new, shared_legend, tidy
from ._systems import ResponseDisplay, inputs_of, responses_of, style_of, unit_of


class StepResponseDisplay(ResponseDisplay):
    """Temperature after a unit step of every input, from rest.

    Make it with :meth:`from_estimator`, :meth:`from_state_space` or :meth:`from_predictions`.

    Parameters
    ----------
    responses : mapping of label to DataFrame
        As :func:`skhybrid.identification.step_response` gives them.

    Attributes
    ----------
    ax_ : ndarray of matplotlib Axes
        One panel an input, after :meth:`plot`.
    figure_ : matplotlib Figure
        The figure that holds them.
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
        """Draw fitted identifications.

        Parameters
        ----------
        estimator : fitted identification
            Or a mapping of label to fitted identification or :class:`~skhybrid.identification.StateSpace`.
        truth : StateSpace or fitted identification, optional
            Drawn as a broad line beneath, with the label "true"; see
            :func:`skhybrid.identification.make_state_space`.
        duration : timedelta-like, default="12h"
            How long after the step.
        output : int, default=0
            Which measured temperature, for models with several.
        ax : array of matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        StepResponseDisplay
        """
        respond = partial(step_response, duration=duration, output=output)
        return cls(responses_of(estimator, truth, respond)).plot(ax, **kwargs)

    @classmethod
    def from_state_space(
        cls,
        state_space: Any,
        *,
        truth: Any = None,
        duration: Any = "12h",
        output: int = 0,
        ax: Any = None,
        **kwargs: Any,
    ) -> StepResponseDisplay:
        """Draw discrete models.

        Parameters
        ----------
        state_space : StateSpace
            Or a mapping of label to StateSpace.
        truth : StateSpace, optional
            Drawn as a broad line beneath.
        duration : timedelta-like, default="12h"
            How long after the step.
        output : int, default=0
            Which measured temperature, for models with several.
        ax : array of matplotlib Axes, optional
            Where to draw; default is a new figure.
        **kwargs
            As in :meth:`plot`.

        Returns
        -------
        StepResponseDisplay
        """
        return cls.from_estimator(state_space, truth=truth, duration=duration, output=output, ax=ax, **kwargs)

    def plot(
        self, ax: Any = None, *, inputs: Sequence[str] | None = None, title: str | None = None
    ) -> StepResponseDisplay:
        """Draw one panel an input.

        Parameters
        ----------
        ax : array of matplotlib Axes, optional
            Where to draw; default is a new figure.
        inputs : sequence of str, optional
            Which inputs; default is all that any model has.
        title : str, optional
            Above the picture.

        Returns
        -------
        StepResponseDisplay
            With ``ax_`` and ``figure_``.
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
