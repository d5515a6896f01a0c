"""Training networks: one job a forecaster, all networks of equal shape in one stack.

The validation block is the end of the training table, with a gap of one horizon before it; no test block is ever seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from .._table import ZoneTable
from .cases import RECURRENT, ModelCase
from .compiled import DEVICE
from .features import rows_per_day
from .loop import LoopSettings, Trained, train_stack
from .nets import NetworkSpec, NetworkStack
from .trained import Scaler, TrainedNetwork, columns_of, evaluate, scaled_windows
from .windows import Windows, padded_windows

#: epochs of a table that is too short for a validation block to say when to stop.
_BLIND_EPOCHS = 20
#: networks of a stack: members take turns in the kernels; a GPU is busy only with many.
_MOST_MEMBERS, _MOST_MEMBERS_ELSEWHERE = 20, 256


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


class _Data(NamedTuple):
    """Z-scores and windows of a case, which all jobs of the same rows, baseline and case share."""

    scaler: Scaler
    n_past: int
    n_columns: tuple[int, int]  # of past and future
    train: Windows
    valid: Windows | None


class _Plan(NamedTuple):
    """A job made ready."""

    job: TrainingJob
    spec: NetworkSpec
    loop: LoopSettings
    data: _Data

    @property
    def shape(self) -> tuple[Any, ...]:
        """What plans must share to be trained as one stack: the same windows by number, the same loop over them."""
        return (self.spec.shape, self.loop, self.job.base is not None, self.job.table.n_rows, self.job.split)


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
    found = try_networks(jobs, verbose)
    for one in found:
        if isinstance(one, Exception):
            raise one
    return cast(list[TrainedJob], found)


def try_networks(jobs: Sequence[TrainingJob], verbose: int = 0) -> list[TrainedJob | Exception]:
    """:func:`train_networks`, with the exception in the place of what could not be trained."""
    plans: dict[int, _Plan] = {}
    results: dict[int, TrainedJob | Exception] = {}
    shared: dict[Any, _Data] = {}
    groups: dict[tuple[Any, ...], list[int]] = {}
    for i, job in enumerate(jobs):
        try:
            plans[i] = _plan(job, shared)
        except Exception as error:
            results[i] = error
        else:
            groups.setdefault(plans[i].shape, []).append(i)
    for numbers in groups.values():
        try:
            results |= _train_group({i: plans[i] for i in numbers}, verbose)
        except Exception as error:
            results |= dict.fromkeys(numbers, error)
    return [results[i] for i in range(len(jobs))]


def _train_group(plans: dict[int, _Plan], verbose: int) -> dict[int, TrainedJob | Exception]:
    """Train plans of one shape in stacks; neighbours are of one activation."""
    ordered = sorted(plans, key=lambda i: plans[i].spec.activation)
    members = [(i, seed) for i in ordered for seed in plans[i].job.seeds]
    found: dict[tuple[int, int], Trained] = {}
    on_kernels = plans[ordered[0]].loop.device == DEVICE
    n_stacks = -(-len(members) // (_MOST_MEMBERS if on_kernels else _MOST_MEMBERS_ELSEWHERE))
    for part in np.array_split(np.arange(len(members)), n_stacks):
        chosen = [members[k] for k in part]
        found.update(zip(chosen, _train([(plans[i], seed) for i, seed in chosen], verbose), strict=True))
    return {i: _finish(plan, [found[i, seed] for seed in plan.job.seeds]) for i, plan in plans.items()}


def _train(members: Sequence[tuple[_Plan, int]], verbose: int) -> list[Trained]:
    """Train (plan, seed) pairs of equal shape as one stack."""
    plans = [plan for plan, _ in members]
    first = plans[0]
    train = Windows.of([plan.data.train for plan in plans])
    validating = [plan.data.valid for plan in plans if plan.data.valid is not None]
    valid = Windows.of(validating) if validating else None
    generators = [torch.Generator().manual_seed(seed) for _, seed in members]
    stack = NetworkStack([plan.spec for plan in plans], generators, corrects=first.job.base is not None)
    return train_stack(stack, train, valid, first.loop, verbose)


# ------------------------------------------------------------------------------------------------------- before, after
def device_of(device: str) -> str:
    """The device that is meant: ``"auto"`` is a GPU where torch finds one.

    Parameters
    ----------
    device : str
        ``"cpu"``, ``"auto"``, or a name of torch's, such as ``"cuda"``.

    Returns
    -------
    str

    Raises
    ------
    ValueError
        If torch does not know the device or cannot use it here.
    """
    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.empty(0, device=device)
    except (RuntimeError, AssertionError) as error:  # torch raises the second where it was built without a GPU
        raise ValueError(f"device={device!r} is not to be had: {str(error).splitlines()[0]}") from None
    return device


def _plan(job: TrainingJob, shared: dict[Any, _Data]) -> _Plan:
    """Shape and loop of a job, and its windows, which ``shared`` may have from a job before."""
    settings, family = job.settings, job.settings.model in RECURRENT
    key = (id(job.table), id(job.target), id(job.base), settings.case_, settings.time_encoding, family, job.split)
    if (*key, job.n_leads) not in shared:
        shared[*key, job.n_leads] = _data(job)
    data = shared[*key, job.n_leads]
    epochs = settings.max_epochs if data.valid is not None else min(settings.max_epochs, _BLIND_EPOCHS)
    device = device_of(settings.device)
    loop = LoopSettings(settings.learning_rate, settings.batch_size, epochs, settings.patience, device)
    return _Plan(job, _spec_of(job, data), loop, data)


def _data(job: TrainingJob) -> _Data:
    """Z-scores of the training block, and all windows by them."""
    settings, split, n_leads, n_rows = job.settings, job.split, job.n_leads, job.table.n_rows
    case: ModelCase = settings.case_
    past, future = columns_of(job.table, case, settings.model, settings.time_encoding)
    early = slice(0, split.train_end)
    scaler = Scaler.of(job.target[early], past[early], future[early])
    n_past = int(case.pattern_days) * rows_per_day(job.table.step)
    # A window whose past is mostly padding teaches little: it is used only where windows are few.
    first = min(n_past - 1, split.train_end // 4)
    last = n_rows - 1 if split.valid_start is None else split.train_end - n_leads
    ahead = np.append((job.target - scaler.zeta_mean) / scaler.zeta_std, np.full(n_leads, np.nan))
    expected = None if job.base is None else job.base.expected(job.table)
    views = scaled_windows(job.table, past, future, scaler, expected, n_past, n_leads, after=n_leads)
    views["base"] = _base_windows(job, scaler)
    targets = padded_windows(ahead[1:], 0, 0, n_leads)
    train = Windows([views], [targets], torch.arange(first, max(last, first + 1)))
    valid = None
    if split.valid_start is not None:
        valid = train.choosing(torch.arange(split.valid_start - 1, n_rows - n_leads))
    return _Data(scaler, n_past, (past.shape[1], future.shape[1]), train, valid)


def _base_windows(job: TrainingJob, scaler: Scaler) -> Tensor:
    """The baseline's forecast from every row, 0 where there is none."""
    if job.base is None:
        return torch.zeros(job.table.n_rows, job.n_leads)
    forecast = job.base.forecast(job.table, np.arange(job.table.n_rows), job.n_leads)
    return torch.from_numpy(((forecast - scaler.zeta_mean) / scaler.zeta_std).astype(np.float32))


