"""Tests of whiteness and independence for series in which rows may be missing: arrays in, tables out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from ..._arguments import check_integer, is_integer
from ..._table import as_numbers, refuse_huge

Z95 = 1.959964  # 95 % of a standard normal variable lies within
_LEAST_POWER = 1e-12  # share of the power of a series that is rounding
_MAX_ORDER = 32  # longest autoregression that makes an input white


def autocorrelation(errors: Any, n_lags: int) -> pd.DataFrame:
    """Autocorrelation over the pairs of rows that were both measured.

    Parameters
    ----------
    errors : array-like of shape (n,)
        NaN where missing; ValueError if fewer than three were measured, or all are the same.
    n_lags : int
        Lags 1 to ``n_lags``; fewer where the series is shorter.

    Returns
    -------
    DataFrame
        Index ``lag`` [rows]; ``acf``, the half-width ``band`` of 95 % of white noise and ``n_pairs``, NaN at no pair.
    """
    check_integer("n_lags", n_lags)
    z, seen = _centred(errors)
    variance = float(np.sum(z**2)) / int(seen.sum())
    lags = np.arange(1, min(n_lags, len(z) - 1) + 1)
    pairs = np.array([np.count_nonzero(seen[k:] & seen[:-k]) for k in lags])
    products = np.array([z[k:] @ z[:-k] for k in lags])
    with np.errstate(invalid="ignore", divide="ignore"):
        acf, band = products / pairs / variance, Z95 / np.sqrt(pairs)
    table = pd.DataFrame({"acf": acf, "band": band, "n_pairs": pairs}, index=pd.Index(lags, name="lag"))
    return table.where(table["n_pairs"] > 0)


def ljung_box(errors: Any, lags: Sequence[int], n_fitted: int = 0) -> pd.DataFrame:
    """Ljung and Box's test of whiteness, over the pairs of rows that were both measured.

    Parameters
    ----------
    errors : array-like of shape (n,)
        NaN where missing.
    lags : sequence of int
        The test takes all lags up to each of these.
    n_fitted : int
        Degrees of freedom taken by parameters of the noise model that were fitted on these rows.

    Returns
    -------
    DataFrame
        Index ``lags``; ``statistic``, ``dof`` and ``p_value``.

    Notes
    -----
    ``(n + 2) / n * sum_k n_pairs(k) acf(k)^2``: Ljung and Box (1978), with missing rows Stoffer and Toloi (1992).
    """
    lags = _read_lags(lags)
    if not lags or min(lags) < 1:
        raise ValueError(f"lags={lags!r} must be row numbers of at least 1; give one or more.")
    check_integer("n_fitted", n_fitted, 0)
    n = int(np.isfinite(as_numbers(errors, "the series")).sum())
    table = autocorrelation(errors, max(lags))
    total = ((n + 2) / n * table["n_pairs"] * table["acf"] ** 2).fillna(0.0).cumsum()
    counted = (table["n_pairs"] > 0).cumsum()
    rows = []
    for lag in lags:
        last = min(int(lag), len(table))
        dof = max(int(counted.loc[last]) - n_fitted, 1)
        statistic = float(total.loc[last])
        rows.append((statistic, dof, float(stats.chi2.sf(statistic, dof))))
    return pd.DataFrame(rows, columns=["statistic", "dof", "p_value"], index=pd.Index(lags, name="lags"))


def cumulative_periodogram(errors: Any) -> pd.DataFrame:
    """Share of the variance at or below each frequency, which for white noise is a straight line (Bartlett).

    Parameters
    ----------
    errors : array-like of shape (n,)
        NaN where missing: such a row is set to the mean, which leaves white noise white.

    Returns
    -------
    DataFrame
        Index ``frequency`` [cycles per row]; ``cumulative``, ``expected`` and the half-width ``band`` of the
        Kolmogorov-Smirnov test at 5 %.  ``attrs`` hold its ``statistic`` and ``p_value``.
    """
    z, _ = _centred(errors)
    m = (len(z) - 1) // 2
    power = np.abs(np.fft.rfft(z)[1 : m + 1]) ** 2
    total = max(power.sum(), _LEAST_POWER * len(z) * (z @ z))  # an alternating series has all of it above these
    cumulative, expected = np.cumsum(power) / total, np.arange(1, m + 1) / m
    statistic = float(max(np.max(cumulative - expected), np.max(expected - cumulative + 1.0 / m)))
    root = np.sqrt(m) + 0.12 + 0.11 / np.sqrt(m)  # Stephens (1970): the limit law, for finite samples
    table = pd.DataFrame(
        {"cumulative": cumulative, "expected": expected, "band": float(stats.kstwobign.isf(0.05)) / root},
        index=pd.Index(np.arange(1, m + 1) / len(z), name="frequency"),
    )
    table.attrs |= {"statistic": statistic, "p_value": float(stats.kstwobign.sf(root * statistic))}
    return table


def prewhiten(series: Any) -> np.ndarray:
    """(n,) residuals of an autoregression of the order by AIC; NaN where a row that it reads is missing.

    Once each of two series is white, their correlation has the standard error of white noise (Haugh, 1976).
    """
    x, seen = _centred(series)
    n, highest = int(seen.sum()), min(_MAX_ORDER, max(len(x) // 10, 1))
    pairs = np.array([np.count_nonzero(seen[k:] & seen[: len(x) - k]) for k in range(highest + 1)])
    # divided by n at lags without gaps, which keeps the autoregression stable
    covariance = np.array([x[k:] @ x[: len(x) - k] * (len(x) - k) for k in range(highest + 1)])
    covariance = covariance / np.maximum(pairs, 1) / len(x)
    covariance[0] *= 1.0 + 1e-9  # a piecewise constant series has a singular Toeplitz matrix
    weights = _autoregression(covariance, n)
    out = lfilter(np.concatenate([[1.0], -weights]), [1.0], x)
    read = np.convolve(~seen, np.ones(len(weights) + 1))[: len(x)] > 0
    out[read] = np.nan
    out[: len(weights)] = np.nan
    return np.asarray(out)


def _autoregression(covariance: np.ndarray, n: int) -> np.ndarray:
    """Weights by Yule and Walker, of the order with the least AIC."""
    best: tuple[float, np.ndarray] = (n * np.log(covariance[0]), np.zeros(0))
    for order in range(1, len(covariance)):
        weights = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        left = covariance[0] - weights @ covariance[1 : order + 1]
        score = n * np.log(max(left, 1e-12 * covariance[0])) + 2.0 * order
        if score < best[0]:
            best = (score, weights)
    return best[1]


def cross_correlation(errors: Any, series: Any, lags: Sequence[int]) -> pd.DataFrame:
    """Correlation of the errors with an input, both prewhitened, over the rows that were measured.

    Parameters
    ----------
    errors : array-like of shape (n,)
        NaN where missing.
    series : array-like of shape (n,)
        The input, without gaps.
    lags : sequence of int
        Rows by which the input is earlier than the error; negative where it is later.

    Returns
    -------
    DataFrame
        Index ``lag`` [rows]; ``ccf``, the half-width ``band`` of 95 % of an independent input (White's, ``1.96 sqrt(sum
        x^2 e^2) / (n sd(x) sd(e))``, right where both are larger by day), and the standardised value ``t``.
    """
    if np.size(errors) != np.size(series):
        raise ValueError(f"errors has {np.size(errors)} rows and series {np.size(series)}; give the same rows of both.")
    lags = _read_lags(lags)
    white = prewhiten(errors)
    measured = np.isfinite(as_numbers(errors, "the series")).sum()
    # scattered gaps leave no row whose past is whole: then the errors stay as they are, and the test is weaker
    z, seen = _centred(white if np.isfinite(white).sum() > measured // 2 else errors)
    x, known = _centred(prewhiten(series))
    scale = np.sqrt(np.sum(z**2) / seen.sum() * np.sum(x**2) / known.sum())
    rows = []
    for lag in lags:
        late = slice(lag, None) if lag >= 0 else slice(None, lag)
        early = slice(None, max(len(x) - lag, 0)) if lag >= 0 else slice(-lag, None)
        n, product = int((seen[late] & known[early]).sum()), z[late] * x[early]
        spread = float(np.sqrt(np.sum(product**2)))
        total = float(np.sum(product))
        if n < 3 or spread == 0.0:
            rows.append((np.nan, np.nan, np.nan))
        else:
            rows.append((total / n / scale, Z95 * spread / n / scale, total / spread))
    return pd.DataFrame(rows, columns=["ccf", "band", "t"], index=pd.Index(lags, name="lag"))


def independence(t: Any) -> float:
    """p-value of standardised correlations at several lags: Bonferroni's of their largest and their sum of squares."""
    known = np.asarray(t, dtype=np.float64)
    known = known[np.isfinite(known)]
    if not len(known):
        return np.nan
    largest = -np.expm1(len(known) * np.log1p(-2.0 * stats.norm.sf(np.abs(known).max())))
    return float(min(1.0, 2.0 * min(largest, stats.chi2.sf(np.sum(known**2), len(known)))))


def _read_lags(lags: Any) -> list[int]:
    """Lags in a list."""
    found: list[Any] = list(lags) if isinstance(lags, Iterable) else [None]
    if not all(map(is_integer, found)):
        raise ValueError(f"lags={lags!r} must be a list of whole numbers of rows, such as [24, 48].")
    return found


def _centred(errors: Any) -> tuple[np.ndarray, np.ndarray]:
    """Errors less their mean, 0 where missing; and which were measured."""
    values = as_numbers(errors, "the series")
    if values.shape != (values.size,) and values.shape != (values.size, 1):
        raise ValueError(f"the series has the shape {values.shape}; give one column.")
    values = values.reshape(-1)
    seen = np.isfinite(values)
    refuse_huge(values[seen], "the series")
    if seen.sum() < 3 or np.ptp(values[seen]) == 0.0:
        raise ValueError(
            f"{int(seen.sum())} values, {'all the same' if seen.sum() > 2 else 'too few'}, say nothing of correlation; "
            "pass more measured rows."
        )
    return np.where(seen, values - values[seen].mean(), 0.0), seen
