"""Checks of the board and what is wired to it: line capacity, voltages."""

from __future__ import annotations

from math import ceil, floor
from typing import get_args

from diffbotctl.config.board_pins import BOARDS, SIMULATED, BoardPins
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.motor_drivers import MODE_TEXT, MOTOR_DRIVERS, MotorDriverFacts, driver_facts
from diffbotctl.config.robot import SIDES, BaudRate, Robot, board_sensors, line_baud
from diffbotctl.errors import join_words
from diffbotctl.geometry.distance_sensors import ECHOES, TURN, further_sensors
from diffbotctl.links import link_protocol

# Input of a linear 5 V regulator (Mega's VIN; 78M05 of an L298N board): its dropout is 2 V, and
# 12 V at 0.2 A dissipate 1.4 W, the maximum without a heat sink.
SUPPLY_MIN_V, SUPPLY_MAX_V = 7.0, 12.0
MODULE_V = 3.3  # that the inputs of an HC-05 take


@check("board.telemetry", "board.edge_times", "link.protocol", "link.baud", "link.uart")
def check_budget(
    context: CheckContext, rate: float, has_edge_times: bool, protocol: str, *_: int
) -> None:
    """Compare the telemetry's bytes a second with what the line carries."""
    if context.robot is None or context.robot.board.type == SIMULATED:
        return
    baud = line_baud(context.robot)
    has_gyro = context.values("imu.type") not in (None, (None,))
    frame = link_protocol.frame_bytes(protocol, has_edge_times, has_gyro)
    ranges = range_load(context.robot)
    load, capacity = rate * frame + ranges, link_protocol.capacity(baud)
    if load <= link_protocol.TELEMETRY_LOAD_MAX * capacity:
        return
    further = f", with {ranges:.0f} of the distance sensors" if ranges else ""
    cause = (
        f"{rate:g} frames of {frame} bytes per second are {load:.0f} bytes/s{further}; "
        f"at {baud} baud the link carries {capacity:.0f} bytes/s"
    )
    rate_max = floor((link_protocol.TELEMETRY_LOAD_MAX * capacity - ranges) / frame)
    options = [f"set telemetry to at most {rate_max} Hz"] if rate_max >= 1 else []
    if line_baud(context.robot) == context.robot.link.baud:  # a USB cable has the rate of its own
        needed = (rate * frame + ranges) / link_protocol.TELEMETRY_LOAD_MAX
        enough = [each for each in get_args(BaudRate) if link_protocol.capacity(each) >= needed]
        options += [f"raise link.baud to {enough[0]}"] if enough else []
    without = rate * link_protocol.frame_bytes(protocol, False, has_gyro) + ranges
    is_enough = without <= link_protocol.TELEMETRY_LOAD_MAX * capacity
    if has_edge_times and protocol == "diffbot" and not has_gyro and is_enough:
        options.append("set edge_times: false")
    place = context.error_place("board.telemetry", "link.baud", "board.edge_times")
    fix = join_words(options)
    if load > capacity:
        context.error("E-LINK-BUDGET", place, cause, fix)
    else:
        context.warn("W-LINK-BUDGET", place, f"{cause}; replies will be delayed", fix)


def range_load(robot: Robot) -> float:
    """Bytes per second of the sensors that are measured in turn; one of them in each turn."""
    kinds = {name: sensor.type for name, sensor in board_sensors(robot).items()}
    has_turns = robot.link.protocol == "diffbot" and further_sensors(kinds)
    return link_protocol.RANGE_FRAME_BYTES / TURN if has_turns else 0.0


