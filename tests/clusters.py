"""Clusters of two workers for the tests."""

from __future__ import annotations

import importlib
from contextlib import contextmanager

import joblib
import pytest


@contextmanager
def processes():
    yield


@contextmanager
def dask():
    distributed = pytest.importorskip("distributed")
    with (
        # otherwise it tries three times again
        importlib.import_module("dask").config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(2, processes=True, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster),
        joblib.parallel_config(backend="dask"),
    ):
        yield


@contextmanager
def ray():
    ray = pytest.importorskip("ray")
    from ray.util.joblib import register_ray

    register_ray()
    # of a lower priority than other tests, as they are otherwise, the workers would wait for minutes
    settings = {"object_store_memory": 100 * 2**20, "_system_config": {"worker_niceness": 0}}
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, **settings)
    try:
        with joblib.parallel_config(backend="ray", n_jobs=2):
            yield
    finally:
        ray.shutdown()
