"""Public functions that take a table, and the command line; and which public names are not called, and why."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from estimators import ESTIMATORS, NETWORKS, fitted
from outcomes import Printed
from sklearn.base import clone
from zone_tables import COLUMNS

from skhybrid import InputDisturbanceID, OutputDisturbanceID, cli
from skhybrid.datasets import make_office, regularize, weather_on_steps
from skhybrid.forecasting import fit_many
from skhybrid.hybrid import DriftMonitor
from skhybrid.identification import (
    autocorrelation,
    cross_correlation,
    cumulative_periodogram,
    diagnose,
    diagnose_residuals,
    identify_rooms,
    ljung_box,
    profile_likelihood,
)
from skhybrid.inspection import DisturbanceWeekDisplay, ForecastDisplay, LeadErrorDisplay, ResidualDisplay
from skhybrid.logs import LogReport
from skhybrid.model_selection import (
    DayAheadScorer,
    RollingOriginSplit,
    backtest,
    compare_models,
    day_ahead_scorer,
    quantile_scorer,
    score_backtest,
    score_intervals,
)
from skhybrid.persistence import load_model, save_model
from skhybrid.study import split_log
from skhybrid.thermal import building_network

_TWO = {"input": InputDisturbanceID("1R1C", n_starts=1), "output": OutputDisturbanceID("1R1C", n_starts=1)}
_PAIR = building_network(["a", "b"], [("a", "b")], room="1R1C", solar="q_sol")
_SETTINGS = """step = "1h"
horizon = "6h"
[columns]
T_za = "T_za"
T_oa = "T_oa"
q_sol = "q_sol"
u_heat = "u_heat"
u_cool = "u_cool"
[network]
name = "1R1C"
[estimator]
n_starts = 1
"""
#: texts of a configuration
SETTINGS = {
    "usual": _SETTINGS,
    "a zone": 'timezone = "Europe/Amsterdam"\n' + _SETTINGS,
    "in UTC": 'timezone = "UTC"\nlabel = "right"\n' + _SETTINGS,
    "few columns": 'step = "1h"\n[columns]\nT_za = "T_za"\nT_oa = "T_oa"\n',
    "other columns": 'step = "1h"\n[columns]\nT_za = "room"\nT_oa = "T_oa"\n',
    "a site": _SETTINGS + "[site]\nlatitude = 52.4\nlongitude = 4.9\n",
    "spans": _SETTINGS + '[train]\nend = 2024-10-27\n[test]\nstart = "2024-10-28"\n[load]\nsetpoint = 21.0\n',
    "another unit": _SETTINGS + '[units]\nT_za = "degF"\nT_oa = "K"\n',
    "another step": _SETTINGS.replace("1h", "15min"),
}


def _there_and_back(estimator: Any, X: Any) -> Any:
    """Predictions of a saved and loaded estimator, which are those of the estimator itself."""
    with tempfile.TemporaryDirectory() as folder:
        save_model(estimator, Path(folder) / "m")
        return load_model(Path(folder) / "m").predict(X)


def _command(X: Any, command: str, arguments: tuple[str, ...], config: str | None) -> None:
    """Run a command of the command line on a table that has been written to a file; a refusal on stderr is raised."""
    said, out = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        log.write_text(X.to_csv() if isinstance(X, pd.DataFrame | pd.Series) else str(X), encoding="utf-8")
        if config is not None:
            (Path(folder) / "zone.toml").write_text(SETTINGS[config], encoding="utf-8")
        given = [command, str(log), *(text.replace("FOLDER", folder) for text in arguments)]
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(out):
            code = cli.main(given)
        written = {path.name for path in (Path(folder) / "out").glob("*")}
    text = said.getvalue().replace(folder, "FOLDER")
    if code == 1 and text.startswith("skhybrid: error: ") and text.count("\n") == 1 and not written:
        raise Printed(text.removeprefix("skhybrid: error: ").strip())
    if code != 0 or (config is not None and "report.html" not in written) or not out.getvalue():
        raise RuntimeError(f"exit code {code}, {len(written)} files, and on stderr: {text}")


def _days(X: Any) -> Any:
    """The forecasts of the rows of a table that is taken for days."""
    return X * 0.99 if isinstance(X, pd.DataFrame) and all(map(pd.api.types.is_float_dtype, X.dtypes)) else X


def _steps_of(X: Any) -> pd.DatetimeIndex:
    """Steps of a quarter of an hour from the first stamp of a table."""
    index = getattr(X, "index", None)
    start = index[0] if isinstance(index, pd.DatetimeIndex) and len(index) else pd.Timestamp("2024-10-26", tz="UTC")
    return pd.date_range(start, periods=8, freq="15min")


def _as_backtest(X: Any) -> Any:
    """A table with the columns of a back-test, some of which are missing where the table has not theirs."""
    if not isinstance(X, pd.DataFrame):
        return X
    names = {"T_za": "y_true", "T_oa": "y_pred", "u_heat": "q_0.1", "u_cool": "q_0.9"}
    return X.drop(columns="q_sol", errors="ignore").rename(columns=names).assign(origin=0, lead=pd.Timedelta("1h"))


def _as_errors(X: Any) -> Any:
    """A table with the columns of one-step errors, which are missing where the table has not theirs."""
    names = {"T_za": "innovation", "T_oa": "std"}
    return X.rename(columns=names)[list(names.values())] if {*names} <= {*getattr(X, "columns", ())} else X


def _of_two_rooms(y: Any) -> Any:
    """The temperature of one room as that of two, the second colder."""
    return pd.DataFrame({"a": y, "b": y - 1.0}) if isinstance(y, pd.Series) and y.dtype.kind == "f" else y


def _column(X: Any) -> Any:
    return X["T_za"] if isinstance(X, pd.DataFrame) and "T_za" in X and X.columns.is_unique else X


def _shown(display: Any, estimator: str, *data: Any, **settings: Any) -> None:
    matplotlib.use("Agg")
    try:
        display.from_estimator(fitted(estimator), *data, **settings)
    finally:
        matplotlib.pyplot.close("all")


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "regularize": regularize,
    "backtest": lambda X, y, horizon, origin_step, start: backtest(
        fitted("ARXRegressor"), X, y, horizon=horizon or "6h", origin_step=origin_step, start=start
    ),
    "diagnose": lambda X, max_lag, level: diagnose(fitted("InputDisturbanceID"), X, max_lag=max_lag, level=level),
    "profile_likelihood": lambda X, y, parameter: profile_likelihood(
        clone(ESTIMATORS["InputDisturbanceID"]), X, y, parameter
    ),
    "fit_many": lambda X, y: fit_many([clone(ESTIMATORS["DisturbanceForecaster, profile"])], X, y)[0],
    "fit_many, networks": lambda X, y: fit_many([clone(ESTIMATORS[NETWORKS[0]])] * 2, X, y)[1],
    "split_log": split_log,
    "save and load, ARXRegressor": lambda X: _there_and_back(fitted("ARXRegressor"), X),
    "save and load, HybridPredictor": lambda X: _there_and_back(fitted("HybridPredictor"), X),
    "save and load, mlp": lambda X: _there_and_back(fitted(NETWORKS[0]), X),
    "compare_models": lambda X, y, purpose: compare_models(_TWO, X, y, purpose=purpose, horizon="6h"),
    "DayAheadScorer, ARXRegressor": lambda X, y, horizon, origin_step: DayAheadScorer(horizon or "6h", origin_step)(
        fitted("ARXRegressor"), X, y
    ),
    "day_ahead_scorer, ARXRegressor": lambda X, y: day_ahead_scorer(fitted("ARXRegressor"), X, y),
    "quantile_scorer, ARXRegressor": lambda X, y: quantile_scorer(fitted("ARXRegressor"), X, y),
    "quantile_scorer, Pipeline": lambda X, y: quantile_scorer(fitted("Pipeline"), X, y),
    "score_backtest": lambda X, by: score_backtest(_as_backtest(X), by),
    "score_intervals": lambda X, by: score_intervals(_as_backtest(X), by),
    "RollingOriginSplit": lambda X, train: list(RollingOriginSplit(train=train, test="6h").split(X)) and None,
    "DriftMonitor.fit": lambda X: DriftMonitor().fit(X, _days(X)).mean_,
    "DriftMonitor.watch": lambda X: DriftMonitor().fit(_DAYS, _DAYS + 1.0).watch(X, _days(X)),
    "diagnose_residuals": lambda X, max_lag, level: (
        diagnose_residuals(_as_errors(X), max_lag=max_lag, level=level).tests
    ),
    "autocorrelation": lambda X: autocorrelation(_column(X), 3),
    "cross_correlation": lambda X: cross_correlation(_column(X), _column(X), [0, 1]),
    "cumulative_periodogram": lambda X: cumulative_periodogram(_column(X)),
    "ljung_box": lambda X: ljung_box(_column(X), [1, 2]),
    "weather_on_steps": lambda X: weather_on_steps(X, _steps_of(X)),
    "make_office": lambda X: make_office(1, weather=X, sampling_time="1h", start="2024-10-26", random_state=0).X,
    "ForecastDisplay, ARXRegressor": lambda X, y: _shown(ForecastDisplay, "ARXRegressor", X, y, horizon="6h"),
    "LeadErrorDisplay, ARXRegressor": lambda X, y: _shown(LeadErrorDisplay, "ARXRegressor", X, y, horizon="6h"),
    "DisturbanceWeekDisplay": lambda X, kind: _shown(DisturbanceWeekDisplay, "InputDisturbanceID", X, kind=kind),
    "ResidualDisplay": lambda X, max_lag: _shown(ResidualDisplay, "InputDisturbanceID", X, max_lag=max_lag),
    "skhybrid run": lambda X, config: _command(
        X, "run", ("--config", "FOLDER/zone.toml", "--out", "FOLDER/out", "--quiet"), config
    ),
    "skhybrid check": lambda X: _command(X, "check", ("--quiet",), None),
    "LogReport": lambda X: None if str(LogReport(X)) else "no text",
    "identify_rooms": lambda X, y: identify_rooms(InputDisturbanceID(_PAIR, n_starts=1), X, _of_two_rooms(y)).theta,
}
_DAYS = pd.DataFrame(
    np.random.default_rng(0).normal(21.0, 1.0, (14, 5)), pd.date_range("2024-10-01", periods=14), list(COLUMNS)
)
#: functions whose tables are not of a zone, or whose refusals begin later: no value is known to be a lie
NO_ZONE = (
    "score_", "RollingOriginSplit", "DriftMonitor", "autocorrelation", "cross_correlation", "cumulative_periodogram",
    "ljung_box", "diagnose_residuals", "make_office", "weather_on_steps", "skhybrid run",
    "skhybrid check", "LogReport", "identify_rooms",
)  # fmt: skip

_MADE, _NUMBERS = "is made by what is called", "takes names and numbers, no table"
_SAMPLES = "samples for seconds from the table of a search"
#: public names that are neither estimators nor functions above
NOT_CALLED = {
    **dict.fromkeys(("RegularizeReport", "RawLog", "ModelComparison", "Diagnostics", "ProfileLikelihood"), _MADE),
    **dict.fromkeys(("Identifiability", "StudyData", "StudyModel", "AffineForecast", "ControlModel"), _MADE),
    **dict.fromkeys(
        (
            "load_small_office",
            "load_dutch_home",
            "load_benchmark",
            "BenchmarkLog",
            "make_prbs",
            "make_house",
            "make_weather",
            "ModelCase",
            "list_cases",
        ),
        _NUMBERS,
    ),
    **dict.fromkeys(("list_sizes", "GainStatistics", "StateSpace", "make_state_space", "step_response"), _NUMBERS),
    **dict.fromkeys(("frequency_response", "BodeDisplay", "StepResponseDisplay", "ScheduleDisplay"), _NUMBERS),
    **dict.fromkeys(("DesignMatrix", "design_matrix", "Parameter", "Source", "draw"), _NUMBERS),
    **dict.fromkeys(("list_networks", "MatrixBuilder", "WeatherError", "show_versions"), _NUMBERS),
    **dict.fromkeys(("read_zone_csv", "read_epw", "read_weather"), "the targets csv and logs"),
    **dict.fromkeys(("Settings", "read_settings", "read_log", "make_models"), "the target toml"),
    **dict.fromkeys(("RCNetwork", "get_network"), "the target toml"),
    **dict.fromkeys(("building_network", "room_network"), _NUMBERS),
    "RoomFits": _MADE,
    "FleetPrior": "is learned from fitted models, no table",
    "find_adjacency": "needs more days than the tables have",
    "propose_settings": "skhybrid check, and the targets csv and toml",
    **dict.fromkeys(("run_study", "write_outputs", "write_report", "StudyResult", "Yesterday"), "skhybrid run"),
    **dict.fromkeys(("PatternExpressiveness", "RobustnessComparison", "select_case", "CaseChoice"), _SAMPLES),
    **dict.fromkeys(("RobustnessDisplay", "PosteriorDisplay", "sample_posterior", "Posterior"), _SAMPLES),
    **dict.fromkeys(("plan_experiment", "ExperimentPlan"), "simulates a week many times, for seconds"),
    **dict.fromkeys(("DayAheadDisplay", "ProfileDisplay", "RoomMapDisplay"), "draws what another call has made"),
    **dict.fromkeys(
        ("save_model", "load_model", "load_metadata", "load_model_and_metadata"), "save and load, and the target model"
    ),
    **dict.fromkeys(
        ("ZoneModel", "ZoneFolder", "DayAhead", "day_ahead", "to_left_label"), "of the tables that read_log returns"
    ),
    **dict.fromkeys(("emhass_parameters", "EmhassExport"), "reads a fitted gray box and settings"),
    **dict.fromkeys(("ZoneFleet", "FleetFolder", "FleetTick"), "takes many zones; see test_fleet.py"),
}
