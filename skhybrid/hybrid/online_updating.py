"""What a fitted estimator does with rows as they come: take them in, learn from them, tell whether it still holds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, Self

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from .._table import ZoneTable, append_tables, read_target
from .._threads import one_blas_thread
from .._time import spell
from ..forecasting.intervals import LeadIntervals
from .scheme import Scheme
from .tables import KEPT, concatenate_tables, in_zone_of

#: rows that are joined to the kept tail at once
_GATHERED = 96


class OnlineUpdatingMixin:
    """``update``, ``partial_fit`` and ``drift`` over a fitted scheme and the kept end of the known rows."""

    adapt: str | None
    max_missing: float
    fit: Callable[..., Self]
    _scheme: Scheme
    intervals_: LeadIntervals
    _tail: ZoneTable
    _recent: list[ZoneTable]
    _read_X: Callable[[Any], ZoneTable]
    _with_history: Callable[[Any], tuple[ZoneTable, int]]

    def _keep(self, table: ZoneTable, target: np.ndarray, *, behind: bool) -> None:
        """Keep the end of the known rows: these, or the kept ones and these ``behind`` them.

        Single rows are gathered before they are joined to the tail, which costs as much for one as for many.
        """
        new = table.replace(history={"T_za": target})
        self._recent = [*self._recent, new] if behind else [new]
        if not behind or sum(recent.n_rows for recent in self._recent) >= _GATHERED:
            whole = self._known_end() if behind else new
            most = int(KEPT / table.step)
            tail = whole.rows(slice(max(whole.n_rows - most, 0), None))
            copies = {role: v.copy() for role, v in tail.inputs.items()}
            self._tail = tail.replace(inputs=copies, history={"T_za": tail.history["T_za"].copy()})
            self._recent = []

    def _known_end(self) -> ZoneTable:
        """The last known rows: the kept tail and what came since."""
        return concatenate_tables([self._tail, *self._recent]) if self._recent else self._tail

    def _after_tail(self, table: ZoneTable) -> tuple[ZoneTable, int]:
        if not table.follows(self._last_rows):
            return table, 0
        tail = self._known_end()
        return append_tables(tail, table), tail.n_rows

    @property
    def _last_rows(self) -> ZoneTable:
        return self._recent[-1] if self._recent else self._tail

    # ------------------------------------------------------------------------------------------- living with a building
    @one_blas_thread
    def update(self, X: Any, y: Any = None) -> Self:
        """Take in new rows without learning from them: the filter and the recent past go on.

        What follows is forecast as if the rows had been in front of it.  It takes the same time whatever came before.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows that follow the last known one, of the training table or of the last call, with ``T_za`` as measured,
            NaN where missing.
        y : array-like of shape (n_samples,), optional
            The measured temperature, where X has no ``T_za``.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the rows do not follow, or hold no measurement.
        """
        check_is_fitted(self)
        table = self._read_following(X)
        self._refuse_unless_following(table)
        if y is not None:
            target = read_target(self._in_own_zone(y), table, max_missing=1.0, role="T_za")
        elif table.T_za is not None:
            target = table.T_za
        else:
            raise ValueError("X has no column 'T_za'; give what was measured there or as y, with NaN where missing.")
        self._scheme.advance(table, target)
        self._keep(table, target, behind=True)
        return self

    @one_blas_thread
    def partial_fit(self, X: Any, y: Any) -> Self:
        """Learn from new rows: the first call fits, later ones recalibrate on all rows since.

        The linear scheme is fitted anew on the last eight weeks, or on as many rows as its first training had where
        those are more.  In the published one, baselines of the disturbance (``model="ridge"`` among them) are fitted
        again on training and new rows, or on the last weeks alone where those forecast the latest one clearly better;
        networks keep their weights and the gray box stays as identified, unless ``adapt="full"``.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
            Rows that follow the last known one, or a later part of those that :meth:`update` has taken in; what is
            known already is not taken in twice.
        y : array-like of shape (n_samples,)
            Measured zone temperature [degC]; NaN where missing.

        Returns
        -------
        self

        Raises
        ------
        ValueError
            As :meth:`fit` does, and if the rows do not follow.
        """
        if not hasattr(self, "_tail"):
            return self.fit(X, y)
        table = self._read_following(X)
        target = read_target(self._in_own_zone(y), table, max_missing=self.max_missing, role="T_za")
        known = 0
        if table.utc is not None and self._last_rows.utc is not None:
            known = int((table.utc <= self._last_rows.utc[-1]).sum())
        table, target = table.rows(slice(known, None)), target[known:]
        if table.n_rows:
            self._refuse_unless_following(table)
        with suppress(ValueError):  # a training too short for intervals stays without
            _ = self.intervals_  # of the training table, which the scheme forgets now
        self._scheme.adapt = self.adapt
        self._scheme.learn(table, target)
        if table.n_rows:
            self._keep(table, target, behind=True)
        self._learned_to = None if self._last_rows.utc is None else self._last_rows.utc[-1]
        return self

    @one_blas_thread
    def drift(self, X: Any = None) -> pd.DataFrame:
        """Tell day by day whether what was learned still holds; nothing is taken in.

        Each day's temperature (linear scheme) or disturbance (published) is held against what was expected of it at
        midnight as trained, without adaptation; the reference are days of the training that were left out of the fit
        (:class:`~skhybrid.hybrid.DriftMonitor`).

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features), optional
            Rows with ``T_za``, behind the training or elsewhere.  By default the rows that :meth:`update` has taken in.

        Returns
        -------
        DataFrame
            One row a whole local day: ``statistic``, ``threshold``, ``drifted``, ``since`` and ``kind`` (``"level"``,
            ``"schedule"``, ``"quiet"``), as known at its end.
        """
        check_is_fitted(self)
        return self._scheme.drift(None if X is None else self._with_history(X)[0])

    def _in_own_zone(self, data: Any) -> Any:
        """A table or a target in the time zone of the training table."""
        if not isinstance(data, pd.DataFrame | pd.Series):
            return data
        stamps = in_zone_of(data.index, self._last_rows.index, ("the known table", "X"))
        return data if stamps is data.index else data.set_axis(stamps)

    def _read_following(self, X: Any) -> ZoneTable:
        """X in the time zone of the training table; a table without stamps goes on with its clock."""
        X = self._in_own_zone(X)
        table = self._read_X(X)
        if table.utc is not None or self._last_rows.utc is not None:
            return table
        begin = self._last_rows.time[-1] + table.step
        return table.replace(time=pd.date_range(begin, periods=table.n_rows, freq=table.step))

    def _refuse_unless_following(self, table: ZoneTable) -> None:
        tail = self._last_rows
        if (table.utc is None) != (tail.utc is None):
            raise ValueError("X has time stamps and the training table has none, or the reverse; give both or neither.")
        if table.utc is not None and not table.follows(tail):
            raise ValueError(
                f"X begins at {table.index[0]}, but the last known row is {tail.index[-1]}; it must begin one step of "
                f"{spell(tail.step)} later."
            )
