"""Colours, axes, legends and titles shared by all displays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from .._warnings import percent
from ..forecasting.quantiles import quantile_levels

#: palette of Okabe and Ito, for colour-blind readers, without its black and its pale yellow.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
MEASURED = "#222222"
WEEKDAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
#: lines also differ by their dashes, for prints without colour.
DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1, 1, 1)))
#: of lines with few enough points, where dashes of long curves would look alike.
MARKERS = ("o", "s", "^", "D", "v", "x")
_PER_INCH, _HANDLE = 16.0, 9  # characters of a legend per inch, and those that a handle takes
_LEGEND: dict[str, Any] = {"frameon": False, "fontsize": "small", "handlelength": 3.2}
NARROW = 5.0  # width of a figure up to which there is room for one column and few stamps [in]


def line_style(number: int, *, beside_measured: bool = False) -> dict[str, Any]:
    """Return colour and dashes of line ``number``; beside a measurement none is solid, as that is."""
    dashes = DASHES[1:] if beside_measured else DASHES
    return {"color": COLORS[number % len(COLORS)], "linestyle": dashes[number % len(dashes)]}


def axes_or_new(ax: Any, figsize: tuple[float, float], n_rows: int = 1) -> Any:
    """Return the given axes, or those of a new figure: one, or an array of ``n_rows`` with a common time axis."""
    axes = grid_or_new(ax, n_rows, 1, (figsize[0], figsize[1] / n_rows))
    return axes[0] if n_rows == 1 else axes


def tidy(ax: Any, *, ylabel: str, xlabel: str | None = None, title: str | None = None) -> None:
    """Set the labels, a light grid and no box."""
    ax.set_ylabel(ylabel)
    if xlabel:
        ax.set_xlabel(xlabel)
    if title:
        ax.set_title(title, loc="left", fontsize="medium", fontweight="bold")
    ax.grid(True, color="#dddddd", linewidth=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def heading(ax: Any, title: str | None) -> None:
    """Set a bold title above the axes, clear of a legend."""
    if title:
        pad = 15.0 + 15.0 * -(-len(ax.get_legend_handles_labels()[1]) // _columns(ax))
        ax.set_title(title, loc="left", fontsize="medium", fontweight="bold", pad=pad)


def legend(ax: Any, title: str | None = None) -> None:
    """Add a legend above the axes, where it hides nothing, and a title above it."""
    place = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    ax.legend(ncols=_columns(ax), **place, **_LEGEND)
    heading(ax, title)


def _columns(ax: Any) -> int:
    """Columns of a legend that is no wider than the axes: a wider one would squeeze them."""
    labels = ax.get_legend_handles_labels()[1]
    longest = max(map(len, labels), default=0) + _HANDLE
    return max(1, min(len(labels), 5, int(_PER_INCH * _width(ax) / longest)))


def _width(part: Any) -> float:
    """Width of a figure, or of axes or another part of one [inch]."""
    return float(part.bbox.width / part.figure.dpi)


def time_axis(ax: Any, time: pd.Index) -> None:
    """Format dates in the time zone of the stamps; row numbers stay numbers."""
    if not isinstance(time, pd.DatetimeIndex):
        ax.set_xlabel("row [-]")
        return
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    # a narrow axis has room for 2 to 5 ticks: fewer than 3 days are 2 ticks by day and too many by hour
    few, many = (3, 9) if _width(ax.figure) > NARROW else (2, 5)
    locator = AutoDateLocator(minticks=few, maxticks=many, tz=time.tz)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator, tz=time.tz))
    ax.set_xlim(time.min(), time.max())
    ax.set_xlabel("local time" if time.tz is None else f"local time ({time.tz})")


def grid_or_new(ax: Any, n_axes: int, n_cols: int, size: tuple[float, float], share: bool = True) -> np.ndarray:
    """(n_axes,) axes: those given, or of a new figure in ``n_cols`` columns, each of the given size [inch]."""
    if ax is not None:
        given = np.ravel(np.asarray(ax, dtype=object))
        if strange := [one for one in given if not hasattr(one, "plot")]:
            raise ValueError(f"ax is a {type(strange[0]).__name__}; give axes, such as those of plt.subplots().")
        if len(given) != n_axes:
            raise ValueError(f"ax has {len(given)} axes, but this display needs {n_axes}.")
        return given
    import matplotlib.pyplot as plt

    n_cols = min(n_cols, n_axes)
    n_rows = -(-n_axes // n_cols)
    figure, made = plt.subplots(
        n_rows, n_cols, sharex=share, figsize=(size[0] * n_cols, size[1] * n_rows), layout="constrained", squeeze=False
    )
    made = np.ravel(made)
    for spare in made[n_axes:]:
        figure.delaxes(spare)
    for above in made[max(0, n_axes - n_cols) : n_axes]:  # the lowest axes of each column show the labels
        above.tick_params(labelbottom=True)
    return made[:n_axes]


def shared_legend(axes: np.ndarray, title: str | None = None) -> None:
    """Add one legend above all panels, with the lines of each of them, and a title."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if len({ax.figure for ax in axes}) == 1 and entries:
        heading_style = {"title": title, "title_fontproperties": {"weight": "bold"}, "alignment": "left"}
        fitting = int(_PER_INCH * _width(axes[0].figure) / (max(map(len, entries)) + _HANDLE))
        place = {"loc": "outside upper left", "ncols": max(1, min(len(entries), 6, fitting))}
        axes[0].figure.legend(entries.values(), entries.keys(), **heading_style, **place, **_LEGEND)


def bands(ax: Any, time: Any, frame: pd.DataFrame, color: str, label: str = "") -> None:
    """Shade between pairs of quantile columns ``q_...``, the outer pairs lighter."""
    levels = quantile_levels(frame.columns)
    names = list(levels)
    for low, high in zip(names[: len(names) // 2], names[::-1], strict=False):
        level = percent(levels[high] - levels[low], ".3g")
        text = f"{label}, {level}" if label else f"{level} interval"
        ax.fill_between(time, frame[low], frame[high], color=color, alpha=0.22, linewidth=0, zorder=1, label=text)
