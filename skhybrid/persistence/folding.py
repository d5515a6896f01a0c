"""Plain data as one text, and a list of the values that text cannot hold: skops makes a node of every number."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

#: key of a dictionary that stands for another object; here for the value with this number in the list
MARK = "__skhybrid__"
_TEXT = (str, bool, int, float, type(None))
_MOST_BYTES, _MOST_PARTS = 2**23, 500_000  # of a text


def fold(data: Any) -> dict[str, Any]:
    """Fold data into its text, as bytes in an array, and its values; an array that is held twice is one value."""
    values: list[Any] = []
    places: dict[int, int] = {}

    def plain(value: Any) -> Any:
        if type(value) is dict:
            return {key: plain(part) for key, part in value.items()}
        if type(value) is list:
            return [plain(part) for part in value]
        if type(value) in _TEXT:
            return value
        if not isinstance(value, np.ndarray) or id(value) not in places:
            places[id(value)] = len(values)
            values.append(value)
        return {MARK: places[id(value)]}

    text = json.dumps(plain(data)).encode()
    return {"text": np.frombuffer(text, dtype=np.uint8), "values": values}


def unfold(found: Any) -> Any:
    """Return the data that :func:`fold` folded; refuse another form, or more parts than a model has."""
    if type(found) is not dict or found.keys() != {"text", "values"}:
        raise ValueError("it was not written by save_model")
    array, values = found["text"], found["values"]
    if not isinstance(array, np.ndarray) or array.dtype != np.uint8 or type(values) is not list:
        raise ValueError("its text is not an array of bytes, or its values are not a list")
    text = array.tobytes()
    if len(text) > _MOST_BYTES or sum(text.count(mark) for mark in (b"{", b"[", b",")) > _MOST_PARTS:
        raise ValueError(f"it has more than {_MOST_PARTS:,} parts")

    def whole(part: dict[str, Any]) -> Any:
        number = part.get(MARK)
        if type(number) is not int:
            return part
        if not 0 <= number < len(values):
            raise ValueError(f"it has no value {number}")
        return values[number]

    return json.loads(text, object_hook=whole)
