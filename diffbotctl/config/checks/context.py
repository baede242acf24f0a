"""Input of the checks: the typed values, and the trees with the place of each value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from diffbotctl.block import Block
from diffbotctl.config.board_pins import BOARDS, BoardPins
from diffbotctl.config.configuration import InputUse, Omission, Pipeline, ProgramUse, SourceUse
from diffbotctl.config.motor_pulses import MotorPulses, motor_pulses
from diffbotctl.config.named_parts import NamedPart
from diffbotctl.config.robot import Robot, field_value
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place, Problem


@dataclass(eq=False, repr=False)
class CheckContext:
    """The configuration to check. Values that could not be read are None.

    `real`: a real robot is about to move. `refuse_simulated`: results of a simulated robot are an
    error, because a real one is behind the port. `nominal` is the robot before calibration.
    `block_classes` and `parameters` have an entry for each block whose class was found,
    `inputs` for each wire on which another program publishes. `parts` are pipelines under names;
    the robot's motion depends on `moving_parts`.
    """

    real: bool = False
    refuse_simulated: bool = False
    problems: list[Problem] = field(default_factory=list)
    pipeline_tree: Value | None = None
    pipeline: Pipeline | None = None
    robot_tree: Value | None = None
    robot: Robot | None = None
    nominal: Robot | None = None
    block_classes: dict[str, type[Block]] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    inputs: dict[str, InputUse] = field(default_factory=dict)
    programs: dict[str, ProgramUse] = field(default_factory=dict)
    sources: dict[str, SourceUse] = field(default_factory=dict)
    omissions: list[Omission] = field(default_factory=list)
    parts: dict[str, NamedPart] = field(default_factory=dict)
    moving_parts: set[str] = field(default_factory=set)

    def pipeline_value(self, *steps: str | int) -> Value | None:
        return self.pipeline_tree.at(*steps) if self.pipeline_tree else None

    def parameter_value(self, block: str, name: str) -> Value | None:
        """A block's parameter in the pipeline file, or the block where it is not given."""
        value = self.pipeline_value("blocks", block, "with", name)
        return value or self.pipeline_value("blocks", block)

    def robot_value(self, *steps: str | int) -> Value | None:
        return self.robot_tree.at(*steps) if self.robot_tree else None

    def robot_place(self, *steps: str) -> Place | str:
        """The place of a field of the robot file, or of the nearest section around it."""
        for end in range(len(steps), -1, -1):
            value = self.robot_value(*steps[:end])
            if value is not None:
                return value.place
        return "robot"

    def error_place(self, *paths: str, also: Sequence[Value | None] = ()) -> Place | str:
        """The place to show when several fields together are wrong: what the user changed.

        `paths` are fields of the robot file, the most relevant first; `also` are values of the
        pipeline file. A `--set` is preferred to the user's files, these to shipped ones.
        """
        values = [*(self.robot_value(*path.split(".")) for path in paths), *also]
        places = [value.place for value in values if value is not None]
        if not places:
            return self.robot_place(*paths[0].split("."))
        return min(
            places, key=lambda place: (place.source.name != "--set", not place.source.is_own)
        )

    def values(self, *paths: str) -> tuple[Any, ...] | None:
        """The robot's fields at `paths`, or None when any of them could not be read."""
        return _values(self.robot, paths)

    @property
    def board(self) -> BoardPins | None:
        """The data of the robot's board; None without a board, or if its type is not readable."""
        (kind,) = self.values("board.type") or (None,)
        return BOARDS.get(kind) if isinstance(kind, str) else None

    @property
    def pulses(self) -> MotorPulses | None:
        """Where the motor drivers get their pulses; None where that cannot be read."""
        paths = ("board.type", "link.protocol", "drive.left.motor.driver")
        inputs = ("drive.left.motor.in1", "drive.right.motor.in1")
        if self.robot is None or self.values(*paths, *inputs) is None:
            return None
        return motor_pulses(self.robot)

    def nominal_values(self, *paths: str) -> tuple[Any, ...] | None:
        """As `values`, before calibration: what was measured with a ruler."""
        return _values(self.nominal, paths)

    def error(self, code: str, place: Place | str, cause: str, fix: str) -> None:
        """Add an error: the configuration cannot be used."""
        self.problems.append(Problem(code, place, cause, fix))

    def warn(self, code: str, place: Place | str, cause: str, fix: str) -> None:
        self.problems.append(Problem(code, place, cause, fix, "warning"))


def _values(robot: Robot | None, paths: Sequence[str]) -> tuple[Any, ...] | None:
    try:
        values = tuple(field_value(robot, path) for path in paths)
    except (AttributeError, KeyError, TypeError):
        return None
    return None if any(value is None for value in values) else values


Check = TypeVar("Check", bound=Callable[..., None])
_checks: list[tuple[str, Callable[[CheckContext], None]]] = []  # with the name of the module


def check(*paths: str, is_nominal: bool = False) -> Callable[[Check], Check]:
    """Declare a check: a function of the context and the robot's fields at `paths`.

    It is run when all of these could be read. `is_nominal`: as they were before calibration.
    """

    def add(function: Check) -> Check:
        def run(context: CheckContext) -> None:
            values = _values(context.nominal if is_nominal else context.robot, paths)
            if values is not None:
                function(context, *values)

        _checks.append((function.__module__, run))
        return function

    return add


def declared_checks(module: str) -> list[Callable[[CheckContext], None]]:
    """The checks that a module declares, in their order there."""
    return [run for name, run in _checks if name == module]
