"""Displays of dynamic responses to every input: frequency response and step response."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Self

import numpy as np
import pandas as pd

from .._table import is_stage
from .._warnings import warnings_dropped
from ..exceptions import PlanWarning
from ..identification import frequency_response, step_response
from ._display import Display, frames_by_label
from ._hybrid_response import Responses, frequency_responses, is_hybrid, periods_to_a_day, step_responses
from ._style import MEASURED, grid_or_new, line_style, shared_legend, tidy

_TRUTH = "true"  # label of the true system
#: labelled periods of the axis [s].
_TICKS = {600.0: "10 min", 3600.0: "1 h", 21600.0: "6 h", 86400.0: "1 d", 604800.0: "1 wk", 2592000.0: "30 d"}


class _ResponseDisplay(Display):
    """Base of the displays of responses to every input: a DataFrame per model, with one column per input."""

    _made_by: str
    _kind: str  # of its numbers, as in NumPy

    def __init__(
        self, responses: Mapping[str, pd.DataFrame], by_origin: Mapping[str, Sequence[pd.DataFrame]] | None = None
    ) -> None:
        self.responses, self.by_origin = dict(responses), {k: list(v) for k, v in (by_origin or {}).items()}

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
        %(drawing)s
        """
        found = frames_by_label(responses, "model", "responses", cls._made_by)
        for label, frame in found.items():
            if (
                frame.empty
                or not isinstance(frame.index, pd.TimedeltaIndex)
                or {d.kind for d in frame.dtypes} != {cls._kind}
            ):
                raise ValueError(f"the frame {label!r} is not such a response; give the DataFrame of {cls._made_by}.")
        display: Any = cls(found)
        return display.plot(ax, **kwargs)

    @classmethod
    def _of_models(
        cls, models: Any, truth: Any, respond: Callable[[Any], pd.DataFrame], by_origin: Callable[[Any], Responses]
    ) -> Self:
        """The response of every model by its label, the truth first; of a hybrid that of each member, by origin."""
        given = models if isinstance(models, Mapping) else {type(models).__name__: models}
        if not given:
            raise ValueError(
                "there is no model to draw; pass a fitted identification or hybrid, a StateSpace or a mapping of these."
            )
        found = {} if truth is None else {_TRUTH: respond(truth)}
        several: Responses = {}
        for label, model in given.items():
            if not is_hybrid(model):
                found[str(label)] = respond(model)
                continue
            with warnings_dropped(PlanWarning):  # X holds what the plant did; nothing is planned
                responses = by_origin(model)
            for member, frames in responses.items():
                name = f"{label}, {member}" if isinstance(models, Mapping) else member
                several[name] = frames
                found[name] = sum(frames[1:], frames[0]) / len(frames)
        return cls(found, several)

    def _draw(self, ax: Any, name: str, unit: str, drawn: Callable[[np.ndarray], np.ndarray]) -> None:
        """The responses to an input by time in a unit, in bands from the least to the most of all origins."""
        for label, frame in self.responses.items():
            if name not in frame:
                continue
            across, style = _times(frame, unit), _style_of(label, self.responses)
            ax.plot(across, drawn(frame[name].to_numpy()), label=label, **style)
            frames = self.by_origin.get(label, [])
            if len(frames) > 1:
                values = np.array([drawn(one[name].to_numpy()) for one in frames])
                band: dict[str, Any] = {"alpha": 0.2, "linewidth": 0, "label": f"{label}, {len(frames)} origins"}
                ax.fill_between(across, values.min(axis=0), values.max(axis=0), color=style["color"], zorder=1, **band)


