"""The file of one flight: where it lies, what stands in it, and how many are kept."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from diffbotctl.hub.ring import Ring

KEPT = 10  # files in the folder; older ones go


class Subject(NamedTuple):
    """What the files must know of the run. `wires` are those of the drivers alone."""

    folder: Path
    name: str
    wires: dict[str, type]
    about: dict[str, str]


def folder() -> Path:
    """Where this user's flights lie."""
    state = os.environ.get("XDG_STATE_HOME")
    home = Path(state) if state and Path(state).is_absolute() else Path.home() / ".local" / "state"
    return home / "diffbotctl" / "flights"


def outcome(subject: Subject, number: int, ring: Ring, summary: dict[str, str]) -> str:
    """Write flight `number` of this run, and return the line that tells of it."""
    try:
        path = _save(subject, number, ring, summary)
    except OSError as error:
        return could_not(subject, error)
    whole = ring.known and ring.begin is None
    words = "The whole run so far is" if whole else "The last 3 minutes are"
    return f"{words} in {path}; diffbotctl replay {path}\n"


def could_not(subject: Subject, error: OSError) -> str:
    """The line that tells why there is no file."""
    where = f"{subject.folder}: {os.strerror(error.errno or 0)}"
    return f"The last minutes could not be kept: {where}\n"


def prune(folder: Path) -> None:
    """Keep the newest KEPT flights of the folder."""
    flights = sorted(folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)
    for path in flights[:-KEPT]:
        path.unlink(missing_ok=True)


def _save(subject: Subject, number: int, ring: Ring, summary: dict[str, str]) -> Path:
    subject.folder.mkdir(parents=True, exist_ok=True)
    path = subject.folder / f"{subject.name}-{number}.mcap"
    draft = path.with_suffix(".part")
    try:
        with draft.open("wb") as file:
            _record(file, subject, ring, summary)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
    prune(subject.folder)
    return path


def _record(file: Any, subject: Subject, ring: Ring, summary: dict[str, str]) -> None:
    from diffbotctl.hub.recording import Recording  # the writer alone pays for it

    begins = "run" if ring.known and ring.begin is None else "state" if ring.begin else "unknown"
    about = {**subject.about, "flight": begins}
    recording = Recording(file, subject.wires, len(subject.wires), about)
    if ring.begin is not None:
        recording.attach_state(*ring.begin)
    for instant in ring.instants():
        recording.write(instant)
    recording.finish({**summary, "instants": str(recording.instants)})
