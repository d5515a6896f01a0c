"""``.. commands::`` is the help of every command, as the command line prints it."""

import contextlib
import io
import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from skhybrid.cli import main


def helps(*command: str) -> Iterator[tuple[str, str]]:
    """A command and its help, then the commands under it."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        main([*command, "--help"])
    yield " ".join(("skhybrid", *command)), printed.getvalue()
    for name in re.findall(r"^  (\w+)  ", printed.getvalue().partition("\nCommands:\n")[2], re.MULTILINE):
        yield from helps(*command, name)


class Commands(SphinxDirective):
    """A section for each command."""

    def run(self) -> list[nodes.Node]:
        return [
            nodes.section(
                "", nodes.title(text=name), nodes.literal_block(text=text, language="text"), ids=[nodes.make_id(name)]
            )
            for name, text in helps()
        ]


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
