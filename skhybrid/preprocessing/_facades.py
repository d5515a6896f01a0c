"""Irradiance on the facades of a building, inside a Pipeline."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import _check_feature_names_in, check_is_fitted

from .._table import role_of
from .._time import read_index
from ._frames import numeric, read_input
from ._sun import Place, on_planes

#: azimuth of each facade of the default, degrees clockwise from north.
COMPASS = {"east": 90.0, "south": 180.0, "west": 270.0, "north": 0.0}


class FacadeIrradiance(TransformerMixin, BaseEstimator):
    """Add the irradiance on each facade, from what falls on the horizontal and from where the sun stands.

    Parameters
    ----------
    latitude : float
        North positive [deg].
    longitude : float
        East positive [deg].
    facades : dict of name to azimuth, optional
        Azimuths in degrees clockwise from north; each adds the column ``q_sol_<name>``.  Default: ``east`` 90,
        ``south`` 180, ``west`` 270, ``north`` 0.
    columns : dict of role to column, optional
        ``{"q_sol": column}`` where global horizontal irradiance [kW/m2] is not in a column named ``q_sol``.
    dni, dhi : str or int, optional
        Columns of direct normal and of diffuse horizontal irradiance [kW/m2].  What is not given follows from the
        others, or from global irradiance alone by the model of Erbs et al. (1982).
    timezone : str, optional
        Zone of time stamps that bear none, such as ``"Europe/Amsterdam"`` or ``"UTC"``.
    albedo : float
        Share of irradiance that the ground reflects.
    glazing : bool
        Whether to weigh light by how much of it a pane lets through at its angle of incidence, relative to normal
        incidence.
    start : timestamp-like, optional
        Stamp of the first row of any table that has no time stamps; without it such a table is refused.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps, or of one row; default = that of ``fit``, or 15 min.

    Attributes
    ----------
    sampling_time_ : Timedelta
        Step of the table of ``fit``.
    facades_ : dict of str to float
        Azimuth [deg] by name.
    positions_ : dict of str to int
        Position of ``q_sol`` and, where given, of ``dni`` and ``dhi`` among the columns.
    n_features_in_ : int
    feature_names_in_ : ndarray of str
        Only where fitted on a DataFrame.

    Notes
    -----
    Rows are means over [t, t + step), so the sun is taken at the middle of the step.  Sky light is taken as isotropic;
    a facade sees half of it, and half of what the ground reflects.  Where the sun at the middle of the step is lower
    than 3 degrees and direct irradiance is not logged, none of the light counts as direct: dividing by the sine of so
    low a sun would turn a few watts of error into hundreds.  NaN in the irradiance of a row gives NaN in its facades.

    The columns ``dni`` and ``dhi`` are dropped, unless they bear the name of a role.  All others stay as they are, in
    their order, before the facades.  An array comes back with the facades as its last columns, and under
    ``set_output(transform="pandas")`` named by roles.

    Examples
    --------
    >>> import pandas as pd
    >>> from skhybrid.preprocessing import FacadeIrradiance
    >>> log = pd.DataFrame({"q_sol": [0.4]}, index=pd.to_datetime(["2024-03-20 09:00+00:00"]))
    >>> FacadeIrradiance(latitude=51.5, longitude=0.0, sampling_time="1h").fit_transform(log).iloc[0].round(2).to_dict()
    {'q_sol': 0.4, 'q_sol_east': 0.41, 'q_sol_south': 0.39, 'q_sol_west': 0.12, 'q_sol_north': 0.12}
    """

    def __init__(
        self,
        latitude: float,
        longitude: float,
        *,
        facades: Mapping[str, float] | None = None,
        columns: Mapping[str, Any] | None = None,
        dni: Any = None,
        dhi: Any = None,
        timezone: str | None = None,
        albedo: float = 0.2,
        glazing: bool = True,
        start: Any = None,
        sampling_time: Any = None,
    ) -> None:
        self.latitude = latitude
        self.longitude = longitude
        self.facades = facades
        self.columns = columns
        self.dni = dni
        self.dhi = dhi
        self.timezone = timezone
        self.albedo = albedo
        self.glazing = glazing
        self.start = start
        self.sampling_time = sampling_time

    def fit(self, X: Any, y: Any = None) -> FacadeIrradiance:
        """Check place, columns and stamps; nothing is learned from the values.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)
        y : ignored

        Returns
        -------
        self

        Raises
        ------
        ValueError
            If the place is none on earth, a column is absent or would be added twice, or the stamps have no time zone.
        """
        facades = self._checked_facades()
        self._check_place()
        table = read_input(self, X, reset=True)
        names = _names(table)
        positions = self._find(names)
        twice = [name for name in facades if f"q_sol_{name}" in names]
        if twice:
            raise ValueError(f"X has a column 'q_sol_{twice[0]}' already; drop it or name other facades.")
        self.facades_, self.positions_ = facades, positions
        self.sampling_time_ = self._stamps(table, None)[1]
        return self

    def transform(self, X: Any) -> pd.DataFrame | np.ndarray:
        """Append the facades.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_samples, n_features)

        Returns
        -------
        DataFrame or ndarray of shape (n_samples, n_features_out)

        Raises
        ------
        ValueError
            If the stamps have no time zone, or are not evenly spaced.
        """
        check_is_fitted(self)
        table = read_input(self, X, reset=False)
        utc, step = self._stamps(table, self.sampling_time_)
        light = {kind: _column(table, j) for kind, j in self.positions_.items()}
        place = Place(self.latitude, self.longitude, self.albedo, self.glazing)
        planes = on_planes(utc + step / 2, light["q_sol"], light.get("dni"), light.get("dhi"), self.facades_, place)
        kept = self._kept()
        if not isinstance(table, pd.DataFrame):
            return np.column_stack([table[:, kept], *planes.values()])
        added = pd.DataFrame({f"q_sol_{name}": values for name, values in planes.items()}, index=table.index)
        return pd.concat([table.iloc[:, kept], added], axis=1)

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Names of the columns of the output.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns of an array, in the place of the roles of their positions.

        Returns
        -------
        ndarray of str, shape (n_features_out,)

        Raises
        ------
        ValueError
            If ``input_features`` are not those of ``fit``.
        """
        check_is_fitted(self)
        if input_features is None and not hasattr(self, "feature_names_in_"):
            names = _roles_by_position(self.n_features_in_)
        else:
            names = list(_check_feature_names_in(self, input_features))
        added = [f"q_sol_{name}" for name in self.facades_]
        return np.asarray([*(names[j] for j in self._kept()), *added], dtype=object)

    def _checked_facades(self) -> dict[str, float]:
        facades = {str(name): float(azimuth) for name, azimuth in (self.facades or COMPASS).items()}
        for name in facades:
            if role_of(f"q_sol_{name}") is None:
                raise ValueError(f"facades= has {name!r}, which makes no column 'q_sol_<name>'; use a plain word.")
        return facades

    def _check_place(self) -> None:
        for name, value, bound in (("latitude", self.latitude, 90.0), ("longitude", self.longitude, 180.0)):
            if not isinstance(value, Real) or not -bound <= float(value) <= bound:
                raise ValueError(f"{name}={value!r} must be a number of degrees from {-bound:g} to {bound:g}.")
        if not 0.0 <= self.albedo <= 1.0:
            raise ValueError(f"albedo={self.albedo!r} must lie between 0 and 1.")

    def _find(self, names: list[Any]) -> dict[str, int]:
        """Positions of the irradiance columns."""
        chosen: dict[str, Any] = dict(self.columns or {})
        stray = [role for role in chosen if role != "q_sol"]
        if stray:
            raise ValueError(f"columns= names {stray[0]!r}, but only 'q_sol' is read; use dni= and dhi=.")
        wanted = {"q_sol": chosen.get("q_sol", "q_sol"), "dni": self.dni, "dhi": self.dhi}
        found = {}
        for kind, column in wanted.items():
            if column is None and kind != "q_sol":
                continue
            if column in names:
                found[kind] = names.index(column)
            elif isinstance(column, int | np.integer) and 0 <= column < len(names):
                found[kind] = int(column)
            else:
                shown = ", ".join(repr(str(name)) for name in names)
                advice = "columns={'q_sol': its column}" if kind == "q_sol" else f"{kind}=its column, or None"
                raise ValueError(
                    f"FacadeIrradiance looks for {kind} in a column {column!r}, but X has {shown} "
                    f"({len(names)} feature(s)); pass {advice}."
                )
        return found

    def _kept(self) -> list[int]:
        """Positions of the columns that stay: all but dni and dhi, unless they bear a role's name."""
        names = getattr(self, "feature_names_in_", [None] * self.n_features_in_)
        used_up = {j for kind, j in self.positions_.items() if kind != "q_sol" and role_of(names[j]) is None}
        return [j for j in range(self.n_features_in_) if j not in used_up]

    def _stamps(
        self, table: pd.DataFrame | np.ndarray, known: pd.Timedelta | None
    ) -> tuple[pd.DatetimeIndex, pd.Timedelta]:
        """Stamps in UTC and the step."""
        index = table.index if isinstance(table, pd.DataFrame) else pd.RangeIndex(len(table))
        if isinstance(index, pd.DatetimeIndex):
            stamps = _in_utc(index, self.timezone)
            return stamps, read_index(stamps, self.sampling_time, "15min", known, gaps=True)[0]
        step = read_index(index, self.sampling_time, "15min", known)[0]
        if self.start is None:
            raise ValueError(
                "X has no time stamps, which say where the sun stands; give it a DatetimeIndex, or the stamp of its "
                "first row as start=."
            )
        first = _in_utc(pd.DatetimeIndex([self.start]), self.timezone)[0]
        return pd.date_range(first, periods=len(index), freq=step), step

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


