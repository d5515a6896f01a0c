"""The design matrix on the log of a zone."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from ..forecasting import DisturbanceForecaster
from ..hybrid import HybridPredictor
from ..model_selection import DesignMatrix, DesignMatrixSearchCV
from ..study.compared_models import common_settings, make_gray_box
from ..study.log_split import StudyData
from ..study.settings import Settings


def search_zone(
    settings: Settings,
    data: StudyData,
    store: str | PathLike[str],
    matrix: DesignMatrix,
    n_jobs: int,
    verbose: int = 1,
) -> pd.DataFrame:
    """Train the candidates of a design matrix on the training rows and score them on the test rows; the best first.

    They share the identification of the settings.  Their results are in the folder ``store``, where a search
    that was stopped goes on.
    """
    whole = pd.concat([data.train, data.later])
    first = int(whole.index.searchsorted(data.test_start))
    rows = [(np.arange(len(data.train)), np.arange(first, len(whole)))]
    estimator = HybridPredictor(make_gray_box(settings), DisturbanceForecaster("ridge"), **common_settings(settings))
    search = DesignMatrixSearchCV(
        estimator,
        matrix,
        cv=rows,
        store=Path(store) / "search.sqlite",
        n_jobs=n_jobs,
        refit=False,
        verbose=verbose,
    )
    return search.fit(whole, whole["T_za"]).results_.sort_values("rmse", ignore_index=True)
