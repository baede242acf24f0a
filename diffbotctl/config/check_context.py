"""What the checks look at: the typed files, and the trees that know where everything stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from diffbotctl.block import Block
from diffbotctl.config.pipeline import Pipeline
from diffbotctl.config.robot import Robot
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place, Problem


@dataclass
class CheckContext:
    """One configuration under examination. Values that could not be read are None."""

    real: bool = False
    problems: list[Problem] = field(default_factory=list)
    tree: Value | None = None
    pipeline: Pipeline | None = None
    robot_tree: Value | None = None
    robot: Robot | None = None
    nominal: Robot | None = None
    kinds: dict[str, type[Block]] = field(default_factory=dict)
    values: dict[str, dict[str, Any]] = field(default_factory=dict)

    def at(self, *steps: str | int) -> Value | None:
        """The value at a path of the pipeline file."""
        return self.tree.at(*steps) if self.tree else None

    def robot_at(self, *steps: str | int) -> Value | None:
        """The value at a path of the robot file."""
        return self.robot_tree.at(*steps) if self.robot_tree else None

    def robot_place(self, *steps: str) -> Place | str:
        """Where a field of the robot file stands, or the nearest section around it."""
        for end in range(len(steps), -1, -1):
            value = self.robot_at(*steps[:end])
            if value is not None:
                return value.spot
        return "robot"

    def blame(self, *paths: str, also: Sequence[Value | None] = ()) -> Place | str:
        """Where to point when several fields together are wrong: at what the user changed.

        `paths` are fields of the robot file, the most telling first; `also` are values of the
        pipeline file. A `--set` goes before the user's files, these before shipped ones.
        """
        values = [*(self.robot_at(*path.split(".")) for path in paths), *also]
        places = [value.spot for value in values if value is not None]
        if not places:
            return self.robot_place(*paths[0].split("."))
        return min(
            places, key=lambda place: (place.source.name != "--set", not place.source.is_own)
        )

    def robot_field(self, path: str) -> Any:
        """The typed field at dotted `path`. Raises AttributeError or KeyError for none."""
        return _field(self.robot, path)

    def known(self, *paths: str) -> tuple[Any, ...] | None:
        """The robot's fields at `paths`, or None when any of them could not be read."""
        return _fields(self.robot, paths)

    def stated(self, *paths: str) -> tuple[Any, ...] | None:
        """As `known`, before calibration: what was measured with a rule."""
        return _fields(self.nominal, paths)

    def error(self, code: str, place: Place | str, cause: str, fix: str) -> None:
        """Note what cannot work."""
        self.problems.append(Problem(code, place, cause, fix))

    def warn(self, code: str, place: Place | str, cause: str, fix: str) -> None:
        """Note what is unwise."""
        self.problems.append(Problem(code, place, cause, fix, "warning"))


def _field(robot: Robot | None, path: str) -> Any:
    found: Any = robot
    for step in path.split("."):
        found = found[step] if isinstance(found, dict) else getattr(found, step)
    return found


def _fields(robot: Robot | None, paths: Sequence[str]) -> tuple[Any, ...] | None:
    try:
        found = tuple(_field(robot, path) for path in paths)
    except (AttributeError, KeyError, TypeError):
        return None
    return None if any(value is None for value in found) else found
