"""Fixtures shared by all tests."""

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


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of reference data beside the checkout; the test is skipped where it is not there."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("reference data (../shared/data) is not on this machine")
    return folder
