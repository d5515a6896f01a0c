"""The examples of optimisers: one linear program, three formulations, one optimum."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from scipy.optimize import linprog

for library in ("cvxpy", "casadi", "do_mpc"):
    pytest.importorskip(library)

EXAMPLE = Path(__file__).parents[1] / "examples" / "plot_three_optimisers.py"

pytestmark = pytest.mark.filterwarnings("ignore:The (ONNX|opcua) feature is not available")


@pytest.fixture(scope="module")
def found():
    """Names of the example after it ran."""
    matplotlib.use("Agg")
    return runpy.run_path(str(EXAMPLE))


def test_three_formulations_have_the_optimum_of_a_fourth(found):
    """By SciPy, over the heat and the missing degrees alone."""
    ahead, price, n = found["ahead"], found["price"], found["n"]
    cost = found["hours"] * np.concatenate([price, np.full(n, found["discomfort"])])
    warm_enough = -np.hstack([ahead.gain[:, :, 0], np.eye(n)])
    bounds = [(0.0, found["most"])] * n + [(0.0, None)] * n
    best = linprog(cost, warm_enough, ahead.free - found["lowest"], bounds=bounds)
    np.testing.assert_allclose(found["costs"]["cost"], best.fun, rtol=1e-4)
    assert set(found["plans"]) == {"cvxpy", "CasADi", "do-mpc"}
    for q in found["plans"].values():
        assert q.min() > -1e-6
        assert q.max() < found["most"] + 1e-6
    assert np.ptp(best.x[:n]) > 1.0  # there was something to decide


def test_the_plan_keeps_the_margin_of_the_quantile(found):
    ahead, comfort = found["ahead"], found["comfort"]
    tenth = ahead.temperature(found["plans"]["cvxpy"]) + ahead.offsets[:, 0]
    assert (tenth > comfort - 1e-6).all()
    assert (ahead.offsets[1:, 0] < 0).all()
    assert np.isclose(tenth, comfort).any()  # no warmer than that
