"""The gain of forecasts: how far a kW more moves them, relative to how far it moves the plant.

Models are trained on six weeks of a thermostat's log.  A week later and after, they forecast a day from the hours of
the plant's step tests, with the logged heat and with 1 kW more from the origin on.  The plants are single EnergyPlus
zones, whose tests ``make_step_tests.py`` made (``data/step_tests.csv``), and ``make_office``, of which the response is
computed from its network.

``python benchmarks/gain.py --buildings FOLDER/steps`` runs what is missing and writes ``results/gain.md``;
``make_step_tests.py`` makes the folder, without which ``make_office`` alone is run.  Finished runs are kept in
``benchmarks/.gain``.  Run it on one core (``OMP_NUM_THREADS=1``).

    python benchmarks/gain.py --data make_office --models default ARX      some rows, some columns
"""

from __future__ import annotations

import argparse
import datetime
import json
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
from _forecast_store import path_of, read_facts
from _reference_data import made_buildings
from _report import RESULTS, spread, write_table
from heat_replayed import DEFAULT, NETWORK, NetworkAlone
from sklearn.utils import Bunch

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office, read_zone_csv
from skhybrid.datasets._office import TRUE_THETA, true_system
from skhybrid.exceptions import SkhybridWarning

STORE = Path(__file__).parent / ".gain"
TESTS = Path(__file__).parent / "data" / "step_tests.csv"
DAY = 96
#: leads [h], and how far from the plant's mean a model may be
TARGET = {0.25: 0.15, 1.0: 0.15, 4.0: 0.15, 12.0: 0.15, 24.0: 0.25}
ROWS_AHEAD = np.array([round(4 * lead) for lead in TARGET])
_TEST_COLUMNS = [f"K_per_kW_{lead:g}h" for lead in TARGET]
#: of the synthetic office: Monday, weeks of training and after it, days of steps after the training, hours of steps
OFFICE_START, OFFICE_WEEKS, OFFICE_DAYS, OFFICE_HOURS = "2023-09-04", (6, 4), (8, 17, 26), (0, 7, 14, 21)
SEEDS = range(4)
PLAN = "for planning"
NOTE = (
    "Temperature change by 1 kW more [K/kW], at five leads.  Plants are tested at four hours of three days after the "
    "training, and models at the same hours.  Ratio: mean of the model's changes relative to the mean of the plant's; "
    "median over rows (lowest to highest).  EnergyPlus: single zones, the other zones of the building under their "
    'thermostats.  "within": share of rows in which the ratio is within 15 % of 1 from 15 min to 12 h and within 25 % '
    "after 24 h.  Models are trained on six weeks of the thermostat's log, with its delivered heat, without set-points."
)

COMPARED: dict[str, Make] = {
    DEFAULT: lambda data, seed: HybridPredictor(random_state=seed),
    NETWORK: lambda data, seed: NetworkAlone(random_state=seed),
    **{name: MODELS[name].make for name in (ARX, REFITTED, "ARX, multi-step", "OD alone", "CONV")},
}
if "purpose" in HybridPredictor().get_params():
    COMPARED[PLAN] = lambda data, seed: HybridPredictor(purpose="plan", random_state=seed)


class Row(NamedTuple):
    """Log, stamps from which steps go, and what the plant does."""

    data: DataSet
    stamps: pd.DatetimeIndex  # (n,)
    plant: np.ndarray  # (n, 5) [K/kW]


def rows(folders: Sequence[Path]) -> dict[str, Callable[[], Row]]:
    """Loaders by name."""
    found: dict[str, Callable[[], Row]] = {}
    tests = pd.read_csv(TESTS, comment="#", parse_dates=["day"])
    for folder in folders:
        for row, spans in made_buildings(folder):
            name, season = str(row["name"]), str(row["season"])
            own = tests[(tests["zone"] == name) & (tests["season"] == season)]
            if len(own):
                found[f"{name} {season}"] = partial(_zone, f"{name} {season}", folder / name, spans, own)
    for climate in ("oakland", "chicago"):
        for seed in SEEDS:
            found[f"make_office {climate} {seed}"] = partial(_office, climate, seed)
    return found


