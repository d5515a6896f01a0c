"""The paper's networks: time of an epoch, and day-ahead errors on the paper's office.

Writes ``results/networks_speed.md`` (three minutes on one core) and ``results/networks.md`` (ten to fifteen):
``python benchmarks/networks.py``, or with ``speed`` or ``error`` one of the two.  ``gpu`` writes
``results/networks_gpu.md`` where torch finds a GPU (two minutes).
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings

import numpy as np
import pandas as pd
import torch
from _network_speed import SIZES, interleaved, plain, random_data, spec_of, stacked
from _report import write_table
from _single_networks import single_networks

from skhybrid import DisturbanceForecaster, HybridPredictor, OutputDisturbanceID, TwoStagePredictor
from skhybrid.datasets import make_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.model_selection import backtest, score_backtest

COMMAND = "python benchmarks/networks.py"
CLIMATES = {"oakland": "2023-07-08", "chicago": "2023-07-08"}
TRAIN_DAYS, TEST_DAYS, SEEDS = 28, 42, 3
#: networks of a stack
STACK, GPU_STACKS = 12, (1, 24, 256)
NETWORKS = {"mlp": {}, "cnn": {"pool_size": 4}, "rnn": {}, "lstm": {}}


# ---------------------------------------------------------------------------------------------------------------- speed
def speed(n_rounds: int = 5) -> pd.DataFrame:
    """One row per network: ms of processor time per epoch, and ratios of rounds (median, lowest to highest)."""
    rows = {}
    data = random_data()
    for name, size in SIZES.items():
        spec = spec_of(size)
        n_epochs = {"mlp": 40, "cnn": 4, "rnn": 4, "lstm": 3}[spec.kind]
        times = interleaved(
            {
                "alone": lambda n, s=spec: stacked(s, data, 1, n),
                "stack": lambda n, s=spec: stacked(s, data, STACK, n),
                "plain": lambda n, s=spec: plain(s, data, n),
            },
            n_epochs,
            n_rounds,
        )
        each = times["stack"] / STACK
        rows[name] = {
            "stack, each [ms]": float(np.median(each)),
            "alone [ms]": float(np.median(times["alone"])),
            "bare loop [ms]": float(np.median(times["plain"])),
            "bare loop / stack": _spread(times["plain"], each),
            "bare loop / alone": _spread(times["plain"], times["alone"]),
        }
        print(name, rows[name], flush=True)
    return pd.DataFrame(rows).T.rename_axis("network")


def gpu(n_rounds: int = 3) -> pd.DataFrame:
    """One row per network: ms per epoch and network on a GPU in stacks of some sizes, and of a bare loop."""
    rows, data = {}, random_data()
    for name, size in SIZES.items():
        spec = spec_of(size)
        runs = {str(n): lambda k, n=n, s=spec: stacked(s, data, n, k, "cuda") for n in GPU_STACKS}
        runs |= {device: lambda k, d=device, s=spec: plain(s, data, k, d) for device in ("cpu", "cuda")}
        times = interleaved(runs, {"mlp": 20}.get(spec.kind, 4), n_rounds, time.perf_counter)
        each = {n: times[str(n)] / n for n in GPU_STACKS}
        largest = each[GPU_STACKS[-1]]
        rows[name] = {f"stack of {n}, each [ms]": float(np.median(ms)) for n, ms in each.items()} | {
            "bare loop, GPU [ms]": float(np.median(times["cuda"])),
            "bare loop, CPU [ms]": float(np.median(times["cpu"])),
            f"bare loop, GPU / {GPU_STACKS[-1]}": _spread(times["cuda"], largest),
            f"bare loop, CPU / {GPU_STACKS[-1]}": _spread(times["cpu"], largest),
        }
        print(name, rows[name], flush=True)
    return pd.DataFrame(rows).T.rename_axis("network")


def _spread(above: np.ndarray, below: np.ndarray) -> str:
    ratios = above / below
    return f"{np.median(above) / np.median(below):.3g} ({ratios.min():.3g}-{ratios.max():.3g})"


# --------------------------------------------------------------------------------------------------------------- errors
def _forecasters() -> dict[str, DisturbanceForecaster]:
    several = {"n_repeats": SEEDS, "repeats": "mean", "random_state": 0}
    networks = {k: DisturbanceForecaster.published(k, **several, **sizes) for k, sizes in NETWORKS.items()}
    corrected = {
        "lstm on ridge": networks["lstm"].__class__(**networks["lstm"].get_params() | {"residual_of": "ridge"})
    }
    simple = {name: DisturbanceForecaster(name) for name in ("profile", "ridge")}
    return simple | networks | corrected


def _errors(climate: str, memory: str) -> list[dict]:
    """Rows of one climate: simple forecasters and networks of both disturbances, the gray box alone and without."""
    office = make_office(n_days=TRAIN_DAYS + TEST_DAYS, climate=climate, start=CLIMATES[climate], random_state=2024)
    cut = TRAIN_DAYS * 96
    train, test, start = office.X[:cut], office.X[cut - 10 * 96 :], office.X.index[cut]
    gray_box = OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=12, random_state=0)

    def rmse(model) -> float:
        return float(score_backtest(backtest(model, test, test["T_za"], start=start))["rmse"])

    rows = []
    for kind in ("input", "output"):
        for name, forecaster in _forecasters().items():
            begin = time.process_time()
            model = HybridPredictor(gray_box, forecaster, disturbance=kind, adapt=None, memory=memory)
            model.fit(train, train["T_za"])
            row = {"climate": climate, "disturbance": kind, "forecaster": name, "RMSE [K]": rmse(model)}
            repeats = model.forecaster_.repeats_
            if len(repeats):
                each = np.array([rmse(one) for one in single_networks(model)])
                row |= {"RMSE [K]": float(each.mean()), "lowest": float(each.min()), "highest": float(each.max())}
                row |= {"best on validation": float(each[repeats["valid_loss"].to_numpy().argmin()])}
                row |= {"mean of networks": rmse(model), "epochs": " ".join(map(str, repeats["n_epochs"]))}
            rows.append(row | {"fit and test [s]": time.process_time() - begin})
            print(rows[-1], flush=True)
    conventional = TwoStagePredictor.conventional(gray_box, memory=memory).fit(train, train["T_za"])
    for name, alone in (("OD alone", model.gray_box_), ("OD, no disturbance", conventional)):
        rows.append({"climate": climate, "disturbance": "", "forecaster": name, "RMSE [K]": rmse(alone)})
    return rows


def error() -> pd.DataFrame:
    """One row a climate, disturbance and forecaster."""
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as memory:
        warnings.simplefilter("ignore", SkhybridWarning)
        rows = [row for climate in CLIMATES for row in _errors(climate, memory)]
    return pd.DataFrame(rows).set_index(["climate", "disturbance", "forecaster"]).astype(object).fillna("")


def main(parts: list[str]) -> None:
    """Run what is asked for and write its table."""
    if "speed" in parts:
        write_table(
            "networks_speed",
            "Time of an epoch of the paper's networks",
            f"{COMMAND} speed",
            {"Epochs": speed()},
            "Case01 by hours, four weeks: 456 windows in batches of 128, then 145 windows of validation; Adam.  ms of "
            "processor time of one thread per epoch and network, median of five rounds in which all take turns; ratios "
            f"of medians (lowest to highest of the rounds).  *Stack*: {STACK} networks trained together.  *Bare loop*: "
            "one network of nn.Linear, nn.Conv1d, nn.RNN or nn.LSTM, a shuffled index, slices of tensors, Adam, the "
            "validation error; no clipping, no record.",
        )
    if "gpu" in parts:
        write_table(
            "networks_gpu",
            "Time of an epoch of the paper's networks on a GPU",
            f"{COMMAND} gpu",
            {"Epochs": gpu()},
            f"{torch.cuda.get_device_name()}, torch {torch.__version__}.  Windows, batches, optimiser and bare loop of "
            "networks_speed.md; ms by the clock, median of three rounds in which all take turns; ratios of medians "
            "(lowest to highest of the rounds).  The bare loop trains one network, on the GPU or on one thread of the "
            "processor.",
        )
    if "error" in parts:
        write_table(
            "networks",
            "Day-ahead error of the paper's networks on the paper's office",
            f"{COMMAND} error",
            {"RMSE of the room temperature": error()},
            f"make_office, {TRAIN_DAYS} summer days of training, the {TEST_DAYS} days after them, an origin a day; "
            "gray box OutputDisturbanceID with known Q_h.  Networks: DisturbanceForecaster.published (case01, 1 layer, "
            "20 wide, relu; CNN with pools of 4): up to 1000 epochs, patience 150, the last week of training "
            f"validates.  {SEEDS} seeds in the place of the paper's ten repeats, one case and one size in the place of "
            "its design matrix, six weeks of test in the place of six months.  RMSE of a network: mean over seeds; "
            "then the lowest and the highest, the one that the validation week chooses (the paper's use of repeats), "
            "and the forecast that is the mean of the networks.  *lstm on ridge*: the same network correcting ridge, "
            "its correction discounted.  *OD alone*: the gray box's own forecast, in which the identified ARMA "
            "disturbance persists; *OD, no disturbance*: the paper's conventional approach, zeta = 0 after the origin. "
            " Seconds of the processor, of all seeds; those of the first row contain compilation.",
        )


if __name__ == "__main__":
    main(sys.argv[1:] or ["speed", "error"])