@check("link.uart", "link.level", "board.type")
def check_radio(context: CheckContext, uart: int, level: str, board: str) -> None:
    """Warn of a radio module whose input gets 5 V, or that shares the USB port's pins."""
    if context.robot is None or not context.robot.link.has_radio:
        return
    pins = BOARDS.get(board)
    if level == "direct" and (pins is None or pins.volts > MODULE_V):
        cause = "the board's 5 V signal drives the HC-05's RXD directly, which takes 3.3 V"
        fix = "add 1 kOhm in the wire and 2 kOhm from RXD to GND, and set level: divider"
        context.warn("W-WIRING-LEVEL", context.error_place("link.level"), cause, fix)
    if uart == 0 and (pins is None or pins.has_usb_serial):
        others = [port for port in BOARDS[board].links["diffbot"] if port]
        cause = (
            "the HC-05 shares pins 0 and 1 with the USB port: flashing fails while it is connected"
        )
        fix = (
            f"use uart: {others[0]}" if others else "disconnect it before you connect the USB cable"
        )
        context.warn("W-WIRING-SHARED", context.error_place("link.radio", "link.uart"), cause, fix)


@check()
def check_led_pin(context: CheckContext) -> None:
    """Warn of a motor or button on the pin of the board's LED."""
    board = context.board
    if board is None or board.led is None:
        return
    for side in SIDES:
        if context.values(f"drive.{side}.motor.enable") == (board.led,):
            cause = (
                "pin 13 also drives the board's LED, which the bootloader blinks at each start: "
                f"the {side} wheel will jerk"
            )
            place = context.robot_place("drive", side, "motor", "enable")
            context.warn("W-WIRING-LIGHT", place, cause, "use another pin with PWM")
    if context.values("board.stop_button") == (board.led,):
        cause = "the board's LED pulls pin 13 low, so the button may always read as pressed"
        place = context.robot_place("board", "stop_button")
        context.warn("W-WIRING-LIGHT", place, cause, "use another pin")


@check()
def check_driver(context: CheckContext) -> None:
    """Compare the pins of each motor, and its rest, with the inputs of its driver."""
    drivers = context.values(*(f"drive.{side}.motor.driver" for side in SIDES))
    if drivers is None or context.robot is None or drivers[0] == "none":
        return
    facts = driver_facts(drivers[0])
    if drivers[1] != drivers[0]:
        cause = f"the left motor has the driver {drivers[0]}, the right one {drivers[1]}"
        place = context.error_place("drive.right.motor.driver", "drive.left.motor.driver")
        context.error("E-DRIVER", place, cause, "name one driver for both motors")
        return
    for side in SIDES:
        motor = getattr(context.robot.drive, side).motor
        for name in ("enable", "in2", "standby"):
            _check_input(context, facts, side, name, getattr(motor, name) is not None)
    if (
        facts.standby is not None
        and context.robot_value("drive", "left", "motor", "standby") is None
    ):
        place = context.error_place("drive.left.motor.driver")
        cause = f"{facts.with_article} with its pin {facts.standby} open keeps the motors off"
        fix = f"connect {facts.standby} to a pin and write standby: 4, or to 5 V: standby: none"
        context.warn("W-DRIVER-STANDBY", place, cause, fix)
    _check_pulses(context, facts)
    idle = context.values("drive.left.motor.idle")
    if idle is not None and idle[0] not in facts.rests:
        place = context.error_place("drive.left.motor.idle", "drive.left.motor.driver")
        cause = f"{facts.with_article} shorts the motors at rest: they cannot turn freely"
        if idle[0] == "brake":
            cause = f"{facts.with_article} opens the motors' terminals at rest: it cannot brake"
        context.error("E-DRIVER", place, cause, f"set idle: {facts.rests[0]}")
    if facts.title != "L298N" and context.values("board.supply") == ("regulator",):
        place = context.error_place("board.supply")
        cause = f"{facts.with_article} has no 5 V regulator for the board"
        context.error("E-DRIVER", place, cause, "set supply: vin, or usb")


