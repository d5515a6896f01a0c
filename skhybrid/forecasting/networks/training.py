"""Training a stack with skorch: one net for all networks, of which each is clipped, stopped and kept by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import torch
from skorch import NeuralNet
from skorch.callbacks import Callback
from skorch.helper import predefined_split
from threadpoolctl import ThreadpoolController
from torch import Tensor
from torch.nn import functional as F
from tqdm.auto import tqdm

from .modules import NetworkStack
from .windows import Windows

_MAX_NORM = 1.0
#: Windows of a batch that validates, at least.
_VALIDATED_AT_ONCE = 512
#: A validation error counts as lower when it is lower by this share (skorch's own default).
_THRESHOLD = 1e-4

Batch = tuple[dict[str, Tensor], Tensor]


class TrainingSettings(NamedTuple):
    """Settings that all networks of a stack share."""

    learning_rate: float
    batch_size: int
    max_epochs: int
    patience: int
    device: str = "cpu"


class WindowBatches:
    """Batches of a data set for a stack; with ``generators``, one per network, they are shuffled and have dropout."""

    def __init__(
        self, windows: Windows, size: int, stack: NetworkStack, generators: Sequence[torch.Generator] | None = None
    ) -> None:
        self.windows, self.size, self.stack, self.generators = windows, size, stack, generators
        self._dropping = [_on_device(generator, windows.chosen.device) for generator in generators or ()]
        self._in_order: tuple[list[int], list[Batch]] = ([], [])  # numbers of networks and their batches

    def __len__(self) -> int:
        return -(-len(self.windows) // self.size)

    def __iter__(self) -> Iterator[Batch]:
        numbers = self.stack.numbers
        if self.generators is not None:
            yield from self._shuffled(*([each[n] for n in numbers] for each in (self.generators, self._dropping)))
            return
        if self._in_order[0] != numbers:
            parts = self.windows.chosen.split(self.size)
            self._in_order = numbers, [self.windows.take(rows, numbers) for rows in parts]
        yield from self._in_order[1]

    def _shuffled(self, generators: list[torch.Generator], dropping: list[torch.Generator]) -> Iterator[Batch]:
        """An epoch: the order of windows, then all dropout, from each network's generator."""
        n, chosen = len(self.windows), self.windows.chosen
        order = torch.stack([torch.randperm(n, generator=generator) for generator in generators])
        rows = chosen[order.to(chosen.device)]
        kept = draw_kept(self.stack, n, dropping)
        for start in range(0, n, self.size):
            part = slice(start, start + self.size)
            inputs, target = self.windows.take(rows[:, part], self.stack.numbers)
            if kept is not None:
                inputs["kept"] = kept[..., part]
            yield inputs, target


def draw_kept(stack: NetworkStack, n_windows: int, generators: Sequence[torch.Generator]) -> Tensor | None:
    """Factors of dropout (n_networks, n_layers, width, n_windows) of an epoch; None where no network drops.

    Each row of the stack is drawn from its generator.
    """
    if not any(spec.dropout for spec in stack.specs):
        return None
    kept = torch.ones(len(stack.specs), *stack.spec.kept_shape(n_windows), device=generators[0].device)
    for row, spec, generator in zip(kept, stack.specs, generators, strict=True):
        if spec.dropout:
            spec.draw_uniform(row[: spec.n_dropping], generator)
    shares = kept.new_tensor([spec.dropout for spec in stack.specs])[:, None, None, None]
    factors = kept.new_tensor([1.0 / (1.0 - spec.dropout) for spec in stack.specs])[:, None, None, None]
    kept.ge_(shares).mul_(factors)
    return kept[:, :, : stack.spec.hidden_size]


