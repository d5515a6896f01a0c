"""Identifiability of the parameters: flat and weak directions, as text and as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np
import pandas as pd
from scipy.linalg import qr
from scipy.stats import t as student

from ..._warnings import percent
from ...thermal import Parameter
from .standard_errors import ParameterUncertainty

#: a direction is flat by a singular value below this share of the largest, or a standard deviation of e^5 or more
FLAT, FLAT_SD = 1e-6, 5.0
WEAK = 0.25  # a direction is weak when its leading parameter may be off by more than this share at 90 %
_LEVEL = 0.9
_MINOR = 0.1  # members of a direction below this share of its leading one are not named
_MOST_WEAK, _MOST_MEMBERS = 4, 4  # weak directions, and members of each, that are named: the report fits one screen


@dataclass(frozen=True)
class Identifiability:
    """Information of the data about each direction in the space of the network's parameters.

    A direction is a combination of parameters on the logarithmic scale; ``1 / singular value`` is the relative standard
    error along it, with the parameters of the disturbance model free to follow.

    Attributes
    ----------
    singular_values : Series
        Of the scaled sensitivity, largest first [-].
    directions : DataFrame of shape (n_directions, n_parameters)
        Exponents [-], the leading one 1, in the order of ``singular_values``.
    flat_directions : tuple of str
        Combinations of parameters that the data do not move, with their units and exponents.
    weak_directions : tuple of str
        Combinations that the data hardly determine, and by how many percent each member may move at 90 %.
    at_bound : tuple of str
        Parameters that ended at a bound of the search, or at 0 because of their sign.
    not_excited : tuple of str
        Parameters that no row of the table moves; they stay at their default.
    n_days : int
        Days of data; quantiles are of Student's t with ``n_days - 1`` degrees of freedom.
    """

    singular_values: pd.Series
    flat_directions: tuple[str, ...]
    at_bound: tuple[str, ...]
    not_excited: tuple[str, ...]
    weak_directions: tuple[str, ...] = ()
    directions: pd.DataFrame = field(default_factory=pd.DataFrame)
    n_days: int = 0

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value [-]; 1 where nothing was searched."""
        values = self.singular_values.to_list()  # infinite without a warning, as numbers of Python
        return values[0] / max(values[-1], 1e-300) if values else 1.0

    @property
    def _sections(self) -> list[tuple[str, tuple[str, ...]]]:
        return [
            ("flat directions: no row tells them apart; fix one member of each by known=", self.flat_directions),
            (f"weak directions: what they may be off by at {percent(_LEVEL, '.3g')}", self.weak_directions),
            ("at a bound of the search: widen bounds=, or question the network", self.at_bound),
            ("not excited: no row moves them; known=, or days on which they run", self.not_excited),
        ]

    def __str__(self) -> str:
        n, days = len(self.singular_values), f" from {self.n_days} days" if self.n_days else ""
        lines = [f"Identifiability of {n} parameters{days}"]
        for title, names in self._sections:
            head, _, hint = title.partition(":")
            lines += [f"  {head}:{hint}", *(f"    - {name}" for name in names)] if names else [f"  {head}: none"]
        if n:
            values = ", ".join(f"{v:.3g}" for v in self.singular_values)
            lines.append(f"  singular values of the scaled sensitivity: {values}")
            lines.append(f"  condition number of the sensitivity: {self.condition_number:.3g}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """The same as a table for notebooks and reports."""
        parts = [f"<p><b>Identifiability</b> of {len(self.singular_values)} parameters, {self.n_days} days</p>"]
        for title, names in self._sections:
            head, _, hint = title.partition(":")
            hint = f" <small style='opacity:.7'>{escape(hint.strip())}</small>" if names and hint else ""
            items = "".join(f"<li>{escape(name)}</li>" for name in names)
            parts.append(f"<p style='margin:.4em 0 0'><b>{escape(head)}</b>{hint}{'' if names else ': none'}</p>")
            parts.append(f"<ul style='margin:.1em 0'>{items}</ul>" if names else "")
        if len(self.directions):
            parts.append(self._direction_table())
        return f"<div class='skhybrid-identifiability' style='font-family:sans-serif'>{''.join(parts)}</div>"

    def _direction_table(self) -> str:
        """Every direction as a row; the stronger a member, the darker its cell."""
        cell = "style='padding:.15em .5em;text-align:right;border-bottom:1px solid #ddd{}'"
        names = "".join(f"<th {cell.format('')}>{escape(str(c))}</th>" for c in self.directions.columns)
        rows = []
        for value, (_, row) in zip(self.singular_values, self.directions.iterrows(), strict=True):
            cells = ""
            for x in row:
                shade = f";background:rgba({'0,114,178' if x > 0 else '213,94,0'},{0.45 * min(abs(x), 1.0):.2f})"
                cells += f"<td {cell.format(shade)}>{x:+.2f}</td>"
            rows.append(f"<tr><td {cell.format('')}>{value:.3g}</td>{cells}</tr>")
        return (
            f"<table style='border-collapse:collapse;margin-top:.6em'><caption style='text-align:left'>Exponents of "
            f"each direction, by singular value</caption><thead><tr><th {cell.format('')}>singular value</th>{names}"
            f"</tr></thead><tbody>{''.join(rows)}</tbody></table>"
        )


def find_directions(
    found: ParameterUncertainty, at_bound: tuple[str, ...], not_excited: tuple[str, ...]
) -> Identifiability:
    """Flat and weak directions in the space of the parameters that the data decide."""
    parameters, n_days = found.parameters, found.n_days
    names = [p.name for p in parameters]
    if not names:
        return Identifiability(pd.Series(dtype=np.float64), (), at_bound, not_excited, n_days=n_days)
    values, rows, flat = _directions(found.sensitivity)
    leading = rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)]
    table = pd.DataFrame(rows / leading[:, None], columns=names)
    together = tuple(_together(row, parameters) for row in _sparse_basis(rows[flat]))
    weak = _weak(rows[~flat], found)
    series = pd.Series(values, name="singular_value")
    return Identifiability(series, together, at_bound, not_excited, weak, table, n_days)


def _directions(sensitivity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Singular values (k,), directions (k, k) as rows, and which of them are flat (k,)."""
    n, k = sensitivity.shape
    _, values, rows = np.linalg.svd(sensitivity, full_matrices=n < k)
    values = np.append(values, np.zeros(k - len(values)))
    return values, rows, values <= max(FLAT * values.max(initial=0.0), 1.0 / FLAT_SD)


def held_subspace(covariance: np.ndarray) -> np.ndarray:
    """(k, k) projector onto the directions that data and priors determine."""
    variances, axes = np.linalg.eigh(covariance)
    held = axes[:, variances < FLAT_SD**2]
    return held @ held.T


def _sparse_basis(rows: np.ndarray) -> np.ndarray:
    """The same space with as many zero entries as directions, so that each combination is as short as it can be."""
    if not len(rows):
        return rows
    _, _, order = qr(rows, pivoting=True, mode="economic")
    basis = np.linalg.solve(rows[:, order[: len(rows)]], rows)
    return basis / np.abs(basis).max(axis=1, keepdims=True)


def _together(row: np.ndarray, parameters: Sequence[Parameter]) -> str:
    """Parameters that rise together and those that fall, with the exponents that are not 1."""
    row = row * (1.0 if row.sum() >= 0 else -1.0)

    def listed(sign: float) -> str:
        members = [(p, abs(x)) for p, x in zip(parameters, row, strict=True) if x * sign > _MINOR]
        return ", ".join(f"{p.name} [{p.unit}]" + ("" if x > 0.95 else f"^{x:.2g}") for p, x in members)

    up, down = listed(1.0), listed(-1.0)
    return (f"{up} together" if "," in up or down else f"{up} alone") + (f", {down} inversely" if down else "")


def _weak(rows: np.ndarray, found: ParameterUncertainty) -> tuple[str, ...]:
    """Directions that the data determine loosely: principal axes of the covariance without the flat directions."""
    held, parameters = found.growth[:, None] * (rows.T @ rows), found.parameters
    variances, axes = np.linalg.eigh(held @ found.model @ held.T)
    reach = student.ppf(0.5 + _LEVEL / 2, max(found.n_days - 1, 1)) * np.sqrt(np.maximum(variances, 0.0))
    out: list[str] = []
    for far, axis in zip(reach[::-1], axes.T[::-1], strict=True):
        lead = int(np.argmax(np.abs(axis)))
        moves = far * axis * np.sign(axis[lead])
        if not moves[lead] > np.log1p(WEAK) or len(out) == _MOST_WEAK:
            break
        order = np.argsort(-np.abs(moves), kind="stable")
        told = [j for j in order if abs(moves[j]) > _MINOR * moves[lead]][:_MOST_MEMBERS]
        words = [f"{parameters[j].name} [{parameters[j].unit}] by {_percent(moves[j])}" for j in told]
        out.append(" with ".join([words[0], ", ".join(words[1:])]) if words[1:] else words[0])
    return tuple(f"{words}, or the reverse" for words in out)


def _percent(move: float) -> str:
    """A move of a logarithm as a percentage, or as a factor where it is large."""
    if abs(move) < np.log(5.0):
        return f"{100 * np.expm1(move):+.0f} %"
    factor = f"{np.exp(abs(move)):.0f}" if abs(move) < np.log(1e3) else "1000 or more"
    return f"a factor of {factor if move > 0 else f'1/{factor}'}"


def at_bounds(free: np.ndarray, searched: Sequence[Parameter]) -> tuple[str, ...]:
    """Parameters within a thousandth of the searched range from a bound."""
    ends = [(p.name, x, *p.free_bounds) for p, x in zip(searched, free, strict=True)]
    return tuple(name for name, x, low, high in ends if min(x - low, high - x) < 1e-3 * (high - low))
