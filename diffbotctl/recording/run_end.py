"""How this user's last run ended: a short note, also of a run of which no recording was kept.

A run with `--fast` or `--record` has no black box, and neither has one without a stop. Without the
note, `diffbotctl why` would explain an older run in its place.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl import user_folders
from diffbotctl.file_replacement import replace_file
from diffbotctl.messages import Stop
from diffbotctl.recording.black_box_store import black_box_folder


class RunEnd(NamedTuple):
    """The end of a run: name of its pipeline, time at which it began (ns since 1970), cause.

    `stop`: the last one. `flight`: the name of its last black box file, empty without one.
    """

    pipeline: str
    began: int
    cause: str
    stop: Stop | None
    flight: str = ""


def newest_flight(pattern: str = "*") -> Path | None:
    """The newest file of this user's black box; None where there is none."""
    files = black_box_folder().glob(f"{pattern}.mcap")
    return max(files, key=lambda path: path.stat().st_mtime_ns, default=None)


def note_run_end(end: RunEnd) -> None:
    """Keep the end of this process's run, in place of the note of the run before.

    A folder that cannot be written leaves the run as it is: `why` then explains an older one.
    """
    flight = newest_flight(f"*-{os.getpid()}-*")
    if flight is not None and flight.stat().st_mtime_ns >= end.began:
        end = end._replace(flight=flight.name)
    with suppress(OSError):
        _path().parent.mkdir(parents=True, exist_ok=True)
        replace_file(_path(), json.dumps(end._asdict()).encode())


def last_run_end(flight: Path | None) -> RunEnd | None:
    """The noted end, unless `flight`, the newest black box file, is of a later run.

    That run was killed, or another one has not ended yet.
    """
    try:
        record = json.loads(_path().read_text(encoding="utf-8"))
        stop = record.pop("stop")
        end = RunEnd(**record, stop=None if stop is None else Stop(*stop))
        is_old = (
            flight is not None
            and flight.name != end.flight
            and flight.stat().st_mtime_ns > _path().stat().st_mtime_ns
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return None if is_old else end


def _path() -> Path:
    return user_folders.state_folder() / "last_run.json"
