"""Reference data beside the checkout: weather files and logs of homes; a study without them stops with a sentence."""

from __future__ import annotations

from pathlib import Path

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
