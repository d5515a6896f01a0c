"""The design matrix (paper 3.2): all disturbance models to compare, as one table and as parameter grids."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import pandas as pd
from sklearn.model_selection import ParameterGrid

from ...forecasting import DisturbanceForecaster
from ...forecasting.cases import NETWORKS, RECURRENT, SIZES, ModelCase, cases_by_name, cases_of, list_sizes
from ...forecasting.named_models import BASELINES, check_parameters

IDENTITY = ("framework", "case", "disturbance", "name")  # columns that identify a candidate; those of its size follow
_DISTURBANCES = ("input", "output")
_NO_SIZE = ("disturbance", "forecaster__model", "forecaster__case")
_SIZE_NAMES = {name for sizes in SIZES.values() for name in sizes}
_SMALL = {"n_layers": 2, "hidden_size": 2}  # number of values in a ``"small"`` matrix; one of every other size


class MatrixBlock(NamedTuple):
    """The candidates of one framework: all combinations of cases, kinds of disturbance and sizes."""

    framework: str  # its name
    model: Any  # as for DisturbanceForecaster
    cases: list[str | ModelCase]  # empty where the framework has none
    disturbance: list[str]
    size: dict[str, list[Any]]  # parameter -> values


class DesignMatrix:
    """The candidates of a search, each a disturbance model.

    Made by :func:`design_matrix`; ``len()`` is the number of candidates.

    Parameters
    ----------
    blocks : sequence of MatrixBlock, one per framework

    Attributes
    ----------
    table : DataFrame
        One row per candidate, in the order of :meth:`candidates`: ``framework``, ``case`` (None where it has none),
        ``disturbance``, ``name`` (the paper's spelling) and one column per size, NaN where it does not apply.

    Examples
    --------
    >>> from skhybrid.model_selection import design_matrix
    >>> matrix = design_matrix(frameworks=["mlp", "ridge"], cases=["case01"], size="small", disturbance="input")
    >>> matrix
    DesignMatrix(5 candidates: mlp input 4, ridge input 1)
    >>> matrix.table["name"].unique().tolist()
    ['DEEP_MLP_FORECAST-case01', 'ridge']
    """

    def __init__(self, blocks: Sequence[MatrixBlock]) -> None:
        self._blocks = tuple(blocks)
        self.table = self._make_table()

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        counts = Counter(zip(self.table["framework"], self.table["disturbance"], strict=True))
        shown = ", ".join(f"{framework} {kind} {n}" for (framework, kind), n in counts.items())
        return f"DesignMatrix({len(self)} candidates: {shown})"

    def param_grid(self, prefix: str = "forecaster__") -> list[dict[str, list[Any]]]:
        """Parameter grids for ``GridSearchCV(estimator, param_grid)``, one per framework.

        Parameters
        ----------
        prefix : str, default ``"forecaster__"``
            Prefix of the forecaster's parameters: the default for :class:`~skhybrid.hybrid.HybridPredictor`;
            ``"hybrid__forecaster__"`` for a step ``hybrid`` of a Pipeline; ``""`` for a forecaster alone.

        Raises
        ------
        ValueError
            If ``prefix`` is another.
        """
        if not isinstance(prefix, str) or (prefix and not prefix.endswith("__")):
            raise ValueError(f"prefix={prefix!r} must end with '__', or be empty for a forecaster alone.")
        outside = None if not prefix else prefix.rstrip("_").rpartition("__")[0]
        grids = []
        for block in self._blocks:
            grid: dict[str, list[Any]] = {f"{prefix}model": [block.model]}
            if outside is not None:
                grid[f"{outside}__disturbance" if outside else "disturbance"] = list(block.disturbance)
            if block.cases:
                grid[f"{prefix}case"] = list(block.cases)
            inside = "" if isinstance(block.model, str) else "model__"
            grid |= {f"{prefix}{inside}{name}": list(values) for name, values in block.size.items()}
            grids.append(grid)
        return grids

    def candidates(self, prefix: str = "forecaster__") -> list[dict[str, Any]]:
        """Parameters of every candidate, in the order of ``table`` and of ``GridSearchCV``.

        With an empty prefix, rows that differ only in their ``disturbance`` are one candidate.

        Parameters
        ----------
        prefix : str, default ``"forecaster__"``
            As in :meth:`param_grid`.
        """
        return list(ParameterGrid(self.param_grid(prefix)))

    def _make_table(self) -> pd.DataFrame:
        rows = []
        for block, grid in zip(self._blocks, self.param_grid(), strict=True):
            for candidate in ParameterGrid(grid):
                case = candidate.get("forecaster__case")
                row = {"framework": block.framework, "case": getattr(case, "name", case)}
                row["disturbance"] = candidate["disturbance"]
                row["name"] = long_name(block.framework, row["case"])
                sizes = {key: value for key, value in candidate.items() if key not in _NO_SIZE}
                rows.append(row | {key.split("__")[-1]: value for key, value in sizes.items()})
        sizes = dict.fromkeys(key for row in rows for key in row if key not in IDENTITY)
        table = pd.DataFrame(rows, columns=[*IDENTITY, *sizes])
        return table.assign(case=table["case"].astype(object).where(table["case"].notna(), None))


def design_matrix(
    frameworks: Sequence[str] | Mapping[str, Any] = NETWORKS,
    cases: Iterable[str | ModelCase] | Mapping[str, Iterable[str | ModelCase]] | None = None,
    disturbance: str | Sequence[str] = _DISTURBANCES,
    size: str | Mapping[str, Any] = "paper",
) -> DesignMatrix:
    """All combinations of framework, case, size and kind of disturbance (paper 3.2).

    The default is the paper's full grid: 756 MLP, 4536 CNN, 612 RNN and 612 LSTM for each kind of disturbance.

    Parameters
    ----------
    frameworks : sequence of str, or mapping of str to model
        Networks (``"mlp"``, ``"cnn"``, ``"rnn"``, ``"lstm"``) and baselines (``"ridge"``, ``"profile"`` ...) by name;
        or a mapping from any name to a ``model`` of :class:`~skhybrid.forecasting.DisturbanceForecaster`, such as
        ``{"mlp": "mlp", "forest": RandomForestRegressor()}``.  Only networks have cases.
    cases : sequence of str or ModelCase, or mapping of framework to such, optional
        Cases; each applies to every framework that has a case of this name.  Default, also for frameworks that a
        mapping leaves out: all of the paper's appendix, 21 for MLP and CNN and 17 for RNN and LSTM.
    disturbance : {"input", "output"} or sequence of them, ID, OD or both
    size : {"paper", "small"} or dict
        ``"paper"``: all of 3.2 (:func:`~skhybrid.forecasting.list_sizes`); ``"small"``: four sizes per case, the first
        two numbers of layers and widths.  A dict is either parameter -> values, for every network, or framework -> such
        a dict; frameworks that it leaves out have the paper's sizes.  Only the CNN has channels, filters and pooling.
        Sizes of a regressor are its own parameters, such as ``{"forest": {"n_estimators": [100, 300]}}``.

    Returns
    -------
    DesignMatrix
        Candidates as parameter grids and as a table.

    Raises
    ------
    ValueError
        If a framework, a case, a kind of disturbance or a size is unknown, a network cannot have a size, two cases that
        differ have one name, or there is no candidate.
    """
    for name, given in (("frameworks", frameworks), ("disturbance", disturbance)):
        if not isinstance(given, Iterable):
            raise ValueError(f"{name}={given!r} must be a name, or a list of names.")
    models = _models(frameworks)
    kinds = [disturbance] if isinstance(disturbance, str) else list(dict.fromkeys(disturbance))
    for kind in kinds:
        if kind not in _DISTURBANCES:
            raise ValueError(f"disturbance={kind!r} is unknown; use 'input', 'output' or both.")
    chosen, sizes = _cases(models, cases), _sizes(models, size)
    own = [case for of_one in chosen.values() for case in of_one if isinstance(case, ModelCase)]
    cases_by_name(own, dict.fromkeys(filter(None, map(_network, models.values()))))
    kept = {name: model for name, model in models.items() if chosen[name] or _network(model) is None}
    blocks = [MatrixBlock(name, model, chosen[name], kinds, sizes[name]) for name, model in kept.items()]
    if not blocks or not kinds:
        raise ValueError("the design matrix is empty; give a framework, one of its cases and a kind of disturbance.")
    return DesignMatrix(blocks)


def long_name(framework: str, case: str | None) -> str:
    """A candidate's name in the paper's spelling ("AR" feeds its own output back), or the caller's own."""
    name = framework
    if framework in NETWORKS:
        name = f"DEEP_{'AR_' if framework in RECURRENT else ''}{framework.upper()}_FORECAST"
    return name if case is None else f"{name}-{case}"


def _network(model: Any) -> str | None:
    """The model if it is a network, else None."""
    return model if isinstance(model, str) and model in NETWORKS else None


def _models(frameworks: Sequence[str] | Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(frameworks, str):
        frameworks = [frameworks]
    if not isinstance(frameworks, Mapping):
        for name in frameworks:
            if not isinstance(name, str):
                raise ValueError(f"framework {name!r} has no name; give a mapping, such as {{'forest': {name!r}}}.")
        frameworks = {name: name for name in frameworks}
    for name, model in frameworks.items():
        known = model in (*NETWORKS, *BASELINES) if isinstance(model, str) else hasattr(model, "fit")
        if not known or isinstance(model, type):
            names = ", ".join((*NETWORKS, *BASELINES))
            what = f"{model!r} is not known" if isinstance(model, str) else f"{name!r} is {model!r}"
            raise ValueError(f"framework {what}; use {names} or a scikit-learn regressor.")
    return dict(frameworks)


def _cases(models: Mapping[str, Any], cases: Any) -> dict[str, list[str | ModelCase]]:
    """Cases by framework; none for models that are not networks."""
    networks = {name: net for name, model in models.items() if (net := _network(model)) is not None}
    found: dict[str, list[str | ModelCase]] = {name: [] for name in models}
    if cases is None:
        return found | {name: list(cases_of(net)) for name, net in networks.items()}
    if isinstance(cases, Mapping):
        for name in cases:
            if name not in networks:
                raise ValueError(f"cases are given for {name!r}, which is not a network among the frameworks.")
        return {name: _cases({name: model}, cases.get(name))[name] for name, model in models.items()}
    if not isinstance(cases, Iterable | ModelCase):
        raise ValueError(f"cases={cases!r} must be a case, or a list of them, such as 'case01'; see list_cases().")
    wanted = [cases] if isinstance(cases, str | ModelCase) else list(dict.fromkeys(cases))
    for case, (name, net) in product(wanted, networks.items()):
        if isinstance(case, ModelCase) or case in cases_of(net):
            found[name].append(case)
    for case in wanted:
        of_networks = (found[name] for name in networks) if networks else map(cases_of, NETWORKS)
        if not any(case in of for of in of_networks) and (networks or not isinstance(case, ModelCase)):
            raise ValueError(f"case {case!r} belongs to none of {', '.join(networks or NETWORKS)}; see list_cases().")
    return found


def _sizes(models: Mapping[str, Any], size: Any) -> dict[str, dict[str, list[Any]]]:
    networks = {name: _network(model) for name, model in models.items()}
    paper: dict[str, dict[str, list[Any]]] = {n: list_sizes(net) if net else {} for n, net in networks.items()}
    if size == "paper":
        return paper
    if size == "small":
        return {name: {key: v[: _SMALL.get(key, 1)] for key, v in sizes.items()} for name, sizes in paper.items()}
    if not isinstance(size, Mapping):
        raise ValueError(f"size={size!r} is neither 'paper', 'small' nor a dict.")
    if all(isinstance(value, Mapping) for value in size.values()):
        for name in size:
            if name not in models:
                raise ValueError(f"size is given for {name!r}, which is not among the frameworks {', '.join(models)}.")
        given = paper | {name: _as_lists(value) for name, value in size.items()}
    else:
        elsewhere = {name: _SIZE_NAMES - set(SIZES[net]) for name, net in networks.items() if net}
        given = {name: {} for name in models}
        given |= {name: _as_lists({k: v for k, v in size.items() if k not in no}) for name, no in elsewhere.items()}
    _check_sizes(models, given)
    return given


def _as_lists(sizes: Mapping[str, Any]) -> dict[str, list[Any]]:
    single = {key for key, values in sizes.items() if isinstance(values, str) or not isinstance(values, Iterable)}
    return {key: [values] if key in single else _distinct(values) for key, values in sizes.items()}


def _distinct(values: Iterable[Any]) -> list[Any]:
    """Each value once: a search would count a copy as a further size."""
    found: list[Any] = []
    for value in values:
        if value not in found:
            found.append(value)
    return found


def _check_sizes(models: Mapping[str, Any], sizes: Mapping[str, Mapping[str, list[Any]]]) -> None:
    for name, model in models.items():
        owner = DisturbanceForecaster() if _network(model) else model
        known = owner.get_params() if hasattr(owner, "get_params") else {}
        for key, values in sizes[name].items():
            if key not in known:
                names = ", ".join(sorted(known)) or "none"
                raise ValueError(f"size {key!r} of {name!r} is not one of its parameters; it has {names}.")
            if not len(values):
                raise ValueError(f"size {key!r} of {name!r} has no values.")
            for value in values if _network(model) else ():
                check_parameters(DisturbanceForecaster(model, **{"residual_of": None, key: value}))
