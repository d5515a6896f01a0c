"""The model cases of the paper (appendix, tables a1 and a2): the past and the future that a network reads."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

import pandas as pd

from .._arguments import check_integer

#: all features that a case can have
FEATURES = ("zeta", "how", "hod", "dow", "weekday", "T_oa", "q_sol", "i_heat", "i_cool")
TIME_FEATURES = ("how", "hod", "dow", "weekday")
FEED_FORWARD = ("mlp", "cnn")
RECURRENT = ("rnn", "lstm")
NETWORKS = FEED_FORWARD + RECURRENT
_W = ("T_oa", "q_sol")


@dataclass(frozen=True)
class ModelCase:
    """A model case: the length of a network's history, and its features of the past and of the future.

    Parameters
    ----------
    name : str
        Name of the case.
    pattern_days : int
        Length of the history window [d].
    past : tuple of str
        Features of the history window: any of ``zeta``, ``how`` (hour of week), ``hod`` (hour of day), ``dow`` (day of
        week), ``weekday``, ``T_oa``, ``q_sol``, ``i_heat`` and ``i_cool`` (whether heating or cooling runs).
    future : tuple of str
        Features of the rows to forecast; not ``zeta``, the quantity that is forecast.
    """

    name: str
    pattern_days: int
    past: tuple[str, ...]
    future: tuple[str, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name={self.name!r} of a case must be text, by which tables tell it from others.")
        for part in ("past", "future"):
            given = getattr(self, part)
            if isinstance(given, str) or not isinstance(given, Iterable):
                raise ValueError(
                    f"{part}={given!r} of case {self.name!r} must be a sequence of features, such as ('zeta', 'how')."
                )
            object.__setattr__(self, part, tuple(given))
            for feature in getattr(self, part):
                if feature not in FEATURES:
                    raise ValueError(
                        f"{part} of case {self.name!r} has the unknown feature {feature!r}; use {', '.join(FEATURES)}."
                    )
            if twice := [feature for feature, count in Counter(getattr(self, part)).items() if count > 1]:
                raise ValueError(f"{part} of case {self.name!r} has {twice[0]!r} twice; give it once.")
        if "zeta" in self.future:
            raise ValueError(f"future of case {self.name!r} has 'zeta', which is not known ahead; put it in past.")
        if not self.past and not self.future:
            raise ValueError(f"case {self.name!r} has no feature; give past or future at least one.")
        check_integer(f"case {self.name!r}: pattern_days", self.pattern_days)

    @property
    def features(self) -> tuple[str, ...]:
        """All features of the case, in the order of ``FEATURES``."""
        return tuple(f for f in FEATURES if f in self.past or f in self.future)

    @property
    def history(self) -> int:
        """Length of the past that a forecast needs [d]."""
        return self.pattern_days if self.past else 0

    @property
    def ingredients(self) -> dict[str, int]:
        """Regressors of paper 3.3 (Eq. 23): ``time``, ``past-w``, ``future-w`` (0 or 1) and ``pattern`` [d]."""
        return {
            "time": int(any(f in TIME_FEATURES for f in self.features)),
            "pattern": self.pattern_days if "zeta" in self.past else 0,
            "past-w": int(any(f in _W for f in self.past)),
            "future-w": int(any(f in _W for f in self.future)),
        }


_MODES = ("i_heat", "i_cool")


def _numbered(rows: list[tuple[int, tuple[str, ...], tuple[str, ...]]]) -> dict[str, ModelCase]:
    """Cases from ``case01`` on, by the rows (days, past besides zeta, future) of a table of the appendix."""
    cases = [ModelCase(f"case{i:02d}", days, ("zeta", *past), future) for i, (days, past, future) in enumerate(rows, 1)]
    return {case.name: case for case in cases}


#: table a1; ``q_sol,surface`` of its case01 is taken as ``q_sol``, as in the other twenty
FEED_FORWARD_CASES: Mapping[str, ModelCase] = _numbered(
    [
        (1, ("how", *_W), ("how", *_W)),
        (4, (), _W),
        (4, ("how",), ("how", *_W)),
        (4, ("weekday",), ("weekday", *_W)),
        (4, ("how", *_W), ("how", *_W)),
        (4, ("weekday", *_W), ("weekday", *_W)),
        (7, (), _W),
        (7, ("how",), ("how", *_W)),
        (7, ("weekday",), ("weekday", *_W)),
        (7, ("how", *_W), ("how", *_W)),
        (7, ("weekday", *_W), ("weekday", *_W)),
        (4, ("dow", *_W), ("dow", *_W)),
        (7, ("dow", *_W), ("dow", *_W)),
        (4, _W, _W),
        (7, _W, _W),
        (4, ("weekday", *_W, *_MODES), ("dow", *_W)),
        (7, ("weekday", *_W, *_MODES), ("dow", *_W)),
        (4, ("dow", *_W, *_MODES), ("dow", *_W)),
        (7, ("dow", *_W, *_MODES), ("dow", *_W)),
        (4, ("how", *_W, *_MODES), ("dow", *_W)),
        (7, ("how", *_W, *_MODES), ("dow", *_W)),
    ]
)

#: table a2
RECURRENT_CASES: Mapping[str, ModelCase] = _numbered(
    [
        (1, ("how", *_W), ("how", *_W)),
        (1, ("how",), ("how",)),
        (1, _W, _W),
        (1, ("hod", *_W), ("hod", *_W)),
        (1, ("dow", *_W), ("dow", *_W)),
        (1, ("weekday", *_W), ("weekday", *_W)),
        (2, ("how", *_W), ("how", *_W)),
        (4, ("how", *_W), ("how", *_W)),
        (7, ("how", *_W), ("how", *_W)),
        (4, _W, _W),
        (7, _W, _W),
        (2, ("weekday", *_W), ("weekday", *_W)),
        (4, ("weekday", *_W), ("weekday", *_W)),
        (7, ("weekday", *_W), ("weekday", *_W)),
        (2, ("dow", *_W), ("dow", *_W)),
        (4, ("dow", *_W), ("dow", *_W)),
        (7, ("dow", *_W), ("dow", *_W)),
    ]
)

ACTIVATIONS = ("relu", "selu", "gelu")
_RECURRENT_SIZES = {"n_layers": (1, 2, 4), "hidden_size": (10, 20, 40, 60), "activation": ACTIVATIONS}
#: the model sizes of paper 3.2, by parameter of ``DisturbanceForecaster``
SIZES: Mapping[str, Mapping[str, tuple[int | str, ...]]] = {
    "mlp": {"n_layers": (1, 2, 4), "hidden_size": (10, 20, 50, 100), "activation": ACTIVATIONS},
    "cnn": {
        "n_layers": (1, 2),
        "hidden_size": (10, 50, 100),
        "n_channels": (10, 50, 100),
        "filter_size": (6, 12),
        "pool_size": (0, 4),
        "activation": ACTIVATIONS,
    },
    "rnn": _RECURRENT_SIZES,
    "lstm": _RECURRENT_SIZES,
}

#: long names of the paper, such as ``DEEP_AR_LSTM_FORECAST-case01``: framework, then case
_LONG_NAME = re.compile(r"[A-Z0-9_]*?(?:^|_)(MLP|CNN|RNN|LSTM)(?:_[A-Z0-9_]*)?-(case\d+)\Z")


def cases_of(model: str) -> Mapping[str, ModelCase]:
    """The cases of a framework by name: 21 for MLP and CNN, 17 for RNN and LSTM (paper, appendix)."""
    if model not in NETWORKS:
        raise ValueError(f"model={model!r} has no cases; frameworks are {', '.join(NETWORKS)}.")
    return FEED_FORWARD_CASES if model in FEED_FORWARD else RECURRENT_CASES


def resolve_case(case: str | ModelCase, model: str) -> ModelCase:
    """The case named ``"case01"`` or, of its own framework, ``"DEEP_AR_LSTM_FORECAST-case01"``; or a case itself."""
    if isinstance(case, ModelCase):
        return case
    known = cases_of(model)
    name = str(case)
    long_name = _LONG_NAME.match(name)
    if long_name and long_name[1].lower() == model:
        name = long_name[2]
    if name not in known:
        raise ValueError(
            f"case={case!r} is not known for model={model!r}; use {', '.join(known)}, a long name such as "
            f"'DEEP_AR_{model.upper()}_FORECAST-case01', or a ModelCase."
        )
    return known[name]


def cases_by_name(cases: Iterable[ModelCase], models: Iterable[str] = ()) -> dict[str, ModelCase]:
    """Cases of one's own by name; refused where one differs from another, or from a case of ``models``, of its name."""
    of_models = {model: cases_of(model) for model in models}
    named: dict[str, ModelCase] = {}
    for case in cases:
        if not isinstance(case, ModelCase):
            raise ValueError(f"cases= has {case!r}; give cases of your own, as ModelCase; the paper's are known.")
        others = {"another of your cases": named} | {f"a case of the paper for {m}": of for m, of in of_models.items()}
        for whose, known in others.items():
            if known.get(case.name, case) != case:
                raise ValueError(f"case {case.name!r} has the name of {whose}, but not its content; rename it.")
        named[case.name] = case
    return named


def list_cases(model: str | None = None) -> pd.DataFrame:
    """Model cases of the paper's appendix, one per row: ``model``, ``name``, ``pattern_days``, ``past``, ``future``.

    Parameters
    ----------
    model : {"mlp", "cnn", "rnn", "lstm"}, optional
        Default: all four.

    Raises
    ------
    ValueError
        If there is no such model.
    """
    names = NETWORKS if model is None else (model,)
    columns = [field.name for field in fields(ModelCase)]
    rows = [(m, *(getattr(case, c) for c in columns)) for m in names for case in cases_of(m).values()]
    return pd.DataFrame(rows, columns=["model", *columns])


def list_sizes(model: str) -> dict[str, list[int | str]]:
    """The model sizes of the paper (3.2): lists of values by parameter of :class:`DisturbanceForecaster`.

    Parameters
    ----------
    model : {"mlp", "cnn", "rnn", "lstm"}

    Raises
    ------
    ValueError
        If there is no such model.
    """
    cases_of(model)
    return {name: list(values) for name, values in SIZES[model].items()}
