"""A trained network as plain arrays, and how it forecasts."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from .._table import ZoneTable
from .cases import RECURRENT, ModelCase
from .features import row_features, zeta_of
from .loop import one_thread
from .nets import NetworkSpec, NetworkStack
from .windows import padded_windows

_PREDICT_WINDOWS = 2048
#: recurrent networks read a multiple of this many inputs a row: the hour of week (four), two of weather, zeta and 1.
_INPUTS = 8


class Scaler(NamedTuple):
    """Z-scores that the training block gave."""

    zeta_mean: float
    zeta_std: float
    past_mean: np.ndarray
    past_std: np.ndarray
    future_mean: np.ndarray
    future_std: np.ndarray

    @classmethod
    def of(cls, target: np.ndarray, past: np.ndarray, future: np.ndarray) -> Scaler:
        """The z-scores of a target (n,), NaN where missing, and of the columns (n, n_columns) of past and future."""
        known = target[np.isfinite(target)]
        level, spread = (float(known.mean()), float(known.std())) if len(known) else (0.0, 1.0)
        spread = spread if spread > 1e-9 else 1.0
        return cls(level, spread, past.mean(axis=0), _spread(past), future.mean(axis=0), _spread(future))


def _spread(columns: np.ndarray) -> np.ndarray:
    spread = columns.std(axis=0)
    return np.where(spread > 1e-9, spread, np.inf)  # a constant column says nothing


class TrainedNetwork:
    """One trained network, or several whose mean forecasts: arrays, from which the module is built when it is needed.

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
    weights : dict of str to ndarray
        As :meth:`NetworkStack.weights` names them, (n_members, ...).
    """

    def __init__(
        self, spec: NetworkSpec, case: ModelCase, encoding: str, scaler: Scaler, weights: dict[str, np.ndarray]
    ) -> None:
        self.spec = spec
        self.case = case
        self.encoding = encoding
        self.scaler = scaler
        self.weights = weights

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
        columns = columns_of(table, self.case, spec.kind, self.encoding)
        after = (n_rounds + 1) * spec.n_leads
        views = scaled_windows(table, *columns, scaler, expected, spec.n_past, spec.n_leads, after)
        chosen = torch.from_numpy(np.asarray(origins, dtype=np.int64))
        stack = self._stack()
        zeta = views["zeta"][chosen].expand(len(stack.members), -1, -1)
        scaled = np.zeros((len(origins), n_leads)) if base is None else (base - scaler.zeta_mean) / scaler.zeta_std
        whole = np.pad(scaled, [(0, 0), (0, n_rounds * spec.n_leads - n_leads)], mode="edge")
        paths = []
        for block in torch.from_numpy(whole.astype(np.float32)).split(spec.n_leads, dim=1):
            inputs = {"past": views["past"][chosen], "future": views["future"][chosen], "base": block}
            paths.append(evaluate(stack, zeta, inputs))
            zeta = torch.cat([zeta, paths[-1]], dim=2)[:, :, -(spec.n_past + 1) :]
            chosen = chosen + spec.n_leads
        out = torch.cat(paths, dim=2)[..., :n_leads].numpy().astype(np.float64).mean(axis=0)
        return out * scaler.zeta_std + scaler.zeta_mean

    def _stack(self) -> NetworkStack:
        """The module, without initial draws."""
        weights = {name: torch.from_numpy(value) for name, value in self.weights.items()}
        n_members = len(next(iter(weights.values())))
        return NetworkStack(self.spec, [torch.Generator() for _ in range(n_members)]).set_weights(weights).eval()


def evaluate(stack: NetworkStack, zeta: Tensor, inputs: dict[str, Tensor]) -> Tensor:
    """Forecasts (n_members, n_windows, n_leads) of a stack in ``eval`` mode.

    Parameters
    ----------
    stack : NetworkStack
        The members.
    zeta : Tensor of shape (n_members, n_windows, n_past + 1)
        Each member's history.
    inputs : dict of str to Tensor
        ``past``, ``future`` and ``base`` (n_windows, ...), the same for all members.
    """
    n_members, n = zeta.shape[:2]
    parts = []
    with torch.no_grad(), one_thread():
        for start in range(0, n, _PREDICT_WINDOWS):
            part = slice(start, start + _PREDICT_WINDOWS)
            shared = {k: v[part].expand(n_members, *[-1] * v.ndim) for k, v in inputs.items()}
            parts.append(stack(zeta=zeta[:, part], **shared))
    return torch.cat(parts, dim=1)


def scaled_windows(
    table: ZoneTable,
    past: np.ndarray,
    future: np.ndarray,
    scaler: Scaler,
    expected: np.ndarray | None,
    n_past: int,
    n_leads: int,
    after: int,
) -> dict[str, Tensor]:
    """Windows ``zeta``, ``past``, ``future`` of a table in z-scores; window i has row i as its origin.

    Parameters
    ----------
    table : ZoneTable
        The rows.
    past, future : ndarray of shape (n_rows, n_columns)
        Their columns (:func:`columns_of`).
    scaler : Scaler
        The z-scores.
    expected : ndarray of shape (n_rows,) or None
        What stands in for a missing disturbance; None: its mean.
    n_past, n_leads : int
        Rows of history and of the horizon.
    after : int
        Rows that are padded behind the table's end.
    """
    zeta = zeta_of(table)
    filled = np.where(np.isfinite(zeta), zeta, scaler.zeta_mean if expected is None else expected)
    past = (past - scaler.past_mean) / scaler.past_std
    future = (future - scaler.future_mean) / scaler.future_std
    return {
        "zeta": padded_windows((filled - scaler.zeta_mean) / scaler.zeta_std, n_past, after, n_past + 1),
        "past": padded_windows(past, n_past - 1, after, n_past),
        "future": padded_windows(future, 0, after, n_leads)[1:],
    }


def columns_of(table: ZoneTable, case: ModelCase, kind: str, encoding: str) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the past and of the future, (n_rows, n_columns) each, without ``zeta``.

    A recurrent network reads the same columns in both: one that a part does not name is 0 there.  Further columns of 0
    make their number the same for all of the paper's cases, so that networks of several cases fit into one stack.
    """
    past, future = (tuple(f for f in part if f != "zeta") for part in (case.past, case.future))
    if kind not in RECURRENT:
        return row_features(table, past, encoding), row_features(table, future, encoding)
    both = [f for f in case.features if f != "zeta"]
    blocks = [row_features(table, (feature,), encoding) for feature in both]
    n_read = sum(block.shape[1] for block in blocks) + 2  # zeta and the 1 of the bias are read with them
    empty = [np.zeros((table.n_rows, -n_read % _INPUTS))]
    return (
        np.hstack([block * (feature in past) for feature, block in zip(both, blocks, strict=True)] + empty),
        np.hstack([block * (feature in future) for feature, block in zip(both, blocks, strict=True)] + empty),
    )
