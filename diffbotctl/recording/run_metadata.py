"""Checks the metadata of a recording: texts, some of which are numbers or JSON.

A recording may come from anywhere, so each value is checked where it is read, and the rest of the
program may rely on it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

LIVE = "live"  # key that marks the recording of a running engine, which cannot be replayed
TEXT_MAX_LENGTH = 1000  # characters of a name
INTEGER_MAX = 1 << 63
NESTING_ERRORS = (ValueError, RecursionError)  # of json.loads


def check_run(values: Mapping[str, str]) -> None:
    """Check the metadata of a run. Raises ValueError with the name of the wrong value."""
    _require(values, "epoch", _is_integer, "nanoseconds since 1970")
    for name, is_valid, kind in (
        ("files", _is_json(_are_files), "the texts of the files"),
        ("pipeline", _is_name, "a short text"),
        ("robot", _is_name, "a short text"),
        ("port", _is_port, "a short text"),
        ("sets", _is_json(_are_texts), "a list of texts"),
        ("version", _is_name, "a short text"),
        ("seed", _is_integer, "a whole number"),
        ("goals", _is_json(_are_goals), "a list of goals"),
        ("duration", _is_json(_is_duration), "a time in s, or null"),
        ("state_problem", _is_name, "a short text"),
        ("flight", lambda text: text in ("run", "state", "unknown"), "run, state or unknown"),
    ):
        if name in values:
            _require(values, name, is_valid, kind)


def check_replayable(values: Mapping[str, str]) -> None:
    """Check that the metadata, which `check_run` accepts, hold all that a replay needs.

    Raises ValueError as `check_run`.
    """
    for name in ("files", "sets", "port"):
        _require(values, name, bool, "in the file")
    files = json.loads(values["files"])
    _require(values, "pipeline", files.__contains__, "one of the files")
    _require(values, "robot", lambda text: not text or text in files, "one of the files")
    if "code" in values:
        _require(values, "code", _is_json(_is_table_of_texts), "a table of texts")
    if "robots" in values:
        _require(values, "robots", _is_json(_is_table_of(files)), "a table of some of the files")


def check_end(values: Mapping[str, str]) -> None:
    """Check the metadata of the end of a run. Raises ValueError as `check_run`."""
    _require(values, "last", _is_integer, "nanoseconds")
    if values.get("truth"):
        _require(values, "truth", _is_json(_is_pose), "a list of numbers")


def _is_table_of(files: Mapping[str, str]) -> Callable[[Any], bool]:
    def is_table(table: Any) -> bool:
        return isinstance(table, dict) and all(
            isinstance(file, str) and file in files for file in table.values()
        )

    return is_table


def _require(
    values: Mapping[str, str], name: str, is_valid: Callable[[str], bool], kind: str
) -> None:
    if not is_valid(values.get(name, "")):
        raise ValueError(f"'{name}' is not {kind}")


def _is_integer(text: str) -> bool:
    digits = text.removeprefix("-")
    return digits.isascii() and digits.isdigit() and len(digits) < 20 and int(digits) < INTEGER_MAX


def _is_name(text: str) -> bool:
    return len(text) <= TEXT_MAX_LENGTH and "\0" not in text


def _is_port(text: str) -> bool:
    return bool(text) and _is_name(text)


def _is_json(is_valid: Callable[[Any], bool]) -> Callable[[str], bool]:
    def is_valid_text(text: str) -> bool:
        try:
            return is_valid(json.loads(text))
        except NESTING_ERRORS:
            return False

    return is_valid_text


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, str) for item in value)


def _is_table_of_texts(value: Any) -> bool:
    return isinstance(value, dict) and _are_texts(list(value.values()))


def _are_files(value: Any) -> bool:
    if not isinstance(value, dict):
        return False
    names = [name.rpartition("/")[2] for name in value]
    # The name of a file is used for a copy in a temporary folder.
    return all(names) and _are_texts(list(value.values())) and not {".", ".."} & set(names)


def _are_goals(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(goal, list)
        and len(goal) == 5
        and all(_is_number(item) for item in goal[:4])
        and (goal[4] is None or _is_number(goal[4]))
        for goal in value
    )


def _is_duration(value: Any) -> bool:
    return value is None or (_is_number(value) and value > 0)


def _is_pose(value: Any) -> bool:
    return isinstance(value, list) and len(value) >= 2 and all(map(_is_number, value))


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and isfinite(value) and abs(value) < INTEGER_MAX
