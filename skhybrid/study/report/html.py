"""Pieces of HTML pages: their style, tables, lists, cards, verdicts and figures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from os import PathLike
from typing import Any

import pandas as pd

from ... import __version__
from ..._files import atomic_path
from ..day_energy import Energy, energy_of_zones
from ..results import BuildingResult, StudyResult
from ..verdict import CARE, NOT, Verdict
from .figures import as_image
from .words import number

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --page: #ffffff; --card: #f6f8fa;
  --line: #d0d7de; --mark: #0072b2; --warm: #d55e00; --good: #e6f3ec; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --soft: #9ba6b2; --page: #0f1318; --card: #181e25;
  --line: #313a45; --mark: #56b4e9; --warm: #f0883e; --good: #17352a; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 62rem; padding: 1.2rem 1.1rem 4rem; background: var(--page); color: var(--ink);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0.6rem 0 0.2rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 0.4rem; padding-top: 0.6rem; border-top: 1px solid var(--line); }
p { margin: 0.4rem 0 0.8rem; max-width: 46rem; } .soft { color: var(--soft); }
.verdict { font-size: 1.08rem; border-left: 4px solid var(--mark); padding: 0.2rem 0 0.2rem 0.8rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(10.5rem, 1fr)); gap: 0.7rem; margin: 1rem 0; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 0.7rem 0.9rem; }
.card b { display: block; font-size: 1.5rem; line-height: 1.25; } .card span { color: var(--soft); font-size: 0.86rem; }
.verdicts { display: grid; grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); gap: 0.7rem; margin: 1rem 0; }
.judged { border: 1px solid var(--line); border-radius: 8px; padding: 0.5rem 0.9rem; }
.judged b { font-size: 1.1rem; } .judged ul { margin: 0.3rem 0; padding-left: 1.1rem; color: var(--soft); }
.judged.fine { border-left: 6px solid #009e73; } .judged.care { border-left: 6px double #e69f00; }
.judged.not { border-left: 6px dashed #d55e00; }
.wide { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: 0.92rem; }
th, td { text-align: right; padding: 0.32rem 0.6rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; } td.text, th.text { text-align: left; white-space: normal; }
td.text { min-width: 12rem; } thead th { color: var(--soft); font-weight: 600; } tr.best { background: var(--good); }
tr.best td { font-weight: 600; }
figure { margin: 0.8rem 0 1.2rem; } figure img { width: 100%; height: auto; border-radius: 8px; background: #fff;
  border: 1px solid var(--line); padding: 0.3rem; } figcaption { color: var(--soft); font-size: 0.88rem; }
figure svg { width: 100%; height: auto; } figure svg text { fill: currentColor; font-family: inherit; }
.narrow-figure { display: none; } @media screen and (max-width: 600px) { .narrow-figure { display: block; }
  .wide-figure { display: none; } }
ul { padding-left: 1.2rem; } li { margin: 0.25rem 0; overflow-wrap: anywhere; }
code { font-size: 0.9em; overflow-wrap: anywhere; }
@media (max-width: 40rem) { th, td { white-space: normal; padding: 0.3rem 0.3rem; } td.text { min-width: 9rem; }
  .models td.text, .models th.text { display: none; }
  figure { overflow-x: auto; } figure img { width: 38rem; max-width: none; } figcaption { position: sticky; left: 0; } }
@page { margin: 14mm; }
@media print {
  :root { color-scheme: light; --ink: #000; --soft: #333; --page: #fff; --card: #fff; --line: #888; --mark: #000;
    --good: #eee; }
  html { font-size: 12px; } body { max-width: none; padding: 0; } p { max-width: none; orphans: 3; widows: 3; }
  h2 { break-after: avoid; margin-top: 1.4rem; } h2 + p { break-after: avoid; }
  .cards { grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); }
  .wide { overflow: visible; break-inside: avoid; } th, td { white-space: normal; } td.text { min-width: 0; }
  .models td.text, .models th.text { display: table-cell; }
  figure, tr, li, .card, .judged { break-inside: avoid; } figure { overflow: visible; }
  figure img { width: 100%; max-height: 85mm; object-fit: contain; }
  .listed { columns: 2; font-size: 0.9rem; }
}
"""


