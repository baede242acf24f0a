"""What this user has allowed to run: programs of pipelines, and files with code, by hash."""

from __future__ import annotations

import json
from pathlib import Path

from diffbotctl import user_folders
from diffbotctl.file_replacement import replace_file

KEPT_MAX = 1000  # consents in the file; older ones are asked for again
_allowed_here: set[str] = set()  # in this process alone


def consent_file() -> Path:
    return user_folders.state_folder() / "allowed_programs.json"


def is_allowed(key: str) -> bool:
    """Whether this user has consented to `key`, now or before."""
    return key in _allowed_here or key in _consents()


def allow_here(key: str) -> None:
    """Consent to `key` for as long as this process runs."""
    _allowed_here.add(key)


def remember(key: str) -> None:
    """Remember the consent to `key`. Raises OSError when it cannot be written."""
    allow_here(key)
    path = consent_file()
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, json.dumps([*_consents(), key][-KEPT_MAX:]).encode())


def _consents() -> list[str]:
    try:
        consents = json.loads(consent_file().read_text())
    except (OSError, ValueError):
        return []
    if not isinstance(consents, list):
        return []
    return [key for key in consents if isinstance(key, str)]