class BodeDisplay(_ResponseDisplay):
    """Magnitude and phase of the response of a temperature to every input, by the period of the input.

    Parameters
    ----------
    responses : mapping of label to DataFrame of complex
        Frequency responses, as returned by :func:`skhybrid.identification.frequency_response`.
    %(by_origin)s

    %(attributes)s
    """

    _made_by, _kind = "skhybrid.identification.frequency_response", "c"

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        *,
        X: Any = None,
        truth: Any = None,
        periods: Any = None,
        origin_step: Any = "6h",
        output: int = 0,
        ax: Any = None,
        **kwargs: Any,
    ) -> BodeDisplay:
        """Compute the responses of models and draw them.

        %(models)s
        periods : sequence of timedelta-like, optional
            Periods of the input; by default from 10 minutes (or two steps of the model) to 30 days, of a hybrid to one
            day.
        %(responses)s
        %(drawing)s

        Notes
        -----
        %(hybrids)s
        A blend weighs its members by lead, so that it has no frequency response in the strict sense: what is drawn is
        how the temperature two of the longest periods ahead answers a sinusoid, which began long before.
        """
        models = estimator.values() if isinstance(estimator, Mapping) else [estimator]
        hybrids = [model for model in models if is_hybrid(model)]
        if hybrids and periods is None:
            periods = periods_to_a_day(max(model.sampling_time_ for model in hybrids))
        respond = partial(frequency_response, periods=periods, output=output)
        by_origin = partial(frequency_responses, X=X, origin_step=origin_step, periods=periods)
        return cls._of_models(estimator, truth, respond, by_origin).plot(ax, **kwargs)

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

        %(ax)s
        %(inputs)s
        phase : bool, default=False
            Whether to draw the phase [degrees] next to the magnitude.
        decibel : bool, default=False
            Whether to draw magnitudes in decibels instead of on a logarithmic axis.
        %(title)s
        """
        names = _inputs_of(self.responses, inputs)
        n_each = 2 if phase else 1
        n_cols = 2 if phase or len(names) == 4 else 3
        axes = grid_or_new(ax, n_each * len(names), n_cols, (4.2, 2.4) if len(names) > 1 else (6.4, 3.6))
        for number, name in enumerate(names):
            panel, unit = axes[n_each * number], _unit_of(name)
            self._draw(panel, name, "1s", _decibel if decibel else np.abs)
            if not decibel:
                panel.set_yscale("log")
            tidy(panel, ylabel=f"dB re 1 {unit}" if decibel else f"magnitude [{unit}]", title=name)
            if phase:
                self._draw(axes[n_each * number + 1], name, "1s", _degrees)
                tidy(axes[n_each * number + 1], ylabel="phase [degrees]", title=name)
        for panel in axes:
            _period_axis(panel, self.responses)
        for panel in axes[-n_cols:]:
            panel.set_xlabel("period of the input")
        shared_legend(axes, title)
        return self._drawn_on(axes)


class StepResponseDisplay(_ResponseDisplay):
    """Temperature after a unit step of every input, from rest.

    Parameters
    ----------
    responses : mapping of label to DataFrame
        Step responses, as returned by :func:`skhybrid.identification.step_response`.
    %(by_origin)s

    %(attributes)s
    """

    _made_by, _kind = "skhybrid.identification.step_response", "f"

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        *,
        X: Any = None,
        truth: Any = None,
        duration: Any = "12h",
        origin_step: Any = "6h",
        output: int = 0,
        ax: Any = None,
        **kwargs: Any,
    ) -> StepResponseDisplay:
        """Compute the responses of models and draw them.

        %(models)s
        duration : timedelta-like, default="12h"
            Time after the step.
        %(responses)s
        %(drawing)s

        Notes
        -----
        %(hybrids)s
        """
        respond = partial(step_response, duration=duration, output=output)
        by_origin = partial(step_responses, X=X, origin_step=origin_step, duration=duration)
        return cls._of_models(estimator, truth, respond, by_origin).plot(ax, **kwargs)

    def plot(
        self, ax: Any = None, *, inputs: Sequence[str] | None = None, title: str | None = None
    ) -> StepResponseDisplay:
        """Draw one panel per input.

        %(ax)s
        %(inputs)s
        %(title)s
        """
        names = _inputs_of(self.responses, inputs)
        n_cols = 2 if len(names) == 4 else 3
        axes = grid_or_new(ax, len(names), n_cols, (4.2, 2.4) if len(names) > 1 else (6.4, 3.6))
        longest = max(_times(frame, "1h").max() for frame in self.responses.values())
        for panel, name in zip(axes, names, strict=True):
            self._draw(panel, name, "1h", np.asarray)
            tidy(panel, ylabel=f"temperature [{_unit_of(name)}]", title=name)
            panel.axhline(0.0, color="#999999", linewidth=0.6, zorder=0)
            panel.set_xlim(0, longest)
            if longest % 6 == 0:
                panel.set_xticks(range(0, int(longest) + 1, max(3, int(longest) // 4)))
        for panel in axes[-n_cols:]:
            panel.set_xlabel("time since the step [h]")
        shared_legend(axes, title)
        return self._drawn_on(axes)


def _inputs_of(responses: Mapping[str, pd.DataFrame], chosen: Sequence[str] | None) -> list[str]:
    """Return the inputs to draw: those chosen, or those of any model."""
    present = list(dict.fromkeys(name for frame in responses.values() for name in frame.columns))
    if chosen is not None and (isinstance(chosen, str) or not len(chosen)):
        raise ValueError(f"inputs={chosen!r} is not a list of inputs; the models have {', '.join(present)}.")
    for name in chosen or ():
        if name not in present:
            raise ValueError(f"inputs= names {name!r}, but the models have {', '.join(present)}.")
    return list(chosen) if chosen is not None else present


def _unit_of(name: str) -> str:
    """Return the unit of a temperature's response to an input, by the data contract."""
    if name.startswith("T_"):
        return "K/K"
    if name.startswith("q_sol"):
        return "K per kW/m2"
    return "K per stage" if is_stage(name) else "K/kW"


def _style_of(label: str, responses: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """Return the style of a line: broad and dark, below the others, for the truth."""
    if label == _TRUTH:
        return {"color": MEASURED, "linestyle": "-", "linewidth": 3.0, "alpha": 0.45, "zorder": 1.5}
    return {"linewidth": 1.7, **line_style([name for name in responses if name != _TRUTH].index(label))}


def _decibel(response: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.abs(response))


def _degrees(response: np.ndarray) -> np.ndarray:
    """Phase [degrees], unwrapped from the longest period, where it is near zero, to the shortest."""
    return np.degrees(np.unwrap(np.angle(response)[::-1])[::-1])


def _times(frame: pd.DataFrame, unit: str) -> np.ndarray:
    return (pd.TimedeltaIndex(frame.index) / pd.Timedelta(unit)).to_numpy()


def _period_axis(ax: Any, responses: Mapping[str, pd.DataFrame]) -> None:
    from matplotlib.ticker import NullLocator

    ax.set_xscale("log")
    seconds = np.concatenate([_times(frame, "1s") for frame in responses.values()])
    low, high = seconds.min(), seconds.max()
    ax.set_xlim(low, high)
    shown = {place: text for place, text in _TICKS.items() if low <= place <= high}
    if len(shown) > 1:
        ax.set_xticks(list(shown), list(shown.values()))
        ax.xaxis.set_minor_locator(NullLocator())
