"""Cost of the full design matrix, extrapolated from the part that ran."""

from __future__ import annotations

import numpy as np
import pandas as pd
from _study_plan import CLIMATES
from scipy.optimize import nnls

from skhybrid.forecasting.cases import NETWORKS, RECURRENT, resolve_case
from skhybrid.model_selection import design_matrix

LEADS = 24
#: inputs that a recurrent network reads per row, padding included
_INPUTS = 8
_COLUMNS = {"zeta": 1, "how": 4, "hod": 2, "dow": 2, "weekday": 1, "T_oa": 1, "q_sol": 1, "i_heat": 1, "i_cool": 1}


def multiplications(row: pd.Series) -> float:
    """Multiplications of one forward pass of one window [millions]; a backward pass takes about twice as many."""
    case = resolve_case(row["case"], row["framework"])
    n_past, width, layers = 24 * case.pattern_days, row["hidden_size"], row["n_layers"]
    head = width * width + width
    if row["framework"] in RECURRENT:
        gates = 4 if row["framework"] == "lstm" else 1
        cells = gates * width * (_INPUTS + width + (layers - 1) * 2 * width)
        return 1e-6 * ((n_past + LEADS) * cells + LEADS * head)
    flat = n_past * sum(_COLUMNS[f] for f in case.past) + LEADS * sum(_COLUMNS[f] for f in case.future)
    if row["framework"] == "mlp":
        return 1e-6 * (flat * width + (layers - 1) * width * width + width * LEADS)
    return 1e-6 * _convolutions(row, flat)


def _convolutions(row: pd.Series, flat: int) -> float:
    total, length, channels = 0.0, flat, 1
    for _ in range(int(row["n_layers"]) + 1):
        total += length * row["filter_size"] * channels * row["n_channels"]
        channels = row["n_channels"]
        length = length // row["pool_size"] if row["pool_size"] else length
    return total + length * channels * row["hidden_size"] + row["hidden_size"] * LEADS


def costs(results: pd.DataFrame) -> pd.DataFrame:
    """One row per framework: candidates and hours of what ran, and hours of the paper's full grid.

    The seconds of a candidate are modelled as ``epochs * (a + b * multiplications)``, with a and b of the framework by
    non-negative least squares.  The rest of the grid gets the mean number of epochs of what ran.
    """
    full = design_matrix().table
    rows = {}
    for framework in NETWORKS:
        ran = results[(results["framework"] == framework) & results["fit_time"].notna() & results["n_epochs"].notna()]
        grid = full[full["framework"] == framework]
        n_full = len(grid) * len(CLIMATES)
        rows[framework] = {"candidates run": len(ran), "of": n_full, "share": len(ran) / n_full}
        if len(ran) < 4:
            continue
        epochs = ran["n_epochs"].to_numpy(float)
        X = np.column_stack([epochs, epochs * ran.apply(multiplications, axis=1)])
        seconds = ran["fit_time"].to_numpy(float)
        per_epoch = nnls(X, seconds)[0]
        each = per_epoch[0] + per_epoch[1] * grid.apply(multiplications, axis=1)
        rows[framework] |= {
            "hours run": float(seconds.sum()) / 3600.0,
            "seconds each": float(seconds.mean()),
            "epochs each": float(epochs.mean()),
            "hours by the fit / hours run": float((X @ per_epoch).sum() / seconds.sum()),
            "hours of the full grid": float(each.sum() * len(CLIMATES) * epochs.mean()) / 3600.0,
        }
    table = pd.DataFrame(rows).T.rename_axis("framework")
    total = {
        name: table[name].sum()
        for name in ("candidates run", "of", "hours run", "hours of the full grid")
        if name in table
    }
    table.loc["all"] = pd.Series(total | {"share": total["candidates run"] / total["of"]})
    shown = table.astype({"candidates run": int, "of": int}).astype(object)
    return shown.where(table.notna(), "")
