"""Writing and reading of model files: version, checksum and archive."""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

from sklearn.utils.validation import check_is_fitted

from .. import __version__
from .._arguments import as_mapping
from .._files import atomic_path
from .._warnings import first_sentence
from ..exceptions import ModelFileError
from .archive import MOST_BYTES, check_archive, deflated, unpacks_too_large
from .folding import fold, unfold
from .plain_objects import from_data, to_data
from .skops_import import import_skops

_LONGEST = 200  # characters of a cause: a forged archive can let Python quote all of a file
_HEADER = re.compile(rb"skhybrid-model version=([^ \n]{1,60}) sha256=([0-9a-f]{64})\n")
#: metrics of regressors: a search holds that of its scorer, which is not called when it is read
_METRICS = (
    "d2_absolute_error_score", "explained_variance_score", "max_error", "mean_absolute_error",
    "mean_absolute_percentage_error", "mean_pinball_loss", "mean_squared_error", "mean_squared_log_error",
    "median_absolute_error", "r2_score", "root_mean_squared_error", "root_mean_squared_log_error",
)  # fmt: skip
#: types trusted in addition to those of skops: fitted searches and scikit-learn networks hold them, and they are data.
_TRUSTED = [
    *(f"sklearn.metrics._regression.{name}" for name in _METRICS),
    "sklearn.metrics._scorer._MultimetricScorer",
    "sklearn.metrics._scorer._PassthroughScorer",
    "sklearn.metrics._scorer._Scorer",
    "sklearn.model_selection._split.KFold",
    "sklearn.model_selection._split.TimeSeriesSplit",
    "sklearn.model_selection._split._CVIterableWrapper",
    "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
    "sklearn.neural_network._stochastic_optimizers.SGDOptimizer",
    "sklearn.utils._metadata_requests.MetadataRequest",  # of a scorer of scikit-learn 1.6
    "sklearn.utils._metadata_requests.MethodMetadataRequest",
]


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
    ValueError
        If ``metadata`` is no mapping.
    OSError
        If the file cannot be written.
    """
    if not is_dataclass(estimator):  # a value, such as a FleetPrior, is what it is
        check_is_fitted(estimator)
    texts = {str(k): str(v) for k, v in as_mapping("metadata", metadata, "names to texts").items()}
    io = import_skops()
    try:
        data = to_data(estimator, type(estimator).__name__)
        if texts:
            data = {"model": data, "metadata": texts}
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
            tree = unknown[0].startswith(("sklearn.tree.", "sklearn.ensemble."))
            remedy = "use another regressor (not a tree ensemble)" if tree else "fit with text or numbers in its place"
            raise TypeError(
                f"{type(estimator).__name__} contains a {unknown[0]}, which cannot be written as data that is safe to "
                f"read; {remedy}."
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
    found = _decode(checked_archive(path), path)
    if type(found) is not dict:  # a model alone
        return found, {}
    texts = found.get("metadata")
    if "model" not in found or not isinstance(texts, dict):
        raise ModelFileError(f"{path} holds no model; save the model again.")
    return found["model"], {str(key): str(text) for key, text in texts.items()}


def checked_archive(path: str | os.PathLike[str]) -> bytes:
    """The archive of a file, which must be of this version and as it was saved."""
    version, digest, body = _read(path)
    if _digest(version, body) != digest:
        raise ModelFileError(f"{path} was truncated or altered after it was saved; save the model again.")
    if _major_minor(version.decode()) != _major_minor(__version__):
        raise ModelFileError(
            f"{path} was saved by skhybrid {version.decode()}, but this is {__version__}; load it with that version, "
            "or fit again."
        )
    return body


def _read(path: str | os.PathLike[str]) -> tuple[bytes, bytes, bytes]:
    """Version, checksum and archive of a file that begins as a model file does."""
    try:
        found = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(f"there is no model file {path}; check the path.") from None
    if not stat.S_ISREG(found.st_mode):  # a pipe or a device may never end
        raise ModelFileError(f"{path} is not a file; give the path of a model file.")
    with open(path, "rb") as file:
        header = _HEADER.fullmatch(file.readline(200))
        if header is None:
            raise ModelFileError(f"{path} is not a skhybrid model file, or its first line was altered; save it again.")
        if found.st_size > MOST_BYTES:
            raise ModelFileError(f"{path} has {found.st_size:,} bytes, and a model file at most {MOST_BYTES:,}.")
        return header[1], header[2], file.read()


def _decode(body: bytes, path: object) -> Any:
    io = import_skops()
    try:
        return from_data(unfold(io.loads(check_archive(body), trusted=_TRUSTED)))
    except io.exceptions.UntrustedTypesFoundException as error:
        raise ModelFileError(f"{path} contains types that are not allowed in a model file: {error}") from error
    except Exception as error:  # a forged file can let any part of the reading fail
        cause = first_sentence(str(error))[:_LONGEST] or type(error).__name__
        if isinstance(error, ModuleNotFoundError) and error.name in ("torch", "skorch"):
            cause = f'the neural network in it needs {error.name}; install it with pip install "skhybrid[networks]"'
        raise ModelFileError(f"{path} cannot be read as a model: {cause}.") from error


def _digest(version: bytes, body: bytes) -> bytes:
    return hashlib.sha256(version + b"\n" + body).hexdigest().encode()


def _major_minor(version: str) -> str:
    return ".".join(version.split("+")[0].split(".")[:2])
