"""The tree of one robot or pipeline file, with its includes, `--set` and variables applied.

Each value keeps the place where it was written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NoReturn

from diffbotctl.config import lookup, yaml_reader
from diffbotctl.config.robot import Robot
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import (
    ConfigurationError,
    Place,
    Problem,
    Source,
    UserError,
    closest_match,
    join_words,
)
from diffbotctl.params import declared

INCLUDE_DEPTH_MAX = 10  # files
INCLUDES_MAX_COUNT = 40  # files that are read for one file, each as often as it is included
INCLUDED_MAX_VALUES = 40_000  # in all of them; a robot file has about 150
VARIABLE = r"[A-Za-z_][A-Za-z0-9_]*"
WHOLE_VARIABLE = re.compile(rf"\$({VARIABLE})\Z")
ANY_VARIABLE = re.compile(rf"\$\$|\$({VARIABLE})")
FIXED_KEYS = ("format", "kind", "include")  # of the robot file
OTHER_ROBOT = "name another file with --robot, or change one value: --set robot.drive.track='13 cm'"
OVERRIDE_SHAPE = "write --set block.parameter=value, such as --set follower.tolerance='20 mm'"


@dataclass(frozen=True)
class Override:
    """One `--set path=value`. `place` is the path's place in the words of the command line."""

    steps: tuple[str, ...]
    value: Value
    place: Place


class NamedIncludesError(Exception):
    """The pipeline file that is read gives names to its includes; `tree` is the file alone."""

    def __init__(self, tree: Value) -> None:
        super().__init__("the includes have names")
        self.tree = tree


def parse_overrides(texts: Iterable[str], problems: list[Problem]) -> list[Override]:
    """The overrides in `texts`; those that cannot be read go to `problems`."""
    overrides: list[Override] = []
    for text in texts:
        try:
            overrides.append(_parse_override(text))
        except ConfigurationError as error:
            problems += error.problems
    return overrides


def _parse_override(text: str) -> Override:
    source = Source("--set", text)
    path, equals, written = text.partition("=")
    steps = tuple(path.strip().split("."))
    place = Place(source, 1, 1, max(1, len(path)))
    if not equals or not all(steps):
        cause = "--set requires path=value"
        raise ConfigurationError(Problem("E-SET", place, cause, OVERRIDE_SHAPE))
    column = len(path) + 1
    value = yaml_reader.parse_any(source, " " * column + written)
    if value is None:
        end = Place(source, 1, column + 1)
        raise ConfigurationError(Problem("E-SET", end, "the value is missing", OVERRIDE_SHAPE))
    return Override(steps, replace(value, key_place=place), place)


def read_robot(
    path: Path, overrides: Iterable[Override], problems: list[Problem]
) -> tuple[Value, list[Path]]:
    """The tree of the robot file at `path`, and every file that was read.

    Raises ConfigurationError for a file that cannot be read; smaller mistakes go to `problems`.
    """
    tree, paths = _read_with_includes(path, "robots")
    for override in overrides:
        first, *steps = override.steps
        if first != "robot":
            continue
        if not steps or steps[0] in FIXED_KEYS:
            cause = f"{'.'.join(override.steps)} cannot be changed by --set"
            problems.append(Problem("E-SET", override.place, cause, OTHER_ROBOT))
        elif missing := _missing_item(tree, steps, override):
            problems.append(missing)
        else:
            tree = tree.with_entry(steps, override.value)
    return _substitute(tree, problems), paths


def read_pipeline(
    path: Path, overrides: Iterable[Override], problems: list[Problem], *, skips_named: bool = False
) -> tuple[Value, list[Path]]:
    """As `read_robot`, of the pipeline file at `path`. Raises NamedIncludesError.

    `skips_named`: without the includes that have names, and it need not have blocks of its own.
    """
    tree, paths = _read_with_includes(path, "pipelines", skips_named)
    if skips_named and "blocks" not in tree.entries:
        tree = tree.with_entry(("blocks",), Value({}, tree.value_place, tree.key_place))
    blocks = tree.entries.get("blocks")
    names = list(blocks.entries) if blocks else []
    devices = tree.entries.get("sources")
    sources = list(devices.entries) if devices else []
    for override in overrides:
        first, *rest = _without_sections(override.steps)
        steps: Sequence[str] = ()
        if first in ("goals", "world") or (first == "vars" and rest):
            steps = override.steps
        elif not rest:
            if first != "robot":  # `read_robot` reports that
                cause = "--set requires block.parameter=value"
                problems.append(Problem("E-SET", override.place, cause, OVERRIDE_SHAPE))
        elif first in names:
            steps = ("blocks", first, "with", *rest)
        elif first in sources:
            steps = ("sources", first, "with", *rest)
        elif first != "robot":
            near = closest_match(first, [*names, *sources, "robot", "vars"])
            has = ", ".join([*names, *sources, "robot", "vars"])
            fix = f"did you mean {near}?" if near else f"use one of {has}"
            if first in declared(Robot):
                fix = f"write robot.{'.'.join(override.steps)}, for a value of the robot file"
            cause = f"the pipeline has no block '{first}'"
            problems.append(Problem("E-SET", override.place, cause, fix))
        missing = _missing_item(tree, steps, override)
        if missing is not None:
            problems.append(missing)
        elif steps:
            tree = tree.with_entry(steps, override.value)
    return _substitute(tree, problems), paths


