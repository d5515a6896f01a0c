"""skorch's training loop over a stack of networks: each member is clipped, stopped and kept by itself."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import torch
from skorch import NeuralNet
from skorch.callbacks import Callback
from skorch.helper import predefined_split
from threadpoolctl import ThreadpoolController
from torch import Tensor
from tqdm.auto import tqdm

from .compiled import DEVICE, room_of
from .epochs import Tables, train_epoch, validate
from .nets import NetworkStack
from .windows import Batch, Batches, Windows

#: a validation error counts as lower when it is lower by this share (skorch's own default).
_THRESHOLD = 1e-4
_MAX_NORM = 1.0


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    return ThreadpoolController()  # reading the loaded libraries takes a millisecond; torch is among them here


@contextmanager
def one_thread() -> Iterator[None]:
    """A context in which the calling thread, and no other, computes without helpers.

    Where helpers share a tensor, it is cut between them, and the last bits of what lies at a cut change: a fit in a
    worker process, which has fewer helpers, would differ from one in the main process.  OpenMP keeps this number by
    calling thread: nothing global is set, it comes back after the block, and networks of this size are no slower.
    """
    with _controller().limit(limits=1, user_api="openmp"):
        yield


class LoopSettings(NamedTuple):
    """How a stack is trained; members of a stack share it."""

    learning_rate: float
    batch_size: int
    max_epochs: int
    patience: int
    device: str = "cpu"


class Trained(NamedTuple):
    """What the training of one member gave."""

    weights: dict[str, Tensor]
    history: list[dict[str, float]]  # epoch, train_loss and, with a validation block, valid_loss
    valid_loss: float  # of the weights that are kept; NaN without a validation block


class _InterruptedError(Exception):
    """Ctrl-C, past skorch, which takes it for the end of training."""


class _AllStoppedError(KeyboardInterrupt):
    """Early stopping of the last member: the interruption by which skorch ends its loop."""


class StackNet(NeuralNet):
    """skorch's loop over :class:`Batches` of a stack.

    Each member has a mean squared error of its own, over the known targets; what skorch minimises is their sum, in
    which no member's gradient contains anything of another's.
    """

    def get_iterator(self, dataset: Windows, training: bool = False) -> Batches:
        """Shuffled batches in training, the plain order otherwise."""
        return Batches(dataset, self.batch_size, self.module_, shuffled=training)

    def initialize(self) -> StackNet:
        """Skorch's, and nothing is laid out yet."""
        self.tables_: dict[int, Tables] = {}
        return super().initialize()

    def fit_loop(self, *args: Any, **kwargs: Any) -> StackNet:
        """Skorch's loop, which lets a user's interruption through: early stopping is the only one that is meant."""
        try:
            return super().fit_loop(*args, **kwargs)
        except _AllStoppedError:
            raise
        except KeyboardInterrupt:
            raise _InterruptedError from None

    def train_step(self, batch: Batch, **fit_params: Any) -> dict[str, Tensor]:
        """One step of the optimiser, with gradients clipped member by member."""
        self.optimizer_.zero_grad()
        losses = self._losses(batch)
        loss = losses.sum()
        loss.backward()
        gradient = self.module_.flat.grad
        norms = torch.linalg.vector_norm(gradient, dim=1, keepdim=True)
        gradient.mul_(torch.clamp(_MAX_NORM / (norms + 1e-6), max=1.0))
        self.optimizer_.step()
        return {"loss": loss, "losses": losses.detach()}

    def validation_step(self, batch: Batch, **fit_params: Any) -> dict[str, Tensor]:
        """Loss of a batch."""
        with torch.no_grad():
            losses = self._losses(batch)
        return {"loss": losses.sum(), "losses": losses}

    def _losses(self, batch: Batch) -> Tensor:
        """Mean squared error of the known targets, (n_members,)."""
        errors = (self.module_(**batch.inputs) - batch.target) * batch.known
        return (errors * errors).flatten(1).sum(dim=1) / batch.n_known.clamp(min=1.0)

    def run_single_epoch(self, iterator: Batches | None, training: bool, prefix: str, step_fn: Any, **_: Any) -> None:
        """One pass over the batches, which records each member's mean over them, weighted by their known targets."""
        if iterator is None:
            return
        self.module_.train(training)
        if self.module_.flat.device.type == DEVICE:
            self.history.record(f"{prefix}_loss", self._compiled_epoch(iterator, training))
            return
        losses, counts = [], []
        for batch in iterator:
            losses.append(step_fn(batch)["losses"])
            counts.append(batch.n_known)
        weights = torch.stack(counts)
        means = (torch.stack(losses) * weights).sum(dim=0) / weights.sum(dim=0).clamp(min=1.0)
        self.history.record(f"{prefix}_loss", means.tolist())

    def _compiled_epoch(self, iterator: Batches, training: bool) -> list[float]:
        """One pass through the kernel, which cuts the batches itself."""
        stack, tables = self.module_, self._tables_of(iterator.windows)
        if training:
            return train_epoch(stack, tables, self.optimizer_, self.batch_size, _MAX_NORM)
        return validate(stack, tables)

    def _tables_of(self, windows: Windows) -> Tables:
        """What the kernel reads of a data set; there are two of them, to train and to validate."""
        spec = self.module_.spec
        if not self.tables_:
            self.room_ = room_of(spec.kind, self.module_.shapes()[0], spec.n_past, spec.n_leads)
        if id(windows) not in self.tables_:
            self.tables_[id(windows)] = Tables(windows, spec.kind, spec.reads_zeta, self.room_)
        return self.tables_[id(windows)]


