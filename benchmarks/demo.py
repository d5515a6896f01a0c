"""Errors of the study that ``make demo`` runs, without and with the irradiance on facades.

Writes ``results/demo.md``, whose first table is in the README.  ``python benchmarks/demo.py``
"""

from __future__ import annotations

import pandas as pd
from _report import write_table

from skhybrid.cli.demo import office_study
from skhybrid.study import StudyResult, run_study

SITE = {"latitude": 41.98, "longitude": -87.92}
NOTE = (
    "Six weeks of training and twenty days of test of the EnergyPlus small office in Chicago that ships with the "
    "package, an origin at each midnight.  The 80 % intervals of the hybrid held {:.0f} % of the measurements, with "
    "the irradiance on facades (`[site]`) {:.0f} %."
)


def errors(result: StudyResult) -> pd.DataFrame:
    """Errors and times as the README shows them."""
    table = result.table
    shown = {
        "RMSE [K]": table["rmse"].map("{:.2f}".format),
        "MAE [K]": table["mae"].map("{:.2f}".format),
        "load RMSE [kW]": table["load_rmse"].map("{:.2f}".format),
        "seconds": table["seconds"].map("{:.1f}".format),
    }
    return pd.DataFrame(shown).replace("nan", "-").rename_axis("day-ahead forecast")


def main() -> None:
    """Run both studies and write their tables."""
    plain, facades = (run_study(*office_study(**given)) for given in ({}, {"site": SITE}))
    tables = {"as `make demo` has it": errors(plain), "with `[site]`": errors(facades)}
    note = NOTE.format(100 * plain.coverage, 100 * facades.coverage)
    print(write_table("demo", "The study of `make demo`", "python benchmarks/demo.py", tables, note))


if __name__ == "__main__":
    main()
