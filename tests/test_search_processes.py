"""DesignMatrixSearchCV in several processes: killed, sharing a store, on clusters; always the same table."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time

import clusters
import joblib
import numpy as np
import pandas as pd
import pytest

from skhybrid.model_selection import DesignMatrixSearchCV
from skhybrid.model_selection.search import runner
from skhybrid.parallel.shared import Shared
from skhybrid.parallel.workers import Workers

#: what every process of this file searches, and how it reports how much of it was its own work
PROGRAM = """
import sys
from skhybrid import DisturbanceForecaster, HybridPredictor, OutputDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.model_selection import DesignMatrixSearchCV, RollingOriginSplit, design_matrix
from skhybrid.model_selection.search import runner

office = make_office(n_days=12, sampling_time="1h", random_state=1)
gray_box = OutputDisturbanceID(known=office.theta, n_starts=1, random_state=0)
forecaster = DisturbanceForecaster(max_epochs=30, residual_of=None)
estimator = HybridPredictor(gray_box, forecaster, random_state=0)
matrix = design_matrix(["mlp", "ridge"], ["case02"], size={"hidden_size": [2, 3, 4], "n_layers": [1]})
given = {"cv": RollingOriginSplit(train="8D", test="2D", n_splits=2), "refit": False, "verbose": 0, "chunk_size": 1}
"""
RUN = """
done, evaluate = [], runner.evaluate
runner.evaluate = lambda *args: done.append(1) or evaluate(*args)
print("ready", flush=True)
sys.stdin.readline()
search = DesignMatrixSearchCV(estimator, matrix, store=sys.argv[1], n_jobs=int(sys.argv[2]), **given)
table = search.fit(office.X, office.y).results_
print(len(done), table["rmse"].to_json(double_precision=15), flush=True)
"""


@pytest.fixture(scope="module")
def given():
    names: dict = {}
    exec(PROGRAM, names)
    return names


def search(given, **changed):
    found = DesignMatrixSearchCV(given["estimator"], given["matrix"], **given["given"] | changed)
    return found.fit(given["office"].X, given["office"].y).results_.drop(columns="fit_time")


@pytest.fixture(scope="module")
def uninterrupted(given):
    return search(given)


def start(store, n_jobs):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM + RUN, str(store), str(n_jobs)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # so that its workers can be ended with it
    )


def end(process):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def finished(store):
    """Rows (candidate, split, time) of a store, as another process sees them."""
    if not store.exists():
        return []
    reader = sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=10)
    try:
        return reader.execute("SELECT candidate, split, finished FROM result").fetchall()
    except sqlite3.OperationalError:  # no table yet
        return []
    finally:
        reader.close()


@pytest.mark.slow
def test_a_search_that_was_killed_goes_on_and_ends_the_same(given, uninterrupted, tmp_path, monkeypatch):
    store, total = tmp_path / "r.sqlite", 2 * len(given["matrix"])
    process = start(store, n_jobs=2)
    try:
        process.stdin.write("\n")
        process.stdin.flush()
        until = time.monotonic() + 120
        while len(finished(store)) < 3 and time.monotonic() < until:
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    finally:
        end(process)
    before = finished(store)
    assert 3 <= len(before) < total
    done, evaluate = [], runner.evaluate
    monkeypatch.setattr(runner, "evaluate", lambda *args: done.extend(args[2]) or evaluate(*args))
    table = search(given, store=store)
    assert len(done) == total - len(before)  # nothing that was finished is repeated
    assert set(before) <= set(finished(store))
    pd.testing.assert_frame_equal(table, uninterrupted, check_exact=True)


@pytest.mark.slow
def test_two_processes_share_one_store(given, uninterrupted, tmp_path):
    store, total = tmp_path / "r.sqlite", 2 * len(given["matrix"])
    both = [start(store, n_jobs=1) for _ in range(2)]
    try:
        for process in both:
            assert process.stdout.readline() == "ready\n"
        for process in both:
            process.stdin.write("\n")
            process.stdin.flush()
        told = [process.communicate(timeout=120)[0].split(" ", 1) for process in both]
    finally:
        for process in both:
            end(process)
    shares = [int(count) for count, _ in told]
    assert sum(shares) == total
    assert min(shares) > 0
    for _, rmse in told:
        np.testing.assert_allclose(list(json.loads(rmse).values()), uninterrupted["rmse"], rtol=1e-13)
    pd.testing.assert_frame_equal(search(given, store=store), uninterrupted, check_exact=True)


# ------------------------------------------------------------------------------------------------------------ clusters
def unpacked(n_jobs=None):
    """(process, object) in which each of ten tasks found what they share, and whether it was mapped from disk."""

    def where(shared):
        return os.getpid(), id(shared.get()), type(shared._packed).__name__

    shared = Shared(np.zeros(200_000))
    with Workers(n_jobs) as pool:
        return list(pool.run(iter([joblib.delayed(where)(shared)] * 10)))


def assert_sent_once_a_worker(found):
    assert os.getpid() not in {pid for pid, *_ in found}
    assert len({(pid, one) for pid, one, _ in found}) == len({pid for pid, *_ in found}) <= 2


@pytest.mark.slow
def test_joblibs_own_workers_map_what_they_share(given, uninterrupted):
    pd.testing.assert_frame_equal(search(given, n_jobs=2), uninterrupted, check_exact=True)
    found = unpacked(n_jobs=2)
    assert_sent_once_a_worker(found)
    assert {kind for *_, kind in found} == {"memmap"}


@pytest.mark.slow
@pytest.mark.parametrize("cluster", [clusters.dask, clusters.ray])
def test_a_cluster_of_two_workers_gives_the_same(cluster, given, uninterrupted, tmp_path):
    with cluster():
        assert_sent_once_a_worker(unpacked())
        table = search(given, store=tmp_path / "r.sqlite")
    pd.testing.assert_frame_equal(table, uninterrupted, check_exact=True)
    assert len(finished(tmp_path / "r.sqlite")) == 2 * len(given["matrix"])
