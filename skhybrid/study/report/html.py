"""The report as one HTML file with everything inside, and the verdict on a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd

from ... import __version__
from ..._files import atomic_path
from ..._warnings import percent as plain_percent
from ..scores import has_intervals
from ..tariff import Cost
from ..verdict import CARE, NOT, Verdict
from .figures import as_image, backtest_figure, day_figure, lead_figure, schedule_figure, week_figure
from .words import day_words, flat, lead_groups, number, percent

#: below the comparison of a study's models, with what is to be said of stages
_TABLE_WORDS = (
    '<p class="soft">The best model comes first. The load error compares the heat that would have held the measured '
    "temperature with the heat that was delivered; stages are converted to heat with the identified capacities{}. The "
    "time is that of fit and back-test, for the hybrid with its intervals. The two-stage models share one "
    "identification, whose time is counted for the first of them.</p>\n"
)
_NOISE = 0.05  # relative differences below this are noise with a few dozen origins
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


def verdict(table: pd.DataFrame, label: str = "hybrid") -> str:
    """Say in one sentence how the ``rmse`` [K] of one model compares with the best of the others, by model."""
    own = float(table["rmse"][label])
    others = table["rmse"].drop(label).dropna()
    if others.empty:
        return f"The day-ahead temperature error of the {label} model is {own:.2f} K (RMSE)."
    other, best = str(others.idxmin()), float(others.min())
    if own < best * (1 - _NOISE):
        less = f"{plain_percent(1 - own / best)} less than the next best, {other} ({best:.2f} K)"
        return f"The {label} model forecasts best: its error is {own:.2f} K, {less}."
    if own <= best * (1 + _NOISE):
        return f"The {label} model ({own:.2f} K) and {other} ({best:.2f} K) forecast equally well, within the noise."
    return (
        f"Another model forecasts better here: the error of {other} is {best:.2f} K, of the {label} model {own:.2f} K."
    )


def write_report(
    path: str | PathLike[str],
    *,
    title: str,
    table: pd.DataFrame,
    frames: Mapping[str, pd.DataFrame],
    forecast: pd.DataFrame,
    parameters: pd.DataFrame,
    building: pd.DataFrame | None = None,
    label: str = "hybrid",
    zeta: pd.Series | None = None,
    truth: pd.Series | None = None,
    schedule: pd.DataFrame | None = None,
    weights: pd.DataFrame | None = None,
    identification: str | None = None,
    coverage: float | None = None,
    spans: Mapping[str, Any] | None = None,
    settings: Mapping[str, Any] | None = None,
    verdicts: Sequence[Verdict] = (),
    scaled: bool = True,
    cost: Cost | None = None,
    notes: Iterable[str] = (),
) -> None:
    """Write a study as one self-contained HTML file, in one step.

    Parameters
    ----------
    path : path-like, the file to make or replace
    title : str, name of the zone
    table : DataFrame
        Index = model, the best first; columns ``rmse``, ``mae`` [K], ``load_rmse`` [kW], ``seconds``, ``note``.
    frames : mapping of label to DataFrame, back-tests from :func:`skhybrid.model_selection.backtest`
    forecast : DataFrame, the next day: ``T_za``, ``Q_hvac``, ``setpoint``, and what was measured
    parameters : DataFrame, index name, with ``value``, ``std``, ``unit``, ``description``, ``remark``
    building : DataFrame, optional, index quantity, with ``value``, ``std``, ``unit``, ``remark``
    label : str, the model whose forecast is shown
    zeta, truth : Series, optional
        Estimated unmeasured heat and, where they are known, the internal gains [kW] at the same stamps.
    schedule : DataFrame, optional, index (day, hour), with the learned ``gain`` [kW] and ``ua`` [kW/K]
    weights : DataFrame, optional, share of each member of the blend (columns) by group of leads (index)
    identification : str, optional
        Class of the identification that gave ``parameters`` and ``zeta``, where the model itself did not.
    coverage : float, optional, share of the test measurements inside the intervals
    spans, settings : mapping, optional, training and test spans, and settings of the study, to be listed
    verdicts : sequence of Verdict, on temperature and load
    scaled : bool, whether the log fixes what a kW is; else no kW are shown at the top
    cost : Cost, optional, what the load of the next day costs
    notes : iterable of str, warnings
    """
    sections = [
        _head(title, table, frames, forecast, label, verdicts, scaled, cost),
        _tomorrow(forecast, (settings or {}).get("load", {}).get("setpoint", "measured") == "measured"),
        _accuracy(table, frames, label, coverage, scaled),
        _learned(schedule, weights, frames[label], label),
        _week(zeta, truth),
        _building(parameters, building, identification, label),
    ]
    write_sections(path, title, sections, notes, {**(spans or {}), **flat(settings or {})})


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


def _head(
    title: str,
    table: pd.DataFrame,
    frames: Mapping[str, pd.DataFrame],
    forecast: pd.DataFrame,
    label: str,
    verdicts: Sequence[Verdict],
    scaled: bool,
    cost: Cost | None,
) -> str:
    own = table.loc[label]
    n_origins = frames[label]["origin"].nunique()
    cards = [
        (f"{own['rmse']:.2f} K", f"day-ahead temperature error (RMSE) of the {label} model in {n_origins} forecasts"),
        (f"{own['mae']:.2f} K", "mean absolute temperature error"),
    ]
    if scaled and np.isfinite(own.get("load_rmse", np.nan)):
        cards.append((f"{own['load_rmse']:.2f} kW", "error of the heating or cooling load (RMSE)"))
    low, high = forecast["T_za"].min(), forecast["T_za"].max()
    cards.append((f"{low:.1f}–{high:.1f}\u00a0°C", f"forecast room temperature on {day_words(forecast.index)}"))
    cards += day_energy(forecast) if scaled else []
    if cost is not None:
        cards.append((f"{cost.value:.2f}\u00a0{cost.currency}".strip(), f"cost of the {cost.energy} for it"))
    return (
        f'<p class="soft">skhybrid: day-ahead forecast of a zone</p><h1>{escape(title)}</h1>\n'
        f'{verdict_boxes(verdicts)}<p class="verdict">{escape(verdict(table, label))}</p>\n{html_cards(cards)}'
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


def day_energy(forecast: pd.DataFrame) -> list[tuple[str, str]]:
    """Heating and cooling energy of the day [kWh], where there is any."""
    if "Q_hvac" not in forecast or len(forecast) < 2:
        return []
    hours = (forecast.index[1] - forecast.index[0]) / pd.Timedelta("1h")
    heat = float(forecast["Q_hvac"].clip(lower=0).sum() * hours)
    cold = float(-forecast["Q_hvac"].clip(upper=0).sum() * hours)
    found = [(heat, "heating needed that day"), (cold, "cooling needed that day")]
    return [(f"{value:.0f}\u00a0kWh", text) for value, text in found if value >= 0.5]


def _tomorrow(forecast: pd.DataFrame, holds_measured: bool) -> str:
    day = "This is the day after the last measurement."
    held = "that would hold the set-point instead"
    if "T_za_measured" in forecast:
        day = "This is the last day of the log. The temperature forecast used no measurement of that day; the "
        day += "measurements are drawn for comparison."
        held = "that would hold the temperature that was measured that day" if holds_measured else held
    words = (
        f"<p>{day} The temperature curve assumes the logged or planned heating and cooling. The load curve is the heat "
        f"{held}, within the limits of the plant."
        + (" Four out of five measurements should lie in the shaded interval." if has_intervals(forecast) else "")
        + "</p>"
    )
    return f"<h2>Forecast for {escape(day_words(forecast.index))}</h2>\n{words}\n" + _figure(
        day_figure(forecast), "Forecast of room temperature and heating or cooling load."
    )


def _accuracy(
    table: pd.DataFrame, frames: Mapping[str, pd.DataFrame], label: str, coverage: float | None, scaled: bool
) -> str:
    ordered = {name: frames[name] for name in [label, *table.index.drop(label)] if name in frames}
    hours = frames[label]["lead"].max() / pd.Timedelta("1h")
    days = "Measured and forecast temperature on the last test days; a dashed line marks the start of each forecast."
    interval = (
        ""
        if coverage is None
        else (
            f"<p>The 80 % interval of the {escape(label)} model was learned on the training days; it contained "
            f"{percent(coverage)} of the measurements of the test days.</p>\n"
        )
    )
    return (
        "<h2>Accuracy</h2>\n<p>Each model was fitted on the training days only. It then forecast the test days "
        f"{hours:g} hours ahead. Each forecast was given the weather and the heating and cooling of those hours, but "
        "no room temperature measured after it started. All models are compared at the same times.</p>\n"
        + results_table(table, scaled)
        + _TABLE_WORDS.format("" if scaled else ", whose scale this log does not determine")
        + interval
        + _figure(backtest_figure(ordered), days)
        + _figure(lead_figure(ordered), "Error by lead time, for the best models.")
    )


def results_table(table: pd.DataFrame, scaled: bool) -> str:
    """The comparison of models, the best first."""
    heads = ("model", "RMSE [K]", "MAE [K]", f"load RMSE [{'kW' if scaled else '-'}]", "time [s]", "description")
    rows = []
    for name, row in table.iterrows():
        errors = (number(row[c], 2) for c in ("rmse", "mae", "load_rmse"))
        rows.append((str(name), *errors, number(row["seconds"], 1), str(row.get("note", ""))))
    return html_table(heads, rows, n_texts=1, of_models=True)


def _learned(schedule: pd.DataFrame | None, weights: pd.DataFrame | None, frame: pd.DataFrame, label: str) -> str:
    if schedule is None:
        return ""
    words = (
        f"<p>Schedules that the {escape(label)} model learned from the training days, by hour: unmeasured heat at the "
        "mean outdoor temperature, and conductance to the outside. Both are what the network of the forecast lacks, "
        "and may be negative: they are no properties of the building. Each forecast begins with updated ones.</p>\n"
    )
    picture = _figure(schedule_figure(schedule), "Learned schedules of unmeasured heat and of conductance.")
    section = f"<h2>Learned schedules</h2>\n{words}{picture}"
    if weights is None:
        return section
    rows = zip(lead_groups(frame), *(map(percent, weights[name]) for name in weights), strict=True)
    shares = html_table(["hours ahead", *map(str, weights)], rows)
    words = "Share of each model in the forecast after training. The short memory forgets past days faster."
    return f'{section}{shares}<p class="soft">{words}</p>'


def _week(zeta: pd.Series | None, truth: pd.Series | None) -> str:
    if zeta is None:
        return ""
    known = (
        " The dashed line is the true internal gains alone; the estimate also contains ventilation, infiltration and "
        "whatever the simple network leaves out."
    )
    return (
        "<h2>Unmeasured heat</h2>\n<p>Heat from people, equipment, lights, air exchange and anything else that is not "
        "in the log, estimated by the identification from the temperature of the training days. Positive values heat "
        f"the room.{'' if truth is None else known}</p>\n"
        + _figure(week_figure(zeta, truth), "Unmeasured heat by hour of the week.")
    )


def _building(parameters: pd.DataFrame, building: pd.DataFrame | None, identification: str | None, label: str) -> str:
    separate = (
        ""
        if identification is None
        else " These values and the unmeasured heat above come from a separate identification "
        f"({escape(identification)}): the network of the {escape(label)} model is fitted for its forecasts, and "
        "its parameters do not describe the building."
    )
    described = "" if building is None else _values("quantity", building, ("remark",))
    return (
        "<h2>The building</h2>\n<p>Heat loss of the zone per degree of temperature difference, time constants, and the "
        "window area that the sun heats through. The standard error shows how well the data determine a value; one "
        f"that they do not determine is not shown.{separate}</p>\n{described}"
        "<p>Parameters of the thermal network: capacities store heat, and resistances slow its flow.</p>\n"
        + _values("parameter", parameters, ("description", "remark"))
    )


def _values(what: str, table: pd.DataFrame, texts: Sequence[str]) -> str:
    """A table of values with standard errors, to two digits of the error; texts that all are empty are left out."""
    texts, rows = [name for name in texts if any(table[name])], []
    for name, row in table.iterrows():
        error = float(row["std"])
        digits = int(np.clip(1 - np.floor(np.log10(error)), 0, 4)) if 0.0 < error < np.inf else 3
        numbers = [number(row[c], digits) for c in ("value", "std")]
        rows.append((f"{name} [{row['unit']}]", *numbers, *(str(row[c]) for c in texts)))
    return html_table((what, "value", "± std. error", *texts), rows, n_texts=len(texts))


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


def _figure(figure: Any, caption: str) -> str:
    text = escape(caption, quote=True)
    return f'<figure tabindex="0"><img src="{as_image(figure)}" alt="{text}"><figcaption>{text}</figcaption></figure>\n'
