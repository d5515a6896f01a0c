"""Training jobs of several forecasters: networks of equal shape are trained as one stack."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from ..._time import rows_per_day
from ..cases import RECURRENT, ModelCase
from ..training_job import EPOCHS_WITHOUT_VALIDATION, JobResult, Split, TrainingJob
from .fitted import FittedNetwork, make_stack
from .spec import NetworkSpec
from .training import TrainingResult, TrainingSettings, one_thread, train_stack
from .windows import Scaler, Windows, WindowTable, padded_windows, scaled_views, window_columns

#: Networks of a stack: on a CPU more of them leave its caches; a GPU is busy only with many.
_LARGEST_STACK = {"cpu": 24, "other": 256}


class _Data(NamedTuple):
    """Z-scores and windows of a case, which all jobs of the same rows, baseline and case share."""

    scaler: Scaler
    n_past: int
    n_columns: tuple[int, int]  # of past and future
    train: Windows
    valid: Windows | None


class _Plan(NamedTuple):
    """A job with its network, settings and windows."""

    job: TrainingJob
    spec: NetworkSpec
    training: TrainingSettings
    data: _Data

    @property
    def shape(self) -> tuple[Any, ...]:
        """Key that plans of one stack share: equal networks, settings and numbers of windows."""
        return (self.spec.shape, self.training, self.job.base is not None, self.job.table.n_rows, self.job.split)


def train_networks(jobs: Sequence[TrainingJob], verbose: int = 0, on_error: str = "raise") -> list[Any]:
    """A JobResult of each job, to rounding as if alone; with ``on_error="return"`` an exception if it fails."""
    shared: dict[Any, _Data] = {}
    plans = {i: _attempt(on_error, _plan, job, shared) for i, job in enumerate(jobs)}
    results: dict[int, Any] = {i: plan for i, plan in plans.items() if isinstance(plan, Exception)}
    groups: dict[tuple[Any, ...], list[int]] = {}
    for i, plan in plans.items():
        if i not in results:
            groups.setdefault(plan.shape, []).append(i)
    for numbers in groups.values():
        trained = _attempt(on_error, _train_group, {i: plans[i] for i in numbers}, verbose)
        failed = isinstance(trained, Exception)
        results |= {i: trained if failed else _attempt(on_error, _finish, plans[i], trained[i]) for i in numbers}
    again = {i: made for i, job in enumerate(jobs) if (made := _refit(job, results[i])) is not None}
    if again:
        for i, one in zip(again, train_networks(list(again.values()), verbose, on_error), strict=True):
            # the first result knows the validation errors, the second has the network that saw all rows
            results[i] = one if isinstance(one, Exception) else results[i]._replace(network=one.network)
    return [results[i] for i in range(len(jobs))]


def _attempt(on_error: str, function: Callable[..., Any], *args: Any) -> Any:
    """The result of a function, or its exception where ``on_error="return"``."""
    try:
        return function(*args)
    except Exception as error:
        if on_error == "raise":
            raise
        return error


def _refit(job: TrainingJob, result: JobResult | Exception) -> TrainingJob | None:
    """The same training on all rows for as many epochs as validation found best; None where that is not wanted."""
    if isinstance(result, Exception) or not job.settings.refit or job.split.valid_start is None:
        return None
    used = result.repeats[result.repeats["used"]]
    return job._replace(
        base=None if job.base is None else job.whole_base,
        split=Split(job.table.n_rows, None),
        seeds=tuple(int(seed) for seed in used["seed"]),
        n_epochs=round(used["best_epoch"].median()),
    )


def _train_group(plans: dict[int, _Plan], verbose: int) -> dict[int, list[TrainingResult]]:
    """Train the networks of plans of one shape in stacks, shallow ones first."""
    ordered = _in_order({i: plan.spec for i, plan in plans.items()})
    networks = [(i, seed) for i in ordered for seed in plans[i].job.seeds]
    found: dict[tuple[int, int], TrainingResult] = {}
    device = plans[ordered[0]].training.device
    n_stacks = -(-len(networks) // _LARGEST_STACK["cpu" if device == "cpu" else "other"])
    for part in np.array_split(np.arange(len(networks)), n_stacks):
        chosen = [networks[k] for k in part]
        found.update(zip(chosen, _train([(plans[i], seed) for i, seed in chosen], verbose), strict=True))
    return {i: [found[i, seed] for seed in plan.job.seeds] for i, plan in plans.items()}


def _in_order(specs: dict[int, NetworkSpec]) -> list[int]:
    """Keys by depth, and by activation up and down in turn: neighbours share one, also where depths meet."""
    names = sorted({spec.activation for spec in specs.values()})
    depths = sorted({spec.n_layers for spec in specs.values()})

    def place(i: int) -> tuple[int, int]:
        rank = names.index(specs[i].activation)
        return specs[i].n_layers, -rank if depths.index(specs[i].n_layers) % 2 else rank

    return sorted(specs, key=place)


def _train(networks: Sequence[tuple[_Plan, int]], verbose: int) -> list[TrainingResult]:
    """Train (plan, seed) pairs of equal shape as one stack."""
    plans = [plan for plan, _ in networks]
    first = plans[0]
    train = Windows.joined([plan.data.train for plan in plans])
    validating = [plan.data.valid for plan in plans if plan.data.valid is not None]
    valid = Windows.joined(validating) if validating else None
    generators = [torch.Generator().manual_seed(seed) for _, seed in networks]
    stack = make_stack([plan.spec for plan in plans]).draw_weights(generators, corrects=first.job.base is not None)
    return train_stack(stack, generators, train, valid, first.training, verbose)


def torch_device(device: str) -> str:
    """The device to train on, refused if torch cannot use it; ``"auto"`` is a GPU where torch finds one."""
    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.empty(0, device=device)
    except (RuntimeError, AssertionError) as error:  # torch raises the second where it was built without a GPU
        raise ValueError(f"device={device!r} cannot be used here: {str(error).splitlines()[0]}") from None
    return device


def _plan(job: TrainingJob, shared: dict[Any, _Data]) -> _Plan:
    """Shape and settings of a job, and its windows, which ``shared`` may have from an earlier job."""
    settings, is_recurrent = job.settings, job.settings.model in RECURRENT
    rows = id(job.table), id(job.target), id(job.base), job.split, job.n_leads
    key = (*rows, settings.case_, settings.time_encoding, is_recurrent)
    if key not in shared:
        shared[key] = _data(job)
    data = shared[key]
    unstopped = job.n_epochs or min(settings.max_epochs, EPOCHS_WITHOUT_VALIDATION)
    n_epochs = settings.max_epochs if data.valid is not None else unstopped
    device = torch_device(settings.device)
    training = TrainingSettings(settings.learning_rate, settings.batch_size, n_epochs, settings.patience, device)
    return _Plan(job, _spec_of(job, data), training, data)


def _data(job: TrainingJob) -> _Data:
    """Z-scores of the training block, and all windows in them."""
    settings, split, n_leads = job.settings, job.split, job.n_leads
    case: ModelCase = settings.case_
    past, future = window_columns(job.table, case, settings.model, settings.time_encoding)
    early = slice(0, split.train_end)
    scaler = Scaler.of(job.target[early], past[early], future[early])
    n_past = case.pattern_days * rows_per_day(job.table.step)
    expected = None if job.base is None else job.base.expected(job.table)
    views = scaled_views(job.table, (past, future), scaler, expected, n_past, n_leads, after=n_leads)
    ahead = np.append((job.target - scaler.zeta_mean) / scaler.zeta_std, np.full(n_leads, np.nan))
    targets = padded_windows(ahead[1:], 0, 0, n_leads)
    table = WindowTable(settings.model, "zeta" in case.past, views, _base_windows(job, scaler), targets)
    # A window whose past is mostly padding teaches little: it is used only where windows are few.
    first = min(n_past - 1, split.train_end // 4)
    last = split.train_end - (1 if split.valid_start is None else n_leads)
    train = Windows([table], torch.arange(first, max(last, first + 1)))
    valid = None
    if split.valid_start is not None and split.valid_end is not None:
        valid = Windows([table], torch.arange(split.valid_start - 1, split.valid_end - n_leads))
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
    spec = NetworkSpec(settings.model, data.n_past, job.n_leads, *data.n_columns, "zeta" in case.past, **sizes)
    if spec.filter_size > spec.flat_width:
        raise ValueError(
            f"filter_size={spec.filter_size} is more than the {spec.flat_width} values of this case; give fewer."
        )
    return spec


def _finish(plan: _Plan, found: Sequence[TrainingResult]) -> JobResult:
    """Choose among the repeats, or average them, and find how much of the correction to use."""
    settings = plan.job.settings
    losses = np.array([one.valid_loss for one in found])
    best = 0 if np.isnan(losses).all() else int(np.nanargmin(losses))
    used = list(range(len(found))) if settings.repeats == "mean" else [best]
    last = np.array([one.history[-1]["train_loss"] for one in found])
    if not np.isfinite((last if plan.data.valid is None else losses)[used]).all():
        raise ValueError(f"training diverged with learning_rate={settings.learning_rate!r}; give a lower one.")
    weights = {name: torch.stack([found[i].weights[name] for i in used]).numpy() for name in found[0].weights}
    network = FittedNetwork(plan.spec, settings.case_, settings.time_encoding, plan.data.scaler, weights)
    weight = 1.0
    if plan.job.base is not None:
        weight = 0.0 if plan.data.valid is None else _correction_weight(plan, network)
    repeats = pd.DataFrame(
        {
            "seed": plan.job.seeds,
            "n_epochs": [len(one.history) for one in found],
            "train_loss": last,
            "valid_loss": losses,
            "best_epoch": [_best_epoch(one) for one in found],
            "used": [i in used for i in range(len(found))],
        }
    )
    return JobResult(network, weight, found[best].history, repeats)


def _best_epoch(result: TrainingResult) -> int:
    """The epoch, from 1, whose weights are kept."""
    # not the lowest error: one that is lower by next to nothing does not count as better
    kept = (int(e["epoch"]) for e in result.history if e.get("valid_loss") == result.valid_loss)
    return next(kept, len(result.history))


def _correction_weight(plan: _Plan, network: FittedNetwork) -> float:
    """Share in [0, 1] of the correction to use, by least squares on the validation block less one standard error."""
    # The block that stopped the training flatters it: without the discount, corrections that do not last are kept.
    stack = network.build()
    valid = cast(Windows, plan.data.valid)
    inputs, targets = valid.take(valid.chosen, stack.numbers)
    with torch.no_grad(), one_thread():
        forecast = stack(**inputs).mean(dim=0)
    base, target = inputs["base"][0], targets[0]
    known = torch.isfinite(target)
    correction = torch.where(known, forecast.double() - base.double(), 0.0)
    left = torch.where(known, (target - base).double(), 0.0)
    cross = (correction * left).sum(dim=1).numpy()
    power = (correction**2).sum(dim=1).numpy()
    return discounted_share(cross, power, n_blocks=max(2, len(target) // target.shape[1]))


def discounted_share(cross: np.ndarray, power: np.ndarray, n_blocks: int) -> float:
    """``sum(cross) / sum(power)`` [both (n_windows,)] less its jackknife standard error over blocks, in [0, 1]."""
    crosses, powers = (np.array([part.sum() for part in np.array_split(v, n_blocks)]) for v in (cross, power))
    rest = powers.sum() - powers
    if not np.isfinite(crosses).all() or not (rest > 0).all():
        return 0.0
    shares = (crosses.sum() - crosses) / rest
    error = np.sqrt((n_blocks - 1) / n_blocks * ((shares - shares.mean()) ** 2).sum())
    return float(np.clip(crosses.sum() / powers.sum() - error, 0.0, 1.0))
