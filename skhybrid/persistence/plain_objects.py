"""Objects of this package, of pandas and of scikit-learn as plain data, and back."""

from __future__ import annotations

import importlib
import re
from typing import Any

import numpy as np

from .folding import MARK
from .pandas_objects import PANDAS_KINDS, pack, unpack

_OWN = "skhybrid."
#: modules whose classes a file may name; the ones left out unpickle, write files or start processes
_HOLDERS = re.compile(
    r"skhybrid\.(_holidays|_summary|_table|control|filtering|fleet\.prior|forecasting|hybrid|identification|model_selection|"
    r"preprocessing|schedule|thermal)(\.\w+)*(?<!\.search\.store)(?<!\.search\.runner)"
)
_BASES = {"skhybrid", "sklearn", "builtins", "abc", "collections", "typing"}  # packages of their bases
#: values written as they are, apart from masked arrays and arrays of objects.
_PLAIN = (str, bytes, bool, int, float, complex, type(None), np.ndarray, np.generic)


def to_data(value: Any, where: str) -> Any:
    """Replace pandas objects and objects of this package by marked dictionaries, at any depth."""
    if isinstance(value, _PLAIN):
        return _array_to_data(value, where)
    for kind, (accepted, encode, _) in PANDAS_KINDS.items():
        if isinstance(value, accepted):
            return {MARK: kind, **{k: to_data(v, f"{where}.{k}") for k, v in encode(value).items()}}
    if isinstance(value, type):
        own = value.__module__.startswith(_OWN)
        return {MARK: "type", "type": f"{value.__module__}:{value.__qualname__}"} if own else value
    if type(value).__module__.startswith(_OWN):
        return _own_to_data(value, where)
    if isinstance(value, dict):
        pairs = [(to_data(k, where), to_data(v, f"{where}[{k!r}]")) for k, v in value.items()]
        if type(value) is dict and all(isinstance(k, str) and k != MARK for k in value):
            return dict(pairs)
        return {MARK: "dict", "pairs": [list(pair) for pair in pairs]}
    if isinstance(value, list | tuple | set | frozenset):
        items = [to_data(v, f"{where}[{i}]") for i, v in enumerate(value)]
        if type(value) is list:
            return items
        if type(value) not in (tuple, set, frozenset):
            raise TypeError(f"{where} is a {type(value).__qualname__}, which cannot be written as data.")
        return {MARK: "sequence", "kind": type(value).__name__, "items": items}
    if _is_sklearn_object(value):  # skops can write it, once its attributes are data
        made = object.__new__(type(value))
        made.__dict__.update({k: to_data(v, f"{where}.{k}") for k, v in vars(value).items()})
        return made
    return value  # skops can write it (a random generator, a SciPy matrix), or save_model refuses it


def _array_to_data(value: Any, where: str) -> Any:
    if isinstance(value, np.ma.MaskedArray):  # cv_results_ masks parameters that a candidate does not have
        data = _array_to_data(np.ma.getdata(value), where)
        return {MARK: "masked", "data": data, "mask": np.ma.getmaskarray(value)}
    if isinstance(value, np.ndarray) and value.dtype == object:
        items = [to_data(v, f"{where}[{i}]") for i, v in enumerate(value.ravel())]
        return {MARK: "objects", "shape": list(value.shape), "items": items}
    packed = pack(value)
    return value if packed is None else {MARK: packed[0], **packed[1]}


def _own_to_data(value: Any, where: str) -> dict[str, Any]:
    cls = type(value)
    if "<locals>" in cls.__qualname__:
        raise TypeError(f"{where} is {value!r}, which cannot be written as data.")
    name = f"{cls.__module__}:{cls.__qualname__}"
    if isinstance(value, tuple):
        return {MARK: "tuple", "type": name, "items": [to_data(v, f"{where}[{i}]") for i, v in enumerate(value)]}
    state = value.__getstate__()
    if state is None and cls.__base__ is object:  # it has no attributes
        state = {}
    if not isinstance(state, dict):
        raise TypeError(f"{where} is a {cls.__qualname__} without plain attributes, which cannot be written as data.")
    return {MARK: "object", "type": name, "state": {k: to_data(v, f"{where}.{k}") for k, v in state.items()}}


def _is_sklearn_object(value: Any) -> bool:
    """Whether the value is a Python object of scikit-learn: an estimator, a scorer, a splitter."""
    return type(value).__module__.startswith("sklearn.") and hasattr(value, "__dict__")


def from_data(value: Any) -> Any:
    """Rebuild the objects that :func:`to_data` replaced."""
    if isinstance(value, dict):
        kind = value.get(MARK)
        return {k: from_data(v) for k, v in value.items()} if kind is None else _rebuild(kind, value)
    if isinstance(value, list):
        return [from_data(v) for v in value]
    if _is_sklearn_object(value):
        vars(value).update({k: from_data(v) for k, v in vars(value).items()})
    return value


def _rebuild(kind: str, value: dict[str, Any]) -> Any:
    parts = {k: from_data(v) for k, v in value.items() if k != MARK}
    if any(not isinstance(parts[k], list) for k in ("items", "pairs", "tuples") if k in parts):
        raise ValueError(f"the items of a {kind} are not a list")  # a range of 10**12 would be unfolded
    if kind in PANDAS_KINDS:
        return PANDAS_KINDS[kind][2](**parts)
    if kind in ("planes", "symmetric"):
        return unpack(kind, parts)
    if kind == "dict":
        return {k: v for k, v in parts["pairs"]}  # noqa: C416 -- dict(pairs) would accept pairs of any type
    if kind == "sequence":
        return {"tuple": tuple, "set": set, "frozenset": frozenset}[parts["kind"]](parts["items"])
    if kind == "objects":
        made = np.empty(len(parts["items"]), dtype=object)
        made[:] = parts["items"]
        return made.reshape(parts["shape"])
    if kind == "masked":
        return np.ma.MaskedArray(parts["data"], mask=parts["mask"])
    cls: Any = own_class(parts["type"])
    if kind == "type":
        return cls
    if kind == "tuple" and issubclass(cls, tuple) and len(parts["items"]) == len(getattr(cls, "_fields", ())):
        return tuple.__new__(cls, parts["items"])
    if kind == "object" and not issubclass(cls, tuple):
        rebuilt: Any = object.__new__(cls)
        getattr(rebuilt, "__setstate__", vars(rebuilt).update)(parts["state"])
        return rebuilt
    raise ValueError(f"unknown kind {kind!r}")


def own_class(name: str) -> type:
    """Return a class of this package that holds data, by "module:qualified name"; imported names are refused."""
    module, _, qualified = name.partition(":")
    if not _HOLDERS.fullmatch(module):
        raise ValueError(f"{name!r} is not a class of skhybrid that a model file may name")
    try:
        found: Any = importlib.import_module(module)
        for part in qualified.split("."):
            found = vars(found)[part]
    except (ModuleNotFoundError, KeyError) as error:
        if isinstance(error, ModuleNotFoundError) and not (error.name or "").startswith(_OWN):
            raise  # what is missing is a library, such as torch
        raise ValueError(f"it names {name!r}, which this version does not have; fit and save it again") from None
    named = isinstance(found, type) and (found.__module__, found.__qualname__) == (module, qualified)
    if not named or {base.__module__.partition(".")[0] for base in found.__mro__} - _BASES:
        raise ValueError(f"{name!r} is not a class of skhybrid that a model file may name")
    return found
