"""Time of an epoch of a stack, and of a bare loop over torch.nn layers: the same windows, batches and optimiser."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from skhybrid.forecasting.networks.fitted import make_stack
from skhybrid.forecasting.networks.spec import NetworkSpec
from skhybrid.forecasting.networks.training import TrainingSettings, one_thread, train_stack
from skhybrid.forecasting.networks.windows import Windows, WindowTable, WindowViews

#: four weeks of hours, less a week of validation and what windows take
N_TRAIN, N_VALID, N_LEADS, N_COLUMNS = 456, 145, 24, 6
TRAINING = {"learning_rate": 0.003, "batch_size": 128, "patience": 10_000}
SIZES = {
    "mlp 1 x 20": {"kind": "mlp", "n_layers": 1, "hidden_size": 20},
    "mlp 4 x 100": {"kind": "mlp", "n_layers": 4, "hidden_size": 100},
    "cnn 1 x 10 channels": {"kind": "cnn", "n_layers": 1, "hidden_size": 10},
    "cnn 1 x 10 channels, pool 4": {"kind": "cnn", "n_layers": 1, "hidden_size": 10, "pool_size": 4},
    "rnn 1 x 20": {"kind": "rnn", "n_layers": 1, "hidden_size": 20},
    "lstm 1 x 20": {"kind": "lstm", "n_layers": 1, "hidden_size": 20},
    "lstm 2 x 60": {"kind": "lstm", "n_layers": 2, "hidden_size": 60},
}


class Data(NamedTuple):
    """Random windows of case01 (24 past rows, six columns), and numbers of those that train and validate."""

    views: WindowViews
    target: Tensor
    train: Tensor
    valid: Tensor


def spec_of(size: dict) -> NetworkSpec:
    """The shape of a network of case01 with four time columns, T_oa and q_sol."""
    shape = {"n_past": 24, "n_leads": N_LEADS, "n_past_columns": N_COLUMNS, "n_future_columns": N_COLUMNS}
    cnn = {"n_channels": 10, "filter_size": 6, "pool_size": 0}
    return NetworkSpec(**shape | {"reads_zeta": True, "activation": "relu", "dropout": 0.1} | cnn | size)


def random_data(seed: int = 0) -> Data:
    """Windows of noise: the time of an epoch does not depend on what they hold."""
    g = torch.Generator().manual_seed(seed)
    n = N_TRAIN + N_VALID
    views = [torch.randn(n, *shape, generator=g) for shape in ((25,), (N_COLUMNS, 24), (N_COLUMNS, N_LEADS))]
    target = torch.randn(n, N_LEADS, generator=g)
    return Data(WindowViews(*views), target, torch.arange(N_TRAIN), torch.arange(N_TRAIN, n))


def stacked(spec: NetworkSpec, data: Data, n_networks: int, n_epochs: int, device: str = "cpu") -> None:
    """Train a stack, as ``DisturbanceForecaster.fit`` does."""
    table = WindowTable(spec.kind, spec.reads_zeta, data.views, torch.zeros_like(data.target), data.target)
    generators = [torch.Generator().manual_seed(seed) for seed in range(n_networks)]
    stack = make_stack([spec] * n_networks).draw_weights(generators)
    windows = (Windows([table], rows) for rows in (data.train, data.valid))
    train_stack(stack, generators, *windows, TrainingSettings(max_epochs=n_epochs, device=device, **TRAINING))


class PlainNetwork(nn.Module):
    """The same equations from torch's own layers, one network alone."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.kind, n = spec.kind, spec.hidden_size
        phi = {"relu": nn.ReLU, "selu": nn.SELU, "gelu": nn.GELU}[spec.activation]
        head = [phi(), nn.Dropout(spec.dropout)]
        if spec.kind == "mlp":
            widths = [spec.flat_width, *[n] * spec.n_layers]
            hidden = [[nn.Linear(a, b), *head] for a, b in pairwise(widths)]
            self.body = nn.Sequential(*(layer for block in hidden for layer in block), nn.Linear(n, N_LEADS))
        elif spec.kind == "cnn":
            layers: list[nn.Module] = [nn.Unflatten(1, (1, spec.flat_width))]
            for i in range(spec.n_layers + 1):
                layers.append(nn.Conv1d(spec.n_channels if i else 1, spec.n_channels, spec.filter_size, padding=3))
                layers += [nn.MaxPool1d(spec.pool_size)] * (spec.pool_size > 1) + [phi()]
            self.body = nn.Sequential(*layers, nn.Flatten(), nn.LazyLinear(n), *head, nn.Linear(n, N_LEADS))
        else:
            cell = nn.RNN if spec.kind == "rnn" else nn.LSTM
            self.cell = cell(spec.n_past_columns + 1, n, num_layers=spec.n_layers, batch_first=True)
            self.body = nn.Sequential(nn.Linear(n, n), *head, nn.Linear(n, 1))

    def forward(self, zeta: Tensor, past: Tensor, future: Tensor) -> Tensor:
        """Forecast (n_windows, n_leads)."""
        if self.kind in ("mlp", "cnn"):
            return self.body(torch.cat([zeta[:, 1:], past.flatten(1), future.flatten(1)], dim=1))
        _, hidden = self.cell(torch.cat([zeta[:, :-1, None], past.transpose(1, 2)], dim=2))
        previous, outputs = zeta[:, -1:], []
        for lead in range(N_LEADS):
            step = torch.cat([previous, future[:, :, lead]], dim=1)[:, None]
            h, hidden = self.cell(step, hidden)
            previous = self.body(h[:, 0])
            outputs.append(previous)
        return torch.cat(outputs, dim=1)


def plain(spec: NetworkSpec, data: Data, n_epochs: int, device: str = "cpu") -> None:
    """Train one network in a bare loop: a shuffled index, a slice, a step; the validation error after each epoch."""
    data = Data(WindowViews(*(view.to(device) for view in data.views)), *(part.to(device) for part in data[1:]))
    module = PlainNetwork(spec).to(device)
    with torch.no_grad():
        module(*(view[:2] for view in data.views))  # sizes of lazy layers
    optimizer = torch.optim.Adam(module.parameters(), lr=TRAINING["learning_rate"])

    def loss_of(rows: Tensor) -> Tensor:
        return ((module(*(view[rows] for view in data.views)) - data.target[rows]) ** 2).mean()

    with one_thread():
        for _ in range(n_epochs):
            module.train()
            for rows in data.train[torch.randperm(N_TRAIN, device=device)].split(TRAINING["batch_size"]):
                optimizer.zero_grad()
                loss_of(rows).backward()
                optimizer.step()
            module.eval()
            with torch.no_grad():
                for rows in data.valid.split(TRAINING["batch_size"]):
                    loss_of(rows).item()


def interleaved(
    runs: dict[str, Callable[[int], None]],
    n_epochs: int,
    n_rounds: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, np.ndarray]:
    """Time of an epoch [ms] of every run, (n_rounds,), the runs taking turns so that drifts fall on all.

    Each round's time is the difference between ``n_epochs`` and one epoch, so that making and ending do not count.
    """
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run(1)
    for _ in range(n_rounds):
        for name, run in runs.items():
            stamps = [clock()]
            for n in (1, n_epochs + 1):
                run(n)
                stamps.append(clock())
            times[name].append(1e3 * (stamps[2] - 2 * stamps[1] + stamps[0]) / n_epochs)
    return {name: np.array(values) for name, values in times.items()}
