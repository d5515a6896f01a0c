"""The pages that use a class: its own page leads to them."""

import re
from pathlib import Path


def pages_by_name(docs: Path) -> dict[str, list[str]]:
    """Pages to read, such as ``"how_to/tune"``, by each name that they refer to or that stands in their code."""
    found: dict[str, list[str]] = {}
    for folder in ("start", "how_to", "explanation"):
        for page in sorted((docs / folder).glob("*.rst")):
            for name in set(re.findall(r"\b(\w+)(?=[(`]|\.\w)", page.read_text("utf-8"))):
                found.setdefault(name, []).append(f"{folder}/{page.stem}")
    return found
