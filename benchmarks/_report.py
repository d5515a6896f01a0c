"""Result tables of a benchmark, with its command, machine and date."""

from __future__ import annotations

import datetime
import os
import platform
from pathlib import Path

import numpy as np
import pandas as pd

RESULTS = Path(__file__).parent / "results"


def write_table(
    name: str, title: str, command: str, tables: dict[str, pd.DataFrame], note: str = "", folder: Path = RESULTS
) -> Path:
    """Write tables as Markdown, completely or not at all."""
    cores = os.cpu_count()
    lines = [f"# {title}", "", f"`{command}`, {datetime.date.today()}, {platform.machine()}, {cores} cores, "]
    lines[-1] += f"Python {platform.python_version()}."
    if note:
        lines += ["", note]
    for heading, table in tables.items():
        lines += ["", f"## {heading}", "", *_markdown(table)]
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}.md"
    part = path.with_suffix(".part")
    part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    part.replace(path)
    return path


def spread(values: list[float]) -> str:
    """Median, with the lowest and highest if they differ."""
    values = [v for v in values if np.isfinite(v)]
    if not values:
        return ""
    middle, low, high = (f"{f(values):.3g}" for f in (np.median, min, max))
    return middle if low == high else f"{middle} ({low} to {high})"


def _markdown(table: pd.DataFrame) -> list[str]:
    frame = table.reset_index()
    head = "| " + " | ".join(map(str, frame.columns)) + " |"
    rows = [
        "| " + " | ".join(f"{v:.3g}" if isinstance(v, float) else str(v) for v in row) + " |"
        for row in frame.to_numpy()
    ]
    return [head, "|" + " --- |" * len(frame.columns), *rows]
