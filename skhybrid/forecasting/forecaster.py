"""``DisturbanceForecaster``: networks, any scikit-learn regressor and the baselines with one interface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from .._arguments import draw_seed, store_arguments
from .._joining import refuse_no_frames, refuse_unless_following, unmeasured
from .._rolling import RollingForecastMixin
from .._summary import TrainingRecord
from .._table import ZoneTable, append_tables, fill_ahead, read_target, refuse_other_clock
from .._threads import one_blas_thread
from .._time import refuse_disorder, rows_per_day
from .._transaction import unchanged_on_failure
from .._warnings import several, warn_user
from ..exceptions import SkhybridWarning
from .baselines import SAME_KIND_DAYS
from .cases import ModelCase, cases_of, resolve_case
from .features import mode_roles
from .named_models import check_parameters, fit_baseline, is_network, require_networks
from .reading import read_case_inputs
from .ridge import PairRegressor
from .training_job import EPOCHS_WITHOUT_VALIDATION, JobResult, TrainingJob, measured_split, repeat_seeds


class DisturbanceForecaster(RollingForecastMixin, RegressorMixin, BaseEstimator):
    """Forecast of the disturbance, hourly or at any other even step.

    ``y[k]`` is the disturbance over row k; X holds the weather and, as history, the measured disturbance in the column
    ``zeta``.  A forecast from origin row o knows every row up to o, ``zeta[o]`` included, and the inputs of later rows.

    Parameters
    ----------
    model : str or regressor, default "lstm"
        A network (paper Eqs. 19, 20, 21, 22): ``"mlp"``, ``"cnn"``, ``"rnn"``, ``"lstm"``; a baseline; or any
        scikit-learn regressor, which is cloned and fitted over (origin, lead) pairs on calendar, weather, lead and the
        lags of ``"ridge"``.  ``"ridge"`` is linear in calendar, weather and lags; ``"profile"`` the mean by hour of
        week; ``"last_week"`` the value seven days before, else the last known one of that time of day;
        ``"persistence"`` the last known value; ``"none"`` is 0, as the paper's conventional approach expects.
    case : str or ModelCase, default "case01"
        Features of a network (paper, appendix): ``"case01"``, a long name of the paper, or a case of one's own.
    n_layers : int, default 1
        Hidden (MLP), further convolution (CNN) or stacked recurrent (RNN, LSTM) layers.
    hidden_size : int, default 20
        Width of the hidden layers.
    activation : {"relu", "selu", "gelu"}, default "relu"
    dropout : float, default 0.1
        Share of hidden values dropped in training, in [0, 1).
    n_channels, filter_size, pool_size : int, default 10, 6 and 0
        Channels of a convolution, its width [rows], and the width of max-pooling [rows], where 0 pools nothing (CNN).
    residual_of : {"ridge", "profile", "last_week", "persistence"} or None, default "ridge"
        The baseline whose forecast a network corrects, by the share ``network_weight_``; None: it stands alone.
    horizon : timedelta-like or None, default "1D"
        How far ahead is learned and how far ``predict`` looks.  None: one day is learned, and ``predict`` forecasts all
        rows from the first.
    max_epochs, patience : int, default 1000 and 150
        Most epochs of a network, and epochs without a better validation error after which it stops; its best weights
        are kept.
    time_encoding : {"cyclic", "onehot", "ordinal"}, default "cyclic"
        How a network sees hours and days.
    columns : mapping of role to column, optional
        Overrides the names of the columns of X; None as a column says that the role is absent on purpose.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps, which is refused without it.
    holidays : str or sequence of dates, optional
        A country or state as the ``holidays`` package names it, such as ``"US-IL"``, or local dates, which count as
        Sundays; ``"last_week"`` takes the last known day of the same kind.
    random_state : int, RandomState or None, default None
        Seed of initial weights, dropout and batches (and of a regressor whose own is None).
    verbose : int, default 0
        1 shows a progress bar of epochs.
    learning_rate, batch_size : float and int, default 0.003 and 128
        Step of Adam, and windows per step.
    validation_fraction : float, default 0.2
        Share of the rows up to the last measured one, at their end, on whose error training stops; a gap of one horizon
        lies before them.  0 needs ``residual_of=None``: the network is then trained for 20 epochs, or ``max_epochs`` if
        that is less; so it is, with a warning, where the table is too short for a validation block.
    origin_step : timedelta-like, optional
        Distance of origins in ``predict``, at most ``horizon``, which is the default.
    max_missing : float, default 0.5
        Largest share of missing values in ``y``.
    n_repeats : int, default 1
        How many networks are trained, as one stack, from seeds that ``random_state`` gives; each is, to rounding, what
        it would be alone.
    repeats : {"best", "mean"}, default "best"
        Of several, the one with the lowest validation error forecasts (paper 4.4 chooses by the test error), or the
        mean of all.
    refit : bool, default False
        Whether a network is trained again on all rows, the validation block included, for as many epochs as validation
        found best.
    device : str, default "cpu"
        Device on which torch trains networks: ``"cpu"``, ``"cuda"`` (worth while for dozens of networks at once, see
        :func:`~skhybrid.forecasting.fit_many`), or ``"auto"``.  Forecasts are computed on the CPU.

    Attributes
    ----------
    case_ : ModelCase
        The case of a network.
    history_ : list of dict
        Epoch, ``train_loss`` and ``valid_loss`` (mean squared z-score) of a network, of several the one with the lowest
        validation error; empty otherwise.
    n_epochs_ : int
        How many epochs it ran.
    repeats_ : DataFrame
        One row per network: ``seed``, ``n_epochs``, ``train_loss`` of its last epoch, ``valid_loss`` of the weights
        that are kept, their ``best_epoch``, and whether it is ``used``; all before a refit.
    network_weight_ : float
        Share of the network's correction that is used, in [0, 1]: the least-squares one on the validation block, less
        its standard error.  0 drops the network; it is 0, and a warning says so, where the table was too short for
        a validation block.
    regressor_ : regressor
        The fitted clone, where ``model`` is a regressor.
    sampling_time_ : Timedelta
        Step of the training table.
    n_features_in_, feature_names_in_ : int, ndarray of str
    """

    def __init__(
        self, model: Any = "lstm", case: str | ModelCase = "case01", *, n_layers: int = 1, hidden_size: int = 20,
        activation: Literal["relu", "selu", "gelu"] = "relu", dropout: float = 0.1, n_channels: int = 10,
        filter_size: int = 6, pool_size: int = 0,
        residual_of: Literal["ridge", "profile", "last_week", "persistence"] | None = "ridge", horizon: Any = "1D",
        max_epochs: int = 1000, patience: int = 150, time_encoding: Literal["cyclic", "onehot", "ordinal"] = "cyclic",
        columns: Mapping[str, Any] | None = None, sampling_time: Any = None, holidays: Any = None,
        random_state: int | np.random.RandomState | None = None, verbose: int = 0, learning_rate: float = 0.003,
        batch_size: int = 128, validation_fraction: float = 0.2, origin_step: Any = None, max_missing: float = 0.5,
        n_repeats: int = 1, repeats: Literal["best", "mean"] = "best", refit: bool = False, device: str = "cpu",
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    _tail: ZoneTable
    _target_role = "zeta"

    @classmethod
    def published(cls, model: str = "lstm", case: str | ModelCase = "case01", **changes: Any) -> Self:
        """A network as the paper trains it (3.2, 3.3, 4.4), but validated on the end of the training data.

        The network stands alone, its forecast is used whole, and of ten repeats, each of at most 1000 epochs with a
        patience of 150, the one with the lowest error on one week is kept.  That week is the last of the four that
        train, not one of the test data.  The paper states neither optimiser, learning rate, batch size, dropout share
        nor how the time features are encoded: they are this class's defaults.

        Parameters
        ----------
        model : {"mlp", "cnn", "rnn", "lstm"}, default "lstm"
        case : str or ModelCase, default "case01"
            Features; the paper's choice is ``"DEEP_AR_LSTM_FORECAST-case01"``.
        **changes : dict
            Other parameters, such as ``random_state`` or those of the model size (:func:`list_sizes`).

        Raises
        ------
        ValueError
            If ``model`` is no network.

        Examples
        --------
        >>> from skhybrid import DisturbanceForecaster
        >>> forecaster = DisturbanceForecaster.published("lstm", random_state=0)
        >>> forecaster.n_repeats, forecaster.residual_of
        (10, None)
        """
        cases_of(model)  # networks alone have some
        settings = {"residual_of": None, "n_repeats": 10, "repeats": "best", "validation_fraction": 0.25}
        settings |= {"max_epochs": 1000, "patience": 150}
        return cls(model, case, **settings | changes)

    @unchanged_on_failure
    @one_blas_thread
    def fit(self, X: Any, y: Any) -> Self:
        """Learn the disturbance.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Weather and plant by role, and the known past in ``zeta``, for which ``y`` stands in where X has none.
        y : Series or array-like of shape (n_samples,)
            Disturbance over each row [kW, or degC for an output disturbance]; rows where it is NaN are left out.

        Raises
        ------
        ImportError
            If ``model`` is a network and torch or skorch is missing; nothing has been read then.
        ValueError
            If a parameter is impossible, the table cannot be read, too much of ``y`` is missing, or a network diverges.
        """
        job = self._begin(X, y, {})
        if job is not None:
            from .networks.jobs import train_networks  # torch loads here

            self._take(train_networks([job], self.verbose)[0])
        return self

    def _begin(self, X: Any, y: Any, shared: dict[Any, Any]) -> TrainingJob | None:
        """Do all of ``fit`` but the training of networks, which is returned as a job; None where there is none.

        ``shared`` stores what other forecasters of the same X and y need as well: the table and fitted baselines.
        """
        check_parameters(self)
        require_networks(self.model, self.device)
        self.case_ = resolve_case(self.case, self.model) if is_network(self.model) else None
        table, target = self._training_rows(X, y, shared)
        self._check_spans(table.step)
        self._n_leads = self._leads_of_horizon(table.step)
        self.sampling_time_, self.training_ = table.step, TrainingRecord.of(table)
        self.__dict__.pop("regressor_", None)  # of an earlier fit
        self.history_: list[dict[str, float]] = []
        self.n_epochs_, self.network_weight_ = 0, 0.0
        self._network: Any = None  # FittedNetwork
        seed, job = draw_seed(self.random_state), None
        if is_network(self.model):
            job = self._begin_network(table, target, seed, shared)
        else:
            self._begin_other(table, target, seed)
        self._level = float(np.nanmean(target))
        days = max(SAME_KIND_DAYS if table.holidays else 8, self.case_.pattern_days + 1 if self.case_ else 0)
        self._tail = table.rows(slice(-(days * rows_per_day(table.step) + self._n_leads), None)).owned()
        return job

    def _training_rows(self, X: Any, y: Any, shared: dict[Any, Any]) -> tuple[ZoneTable, np.ndarray]:
        """The training table with its history ``zeta``, and the target; the same objects for all that share them."""
        table = read_case_inputs(self, X, reset=True)
        asked = (repr(self.columns), repr(self.sampling_time), self.max_missing)
        key = ("rows", *asked, table.holidays, tuple(table.inputs))
        if key not in shared:
            target = read_target(y, table, max_missing=self.max_missing, role=self._target_role)
            if "zeta" not in table.history:
                table = table.replace(history={**table.history, "zeta": target})
            shared[key] = table, target
        return shared[key]

    def _begin_other(self, table: ZoneTable, target: np.ndarray, seed: int) -> None:
        """Fit a baseline or a regressor."""
        self.repeats_ = pd.DataFrame(columns=["seed", "n_epochs", "train_loss", "valid_loss", "best_epoch", "used"])
        if isinstance(self.model, str):
            self._base = fit_baseline(self.model, table, target, self._n_leads)
        else:
            self._base = PairRegressor(self.model, seed).fit(table, target, self._n_leads)
            self.regressor_ = self._base.regressor_

    def _begin_network(self, table: ZoneTable, target: np.ndarray, seed: int, shared: dict[Any, Any]) -> TrainingJob:
        """Fit two baselines: of the rows that train, for the network to correct, and of all rows, to forecast with."""
        per_day = rows_per_day(table.step)
        assert self.case_ is not None
        if table.n_rows <= self.case_.history * per_day:
            warn_user(
                f"{self.case_.name} reads {several(self.case_.history, 'day')} of the past, which no row of a table of "
                f"{table.n_rows / per_day:.3g} days has: what lies before the table counts as expected; give more "
                "rows, or a case of fewer days.",
                SkhybridWarning,
            )
        split = measured_split(target, self._n_leads, self.validation_fraction, per_day)
        if split.valid_start is None and self.validation_fraction > 0.0:
            follows = (
                f"the network is trained for {min(self.max_epochs, EPOCHS_WITHOUT_VALIDATION)} epochs, whatever their "
                "error; give more rows, or another fraction."
                if self.residual_of is None
                else f"the correction by the network is dropped, and {self.residual_of!r} forecasts alone; give more "
                "rows, another fraction, or residual_of=None."
            )
            warn_user(
                f"validation_fraction={self.validation_fraction:g} of {several(split.train_end, 'row')} leaves too few "
                f"to train on or to validate with: {follows}",
                SkhybridWarning,
            )
        base = self._shared_baseline(table, target, split.train_end, shared)
        self._base = self._shared_baseline(table, target, table.n_rows, shared)
        seeds = repeat_seeds(seed, self.n_repeats)
        return TrainingJob(self, table, target, base, split, self._n_leads, seeds, whole_base=self._base)

    def _shared_baseline(self, table: ZoneTable, target: np.ndarray, n_rows: int, shared: dict[Any, Any]) -> Any:
        """The baseline of the first ``n_rows``, which ``shared`` may have; None where none is corrected."""
        if self.residual_of is None:
            return None
        key = ("baseline", id(table), self.residual_of, self._n_leads, n_rows)
        if key not in shared:
            rows = slice(0, n_rows)
            shared[key] = fit_baseline(self.residual_of, table.rows(rows), target[rows], self._n_leads)
        return shared[key]

    def _take(self, result: JobResult) -> None:
        self._network, self.network_weight_ = result.network, result.weight
        self.history_, self.n_epochs_ = result.history, len(result.history)
        self.repeats_ = result.repeats

    @one_blas_thread
    def forecast(self, history: pd.DataFrame | None, future: pd.DataFrame) -> pd.Series:
        """Forecast the rows of ``future`` from the last row of ``history``.

        Parameters
        ----------
        history : DataFrame or None
            Rows up to the origin, with ``zeta`` as far as it is known; None: the end of the training table.
        future : DataFrame
            The rows right after it with their known inputs; a ``zeta`` in it is not read, nor is the plant up to
            ``horizon`` where the case reads it in the past only.

        Returns
        -------
        Series
            Forecast disturbance [unit of ``y``] at the index of ``future``, named ``zeta``.

        Raises
        ------
        ValueError
            If ``future`` does not begin one step after ``history``, lacks an input, or only one of them has time
            stamps; or if ``history`` lacks ``zeta``, which the training table had, and does not follow that table.
        """
        check_is_fitted(self)
        refuse_no_frames(history, future)
        if self.case_ is not None and not {"i_heat", "i_cool"} & {*self.case_.future} and len(future) <= self._n_leads:
            future, _ = fill_ahead(future, [self._column_of(role) for role in mode_roles(self._tail.inputs)])
        ahead = unmeasured(self._read_X(future), self._tail)
        past = self._tail if history is None else self._read_past(history)
        refuse_other_clock(ahead, past)
        joined = append_tables(past, ahead)
        if past.utc is None:  # the clock runs on
            if history is not None:
                refuse_disorder(history.index.append(future.index))
            joined = joined.replace(time=pd.date_range(past.time[0], periods=joined.n_rows, freq=past.step))
        else:
            refuse_unless_following(ahead, past)
        values = self._forecast(joined, np.array([past.n_rows - 1]), ahead.n_rows)[0]
        return pd.Series(values, index=future.index, name="zeta")

    def _read_past(self, history: pd.DataFrame) -> ZoneTable:
        """The rows up to an origin, after the end of the training table where they follow it."""
        table = self._read_X(history)
        past, n_tail = self._after_tail(table)
        self._refuse_lost_past(table, n_tail)
        return past

    def _read_X(self, X: Any) -> ZoneTable:
        return read_case_inputs(self, X, reset=False)

    def _facts(self) -> dict[str, str]:
        facts = {"model": str(self.model)}
        if self._network is None or self.case_ is None:
            return facts
        share = {"corrects": str(self.residual_of), "share": f"{self.network_weight_:.3g}"} if self.residual_of else {}
        return facts | {"case": self.case_.name, "epochs": str(self.n_epochs_)} | share

    def _past_roles(self) -> tuple[str, ...]:
        return ("zeta",)

    def _cold_value(self, table: ZoneTable) -> float:
        first = table.measured("zeta")[0]
        if np.isfinite(first):
            return float(first)
        return self._level if self._base is None else float(self._base.expected(table.rows(slice(0, 1)))[0])

    def _forecast(self, table: ZoneTable, origins: np.ndarray, n_leads: int) -> np.ndarray:
        base: Any = None if self._base is None else self._base.forecast(table, origins, n_leads)
        if self._network is None or (base is not None and self.network_weight_ == 0.0):
            return base
        if base is None:
            return self._network.forecast(table, origins, n_leads)
        whole = self._network.forecast(table, origins, n_leads, base, self._base.expected(table))
        return base + self.network_weight_ * (whole - base)
