"""The pipeline file, declared, and the checked configuration that a pipeline and a robot become."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from diffbotctl.block import Block
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Place, Problem
from diffbotctl.params import Choice, Param, Section

SensorMessage = Literal["Volts", "Scan"]


class RobotUse(Section):
    """The node `robot`: which one, and what drives its wheels."""

    use = Param(str, none=True, default=None, help="Name or path of a robot file.")
    wires = Param(
        dict[str, str], key="in", default={}, help="What feeds the robot's inputs: block.output."
    )


class GoalEntry(Section):
    """A pose to reach, in the frame odom: where the robot starts is 0, 0, looking along x."""

    x = Param(float, unit="m", default=0.0, help="Forward of the start.")
    y = Param(float, unit="m", default=0.0, help="Left of the start.")
    heading = Param(
        float, unit="rad", none=True, default=None, help="Final heading; none: any will do."
    )


class BlockEntry(Section):
    """One block: its kind, what feeds its inputs, and its parameters."""

    block = Param(str, help="Kind of block; `diffbotctl blocks` lists them.")
    wires = Param(dict[str, str], key="in", default={}, help="What feeds each input: block.output.")
    values: Any = Param(dict, key="with", default={}, help="Values of the block's parameters.")
    needs: SensorMessage | None = Choice(
        SensorMessage,
        none=True,
        default=None,
        help="Leave the block out, and pass on what it was given, where no sensor of the robot "
        "has this message.",
    )


class WallEntry(Section):
    """A straight wall of the simulated world."""

    start = Param(tuple[float, float], key="from", unit="m", help="One end: [x, y].")
    end = Param(tuple[float, float], key="to", unit="m", help="The other end: [x, y].")


class ObstacleEntry(Section):
    """A round obstacle of the simulated world."""

    at = Param(tuple[float, float], unit="m", help="Its middle: [x, y].")
    radius = Param(float, unit="m", above=0.0, help="Its radius.")


class WorldEntry(Section):
    """What stands around the simulated robot, in the world's frame.

    That is the frame odom, unless the robot's `simulation.start` says where in the world it begins.
    """

    field = Param(
        tuple[float, float],
        unit="m",
        none=True,
        default=None,
        help="A walled field from [0, 0] to here, which no simulated robot can leave.",
    )
    walls = Param(list[WallEntry], default=[], help="Straight walls.")
    obstacles = Param(list[ObstacleEntry], default=[], help="Round obstacles.")


class Pipeline(Section):
    """What one run does."""

    format = Param(int, choices=(1,), help="Version of this file's shape.")
    kind = Param(str, choices=("pipeline",), help="What this file describes.")
    include: Any = Param(
        object,
        none=True,
        default=None,
        help="A pipeline file, or a list of them, that this one changes.",
    )
    vars: Any = Param(dict, default={}, help="Values used elsewhere as $name.")
    robot = Param(
        RobotUse, none=True, default=None, help="The robot; left out, the pipeline has none."
    )
    goals = Param(list[GoalEntry], default=[], help="Poses to reach, in this order.")
    blocks = Param(dict[str, BlockEntry], help="The blocks by name.")
    world = Param(WorldEntry, default=WorldEntry(), help="What stands around a simulated robot.")


@dataclass(frozen=True)
class BlockUse:
    """One block of a pipeline: `cls(**values)` makes it, `wires` maps its inputs to sources.

    A source is `node.port`, where the node is another block, `robot` or `operator`. `values` holds
    SI numbers, and the robot's fields that the block asked for.
    """

    name: str
    kind: str
    cls: type[Block]
    values: dict[str, Any]
    wires: dict[str, str]
    place: Place


@dataclass(frozen=True)
class RobotFile:
    """A checked robot. `nominal` is the robot before calibration: what the simulation starts from,
    so that calibrating a simulated robot does not change it."""

    robot: Robot
    nominal: Robot
    file: Path
    files: tuple[Path, ...]
    warnings: tuple[Problem, ...] = ()


@dataclass(frozen=True)
class Configuration:
    """A checked pipeline with its robot, ready to be built into a graph."""

    name: str
    file: Path
    robot: Robot | None
    nominal: Robot | None
    robot_file: Path | None
    blocks: tuple[BlockUse, ...]
    robot_wires: dict[str, str]
    goals: tuple[GoalEntry, ...]
    world: WorldEntry
    files: tuple[Path, ...]
    warnings: tuple[Problem, ...] = ()
    settings: tuple[str, ...] = field(default=())
