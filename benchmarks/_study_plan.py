"""Plan of the study of the paper's design matrix: data, estimator, sizes in levels, and the order of work."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from skhybrid import DisturbanceForecaster, HybridPredictor, OutputDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.forecasting.cases import NETWORKS, cases_of
from skhybrid.model_selection import DesignMatrix
from skhybrid.model_selection.search.candidates import candidate_id
from skhybrid.model_selection.search.design_matrix import MatrixBlock

CLIMATES = {"oakland": "2023-07-08", "chicago": "2023-07-08"}
KINDS = ("input", "output")
TRAIN_DAYS, TEST_DAYS, ROWS_PER_DAY = 28, 182, 96
#: baselines that the two-stage scheme takes in place of a network; the others are in ``_study_baselines.py``
BASELINES = ("ridge", "profile", "last_week", "persistence")
#: sizes that a level adds to every case; levels after the last of a framework add nothing to it.
A_LEVEL = 3
#: candidates per task of a worker: as many as are trained as one stack, and few enough that a stop loses little
CHUNK = {"mlp": 3, "cnn": 1, "rnn": 6, "lstm": 6, "baselines": 8}

_DENSE = ("n_layers", "hidden_size", "activation")
_CONVOLUTION = ("n_layers", "hidden_size", "filter_size", "activation")


def _named(names: tuple[str, ...], rows: list[tuple[Any, ...]], **fixed: int) -> list[dict[str, Any]]:
    return [dict(zip(names, row, strict=True)) | fixed for row in rows]


#: The sizes of each framework, three per level.  MLP: a Graeco-Latin square of layers, activation, level and width (10
#: thrice, the other three widths twice), so that every level has each depth and each activation once.  RNN and LSTM:
#: the same of two levels, widths 10 and 20 twice, 40 and 60 once.  CNN: all pairs of layers and width, activations in
#: turn; of channels and pooling only the cheapest (10 channels, pools of 4).
SIZES: dict[str, list[dict[str, Any]]] = {
    "mlp": _named(
        _DENSE,
        [
            *((1, 10, "relu"), (2, 50, "selu"), (4, 20, "gelu")),
            *((1, 50, "selu"), (2, 10, "gelu"), (4, 100, "relu")),
            *((1, 100, "gelu"), (2, 20, "relu"), (4, 10, "selu")),
        ],
    ),
    "rnn": _named(
        _DENSE,
        [
            *((1, 40, "relu"), (2, 20, "selu"), (4, 10, "gelu")),
            *((1, 10, "gelu"), (2, 60, "relu"), (4, 20, "selu")),
        ],
    ),
    "cnn": _named(
        _CONVOLUTION,
        [
            *((1, 10, 6, "relu"), (2, 50, 6, "selu"), (1, 100, 12, "gelu")),
            *((2, 10, 12, "gelu"), (1, 50, 12, "relu"), (2, 100, 6, "selu")),
        ],
        n_channels=10,
        pool_size=4,
    ),
}
SIZES["lstm"] = SIZES["rnn"]
#: the cheap ones first, so that a stop leaves out what costs most
ORDER = ("mlp", "rnn", "lstm", "cnn")


class Unit(NamedTuple):
    """One search: all cases of a framework in one size, or the baselines."""

    level: int
    framework: str
    size: int  # its number in SIZES, from 0
    disturbance: str
    climate: str

    def __str__(self) -> str:
        size = "" if self.framework == "baselines" else f" size {self.size + 1}"
        return f"level {self.level} {self.framework}{size} {self.disturbance} {self.climate}"

    def matrix(self) -> DesignMatrix:
        """Its candidates."""
        if self.framework == "baselines":
            return DesignMatrix([MatrixBlock(name, name, [], [self.disturbance], {}) for name in BASELINES])
        size = {name: [value] for name, value in SIZES[self.framework][self.size].items()}
        cases = list(cases_of(self.framework))
        return DesignMatrix([MatrixBlock(self.framework, self.framework, cases, [self.disturbance], size)])


def units(
    levels: Iterable[int] = (1, 2, 3),
    climates: Iterable[str] = tuple(CLIMATES),
    frameworks: Iterable[str] = ORDER,
    by_size: bool = False,
) -> Iterator[Unit]:
    """All searches in the order in which they are run, disturbances and climates in turn.

    A level has all sizes of one framework, then those of the next; ``by_size``: the first size of all frameworks, then
    the second.
    """
    climates, frameworks = list(climates), list(frameworks)
    for kind in KINDS:
        yield from (Unit(0, "baselines", 0, kind, climate) for climate in climates)
    for level in sorted(set(levels)):
        for framework, size in _turns(level, frameworks, by_size):
            for kind in KINDS:
                yield from (Unit(level, framework, size, kind, climate) for climate in climates)


def _turns(level: int, frameworks: list[str], by_size: bool) -> list[tuple[str, int]]:
    """Frameworks and sizes of a level in the order in which they are run."""
    first = A_LEVEL * (level - 1)
    found = [(name, size) for name in frameworks for size in range(len(SIZES[name]))[first : first + A_LEVEL]]
    return sorted(found, key=lambda one: one[1]) if by_size else found


class Split(NamedTuple):
    """A climate's data."""

    X: pd.DataFrame
    y: pd.Series

    @property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the training, and of the test after it."""
        cut = TRAIN_DAYS * ROWS_PER_DAY
        return np.arange(cut), np.arange(cut, len(self.X))

    @property
    def train(self) -> tuple[pd.DataFrame, pd.Series]:
        """The first four weeks."""
        cut = len(self.rows[0])
        return self.X.iloc[:cut], self.y.iloc[:cut]

    @property
    def test(self) -> tuple[pd.DataFrame, pd.Series]:
        """The half year after them."""
        cut = len(self.rows[0])
        return self.X.iloc[cut:], self.y.iloc[cut:]


def load(climate: str) -> Split:
    """The paper's office: four weeks from the 8th of July, and the 26 weeks after them."""
    days = TRAIN_DAYS + TEST_DAYS
    office = make_office(n_days=days, climate=climate, start=CLIMATES[climate], random_state=2024)
    return Split(office.X, office.y)


def gray_box() -> OutputDisturbanceID:
    """The paper's identification; its horizon is what ``predict`` of the gray box alone looks ahead."""
    return OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=12, horizon="1D", random_state=0)


def estimator(**changes: Any) -> HybridPredictor:
    """The estimator that takes the candidates; ``changes`` of the network's training are for trials."""
    forecaster = DisturbanceForecaster.published("lstm", n_repeats=1, random_state=0, **changes)
    return HybridPredictor(gray_box(), forecaster, adapt=None, random_state=0)


def planned(levels: Iterable[int] = (1, 2, 3)) -> pd.DataFrame:
    """Every candidate of the plan: ``climate``, ``level``, the columns of a design matrix, and ``id`` in the store."""
    parts = []
    for unit in units(levels):
        matrix = unit.matrix()
        ids = [candidate_id(params) for params in matrix.candidates()]
        parts.append(matrix.table.assign(climate=unit.climate, level=unit.level, id=ids))
    return pd.concat(parts, ignore_index=True)


assert set(ORDER) == set(NETWORKS) == set(SIZES)
