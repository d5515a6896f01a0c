"""The forecast benchmark with heat that tells nothing: that of other people's thermostat, replayed open loop.

A thermostat answers every disturbance with heat, so that tomorrow's delivered heat reveals tomorrow's disturbances.
Here the rooms of the test get, two days of three, the heat that the thermostat gave other people under the same weather
and set-points.  On the third day their own thermostat acts, so that temperatures stay where people would have them; no
forecast over such a day is scored.  Models are trained on a usual log.  The same forecasts under the room's own
thermostat, at the same stamps, show what that heat told.

``python benchmarks/heat_replayed.py --buildings FOLDER/replay`` runs what is missing and writes
``results/heat_replayed.md``; ``make_buildings.py --group replay`` makes the folder, without which the synthetic offices
alone are run.  Finished runs are kept in ``benchmarks/.heat_replayed``.  Run it on one core (``OMP_NUM_THREADS=1``).

    python benchmarks/heat_replayed.py --data make_office --models default ARX      some rows, some columns
"""

from __future__ import annotations

import argparse
import datetime
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from _forecast_data import _BUILDING_COLUMNS, BEAM_AND_SKY, DataSet, chosen, split
from _forecast_models import ARX, MODELS, REFITTED, Make
from _forecast_store import Errors, Run, by_hour, is_done, read_runs, write_run
from _reference_data import made_buildings
from _report import RESULTS, write_table

from skhybrid import HybridPredictor
from skhybrid._holidays import NO_HOLIDAYS
from skhybrid.datasets import make_weather, read_zone_csv
from skhybrid.datasets._gains import draw_gains
from skhybrid.datasets._office import SIMULATION_STEP, TRUE_THETA, _make_log, _simulate_office
from skhybrid.datasets._random import spawn_generators
from skhybrid.datasets._thermostat_plan import plan_setpoints
from skhybrid.exceptions import SkhybridWarning

STORE = Path(__file__).parent / ".heat_replayed"
DAY = 96
#: rows from the begin of two replayed days to the origins: 0, 7, 14 and 21 h
ORIGINS = (0, 28, 56, 84)
LEVELS = (0.1, 0.9)
REPLAYED, OWN = "replayed", "own thermostat"
DEFAULT, NETWORK, PLAN = "default", "its network alone", "for planning"
LEADS = (1, 6, 12, 24)
#: of the synthetic office: Monday, weeks of training and after it
OFFICE_START, OFFICE_WEEKS = "2023-09-04", (6, 9)
OTHERS = 1000
NOTE = (
    "Day-ahead error of the temperature while the room gets the heat that the thermostat gave other people under the "
    "same weather and set-points (two days of three, origins 0, 7, 14 and 21 h after their begin; on the third day the "
    'own thermostat acts, and nothing is scored).  "own thermostat": the same origins of the usual log, whose heat '
    "tells of the disturbances.  Ratios are errors relative to the default's.  Hour 1 is the first four leads, and so "
    "on.  Models are trained on six weeks of the usual log and were not tuned on these rows; the default's development "
    "knew the usual logs of the buildings other than small_office_chicago, which has people of its own here."
)


class NetworkAlone(HybridPredictor):
    """The default's network without the other members of its blend, nor the residual correction."""

    def predict_from(self, X: pd.DataFrame, origins: Any, horizon: Any = None) -> np.ndarray:
        """Forecast a day from each of increasing origins."""
        table, n_tail = self._with_history(X)
        scheme = self._present_scheme()
        rows, moved = scheme._numbered(table)
        rolling, view = scheme._physics.start(rows, scheme._record.sample, scheme.adapt), scheme._physics.view(rows)
        paths = []
        for origin in np.asarray(origins) + n_tail + moved:
            rolling.advance(view, int(origin))
            paths.append(rolling.forecast(view, DAY)[0][0])
        return np.array(paths)


_BENCH = ("ARX, multi-step, re-fitted", "boosting, direct", "boosting on ARX", "OD alone", "CONV")
#: makers by name, the default first
COMPARED: dict[str, Make] = {
    DEFAULT: lambda data, seed: HybridPredictor(known=dict(data.known) or None, random_state=seed),
    NETWORK: lambda data, seed: NetworkAlone(known=dict(data.known) or None, random_state=seed),
    **{name: MODELS[name].make for name in (ARX, REFITTED, *_BENCH)},
    PLAN: lambda data, seed: HybridPredictor(known=dict(data.known) or None, purpose="plan", random_state=seed),
}


