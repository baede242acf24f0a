"""Writing results into the section `calibration:` of a robot file, and undoing that.

Only the changed entries of the section differ afterwards; every other byte is kept. The previous
file is kept in the folder `backups` beside it, under a name that ends with the fingerprint of what
was written: so `undo` detects whether the file was changed since, and can go back step by step.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from difflib import unified_diff
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from diffbotctl.calibrate.result import Finding, Provenance, formatted_value
from diffbotctl.calibrate.yaml_edit import reads_as, with_entry
from diffbotctl.config import lookup
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.editor_schemas import place_schemas
from diffbotctl.config.load import load_robot
from diffbotctl.config.motor_pulses import calibrated_pulses
from diffbotctl.errors import ConfigurationError, Problem, RunError, UsageError

SECTION = "calibration"
INDENT = "  "
# The line of the section with nothing behind the key, or an empty mapping, and a comment.
EMPTY_SECTION = re.compile(
    rf"^(?P<key>{SECTION}:)(?P<gap>[ ]*)(?P<braces>\{{[ ]*\}})?(?P<rest>[ ]*(?:#.*)?)$",
    re.MULTILINE,
)
SIMULATED_FILE = """\
# What `calibrate` measures on a simulated robot. A real port refuses it.
format: 1
kind: robot
include: {include}
calibration: {{}}
"""
FINGERPRINT_DIGITS = 8  # hexadecimal
BACKUP_FOLDER, BACKUP_INFIX = "backups", ".before-"


def replace_section(text: str, entries: Mapping[str, str]) -> str:
    """`text` with each of `entries` (field path and the text behind it) in the section.

    Line ends are kept. Raises ValueError if the layout of the file does not allow it.
    """
    has_crlf = "\r\n" in text and not re.search(r"(?<!\r)\n", text)
    changed = text.replace("\r\n", "\n") if has_crlf else text
    for path, entry in entries.items():
        top = yaml.load(changed, Loader=yaml.CSafeLoader)
        if isinstance(top, dict) and not top.get(SECTION):
            changed = _open_section(changed, top, f"{INDENT}{path}: {entry}")
        else:
            changed = with_entry(changed, [SECTION, path], entry)
    return changed.replace("\n", "\r\n") if has_crlf else changed


def _open_section(text: str, top: dict[str, Any], line: str) -> str:
    """`text`, whose section is empty or missing, with `line` as its first entry."""
    matches = list(EMPTY_SECTION.finditer(text))
    if len(matches) > 1:
        raise ValueError("several lines begin with `calibration:`")
    if matches:
        match = matches[0]
        # Spaces in the place of the braces keep a comment in its column.
        comment = ""
        if "#" in match["rest"]:
            comment = match["gap"] + " " * len(match["braces"] or "") + match["rest"]
        head, tail = text[: match.start()], text[match.end() :]
        changed = f"{head}{match['key']}{comment}\n{line}{tail}"
    else:
        end = "" if text.endswith("\n") or not text else "\n"
        changed = f"{text}{end}{SECTION}:\n{line}\n"
    return reads_as(changed, top | {SECTION: yaml.load(line, Loader=yaml.CSafeLoader)})


class FileChange(NamedTuple):
    """The present and the changed content of a robot file. Nothing is written yet."""

    path: Path
    before: bytes
    after: bytes

    def difference(self, label: str = "after") -> str:
        """The changes as a unified diff; `label` describes the changed file."""
        old, new = (text.decode().splitlines() for text in (self.before, self.after))
        name = lookup.display_path(self.path)
        return "\n".join(unified_diff(old, new, name, f"{name} ({label})", lineterm="", n=1))


def writable_copy(path: Path) -> tuple[Path, bool]:
    """The file to write for the robot at `path`, and whether it was copied to ./robots for that.

    Files that ship with diffbotctl are never written. Raises UsageError if one cannot be copied.
    """
    if not lookup.is_shipped(path):
        return path, False
    copy = Path("robots") / path.name
    try:
        if copy.exists():
            if copy.samefile(path):
                raise lookup.shipped_folder_error(path, "E-CALIBRATE-WRITE")
            return copy, False
        copy.parent.mkdir(exist_ok=True)
        shutil.copyfile(path, copy)
    except OSError as error:
        raise _write_error(copy, f"cannot be written: {error.strerror}", "") from error
    with suppress(OSError):  # the first line names a schema; a calibration does not need it
        place_schemas()
    return copy, True


def simulated_copy(path: Path) -> tuple[Path, bool]:
    """The file beside the robot file at `path` for results of a simulated robot; whether it is new.

    It includes the file at `path`, and so follows its changes. Raises UsageError if it cannot be
    written.
    """
    copy = lookup.simulated_copy_of(path)
    if copy.exists():
        return copy, False
    if lookup.is_shipped(copy):
        raise lookup.shipped_folder_error(copy, "E-CALIBRATE-WRITE")
    include = path.stem if lookup.is_shipped(path) else json.dumps(f"./{path.name}")
    try:
        copy.parent.mkdir(exist_ok=True)
        copy.write_text(SIMULATED_FILE.format(include=include), encoding="utf-8")
    except OSError as error:
        raise _write_error(copy, f"cannot be written: {error.strerror}", "") from error
    return copy, True


def plan_change(path: Path, findings: Sequence[Finding], origin: Provenance) -> FileChange:
    """The robot file at `path` with `findings`.

    Raises UsageError if its layout does not allow it; ConfigurationError with the reasons if the
    file would become invalid, or a value is not plausible.
    """
    return _plan(path, lambda text: _with_findings(text, findings, origin))[0]


def plan_value_change(path: Path, keys: Sequence[str], value: str) -> FileChange:
    """The robot file at `path` with the value at `keys` replaced or added. Raises as above."""
    return _plan(path, lambda text: with_entry(text, keys, value))[0]


def with_findings(file: RobotFile, findings: Sequence[Finding]) -> RobotFile:
    """The robot with `findings`; nothing is written. Raises as above."""
    origin = Provenance("trial", "", None, None, pulses=calibrated_pulses(file.robot))
    _, changed = _plan(file.file, lambda text: _with_findings(text, findings, origin))
    return replace(changed, file=file.file, files=file.files)


def _with_findings(text: str, findings: Sequence[Finding], origin: Provenance) -> str:
    entries = {finding.field: formatted_value(finding, origin) for finding in findings}
    return replace_section(text, entries)


def _plan(path: Path, change: Callable[[str], str]) -> tuple[FileChange, RobotFile]:
    before = path.read_bytes()
    try:
        after = change(before.decode()).encode()
    except ValueError as error:
        raise _write_error(path, str(error), "write the entries by hand") from error
    trial = path.with_name(f".{path.name}.trial.yaml")
    try:
        trial.write_bytes(after)
        return FileChange(path, before, after), load_robot(str(trial.absolute()))
    except ConfigurationError as error:
        problems = [replace(problem, place=str(path)) for problem in error.problems]
        raise ConfigurationError(problems) from None
    except OSError as error:
        cause = f"its folder cannot be written: {error.strerror}"
        fix = "copy the robot file into a folder of your own, and name it: --robot FILE"
        raise _write_error(path, cause, fix) from error
    finally:
        with suppress(OSError):
            trial.unlink(missing_ok=True)


def write_change(change: FileChange) -> Path:
    """Write the change atomically. Returns the path of the backup.

    Raises RunError if the file was changed meanwhile, or cannot be written.
    """
    path = change.path.resolve()
    if change.after == change.before:
        return path
    if path.read_bytes() != change.before:
        cause = "the file was changed meanwhile"
        fix = "run the step again, or write the entries by hand"
        raise RunError(Problem("E-CALIBRATE-WRITE", str(path), cause, fix))
    backup = _backup_path(path, change.after)
    try:
        backup.parent.mkdir(exist_ok=True)
        _write_atomic(backup, change.before, path)
        _write_atomic(path, change.after, path)
    except OSError as error:
        cause = f"cannot be written: {error.strerror}"
        raise RunError(Problem("E-CALIBRATE-WRITE", str(path), cause, "")) from error
    return backup


def undo(path: Path) -> FileChange:
    """Restore the file at `path` as it was before the last calibration.

    Raises UsageError if there is no backup, or the file was changed since.
    """
    present = path.read_bytes()
    backup = _backup_path(path.resolve(), present)
    if not backup.exists():
        raise UsageError(_no_backup(path))
    before = backup.read_bytes()
    _write_atomic(path.resolve(), before, path)
    backup.unlink()
    with suppress(OSError):  # others are in it
        backup.parent.rmdir()
    return FileChange(path, present, before)


def _no_backup(path: Path) -> Problem:
    folder = path.resolve().parent / BACKUP_FOLDER
    backups = folder.glob(f"{path.name}{BACKUP_INFIX}*")
    names = ", ".join(sorted(backup.name for backup in backups))
    if names:
        cause = f"the file was changed since the last calibration; backup: {names}"
        fix = "compare the files, and copy what you want to restore"
    else:
        cause, fix = "no calibration was written into this file", "calibrate first"
        simulated = lookup.simulated_copy_of(path)
        if simulated.exists():
            fix = f"the simulated robot's is undone with --robot {lookup.display_path(simulated)}"
    return Problem("E-CALIBRATE-UNDO", str(path), cause, fix)


def _backup_path(path: Path, after: bytes) -> Path:
    fingerprint = sha256(after).hexdigest()[:FINGERPRINT_DIGITS]
    return path.parent / BACKUP_FOLDER / f"{path.name}{BACKUP_INFIX}{fingerprint}"


def _write_atomic(path: Path, data: bytes, like: Path) -> None:
    """Write `data` to `path` atomically, with the access rights of `like`."""
    temporary = path.with_name(f".{path.name}.new")
    with temporary.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    shutil.copymode(like, temporary)
    temporary.replace(path)


def _write_error(path: Path, cause: str, fix: str) -> UsageError:
    return UsageError(Problem("E-CALIBRATE-WRITE", str(path), cause, fix))
