"""Texts of the codes that a problem or a stop can carry, for `diffbotctl explain`.

The texts are data, in `codes.yaml` beside this file.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple


class Code(NamedTuple):
    """What a code means, in a few words and in a paragraph or two."""

    title: str
    text: str


@cache
def code_texts() -> dict[str, Code]:
    """Every code with its texts, in the order of the file."""
    import yaml  # heavy, and most commands explain no code

    text = (Path(__file__).parent / "codes.yaml").read_text(encoding="utf-8")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    entries = yaml.load(text, Loader=loader)
    return {
        code: Code(entry["title"], entry["text"].rstrip("\n")) for code, entry in entries.items()
    }
