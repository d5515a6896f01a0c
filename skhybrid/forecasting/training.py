"""Training networks: one job a forecaster, all networks of equal shape in one stack.

The validation block is the end of the training table, with a gap of one horizon before it; no test block is ever seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from .._contract import ZoneTable
from .cases import ModelCase
from .features import rows_per_day
from .loop import LoopSettings, Trained, train_stack
from .nets import NetworkSpec, NetworkStack
from .trained import Scaler, TrainedNetwork, columns_of, evaluate, window_views
from .windows import Windows, padded_windows

#: epochs of a table that is too short for a validation block to say when to stop.
_BLIND_EPOCHS = 20
#: networks of a stack; more of them leave the cache and gain nothing (``benchmarks/networks.py``).
_MOST_MEMBERS = 20


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


class TrainingJob(NamedTuple):
    """The networks of one forecaster: the same settings and rows, one network a seed."""

    settings: Any  # DisturbanceForecaster: its constructor's arguments and ``case_``
    table: ZoneTable  # training table with history ``zeta``
    target: np.ndarray  # (n_rows,), NaN where missing
    base: Any  # the baseline to correct, fitted before the validation block; None: there is none
    split: Split
    n_leads: int  # rows of the horizon
    seeds: tuple[int, ...]  # of weights, dropout and batches


class TrainedJob(NamedTuple):
    """What a job gave."""

    network: TrainedNetwork  # the one that is used, or all of them, to be averaged
    weight: float  # share in [0, 1] of its correction that is used; 1 where there is no baseline
    history: list[dict[str, float]]  # epochs of the network with the lowest validation error
    repeats: pd.DataFrame  # one row a seed: ``seed``, ``n_epochs``, ``train_loss``, ``valid_loss``, ``used``


class _Plan(NamedTuple):
    """A job made ready: shape, z-scores, windows."""

    job: TrainingJob
    spec: NetworkSpec
    case: ModelCase
    encoding: str
    scaler: Scaler
    loop: LoopSettings
    views: dict[str, Tensor]
    target: Tensor
    train: Tensor  # numbers of the windows that train
    valid: Tensor | None

    @property
    def shape(self) -> tuple[Any, ...]:
        """What plans must share to be trained as one stack: the same windows by number, the same loop over them."""
        return (self.spec, self.loop, self.job.base is not None, self.job.table.n_rows, self.job.split)


def train_networks(jobs: Sequence[TrainingJob], verbose: int = 0) -> list[TrainedJob]:
    """Train the networks of several forecasters, those of equal shape as one stack.

    Parameters
    ----------
    jobs : sequence of TrainingJob
        Such as the candidates of a search.
    verbose : int, default 0
        1 shows a progress bar.

    Returns
    -------
    list of TrainedJob
        In the order of the jobs; each to the bit what it would be if it were trained alone.
    """
    plans = [_plan(job) for job in jobs]
    groups: dict[tuple[Any, ...], list[tuple[int, int]]] = {}
    for i, plan in enumerate(plans):
        groups.setdefault(plan.shape, []).extend((i, seed) for seed in plan.job.seeds)
    found: dict[tuple[int, int], Trained] = {}
    for members in groups.values():
        for start in range(0, len(members), _MOST_MEMBERS):
            part = members[start : start + _MOST_MEMBERS]
            found.update(zip(part, _train(plans, part, verbose), strict=True))
    return [_finish(plan, [found[i, seed] for seed in plan.job.seeds]) for i, plan in enumerate(plans)]


def _train(plans: Sequence[_Plan], members: Sequence[tuple[int, int]], verbose: int) -> list[Trained]:
    """Train (plan, seed) pairs of equal shape as one stack."""
    mine = [plans[i] for i, _ in members]
    shared = all(plan is mine[0] for plan in mine)
    parts = mine[:1] if shared else mine
    views, targets = [plan.views for plan in parts], [plan.target for plan in parts]
    first = mine[0]
    train = Windows(views, targets, first.train)
    valid = None if first.valid is None else Windows(views, targets, first.valid)
    generators = [torch.Generator().manual_seed(seed) for _, seed in members]
    stack = NetworkStack(first.spec, generators, corrects=first.job.base is not None)
    return train_stack(stack, train, valid, first.loop, verbose)


# ------------------------------------------------------------------------------------------------------- before, after
def _plan(job: TrainingJob) -> _Plan:
    """Z-scores of the training block, and all windows by them."""
    settings, split, n_leads, n_rows = job.settings, job.split, job.n_leads, job.table.n_rows
    case: ModelCase = settings.case_
    past, future = columns_of(job.table, case, settings.model, settings.time_encoding)
    early = slice(0, split.train_end)
    scaler = Scaler.of(job.target[early], past[early], future[early])
    spec = _spec_of(job, past.shape[1], future.shape[1])
    # A window whose past is mostly padding teaches little: it is used only where windows are few.
    first = min(spec.n_past - 1, split.train_end // 4)
    valid, last, epochs = None, n_rows - 1, min(settings.max_epochs, _BLIND_EPOCHS)
    if split.valid_start is not None:
        valid = torch.arange(split.valid_start - 1, n_rows - n_leads)
        last, epochs = split.train_end - n_leads, settings.max_epochs
    loop = LoopSettings(settings.learning_rate, settings.batch_size, epochs, settings.patience)
    train = torch.arange(first, max(last, first + 1))
    plan = _Plan(job, spec, case, settings.time_encoding, scaler, loop, {}, torch.empty(0), train, valid)
    ahead = np.append((job.target - scaler.zeta_mean) / scaler.zeta_std, np.full(n_leads, np.nan))
    return plan._replace(views=_views(plan), target=padded_windows(ahead[1:], 0, 0, n_leads))


def _spec_of(job: TrainingJob, n_past_columns: int, n_future_columns: int) -> NetworkSpec:
    settings, case = job.settings, job.settings.case_
    sizes = {name: getattr(settings, name) for name in ("n_layers", "hidden_size", "activation", "dropout")}
    for name in ("n_channels", "filter_size", "pool_size"):
        # others do not read them: candidates that differ in nothing else are of equal shape
        sizes[name] = getattr(settings, name) if settings.model == "cnn" else 0
    return NetworkSpec(
        kind=settings.model,
        n_past=int(case.pattern_days) * rows_per_day(job.table.step),
        n_leads=job.n_leads,
        n_past_columns=n_past_columns,
        n_future_columns=n_future_columns,
        reads_zeta="zeta" in case.past,
        **sizes,
    )


def _views(plan: _Plan) -> dict[str, Tensor]:
    """Windows of the training table, with the baseline's forecast from every row."""
    job, scaler, n_rows = plan.job, plan.scaler, plan.job.table.n_rows
    expected = None if job.base is None else job.base.expected(job.table)
    views = window_views(job.table, plan, expected, after=job.n_leads)
    scaled = np.zeros((n_rows, job.n_leads))
    if job.base is not None:
        baseline = job.base.forecast(job.table, np.arange(n_rows), job.n_leads)
        scaled = (baseline - scaler.zeta_mean) / scaler.zeta_std
    return views | {"base": torch.from_numpy(scaled.astype(np.float32))}


