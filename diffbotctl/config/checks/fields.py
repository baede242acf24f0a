"""Blocks that need the robot's geometry need a robot that has it."""

from __future__ import annotations

from diffbotctl.block import robot_fields
from diffbotctl.config.check_context import CheckContext
from diffbotctl.errors import Place, closest_match, join_words

SHOWN = 2  # fields that a message names before it says how many there are


def check_fields(case: CheckContext) -> None:
    """Check what each block asks of the robot file, and the sensors that parameters name."""
    for name, kind in case.kinds.items():
        wanted = robot_fields(kind)
        place = case.at("blocks", name)
        if not wanted or place is None:
            continue
        if case.robot is None:
            if case.at("robot") is None:
                paths = list(wanted.values())
                more = [f"{len(paths) - SHOWN} more"] if len(paths) > SHOWN else []
                fields = join_words([*paths[:SHOWN], *more], "and")
                cause = f"'{name}' needs the robot's {fields}, but the pipeline has no robot"
                fix = "add `robot: {in: {wheels: ...}}` to the pipeline"
                case.error("E-ROBOT-MISSING", place.spot, cause, fix)
            continue
        _check_fields(case, name, wanted)
        _check_sensor(case, name)
    _check_simulated(case)


def _check_fields(case: CheckContext, name: str, wanted: dict[str, str]) -> None:
    for path in wanted.values():
        try:
            case.robot_field(path)
        except (AttributeError, KeyError):
            place = case.at("blocks", name)
            assert place is not None
            cause = f"'{name}' asks for {path}, which robot files do not have"
            fix = "this is a mistake in the block's own code: mend its FromRobot"
            case.error("E-ROBOT-FIELD", place.spot, cause, fix)


def _check_sensor(case: CheckContext, name: str) -> None:
    sensor = case.values.get(name, {}).get("sensor")
    value = case.at("blocks", name, "with", "sensor") or case.at("blocks", name)
    if isinstance(sensor, str) and value is not None:
        _check_known(case, sensor, value.spot)


def _check_simulated(case: CheckContext) -> None:
    simulated = case.robot_at("simulation", "sensors")
    for name, value in simulated.entries.items() if simulated else ():
        _check_known(case, name, value.key or value.spot)


def _check_known(case: CheckContext, sensor: str, place: Place) -> None:
    sensors = case.robot.sensors if case.robot else None
    if sensors is None or sensor in sensors:
        return
    near = closest_match(sensor, sensors)
    fix = f"did you mean {near}?" if near else f"it has {join_words(sensors, 'and') or 'none'}"
    case.error("E-SENSOR-UNKNOWN", place, f"the robot has no sensor '{sensor}'", fix)
