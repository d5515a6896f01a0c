"""Who may speak to the server: host, origin and token of a request, and headers of every answer."""

from __future__ import annotations

import base64
import binascii
import hmac
from typing import Any
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse

#: names of this machine; a page of another site that resolves to it (DNS rebinding) has its own name as the host
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1", "[::1]")
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_READING = ("GET", "HEAD")


class Guard:
    """ASGI middleware that refuses requests of others, each with one sentence.

    With a token a request needs ``Authorization: Bearer TOKEN``; to read, the token may also be the password of
    basic authentication, for which browsers ask.  Posts of pages of other sites are refused with and without one.
    """

    def __init__(self, app: Any, token: str | None = None) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(_HEADERS)
            await send(message)

        refused = self._refusal(scope["method"], Headers(scope=scope))
        await (refused or self.app)(scope, receive, send_with_headers)

    def _refusal(self, method: str, headers: Headers) -> JSONResponse | None:
        if self.token is not None and not self._knows_token(method, headers.get("authorization", "")):
            kind = 'Basic realm="skhybrid", charset="UTF-8"' if method in _READING else "Bearer"
            text = "the token is missing or wrong; send the header Authorization: Bearer TOKEN."
            return JSONResponse({"detail": text}, 401, {"WWW-Authenticate": kind})
        if method not in _READING and _is_cross_site(headers):
            return JSONResponse({"detail": "a page of another site may not post here."}, 403)
        return None

    def _knows_token(self, method: str, given: str) -> bool:
        kind, _, value = given.partition(" ")
        if kind.lower() == "basic" and method in _READING:
            try:
                value = base64.b64decode(value, validate=True).decode("utf-8", "replace").partition(":")[2]
            except (binascii.Error, ValueError):
                return False
        elif kind.lower() != "bearer":
            return False
        return hmac.compare_digest(value.encode("utf-8", "replace"), str(self.token).encode())


def _is_cross_site(headers: Headers) -> bool:
    """Whether a browser says that a page of another site sends the request; other programs say nothing."""
    if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
        return True
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != headers.get("host")
