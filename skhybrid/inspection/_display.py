"""Base class of the displays, and the documentation that they share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from inspect import isfunction
from typing import Any, Self

import numpy as np
import pandas as pd

from .._docs import filled
from .._table import float_columns, listed

_BLOCKS = {
    "attributes": """
    Attributes
    ----------
    ax_ : matplotlib Axes or ndarray of Axes
        Axes that :meth:`plot` drew on, one per panel.
    figure_ : matplotlib Figure
    """,
    "ax": """
    Parameters
    ----------
    ax : matplotlib Axes or array of Axes, optional
        Axes to draw on, one per panel; default is a new figure.
    """,
    "drawing": """
    ax : matplotlib Axes or array of Axes, optional
        Axes to draw on, one per panel; default is a new figure.
    **kwargs
        Passed to :meth:`plot`.

    Returns
    -------
    Display
    """,
    "title": """
    title : str, optional

    Returns
    -------
    Display
        With ``ax_`` and ``figure_``.
    """,
    "backtest": """
    Parameters
    ----------
    estimator : fitted estimator or mapping
        A fitted estimator, or a mapping of label to fitted estimator.
    X : DataFrame or array-like of shape (n_samples, n_features)
    y : Series or array-like of shape (n_samples,)
        Measured zone temperature [degC].
    horizon, origin_step : timedelta-like
        As in :func:`skhybrid.model_selection.backtest`.
    """,
    "models": """
    Parameters
    ----------
    estimator : fitted identification or hybrid, StateSpace or mapping
        A model, or a mapping of label to model.
    X : DataFrame, optional
        Rows that follow the training of a hybrid, which takes them in as it goes from origin to origin.
    truth : StateSpace or fitted identification, optional
        True model, drawn as a broad line below the others with the label "true"; see
        :func:`skhybrid.identification.make_state_space`.
    """,
    "by_origin": """
    by_origin : mapping of label to list of DataFrame, optional
        Responses at several origins, drawn as a band from the least to the most of them.
    """,
    "responses": """
    origin_step : timedelta-like, default="6h"
        Time between the origins at which the response of a hybrid is taken.
    output : int, default=0
        Index of the measured temperature, for models with several.
    """,
    "hybrids": """
    A hybrid is drawn by member, its blend and its network, under heating and cooling alone, as the mean over origins
    in a band from the least to the most of them.  The band is how far the response changes with what is learned and
    with the hour; it is not the error of the gain, which all origins may share.  Where a stage's heat bends at part
    load, the response is that at the stages in ``X``.
    """,
    "inputs": """
    inputs : sequence of str, optional
        Inputs to draw; default is those of any model.
    """,
}


def refuse_other(given: Any, kind: type, name: str, of: str) -> None:
    """Refuse what is not of a kind, with what returns or holds it."""
    if not isinstance(given, kind):
        raise ValueError(f"{name} is a {type(given).__name__}; give the {kind.__name__} of {of}.")


def frames_by_label(given: Any, alone: str, name: str, made_by: str) -> dict[str, pd.DataFrame]:
    """Frames by label, that of a single one being ``alone``; refused where they are something else."""
    found = dict(given) if isinstance(given, Mapping) else {alone: given}
    for label, frame in found.items():
        refuse_other(frame, pd.DataFrame, name if frame is given else f"{name}[{label!r}]", made_by)
    return found


def refuse_no_times(frame: pd.DataFrame, needed: Sequence[str]) -> None:
    """Refuse a back-test that lacks a column of times, whose stamps are text, or whose leads are numbers."""
    for name in needed:
        if name not in frame:
            raise ValueError(f"the back-test has no column {name!r}; give one.")
        kind = pd.api.types.infer_dtype(frame[name])
        if kind == "string" and name != "lead":  # as a CSV holds them
            raise ValueError(f"column {name!r} of the back-test holds text; convert it with pd.to_datetime.")
        if kind in ("integer", "floating") and name == "lead":
            raise ValueError(f"column {name!r} of the back-test holds numbers; convert it with pd.to_timedelta.")


def refuse_other_zones(frames: Mapping[str, pd.DataFrame]) -> None:
    """Refuse back-tests of which some have zones that others lack."""
    zones = {label: frozenset(frame["zone"]) if "zone" in frame else frozenset() for label, frame in frames.items()}
    if len(set(zones.values())) > 1:
        raise ValueError(f"the back-tests {listed(frames)} are not of the same zones; draw them apart.")


def refuse_no_numbers(frame: Any, needed: Sequence[str], others: Sequence[str], what: str) -> None:
    """Refuse a frame without rows or numbers in the columns that are needed, or in others as far as it has them."""
    float_columns(frame, needed, what)
    float_columns(frame, [name for name in others if name in frame], what)
    if frame.empty:
        raise ValueError(f"{what} has no rows; give at least one.")


class Display:
    """Base of the displays; fills the shared blocks into their docstrings, where a line ``%(name)s`` asks for one."""

    ax_: Any
    figure_: Any

    def __init_subclass__(cls) -> None:
        cls.__doc__ = filled(cls.__doc__, _BLOCKS)
        for member in vars(cls).values():
            function = getattr(member, "__func__", member)
            if isfunction(function):
                function.__doc__ = filled(function.__doc__, _BLOCKS)

    def _drawn_on(self, axes: Any) -> Self:
        self.ax_, self.figure_ = axes, np.ravel(axes)[0].figure
        return self
