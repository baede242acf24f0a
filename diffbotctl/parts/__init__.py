"""Data of the parts that robots are built of, from their data sheets: a table a kind, a row a part.

A new part of a known kind is a new row. The classes that give the columns their meaning are in
`config` and `geometry`; `tests/data/parts.schema.json` states what a row must have.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml


def rows(table: str) -> dict[str, dict[str, Any]]:
    """The rows of `table`, by the name that a robot file writes; their lists are tuples."""
    text = Path(__file__).with_name(f"{table}.yaml").read_text(encoding="utf-8")
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return {name: _with_tuples(row) for name, row in yaml.load(text, loader).items()}


def _with_tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _with_tuples(entry) for name, entry in value.items()}
    return tuple(map(_with_tuples, value)) if isinstance(value, list) else value