def _missing_item(tree: Value, steps: Sequence[str], override: Override) -> Problem | None:
    """The problem of a path that names an item which a list of `tree` does not have."""
    value: Value | None = tree
    for number, step in enumerate(steps):
        if value is None:
            return None
        if not isinstance(value.data, list):
            value = value.entries.get(step)
            continue
        count = len(value.items)
        if step.isdecimal() and int(step[:9]) < count:
            value = value.items[int(step)]
            continue
        name = ".".join(steps[:number])
        has = f"{name} has {count} items" if count != 1 else f"{name} has one item"
        cause = f"{has}, and none is called {step}" if count else f"{name} is an empty list"
        last = "" if count < 2 else f" to {name}.{count - 1}"
        whole = f"write the whole list: --set {name}='[...]'"
        fix = f"items count from 0: {name}.0{last}; or {whole}" if count else whole
        return Problem("E-SET", override.place, cause, fix)
    return None


def _without_sections(steps: Sequence[str]) -> Sequence[str]:
    """`steps` without the sections `blocks` and `with`, which messages and files name."""
    if len(steps) > 2 and steps[0] in ("blocks", "sources"):
        steps = steps[1:]
    return (steps[0], *steps[2:]) if len(steps) > 2 and steps[1] == "with" else steps


def _read_with_includes(
    path: Path, folder: str, skips_named: bool = False
) -> tuple[Value, list[Path]]:
    """The file at `path` merged over its includes, and every file that was read.

    `folder` is where bare names are looked up. Raises ConfigurationError.
    """
    reader = _IncludeReader(folder, skips_named)
    return reader.read(path, ()), reader.paths


@dataclass(eq=False, repr=False)
class _IncludeReader:
    """Reads a file with its includes. `paths` lists every file that was read."""

    folder: str
    skips_named: bool = False
    paths: list[Path] = field(default_factory=list)
    count: int = 0
    values: int = 0

    def read(self, path: Path, including: Sequence[Path]) -> Value:
        """`including` are the files that include this one, outermost first."""
        own = yaml_reader.read(str(path), lookup.display_path(path), not lookup.is_shipped(path))
        self.values += own.size
        if path not in self.paths:
            self.paths.append(path)
        include = own.entries.get("include")
        if include is None:
            return own
        items = include.items or [include]
        if self.folder == "pipelines" and any(isinstance(item.data, dict) for item in items):
            if including:
                cause = "names of includes are possible only in the file that is run"
                _refuse_include(include, cause, "give the names there")
            if not self.skips_named:
                raise NamedIncludesError(own)
            items = [item for item in items if not isinstance(item.data, dict)]
        base: Value | None = None
        for name in items:
            included = self._included(name, path, [*including, lookup.real_path(path)])
            base = included if base is None else _merge(included, base)
        return own if base is None else _merge(own, base)

    def _included(self, name: Value, path: Path, including: list[Path]) -> Value:
        if not isinstance(name.data, str) or not name.data.strip() or "\0" in name.data:
            cause = "include requires the name or path of a file"
            _refuse_include(name, cause, "write `include: book_2wd`")
        file = self._find(name, path)
        self._count_include(name)
        if len(including) > INCLUDE_DEPTH_MAX:
            cause = f"files include files more than {INCLUDE_DEPTH_MAX} levels deep"
            _refuse_include(name, cause, "include the innermost file directly")
        if lookup.real_path(file) in including:
            names = " -> ".join(path.name for path in [*including, file])
            _refuse_include(name, f"the files include each other: {names}", "remove one include")
        try:
            return self.read(file, including)
        except ConfigurationError as error:
            whole_file = [problem for problem in error.problems if problem.line == 0]
            if not whole_file:
                raise
            raise ConfigurationError(
                Problem("E-INCLUDE", name.place, problem.cause, problem.fix)
                for problem in whole_file
            ) from None

    def _count_include(self, name: Value) -> None:
        """Bound the total work: ten files that include ten others each are read in no time."""
        self.count += 1
        if self.count > INCLUDES_MAX_COUNT or self.values > INCLUDED_MAX_VALUES:
            files, values = INCLUDES_MAX_COUNT, INCLUDED_MAX_VALUES
            cause = f"all includes together read more than {files} files or {values} values"
            _refuse_include(name, cause, "include fewer files")

    def _find(self, include: Value, path: Path) -> Path:
        """A path counts from the including file; a name is first looked for beside it."""
        name = str(include.data)
        if lookup.is_path(name):
            return path.parent / name
        beside = path.parent / f"{name}.yaml"
        shipped = lookup.folder(self.folder) / f"{name}.yaml"
        for candidate in (beside, shipped):
            if lookup.is_file(candidate):
                return candidate
        try:
            return lookup.find(name, self.folder)
        except UserError as error:
            _refuse_include(include, error.problems[0].cause, error.problems[0].fix)


