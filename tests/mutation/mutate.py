"""Mutation testing: changes one operator or number of a module at a time and sees whether a test fails.

    pip install cosmic-ray                                              # anywhere; it makes the mutants
    python tests/mutation/mutate.py --sample 20 identification/loads.py  # 20 places of one module
    nice python tests/mutation/mutate.py --sample 4 --jobs 2            # of every module
    python tests/mutation/mutate.py --report                            # the table from what has been run

A mutant is tested in a copy of the package below ``build/mutation``, so that the checkout stays as it is.  A survey
runs each file of tests once and notes which functions each test calls (some 20 minutes; kept until the file changes).
A mutant is run against the tests that call the changed function, the quickest first, for at most ``--budget`` seconds.
Outcomes are lines of ``outcomes.csv`` as soon as they are known; a run that is started again goes on from there, and
tests a module anew where it has changed.  ``reason``, filled in by hand, says why a survivor may live; it is kept.  A
sample with the same seed is the same, and a larger one holds the smaller.
"""

from __future__ import annotations

import argparse
import ast
import csv
import difflib
import hashlib
import json
import os
import random
import shutil
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parents[2]
PACKAGE, WORK = ROOT / "skhybrid", ROOT / "build" / "mutation"
STORE, REPORT = Path(__file__).with_name("outcomes.csv"), ROOT / "benchmarks" / "results" / "mutation.md"
FIELDS = ["module", "line", "column", "operator", "occurrence", "before", "after", "outcome", "seconds", "source"]
FIELDS += ["reason"]
#: operators that say nothing about numbers: a kernel without its decorator is the same, only slower
LEFT_OUT = ("RemoveDecorator", "ExceptionReplacer", "NoOp", "Variable")
#: quick tests of kernels, which run as plain Python, because numba keeps compiled callers of a changed kernel
PLAIN = [
    "test_filtering",
    "test_predictor",
    "test_horizon_errors",
    "test_forecasting_arx -k not (update or whole_table)",
    "test_load -k felt_late or arrays_without or met_at_its or ramp or every_day",
    "test_schedule_model -k hourly_origins",
    "test_identification_gradients -k periodic",
    "test_multi_step -k hourly_and_leads or plain_loop or slopes",
    "test_set_points_known -k trees_as_arrays",
]


# --------------------------------------------------------------------------------------------------------- mutants
def silent_spans(tree: ast.AST) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Spans of code whose mutants no test of numbers can see: annotations, errors, decorators, ``strict=`` of zip."""
    nodes: list[ast.AST | None] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            nodes.append(node)
        elif isinstance(node, ast.FunctionDef):
            nodes += [node.returns, *node.decorator_list]
        elif isinstance(node, ast.arg | ast.AnnAssign):
            nodes.append(node.annotation)
        elif isinstance(node, ast.keyword) and node.arg == "strict":
            nodes.append(node.value)
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in nodes if n is not None]


def mutants(module: str, sample: int, seed: int) -> list[dict]:
    """One mutant each of a random sample of places of a module."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    code = (PACKAGE / module).read_text(encoding="utf-8")
    silent, source = silent_spans(ast.parse(code)), hashlib.sha256(code.encode()).hexdigest()[:12]
    nodes, places = list(ast_nodes(get_ast(code))), {}
    for name in sorted(operator_names()):
        if get_operator(name).arguments() or any(word in name for word in LEFT_OUT):
            continue
        operator = get_operator(name)()
        found = (position for node in nodes for position in operator.mutation_positions(node))
        for occurrence, (start, _) in enumerate(found):
            if not any(first <= start < last for first, last in silent):
                places.setdefault(start, []).append((name, occurrence))
    rng = random.Random(f"{seed} {module}")
    chosen = [(start, rng.choice(places[start])) for start in rng.sample(sorted(places), len(places))]
    return [
        {"module": module, "line": line, "column": column, "operator": name, "occurrence": occurrence, "source": source}
        for (line, column), (name, occurrence) in chosen[:sample]
    ]


