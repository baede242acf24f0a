"""The serial line carries what the board wants to say.

A board tells one distance: both firmwares have one channel for it in each frame.
"""

from __future__ import annotations

from math import floor

from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.check_context import CheckContext
from diffbotctl.config.checks.graph import entries
from diffbotctl.config.checks.pins import PINLESS
from diffbotctl.config.yaml_tree import Value
from diffbotctl.links import bandwidth


def check_budget(case: CheckContext) -> None:
    """Compare the telemetry's bytes a second with what the line carries."""
    known = case.known(
        "board.telemetry", "board.edge_times", "link.protocol", "link.baud", "link.uart"
    )
    if known is None or case.robot is None:
        return
    if case.robot.board.type == SIMULATED:
        return  # no line carries anything
    rate, has_edge_times, protocol, _, _ = known
    baud = bandwidth.baud_of(case.robot.link)
    frame = bandwidth.frame_bytes(protocol, has_edge_times)
    load, room = rate * frame, bandwidth.capacity(baud)
    if load <= bandwidth.COMFORTABLE * room:
        return
    cause = (
        f"{rate:g} frames of {frame} bytes are {load:.0f} bytes a second; "
        f"at {baud} baud the line carries {room:.0f}"
    )
    most = floor(bandwidth.COMFORTABLE * room / frame)
    fix = f"at most {most} Hz leaves room for replies; or raise link.baud"
    if has_edge_times and protocol == "diffbot":
        fix += ", or set edge_times: false"
    place = case.blame("board.telemetry", "link.baud", "board.edge_times")
    if load > room:
        case.error("E-LINK-BUDGET", place, cause, fix)
    else:
        case.warn("W-LINK-BUDGET", place, f"{cause}: replies will be late", fix)


def check_channels(case: CheckContext) -> None:
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


def _listeners(case: CheckContext, sensor: str) -> dict[str, Value]:
    """The wires from this sensor, by the node that they lead to."""
    wires = {node: found for node, value in entries(case).items() if (found := value.at("in"))}
    return {
        node: source
        for node, inputs in wires.items()
        for source in inputs.entries.values()
        if source.data == f"robot.{sensor}"
    }


def _refuse(case: CheckContext, name: str, told: str, waiting: dict[str, Value]) -> None:
    for node, source in waiting.items():
        cause = (
            f"'{node}' waits for the sensor '{name}', but a board tells one distance in each "
            f"frame, that of '{told}': this wire would stay silent"
        )
        fix = f"wire it to robot.{told}, or leave the block out"
        case.error("E-BOARD-SENSOR", source.spot, cause, fix)
