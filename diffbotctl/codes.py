"""Texts of the codes of problems and stops, for `diffbotctl explain`; read from `codes.yaml`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple


class Code(NamedTuple):
    """The meaning of a code: a title, and a text of one or two paragraphs."""

    title: str
    text: str


@cache
def code_texts() -> dict[str, Code]:
    """All codes with their texts, in the order of the file."""
    import yaml  # slow to import, and most commands need no code

    text = (Path(__file__).parent / "codes.yaml").read_text(encoding="utf-8")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    entries = yaml.load(text, Loader=loader)
    return {
        code: Code(entry["title"], entry["text"].rstrip("\n")) for code, entry in entries.items()
    }