def _check_pulses(context: CheckContext, facts: MotorDriverFacts) -> None:
    """Refuse pulses where the driver or the board cannot have them, and an enable without need."""
    both = [getattr(context.robot.drive, side).motor for side in SIDES] if context.robot else []
    place = context.error_place("drive.left.motor.pulses", "drive.left.motor.driver")
    if len({motor.pulses for motor in both}) > 1:
        cause = "the pulses of both motors must be on the same inputs"
        context.error("E-DRIVER", place, cause, "state pulses once, in the section drive.motor")
        return
    pulses = context.pulses
    if pulses is None:
        return
    if not pulses.is_possible:
        cause = f"the pulses cannot be on {both[0].pulses}: {pulses.why}"
        context.error("E-DRIVER", place, cause, f"set pulses: {pulses.on}, or remove it")
    if pulses.on == "inputs" and facts.mode == "enable_in1_in2":
        without = [name for name, motor in zip(SIDES, both, strict=True) if motor.enable is None]
        idle = context.values("drive.left.motor.idle")
        if len(without) == 1:
            cause = f"enable of the {without[0]} motor has no pin, that of the other motor has one"
            place = context.error_place(f"drive.{without[0]}.motor.enable")
            context.error("E-DRIVER", place, cause, "wire both alike: two jumpers, or two pins")
        elif without and idle == ("coast",):
            place = context.error_place("drive.left.motor.idle", "drive.left.motor.enable")
            cause = f"{facts.with_article} that is always enabled shorts the motors at rest"
            context.error("E-DRIVER", place, cause, "set idle: brake")


@check()
def check_stall_current(context: CheckContext) -> None:
    """Compare the current of the blocked motors with what the driver carries."""
    for side in SIDES:
        path = f"drive.{side}.motor"
        values = context.values(f"{path}.stall_current", f"{path}.driver")
        facts = MOTOR_DRIVERS.get(values[1]) if values else None
        if values is None or facts is None or values[0] <= facts.current:
            continue
        effect = "it can be destroyed when a wheel is blocked"
        if facts.bridge.has_thermal_shutdown:
            effect = "when a wheel is blocked it heats until it switches the motors off"
        cause = (
            f"a blocked motor takes {values[0]:g} A, {facts.with_article} carries "
            f"{facts.current:g} A: {effect}"
        )
        enough = [
            other.title
            for other in MOTOR_DRIVERS.values()
            if other.current >= values[0] and other.mode == facts.mode
        ]
        fix = "use a driver for that current"
        if enough:
            fix += f" ({join_words(enough)})"
        place = context.error_place(f"{path}.stall_current", f"{path}.driver")
        context.warn("W-DRIVER-CURRENT", place, cause, fix + ", or smaller motors")
        return


def _check_input(
    context: CheckContext, facts: MotorDriverFacts, side: str, name: str, is_stated: bool
) -> None:
    has_input = facts.standby is not None if name == "standby" else name in facts.inputs()
    if has_input == is_stated or (name == "standby" and has_input):
        return  # a standby input may be wired to 5 V
    path = f"drive.{side}.motor.{name}"
    if has_input:
        if context.robot_value("drive", side, "motor", name) is not None:
            return  # `none` is refused where the pins are checked
        inputs = MODE_TEXT[facts.mode]
        cause = f"{facts.with_article} has {inputs}, and {name} of the {side} motor is missing"
        place = context.error_place(path, f"drive.{side}.motor.driver")
        context.error("E-DRIVER", place, cause, f"add {name}: and the board's pin")
        return
    inputs = MODE_TEXT[facts.mode] if name != "standby" else "no standby input"
    cause = f"{facts.with_article} has {inputs}, and {name} of the {side} motor is stated"
    context.error("E-DRIVER", context.error_place(path), cause, f"write {name}: none")


