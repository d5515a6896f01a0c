"""Errors of the study that ``make demo`` runs, without and with the irradiance on facades.

Writes ``results/demo.md``, whose first tables are in the README.  ``python benchmarks/demo.py``
"""

from __future__ import annotations

import pandas as pd
from _report import write_table

from skhybrid.cli.demo import office_study
from skhybrid.study import run_study

SITE = {"latitude": 41.98, "longitude": -87.92}
NOTE = (
    "Six weeks of training and twenty days of test of the EnergyPlus small office in Chicago that ships with the "
    "package, an origin at each midnight.  With the set-points known, the 80 % intervals held {:.0f} % of the "
    "temperatures and {:.0f} % of the loads; with the heat known, the 80 % intervals of the hybrid held {:.0f} % of "
    "the measurements, with the irradiance on facades (`[site]`) {:.0f} %."
)
SETPOINTS = "set-points known, as `make demo` has it"


def errors(table: pd.DataFrame, known: str) -> pd.DataFrame:
    """Errors and times as the README shows them."""
    shown = {
        "RMSE [K]": table["rmse"].map("{:.2f}".format),
        "MAE [K]": table["mae"].map("{:.2f}".format),
        "load RMSE [kW]": table["load_rmse"].map("{:.2f}".format),
    }
    if "seconds" in table:
        shown["seconds"] = table["seconds"].map("{:.1f}".format)
    return pd.DataFrame(shown).replace("nan", "-").rename_axis(f"known: {known}")


def main() -> None:
    """Run both studies and write their tables."""
    plain, facades = (run_study(*office_study(**given)) for given in ({}, {"site": SITE}))
    held = plain.setpoints_known
    tables = {
        SETPOINTS: errors(held.table, "weather, set-points"),
        "heat known, as `make demo` has it": errors(plain.table, "weather, heat"),
        "heat known, with `[site]`": errors(facades.table, "weather, heat"),
    }
    shares = (held.coverage, held.load_coverage, plain.coverage, facades.coverage)
    note = NOTE.format(*(100 * share for share in shares))
    print(write_table("demo", "The study of `make demo`", "python benchmarks/demo.py", tables, note))


if __name__ == "__main__":
    main()
