"""The models of a study, fitted on its training rows and back-tested on the rows after them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Self

import pandas as pd
from sklearn.base import clone

from .._table import SETPOINT_ROLES, ZoneTable, plant_roles
from ..exceptions import TooFewDaysError
from ..model_selection import backtest
from ..model_selection.single_reading import read_once, takes_tables
from .compared_models import ALONE, HYBRID, StudyModel, identified_by
from .log_split import StudyData, without_setpoints
from .scores import INTERVAL
from .settings import Settings
from .zone_part import each_zone, measured_of, rows_of_zone, settings_of_zone

Progress = Callable[[int, int, str], None]  # called before every step with its number, the number of steps and a text


class StudySpan(NamedTuple):
    """Rows of a study as a frame, and as the table that all models of this package share."""

    frame: pd.DataFrame
    table: ZoneTable | None = None  # of several zones there is none

    @classmethod
    def of(cls, frame: pd.DataFrame, *, fits: bool) -> Self:
        """Read a frame of one zone once."""
        table = read_once(frame, fits=fits)
        return cls(frame, table if isinstance(table, ZoneTable) else None)

    @property
    def without_setpoints(self) -> StudySpan:
        """The same rows for a model that learns no thermostat."""
        table = self.table
        if table is not None:
            table = table.replace(inputs={k: v for k, v in table.inputs.items() if k not in SETPOINT_ROLES})
        return StudySpan(without_setpoints(self.frame), table)

    def given_to(self, model: Any) -> Any:
        """The rows as a model takes them."""
        if self.table is not None and takes_tables(model):
            return self.table
        return self.frame[list(getattr(model, "feature_names_in_", self.frame))]


class StudyTest(NamedTuple):
    """The rows that the models of a study are fitted to and tested on, and how."""

    settings: Settings
    train: StudySpan
    later: StudySpan
    start: pd.Timestamp  # of the test, in the later rows
    remarks: list[str]  # to which what is found on the way is added

    @classmethod
    def of(cls, settings: Settings, data: StudyData) -> Self:
        """The test of a study, with the remarks on its log."""
        train, later = (
            StudySpan(rows) if settings.zones else StudySpan.of(rows, fits=rows is data.train)
            for rows in (data.train, data.later)
        )
        return cls(settings, train, later, data.test_start, list(data.remarks))

    def of_zone(self, zone: str) -> StudyTest:
        """The same for one zone of several."""
        train, later = (StudySpan(rows_of_zone(span.frame, self.settings, zone)) for span in (self.train, self.later))
        return self._replace(settings=settings_of_zone(self.settings, zone), train=train, later=later)

    @property
    def without_setpoints(self) -> StudyTest:
        """The same for a model that learns no thermostat."""
        return self._replace(train=self.train.without_setpoints, later=self.later.without_setpoints)

    def fitted(self, estimator: Any) -> Any:
        """An estimator after its fit on the training rows."""
        return estimator.fit(self.train.given_to(estimator), measured_of(self.train.frame, self.settings))

    def backtest(self, model: Any, **given: Any) -> pd.DataFrame:
        """A back-test of a fitted model, with further arguments of :func:`skhybrid.model_selection.backtest`."""
        given |= {"horizon": self.settings.horizon, "origin_step": self.settings.origin_step, "start": self.start}
        return backtest(model, self.later.given_to(model), measured_of(self.later.frame, self.settings), **given)

    def backtest_with_intervals(self, model: Any, **given: Any) -> pd.DataFrame:
        """The same with the quantiles of :data:`INTERVAL`; a remark says why a model has not learned them."""
        try:
            return self.backtest(model, quantiles=INTERVAL, **given)
        except TooFewDaysError as error:
            self.remarks.append(f"no intervals are given: {error}")
            return self.backtest(model, **given)


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


def tested_models(models: Sequence[StudyModel], test: StudyTest, say: Callable[[str], None]) -> dict[str, TestedModel]:
    """All models by label, without those that fail; zones that know their neighbours also without them."""
    tested: dict[str, TestedModel] = {}
    for one in models:
        say(f"{one.label}: fit and back-test")
        try:
            tested[one.label] = made = _tested(one, test)
        except ValueError as error:
            if one.label in (HYBRID, identified_by(test.settings)):
                raise
            test.remarks.append(f"{one.label} was left out: {error}")
            continue
        if getattr(made.model, "coupled_", None):
            begun, alone = time.perf_counter(), made.model.without_neighbours()
            frame, note = test.backtest(alone), "the same model, without neighbours"
            tested[ALONE] = TestedModel(alone, frame, None, time.perf_counter() - begun, note)
    return tested


def _tested(one: StudyModel, test: StudyTest) -> TestedModel:
    """Fit a model on the training rows and back-test it on the rows after them."""
    begun, zones = time.perf_counter(), test.settings.zones
    if one.label == HYBRID:
        model = test.fitted(one.estimator)
        frame = test.backtest_with_intervals(model)
    elif zones:
        parts = [_tested(one._replace(estimator=clone(one.estimator)), test.of_zone(zone)) for zone in zones]
        named = [part.frame.assign(zone=zone) for part, zone in zip(parts, zones, strict=True)]
        model, frame = None, pd.concat(named, ignore_index=True)
    else:
        test = test.without_setpoints
        model = test.fitted(one.estimator)
        frame = test.backtest(model)
    seconds = time.perf_counter() - begun
    return TestedModel(model, frame, _needed_load(model, test), seconds, one.note)


def _needed_load(model: Any, test: StudyTest) -> pd.DataFrame | None:
    """The load that would have held the measured temperatures of the zones that something heats or cools."""
    if not hasattr(model, "predict_load") or getattr(model, "shared_plants_", ()):
        return None
    rows = {zone: rows_of_zone(test.later.frame, test.settings, zone) for zone in each_zone(test.settings)}
    held = {z: own["T_za"].interpolate(limit_direction="both") for z, own in rows.items() if plant_roles(own)}
    if not held:
        return None
    return model.predict_load(test.later.given_to(model), held if test.settings.zones else held[""])
