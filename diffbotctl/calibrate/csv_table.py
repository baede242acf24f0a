"""CSV files as people and spreadsheets write them: their first line names the columns.

Columns are separated by commas, semicolons or tabs. Names may be quoted and in any case. With
semicolons and tabs a comma is a decimal comma; between commas it would be ambiguous. Lines that
are empty or begin with # are no rows.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import TextIOWrapper
from math import nan
from pathlib import Path

from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, UsageError, join_words

LINE_MAX_CHARACTERS = 1 << 16  # parsers need twenty times the length of a line
CSV_ENCODING = "utf-8-sig"  # spreadsheets write a byte-order mark
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
COMMENT = "#"
NAMES_QUOTED_MAX = 8
QUOTED_MAX_CHARACTERS = 30
MINUS_SIGN = "\N{MINUS SIGN}"
NOTED_SEPARATOR = re.compile(r'"?sep=(.)"?\s*', re.IGNORECASE)  # a line of Excel
GROUPED = re.compile(r"[+-]?\d{1,3}([,.' \u00a0\u202f]\d{3})+([,.]\d+)?")
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+")
NUMBER_AND_UNIT = re.compile(r"[+-]?\d+([.,]\d+)?\s*([^\W\d_]+|\N{DEGREE SIGN})")


def unusable_log(path: Path, cause: str, fix: str = "") -> UsageError:
    """The error for an unusable file."""
    described = "`diffbotctl explain E-CALIBRATE-LOG` describes the files"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix or described))


def error_text(error: Exception) -> str:
    """Why a file cannot be read, without Python's number of the error."""
    return getattr(error, "strerror", None) or str(error)


