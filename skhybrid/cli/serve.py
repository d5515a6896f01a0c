"""``skhybrid serve``: a zone folder over HTTP."""

from __future__ import annotations

from pathlib import Path

import click

from ._options import DIR, PATH, as_command, print_json
from ._output import Progress


@as_command("serve", "skhybrid serve kitchen --weather tomorrow.json --setpoint 21,24")
@DIR
@click.option(
    "--host",
    default="127.0.0.1",
    help="Address to listen on; any other than this machine's own (127.0.0.1) needs a token.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=8765, help="Port to listen on; 0 takes a free one.")
@click.option(
    "--token",
    envvar="SKHYBRID_TOKEN",
    show_envvar=True,
    help="Token that requests must send, as Authorization: Bearer TOKEN; set it by the "
    "environment variable, which other users cannot see.",
)
@click.option("--weather", type=PATH, help="Weather to come, as for zone tick; read anew at each post.")
@click.option("--setpoint", multiple=True, help="Set-points [degC], as for zone tick.")
def command(
    folder: Path,
    host: str,
    port: int,
    token: str | None,
    weather: Path | None,
    setpoint: tuple[str, ...],
    say: Progress,
    as_json: bool,
) -> None:
    """Serve the folder of a zone over HTTP, with a page.

    It answers POST /rows, GET /forecast, /status and /docs, and has a page at /.  Rows are taken in as by zone tick,
    whose lock it shares.  It ends with Ctrl-C.
    """
    from ..server import check_token, open_socket, serve
    from ..zone import ZoneFolder
    from ..zone.rows_ahead import schedules_of

    schedule = schedules_of(setpoint, ZoneFolder(folder).zones)
    check_token(host, token)
    ZoneFolder(folder).load()  # what is wrong with it is said before anyone is answered
    with open_socket(host, port) as listener:
        name, found = f"[{host}]" if ":" in host else host, listener.getsockname()[1]
        if as_json:
            print_json({"address": f"http://{name}:{found}/", "token": token is not None})
        say.note(f"serving {folder} at http://{name}:{found}/ (Ctrl-C ends it)")
        level = "warning" if say.quiet else "info"
        serve(folder, listener, token=token, weather=weather, schedule=schedule, log_level=level)
