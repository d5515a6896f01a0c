"""Run a study: fit, back-test, compare, forecast the next day."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .._table import SETPOINT_ROLES, ZoneTable, is_plant, plant_roles
from .._warnings import recorded_warnings, warnings_dropped, without_python
from ..exceptions import PlanWarning
from ..model_selection import backtest
from ..model_selection.single_reading import read_once, takes_tables
from .compared_models import HYBRID, YESTERDAY, StudyModel, identified_by, make_models
from .identified_building import describe, parameter_table
from .judgement import Doubts, judge_load, judge_temperature, loads_by_rule, of_whole_plant
from .log_split import StudyData, inputs_of, setpoints_of, without_setpoints
from .scores import backtest_with_intervals, coverage_of, error_table, errors_by_model, interval_asked
from .setpoints_known import LOAD_INTERVAL, NOT_LEARNED, SetpointsKnown, unusable_setpoints
from .settings import Settings, is_scaled
from .verdict import Verdict

Progress = Callable[[int, int, str], None]  # called before every step with its number, the number of steps and a text


@dataclass
class StudyResult:
    """Results of a study.

    Parameters
    ----------
    settings : Settings
    data : StudyData
    model : fitted HybridPredictor, the model whose forecast is shown
    identification : fitted estimator
        The identification whose parameters describe the building: the model's own, or with the schedule model that of
        the two-stage model next to it.
    frames : dict of label to DataFrame
        Back-tests; the hybrid's with quantiles where there are intervals.
    table : DataFrame
        Index = label; ``rmse``, ``mae`` [K], ``load_rmse`` [kW], ``seconds``, ``note``; the best first.
    forecast : DataFrame, the next day
    zeta : Series, disturbance of the training rows as the identification estimates it [kW]
    parameters : DataFrame
        Index = name; ``value``, ``std``, ``unit``, ``lower``, ``upper``, ``description``, ``remark``.
    verdicts : list of Verdict
        On temperature and, where the plant's heat is known, on the load; where set-points were tested, on that test.
    warnings : list of str, all warnings, each once
    seconds : float
    building : DataFrame
        Index = quantity, such as "heat loss"; ``value``, ``std``, ``unit``, ``remark``.
    setpoints_known : SetpointsKnown, optional
        The back-test in which the heat is not known ahead; None for a log without set-points.
    """

    settings: Settings
    data: StudyData
    model: Any
    identification: Any
    frames: dict[str, pd.DataFrame]
    table: pd.DataFrame
    forecast: pd.DataFrame
    zeta: pd.Series
    parameters: pd.DataFrame
    verdicts: list[Verdict] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0.0
    building: pd.DataFrame = field(default_factory=pd.DataFrame)
    setpoints_known: SetpointsKnown | None = None

    @property
    def scaled(self) -> bool:
        """Whether the log fixes what a kW is."""
        return is_scaled(self.data.train, self.settings.capacities)

    @property
    def best(self) -> str:
        """Label of the model with the lowest day-ahead error."""
        return str(self.table.index[0])

    @property
    def coverage(self) -> float | None:
        """Share of the test measurements inside the intervals; None without intervals."""
        return coverage_of(self.frames[HYBRID])


class StudySpan(NamedTuple):
    """Rows of a study as a frame, and as the table that all models of this package share."""

    frame: pd.DataFrame
    table: Any

    @classmethod
    def of(cls, frame: pd.DataFrame, *, fits: bool = True) -> Self:
        """Read a frame once."""
        return cls(frame, read_once(frame, fits=fits))

    @property
    def without_setpoints(self) -> StudySpan:
        """The same rows for a model that learns no thermostat."""
        table = self.table
        if isinstance(table, ZoneTable):
            table = table.replace(inputs={k: v for k, v in table.inputs.items() if k not in SETPOINT_ROLES})
        return StudySpan(without_setpoints(self.frame), table)

    def given_to(self, model: Any) -> Any:
        if takes_tables(model) and self.table is not self.frame:
            return self.table
        return self.frame[list(getattr(model, "feature_names_in_", self.frame))]


class TestedModel(NamedTuple):
    """A model after its back-test."""

    model: Any
    frame: pd.DataFrame
    load: pd.DataFrame | None  # that would have held the measured temperature; None where nothing heats or cools
    seconds: float


def run_study(settings: Settings, data: StudyData, progress: Progress | None = None) -> StudyResult:
    """Fit the hybrid and the models it is compared with, back-test them at the same origins, forecast the next day.

    Parameters
    ----------
    settings : Settings
    data : StudyData
    progress : callable, optional, called with (number, total, text) before every step

    Returns
    -------
    StudyResult
        Errors, back-tests, the forecast of the next day, and what was identified; :func:`write_outputs` writes them.

    Raises
    ------
    ValueError
        If an input of the next day is missing, or the hybrid or the identification cannot be fitted or tested; any
        other model that fails is left out, with a warning.
    """
    refuse_holes(data, settings)
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, recorded_warnings() as caught:
        models = make_models(settings, memory=folder)
        say = counted(progress, len(models) + 1)
        remarks = list(data.remarks)
        train, later = spans = StudySpan.of(data.train), StudySpan.of(data.later, fits=False)
        tested = _test_all(models, settings, data.test_start, spans, say, remarks)
        say("forecast of the next day")
        identification = tested[identified_by(settings)].model.gray_box_
        model = tested[HYBRID].model.set_params(memory=None)  # the folder ends with this block
        yesterday = tested[YESTERDAY].frame
        held = SetpointsKnown.of(model, later.given_to(model), data, yesterday, settings, remarks)
        of_day = held if is_under_setpoints(held, unusable_setpoints(data.future), data, remarks) else None
        asked = interval_asked(tested[HYBRID].frame if of_day is None else of_day.frame, settings)
        forecast = _next_day(model, identification, data, asked, of_day is not None)
        zeta = identification.estimate_disturbance(train.given_to(identification), smooth=True)
        delivered = delivered_heat(identification, pd.concat([data.train, data.later]))
        rules = {} if delivered is None else loads_by_rule(data, delivered)
        of_stages = any(role.startswith("u_") for role in plant_roles(data.train))
        scale = identification if of_stages else None
        doubts = Doubts.of(model, later.given_to(model), data, scale, setpoints_known=of_day is not None)
    result = StudyResult(
        settings,
        data,
        model,
        identification,
        {label: one.frame for label, one in tested.items()},
        _compared(models, tested, identification, data, delivered, rules),
        forecast,
        zeta,
        parameter_table(identification),
        [],
        each_once(remarks, caught),
        time.perf_counter() - begun,
        describe(identification),
        held,
    )
    result.verdicts = _judged(result, tested[HYBRID].load, rules, delivered, doubts)
    return result


def _judged(
    result: StudyResult,
    load: pd.DataFrame | None,
    rules: dict[str, pd.Series],
    delivered: pd.Series | None,
    doubts: Doubts,
) -> list[Verdict]:
    """The verdicts on temperature and, where there is one, on the load [kW]."""
    own, yesterday = result.frames[HYBRID], result.frames[YESTERDAY]
    if result.setpoints_known is not None:
        return result.setpoints_known.verdicts(yesterday, doubts, scaled=result.scaled)
    out = [judge_temperature(own, yesterday, result.coverage, doubts.temperature)]
    if load is not None and delivered is not None:
        heat, start = _in_kilowatts(load, result.identification, result.data.later)["Q_hvac"], result.data.test_start
        out.append(judge_load(heat, rules, delivered, start, scaled=result.scaled, doubts=doubts.load))
    return out


def counted(progress: Progress | None, total: int) -> Callable[[str], None]:
    """A function that passes a text on to ``progress``, with its number and the total."""
    numbers = iter(range(1, total + 1))
    return lambda text: None if progress is None else progress(next(numbers), total, text)


def each_once(remarks: Sequence[str], caught: Sequence[warnings.WarningMessage]) -> list[str]:
    """Remarks and the warnings for a user, each once."""
    said = (w.message for w in caught if issubclass(w.category, UserWarning))
    return list(dict.fromkeys(map(without_python, [*remarks, *said])))


def _test_all(
    models: Sequence[StudyModel],
    settings: Settings,
    test_start: pd.Timestamp,
    spans: tuple[StudySpan, StudySpan],
    say: Callable[[str], None],
    remarks: list[str],
) -> dict[str, TestedModel]:
    """All models by label, without those that fail; what is worth a remark is added to ``remarks``."""
    tested = {}
    for one in models:
        say(f"{one.label}: fit and back-test")
        try:
            tested[one.label] = tested_model(one, settings, test_start, spans, remarks)
        except ValueError as error:
            if one.label in (HYBRID, identified_by(settings)):
                raise
            remarks.append(f"{one.label} was left out: {error}")
    return tested


def tested_model(
    one: StudyModel,
    settings: Settings,
    test_start: pd.Timestamp,
    spans: tuple[StudySpan, StudySpan],
    remarks: list[str],
) -> TestedModel:
    """Fit a model on the training rows and back-test it on the rows after them."""
    begun = time.perf_counter()
    train, later = (span if one.label == HYBRID else span.without_setpoints for span in spans)
    model = one.estimator.fit(train.given_to(one.estimator), train.frame["T_za"])
    rows: tuple[Any, Any] = (later.given_to(model), later.frame["T_za"])
    given: dict[str, Any] = {"horizon": settings.horizon, "origin_step": settings.origin_step, "start": test_start}
    if one.label == HYBRID:
        frame = backtest_with_intervals(model, *rows, remarks, **given)
    else:
        frame = backtest(model, *rows, **given)
    seconds, load = time.perf_counter() - begun, None
    if hasattr(model, "predict_load") and plant_roles(later.frame):
        load = model.predict_load(rows[0], later.frame["T_za"].interpolate(limit_direction="both"))
    return TestedModel(model, frame, load, seconds)


def _compared(
    models: Sequence[StudyModel],
    tested: dict[str, TestedModel],
    identification: Any,
    data: StudyData,
    delivered: pd.Series | None,
    rules: dict[str, pd.Series],
) -> pd.DataFrame:
    """The table of results, over the forecasts that every model made, the best first."""
    table = error_table(errors_by_model({name: one.frame for name, one in tested.items()}))
    loads = {
        name: _in_kilowatts(one.load, identification, data.later)["Q_hvac"]
        for name, one in tested.items()
        if one.load is not None and delivered is not None
    }
    table = table.assign(
        load_rmse=pd.Series({name: _load_error(load, delivered, data) for name, load in loads.items()}, dtype=float),
        seconds=pd.Series({name: one.seconds for name, one in tested.items()}),
        note=pd.Series({one.label: one.note for one in models if one.label in tested}),
    ).sort_values("rmse")
    for name, load in rules.items():
        table.loc[name, ["load_rmse", "note"]] = _load_error(load, delivered, data), "a rule for the load alone"
    return table.rename_axis("model")


def _load_error(load: pd.Series, delivered: pd.Series | None, data: StudyData) -> float:
    """RMSE [kW] between a load and the delivered heat in the test, where the temperature is known before and after."""
    rows = data.later
    known = rows["T_za"].notna() & rows["T_za"].shift(-1).notna() & (rows.index >= data.test_start)
    return float(np.sqrt(((load - delivered)[known[known].index] ** 2).mean()))


def _in_kilowatts(load: pd.DataFrame, identification: Any, rows: pd.DataFrame) -> pd.DataFrame:
    """A load of stages in kW by the identification's capacities, since other models have no certain scale."""
    load, stages = of_whole_plant(load), plant_roles(rows)
    if not stages or any(role.startswith("Q_") for role in stages):
        return load
    heat = {}
    for end in ("", "_unclipped") if f"{stages[0]}_unclipped" in load else ("",):
        by_role = load[[role + end for role in stages]].set_axis(stages, axis=1)
        heat["Q_hvac" + end] = delivered_heat(identification, by_role)
    return load.assign(**heat)


