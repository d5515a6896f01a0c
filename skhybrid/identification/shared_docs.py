"""Parameter and attribute documentation that the identifications share."""

from __future__ import annotations

from .._docs import docs_from

_BLOCKS = {
    "network": """
    network : str or RCNetwork, default="2R2C"
        A name of the catalogue, or a network of your own.
    known : dict of parameter to value, optional
        Parameters that are not searched, such as a capacity ``{"Q_h": 6.0}`` [kW]; those of ``disturbance_`` can be
        among them, in its units.
    """,
    "search": """
    bounds : dict of parameter to (lower, upper), optional
        Overrides the paper's bounds.
    n_starts : int, default=50
        Largest number of random starts, log-uniform within the bounds; the search ends once five agree on the best
        minimum.
    """,
    "data": """
    horizon : timedelta-like, optional
        How far ahead ``predict`` looks; None simulates from the first row on.
    warmup : timedelta-like, default="1D"
        How much of the training table's end is kept as history; CONV sets its first state over such a span, at
        most half of the rows.
    columns : dict of role to column, optional
        Columns whose names are not their roles.
    sampling_time : timedelta-like, optional
        Step of tables without time stamps, which are refused without it.
    """,
    "runs": """
    n_jobs : int, optional
        Starts run in parallel.
    random_state : int, RandomState or None
        Of the starts; None is 0, so that equal tables give equal fits.  The result is the same under any ``n_jobs``.
    verbose : int, default=0
        1 shows a progress bar.
    origin_step : timedelta-like, optional
        Distance of forecast origins, at most ``horizon``, which is the default.
    max_missing : float, default=0.5
        Highest share of missing measurements.
    priors : dict of parameter to prior, optional
        ``(median, factor)``, log-normal with 90 % between ``median / factor`` and ``median * factor``, or a frozen
        ``scipy.stats.lognorm`` (``norm`` for a parameter of either sign).  The fit is then the posterior's maximum.
    """,
    "objective": """
    objective : {"one_step", "multi_step"}, default="one_step"
        Square the errors of the next row (CONV: of the simulation), for the building's parameters; or those of hourly
        forecasts up to ``horizon`` (default one day), for forecasts; see :ref:`two_objectives`.
    """,
    "theta": """
    theta_, theta_std_ : Series
        Parameters and their standard errors, from the Hessian or the days, whichever is larger; NaN of a parameter
        that a bound holds, infinite of one that nothing moved.
    theta_cov_ : DataFrame
        Covariance of the parameters; see :meth:`theta_interval`.
    n_days_ : int
        Days of data on which the standard errors rest.
    identifiability_ : Identifiability
        Flat and weak directions, parameters at a bound, parameters that nothing moved.
    """,
    "weighted_loss": """
    loss_, noise_std_ : float
        Sum of squared errors [K2], weighted where their variances differ, and their standard deviation where no row is
        missing [K].
    """,
    "fitted": """
    starts_ : DataFrame
        One row per start that was made: its loss, whether that is the best, and where it ended.
    state_space_ : StateSpace
    initial_state_ : ndarray of shape (n_states,)
        Node temperatures at the first training row [degC].
    sampling_time_ : Timedelta
    network_ : RCNetwork
    n_features_in_, feature_names_in_ : int, ndarray of str
    """,
}

shared_docs = docs_from(_BLOCKS)  # puts these blocks into a class docstring
