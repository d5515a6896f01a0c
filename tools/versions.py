"""Tests on the oldest versions that ``pyproject.toml`` allows and on the newest, checks of wheel and sdist, an audit.

    python tools/versions.py [oldest | newest | wheel | audit] [--pytest ARGUMENTS] [--newest PYTHON] [--folder DIR]

Every part makes an environment of its own in the folder (a new one under the temporary folder) and writes its section
of ``benchmarks/results/versions.md``.  Exit code 1 if a part fails.  Without a part named, all four run.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "versions.md"
OLDEST_PYTHON = "python3.11"
EXTRAS = ("networks", "bayes", "distributed", "holidays", "files", "sql", "serve", "control", "test")
#: newest first
PYTHONS = ("python3.15", "python3.14", "python3.13", "python3.12", OLDEST_PYTHON)
SHOWN = (
    "numpy", "scipy", "scikit-learn", "pandas", "numba", "joblib", "pvlib", "matplotlib", "tqdm", "skops",
    "threadpoolctl", "torch", "skorch", "pymc", "dask", "distributed", "ray", "holidays", "pytest",
    "pytest-xdist", "numpydoc",
)  # fmt: skip
#: files of the sdist beside the package
DESCRIPTION = {
    "CHANGELOG.md", "CITATION.cff", "LICENSE", "MANIFEST.in", "PKG-INFO", "README.md", "SECURITY.md", "constraints.txt",
    "pyproject.toml", "setup.cfg",
}  # fmt: skip
#: Imports every module of the package; its own deprecated calls are errors, those of other packages are not.
IMPORT_ALL = """
import importlib, pkgutil, warnings
import pandas  # pandas 2.2.0 warns of pyarrow on import
for category in (DeprecationWarning, FutureWarning):
    warnings.filterwarnings("error", category=category, module=r"skhybrid(\\.|$)")
import skhybrid
names = [module.name for module in pkgutil.walk_packages(skhybrid.__path__, "skhybrid.")]
for name in names:
    if not name.endswith("__main__"):
        importlib.import_module(name)
print(len(names), "modules imported")
"""
WITHOUT_TORCH = """
import importlib.util, sys
found = [name for name in ("torch", "skorch", "pymc") if importlib.util.find_spec(name)]
sys.exit(f"{found} are installed" if found else 0)
"""


def requirements() -> list[str]:
    """The direct requirements of the package and of its extras that tests use."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [line for group in EXTRAS for line in project["optional-dependencies"][group]]
    return [line for line in project["dependencies"] + extras if not line.startswith("skhybrid")]


def lower_bounds() -> list[str]:
    """Each requirement at its lower bound, as lines of a constraints file."""
    pins = []
    for line in requirements():
        name, bound = re.match(r"([\w-]+)(?:\[.*\])?>=([\d.]+)", line).groups()
        pins.append(f"{name}=={bound}")
        if name == "dask":
            pins.append(f"distributed=={bound}")
    return pins


def run(*command: object, cwd: Path = ROOT, check: bool = True, **settings) -> subprocess.CompletedProcess:
    """Run a command with one thread for BLAS, and the package only where it is installed."""
    drop = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    environment = {key: value for key, value in os.environ.items() if key not in drop} | threads
    print("$", *command, flush=True)
    return subprocess.run(list(map(str, command)), cwd=cwd, check=check, env=environment, text=True, **settings)


def environment(folder: Path, python: str) -> Path:
    """The interpreter of a new virtual environment."""
    run(python, "-m", "venv", "--clear", folder)
    return folder / "bin" / "python"


def versions(python: Path) -> str:
    """The installed versions of the packages that matter, in one line."""
    listed = json.loads(run(python, "-m", "pip", "list", "--format", "json", stdout=subprocess.PIPE).stdout)
    found = {package["name"].lower(): package["version"] for package in listed}
    interpreter = run(python, "-c", "import platform; print(platform.python_version())", stdout=subprocess.PIPE).stdout
    return ", ".join([f"Python {interpreter.strip()}", *(f"{name} {found[name]}" for name in SHOWN if name in found)])


