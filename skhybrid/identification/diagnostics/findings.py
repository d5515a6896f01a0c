"""What the errors of a fitted identification say about it, in tables and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from sklearn.utils.validation import check_is_fitted

from ..._time import rows_covering
from .residual_tests import autocorrelation, cross_correlation, cumulative_periodogram, independence, ljung_box

#: what stands behind an input that the errors follow
_MEANING = {
    "T_oa": "heat that leaves with the outdoor temperature (a resistance to it, ventilation)",
    "q_sol": "solar gain (window area, its share to the air, a shaded facade)",
    "u_heat": "heating (its capacity, the lag of its emitter, or a thermostat that acts within a step)",
    "u_cool": "cooling (its capacity, its lag, or a thermostat that acts within a step)",
    "Q_": "the measured heat (its lag, or the node that it enters)",
    "T_": "heat to this neighbour",
    "u_": "this stage (its capacity or its lag)",
}
#: 95 % of a standard normal variable lies within
_Z95 = 1.96
#: a correlation below this is real where rows are many, and still of little weight
_WEAK = 0.1


@dataclass(frozen=True)
class Diagnostics:
    """Tests of the errors of a model, and what their pattern means.

    Attributes
    ----------
    name : str
        Of the model.
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
        Index ``lag`` (Timedelta; positive where the input is earlier), columns (input, ``ccf``/``band``/``t``);
        errors and inputs prewhitened.
    tests : DataFrame
        One row a test: ``statistic``, ``p_value`` and ``passed`` at the level.
    findings : tuple of str
        What the patterns mean.
    level : float
        Of every test.
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
        """p-value of whiteness: Bonferroni's of the Ljung-Box rows."""
        return float(min(1.0, len(self.ljung_box) * self.ljung_box["p_value"].min()))

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
        With the measured temperature as column ``T_za``: the training table, or new rows.
    output : int, default=0
        Which measured temperature, for a network with several.
    max_lag : timedelta-like, default="1D"
        Longest lag of the correlations.
    level : float, default=0.01
        Of every test.

    Returns
    -------
    Diagnostics
        Print it: one screen.

    Raises
    ------
    ValueError
        If X has no ``T_za``, or too few rows were measured.

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
    found = estimator.innovations(X)
    half = found.shape[1] // 2  # a column an output, then their standard deviations
    errors = found.iloc[:, [output, half + output]].set_axis(["innovation", "std"], axis=1)
    table = estimator._read_X(X)
    roles = estimator.network_.inputs(tuple(sorted(table.inputs)))
    inputs = pd.DataFrame({role: table.inputs[role] for role in roles}, index=errors.index)
    # one autoregressive and one moving-average root: OD's by definition, and a filter with one noise ratio has as many
    n_fitted = 2 if len(estimator.disturbance_) else 0
    return diagnose_residuals(
        errors,
        inputs,
        sampling_time=estimator.sampling_time_,
        n_fitted=n_fitted,
        max_lag=max_lag,
        level=level,
        name=type(estimator).__name__,
    )


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
    """Test one-step errors that were computed already, as :func:`diagnose` does.

    Parameters
    ----------
    innovations : DataFrame
        Columns ``innovation`` and ``std`` [K], one row a step; NaN where nothing was measured.  Stamps that are absent
        count as rows without a measurement.
    inputs : DataFrame, optional
        Inputs of the same rows, by name; one that never changes is left out.
    sampling_time : timedelta-like, optional
        The step; needed where the index has no time stamps.
    n_fitted : int
        Parameters of the noise model that were fitted on these rows.
    max_lag : timedelta-like, default="1D"
        Longest lag of the correlations.
    level : float, default=0.01
        Of every test.
    name : str
        Of the model.

    Returns
    -------
    Diagnostics

    Raises
    ------
    ValueError
        If there is no step, or too few rows were measured.
    """
    step = _step_of(innovations.index, sampling_time)
    if isinstance(innovations.index, pd.DatetimeIndex):
        grid = pd.date_range(innovations.index[0], innovations.index[-1], freq=step)
        innovations = innovations.reindex(grid)
        inputs = None if inputs is None else inputs.reindex(grid)
    hours = step / pd.Timedelta("1h")
    z = (innovations["innovation"] / innovations["std"]).to_numpy(dtype=np.float64)
    n_lags = min(rows_covering(max_lag, step, "max_lag"), max(2, len(z) // 4))
    acf = autocorrelation(z, n_lags)
    box = ljung_box(z, sorted({max(n_fitted + 1, n_lags // part) for part in (4, 2, 1)}), n_fitted)
    spectrum = cumulative_periodogram(z)
    crossed = _cross_table(z, inputs, n_lags)
    tests = _tests(z, box, spectrum, crossed, level)
    findings = _Words(z, innovations.index, step, acf, spectrum, crossed, tests, level).findings()
    for table in (acf, box, crossed):
        table.index = pd.TimedeltaIndex(table.index.to_numpy() * step, name="lag").as_unit("ns")
    spectrum.index = pd.Index(spectrum.index / hours, name="frequency")
    return Diagnostics(name, innovations, step, acf, box, spectrum, crossed, tests, findings, level)


def _step_of(index: pd.Index, given: Any) -> pd.Timedelta:
    if given is not None:
        return pd.Timedelta(given)
    if not isinstance(index, pd.DatetimeIndex) or len(index) < 2:
        raise ValueError("the rows have no time stamps: say how far apart they are, such as sampling_time='15min'.")
    return pd.Timedelta(index[1] - index[0])


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
    known = z[np.isfinite(z)]
    shape = stats.jarque_bera(known)
    rows["normal (Jarque-Bera)"] = (float(shape.statistic), float(shape.pvalue))
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["statistic", "p_value"])
    table.index.name = "test"
    return table.assign(passed=~(table["p_value"] < level))


@dataclass(frozen=True)
class _Words:
    """What the tables mean."""

    z: np.ndarray
    index: pd.Index
    step: pd.Timedelta
    acf: pd.DataFrame
    spectrum: pd.DataFrame
    crossed: pd.DataFrame
    tests: pd.DataFrame
    level: float

    def findings(self) -> tuple[str, ...]:
        found = [*self._neighbours(), *self._day(), *self._spectrum(), *self._inputs()]
        if not found:
            found = ["the errors are white and independent of the inputs: the model leaves nothing that one could use."]
        return (*found, *self._size(), *self._clock(), *self._tails())

    def _neighbours(self) -> list[str]:
        if self.tests.loc["white (Ljung-Box)", "passed"]:
            return []
        outside = self.acf.index[self.acf["acf"].abs() > self.acf["band"]]
        near = self.acf["acf"].loc[: max(int(outside[0]), 4) if len(outside) else 1]
        first = int(near.index[int(near.abs().to_numpy().argmax())])
        r = float(near.loc[first])
        at = f"(r = {r:.2f} at {_spell(first * self.step)})"
        if first > 4:
            return [f"errors are alike at a distance {at}: look at what repeats with it."]
        weak = "slightly " if abs(r) < _WEAK else ""
        if r > 0:
            what = (
                "the disturbance model is not quite that of these rows."
                if weak
                else "heat comes and goes that the model does not carry (a disturbance state, a node); its standard "
                "errors are too small."
            )
            return [f"errors that follow one another are {weak}alike {at}: {what}"]
        return [
            f"errors that follow one another are {weak}opposed {at}: the model follows the noise of the thermometer; "
            "it takes the disturbance as too quick, or the measurement as too good."
        ]

    def _day(self) -> list[str]:
        day = round(pd.Timedelta("1D") / self.step)
        near = self.acf.loc[max(1, day - 1) : day + 1]
        high = near[near["acf"] > 2.0 * near["band"]]
        if high.empty:
            return []
        return [
            f"errors repeat from day to day (r = {high['acf'].max():.2f} at 24 h): a daily schedule of people or "
            "equipment is not in the model; PeriodicDisturbanceID learns one."
        ]

    def _spectrum(self) -> list[str]:
        if self.tests.loc["white (periodogram)", "passed"]:
            return []
        gap = self.spectrum["cumulative"] - self.spectrum["expected"]
        place = float(gap.index[int(gap.abs().to_numpy().argmax())])
        period = _spell(self.step / place)
        if gap.abs().max() == gap.max():
            return [f"too much of the errors is slower than a period of {period}: slow heat flows are missing."]
        return [f"too much of the errors is quicker than a period of {period}: noise or cycling within the step."]

    def _inputs(self) -> list[str]:
        out = []
        for name in self.crossed.columns.unique("input"):
            if self.tests.loc[f"independent of {name}", "passed"]:
                continue
            part = self.crossed[name].loc[1:]
            t = part["t"].abs().to_numpy()
            worst = int(np.nanargmax(t))
            lags, r = _segment(t > _Z95, worst) + 1, float(part["ccf"].iloc[worst])
            first, last = _spell(int(lags[0]) * self.step), _spell(int(lags[-1]) * self.step)
            at = f"at a lag of {first}" if first == last else f"at lags of {first} to {last}"
            out.append(
                f"errors are {'weakly ' if abs(r) < _WEAK else ''}correlated with {name} {at} (r = {r:.2f}): "
                f"{_meaning(name)} is not well described, or something unmeasured keeps the same hours."
            )
        return out

    def _size(self) -> list[str]:
        known = self.z[np.isfinite(self.z)]
        ratio, out = float(np.sqrt(np.mean(known**2))), []
        if not 0.8 < ratio < 1.25:
            out.append(f"errors are {ratio:.2g} times as large as the model says: its error bars are off by that.")
        drift = float(known.mean())
        if abs(drift) > 0.1 and abs(drift) * np.sqrt(len(known)) > 4.0:
            out.append(f"the temperature is on average {'above' if drift > 0 else 'below'} what is predicted.")
        return out

    def _clock(self) -> list[str]:
        if not isinstance(self.index, pd.DatetimeIndex):
            return []
        quarter = np.asarray(self.index.hour) // 6
        block = np.array([np.nanmean(np.append(self.z[quarter == q] ** 2, np.nan)) for q in range(4)])
        if not block.max() > 3.0 * block.min():  # False too where a quarter has no row
            return []
        hour = 6 * int(block.argmax())
        return [
            f"errors are {np.sqrt(block.max() / block.min()):.1f} times as large from {hour} to {hour + 6} h as in the "
            "quietest quarter of the day: a model whose variance changes with time (PeriodicDisturbanceID) would weigh "
            "the quiet hours more."
        ]

    def _tails(self) -> list[str]:
        excess = float(stats.kurtosis(self.z[np.isfinite(self.z)]))
        if self.tests.loc["normal (Jarque-Bera)", "passed"] or excess < 3.0:
            return []
        return [f"a few errors are very large (excess kurtosis {excess:.1f}): single events, such as an open window."]


def _spell(span: pd.Timedelta) -> str:
    minutes = span / pd.Timedelta("1min")
    return f"{minutes:.3g} min" if minutes < 120 else f"{minutes / 60:.3g} h"


def _segment(high: np.ndarray, place: int) -> np.ndarray:
    """The unbroken run of high values around a place; one low value does not break it."""
    first = last = place
    while first > 0 and high[max(0, first - 2) : first].any():
        first -= 1 if high[first - 1] else 2
    while last < len(high) - 1 and high[last + 1 : last + 3].any():
        last += 1 if high[last + 1] else 2
    return np.arange(first, last + 1)


def _meaning(name: str) -> str:
    candidates: Sequence[str] = [key for key in _MEANING if name.startswith(key)]
    return _MEANING[max(candidates, key=len)] if candidates else "its effect"
