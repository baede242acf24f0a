"""A board tells one distance: both firmwares have one channel for it in each frame."""

from __future__ import annotations

from diffbotctl.config.boards import SIMULATED
from diffbotctl.config.case import Case
from diffbotctl.config.checks.pins import PINLESS
from diffbotctl.config.checks.wires import entries
from diffbotctl.config.value import Value


def check(case: Case) -> None:
    """Say of every further sensor that it is silent on a real board; refuse to wait for it."""
    if case.robot is None or case.known("board.type") in (None, (SIMULATED,)):
        return
    sensors = case.robot.sensors or {}
    told, *silent = [
        name
        for name, sensor in sensors.items()
        if sensor is not None and sensor.type not in PINLESS
    ] or [""]
    for name in silent:
        waiting = _listeners(case, name)
        if case.real and waiting:
            _refuse(case, name, told, waiting)
        else:
            cause = (
                f"a board tells one distance in each frame, that of '{told}'; on a real board "
                f"'{name}' would stay silent, only the simulator has it"
            )
            fix = "remove it, or set board: {type: simulated} for a robot that is never built"
            place = case.robot_at("sensors", name)
            spot = place.key or place.spot if place else case.robot_place("sensors")
            case.warn("W-BOARD-SENSOR", spot, cause, fix)


def _listeners(case: Case, sensor: str) -> dict[str, Value]:
    """The wires from this sensor, by the node that they lead to."""
    wires = {node: found for node, value in entries(case).items() if (found := value.at("in"))}
    return {
        node: source
        for node, inputs in wires.items()
        for source in inputs.entries.values()
        if source.data == f"robot.{sensor}"
    }


def _refuse(case: Case, name: str, told: str, waiting: dict[str, Value]) -> None:
    for node, source in waiting.items():
        cause = (
            f"'{node}' waits for the sensor '{name}', but a board tells one distance in each "
            f"frame, that of '{told}': this wire would stay silent"
        )
        fix = f"wire it to robot.{told}, or leave the block out"
        case.error("E-BOARD-SENSOR", source.spot, cause, fix)
