"""Run a study: fit, back-test, compare, forecast the next day."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from ..model_selection import backtest
from .data import StudyData, standstill
from .models import HYBRID, Rival, identifies, make_models
from .settings import Settings

#: quantiles of the intervals that are shown: 80 % lie between them.
INTERVAL = (0.1, 0.9)
#: says what is being done: number of the step, number of steps, text.
Progress = Callable[[int, int, str], None]


@dataclass
class StudyResult:
    """What a study found.

    Parameters
    ----------
    settings : Settings
        What was asked for.
    data : StudyData
        The rows it was done on.
    model : fitted HybridPredictor
        The one whose forecast is shown.
    identification : fitted estimator
        The one whose parameters tell of the building; the model's own, but for the default scheme.
    frames : dict of label to DataFrame
        Back-tests; the hybrid's with the quantiles of :data:`INTERVAL` where there are intervals.
    table : DataFrame
        Index = label; ``rmse``, ``mae`` [K], ``load_rmse`` [kW], ``seconds``, ``note``; the best first.
    forecast : DataFrame
        The next day.
    zeta : Series
        Disturbance of the training rows as the identification estimates it [kW].
    parameters : DataFrame
        Index = name; ``value``, ``std``, ``unit``, ``lower``, ``upper``, ``description``, ``remark``.
    warnings : list of str
        What was warned of.
    seconds : float
        How long it took.
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
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def best(self) -> str:
        """Label of the lowest day-ahead error."""
        return str(self.table.index[0])

    @property
    def coverage(self) -> float | None:
        """Share of the test measurements that lay within the intervals; None where there are none."""
        frame = self.frames[HYBRID].dropna(subset="y_true")
        low, high = (f"q_{level:g}" for level in INTERVAL)
        return float(frame["y_true"].between(frame[low], frame[high]).mean()) if low in frame else None


def run_study(settings: Settings, data: StudyData, progress: Progress | None = None) -> StudyResult:
    """Fit the hybrid and its rivals, back-test them at the same origins, and forecast the next day.

    Parameters
    ----------
    settings : Settings
        What to fit and how to test.
    data : StudyData
        The rows to do it on.
    progress : callable, optional
        Called with (number, total, text) before every step.

    Returns
    -------
    StudyResult

    Raises
    ------
    ValueError
        If the hybrid or the identification cannot be fitted or tested; a rival that cannot is left out, with a
        warning.
    """
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rivals = make_models(settings, memory=folder)
        say = _counted(progress, len(rivals) + 1)
        frames, rows, fitted, loads = {}, {}, {}, {}
        stuck = standstill(pd.concat([data.train["T_za"], data.later["T_za"]]))
        remarks = [] if stuck is None else [stuck]
        for rival in rivals:
            say(f"{rival.label}: fit and back-test")
            try:
                fitted[rival.label], frames[rival.label], rows[rival.label] = _compete(rival, settings, data)
                loads[rival.label] = _held_load(fitted[rival.label], data)
            except ValueError as error:
                if rival.label in (HYBRID, identifies(settings)):
                    raise
                remarks.append(f"{rival.label} was left out: {error}")
        say("intervals, and forecast of the next day")
        identification = fitted[identifies(settings)].gray_box_
        for label in frames:
            rows[label]["load_rmse"] = _load_error(loads[label], identification, data)
        model = fitted[HYBRID].set_params(memory=None)  # the folder ends with this block
        quantiles: tuple[float, float] | None = INTERVAL
        try:
            frames[HYBRID] = _backtest(model, settings, data, quantiles)
        except ValueError as error:
            remarks.append(f"no intervals are given: {error}")
            quantiles = None
        forecast = _next_day(model, identification, data, quantiles)
        zeta = identification.estimate_disturbance(data.train[list(identification.feature_names_in_)], smooth=True)
    texts = [str(w.message) for w in caught if issubclass(w.category, UserWarning)]
    return StudyResult(
        settings,
        data,
        model,
        identification,
        frames,
        _compared(frames, rows),
        forecast,
        zeta,
        _parameters(identification),
        list(dict.fromkeys([*remarks, *texts])),
        time.perf_counter() - begun,
    )


def _counted(progress: Progress | None, total: int) -> Callable[[str], None]:
    numbers = iter(range(1, total + 1))

    def say(text: str) -> None:
        if progress is not None:
            progress(next(numbers), total, text)

    return say


def _compete(rival: Rival, settings: Settings, data: StudyData) -> tuple[Any, pd.DataFrame, dict[str, Any]]:
    """Fit a rival on the training rows; its back-test, and its row of the table but for the scores."""
    begun = time.perf_counter()
    model = rival.estimator.fit(data.train, data.train["T_za"])
    frame = _backtest(model, settings, data)
    seconds = time.perf_counter() - begun
    return model, frame, {"load_rmse": np.nan, "seconds": seconds, "note": rival.note}


def _backtest(
    model: Any, settings: Settings, data: StudyData, quantiles: tuple[float, float] | None = None
) -> pd.DataFrame:
    return backtest(
        model,
        data.later,
        data.later["T_za"],
        horizon=settings.horizon,
        origin_step=settings.origin_step,
        start=data.test_start,
        quantiles=quantiles,
    )