@dataclass(frozen=True, slots=True)
class CsvTable:
    """The layout of a file, and its rows."""

    path: Path
    separator: str
    names: tuple[str, ...]
    """of the columns, in lower case"""

    @property
    def has_decimal_commas(self) -> bool:
        """Whether a comma in a number is a decimal comma."""
        return self.separator != ","

    def column(self, name: str) -> int:
        """Number of the column called `name`, from 0."""
        return self.names.index(name)

    def lines(self) -> Iterator[tuple[int, str]]:
        """The numbers and texts of the lines with cells, after the first one. Raises UsageError."""
        rows = content_lines(self.path)
        for _, line in rows:
            if not NOTED_SEPARATOR.fullmatch(line):
                break
        for number, line in rows:
            self._refuse_odd_line(number, line)
            if line.strip(self.separator + ' "'):
                yield number, line

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The numbers of the lines, and their cells; at least as many as there are names."""
        for number, line in self.lines():
            cells = split_line(self.path, line, self.separator)
            if any(cells[len(self.names) :]):
                raise self._more_cells(number)
            yield number, cells + [""] * (len(self.names) - len(cells))

    def number(self, line: int, name: str, text: str) -> float:
        """The number in a cell; nan for an empty one. Raises UsageError."""
        cleaned = text.partition(COMMENT)[0].strip().replace(MINUS_SIGN, "-")
        if self.has_decimal_commas:
            cleaned = cleaned.replace(",", ".")
        if not cleaned:
            return nan
        with suppress(ValueError):
            if "_" not in cleaned:
                return float(cleaned)
        if cleaned.casefold() == name:
            cause = f"line {line} names the columns again: does the file contain two drives?"
            raise unusable_log(self.path, cause, "write each drive into a file of its own")
        quoted = _shortened(text.strip())
        cause = f"line {line}, column {name}: '{quoted}' is not a number"
        raise unusable_log(self.path, cause, _number_fix(text.strip(), name))

    def _refuse_odd_line(self, number: int, line: str) -> None:
        """Raises UsageError for a line with more cells than names, or with other separators."""
        count = line.count(self.separator)
        if '"' in line:
            return
        if count >= len(self.names) and any(
            cell.strip() for cell in line.split(self.separator)[len(self.names) :]
        ):
            raise self._more_cells(number)
        others = [other for other in SEPARATORS if other != self.separator and other in line]
        if not count and len(self.names) > 1 and others:
            own, other = SEPARATORS[self.separator], SEPARATORS[others[-1]]
            cause = f"the first line separates its cells by {own}, line {number} by {other}"
            raise unusable_log(self.path, cause, "use one separator in all lines")

    def _more_cells(self, number: int) -> UsageError:
        cause = (
            f"line {number} has more cells than the first line names: a decimal comma, or commas "
            "between thousands?"
        )
        fix = "write decimal points, or separate the cells by semicolons"
        return unusable_log(self.path, cause, fix)


def open_table(path: Path, names: Sequence[str]) -> CsvTable:
    """The layout of the file at `path`. Raises UsageError if its first line lacks one of `names`,
    or names one twice.
    """
    separators = list(SEPARATORS)
    header = ""
    for _, line in content_lines(path):
        noted = NOTED_SEPARATOR.fullmatch(line)
        if noted is None:
            header = line
            break
        separators = [noted[1]] if noted[1] in SEPARATORS else separators

    def split(separator: str) -> list[str]:
        cells = split_line(path, header, separator)
        return [cell.strip().casefold() for cell in cells]

    # Where no separator gives the names, that which gives most cells is meant.
    best = max(separators, key=lambda each: (_named(split(each), names), len(split(each))))
    found = split(best)
    missing = [name for name in names if name not in found]
    if missing:
        raise _unnamed(path, split_line(path, header, best), names, missing)
    for name in names:
        if found.count(name) > 1:
            fix = "rename or remove the column that is not meant"
            raise unusable_log(path, f"its first line names {name} twice", fix)
    return CsvTable(path, best, tuple(found))


def column_names(path: Path) -> frozenset[str]:
    """The names in the first line, in lower case. Raises UsageError if it cannot be read."""
    return frozenset(open_table(path, ()).names)


def content_lines(path: Path) -> Iterator[tuple[int, str]]:
    """The numbers and texts of the lines that are neither empty nor comments. Raises UsageError."""
    try:
        with TextIOWrapper(open_regular(path), CSV_ENCODING) as file:
            number = 0
            while line := file.readline(LINE_MAX_CHARACTERS):
                number += 1
                if len(line) == LINE_MAX_CHARACTERS:
                    cause = f"line {number} has more than {LINE_MAX_CHARACTERS} characters"
                    raise unusable_log(path, cause)
                if "\0" in line:
                    cause = f"line {number} contains zero bytes: was the power lost while writing?"
                    raise unusable_log(path, cause, "remove this line and those after it")
                if line.strip() and not line.lstrip().startswith(COMMENT):
                    yield number, line.rstrip("\n")
    except UnicodeDecodeError as error:
        fix = "save it as UTF-8 text, with commas, semicolons or tabs between the cells"
        raise unusable_log(path, "cannot be read: this is not UTF-8 text", fix) from error
    except OSError as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error


def split_line(path: Path, line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and spaces around them. Raises UsageError."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except csv.Error as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
    return [cell.strip() for cell in row]


def _named(cells: Sequence[str], names: Sequence[str]) -> int:
    return sum(name in cells for name in names)


def _unnamed(
    path: Path, cells: Sequence[str], names: Sequence[str], missing: Sequence[str]
) -> UsageError:
    """The error for a first line that lacks some of `names`."""
    cause = f"its first line does not name {join_words(missing, 'and')}"
    fix = f"name the columns {join_words(names, 'and')} in the first line"
    found = [_shortened(cell) for cell in cells if cell]
    if not found:
        return unusable_log(path, f"is empty: {cause}", fix)
    if all(_is_number(cell) for cell in found):
        return unusable_log(path, f"{cause}, but holds numbers", fix)
    if len(found) == 1 and _named(found[0].casefold().split(), names):
        return unusable_log(path, cause, "separate the cells by commas, semicolons or tabs")
    quoted = [f"'{name}'" for name in found[:NAMES_QUOTED_MAX]]
    if len(found) > NAMES_QUOTED_MAX:
        quoted.append("others")
    return unusable_log(path, f"{cause}, but {join_words(quoted, 'and')}", fix)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _shortened(text: str) -> str:
    return text if len(text) <= QUOTED_MAX_CHARACTERS else f"{text[:QUOTED_MAX_CHARACTERS]}..."


def _number_fix(text: str, name: str) -> str:
    """How to write a cell that is no number; empty if that is not obvious."""
    if name == "time" and ":" in text:
        return "write times in seconds since the start of the drive"
    if GROUPED.fullmatch(text):
        return "write decimal points, and nothing between thousands"
    if DECIMAL_COMMA.fullmatch(text):
        return "write decimal points, or separate the cells by semicolons"
    if NUMBER_AND_UNIT.fullmatch(text):
        return "write the number without its unit"
    return ""
