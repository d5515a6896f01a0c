"""The address of the server, and who may speak to it."""

from __future__ import annotations

import ipaddress
import socket
from os import PathLike
from typing import Any

_LEAST_TOKEN = 16  # characters


def is_loopback(host: str) -> bool:
    """Whether a host is reached from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_token(host: str, token: str | None) -> None:
    """Refuse a host that others reach without a token, and a token that is weak or does not fit into a header."""
    if token is None:
        if not is_loopback(host):
            raise ValueError(
                f"others can reach {host}, so a token is needed: set SKHYBRID_TOKEN to {_LEAST_TOKEN} characters or "
                "more (openssl rand -hex 24 makes some), or leave out --host."
            )
    elif len(token) < _LEAST_TOKEN or not all("!" <= letter <= "~" for letter in token):
        raise ValueError(
            f"the token needs {_LEAST_TOKEN} or more letters, digits and signs of ASCII without a space; openssl rand "
            "-hex 24 makes one."
        )


def open_socket(host: str, port: int) -> socket.socket:
    """A socket that listens; an OSError says what to do where the port is taken or the host is none of this machine."""
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        raise OSError(f"cannot listen on {host}, port {port} ({error}); give another --port or --host.") from None


def serve(
    folder: str | PathLike[str],
    listener: socket.socket,
    *,
    token: str | None = None,
    weather: str | PathLike[str] | None = None,
    schedule: Any = None,
    log_level: str = "info",
) -> None:
    """Serve a zone folder on a socket of :func:`open_socket` until a signal ends the process.

    ``weather`` and ``schedule`` are those of :meth:`skhybrid.zone.ZoneFolder.tick`, at each post.
    """
    try:
        import uvicorn

        from .app import make_app
    except ImportError as error:
        if (error.name or "").split(".")[0] not in ("fastapi", "pydantic", "starlette", "uvicorn"):
            raise
        raise ImportError(
            'serving needs FastAPI and uvicorn; install them with pip install "skhybrid[serve]".'
        ) from None
    app = make_app(folder, token=token, weather=weather, schedule=schedule)
    config = uvicorn.Config(app, log_level=log_level, server_header=False, proxy_headers=False, limit_concurrency=64)
    uvicorn.Server(config).run(sockets=[listener])