def mutated(mutant: dict) -> str:
    """The code of a mutant; its changed lines are put into the mutant."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    code = (PACKAGE / mutant["module"]).read_text(encoding="utf-8")
    changed = mutate_code(code, get_operator(mutant["operator"])(), mutant["occurrence"])
    diff = list(difflib.ndiff(code.splitlines(), changed.splitlines()))
    for field, sign in (("before", "- "), ("after", "+ ")):
        mutant[field] = " ".join(line[2:].strip() for line in diff if line.startswith(sign))
    return changed


# ---------------------------------------------------------------------------------------------------------- tests
class Bench:
    """A copy of the package, and a process that runs tests on it with the libraries already loaded."""

    def __init__(self, number: int, python: str) -> None:
        self.folder = WORK / str(number)
        shutil.rmtree(self.folder / "skhybrid", ignore_errors=True)
        # times of files are kept, so that compiled kernels are found again
        shutil.copytree(PACKAGE, self.folder / "skhybrid", ignore=shutil.ignore_patterns("__pycache__"))
        subprocess.run([python, "-m", "compileall", "-q", str(self.folder / "skhybrid")], check=True)
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        env = os.environ | one | {"PYTHONPATH": str(self.folder), "PYTHONSAFEPATH": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        env["NUMBA_CACHE_DIR"] = str(self.folder / "numba")
        command = [python, str(Path(__file__).with_name("server.py")), str(self.folder)]
        pipe = subprocess.PIPE
        self.server = subprocess.Popen(command, cwd=ROOT, env=env, stdin=pipe, stdout=pipe, text=True)

    def run(self, tests: list[str], plain: bool, limit: float = 1e6, survey: str = "") -> str:
        """Run tests: ``survived``, ``killed`` or ``timeout``."""
        arguments = ["-q", "-x", "-p", "no:cacheprovider", "--tb=line", *tests]
        question = {"arguments": arguments, "plain": plain, "limit": limit, "survey": survey}
        question["log"] = str(self.folder / "last.log")
        print(json.dumps(question), file=self.server.stdin, flush=True)
        answer = self.server.stdout.readline().strip()
        if answer in ("4", "5"):  # pytest did not know a test, or found none
            raise RuntimeError(f"no such tests: {', '.join(tests)}; remove {WORK / 'surveys'} and survey anew.")
        return {"0": "survived", "timeout": "timeout"}.get(answer, "killed")

    def survey(self, name: str, plain: bool) -> dict:
        """Find what the tests of a file, or of a part of it by ``-k``, call; kept until the file changes."""
        file, *choice = name.split(" -k ")
        kept = WORK / "surveys" / f"{name.replace(' ', '_')}{'_plain' if plain else ''}.json"
        if not kept.exists() or kept.stat().st_mtime < (ROOT / "tests" / f"{file}.py").stat().st_mtime:
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.unlink(missing_ok=True)
            tests = [f"tests/{file}.py", "-m", "not slow", *(word for part in choice for word in ("-k", part))]
            self.run(tests, plain, survey=str(kept))
            print(f"survey of {name}", flush=True)  # noqa: T201
        return json.loads(kept.read_text(encoding="utf-8"))


def is_compiled(module: str) -> bool:
    return "@compiled" in (PACKAGE / module).read_text(encoding="utf-8")


def survey_all(benches: Queue, plain: bool) -> list[dict]:
    """Find what the quick tests of all files call, or those of kernels as plain Python."""

    def survey(name: str) -> dict:
        bench = benches.get()
        try:
            return bench.survey(name, plain)
        finally:
            benches.put(bench)

    names = PLAIN if plain else sorted(path.stem for path in (ROOT / "tests").glob("test_*.py"))
    with ThreadPoolExecutor(benches.qsize()) as pool:
        return list(pool.map(survey, names))


def function_at(module: str, line: int) -> str:
    """The qualified name of the function that a line is in the body of; empty where the line runs at import."""
    name, nodes = "", [(ast.parse((PACKAGE / module).read_text(encoding="utf-8")), "")]
    while nodes:
        node, outer = nodes.pop()
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef):
                nodes.append((child, f"{outer}{child.name}."))
            elif isinstance(child, ast.FunctionDef):
                nodes.append((child, f"{outer}{child.name}.<locals>."))
                if child.body[0].lineno <= line <= child.end_lineno:
                    name = max(name, outer + child.name, key=len)
            else:
                nodes.append((child, outer))
    return name


def chosen_tests(surveys: list[dict], module: str, function: str, budget: float) -> tuple[list[str], float]:
    """The quickest tests within a budget that call a function, or without one any of the module; and their seconds."""
    found, called = [], f"{module}:{function}"
    for number, survey in enumerate(surveys):
        for test, note in survey["tests"].items():
            used = {name: survey["fixtures"][name] for name in note["fixtures"] if name in survey["fixtures"]}
            notes = [note, *used.values()]
            calls = {call if function else f"{call.split(':')[0]}:" for one in notes for call in one["calls"]}
            if called in calls:
                needed = {(number, name): one["seconds"] for name, one in used.items()}
                found.append((sum(one["seconds"] for one in notes), test, note["seconds"], needed))
    tests, seconds, ready = [], 0.0, set()
    for _, test, own, needed in sorted(found, key=lambda one: one[:2]):
        more = own + sum(needed[fixture] for fixture in needed.keys() - ready)
        if seconds + more <= budget:
            tests.append(test)
            seconds, ready = seconds + more, ready | needed.keys()
    return tests, seconds


def try_mutant(mutant: dict, surveys: list[dict], benches: Queue, budget: float) -> dict:
    """Test one mutant on a free bench, and put the module back."""
    bench, module = benches.get(), mutant["module"]
    copy, function = bench.folder / "skhybrid" / module, function_at(module, mutant["line"])
    mutant |= {"outcome": "survived", "seconds": 0.0, "reason": ""}
    try:
        tests, expected = chosen_tests(surveys, module, function, budget)
        if not tests:  # what numba compiles is called unseen
            tests, expected = chosen_tests(surveys, module, "", budget)
        mutant["tests"], code, begin = len(tests), mutated(mutant), time.time()
        if tests:
            copy.write_text(code, encoding="utf-8")
            mutant["outcome"] = bench.run(tests, is_compiled(module), 60.0 + 5.0 * expected)
            mutant["seconds"] = round(time.time() - begin, 1)
    finally:
        shutil.copy2(PACKAGE / module, copy)
        benches.put(bench)
    return mutant


# --------------------------------------------------------------------------------------------------------- outcomes
def read_store() -> list[dict]:
    """Outcomes of what has been run, but for modules that are gone."""
    rows = csv.DictReader(STORE.open(encoding="utf-8")) if STORE.exists() else []
    return [row for row in rows if (PACKAGE / row["module"]).exists()]


def write_store(rows: list[dict]) -> None:
    with STORE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda r: (r["module"], int(r["line"]), int(r["column"]), r["operator"])))


def is_kept(row: dict, source: str, again: bool) -> bool:
    """Whether the outcome of a mutant holds for a state of its module."""
    open_ = row["outcome"] == "survived" and not row["reason"]
    return row["source"] == source and not (again and open_)


def key(row: dict) -> tuple:
    return tuple(str(row[name]) for name in ("module", "source", "operator", "occurrence"))


def write_report(rows: list[dict]) -> None:
    """A table of modules and a list of survivors."""
    modules = sorted({row["module"] for row in rows})
    most = max((sum(row["module"] == module for row in rows) for module in modules), default=0)
    how = f"Made on {date.today()} by `python tests/mutation/mutate.py --sample {most}`, which says how."
    text = ["# Mutation testing", "", how, "A module that changed since keeps its rows until it is run again."]
    text += ["Outcomes and reasons of survivors were completed by hand, and each kill was seen.", ""]
    text += ["| module | mutants | killed | timeout | survived |", "|---|---|---|---|---|"]
    for module in [*modules, None]:
        outcomes = [row["outcome"] for row in rows if module in (None, row["module"])]
        counts = [outcomes.count(kind) for kind in ("killed", "timeout", "survived")]
        text.append("| " + " | ".join([module or "all", str(len(outcomes)), *map(str, counts)]) + " |")
    text += ["", "## Survivors", ""]
    for row in rows:
        if row["outcome"] == "survived":
            text += [f"- `{row['module']}:{row['line']}` {row['reason'] or 'no reason yet'}", ""]
            text += [f"      - {row['before']}", f"      + {row['after']}", ""]
    REPORT.write_text("\n".join(text).rstrip() + "\n", encoding="utf-8")


# ------------------------------------------------------------------------------------------------------------- main
def all_modules() -> list[str]:
    found = (path.relative_to(PACKAGE).as_posix() for path in sorted(PACKAGE.rglob("*.py")))
    return [module for module in found if not module.endswith("__init__.py")]


def run_module(wanted: list[dict], surveys: list[dict], benches: Queue, budget: float) -> None:
    """Test the mutants of one module."""
    with ThreadPoolExecutor(benches.qsize()) as pool:
        for row in pool.map(lambda mutant: try_mutant(mutant, surveys, benches, budget), wanted):
            write_store([*read_store(), row])
            where = f"{row['module']}:{row['line']} {row['outcome']} by {row['tests']} tests in {row['seconds']} s"
            print(f"{where}: {row['after']}", flush=True)  # noqa: T201


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", help="paths in skhybrid; default: all")
    parser.add_argument("--sample", type=int, default=20, help="places of each module")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--budget", type=float, default=60.0, help="seconds of tests of one mutant")
    parser.add_argument("--python", default=str(ROOT / ".venv" / "bin" / "python"), help="that runs the tests")
    parser.add_argument("--again", action="store_true", help="test anew what survived without a reason")
    parser.add_argument("--report", action="store_true", help="write the table and run nothing")
    options = parser.parse_args()
    benches: Queue = Queue()
    for number in range(0 if options.report else options.jobs):
        benches.put(Bench(number, options.python))
    modules = [] if options.report else options.modules or all_modules()
    surveys = {plain: survey_all(benches, plain) for plain in set(map(is_compiled, modules))}
    for module in modules:
        sampled = mutants(module, options.sample, options.seed)
        source = sampled[0]["source"] if sampled else ""
        # of an earlier state of the module only reasons are of use
        reasons = {(r["module"], r["before"], r["after"]): r["reason"] for r in read_store() if r["reason"]}
        write_store([r for r in read_store() if r["module"] != module or is_kept(r, source, options.again)])
        done = {key(row) for row in read_store()}
        wanted = [mutant for mutant in sampled if key(mutant) not in done]
        if wanted:
            run_module(wanted, surveys[is_compiled(module)], benches, options.budget)
        rows = read_store()
        for row in rows:
            row["reason"] = row["reason"] or reasons.get((row["module"], row["before"], row["after"]), "")
        write_store(rows)
    write_report(read_store())


if __name__ == "__main__":
    main()