def _held_load(model: Any, data: StudyData) -> pd.DataFrame | None:
    """What would have held the measured temperature; None where nothing heats or cools."""
    if not hasattr(model, "predict_load") or not _plant_roles(data.later):
        return None
    return model.predict_load(data.later, data.later["T_za"].interpolate(limit_direction="both"))


def _plant_roles(rows: pd.DataFrame) -> list[str]:
    return [str(role) for role in rows if str(role).startswith(("Q_", "u_"))]


def _load_error(load: pd.DataFrame | None, identification: Any, data: StudyData) -> float:
    """RMSE [kW] of the heat that would have held the measured temperature, against the heat that was delivered."""
    rows = data.later
    delivered = delivered_heat(identification, rows)
    if load is None or delivered is None:
        return np.nan
    known = rows["T_za"].notna() & rows["T_za"].shift(-1).notna() & (rows.index >= data.test_start)
    error = (_in_kilowatts(load, identification, rows)["Q_hvac"] - delivered)[known]
    return float(np.sqrt((error**2).mean()))


def _in_kilowatts(load: pd.DataFrame, identification: Any, rows: pd.DataFrame) -> pd.DataFrame:
    """A load of stages alone in kW of the identification's capacities, which then are those of every model.

    Temperatures do not tell the scale of a network, and a model may bend what a stage gives: the kW of two models could
    not be compared.
    """
    stages = _plant_roles(rows)
    if not stages or any(role.startswith("Q_") for role in stages):
        return load
    asked = {}
    for end in ("", "_unclipped"):  # a stage whose capacity came out as 0 is not asked for anything
        by_role = load.reindex(columns=[role + end for role in stages], fill_value=0.0).set_axis(stages, axis=1)
        asked["Q_hvac" + end] = delivered_heat(identification, by_role)
    return load.assign(**asked)


def delivered_heat(identification: Any, rows: pd.DataFrame) -> pd.Series | None:
    """Measured heat, or the stages times their identified capacities [kW]; None where nothing heats or cools.

    Parameters
    ----------
    identification : fitted estimator
        With ``network_`` and ``theta_``.
    rows : DataFrame
        One column a role.

    Returns
    -------
    Series or None
    """
    theta = identification.theta_
    plant = [s for s in identification.network_.sources(rows.columns) if s.role.startswith(("Q_", "u_"))]
    parts = [rows[s.role] * (1.0 if s.parameter is None else theta[s.parameter]) for s in plant]
    return sum(parts[1:], parts[0]) if parts else None


def _compared(frames: dict[str, pd.DataFrame], rows: dict[str, dict[str, Any]]) -> pd.DataFrame:
    """The table of results, over the forecasts that every model made, the best first."""
    errors = pd.DataFrame({label: frame["y_pred"] - frame["y_true"] for label, frame in frames.items()}).dropna()
    if errors.empty:
        raise ValueError("no forecast of the test span meets a measurement; choose another [test] span.")
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.insert(0, "rmse", np.sqrt((errors**2).mean()))
    table.insert(1, "mae", errors.abs().mean())
    return table.sort_values("rmse").rename_axis("model")


def _next_day(model: Any, identification: Any, data: StudyData, quantiles: tuple[float, float] | None) -> pd.DataFrame:
    """Temperature under the known control with its interval, and the load that holds the set-point."""
    out = model.forecast(data.history, data.future, quantiles=quantiles)
    unknown = data.future.assign(T_za=np.nan)
    whole = pd.concat([data.history, unknown])
    heat = delivered_heat(identification, data.future)
    if heat is not None:
        load = model.predict_load(whole, data.setpoint.to_numpy()).loc[data.future.index]
        load = _in_kilowatts(load, identification, data.future)
        out = out.join(load.drop(columns=["zeta", "T_za"], errors="ignore"))
    out["setpoint"] = data.setpoint.loc[data.future.index]
    if data.held_out:
        out["T_za_measured"] = data.future["T_za"]
        if heat is not None:
            out["Q_hvac_delivered"] = heat
    return out.rename_axis("time")


def _parameters(gray_box: Any) -> pd.DataFrame:
    """Identified parameters with units, standard errors, bounds and a remark on each doubtful one."""
    table = pd.DataFrame({"value": gray_box.theta_, "std": gray_box.theta_std_})
    searched = {p.name: p for p in gray_box.parameters_}
    for column in ("unit", "lower", "upper", "description"):
        table[column] = [getattr(searched[str(name)], column) for name in table.index]
    found = getattr(gray_box, "identifiability_", None)
    relative = (table["std"] / table["value"].abs()).to_numpy(dtype=float)
    remark = np.where(relative > 0.5, "uncertain by more than half", "")
    margin = 1e-6 * (table["upper"] - table["lower"])
    outside = (table["value"] <= table["lower"] + margin) | (table["value"] >= table["upper"] - margin)
    for text, names in (
        ("at its bound", (*table.index[outside], *getattr(found, "at_bound", ()))),
        ("no data moved it", getattr(found, "not_excited", ())),
        ("given, not identified", tuple(gray_box.known or ())),
    ):
        remark = np.where(table.index.isin(names), text, remark)
    return table.assign(remark=remark).rename_axis("parameter")
