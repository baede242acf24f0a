"""The wiring harness of a robot: every wire between its parts, from the robot file, and notes.

Colours are those of ribbon jumper wires: red and black for supply and ground, one colour for each
kind of signal. The notes are instructions that a drawing of the wires does not show.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, assert_never

from diffbotctl.config.board_pins import BOARDS, BoardPins
from diffbotctl.config.robot import Robot, SideSection
from diffbotctl.errors import Problem, UsageError

SUPPLY, GROUND = "red", "black"
ENABLE, FIRST, SECOND = "orange", "green", "blue"  # motor: PWM, first and second direction input
ENCODER, SENSOR, BUTTON = "purple", "yellow", "white"
TO_BOARD, FROM_BOARD = "grey", "brown"  # serial line
DIVIDER = "1k in it, 2k RXD to GND"  # 5 V x 2 / 3 = 3.3 V
MEANINGS = {
    SUPPLY: "supply",
    GROUND: "ground",
    ENABLE: "speed, PWM",
    FIRST: "direction 1",
    SECOND: "direction 2",
    ENCODER: "encoder",
    SENSOR: "sensor",
    BUTTON: "stop button",
    TO_BOARD: "to board",
    FROM_BOARD: "from board",
}

DRIVER, BOARD, RADIO, CELLS, STOP = "driver", "board", "radio", "battery", "button"
# Half A of the L298N drives the left motor: names of its inputs and outputs.
HALVES = {
    "left": ("ENA", "IN1", "IN2", "OUT1", "OUT2"),
    "right": ("ENB", "IN3", "IN4", "OUT3", "OUT4"),
}


class HarnessPin(NamedTuple):
    """One terminal of one part."""

    part: str
    name: str


class HarnessWire(NamedTuple):
    """One wire. `through` names the parts soldered into it."""

    start: HarnessPin
    end: HarnessPin
    colour: str
    purpose: str
    through: str = ""


class HarnessPart(NamedTuple):
    """One part: its title and the names of its pins, in drawing order.

    `remark` is a short note: a voltage, or an action.
    """

    key: str
    title: str
    pins: tuple[str, ...]
    remark: str = ""


class Harness(NamedTuple):
    """All parts and wires of one robot.

    `printed` maps a pin of the board to its full printed label, where that is more than its name.
    """

    parts: dict[str, HarnessPart]
    wires: tuple[HarnessWire, ...]
    printed: dict[str, str]

    def colours(self) -> dict[str, str]:
        """Each colour in use and what it means."""
        used = {wire.colour for wire in self.wires}
        return {colour: meaning for colour, meaning in MEANINGS.items() if colour in used}

    def of(self, *keys: str) -> list[HarnessWire]:
        """The wires between any two of these parts."""
        return [wire for wire in self.wires if {wire.start.part, wire.end.part} <= set(keys)]


def harness(robot: Robot) -> Harness:
    """Every wire of a checked robot. Raises UsageError for a robot without a board."""
    board = BOARDS.get(robot.board.type)
    if board is None:
        cause = f"a robot whose board is {robot.board.type} has no wires"
        raise UsageError(Problem("E-WIRING-NONE", "wiring", cause, "name a robot with a board"))
    wires = [
        *_power(robot),
        *_motor("left", robot.drive.left, board),
        *_motor("right", robot.drive.right, board),
        *_radio(robot, board),
        *_encoder("left", robot.drive.left, board),
        *_encoder("right", robot.drive.right, board),
        *_sensors(robot, board),
        *_button(robot, board),
    ]
    return Harness(_parts(robot, board, wires), tuple(wires), _printed(robot, board))


def _wire(
    part: str, pin: str, to_part: str, to_pin: str, colour: str, purpose: str, through: str = ""
) -> HarnessWire:
    start, end = HarnessPin(part, pin), HarnessPin(to_part, to_pin)
    return HarnessWire(start, end, colour, purpose, through)


def _power(robot: Robot) -> Iterator[HarnessWire]:
    yield _wire(CELLS, "+", DRIVER, "12V", SUPPLY, "motor supply, through a switch")
    yield _wire(CELLS, "-", DRIVER, "GND", GROUND, "motor supply")
    match robot.board.supply:
        case "vin":
            yield _wire(DRIVER, "12V", BOARD, "VIN", SUPPLY, "board's supply, 7 to 12 V")
        case "regulator":
            yield _wire(DRIVER, "5V", BOARD, "5V", SUPPLY, "board's supply, 5 V")
        case "usb":
            pass
        case _:
            assert_never(robot.board.supply)
    yield _wire(DRIVER, "GND", BOARD, "GND", GROUND, "common ground")


def _motor(name: str, side: SideSection, board: BoardPins) -> Iterator[HarnessWire]:
    enable, first, second, first_output, second_output = HALVES[name]
    motor, key = side.motor, f"{name} motor"
    for pin, input_, colour, purpose in (
        (motor.enable, enable, ENABLE, "speed (PWM)"),
        (motor.in1, first, FIRST, "direction"),
        (motor.in2, second, SECOND, "direction"),
    ):
        yield _wire(BOARD, board.named(str(pin)), DRIVER, input_, colour, f"{key}: {purpose}")
    yield _wire(DRIVER, first_output, key, "+", SUPPLY, key)
    yield _wire(DRIVER, second_output, key, "-", GROUND, key)


def _supplied(key: str, supply: str, ground: str, title: str) -> Iterator[HarnessWire]:
    yield _wire(BOARD, "5V", key, supply, SUPPLY, f"{title}: 5 V")
    yield _wire(BOARD, "GND", key, ground, GROUND, f"{title}: ground")


def _radio(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    if not robot.link.has_radio:
        return
    receive, transmit = board.uarts[robot.link.uart]
    yield from _supplied(RADIO, "VCC", "GND", "HC-05")
    yield _wire(RADIO, "TXD", BOARD, receive, TO_BOARD, "data to the board")
    through = DIVIDER if robot.link.level == "divider" else ""
    yield _wire(BOARD, transmit, RADIO, "RXD", FROM_BOARD, "data", through)


def _encoder(name: str, side: SideSection, board: BoardPins) -> Iterator[HarnessWire]:
    key, pin = f"{name} encoder", board.named(str(side.encoder.pin))
    yield from _supplied(key, "VCC", "GND", key)
    yield _wire(key, "OUT", BOARD, pin, ENCODER, f"{key}: edges")


def _sensors(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    for name, sensor in robot.sensors.items():
        key, pin = f"{name} sensor", board.named(str(sensor.pin))
        yield from _supplied(key, "VCC", "GND", key)
        yield _wire(key, "Vo", BOARD, pin, SENSOR, f"{key}: 0 to 3.1 V")


def _button(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    if robot.board.stop_button is not None:
        pin = board.named(str(robot.board.stop_button))
        yield _wire(BOARD, pin, STOP, "1", BUTTON, "stop button: closed is pressed")
        yield _wire(BOARD, "GND", STOP, "2", GROUND, "stop button: ground")


def _parts(robot: Robot, board: BoardPins, wires: list[HarnessWire]) -> dict[str, HarnessPart]:
    titles = {CELLS: "battery", DRIVER: "L298N", BOARD: board.title, RADIO: "HC-05"}
    titles |= {STOP: "stop button"} | {f"{name} sensor": f"{name}: Sharp" for name in robot.sensors}
    pins: dict[str, dict[str, None]] = {}
    for wire in wires:
        for part, name in (wire.start, wire.end):
            pins.setdefault(part, {})[name] = None
    full = robot.battery.full
    remarks = {
        CELLS: "7 to 12 V" if full is None else f"{full:g} V full",
        DRIVER: "ENA/ENB off",
        BOARD: {"vin": "VIN 7-12 V", "regulator": "5 V in", "usb": "USB power"}[robot.board.supply],
    }
    return {
        key: HarnessPart(key, titles.get(key, key), tuple(names), remarks.get(key, ""))
        for key, names in pins.items()
    }


def _printed(robot: Robot, board: BoardPins) -> dict[str, str]:
    if not robot.link.has_radio:
        return {}
    receive, transmit = board.uarts[robot.link.uart]
    number = str(robot.link.uart or "")  # port 0 is printed RX and TX
    return {receive: f"RX{number} {receive}", transmit: f"TX{number} {transmit}"}


def notes(robot: Robot) -> Iterator[str]:
    """Instructions that the wires do not show, in the order of assembly."""
    yield (
        "Remove the jumpers ENA and ENB from the L298N: with them the motors run only at full "
        "speed, and 5 V is applied to the PWM pins."
    )
    if robot.board.supply == "regulator":
        yield "Keep the L298N's 5 V jumper: its regulator supplies the board. At most 12 V."
    else:
        yield "Do not connect the L298N's 5 V terminal: its regulator supplies only the L298N."
    yield "Connect the grounds of battery, L298N and board. No signal works without it."
    full = robot.battery.full
    battery = f"{full:g} V when full" if full is not None else "7 to 12 V"
    yield (
        f"Battery: {battery}. The L298N takes at most 35 V, loses about 2 V, and supplies 2 A per "
        "motor; the motors of the kit are rated for 5 to 9 V."
    )
    if robot.link.has_radio and robot.link.level == "divider":
        yield "The HC-05 runs on 5 V, but its RXD takes 3.3 V: 1 kOhm in the wire, 2 kOhm to GND."
    if robot.sensors:
        yield "Solder 10 uF across a Sharp sensor's VCC and GND: it draws its current in pulses."
    yield (
        "10 kOhm from ENA and from ENB to GND keep the motors off while the board is flashed, "
        "when its pins float."
    )
    for name in HALVES:
        if getattr(robot.drive, name).motor.reversed:
            first, second = HALVES[name][1:3]
            yield (
                f"The {name} motor is mounted mirrored (reversed: true): {first} low and {second} "
                "high drive it forward."
            )