class Row(NamedTuple):
    """Training and test, the same test under the own thermostat, and row numbers of origins in both."""

    data: DataSet
    own: pd.DataFrame
    origins: np.ndarray


def rows(folders: Sequence[Path]) -> dict[str, Callable[[], Row]]:
    """Loaders by name."""
    found: dict[str, Callable[[], Row]] = {}
    for folder in folders:
        for row, spans in made_buildings(folder):
            name = f"{row['name']} {row['season']}"
            found[name] = partial(_building, name, folder / str(row["name"]), spans)
    for climate in ("oakland", "chicago"):
        found[f"make_office {climate}"] = partial(_office, climate)
    return found


def _building(name: str, stem: Path, spans: tuple[str, str, str, str]) -> Row:
    usual, replayed = (
        read_zone_csv(stem.with_name(f"{stem.name}_{run}.csv"), _BUILDING_COLUMNS | extra, label="right").drop(
            columns=list(BEAM_AND_SKY)
        )
        for run, extra in (("irregular", {}), ("replayed", {"replayed": "replayed"}))
    )
    data = split(name, usual, replayed.drop(columns="replayed"), spans, "")
    return Row(data, usual.loc[data.later.index], _origins(replayed["replayed"], data))


def _office(climate: str) -> Row:
    """The paper's office; what other people's thermostat did is replayed after the training."""
    weeks, others = sum(OFFICE_WEEKS), spawn_generators(7000 + OTHERS, 5)[1]
    weather_rng, gain_rng, plan_rng, prbs_rng, noise_rng = spawn_generators(7000, 5)
    time = pd.date_range(OFFICE_START, periods=weeks * 7 * 288, freq=SIMULATION_STEP)
    outside = make_weather(weeks * 7, climate, start=time[0], step=SIMULATION_STEP, random_state=weather_rng)
    setpoints = plan_setpoints(time, NO_HOLIDAYS, "weekend_prbs", plan_rng, prbs_rng)
    stages = _simulate_office(outside, setpoints, draw_gains(time, others))[["u_heat", "u_cool"]]
    day, trained = np.arange(len(time)) // 288, OFFICE_WEEKS[0] * 7
    replayed = pd.Series((day >= trained) & (day % 3 > 0), time)
    gains, noise = draw_gains(time, gain_rng), 0.03 * noise_rng.standard_normal(len(time) // 3)
    usual, log = (
        _make_log(_simulate_office(outside, setpoints, gains, heat), setpoints, 3, noise, {}, "").X
        for heat in (None, stages.where(replayed).to_numpy())
    )
    first = trained * DAY
    start = time[0] + (trained + 7) * pd.Timedelta("1D")
    capacity = {"u_heat": TRUE_THETA["Q_h"], "u_cool": TRUE_THETA["Q_c"]}
    data = DataSet(f"make_office {climate}", log[:first], log[first:], start, "", known={"Q_h": 6.0}, capacity=capacity)
    return Row(data, usual[first:], _origins(replayed[::3], data))


def _origins(replayed: pd.Series, data: DataSet) -> np.ndarray:
    """Row numbers of the later rows from which a day's heat is replayed."""
    flags = replayed.loc[data.later.index].to_numpy() > 0.5
    begins = np.flatnonzero(flags[1:] & ~flags[:-1]) + 1
    origins = (begins[:, None] + np.array(ORIGINS)).ravel()
    first = int(data.later.index.searchsorted(data.start))
    origins = origins[(origins >= first) & (origins + DAY < len(flags))]
    return origins[[bool(flags[o : o + DAY].all()) for o in origins]]


# --------------------------------------------------------------------------------------------------------------- runs
def assess(row: Row, name: str, store: Path) -> None:
    """Fit once, forecast under both heats, keep both runs."""
    begun = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model = COMPARED[name](row.data, 0).fit(row.data.train, row.data.train["T_za"])
        for heat, later in ((REPLAYED, row.data.later), (OWN, row.own)):
            at = row.origins[:, None] + np.arange(1, DAY + 1)
            measured = later["T_za"].to_numpy()[at]
            facts: dict[str, Any] = {"data": f"{row.data.name}, {heat}", "model": name, "seed": 0, "tag": "1"}
            facts |= {"row": row.data.name, "heat": heat, "date": str(datetime.date.today())}
            if name == DEFAULT:
                low, high = np.moveaxis(model.predict_quantiles_from(later, row.origins, LEVELS, "1D"), -1, 0)
                facts["coverage"] = float(np.mean((low <= measured) & (measured <= high)))
            error = model.predict_from(later, row.origins, "1D") - measured
            hour = np.tile(np.arange(DAY) // 4 + 1, len(at))
            stamps = later.index[np.repeat(row.origins, DAY)].astype(str)
            write_run(Run(facts, by_hour(stamps, hour, error.ravel()), None), store)
            print(f"{facts['data']} | {name}: {float(np.sqrt(np.mean(error**2))):.3f} K", flush=True)
    print(f"{time.perf_counter() - begun:.0f} s", flush=True)


def _rmse(errors: Errors, hour: int | None = None) -> float:
    part = slice(None) if hour is None else slice(hour - 1, hour)
    return float(np.sqrt(errors.square[:, part].sum() / errors.count[:, part].sum()))


def tables(store: Path, order: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Errors, their ratios over all leads and at single hours, and coverage."""
    runs = {(r.facts["row"], r.facts["heat"], r.facts["model"]): r for r in read_runs(store)}
    names = [n for n in order if (n, REPLAYED, DEFAULT) in runs]

    def wide(heat: str, hour: int | None = None) -> pd.DataFrame:
        found = [(row, m, _rmse(r.temperature, hour)) for (row, h, m), r in runs.items() if h == heat]
        frame = pd.DataFrame(found, columns=["row", "model", "rmse"]).pivot_table("rmse", "row", "model")
        return frame.loc[names, [m for m in COMPARED if m in frame]]

    def relative(frame: pd.DataFrame) -> pd.DataFrame:
        out = frame.div(frame[DEFAULT], axis=0)
        out.loc["geometric mean"] = np.exp(np.log(out).mean())
        return out.drop(columns=DEFAULT).round(3)

    out = {"RMSE [K], heat replayed": wide(REPLAYED).round(3), f"RMSE [K], {OWN}": wide(OWN).round(3)}
    out["Ratio to the default, heat replayed"] = relative(wide(REPLAYED))
    out[f"Ratio to the default, {OWN}"] = relative(wide(OWN))
    for hour in LEADS:
        out[f"Ratio to the default, heat replayed, hour {hour}"] = relative(wide(REPLAYED, hour))
    default = {n: [runs[n, heat, DEFAULT] for heat in (REPLAYED, OWN)] for n in names}
    out["Coverage of the default's 80 % intervals"] = pd.DataFrame(
        {n: [*(r.facts["coverage"] for r in pair), len(pair[0].temperature.origin)] for n, pair in default.items()},
        index=[REPLAYED, OWN, "origins"],
    ).T.rename_axis("row").astype({"origins": int})  # fmt: skip
    return out


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="beginnings of the names of rows")
    parser.add_argument("--models", nargs="+", choices=list(COMPARED))
    parser.add_argument("--buildings", type=Path, nargs="+", default=[], help="folders that make_buildings.py made")
    parser.add_argument("--store", type=Path, default=STORE)
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    loaders = rows(options.buildings)
    for name in chosen(list(loaders), options.data):
        left = [m for m in options.models or COMPARED if not is_done(f"{name}, {OWN}", m, 0, None, options.store)]
        row = loaders[name]() if left else None
        for model in left:
            assess(row, model, options.store)  # type: ignore[arg-type]
    command = " ".join(["python benchmarks/heat_replayed.py", *(arguments if arguments is not None else sys.argv[1:])])
    title = "Heat of another occupancy's thermostat"
    print(write_table("heat_replayed", title, command, tables(options.store, list(loaders)), NOTE, options.results))


if __name__ == "__main__":
    main()
