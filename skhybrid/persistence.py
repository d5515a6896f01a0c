"""Model files that hold only data: reading a file executes nothing in it.

A file is one line of text, with the version and a checksum, followed by a ``skops`` archive.  pandas objects and those
of this package are written as plain data, so a file can only name these types and those that ``skops`` itself trusts.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from . import __version__
from ._archive import MOST_BYTES, check_archive, deflated, unpacks_too_large
from ._files import atomic_path
from ._folded import MARK, fold, unfold
from ._plain_data import PANDAS_KINDS, pack, unpack
from ._skops import import_skops
from ._warnings import first_sentence
from .exceptions import ModelFileError

__all__ = ["load_metadata", "load_model", "load_model_and_metadata", "save_model"]

_HEADER = re.compile(rb"skhybrid-model version=([^ \n]{1,60}) sha256=([0-9a-f]{64})\n")
_OWN = "skhybrid."
#: modules whose classes a file may name; the ones left out unpickle, write files or start processes
_HOLDERS = re.compile(
    r"skhybrid\.(_holidays|_summary|_table|control|filtering|fleet\.prior|forecasting|hybrid|identification|model_selection|"
    r"preprocessing|schedule|thermal)(\.\w+)*(?<!\.search\.store)(?<!\.search\.runner)"
)
_BASES = {"skhybrid", "sklearn", "builtins", "abc", "collections", "typing"}  # packages of their bases
#: types trusted in addition to those of skops: fitted searches and scikit-learn networks hold them, and they are data.
_TRUSTED = [
    "sklearn.metrics._scorer._PassthroughScorer",
    "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
    "sklearn.neural_network._stochastic_optimizers.SGDOptimizer",
    "sklearn.utils._metadata_requests.MetadataRequest",  # of a scorer of scikit-learn 1.6
    "sklearn.utils._metadata_requests.MethodMetadataRequest",
]
#: values written as they are, apart from masked arrays and arrays of objects.
_PLAIN = (str, bytes, bool, int, float, complex, type(None), np.ndarray, np.generic)


def save_model(estimator: Any, path: str | os.PathLike[str], metadata: Mapping[str, str] | None = None) -> None:
    """Write a fitted estimator to a file.

    Parameters
    ----------
    estimator : fitted estimator
        Of this package (or a :class:`~skhybrid.fleet.FleetPrior`), or a Pipeline or a search that contains one.
    path : path-like
        The file to write, in one step.
    metadata : mapping of str to str, optional
        Texts that go with it, for :func:`load_metadata`, such as how its log is read.

    Raises
    ------
    sklearn.exceptions.NotFittedError
        If it is not fitted.
    TypeError
        If it contains an object that cannot be written as data, such as a lambda.
    OSError
        If the file cannot be written.
    """
    if not is_dataclass(estimator):  # a value, such as a FleetPrior, is what it is
        check_is_fitted(estimator)
    io = import_skops()
    try:
        data = _to_data(estimator, type(estimator).__name__)
        if metadata:
            data = {"model": data, "metadata": {str(k): str(v) for k, v in metadata.items()}}
        body = io.dumps(fold(data))
        if not unpacks_too_large(small := deflated(body)):  # load_model refuses what looks like a bomb
            body = small
    except (AttributeError, NotImplementedError, TypeError) as error:
        raise TypeError(f"{type(estimator).__name__} cannot be written as data: {error}") from error
    try:
        _decode(body, path)
    except ModelFileError as error:
        unknown = sorted(set(io.get_untrusted_types(data=body)) - set(_TRUSTED))
        if unknown:
            raise TypeError(
                f"{type(estimator).__name__} contains a {unknown[0]}, which cannot be written as data that is safe to "
                "read; use another regressor (not a tree ensemble)."
            ) from error
        raise TypeError(f"{type(estimator).__name__} cannot be written as data: {error.__cause__}") from error
    version = __version__.encode()
    with atomic_path(path) as made:
        made.write_bytes(b"skhybrid-model version=%s sha256=%s\n%s" % (version, _digest(version, body), body))


def load_model(path: str | os.PathLike[str]) -> Any:
    """Read an estimator written by :func:`save_model`; nothing in the file is executed.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    FileNotFoundError
        If there is no file.
    skhybrid.exceptions.ModelFileError
        If the file is truncated, altered, from another version (major.minor), or not a model file.
    """
    return load_model_and_metadata(path)[0]


def load_metadata(path: str | os.PathLike[str]) -> dict[str, str]:
    """The texts that :func:`save_model` wrote beside an estimator; empty if there were none.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    FileNotFoundError, skhybrid.exceptions.ModelFileError
        As :func:`load_model`.
    """
    return load_model_and_metadata(path)[1]


def load_model_and_metadata(path: str | os.PathLike[str]) -> tuple[Any, dict[str, str]]:
    """Return what :func:`load_model` and :func:`load_metadata` do, from one reading of the file.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    FileNotFoundError, skhybrid.exceptions.ModelFileError
        As :func:`load_model`.
    """
    version, digest, body = _read(path)
    if _digest(version, body) != digest:
        raise ModelFileError(f"{path} was truncated or altered after it was saved; save the model again.")
    if _major_minor(version.decode()) != _major_minor(__version__):
        raise ModelFileError(
            f"{path} was saved by skhybrid {version.decode()}, but this is {__version__}; load it with that version, "
            "or fit again."
        )
    found = _decode(body, path)
    if type(found) is not dict:  # a model alone
        return found, {}
    texts = found.get("metadata")
    if "model" not in found or not isinstance(texts, dict):
        raise ModelFileError(f"{path} holds no model; save the model again.")
    return found["model"], {str(key): str(text) for key, text in texts.items()}


def _read(path: str | os.PathLike[str]) -> tuple[bytes, bytes, bytes]:
    """Version, checksum and archive of a file that begins as a model file does."""
    try:
        found = os.stat(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no model file {path}; check the path.") from None
    if not stat.S_ISREG(found.st_mode):  # a pipe or a device may never end
        raise ModelFileError(f"{path} is not a file; give the path of a model file.")
    with open(path, "rb") as file:
        header = _HEADER.fullmatch(file.readline(200))
        if header is None:
            raise ModelFileError(f"{path} is not a skhybrid model file, or its first line was altered.")
        if found.st_size > MOST_BYTES:
            raise ModelFileError(f"{path} has {found.st_size:,} bytes, and a model file at most {MOST_BYTES:,}.")
        return header[1], header[2], file.read()


def _decode(body: bytes, path: object) -> Any:
    io = import_skops()
    try:
        return _from_data(unfold(io.loads(check_archive(body), trusted=_TRUSTED)))
    except io.exceptions.UntrustedTypesFoundException as error:
        raise ModelFileError(f"{path} contains types that are not allowed in a model file: {error}") from error
    except Exception as error:  # a forged file can let any part of the reading fail
        cause = first_sentence(str(error)) or type(error).__name__
        if isinstance(error, ModuleNotFoundError) and error.name in ("torch", "skorch"):
            cause = f'the neural network in it needs {error.name}; install it with pip install "skhybrid[networks]"'
        raise ModelFileError(f"{path} cannot be read as a model: {cause}.") from error


def _digest(version: bytes, body: bytes) -> bytes:
    return hashlib.sha256(version + b"\n" + body).hexdigest().encode()


def _major_minor(version: str) -> str:
    return ".".join(version.split("+")[0].split(".")[:2])


def _to_data(value: Any, where: str) -> Any:
    """Replace pandas objects and objects of this package by marked dictionaries, at any depth."""
    if isinstance(value, _PLAIN):
        return _array_to_data(value, where)
    for kind, (accepted, encode, _) in PANDAS_KINDS.items():
        if isinstance(value, accepted):
            return {MARK: kind, **{k: _to_data(v, f"{where}.{k}") for k, v in encode(value).items()}}
    if isinstance(value, type):
        own = value.__module__.startswith(_OWN)
        return {MARK: "type", "type": f"{value.__module__}:{value.__qualname__}"} if own else value
    if type(value).__module__.startswith(_OWN):
        return _own_to_data(value, where)
    if isinstance(value, dict):
        pairs = [(_to_data(k, where), _to_data(v, f"{where}[{k!r}]")) for k, v in value.items()]
        if type(value) is dict and all(isinstance(k, str) and k != MARK for k in value):
            return dict(pairs)
        return {MARK: "dict", "pairs": [list(pair) for pair in pairs]}
    if isinstance(value, list | tuple | set | frozenset):
        items = [_to_data(v, f"{where}[{i}]") for i, v in enumerate(value)]
        if type(value) is list:
            return items
        if type(value) not in (tuple, set, frozenset):
            raise TypeError(f"{where} is a {type(value).__qualname__}, which cannot be written as data.")
        return {MARK: "sequence", "kind": type(value).__name__, "items": items}
    if _is_sklearn_object(value):  # skops can write it, once its attributes are data
        made = object.__new__(type(value))
        made.__dict__.update({k: _to_data(v, f"{where}.{k}") for k, v in vars(value).items()})
        return made
    return value  # skops can write it (a random generator, a SciPy matrix), or save_model refuses it


def _array_to_data(value: Any, where: str) -> Any:
    if isinstance(value, np.ma.MaskedArray):  # cv_results_ masks parameters that a candidate does not have
        data = _array_to_data(np.ma.getdata(value), where)
        return {MARK: "masked", "data": data, "mask": np.ma.getmaskarray(value)}
    if isinstance(value, np.ndarray) and value.dtype == object:
        items = [_to_data(v, f"{where}[{i}]") for i, v in enumerate(value.ravel())]
        return {MARK: "objects", "shape": list(value.shape), "items": items}
    packed = pack(value)
    return value if packed is None else {MARK: packed[0], **packed[1]}


def _own_to_data(value: Any, where: str) -> dict[str, Any]:
    cls = type(value)
    if "<locals>" in cls.__qualname__:
        raise TypeError(f"{where} is {value!r}, which cannot be written as data.")
    name = f"{cls.__module__}:{cls.__qualname__}"
    if isinstance(value, tuple):
        return {MARK: "tuple", "type": name, "items": [_to_data(v, f"{where}[{i}]") for i, v in enumerate(value)]}
    state = value.__getstate__()
    if not isinstance(state, dict):
        raise TypeError(f"{where} is a {cls.__qualname__} without plain attributes, which cannot be written as data.")
    return {MARK: "object", "type": name, "state": {k: _to_data(v, f"{where}.{k}") for k, v in state.items()}}


def _is_sklearn_object(value: Any) -> bool:
    """Whether the value is a Python object of scikit-learn: an estimator, a scorer, a splitter."""
    return type(value).__module__.startswith("sklearn.") and hasattr(value, "__dict__")


def _from_data(value: Any) -> Any:
    """Rebuild the objects that :func:`_to_data` replaced."""
    if isinstance(value, dict):
        kind = value.get(MARK)
        return {k: _from_data(v) for k, v in value.items()} if kind is None else _rebuild(kind, value)
    if isinstance(value, list):
        return [_from_data(v) for v in value]
    if _is_sklearn_object(value):
        vars(value).update({k: _from_data(v) for k, v in vars(value).items()})
    return value


def _rebuild(kind: str, value: dict[str, Any]) -> Any:
    parts = {k: _from_data(v) for k, v in value.items() if k != MARK}
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
    cls: Any = _own_class(parts["type"])
    if kind == "type":
        return cls
    if kind == "tuple" and issubclass(cls, tuple) and len(parts["items"]) == len(getattr(cls, "_fields", ())):
        return tuple.__new__(cls, parts["items"])
    if kind == "object" and not issubclass(cls, tuple):
        rebuilt: Any = object.__new__(cls)
        getattr(rebuilt, "__setstate__", vars(rebuilt).update)(parts["state"])
        return rebuilt
    raise ValueError(f"unknown kind {kind!r}")


def _own_class(name: str) -> type:
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