class MemberStopping(Callback):
    """Early stopping, best weights and history of each member; one that has stopped leaves the stack.

    Parameters
    ----------
    patience : int or None
        Epochs without a lower validation error after which a member stops; None: there is no validation block.
    """

    def __init__(self, patience: int | None) -> None:
        self.patience = patience

    def on_train_begin(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        """Nothing is known yet."""
        n = len(net.module_.members)
        self.flat_ = net.module_.flat.detach().clone()
        self.histories_: list[list[dict[str, float]]] = [[] for _ in range(n)]
        self.best_ = np.full(n, np.inf)
        self.misses_ = np.zeros(n, dtype=int)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Keep what is better, and take out who has waited long enough."""
        stack: NetworkStack = net.module_
        last, flat = net.history[-1], stack.flat.detach()
        for row, member in enumerate(stack.members):
            losses = {name: last[name][row] for name in ("train_loss", "valid_loss") if name in last}
            self.histories_[member].append({"epoch": last["epoch"]} | losses)
            if self.patience is None:
                self.flat_[member] = flat[row]
            elif losses["valid_loss"] < self.best_[member] * (1.0 - _THRESHOLD):
                self.best_[member], self.misses_[member] = losses["valid_loss"], 0
                self.flat_[member] = flat[row]
            else:
                self.misses_[member] += 1
        waiting = [i for i, m in enumerate(stack.members) if self.patience is None or self.misses_[m] < self.patience]
        if not waiting:
            raise _AllStoppedError
        if len(waiting) < len(stack.members):
            _keep(net, waiting)

    def results(self, stack: NetworkStack) -> list[Trained]:
        """What each member became, from a stack of its shape."""
        named = [
            {n: v[0].detach().clone() for n, v in _holding(stack, row).weights().items()} for row in self.flat_.cpu()
        ]
        best = np.where(np.isfinite(self.best_), self.best_, np.nan)
        return [Trained(*found) for found in zip(named, self.histories_, best.tolist(), strict=True)]


def _holding(stack: NetworkStack, row: Tensor) -> NetworkStack:
    alone = NetworkStack(stack.spec, [torch.Generator()])
    alone.flat = torch.nn.Parameter(row[None].clone())
    return alone


def _keep(net: NeuralNet, rows: list[int]) -> None:
    """Take the other members out of the module and out of the optimiser's state."""
    optimizer, old = net.optimizer_, net.module_.flat
    net.module_.keep(rows)
    state = optimizer.state.pop(old)
    optimizer.state[net.module_.flat] = {
        name: value[rows] if torch.is_tensor(value) and value.ndim == 2 else value for name, value in state.items()
    }
    optimizer.param_groups[0]["params"] = [net.module_.flat]


class EpochBar(Callback):
    """A progress bar of epochs."""

    def on_train_begin(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        """Open the bar."""
        self.bar_ = tqdm(total=net.max_epochs, desc="epochs", unit="epoch", leave=False)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Advance it, with the newest losses, the lowest of the members that still train."""
        last = net.history[-1]
        self.bar_.set_postfix({k: f"{min(last[k]):.3f}" for k in ("train_loss", "valid_loss") if k in last})
        self.bar_.update()

    def on_train_end(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        """Close it."""
        self.bar_.close()


def train_stack(
    stack: NetworkStack, train: Windows, valid: Windows | None, settings: LoopSettings, verbose: int = 0
) -> list[Trained]:
    """Train the members of a stack.

    Parameters
    ----------
    stack : NetworkStack
        With initial weights; it is used up.
    train, valid : Windows
        What is learned and what says when to stop; without ``valid`` all of ``max_epochs`` are run.
    settings : LoopSettings
        How.
    verbose : int, default 0
        1 shows a progress bar.

    Returns
    -------
    list of Trained
        One a member, in order; to the bit what each would be if it were trained alone.
    """
    train, valid = train.to(settings.device), None if valid is None else valid.to(settings.device)
    stopping = MemberStopping(None if valid is None else settings.patience)
    callbacks: list[Any] = [("stop", stopping)] if not verbose else [("bar", EpochBar()), ("stop", stopping)]
    net = StackNet(
        stack,
        criterion=torch.nn.MSELoss,
        optimizer=torch.optim.Adam,
        lr=settings.learning_rate,
        max_epochs=settings.max_epochs,
        batch_size=settings.batch_size,
        train_split=None if valid is None else predefined_split(valid),
        callbacks=callbacks,
        callbacks__epoch_timer=None,
        callbacks__train_loss=None,
        callbacks__valid_loss=None,
        callbacks__print_log=None,
        device=settings.device,
        verbose=0,
    )
    net.initialize()
    fitted = dict(net.callbacks_)["stop"]
    try:
        with one_thread():
            net.partial_fit(train)
    except _InterruptedError:
        raise KeyboardInterrupt from None
    return fitted.results(stack.cpu())
