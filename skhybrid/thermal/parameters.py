"""Metadata of physical parameters: unit, bounds, sign and search scale, apart from their values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._arguments import as_mapping, is_number
from .._warnings import warn_user
from ..exceptions import UnitWarning

#: unit and bounds of each kind of parameter: paper 2.2.1 for C, R, f and A_win; wide for a capacity
_KINDS = {
    "C": ("kWh/K", 0.1, 40.0),
    "R": ("K/kW", 0.1, 40.0),
    "f": ("-", 1e-6, 1.0),
    "A": ("m2", 0.1, 25.0),
    "Q": ("kW", 0.05, 100.0),
}
#: from this size on, what a zone has is more likely given in another unit, by unit
_LIKELY = {"kW": (1000.0, "W"), "kWh/K": (1000.0, "kJ/K or J/K")}


@dataclass(frozen=True)
class Parameter:
    """A parameter before any data: its unit, its bounds and the scale on which it is searched.

    Attributes
    ----------
    name : str
        The paper's symbol, such as ``C_w``.
    unit : str
        Such as ``kWh/K``.
    lower, upper : float
        Bounds of the value itself; for a negative parameter both are negative.
    description : str
    transform : {"log", "identity"}
        Scale of the search; ``"log"`` is the logarithm of the magnitude.
    """

    name: str
    unit: str
    lower: float
    upper: float
    description: str = ""
    transform: str = "log"

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise ValueError(
                f"bounds of {self.name} are ({self.lower}, {self.upper}); the lower must be less than the upper."
            )
        if self.transform == "log" and not self.lower * self.upper > 0:
            raise ValueError(
                f"bounds of {self.name} are ({self.lower}, {self.upper}); both must have the same sign and not be zero."
            )

    @property
    def sign(self) -> float:
        """-1 where the parameter is negative, else 1."""
        return -1.0 if self.transform == "log" and self.upper < 0 else 1.0

    @property
    def default(self) -> float:
        """Value in the middle of the bounds on the search scale."""
        return float(self.from_free(0.5 * sum(self.free_bounds)))

    @property
    def free_bounds(self) -> tuple[float, float]:
        """Bounds on the search scale."""
        ends = sorted((float(self.to_free(self.lower)), float(self.to_free(self.upper))))
        return ends[0], ends[1]

    def to_free(self, value: float) -> float:
        """Convert a value to the search scale.

        Parameters
        ----------
        value : float
        """
        return float(np.log(value * self.sign)) if self.transform == "log" else float(value)

    def from_free(self, free: float) -> float:
        """Convert from the search scale to a value.

        Parameters
        ----------
        free : float
        """
        return float(self.sign * np.exp(free)) if self.transform == "log" else float(free)

    def slope(self, value: float) -> float:
        """Derivative of the value with respect to the search scale.

        Parameters
        ----------
        value : float
        """
        return float(value) if self.transform == "log" else 1.0

    def bounded(self, bounds: tuple[float, float] | None) -> Parameter:
        """Copy of the parameter with other bounds.

        Parameters
        ----------
        bounds : tuple of (lower, upper) or None; None keeps the present bounds, negative ones come in either order

        Raises
        ------
        ValueError
            If they are not two numbers in this order, or would turn the sign.
        """
        if bounds is None:
            return self
        lower, upper = as_bounds(self.name, bounds)
        if self.transform == "log" and min(lower * self.sign, upper * self.sign) <= 0.0:
            raise ValueError(
                f"bounds of {self.name} are ({lower:g}, {upper:g}); both must be {'<' if self.sign < 0 else '>'} 0."
            )
        if self.unit == "-" and self.transform == "log" and upper > 1.0:
            raise ValueError(f"bounds of {self.name} are ({lower:g}, {upper:g}); a share is at most 1.")
        return replace(self, lower=lower, upper=upper)


def search_bounds(parameters: Iterable[Parameter]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (p,) of some parameters on the search scale."""
    lower, upper = np.array([p.free_bounds for p in parameters]).reshape(-1, 2).T
    return lower, upper


def as_bounds(name: str, given: Any) -> tuple[float, float]:
    """Bounds of a parameter as two floats; those of a negative one may begin with the smaller magnitude."""
    ends = tuple(given) if isinstance(given, Sequence | np.ndarray) else ()
    if len(ends) != 2 or not all(map(is_number, ends)):
        raise ValueError(f"bounds of {name} are {given!r}; give two finite numbers (lower, upper).")
    lower, upper = sorted(float(end) for end in ends)
    if lower == upper or (lower != ends[0] and upper >= 0.0):
        raise ValueError(f"bounds of {name} are ({ends[0]:g}, {ends[1]:g}); the lower must be less than the upper.")
    return lower, upper


def make_parameter(name: str, kind: str, description: str) -> Parameter:
    """Parameter of a kind ("C", "R", "f", "A" or "Q") with the usual bounds of that kind."""
    unit, lower, upper = _KINDS[kind]
    transform = "log"
    if kind == "Q" and name.startswith("Q_c"):
        lower, upper = -upper, -lower
    elif kind == "Q" and not name.startswith("Q_h"):  # a stage that may heat or cool
        lower, transform = -upper, "identity"
    return Parameter(name, unit, lower, upper, description, transform)


def known_values(known: Any) -> dict[str, Any]:
    """``known=`` of an estimator as a dict; anything but a mapping, and a parameter without a value, is refused."""
    values = as_mapping("known", known, "parameters to values, such as {'Q_h': 6.0}")
    for name, value in values.items():
        if value is None:
            raise ValueError(f"known= gives {name} no value; give a number, or leave it out.")
    return values


def check_known(
    parameters: Iterable[Parameter], known: Mapping[str, Any], given: str = "known=", may_be_0: Collection[str] = ()
) -> None:
    """Refuse values that a user gives for parameters and that they cannot have; warn of those likely in another unit.

    ``known`` are values by name: other names are left alone, and None is no value.  ``given`` is what messages call
    it; parameters of the units ``may_be_0`` may be 0, as a fit may find them.
    """
    for p in parameters:
        value = known.get(p.name)
        if value is None:
            continue
        if not is_number(value):
            raise ValueError(f"{given} gives {p.name} the value {value!r}; it must be a number [{p.unit}].")
        if (value == 0 and p.unit not in may_be_0) or (p.transform == "log" and float(value) * p.sign < 0):
            sign = "other than" if p.transform == "identity" else "<" if p.sign < 0 else ">"
            hint = f": cooling is negative, write {-value}" if value and p.sign < 0 else ""
            raise ValueError(f"{given} gives {p.name} the value {value}; it must be {sign} 0{hint}.")
        if p.unit == "-" and value > 1:
            raise ValueError(f"{given} gives {p.name} the value {value}; it is a share, at most 1.")
        largest, likely = _LIKELY.get(p.unit, (np.inf, ""))
        if abs(float(value)) >= largest:
            warn_user(f"{given} gives {p.name} {value:g} {p.unit}: likely {likely}; give it in {p.unit}.", UnitWarning)
