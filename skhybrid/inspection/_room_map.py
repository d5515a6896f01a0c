"""Display of the rooms of a building: which of them exchange heat, and how well each is forecast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.sparse.csgraph import shortest_path

from .._arguments import is_number, refuse_without
from ._display import Display, refuse_other
from ._style import COLORS, MEASURED, axes_or_new, heading

PAGE = "#fefefe"  # background of labels that lines pass below; a page may replace it with its own
_APART = 1.9  # distance of two neighbours, where there is room [inch]
_MARGIN = np.array([0.6, 0.5])  # around the outermost rooms [inch]
_TRIES = 12  # begun at different places, since some end with crossed lines
_QUIET = "#888888"


@dataclass(eq=False, repr=False)
class RoomMapDisplay(Display):
    """Map of the rooms of a building, drawn from who is next to whom.

    Lines join rooms whose forecasts know each other.  The wider a line, the more heat they exchange; it is dashed where
    that is not known.  The darker a room, the larger its error.

    Parameters
    ----------
    couplings : mapping of pair of zones to float or None
        Heat that two zones exchange [W/K], None or NaN where it is not known.
    errors : mapping of zone to float or None
        Error of each zone's forecast [K], None or NaN where it is not known; its order is that of the zones.

    %(attributes)s
    """

    couplings: Mapping[tuple[str, str], float | None]
    errors: Mapping[str, float | None]

    @classmethod
    def from_estimator(
        cls, estimator: Any, *, errors: Mapping[str, float] | None = None, ax: Any = None, **kwargs: Any
    ) -> RoomMapDisplay:
        """Draw the neighbours of a fitted building.

        Parameters
        ----------
        estimator : fitted BuildingPredictor
        errors : mapping of zone to float, optional
            Error of each zone's forecast [K].
        %(drawing)s

        Raises
        ------
        ValueError
            If ``errors`` name a zone that the building does not have.
        """
        refuse_without(estimator, "coupled_", "a BuildingPredictor")
        pairs = ((zone, other) for zone, one in estimator.coupled_.items() for other in one.neighbours)
        known = dict(errors or {})
        unknown = [zone for zone in known if zone not in estimator.zones_]
        if unknown:
            raise ValueError(f"errors name the zone {unknown[0]!r}, but there are {', '.join(estimator.zones_)}.")
        by_zone = {zone: known.get(zone) for zone in estimator.zones_}
        return cls.from_predictions(dict.fromkeys(tuple(sorted(pair)) for pair in pairs), by_zone, ax=ax, **kwargs)

    @classmethod
    def from_predictions(
        cls,
        couplings: Mapping[tuple[str, str], float | None],
        errors: Mapping[str, float | None],
        *,
        ax: Any = None,
        **kwargs: Any,
    ) -> RoomMapDisplay:
        """Draw couplings and errors that are known.

        Parameters
        ----------
        couplings, errors
            As in the class.
        %(drawing)s

        Raises
        ------
        ValueError
            If a coupling names a zone that has no entry in ``errors``, or a value is negative, infinite or no number.
        """
        refuse_other(couplings, Mapping, "couplings", "pairs of zones to W/K")
        refuse_other(errors, Mapping, "errors", "zones to K")
        if wrong := [pair for pair in couplings if not isinstance(pair, tuple) or len(pair) != 2]:
            raise ValueError(f"couplings name {wrong[0]!r}, which is not a pair of zones, such as ('hall', 'study').")
        unknown = [zone for pair in couplings for zone in pair if zone not in errors]
        if unknown:
            raise ValueError(f"couplings name the zone {unknown[0]!r}, but errors have {', '.join(errors)}.")
        if same := [a for a, b in couplings if a == b]:
            raise ValueError(f"couplings join {same[0]!r} with itself; leave the pair out.")
        if not errors:
            raise ValueError("errors name no zone; give at least one.")
        _refuse_impossible("couplings", couplings)
        _refuse_impossible("errors", errors)
        return cls(couplings, errors).plot(ax, **kwargs)

    def size(self, width: float = 9.0) -> tuple[float, float]:
        """Width and height of a figure that fits the map [inch].

        Parameters
        ----------
        width : float, the most [inch]; a narrow map is turned
        """
        across, along = np.ptp(self._places(width), axis=0)
        apart = min(_APART, (width - 2 * _MARGIN[0]) / max(across, 1e-9))
        return width, float(along * apart + 2 * _MARGIN[1])

    def plot(self, ax: Any = None, *, title: str | None = None) -> RoomMapDisplay:
        """Draw the map.

        %(ax)s
        %(title)s
        """
        ax = axes_or_new(ax, self.size())
        size = ax.bbox.size / ax.figure.dpi  # of the axes [inch]
        places = self._places(size[0])
        at = dict(zip(self.errors, places, strict=True))
        couplings, errors = _nan_as_none(self.couplings), _nan_as_none(self.errors)
        strongest = max((value for value in couplings.values() if value), default=1.0)
        for (a, b), value in couplings.items():
            self._draw_coupling(ax, at[a], at[b], value, strongest)
        worst = max((error for error in errors.values() if error), default=1.0)
        for zone, error in errors.items():
            self._draw_room(ax, zone, at[zone], error, worst)
        lowest, highest = places.min(axis=0), places.max(axis=0)
        free = np.maximum(size - 2 * _MARGIN, 0.3)
        half = size / (2 * min(_APART, *(free / np.maximum(highest - lowest, 1e-9))))
        for limit, middle, reach in zip((ax.set_xlim, ax.set_ylim), (lowest + highest) / 2, half, strict=True):
            limit(middle - reach, middle + reach)
        ax.set_axis_off()
        heading(ax, title)
        return self._drawn_on(ax)

    def _places(self, width: float) -> np.ndarray:
        """(n_zones, 2) places at which distances are those along the couplings, widest across, or along if narrow."""
        zones = list(self.errors)
        places = _spread(zones, list(self.couplings))
        return places[:, ::-1] if width < 6.0 else places

    @staticmethod
    def _draw_coupling(ax: Any, start: np.ndarray, end: np.ndarray, value: float | None, strongest: float) -> None:
        (x, y), (x_end, y_end) = start, end
        if value is None:
            ax.plot([x, x_end], [y, y_end], color=_QUIET, linewidth=1.2, linestyle=(0, (4, 3)), zorder=1)
            return
        thick = 1.2 + 5.0 * np.sqrt(value / strongest)
        ax.plot([x, x_end], [y, y_end], color=COLORS[0], linewidth=thick, solid_capstyle="butt", zorder=1)
        box = {"facecolor": PAGE, "edgecolor": "none", "pad": 1.5}
        middle = {"ha": "center", "va": "center", "fontsize": "small", "zorder": 2}
        ax.text((x + x_end) / 2, (y + y_end) / 2, f"{value:.0f} W/K", color=MEASURED, bbox=box, **middle)

    @staticmethod
    def _draw_room(ax: Any, zone: str, place: np.ndarray, error: float | None, worst: float) -> None:
        text = zone if error is None else f"{zone}\n{error:.2f} K"
        middle = {"ha": "center", "va": "center", "linespacing": 1.4, "fontsize": "medium", "color": MEASURED}
        ground = {"boxstyle": "round,pad=0.55", "facecolor": PAGE, "edgecolor": MEASURED, "linewidth": 1.2}
        ax.text(*place, text, bbox=ground, zorder=3, **middle)
        share = 0.0 if error is None else 0.5 * error / worst
        shade = {"boxstyle": "round,pad=0.55", "facecolor": COLORS[1], "edgecolor": "none", "alpha": share}
        ax.text(*place, text, bbox=shade, zorder=4, **middle)


def _refuse_impossible(name: str, values: Mapping[Any, Any]) -> None:
    """Refuse values that are neither None, NaN, nor finite numbers from 0 on."""
    for key, value in values.items():
        known = not (value is None or (isinstance(value, Real) and np.isnan(float(value))))
        if known and not (is_number(value) and value >= 0):
            raise ValueError(f"{name} give {key!r} the value {value!r}; give a number from 0 on, or None.")


def _nan_as_none(values: Mapping[Any, float | None]) -> dict[Any, float | None]:
    return {key: None if value is None or np.isnan(value) else value for key, value in values.items()}


def _spread(zones: list[str], pairs: list[tuple[str, str]]) -> np.ndarray:
    """(n_zones, 2) places whose distances are near those along the pairs (Kamada & Kawai 1989), widest across."""
    n = len(zones)
    joined = np.zeros((n, n))
    for a, b in pairs:
        joined[zones.index(a), zones.index(b)] = joined[zones.index(b), zones.index(a)] = 1.0
    apart = shortest_path(joined, directed=False, unweighted=True)
    finite = apart[np.isfinite(apart)].max(initial=0.0)
    apart = np.where(np.isfinite(apart), apart, max(finite, 1.0) + 0.5)
    upper = np.triu_indices(n, 1)
    wanted = apart[upper]

    def stress(flat: np.ndarray) -> tuple[float, np.ndarray]:
        places = flat.reshape(n, 2)
        steps = places[upper[0]] - places[upper[1]]
        found = np.maximum(np.hypot(*steps.T), 1e-9)
        missed = (found - wanted) / wanted**2
        pull = (2.0 * missed / found)[:, None] * steps
        slope = np.zeros((n, 2))
        np.add.at(slope, upper[0], pull)
        np.add.at(slope, upper[1], -pull)
        return float(np.sum((found - wanted) ** 2 / wanted**2)), slope.ravel()

    angle = 2 * np.pi * np.arange(n) / n
    begin = 0.5 * n / np.pi * np.column_stack([np.cos(angle), np.sin(angle)])
    rng = np.random.default_rng(0)
    tries = [begin, *(rng.normal(size=(n, 2)) * np.ptp(begin) for _ in range(_TRIES - 1))]
    best = min(
        (minimize(stress, one.ravel(), jac=True, method="L-BFGS-B", tol=1e-12) for one in tries), key=lambda f: f.fun
    )
    places = best.x.reshape(n, 2) - best.x.reshape(n, 2).mean(axis=0)
    turn = np.linalg.svd(places)[2]  # (2, 2), also of a single zone
    return places @ turn.T
