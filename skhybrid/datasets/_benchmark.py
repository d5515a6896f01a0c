"""The public benchmark of day-ahead room temperature: frozen logs, splits and origins."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import pandas as pd

from .._arguments import check_integer
from ._office import make_office
from ._shipped_logs import load_dutch_home, load_small_office

STEP = pd.Timedelta("15min")
#: first and last day of the training, first and last day of the test
OFFICE_SPANS = ("2018-09-03", "2018-10-14", "2018-10-22", "2018-12-15")
_HOME_TRAINING_ENDS = {1: "2021-12-12", 2: "2021-11-30", 3: "2021-11-30"}
_TRAIN_DAYS, _TEST_DAYS = 28, 26 * 7
#: latitude and longitude [deg]: the weather station; the middle of the Netherlands, since the homes' sites are unknown
CHICAGO, NETHERLANDS = (41.98, -87.92), (52.1, 5.2)


@dataclass(frozen=True)
class BenchmarkLog:
    """A log of the benchmark, cut into training and what follows it.

    Attributes
    ----------
    name : str
    train : DataFrame, one column per role with ``T_za``, and ``dni`` and ``dhi`` [kW/m2] where they were logged
    later : DataFrame, the rows after it: history up to ``start``, then the test
    start : Timestamp, no origin lies before it
    origin_step : str, distance of the origins, as for :func:`skhybrid.model_selection.backtest`
    site : tuple of (latitude, longitude) [deg], or None where the irradiance is that of the window
    known : mapping, the capacity [kW] that an identification is given
    capacity : mapping, true capacities of the stages [kW], where the log is simulated
    truth : mapping or None
        Of a simulated log ``heat_gain`` and its part ``air`` [kW], and ``states`` [degC]; no model may read them.
    """

    name: str
    train: pd.DataFrame
    later: pd.DataFrame
    start: pd.Timestamp
    origin_step: str
    site: tuple[float, float] | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    capacity: Mapping[str, float] = field(default_factory=dict)
    truth: Mapping[str, pd.Series | pd.DataFrame] | None = None


def load_benchmark(names: Sequence[str] | None = None, *, seed: int = 0) -> dict[str, BenchmarkLog]:
    """Load the logs of the public benchmark with their splits and origins, which do not change.

    Fit on ``log.train`` and ``log.train["T_za"]``; ``backtest(model, log.later, log.later["T_za"], start=log.start,
    origin_step=log.origin_step)`` makes the forecasts that are scored.  ``benchmarks/leaderboard.py`` does both.

    Parameters
    ----------
    names : sequence of str, optional
        Which of ``"office autumn, same control"``, ``"office autumn, new control"`` (an EnergyPlus office, see
        :func:`load_small_office`), ``"dutch home 1"`` ... ``"dutch home 3"`` (:func:`load_dutch_home`),
        ``"make_office oakland"`` and ``"make_office chicago"`` (the paper's office); all by default.
    seed : int, default=0
        Of the paper's office; the benchmark is seed 0.

    Returns
    -------
    dict of str to BenchmarkLog

    Raises
    ------
    ValueError
        If there is no log of that name, or ``seed`` is no integer from 0 on.
    """
    check_integer("seed", seed, 0)
    if isinstance(names, str) or not isinstance(names, Iterable | None):
        raise ValueError(f"names={names!r} must be a list of names, such as {list(LOGS)[:1]}.")
    unknown = [name for name in names or () if name not in LOGS]
    if unknown:
        raise ValueError(f"names= has {unknown[0]!r}, but the logs are {', '.join(map(repr, LOGS))}.")
    return {name: LOGS[name](seed) for name in (LOGS if names is None else names)}


def cut_log(
    training_run: pd.DataFrame, test_run: pd.DataFrame, spans: Sequence[str]
) -> tuple[pd.DataFrame, pd.DataFrame, pd.Timestamp]:
    """Training, later rows and start of the test, by first and last day of training and of the test.

    If the two come from different runs, one step between them is left out: the temperature jumps there, and no model
    may mistake that for behaviour of the building.
    """
    first, last, start, end = spans
    train = training_run[first:last]
    first_later = train.index[-1] + (STEP if training_run is test_run else 2 * STEP)
    later = test_run[test_run.index >= first_later][:end]
    begin = pd.Timestamp(start)
    begin = begin if later.index.tz is None else begin.tz_localize(later.index.tz)
    return train.copy(), later.copy(), begin


def _small_office(word: str, control: str, seed: int) -> BenchmarkLog:
    training_run = _autumn("irregular")
    test_run = training_run if control == "irregular" else _autumn(control)
    return BenchmarkLog(
        f"office autumn, {word} control", *cut_log(training_run, test_run, OFFICE_SPANS), "7h", site=CHICAGO
    )


def _autumn(control: str) -> pd.DataFrame:
    log = load_small_office(control)
    return log.X.join(log.frame[["dni", "dhi"]])


def _home(number: int, seed: int) -> BenchmarkLog:
    run, last = load_dutch_home(number).X, _HOME_TRAINING_ENDS[number]
    start = str((pd.Timestamp(last) + pd.Timedelta("1D")).date())
    spans = (str(run.index[0].date()), last, start, "2021-12-31")
    cut = cut_log(run, run, spans)
    return BenchmarkLog(f"dutch home {number}", *cut, "5h", site=NETHERLANDS, known={"Q_h": 8.0})


def _office(climate: str, seed: int) -> BenchmarkLog:
    """The paper's office: four weeks of summer from Monday 3 July, then half a year."""
    office = make_office(_TRAIN_DAYS + _TEST_DAYS, climate, start="2023-07-03", random_state=7000 + seed)
    rows = _TRAIN_DAYS * 96
    return BenchmarkLog(
        f"make_office {climate}",
        office.X[:rows],
        office.X[rows:],
        office.X.index[rows],
        "25h",
        known={"Q_h": 6.0},
        capacity={"u_heat": office.theta["Q_h"], "u_cool": office.theta["Q_c"]},
        truth={"heat_gain": office.heat_gain, "air": office.gain_parts["air"], "states": office.states},
    )


#: loaders by name; the seed matters for the paper's office only
LOGS: dict[str, Callable[[int], BenchmarkLog]] = {
    "office autumn, same control": partial(_small_office, "same", "irregular"),
    "office autumn, new control": partial(_small_office, "new", "shifted"),
    **{f"dutch home {number}": partial(_home, number) for number in _HOME_TRAINING_ENDS},
    **{f"make_office {climate}": partial(_office, climate) for climate in ("oakland", "chicago")},
}