def _merge(own: Value, base: Value) -> Value:
    """`own` over `base`, key by key; an entry of `calibration` is one result and stays whole."""
    merged = own.merged_over(base)
    results = own.at("calibration")
    for path, entry in results.entries.items() if results else ():
        merged = merged.with_entry(("calibration", path), entry)
    return merged


def _refuse_include(name: Value, cause: str, fix: str) -> NoReturn:
    raise ConfigurationError(Problem("E-INCLUDE", name.place, cause, fix)) from None


def _substitute(tree: Value, problems: list[Problem]) -> Value:
    """`tree` with every `$name` replaced from its `vars`; `$$` is a dollar sign.

    An unknown name is an error, one that is never used a warning; both go to `problems`.
    """
    variables = tree.entries.get("vars")
    substitution = _Substitution(variables.entries if variables else {}, problems)
    entries = {
        name: value if name == "vars" else substitution.apply(value)
        for name, value in tree.entries.items()
    }
    for name in substitution.variables.keys() - substitution.used:
        value = substitution.variables[name]
        cause, fix = f"the variable {name} is never used", f"remove it, or use it as ${name}"
        place = value.name_place
        problems.append(Problem("W-VAR-UNUSED", place, cause, fix, "warning"))
    return replace(tree, data=entries)


@dataclass(eq=False, repr=False)
class _Substitution:
    """Replaces variables by their values. `used` are the names that occurred."""

    variables: dict[str, Value]
    problems: list[Problem]
    used: set[str] = field(default_factory=set)

    def apply(self, value: Value) -> Value:
        if isinstance(value.data, dict):
            entries = {name: self.apply(entry) for name, entry in value.data.items()}
            return replace(value, data=entries)
        if isinstance(value.data, list):
            return replace(value, data=[self.apply(item) for item in value.data])
        if "$" not in value.text:
            return value
        names = [name for name in ANY_VARIABLE.findall(value.text) if name]
        unknown = [name for name in names if name not in self.variables]
        self.problems += [self._unknown(value, name) for name in unknown]
        self.used |= set(names)
        if unknown:
            return value
        if whole := WHOLE_VARIABLE.match(value.text):
            # A mistake in the variable's value is reported where the variable is used.
            variable = self.variables[whole[1]]
            return replace(variable, value_place=value.value_place, key_place=value.key_place)
        return self._interpolate(value)

    def _interpolate(self, value: Value) -> Value:
        text = ANY_VARIABLE.sub(
            lambda match: self.variables[match[1]].text if match[1] else "$", value.text
        )
        data: bool | int | float | str | None = text
        if not value.quoted:
            try:
                data = yaml_reader.resolve(text)
            except yaml_reader.ScalarError as error:
                problem = Problem("E-YAML-NUMBER", value.value_place, str(error), error.fix)
                self.problems.append(problem)
        return replace(value, data=data, text=text)

    def _unknown(self, value: Value, name: str) -> Problem:
        near = closest_match(name, self.variables)
        if near:
            fix = f"did you mean ${near}?"
        elif self.variables:
            names = join_words(self.variables, "and")
            fix = f"vars defines {names}; write $$ for a dollar sign"
        else:
            fix = f"add `vars: {{{name}: ...}}`; write $$ for a dollar sign"
        return Problem("E-VAR-UNKNOWN", value.place, f"there is no variable {name}", fix)