@check()
def check_voltages(context: CheckContext) -> None:
    """Refuse what puts more on a pin of a board than it takes, or too much on its supply."""
    board = context.board
    if board is None or context.robot is None:
        return
    _check_divider(context, board)
    if board.volts > MODULE_V:
        return
    most = f"{board.volts:g} V"
    if context.values("board.supply") == ("vin",):
        cause = f"{board.with_article} takes 1.8 to 5.5 V at {board.supply.into}, not a battery"
        fix = (
            "supply it from USB (board.supply: usb) or a regulator of 5 V (board.supply: regulator)"
        )
        context.error("E-WIRING-VOLTAGE", context.error_place("board.supply"), cause, fix)
    for name, sensor in board_sensors(context.robot).items():
        if sensor.type in ECHOES and sensor.level == "direct":
            cause = f"the echo of '{name}' is 5 V, and the pins of {board.with_article} take {most}"
            fix = "add 1 kOhm in the wire and 2 kOhm from the pin to GND, and set level: divider"
            place = context.robot_place("sensors", name, "echo")
            context.error("E-WIRING-VOLTAGE", place, cause, fix)


def _check_divider(context: CheckContext, board: BoardPins) -> None:
    """Compare the battery's voltage behind its divider with what a pin takes."""
    values = context.values("battery.pin", "battery.full", "battery.divider")
    if values is None or values[1] / values[2] <= board.volts:
        return
    _, full, divider = values
    cause = (
        f"{full:g} V divided by {divider:g} are {full / divider:.1f} V at the pin, and those of "
        f"{board.with_article} take {board.volts:g} V"
    )
    enough = ceil(11.0 * full / board.volts) / 10  # a tenth more
    fix = f"take resistors that divide by at least {enough:g}, and state that divider"
    place = context.error_place("battery.divider", "battery.full")
    context.error("E-WIRING-VOLTAGE", place, cause, fix)


@check()
def check_battery(context: CheckContext) -> None:
    """Refuse a low battery that a full one is; warn of what has no effect or is not known."""
    battery = context.robot.battery if context.robot is not None else None
    if battery is None or battery.low is None:
        return
    place = context.error_place("battery.low", "battery.full")
    if battery.full is not None and battery.low >= battery.full:
        cause = f"low is {battery.low:g} V, and full is {battery.full:g} V: it would never drive"
        fix = "low is where the robot stops: about 3.3 V for each lithium cell"
        context.error("E-BATTERY", place, cause, fix)
    elif battery.low and battery.pin is None:
        cause = "low has no effect: no pin measures the battery"
        fix = "wire a divider, and state its pin and divider; or remove low"
        context.warn("W-BATTERY", place, cause, fix)
    elif battery.low and battery.divider is None:
        cause = "low is a voltage of the battery, and the divider in front of its pin is not stated"
        fix = "state divider, or find it out: `diffbotctl calibrate battery`"
        context.warn("W-BATTERY", place, cause, fix)


@check("battery.full", "board.supply")
def check_supply(context: CheckContext, full: float, supply: str) -> None:
    """Warn of a battery voltage outside the range of the motor driver or the board's regulator."""
    place = context.error_place("battery.full", "board.supply")
    drivers = context.values("drive.left.motor.driver")
    facts = driver_facts(drivers[0] if drivers else "l298n")
    low, high = facts.supply
    if not low <= full <= high:
        bound = f"above the {facts.title}'s maximum of {high:g} V"
        if full < low:
            bound = f"below the {facts.title}'s minimum of {low:g} V"
        fix = f"use a battery of {max(low, SUPPLY_MIN_V):g} to {min(high, SUPPLY_MAX_V):g} V"
        context.warn("W-WIRING-SUPPLY", place, f"{full:g} V is {bound}", fix)
    elif supply != "usb" and not SUPPLY_MIN_V <= full <= SUPPLY_MAX_V:
        part = "the board's VIN" if supply == "vin" else "the L298N's 5 V regulator"
        effect = "it would overheat"
        if full < SUPPLY_MIN_V:
            effect = "the board would restart whenever a motor starts"
        cause = f"{part} takes {SUPPLY_MIN_V:g} to {SUPPLY_MAX_V:g} V, not {full:g} V: {effect}"
        fix = "use two lithium cells (8.4 V), or supply the board from USB (board.supply: usb)"
        context.warn("W-WIRING-SUPPLY", place, cause, fix)
