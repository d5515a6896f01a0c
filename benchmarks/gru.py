"""A GRU encoder-decoder against the default and multi-step ARX, on development logs: does it earn a row of the bench?

Writes ``results/gru.md`` (ten minutes on two cores):
``python benchmarks/gru.py --buildings FOLDER/dev``, where ``make_buildings.py`` has written its development logs.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
import torch
from _forecast_data import BEAM_AND_SKY, DataSet, chosen, data_sets
from _forecast_models import HYBRID, MODELS
from _report import spread, write_table
from joblib import Parallel, delayed
from sklearn.base import BaseEstimator, RegressorMixin
from skorch import NeuralNetRegressor
from skorch.callbacks import EarlyStopping
from skorch.dataset import Dataset
from skorch.helper import predefined_split

from skhybrid.model_selection import backtest

LOGS = (
    "dev: apartment_newark winter, new control",
    "dev: medium_office_san_francisco autumn, new control",
    "dev: retail_colorado_springs winter, same control",
    "dev: small_office_2019_fresno autumn, new control",
)
BASELINES = {"default": HYBRID, "multi-step ARX": "ARX, multi-step", "re-fitted": "ARX, multi-step, re-fitted"}
N_SEEDS, N_LEADS = 3, 96
#: rows of history, rows between origins that train, share of the origins (the last) that stop the training
N_PAST, STRIDE, VALIDATION = 96, 4, 0.2


class EncoderDecoder(torch.nn.Module):
    """A GRU over the past day, and one over the day ahead that begins in its state: changes from the origin on."""

    def __init__(self, n_inputs: int, hidden_size: int = 48) -> None:
        super().__init__()
        self.encoder = torch.nn.GRU(n_inputs + 1, hidden_size, batch_first=True)
        self.decoder = torch.nn.GRU(n_inputs, hidden_size, batch_first=True)
        self.out = torch.nn.Linear(hidden_size, 1)

    def forward(self, past: torch.Tensor, ahead: torch.Tensor) -> torch.Tensor:
        """(n_windows, n_leads) from (n_windows, N_PAST, n_inputs + 1) and (n_windows, n_leads, n_inputs)."""
        return self.out(self.decoder(ahead, self.encoder(past)[1])[0])[..., 0]


class GRUForecaster(RegressorMixin, BaseEstimator):
    """Temperature of the next day by an encoder-decoder fitted on errors at all leads."""

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed

    def fit(self, X: pd.DataFrame, y: Any) -> Self:
        """Learn from all origins of the training rows; the last fifth of them says when to stop."""
        self.names_ = [name for name in X if name not in ("T_za", *BEAM_AND_SKY)]
        values = X[[*self.names_, "T_za"]]
        self.mean_, self.std_ = values.mean(), values.std().clip(lower=1e-6)
        self.past_ = X.iloc[-2 * N_PAST :]
        origins = np.arange(N_PAST, len(X) - N_LEADS, STRIDE)
        n_train = round((1.0 - VALIDATION) * len(origins))
        T = X["T_za"].to_numpy()
        target = (T[origins[:, None] + np.arange(1, N_LEADS + 1)] - T[origins, None]) / self.std_["T_za"]
        split = np.split(np.arange(len(origins)), [n_train])
        split[0] = split[0][origins[split[0]] + N_LEADS < origins[n_train]]  # no target of training in validation
        train, valid = (Dataset(self._windows(X, origins[k]), target[k].astype(np.float32)) for k in split)
        torch.manual_seed(self.seed)
        self.net_ = NeuralNetRegressor(
            EncoderDecoder,
            module__n_inputs=len(self.names_) + 13,
            optimizer=torch.optim.Adam,
            lr=0.003,
            batch_size=64,
            max_epochs=40,
            iterator_train__shuffle=True,
            train_split=predefined_split(valid),
            callbacks=[EarlyStopping(patience=6, load_best=True)],
            verbose=0,
        ).fit(train, y=None)
        return self

    def predict_from(self, X: pd.DataFrame, origins: np.ndarray, horizon: Any = "1D") -> np.ndarray:
        """Forecast one day from each origin, after the rows that trained."""
        joined = pd.concat([self.past_, X])
        rows = np.asarray(origins) + len(self.past_)
        change = self.net_.predict(self._windows(joined, rows)) * self.std_["T_za"]
        return change.astype(np.float64) + joined["T_za"].to_numpy()[rows, None]

    def _windows(self, X: pd.DataFrame, origins: np.ndarray) -> dict[str, np.ndarray]:
        """z-scores and calendar; the input of a row acts until the next, so that of the origin is the first ahead."""
        known = ((X[self.names_] - self.mean_[self.names_]) / self.std_[self.names_]).to_numpy()
        hour = (X.index.hour + X.index.minute / 60).to_numpy()[:, None] * 2 * np.pi / 24 * np.arange(1, 4)
        days = np.eye(7)[X.index.day_of_week]
        known = np.hstack([known, np.sin(hour), np.cos(hour), days])
        T = ((X["T_za"] - self.mean_["T_za"]) / self.std_["T_za"]).to_numpy()[:, None]
        before = origins[:, None] + np.arange(-N_PAST + 1, 1)
        past = np.concatenate([T[before], known[before - 1]], axis=2)
        return {
            "past": past.astype(np.float32),
            "ahead": known[origins[:, None] + np.arange(N_LEADS)].astype(np.float32),
        }


def error_of(model: Any, data: DataSet) -> float:
    """Root-mean-square error over all leads [K] at the origins of the benchmark."""
    later = data.later.drop(columns=[name for name in BEAM_AND_SKY if name in data.later])
    frame = backtest(model, later, later["T_za"], origin_step=data.origin_step, start=data.start)
    return float(np.sqrt(((frame["y_pred"] - frame["y_true"]) ** 2).mean()))


def run(name: str, buildings: list[Path], what: str | int) -> tuple[str, str | int, float]:
    """The error of a baseline, or of the GRU of a seed, on a log."""
    torch.set_num_threads(1)
    data, begun = data_sets(buildings)[name](0), time.process_time()
    train = data.train.drop(columns=[column for column in BEAM_AND_SKY if column in data.train])
    model = GRUForecaster(what) if isinstance(what, int) else MODELS[BASELINES[what]].make(data, 0)
    error = error_of(model.fit(train, train["T_za"]), data)
    print(f"{name} | {what}: {error:.3f} K, {time.process_time() - begun:.0f} s", flush=True)
    return name, what, error


def main() -> None:
    """Run every log and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--buildings", type=Path, nargs="+", required=True, help="folders that make_buildings.py made")
    parser.add_argument("--n-jobs", type=int, default=2)
    options = parser.parse_args()
    chosen(list(data_sets(options.buildings)), list(LOGS))  # all are there
    work = [(name, what) for what in (*range(N_SEEDS), *BASELINES) for name in LOGS]
    found = Parallel(options.n_jobs)(delayed(run)(name, options.buildings, what) for name, what in work)
    errors = {(name, what): error for name, what, error in found}
    rows = {}
    for name in LOGS:
        own = np.array([errors[name, seed] for seed in range(N_SEEDS)])
        rows[name] = {f"{what} [K]": f"{errors[name, what]:.3f}" for what in BASELINES} | {"GRU [K]": spread([*own])}
        rows[name] |= {f"GRU / {what}": spread([*own / errors[name, what]]) for what in BASELINES}
    won = sum(
        np.median([errors[name, seed] for seed in range(N_SEEDS)]) <= errors[name, "multi-step ARX"] for name in LOGS
    )
    write_table(
        "gru",
        "A GRU encoder-decoder",
        "python benchmarks/gru.py --buildings FOLDER/dev",
        {"Errors over all leads to 24 h": pd.DataFrame(rows).T.rename_axis("log")},
        f"Development logs, heat known in advance, the origins of the benchmark; GRU: median of {N_SEEDS} seeds "
        "(lowest to highest).  A layer of 48 over the past day of inputs, calendar and T_za, and one over the day "
        "ahead; errors at all leads, Adam, early stopping on the last fifth of the training.  The median is at or "
        f"below multi-step ARX on {won} of {len(LOGS)} logs, so it "
        f"{'earns' if won > len(LOGS) / 2 else 'does not earn'} a row of the benchmark.",
    )


if __name__ == "__main__":
    main()