def delivered_heat(identification: Any, rows: pd.DataFrame) -> pd.Series | None:
    """Measured heat, or the stages times their identified capacities [kW]; None where nothing heats or cools."""
    theta = identification.theta_
    plant = [s for s in identification.network_.sources(rows.columns) if is_plant(s.role)]
    parts = [rows[s.role] * (1.0 if s.parameter is None else theta[s.parameter]) for s in plant]
    return sum(parts[1:], parts[0]) if parts else None


def refuse_holes(data: StudyData, settings: Settings) -> None:
    """Refuse a next day that cannot be forecast, before models are fitted for minutes; set-points may be missing."""
    ahead = inputs_of(data.future, settings.roles_of("T_za")).drop(columns=data.unplanned)
    holed = [one for name, one in ahead.items() if one.isna().any() and not str(name).startswith(SETPOINT_ROLES)]
    if holed or data.history.empty:
        what = f"{holed[0].name} is missing at {holed[0].isna().idxmax()}" if holed else "an input is missing before it"
        raise ValueError(f"the next day begins at {ahead.index[0]}, and {what}; fill it in or end the log earlier.")


def refuse_unplanned(data: StudyData, why_not: str) -> None:
    """Refuse a next day without heat that cannot be forecast under its set-points, and say ``why_not``."""
    if data.unplanned and why_not:
        raise ValueError(
            f"{data.unplanned[0]} is empty in the next day, from {data.future.index[0]}, which cannot be forecast "
            f"under its set-points: {why_not}; fill in the heat that is planned."
        )


