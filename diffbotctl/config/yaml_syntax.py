"""Translates errors of the YAML parser into problems with the place of the actual mistake."""

from __future__ import annotations

import re
from typing import Any

from diffbotctl.errors import Place, Problem, Source

NESTING_MAX_LEVELS = 40  # a robot file has 6


def problem(source: Source, error: Any) -> Problem:
    """The problem described by `error`, a yaml.YAMLError raised while parsing `source`."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    words = str(getattr(error, "problem", None) or getattr(error, "reason", None) or error)
    if mark is None:
        cause = f"this is not YAML text: {words.splitlines()[0].strip()}"
        return Problem("E-FILE-ENCODING", source.name, cause, "save it as UTF-8 text")
    place = Place(source, mark.line + 1, mark.column + 1)
    tab = _indented_by_tab(source, mark.line + 1)
    if tab is not None:
        cause = "this line is indented with a tab; YAML allows only spaces"
        return Problem("E-YAML-TAB", tab, cause, "replace each tab with spaces")
    if "nesting depth" in words:  # libyaml 0.2.6 and later read at most 1000 open brackets
        return too_deep(place)
    if "mapping values are not allowed" in words:
        return _unexpected_key(source, place)
    context = getattr(error, "context_mark", None)
    if "could not find expected ':'" in words and context is not None:
        return _missing_colon(source, Place(source, context.line + 1, context.column + 1))
    if source.line(place.line)[place.column - 1 : place.column] in ("}", "]"):
        cause = "this brace or bracket closes none that is open"
        return Problem("E-YAML-SYNTAX", place, cause, "remove it, or add the one that opens it")
    if re.match(r"- +[0-9.]", source.line(place.line)[place.column - 1 :]):
        cause = "a space after the minus sign makes this an item of a list"
        return Problem(
            "E-YAML-SYNTAX", place, cause, "write the minus sign before the number: -5 mm"
        )
    for pattern, cause, fix in SYNTAX:
        if re.search(pattern, words):
            where = f" (opened in line {context.line + 1})" if context and "closed" in cause else ""
            return Problem("E-YAML-SYNTAX", place, cause + where, fix)
    cause = f"invalid YAML from here: {words}"
    return Problem("E-YAML-SYNTAX", place, cause, "compare this line with the ones around it")


def too_deep(place: Place) -> Problem:
    """The problem of a value at `place` that is nested too deeply."""
    cause = f"this is nested more than {NESTING_MAX_LEVELS} levels deep"
    return Problem("E-YAML-SIZE", place, cause, "close the brackets that are open")


SYNTAX = [
    (
        r"expected ',' or '[}]'|expected ',' or '\]'|flow (mapping|sequence)",
        "a brace or bracket before this point is not closed",
        "close it, and put a comma between its entries",
    ),
    (r"expected ':'", "a key without a colon", "write `key: value`, with a space after the colon"),
    (
        r"quoted scalar|end of stream",
        "a quoted text before this point is not closed",
        "close the text with the quotation mark that opens it",
    ),
    (
        r"expected <block end>|did not find expected key|block (mapping|collection|end)",
        "the indentation of this line differs from the lines around it",
        "use the same indentation for all keys of a mapping",
    ),
    (
        r"cannot start any token",
        "a value cannot begin with this character",
        "put the text in quotes",
    ),
]


def _unexpected_key(source: Source, colon: Place) -> Problem:
    """A key in a wrong place: the cause is usually the previous line, or the indentation."""
    line, before = source.line(colon.line), source.line(colon.line - 1)
    glued = _glued_colon(source, colon.line - 1)
    if glued is not None:
        return glued
    indent = len(line) - len(line.lstrip())
    if re.match(rf"[ ]{{{indent}}}[A-Za-z_][A-Za-z0-9_]*(?:[ ][^:#]*)?$", before):
        return _missing_colon(source, Place(source, colon.line - 1, indent + 1))
    if ":" not in line[: colon.column - 1] and indent > len(before) - len(before.lstrip()):
        cause = "this line is indented below a line that already has a value"
        place = Place(source, colon.line, indent + 1)
        fix = "use the same indentation for all keys of a mapping"
        return Problem("E-YAML-SYNTAX", place, cause, fix)
    cause = "a second colon in this line: the text before it cannot be a key"
    fix = "put braces around inner keys, `body: {front: 9 cm}`, or quotes around text"
    return Problem("E-YAML-SYNTAX", colon, cause, fix)


def _missing_colon(source: Source, key: Place) -> Problem:
    """A key without a colon, or without the space after it: the parser notices it a line later."""
    glued = _glued_colon(source, key.line)
    cause, fix = "a key without a colon", "write `key: value`, with a space after the colon"
    return glued or Problem("E-YAML-SYNTAX", key, cause, fix)


def _glued_colon(source: Source, number: int) -> Problem | None:
    """A colon without a space after it."""
    glued = re.match(r"\s*[A-Za-z_][A-Za-z0-9_]*(:)\S", source.line(number))
    if glued is None:
        return None
    place = Place(source, number, glued.start(1) + 1)
    return Problem(
        "E-YAML-SYNTAX", place, "a space is missing after this colon", "write `key: value`"
    )


def _indented_by_tab(source: Source, number: int) -> Place | None:
    for candidate in (number, number - 1):
        tab = re.match(r"[ ]*(\t)", source.line(candidate))
        if tab:
            return Place(source, candidate, tab.start(1) + 1)
    return None
