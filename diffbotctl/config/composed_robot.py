"""A robot file composed of parts: the rules of the board decide the pins.

Each wire of a part needs a pin with a function. `PinAssignment` finds a pin for each, moving one
that another wire could have elsewhere too, so that a combination is refused only if no assignment
exists. Pins without other functions are taken first for what any pin can do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import floor
from typing import NamedTuple

from diffbotctl.config.board_pins import BOARDS, BoardPins
from diffbotctl.config.checks.board import MODULE_V
from diffbotctl.config.checks.pins import PinRole, pins_for, serial_pins
from diffbotctl.config.imu_chips import IMU_CHIPS
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS, MotorDriverFacts, driver_names
from diffbotctl.config.motor_pulses import pulses_obstacle
from diffbotctl.config.robot import SIDES, BoardSection
from diffbotctl.config.section_reader import contained_choice, refused_part
from diffbotctl.errors import Problem, UsageError, closest_match, join_words
from diffbotctl.geometry.distance_sensors import (
    ECHOES,
    FACTS,
    SENSORS_MAX,
    TURN,
    further_sensors,
    sensor_facts,
)
from diffbotctl.links import link_protocol
from diffbotctl.params import declared

CODE = "E-PARTS"
PROTOCOL = "diffbot"  # the book's firmware runs with the book's wiring only
RADIO_BAUD = 9600  # of an HC-05 as it is sold
NONE = "none"
CHANNELS = {NONE: 0, "one-channel": 1, "two-channel": 2}  # of a kind of encoders
# Of a slotted disc; of a Hall encoder with 11 pulses a turn of the motor behind a gear of 1:34.
USUAL_SLOTS = {NONE: 0, "one-channel": 20, "two-channel": 374}
# Name of each distance sensor, in the order of the parts, and its place on the robot.
SENSOR_PLACES = {
    "front": "x: 90 mm",
    "left": "y: 60 mm, heading: 90 deg",
    "right": "y: -60 mm, heading: -90 deg",
    "rear": "x: -140 mm, heading: 180 deg",
}


class PartKind(NamedTuple):
    """A kind of part: the field of robot files that names it, and the names."""

    field: str
    names: tuple[str, ...]

    def check(self, written: str) -> str:
        """The name that was written. Raises UsageError with what comes nearest."""
        plain = {name.replace("_", "-"): name for name in self.names}
        name = written.strip().lower().replace("_", "-")
        if name in plain:
            return plain[name]
        part = refused_part(self.field, written, self.names)
        if part is not None:
            raise _refused(part.cause, part.fix)
        near = contained_choice(name, self.names) or plain.get(closest_match(name, plain) or "")
        fix = f"did you mean {near}?" if near else f"write {join_words(self.names)}"
        raise _refused(f"'{written}' is not known here", fix)


PART_KINDS = {
    "board": PartKind("board.type", tuple(BOARDS)),
    "driver": PartKind("motor.driver", tuple(MOTOR_DRIVERS)),
    "encoders": PartKind("encoders", tuple(CHANNELS)),
    "sensor": PartKind("sensors.type", (NONE, *FACTS)),
    "imu": PartKind("imu.type", (NONE, *IMU_CHIPS)),
    "radio": PartKind("radio", ("cable", "hc05")),
}


class RobotParts(NamedTuple):
    """The parts of a robot, by their names in robot files. `sensors`: in front, left, right, rear.

    `slots`: per turn of a wheel, of channel A; None: the usual ones.
    """

    board: str
    driver: str
    encoders: str = "one-channel"
    slots: int | None = None
    sensors: tuple[str, ...] = ()
    imu: str = NONE
    radio: str = "cable"

    def checked(self) -> RobotParts:
        """The same with the names as robot files have them. Raises UsageError for one that is none,
        and for too many sensors."""
        kinds = PART_KINDS
        sensors = tuple(kinds["sensor"].check(sensor) for sensor in self.sensors)
        sensors = tuple(sensor for sensor in sensors if sensor != NONE)
        if len(sensors) > SENSORS_MAX:
            cause = f"a board reads {SENSORS_MAX} distance sensors, not {len(sensors)}"
            raise _refused(cause, f"leave out {len(sensors) - SENSORS_MAX}")
        return self._replace(
            board=kinds["board"].check(self.board),
            driver=kinds["driver"].check(self.driver),
            encoders=kinds["encoders"].check(self.encoders),
            sensors=sensors,
            imu=kinds["imu"].check(self.imu),
            radio=kinds["radio"].check(self.radio),
        )

    @property
    def title(self) -> str:
        names = [BOARDS[self.board].title, MOTOR_DRIVERS[self.driver].title]
        names.append(f"{self.encoders} encoders" if CHANNELS[self.encoders] else "no encoders")
        names += [sensor_facts(kind).title for kind in self.sensors]
        names += [] if self.imu == NONE else [self.imu.upper()]
        return join_words([*names, "USB cable" if self.radio == "cable" else "HC-05"], "and")


class PinNeed(NamedTuple):
    """A wire that needs a pin: its key, such as `left.in1`, the pin's function, and a label."""

    key: str
    role: PinRole
    label: str


