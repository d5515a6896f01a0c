"""The routes of the server: rows in; forecast, status, their description and a page out."""

from __future__ import annotations

import tempfile
import threading
import time
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd
from fastapi import FastAPI, HTTPException, Request
from fastapi.responses import HTMLResponse, JSONResponse
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect

from .. import __version__
from .._warnings import warnings_to, without_python
from ..exceptions import ModelFileError, SettingsError, SkhybridWarning
from ..zone import ZoneFolder
from ..zone.forecast_archive import open_archive
from ..zone.zone_state import status_of
from .guard import LOOPBACK_NAMES, Guard
from .page import docs_page, page_of
from .schemas import ROWS, BuildingForecast, BuildingStatus, Forecast, Posted, Refusal, Row, Status
from .zone_view import QUANTITIES, plain_rows, view_zones

_MOST_BYTES = 8 * 2**20  # of a body: months of rows
_FILE = "rows.csv"  # of a body, for as long as it is read
_UNITS = {name: "degC" if name.startswith("T_") else "kW" for name in QUANTITIES.values()}
_BODY = {
    "required": True,
    "content": {
        "application/json": {"schema": {"type": "array", "items": {"$ref": "#/components/schemas/Row"}}},
        "text/csv": {"schema": {"type": "string", "description": "columns as in the log of the zone"}},
    },
}
_REFUSALS: dict[int | str, dict[str, Any]] = {401: {"model": Refusal, "description": "the token is missing or wrong"}}
_NOTHING: dict[int | str, dict[str, Any]] = {404: {"model": Refusal, "description": "there is no forecast yet"}}
_POST_REFUSALS = _REFUSALS | {
    403: {"model": Refusal, "description": "a page of another site posts"},
    409: {"model": Refusal, "description": "another command is at work in the folder; try again"},
    413: {"model": Refusal, "description": "the body is too large"},
    415: {"model": Refusal, "description": "the body is neither JSON nor CSV"},
    422: {"model": Refusal, "description": "the rows cannot be used; nothing was changed"},
    500: {"model": Refusal, "description": "a file of the zone cannot be used; nothing was changed"},
}


def make_app(
    folder: str | PathLike[str],
    *,
    token: str | None = None,
    weather: str | PathLike[str] | None = None,
    schedule: Any = None,
) -> FastAPI:
    """The application that serves a zone folder; without a token only requests to this machine's names are answered.

    ``weather`` and ``schedule`` are those of :meth:`skhybrid.zone.ZoneFolder.tick`, at each post.
    """
    zone = ZoneFolder(folder)
    what = "several zones" if zone.zones else "one zone"
    app = FastAPI(
        title="skhybrid",
        version=__version__,
        summary=f"Forecast of {what}: temperature and heat of the day to come.",
        docs_url=None,  # FastAPI's own pages load scripts from a CDN
        redoc_url=None,
    )
    _add_reading(app, zone)
    _add_posting(app, zone, weather, schedule)
    _add_refusals(app)
    app.openapi()["components"]["schemas"]["Row"] = Row.model_json_schema()  # which is read by hand
    if token is None:
        app.add_middleware(TrustedHostMiddleware, allowed_hosts=LOOPBACK_NAMES, www_redirect=False)
    app.add_middleware(Guard, token=token)
    return app


