"""Forecasts of coupled rooms: each by itself, with its neighbours, by a floor plan or by neighbours found in the data.

Logs: five rooms of the small office (EnergyPlus, Chicago, September to December) with partitions that couple them
weakly, as two gypsum boards do, and strongly (doors open), under the control of the training and under another one.
Trained on six weeks, tested on the four that follow from an origin every 25 h (50 h where only set-points are known).
Then offices with real air systems: as they are, and with doors open or closed, with several seeds of gains.

``python benchmarks/several_zones.py --buildings FOLDER/rooms`` runs what is missing and writes
``results/several_zones.md`` (an hour on one core); ``make_buildings.py --group rooms`` makes the folder.  Finished rows
are kept in ``benchmarks/.rows/several_zones``.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from _energyplus import DAYS_OFF
from _forecast_data import KNOWN
from _office_rooms import OFFICES, on_floors
from _reference_data import reference
from _report import write_table

from skhybrid import BuildingPredictor, HybridPredictor
from skhybrid.exceptions import SkhybridWarning
from skhybrid.preprocessing import FacadeIrradiance

STORE = Path(__file__).parent / ".rows" / "several_zones"
CLOCK = "Etc/GMT+6"
ROOMS = ("core", "south", "east", "north", "west")
FLOOR_PLAN = [*(("core", room) for room in ROOMS[1:])]
FLOOR_PLAN += [("south", "east"), ("east", "north"), ("north", "west"), ("west", "south")]
#: conductance to all neighbours relative to that outdoors (README of the data), and the controls of the log
COUPLINGS = {
    "weak": ("0.2-0.55", ("base",)),
    "ref": ("1.2-3.3", ("base", "shift")),
    "strong": ("3.3-13", ("base", "shift")),
}
CONTROL = {"base": "same", "shift": "new"}
TRAIN, TEST, END = "2018-10-01", "2018-11-12", "2018-12-10"
N_LEADS, EVERY = 96, 100
LEADS = {"1 h": 4, "6 h": 24, "12 h": 48, "24 h": 96}
N_SAMPLES, N_BOOTSTRAP = 100, 2000
OFFICES_AS_THEY_ARE = "Offices as they are, heat known"
ROOMS_APART = "Offices with people and set-points of each room's own, heat known"
CALENDARS = {"": None, KNOWN: DAYS_OFF}  # of the offices, whose people keep these days off
HEAT_AND_T = {"T_za": "T_{}_degC", "Q_hvac": "Q_{}_kW"}
CONTROLS = {"irregular": "same", "shifted": "new"}  # runs of an office, and how the control of the test is


def read_log(coupling: str, control: str) -> pd.DataFrame:
    """Inputs, temperatures and set-points of all rooms by the data contract."""
    name = f"zones/small_office_zones_{coupling}_{control}_1.csv.gz"
    log = pd.read_csv(reference(name, "make it with EnergyPlus"), index_col=0)
    log.index = pd.to_datetime(log.index).tz_convert(CLOCK)
    X = pd.DataFrame({"T_oa": log["T_out_degC"], "q_sol": log["ghi_kW_m2"]})
    X = FacadeIrradiance(latitude=41.98, longitude=-87.9).set_output(transform="pandas").fit_transform(X)
    columns = {"T_za": "T_{}_degC", "Q_hvac": "Q_{}_kW"}
    columns |= {"T_heat_set": "set_heat_{}_degC", "T_cool_set": "set_cool_{}_degC"}
    return X.assign(**{f"{role}_{room}": log[c.format(room)] for room in ROOMS for role, c in columns.items()})


def between(log: pd.DataFrame, begin: str, end: str) -> pd.DataFrame:
    return log[pd.Timestamp(begin, tz=CLOCK) : pd.Timestamp(end, tz=CLOCK) - pd.Timedelta("15min")]


def temperatures(log: pd.DataFrame) -> pd.DataFrame:
    return log[[f"T_za_{room}" for room in ROOMS]].set_axis(list(ROOMS), axis=1)


def fitted(coupling: str, plan: Any, *, setpoints: bool) -> tuple[BuildingPredictor, float]:
    """A building fitted on the control of the training, and the seconds of processor time."""
    train = between(read_log(coupling, "base"), TRAIN, TEST)
    if not setpoints:
        train = train[[c for c in train if "_set_" not in c]]
    begun = time.process_time()
    model = BuildingPredictor(HybridPredictor(intervals=not setpoints), adjacency=plan)
    return model.fit(train, temperatures(train)), time.process_time() - begun


def heat_known(coupling: str) -> dict[str, Any]:
    """Errors [K] of temperatures with the heat of all rooms known ahead, and energy scores."""
    models = {"floor plan": fitted(coupling, FLOOR_PLAN, setpoints=False)}
    models["found"] = fitted(coupling, None, setpoints=False)
    out: dict[str, Any] = {"fit [s]": models["floor plan"][1], "shares": models["floor plan"][0].shares_.mean().mean()}
    for control in COUPLINGS[coupling][1]:
        later = between(read_log(coupling, control), TEST, END)
        origins = np.arange(EVERY, len(later) - N_LEADS - 1, EVERY)
        truth = temperatures(later).to_numpy()[origins[:, None] + np.arange(1, N_LEADS + 1)]
        paths = {name: model.predict_from(later, origins, "1D") for name, (model, _) in models.items()}
        building = models["floor plan"][0]
        paths["by itself"] = building.without_neighbours().predict_from(later, origins, "1D")
        for name, found in paths.items():
            squares = (found - truth) ** 2
            out[f"{control} {name}"] = float(np.sqrt(squares.mean(axis=(0, 1))).mean())
            by_room = np.sqrt(squares.mean(axis=(0, 1)))
            out[f"{control} {name} rooms"] = by_room.tolist()
            out[f"{control} {name} leads"] = [
                float(np.sqrt(squares[:, lead - 1].mean(axis=0)).mean()) for lead in LEADS.values()
            ]
        out[f"{control} energy"] = energy_scores(building, later, origins)
    return out


def energy_scores(building: BuildingPredictor, later: pd.DataFrame, origins: np.ndarray) -> list[list[list[float]]]:
    """Energy scores (n_origins, 2, 2) of a day of all rooms, and of their mean: joint samples, and independent ones.

    Independent samples are the same paths of each room, in any order.
    """
    rng, scores, model, done = np.random.default_rng(0), [], copy(building), 0
    for origin in origins:
        model.update(later[done : origin + 1])
        done = origin + 1
        future = later[done : done + N_LEADS]
        drawn = model.sample(None, future, N_SAMPLES, random_state=0).to_numpy().reshape(N_SAMPLES, N_LEADS, len(ROOMS))
        apart = np.stack([rng.permuted(drawn[..., j], axis=0) for j in range(len(ROOMS))], axis=-1)
        truth = temperatures(future).to_numpy()
        both = (drawn, apart)
        all_rooms = [energy_score(paths.reshape(N_SAMPLES, -1), truth.ravel()) for paths in both]
        scores.append([all_rooms, [energy_score(paths.mean(axis=2), truth.mean(axis=1)) for paths in both]])
    return scores


def scores_in_words(scores: np.ndarray) -> dict[str, Any]:
    """Scores of joint samples relative to independent ones, with 90 % intervals by a bootstrap over days."""
    days = np.random.default_rng(0).integers(0, len(scores), (N_BOOTSTRAP, len(scores)))
    ratios = [mean[..., 0] / mean[..., 1] for mean in (scores.mean(axis=0), scores[days].mean(axis=1))]
    low, high = np.percentile(ratios[1], (5, 95), axis=0)
    joint, apart = scores.mean(axis=0)[0]
    out = {"days": len(scores), "all rooms, joint": joint, "independent": apart}
    for k, name in enumerate(("all rooms", "their mean")):
        out |= {f"ratio, {name}": ratios[0][k], f"90 %, {name}": f"{low[k]:.2f} to {high[k]:.2f}"}
    return out


def energy_score(drawn: np.ndarray, truth: np.ndarray) -> float:
    """Of paths (n_samples, H); lower is better (Gneiting and Raftery 2007, Eq. 22)."""
    apart = np.linalg.norm(drawn[:, None] - drawn[None], axis=-1)
    return float(np.linalg.norm(drawn - truth, axis=-1).mean() - 0.5 * apart.mean())


def set_points_known(coupling: str) -> dict[str, Any]:
    """Errors of loads [kW, hourly means] and temperatures [K] where only set-points are known ahead."""
    building, _ = fitted(coupling, FLOOR_PLAN, setpoints=True)
    out: dict[str, Any] = {}
    for control in COUPLINGS[coupling][1]:
        later, done, model, missed = between(read_log(coupling, control), TEST, END), 0, copy(building), []
        for origin in range(EVERY, len(later) - N_LEADS - 1, 2 * EVERY):
            model.update(later[done : origin + 1])
            done = origin + 1
            truth = later[done : done + N_LEADS]
            future = truth[[c for c in truth if not c.startswith(("T_za", "Q_hvac"))]]
            missed.append([errors_of(one.forecast(None, future), truth) for one in (model.without_neighbours(), model)])
        root = np.sqrt(np.mean(np.square(missed), axis=(0, 3))).mean(axis=-1)  # (model, quantity)
        out |= {f"{control} load by itself": root[0, 0], f"{control} load": root[1, 0]}
        out |= {f"{control} T by itself": root[0, 1], f"{control} T": root[1, 1]}
    return out


def errors_of(frame: pd.DataFrame, truth: pd.DataFrame) -> np.ndarray:
    """(2, 24, n_rooms) errors of hourly loads [kW] and temperatures [K]."""
    wanted = [[f"{role}_{room}" for room in ROOMS] for role in ("Q_hvac", "T_za")]
    hourly = [(frame[names] - truth[names]).to_numpy().reshape(24, -1, len(ROOMS)) for names in wanted]
    return np.stack([hourly[0].mean(axis=1), hourly[1][:, -1]])


def by_the_hour(coupling: str) -> dict[str, Any]:
    """Errors [K] after two weeks of hourly temperatures and kWh per room, as a house's own log may have them."""
    logs = {}
    for control in COUPLINGS[coupling][1]:
        log = read_log(coupling, control)
        log = log[[c for c in log if "_set_" not in c]]
        means = log.resample("h").mean()
        at_stamp = [c for c in log if c.startswith("T_za")]
        logs[control] = means.assign(**{c: log[c].resample("h").first() for c in at_stamp})
    begin = str((pd.Timestamp(TEST) - pd.Timedelta("14D")).date())
    train = between(logs["base"], begin, TEST)
    building = BuildingPredictor(HybridPredictor(intervals=False), adjacency=FLOOR_PLAN)
    building.fit(train, temperatures(train))
    out: dict[str, Any] = {}
    for control, log in logs.items():
        later = between(log, TEST, END)
        origins = np.arange(25, len(later) - 25, 25)
        truth = temperatures(later).to_numpy()[origins[:, None] + np.arange(1, 25)]
        for name, model in (("with neighbours", building), ("by itself", building.without_neighbours())):
            missed = model.predict_from(later, origins, "1D") - truth
            out[f"{control} {name}"] = float(np.sqrt(np.mean(missed**2, axis=(0, 1))).mean())
    return out


