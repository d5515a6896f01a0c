"""Numbers in the cells of a log: decimal signs, on and off, and the words and columns that tell of an error."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from .setpoint_modes import COOLS, HEATS, action_name, code_of, kind_of_words
from .unit_names import unit_named

_ON = "on true open yes active running ein wahr offen ja aan marche vrai oui vero sí si verdadero tak heating "
_ON += "acceso encendido ligado zapnuto på päällä kyllä"
_OFF = "off false closed close no inactive stopped aus falsch zu nein uit nee arrêt faux non falso nie idle "
_OFF += "spento apagado desligado vypnuto av pois ei"
_SWITCHES = dict.fromkeys(_ON.split(), 1.0) | dict.fromkeys(_OFF.split(), 0.0)
_ERRORS = re.compile(
    r"\W*|comm\w*\W(fail|fault|err|lost|loss).*|"
    r"#?n/?a!?|nan|null|none|nil|err(or)?\b.*|bad\b.*|no ?(data|value|reading)|fault\b.*|fail(ed|ure)?\b.*|"
    r"invalid\b.*|missing|offline|unknown|unavailable|not available|stale|disconnected|down|disabled|over(flow|range)?|"
    r"under(flow|range)?|(open|short) circuit|i/o timeout|time ?out|uncertain|undef(ined)?|#[a-z0-9/]+[!?]?|"
    r"[-+]?inf(inity)?",
    re.IGNORECASE,
)
_BETWEEN = re.compile(r"(?<=\d)[ \u00a0\u202f'’](?=\d{3}(?:\D|\Z))")  # thousands by space or apostrophe
_GROUPED_DOT = re.compile(r"[-+]?\d{1,3}(\.\d{3})+,\d+|[-+]?\d{1,3}(\.\d{3}){2,}")
_GROUPED_COMMA = re.compile(r"[-+]?\d{1,3}(,\d{3})+\.\d+|[-+]?\d{1,3}(,\d{3}){2,}")
_ONE_COMMA = re.compile(r"[-+]?\d*,(\d+)([eE][-+]?\d+)?")
_THOUSANDS = re.compile(r"[-+]?\d{1,3},\d{3}")  # or a decimal comma with three decimals
_ONE_DOT = re.compile(r"[-+]?\d{1,3}\.\d{3}")
_NEGATIVE = re.compile(r"\A(?:\(([.,\d]*\d)\)|([.,\d]*\d)-)\Z")  # (4.1) and 4.1- of accounts
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_WITH_UNIT = re.compile(r"([-+.,\d]*\d)\s*([^\d\s.,].*)")
_WITH_STATUS = re.compile(r"(.+?)\s*[{\[(]\s*([\w ,]+?)\s*[)\]}]")  # 20.5 °C {ok}
_GOOD = re.compile(r"(?:(?:ok|good|valid|normal|overridden|alarm|unackedalarm)\W*)+", re.IGNORECASE)
_QUALITY = re.compile(r"qualit|validity|\bflag\b|\bstatus(?:[ .]\(?\d+\)?)?\Z", re.IGNORECASE)
_MOST_WORDS, _FURTHER = 1000, "..."  # different words of a column that are counted each, and what counts the others
_GOOD_CODE, _OFTEN = 192.0, 0.5  # by OPC, and above; share of the rows that shows it


def _is_error(text: str) -> bool:
    """Whether a cell is a word that loggers write for an error."""
    return re.search(r"\w", text) is not None and _ERRORS.fullmatch(text.strip()) is not None


def decimal_sign(cells: list[str], sep: str) -> str:
    """The decimal sign of the numbers in a sample of cells of a file with the separator ``sep``."""
    cells = list(map(_without_status, cells))
    cells = [apart[1] if (apart := _WITH_UNIT.fullmatch(cell)) and unit_named(apart[2]) else cell for cell in cells]
    commas = [found for cell in cells if (found := _ONE_COMMA.fullmatch(cell)) or _GROUPED_DOT.fullmatch(cell)]
    # 1,234 in quotes is a thousand in a file with commas between cells, and a decimal in one with semicolons
    sure = [found for found in commas if sep != "," or found is None or len(found[1]) != 3]
    points = [cell for cell in cells if re.fullmatch(r"[-+]?\d*\.\d+", cell) and not _ONE_DOT.fullmatch(cell)]
    return "," if len(sure) > len(points) else "."


def _without_status(text: str) -> str:
    """A cell without a word in brackets after it that says that its value is good, or a sign of degrees alone."""
    found = _WITH_STATUS.fullmatch(text)
    return (found[1] if found and _GOOD.fullmatch(found[2]) else text).removesuffix("°")


def number_in(text: str, decimal: str = ".") -> float | None:
    """The number that a cell spells with any sign for decimals and thousands; None for a word."""
    text = _NEGATIVE.sub(r"-\1\2", _BETWEEN.sub("", text.strip()).replace("−", "-"))
    if _GROUPED_DOT.fullmatch(text) or (decimal == "," and _ONE_DOT.fullmatch(text)):
        text = text.replace(".", "").replace(",", ".")
    elif _GROUPED_COMMA.fullmatch(text):
        text = text.replace(",", "")
    elif found := _ONE_COMMA.fullmatch(text):
        text = text.replace(",", "." if decimal == "," or len(found[1]) != 3 else "")
    return float(text) if _NUMBER.fullmatch(text) else None


@dataclass
class NumberColumn:
    """The cells of one column, read piece by piece."""

    numbers: np.ndarray = field(default_factory=lambda: np.empty(0))
    n_cells: int = 0
    n_numbers: int = 0
    n_switches: int = 0
    switch: str = ""  # a word that was read as 1 or 0
    words: Counter[str] = field(default_factory=Counter)
    units: Counter[str] = field(default_factory=Counter)
    thousands: str = ""  # a cell such as 1,234 that was read as more than a thousand
    said: set[str] = field(default_factory=set)  # words that are no errors, as far as they are few
    modes: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)  # rows with words of modes, and which
    is_mode: bool = False

    def add(self, cells: pd.Series, decimal: str) -> None:
        """Read the cells of the next piece."""
        if cells.dtype.kind in "iuf":  # not "b": pandas reads True and False, which are switches
            values = cells.to_numpy(dtype=np.float64, na_value=np.nan)
        else:
            values = self._from_text(cells, decimal)
        wild = np.isinf(values)
        if wild.any():
            self.words["inf"] += int(wild.sum())
            values = np.where(wild, np.nan, values)
        self.n_numbers += int(np.isfinite(values).sum())
        end = self.n_cells + len(values)
        if end > len(self.numbers):  # one block that grows, since many small ones leave holes in the memory
            self.numbers.resize(max(end, len(self.numbers) * 3 // 2), refcheck=False)
        self.numbers[self.n_cells : end] = values
        self.n_cells = end

    def values(self) -> np.ndarray:
        """All numbers that were read, float64, NaN where a cell has none."""
        return self.numbers[: self.n_cells]

    @property
    def usual_word(self) -> tuple[str, int]:
        """The most frequent word that is not a number, and the number of cells that hold words."""
        usual = (word for word, _ in self.words.most_common(2) if word != _FURTHER)
        return next(usual, ""), self.words.total()

    @property
    def tells_plant(self) -> bool:
        """Whether a column of words seems to say when a plant heats and cools."""
        return any(word.lower() in ("heating", "cooling", "heat", "cool") for word in (self.switch, *self.words))

    @property
    def is_text(self) -> bool:
        """Whether the words have a meaning of their own, so that this is not a channel of numbers."""
        meant = sum(n for word, n in self.words.items() if not _ERRORS.fullmatch(word))
        # "off" beside "heat" is a mode, not a switch
        return meant > self.n_numbers or (meant > 0 and self.n_switches > 0)

    def channels(self, name: str) -> dict[str, NumberColumn]:
        """A column of words as that of a mode, or as two of heating and cooling; empty for any other."""
        kind = None if self.n_numbers > self.n_switches else kind_of_words(name, self.said)
        if kind is None:
            return {}
        codes = np.full(self.n_cells, np.nan)
        for rows, told in self.modes:
            codes[rows] = told
        if kind == "mode":
            return {name: NumberColumn(codes, self.n_cells, self.n_cells, is_mode=True)}
        sides = {"heating": HEATS, "cooling": COOLS}
        on = {side: np.where(np.isnan(codes), np.nan, codes == code) for side, code in sides.items()}
        return {
            action_name(name, side): NumberColumn(values, self.n_cells, self.n_cells) for side, values in on.items()
        }

    def _from_text(self, cells: pd.Series, decimal: str) -> np.ndarray:
        known = cells.notna().to_numpy()
        text = cells.astype(str).str.strip()
        plain = known & ~text.str.contains(".", regex=False).to_numpy(dtype=bool) if decimal == "," else known
        values = np.full(len(cells), np.nan)
        values[plain] = pd.to_numeric(text[plain], errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
        left = known & np.isnan(values) & (text != "").to_numpy(dtype=bool)
        if not left.any():
            return values
        codes, uniques = pd.factorize(text[left])
        counts = np.bincount(codes, minlength=len(uniques))
        of_uniques = [self._one(word, int(n), decimal) for word, n in zip(uniques, counts, strict=True)]
        values[left] = np.array(of_uniques)[codes]
        told = np.array([code_of(word) for word in uniques], dtype=np.float64)[codes]
        if (of_mode := np.isfinite(told)).any():
            self.modes.append((self.n_cells + np.flatnonzero(left)[of_mode], told[of_mode]))
        return values

    def _one(self, word: str, n: int, decimal: str) -> float:
        """The value of a cell that is not a plain number, ``n`` of which were found."""
        if (switch := _SWITCHES.get(word.lower())) is not None:
            self.n_switches, self.switch = self.n_switches + n, word
            self.said.add(word)
            return switch
        number = number_in(word, decimal)
        if number is not None:
            if decimal == "." and _THOUSANDS.fullmatch(word):
                self.thousands = word
            return number
        apart = _WITH_UNIT.fullmatch(word)
        if apart and unit_named(apart[2]) and (number := number_in(apart[1], decimal)) is not None:
            self.units[apart[2]] += n
            return number
        if (value := _without_status(word)) != word:
            return self._one(value, n, decimal)
        self.words[word if word in self.words or len(self.words) < _MOST_WORDS else _FURTHER] += n
        if not _ERRORS.fullmatch(word) and len(self.said) < 100:
            self.said.add(word)
        return np.nan


def quality_columns(names: Iterable[Hashable]) -> list[str]:
    """The columns that have the usual name of one of quality."""
    return [str(name) for name in names if _QUALITY.search(str(name))]


def columns_judged(names: Iterable[Hashable]) -> dict[str, str]:
    """The column that each one of quality judges: the last other one before it.

    Its name says so, or several have one right after them; a further one that begins with no name of a column counts
    where all have as many.
    """
    ordered = list(map(str, names))
    found, after, judged = set(quality_columns(ordered)), dict[str, list[str]](), ""
    for name in ordered:
        if name not in found:
            judged = name
        elif judged:
            after.setdefault(judged, []).append(name)
    several = len(after) > 1
    alike = several and len(set(map(len, after.values()))) == 1
    return {
        name: of
        for of, own in after.items()
        for k, name in enumerate(own)
        if name.startswith(of) or (several and k == 0) or (alike and _QUALITY.match(name))
    }


def without_bad(piece: pd.DataFrame, judged: Mapping[str, str]) -> pd.DataFrame:
    """The rows of a table with the word for a bad quality in place of each value that has one."""
    out: dict[str, pd.Series] = {}
    for name, of in judged.items():
        words, numbers = piece[name].astype(str), pd.to_numeric(piece[name], errors="coerce")
        by_number = bool((numbers == _GOOD_CODE).mean() > _OFTEN)
        bad = numbers < _GOOD_CODE if by_number else piece[name].notna() & words.map(_is_error)
        if bad.any():
            out[of] = out.get(of, piece[of]).astype(object).where(~bad, "bad" if by_number else words)
    return piece.assign(**out)
