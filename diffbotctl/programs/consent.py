"""What a person consents to who allows the programs of a pipeline, as one hash.

It is over the pipeline's files, the command lines, the executables and the files that the command
lines name. It does not cover what these load themselves.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

from diffbotctl.config.configuration import Configuration, ProgramUse


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
