"""The section `calibration:` of a robot file: its entries change, every other byte stays.

Writing results into a robot file, keeping what was there, and bringing it back.

What a file was is kept beside it, under a name that ends in the fingerprint of what was written:
so `undo` knows whether the file is still what was written, and undoing goes back step by step.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import unified_diff
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import yaml

from diffbotctl.calibrate.result import Finding, Provenance, formatted_value
from diffbotctl.config import lookup
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.load import load_robot
from diffbotctl.config.yaml_edit import reads_as, with_entry
from diffbotctl.errors import ConfigurationError, Problem, RunError, UsageError

SECTION = "calibration"
INDENT = "  "
# The section's line with nothing behind the key, or an empty mapping; what follows is a comment.
EMPTY_SECTION = re.compile(
    rf"^(?P<key>{SECTION}:)(?P<gap>[ ]*)(?P<braces>\{{[ ]*\}})?(?P<rest>[ ]*(?:#.*)?)$",
    re.MULTILINE,
)


def replace_section(text: str, entries: Mapping[str, str]) -> str:
    """`text` with each of `entries` (field path to what is written behind it) in the section.

    Line ends are those of the file. Raises ValueError where its layout does not allow it.
    """
    crlf = "\r\n" in text and not re.search(r"(?<!\r)\n", text)
    changed = text.replace("\r\n", "\n") if crlf else text
    for path, written in entries.items():
        changed = _with_section_entry(changed, path, written)
    return changed.replace("\n", "\r\n") if crlf else changed


def _with_section_entry(text: str, path: str, written: str) -> str:
    if _is_empty(text):
        return _open_section(text, f"{INDENT}{path}: {written}")
    return with_entry(text, [SECTION, path], written)


def _is_empty(text: str) -> bool:
    top = yaml.load(text, Loader=yaml.CSafeLoader)
    return isinstance(top, dict) and not top.get(SECTION)


def _open_section(text: str, line: str) -> str:
    """`text`, whose section is empty or missing, with `line` as the section's first entry."""
    found = list(EMPTY_SECTION.finditer(text))
    if not found:
        end = "" if text.endswith("\n") or not text else "\n"
        changed = f"{text}{end}{SECTION}:\n{line}\n"
    elif len(found) == 1:
        match = found[0]
        # Spaces in the place of the braces keep a comment in its column.
        filler = match["gap"] + " " * len(match["braces"] or "") if "#" in match["rest"] else ""
        rest = match["rest"] if filler else ""
        changed = (
            f"{text[: match.start()]}{match['key']}{filler}{rest}\n{line}{text[match.end() :]}"
        )
    else:
        raise ValueError("the word `calibration:` stands at the beginning of several lines")
    return _check_entry(text, changed, line)


def _check_entry(before: str, after: str, line: str) -> str:
    """`after`, if it reads as `before` with that one entry in the section."""
    wanted = yaml.load(before, Loader=yaml.CSafeLoader) | {
        SECTION: yaml.load(line, Loader=yaml.CSafeLoader)
    }
    return reads_as(after, wanted)


FINGERPRINT_DIGITS = 8  # hexadecimal digits: one in four thousand million is no accident
BACKUP_INFIX = ".before-"


class FileChange(NamedTuple):
    """A robot file as it is, and as it would be. Nothing is written yet."""

    path: Path
    before: bytes
    after: bytes

    def difference(self, state: str = "after") -> str:
        """What changes, as a unified diff; `state` says what the file is then."""
        old, new = (text.decode().splitlines() for text in (self.before, self.after))
        name = lookup.display_path(self.path)
        return "\n".join(unified_diff(old, new, name, f"{name} ({state})", lineterm="", n=1))


def writable_copy(path: Path) -> tuple[Path, bool]:
    """The file to write for the robot at `path`, and whether it was copied to ./robots for that.

    What ships with diffbotctl is never written. Raises UsageError where it cannot be copied.
    """
    if not lookup.is_shipped(path):
        return path, False
    mine = Path("robots") / path.name
    try:
        if mine.exists():
            if mine.samefile(path):
                cause = "this is the folder of diffbotctl itself, whose files stay as they are"
                raise _write_error(path, cause, "change to a folder of your own")
            return mine, False
        mine.parent.mkdir(exist_ok=True)
        shutil.copyfile(path, mine)
    except OSError as error:
        raise _write_error(mine, f"cannot copy it there: {error.strerror}", "") from error
    return mine, True


