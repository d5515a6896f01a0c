"""The models of a study, fitted on its training rows and back-tested on the rows after them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd
from sklearn.base import clone

from .._table import plant_roles
from .compared_models import ALONE, HYBRID, StudyModel, identified_by
from .scores import backtest_of, backtest_with_intervals
from .zone_part import Study, measured_of

Progress = Callable[[int, int, str], None]  # called before every step with its number, the number of steps and a text


class TestedModel(NamedTuple):
    """A model after its back-test."""

    model: Any  # None where it was fitted to each of several zones
    frame: pd.DataFrame
    load: pd.DataFrame | None  # that would have held the measured temperature; None where nothing heats or cools
    seconds: float
    note: str


def counted(progress: Progress | None, total: int) -> Callable[[str], None]:
    """A function that passes a text on to ``progress``, with its number and the total."""
    numbers = iter(range(1, total + 1))
    return lambda text: None if progress is None else progress(next(numbers), total, text)


def tested_models(models: Sequence[StudyModel], study: Study, say: Callable[[str], None]) -> dict[str, TestedModel]:
    """All models by label, without those that fail; zones that know their neighbours also without them."""
    tested: dict[str, TestedModel] = {}
    for one in models:
        say(f"{one.label}: fit and back-test")
        try:
            tested[one.label] = made = _tested(one, study)
        except ValueError as error:
            if one.label in (HYBRID, identified_by(study.settings)):
                raise
            study.remarks.append(f"{one.label} was left out: {error}")
            continue
        if getattr(made.model, "coupled_", None):
            begun, alone = time.perf_counter(), made.model.without_neighbours()
            frame, note = backtest_of(alone, study), "the same model, without neighbours"
            tested[ALONE] = TestedModel(alone, frame, None, time.perf_counter() - begun, note)
    return tested


def _tested(one: StudyModel, study: Study) -> TestedModel:
    """Fit a model on the training rows and back-test it on the rows after them."""
    begun = time.perf_counter()
    if one.label == HYBRID:
        model = _fitted(one.estimator, study)
        frame = backtest_with_intervals(model, study)
    elif study.settings.zones:
        parts = {zone: _tested(one._replace(estimator=clone(one.estimator)), s) for zone, s in study.by_zone.items()}
        named = [part.frame.assign(zone=zone) for zone, part in parts.items()]
        model, frame = None, pd.concat(named, ignore_index=True)
    else:
        study = study.without_setpoints
        model = _fitted(one.estimator, study)
        frame = backtest_of(model, study)
    seconds = time.perf_counter() - begun
    return TestedModel(model, frame, _needed_load(model, study), seconds, one.note)


def _fitted(estimator: Any, study: Study) -> Any:
    return estimator.fit(study.rows_for(estimator)[0], measured_of(study.data.train, study.settings))


def _needed_load(model: Any, study: Study) -> pd.DataFrame | None:
    """The load that would have held the measured temperatures of the zones that something heats or cools."""
    if not hasattr(model, "predict_load") or getattr(model, "shared_plants_", False):
        return None
    rows = {zone: own.data.later for zone, own in study.by_zone.items() if plant_roles(own.data.later)}
    if not rows:
        return None
    held = {zone: own["T_za"].interpolate(limit_direction="both") for zone, own in rows.items()}
    return model.predict_load(study.rows_for(model)[1], held if study.settings.zones else held[""])


def needed_loads(tested: Mapping[str, TestedModel]) -> dict[str, pd.DataFrame]:
    """The loads of the models that have one, by label."""
    return {label: one.load for label, one in tested.items() if one.load is not None}
