"""The JSON schemas for editors, in a folder of the user's own.

The first line of a robot, pipeline or view file names its schema by a path relative to the file. It
remains valid when the folder is copied to another machine, as the path of an installation does not.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from diffbotctl.config.lookup import folder

FOLDER = Path("schemas")  # in the working directory, beside robots/ and pipelines/
KINDS = ("robot", "pipeline", "trials", "view")
SCHEMA_FILES = tuple(f"{kind}.schema.json" for kind in KINDS)
TITLE_END = " of diffbotctl"  # of each schema; a file with another title is not replaced


def place_schemas() -> list[Path]:
    """Write the schemas to ./schemas if they are missing or those of another version.

    Returns the written files; a file of the same name that is not a schema of diffbotctl is kept.
    Raises OSError.
    """
    written = []
    for name in SCHEMA_FILES:
        path, text = FOLDER / name, (folder("schemas") / name).read_text(encoding="utf-8")
        if not path.exists() or (_is_ours(path) and path.read_text(encoding="utf-8") != text):
            FOLDER.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
            written.append(path)
    return written


def modeline(kind: str, path: Path) -> str:
    """The first line of a file of this kind at `path`; empty if ./schemas has no schema for it."""
    schema = FOLDER / f"{kind}.schema.json"
    if not schema.is_file():
        return ""
    relative = os.path.relpath(schema.resolve(), path.resolve().parent)
    return f"# yaml-language-server: $schema={relative}\n"


def _is_ours(path: Path) -> bool:
    try:
        title = json.loads(path.read_text(encoding="utf-8")).get("title")
    except (ValueError, AttributeError):
        return False
    return isinstance(title, str) and title.endswith(TITLE_END)