def write_sections(
    path: str | PathLike[str],
    name: str,
    sections: Iterable[str],
    notes: Iterable[str],
    listed: Mapping[str, Any],
    head: str = "",
) -> None:
    """Write the page of a study in one step: its sections, then warnings, and settings as a list."""
    items = (f"{escape(k)}: <code>{escape(str(v))}</code>" for k, v in {**listed, "skhybrid": __version__}.items())
    ends = [html_list("Warnings", map(escape, notes)), html_list("Settings", items, "listed")]
    with atomic_path(path) as made:
        made.write_text(html_page(f"{name}: day-ahead forecast", [*sections, *ends], head), encoding="utf-8")


def html_page(title: str, sections: Iterable[str], head: str = "") -> str:
    """A page with the style of a report; ``head`` is put before its title, empty sections are left out."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"{head}<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(s for s in sections if s)
        + "\n</main>\n</body>\n</html>\n"
    )


def html_cards(cards: Iterable[tuple[str, str]]) -> str:
    """Boxes with a value and what it is."""
    boxes = "".join(f'<div class="card"><b>{escape(v)}</b><span>{escape(t)}</span></div>' for v, t in cards)
    return f'<div class="cards">{boxes}</div>'


def verdict_boxes(verdicts: Sequence[Verdict]) -> str:
    """Temperature and load: usable, use with care or not usable, with reasons."""
    kinds = {CARE: "care", NOT: "not"}
    boxes = "".join(
        f'<div class="judged {kinds.get(one.level, "fine")}"><b>{escape(one.quantity[:1].upper() + one.quantity[1:])}: '
        f"{escape(one.level)}</b><ul>{''.join(f'<li>{escape(reason)}</li>' for reason in one.reasons)}</ul></div>"
        for one in verdicts
    )
    return f'<div class="verdicts">{boxes}</div>\n' if boxes else ""


def energy_cards(found: Iterable[Energy]) -> list[tuple[str, str]]:
    """Heating and cooling of a day, where there is any."""
    return [one.card() for one in found if one.value >= 0.5]


def next_day_cards(result: StudyResult | BuildingResult) -> list[tuple[str, str]]:
    """Energy and cost of the next day of a study; empty where its kW have no scale."""
    if not result.scaled:
        return []
    loads = [role for role in result.settings.roles_of("Q_hvac") if role in result.forecast]
    cost = result.next_day_cost
    energy = energy_of_zones(result.forecast[loads], result.load_paths)
    return energy_cards(energy) + ([] if cost is None else [cost.card()])


def results_table(table: pd.DataFrame, scaled: bool, load_name: str = "load") -> str:
    """The comparison of models, the best first."""
    timed = "seconds" in table
    heads = ["model", "RMSE [K]", "MAE [K]", f"{load_name} RMSE [{'kW' if scaled else '-'}]", *["time [s]"] * timed]
    rows = []
    for name, row in table.iterrows():
        cells = [number(row[c], 2) for c in ("rmse", "mae", "load_rmse")]
        cells += [number(row["seconds"], 1)] if timed else []
        rows.append((str(name), *cells, str(row.get("note", ""))))
    return html_table([*heads, "description"], rows, n_texts=1, of_models=True)


def html_list(title: str, items: Iterable[str], kind: str = "prose") -> str:
    """A section with a list of HTML items; empty without items."""
    items = "".join(f"<li>{item}</li>" for item in items)
    return f'<h2>{title}</h2>\n<ul class="{kind}">{items}</ul>' if items else ""


def html_table(heads: Sequence[str], rows: Iterable[Sequence[str]], n_texts: int = 0, of_models: bool = False) -> str:
    """A table whose last ``n_texts`` columns are prose; of models, the first is marked as the best."""
    kinds = [""] * (len(heads) - n_texts) + [f' class="text{" soft" if of_models else ""}"'] * n_texts
    head = "".join(f"<th{kind}>{escape(text)}</th>" for kind, text in zip(kinds, heads, strict=True))
    lines = ["".join(f"<td{k}>{escape(text)}</td>" for k, text in zip(kinds, row, strict=True)) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    if of_models:
        body = body.replace("<tr>", '<tr class="best">', 1)
    wide = "wide models" if of_models else "wide"
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="{wide}" tabindex="0">{table}</div>\n'


def html_figure(figure: Any, caption: str) -> str:
    """A figure as a picture inside the page, with its caption."""
    text = escape(caption, quote=True)
    return f'<figure tabindex="0"><img src="{as_image(figure)}" alt="{text}"><figcaption>{text}</figcaption></figure>\n'
