"""Candidates per minute: our search and scikit-learn's ``GridSearchCV`` over a plain skorch net, on the same cores.

Writes ``results/search_speed.md`` (a quarter of an hour on two cores):
``python benchmarks/search_speed.py``.  With ``gpu``, where torch finds a GPU, it writes ``results/search_speed_gpu.md``
(five minutes).
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import psutil
import torch
from _network_speed import PlainNetwork
from _report import write_table
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.model_selection import GridSearchCV, ParameterGrid
from sklearn.pipeline import Pipeline
from skorch import NeuralNetRegressor
from skorch.callbacks import EarlyStopping

from skhybrid.datasets import make_office
from skhybrid.forecasting import DisturbanceForecaster, list_sizes
from skhybrid.forecasting.cases import resolve_case
from skhybrid.forecasting.networks.spec import NetworkSpec
from skhybrid.forecasting.networks.windows import window_columns
from skhybrid.forecasting.reading import read_case_inputs
from skhybrid.forecasting.training_job import chronological_split
from skhybrid.model_selection import DesignMatrixSearchCV, design_matrix

COMMAND = "python benchmarks/search_speed.py"


class Block(NamedTuple):
    """Every size of paper 3.2 for each case, each with networks of several seeds."""

    model: str
    cases: tuple[str, ...]
    n_epochs: int
    n_repeats: int = 1


class Machine(NamedTuple):
    """The device of a search, and its processes and chunks there."""

    device: str = "cpu"
    n_jobs: int = 2
    chunk_size: int = 12


BLOCKS = {b.model: b for b in (Block("mlp", ("case01", "case12"), 20), Block("lstm", ("case01", "case03"), 4))}
#: The paper trains ten networks of each size.
GPU_BLOCKS = [
    Block("mlp", ("case01", "case12"), 100, 10),
    Block("lstm", ("case01", "case02", "case03", "case04"), 10, 10),
]
#: Of the networks of a block on a GPU, GridSearchCV trains one in so many.
EVERY = 70
N_DAYS, N_LEADS, PATIENCE, N_ROUNDS = 28, 24, 150, 5
TRAINING = {"learning_rate": 0.003, "batch_size": 128, "validation_fraction": 0.2}


def hourly_office() -> tuple[pd.DataFrame, pd.Series]:
    """Four weeks of the paper's office by the hour, with its true heat gain as the disturbance."""
    office = make_office(n_days=N_DAYS, random_state=0)
    X = office.X[["T_oa", "q_sol"]].resample("1h").mean()
    zeta = office.heat_gain.resample("1h").mean().rename("zeta")
    return X.assign(zeta=zeta), zeta


# --------------------------------------------------------------------------------------------------------------- plain
class CaseWindows(TransformerMixin, BaseEstimator):
    """The windows of a case, each as one flat row; a Pipeline computes them again for every candidate."""

    def __init__(self, model: str = "mlp", case: str = "case01") -> None:
        self.model = model
        self.case = case

    def fit(self, X: Any, y: Any = None) -> CaseWindows:
        """Keep the number of rows; the net's own split says which of them train."""
        self.n_rows_ = len(X)
        return self

    def transform(self, X: Any) -> np.ndarray:
        """(n_windows, zeta, past columns, future columns), z-scores."""
        reader = DisturbanceForecaster(self.model, self.case)
        reader.case_ = resolve_case(self.case, self.model)
        past, future = (
            _z_scores(c)
            for c in window_columns(read_case_inputs(reader, X, reset=True), reader.case_, self.model, "cyclic")
        )
        n_past = 24 * reader.case_.pattern_days
        zeta = _z_scores(X["zeta"].to_numpy())
        parts = [
            _windows(zeta[:, None], n_past, 1, n_past + 1),
            _windows(past, n_past - 1, 0, n_past),
            _windows(future, 0, N_LEADS, N_LEADS)[1:],
        ]
        return np.hstack([part[: len(X)].reshape(len(X), -1) for part in parts]).astype(np.float32)


def _z_scores(columns: np.ndarray) -> np.ndarray:
    return (columns - columns.mean(axis=0)) / np.maximum(columns.std(axis=0), 1e-9)


def _windows(values: np.ndarray, before: int, after: int, width: int) -> np.ndarray:
    padded = np.pad(values, [(before, after), (0, 0)])
    return np.lib.stride_tricks.sliding_window_view(padded, width, axis=0)


class FlatNetwork(PlainNetwork):
    """The network of torch.nn layers, which cuts its inputs out of a flat row."""

    def __init__(self, model: str, case: str, n_columns: int, n_layers: int, hidden_size: int, activation: str) -> None:
        n_past = 24 * resolve_case(case, model).pattern_days
        super().__init__(
            NetworkSpec(
                model, n_past, N_LEADS, n_columns, n_columns, True, n_layers, hidden_size, activation, 0.1, 0, 0, 0
            )
        )
        self.n_past, self.n_columns = n_past, n_columns

    def forward(self, rows: torch.Tensor) -> torch.Tensor:  # type: ignore[override]
        """Forecast (n_windows, n_leads)."""
        sizes = [self.n_past + 1, self.n_columns * self.n_past, self.n_columns * N_LEADS]
        zeta, past, future = rows.split(sizes, dim=1)
        shape = (len(rows), self.n_columns, -1)
        return super().forward(zeta, past.reshape(shape), future.reshape(shape))