class PinAssignment:
    """Pins of a board for the wires that were added, by their keys."""

    def __init__(self, board: BoardPins, taken: Sequence[str]) -> None:
        """`taken`: pins that carry something else."""
        self.board, self._taken = board, taken
        self._needs: dict[str, PinNeed] = {}

    @property
    def pins(self) -> dict[str, str]:
        return {need.key: pin for pin, need in self._needs.items()}

    def add(self, need: PinNeed) -> bool:
        """Find a pin for a wire; False if there is none, wherever the others are."""
        return self._place(need, set())

    def _place(self, need: PinNeed, tried: set[str]) -> bool:
        """A step of Kuhn's algorithm: a maximum matching of wires and pins."""
        for pin in sorted(self._suitable(need.role), key=lambda pin: pin in self._needs):
            if pin in tried:
                continue
            tried.add(pin)
            if pin not in self._needs or self._place(self._needs[pin], tried):
                self._needs[pin] = need
                return True
        return False

    def _suitable(self, role: PinRole) -> list[str]:
        board = self.board
        pins = [pin for pin in pins_for(board, role, PROTOCOL) if pin not in self._taken]
        if role == "pwm" and board.shares_pwm:  # one pin of each output
            pins = sorted({board.pwm[pin]: pin for pin in reversed(pins)}.values(), key=int)
        if role == "digital":
            pins.sort(key=self._functions)
        return sorted(pins, key=lambda pin: pin == board.led)

    def _functions(self, pin: str) -> int:
        board = self.board
        serial = [pin for pins in board.uarts.values() for pin in pins]
        groups = (board.pwm, board.interrupts, board.changes, board.analog, board.i2c, serial)
        return sum(pin in group for group in groups)


def compose_robot(parts: RobotParts) -> dict[str, str]:
    """The fields of the template `composed_robot.yaml` for these parts.

    Raises UsageError: an unknown part, or more wires than the board has pins for.
    """
    parts = parts.checked()
    board, facts = BOARDS[parts.board], MOTOR_DRIVERS[parts.driver]
    on_inputs = not pulses_obstacle(facts)
    pins = _assigned(parts, list(_needs(parts, facts, on_inputs)))
    has_encoders = parts.encoders != NONE
    slots = parts.slots or USUAL_SLOTS[parts.encoders]
    encoder = f"{{channels: {CHANNELS[parts.encoders]}, slots: {slots}}}" if has_encoders else NONE
    return {
        "title": parts.title,
        "board": f"type: {parts.board}, supply: {'vin' if board.volts == 5.0 else 'usb'}, "
        f"telemetry: {_telemetry(parts)} Hz",
        "link": _link(parts, board),
        "motor": f"driver: {parts.driver}, {_standby(pins)}rated: 180 rpm, idle: {facts.rests[0]}",
        "encoder": encoder,
        **{side: "\n".join(_side(parts, facts, side, pins)) for side in SIDES},
        "sensors": "\n".join(_sensors(parts, board, pins)) or " {}",
        "imu": f"{{type: {parts.imu}}}",
        "simulation": _simulation(parts),
    }


def _needs(parts: RobotParts, facts: MotorDriverFacts, on_inputs: bool) -> Iterator[PinNeed]:
    """The wires, those with the fewest suitable pins first."""
    channels, board = CHANNELS[parts.encoders], BOARDS[parts.board]
    if channels:
        for side in SIDES:
            yield PinNeed(f"{side}.pin", "interrupt", f"{side} encoder")
    roles: dict[str, PinRole] = {"enable": "digital" if on_inputs else "pwm"}
    roles |= dict.fromkeys(("in1", "in2"), "pwm" if on_inputs else "digital")
    motors = [
        PinNeed(f"{side}.{name}", roles[name], f"{side} motor's {name}")
        for side in SIDES
        for name in facts.inputs()
    ]
    yield from (need for need in motors if need.role == "pwm")
    for name, kind in zip(SENSOR_PLACES, parts.sensors, strict=False):
        if kind in ECHOES:
            yield PinNeed(f"{name}.echo", "change", f"echo of the sensor at the {name}")
        else:
            yield PinNeed(f"{name}.pin", "analog", f"sensor at the {name}")
    if channels == 2:
        second: PinRole = "interrupt" if board.counts_of_slot > 1 else "digital"
        for side in SIDES:
            yield PinNeed(f"{side}.pin_b", second, f"{side} encoder's channel B")
    yield from (need for need in motors if need.role == "digital")
    for name, kind in zip(SENSOR_PLACES, parts.sensors, strict=False):
        if kind in ECHOES:
            yield PinNeed(f"{name}.trigger", "digital", f"trigger of the sensor at the {name}")
    if facts.standby is not None:
        yield PinNeed("standby", "digital", f"driver's {facts.standby}")


