"""The report on a log as HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import pandas as pd

_STYLE = """
.skhybrid-log { font: 14px/1.5 system-ui, sans-serif; max-width: 62rem; }
.skhybrid-log table { border-collapse: collapse; font-size: 0.92em; } .skhybrid-log h4 { margin: 1em 0 0.3em; }
.skhybrid-log th, .skhybrid-log td { text-align: left; padding: 0.25em 0.7em; border-bottom: 1px solid #8885; }
.skhybrid-log .wide { overflow-x: auto; } .skhybrid-log .off { opacity: 0.6; }
.skhybrid-log .error { color: #c0392b; font-weight: 600; } .skhybrid-log .warning { color: #b9770e; font-weight: 600; }
"""


def report_html(
    headline: str, columns: pd.DataFrame, first_rows: pd.DataFrame, sections: Mapping[str, Sequence[str]]
) -> str:
    """The parts of a report as one block of HTML."""
    shown = columns.astype({"role": object, "unit": object}).fillna({"role": "unused", "unit": ""})
    rows = [
        _row(name, role, unit, reason, off=role == "unused")
        for name, role, unit, reason in zip(shown.index, shown["role"], shown["unit"], shown["reason"], strict=True)
    ]
    head = "<tr><th>column</th><th>role</th><th>unit</th><th>reason</th></tr>"
    lists = "".join(
        f"<h4>{escape(title)}</h4><ul>{''.join(map(_item, texts))}</ul>" for title, texts in sections.items()
    )
    first = first_rows.to_html(float_format="{:.2f}".format, border=0)
    return (
        f'<div class="skhybrid-log"><style>{_STYLE}</style><p>{escape(headline)}</p>'
        f'<div class="wide"><table>{head}{"".join(rows)}</table></div>'
        f'<h4>First rows [degC, kW]</h4><div class="wide">{first}</div>{lists}</div>'
    )


def _row(*cells: object, off: bool) -> str:
    kind = ' class="off"' if off else ""
    return f"<tr{kind}>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>"


def _item(text: str) -> str:
    """A finding with its level in colour."""
    level, colon, rest = text.partition(":")
    if colon and level in ("error", "warning"):
        return f'<li><span class="{level}">{level}</span>:{escape(rest)}</li>'
    return f"<li>{escape(text)}</li>"
