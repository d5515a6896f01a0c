"""Reader of JSON: records, columns, series of Prometheus, VictoriaMetrics, Graphite and InfluxDB 1, and lists."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ..._table import listed
from .. import rows_by_zone
from ..assembly import Choice, Pieces
from ..cell_numbers import decimal_sign
from ..paired_columns import POINT, STAMP, VALUE, is_value_name
from ..raw_log import RawLog
from ..stamp_cells import find_stamp_columns, holds_stamps, is_stamp_name
from ..stamps import cell
from ..table_shapes import SAMPLE, assemble_table
from ..text_files import text_of
from ..unit_names import unit_or_energy
from .change_of_value import point_and_value

_BEGIN = re.compile(r'\s*[\[{]\s*(["{\[\]}]|null)')
_BLANKS = re.compile(r"\s*")
_ANSWERS = {"error", "hourly", "results"}  # what objects hold that are no table
_OF_TARGETS = ("instance", "job")  # labels that Prometheus itself adds
_Series = tuple[str, Sequence[Any], Sequence[Any]]  # name, stamps and values


def looks_like(path: Path, head: str) -> bool:
    """Whether a text begins as a list or an object of JSON does."""
    return _BEGIN.match(head) is not None


def read(path: Path, *, point_column: str | None = None, value_column: str | None = None, **options: Any) -> RawLog:
    """Read JSON, wide or long, or the answer of a database; the options beside these are those of ``Choice``."""
    choice, where, units = Choice(**options), repr(path.name), dict[str, str]()
    items = _with_answer(json_items(path, where), where)
    try:
        of_items = [list(_series(item, units)) if isinstance(item, dict) else [] for item in items]
        series = [one for found in of_items for one in found]
        frame = _points(series) if series else _table(items)
        frame = frame.apply(lambda own: own.map(_plain) if own.dtype.kind == "O" else own)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        raise ValueError(f"{where} {_refusal(items)}.") from None
    for item, found in zip(items, of_items, strict=True):
        if series and not found and isinstance(item, dict) and not _is_empty(item):
            raise ValueError(f"{where} {_refusal_among_series(item)}.")
    sample = frame.head(SAMPLE)
    both = (POINT, VALUE) if series else point_and_value(list(map(str, frame)), point_column, value_column, where)
    stamps = find_stamp_columns(sample.drop(columns=list(both or ())), choice.time_column, where)
    texts = [text for text in sample.to_numpy(dtype=object).ravel() if isinstance(text, str)]
    pieces = Pieces((), stamps, where, "JSON", units, decimal_sign(texts, ";"), first_line=1)
    full = {name for name, at, _ in series if len(at)}
    if empty := [name for name, _, _ in series if name not in full]:
        pieces.notes.append(f"{listed(empty)}: left out, since there are no values")
    return assemble_table(pieces, sample, choice, lambda wanted, _: [frame[wanted]], both)


def json_items(path: Path, where: str) -> list[Any]:
    """The documents in a file of JSON, one after the other; of a list, what it holds."""
    text = text_of(path).strip()
    decoder, items, at = json.JSONDecoder(), [], 0
    try:
        while at < len(text):
            found, at = decoder.raw_decode(text, at)
            items += found if isinstance(found, list) else [found]
            at = gap.end() if (gap := _BLANKS.match(text, at)) else at
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{where} is no complete JSON ({error}); export it again.") from None
    return items


def _with_answer(items: list[Any], where: str) -> list[Any]:
    """The documents, where those of an export of VictoriaMetrics become one answer of Prometheus."""
    exported, others = list[Any](), list[Any]()
    for number, item in enumerate(items, start=1):
        metric = item.get("metric") if isinstance(item, dict) and {"values", "timestamps"} <= set(item) else None
        if not isinstance(metric, dict):
            others.append(item)
            continue
        values, at = item["values"], item["timestamps"]
        if not (isinstance(values, list) and isinstance(at, list) and len(values) == len(at)):
            (name,) = _names([metric])
            raise ValueError(
                f"row {number} of {where}: {name} has no value for each of its timestamps; export it again."
            )
        exported.append({"metric": metric, "values": list(zip(at, values, strict=True))})
    answer = {"data": {"resultType": "matrix", "result": exported}}
    return [answer, *others] if exported else items


def _series(item: Mapping[str, Any], units: dict[str, str]) -> Iterator[_Series]:
    """The series in an answer, none in another object; adds the units that are in the names of metrics."""
    answer, results = item.get("data"), item.get("results")
    if isinstance(answer, dict) and answer.get("resultType") == "matrix":
        for name, one in zip(_names([one["metric"] for one in answer["result"]]), answer["result"], strict=True):
            if unit := unit_or_energy(name.partition("{")[0].rpartition("_")[2]):
                units[name] = unit
            yield name, *_transposed(one["values"])
    if "target" in item and isinstance(item.get("datapoints"), list):  # of Graphite
        values, at = _transposed(item["datapoints"])
        yield str(item["target"]), at, values
    for result in results if isinstance(results, list) else ():
        for one in result.get("series", ()):
            yield from _of_influx(one)
    is_record = any(is_stamp_name(key) and not isinstance(own, list | dict) for key, own in item.items())
    rows_of = {} if is_record else {key: rows for key, rows in item.items() if _is_series(rows)}
    for key, rows in rows_of.items():
        value, stamp = sorted(rows[0], key=is_value_name, reverse=True)
        name = item.get("name", key) if len(rows_of) == 1 else key
        yield str(name), [row[stamp] for row in rows], [row[value] for row in rows]


def _names(metrics: Sequence[Mapping[str, str]]) -> list[str]:
    """Metrics of Prometheus as it writes them, without the labels of targets where the others tell them apart."""
    for left_out in (_OF_TARGETS, ()):
        labels = [{key: metric[key] for key in metric if key not in ("__name__", *left_out)} for metric in metrics]
        texts = [", ".join(f'{key}="{value}"' for key, value in own.items()) for own in labels]
        names = [
            own.get("__name__", "") + (f"{{{text}}}" if text or "__name__" not in own else "")
            for own, text in zip(metrics, texts, strict=True)
        ]
        if len(set(names)) == len({str(sorted(metric.items())) for metric in metrics}):
            break
    return names


def _of_influx(one: Mapping[str, Any]) -> Iterator[_Series]:
    """The series of each column under the name that the annotated CSV gives it; a column may tell rooms apart."""
    table = pd.DataFrame(one["values"], columns=one["columns"])
    stamp, *names = map(str, table)
    among = rows_by_zone.may_name_zones(table, [stamp])
    tag = rows_by_zone.zone_column(table, [stamp], among, len(names) + 1)
    for key, rows in table.groupby(tag) if tag else [("", table)]:
        tags = [f"{k}={value}" for k, value in {**one.get("tags", {}), tag: key}.items() if value]
        for name in names:
            if name != tag:
                yield " ".join([one.get("name", ""), name, *tags]).strip(), list(rows[stamp]), list(rows[name])


def _is_series(rows: Any) -> bool:
    """Whether a list holds stamps and values alone."""
    names = rows[0] if isinstance(rows, list) and rows and isinstance(rows[0], dict) else ()
    return sorted((is_value_name(name), is_stamp_name(name)) for name in names) == [(False, True), (True, False)]


def _points(series: Iterable[_Series]) -> pd.DataFrame:
    """The rows of a long table."""
    parts = [pd.DataFrame({STAMP: list(at), POINT: name, VALUE: list(values)}) for name, at, values in series]
    if not any(map(len, parts)):
        raise ValueError
    return pd.concat(parts)


def _table(items: Sequence[Any]) -> pd.DataFrame:
    """The rows of records, or of the columns of one object."""
    if len(items) > 1:
        table = pd.json_normalize([dict(item) for item in items])
    elif _ANSWERS & set(items[0]):
        raise ValueError
    elif {"columns", "data"} <= set(items[0]):
        table = _with_index(pd.DataFrame(items[0]["data"], items[0].get("index"), items[0]["columns"]))
    elif all(isinstance(own, dict) for own in items[0].values()):
        by_row = holds_stamps(pd.Series(list(items[0])), "index")
        table = _with_index(pd.DataFrame.from_dict(items[0], orient="index" if by_row else "columns"))
    elif all(isinstance(own, list) for own in items[0].values()) and len(items[0]) > 1:
        table = pd.DataFrame(items[0])
    else:
        (rows,) = (own for own in items[0].values() if isinstance(own, list))
        return _table(rows)
    table.columns = table.columns.map(str)
    if table.empty or not table.columns.is_unique or table.iloc[0].map(lambda one: isinstance(one, dict)).any():
        raise ValueError
    return table


def _plain(value: Any) -> Any:
    """The value of a cell, as text if it is a list or an object."""
    return str(value) if isinstance(value, list | dict) else value


def _with_index(table: pd.DataFrame) -> pd.DataFrame:
    """A table with its labels as a column, unless they number its rows."""
    numbers = list(map(str, table.index)) == list(map(str, range(len(table))))
    return table if numbers else table.rename_axis(index="index").reset_index()


def _transposed(pairs: Sequence[Sequence[Any]]) -> tuple[Sequence[Any], Sequence[Any]]:
    """The firsts and the seconds of pairs, of which there may be none."""
    firsts, seconds = zip(*pairs, strict=True) if pairs else ((), ())
    return firsts, seconds


def _is_empty(item: Mapping[str, Any]) -> bool:
    """Whether an object is that of a series without values."""
    return [] in item.values() or "results" in item or "data" in item


def _refusal_among_series(item: Mapping[str, Any]) -> str:
    """The words on an object among series that is none."""
    if isinstance(item.get("error"), str):
        return _refusal([item])
    return f"has {cell(json.dumps(item))} among series of stamps and values; put it in a file of its own"


def _refusal(items: Sequence[Any]) -> str:
    """The words on JSON that holds no log: its kind, and what to do."""
    first = items[0] if items and isinstance(items[0], dict) else {}
    if not items or [] in first.values():
        return "holds no rows; export a time that has some"
    if isinstance(first.get("error"), str):
        return f"is an answer that tells of an error, {cell(first['error'])}; ask again"
    if "hourly" in first:
        return "is a forecast of Open-Meteo, which is no log of a room; give it as weather (--weather)"
    if isinstance(first.get("results"), dict):
        return "is an answer to a panel of Grafana; download its data as CSV (Inspect, Data)"
    if "results" in first or (isinstance(first.get("data"), dict) and "resultType" in first["data"]):
        return "is an answer without values over time; query a range of time that has some"
    if first and len(items) == 1 and not any(isinstance(own, dict | list) for own in first.values()):
        return "holds one record; export one for each time stamp"
    return 'is JSON of no known form; write it as records, [{"time": ..., "room temp": ...}, ...], or as CSV'
