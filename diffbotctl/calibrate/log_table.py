"""Numbers in the CSV files of recorded drives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path

import numpy as np

from diffbotctl.calibrate.csv_table import (
    CSV_ENCODING,
    CsvTable,
    content_lines,
    error_text,
    open_table,
    unusable_log,
)
from diffbotctl.calibrate.dead_reckoning import Floats


def read_columns(path: Path, names: Sequence[str]) -> Floats:
    """(rows, names): nan for an empty cell. Raises UsageError."""
    table = open_table(path, names)
    columns = [table.column(name) for name in names]
    lines = _plain_lines(table)
    first = next(lines, None)
    if first is None:
        return np.empty((0, len(names)))
    with suppress(ValueError):  # an empty cell, a quoted one, or text: read below
        numbers = np.loadtxt(
            chain([first], lines), delimiter=table.separator, usecols=columns, ndmin=2
        )
        return np.asarray(numbers.reshape(-1, len(names)))
    numbers = np.fromiter(_cells(table, names), float)
    return np.asarray(numbers.reshape(-1, len(names)))


def _plain_lines(table: CsvTable) -> Iterator[str]:
    for _, line in table.lines():
        yield line.replace(",", ".") if table.has_decimal_commas else line


def _cells(table: CsvTable, names: Sequence[str]) -> Iterator[float]:
    """The numbers in the columns `names`, row by row."""
    columns = [(name, table.column(name)) for name in names]
    for line, cells in table.rows():
        for name, column in columns:
            yield table.number(line, name, cells[column])


def read_table(path: Path) -> Floats:
    """(rows, columns): the numbers of a file without a first line of names. Raises UsageError."""
    lines = (line for _, line in content_lines(path))
    first = next(lines, None)
    if first is None:
        raise unusable_log(path, "cannot be read: the file is empty")
    try:
        table = np.loadtxt(chain([first], lines), delimiter=",", encoding=CSV_ENCODING, ndmin=2)
    except ValueError as error:
        raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
    return np.asarray(table)
