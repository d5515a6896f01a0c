"""Documentation of parameters and attributes that the hybrid predictors share."""

from __future__ import annotations

from .._docs import docs_from

#: puts these blocks into a class docstring
shared_docs = docs_from(
    {
        "stages": """
        gray_box : estimator, optional
            An identification of this package; default ``PeriodicDisturbanceID()`` with ``network`` and ``known``.  Its
            ``columns``, ``sampling_time`` and ``holidays`` are used unless they are given here.  A fitted one in a
            :class:`~sklearn.frozen.FrozenEstimator` is used as it is: it may have been fitted on other rows, such as
            the paper's seven days of perturbed control.
        forecaster : estimator, optional
            A regressor of the disturbance; default ``DisturbanceForecaster("ridge")``.  One whose ``horizon`` is None
            learns this estimator's horizon, or one day.
        """,
        "purpose": """
        purpose : {"forecast", "plan"}, default="forecast"
            What the forecasts are for.  ``"forecast"``: the smallest error if the heat ahead is known.  ``"plan"``: the
            right response to a kW, for a controller that decides on the heat.  Jumps of the heat in the training show
            this response; the network is pulled toward it, and all members of the blend respond as the network does.
        """,
        "gain": """
        gain_ : DataFrame
            Temperature after a step of 1 kW, by lead, of each way to forecast and of their blend [K/kW].
        gain_std_ : Series
            Relative standard error of the network's ``gain_``, by lead.  It joins the statistical error (a jackknife
            over blocks of days) and the error of the network itself, as found by step tests in EnergyPlus: 0.25 with
            ``purpose="plan"`` after a training with jumps of the heat, otherwise 0.5.
        """,
        "disturbance": """
        disturbance : {"input", "output"}, default="input"
            Whether the disturbance is heat on the zone [kW] or an addition to its temperature [K].
        """,
        "horizon": """
        horizon : timedelta-like, default="1D"
            How far ahead ``predict`` looks; None forecasts from the first row on.
        """,
        "preprocess": """
        preprocess : transformer, optional
            Applied to every table before it is read, so that ``forecast``, ``predict_quantiles``, ``predict_load`` and
            ``update`` work as they would inside a Pipeline; a clone is fitted in ``fit`` as ``preprocess_`` (None
            without one).  Its output must keep the index and the column names (``set_output``), because columns are
            found by name.  Temperatures that were not measured stay missing, whatever it fills.
        """,
        "memory": """
        memory : str or joblib.Memory, optional
            Where identifications are cached, so that candidates of a search that share a gray box identify it once.
        """,
        "parts": """
        n_jobs : int, optional
            Passed to a gray box that has none.
        random_state : int, RandomState or None
            Passed to parts that have none.
        verbose : int, default=0
            1 shows progress.
        """,
        "data": """
        columns : dict of role to column, optional
            Columns whose names are not their roles.
        sampling_time : timedelta-like, optional
            Step of tables without time stamps.
        holidays : str or sequence of dates, optional
            A country or state as the ``holidays`` package names it, such as ``"US"``, ``"US-IL"`` or ``"DE-BY"``, or
            local dates.  A holiday counts as a Sunday.
        """,
        "origins": """
        origin_step : timedelta-like, optional
            Distance of forecast origins, at most ``horizon``, which is the default.
        max_missing : float, default=0.5
            Highest share of missing measurements.
        """,
        "prior": """
        prior : FleetPrior, optional
            Knowledge from fitted zones with the same columns, step and network, for a log of a few days.  For ARX it
            replaces the penalties that are otherwise chosen from the log; for the network it is used with less than a
            week.  Not with ``purpose="plan"``.
        """,
        "fitted": """
        zeta_ : Series
            The disturbance of the training, by steps of the forecaster [kW, or K for an output disturbance].
        sampling_time_, disturbance_step_ : Timedelta
            Steps of the table and of the disturbance.
        intervals_ : LeadIntervals
            Errors on left-out days of the training, from which quantiles are made.
        preprocess_ : transformer or None
        n_features_in_, feature_names_in_ : int, ndarray of str
        """,
    }
)
