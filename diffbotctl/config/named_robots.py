"""Pipelines of several robots: each include has a name, `{path: turtle, as: left}`.

Each included pipeline is loaded and checked by itself, with the robot that it names; nothing is
shared between two of them. A problem is reported in the file in which it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

from diffbotctl.config import lookup
from diffbotctl.config.configuration import Configuration, WorldEntry
from diffbotctl.config.node_ports import RESERVED, is_name
from diffbotctl.config.source_tree import NamedIncludesError, Override
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Problem, closest_match, join_words

NESTED = "names are possible only in the file that is run: include those files here"
ROBOTS_MAX = 20  # each has a process for its control socket
STEPS_MAX = 20  # of a path in `set`; a robot file has five
FILE_KEYS = ("format", "kind", "include")  # of a file that names its includes
INCLUDE_KEYS = ("path", "as", "robot", "set", "in")
WHOLE_SECTIONS = ("goals", "world")  # that an override may replace
EXAMPLE = "write `- {path: goal, as: left}`"

LoadOne = Callable[[str, "str | None", list[Override]], Configuration]


@dataclass(frozen=True)
class NamedInclude:
    """One include: the pipeline at `path`, on the robot file `robot`, called `name`."""

    name: str
    path: str
    robot: str | None
    overrides: list[Override]
    value: Value


def load_named_robots(
    file: Path,
    tree: Value,
    overrides: Sequence[Override],
    robot_files: Mapping[str, str],
    load_one: LoadOne,
) -> Configuration:
    """The configuration of the pipeline `file`, whose includes have names.

    `overrides` begin with the name of a robot. `robot_files` has priority over what the files name.
    Raises ConfigurationError with the problems of all robots.
    """
    includes = _read_includes(file, tree)
    _check_overrides(overrides, [include.name for include in includes])
    problems: list[Problem] = []
    robots: dict[str, Configuration] = {}
    for include in includes:
        of_robot = [
            replace(override, steps=override.steps[1:])
            for override in overrides
            if override.steps[0] == include.name
        ]
        robot = robot_files.get(include.name, include.robot)
        try:
            loaded = load_one(include.path, robot, [*include.overrides, *of_robot])
            _check_robot(include, loaded)
        except NamedIncludesError:
            refuse(include.value, f"{include.path} itself gives names to its includes", NESTED)
        except ConfigurationError as error:
            problems += error.problems
            continue
        problems += loaded.warnings
        robots[include.name] = replace(loaded, name=include.name)
    problems = list({(each.code, str(each.place), each.cause): each for each in problems}.values())
    if any(problem.severity == "error" for problem in problems):
        raise ConfigurationError(problems)
    files = dict.fromkeys([file, *(file for robot in robots.values() for file in robot.files)])
    return Configuration(
        name=file.stem,
        file=file,
        robot=None,
        nominal=None,
        robot_file=None,
        blocks=(),
        robot_wires={},
        goals=(),
        world=WorldEntry(),
        files=tuple(files),
        warnings=tuple(problems),
        robots=robots,
    )


def _read_includes(file: Path, tree: Value) -> list[NamedInclude]:
    """The includes of `tree`, the pipeline `file`."""
    for key, value in tree.entries.items():
        if key not in FILE_KEYS:
            cause = f"a pipeline whose includes have names has no '{key}' of its own"
            refuse(value, cause, "move it into an included file, or into its `set`", at_key=True)
    include = tree.entries["include"]
    if include.items and len(include.items) > ROBOTS_MAX:
        cause = f"at most {ROBOTS_MAX} robots are possible in a pipeline"
        refuse(include, cause, "start another engine with the others")
    includes: list[NamedInclude] = []
    for value in include.items or [include]:
        read = read_include(file, value)
        if read.name in [other.name for other in includes]:
            refuse(value.entries["as"], f"two robots are called '{read.name}'", "rename one")
        includes.append(read)
    return includes


def read_include(file: Path, value: Value) -> NamedInclude:
    """What an include with a name states. Raises ConfigurationError."""
    if not value.entries:
        refuse(value, "either all includes have a name or none", EXAMPLE)
    for key, entry in value.entries.items():
        if key not in INCLUDE_KEYS:
            near = closest_match(key, INCLUDE_KEYS)
            fix = f"did you mean {near}?" if near else f"it has {join_words(INCLUDE_KEYS, 'and')}"
            refuse(entry, f"an include has no '{key}'", fix, at_key=True)
    name = _text(value, "as")
    if not is_name(name) or name in RESERVED:
        cause = f"'{name}' is not a valid name"
        refuse(value.entries["as"], cause, "use lower-case letters, digits and _, such as left")
    return NamedInclude(
        name,
        _find(file, value, "path", "pipelines"),
        _find(file, value, "robot", "robots") if "robot" in value.entries else None,
        _read_set(value.entries.get("set")),
        value,
    )


def _text(value: Value, key: str) -> str:
    entry = value.entries.get(key)
    if entry is None:
        refuse(value, f"the include has no '{key}'", EXAMPLE)
    if not isinstance(entry.data, str) or not entry.data.strip() or "\0" in entry.data:
        refuse(entry, f"'{key}' requires a name", EXAMPLE)
    return entry.data


def _find(file: Path, include: Value, key: str, folder: str) -> str:
    """A path counts from the including file; a name is first looked for beside it."""
    name = _text(include, key)
    value = include.entries[key]
    if lookup.is_path(name):
        found = file.parent / name
        if not lookup.is_file(found):
            refuse(value, f"there is no file {lookup.display_path(found)}", "correct the path")
        return str(found)
    beside = file.parent / f"{name}.yaml"
    if beside != file and lookup.is_file(beside) and folder == "pipelines":
        return str(beside)
    if not lookup.is_known(name, folder):
        what = folder.removesuffix("s")
        near = closest_match(name, lookup.names(folder))
        fix = f"did you mean {near}?" if near else "give a path"
        refuse(value, f"there is no {what} '{name}'", fix)
    return name


def _read_set(value: Value | None) -> list[Override]:
    """`set: {follower.tolerance: 5 cm}`, as `--set` of the included pipeline."""
    if value is None:
        return []
    if not isinstance(value.data, dict):
        refuse(value, "'set' requires a mapping", "write `set: {follower.tolerance: 5 cm}`")
    overrides = []
    for path, entry in value.entries.items():
        steps = tuple(path.split("."))
        is_short = len(steps) < 2 and path not in WHOLE_SECTIONS
        if not all(steps) or is_short or len(steps) > STEPS_MAX:
            cause = f"'{path[:60]}' names no value"
            fix = "write block.parameter, or robot.limits.speed"
            refuse(entry, cause, fix, at_key=True)
        overrides.append(Override(steps, entry, entry.name_place))
    return overrides


def _check_overrides(overrides: Iterable[Override], names: list[str]) -> None:
    problems = []
    for override in overrides:
        first = override.steps[0]
        if first not in names:
            near = closest_match(first, names)
            fix = f"did you mean {near}?" if near else f"begin with one of {', '.join(names)}"
            cause = f"the pipeline has no robot '{first}'"
            problems.append(Problem("E-SET", override.place, cause, fix))
        elif len(override.steps) < 3 and override.steps[1] not in WHOLE_SECTIONS:
            cause, fix = "this names no value", f"write --set {first}.block.parameter=value"
            problems.append(Problem("E-SET", override.place, cause, fix))
    if problems:
        raise ConfigurationError(problems)


def _check_robot(include: NamedInclude, loaded: Configuration) -> None:
    """Refuse what works only in an engine with one robot."""
    if (remaps := include.value.at("in")) is not None:
        cause = "wires between robots are not possible: each has a pipeline of its own"
        refuse(remaps, cause, "remove `in`", at_key=True)
    if loaded.robot is None or "wheels" not in loaded.robot_wires:
        cause = f"{include.path} drives no robot, and others of these includes do"
        fix = "include one that drives a robot without `as`, and this one with a name"
        refuse(include.value, cause, fix)
    sections = (("programs", loaded.programs), ("sources", loaded.sources))
    own = [key for key, uses in sections if uses]
    if own:
        cause = f"{include.path} has {join_words(own, 'and')}, which several robots cannot have"
        refuse(include.value, cause, "run it in an engine of its own")


def refuse(value: Value, cause: str, fix: str, at_key: bool = False) -> NoReturn:
    """Raise ConfigurationError at an include, or at one of its keys."""
    place = value.name_place if at_key else value.place
    raise ConfigurationError(Problem("E-INCLUDE", place, cause, fix))
