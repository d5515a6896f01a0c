"""Language of README, changelog and documentation: proselint, and words that have a plainer one.

    python tools/prose.py

Code, equations, tables of numbers and names in backticks are not read.  Exit code 1 if anything is found.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from proselint.checks import __register__ as CHECKS
from proselint.config import DEFAULT
from proselint.registry import CheckRegistry
from proselint.tools import LintFile

ROOT = Path(__file__).resolve().parents[1]
#: a pattern of words, and what to write instead
WORDS = {
    r"rivals?": "competitor, or baseline",
    r"behind": "after",
    r"e\.g\.|i\.e\.": "for example, that is",
    r"in order to": "to",
    r"utili[sz]\w+|leverag\w+": "use",
    r"whilst|hence|thereof|wherein|thereby|aforementioned": "a usual word",
    r"obviously|of course|needless to say": "nothing",
    r"is not told|fewer do": "who does what to what",
    r"linear scheme": "schedule model",
    r"linear model of the gain": "schedule model",
    r"the course of": "the path of",
}
#: checks of proselint that know nothing of this field: its symbols, quantities, and plain quotation marks
LEFT_OUT = (
    "typography", "lexical_illusions", "weasel_words", "redundancy.misc.after_the_deadline", "spelling",
    "misc.phrasal_adjectives",
)  # fmt: skip
_BLOCK = re.compile(r"( *)(?:\.\. (?!\[\d)|(?!\.\. ).*::$|.*>>>)")
_NAMES = re.compile(r"``.*?``|(?<!`)`[^`]+`_*|:\w+:`[^`]*`|\]\(.*?\)|https?://\S+")


def pages() -> list[Path]:
    """Files that are read."""
    made = {"generated", "auto_examples", "_build"}
    found = [*ROOT.glob("*.md"), *(p for p in (ROOT / "docs").rglob("*.rst") if not made & {*p.parts})]
    return sorted(found)


def prose(text: str, rst: bool) -> str:
    """The text with everything that is no prose blanked, so that lines keep their numbers."""
    lines, inside, fenced = [], None, False
    for line in text.splitlines():
        fenced ^= line.startswith("```")
        indent = len(line) - len(line.lstrip())
        if inside is not None and line.strip() and indent <= inside:
            inside = None
        if inside is None and rst and (block := _BLOCK.match(line)):
            inside = len(block[1])
            line = "" if line.lstrip().startswith("..") else line
        elif inside is not None or fenced or line.startswith(("|", "```", "====", "----", "~~~~")):
            line = ""
        lines.append(line)
    return _NAMES.sub(lambda name: "\n" * name[0].count("\n") or "name", "\n".join(lines))


def findings(path: Path) -> Iterator[str]:
    """Findings in a file, each with its line."""
    text = prose(path.read_text(encoding="utf-8"), path.suffix == ".rst")
    name = path.relative_to(ROOT)
    for pattern, instead in WORDS.items():
        for found in re.finditer(rf"(?<![\w\"-])(?:{pattern})(?![\w-])", text, re.IGNORECASE):
            yield f"{name}:{text.count(chr(10), 0, found.start()) + 1}: {found[0]!r}: write {instead}"
    for result in LintFile(str(name), text).lint(DEFAULT):
        if not result.check_result.check_path.startswith(LEFT_OUT):
            line, _ = result.pos
            yield f"{name}:{line}: {result.check_result.check_path}: {result.check_result.message}"


def main() -> int:
    CheckRegistry().register_many(CHECKS)
    found = [line for path in pages() for line in findings(path)]
    print("\n".join(found) or "nothing found")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
