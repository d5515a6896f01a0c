"""Reference data beside the checkout: weather files and logs of homes; a study without them stops with a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
#: TMY3 weather by climate
EPW = {
    "oakland": "USA_CA_Oakland.Intl.AP.724930_TMY3.epw",
    "chicago": "USA_IL_Chicago-OHare.Intl.AP.725300_TMY3.epw",
}


def reference(name: str, otherwise: str) -> Path:
    """The path of a reference file; where it is absent the study ends with a sentence that names what else to do."""
    path = SHARED / name
    if not path.is_file():
        raise SystemExit(f"{path} is absent, and nothing takes its place silently; put it there, or {otherwise}.")
    return path


def made_buildings(folder: Path) -> Iterator[tuple[dict[str, Any], tuple[str, ...]]]:
    """The rows of ``meta.csv`` in a folder of simulated buildings, with the spans of training and test."""
    if not (folder / "meta.csv").is_file():
        raise SystemExit(f"{folder} has no meta.csv; make it with make_buildings.py or make_step_tests.py.")
    for row in pd.read_csv(folder / "meta.csv").to_dict("records"):
        yield row, tuple(str(row[end]) for end in ("train_start", "train_end", "test_start", "test_end"))