def _add_reading(app: FastAPI, zone: ZoneFolder) -> None:
    drawing = threading.Lock()  # matplotlib is not made for several threads
    drawn: dict[tuple[int, ...], str] = {}  # the page, by what it shows
    several = bool(zone.zones)

    @app.get("/forecast", response_model=BuildingForecast if several else Forecast, responses=_REFUSALS | _NOTHING)
    def forecast() -> dict[str, Any]:
        """The latest forecast."""
        return _latest(zone)

    @app.get("/status", response_model=BuildingStatus if several else Status, responses=_REFUSALS)
    def status() -> dict[str, Any]:
        """Drift, the last row, and how past forecasts did: as skhybrid zone status."""
        return zone.status()

    @app.get("/", response_class=HTMLResponse, include_in_schema=False)
    def page() -> str:
        files = (zone.archive, zone.model, zone.config)
        with drawing:
            now = (int(time.time() // 3600), *(file.stat().st_mtime_ns for file in files if file.exists()))
            if now not in drawn:
                model = zone.load()
                with open_archive(zone.archive) as archive:
                    views, state = view_zones(archive, model), status_of(archive, model)
                    text = page_of(model.settings.name, views, state, archive.latest_energy())
                drawn.clear()
                drawn[now] = text
            return drawn[now]

    @app.get("/docs", response_class=HTMLResponse, include_in_schema=False)
    def docs() -> str:
        return docs_page(app.openapi())


def _latest(zone: ZoneFolder) -> dict[str, Any]:
    model = zone.load()
    with open_archive(zone.archive) as archive:
        views = view_zones(archive, model)
    view = next(iter(views.values()))
    if view.origin is None:
        raise HTTPException(404, "there is no forecast yet; post rows, or run skhybrid zone tick.")
    units = {f"{name}_{one}" if one else name: unit for one in views for name, unit in _UNITS.items()}
    return {
        "name": model.settings.name,
        **({"zones": list(views)} if model.zones else {}),
        "origin": view.origin.isoformat(),
        "timezone": view.timezone,
        "step_minutes": view.step / pd.Timedelta("1min"),
        "interval": 0.8,
        "scaled": all(one.scaled for one in views.values()),
        "units": units,
        "rows": plain_rows(views),
    }


def _add_posting(app: FastAPI, zone: ZoneFolder, weather: Any, schedule: Any) -> None:
    one_at_a_time = threading.Lock()

    def take(body: bytes, is_json: bool) -> dict[str, Any]:
        text, n_rows = _csv_of_json(body) if is_json else _csv_text(body)
        said: list[SkhybridWarning] = []
        with one_at_a_time, tempfile.TemporaryDirectory() as place, warnings_to(said.append):
            path = Path(place) / _FILE
            path.write_text(text, encoding="utf-8")
            done = zone.post(path, weather, schedule, plain=is_json)
        frame = None if done.forecast is None else done.forecast.frame
        return {
            "rows": n_rows,
            "new_steps": done.n_new,
            "fitted_again_because": done.learned or None,
            "forecast_from": None if frame is None else (frame.index[0] - _step_of(frame)).isoformat(),
            "remarks": list(dict.fromkeys(" ".join(without_python(text).split()) for text in (*said, *done.remarks))),
        }

    @app.post("/rows", response_model=Posted, responses=_POST_REFUSALS, openapi_extra={"requestBody": _BODY})
    async def rows(request: Request) -> dict[str, Any]:
        """Take in new rows, update the model and forecast, as skhybrid zone tick does."""
        kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind not in ("application/json", "text/csv"):
            raise HTTPException(415, "the content type is neither application/json nor text/csv.")
        return await run_in_threadpool(take, await _body(request), kind == "application/json")


def _add_refusals(app: FastAPI) -> None:
    def answer(code: int, headers: dict[str, str] | None = None, remedy: str = "") -> Any:
        def refuse(request: Request, error: Exception) -> JSONResponse:
            said = " ".join(without_python(error).split()).replace(f"'{_FILE}'", "the body")
            said = f"{said.removesuffix('.')}; {remedy}." if remedy else said
            return JSONResponse({"detail": said}, code, headers)

        return refuse

    app.add_exception_handler(BlockingIOError, answer(409, {"Retry-After": "5"}))
    app.add_exception_handler(SettingsError, answer(500, remedy="mend it and post the rows again"))
    for kind, code in ((ModelFileError, 500), (OSError, 500), (ValueError, 422)):
        app.add_exception_handler(kind, answer(code))


async def _body(request: Request) -> bytes:
    """The body, read as far as it may go."""
    body = bytearray()
    try:
        async for piece in request.stream():
            body += piece
            if len(body) > _MOST_BYTES:
                raise HTTPException(413, f"the body has more than {_MOST_BYTES // 2**20} MiB; post the rows in parts.")
    except ClientDisconnect:  # nobody reads the answer, but the log of the server has a line and no traceback
        raise HTTPException(400, "the connection ended before the body was complete; post the rows again.") from None
    return bytes(body)


def _csv_of_json(body: bytes) -> tuple[str, int]:
    try:
        rows = ROWS.validate_json(body)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = " of ".join(str(part) for part in reversed(first["loc"])) or "the body"
        said = first["msg"].removeprefix("Value error, ")
        raise ValueError(
            f"the rows cannot be read: {where}: {said[0].lower()}{said[1:]} (rows count from 0)."
        ) from None
    table = pd.DataFrame([row.model_dump() for row in rows])
    if table.shape[1] == 1:
        raise ValueError("no posted row has a value; the columns are those of zone.toml.")
    return table[["time", *table.columns.drop("time")]].to_csv(index=False), len(table)


def _csv_text(body: bytes) -> tuple[str, int]:
    """The body as text; refused where it is compressed, or a database."""
    try:
        text = body.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("the CSV is not text in UTF-8.") from None
    if "\0" in text or text.startswith("BZh") or not text.strip():
        raise ValueError("the body is not CSV.")
    return text, max(0, len(text.strip().splitlines()) - 1)


def _step_of(frame: pd.DataFrame) -> pd.Timedelta:
    return frame.index[1] - frame.index[0] if len(frame) > 1 else pd.Timedelta(0)