def is_under_setpoints(held: object, unusable: str, data: StudyData, remarks: list[str]) -> bool:
    """True if the next day is forecast under its set-points; a day to come is under heat that is planned.

    ``held`` is the back-test under set-points, None where no thermostat was learned; ``unusable`` says why the
    set-points of the day cannot be used, and is empty where they can.
    """
    why_not = NOT_LEARNED if held is None else unusable
    refuse_unplanned(data, why_not)
    if held is None or not (data.held_out or data.unplanned):
        return False
    if why_not:
        remarks.append(f"the next day is forecast under its known heat: {why_not}")
    return not why_not


def _next_day(model: Any, identification: Any, data: StudyData, asked: Mapping[str, Any], of_day: bool) -> pd.DataFrame:
    """The forecast of the next day, with intervals as ``asked``, and what was measured of it.

    Under its set-points where ``of_day``, else under its heat.
    """
    with warnings_dropped(PlanWarning):  # the verdict says what lies beyond the training
        if of_day:
            out = _under_setpoints(model, identification, data, asked).join(setpoints_of(data.future))
        else:
            out = _under_known_heat(model, identification, data, asked)
    if data.held_out:
        out["T_za_measured"] = data.future["T_za"]
        heat = delivered_heat(identification, data.future)
        if heat is not None:
            out["Q_hvac_delivered"] = heat
    return out.rename_axis("time")


