"""Runs pytest in forked processes that have the heavy libraries loaded; ``mutate.py`` starts it and asks by lines.

A question is a line of JSON: ``arguments`` of pytest, ``plain`` (kernels without compilation), ``limit`` [s], ``log``
and perhaps ``survey``, a file for the functions that each test calls.  The answer is the exit status, or ``timeout``.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import time
from contextlib import contextmanager
from pathlib import Path

LOADED = ["numpy", "scipy.optimize", "scipy.signal", "scipy.stats", "pandas", "numba", "sklearn.linear_model", "pytest"]
LOADED += ["sklearn.model_selection", "sklearn.ensemble", "sklearn.utils.estimator_checks", "pvlib", "joblib"]
LOADED += ["matplotlib.pyplot", "hypothesis", "skops.io"]


class Survey:
    """Notes which functions of the package each test and each fixture calls, and its seconds."""

    def __init__(self, package: Path) -> None:
        self.package, self.seen, self.tests, self.fixtures = str(package) + os.sep, {}, {}, {}

    def trace(self, frame, event, argument) -> None:
        self.seen[id(frame.f_code)] = frame.f_code

    @contextmanager
    def noted(self, notes: dict, name: str, fixtures: list[str]):
        """Fixtures are noted apart from tests, because all tests that use one depend on what it calls."""
        outer, self.seen, begin = self.seen, {}, time.perf_counter()
        try:
            yield
        finally:
            codes, self.seen = self.seen, outer
        # not reached where the test fails or is skipped: such a test can tell nothing of a mutant
        own = [code for code in codes.values() if code.co_filename.startswith(self.package)]
        calls = {f"{code.co_filename[len(self.package) :]}:{code.co_qualname}" for code in own}
        before = notes.get(name, {"seconds": 0.0, "calls": []})
        seconds = max(before["seconds"], round(time.perf_counter() - begin, 3))
        notes[name] = {"seconds": seconds, "calls": sorted(calls.union(before["calls"])), "fixtures": fixtures}

    def hooks(self):
        """A plugin of pytest."""
        import pytest

        survey = self

        class Hooks:
            @pytest.hookimpl(wrapper=True)
            def pytest_fixture_setup(self, fixturedef):
                with survey.noted(survey.fixtures, fixturedef.argname, []):
                    return (yield)

            @pytest.hookimpl(wrapper=True)
            def pytest_runtest_call(self, item):
                with survey.noted(survey.tests, item.nodeid, sorted(item.fixturenames)):
                    return (yield)

        return Hooks()


def run(package: Path, question: dict) -> int:
    """In the forked process: pytest on the package in a folder."""
    import numba
    import pytest

    log = os.open(question["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    if question["plain"]:
        os.environ["NUMBA_DISABLE_JIT"] = "1"
        numba.config.DISABLE_JIT = 1
    if not question["survey"]:
        return int(pytest.main(question["arguments"]))
    survey = Survey(package)
    sys.settrace(survey.trace)
    status = int(pytest.main(question["arguments"], plugins=[survey.hooks()]))
    sys.settrace(None)
    Path(question["survey"]).write_text(
        json.dumps({"tests": survey.tests, "fixtures": survey.fixtures}), encoding="utf-8"
    )
    return status


def answer(package: Path, question: dict) -> str:
    """Fork, wait and end what takes too long, with all that it started."""
    child, begin = os.fork(), time.time()
    if child == 0:
        os.setsid()
        status = 99
        try:
            status = run(package, question)
        finally:
            sys.stdout.flush()
            os._exit(status)
    while time.time() - begin < question["limit"]:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return str(os.waitstatus_to_exitcode(status))
        time.sleep(0.05)
    try:
        os.killpg(child, signal.SIGKILL)
    except ProcessLookupError:
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "timeout"


def main() -> None:
    package = Path(sys.argv[1]) / "skhybrid"
    sys.path.insert(0, str(package.parent))
    for name in LOADED:
        importlib.import_module(name)
    for line in sys.stdin:
        print(answer(package, json.loads(line)), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