def _zone(name: str, stem: Path, spans: tuple[str, str, str, str], tests: pd.DataFrame) -> Row:
    log = read_zone_csv(stem.with_name(f"{stem.name}_irregular.csv"), _BUILDING_COLUMNS, label="right")
    log = log.drop(columns=list(BEAM_AND_SKY))
    stamps = tests["day"] + pd.to_timedelta(tests["start_h"], unit="h")
    return Row(
        split(name, log, log, spans, ""),
        pd.DatetimeIndex(stamps).tz_localize(log.index.tz),
        tests[_TEST_COLUMNS].to_numpy(),
    )


def _office(climate: str, seed: int) -> Row:
    """The paper's office with measured heat."""
    n_days, trained = 7 * sum(OFFICE_WEEKS), OFFICE_WEEKS[0] * 7
    make = partial(make_office, n_days, climate, start=OFFICE_START, random_state=seed)
    log, fine = make().X, make(sampling_time="5min")
    heat = TRUE_THETA["Q_h"] * log["u_heat"] + TRUE_THETA["Q_c"] * log["u_cool"]
    log = log.drop(columns=["u_heat", "u_cool"]).assign(Q_hvac=heat)
    first = log.index[trained * DAY]
    stamps = pd.DatetimeIndex([first + pd.Timedelta(days=d, hours=h) for d in OFFICE_DAYS for h in OFFICE_HOURS])
    data = DataSet(f"make_office {climate} {seed}", log[:first][:-1], log[first:], first + pd.Timedelta("7D"), "")
    conductance = air_conductance(fine)
    return Row(data, stamps, np.array([_response(conductance[fine.X.index.get_loc(s) :]) for s in stamps]))


def air_conductance(office: Bunch) -> np.ndarray:
    """Heat that outdoor air carries off per kelvin [kW/K], of a log at the step of the simulation."""
    across = office.X["T_oa"] - office.states["T_za"]
    found = office.gain_parts["air"] / across.where(across.abs() > 0.1)
    return found.interpolate(limit_direction="both").to_numpy()


def _response(conductance: np.ndarray) -> np.ndarray:
    """(5,) response of the office to 1 kW [K/kW], which outdoor air carries off too (n,) [kW/K], every 5 min."""
    A, B = true_system(1.0 / 12.0)
    state, warmed = np.zeros(2), np.zeros(3 * DAY + 1)
    for k in range(3 * DAY):
        state = A @ state + B[:, -1] * (1.0 - conductance[k] * state[1])
        warmed[k + 1] = state[1]
    return warmed[3 * ROWS_AHEAD]


# --------------------------------------------------------------------------------------------------------------- runs
def assess(row: Row, name: str, store: Path) -> None:
    """Fit once, forecast without and with a step at each stamp, keep the differences."""
    begun, train, later = time.perf_counter(), row.data.train, row.data.later
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkhybridWarning)
        model = COMPARED[name](row.data, 0).fit(train, train["T_za"])
        gains = np.array([_step(model, later, origin) for origin in later.index.get_indexer(row.stamps)])
    stated = model.gain_std_.reindex(pd.to_timedelta(list(TARGET), unit="h")).tolist() if name == PLAN else []
    facts = {"row": row.data.name, "model": name, "date": str(datetime.date.today()), "stated": stated}
    path = path_of(row.data.name, name, 0, store)
    path.parent.mkdir(parents=True, exist_ok=True)
    table = pd.DataFrame(np.hstack([gains, row.plant]), row.stamps.rename("origin"), _columns())
    path.with_suffix(".part").write_text(
        f"# {json.dumps(facts)}\n{table.to_csv(float_format='%.6g')}", encoding="utf-8"
    )
    path.with_suffix(".part").replace(path)
    ratio = (gains.mean(axis=0) / row.plant.mean(axis=0)).round(2)
    print(f"{row.data.name} | {name}: {ratio} in {time.perf_counter() - begun:.0f} s", flush=True)


