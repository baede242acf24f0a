"""Remembers which contents were found to have the right shape, so that the second start is fast.

What is remembered is a hash of the content, the schema and the version: nothing that could make a
wrong file pass. Without a writable place everything works, only slower.
"""

from __future__ import annotations

import os
from contextlib import suppress
from json import dumps
from pathlib import Path
from typing import Any

from diffbotctl import __version__

try:
    from _blake2 import blake2b  # as hashlib has it, which loads all of OpenSSL besides: 3 MB
except ImportError:  # not CPython
    from hashlib import blake2b

KEPT = 400  # entries; an empty file each
LENGTH = 32  # bytes of hash: nobody finds two contents with the same


def key(schema: dict[str, Any], content: Any) -> str:
    """A name for this content under this schema and version."""
    text = dumps([__version__, schema, content], default=str)
    return blake2b(text.encode("utf-8", "surrogatepass"), digest_size=LENGTH).hexdigest()


def holds(name: str) -> bool:
    """True when `name` was remembered."""
    try:
        return (folder() / name).exists()
    except OSError:  # a folder that this user may not enter, such as root's after `sudo -u`
        return False


def remember(name: str) -> None:
    """Remember `name`; forget the oldest when there are many."""
    with suppress(OSError):
        folder().mkdir(parents=True, exist_ok=True)
        (folder() / name).touch()
        entries = list(folder().iterdir())
        if len(entries) > KEPT:
            entries.sort(key=lambda entry: entry.stat().st_mtime)
            for entry in entries[: len(entries) - KEPT // 2]:
                entry.unlink(missing_ok=True)


def folder() -> Path:
    """Where the entries lie: below the user's cache folder."""
    root = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(root) / "diffbotctl" / "valid"
