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
from .rivals import HYBRID, Rival, make_rivals
from .settings import Settings

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
    frames : dict of label to DataFrame
        Back-tests.
    table : DataFrame
        Index = label; ``rmse``, ``mae`` [K], ``load_rmse`` [kW], ``seconds``, ``note``; the best first.
    forecast : DataFrame
        The next day.
    zeta : Series
        Estimated disturbance of the training rows [kW].
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
        If the hybrid cannot be fitted or tested; a rival that cannot is left out, with a warning.
    """
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rivals = make_rivals(settings, memory=folder)
        say = _counted(progress, len(rivals) + 1)
        frames, rows, fitted = {}, {}, {}
        stuck = standstill(pd.concat([data.train["T_za"], data.later["T_za"]]))
        remarks = [] if stuck is None else [stuck]
        for rival in rivals:
            say(f"{rival.label}: fit and back-test")
            try:
                fitted[rival.label], frames[rival.label], rows[rival.label] = _compete(rival, settings, data)
            except ValueError as error:
                if rival.label == HYBRID:
                    raise
                remarks.append(f"{rival.label} was left out: {error}")
        say("forecast of the next day")
        model = fitted[HYBRID].set_params(memory=None)  # the folder ends with this block
        forecast = _next_day(model, data)
        zeta = model.gray_box_.estimate_disturbance(data.train, smooth=True)
    texts = [str(w.message) for w in caught if issubclass(w.category, UserWarning)]
    return StudyResult(
        settings,
        data,
        model,
        frames,
        _compared(frames, rows),
        forecast,
        zeta,
        _parameters(model.gray_box_),
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
    frame = backtest(
        model,
        data.later,
        data.later["T_za"],
        horizon=settings.horizon,
        origin_step=settings.origin_step,
        start=data.test_start,
    )
    seconds = time.perf_counter() - begun
    return model, frame, {"load_rmse": _load_error(model, data), "seconds": seconds, "note": rival.note}


def _load_error(model: Any, data: StudyData) -> float:
    """RMSE [kW] of the heat that would have held the measured temperature, against the heat that was delivered."""
    rows = data.later
    delivered = delivered_heat(model, rows)
    if not hasattr(model, "predict_load") or delivered is None:
        return np.nan
    held = rows["T_za"].interpolate(limit_direction="both")
    wanted = model.predict_load(rows, held)["Q_hvac"]
    known = rows["T_za"].notna() & rows["T_za"].shift(-1).notna() & (rows.index >= data.test_start)
    error = (wanted - delivered)[known]
    return float(np.sqrt((error**2).mean()))


def delivered_heat(model: Any, rows: pd.DataFrame) -> pd.Series | None:
    """Measured heat, or the stages times their identified capacities [kW]; None where nothing heats or cools.

    Parameters
    ----------
    model : fitted estimator
        A gray box, or a predictor that holds one as ``gray_box_``.
    rows : DataFrame
        One column a role.

    Returns
    -------
    Series or None
    """
    gray_box = getattr(model, "gray_box_", model)
    network, theta = getattr(gray_box, "network_", None), getattr(gray_box, "theta_", {})
    if network is None:
        return None
    plant = [s for s in network.sources(rows.columns) if s.role.startswith(("Q_", "u_"))]
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


def _next_day(model: Any, data: StudyData) -> pd.DataFrame:
    """Temperature under the known control, and the load that holds the set-point."""
    out = model.forecast(data.history, data.future)
    unknown = data.future.assign(T_za=np.nan)
    whole = pd.concat([data.history, unknown])
    if delivered_heat(model, data.future) is not None:
        load = model.predict_load(whole, data.setpoint.to_numpy()).loc[data.future.index]
        out = out.join(load.drop(columns=["zeta", "T_za"], errors="ignore"))
    out["setpoint"] = data.setpoint.loc[data.future.index]
    if data.held_out:
        out["T_za_measured"] = data.future["T_za"]
        heat = delivered_heat(model, data.future)
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