def _spec_of(job: TrainingJob, data: _Data) -> NetworkSpec:
    settings, case = job.settings, job.settings.case_
    sizes = {name: getattr(settings, name) for name in ("n_layers", "hidden_size", "activation", "dropout")}
    for name in ("n_channels", "filter_size", "pool_size"):
        # others do not read them: candidates that differ in nothing else are of equal shape
        sizes[name] = getattr(settings, name) if settings.model == "cnn" else 0
    return NetworkSpec(
        kind=settings.model,
        n_past=data.n_past,
        n_leads=job.n_leads,
        n_past_columns=data.n_columns[0],
        n_future_columns=data.n_columns[1],
        reads_zeta="zeta" in case.past,
        **sizes,
    )


def _finish(plan: _Plan, found: Sequence[Trained]) -> TrainedJob:
    """Choose among the repeats, or average them, and say how much of the correction to use."""
    losses = np.array([one.valid_loss for one in found])
    best = 0 if np.isnan(losses).all() else int(np.nanargmin(losses))
    used = list(range(len(found))) if plan.job.settings.repeats == "mean" else [best]
    weights = {name: torch.stack([found[i].weights[name] for i in used]) for name in found[0].weights}
    arrays = {name: value.numpy() for name, value in weights.items()}
    settings = plan.job.settings
    network = TrainedNetwork(plan.spec, settings.case_, settings.time_encoding, plan.data.scaler, arrays)
    weight = 1.0
    if plan.job.base is not None:
        weight = 0.0 if plan.data.valid is None else _correction_weight(plan, weights)
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
    inputs = cast(Windows, plan.data.valid).whole()
    target, known = inputs.pop("target"), inputs.pop("known").bool()
    zeta = inputs.pop("zeta").expand(n_members, -1, -1)
    correction = evaluate(stack, zeta, inputs).mean(dim=0).double() - inputs["base"].double()
    left = torch.where(known, (target - inputs["base"]).double(), 0.0)
    correction = torch.where(known, correction, 0.0)
    cross = (correction * left).sum(dim=1).numpy()
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