def office(path: Path, holidays: tuple[str, ...] | None) -> dict[str, Any]:
    """Errors [K] in an office of ``make_buildings.py``, under the control of its training and under another one."""
    about = pd.read_csv(path.parent / "meta.csv").set_index(["name", "season"]).loc[path.name, "autumn"]
    logs = {control: _rooms_of(path.with_name(f"{path.name}_{control}.csv"), about) for control in CONTROLS}
    rooms = [c.removeprefix("T_za_") for c in logs["irregular"] if c.startswith("T_za_")]
    days = [pd.Timestamp(about[name]) for name in ("train_start", "train_end", "test_start", "test_end")]

    def part(log: pd.DataFrame, first: pd.Timestamp, last: pd.Timestamp) -> pd.DataFrame:
        return log[first.tz_localize(log.index.tz) : (last + pd.Timedelta("23h45min")).tz_localize(log.index.tz)]

    train = part(logs["irregular"], *days[:2])
    begun = time.process_time()
    zone = HybridPredictor(intervals=False, holidays=holidays)
    model = BuildingPredictor(zone, adjacency=on_floors(rooms))
    model.fit(train, train[[f"T_za_{room}" for room in rooms]])
    out: dict[str, Any] = {"rooms": len(rooms), "fit [s]": time.process_time() - begun}
    for control, log in logs.items():
        later = part(log, days[1] + pd.Timedelta("1D"), days[3])
        first = int(later.index.searchsorted(days[2].tz_localize(log.index.tz)))
        origins = np.arange(first, len(later) - N_LEADS - 1, EVERY)
        measured = later[[f"T_za_{room}" for room in rooms]].to_numpy()
        truth = measured[origins[:, None] + np.arange(1, N_LEADS + 1)]
        for name, one in (("with neighbours", model), ("by itself", model.without_neighbours())):
            missed = one.predict_from(later, origins, "1D") - truth
            out[f"{control} {name}"] = np.sqrt(np.mean(missed**2, axis=(0, 1))).tolist()
    return out


