"""The section `calibration:` of a robot file: its entries change, every other byte stays."""

from __future__ import annotations

import re
from collections.abc import Mapping

import yaml

from diffbotctl.config.rewrite import reads_as, with_entry

KEY = "calibration"
INDENT = "  "
# The section's line with nothing behind the key, or an empty mapping; what follows is a comment.
EMPTY = re.compile(
    rf"^(?P<key>{KEY}:)(?P<gap>[ ]*)(?P<braces>\{{[ ]*\}})?(?P<rest>[ ]*(?:#.*)?)$", re.MULTILINE
)


def with_entries(text: str, entries: Mapping[str, str]) -> str:
    """`text` with each of `entries` (field path to what is written behind it) in the section.

    Line ends are those of the file. Raises ValueError where its layout does not allow it.
    """
    crlf = "\r\n" in text and not re.search(r"(?<!\r)\n", text)
    changed = text.replace("\r\n", "\n") if crlf else text
    for path, written in entries.items():
        changed = _with(changed, path, written)
    return changed.replace("\n", "\r\n") if crlf else changed


def _with(text: str, path: str, written: str) -> str:
    if _is_empty(text):
        return _opened(text, f"{INDENT}{path}: {written}")
    return with_entry(text, [KEY, path], written)


def _is_empty(text: str) -> bool:
    top = yaml.load(text, Loader=yaml.CSafeLoader)
    return isinstance(top, dict) and not top.get(KEY)


def _opened(text: str, line: str) -> str:
    """`text`, whose section is empty or missing, with `line` as the section's first entry."""
    found = list(EMPTY.finditer(text))
    if not found:
        end = "" if text.endswith("\n") or not text else "\n"
        changed = f"{text}{end}{KEY}:\n{line}\n"
    elif len(found) == 1:
        match = found[0]
        # Spaces in the place of the braces keep a comment in its column.
        filler = match["gap"] + " " * len(match["braces"] or "") if "#" in match["rest"] else ""
        rest = match["rest"] if filler else ""
        changed = (
            f"{text[: match.start()]}{match['key']}{filler}{rest}\n{line}{text[match.end() :]}"
        )
    else:
        raise ValueError("the word `calibration:` stands at the beginning of several lines")
    return _checked(text, changed, line)


def _checked(before: str, after: str, line: str) -> str:
    """`after`, if it reads as `before` with that one entry in the section."""
    wanted = yaml.load(before, Loader=yaml.CSafeLoader) | {
        KEY: yaml.load(line, Loader=yaml.CSafeLoader)
    }
    return reads_as(after, wanted)