def _in_utc(index: pd.DatetimeIndex, timezone: str | None) -> pd.DatetimeIndex:
    if index.tz is not None:
        return index.tz_convert("UTC")
    if timezone is None:
        raise ValueError(
            f"the time stamps (first {index[0]}) have no time zone, and the sun's place needs one; pass "
            "timezone='Europe/Amsterdam' or the like, 'UTC', or a fixed offset '+01:00'."
        )
    try:
        return index.tz_localize(timezone).tz_convert("UTC")
    except (ValueError, KeyError) as error:  # no such zone; an hour that comes twice, or never, on a day of change
        raise ValueError(
            f"the time stamps (first {index[0]}) are none in timezone={timezone!r} ({error}); localize them "
            "yourself, or pass a fixed offset such as '+01:00' for a log without daylight saving."
        ) from error


def _names(table: pd.DataFrame | np.ndarray) -> list[Any]:
    """Names of the columns; by position, as the contract says, where none bears a role's name and no row a stamp."""
    by_position = _roles_by_position(table.shape[1])
    if not isinstance(table, pd.DataFrame):
        return by_position
    names = list(table.columns)
    stamped = isinstance(table.index, pd.DatetimeIndex)
    return names if stamped or any(role_of(name) for name in names) else by_position


def _column(table: pd.DataFrame | np.ndarray, j: int) -> np.ndarray:
    return numeric(table.iloc[:, j]) if isinstance(table, pd.DataFrame) else table[:, j]


def _roles_by_position(n_columns: int) -> list[str]:
    return [("T_oa", "q_sol")[j] if j < 2 else f"u_{j}" for j in range(n_columns)]
