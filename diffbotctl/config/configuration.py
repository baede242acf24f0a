"""What comes out of the files: everything a run needs, checked and typed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from diffbotctl.block import Block
from diffbotctl.config.pipeline import GoalEntry, WorldEntry
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Place, Problem


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
