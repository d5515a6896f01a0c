"""A zone folder over HTTP: rows in, forecast and status out, and one page; needs the extra ``serve``."""

from .listen import check_token, open_socket, serve

__all__ = ["check_token", "open_socket", "serve"]
