"""Fixtures shared by all tests."""

import sys
from pathlib import Path

import matplotlib
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


@pytest.fixture(scope="module")
def quick_fits():
    """Models are learned in a moment, and less well: few trees, one start, two steps of each search."""
    from skhybrid.forecasting import boosting
    from skhybrid.hybrid.thermostat_law import boosted_trees
    from skhybrid.schedule import fit

    def few_steps(problem, best, max_steps, minimise=fit.minimise, **given):
        return minimise(problem, best, min(max_steps, 2), **given)

    with pytest.MonkeyPatch.context() as patch:
        for name, few in (("max_iter", 5), ("max_bins", 7)):
            patch.setitem(boosted_trees.SETTINGS, name, few)
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
