"""`include`: one file says only what differs from another. Each value keeps its own place."""

from __future__ import annotations

from pathlib import Path

from diffbotctl.config import lookup, yaml_reader
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Problem, UserError

CHAIN = 10  # files deep


def read(path: Path, kind: str) -> tuple[Value, list[Path]]:
    """The file at `path` over all that it includes, and every file that was read.

    `kind` is the folder in which bare names are looked up. Raises ConfigurationError.
    """
    files: list[Path] = []
    return _read(path, kind, files, []), files


def merge(below: Value, above: Value) -> Value:
    """`above` over `below`: mappings are merged, everything else is replaced."""
    if not isinstance(below.data, dict) or not isinstance(above.data, dict):
        return above
    entries = dict(below.data)
    for name, value in above.data.items():
        entries[name] = merge(entries[name], value) if name in entries else value
    merged = above.with_key(above.key)
    merged.data = entries
    return merged


def _read(path: Path, kind: str, files: list[Path], chain: list[Path]) -> Value:
    own = yaml_reader.read(str(path), lookup.display_path(path), not lookup.is_shipped(path))
    if path not in files:
        files.append(path)
    wanted = own.entries.get("include")
    if wanted is None:
        return own
    merged: Value | None = None
    for each in wanted.items or [wanted]:
        below = _included(each, path, kind, files, [*chain, path.resolve()])
        merged = below if merged is None else merge(merged, below)
    return own if merged is None else merge(merged, own)


def _included(wanted: Value, path: Path, kind: str, files: list[Path], chain: list[Path]) -> Value:
    if not isinstance(wanted.data, str) or not wanted.data.strip() or "\0" in wanted.data:
        cause = "include wants the name or path of a file"
        raise ConfigurationError(
            Problem("E-INCLUDE", wanted.spot, cause, "write `include: book_2wd`")
        )
    found = _find(wanted, path, kind)
    if found.resolve() in chain or len(chain) > CHAIN:
        names = " -> ".join(each.name for each in [*chain, found])
        cause = f"the files include each other: {names}"
        raise ConfigurationError(Problem("E-INCLUDE", wanted.spot, cause, "remove one include"))
    try:
        return _read(found, kind, files, chain)
    except ConfigurationError as error:
        about_file = [problem for problem in error.problems if problem.line == 0]
        if not about_file:
            raise
        raise ConfigurationError(
            Problem("E-INCLUDE", wanted.spot, problem.cause, problem.fix) for problem in about_file
        ) from None


def _find(wanted: Value, path: Path, kind: str) -> Path:
    name = str(wanted.data)
    beside = path.parent / (name if lookup.is_path(name) else f"{name}.yaml")
    if beside.is_file() or lookup.is_path(name):
        return beside
    shipped = lookup.folder(kind) / f"{name}.yaml"
    if shipped.is_file():
        return shipped
    try:
        return lookup.find(name, kind)
    except UserError as error:
        problem = error.problems[0]
        raise ConfigurationError(
            Problem("E-INCLUDE", wanted.spot, problem.cause, problem.fix)
        ) from None