def _finish(plan: _Plan, found: Sequence[Trained]) -> TrainedJob:
    """Choose among the repeats, or average them, and say how much of the correction to use."""
    losses = np.array([one.valid_loss for one in found])
    best = 0 if np.isnan(losses).all() else int(np.nanargmin(losses))
    used = list(range(len(found))) if plan.job.settings.repeats == "mean" else [best]
    weights = {name: torch.stack([found[i].weights[name] for i in used]) for name in found[0].weights}
    arrays = {name: value.numpy() for name, value in weights.items()}
    network = TrainedNetwork(plan.spec, plan.case, plan.encoding, plan.scaler, arrays)
    weight = 1.0
    if plan.job.base is not None:
        weight = 0.0 if plan.valid is None else _correction_weight(plan, weights)
    repeats = pd.DataFrame(
        {
            "seed": plan.job.seeds,
            "n_epochs": [len(one.history) for one in found],
            "train_loss": [one.history[-1]["train_loss"] for one in found],
            "valid_loss": losses,
            "used": [i in used for i in range(len(found))],
        }
    )
    return TrainedJob(network, weight, found[best].history, repeats)


def _correction_weight(plan: _Plan, weights: dict[str, Tensor]) -> float:
    """The share in [0, 1] of the correction to use, by least squares on the validation block less one standard error.

    The block that stopped the training flatters it: without the discount, corrections that do not last are kept.
    """
    n_members = len(next(iter(weights.values())))
    stack = NetworkStack(plan.spec, [torch.Generator() for _ in range(n_members)]).set_weights(weights).eval()
    inputs = {name: view[plan.valid] for name, view in plan.views.items()}
    zeta = inputs.pop("zeta").expand(n_members, -1, -1)
    target = plan.target[plan.valid]
    correction = evaluate(stack, zeta, inputs).mean(dim=0).double() - inputs["base"].double()
    left = (target - inputs["base"]).double()
    correction = torch.where(torch.isfinite(left), correction, 0.0)
    cross = (correction * torch.nan_to_num(left)).sum(dim=1).numpy()
    power = (correction**2).sum(dim=1).numpy()
    return discounted_share(cross, power, n_blocks=max(2, len(target) // target.shape[1]))


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
