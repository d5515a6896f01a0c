"""Settings as text that is the same in every process, and their comparison with those of a store."""

from __future__ import annotations

import hashlib
import inspect
import sysconfig
from collections.abc import Mapping
from functools import partial
from types import CodeType, FunctionType
from typing import Any

import joblib
import numpy as np
import pandas as pd

from .._warnings import warn_user
from ..exceptions import SkhybridWarning

VERSION = "version of "  # settings whose names begin with this may differ, with a warning
WITHOUT_EFFECT = ("n_jobs", "verbose", "memory")  # parameters that change no result, at any depth
_INSTALLED = tuple({sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")})


def as_plain(value: Any) -> str:
    """The value of a parameter as text, the same for equal values in every process; a strange one must pickle."""
    if is_estimator(value):
        params = sorted(value.get_params(deep=False).items())
        inside = ", ".join(f"{name}={as_plain(one)}" for name, one in params if name not in WITHOUT_EFFECT)
        return f"{name_of(type(value))}({inside})"
    if isinstance(value, Mapping):  # equal whatever their order
        return "{" + ", ".join(sorted(f"{as_plain(k)}: {as_plain(v)}" for k, v in value.items())) + "}"
    if isinstance(value, set | frozenset):  # its order differs between processes
        return "{" + ", ".join(sorted(map(as_plain, value))) + "}"
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return "[" + ", ".join(map(as_plain, value)) + "]"
    if isinstance(value, np.generic):
        return repr(value.item())
    if _may_change(value):
        return f"{name_of(value)} {hashlib.sha256(_code_of(value).encode()).hexdigest()[:16]}"
    if inspect.isroutine(value) or inspect.isclass(value):
        return name_of(value)
    if isinstance(value, partial):
        return f"{name_of(type(value))} {as_plain([value.func, value.args, value.keywords])}"
    if _may_change(getattr(value, "_score_func", None)):  # of a scorer of scikit-learn
        return f"{name_of(type(value))} {as_plain(vars(value))}"
    text = repr(value)
    if isinstance(value, np.ndarray | pd.DataFrame | pd.Series | pd.Index) or " at 0x" in text or "..." in text:
        return f"{name_of(type(value))} {joblib.hash(value)}"  # its text is cut short, or differs between processes
    return text


def is_estimator(value: Any) -> bool:
    """Whether a value is an estimator, not the class of one."""
    return hasattr(value, "get_params") and not inspect.isclass(value)


def name_of(thing: Any) -> str:
    """Module and qualified name of a class or function."""
    return f"{getattr(thing, '__module__', '')}.{getattr(thing, '__qualname__', thing)}"


def _may_change(value: Any) -> bool:
    """Whether a value is a function whose name does not tell what it does: of no installed package, or without one."""
    if not inspect.isfunction(value):
        return False
    path, package = inspect.unwrap(value).__code__.co_filename, str(value.__module__).split(".")[0]
    installed = path.startswith(("<frozen ", *_INSTALLED)) or package == __name__.split(".")[0]
    return "<" in value.__qualname__ or not installed


def _code_of(function: FunctionType) -> str:
    """Text of the code of a function, of its defaults, and of the values that it was made with."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    made_with = ["itself" if one is function else one for one in cells]
    return as_plain([_instructions(function.__code__), function.__defaults__, function.__kwdefaults__, made_with])


def _instructions(code: CodeType) -> list[Any]:
    constants = [_instructions(one) if isinstance(one, CodeType) else one for one in code.co_consts]
    return [code.co_code, code.co_names, constants]


def check_settings(path: str, known: Mapping[str, str], given: Mapping[str, str]) -> None:
    """Refuse a store that was made with other data or settings, and name them; warn of one made by other versions."""
    names = [name for name in {**known, **given} if known.get(name) != given.get(name)] if known else []
    shown = {n: f"{n} is {known.get(n, 'absent')} there and {given.get(n, 'absent')} here" for n in names}
    versions = [shown.pop(name) for name in names if name.startswith(VERSION)]
    if shown:
        more = f" and {len(shown) - 5} more" if len(shown) > 5 else ""
        raise ValueError(
            f"store {path} was made with other data or settings: {'; '.join(list(shown.values())[:5])}{more}; give "
            "another store, or the same data and settings, or remove this store to begin anew."
        )
    if versions:
        warn_user(f"part of store {path} comes from other versions: {'; '.join(versions)}.", SkhybridWarning)
