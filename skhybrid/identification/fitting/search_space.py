"""Bounds and known values of the parameters of an identification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...thermal import Parameter


def bounded_parameters(
    parameters: Sequence[Parameter],
    others: Sequence[Parameter],
    own: Sequence[Parameter],
    known: Mapping[str, Any],
    bounds: Mapping[str, Any],
) -> tuple[Parameter, ...]:
    """The network's parameters with the bounds that the user gave; settings that name no parameter are refused.

    ``others`` are parameters that the network has under other inputs, and ``own`` those of the disturbance model, which
    settings may name too.
    """
    names = [p.name for p in (*parameters, *own)]
    for setting, given in (("known", known), ("bounds", bounds)):
        for name in given:
            if name not in names and name not in {p.name for p in others}:
                raise ValueError(f"{setting}= names {name!r}, but the parameters are {', '.join(names)}.")
    out = tuple(p.bounded(bounds.get(p.name)) for p in parameters)
    for p in out:
        if known.get(p.name) is not None:
            _check_known(p, known[p.name])
    return out


def _check_known(p: Parameter, value: Any) -> None:
    if not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise ValueError(f"known= gives {p.name} the value {value!r}; it must be a number [{p.unit}].")
    if p.transform == "log" and value * p.sign <= 0:
        raise ValueError(f"known= gives {p.name} the value {value}; it must be {'<' if p.sign < 0 else '>'} 0.")
    if p.unit == "-" and value > 1:
        raise ValueError(f"known= gives {p.name} the value {value}; it is a share, at most 1.")
