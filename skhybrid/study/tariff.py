"""Cost of the plant's energy of a day, at one price or at prices by the clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from .clock_values import at_minute, by_clock, free_days, minutes
from .day_energy import interval_of
from .keys import check_keys
from .plant_performance import Performance

_KINDS = ("price", "weekend", "currency")


class Tariff(NamedTuple):
    """Prices of a kWh by the minute of the day; those of a weekend begin and end at midnight."""

    price: dict[int, float]
    weekend: dict[int, float]  # of weekends and holidays
    currency: str

    @classmethod
    def of(cls, tables: Mapping[str, Any]) -> Self | None:
        """The tariff of ``[tariff]``; None if it is empty, and a ValueError where it cannot be read."""
        if not tables:
            return None
        check_keys("tariff", tables, _KINDS)
        if "price" not in tables:
            raise ValueError("[tariff] needs the price of a kWh, such as price = 0.30.")
        currency = tables.get("currency", "")
        if not isinstance(currency, str):
            raise ValueError(f"[tariff] currency = {currency!r} must be text in quotes, such as 'EUR'.")
        price = by_clock("[tariff] price", tables["price"], "price of a kWh")
        free = by_clock("[tariff] weekend", tables.get("weekend"), "price of a kWh")
        return cls(price, free or price, currency)

    def over(self, index: pd.DatetimeIndex, step: pd.Timedelta, free: np.ndarray) -> np.ndarray:
        """Mean prices (n,) over the steps of rows in local time, of which ``free`` (n,) are weekends and holidays."""
        each = (minutes(index)[:, None] + np.arange(max(1, step // pd.Timedelta("1min")))) % 1440
        return np.where(free[:, None], at_minute(self.weekend, each), at_minute(self.price, each)).mean(axis=1)


class Cost(NamedTuple):
    """Cost of the plant's energy."""

    value: float
    interval: tuple[float, float] | None  # that holds it with 80 %, where paths of the load are known
    energy: str  # electricity, or heat where no coefficient of performance is given
    currency: str

    def card(self) -> tuple[str, str]:
        """Value and words for a report."""
        words = f"cost of the {self.energy} for it"
        if self.interval is not None:
            words += "; 80 % interval {:.2f} to {:.2f}".format(*self.interval)
        return f"{self.value:.2f}\u00a0{self.currency}".strip(), words

    def entries(self) -> dict[str, Any]:
        """Values by name, for a list."""
        name, unit = f"cost of {self.energy}", f" [{self.currency}]" if self.currency else ""
        found: dict[str, Any] = {f"{name}{unit}": round(self.value, 2)}
        if self.interval is not None:
            found[f"{name}, 80 % interval{unit}"] = [round(end, 2) for end in self.interval]
        return found


def energy_cost(
    forecast: pd.DataFrame,
    tariff: Mapping[str, Any],
    plant: Mapping[str, Any],
    holidays: Any,
    zones: Sequence[str] = (),
    paths: pd.DataFrame | None = None,
) -> Cost | None:
    """The cost of a day's plant energy by the settings of a study; None without a tariff or a load.

    ``forecast`` has ``Q_hvac`` [kW], cooling negative, and ``T_oa``; of several zones, names end with the zone's, and
    the cost is that of all.  ``paths``, as :func:`paths_of_load` draws them, have all these loads.
    """
    prices = Tariff.of(tariff)
    named = [role for role in ([f"Q_hvac_{zone}" for zone in zones] or ["Q_hvac"]) if role in forecast]
    if prices is None or not named or len(forecast) < 2:
        return None
    index = pd.DatetimeIndex(forecast.index)
    step = index[1] - index[0]
    price = step / pd.Timedelta("1h") * prices.over(index, step, free_days(holidays, index))
    performance = Performance.of(plant)

    def costs(loads: pd.DataFrame) -> np.ndarray:
        load = loads[named].to_numpy(dtype=np.float64).T.reshape(len(named), -1, len(price))
        if performance is not None:
            load = performance.electricity(load, forecast["T_oa"].to_numpy(dtype=np.float64))
        return np.asarray((price * np.abs(load)).sum(axis=(0, 2)))

    interval = None if paths is None else interval_of(costs(paths))
    energy = "heat" if performance is None else "electricity"
    return Cost(float(costs(forecast)[0]), interval, energy, prices.currency)
