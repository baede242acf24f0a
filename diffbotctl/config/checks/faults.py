"""Checks of the faults of a simulated robot: one that it cannot have is an error, never ignored."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import NamedTuple

from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.faults import FAULTS, FaultEntry
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.robot import Robot
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem, join_words
from diffbotctl.geometry.distance_sensors import ECHOES, is_analog
from diffbotctl.messages import Scan


class Need(NamedTuple):
    """What a robot must have for a fault: whether it has it, and what else it has."""

    is_met: Callable[[Robot], bool]
    lack: str
    fix: str


def _channels(robot: Robot) -> int:
    return robot.drive.left.encoder.channels


def _has_range_sensor(robot: Robot) -> bool:
    kinds = [sensor.type for sensor in robot.sensors.values()]
    return any(is_analog(kind) or kind in ECHOES for kind in kinds)


def _measures(robot: Robot, message: type) -> bool:
    return any(SENSOR_MESSAGES[sensor.type] is message for sensor in robot.sensors.values())


OTHER_FAULT = "choose a fault of what this robot has, such as wheel_blocked"
NEEDS = {  # by the words of faults.yaml
    "encoders": Need(lambda robot: _channels(robot) > 0, "it has no encoders", OTHER_FAULT),
    "one_channel": Need(
        lambda robot: _channels(robot) == 1,
        "its encoders do not have one channel",
        "use encoder_dead, or a fault of the motors or wheels",
    ),
    "two_channels": Need(
        lambda robot: _channels(robot) == 2, "its encoders do not have two channels", OTHER_FAULT
    ),
    "scanner": Need(lambda robot: _measures(robot, Scan), "it has no laser scanner", OTHER_FAULT),
    "distance_sensor": Need(_has_range_sensor, "it has no distance sensor", OTHER_FAULT),
    "ultrasonic_sensor": Need(
        lambda robot: any(sensor.type in ECHOES for sensor in robot.sensors.values()),
        "it has no ultrasonic sensor",
        OTHER_FAULT,
    ),
    "imu": Need(
        lambda robot: robot.imu.type is not None, "it has no IMU", "add `imu: {type: mpu6050}`"
    ),
    "board": Need(
        lambda robot: robot.board.type != SIMULATED,
        "it exists in the simulator alone, without a board",
        OTHER_FAULT,
    ),
    "own_firmware": Need(
        lambda robot: robot.link.protocol == "diffbot", "its board has other firmware", OTHER_FAULT
    ),
    "stop_button": Need(
        lambda robot: robot.board.stop_button is not None,
        "no stop button is connected to its board",
        "state its pin: `board: {stop_button: 24}`",
    ),
}


def fault_problems(
    robot: Robot,
    programs: Collection[str] | None,
    entries: Sequence[FaultEntry | None],
    values: Sequence[Value],
) -> Iterator[Problem]:
    """Why `robot` cannot have these faults, which are at `values`.

    `programs`: of the pipeline, None when no pipeline is checked.
    """
    for entry, value in zip(entries, values, strict=False):
        if entry is None or entry.fault not in FAULTS:
            continue
        place = value.entries["fault"].place
        kind = FAULTS[entry.fault]
        lacking = [NEEDS[need] for need in kind.needs if not NEEDS[need].is_met(robot)]
        if lacking:
            cause = f"this robot cannot have the fault {entry.fault}: {lacking[0].lack}"
            yield Problem("E-FAULT", place, cause, lacking[0].fix)
        elif robot.simulation.plant is not None and kind.is_of_shipped_plant:
            cause = f"a plant of your own cannot have the fault {entry.fault}"
            yield Problem("E-FAULT", place, cause, "let the plant itself do it, or remove `plant`")
        yield from _sensor_problems(robot, entry, value)
        if programs is not None:
            yield from _program_problems(programs, entry, value)
        side = value.entries.get("side")
        if entry.side is not None and side is not None and not kind.has_side:
            cause = f"the fault {entry.fault} is of the whole robot, not of one side"
            yield Problem("E-FAULT", side.name_place, cause, "remove side")


def _sensor_problems(robot: Robot, entry: FaultEntry, value: Value) -> Iterator[Problem]:
    """Why the sensor that the fault names cannot have it."""
    written = value.entries.get("sensor")
    if entry.sensor is None or written is None:
        return
    if not entry.fault.startswith("range_"):
        cause = f"the fault {entry.fault} is not of a distance sensor"
        yield Problem("E-FAULT", written.name_place, cause, "remove sensor")
    elif entry.sensor not in robot.sensors:
        cause = f"the robot has no sensor {entry.sensor}"
        yield Problem("E-FAULT", written.place, cause, f"use {join_words(robot.sensors)}")
    elif entry.fault == "range_endless" and robot.sensors[entry.sensor].type not in ECHOES:
        cause = f"the sensor {entry.sensor} is no ultrasonic one: it has no echo"
        yield Problem("E-FAULT", written.place, cause, "use range_silent")


def _program_problems(
    programs: Collection[str], entry: FaultEntry, value: Value
) -> Iterator[Problem]:
    """Why the pipeline has no program that could have the fault."""
    written, place = value.entries.get("program"), value.entries["fault"].place
    is_of_program = entry.fault.startswith("program_")
    if is_of_program and not programs:
        cause = f"this pipeline cannot have the fault {entry.fault}: it starts no program"
        yield Problem("E-FAULT", place, cause, OTHER_FAULT)
    elif written is not None and not is_of_program:
        cause = f"the fault {entry.fault} is not of a program"
        yield Problem("E-FAULT", written.name_place, cause, "remove program")
    elif written is not None and entry.program is not None and entry.program not in programs:
        cause = f"the pipeline has no program {entry.program}"
        yield Problem("E-FAULT", written.place, cause, f"use {join_words(programs)}")


def emulated_problems(entries: Sequence[FaultEntry], values: Sequence[Value]) -> Iterator[Problem]:
    """The faults that only an emulated board can have, of a simulated one."""
    for entry, value in zip(entries, values, strict=False):
        if entry.fault == "link_damage":
            cause = "the simulated board has no bytes on its link that could be damaged"
            fix = "write `port: emulated` in the file of trials, or use link_loss"
            yield Problem("E-FAULT", value.entries["fault"].place, cause, fix)


@check("simulation.faults", "drive.left.encoder.channels", "board.telemetry")
def check_faults(context: CheckContext, faults: Sequence[FaultEntry | None], *_: float) -> None:
    """Refuse faults that the simulated robot cannot have."""
    values = context.robot_value("simulation", "faults")
    if context.robot is not None and values is not None:
        programs = None if context.pipeline is None else context.programs
        context.problems += fault_problems(context.robot, programs, faults, values.items)
