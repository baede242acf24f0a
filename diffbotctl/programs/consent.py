"""Consent to the programs of a pipeline: a person is asked once, until one of them changes.

The consent is bound to a hash over the pipeline's files, the command lines, the executables and the
files that the command lines name. It does not cover what these load themselves.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from diffbotctl import user_folders
from diffbotctl.config.configuration import Configuration, ProgramUse

KEPT_MAX = 1000  # consents in the file; older ones are asked for again


def consent_file() -> Path:
    """The file with the consents of this user."""
    return user_folders.state_folder() / "allowed_programs.json"


def program_files(use: ProgramUse) -> list[Path]:
    """The executable of a program, and every file that its command line names."""
    files: list[Path] = []
    for place, word in enumerate(use.words):
        path = use.folder / word
        if not path.is_file() and not place:
            path = Path(shutil.which(word) or path)
        if path.is_file():
            files.append(path.resolve())
    return files


def consent_key(configuration: Configuration) -> str:
    """A hash over all that a person consents to. Raises OSError for a file that is not readable."""
    digest = hashlib.sha256()
    for part in _parts(configuration):
        digest.update(b"%d:" % len(part) + part)
    return digest.hexdigest()


def _parts(configuration: Configuration) -> Iterator[bytes]:
    for file in configuration.files:
        yield file.read_bytes()
    for use in configuration.programs:
        yield json.dumps([use.name, str(use.folder), *use.words]).encode()
        for path in program_files(use):
            yield str(path).encode()
            yield path.read_bytes()


def is_allowed(key: str) -> bool:
    """Whether this user has consented to `key` before."""
    return key in _consents()


def remember(key: str) -> None:
    """Remember the consent to `key`. Raises OSError when it cannot be written."""
    path = consent_file()
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(f".{os.getpid()}.part")
    draft.write_text(json.dumps([*_consents(), key][-KEPT_MAX:]))
    draft.replace(path)


def _consents() -> list[str]:
    try:
        consents = json.loads(consent_file().read_text())
    except (OSError, ValueError):
        return []
    if not isinstance(consents, list):
        return []
    return [key for key in consents if isinstance(key, str)]
