"""Forecasts for optimisers from frames: affine in a plan's heat, and a network as a discrete model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from sklearn.utils.validation import check_is_fitted

from .._calendar import day_type_hours
from .._joining import read_now, refuse_no_frames, with_measured
from .._table import ZoneTable
from .._threads import one_blas_thread
from .._warnings import warn_once
from ..control import (
    AffineForecast,
    ControlModel,
    Plan,
    decided_on,
    limits_of,
    planned,
    read_inputs,
    read_member,
    warn_bent,
    warn_uncovered,
)
from ..exceptions import GainWarning
from ..forecasting.intervals import LeadIntervals, PathClock
from ..forecasting.quantiles import path_clock, read_quantiles
from ..forecasting.weather_error import WeatherError, weather_of_quantiles
from .frames_forecast import FramesForecastMixin
from .scheme import Ahead, RecentErrors


class AffineFramesMixin(FramesForecastMixin):
    """``affine_forecast`` and ``to_state_space`` of the hybrid predictors."""

    @one_blas_thread
    def affine_forecast(
        self,
        history: Any,
        future: Any,
        inputs: Sequence[str] | None = None,
        T_za: float | None = None,
        member: str = "blend",
        quantiles: Sequence[float] | None = None,
        weather_error: Any = None,
    ) -> AffineForecast:
        """Forecast as an affine function of the heat that is planned: ``T = free + gain @ q``.

        It is what :meth:`forecast` gives under a plan, up to rounding, with three exceptions.  Nothing is clipped:
        :meth:`forecast` stays within the temperatures known so far, widened on either side by their range and 2 K, and
        by 10 K at least.  Where a stage's heat bends at part load, the gain is that at the plan in ``future``.  And
        with ``T_za`` the offsets of the schedule model come from errors recorded as it ran, in a few milliseconds.

        Parameters
        ----------
        history : DataFrame or None
            As in :meth:`forecast`.
        future : DataFrame
            As in :meth:`forecast`.  Columns of the ``inputs`` may be absent; what they hold is a first plan, at which
            the tangent is taken where a stage's heat bends at part load.
        inputs : sequence of str, optional
            What is decided: heating and cooling of the training table, kW or stages; of the schedule model also a
            boundary temperature of its network.  What is not named is read from ``future``; default is all heating and
            cooling, in the order of the table.
        T_za : float, optional
            As in :meth:`forecast`: the first row of ``future`` is *now* [degC].
        member : {"blend", "network"}, default="blend"
            The whole model, or the forecast of its network alone, which the two-stage scheme is.
        quantiles : sequence of float, optional
            As in :meth:`predict_quantiles`.
        weather_error : {None, "low", "medium", "high"} or WeatherError, default=None
            As in :meth:`predict_quantiles`, for ``offsets``: the weather in ``future`` is a forecast.  The call
            takes three to four times as long.

        Returns
        -------
        AffineForecast
            ``free`` (H,) [degC], ``gain`` (H, H, m) [K per kW or stage], ``zeta`` (H,) [kW or K], ``offsets``
            (H, n_quantiles) [K] and ``index``, by the rows of ``future``; row i of the gain is 0 from column i on, as
            heat acts over the step that begins at its stamp.

        Raises
        ------
        ValueError
            As :meth:`forecast` does, and if an input was not in training, or ``weather_error`` is given without
            ``quantiles``.

        Warns
        -----
        PlanWarning
            If the plan in ``future`` leaves what training covered; once per fit, if the forecast is not affine.
        GainWarning
            Once per fit, if the members of the blend disagree on what heat does, unless it had ``purpose="plan"``.
        """
        check_is_fitted(self)
        levels = None if quantiles is None else read_quantiles(quantiles)
        weather = weather_of_quantiles(weather_error, quantiles)
        trained, boundaries = list(self._scheme.rows.training.inputs), self._scheme.planned_boundaries
        roles = read_inputs(inputs, trained, self._column_of, boundaries)
        ahead, plan = self._planned(history, future, roles, T_za)
        found = self._present_scheme().affine(ahead, plan, read_member(member))
        warn_bent(plan, found.bent, self.training_)
        free = found.temperature - np.tensordot(found.gain, plan.values, axes=2)
        offsets = None if levels is None else self._offsets_ahead(ahead, levels, found.recent, weather)
        return AffineForecast(free, found.gain, found.zeta, future.index, roles, offsets)

    @one_blas_thread
    def to_state_space(self, history: Any, future: Any, T_za: float | None = None) -> ControlModel:
        """The network over the rows ahead as a discrete state-space model, whose inputs are heating and cooling.

        ``x[k+1] = A x[k] + B u[k] + forcing[k]`` with ``T[k] = C x[k]`` is the forecast of
        ``affine_forecast(member="network")``, in plain arrays with which python-control, CasADi and do-mpc can work.

        Parameters
        ----------
        history, future, T_za
            As in :meth:`affine_forecast`; what a stage's heat at part load has beyond its share of the capacity stands
            in ``forcing``, for the plan in ``future``.

        Returns
        -------
        ControlModel
            ``A`` (n, n), ``B`` (n, m), ``C`` (1, n), ``x0`` (n,), ``forcing`` (H, n), ``inputs``, ``limits`` (m, 2).

        Raises
        ------
        ValueError
            As :meth:`forecast` does, and if training had neither heating nor cooling.

        Warns
        -----
        PlanWarning, GainWarning
            As :meth:`affine_forecast` does.
        """
        check_is_fitted(self)
        training = self._scheme.rows.training
        roles = decided_on(training.inputs)
        ahead, plan = self._planned(history, future, roles, T_za)
        scheme = self._present_scheme()
        network = scheme.linear_network(ahead, plan)
        warn_bent(plan, network.bent, self.training_)
        limits = limits_of(scheme.stages(), training.inputs, roles)
        arrays = network.A, network.B, network.C, network.state, network.forcing
        return ControlModel(*arrays, roles, limits, network.states, future.index, self.sampling_time_)

    def _planned(self, history: Any, future: Any, roles: tuple[str, ...], T_za: Any) -> tuple[Ahead, Plan]:
        """The rows ahead, and the plan that they hold."""
        refuse_no_frames(history, future)
        now, n_rows = None if T_za is None else read_now(T_za, future.index), len(future.index)
        filled, given = planned(future, roles, self._column_of)
        if history is None:
            ahead = Ahead(self._read_future(filled), None, now, n_rows)
        else:
            table, origin = self._read_both(history, filled, now)
            ahead = Ahead(table, int(origin[0]), now, n_rows)
        plan = Plan.of(ahead.table, roles, n_rows)
        warn_uncovered(plan, given, self._scheme.rows.training.inputs)
        if self._scheme.gain_doubt is not None:
            warn_once(self._scheme.gain_doubt, GainWarning, self.training_)
        return ahead, plan

    def _offsets_ahead(
        self, ahead: Ahead, levels: np.ndarray, recent: RecentErrors | None, weather: WeatherError | None
    ) -> np.ndarray:
        """(H, n_levels) what quantiles have beyond a forecast of the rows ahead [K]."""
        out, n_leads = np.zeros((ahead.n_rows, len(levels))), ahead.n_leads
        if not n_leads:
            return out
        if ahead.origin is not None:
            table, origin = ahead.table, np.array([ahead.origin])
        elif recent is not None and ahead.T_za is not None and weather is None:
            table, origin = with_measured(ahead.table, 0, ahead.T_za), np.array([0])
        else:
            table, origin = self._after_known(ahead.table, ahead.T_za)
        if recent is None:
            found = self._quantile_offsets(table, origin, n_leads, levels, weather)[1][0]
        else:
            wider = None if weather is None else self._weather_spread(weather, table, origin, n_leads)[0]
            clock = path_clock(table, origin, n_leads)
            found = recent_offsets(self.intervals_, clock, table, recent, levels, wider)
        out[ahead.n_rows - n_leads :] = found
        return out


def recent_offsets(
    intervals: LeadIntervals,
    clock: PathClock,
    table: ZoneTable,
    recent: RecentErrors,
    levels: np.ndarray,
    wider: np.ndarray | None = None,
) -> np.ndarray:
    """(n_leads, n_levels) quantiles of the error of a path to the table's end, by recorded errors.

    They are wider by an error with the standard deviations ``wider`` (n_leads,).
    """
    hours = table.step_hours
    ends = recent.leads - recent.back[:, None]  # rows from the origin
    since_last = ends - clock.lead.shape[1]
    slots = day_type_hours(table, since_last.ravel()).reshape(ends.shape)
    lead = np.broadcast_to(recent.leads * hours, ends.shape)
    errors = recent.values, PathClock(lead, slots, ends * hours / 24.0)
    factor = intervals.factor_at(errors, 0.0)
    return intervals.offsets(clock._replace(day=clock.day - clock.day), levels, errors, 0.0, wider, factor)
