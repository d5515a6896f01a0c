"""Diagnostics of a fitted identification: tests of its one-step errors, and a report of them."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from sklearn.utils.validation import check_is_fitted

from ..._arguments import check_integer, check_level, refuse_without
from ..._table import float_columns
from ..._time import positive_duration, rows_covering, spell
from .findings import ErrorPattern
from .residual_tests import autocorrelation, cross_correlation, cumulative_periodogram, independence, ljung_box


@dataclass(frozen=True)
class Diagnostics:
    """Tests of the errors of a model, and what their pattern means.

    Attributes
    ----------
    name : str
    innovations : DataFrame
        ``innovation`` and ``std`` [K] of every row; all else is about their ratio.
    sampling_time : Timedelta
    autocorrelation : DataFrame
        Index ``lag`` (Timedelta); ``acf``, ``band`` (95 %), ``n_pairs``.
    ljung_box : DataFrame
        Index ``lag`` (Timedelta); ``statistic``, ``dof``, ``p_value``.
    cumulative_periodogram : DataFrame
        Index ``frequency`` [1/h]; ``cumulative``, ``expected``, ``band`` (Kolmogorov-Smirnov, 95 %).
    cross_correlation : DataFrame
        Index ``lag`` (Timedelta, input first), columns (input, ``ccf``/``band``/``t``), prewhitened.
    tests : DataFrame
        One row per test: ``statistic``, ``p_value`` and ``passed`` at the level.
    findings : tuple of str
        What the patterns mean.
    level : float
    """

    name: str
    innovations: pd.DataFrame
    sampling_time: pd.Timedelta
    autocorrelation: pd.DataFrame
    ljung_box: pd.DataFrame
    cumulative_periodogram: pd.DataFrame
    cross_correlation: pd.DataFrame
    tests: pd.DataFrame
    findings: tuple[str, ...]
    level: float = 0.01

    @property
    def standardised(self) -> pd.Series:
        """``innovation / std`` of every row; NaN where missing."""
        return (self.innovations["innovation"] / self.innovations["std"]).rename("standardised")

    @property
    def share_outside(self) -> float:
        """Share of the autocorrelations outside the 95 % band; 0.05 for white noise."""
        table = self.autocorrelation.dropna()
        return float((table["acf"].abs() > table["band"]).mean())

    @property
    def whiteness(self) -> float:
        """p-value of whiteness by Ljung and Box."""
        return float(self.tests["p_value"]["white (Ljung-Box)"])

    def __str__(self) -> str:
        n, n_missing = int(self.standardised.notna().sum()), int(self.standardised.isna().sum())
        rms = float(np.sqrt((self.innovations["innovation"] ** 2).mean()))
        lines = [f"{self.name}: {n} one-step errors ({n_missing} rows without), rms {rms:.3g} K"]
        shown = self.tests.assign(passed=np.where(self.tests["passed"], "yes", "NO"))
        lines += [shown.to_string(float_format=lambda value: f"{value:.3g}")]
        return "\n".join([*lines, *(f"- {finding}" for finding in self.findings)])

    def _repr_html_(self) -> str:
        shown = self.tests.assign(passed=np.where(self.tests["passed"], "yes", "<b>no</b>"))
        table = shown.to_html(float_format=lambda value: f"{value:.3g}", escape=False, border=0)
        items = "".join(f"<li>{escape(finding)}</li>" for finding in self.findings)
        return f"<h4>Diagnostics of {escape(self.name)}</h4>{table}<ul>{items}</ul>"


def diagnose(estimator: Any, X: Any, *, output: int = 0, max_lag: Any = "1D", level: float = 0.01) -> Diagnostics:
    """Test the one-step errors of a fitted identification.

    Parameters
    ----------
    estimator : fitted identification
        With ``innovations(X)``.
    X : DataFrame or array-like of shape (n_samples, n_features)
        The training table or new rows, with column ``T_za``.
    output : int, default=0
        Which measured temperature, for a network with several.
    max_lag : timedelta-like, default="1D"
        Longest lag of the correlations.
    level : float, default=0.01
        Probability that a test fails where all is well.

    Returns
    -------
    Diagnostics

    Raises
    ------
    ValueError
        If ``T_za`` is missing, or fewer than three rows have an error.

    Examples
    --------
    >>> from skhybrid import GrayBoxRC
    >>> from skhybrid.datasets import make_office
    >>> from skhybrid.identification import diagnose
    >>> office = make_office(n_days=4, random_state=0)
    >>> found = diagnose(GrayBoxRC(known=office.theta).fit(office.X, office.y), office.X)
    >>> bool(found.tests.loc["white (Ljung-Box)", "passed"])  # the unmeasured gains are in the errors
    False
    """
    check_is_fitted(estimator)
    refuse_without(estimator, "innovations", "an identification, such as OutputDisturbanceID")
    table = estimator._read_X(X)
    found = estimator.innovations(table)
    half = found.shape[1] // 2  # one column per output, then their standard deviations
    check_integer("output", output, 0, half - 1)
    errors = found.iloc[:, [output, half + output]].set_axis(["innovation", "std"], axis=1)
    roles = estimator.network_.inputs(tuple(sorted(table.inputs)))
    inputs = pd.DataFrame({role: table.inputs[role] for role in roles}, index=errors.index)
    # one autoregressive and one moving-average root: OD's by definition, and a filter with one noise ratio has as many
    n_fitted = 2 if len(estimator.disturbance_) else 0
    settings = {"n_fitted": n_fitted, "max_lag": max_lag, "level": level, "name": type(estimator).__name__}
    return diagnose_residuals(errors, inputs, sampling_time=estimator.sampling_time_, **settings)


def diagnose_residuals(
    innovations: pd.DataFrame,
    inputs: pd.DataFrame | None = None,
    *,
    sampling_time: Any = None,
    n_fitted: int = 0,
    max_lag: Any = "1D",
    level: float = 0.01,
    name: str = "model",
) -> Diagnostics:
    """Test one-step errors that have been computed, as :func:`diagnose` does.

    Parameters
    ----------
    innovations : DataFrame
        Columns ``innovation`` and ``std`` [K], one row per step; NaN or no row where nothing was measured.
    inputs : DataFrame, optional
        Inputs of the same rows, by name; one that never changes is left out.
    sampling_time : timedelta-like, optional
        The step; needed where the index has no time stamps.
    n_fitted : int
        Parameters of the noise model that were fitted on these rows.
    max_lag, level : timedelta-like and float
        As in :func:`diagnose`.
    name : str

    Returns
    -------
    Diagnostics

    Raises
    ------
    ValueError
        If a column is missing, the step is unknown or not positive, a row comes twice or is no whole number of steps
        after the first, the inputs lack a row, or fewer than three rows have an error.
    """
    check_level(level)
    check_integer("n_fitted", n_fitted, 0)
    innovations = float_columns(innovations, ("innovation", "std"), "innovations")
    step = _step_of(innovations.index, sampling_time)
    if isinstance(innovations.index, pd.DatetimeIndex):
        grid = _grid(innovations.index, step)
        if inputs is not None:
            inputs = float_columns(inputs, getattr(inputs, "columns", ()), "inputs")
            if not (found := innovations.index.isin(inputs.index)).all():
                raise ValueError(
                    f"inputs has no row {innovations.index[int(np.argmin(found))]}; give those of the same rows, with "
                    "the same time stamps."
                )
            inputs = inputs.reindex(grid)
        innovations = innovations.reindex(grid)
    hours = step / pd.Timedelta("1h")
    z = (innovations["innovation"] / innovations["std"]).to_numpy(dtype=np.float64)
    n_lags = min(rows_covering(max_lag, step, "max_lag"), max(2, len(z) // 4))
    acf = autocorrelation(z, n_lags)
    box = ljung_box(z, sorted({max(n_fitted + 1, n_lags // part) for part in (4, 2, 1)}), n_fitted)
    spectrum = cumulative_periodogram(z)
    crossed = _cross_table(z, inputs, n_lags)
    tests = _tests(z, box, spectrum, crossed, level)
    findings = ErrorPattern(z, innovations.index, step, acf, spectrum, crossed, tests).findings()
    for table in (acf, box, crossed):
        table.index = pd.TimedeltaIndex(table.index.to_numpy() * step, name="lag").as_unit("ns")
    spectrum.index = pd.Index(spectrum.index / hours, name="frequency")
    return Diagnostics(name, innovations, step, acf, box, spectrum, crossed, tests, findings, level)


def _step_of(index: pd.Index, given: Any) -> pd.Timedelta:
    if given is not None:
        return positive_duration(given, "sampling_time")
    if not isinstance(index, pd.DatetimeIndex) or len(index) < 2:
        raise ValueError("the rows have no time stamps: say how far apart they are, such as sampling_time='15min'.")
    step = pd.Timedelta(np.median(np.diff(index.as_unit("ns").asi8)), unit="ns")
    if step <= pd.Timedelta(0):
        raise ValueError("most rows are at the stamp of the row before or earlier; sort them and drop duplicates.")
    return step


def _grid(stamps: pd.DatetimeIndex, step: pd.Timedelta) -> pd.DatetimeIndex:
    """Every step from the first stamp to the last; stamps between the steps, and those that come twice, are refused."""
    grid = pd.date_range(stamps[0], stamps[-1], freq=step)
    if not (once := stamps.isin(grid) & ~stamps.duplicated()).all():
        raise ValueError(
            f"the row {stamps[int(np.argmin(once))]} comes twice or is not a whole number of steps of {spell(step)} "
            "after the first; sort the rows, drop duplicates, or give their step as sampling_time=."
        )
    return grid


def _cross_table(z: np.ndarray, inputs: pd.DataFrame | None, n_lags: int) -> pd.DataFrame:
    """Lags from half a ``max_lag`` before the input to half a ``max_lag`` after it."""
    half = max(1, n_lags // 2)
    lags = list(range(-half, half + 1))
    moving = [] if inputs is None else [name for name in inputs if inputs[name].max() > inputs[name].min()]
    parts = {name: cross_correlation(z, inputs[name], lags) for name in moving if inputs is not None}
    if not parts:
        empty = pd.MultiIndex.from_arrays([[], []], names=["input", "value"])
        return pd.DataFrame(index=pd.Index(lags, name="lag"), columns=empty, dtype=np.float64)
    return pd.concat(parts, axis=1, names=["input", "value"])


def _tests(
    z: np.ndarray, box: pd.DataFrame, spectrum: pd.DataFrame, crossed: pd.DataFrame, level: float
) -> pd.DataFrame:
    worst = box.iloc[int(box["p_value"].to_numpy().argmin())]
    rows = {
        "white (Ljung-Box)": (worst["statistic"], min(1.0, len(box) * worst["p_value"])),
        "white (periodogram)": (spectrum.attrs["statistic"], spectrum.attrs["p_value"]),
    }
    for name in crossed.columns.unique("input"):
        t = crossed[name]["t"].loc[1:]  # an input acts on later temperatures only; before that it is the thermostat
        rows[f"independent of {name}"] = (float(t.abs().max()), independence(t))
    shape = stats.jarque_bera(z[np.isfinite(z)])
    rows["normal (Jarque-Bera)"] = (float(shape.statistic), float(shape.pvalue))
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["statistic", "p_value"])
    table.index.name = "test"
    return table.assign(passed=~(table["p_value"] < level))
