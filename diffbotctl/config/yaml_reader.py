"""The text of a configuration file, or why it has none: told before anything is parsed.

A YAML file as a tree of values that know where they stand.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from typing import Any

from diffbotctl.config import yaml_syntax
from diffbotctl.config.yaml_tree import TreeBuilder, UnreadableError, Value, too_deep
from diffbotctl.errors import ConfigurationError, Place, Problem, Source

LARGEST = 256 * 1024  # bytes; the longest shipped file has 4 kB


def read_text(path: str, name: str) -> str:
    """The text of the file at `path`, called `name` in messages. Raises ConfigurationError."""
    try:
        status = os.stat(path)
    except (OSError, ValueError) as error:  # ValueError: no file can have such a name
        raise _unreadable(name, error) from None
    if stat.S_ISDIR(status.st_mode):
        raise ConfigurationError(
            Problem("E-FILE-READ", name, "this is a directory, not a file", "name a file in it")
        )
    if not stat.S_ISREG(status.st_mode):
        raise ConfigurationError(
            Problem("E-FILE-READ", name, "this is a device or a pipe, not a file", "name a file")
        )
    if status.st_size > LARGEST:
        raise ConfigurationError(_too_large(name, status.st_size))
    try:
        with open(path, "rb") as file:
            raw = file.read(LARGEST + 1)
    except OSError as error:
        raise _unreadable(name, error) from None
    return _decoded(raw, name)


def _decoded(raw: bytes, name: str) -> str:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in raw:
        what = "UTF-16 text" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "not a text file"
        raise ConfigurationError(
            Problem("E-FILE-ENCODING", name, f"this is {what}", "save it as UTF-8 text")
        )
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = raw[: error.start].decode("utf-8", "replace")
        line, column = text.count("\n") + 1, error.start - raw.rfind(b"\n", 0, error.start)
        source = Source(name, raw.decode("utf-8", "replace"))
        cause = f"byte 0x{raw[error.start]:02x} is not UTF-8"
        raise ConfigurationError(
            Problem("E-FILE-ENCODING", Place(source, line, column), cause, "save the file as UTF-8")
        ) from None


def _unreadable(name: str, error: OSError | ValueError) -> ConfigurationError:
    causes: dict[type[Exception], tuple[str, str]] = {
        FileNotFoundError: ("there is no such file", "check the name and the folder"),
        PermissionError: ("you may not read this file", "check its permissions with ls -l"),
    }
    reason = (getattr(error, "strerror", None) or str(error)).lower()
    cause, fix = causes.get(type(error), (f"the file cannot be read: {reason}", "check the path"))
    return ConfigurationError(Problem("E-FILE-READ", name, cause, fix))


def _too_large(name: str, size: int) -> Problem:
    amount = f"{size / 1e6:.0f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"
    return Problem(
        "E-FILE-SIZE",
        name,
        f"this file has {amount}; a robot or pipeline file has a few kB",
        f"name another file; at most {LARGEST // 1024} kB are read",
    )


def read(path: str, name: str | None = None, is_own: bool = True) -> Value:
    """Read the YAML mapping in file `path`, called `name` in messages; `is_own`: the user's file.

    Raises ConfigurationError with every problem that keeps it from being read.
    """
    return parse(Source(name or path, read_text(path, name or path), is_own))


def parse(source: Source) -> Value:
    """Read the YAML mapping in `source`. Raises ConfigurationError."""
    root = parse_any(source, "\n".join(source.lines))
    wrong = _not_a_mapping(root, source)
    if wrong:
        raise ConfigurationError(wrong)
    assert root is not None
    return root


def parse_any(source: Source, text: str) -> Value | None:
    """Read any YAML value from `text`, whose columns are those of `source`; None when empty.

    Raises ConfigurationError.
    """
    builder = TreeBuilder(source)
    try:
        for event in _events(text):
            builder.take(event)
    except UnreadableError:
        pass
    except RecursionError:
        builder.problems.append(too_deep(Place(source, 1, 1)))
    except Exception as error:
        if type(error).__module__.split(".")[0] not in ("yaml", "_yaml"):
            raise
        builder.problems.append(yaml_syntax.problem(source, error))
    if builder.problems:
        raise ConfigurationError(builder.problems)
    return builder.root


def _not_a_mapping(root: Value | None, source: Source) -> list[Problem]:
    if root is None or root.data is None:
        cause, fix = (
            "this file is empty",
            "begin it with `format: 1` and `kind: robot` or `pipeline`",
        )
        return [Problem("E-YAML-TOP", source.name, cause, fix)]
    if isinstance(root.data, dict):
        return []
    what = "a list" if isinstance(root.data, list) else "a single value"
    cause = f"the file is {what}, but keys with values are wanted"
    fix = "write `key: value` lines, without a dash or bracket in front"
    return [Problem("E-YAML-TOP", root.place, cause, fix)]


def _events(text: str) -> Iterator[Any]:
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.parse(text, Loader=loader)
