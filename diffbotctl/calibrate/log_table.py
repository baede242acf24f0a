"""Tables of numbers in CSV files whose first line names the columns."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from math import nan
from pathlib import Path

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, UsageError, join_words

LINE_MAX_BYTES = 1 << 16  # parsers need twenty times the length of a line
CSV_ENCODING = "utf-8-sig"  # spreadsheets write a byte-order mark


def unusable_log(path: Path, cause: str) -> UsageError:
    """The error for an unusable file."""
    fix = "`diffbotctl explain E-CALIBRATE-LOG` describes the files"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix))


def error_text(error: Exception) -> str:
    """Why a file cannot be read, without Python's number of the error."""
    return getattr(error, "strerror", None) or str(error)


def read_columns(path: Path, names: Sequence[str]) -> Floats:
    """(rows, names): nan for an empty cell. Raises UsageError."""
    columns = _find_columns(path, names)
    _refuse_odd_lines(path)
    with suppress(ValueError):  # an empty cell, or text: read below
        table = np.loadtxt(
            path, delimiter=",", skiprows=1, usecols=columns, ndmin=2, encoding=CSV_ENCODING
        )
        return np.asarray(table.reshape(-1, len(names)))
    table = np.fromiter(_cells(path, columns), float)
    return np.asarray(table.reshape(-1, len(names)))


def _refuse_odd_lines(path: Path) -> None:
    """Raises UsageError for a line that is too long, or has more cells than the first one."""
    cells = None
    with open_regular(path) as file:
        for number, line in enumerate(iter(partial(file.readline, LINE_MAX_BYTES), b""), 1):
            if len(line) == LINE_MAX_BYTES:
                raise unusable_log(path, f"a line has more than {LINE_MAX_BYTES} characters")
            count = line.count(b",")
            if cells is None:
                cells = count
            if count > cells and b'"' not in line:
                raise _more_cells(path, number)


def _more_cells(path: Path, number: int) -> UsageError:
    cause = (
        f"line {number} has more cells than the first line names: a decimal comma, or commas "
        "between thousands?"
    )
    return unusable_log(path, cause)


def _cells(path: Path, columns: Sequence[int]) -> Iterator[float]:
    """The numbers in `columns`, row by row."""
    try:
        with path.open(encoding=CSV_ENCODING, newline="") as file:
            rows = csv.reader(file)
            next(rows, None)
            for row in rows:
                if row:
                    for column in columns:
                        yield parse_number(path, row[column] if column < len(row) else "")
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error


def has_columns(path: Path, names: Sequence[str]) -> bool:
    """Whether the first line names all of them."""
    header = _read_header(path)
    return all(name in header for name in names)


def read_rows(path: Path, names: Sequence[str]) -> list[dict[str, str]]:
    """The rows of a CSV file by column name. Raises UsageError if one of `names` is missing."""
    _find_columns(path, names)
    try:
        reader = csv.DictReader(path.read_text(CSV_ENCODING).splitlines(), restval="")
    except (OSError, UnicodeDecodeError) as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
    reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
    rows = list(reader)
    for number, row in enumerate(rows, 2):
        if any(row.pop(None, ())):  # cells beyond the header
            raise _more_cells(path, number)
    return rows


def read_table(path: Path) -> Floats:
    """(rows, columns): the numbers of a file without a first line of names. Raises UsageError."""
    try:
        _refuse_odd_lines(path)
        table = np.loadtxt(path, delimiter=",", encoding=CSV_ENCODING, ndmin=2)
    except (OSError, ValueError) as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
    return np.asarray(table)


def parse_number(path: Path, text: str | None) -> float:
    """The number in a cell; nan for an empty one."""
    try:
        return float(text) if text and text.strip() else nan
    except ValueError:
        raise unusable_log(path, f"'{text}' is not a number") from None


def _find_columns(path: Path, names: Sequence[str]) -> list[int]:
    header = _read_header(path)
    missing = [name for name in names if name not in header]
    if missing:
        raise unusable_log(path, f"its first line does not name {join_words(missing, 'and')}")
    return [header.index(name) for name in names]


def _read_header(path: Path) -> list[str]:
    try:
        with open_regular(path) as file:
            line = file.readline(LINE_MAX_BYTES).decode(CSV_ENCODING)
            return [name.strip() for name in line.strip("\r\n").split(",")]
    except (OSError, UnicodeDecodeError) as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
