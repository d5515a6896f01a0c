"""Training a network through skorch, on windows that are sliced from tensors in memory.

The validation block is the end of the training table, with a gap of one horizon before it; no test block is ever seen.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from skorch import NeuralNet
from skorch.callbacks import Callback, EarlyStopping, GradientNormClipping
from skorch.helper import predefined_split
from skorch.utils import noop
from threadpoolctl import threadpool_limits
from torch import Tensor
from tqdm.auto import tqdm

from .._contract import ZoneTable
from .cases import RECURRENT, ModelCase
from .features import row_features, rows_per_day, zeta_of
from .nets import NetworkSpec, build_network
from .windows import Batches, Windows, padded_windows

#: epochs of a table that is too short for a validation block to say when to stop.
_BLIND_EPOCHS = 20
_PREDICT_WINDOWS = 2048


class Split(NamedTuple):
    """A chronological split of the rows of a training table."""

    train_end: int  # targets of training lie before this row
    valid_start: int | None  # targets of validation begin here; None: there is no validation block


def chronological_split(n_rows: int, n_leads: int, fraction: float, per_day: int) -> Split:
    """Cut the validation block from the end, with a gap of one horizon before it.

    Parameters
    ----------
    n_rows, n_leads : int
        Rows of the table and of the horizon.
    fraction : float
        Share of the rows that validate.
    per_day : int
        Rows of a day: training must be left with two of them, and validation be longer than one horizon.

    Returns
    -------
    Split
    """
    n_valid = round(fraction * n_rows)
    valid_start = n_rows - n_valid
    train_end = valid_start - n_leads
    if n_valid <= n_leads or train_end < max(2 * per_day, 2 * n_leads):
        return Split(n_rows, None)
    return Split(train_end, valid_start)


class Scaler(NamedTuple):
    """Z-scores that the training block gave."""

    zeta_mean: float
    zeta_std: float
    past_mean: np.ndarray
    past_std: np.ndarray
    future_mean: np.ndarray
    future_std: np.ndarray


def _spread(columns: np.ndarray) -> np.ndarray:
    spread = columns.std(axis=0)
    return np.where(spread > 1e-9, spread, np.inf)  # a constant column says nothing


# ----------------------------------------------------------------------------------------------------------- training
class _InterruptedError(Exception):
    """Ctrl-C, past skorch, which takes it for the end of training."""


class WindowNet(NeuralNet):
    """skorch's loop over :class:`Batches`, with a loss that leaves out unknown targets."""

    def __init__(self, module: Any, *, generator: torch.Generator, **kwargs: Any) -> None:
        self.generator = generator
        super().__init__(module, **kwargs)

    def get_iterator(self, dataset: Windows, training: bool = False) -> Batches:
        """Shuffled batches in training, the plain order otherwise."""
        return Batches(dataset, self.batch_size, self.generator if training else None)

    def fit_loop(self, *args: Any, **kwargs: Any) -> WindowNet:
        """Skorch's loop, which lets a user's interruption through: early stopping is the only one that is meant."""
        try:
            return super().fit_loop(*args, **kwargs)
        except KeyboardInterrupt:
            stops = [c for _, c in self.callbacks_ if isinstance(c, EarlyStopping)]
            if not any(stop.misses_ >= stop.patience for stop in stops):
                raise _InterruptedError from None
            raise

    def get_loss(self, y_pred: Tensor, y_true: Tensor, X: Any = None, training: bool = False) -> Tensor:
        """Mean squared error of the known targets."""
        known = torch.isfinite(y_true)
        errors = torch.where(known, y_pred - torch.nan_to_num(y_true), torch.zeros(()))
        return (errors**2).sum() / known.sum().clamp(min=1)


