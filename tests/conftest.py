"""Fixtures shared by all tests."""

import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")


@pytest.fixture
def write(tmp_path):
    """A function that writes a text to a file of a temporary folder and returns its path."""

    def to_file(text, encoding="utf-8", name="log.csv"):
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return to_file


@pytest.fixture
def closed_figures():
    """Close the figures of a test after it."""
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


def one_tree(X, y, weight=None):
    """A tree whose splits are tried at random, in a moment, in place of the boosted ones of ``fit_trees``."""
    from sklearn.tree import ExtraTreeRegressor

    from skhybrid.hybrid.thermostat_law.boosted_trees import BoostedTrees

    X = np.where(np.isfinite(X).any(axis=0), X, 0.0)
    tree = ExtraTreeRegressor(max_depth=5, min_samples_leaf=10, random_state=0).fit(X, y, weight).tree_
    leaf, own = tree.children_left < 0, np.arange(tree.node_count)
    left, right = (np.where(leaf, own, child) for child in (tree.children_left, tree.children_right))
    nodes = (np.where(leaf, 0, tree.feature), tree.threshold, left, right, tree.missing_go_to_left.astype(bool))
    return BoostedTrees(0.0, *(part[None] for part in nodes), tree.value[None, :, 0, 0].astype(np.float32))


@pytest.fixture(scope="module")
def quick_fits():
    """Models are learned in a moment, and less well: a tree for many, one start, two steps of each search."""
    from skhybrid.forecasting import boosting
    from skhybrid.hybrid.thermostat_law import plant_law
    from skhybrid.schedule import fit

    def few_steps(problem, best, max_steps, minimise=fit.minimise, **given):
        return minimise(problem, best, min(max_steps, 2), **given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plant_law, "fit_trees", one_tree)
        patch.setattr(boosting, "_FEW_TREES", 5)
        patch.setattr(boosting, "_LEAST_PAIRS", sys.maxsize)  # so that no trial chooses the number of trees
        for name in ("_SCALES", "_PACES", "_GAINS", "_UAS", "_DAY_TYPES"):
            patch.setattr(fit, name, (1.0,))
        patch.setattr(fit, "minimise", few_steps)
        yield


@pytest.fixture
def empty_pictures(monkeypatch):
    """Figures are made and written, but without what is on them: to draw a report takes longer than its study."""
    from matplotlib.figure import Figure

    draw = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda _, *to, **given: draw(Figure((0.1, 0.1)), *to, **given))


@pytest.fixture(scope="session")
def hourly_office():
    """Hourly rows of the small office, from a Monday on."""
    from skhybrid.datasets import load_small_office

    office = load_small_office("irregular")
    frame = office.frame.drop(columns=[c for c in office.X if c in office.frame]).join(office.X)
    names = {"set_heat": "T_heat_set", "set_cool": "T_cool_set"}
    roles = ["T_oa", "q_sol", "Q_hvac", "T_heat_set", "T_cool_set", "T_za"]
    return frame.rename(columns=names)[roles].resample("1h").mean().loc["2018-09-17":].rename_axis("time")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of reference data beside the checkout; the test is skipped where it is not there."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("reference data (../shared/data) is not on this machine")
    return folder
