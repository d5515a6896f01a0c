"""skorch callbacks of a stack: gradient clipping, early stopping and progress, network by network."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
import torch
from skorch import NeuralNet
from skorch.callbacks import Callback
from torch import Tensor
from tqdm.auto import tqdm

from .modules import NetworkStack

#: A validation error counts as lower when it is lower by this share (skorch's own default).
_THRESHOLD = 1e-4


class TrainingResult(NamedTuple):
    """Weights and history of one network after its training."""

    weights: dict[str, Tensor]
    history: list[dict[str, float]]  # epoch, train_loss and, with a validation block, valid_loss
    valid_loss: float  # of the weights that are kept; NaN without a validation block


class GradientClippingPerNetwork(Callback):
    """Clip the norm of each network's gradient."""

    def __init__(self, max_norm: float) -> None:
        self.max_norm = max_norm

    def on_grad_computed(self, net: NeuralNet, named_parameters: Any, **kwargs: Any) -> None:
        """Scale the rows of the gradient as ``torch.nn.utils.clip_grad_norm_`` does."""
        for _, flat in named_parameters:
            norms = torch.linalg.vector_norm(flat.grad, dim=1, keepdim=True)
            flat.grad.mul_(torch.clamp(self.max_norm / (norms + 1e-6), max=1.0))


class EarlyStoppingPerNetwork(Callback):
    """Early stopping, best weights and history of each network; one that stops leaves the stack."""

    def __init__(self, patience: int | None) -> None:
        self.patience = patience  # None where there is no validation block

    def on_train_begin(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        n = len(net.module_.numbers)
        self.ended_ = False  # whether all networks have stopped or the last epoch was run
        self.best_stack_ = deepcopy(net.module_)  # all networks, with the weights that are kept
        self.histories_: list[list[dict[str, float]]] = [[] for _ in range(n)]
        self.best_ = np.full(n, np.inf)
        self.misses_ = np.zeros(n, dtype=int)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Store better weights, and remove networks whose patience has run out."""
        stack: NetworkStack = net.module_
        losses, better = epoch_losses(net), []
        for row, number in enumerate(stack.numbers):
            own = {name: values[row] for name, values in losses.items()}
            self.histories_[number].append({"epoch": len(net.history)} | own)
            if self.patience is None or own["valid_loss"] < self.best_[number] * (1.0 - _THRESHOLD):
                self.best_[number], self.misses_[number] = own.get("valid_loss", np.nan), 0
                better.append(row)
            else:
                self.misses_[number] += 1
        self.best_stack_.flat.data[[stack.numbers[row] for row in better]] = stack.flat.detach()[better]
        patience = np.inf if self.patience is None else self.patience
        running = [row for row, number in enumerate(stack.numbers) if self.misses_[number] < patience]
        self.ended_ = not running or len(net.history) == net.max_epochs
        if not running:
            raise KeyboardInterrupt  # by which skorch ends a training
        if len(running) < len(stack.numbers):
            _keep(net, running)

    def results(self) -> list[TrainingResult]:
        """Results of all networks."""
        best = np.where(np.isfinite(self.best_), self.best_, np.nan)
        weights = self.best_stack_.cpu().weights_by_network()
        return [TrainingResult(*each) for each in zip(weights, self.histories_, best.tolist(), strict=True)]


def epoch_losses(net: NeuralNet) -> dict[str, list[float]]:
    """``train_loss`` and, with validation, ``valid_loss`` of the last epoch: mean squared errors by network."""
    last = net.history[-1]
    return {f"{part}_loss": last[f"{part}_losses"] for part in ("train", "valid") if f"{part}_losses" in last}


def _keep(net: NeuralNet, rows: list[int]) -> None:
    """Remove the other networks from the module and from the optimiser's state."""
    optimizer, old = net.optimizer_, net.module_.flat
    net.module_.keep(rows)
    state = optimizer.state.pop(old)
    optimizer.state[net.module_.flat] = {
        name: value[rows] if torch.is_tensor(value) and value.ndim == 2 else value for name, value in state.items()
    }
    optimizer.param_groups[0]["params"] = [net.module_.flat]


class EpochProgress(Callback):
    """A progress bar of epochs, with the lowest losses of the networks that still train."""

    def on_train_begin(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        self.bar_ = tqdm(total=net.max_epochs, desc="epochs", unit="epoch", leave=False)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        self.bar_.set_postfix({name: f"{min(values):.3f}" for name, values in epoch_losses(net).items()})
        self.bar_.update()

    def on_train_end(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        self.bar_.close()
