"""CSV files of recorded drives: their first line names the columns.

Commas, semicolons or tabs separate the cells. With semicolons and tabs a comma is a decimal comma;
between commas it would be ambiguous. Lines that are empty or begin with # are no rows.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from io import TextIOWrapper
from math import nan
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, UsageError, join_words

LINE_MAX_CHARACTERS = 1 << 16  # parsers need twenty times the length of a line
CSV_ENCODING = "utf-8-sig"  # spreadsheets write a byte-order mark
SEPARATORS = (",", ";", "\t")
COMMENT = "#"
QUOTED_MAX_CHARACTERS = 30


def unusable_log(path: Path, cause: str, fix: str = "") -> UsageError:
    described = "`diffbotctl explain E-CALIBRATE-LOG` describes the files"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix or described))


def error_text(error: Exception) -> str:
    """Why a file cannot be read, without Python's number of the error."""
    return getattr(error, "strerror", None) or str(error)


class CsvTable(NamedTuple):
    """The layout of a file, and its rows."""

    path: Path
    separator: str
    names: tuple[str, ...]  # of the columns, in lower case

    def column(self, name: str) -> int:
        """Number of the column called `name`, from 0."""
        return self.names.index(name)

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The numbers of the lines, and their cells, as many as there are names. Raises
        UsageError."""
        lines = content_lines(self.path)
        next(lines)
        for number, line in lines:
            cells = split_line(self.path, line, self.separator)
            if any(cells[len(self.names) :]):
                cause = (
                    f"line {number} has more cells than the first line names: a decimal comma, or "
                    "commas between thousands?"
                )
                fix = "write decimal points, or separate the cells by semicolons"
                raise unusable_log(self.path, cause, fix)
            if any(cells):
                yield number, (cells + [""] * len(self.names))[: len(self.names)]

    def number(self, line: int, name: str, text: str) -> float:
        """The number in a cell; nan for an empty one. Raises UsageError."""
        if not text:
            return nan
        try:
            if "_" in text:  # which Python reads as a mark between digits
                raise ValueError
            return float(text if self.separator == "," else text.replace(",", "."))
        except ValueError:
            shown = text if len(text) <= QUOTED_MAX_CHARACTERS else text[:QUOTED_MAX_CHARACTERS]
            cause = f"line {line}, column {name}: '{shown}' is not a number"
            fix = "write decimal points, no unit, and nothing between thousands; times in seconds"
            raise unusable_log(self.path, cause, fix) from None


def open_table(path: Path, names: Sequence[str]) -> CsvTable:
    """The layout of the file at `path`. Raises UsageError if its first line lacks one of `names`,
    or names one twice."""
    _, header = next(content_lines(path), (0, ""))
    separator = max(SEPARATORS, key=header.count)
    found = tuple(cell.casefold() for cell in split_line(path, header, separator))
    missing = [name for name in names if name not in found]
    if missing:
        fix = f"name the columns {join_words(names, 'and')}, separated by commas, semicolons or"
        cause = f"its first line does not name {join_words(missing, 'and')}"
        raise unusable_log(path, cause, f"{fix} tabs")
    for name in names:
        if found.count(name) > 1:
            fix = "rename or remove the column that is not meant"
            raise unusable_log(path, f"its first line names {name} twice", fix)
    return CsvTable(path, separator, found)


def read_columns(path: Path, names: Sequence[str]) -> Floats:
    """(rows, names): nan for an empty cell. Raises UsageError."""
    table = open_table(path, names)
    columns = [(name, table.column(name)) for name in names]
    numbers = (
        table.number(line, name, cells[column])
        for line, cells in table.rows()
        for name, column in columns
    )
    return np.fromiter(numbers, float).reshape(-1, len(names))


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
                if line.strip() and not line.lstrip().startswith(COMMENT):
                    yield number, line.rstrip("\n")
    except UnicodeDecodeError as error:
        fix = "save it as UTF-8 text, with commas, semicolons or tabs between the cells"
        raise unusable_log(path, "cannot be read: this is not UTF-8 text", fix) from error
    except OSError as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error


def split_line(path: Path, line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and spaces around them. Raises UsageError."""
    try:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
    return [cell.strip() for cell in row]