class SquaredErrorsPerNetwork(torch.nn.Module):
    """Sum of squared errors of each network over the known targets of a batch, and their number."""

    all_known = False  # whether no target is NaN, which saves a few passes

    def forward(self, forecast: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Sums and numbers (n_networks,) for forecasts (n_networks, n_windows, n_leads); unknown targets are NaN."""
        if self.all_known:
            squares = F.mse_loss(forecast, target, reduction="none").sum(dim=(1, 2))
            return squares, torch.full_like(squares, target[0].numel())
        known = ~torch.isnan(target)
        squares = F.mse_loss(forecast, torch.where(known, target, forecast.detach()), reduction="none")
        return squares.sum(dim=(1, 2)), known.sum(dim=(1, 2))


class StackNet(NeuralNet):
    """skorch's net over a stack of networks, one generator per network for its order of windows and its dropout."""

    def __init__(self, *args: Any, generators: Sequence[torch.Generator] = (), **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.generators = generators

    def get_iterator(self, dataset: Windows, training: bool = False) -> WindowBatches:
        """Shuffled batches in training, batches in order otherwise."""
        if training:
            return WindowBatches(dataset, self.batch_size, self.module_, self.generators)
        return WindowBatches(dataset, max(self.batch_size, _VALIDATED_AT_ONCE), self.module_)

    def infer(self, x: dict[str, Tensor], **fit_params: Any) -> Tensor:
        """Forecasts of a batch, whose tensors are on the net's device already."""
        return self.module_(**x)

    def get_loss(self, y_pred: Tensor, y_true: Tensor, X: Any = None, training: bool = False) -> Tensor:
        """Sum of the networks' mean squared errors: no gradient mixes networks."""
        squares, n_known = self.criterion_(y_pred, y_true)
        self.sums_.append((squares.detach(), n_known))
        return (squares / n_known.clamp(min=1)).sum()

    def train_step(self, batch: Batch, **fit_params: Any) -> dict[str, Tensor]:
        """A step of Adam, which needs no closure."""
        self.module_.flat.grad = None
        step = self.train_step_single(batch, **fit_params)
        self.notify("on_grad_computed", named_parameters=self.module_.named_parameters(), batch=batch, training=True)
        self.optimizer_.step()
        return step

    def run_single_epoch(
        self,
        iterator: WindowBatches | None,
        training: bool,
        prefix: str,
        step_fn: Callable[..., Any],
        **fit_params: Any,
    ) -> None:
        """Run an epoch; the history keeps the mean squared error of each network, ``<prefix>_losses``.

        Callbacks are not called batch by batch, which takes as long as a step of small networks.
        """
        if iterator is None:
            return
        self.criterion_.all_known = iterator.windows.all_known
        self.sums_: list[tuple[Tensor, Tensor]] = []
        for batch in iterator:
            step_fn(batch)
        squares, n_known = (torch.stack(parts).sum(dim=0) for parts in zip(*self.sums_, strict=True))
        self.history.record(f"{prefix}_losses", (squares / n_known.clamp(min=1)).tolist())


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


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    return ThreadpoolController()  # reading the loaded libraries takes a millisecond; torch is among them here


@contextmanager
def one_thread() -> Iterator[None]:
    """A context in which the calling thread, and no other, computes without helpers.

    Where helpers share a tensor, the last bits of what lies at a cut change: a fit in a worker process, which has fewer
    helpers, would differ from one in the main process.  OpenMP keeps this number by calling thread: nothing global is
    set, it comes back after the block, and networks of this size are no slower.
    """
    with _controller().limit(limits=1, user_api="openmp"):
        yield


def train_stack(
    stack: NetworkStack,
    generators: Sequence[torch.Generator],
    train: Windows,
    valid: Windows | None,
    settings: TrainingSettings,
    verbose: int = 0,
) -> list[TrainingResult]:
    """Results of the networks of a stack, in order, to rounding as if alone; without ``valid`` all epochs are run."""
    device = settings.device
    stopping = EarlyStoppingPerNetwork(None if valid is None else settings.patience)
    net = StackNet(
        stack,
        criterion=SquaredErrorsPerNetwork,
        optimizer=torch.optim.Adam,
        optimizer__fused=device != "cpu" or torch.__version__ >= "2.4",  # the fastest, on a CPU since 2.4
        lr=settings.learning_rate,
        max_epochs=settings.max_epochs,
        batch_size=settings.batch_size,
        train_split=None if valid is None else predefined_split(valid.to(device)),
        callbacks=[
            ("clipping", GradientClippingPerNetwork(_MAX_NORM)),
            *([("progress", EpochProgress())] if verbose else []),
            ("stopping", stopping),
        ],
        **{f"callbacks__{name}": None for name in ("epoch_timer", "train_loss", "valid_loss", "print_log")},
        device=device,
        verbose=0,
        generators=generators,
    ).initialize()
    with one_thread():
        net.partial_fit(train.to(device))
    stopping = dict(net.callbacks_)["stopping"]
    if not stopping.ended_:  # skorch takes a user's interruption for the end of training
        raise KeyboardInterrupt
    return stopping.results()


def _on_device(generator: torch.Generator, device: torch.device) -> torch.Generator:
    """The generator itself on a CPU; elsewhere one of the same seed, since each device draws its own numbers."""
    if device.type == "cpu":
        return generator
    return torch.Generator(device).manual_seed(generator.initial_seed())
