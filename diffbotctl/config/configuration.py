"""The sections of a pipeline file, and the checked configuration of a pipeline and its robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from diffbotctl.block import Block, In, inputs, outputs
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.robot import Robot
from diffbotctl.device import DeviceDriver
from diffbotctl.errors import Place, Problem
from diffbotctl.estimation.geometry_deviation import may_have_wrong_slots
from diffbotctl.messages import Range, Scan
from diffbotctl.params import REQUIRED, Choice, Number, Param, Section
from diffbotctl.units import POSE_MAX

SensorMessage = Literal["Volts", "Range", "Scan"]


class RobotUse(Section):
    """The node `robot`: which robot file, and the source of its wheel commands."""

    use: str | None = Param(str, none=True, default=None, help="Name or path of a robot file.")
    wires = Param(
        dict[str, str], key="in", default={}, help="Source of each robot input: block.output."
    )


class GoalEntry(Section):
    """A pose to reach, in the frame odom: the robot starts at 0, 0, heading along x."""

    x = Number("m", f"[{-POSE_MAX['m']}, {POSE_MAX['m']}]", 0.0, "x coordinate.")
    y = Number("m", f"[{-POSE_MAX['m']}, {POSE_MAX['m']}]", 0.0, "y coordinate.")
    heading = Number("rad", "", None, "Final heading; none: any.")


class BlockEntry(Section):
    """One block: its kind, the sources of its inputs, its parameters."""

    block = Param(
        str,
        help="Kind of block; `diffbotctl blocks` lists them. Or a class in a file: "
        "./my_block.py:MyBlock.",
    )
    wires = Param(dict[str, str], key="in", default={}, help="Source of each input: block.output.")
    values: Any = Param(dict, key="with", default={}, help="Values of the block's parameters.")
    needs: SensorMessage | None = Choice(
        SensorMessage,
        None,
        "Leave the block out, and pass its input on, when no sensor of the robot and no "
        "source has this message.",
    )


class WallEntry(Section):
    """A straight wall of the simulated world."""

    start = Param(tuple[float, float], key="from", unit="m", help="One end: [x, y].")
    end = Param(tuple[float, float], key="to", unit="m", help="The other end: [x, y].")
    glass = Param(
        bool,
        default=False,
        help="Light passes through, but for rays within 15 degrees of its normal.",
    )


class ObstacleEntry(Section):
    """A round obstacle of the simulated world."""

    at = Param(tuple[float, float], unit="m", help="Centre: [x, y].")
    radius = Number("m", "(0, inf)", REQUIRED, "Radius.")
    path = Param(
        list[tuple[float, float]],
        unit="m",
        default=[],
        help="Points [x, y] to which it moves, as a chair that is put elsewhere or a person.",
    )
    begin = Number("s", "[0, inf)", 0.0, "When it begins to move.")
    speed = Number("m/s", "(0, 5]", 0.8, "How fast it moves.")
    repeat = Param(bool, default=False, help="Move back to `at` from the last point, and so on.")


class WorldEntry(Section):
    """Walls and obstacles around the simulated robot, in the frame of the world.

    That is the frame odom, unless the robot's `simulation.start` sets another start pose.
    """

    field: tuple[float, float] | None = Param(
        tuple[float, float],
        unit="m",
        none=True,
        default=None,
        help="Walled field from [0, 0] to this corner, which the robot cannot leave.",
    )
    walls = Param(list[WallEntry], default=[], help="Straight walls.")
    obstacles = Param(list[ObstacleEntry], default=[], help="Round obstacles.")


def _timeout(whose: str) -> float:
    """The entry that bounds the age of a message from outside of the graph."""
    return Param(
        float,
        unit="s",
        default=0.5,
        minimum=0.02,
        maximum=60.0,
        help=f"Age at which {whose} newest message is no longer valid; at most 1 s where it feeds "
        "motion.",
    )


class InputEntry(Section):
    """A wire on which a client of the control socket publishes: `input.NAME`."""

    type = Param(str, help="Message type, such as Range, Int32 or my_package/Face.")
    timeout = _timeout("the")
    neutral: Any = Param(
        dict,
        none=True,
        default=None,
        help="Message in place of one that is no longer valid; none: blocks get no message then.",
    )


class ProgramEntry(Section):
    """A program that is started with the run, and reads and publishes messages."""

    run = Param(str, help="Command line; its folder is that of the pipeline file.")
    wires = Param(
        dict[str, str], key="in", default={}, help="What it reads: its own name, then block.output."
    )
    types = Param(
        dict[str, str], key="out", default={}, help="What it publishes: name, then message type."
    )
    timeout = _timeout("its")
    neutral: Any = Param(
        dict,
        none=True,
        default=None,
        help="For each output the message in place of one that is no longer valid.",
    )


class SourceEntry(Section):
    """A device of this computer that a driver reads: a joystick, a USB lidar, an Arduino."""

    driver = Param(str, help="Kind of driver; `diffbotctl blocks` lists them.")
    wires = Param(
        dict[str, str], key="in", default={}, help="What is sent to it: its input: block.output."
    )
    types = Param(
        dict[str, str],
        key="out",
        default={},
        help="What it publishes: name, then message type; of a driver that leaves that open.",
    )
    values: Any = Param(dict, key="with", default={}, help="Values of the driver's parameters.")
    timeout = _timeout("its")


class Pipeline(Section):
    """One pipeline: robot, blocks, goals and world of a run."""

    format = Param(int, choices=(1,), help="Version of the file format.")
    kind = Param(str, choices=("pipeline",), help="Kind of file.")
    include: Any = Param(
        object,
        none=True,
        default=None,
        help="A pipeline file, or a list of them, whose values this file overrides; or "
        "pipelines and robots by name, each as {path, as, robot, set, in}.",
    )
    vars: Any = Param(dict, default={}, help="Values used elsewhere as $name.")
    robot: RobotUse | None = Param(
        RobotUse, none=True, default=None, help="The robot; absent: the pipeline has none."
    )
    goals = Param(list[GoalEntry], default=[], help="Poses to reach, in order.")
    blocks = Param(dict[str, BlockEntry], help="The blocks by name.")
    inputs = Param(
        dict[str, InputEntry], default={}, help="What clients of the control socket may publish."
    )
    programs = Param(dict[str, ProgramEntry], default={}, help="Programs in any language, by name.")
    sources = Param(
        dict[str, SourceEntry], default={}, help="Devices of this computer, by name of the node."
    )
    world = Param(WorldEntry, default=WorldEntry(), help="Simulated walls and obstacles.")


@dataclass(frozen=True)
class BlockUse:
    """One block of a pipeline: `cls(**values)` creates it, `wires` maps its inputs to sources.

    A source is `node.port`, where the node is another block, `robot` or `operator`. `values` holds
    SI numbers, and the fields of the robot file that the block declares.
    """

    name: str
    kind: str
    cls: type[Block]
    values: dict[str, Any]
    wires: dict[str, str]
    place: Place


@dataclass(frozen=True)
class InputUse:
    """A wire on which another program publishes messages of class `kind`.

    `timeout` is in s; `neutral` is None without one. `feeds_motion`: the robot's motion depends on
    it.
    """

    wire: str
    kind: type
    timeout: float
    neutral: Any
    feeds_motion: bool

    @property
    def is_of_robot(self) -> bool:
        """Whether it is a sensor of the robot, on whose wire the plant delivers, too."""
        return self.wire.startswith("robot.")


@dataclass(frozen=True)
class ProgramUse:
    """A program of a pipeline: its command line, which starts in `folder`.

    `wires` maps its names for what it reads to wires, `outputs` the wires on which it publishes to
    their message classes. `timeout` is in s.
    """

    name: str
    words: tuple[str, ...]
    folder: Path
    wires: dict[str, str]
    outputs: dict[str, type]
    timeout: float


@dataclass(frozen=True)
class SourceUse:
    """A device of a pipeline: `cls(**values)` creates its driver.

    `outputs` maps the wires on which it publishes to their message classes, `wires` its inputs to
    their sources. `timeout` is in s. A sensor of the robot is one, too.
    """

    name: str
    cls: type[DeviceDriver]
    values: dict[str, Any]
    outputs: dict[str, type]
    timeout: float
    place: Place
    wires: dict[str, str] = field(default_factory=dict)
    what: Literal["source", "sensor"] = "source"

    def wire(self, port: str) -> str:
        """The wire on which the output `port` of its driver is delivered."""
        return f"{self.name}.{port}" if self.what == "source" else f"robot.{self.name}"


@dataclass(frozen=True)
class Omission:
    """A block that was left out, because nothing gives the message that it needs."""

    name: str
    needs: str

    def text(self) -> str:
        needed = {"Volts": "distance", "Range": "distance"}.get(self.needs, self.needs.lower())
        return f"left out: {self.name} (no sensor of the robot and no source gives a {needed})"


@dataclass(frozen=True)
class RobotFile:
    """A checked robot. `nominal` is the robot before calibration.

    The simulation starts from it, so that calibrating a simulated robot does not change that robot.
    """

    robot: Robot
    nominal: Robot
    file: Path
    files: tuple[Path, ...]
    warnings: tuple[Problem, ...] = ()


@dataclass(frozen=True)
class Configuration:
    """A checked pipeline with its robot, ready to be built into a graph.

    `robots` are the pipelines of several robots by name; this one then has no robot of its own.
    `code` has the SHA-256 of each file with code that the files name.
    """

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
    inputs: tuple[InputUse, ...] = ()
    programs: tuple[ProgramUse, ...] = ()
    sources: tuple[SourceUse, ...] = ()
    omissions: tuple[Omission, ...] = ()
    robots: dict[str, Configuration] = field(default_factory=dict)
    code: dict[str, str] = field(default_factory=dict)

    def sensor_wires(self) -> dict[str, str]:
        """Wires with the distances of a sensor, and its name in the robot file.

        A block that names a sensor takes its distances from there, or computes them; a sensor that
        no block names has the wire of its name at the robot.
        """
        sensors = self.robot.sensors if self.robot is not None else {}
        wires: dict[str, str] = {}
        for use in self.blocks:
            if (sensor := use.values.get("sensor")) in sensors:
                for port, taken in inputs(use.cls).items():
                    if isinstance(taken, In) and taken.kind in (Range, Scan) and port in use.wires:
                        wires[use.wires[port]] = sensor
                for port, out in outputs(use.cls).items():
                    if out.kind in (Range, Scan):
                        wires[f"{use.name}.{port}"] = sensor
        for name, section in sensors.items():
            if name not in wires.values() and SENSOR_MESSAGES[section.type] in (Range, Scan):
                wires[f"robot.{name}"] = name
        return wires

    def has_unverified_slots(self) -> bool:
        """Whether nothing has measured the slots of an encoder of its robots."""
        robots = (self.robot, *(part.robot for part in self.robots.values()))
        return any(
            may_have_wrong_slots(robot.calibration)
            for robot in robots
            if robot is not None and robot.has_board and robot.drive.left.encoder.channels
        )

    def all_omissions(self) -> tuple[Omission, ...]:
        """The blocks that are left out, of several robots with the name of theirs."""
        named = [
            Omission(f"{robot}.{each.name}", each.needs)
            for robot, part in self.robots.items()
            for each in part.omissions
        ]
        return (*self.omissions, *named)
