"""Opening a recording, with words for a file that is none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from diffbotctl.engine.replay import Recorded
from diffbotctl.errors import Problem, RunError
from diffbotctl.hub.recording import RecordingReader


def messages(path: Path) -> Iterator[Recorded]:
    """The messages of the run recorded at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    with readable(path):
        yield from reader.messages()
    whole(reader)


class readable:  # noqa: N801 - read as a word: `with readable(path):`
    """Turns an OSError on the way into words about the file `path`."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        """Nothing is opened here."""

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if isinstance(error, OSError):
            cause = f"cannot read it: {error.strerror}"
            raise RunError(Problem("E-RECORDING", str(self.path), cause)) from error


def whole(reader: RecordingReader) -> None:
    """Raise RunError unless what `reader` has read began as a recording does."""
    if not reader.about:
        cause = "this is no recording of diffbotctl"
        fix = "make one: diffbotctl run goal --record FILE"
        raise RunError(Problem("E-RECORDING", str(reader.path), cause, fix))
