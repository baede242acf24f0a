"""Loads robot and pipeline files into a checked Configuration.

Steps: `source_tree` reads a file with its includes, overrides and variables; `robot_tree` applies
common and calibrated values of a robot; `section_reader` converts the tree to typed values; the
checks compare them with each other. All problems of all files are reported together.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias, TypeVar

from diffbotctl.block import Block, robot_fields
from diffbotctl.config import lookup, registry, robot_tree, source_tree, yaml_reader
from diffbotctl.config.checks import CHECKS
from diffbotctl.config.checks.block_needs import omit_unusable_blocks
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.checks.graph import loops
from diffbotctl.config.code_files import CodeFiles, is_code
from diffbotctl.config.configuration import (
    BlockEntry,
    BlockUse,
    Configuration,
    Omission,
    Pipeline,
    RobotFile,
)
from diffbotctl.config.declared_inputs import (
    mark_motion,
    read_inputs,
    read_lidars,
    read_programs,
    read_sources,
)
from diffbotctl.config.faults import read_sizes
from diffbotctl.config.motor_pulses import calibrated_pulses, fields_of_other_pulses, fill_shorted
from diffbotctl.config.named_parts import has_parts, join_parts, load_parts
from diffbotctl.config.named_robots import load_named_robots
from diffbotctl.config.robot import Robot, field_value, fill_defaults
from diffbotctl.config.section_reader import read_parameters, read_section
from diffbotctl.config.source_tree import Override
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Problem, UsageError, UserError, closest_match
from diffbotctl.params import Section, declared
from diffbotctl.physics_model import Plant

FILE_KINDS: dict[str, type[Section]] = {"robot": Robot, "pipeline": Pipeline}
KINDS = tuple(FILE_KINDS)
Name = TypeVar("Name", str, "str | None")
TreeReader: TypeAlias = Callable[
    [Path, Iterable[source_tree.Override], list[Problem]], tuple[Value, list[Path]]
]


def load(
    pipeline: str,
    robot: str | None = None,
    sets: Sequence[str] = (),
    *,
    real: bool = False,
    refuse_simulated: bool = False,
    robot_files: Mapping[str, str] | None = None,
    code: CodeFiles | None = None,
    default_robot: str | None = None,
) -> Configuration:
    """Read and check the pipeline called `pipeline` and its robot.

    Both are names or paths; `robot` has priority over `use` in the pipeline. `sets` are texts of
    the form `block.param=value`. `real`: for a run on a real robot; this adds checks that matter
    only there. `refuse_simulated`: results of a simulated robot are an error. `robot_files`: of a
    pipeline of several robots, by their names. `code`: where a replay finds files with code.
    `default_robot`: of a pipeline that names none, in place of the one in ./robots. Raises
    ConfigurationError with every problem of all files at once, CodeConsentError if there is none
    but that the user has not consented to code.
    """
    loader = _Loader(sets, real, refuse_simulated, code=code, default_robot=default_robot)
    try:
        return loader.load_pipeline(pipeline, robot)
    except source_tree.NamedIncludesError as named:
        if has_parts(lookup.find_pipeline(pipeline), named.tree):
            return loader.load_with_parts(pipeline, robot, named.tree)
        if robot is not None:
            cause, fix = (
                "several robots are in this pipeline",
                "write `robot: NAME` in its includes",
            )
            raise UsageError(Problem("E-SEVERAL-ROBOTS", "--robot", cause, fix)) from None
        return loader.load_named(pipeline, named.tree, robot_files or {})


def load_robot(
    robot: str | None = None,
    sets: Sequence[str] = (),
    *,
    real: bool = False,
    refuse_simulated: bool = False,
) -> RobotFile:
    """Read and check one robot file by name or path; None: the default robot.

    `real` and `refuse_simulated`: as for `load`. Raises ConfigurationError.
    """
    return _Loader(sets, real, refuse_simulated).load_robot(robot)


def check(
    name: str, robot: str | None = None, sets: Sequence[str] = (), *, real: bool = False
) -> tuple[Problem, ...]:
    """Every problem of the robot or pipeline file `name`, as `check_all` finds them."""
    return check_all(name, robot, sets, real=real)[0]


def check_all(
    name: str,
    robot: str | None = None,
    sets: Sequence[str] = (),
    *,
    real: bool = False,
    default_robot: str | None = None,
) -> tuple[tuple[Problem, ...], tuple[Omission, ...]]:
    """Every problem of the robot or pipeline file `name`, and the blocks that are left out.

    Its `kind` decides which file it is. A name without a path is looked up among pipelines, then
    among robots.
    """
    try:
        if _is_robot(name):
            return load_robot(name, sets, real=real, refuse_simulated=real).warnings, ()
        loaded = load(
            name, robot, sets, real=real, refuse_simulated=real, default_robot=default_robot
        )
        return loaded.warnings, loaded.all_omissions()
    except UserError as error:
        return error.problems, ()


def takes_robot(name: str) -> bool:
    """Whether `check` reads `name` as a pipeline, for which a robot can be chosen."""
    try:
        return not _is_robot(name)
    except UserError:
        return True  # `check` reports what is wrong with it


def _is_robot(name: str) -> bool:
    if not lookup.is_path(name):
        return not lookup.is_known(name, "pipelines") and lookup.is_known(name, "robots")
    try:
        tree = yaml_reader.read(name)
    except ConfigurationError:
        return Path(name).parent.name == "robots"
    return _kind_of(tree) == "robot"


def _is_robot_file(file: Path) -> bool:
    """True when `file` exists and can be read as a robot file."""
    try:
        return _kind_of(yaml_reader.read(str(file))) == "robot"
    except (ConfigurationError, ValueError):
        return False


def _kind_of(tree: Value) -> str:
    """`robot` or `pipeline`: what a file is, by its `kind`, or without one by its sections."""
    kind = tree.entries.get("kind") or _misspelt_kind(tree)
    if kind is not None:
        if kind.text in KINDS:  # `closest_match` would import difflib at every start
            return kind.text
        written = closest_match(kind.text, KINDS)
        if written is not None:
            return written
    kind_by_sections = _kind_by_sections(tree)
    if kind_by_sections is not None:
        return kind_by_sections
    include = tree.entries.get("include")
    is_robot = include is not None and not lookup.is_path(include.text) and _is_robot(include.text)
    return "robot" if is_robot or {"drive", "board"} & tree.entries.keys() else "pipeline"


class _Loader:
    """Reads one pipeline or robot and collects every problem on the way."""

    def __init__(
        self,
        sets: Sequence[str],
        real: bool,
        refuse_simulated: bool,
        overrides: Sequence[Override] = (),
        code: CodeFiles | None = None,
        default_robot: str | None = None,
    ) -> None:
        """`overrides` come before those in `sets`."""
        self.code, self.default_robot = code or CodeFiles(), default_robot
        self.context = CheckContext(real=real, refuse_simulated=refuse_simulated)
        self.problems = self.context.problems
        self.sets = tuple(sets)
        self.overrides = [*overrides, *source_tree.parse_overrides(sets, self.problems)]
        self.files: list[Path] = []

    def load_pipeline(
        self, name: str, robot: str | None, read: TreeReader = source_tree.read_pipeline
    ) -> Configuration:
        file = self._find(lookup.find_pipeline, name)
        tree = self._read_tree(file, read) if file else None
        if tree is not None:
            self._read_pipeline(tree)
        robot_file = self._load_robot_of_pipeline(robot)
        read_lidars(self.context)
        omit_unusable_blocks(self.context)
        mark_motion(self.context)
        self._check()
        context = self.context
        assert file is not None
        assert context.pipeline is not None
        robot_use = context.pipeline.robot
        return Configuration(
            name=file.stem,
            file=file,
            robot=context.robot,
            nominal=context.nominal,
            robot_file=robot_file,
            blocks=tuple(self._use(*item) for item in context.pipeline.blocks.items()),
            robot_wires=dict(robot_use.wires) if robot_use else {},
            goals=tuple(context.pipeline.goals),
            world=context.pipeline.world,
            files=tuple(self.files),
            warnings=tuple(self.problems),
            settings=self.sets,
            inputs=tuple(context.inputs.values()),
            programs=tuple(context.programs.values()),
            sources=tuple(context.sources.values()),
            omissions=tuple(context.omissions),
            code=self.code.hashes(),
        )

    def load_named(self, name: str, tree: Value, robot_files: Mapping[str, str]) -> Configuration:
        """The pipeline called `name` of several robots; `tree` is its file."""
        file = self._find_named(name, tree)
        try:
            loaded = load_named_robots(file, tree, self.overrides, robot_files, self._load_one)
        except ConfigurationError as error:
            raise self.code.error(error.problems) from None
        return replace(loaded, settings=self.sets, code=self.code.hashes())

    def _find_named(self, name: str, tree: Value) -> Path:
        """The pipeline file whose includes have names. Raises ConfigurationError for another."""
        wrong = _wrong_kind(tree, "pipeline")
        if wrong is not None or self.problems:
            raise ConfigurationError([*([] if wrong is None else [wrong]), *self.problems])
        return lookup.find_pipeline(name)

    def _load_one(self, path: str, robot: str | None, overrides: list[Override]) -> Configuration:
        context = self.context
        loader = _Loader((), context.real, context.refuse_simulated, overrides, self.code)
        return loader.load_pipeline(path, robot)

    def load_with_parts(self, name: str, robot: str | None, tree: Value) -> Configuration:
        """The pipeline called `name`, which includes others under names; `tree` is its file."""
        file = self._find_named(name, tree)
        try:
            parts = load_parts(file, tree, self.overrides, self._load_one)
        except ConfigurationError as error:
            raise self.code.error(error.problems) from None
        self.context.parts = {part.name: part for part in parts}
        self.overrides = [
            override for override in self.overrides if override.steps[0] not in self.context.parts
        ]
        read = partial(source_tree.read_pipeline, skips_named=True)
        whole = self.load_pipeline(name, robot, read)
        return join_parts(whole, parts, self.context.moving_parts, loops)

    def load_robot(self, name: str | None) -> RobotFile:
        file = self._find_and_read_robot(name)
        self._check()
        context = self.context
        assert file is not None
        assert context.robot is not None
        assert context.nominal is not None
        return RobotFile(
            context.robot, context.nominal, file, tuple(self.files), tuple(self.problems)
        )

    def _check(self) -> None:
        """Run every check. Raises ConfigurationError when there is any error."""
        for check in CHECKS:
            check(self.context)
        self.problems[:] = _without_repetition(self.problems)
        if any(problem.severity == "error" for problem in self.problems):
            raise self.code.error(self.problems)

    def _find(self, find: Callable[[Name], Path], name: Name) -> Path | None:
        try:
            return find(name)
        except UserError as error:
            self.problems += error.problems
            return None

    def _read_tree(self, file: Path, read: TreeReader) -> Value | None:
        count = len(self.problems)
        try:
            tree, files = read(file, self.overrides, self.problems)
        except ConfigurationError as error:
            self.problems += error.problems
            return None
        self.files += files
        expected = "robot" if read is source_tree.read_robot else "pipeline"
        problem = _wrong_kind(tree, expected)
        if problem is not None:
            self.problems[count:] = [problem]  # everything else would follow from this one
            return None
        return tree

    def _read_pipeline(self, tree: Value) -> None:
        pipeline = read_section(tree, Pipeline, "the pipeline file", self.problems)
        self.context.pipeline_tree, self.context.pipeline = tree, pipeline
        read_inputs(self.context)
        read_programs(self.context, self.files)
        read_sources(self.context)
        for name, entry in (pipeline.blocks or {}).items():
            if entry is not None and entry.block is not None:
                self._read_block(name, entry.block, tree.entries["blocks"].entries[name])

    def _read_block(self, name: str, kind: str, value: Value) -> None:
        written = value.entries["block"]
        try:
            if is_code(kind):
                file = lookup.file_of(written.value_place.source.name, self.files)
                block = self.code.find(kind, file, Block)
            else:
                block = registry.block(kind)
        except registry.RegistryError as error:
            place = error.place or written.place
            self.problems.append(Problem(error.code, place, str(error), error.fix))
            return
        self.context.block_classes[name] = block
        parameters = value.at("with") or Value({}, value.value_place, value.key_place)
        if isinstance(parameters.data, dict):
            self.context.parameters[name] = read_parameters(
                parameters, block, f"{name}.with", self.problems
            )

    def _load_robot_of_pipeline(self, name: str | None) -> Path | None:
        """Read the pipeline's robot, if it has one; `name` has priority over `use`."""
        tree, pipeline = self.context.pipeline_tree, self.context.pipeline
        if tree is not None and "robot" not in tree.entries:
            return None
        use = tree.at("robot", "use") if tree is not None else None
        if name is not None or use is None or pipeline is None:
            return self._find_and_read_robot(name)
        if pipeline.robot is None or pipeline.robot.use is None:
            return self._find_and_read_robot(None)
        return self._load_robot_in_use(use, pipeline.robot.use)

    def _load_robot_in_use(self, use: Value, name: str) -> Path | None:
        """The robot that the pipeline names; a path counts from the pipeline's folder.

        A name is first looked for beside the pipeline.

        A problem of the robot file as a whole is shown where the pipeline names it.
        """
        count = len(self.problems)
        beside = self._folder_of(use) / f"{name}.yaml"
        is_other_file = not lookup.is_path(name) and beside not in self.files
        if is_other_file and _is_robot_file(beside):
            return self._read_robot(beside)
        file = self._find(lookup.find_robot, name)
        if lookup.is_path(name):
            file = self._read_robot(self._folder_of(use) / name)
        self.problems[count:] = [
            replace(problem, place=use.place) if problem.line == 0 else problem
            for problem in self.problems[count:]
        ]
        if file is not None and not lookup.is_path(name):
            self._read_robot(file)
        return file

    def _folder_of(self, value: Value) -> Path:
        """The folder of the file that `value` was written in."""
        for file in self.files:
            if lookup.display_path(file) == value.value_place.source.name:
                return file.parent
        return Path()

    def _find_and_read_robot(self, name: str | None) -> Path | None:
        file = self._find(lookup.find_robot, name or self.default_robot)
        return self._read_robot(file) if file else None

    def _read_robot(self, file: Path) -> Path:
        tree = self._read_tree(file, source_tree.read_robot)
        if tree is None:
            return file
        tree = self._without_other_pulses(robot_tree.spell_out_missing_encoders(tree))
        calibrated = robot_tree.overlay_calibration(tree, self.problems)
        whole = robot_tree.copy_common_to_sides(calibrated)
        robot = self._robot_of(whole, self.problems)
        self.context.robot_tree, self.context.robot = whole, robot
        self.context.nominal = robot
        if robot.calibration:
            stated = robot_tree.copy_common_to_sides(tree)
            self.context.nominal = self._robot_of(stated, [])
        return file

    def _plant(self, text: str, value: Value, problems: list[Problem]) -> type[Plant] | None:
        """The class of physics that the robot file names."""
        try:
            if is_code(text):
                file = lookup.file_of(value.value_place.source.name, self.files)
                return self.code.find(text, file, Plant)
            return registry.plant(text)
        except registry.RegistryError as error:
            problems.append(Problem(error.code, error.place or value.place, str(error), error.fix))
            return None

    def _robot_of(self, tree: Value, problems: list[Problem]) -> Robot:
        robot = read_section(tree, Robot, "the robot file", problems)
        faults = tree.at("simulation", "faults")
        if robot.simulation is not None and faults is not None:
            read_sizes(robot.simulation.faults, faults.items, problems)
        plant = tree.at("simulation", "plant")
        if robot.simulation is not None and robot.simulation.plant and plant is not None:
            robot.simulation.plant = self._plant(robot.simulation.plant, plant, problems)
        fill_defaults(robot)
        fill_shorted(robot)
        return robot

    def _without_other_pulses(self, tree: Value) -> Value:
        """The tree without the results of a calibration with other pulses of the motors."""
        if "calibration" not in tree.entries:
            return tree
        stated = read_section(robot_tree.copy_common_to_sides(tree), Robot, "the robot file", [])
        fields = fields_of_other_pulses(stated)
        if fields:
            entry = tree.at("calibration", fields[0])
            now = "in1 and in2" if calibrated_pulses(stated) == "inputs" else "enable"
            others = f" and {len(fields) - 1} more" if fields[1:] else ""
            self.problems.append(
                Problem(
                    "W-CALIBRATION-PULSES",
                    entry.name_place if entry is not None else "calibration",
                    f"{fields[0]}{others}: measured with other pulses of the motors than those on "
                    f"{now}, and not used",
                    "run `diffbotctl calibrate motors` again, or set pulses as they were",
                    "warning",
                )
            )
        for field in fields:
            tree = tree.with_entry(("calibration", field), None)
        return tree

    def _use(self, name: str, entry: BlockEntry) -> BlockUse:
        context = self.context
        block = context.block_classes[name]
        values = dict(context.parameters[name])
        for attribute, path in robot_fields(block).items():
            values[attribute] = field_value(context.robot, path)
        value = context.pipeline_value("blocks", name)
        assert value is not None
        return BlockUse(name, entry.block, block, values, dict(entry.wires), value.place)


