"""A report on a log, before anything is fitted: what was read, what it means, what it can tell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from .._table import is_plant, is_stage
from .._time import spell
from .._warnings import several
from .abilities import abilities, days_of, excitation
from .blank_setpoints import filled_setpoints
from .column_roles import ColumnRoles
from .column_spans import lost_columns, one_after_the_other
from .conversion import Channel, counter_of, factor_remarks, fill_remarks, refuse_unlogged, to_roles
from .even_steps import regularize, usual_step
from .log_findings import (
    Finding,
    clash,
    clock_findings,
    counter_findings,
    electricity_finding,
    gap_findings,
    gaps_of,
    partial_findings,
    sensor_findings,
    set_point_findings,
    swap_findings,
    unused_findings,
)
from .naming import UNPLACED
from .plant_findings import cold_findings, cooling_findings, parallel_findings, plant_findings, shared_plant_findings
from .raw_log import RawLog
from .standstills import controlled_rows

_SHOWN_ROWS = 3
_STEPS = tuple(pd.Timedelta(minutes=m) for m in (5, 10, 15, 20, 30, 60))  # steps to choose from; each divides a day
_STYLE = """
.skhybrid-log { font: 14px/1.5 system-ui, sans-serif; max-width: 62rem; }
.skhybrid-log table { border-collapse: collapse; font-size: 0.92em; } .skhybrid-log h4 { margin: 1em 0 0.3em; }
.skhybrid-log th, .skhybrid-log td { text-align: left; padding: 0.25em 0.7em; border-bottom: 1px solid #8885; }
.skhybrid-log .wide { overflow-x: auto; } .skhybrid-log .off { opacity: 0.6; }
.skhybrid-log .error { color: #c0392b; font-weight: 600; } .skhybrid-log .warning { color: #b9770e; font-weight: 600; }
"""


class LogReport:
    """Report on a log: roles and units of its columns, its clock, gaps and sensors, and what it can tell of a zone.

    Parameters
    ----------
    frame : DataFrame or RawLog
        A log with a DatetimeIndex and columns of numbers under their own names, or what :func:`read_log` returns.
    columns : mapping of role to column, optional
        Roles that are known; the others are guessed from names, units and values.  If none are known, and two rooms or
        more have a temperature and a plant of their own, roles end with the room's name, as ``T_za_kitchen``.
    units : mapping of role to unit, optional
        Units that are known.
    scale : mapping of role to number, optional
        Factors that make a stage between 0 and 1 of a column.
    label : {"left", "right"}, optional
        Whether a stamp begins or ends the interval of its row.
    holidays : str or list of dates, optional
        As in :class:`skhybrid.hybrid.HybridPredictor`; such days count as Sundays.
    scaled : iterable of str, optional
        Roles of stages whose capacity is known, and of meters that are known to be heat or electricity.

    Attributes
    ----------
    columns : DataFrame
        Index: columns of the log; ``role`` (None: not used; two with a comma where one set-point heats and cools),
        ``unit``, ``assumed`` (whether the unit or scale is a guess from values), ``scale`` and ``reason``.
    frame : DataFrame of shape (n_rows, n_roles)
        The columns with a role, in the units of the data contract, at the stamps of the log.
    even : DataFrame
        ``frame`` at even steps, with values that are logged by change held until the next; ``frame`` where none is.
    zones : list of str, the rooms of a log with several; empty for one
    step, even_step : Timedelta
        Usual distance of two rows, and a step that divides a day and is about as long.
    gaps : DataFrame, ``last``, ``next`` and ``hours`` of each gap of the rows
    days : dict, number of whole days by kind: working days, weekends, holidays
    excitation : DataFrame, how each role moved
    findings : list of Finding, errors first
    can, cannot, next_steps : list of str

    Raises
    ------
    ValueError
        If there are no two rows with time stamps, the log lacks one of ``columns``, or ``label`` is another word.

    Examples
    --------
    >>> from skhybrid.datasets import load_small_office
    >>> from skhybrid.logs import LogReport
    >>> report = LogReport(load_small_office().X)
    >>> report.roles["T_oa"]
    'T_oa'
    """

    def __init__(
        self,
        frame: pd.DataFrame | RawLog,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        scale: Mapping[str, float] | None = None,
        *,
        label: str | None = None,
        holidays: Any = None,
        scaled: Iterable[str] = (),
    ) -> None:
        self.raw = raw = _checked_log(frame, columns or {}, label)
        self.step = usual_step(raw.frame)
        self.even_step = next((s for s in _STEPS if s >= 0.9 * self.step), _STEPS[-1])
        self.label = label or raw.label
        self._scaled = set(scaled)
        self._given = {"unit": units or {}, "scale": scale or {}}
        ordered = replace(raw, frame=raw.frame.sort_index(kind="stable"))
        self._read = read = ColumnRoles(ordered, columns or {}, units or {}, scale or {}, self._scaled)
        self.zones, channels = read.zones, read.channels
        self.frame = to_roles(ordered, channels).replace([np.inf, -np.inf], np.nan)
        self.columns = read.table()
        self.gaps = gaps_of(pd.DatetimeIndex(raw.frame.index), self.step)
        held = [c.role for c in channels if c.name in raw.held and c.role in self.frame]
        even: Any = regularize(self.frame, self.even_step, "0h", held=held) if held else self.frame
        self.even: pd.DataFrame = even
        self.days = days_of(self.even, self.even_step if held else self.step, holidays)
        self.excitation = excitation(self.even)
        self.can, self.cannot, self.next_steps = self._abilities(channels)
        self.findings = sorted(self._find(ordered, channels), key=lambda f: ("error", "warning", "note").index(f.level))

    def _abilities(self, channels: list[Channel]) -> tuple[list[str], list[str], list[str]]:
        measured = any(c.role.startswith("Q_") and is_plant(c.role) and not self._read.is_unsure(c) for c in channels)
        unsure = {c.role for c in channels if is_plant(c.role) and self._read.is_unsure(c)}
        stages = {c.role for c in channels if is_stage(c.role)}
        unsure |= set() if measured or stages & self._scaled else stages  # one scale fixes those of all
        unplaced = [name for name, guess in self._read.guesses.items() if guess.reason == UNPLACED]
        return abilities(self.excitation, sum(self.days.values()), unsure, self._read.rooms, unplaced)

    @property
    def roles(self) -> dict[str, str]:
        """Column of each role."""
        used = self.columns["role"].dropna()
        return {role: str(name) for name, roles in used.items() for role in str(roles).split(", ")}

    @property
    def assumed_label(self) -> str:
        """Label of the stamps: as the log states it, or else as guessed.

        Right where the first one is a step after midnight, as in files of whole days that are stamped at the end.
        """
        first = self.raw.frame.index[0] if self.raw.first is None else self.raw.first
        return self.label or ("right" if first - first.normalize() == self.step else "left")

    def electricity(self) -> list[str]:
        """Roles whose column seems to be electricity, not heat."""
        return [str(g.role) for g in self._read.guesses.values() if g.role is not None and g.is_electricity]

    def to_dict(self) -> dict[str, Any]:
        """The report as plain values, for JSON."""
        index = pd.DatetimeIndex(self.raw.frame.index)
        return {
            "format": self.raw.format,
            "rows": len(index),
            "first": str(index.min()),
            "last": str(index.max()),
            "step": spell(self.step),
            "timezone": None if index.tz is None else str(index.tz),
            "label": self.assumed_label,
            "columns": _rows_of(self.columns),
            "first_rows": _rows_of(self._first_rows()),
            "gaps": self.gaps.astype({"last": str, "next": str}).round({"hours": 2}).to_numpy().tolist(),
            "days": self.days,
            "excitation": _rows_of(self.excitation),
            "findings": [finding._asdict() for finding in self.findings],
            "can": self.can,
            "cannot": self.cannot,
            "next_steps": self.next_steps,
        }

    def __str__(self) -> str:
        used = self.columns[self.columns["role"].notna()]
        others = self.columns[self.columns["role"].isna()]
        lines = [self.headline(), "", "Columns"]
        width = max(10, *used["role"].map(len), 0)
        for name, row in used.iterrows():
            lines.append(f"  {row['role']:{width}}  {name!r}: {_unit_words(row)}; {row['reason']}")
        lines += [f"  {'unused':{width}}  {name!r}, because {reason}" for name, reason in others["reason"].items()]
        lines += ["", "First rows [degC, kW]", self._first_rows().T.to_string(float_format="{:.2f}".format)]
        for title, texts in self.sections().items():
            lines += ["", title, *(f"  - {text}" for text in texts)]
        return "\n".join(lines)

    def headline(self) -> str:
        """One sentence on format, span and step."""
        index = self.raw.frame.index
        n_days = ", ".join(f"{n} {kind}" for kind, n in self.days.items() if n)
        return (
            f"{self.raw.format}: {len(index)} rows from {index.min()} to {index.max()}, every {spell(self.step)}; "
            f"whole days: {n_days or 'none'}; {several(len(self.gaps), 'gap')}"
            + (f", the longest of {self.gaps['hours'].max():.1f} h." if len(self.gaps) else ".")
        )

    def sections(self) -> dict[str, list[str]]:
        """The remarks by title, without empty ones."""
        found = {
            "Findings": [f"{f.level}: {f.where}: {f.text}" for f in self.findings],
            "This log can tell": self.can,
            "It cannot tell": self.cannot,
            "What to do next": self.next_steps,
        }
        return {title: texts for title, texts in found.items() if texts}

    def _repr_html_(self) -> str:
        shown = self.columns.astype({"role": object, "unit": object}).fillna({"role": "unused", "unit": ""})
        rows = [
            _row(name, role, unit, reason, off=role == "unused")
            for name, role, unit, reason in zip(shown.index, shown["role"], shown["unit"], shown["reason"], strict=True)
        ]
        head = "<tr><th>column</th><th>role</th><th>unit</th><th>reason</th></tr>"
        lists = "".join(
            f"<h4>{escape(title)}</h4><ul>{''.join(map(_item, texts))}</ul>" for title, texts in self.sections().items()
        )
        first = self._first_rows().T.to_html(float_format="{:.2f}".format, border=0)
        return (
            f'<div class="skhybrid-log"><style>{_STYLE}</style><p>{escape(self.headline())}</p>'
            f'<div class="wide"><table>{head}{"".join(rows)}</table></div>'
            f'<h4>First rows [degC, kW]</h4><div class="wide">{first}</div>{lists}</div>'
        )

    def _first_rows(self) -> pd.DataFrame:
        return self.frame[~self.frame.index.duplicated()].dropna(how="all").head(_SHOWN_ROWS)

    def _find(self, raw: RawLog, channels: list[Channel]) -> list[Finding]:
        index = pd.DatetimeIndex(self.raw.frame.index)
        found = list(clock_findings(index, self.step, self.label, self.assumed_label))
        if (text := clash(self.frame) or clash(raw.frame)) is not None:
            found.append(Finding("error", "clock", text))
        found += gap_findings(self.gaps, index)
        for channel in (c for c in channels if c.role in self.frame):  # the mode is no quantity
            if n_infinite := int(np.isinf(self.raw.frame[channel.name]).sum()):
                text = f"{several(n_infinite, 'value')} {'is' if n_infinite == 1 else 'are'} infinite."
                found.append(Finding("error", channel.name, text))
            role = "T_za" if channel.role.removeprefix("T_za_") in self.zones else channel.role
            controlled = controlled_rows(self.frame, channel.role) if role == "T_za" else None
            values = self.frame[channel.role]
            if role.startswith("Q_heat") and self.raw.frame[channel.name].min() >= 0.0 < values.max():
                values = values.abs()  # it is negative where the mode cools
            meter = counter_of(raw, channel)
            found += sensor_findings(role, channel.name, values, self.even[channel.role], controlled, meter is not None)
            found += [] if meter is None else counter_findings(channel.name, meter)
            if role == "T_za" and "T_oa" in self.frame:
                found += swap_findings(channel.name, channel.role, self.frame)
            if self._read.seems_electric(channel):
                found.append(electricity_finding(channel.name))
            if why := self._read.assumed.get(channel.role):
                found.append(Finding("note", channel.name, f"{why}; give its unit if this is wrong."))
        found += self._readings(raw, channels)
        found += [Finding("warning", self.roles[role], text) for role, text in lost_columns(self.even)]
        found += [*set_point_findings(self.even), *unused_findings(self._given, {c.role for c in channels})]
        columns = {c.role: c.name for c in channels}
        rooms = self.frame.reindex(columns=self._read.rooms).rename(columns=columns)
        if (text := one_after_the_other(rooms)) is not None:
            found.append(Finding("error", "rooms", text))
        found += self._read.one_for_both.values()
        found += partial_findings({c.name: self._read.guesses[c.name].reason for c in channels})
        found += shared_plant_findings(columns, self._read.further_rooms)
        found += plant_findings(self.even, self._read.rooms)
        found += parallel_findings(raw.frame, columns, self._read.taken())
        begins = ("Q_hvac", "Q_heat", *(f"Q_{zone}" for zone in self.zones))
        heat = [c for c in channels if c.role.startswith(begins) and c.role not in self._scaled]
        found += [*cooling_findings(self.even, {c.role: c.name for c in heat}), *cold_findings(self.even, columns)]
        return found + [Finding("note", "log", text) for text in self.raw.notes]

    def _readings(self, raw: RawLog, channels: list[Channel]) -> Iterator[Finding]:
        """Remarks on how values are read: without a factor of their name, as missing, or filled in."""
        factors = factor_remarks(channels, self._given["scale"])
        yield from (Finding("warning", name, f"{text}.") for name, text in factors.items())
        yield from (Finding("note", name, f"{text}.") for name, text in fill_remarks(raw, channels).items())
        yield from (Finding("note", "set-points", f"{one.remark}.") for one in filled_setpoints(self.even)[1])


def _log_of(frame: pd.DataFrame) -> RawLog:
    """The columns of a frame that hold real numbers; a note names the others."""
    if not frame.columns.is_unique:
        raise ValueError(f"the log has two columns {frame.columns[frame.columns.duplicated()][0]!r}; rename one.")
    types = frame.dtypes
    real = [pd.api.types.is_numeric_dtype(t) and not pd.api.types.is_complex_dtype(t) for t in types]
    others = [
        f"{name!r} holds no real numbers and is left out" for name, own in zip(frame, real, strict=True) if not own
    ]
    return RawLog(frame.loc[:, real].astype(np.float64).rename(columns=str), "DataFrame", notes=tuple(others))


def _checked_log(given: pd.DataFrame | RawLog, columns: Mapping[str, str], label: str | None) -> RawLog:
    """The log to report on; refused where it has no two stamps or lacks a column, or the label is unknown."""
    frame = given.frame if isinstance(given, RawLog) else given
    if not isinstance(frame, pd.DataFrame) or not isinstance(frame.index, pd.DatetimeIndex):
        raise ValueError("the log has no time stamps; give a DataFrame with a DatetimeIndex, or use read_log.")
    if len(frame.index.unique()) < 2:
        raise ValueError(f"the log has {several(len(frame.index.unique()), 'distinct stamp')}; two are the least.")
    if label not in (None, "left", "right"):
        raise ValueError(f"label={label!r} must be 'left', 'right' or None.")
    raw = given if isinstance(given, RawLog) else _log_of(frame)
    refuse_unlogged(raw, columns)
    return raw


def _rows_of(table: pd.DataFrame) -> dict[Any, Any]:
    """The rows of a table by their names, None where a value is missing."""
    return table.astype(object).where(table.notna(), None).rename(index=str).to_dict(orient="index")


def _unit_words(row: Any) -> str:
    scale = "" if row["scale"] in (None, 1.0) else f", {row['scale']:.4g} times the column"
    unit = "fraction" if is_stage(row["role"]) and row["unit"] == "-" else row["unit"]
    return f"{unit}{scale}{' (assumed)' if row['assumed'] else ''}"


def _row(*cells: object, off: bool) -> str:
    kind = ' class="off"' if off else ""
    return f"<tr{kind}>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>"


def _item(text: str) -> str:
    """A finding with its level in colour."""
    level, colon, rest = text.partition(":")
    if colon and level in ("error", "warning"):
        return f'<li><span class="{level}">{level}</span>:{escape(rest)}</li>'
    return f"<li>{escape(text)}</li>"
