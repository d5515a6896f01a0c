"""Summaries of fitted estimators, as text and in notebooks."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
import pandas as pd
import sklearn
from sklearn.utils.validation import check_is_fitted

from . import __version__
from ._holidays import Holidays
from ._table import ZoneTable
from ._time import spell


@dataclass(frozen=True, eq=False)  # a fit has one
class TrainingRecord:
    """Training span of an estimator, and versions of the fit."""

    first: Any  # stamp or row number of the training table
    last: Any
    n_rows: int
    step: pd.Timedelta
    versions: dict[str, str]  # by package
    ranges: dict[str, tuple[float, float]]  # lowest and highest value of each input, by role
    holidays: Holidays  # which hold in forecasts too

    @classmethod
    def of(cls, table: ZoneTable, latest: ZoneTable | None = None) -> TrainingRecord:
        """The record of a table, or of all rows from its first to the last of ``latest``."""
        versions = {"skhybrid": __version__, "scikit-learn": sklearn.__version__, "numpy": np.__version__}
        parts = [table] if latest is None else [table, latest]
        ranges = {
            role: (min(float(p.inputs[role].min()) for p in parts), max(float(p.inputs[role].max()) for p in parts))
            for role in table.inputs
        }
        n_rows = table.n_rows
        if latest is not None:
            first, last = (part.time if part.utc is None else part.utc for part in parts)
            n_rows = round((last[-1] - first[0]) / table.step) + 1
        return cls(table.index[0], parts[-1].index[-1], n_rows, table.step, versions, ranges, table.holidays)

    def facts(self) -> dict[str, str]:
        """Span and versions as text."""
        versions = ", ".join(f"{name} {version}" for name, version in self.versions.items())
        span = f"{self.first} to {self.last} ({self.n_rows} rows of {spell(self.step)})"
        return {"trained on": span, "versions": versions}


@dataclass(frozen=True)
class Summary:
    """Summary of a fitted estimator; ``print`` it, or let a notebook show it.

    Attributes
    ----------
    title : str
    facts : dict of str to str
        Such as the training span and the versions of the fit.
    tables : dict of str to DataFrame
        Such as ``"parameters"``: ``value``, ``std`` where it is known, and ``unit``.
    """

    title: str
    facts: dict[str, str]
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)

    def __str__(self) -> str:
        lines = [self.title, *(f"  {name}: {value}" for name, value in self.facts.items())]
        for name, table in self.tables.items():
            lines += ["", name, table.to_string(float_format="{:.4g}".format, na_rep="-")]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        facts = "".join(f"<li>{escape(name)}: {escape(value)}</li>" for name, value in self.facts.items())
        tables = (
            f"<details><summary>{escape(name)}</summary>"
            f"{table.to_html(border=0, float_format='{:.4g}'.format, na_rep='-')}</details>"
            for name, table in self.tables.items()
        )
        return f"<div><b>{escape(self.title)}</b><ul>{facts}</ul>{''.join(tables)}</div>"


class SummaryMixin:
    """``summary``, and the same below the diagram of a fitted estimator; ``fit`` sets ``training_``."""

    training_: TrainingRecord

    def summary(self) -> Summary:
        """Parameters, settings that were found, training span and versions of the fit.

        Returns
        -------
        Summary
            With ``facts`` and ``tables`` (DataFrames); ``print`` gives text, a notebook shows HTML.
        """
        check_is_fitted(self)
        return Summary(type(self).__name__, self.training_.facts() | self._facts(), self._tables())

    def _facts(self) -> dict[str, str]:
        return {}

    def _tables(self) -> dict[str, pd.DataFrame]:
        return {}

    def _repr_html_inner(self) -> str:
        html = super()._repr_html_inner()  # type: ignore[misc]
        return html + self.summary()._repr_html_() if hasattr(self, "training_") else html

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, str]:
        shown = super()._repr_mimebundle_(**kwargs)  # type: ignore[misc]
        return shown | {"text/html": self._repr_html_inner()} if "text/html" in shown else shown


def network_tables(fitted: Any) -> dict[str, pd.DataFrame]:
    """Parameters of a fitted network with errors where they are known and units, and those of its disturbance."""
    units = {p.name: p.unit for p in getattr(fitted, "parameters_", fitted.network_.parameters())}
    parameters = pd.DataFrame({"value": fitted.theta_})
    if hasattr(fitted, "theta_std_"):
        parameters["std"] = fitted.theta_std_
    parameters["unit"] = [units.get(str(name), "") for name in parameters.index]
    own = fitted.disturbance_.to_frame("value")
    return {"parameters": parameters} | ({"disturbance": own} if len(own) else {})
