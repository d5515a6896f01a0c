"""Figures for files, which pyplot neither shows nor keeps."""

from __future__ import annotations

from io import StringIO
from typing import Any, Literal


def blank_axes(
    n_rows: int, figsize: tuple[float, float], n_columns: int = 1, share: bool | Literal["col"] = True
) -> tuple[Any, Any]:
    """Make a figure that pyplot does not keep in memory, and its (n_rows * n_columns,) axes, row by row.

    All axes ``share`` their times, none do, or those of each column.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=figsize, layout="constrained")
    axes = figure.subplots(n_rows, n_columns, sharex=share, squeeze=False)
    return figure, axes.ravel()


def svg_text(figure: Any, salt: str) -> str:
    """A figure as SVG with its texts as texts; identifiers depend on the salt and the figure alone."""
    import matplotlib as mpl

    buffer = StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": salt}):
        for ax in figure.axes:
            ax.patch.set_visible(False)
        figure.savefig(buffer, format="svg", facecolor="none", metadata={"Date": None})
    return buffer.getvalue()
