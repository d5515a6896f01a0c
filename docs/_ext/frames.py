"""Tables, drawings and equations that the package makes itself, so that the pages cannot drift from it.

``.. frame:: module: expression`` is a DataFrame as a table, ``.. drawing:: name`` a network of the catalogue,
``.. heat-balance:: name`` its equations, ``.. measured:: name`` the command and date of a report, and a link to it.
"""

from importlib import import_module
from typing import Any

import pandas as pd
from docutils import nodes
from results import FOLDER, measured
from sphinx.addnodes import download_reference
from sphinx.util.docutils import SphinxDirective

from skhybrid.thermal import draw, get_network


class Frame(SphinxDirective):
    """The table that an expression over the names of a module gives; its index is the first column.

    Its title is that of the report's section, or the line under the directive.
    """

    required_arguments = 1
    final_argument_whitespace = True
    has_content = True

    def run(self) -> list[nodes.Node]:
        module, expression = self.arguments[0].split(":", 1)
        frame = eval(expression.strip(), {**vars(import_module(module)), "pd": pd})
        if frame.index.name or not isinstance(frame.index, pd.RangeIndex):
            frame = frame.reset_index(names=[(frame.index.name or "").removesuffix("index")])
        rows = [[_shown(value) for value in row] for row in frame.itertuples(index=False)]
        title = " ".join(self.content) or frame.attrs.get("title", "")
        return [_table([str(c) for c in frame.columns], rows, title)]


class Drawing(SphinxDirective):
    """The circuit of a network of the catalogue."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        svg = draw(get_network(self.arguments[0]))
        return [nodes.raw("", f'<div class="drawing">{svg}</div>', format="html")]


class HeatBalance(SphinxDirective):
    """The equations of a network of the catalogue."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        lines = get_network(self.arguments[0]).equations(latex=True)
        text = rf"\begin{{aligned}}{lines}\end{{aligned}}"
        return [nodes.math_block(text, text, nowrap=False, number=None, label=None)]


class Measured(SphinxDirective):
    """The command that wrote a report of ``benchmarks/results``, its date, and where the whole report is."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        name = self.arguments[0]
        self.env.note_dependency(str(FOLDER / f"{name}.md"))
        command, date = measured(name)
        text = f"benchmarks/results/{name}.md"
        report = download_reference("", "", nodes.literal(text=text), reftarget=f"/../{text}", refdoc=self.env.docname)
        said = [nodes.Text("Measured by "), nodes.literal(text=command), nodes.Text(f", {date}.  The whole report: ")]
        return [nodes.paragraph("", "", *said, report, nodes.Text("."), classes=["measured"])]


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple | list):
        return ", ".join(map(str, value))
    return str(value)


def _table(head: list[str], rows: list[list[str]], title: str) -> nodes.table:
    group = nodes.tgroup("", *[nodes.colspec(colwidth=1) for _ in head], cols=len(head))
    group += nodes.thead("", _row(head))
    group += nodes.tbody("", *map(_row, rows))
    return nodes.table("", *([nodes.title(text=title)] if title else []), group)


def _row(cells: list[str]) -> nodes.row:
    return nodes.row("", *[nodes.entry("", nodes.paragraph(text=cell)) for cell in cells])


def setup(app: Any) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("frame", Frame)
    app.add_directive("measured", Measured)
    app.add_directive("drawing", Drawing)
    app.add_directive("heat-balance", HeatBalance)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