def plan_change(path: Path, findings: Sequence[Finding], origin: Provenance) -> FileChange:
    """What `findings` make of the robot file at `path`.

    Raises UsageError where its layout does not allow it; ConfigurationError with the reasons when
    the file would no longer be valid, or a value is not plausible.
    """
    before = path.read_bytes()
    try:
        entries = {each.field: formatted_value(each, origin) for each in findings}
        after = replace_section(before.decode(), entries).encode()
    except ValueError as error:
        raise _write_error(path, str(error), "write the entries by hand") from error
    _load_trial(path, after)
    return FileChange(path, before, after)


def plan_value_change(path: Path, keys: Sequence[str], value: str) -> FileChange:
    """The robot file at `path` with one of its own values replaced, or added.

    Raises as `change` does.
    """
    before = path.read_bytes()
    try:
        after = with_entry(before.decode(), keys, value).encode()
    except ValueError as error:
        raise _write_error(path, str(error), "write the entry by hand") from error
    _load_trial(path, after)
    return FileChange(path, before, after)


def write_change(made: FileChange) -> Path:
    """Write the change in one go. Returns where the file as it was is kept.

    Raises RunError when the file was changed meanwhile, or cannot be written.
    """
    path = made.path.resolve()
    if made.after == made.before:
        return path
    if path.read_bytes() != made.before:
        cause = "it was changed by somebody else meanwhile"
        fix = "do it again, or write the entries by hand"
        raise RunError(Problem("E-CALIBRATE-WRITE", str(path), cause, fix))
    kept = _backup_path(path, made.after)
    try:
        _write_atomic(kept, made.before, path)
        _write_atomic(path, made.after, path)
    except OSError as error:
        cause = f"cannot write there: {error.strerror}"
        raise RunError(Problem("E-CALIBRATE-WRITE", str(path), cause, "")) from error
    return kept


def undo(path: Path) -> FileChange:
    """Bring back the file at `path` as it was before the last calibration.

    Raises UsageError when there is none, or the file has been changed since.
    """
    now = path.read_bytes()
    kept = _backup_path(path.resolve(), now)
    if not kept.exists():
        raise UsageError(_no_backup(path))
    before = kept.read_bytes()
    _write_atomic(path.resolve(), before, path)
    kept.unlink()
    return FileChange(path, now, before)


def _no_backup(path: Path) -> Problem:
    others = sorted(each.name for each in path.resolve().parent.glob(f"{path.name}{BACKUP_INFIX}*"))
    if others:
        cause = f"it was changed since the last calibration; {', '.join(others)} is kept beside it"
        fix = "compare them, and copy what you want back"
    else:
        cause, fix = "no calibration was written into it", "calibrate first"
    return Problem("E-CALIBRATE-UNDO", str(path), cause, fix)


def _backup_path(path: Path, after: bytes) -> Path:
    return path.with_name(
        f"{path.name}{BACKUP_INFIX}{sha256(after).hexdigest()[:FINGERPRINT_DIGITS]}"
    )


def with_findings(file: RobotFile, findings: Sequence[Finding]) -> RobotFile:
    """The robot as `findings` would make it; nothing is written.

    Raises ConfigurationError with the reasons when a value is not plausible, or UsageError.
    """
    now = Provenance("trial", "", None, None)
    entries = {each.field: formatted_value(each, now) for each in findings}
    try:
        after = replace_section(file.file.read_bytes().decode(), entries).encode()
    except ValueError as error:
        raise _write_error(file.file, str(error), "write the entries by hand") from error
    return replace(_load_trial(file.file, after), file=file.file, files=file.files)


def _load_trial(path: Path, after: bytes) -> RobotFile:
    """The robot file at `path`, had it the text `after`. Raises ConfigurationError."""
    trial = path.with_name(f".{path.name}.trial.yaml")
    try:
        trial.write_bytes(after)
        return load_robot(str(trial.absolute()))
    except ConfigurationError as error:
        raise ConfigurationError(
            Problem(each.code, str(path), each.cause, each.fix, each.severity)
            for each in error.problems
        ) from None
    finally:
        trial.unlink(missing_ok=True)


def _write_atomic(path: Path, data: bytes, like: Path) -> None:
    """Write `data` to `path` in one go, with the access rights of `like`."""
    beside = path.with_name(f".{path.name}.new")
    with beside.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    shutil.copymode(like, beside)
    beside.replace(path)


def _write_error(path: Path, cause: str, fix: str) -> UsageError:
    return UsageError(Problem("E-CALIBRATE-WRITE", str(path), cause, fix))
