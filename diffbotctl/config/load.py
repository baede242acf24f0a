"""From names and files to a checked Configuration, or to all that is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from diffbotctl.block import Block, robot_fields
from diffbotctl.config import (
    calibration_overlay,
    drive_sides,
    include,
    lookup,
    optional_blocks,
    overrides,
    registry,
    schema,
    schema_check,
    variables,
    yaml_reader,
)
from diffbotctl.config.check_context import CheckContext
from diffbotctl.config.checks.all_checks import CHECKS
from diffbotctl.config.configuration import BlockUse, Configuration, RobotFile
from diffbotctl.config.pipeline import BlockEntry, Pipeline
from diffbotctl.config.robot import Robot
from diffbotctl.config.typed_reader import Reader
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Problem, UserError, closest_match
from diffbotctl.params import declared


def load(
    pipeline: str,
    robot: str | None = None,
    sets: Sequence[str] = (),
    *,
    real: bool = False,
) -> Configuration:
    """Read and check the pipeline called `pipeline` and its robot.

    Both are names or paths; `robot` wins over the pipeline's own `use`. `sets` are texts of the
    form `block.param=value`. `real`: a real robot is about to move, which adds the warnings that
    matter only then. Raises ConfigurationError with every problem of all files at once.
    """
    loader = _Loader(sets, real)
    return loader.pipeline(pipeline, robot)


def load_robot(
    robot: str | None = None, sets: Sequence[str] = (), *, real: bool = False
) -> RobotFile:
    """Read and check one robot file, found by name, by path or by the rules for none given.

    Raises ConfigurationError.
    """
    loader = _Loader(sets, real)
    return loader.robot_alone(robot)


def check(
    name: str, robot: str | None = None, sets: Sequence[str] = (), *, real: bool = False
) -> tuple[Problem, ...]:
    """Every problem of the robot or pipeline file called `name`; what it is, its `kind` says.

    A name without a path is looked up among pipelines, then among robots.
    """
    try:
        if _is_robot(name):
            return load_robot(name, sets, real=real).warnings
        return load(name, robot, sets, real=real).warnings
    except UserError as error:
        return error.problems


def _is_robot(name: str) -> bool:
    if not lookup.is_path(name):
        try:
            lookup.pipeline(name)
        except UserError:
            return lookup.is_known(name, "robots")
        return False
    try:
        kind = yaml_reader.read(name).entries.get("kind")
    except ConfigurationError:
        return Path(name).parent.name == "robots"
    return kind is not None and closest_match(kind.text, ["robot", "pipeline"]) == "robot"


class _Loader:
    """One reading of a pipeline or robot: what was found so far, right and wrong."""

    def __init__(self, texts: Sequence[str], real: bool) -> None:
        self.case = CheckContext(real=real)
        self.problems = self.case.problems
        self.texts = tuple(texts)
        self.settings = overrides.parse(texts, self.problems)
        self.files: list[Path] = []

    def pipeline(self, name: str, robot: str | None) -> Configuration:
        file = self._found(lambda: lookup.pipeline(name))
        tree = self._tree(file, "pipelines") if file else None
        if tree is not None:
            tree = self._pipeline_tree(tree)
        robot_file = self._robot_of(tree, robot)
        optional_blocks.drop_unusable_blocks(self.case)
        self._check()
        case = self.case
        assert file is not None
        assert case.pipeline is not None
        return Configuration(
            name=file.stem,
            file=file,
            robot=case.robot,
            nominal=case.nominal,
            robot_file=robot_file,
            blocks=tuple(self._use(name, entry) for name, entry in case.pipeline.blocks.items()),
            robot_wires=dict(case.pipeline.robot.wires) if case.pipeline.robot else {},
            goals=tuple(case.pipeline.goals),
            world=case.pipeline.world,
            files=tuple(self.files),
            warnings=tuple(self.problems),
            settings=self.texts,
        )

    def robot_alone(self, name: str | None) -> RobotFile:
        file = self._robot(name)
        self._check()
        case = self.case
        assert file is not None
        assert case.robot is not None
        assert case.nominal is not None
        return RobotFile(case.robot, case.nominal, file, tuple(self.files), tuple(self.problems))

    def _check(self) -> None:
        """Run every check; raise when there is any error."""
        for check in CHECKS:
            check(self.case)
        errors = [problem for problem in self.problems if problem.severity == "error"]
        self.problems[:] = _once(self.problems)
        if errors:
            raise ConfigurationError(self.problems)

    def _found(self, find: Any) -> Path | None:
        try:
            path = find()
        except UserError as error:
            self.problems += error.problems
            return None
        assert isinstance(path, Path)
        return path

    def _tree(self, file: Path, kind: str) -> Value | None:
        try:
            tree, files = include.read(file, kind)
        except ConfigurationError as error:
            self.problems += error.problems
            return None
        self.files += files
        return tree

    def _pipeline_tree(self, tree: Value) -> Value:
        tree = overrides.for_pipeline(tree, self.settings, self.problems)
        tree = variables.substitute(tree, self.problems)
        self.case.tree = tree
        self.problems += schema_check.check(tree, schema.of_section(Pipeline), "the pipeline file")
        reader = Reader()
        self.case.pipeline = reader.section(tree, Pipeline)
        self.problems += reader.problems
        for name, entry in (self.case.pipeline.blocks or {}).items():
            self._block(name, entry)
        return tree

    def _block(self, name: str, entry: BlockEntry | None) -> None:
        """Find the class of one block and read the values of its parameters."""
        value = self.case.at("blocks", name)
        if entry is None or entry.block is None or value is None:
            return
        try:
            kind = registry.block(entry.block)
        except registry.RegistryError as error:
            place = value.at("block") or value
            self.problems.append(Problem(error.code, place.spot, str(error), error.fix))
            return
        self.case.kinds[name] = kind
        given = value.at("with") or Value({}, value.place, value.key, flow=value.flow)
        if not isinstance(given.data, dict):
            return
        where = f"{name}.with"
        self.problems += schema_check.check(given, schema.of_parameters(kind), where)
        reader = Reader()
        self.case.values[name] = {
            setting.name: reader.value(given.entries[setting.key], setting.kind, setting)
            if setting.key in given.entries
            else setting.default
            for setting in declared(kind).values()
        }
        self.problems += reader.problems

    def _robot_of(self, tree: Value | None, wanted: str | None) -> Path | None:
        """Read the pipeline's robot, if it has one."""
        pipeline = self.case.pipeline
        if tree is not None and (pipeline is None or tree.at("robot") is None):
            return None
        if wanted is None and pipeline is not None and pipeline.robot is not None:
            use = self.case.at("robot", "use")
            if use is not None and pipeline.robot.use is not None:
                return self._robot_in_use(use, pipeline.robot.use)
        return self._robot(wanted)

    def _folder_of(self, value: Value) -> Path:
        """The folder of the file in which `value` stands."""
        for file in self.files:
            if lookup.display_path(file) == value.place.source.name:
                return file.parent
        return Path()

    def _robot_in_use(self, place: Value, use: str) -> Path | None:
        """The robot that the pipeline names; a path is meant from the pipeline's folder."""
        if lookup.is_path(use):
            before = len(self.problems)
            file = self._read_robot(self._folder_of(place) / use)
            self.problems[before:] = [
                Problem(each.code, place.spot, each.cause, each.fix) if each.line == 0 else each
                for each in self.problems[before:]
            ]
            return file
        try:
            lookup.robot(use)
        except UserError as error:
            first = error.problems[0]
            self.problems.append(Problem(first.code, place.spot, first.cause, first.fix))
            return None
        return self._robot(use)

    def _robot(self, name: str | None) -> Path | None:
        file = self._found(lambda: lookup.robot(name))
        return self._read_robot(file) if file else None

    def _read_robot(self, file: Path) -> Path:
        tree = self._tree(file, "robots")
        if tree is None:
            return file
        tree = overrides.for_robot(tree, self.settings)
        tree = variables.substitute(tree, self.problems)
        nominal = drive_sides.copy_common_to_sides(tree)
        tree = drive_sides.copy_common_to_sides(
            calibration_overlay.overlay_calibration(tree, self.problems)
        )
        self.case.robot_tree = tree
        whole = schema.of_section(Robot, merged=True)
        self.problems += schema_check.check(tree, whole, "the robot file")
        reader = Reader()
        self.case.robot = reader.section(tree, Robot)
        self.problems += reader.problems
        self.case.nominal = (
            Reader().section(nominal, Robot) if self.case.robot.calibration else self.case.robot
        )
        return file

    def _use(self, name: str, entry: BlockEntry) -> BlockUse:
        kind: type[Block] = self.case.kinds[name]
        values = dict(self.case.values[name])
        for attribute, path in robot_fields(kind).items():
            values[attribute] = self.case.robot_field(path)
        place = self.case.tree.at("blocks", name)  # type: ignore[union-attr]
        assert place is not None
        return BlockUse(name, entry.block, kind, values, dict(entry.wires), place.spot)


def _once(problems: Iterable[Problem]) -> list[Problem]:
    """The problems without repetition, in the order of their files and lines."""
    first: dict[tuple[object, ...], Problem] = {}
    problems = list(problems)
    unknown = {str(problem.place) for problem in problems if problem.code == "E-VAR-UNKNOWN"}
    for problem in problems:
        if str(problem.place) in unknown and problem.code != "E-VAR-UNKNOWN":
            continue  # what a variable that is not set would have been is no second mistake
        first.setdefault((problem.code, str(problem.place), problem.cause), problem)
    return sorted(first.values(), key=lambda problem: (problem.file, problem.line, problem.column))