def tested(python: Path, folder: Path, arguments: list[str]) -> Iterator[str]:
    """Import all modules with warnings as errors, then run the tests; yields the lines of the report."""
    yield f"- versions: {versions(python)}"
    run(python, "-c", IMPORT_ALL)
    yield "- all modules import without a DeprecationWarning or FutureWarning of their own"
    report = folder / "tests.xml"
    command = ["-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    done = run(python, *command, f"--junitxml={report}", check=False)
    suite = ElementTree.parse(report).getroot().find("testsuite")
    n = {key: int(suite.get(key)) for key in ("tests", "failures", "errors", "skipped")}
    passed = n["tests"] - n["failures"] - n["errors"] - n["skipped"]
    yield (
        f"- `pytest {' '.join(arguments)}`: {passed} passed, {n['failures'] + n['errors']} failed, "
        f"{n['skipped']} skipped or expected to fail, {float(suite.get('time')) / 60:.0f} min"
    )
    for case in suite.iter("testcase"):
        if case.find("failure") is not None or case.find("error") is not None:
            yield f"- failed: `{case.get('classname')}::{case.get('name')}`"
    if done.returncode:
        raise Failed(f"pytest ended with {done.returncode}")


class Failed(Exception):
    """A part ran and found something wrong."""


def oldest(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """The tests on the lower bounds of every requirement."""
    python = environment(folder / "venv", OLDEST_PYTHON)
    pins = folder / "lower-bounds.txt"
    pins.write_text("\n".join(lower_bounds()) + "\n", encoding="utf-8")
    # Ray 2.9 imports pkg_resources, which newer versions of setuptools lack
    run(python, "-m", "pip", "install", "-q", "-c", pins, "-e", ".[test]", "setuptools<81")
    yield from tested(python, folder, options.pytest)


def newest(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """The tests on the newest interpreter and the newest versions of the index."""
    python = environment(folder / "venv", newest_python(options))
    run(python, "-m", "pip", "install", "-q", "-U", "-e", ".[test]")
    yield from tested(python, folder, options.pytest)


def newest_python(options: argparse.Namespace) -> str:
    """The newest interpreter that is found, or the one that was named."""
    return options.newest or next(filter(works, PYTHONS))


def works(python: str) -> bool:
    """Whether a name on the path is an interpreter, not the stub of one."""
    return bool(shutil.which(python)) and subprocess.run([python, "-V"], capture_output=True).returncode == 0


def wheel(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Wheel and sdist: contents, twine, sizes; the README's Python block in environments without and with extras."""
    tools = environment(folder / "tools", sys.executable)
    run(tools, "-m", "pip", "install", "-q", "build", "twine")
    run(tools, "-m", "build", "--outdir", folder / "dist", ROOT)
    built = sorted((folder / "dist").iterdir())
    run(tools, "-m", "twine", "check", "--strict", *built)
    yield "- `twine check --strict`: " + ", ".join(path.name for path in built)
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    if missing := [name for name, address in urls.items() if "example.org" in address]:
        yield f"- addresses to fill in before publishing (`[project.urls]`): {', '.join(missing)}"
    for path in built:
        yield f"- {path.name}: {check_contents(path)} files, {path.stat().st_size / 1e6:.2f} MB"
    block = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL).group(1)
    whl = next(path for path in built if path.suffix == ".whl")
    sizes, found = [], []
    for name in dict.fromkeys((OLDEST_PYTHON, newest_python(options))):
        core = environment(folder / f"{Path(name).name}-core", name)
        run(core, "-m", "pip", "install", "-q", whl)  # with its dependencies
        for path in built:
            run(core, "-m", "pip", "install", "-q", "--force-reinstall", "--no-deps", path)
            run(core, "-c", WITHOUT_TORCH, cwd=folder)
            sizes.append((path.name, try_out(core, folder, block)))
        extras = environment(folder / f"{Path(name).name}-all", name)
        if name == OLDEST_PYTHON:  # torch comes first and alone, so that a build for CPU is taken where one is at hand
            run(extras, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", "torch")
        run(extras, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", f"{whl}[all]")
        sizes.append((f"{whl.name}[all]", try_out(extras, folder, block)))
        found += [versions(core), versions(extras)]
    yield "- each runs the README's Python block, `--version` and `show_versions`; the first two have no torch:"
    yield "\n| installed into an empty environment | Python | MB in all |\n| --- | --- | --- |"
    yield from (f"| {name} | {python} | {size:.0f} |" for name, (python, size) in sizes)
    yield ""
    yield from (f"- versions: {line}" for line in found)


def try_out(python: Path, folder: Path, block: str) -> tuple[str, float]:
    """Run the README's Python block and the command line; the interpreter's version and the environment's size [MB]."""
    run(python, "-c", block, cwd=folder)
    run(python.parent / "skhybrid", "--version", cwd=folder)
    run(python, "-c", "import skhybrid; skhybrid.show_versions()", cwd=folder)
    size = sum(path.stat().st_size for path in python.parents[1].rglob("*") if path.is_file() and not path.is_symlink())
    return versions(python).partition(",")[0].removeprefix("Python "), size / 1e6


def check_contents(path: Path) -> int:
    """Number of files of a wheel or sdist, which has the package and what describes it, no more."""
    tracked = run("git", "ls-files", "skhybrid", stdout=subprocess.PIPE).stdout.split()
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as archive:
            found = archive.namelist()
        own = [name for name in found if ".dist-info/" not in name]
    else:
        with tarfile.open(path) as archive:
            found = [member.name.partition("/")[2] for member in archive if member.isfile()]
        own = [name for name in found if name not in DESCRIPTION and ".egg-info/" not in name]
    if set(own) != set(tracked):
        raise Failed(f"{path.name}: other files than the package has: {sorted(set(own) ^ set(tracked))}")
    return len(found)


def audit(folder: Path, options: argparse.Namespace) -> Iterator[str]:
    """Known vulnerabilities of the versions in ``constraints.txt``."""
    tools = environment(folder / "tools", sys.executable)
    run(tools, "-m", "pip", "install", "-q", "pip-audit")
    command = (
        tools,
        "-m",
        "pip_audit",
        "-r",
        "constraints.txt",
        "--no-deps",
        "--progress-spinner",
        "off",
        "-f",
        "json",
    )
    n_bad = 0
    for service in ("pypi", "osv"):
        done = run(*command, "-s", service, check=False, capture_output=True)
        if not done.stdout.startswith("{"):
            yield f"- not audited by {service}: {done.stderr.strip().splitlines()[-1]}"
            continue
        found = json.loads(done.stdout)["dependencies"]
        # pip-audit ends with 0 and "no known vulnerabilities" where it could look up nothing at all
        skipped = [package["skip_reason"] for package in found if "skip_reason" in package]
        if skipped:
            yield f"- not audited by {service}: {len(skipped)} of {len(found)} packages, such as: {skipped[0]}"
        bad = [f"{p['name']} {p['version']}: {v['id']}" for p in found for v in p.get("vulns", [])]
        if len(skipped) < len(found):
            n_known = len(found) - len(skipped)
            yield f"- audited by {service}: {n_known} packages; known vulnerabilities: {', '.join(bad) or 'none'}"
        n_bad += len(bad)
    if n_bad:
        raise Failed(f"{n_bad} known vulnerabilities")


PARTS = {part.__name__: part for part in (oldest, newest, wheel, audit)}


def passes(part: str, folder: Path, options: argparse.Namespace) -> bool:
    """Run a part, record what it found, and say whether all was well."""
    folder.mkdir(parents=True, exist_ok=True)
    lines, failure = [], None
    try:
        for line in PARTS[part](folder, options):
            print(line, flush=True)
            lines.append(line)
    except (Failed, subprocess.CalledProcessError) as error:
        failure = error
        lines.append(f"- FAILED: {error}")
    record(part, lines)
    return failure is None


def record(part: str, lines: list[str]) -> None:
    """Replace one section of the results."""
    text = RESULTS.read_text(encoding="utf-8") if RESULTS.is_file() else "# Versions that the tests pass with\n"
    head, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    kept = {section.split(":")[0]: "## " + section.strip() + "\n" for section in sections}
    today = datetime.datetime.now(datetime.UTC).date()
    title = f"## {part}: `python tools/versions.py {part}`, {today}, {platform.machine()}\n"
    kept[part] = "\n".join([title, *lines]) + "\n"
    RESULTS.write_text("\n".join([head.strip() + "\n", *(kept[name] for name in PARTS if name in kept)]), "utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", nargs="?", choices=[*PARTS, "all"], default="all")
    parser.add_argument("--pytest", type=shlex.split, default=[], metavar="ARGUMENTS", help="as one string")
    parser.add_argument("--newest", metavar="PYTHON", help="the interpreter; the newest that is found")
    parser.add_argument("--folder", type=Path, help="where the environments are made")
    options = parser.parse_args()
    base = (options.folder or Path(tempfile.mkdtemp(prefix="versions-"))).resolve()
    failed = [part for part in PARTS if options.part in (part, "all") and not passes(part, base / part, options)]
    print("failed:", ", ".join(failed) or "nothing")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
