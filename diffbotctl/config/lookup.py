"""Finds shipped folders, and robot and pipeline files by name or path."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from diffbotctl.errors import Problem, UsageError, closest_match
from diffbotctl.parts import rows

DEFAULT_ROBOT = "book_2wd"
SIMULATED = ".simulated"  # ends the stem of a file for results of a simulated robot


def folder(name: str) -> Path:
    """The shipped folder `name`: inside the package when installed, beside it in a checkout.

    Raises FileNotFoundError when the installation is incomplete.
    """
    package = Path(__file__).resolve().parent.parent
    for candidate in (package / name, package.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"the folder {name} is missing from this installation of diffbotctl")


def names(kind: str) -> list[str]:
    """The names of the shipped YAML files in folder `kind`, without their ending."""
    return sorted(path.stem for path in folder(kind).glob("*.yaml"))


def find_pipeline(name: str) -> Path:
    """The pipeline file meant by `name`. Raises UsageError."""
    return find(name, "pipelines")


def find_robot(name: str | None) -> Path:
    """The robot file meant by `name`; None: the only one in ./robots, or the default.

    Raises UsageError.
    """
    if name is not None:
        return find(name, "robots")
    own = _own_names("robots")
    if len(own) > 1 and DEFAULT_ROBOT not in own:
        cause = f"./robots contains {len(own)} robot files: {', '.join(own)}"
        fix = f"choose one: --robot {own[0]}"
        raise UsageError(Problem("E-ROBOT-WHICH", "robots", cause, fix))
    return find(own[0] if len(own) == 1 else DEFAULT_ROBOT, "robots")


def _own_names(kind: str) -> list[str]:
    """The names of the user's YAML files in ./`kind`, without their ending.

    Files for results of a simulated robot are used only by their names.
    """
    return sorted(p.stem for p in Path(kind).glob("*.yaml") if not is_simulated_copy(p))


def is_simulated_copy(path: Path) -> bool:
    """Whether `path` is the file for results of a simulated robot."""
    return path.stem.endswith(SIMULATED)


def simulated_copy_of(path: Path) -> Path:
    """The file beside `path` for results of a simulated robot; of a shipped one, in ./robots."""
    if is_simulated_copy(path):
        return path
    folder = Path("robots") if is_shipped(path) else path.parent
    return folder / f"{path.stem}{SIMULATED}.yaml"


def original_of(path: Path) -> Path:
    """The robot whose results of a simulated robot are at `path`: its file, or its shipped name."""
    file = path.with_name(f"{path.stem.removesuffix(SIMULATED)}.yaml")
    return file if file.exists() else Path(file.stem)


def is_known(name: str, kind: str) -> bool:
    """True when `name` can be looked up in folder `kind`."""
    try:
        find(name, kind)
    except UsageError:
        return False
    return True


def find(name: str, kind: str) -> Path:
    """The file of folder `kind` meant by `name`.

    A path, or a name in ./`kind`, among the shipped files, or in the working directory. Raises
    UsageError.
    """
    if is_path(name):
        path = Path(name)
        if not os.path.lexists(path) and is_shipped_name(path.stem, kind):
            cause = "there is no such file"
            fix = f"did you mean {path.stem}, without .yaml? That one ships with diffbotctl"
            raise UsageError(Problem("E-FILE-READ", name, cause, fix))
        return path
    for candidate in _candidates(name, kind):
        if is_file(candidate):
            return candidate
    raise _not_found(name, kind)


def is_shipped_name(name: str, kind: str) -> bool:
    """Whether a file of folder `kind` that ships with diffbotctl is called `name`."""
    return name in names(kind)


def is_path(name: str) -> bool:
    """True when `name` is a path, not a name to look up."""
    return "/" in name or os.sep in name or name.endswith((".yaml", ".yml"))


def is_file(path: Path) -> bool:
    """Whether `path` is a file; False also for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long, or with a zero in it
        return False


def real_path(path: Path) -> Path:
    """`path` without symbolic links; a link to itself is returned as it is."""
    return Path(os.path.realpath(path))


def display_path(path: Path) -> str:
    """`path` relative to the working directory; shipped files are shown below `diffbotctl/`."""
    try:
        return str(real_path(path).relative_to(Path.cwd()))
    except (ValueError, OSError):
        return f"diffbotctl/{path.parent.name}/{path.name}" if is_shipped(path) else str(path)


def file_of(source_name: str, files: Iterable[Path]) -> Path | None:
    """The one of `files` that problems show as `source_name`; None for the command line."""
    return next((file for file in files if display_path(file) == source_name), None)


def is_shipped(path: Path) -> bool:
    """True when `path` is one of the files that ship with diffbotctl."""
    folders = [folder(kind) for kind in ("robots", "pipelines")]
    try:
        return real_path(path).parent in [real_path(folder) for folder in folders]
    except (OSError, ValueError):
        return False


def shipped_folder_error(path: Path, code: str) -> UsageError:
    """The error for a file of the user in a folder whose files ship with diffbotctl."""
    cause = "this folder belongs to diffbotctl itself, and its files are not changed"
    fix = "change to a folder of your own: mkdir ~/robot; cd ~/robot"
    return UsageError(Problem(code, str(path), cause, fix))


def _candidates(name: str, kind: str) -> tuple[Path, Path, Path]:
    """Where the file of folder `kind` may be, best first."""
    file_name = f"{name}.yaml"
    return Path(kind) / file_name, folder(kind) / file_name, Path(file_name)


def _not_found(name: str, kind: str) -> UsageError:
    known = sorted({*names(kind), *_own_names(kind)})
    near = closest_match(name, known)
    what = kind.removesuffix("s")
    if is_file(Path(name)):
        cause = f"this file does not end in .yaml, as that of a {what} must"
        fix = f"name a {what} file, or one of {', '.join(known)}"
        return UsageError(Problem("E-FILE-NAME", name, cause, fix))
    other = "robots" if kind == "pipelines" else "pipelines"
    if any(is_file(candidate) for candidate in _candidates(name, other)):
        cause = f"'{name}' is a {other.removesuffix('s')}; a {what} is needed here"
        fix = f"use one of {', '.join(known)}"
        if kind == "pipelines":
            fix += f"; a robot: `robot: {{use: {name}}}`, or `--robot {name}`"
        return UsageError(Problem("E-FILE-NAME", name, cause, fix))
    fix = f"did you mean {near}?" if near else f"use one of {', '.join(known)}, or a path"
    if kind == "robots" and name in rows("kits"):
        fix = f"it is a kit: `diffbotctl new robot --kit {name}` writes its robot file"
    cause = f"there is no {what} '{name}' here, in ./{kind} or among the shipped files"
    return UsageError(Problem("E-FILE-NAME", name, cause, fix))
