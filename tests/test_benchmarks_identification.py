"""The benchmark of the speed of identifications (``benchmarks/identification.py``): how many starts it times."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import identification

from skhybrid.datasets import make_office


def test_all_starts_are_made_though_the_first_ten_agree():
    office = make_office(3, random_state=0)
    settings = {"known": identification.KNOWN, "n_starts": 30, "random_state": 0}
    usual, all_made = (
        identification.fit_quietly(kind(**settings), office.X, office.y)
        for kind in (identification.OutputDisturbanceID, identification.AllStarts)
    )
    assert len(usual.starts_) < 30
    assert len(all_made.starts_) == 30