def _rooms_of(path: Path, about: pd.Series) -> pd.DataFrame:
    """Inputs and temperatures of all rooms of a file."""
    log = pd.read_csv(path, index_col=0)
    log.index = pd.to_datetime(log.index)
    X = pd.DataFrame({"T_oa": log["T_out_degC"], "q_sol": log["ghi_kW_m2"]})
    facades = FacadeIrradiance(latitude=about["latitude"], longitude=about["longitude"])
    X = facades.set_output(transform="pandas").fit_transform(X)
    rooms = [c[2:-5] for c in log if c.startswith("T_") and c != "T_out_degC"]
    given = {f"{role}_{room}": log[c.format(room)] for room in rooms for role, c in HEAT_AND_T.items()}
    return pd.concat([X, pd.DataFrame(given)], axis=1)


TASKS = {"heat known": heat_known, "set-points known": set_points_known, "by the hour": by_the_hour}


def row_of(task: str, coupling: str) -> dict[str, Any]:
    """A row, run where it is missing."""
    return kept(f"{task.replace(' ', '_')}_{coupling}", lambda: TASKS[task](coupling))


def kept(name: str, run: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The row that was stored under a name; run where it is missing."""
    path = STORE / f"{name}.json"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(run()), encoding="utf-8")
        part.replace(path)
        print(name, flush=True)
    return json.loads(path.read_text(encoding="utf-8"))


def offices(folder: Path) -> dict[str, pd.DataFrame]:
    """Tables of errors in the offices of a folder: as they are, and with people and set-points of each room's own."""
    out = {}
    for label, holidays in CALENDARS.items():
        rows: dict[str, dict[str, Any]] = {}
        for name in dict.fromkeys(pd.read_csv(folder / "meta.csv")["name"]):
            found = kept(f"office_{name}{label}", lambda name=name, holidays=holidays: office(folder / name, holidays))
            rows |= {f"{name}, {how} control": row_of_office(found, control) for control, how in CONTROLS.items()}
        table = pd.DataFrame(rows).T.rename_axis("office").infer_objects()
        apart = table.index.str.startswith(tuple(one.name for one in OFFICES if one.doors is not None))
        out |= {OFFICES_AS_THEY_ARE + label: table[~apart], ROOMS_APART + label: table[apart]}
    return out


def row_of_office(found: dict[str, Any], control: str) -> dict[str, Any]:
    """Errors of an office under a control, and their ratio."""
    both = {what: np.array(found[f"{control} {what}"]) for what in ("by itself", "with neighbours")}
    ratios = both["with neighbours"] / both["by itself"]
    row = {"rooms": found["rooms"], "fit [s]": found["fit [s]"]}
    row |= {f"{what} [K]": float(values.mean()) for what, values in both.items()}
    row["ratio"] = row["with neighbours [K]"] / row["by itself [K]"]
    return row | {"ratios of rooms": f"{ratios.min():.2f} to {ratios.max():.2f}"}


def tables(couplings: list[str]) -> dict[str, pd.DataFrame]:
    """Tables of the rows of some couplings."""
    errors, by_lead, loads, scores, short = {}, {}, {}, {}, {}
    for coupling in couplings:
        found, known = row_of("heat known", coupling), row_of("set-points known", coupling)
        for control in COUPLINGS[coupling][1]:
            name, own = f"{coupling}, {CONTROL[control]} control", found[f"{control} by itself"]
            ratios = np.array(found[f"{control} floor plan rooms"]) / found[f"{control} by itself rooms"]
            errors[name] = {"neighbours / outdoors": COUPLINGS[coupling][0], "by itself [K]": own}
            errors[name] |= {"with neighbours [K]": found[f"{control} floor plan"]}
            errors[name] |= {
                "ratio": found[f"{control} floor plan"] / own,
                "ratio, found": found[f"{control} found"] / own,
            }
            errors[name] |= {"rooms": f"{ratios.min():.2f} to {ratios.max():.2f}"}
            pairs = zip(LEADS, found[f"{control} floor plan leads"], found[f"{control} by itself leads"], strict=True)
            by_lead[name] = {lead: f"{a:.3f} / {b:.3f}" for lead, a, b in pairs}
            loads[name] = {
                "load by itself [kW]": known[f"{control} load by itself"],
                "load [kW]": known[f"{control} load"],
            }
            loads[name] |= {"ratio, load": known[f"{control} load"] / known[f"{control} load by itself"]}
            loads[name] |= {"T by itself [K]": known[f"{control} T by itself"], "T [K]": known[f"{control} T"]}
            hourly = row_of("by the hour", coupling)
            both = [hourly[f"{control} {name}"] for name in ("by itself", "with neighbours")]
            short[name] = {"by itself [K]": both[0], "with neighbours [K]": both[1], "ratio": both[1] / both[0]}
            scores[name] = scores_in_words(np.array(found[f"{control} energy"]))
    out = {
        "Errors over all leads to 24 h, heat known": errors,
        "By lead: with neighbours / by itself [K]": by_lead,
        "Only set-points known": loads,
        "Two weeks of training by the hour, heat known": short,
        "Energy scores of joint samples of a day": scores,
    }
    return {title: pd.DataFrame(rows).T.rename_axis("log").infer_objects() for title, rows in out.items()}


def main() -> None:
    """Run what is missing, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--couplings", nargs="+", choices=list(COUPLINGS), default=list(COUPLINGS))
    parser.add_argument("--buildings", type=Path, help="folder rooms of make_buildings.py")
    options = parser.parse_args()
    couplings = options.couplings
    warnings.simplefilter("ignore", SkhybridWarning)
    found = tables(couplings)
    if options.buildings is not None:
        found |= offices(options.buildings)
    seconds = [row_of("heat known", coupling)["fit [s]"] for coupling in couplings]
    write_table(
        "several_zones",
        "Several zones",
        "python benchmarks/several_zones.py --buildings FOLDER/rooms",
        found,
        "Five rooms of the small office (EnergyPlus, Chicago) with facades' irradiance: trained from 2018-10-01 on "
        "six weeks of one control, tested on the four weeks that follow, from an origin every 25 h (50 h where only "
        "set-points are known).  A room reads the irradiance of the facade that bears its name.  Root-mean-square "
        "errors, mean over rooms; rooms: lowest to highest ratio of one room.  Neighbours by the floor plan, or found "
        "in the data (ratio, found).  'neighbours / outdoors': sum of the conductances to neighbours relative to that "
        "outdoors.  The prior shares of the blend were chosen on these rooms, of one seed of gains, and on the first "
        "office.  Calendar known: the models have the days on which nobody works.  Offices with people and set-points "
        "of each room's own were looked at once without a calendar, and once with it: open: 0.25 m3/s of air (0.3 "
        "kW/K) between the core and each other room and a fifth of it in the ring; closed: partitions of the "
        "model alone.  Energy scores compare joint samples of a day with the same paths of each "
        "room in any order (independent).  A fit with floor plan and intervals took "
        f"{min(seconds):.0f} to {max(seconds):.0f} s of processor time.",
    )


if __name__ == "__main__":
    main()