class EpochBar(Callback):
    """A progress bar of epochs."""

    def on_train_begin(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        """Open the bar."""
        self.bar_ = tqdm(total=net.max_epochs, desc="epochs", unit="epoch", leave=False)

    def on_epoch_end(self, net: NeuralNet, **kwargs: Any) -> None:
        """Advance it, with the newest losses."""
        last = net.history[-1]
        self.bar_.set_postfix({k: f"{last[k]:.3f}" for k in ("train_loss", "valid_loss") if k in last})
        self.bar_.update()

    def on_train_end(self, net: NeuralNet, X: Any = None, y: Any = None, **kwargs: Any) -> None:
        """Close it."""
        self.bar_.close()


class TrainedNetwork:
    """A trained network: plain arrays, from which the module is built when it forecasts.

    Parameters
    ----------
    spec : NetworkSpec
        Shape of the network.
    case : ModelCase
        Its features.
    encoding : str
        Time encoding.
    scaler : Scaler
        Z-scores of the training block.
    """

    def __init__(self, spec: NetworkSpec, case: ModelCase, encoding: str, scaler: Scaler) -> None:
        self.spec = spec
        self.case = case
        self.encoding = encoding
        self.scaler = scaler
        self.weights: dict[str, np.ndarray] = {}
        self.history: list[dict[str, float]] = []
        self.weight = 1.0

    def views(self, table: ZoneTable, expected: np.ndarray | None, after: int) -> dict[str, Tensor]:
        """Windows ``zeta``, ``past``, ``future`` of a table; window i has row i as its origin.

        Parameters
        ----------
        table : ZoneTable
            The rows.
        expected : ndarray of shape (n_rows,) or None
            What stands in for a missing disturbance; None: its mean.
        after : int
            Rows that are padded behind the table's end.
        """
        scaler, n_past, n_leads = self.scaler, self.spec.n_past, self.spec.n_leads
        zeta = zeta_of(table)
        filled = np.where(np.isfinite(zeta), zeta, scaler.zeta_mean if expected is None else expected)
        past, future = columns_of(table, self.case, self.spec.kind, self.encoding)
        past = (past - scaler.past_mean) / scaler.past_std
        future = (future - scaler.future_mean) / scaler.future_std
        return {
            "zeta": padded_windows((filled - scaler.zeta_mean) / scaler.zeta_std, n_past, after, n_past + 1),
            "past": padded_windows(past, n_past - 1, after, n_past),
            "future": padded_windows(future, 0, after, n_leads)[1:],
        }

    def forecast(
        self, table: ZoneTable, origins: np.ndarray, n_leads: int, base: Any = None, expected: np.ndarray | None = None
    ) -> np.ndarray:
        """Forecasts (n_origins, n_leads); beyond the trained horizon its own forecasts become history.

        Parameters
        ----------
        table : ZoneTable
            The rows.
        origins : ndarray of int, shape (n_origins,)
            Rows to forecast from.
        n_leads : int
            How many rows ahead.
        base : ndarray of shape (n_origins, n_leads), optional
            Baseline forecast that is corrected.
        expected : ndarray of shape (n_rows,), optional
            What stands in for a missing disturbance.
        """
        spec, scaler = self.spec, self.scaler
        n_rounds = -(-n_leads // spec.n_leads)
        views = self.views(table, expected, after=(n_rounds + 1) * spec.n_leads)
        chosen = torch.from_numpy(np.asarray(origins, dtype=np.int64))
        zeta = views["zeta"][chosen]
        scaled = np.zeros((len(origins), n_leads)) if base is None else (base - scaler.zeta_mean) / scaler.zeta_std
        whole = np.pad(scaled, [(0, 0), (0, n_rounds * spec.n_leads - n_leads)], mode="edge")
        module, paths = self._module(), []
        for block in torch.from_numpy(whole.astype(np.float32)).split(spec.n_leads, dim=1):
            inputs = {"zeta": zeta, "past": views["past"][chosen], "future": views["future"][chosen], "base": block}
            paths.append(_evaluate(module, inputs))
            zeta = torch.cat([zeta, paths[-1]], dim=1)[:, -(spec.n_past + 1) :]
            chosen = chosen + spec.n_leads
        out = torch.cat(paths, dim=1)[:, :n_leads].numpy().astype(np.float64)
        return out * scaler.zeta_std + scaler.zeta_mean

    def _module(self) -> torch.nn.Module:
        module = build_network(self.spec, torch.Generator().manual_seed(0))
        module.load_state_dict({name: torch.from_numpy(value.copy()) for name, value in self.weights.items()})
        return module.eval()


def one_thread() -> threadpool_limits:
    """A context in which the calling thread, and no other, computes without helpers.

    The last bits of a matrix product depend on how many threads share it, so that a fit in a worker process, which has
    fewer of them, would differ from one in the main process.  OpenMP keeps this number by calling thread: nothing
    global is set, and networks of this size are no slower for it.
    """
    return threadpool_limits(limits=1, user_api="openmp")


def _evaluate(module: torch.nn.Module, inputs: dict[str, Tensor]) -> Tensor:
    with torch.no_grad(), one_thread():
        n = len(inputs["zeta"])
        parts = [
            module(**{name: value[start : start + _PREDICT_WINDOWS] for name, value in inputs.items()})
            for start in range(0, n, _PREDICT_WINDOWS)
        ]
    return torch.cat(parts)


def columns_of(table: ZoneTable, case: ModelCase, kind: str, encoding: str) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the past and of the future, (n_rows, n_columns) each, without ``zeta``.

    A recurrent network reads the same columns in both: one that a part does not name is 0 there.
    """
    past, future = (tuple(f for f in part if f != "zeta") for part in (case.past, case.future))
    if kind not in RECURRENT:
        return row_features(table, past, encoding), row_features(table, future, encoding)
    both = [f for f in case.features if f != "zeta"]
    blocks = [row_features(table, (feature,), encoding) for feature in both]
    empty = [np.empty((table.n_rows, 0))]
    return (
        np.hstack(empty + [block * (feature in past) for feature, block in zip(both, blocks, strict=True)]),
        np.hstack(empty + [block * (feature in future) for feature, block in zip(both, blocks, strict=True)]),
    )


def _prepare(settings: Any, table: ZoneTable, target: np.ndarray, split: Split, n_leads: int) -> TrainedNetwork:
    """An untrained network with the z-scores of the training block."""
    case: ModelCase = settings.case_
    past, future = columns_of(table, case, settings.model, settings.time_encoding)
    early = slice(0, split.train_end)
    known = target[early][np.isfinite(target[early])]
    level, spread = (float(known.mean()), float(known.std())) if len(known) else (0.0, 1.0)
    scaler = Scaler(
        level,
        spread if spread > 1e-9 else 1.0,
        past[early].mean(axis=0),
        _spread(past[early]),
        future[early].mean(axis=0),
        _spread(future[early]),
    )
    names = ("n_layers", "hidden_size", "activation", "dropout", "n_channels", "filter_size", "pool_size")
    spec = NetworkSpec(
        kind=settings.model,
        n_past=int(case.pattern_days) * rows_per_day(table.step),
        n_leads=n_leads,
        n_past_columns=past.shape[1],
        n_future_columns=future.shape[1],
        reads_zeta="zeta" in case.past,
        **{name: getattr(settings, name) for name in names},
    )
    return TrainedNetwork(spec, case, settings.time_encoding, scaler)


def train_network(
    settings: Any, table: ZoneTable, target: np.ndarray, base: Any, split: Split, n_leads: int, seed: int
) -> TrainedNetwork:
    """Train a network, and say how much of its correction to use.

    Parameters
    ----------
    settings : DisturbanceForecaster
        Its constructor's arguments and ``case_``.
    table : ZoneTable
        Training table with history ``zeta``.
    target : ndarray of shape (n_rows,)
        NaN where missing.
    base : rival or None
        The baseline to correct, fitted before the validation block.
    split : Split
        Training and validation rows.
    n_leads : int
        Rows of the horizon.
    seed : int
        Seed of weights, dropout and shuffling.

    Returns
    -------
    TrainedNetwork
    """
    network = _prepare(settings, table, target, split, n_leads)
    scaler, n_rows = network.scaler, table.n_rows
    expected = None if base is None else base.expected(table)
    views = network.views(table, expected, after=n_leads)
    origins = np.arange(n_rows)
    baseline = None if base is None else base.forecast(table, origins, n_leads)
    scaled = np.zeros((n_rows, n_leads)) if baseline is None else (baseline - scaler.zeta_mean) / scaler.zeta_std
    views["base"] = torch.from_numpy(scaled.astype(np.float32))
    ahead = np.append((target - scaler.zeta_mean) / scaler.zeta_std, np.full(n_leads, np.nan))
    views_target = padded_windows(ahead[1:], 0, 0, n_leads)
    return _fit(network, settings, views, views_target, base is not None, split, seed)


def _fit(
    network: TrainedNetwork,
    settings: Any,
    views: dict[str, Tensor],
    target: Tensor,
    corrects: bool,
    split: Split,
    seed: int,
) -> TrainedNetwork:
    n_leads, n_rows = network.spec.n_leads, len(target)
    # A window whose past is mostly padding teaches little: it is used only where windows are few.
    first = min(network.spec.n_past - 1, split.train_end // 4)
    valid, last = None, n_rows - 1
    if split.valid_start is not None:
        valid = Windows(views, target, torch.arange(split.valid_start - 1, n_rows - n_leads))
        last = split.train_end - n_leads
    train = Windows(views, target, torch.arange(first, max(last, first + 1)))
    generator = torch.Generator().manual_seed(seed)
    module = build_network(network.spec, generator, corrects)
    net = _skorch_net(module, settings, valid, generator)
    try:
        with one_thread():
            net.fit(train)
    except _InterruptedError:
        raise KeyboardInterrupt from None
    network.weights = {name: value.numpy().copy() for name, value in net.module_.state_dict().items()}
    names = [name for name in ("train_loss", "valid_loss") if name in net.history[0]]
    network.history = [{"epoch": row["epoch"]} | {name: float(row[name]) for name in names} for row in net.history]
    if corrects:
        network.weight = 0.0 if valid is None else _correction_weight(net.module_.eval(), valid)
    return network


def _skorch_net(module: torch.nn.Module, settings: Any, valid: Windows | None, generator: torch.Generator) -> WindowNet:
    callbacks: list[Any] = [("clip", GradientNormClipping(1.0))]
    if valid is not None:
        stop = EarlyStopping(monitor="valid_loss", patience=settings.patience, load_best=True, sink=noop)
        callbacks.append(("stop", stop))
    if settings.verbose:
        callbacks.append(("bar", EpochBar()))
    return WindowNet(
        module,
        generator=generator,
        criterion=torch.nn.MSELoss,
        optimizer=torch.optim.Adam,
        lr=settings.learning_rate,
        max_epochs=settings.max_epochs if valid is not None else min(settings.max_epochs, _BLIND_EPOCHS),
        batch_size=settings.batch_size,
        train_split=None if valid is None else predefined_split(valid),
        callbacks=callbacks,
        callbacks__print_log=None,
        verbose=0,
    )


def _correction_weight(module: torch.nn.Module, valid: Windows) -> float:
    """The share in [0, 1] of the correction to use, by least squares on the validation block less one standard error.

    The block that stopped the training flatters it: without the discount, corrections that do not last are kept.
    """
    inputs, target = valid[torch.arange(len(valid))]
    correction = (_evaluate(module, inputs) - inputs["base"]).double()
    left = (target - inputs["base"]).double()
    correction = torch.where(torch.isfinite(left), correction, 0.0)
    cross = (correction * torch.nan_to_num(left)).sum(dim=1).numpy()
    power = (correction**2).sum(dim=1).numpy()
    return discounted_share(cross, power, n_blocks=max(2, len(valid) // target.shape[1]))


def discounted_share(cross: np.ndarray, power: np.ndarray, n_blocks: int) -> float:
    """``sum(cross) / sum(power)`` less its jackknife standard error over blocks of consecutive windows, in [0, 1].

    Parameters
    ----------
    cross, power : ndarray of shape (n_windows,)
        Each window's product of correction and remainder, and its squared correction.
    n_blocks : int
        How many blocks of windows are left out in turn; windows of a block overlap.
    """
    crosses, powers = (np.array([part.sum() for part in np.array_split(v, n_blocks)]) for v in (cross, power))
    rest = powers.sum() - powers
    if not np.isfinite(crosses).all() or not (rest > 0).all():
        return 0.0
    shares = (crosses.sum() - crosses) / rest
    error = np.sqrt((n_blocks - 1) / n_blocks * ((shares - shares.mean()) ** 2).sum())
    return float(np.clip(crosses.sum() / powers.sum() - error, 0.0, 1.0))
