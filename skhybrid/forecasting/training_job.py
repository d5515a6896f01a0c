"""The training job of a forecaster's networks: its split of the rows, its seeds, and its result."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._table import ZoneTable
from .._warnings import several

#: Epochs of a network without a validation block, which says when to stop.
EPOCHS_WITHOUT_VALIDATION = 20


class Split(NamedTuple):
    """A chronological split of the rows of a training table."""

    train_end: int  # targets of training lie before this row
    valid_start: int | None  # targets of validation begin here; None: there is no validation block
    valid_end: int | None = None  # and lie before this row


def chronological_split(n_rows: int, n_leads: int, fraction: float, per_day: int) -> Split:
    """Validate on the last ``fraction`` of the rows, one horizon after training; on none if either were too short."""
    n_valid = round(fraction * n_rows)
    valid_start = n_rows - n_valid
    train_end = valid_start - n_leads
    if n_valid <= n_leads or 0 < train_end < 2 * max(per_day, n_leads):
        return Split(n_rows, None)
    if train_end <= 0:
        raise ValueError(
            f"validation_fraction={fraction:g} of {several(n_rows, 'row')} leaves none before a gap of one horizon to "
            "train on; give a smaller one."
        )
    return Split(train_end, valid_start, n_rows)


def measured_split(target: np.ndarray, n_leads: int, fraction: float, per_day: int) -> Split:
    """:func:`chronological_split` of the rows up to the last one whose target (n_rows,) is not missing."""
    known = np.flatnonzero(np.isfinite(target))
    split = chronological_split(int(known[-1]) + 1, n_leads, fraction, per_day)
    if known[0] >= split.train_end:
        raise ValueError(
            f"Input y contains NaN in all of its first {split.train_end} rows, which train a network; choose another "
            "span, or a smaller validation_fraction."
        )
    return split


class TrainingJob(NamedTuple):
    """The networks of one forecaster: the same settings and rows, one network per seed."""

    settings: Any  # DisturbanceForecaster: its constructor's arguments and ``case_``
    table: ZoneTable  # training table with history ``zeta``
    target: np.ndarray  # (n_rows,), NaN where missing
    base: Any  # the baseline to correct, fitted before the validation block; None: there is none
    split: Split
    n_leads: int  # rows of the horizon
    seeds: tuple[int, ...]  # of weights, dropout and batches
    whole_base: Any = None  # the baseline to correct, fitted on all rows
    n_epochs: int | None = None  # of a refit; None: as validation says


class JobResult(NamedTuple):
    """Result of a job."""

    network: Any  # FittedNetwork: the network that is used, or all of them, to be averaged
    weight: float  # share in [0, 1] of its correction that is used; 1 where there is no baseline
    history: list[dict[str, float]]  # epochs of the network with the lowest validation error
    repeats: pd.DataFrame  # one row per seed, as ``DisturbanceForecaster.repeats_``


def repeat_seeds(seed: int, n_repeats: int) -> tuple[int, ...]:
    """A seed for each of several networks: the first is ``seed`` itself, so that one network is the first of ten."""
    others = np.random.SeedSequence(seed).generate_state(n_repeats)
    return (seed, *(int(value) for value in others[: n_repeats - 1]))
