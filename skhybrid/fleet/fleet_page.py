"""The page of a fleet: a table, and a small chart per zone, the worst first; HTML without scripts."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd

from .._files import write_text
from ..study.report.html import html_cards, html_page, html_table
from ..study.report.words import percent_or_dash
from ..study.verdict import CARE, NOT, USABLE

_MOST_CHARTS = 200  # of the worst zones: more would make a page of many megabytes
_WIDTH, _HEIGHT = 240.0, 80.0  # of a chart
_KINDS = {USABLE: "fine", CARE: "care", NOT: "not"}
_STYLE = """<style>
.zones { display: grid; grid-template-columns: repeat(auto-fill, minmax(16rem, 1fr)); gap: 0.7rem; }
.zone { border: 1px solid var(--line); border-radius: 8px; padding: 0.5rem 0.8rem; min-width: 0; }
.zone b { overflow-wrap: anywhere; } .zone p { margin: 0.2rem 0; font-size: 0.84rem; overflow-wrap: anywhere; }
.zone svg { width: 100%; height: auto; display: block; } .zone.fine { border-left: 6px solid #009e73; }
.zone.care { border-left: 6px double #e69f00; } .zone.not { border-left: 6px dashed #d55e00; }
.band { fill: var(--mark); opacity: 0.2; } .made { stroke: var(--mark); fill: none; stroke-width: 1.6;
  stroke-dasharray: 4 2; } .seen { stroke: var(--ink); fill: none; stroke-width: 1.6; }
.now { stroke: var(--soft); stroke-width: 1; stroke-dasharray: 2 2; }
.zone text { fill: var(--soft); font-size: 9px; }
</style>
"""


def write_fleet_page(
    path: str | PathLike[str], table: pd.DataFrame, recent: Mapping[str, pd.DataFrame], key: str
) -> None:
    """Write the status of a fleet as one HTML file, in one step."""
    counts = table["verdict"].value_counts()
    cards = [(str(counts.get(level, 0)), f"zones: {level}") for level in (NOT, CARE, USABLE)]
    yesterday = table["rmse_yesterday"].dropna()
    if len(yesterday):
        cards.append((f"{yesterday.median():.2f} K", "median error of the last day's forecasts"))
    shown = [_zone(row, recent.get(str(row[key])), key) for _, row in table.head(_MOST_CHARTS).iterrows()]
    more = f" The {_MOST_CHARTS} worst of {len(table)} are shown." if len(table) > _MOST_CHARTS else ""
    sections = [
        f'<p class="soft">skhybrid: day-ahead forecasts of a fleet</p><h1>{len(table)} zones</h1>\n{html_cards(cards)}',
        "<h2>Zones, the worst first</h2>\n<p>Line: measured temperature. Dashes: its forecast, with the interval that "
        f"should hold 80 % of the measurements. Dots: where the measurements end.{more}</p>\n"
        + f'<div class="zones">{"".join(shown)}</div>',
        "<h2>Errors</h2>\n" + _errors(table.head(_MOST_CHARTS), key),
    ]
    write_text(path, html_page("Fleet: status", sections, _STYLE))


def _zone(row: pd.Series, recent: pd.DataFrame | None, key: str) -> str:
    facts = [
        f"error {row['rmse_yesterday']:.2f} K yesterday" if np.isfinite(row["rmse_yesterday"]) else "",
        f"error {row['rmse_training']:.2f} K in training" if np.isfinite(row["rmse_training"]) else "",
        f"{percent_or_dash(row['coverage'])} in the interval" if np.isfinite(row["coverage"]) else "",
    ]
    chart = "" if recent is None else _chart(recent)
    return (
        f'<div class="zone {_KINDS[row["verdict"]]}"><b>{escape(str(row[key]))}</b>: {escape(row["verdict"])}{chart}'
        f"<p>{', '.join(filter(None, facts))}</p>"
        f'<p class="soft">{escape(row["reasons"])}</p></div>'
    )


def _chart(recent: pd.DataFrame) -> str:
    """Measured and forecast temperature as a drawing of two lines and a band."""
    lines = recent.reindex(columns=["y_true", "y_pred", "q_0.1", "q_0.9"]).to_numpy(dtype=float)
    if len(lines) < 2 or not np.isfinite(lines).any():
        return ""
    low, high = np.nanmin(lines), np.nanmax(lines)
    x = np.linspace(0.0, _WIDTH, len(lines))
    y = _HEIGHT - 4.0 - (lines - low) / max(high - low, 0.1) * (_HEIGHT - 8.0)
    known = np.isfinite(y[:, 2:]).all(axis=1)
    around = [*zip(x[known], y[known, 3], strict=True), *list(zip(x[known], y[known, 2], strict=True))[::-1]]
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in around)
    band = f'<polygon class="band" points="{points}"/>' if len(around) > 2 else ""
    paths = {"seen": _path(x, y[:, 0]), "made": _path(x, y[:, 1])}
    drawn = "".join(f'<path class="{kind}" d="{path}"/>' for kind, path in paths.items() if path)
    seen = np.flatnonzero(np.isfinite(lines[:, 0]))  # a line where the measurements end
    now = (
        f'<line class="now" x1="{x[seen[-1]]:.1f}" y1="0" x2="{x[seen[-1]]:.1f}" y2="{_HEIGHT:g}"/>'
        if len(seen)
        else ""
    )
    text = f"{low:.1f} to {high:.1f} °C, {recent.index[0]} to {recent.index[-1]}"
    return (
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT + 24:g}" role="img" aria-label="{escape(text)}">{band}{now}{drawn}'
        f'<text x="0" y="{_HEIGHT + 9:g}">{_date(recent.index[0])}</text>'
        f'<text x="{_WIDTH:g}" y="{_HEIGHT + 9:g}" text-anchor="end">{_date(recent.index[-1])}</text>'
        f'<text x="0" y="{_HEIGHT + 20:g}">{low:.1f}–{high:.1f} °C</text></svg>'
    )


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """A line that is broken where values are missing."""
    known = np.isfinite(y)
    moves = known & ~np.concatenate([[False], known[:-1]])
    return "".join(f"{'M' if moves[i] else 'L'}{x[i]:.1f} {y[i]:.1f}" for i in np.flatnonzero(known))


def _date(stamp: Any) -> str:
    return f"{stamp:%d %b %H:%M}" if isinstance(stamp, pd.Timestamp) else ""


def _errors(table: pd.DataFrame, key: str) -> str:
    heads = (key, "yesterday [K]", "training [K]", "in interval", "drift", "last row")
    rows = []
    for _, row in table.iterrows():
        numbers = [f"{row[c]:.2f}" if np.isfinite(row[c]) else "–" for c in ("rmse_yesterday", "rmse_training")]
        last = "–" if row["last_row"] is pd.NaT else str(row["last_row"])
        rows.append((str(row[key]), *numbers, percent_or_dash(row["coverage"]), "yes" if row["drift"] else "no", last))
    return html_table(heads, rows)