def _assigned(parts: RobotParts, needs: Sequence[PinNeed]) -> dict[str, str]:
    """The pin of each wire. Raises UsageError naming those without one."""
    board = BOARDS[parts.board]
    taken = [*serial_pins(board, board.links[PROTOCOL][-1], PROTOCOL)]
    taken += board.i2c if parts.imu != NONE else ()
    assignment = PinAssignment(board, taken)
    without = [need.label for need in needs if not assignment.add(need)]
    if without:
        cause = f"{board.with_article} has no pin left for the {join_words(without, 'and')}"
        more = [each for each in ("mega2560", "pico") if each != parts.board]
        raise _refused(cause, f"leave a part out, or use a board with more pins: {more[0]}")
    return assignment.pins


def _telemetry(parts: RobotParts) -> int:
    """Frames a second: the usual ones, or as many as the line carries."""
    usual = declared(BoardSection)["telemetry"].default
    baud = RADIO_BAUD if parts.radio == "hc05" else link_protocol.USB_BAUD
    names = dict(zip(SENSOR_PLACES, parts.sensors, strict=False))
    ranges = link_protocol.RANGE_FRAME_BYTES / TURN if further_sensors(names) else 0.0
    frame = link_protocol.frame_bytes(PROTOCOL, True, parts.imu != NONE)
    share = link_protocol.TELEMETRY_LOAD_MAX * link_protocol.capacity(baud)
    return min(int(usual), floor((share - ranges) / frame))


def _link(parts: RobotParts, board: BoardPins) -> str:
    if parts.radio == "cable":
        return "uart: 0, radio: cable"
    level = "divider" if board.volts > MODULE_V else "direct"
    return f"uart: {board.links[PROTOCOL][-1]}, baud: {RADIO_BAUD}, radio: hc05, level: {level}"


def _standby(pins: dict[str, str]) -> str:
    return f"standby: {pins['standby']}, " if "standby" in pins else ""


def _side(
    parts: RobotParts, facts: MotorDriverFacts, side: str, pins: dict[str, str]
) -> Iterator[str]:
    """The lines of one side; a motor on the left is mounted mirrored."""
    printed = driver_names(parts.driver, side)
    inputs = ", ".join(f"{name}: {pins[f'{side}.{name}']}" for name in facts.inputs())
    names = ", ".join(str(getattr(printed, name)) for name in facts.inputs())
    mirrored = "true" if side == "left" else "false"
    yield f"    motor: {{{inputs}, reversed: {mirrored}}}  # {names}"
    keys = ("pin", "pin_b")[: CHANNELS[parts.encoders]]
    if keys:
        channels = ", ".join(f"{key}: {pins[f'{side}.{key}']}" for key in keys)
        yield f"    encoder: {{{channels}}}"


def _sensors(parts: RobotParts, board: BoardPins, pins: dict[str, str]) -> Iterator[str]:
    for number, (name, kind) in enumerate(zip(SENSOR_PLACES, parts.sensors, strict=False)):
        keys = ("trigger", "echo") if kind in ECHOES else ("pin",)
        wired = ", ".join(f"{key}: {pins[f'{name}.{key}']}" for key in keys)
        level = ", level: divider" if kind in ECHOES and board.volts < 5.0 else ""
        line = f"  {name}: {{type: {kind}, {wired}{level}, at: {{{SENSOR_PLACES[name]}}}}}"
        yield line if number else f"\n{line}"


def _simulation(parts: RobotParts) -> str:
    """How the simulated robot is built; encoders of two channels are finer than slotted discs."""
    wiring = "\n  wiring: {left: reversed, right: plain}"
    if CHANNELS[parts.encoders] < 2:
        return wiring
    return f"{wiring}\n  encoder: {{slot_spread: 0.01, duty_spread: 0.02, jitter: 5 us}}"


def _refused(cause: str, fix: str) -> UsageError:
    return UsageError(Problem(CODE, "parts", cause, fix))
