"""Transformer that adds the irradiance on the facades of a building."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from sklearn.utils.validation import _check_feature_names_in, check_is_fitted

from .._arguments import as_mapping, check_bool, check_place, store_arguments
from .._ranges import check_range
from .._table import listed, numeric, role_of
from .._time import first_row_number, read_index
from ._frames import TableTransformer, position_of, roles_by_position
from ._sun import Place, on_planes

#: azimuths of the default facades, degrees clockwise from north.
COMPASS = {"east": 90.0, "south": 180.0, "west": 270.0, "north": 0.0}


class FacadeIrradiance(TableTransformer):
    """Add the irradiance on each facade, computed from horizontal irradiance and the position of the sun.

    Parameters
    ----------
    latitude, longitude : float
        Position of the building [deg], north and east positive.
    facades : dict of name to azimuth, optional
        Azimuths in degrees clockwise from north; each adds the column ``q_sol_<name>``.  Default: ``east`` 90,
        ``south`` 180, ``west`` 270, ``north`` 0.
    columns : dict of role to column, optional
        ``{"q_sol": column}`` if global horizontal irradiance [kW/m2] is in a column of another name.
    dni, dhi : str or int, optional
        Columns of direct normal and diffuse horizontal irradiance [kW/m2].  If one is given, the other follows from the
        balance with global irradiance; if neither is, both follow from the model of Erbs et al. (1982).
    timezone : str, optional
        Zone of time stamps without one, such as ``"Europe/Amsterdam"`` or ``"UTC"``.
    albedo : float
        Fraction of irradiance reflected by the ground [-].
    glazing : bool
        Whether to include the transmission of a pane at the angle of incidence, relative to normal incidence.
    start : timestamp-like, optional
        Stamp of row 0 of a table without time stamps; such a table is refused if it is not given.  An integer index
        numbers the rows, those of an array begin at 0.
    sampling_time : timedelta-like, optional
        Step of a table without time stamps or with one row; default is the step of ``fit``.

    Attributes
    ----------
    sampling_time_ : Timedelta
    facades_ : dict of str to float
    positions_ : dict of str to int
        Positions of the columns of ``q_sol`` and, if given, ``dni`` and ``dhi``.
    n_features_in_, feature_names_in_ : int, ndarray of str

    Notes
    -----
    Rows are means over [t, t + step), so the position of the sun is that at the middle of the step.  The sky is
    isotropic; a facade sees half of it and half of the ground.  If the sun is less than 3 degrees above the horizon and
    direct irradiance is not logged, all light counts as diffuse.  NaN in the irradiance of a row gives NaN on its
    facades.

    The facades are appended; ``dni`` and ``dhi`` are dropped unless they are named after a role.

    Examples
    --------
    >>> import pandas as pd
    >>> from skhybrid.preprocessing import FacadeIrradiance
    >>> log = pd.DataFrame({"q_sol": [0.4]}, index=pd.to_datetime(["2024-03-20 09:00+00:00"]))
    >>> FacadeIrradiance(latitude=51.5, longitude=0.0, sampling_time="1h").fit_transform(log).iloc[0].round(2).to_dict()
    {'q_sol': 0.4, 'q_sol_east': 0.41, 'q_sol_south': 0.39, 'q_sol_west': 0.12, 'q_sol_north': 0.12}
    """

    def __init__(
        self, latitude: float, longitude: float, *, facades: Mapping[str, float] | None = None,
        columns: Mapping[str, Any] | None = None, dni: Any = None, dhi: Any = None, timezone: str | None = None,
        albedo: float = 0.2, glazing: bool = True, start: Any = None, sampling_time: Any = None,
    ) -> None:  # fmt: skip
        store_arguments(self, locals())

    def _fit_table(self, table: pd.DataFrame) -> None:
        facades = self._checked_facades()
        self._check_place()
        names = list(table.columns)
        if not isinstance(table.index, pd.DatetimeIndex) and not any(role_of(name) for name in names):
            names = roles_by_position(len(names))
        positions = self._find_columns(names)
        present = [name for name in facades if f"q_sol_{name}" in names]
        if present:
            raise ValueError(f"X already has a column 'q_sol_{present[0]}'; drop it or rename the facade.")
        self.facades_, self.positions_, self.sampling_time_ = facades, positions, self._stamps(table.index, None)[1]

    def _transform_table(self, table: pd.DataFrame) -> pd.DataFrame:
        utc, step = self._stamps(table.index, self.sampling_time_)
        light = {kind: numeric(table.iloc[:, j]) for kind, j in self.positions_.items()}
        stamped = isinstance(table.index, pd.DatetimeIndex)
        shown = table.index if stamped else utc
        for kind, j in self.positions_.items():
            check_range(light[kind], "q_sol", f"column {table.columns[j]!r}", shown, named=stamped)
        place = Place(self.latitude, self.longitude, self.albedo, self.glazing)
        planes = on_planes(utc + step / 2, light["q_sol"], light.get("dni"), light.get("dhi"), self.facades_, place)
        kept = self._kept_columns()
        added = pd.DataFrame({f"q_sol_{name}": values for name, values in planes.items()}, index=table.index)
        return pd.concat([table.iloc[:, kept], added], axis=1)

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """(n_features_out,) names of the columns of the output.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns of an array, instead of the roles given by position.
        """
        check_is_fitted(self)
        if input_features is None and not hasattr(self, "feature_names_in_"):
            names = roles_by_position(self.n_features_in_)
        else:
            names = list(_check_feature_names_in(self, input_features))
        added = [f"q_sol_{name}" for name in self.facades_]
        return np.asarray([*(names[j] for j in self._kept_columns()), *added], dtype=object)

    def _checked_facades(self) -> dict[str, float]:
        if not isinstance(self.facades, Mapping | None):
            raise ValueError(f"facades={self.facades!r} must be a mapping of names to azimuths, such as {COMPASS}.")
        for name, azimuth in (facades := self.facades or COMPASS).items():
            if role_of(f"q_sol_{name}") is None:
                raise ValueError(f"facades= has {name!r}, which makes no column name 'q_sol_<name>'; use a plain word.")
            if not isinstance(azimuth, Real) or not np.isfinite(float(azimuth)):
                raise ValueError(f"facades= gives {name!r} the azimuth {azimuth!r}; give degrees clockwise from north.")
        return {str(name): float(azimuth) for name, azimuth in facades.items()}

    def _check_place(self) -> None:
        check_place(self.latitude, self.longitude)
        if not isinstance(self.albedo, Real) or not 0.0 <= float(self.albedo) <= 1.0:
            raise ValueError(f"albedo={self.albedo!r} must be a number from 0 to 1.")
        check_bool("glazing", self.glazing)

    def _find_columns(self, names: list[Any]) -> dict[str, int]:
        chosen = as_mapping("columns", self.columns, "'q_sol' to a column, such as {'q_sol': 'ghi'}")
        others = [role for role in chosen if role != "q_sol"]
        if others:
            raise ValueError(f"columns= names {others[0]!r}, but only 'q_sol' is read; use dni= and dhi=.")
        wanted = {"q_sol": chosen.get("q_sol", "q_sol"), "dni": self.dni, "dhi": self.dhi}
        found = {}
        for kind, column in wanted.items():
            if column is None and kind != "q_sol":
                continue
            position = position_of(column, names)
            if position is None:
                advice = "columns={'q_sol': its column}" if kind == "q_sol" else f"{kind}=its column, or None"
                raise ValueError(
                    f"FacadeIrradiance expects {kind} in a column {column!r}, but X has {listed(names)} "
                    f"({len(names)} feature(s)); pass {advice}."
                )
            found[kind] = position
        return found

    def _kept_columns(self) -> list[int]:
        """Positions of the columns to keep: all but dni and dhi, and these too if they are named after a role."""
        names = getattr(self, "feature_names_in_", [None] * self.n_features_in_)
        dropped = {j for kind, j in self.positions_.items() if kind != "q_sol" and role_of(names[j]) is None}
        return [j for j in range(self.n_features_in_) if j not in dropped]

    def _stamps(self, index: pd.Index, known: pd.Timedelta | None) -> tuple[pd.DatetimeIndex, pd.Timedelta]:
        """Time stamps in UTC, and the step."""
        if isinstance(index, pd.DatetimeIndex):
            stamps = _in_utc(index, self.timezone)
            return stamps, read_index(stamps, self.sampling_time, known, gaps=True)[0]
        if self.start is None:
            raise ValueError(
                "X has no time stamps, but the position of the sun depends on them; give it a DatetimeIndex, or pass "
                "the stamp of its row 0 as start=."
            )
        step = read_index(index, self.sampling_time, known)[0]
        try:
            start = pd.DatetimeIndex([self.start])
        except (TypeError, ValueError):
            raise ValueError(f"start={self.start!r} is not a time stamp, such as '2024-03-01 00:00'.") from None
        first = _in_utc(start, self.timezone)[0] + first_row_number(index) * step
        return pd.date_range(first, periods=len(index), freq=step), step


def _in_utc(index: pd.DatetimeIndex, timezone: str | None) -> pd.DatetimeIndex:
    if index.tz is not None:
        return index.tz_convert("UTC")
    if timezone is None:
        raise ValueError(
            f"the time stamps (first {index[0]}) have no time zone, but the position of the sun depends on it; pass "
            "timezone=, such as 'Europe/Amsterdam', 'UTC' or a fixed offset '+01:00'."
        )
    try:
        return index.tz_localize(timezone).tz_convert("UTC")
    except Exception as error:  # unknown zone, or an hour repeated or skipped; zoneinfo and pytz differ in the class
        raise ValueError(
            f"the time stamps (first {index[0]}) cannot be localized to timezone={timezone!r} ({error}); localize "
            "them yourself, or pass a fixed offset such as '+01:00' for a log without daylight saving."
        ) from error
