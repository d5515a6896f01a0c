"""Priors of the user, as normal distributions on the searched scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import norm

from ..._arguments import is_number
from ...thermal import Parameter

_Z = float(norm.ppf(0.95))  # 90 % of a normal distribution lie within this many standard deviations
_ACCEPTED = "(median, factor), scipy.stats.lognorm(...) or, for a parameter of either sign, scipy.stats.norm(...)"


def normal_priors(
    priors: Mapping[str, Any] | None,
    parameters: Sequence[Parameter],
    known: Mapping[str, Any],
    units: Mapping[str, float] | None = None,
) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation, on the searched scale, of every prior that the user gave.

    Parameters that are searched in other ``units`` than the user's have their bounds in these, by name.
    """
    by_name = {p.name: p for p in parameters}
    out = {}
    for name, prior in (priors or {}).items():
        if name not in by_name:
            raise ValueError(f"priors= names {name!r}, but the parameters are {', '.join(by_name)}.")
        if name in known:
            raise ValueError(f"priors= and known= both name {name!r}; give one of them.")
        p, unit = by_name[name], (units or {}).get(name, 1.0)
        mean, sd = _normal(p, prior)
        out[name] = mean - float(np.log(unit)), sd
        low, high = p.free_bounds
        if not low <= out[name][0] <= high:
            raise ValueError(
                f"priors= gives {name} the median {p.from_free(mean):g}, outside its bounds ({p.lower * unit:g}, "
                f"{p.upper * unit:g}); mend the prior, or give bounds= that hold it."
            )
    return out


def _normal(p: Parameter, prior: Any) -> tuple[float, float]:
    kind = getattr(getattr(prior, "dist", None), "name", None)
    if kind == "norm" and p.transform == "identity":
        mean, sd = float(prior.mean()), float(prior.std())
        if not (np.isfinite(mean) and 0.0 < sd < np.inf):
            raise ValueError(
                f"priors= gives {p.name} the mean {mean:g} and the standard deviation {sd:g}; both must be finite and "
                "the second > 0."
            )
        return mean, sd
    if kind == "lognorm" and p.transform == "log" and prior.support()[0] == 0.0:
        median = float(prior.median()) * p.sign
        factor = float(prior.ppf(0.95) / prior.median())
    elif isinstance(prior, tuple | list) and len(prior) == 2 and all(map(is_number, prior)) and p.transform == "log":
        median, factor = (float(x) for x in prior)
    else:
        raise ValueError(f"priors= gives {p.name} {prior!r}, which the search cannot use; give {_ACCEPTED}.")
    if not (np.isfinite([median, factor]).all() and factor > 1.0 and median * p.sign > 0):
        raise ValueError(
            f"priors= gives {p.name} the median {median:g} and the factor {factor:g}; the median must be "
            f"{'<' if p.sign < 0 else '>'} 0 [{p.unit}] and the factor > 1."
        )
    return p.to_free(median), float(np.log(factor)) / _Z