def _misspelt_kind(tree: Value) -> Value | None:
    """The entry of a file without a `kind` that probably is it."""
    known = set[str]().union(*(declared(owner) for owner in FILE_KINDS.values()))
    name = closest_match("kind", [name for name in tree.entries if name not in known])
    return None if name is None else tree.entries[name]


def _kind_by_sections(tree: Value) -> str | None:
    """The kind of file of which it has sections; None when it has them of both or of none."""
    kinds = {
        kind
        for kind, owner in FILE_KINDS.items()
        for other in FILE_KINDS.values()
        if other is not owner
        and tree.entries.keys() & (declared(owner).keys() - declared(other).keys())
    }
    return kinds.pop() if len(kinds) == 1 else None


def _wrong_kind(tree: Value, expected: str) -> Problem | None:
    """The problem of a file without a `kind`, or of the other one; None for a right one."""
    kind, actual = tree.entries.get("kind"), _kind_of(tree)
    article = f"a {expected} file is required here"
    other = _kind_by_sections(tree)
    if kind is not None and kind.text == "trials":
        cause = f"this is a file of trials, but {article}"
        return Problem("E-KIND", kind.place, cause, "`diffbotctl trials FILE` runs it")
    if kind is not None and actual == expected and other not in (None, expected):
        cause = f"kind is {kind.text}, but the sections are those of a {other} file"
        return Problem("E-KIND", kind.place, cause, f"write kind: {other}")
    if actual != expected:
        cause = f"this is a {actual} file, but {article}"
        fix = (
            "give the name of a pipeline, and this file as `--robot FILE`"
            if expected == "pipeline"
            else "give the name of a robot file"
        )
        return Problem("E-KIND", kind.place if kind is not None else tree.place, cause, fix)
    if kind is None:
        fix, misspelt = f"write `kind: {expected}`", _misspelt_kind(tree)
        if misspelt is not None:
            cause = "the file does not state its kind: this key is misspelt"
            return Problem("E-KIND", misspelt.name_place, cause, fix)
        cause = "the file does not state its kind"
        return Problem("E-KIND", tree.place, cause, f"add the line `kind: {expected}`")
    return None


def _without_repetition(problems: Iterable[Problem]) -> list[Problem]:
    """The problems without repetition, in the order of their files and lines."""
    first: dict[tuple[object, ...], Problem] = {}
    problems = list(problems)
    unknown = {str(problem.place) for problem in problems if problem.code == "E-VAR-UNKNOWN"}
    for problem in problems:
        if str(problem.place) in unknown and problem.code != "E-VAR-UNKNOWN":
            continue  # a consequence of the variable that is not set
        # A common part of `drive` is read once for itself and once for each side.
        cause = re.sub(r"\bdrive\.(?:left|right)\.", "drive.", problem.cause)
        first.setdefault((problem.code, str(problem.place), cause), problem)
    return sorted(first.values(), key=lambda problem: (problem.file, problem.line, problem.column))