def _under_setpoints(model: Any, identification: Any, data: StudyData, asked: Mapping[str, Any]) -> pd.DataFrame:
    """Temperature and load under the set-points of the day, with intervals where there are any."""
    roles = plant_roles(data.future)
    out = model.forecast(data.history, data.future.drop(columns=["T_za", *roles]), **asked)
    if roles != ["Q_hvac"]:  # intervals are in the scale of the model
        out = _in_kilowatts(out, identification, data.future).drop(columns=list(LOAD_INTERVAL), errors="ignore")
    return out


def _under_known_heat(model: Any, identification: Any, data: StudyData, asked: Mapping[str, Any]) -> pd.DataFrame:
    """Temperature under the known heat, with its interval, and the load that holds the set-point."""
    whole = read_once(pd.concat([data.history, data.future.assign(T_za=np.nan)]), fits=False)
    parts: tuple[Any, Any] = (data.history, data.future)
    if isinstance(whole, ZoneTable):
        n_past = len(data.history)
        parts = (whole.rows(slice(n_past)), whole.rows(slice(n_past, None)))
    out = model.forecast(*parts, **asked)
    if plant_roles(data.future):
        load = model.predict_load(whole, data.setpoint.to_numpy()).loc[data.future.index]
        load = _in_kilowatts(load, identification, data.future)
        out = out.join(load.drop(columns=["zeta", "T_za"], errors="ignore"))
    out["setpoint"] = data.setpoint.loc[data.future.index]
    return out