def _halves(dataset: Any, y: Any = None) -> tuple[Any, Any]:
    """The windows that train and those that say when to stop, as ``DisturbanceForecaster`` cuts them."""
    split = chronological_split(len(dataset), N_LEADS, TRAINING["validation_fraction"], 24)
    train, valid = np.arange(23, split.train_end - N_LEADS), np.arange(split.valid_start - 1, len(dataset) - N_LEADS)
    return torch.utils.data.Subset(dataset, train), torch.utils.data.Subset(dataset, valid)


def plain_search(block: Block, X: pd.DataFrame, y: pd.Series, machine: Machine, every: int = 1) -> int:
    """``GridSearchCV`` over a Pipeline of windows and a skorch net; the number of its candidates, one in ``every``."""
    model = block.model
    net = NeuralNetRegressor(
        FlatNetwork,
        module__model=model,
        optimizer=torch.optim.Adam,
        lr=TRAINING["learning_rate"],
        batch_size=TRAINING["batch_size"],
        max_epochs=block.n_epochs,
        train_split=_halves,
        iterator_train__shuffle=True,
        callbacks=[EarlyStopping(patience=PATIENCE, load_best=True)],
        device=machine.device,
        verbose=0,
    )
    pipeline = Pipeline([("windows", CaseWindows(model)), ("net", net)])
    grid = []
    for case in block.cases:
        reader = DisturbanceForecaster(model, case)
        reader.case_ = resolve_case(case, model)
        n_columns = window_columns(read_case_inputs(reader, X, reset=True), reader.case_, model, "cyclic")[0].shape[1]
        fixed = {"windows__case": [case], "net__module__case": [case], "net__module__n_columns": [n_columns]}
        grid.append(fixed | {f"net__module__{name}": values for name, values in list_sizes(model).items()})
    chosen = [params for params in ParameterGrid(grid) for _ in range(block.n_repeats)][every // 2 :: every]
    targets = _windows(_z_scores(y.to_numpy())[:, None], 0, N_LEADS, N_LEADS)[1:, 0].astype(np.float32)
    rows = np.arange(len(X))
    search = GridSearchCV(
        pipeline,
        [{name: [value] for name, value in params.items()} for params in chosen],
        cv=[(rows, rows)],
        scoring="neg_mean_squared_error",
        n_jobs=machine.n_jobs,
        refit=False,
        error_score="raise",
    )
    search.fit(X, targets)
    return len(search.cv_results_["params"])


# ---------------------------------------------------------------------------------------------------------------- ours
def design_search(block: Block, X: pd.DataFrame, y: pd.Series, machine: Machine) -> int:
    """``DesignMatrixSearchCV``; the number of networks that it trained."""
    settings = {"max_epochs": block.n_epochs, "patience": PATIENCE, "residual_of": None, "random_state": 0}
    repeats = {"n_repeats": block.n_repeats, "repeats": "mean", "device": machine.device}
    rows = np.arange(len(X))
    search = DesignMatrixSearchCV(
        DisturbanceForecaster(block.model, **settings | TRAINING | repeats),
        design_matrix([block.model], list(block.cases), disturbance="input"),
        cv=[(rows, rows)],
        n_jobs=machine.n_jobs,
        chunk_size=machine.chunk_size,
        refit=False,
        error_score="raise",
        verbose=0,
    )
    search.fit(X, y)
    return len(search.results_) * block.n_repeats


# ------------------------------------------------------------------------------------------------------------- measure
def _processor_time() -> float:
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    return sum(sum(process.cpu_times()[:2]) for process in processes)


SEARCHES: dict[str, Callable[..., int]] = {"plain": plain_search, "ours": design_search}


def _timed(search: Callable[..., int], block: Block, X: pd.DataFrame, y: pd.Series) -> tuple[int, float, float]:
    begin, used = time.perf_counter(), _processor_time()
    n = search(block, X, y, Machine())
    return n, time.perf_counter() - begin, _processor_time() - used


def serve(name: str, model: str) -> None:
    """Run a search, in the same worker processes, for every line read; print its candidates and its two times."""
    search, (X, y), block = SEARCHES[name], hourly_office(), BLOCKS[model]
    search(block._replace(cases=block.cases[:1], n_epochs=1), X, y, Machine())  # imports and warm processes
    print("ready", flush=True)
    for _ in sys.stdin:
        print(*_timed(search, block, X, y), flush=True)


def measure(model: str, n_rounds: int = N_ROUNDS) -> dict[str, Any]:
    """A row of the table: both searches take turns, each with its own worker processes, after a first round."""
    servers = {}
    for name in SEARCHES:
        command = [sys.executable, __file__, "--serve", name, model]
        servers[name] = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        assert servers[name].stdout.readline() == "ready\n", f"{name} ended early"
    times = {name: np.empty((n_rounds, 3)) for name in SEARCHES}
    for i in range(n_rounds):
        for name, server in servers.items():
            server.stdin.write("go\n")
            times[name][i] = [float(value) for value in server.stdout.readline().split()]
            print(model, name, times[name][i], flush=True)
    for server in servers.values():
        server.communicate()
    count, wall, cpu = ({name: values[:, k] for name, values in times.items()} for k in range(3))
    n = int(count["ours"][0])
    assert (count["plain"] == n).all()
    return {
        "candidates": n,
        "epochs": BLOCKS[model].n_epochs,
        "GridSearchCV [candidates/min]": 60.0 * n / float(np.median(wall["plain"])),
        "DesignMatrixSearchCV [candidates/min]": 60.0 * n / float(np.median(wall["ours"])),
        "ratio": _spread(wall["plain"], wall["ours"]),
        "ratio of processor time": _spread(cpu["plain"], cpu["ours"]),
    }


def _spread(above: np.ndarray, below: np.ndarray) -> str:
    ratios = above / below
    return f"{np.median(ratios):.1f} ({ratios.min():.1f}-{ratios.max():.1f})"


def measure_gpu(block: Block) -> dict[str, Any]:
    """A row of the table of a GPU: networks per minute of both searches there and on all cores."""
    X, y = hourly_office()
    gpu, cores = Machine("cuda", 1, 256), Machine("cpu", os.cpu_count() or 1)
    counts: dict[str, int] = {}
    rates: dict[str, float] = {}
    for name, search, machine, settings in (
        ("ours, GPU", design_search, gpu, {}),
        ("skorch, GPU", plain_search, gpu, {"every": EVERY}),
        ("skorch, all cores", plain_search, cores, {"every": EVERY // 4}),
    ):
        search(block._replace(cases=block.cases[:1], n_epochs=1), X, y, machine, **settings)  # imports, processes
        begin = time.perf_counter()
        counts[name] = search(block, X, y, machine, **settings)
        rates[name] = 60.0 * counts[name] / (time.perf_counter() - begin)
        print(block.model, name, counts[name], rates[name], flush=True)
    ours, *others = rates
    ratios = {f"ours / {name}": rates[ours] / rates[name] for name in others}
    return {"networks": counts[ours], "epochs": block.n_epochs} | rates | ratios


def main_gpu() -> None:
    """Measure on a GPU and write the table."""
    rows = {block.model: measure_gpu(block) for block in GPU_BLOCKS}
    chosen = "; ".join(f"{block.model} {', '.join(block.cases)}" for block in GPU_BLOCKS)
    write_table(
        "search_speed_gpu",
        "Networks of the design matrix per minute, on a GPU",
        f"{COMMAND} gpu",
        {"Networks per minute, and ratios": pd.DataFrame(rows).T.rename_axis("framework")},
        f"{torch.cuda.get_device_name()}, torch {torch.__version__}.  make_office, {N_DAYS} days by the hour.  Every "
        f"size of paper 3.2 (36) with ten seeds for {chosen}.  *Ours* and *skorch*: DesignMatrixSearchCV and "
        "GridSearchCV, as in search_speed.md.  On the GPU both run in one process; on all cores, GridSearchCV runs in "
        "a process per core.  Times include scoring.  "
        f"GridSearchCV trains one in {EVERY} of the networks, one in {EVERY // 4} on all cores, evenly over the block, "
        "and its rate is that of those.",
    )


def main() -> None:
    """Measure both frameworks and write the table."""
    rows = {model: measure(model) for model in BLOCKS}
    chosen = "; ".join(f"{model} {' and '.join(block.cases)}" for model, block in BLOCKS.items())
    write_table(
        "search_speed",
        "Candidates of the design matrix per minute",
        COMMAND,
        {"Blocks": pd.DataFrame(rows).T.rename_axis("framework")},
        f"make_office, {N_DAYS} days by the hour.  Every size of paper 3.2 (36) for {chosen}.  Both search in two "
        f"worker processes of one thread each, on batches of {TRAINING['batch_size']}, with the same validation block "
        f"and early stopping (patience {PATIENCE}, not reached in so few epochs), and score every candidate once.  "
        f"GridSearchCV: Pipeline of windows and NeuralNetRegressor (torch's own layers, default DataLoader).  "
        f"{N_ROUNDS} rounds in which they take turns: the median ratio of a round, then the lowest and the highest.  "
        "The load of the machine at the end: {:.1f} {:.1f} {:.1f}.  search_speed_gpu.md has a GPU.".format(
            *os.getloadavg()
        ),
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(*sys.argv[2:])
    else:
        main_gpu() if sys.argv[1:] == ["gpu"] else main()
