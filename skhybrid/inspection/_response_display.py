"""Base class and helpers of the displays of dynamic responses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import pandas as pd

from ._style import MEASURED, line_style

#: label of the true system.
TRUTH = "true"


class ResponseDisplay:
    """Base of the displays of responses to every input.

    Parameters
    ----------
    responses : mapping of label to DataFrame
        Response of each model, with one column per input.
    """

    ax_: Any
    figure_: Any

    def __init__(self, responses: Mapping[str, pd.DataFrame]) -> None:
        self.responses = dict(responses)

    @classmethod
    def from_predictions(
        cls, responses: Mapping[str, pd.DataFrame] | pd.DataFrame, *, ax: Any = None, **kwargs: Any
    ) -> Self:
        """Draw responses that have been computed.

        Parameters
        ----------
        responses : DataFrame or mapping of label to DataFrame
            As returned by :func:`skhybrid.identification.frequency_response` (complex) or
            :func:`skhybrid.identification.step_response`; the one labelled "true" is drawn below the others.
        ax : array of matplotlib Axes, optional
            Axes to draw on; default is a new figure.
        **kwargs
            Passed to :meth:`plot`.

        Returns
        -------
        Display
        """
        display: Any = cls({"model": responses} if isinstance(responses, pd.DataFrame) else responses)
        return display.plot(ax, **kwargs)


def responses_of(models: Any, truth: Any, respond: Callable[[Any], pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Compute the response of every model by its label, the truth first."""
    given = models if isinstance(models, Mapping) else {type(models).__name__: models}
    if not given:
        raise ValueError("there is no model to draw; pass a fitted identification, a StateSpace or a mapping of these.")
    if truth is not None:
        given = {TRUTH: truth, **given}
    return {str(label): respond(model) for label, model in given.items()}


def inputs_of(responses: Mapping[str, pd.DataFrame], chosen: Sequence[str] | None) -> list[str]:
    """Return the inputs to draw: those chosen, or those of any model."""
    present = list(dict.fromkeys(name for frame in responses.values() for name in frame.columns))
    for name in chosen or ():
        if name not in present:
            raise ValueError(f"inputs= names {name!r}, but the models have {', '.join(present)}.")
    return list(chosen) if chosen is not None else present


def unit_of(name: str) -> str:
    """Return the unit of a temperature's response to an input, by the data contract."""
    if name.startswith("T_"):
        return "K/K"
    if name.startswith("q_sol"):
        return "K per kW/m2"
    return "K per stage" if name.startswith("u_") else "K/kW"


def style_of(label: str, responses: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """Return the style of a line: broad and dark, below the others, for the truth."""
    if label == TRUTH:
        return {"color": MEASURED, "linestyle": "-", "linewidth": 3.0, "alpha": 0.45, "zorder": 1.5}
    return {"linewidth": 1.7, **line_style([name for name in responses if name != TRUTH].index(label))}
