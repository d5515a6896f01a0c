"""Compute the monthly constants of the embedded weather generator from EPW files, print them and write them.

    python benchmarks/data/fit_climate.py oakland=OAKLAND.epw chicago=CHICAGO.epw [--write]

``--write`` replaces ``skhybrid/datasets/data/climate.json``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import fsolve
from scipy.special import expit, logit

from skhybrid.datasets import read_epw
from skhybrid.datasets._weather import MAX_CLEARNESS, clear_sky, sun, year_position

TARGET = Path(__file__).resolve().parents[2] / "skhybrid" / "datasets" / "data" / "climate.json"


def anchors_of(time: pd.DatetimeIndex, monthly: np.ndarray) -> np.ndarray:
    """Values at the middles of the months whose straight-line interpolation has the given monthly means."""
    grid = np.arange(-0.5, 13.0)
    hats = np.stack([np.interp(year_position(time), grid, np.eye(12)[j][np.arange(-1, 13) % 12]) for j in range(12)])
    share = np.stack([hats[:, time.month == month].mean(axis=1) for month in range(1, 13)])
    return np.linalg.solve(share, monthly)


def diurnal_of(air: pd.Series) -> list[list[float]]:
    """Two harmonics of the mean day of every month: cosine and sine of once, then of twice a day [K]."""
    rows = []
    for month in range(1, 13):
        day = air[air.index.month == month].groupby(air.index[air.index.month == month].hour).mean().to_numpy()
        spectrum = 2 * np.fft.rfft(day)[1:3] / 24
        rows.append([round(float(v), 3) for z in spectrum for v in (z.real, -z.imag)])
    return rows


def clearness_of(frame: pd.DataFrame, cloudless: np.ndarray) -> dict[str, object]:
    """Level and spread of the latent clearness by month, its share between days and their autocorrelation."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    weights = weights / weights.sum()
    sunny = cloudless > 50.0
    index = np.clip(frame["ghi"].to_numpy() * 1000 / np.maximum(cloudless, 1.0), 0.01, MAX_CLEARNESS - 0.01)
    level, spread = np.zeros(12), np.zeros(12)
    for month in range(12):
        rows = sunny & (frame.index.month == month + 1)
        weight = cloudless[rows] / cloudless[rows].sum()
        mean = float(weight @ (frame["ghi"].to_numpy()[rows] * 1000 / cloudless[rows]))
        std = float(np.sqrt(weight @ (index[rows] - mean) ** 2))

        def miss(z: np.ndarray, mean: float = mean, std: float = std) -> list[float]:
            k = MAX_CLEARNESS * expit(z[0] + np.exp(z[1]) * nodes)
            first = float(weights @ k)
            return [first - mean, float(np.sqrt(weights @ (k - first) ** 2)) - std]

        root = fsolve(miss, [logit(mean / MAX_CLEARNESS), 0.0])
        level[month], spread[month] = root[0], np.exp(root[1])
    month = frame.index.month.to_numpy() - 1
    latent = pd.Series((logit(index / MAX_CLEARNESS) - level[month]) / spread[month], index=frame.index)[sunny]
    latent = latent.clip(-3, 3)
    daily = latent.groupby(latent.index.normalize()).mean()
    return {
        "clear_level": np.round(level, 3).tolist(),
        "clear_spread": np.round(spread, 3).tolist(),
        "cloud_day_share": round(float(daily.var() / latent.var()), 3),
        "cloud_ar1": round(float(daily.autocorr(1)), 3),
    }


def fit(path: str) -> dict[str, object]:
    """The constants of one climate."""
    frame = read_epw(path)
    site = frame.attrs["site"]
    frame = frame.tz_localize(None)
    fine = pd.date_range(frame.index[0], periods=12 * len(frame), freq="5min") + pd.Timedelta("2.5min")
    cloudless = clear_sky(sun(site, fine)["zenith"].to_numpy()).reshape(-1, 12).mean(axis=1)
    air = frame["T_oa"]
    anchors = anchors_of(frame.index, air.groupby(air.index.month).mean().to_numpy())
    season = np.interp(year_position(frame.index), np.arange(-0.5, 13.0), anchors[np.arange(-1, 13) % 12])
    daily = (air - season).groupby(air.index.normalize()).mean()
    months = daily.groupby(daily.index.month)
    return {
        **site,
        "T_anchor": np.round(anchors, 3).tolist(),
        "diurnal": diurnal_of(air),
        "T_day_std": np.round(months.std(), 3).tolist(),
        "T_day_ar1": round(float(daily.autocorr(1)), 3),
        **clearness_of(frame, cloudless),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("climates", nargs="+", metavar="NAME=FILE.epw")
    parser.add_argument("--write", action="store_true", help=f"replace {TARGET.name} in the package")
    options = parser.parse_args()
    table = {name: fit(path) for name, path in (pair.split("=", 1) for pair in options.climates)}
    text = json.dumps(table, indent=1)
    print(text)
    if options.write:
        TARGET.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
