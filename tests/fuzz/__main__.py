"""Fuzzing that goes on until a time or a number is reached.

    python tests/fuzz tables --count 100000 --seconds 3600   # calls of all entry points on odd tables
    python tests/fuzz csv --seconds 1800                     # mutants of CSV logs; likewise logs, toml, model, store
    python tests/fuzz report                                 # benchmarks/results/fuzz.md from what has been run
    python tests/fuzz call "Call('ARXRegressor.fit')"        # one call, with its traceback

What has been run is kept in ``build/fuzz``, one file for each target: a run that is stopped goes on from there, and
``--fresh`` begins again.  ``make fuzz`` runs all of them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import hypothesis
from calls import Call, calls, read, simplest
from entry_points import called, entries
from file_readers import READERS, mutant, smallest
from hypothesis import HealthCheck, Phase, given
from outcomes import ACCEPTED, REFUSED, Tally

ROOT = Path(__file__).resolve().parents[2]
KEPT, REPORT = ROOT / "build" / "fuzz", ROOT / "benchmarks" / "results" / "fuzz.md"
_CHUNK = 500  # calls that are drawn from one seed
_MEMORY = 16 * 2**30  # address space [bytes]: more is a MemoryError, not a machine that swaps
_BUDGET = "`make fuzz` makes 100 000 calls on tables and reads the mutants of each kind of file for half an hour."
_QUIET = {"deadline": None, "database": None, "phases": [Phase.generate], "suppress_health_check": list(HealthCheck)}


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", choices=["tables", *READERS, "report", "call"])
    parser.add_argument("text", nargs="?", help="the call to make, or the number of the mutant to read")
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--count", type=int, default=10**9, help="stop at so many tables or files in all")
    parser.add_argument("--fresh", action="store_true", help="forget what has been run")
    arguments = parser.parse_args()
    if arguments.target == "report":
        return write_report()
    if arguments.target == "call":
        return show_call(arguments.text)
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    warnings.simplefilter("ignore")  # those of a call are seen all the same
    KEPT.mkdir(parents=True, exist_ok=True)
    kept = KEPT / f"{arguments.target}.json"
    content = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() and not arguments.fresh else {}
    tally, next_number, spent = Tally(content), content.get("next", 0), content.get("seconds", 0.0)
    batches = table_batches if arguments.target == "tables" else file_batches
    begun = time.monotonic()
    for done in batches(arguments.target, next_number, tally):
        now = spent + time.monotonic() - begun
        text = json.dumps(tally.as_dict() | {"next": done, "seconds": now, "date": time.strftime("%Y-%m-%d")})
        kept.with_suffix(".new").write_text(text, encoding="utf-8")
        os.replace(kept.with_suffix(".new"), kept)
        print(f"{done} in {now:.0f} s, failures: {sum(tally.failures().values())}", flush=True)
        if now - spent >= arguments.seconds or done >= arguments.count:
            break
    for kind, n in tally.failures().most_common():
        print(f"{n} x {kind}\n    {tally.examples.get(kind, '')[:600]}")
    return int(bool(tally.failures()))


def table_batches(target: str, number: int, tally: Tally) -> Iterator[int]:
    """Calls on tables; after each batch the number of calls so far."""
    for name in entries():  # numba compiles
        Call(name).outcome()
    while True:

        @hypothesis.seed(number)
        @hypothesis.settings(max_examples=_CHUNK, **_QUIET)
        @given(calls())
        def batch(call: Any) -> None:
            outcome = call.outcome()
            if tally.add(entries()[call.entry].method, outcome):
                tally.examples[outcome.kind] = repr(call)
                simple = simplest(call)
                tally.examples[outcome.kind] = f"{simple!r}: {simple.outcome().detail or outcome.kind}"

        batch()
        number += _CHUNK
        yield number


def file_batches(target: str, number: int, tally: Tally) -> Iterator[int]:
    """Mutants of files; after some seconds the number of mutants so far."""
    folder, shown = KEPT / "work" / target, time.monotonic()  # not a random name: messages show it
    folder.mkdir(parents=True, exist_ok=True)
    while True:
        content, choice = mutant(target, number, folder)
        outcome = READERS[target].read(content, choice, folder)
        if tally.add(target, outcome):
            tally.examples[outcome.kind] = f"{KEPT.name}/{target}-{number}: {outcome.detail or outcome.kind}"
            (KEPT / f"{target}-{number}").write_bytes(smallest(target, content, choice, folder))
        number += 1
        if time.monotonic() - shown > 10:
            shown = time.monotonic()
            yield number


def show_call(text: str | None) -> int:
    """Make one call and print its outcome; an error that is no refusal is raised."""
    call = read(text or "")
    print(call, outcome := call.outcome(), sep="\n")
    entry = entries()[call.entry]
    if outcome.failed:
        X = call.table.odd(call.table.frame())
        print(X)
        print(called(entry)[1](**{name: call._argument(name, X) for name in entry.parameters}))
    return int(outcome.failed)


def write_report() -> int:
    """Write the table of outcomes."""
    kept = {p.stem: json.loads(p.read_text(encoding="utf-8")) for p in sorted(KEPT.glob("*.json"))}
    date = max(one["date"] for one in kept.values())
    lines = ["# Fuzzing", "", f"Made by `tests/fuzz` on {date}; {_machine()}.", _BUDGET, ""]
    lines += [
        "A call on a table, or the reading of a file, is accepted with finite numbers, or refused in one sentence by",
        "an error that the package raises on purpose. All else is a failure, and so is: a lie that is accepted (a fill",
        "value, a mask, dates as numbers, a y that is not T_za, rows without a step); a forecast beyond -60 to 100",
        "degC from a table that was not warned of; another result for the same rows in another order or type; and a",
        "refusal that leaves the estimator changed.",
        "",
        "| target | calls | accepted and finite | refused in one sentence | anything else | time [min] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, content in kept.items():
        lines.append(_row(name, sum(map(Counter, content["counts"].values()), Counter()), content["seconds"] / 60))
    if "tables" in kept:
        lines += ["", "## Tables by entry point", ""]
        lines += ["| method or function | calls | accepted | refused | anything else |", "|---|---:|---:|---:|---:|"]
        lines += [_row(name, Counter(counts)) for name, counts in sorted(kept["tables"]["counts"].items())]
    lines += ["", "## Anything else", ""]
    failures = [(n, kind, name) for name, content in kept.items() for kind, n in Tally(content).failures().items()]
    for n, kind, name in sorted(failures, reverse=True):
        example = " ".join(kept[name]["examples"].get(kind, "").split())[:300]
        lines.append(f"- {name}, {n} times: {kind}. `{example}`".replace(f"{ROOT}/", ""))
    REPORT.write_text("\n".join(lines + ([] if failures else ["None."])) + "\n", encoding="utf-8")
    print(REPORT.read_text(encoding="utf-8"))
    return 0


def _row(name: str, counts: Counter[str], minutes: float | None = None) -> str:
    rest = counts.total() - counts[ACCEPTED] - counts[REFUSED]
    cells = [name, counts.total(), counts[ACCEPTED], counts[REFUSED], rest]
    return "| " + " | ".join(map(str, cells + ([] if minutes is None else [f"{minutes:.0f}"]))) + " |"


def _machine() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "pandas", "scikit-learn", "hypothesis"))
    return f"one core of {platform.machine()}, {platform.system()}, Python {platform.python_version()}, {packages}"


if __name__ == "__main__":
    sys.exit(main())