def _step(model: Any, later: pd.DataFrame, origin: int) -> np.ndarray:
    """(5,) change of the forecast from an origin by 1 kW from there on [K/kW]."""
    base = later.iloc[: origin + DAY + 1]
    more = base.assign(Q_hvac=base["Q_hvac"] + (np.arange(len(base)) >= origin))
    without, with_step = (model.predict_from(X, np.array([origin]), "1D")[0] for X in (base, more))
    return (with_step - without)[ROWS_AHEAD - 1]


def _columns() -> list[str]:
    return [f"{whose} {lead:g} h" for whose in ("model", "plant") for lead in TARGET]


# ------------------------------------------------------------------------------------------------------------- tables
def tables(store: Path, order: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Summaries by model, the plants, and the ratios of every row by lead."""
    plants, ratios, stated = {}, {}, {}
    for path in sorted(store.glob("*/*__0.csv")):
        facts, table = read_facts(path), pd.read_csv(path, skiprows=1, index_col="origin")
        model, plant = (table[_columns()[at]] for at in (slice(5), slice(5, None)))
        plants[facts["row"]] = [spread(list(plant[c])) for c in plant]
        ratio = model.mean().to_numpy() / plant.mean().to_numpy()
        ratios[facts["model"], facts["row"]] = ratio
        if facts["model"] == PLAN:
            stated[facts["row"]] = np.concatenate([np.abs(ratio - 1.0), facts["stated"]])
    heads = [f"{lead:g} h" for lead in TARGET]
    frame = pd.DataFrame(ratios, index=heads).T.rename_axis(["model", "row"])
    names = [n for n in order if n in plants]
    kinds: dict[str, list[str]] = {}
    for name in names:
        kinds.setdefault("make_office" if name.startswith("make_") else f"EnergyPlus, {name.split()[-1]}", []).append(
            name
        )
    out = {f"Ratio to the plant, {kind}": _summary(frame, chosen) for kind, chosen in kinds.items()}
    out["The plants [K/kW]"] = pd.DataFrame(plants, index=heads).T.loc[names].rename_axis("row")
    for head in heads:
        wide = frame.reset_index().pivot_table(head, "row", "model")
        wide = wide.loc[names, [m for m in COMPARED if m in wide]]
        out[f"Ratio to the plant after {head}"] = wide.round(2)
    both = [f"{what}, {head}" for what in ("error", "stated") for head in heads]
    found = pd.DataFrame(stated, index=both).T.reindex([n for n in names if n in stated]).rename_axis("row")
    out["Relative error of the gain for planning, and gain_std_"] = found.round(2)
    return out


def _summary(ratios: pd.DataFrame, chosen: list[str]) -> pd.DataFrame:
    """Median (lowest to highest) of the rows, and the share of them within the target."""
    lines = {}
    for model in COMPARED:
        own = ratios[ratios.index.get_level_values("model") == model].droplevel("model")
        own = own.loc[own.index.intersection(chosen)]
        if len(own):
            lines[model] = {head: spread([round(v, 2) for v in own[head]]) for head in own}
            lines[model]["within"] = f"{((own - 1.0).abs() <= list(TARGET.values())).all(axis=1).mean():.2f}"
            lines[model]["rows"] = len(own)
    return pd.DataFrame(lines).T.rename_axis("model")


def main(arguments: list[str] | None = None) -> None:
    """Fill the store, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", help="beginnings of the names of rows")
    parser.add_argument("--models", nargs="+", choices=list(COMPARED))
    parser.add_argument("--buildings", type=Path, nargs="+", default=[], help="folders that make_step_tests.py made")
    parser.add_argument("--store", type=Path, default=STORE)
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    loaders = rows(options.buildings)
    for name in chosen(list(loaders), options.data):
        left = [m for m in options.models or COMPARED if not path_of(name, m, 0, options.store).is_file()]
        row = loaders[name]() if left else None
        for model in left:
            assess(row, model, options.store)  # type: ignore[arg-type]
    command = " ".join(["python benchmarks/gain.py", *(arguments if arguments is not None else sys.argv[1:])])
    title = "The gain of forecasts"
    print(write_table("gain", title, command, tables(options.store, list(loaders)), NOTE, options.results))


if __name__ == "__main__":
    main()
