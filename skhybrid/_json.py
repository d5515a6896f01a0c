"""Plain values as strict JSON."""

from __future__ import annotations

import json
from typing import Any


def strict_json(content: Any) -> str:
    """Values as JSON, in which a number that is not finite is null, and what JSON does not know is text."""
    return json.dumps(_plain(content), indent=2, default=str, allow_nan=False, ensure_ascii=False)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        value = value.item()
    return None if isinstance(value, float) and not abs(value) < float("inf") else value
