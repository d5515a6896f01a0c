"""Irradiance on vertical planes from horizontal irradiance, as arrays in kW/m2."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd

from .._warnings import percent, warn_user
from ..exceptions import SkhybridWarning

LOWEST_SUN = 87.0  # largest zenith angle [deg] at which direct irradiance is computed from global and diffuse one
_W_PER_KW = 1000.0
#: zenith angle [deg] from which no light comes within an hour, light [kW/m2] that no twilight and no offset of a sensor
#: is, and the share of all such light that shows another place or time zone
_DARK, _BRIGHT, _MOST_DARK = 100.0, 0.05, 0.01


class Place(NamedTuple):
    """Location of the planes, and the optical properties of ground and panes."""

    latitude: float  # [deg] north
    longitude: float  # [deg] east
    albedo: float  # [-]
    glazing: bool  # whether to include the transmission of a pane by angle of incidence


class Light(NamedTuple):
    """Irradiance [kW/m2], each of shape (n,)."""

    direct: np.ndarray  # direct normal
    diffuse: np.ndarray  # diffuse horizontal
    total: np.ndarray  # global horizontal


def on_planes(
    stamps: pd.DatetimeIndex,
    ghi: np.ndarray,
    dni: np.ndarray | None,
    dhi: np.ndarray | None,
    azimuths: Mapping[str, float],
    place: Place,
) -> dict[str, np.ndarray]:
    """Irradiance on the vertical plane of each azimuth [deg from north], (n,), with the sun as at ``stamps``."""
    from pvlib.iam import physical
    from pvlib.irradiance import aoi
    from pvlib.solarposition import get_solarposition

    if not len(stamps):
        return {name: np.zeros(0) for name in azimuths}
    sun = get_solarposition(stamps, place.latitude, place.longitude, method="ephemeris")
    zenith, azimuth = sun["zenith"].to_numpy(), sun["azimuth"].to_numpy()
    _warn_of_dark(ghi, zenith, place)
    light = split(ghi, dni, dhi, zenith, stamps.day_of_year.to_numpy())
    from_sky, from_ground = pane_diffuse() if place.glazing else (1.0, 1.0)
    # a vertical plane sees half of an isotropic sky, and half of the ground
    scattered = 0.5 * light.diffuse * from_sky + 0.5 * place.albedo * light.total * from_ground
    planes = {}
    for name, facing in azimuths.items():
        incidence = np.asarray(aoi(90.0, facing, zenith, azimuth))
        facing_sun = np.cos(np.radians(incidence)).clip(0.0)
        through = np.asarray(physical(incidence)) if place.glazing else 1.0
        planes[name] = scattered + light.direct * facing_sun * through
    return planes


def _warn_of_dark(ghi: np.ndarray, zenith: np.ndarray, place: Place) -> None:
    """Warn of light (n,) while the sun is far below the horizon: its place or its clock is another one."""
    light = np.where(ghi > _BRIGHT, ghi, 0.0)
    if (share := float(light[zenith > _DARK].sum() / max(light.sum(), _BRIGHT))) > _MOST_DARK:
        warn_user(
            f"{percent(share)} of the irradiance was logged while the sun at latitude {place.latitude:g} and longitude "
            f"{place.longitude:g} was far below the horizon: look at their signs (east is positive) and the time zone.",
            SkhybridWarning,
        )


def split(
    ghi: np.ndarray, dni: np.ndarray | None, dhi: np.ndarray | None, zenith: np.ndarray, day: np.ndarray
) -> Light:
    """Direct, diffuse and global irradiance, with those not given computed from the others.

    ``zenith`` is that of the sun [deg], ``day`` the day of the year.  Negative readings count as zero; NaN stays NaN.
    """
    from pvlib.irradiance import erbs, get_extra_radiation

    total = ghi.clip(0.0)
    height = np.cos(np.radians(zenith)).clip(0.0)
    if dni is not None:
        direct = dni.clip(0.0) * (zenith < 90.0)
        return Light(direct, (total - direct * height).clip(0.0) if dhi is None else dhi.clip(0.0), total)
    if dhi is not None:
        diffuse = dhi.clip(0.0)
    else:
        diffuse = np.asarray(erbs(total * _W_PER_KW, zenith, day, max_zenith=LOWEST_SUN)["dhi"]) / _W_PER_KW
    # at a low sun, division by a small cosine would turn an error of a few watts into hundreds
    high = zenith <= LOWEST_SUN
    beam = (total - diffuse).clip(0.0) / np.where(high, height, 1.0)
    above_atmosphere = np.asarray(get_extra_radiation(day)) / _W_PER_KW
    direct = np.where(high, np.minimum(beam, above_atmosphere), 0.0)
    return Light(direct, diffuse if dhi is not None else total - direct * height, total)


@cache
def pane_diffuse() -> tuple[float, float]:
    """Transmission of diffuse light from sky and ground by a vertical pane, relative to normal incidence."""
    from pvlib.iam import marion_diffuse

    shares = marion_diffuse("physical", 90.0)
    return float(shares["sky"]), float(shares["ground"])
