"""Bodies of requests and answers, with units, for the checks and the OpenAPI description."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter


def _no_truth(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("true or false is not a number; post 1 or 0 where that is meant")
    return value


def _iso(value: str) -> str:
    try:
        datetime.fromisoformat(value)
    except ValueError:
        raise ValueError(f"{value!r} is not a date and time such as 2024-01-31T13:45:00+01:00") from None
    return value


_Number = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(_no_truth)]


class Row(BaseModel):
    """A row of the log: its time stamp, and a value for each column that zone.toml names, in the unit it has there."""

    model_config = ConfigDict(extra="allow", str_max_length=200)
    __pydantic_extra__: dict[str, _Number | None]
    time: Annotated[str, AfterValidator(_iso)] = Field(
        description="ISO 8601, with an offset where the log of the zone has a time zone"
    )


ROWS = TypeAdapter(Annotated[list[Row], Field(min_length=1)])


class Posted(BaseModel):
    """The effect of posted rows."""

    rows: int = Field(description="rows read")
    new_steps: int = Field(description="steps of the zone that became complete by them")
    fitted_again_because: str | None = Field(description="why the model was fitted again; null where it was not")
    forecast_from: str | None = Field(description="origin of the new forecast; null where there is none, see remarks")
    remarks: list[str] = Field(description="what a user should know of them")


class ForecastRow(BaseModel):
    """One step of a forecast."""

    time: str = Field(description="start of the step, ISO 8601, with an offset where the log has a time zone")
    T_za: float | None = Field(description="zone temperature [degC]")
    T_za_low: float | None = Field(description="10 % quantile of the zone temperature [degC]")
    T_za_high: float | None = Field(description="90 % quantile of the zone temperature [degC]")
    Q_hvac: float | None = Field(
        description="mean heat of the plant over the step [kW], negative for cooling; null where it was planned"
    )
    Q_hvac_low: float | None = Field(description="10 % quantile of the heat [kW]")
    Q_hvac_high: float | None = Field(description="90 % quantile of the heat [kW]")


class _Latest(BaseModel):
    """Fields of the latest forecast of a zone or of a building."""

    name: str = Field(description="name of the zone or the building")
    origin: str = Field(description="time of the last measurement that the forecast knows, ISO 8601")
    timezone: str | None = Field(description="time zone of the stamps; null where the log has none")
    step_minutes: float = Field(description="length of a step [min]")
    interval: float = Field(description="share of the measurements that lies between low and high [-]")
    scaled: bool = Field(description="whether the log fixes what a kW is, in every zone; if not, heats are relative")
    units: dict[str, str] = Field(description="unit of each quantity")


class Forecast(_Latest):
    """The latest forecast of a zone."""

    rows: list[ForecastRow] = Field(description="steps after the origin, in the order of time")


class Errors(BaseModel):
    """Errors of forecasts beside what was measured."""

    rmse: float = Field(description="root mean square error, in the unit of the quantity")
    bias: float = Field(description="mean of forecast minus measurement, in the unit of the quantity")
    coverage: float | None = Field(description="share of the measurements inside the 80 % interval [-]")


class PastErrors(BaseModel):
    """Errors of forecasts that are over; of stages too, each under its name, such as u_heat [-]."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Errors | None]
    first_row: str | None = Field(None, alias="from", description="first row, where it is one forecast")
    forecasts: int | None = Field(None, description="number of forecasts, where there are several")
    temperature: Errors | None = Field(None, alias="temperature [K]", description="errors of the zone temperature [K]")
    load: Errors | None = Field(None, alias="load [kW]", description="errors of the heat of the plant [kW]")


class Drift(BaseModel):
    """Whether errors have grown since the model learned; empty while that is not known."""

    drifted: bool | None = Field(None, description="whether they have")
    since: str | None = Field(None, description="day of the change")
    kind: str | None = Field(None, description="kind of the change")
    statistic: float | None = Field(None, description="of the drift test [-]")
    threshold: float | None = Field(None, description="above which errors have drifted [-]")


class Judged(BaseModel):
    """The verdict on one forecast."""

    quantity: str = Field(description="temperature or load")
    level: str = Field(description="usable, use with care or not usable")
    reasons: list[str] = Field(description="reasons in plain words")


class _Head(BaseModel):
    """Fields of the status of a zone or of a building."""

    name: str = Field(description="name of the zone or the building")
    last_row: str | None = Field(alias="last row", description="time of the last measurement")
    last_forecast: str | None = Field(alias="last forecast from", description="first row of the last forecast")
    learned_until: str = Field(alias="learned until", description="last row that the model learned from")


class ZoneState(BaseModel):
    """Errors of the forecasts of a zone."""

    last_measured: str | None = Field(
        alias="last measured", description="time of the zone's last temperature, where it is a day old; else null"
    )
    drift: Drift = Field(description="drift of the errors")
    verdicts: list[Judged] = Field(description="as skhybrid zone status prints; empty before a forecast is over")
    yesterday: PastErrors | None = Field(alias="yesterday's forecast", description="the last forecast that is over")
    four_weeks: PastErrors | None = Field(alias="last four weeks", description="all that ended in the last four weeks")


class Status(ZoneState, _Head):
    """State of the zone, and errors of its forecasts."""


class ZonesRow(BaseModel):
    """One step of a forecast of several zones, with the quantities of ForecastRow per zone, such as T_za_low_hall."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, float | None]
    time: str = Field(description="start of the step, ISO 8601, with an offset where the log has a time zone")


class BuildingForecast(_Latest):
    """The latest forecast of several zones."""

    zones: list[str] = Field(description="names of the zones, with which names of quantities end")
    rows: list[ZonesRow] = Field(description="steps after the origin, in the order of time")


class BuildingStatus(_Head):
    """State of several zones, and errors of their forecasts."""

    zones: dict[str, ZoneState] = Field(description="state of each zone, that with the worst verdict first")


class Refusal(BaseModel):
    """Why a request was refused."""

    detail: str = Field(description="one sentence: what, where, and what to do")
