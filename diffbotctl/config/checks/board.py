"""The serial line carries what the board wants to say.

A board tells one distance: both firmwares have one channel for it in each frame.
"""

from __future__ import annotations

from math import floor

from diffbotctl.config.board_pins import BOARDS, SIMULATED
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.checks.graph import nodes_with_inputs
from diffbotctl.config.checks.pins import PINLESS
from diffbotctl.config.harness import has_radio
from diffbotctl.config.robot import SIDES
from diffbotctl.config.yaml_tree import Value
from diffbotctl.links import bandwidth


def check_budget(context: CheckContext) -> None:
    """Compare the telemetry's bytes a second with what the line carries."""
    known = context.values(
        "board.telemetry", "board.edge_times", "link.protocol", "link.baud", "link.uart"
    )
    if known is None or context.robot is None:
        return
    if context.robot.board.type == SIMULATED:
        return  # no line carries anything
    rate, has_edge_times, protocol, _, _ = known
    baud = bandwidth.baud_of(context.robot.link)
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
    place = context.error_place("board.telemetry", "link.baud", "board.edge_times")
    if load > room:
        context.error("E-LINK-BUDGET", place, cause, fix)
    else:
        context.warn("W-LINK-BUDGET", place, f"{cause}: replies will be late", fix)


def check_channels(context: CheckContext) -> None:
    """Say of every further sensor that it is silent on a real board; refuse to wait for it."""
    if context.robot is None or context.values("board.type") in (None, (SIMULATED,)):
        return
    sensors = context.robot.sensors or {}
    told, *silent = [
        name
        for name, sensor in sensors.items()
        if sensor is not None and sensor.type not in PINLESS
    ] or [""]
    for name in silent:
        waiting = _listeners(context, name)
        if context.real and waiting:
            _refuse(context, name, told, waiting)
        else:
            cause = (
                f"a board tells one distance in each frame, that of '{told}'; on a real board "
                f"'{name}' would stay silent, only the simulator has it"
            )
            fix = "remove it, or set board: {type: simulated} for a robot that is never built"
            place = context.robot_value("sensors", name)
            spot = place.key_place or place.place if place else context.robot_place("sensors")
            context.warn("W-BOARD-SENSOR", spot, cause, fix)


def _listeners(context: CheckContext, sensor: str) -> dict[str, Value]:
    """The wires from this sensor, by the node that they lead to."""
    wires = {
        node: found
        for node, value in nodes_with_inputs(context).items()
        if (found := value.at("in"))
    }
    return {
        node: source
        for node, inputs in wires.items()
        for source in inputs.entries.values()
        if source.data == f"robot.{sensor}"
    }


def _refuse(context: CheckContext, name: str, told: str, waiting: dict[str, Value]) -> None:
    for node, source in waiting.items():
        cause = (
            f"'{node}' waits for the sensor '{name}', but a board tells one distance in each "
            f"frame, that of '{told}': this wire would stay silent"
        )
        fix = f"wire it to robot.{told}, or leave the block out"
        context.error("E-BOARD-SENSOR", source.place, cause, fix)


# V at the input of a linear regulator of 5 V (Mega's VIN; 78M05 of an L298N board): it needs 2 V
# more than it gives, and 12 V at 0.2 A are 1.4 W of heat, the most that its bare context sheds.
LEAST_SUPPLY, MOST_SUPPLY = 7.0, 12.0
MOST_DRIVER = 35.0  # V; the L298N board's supply (data sheet of the module)
LIGHT = "13"  # the pin of the light L, on all boards here


def check_wiring(context: CheckContext) -> None:
    """Warn of what the wiring would make of a robot whose pins and ports are right."""
    _check_radio(context)
    _check_light(context)
    _check_supply(context)


def _check_radio(context: CheckContext) -> None:
    known = context.values("link.uart", "link.level", "board.type")
    if known is None or context.robot is None or not has_radio(context.robot):
        return
    uart, level, kind = known
    if level == "direct":
        cause = "the board's 5 V go straight into the HC-05's RXD, which is made for 3.3 V"
        fix = "put 1 kOhm into the wire and 2 kOhm from RXD to GND, and say level: divider"
        context.warn("W-WIRING-LEVEL", context.error_place("link.level"), cause, fix)
    if uart == 0:
        others = [str(each) for each in BOARDS[kind].links["diffbot"] if each]
        cause = "the HC-05 shares pins 0 and 1 with the USB port: flashing fails while it is there"
        fix = f"use uart: {others[0]}" if others else "unplug it before you plug in the USB cable"
        context.warn("W-WIRING-SHARED", context.error_place("link.radio", "link.uart"), cause, fix)


def _check_light(context: CheckContext) -> None:
    for side in SIDES:
        pin = context.values(f"drive.{side}.motor.enable")
        if pin is not None and str(pin[0]) == LIGHT:
            cause = (
                "the board's light hangs on pin 13, and the bootloader blinks it at each start: "
                f"the {side} wheel will jerk"
            )
            place = context.robot_place("drive", side, "motor", "enable")
            context.warn("W-WIRING-LIGHT", place, cause, "give the motor another pin with PWM")
    button = context.values("board.stop_button")
    if button is not None and str(button[0]) == LIGHT:
        cause = "the board's light pulls pin 13 down, so the button may seem pressed for ever"
        place = context.robot_place("board", "stop_button")
        context.warn("W-WIRING-LIGHT", place, cause, "give the button another pin")


def _check_supply(context: CheckContext) -> None:
    known = context.values("battery.full", "board.supply")
    if known is None:
        return
    full, supply = known
    place = context.error_place("battery.full", "board.supply")
    if full > MOST_DRIVER:
        cause = f"{full:g} V are more than the L298N stands ({MOST_DRIVER:g} V)"
        context.warn("W-WIRING-SUPPLY", place, cause, "take a battery of 7 to 12 V")
    elif supply != "usb" and not LEAST_SUPPLY <= full <= MOST_SUPPLY:
        who = "the board's VIN" if supply == "vin" else "the L298N's 5 V regulator"
        why = (
            "the board would restart whenever a motor starts"
            if full < LEAST_SUPPLY
            else "it would get too hot"
        )
        cause = f"{who} takes {LEAST_SUPPLY:g} to {MOST_SUPPLY:g} V, not {full:g} V: {why}"
        fix = "take two lithium cells (8.4 V), or feed the board from USB (board.supply: usb)"
        context.warn("W-WIRING-SUPPLY", place, cause, fix)
