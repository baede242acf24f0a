"""The wiring harness of a robot: every wire between its parts, from the robot file, and notes.

Colours are those of ribbon jumper wires: red and black for supply and ground, one colour for each
kind of signal. The notes are instructions that a drawing of the wires does not show.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, assert_never

from diffbotctl.config.board_pins import BOARDS, BoardPins
from diffbotctl.config.imu_chips import IMU_CHIPS
from diffbotctl.config.motor_drivers import MotorDriverFacts, driver_facts, driver_names
from diffbotctl.config.motor_pulses import motor_pulses, pulses_text
from diffbotctl.config.robot import SIDES, Robot, SideSection, board_sensors
from diffbotctl.errors import Problem, UsageError, join_words
from diffbotctl.geometry.distance_sensors import ECHOES, is_analog
from diffbotctl.geometry.lidars import LIDARS

SUPPLY, GROUND = "red", "black"
LOGIC = "cyan"  # 3.3 V of a board whose pins take no more
RAILED = (SUPPLY, LOGIC, GROUND)
ENABLE, FIRST, SECOND = "orange", "green", "blue"  # motor: PWM, first and second direction input
ENCODER, SENSOR, BUTTON = "purple", "yellow", "white"
STANDBY = "pink"
TO_BOARD, FROM_BOARD = "grey", "brown"  # serial line
MEANINGS = {
    SUPPLY: "supply",
    GROUND: "ground",
    LOGIC: "supply, 3.3 V",
    ENABLE: "enable",
    FIRST: "input 1",
    SECOND: "input 2",
    ENCODER: "encoder",
    SENSOR: "sensor",
    BUTTON: "stop button",
    STANDBY: "driver on",
    TO_BOARD: "to board",
    FROM_BOARD: "from board",
}

DRIVER, BOARD, RADIO, CELLS, STOP = "driver", "board", "radio", "battery", "button"
IMU = "IMU"
TAP = "battery tap"  # the battery's plus pole again, where the voltage divider begins
SUPPLY_FULL_V = 12.6  # of three lithium cells
FIVE_V = 5.0
USUAL_CURRENT = 0.5  # A; a small gear motor under load
PARALLEL_KOHM = 10.0  # the ATmega's ADC is specified for sources of at most 10 kOhm
# Values of resistors that are sold (series E24), in units of a power of ten.
E24 = (
    *(10, 11, 12, 13, 15, 16, 18, 20, 22, 24, 27, 30),
    *(33, 36, 39, 43, 47, 51, 56, 62, 68, 75, 82, 91),
)


class HarnessPin(NamedTuple):
    """One terminal of one part."""

    part: str
    name: str


class Divider(NamedTuple):
    """A voltage divider: `series` in the wire, `parallel` from `node` to ground.

    The resistors are written as they are sold: 1k, 8k2. `is_at_board`: the node is the board's pin,
    otherwise the other end of the wire.
    """

    series: str
    parallel: str
    node: str
    is_at_board: bool = False

    def __str__(self) -> str:
        return f"{self.series} in it, {self.parallel} {self.node} to GND"


class HarnessWire(NamedTuple):
    """One wire, and the divider soldered into it."""

    start: HarnessPin
    end: HarnessPin
    colour: str
    purpose: str
    through: Divider | None = None


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

    `printed` maps a pin of the board to its full printed label, where that is more than its name;
    `driver_rows` a terminal of the motor driver to its row in a drawing.
    """

    parts: dict[str, HarnessPart]
    wires: tuple[HarnessWire, ...]
    printed: dict[str, str]
    driver_rows: dict[str, int]

    def colours(self) -> dict[str, str]:
        used = {wire.colour for wire in self.wires}
        return {colour: meaning for colour, meaning in MEANINGS.items() if colour in used}

    def of(self, *keys: str) -> list[HarnessWire]:
        return [wire for wire in self.wires if {wire.start.part, wire.end.part} <= set(keys)]


def harness(robot: Robot) -> Harness:
    """Every wire of a checked robot. Raises UsageError for a robot without a board."""
    board = BOARDS.get(robot.board.type)
    if board is None:
        cause = f"a robot whose board is {robot.board.type} has no wires"
        raise UsageError(Problem("E-WIRING-NONE", "wiring", cause, "name a robot with a board"))
    wires = [
        *_power(robot, board),
        *_motor("left", robot, board),
        *_motor("right", robot, board),
        *_radio(robot, board),
        *_encoder("left", robot.drive.left, board),
        *_encoder("right", robot.drive.right, board),
        *_sensors(robot, board),
        *_imu(robot, board),
        *_battery_voltage(robot, board),
        *_button(robot, board),
    ]
    rows = _driver_rows(driver_facts(robot.drive.left.motor.driver))
    return Harness(_parts(robot, board, wires), tuple(wires), _printed(robot, board), rows)


def _driver_rows(facts: MotorDriverFacts) -> dict[str, int]:
    """The inputs in the order of the board's wires, the outputs beside the motors."""
    left, right = facts.left, facts.right
    names: dict[int, tuple[str | None, ...]] = {
        1: (left.first_output, left.enable),
        2: (left.second_output, left.in1),
        3: (left.in2,),
        4: (right.in1,),
        5: (right.first_output, right.in2),
        6: (right.second_output, right.enable),
        7: (facts.standby, facts.always_high),
        8: ("5V", facts.logic_pin),
        9: (facts.supply_pin,),
        10: ("GND",),
    }
    return {name: row for row, in_row in names.items() for name in in_row if name is not None}


def _wire(
    part: str,
    pin: str,
    to_part: str,
    to_pin: str,
    colour: str,
    purpose: str,
    through: Divider | None = None,
) -> HarnessWire:
    start, end = HarnessPin(part, pin), HarnessPin(to_part, to_pin)
    return HarnessWire(start, end, colour, purpose, through)


def _power(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    motor = robot.drive.left.motor
    facts = driver_facts(motor.driver)
    yield _wire(CELLS, "+", DRIVER, facts.supply_pin, SUPPLY, "motor supply, through a switch")
    yield _wire(CELLS, "-", DRIVER, "GND", GROUND, "motor supply")
    match robot.board.supply:
        case "vin":
            yield _wire(DRIVER, facts.supply_pin, BOARD, "VIN", SUPPLY, "board's supply, 7 to 12 V")
        case "regulator":
            yield _wire(DRIVER, "5V", BOARD, board.supply.into, SUPPLY, "board's supply, 5 V")
        case "usb":
            pass
        case _:
            assert_never(robot.board.supply)
    yield _wire(DRIVER, "GND", BOARD, "GND", GROUND, "common ground")
    if facts.logic_pin is not None:
        pin, colour = board.supply.logic, _logic(board)
        yield _wire(BOARD, pin, DRIVER, facts.logic_pin, colour, "supply of the driver's inputs")
    if facts.standby is not None:
        pin = board.supply.logic if motor.standby is None else board.named(str(motor.standby))
        yield _wire(BOARD, pin, DRIVER, facts.standby, STANDBY, "driver awake")
    if facts.always_high is not None:
        pin = board.supply.logic
        yield _wire(BOARD, pin, DRIVER, facts.always_high, STANDBY, "driver on, always")


def _motor(name: str, robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    motor, key = getattr(robot.drive, name).motor, f"{name} motor"
    names = driver_names(motor.driver, name)
    on_inputs = motor_pulses(robot).on == "inputs"
    purpose = "PWM" if on_inputs else "direction"
    for pin, input_, colour, what in (
        (motor.enable, names.enable, ENABLE, "on" if on_inputs else "speed (PWM)"),
        (motor.in1, names.in1, FIRST, purpose),
        (motor.in2, names.in2, SECOND, purpose),
    ):
        if input_ is not None and pin is not None:
            yield _wire(BOARD, board.named(str(pin)), DRIVER, input_, colour, f"{key}: {what}")
    yield _wire(DRIVER, names.first_output, key, "+", SUPPLY, key)
    yield _wire(DRIVER, names.second_output, key, "-", GROUND, key)


def _logic(board: BoardPins) -> str:
    """The colour of the wires with the voltage that the board's pins take."""
    return LOGIC if board.volts < FIVE_V else SUPPLY


def _supplied(
    board: BoardPins, key: str, title: str, *, logic: bool = False, pin: str = "VCC"
) -> Iterator[HarnessWire]:
    """Supply of a part with 5 V; with `logic`, with what the board's pins take."""
    if logic:
        volts = f"{title}: {board.volts:g} V"
        yield _wire(BOARD, board.supply.logic, key, pin, _logic(board), volts)
    else:
        yield _wire(BOARD, board.supply.out, key, pin, SUPPLY, f"{title}: 5 V")
    yield _wire(BOARD, "GND", key, "GND", GROUND, f"{title}: ground")


def _radio(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    if not robot.link.has_radio:
        return
    receive, transmit = board.uarts[robot.link.uart]
    yield from _supplied(board, RADIO, "HC-05")
    yield _wire(RADIO, "TXD", BOARD, receive, TO_BOARD, "data to the board")
    # 5 V x 2 / 3 = 3.3 V
    is_divided = robot.link.level == "divider" and board.volts == FIVE_V
    through = Divider("1k", "2k", "RXD") if is_divided else None
    yield _wire(BOARD, transmit, RADIO, "RXD", FROM_BOARD, "data", through)


def _encoder(name: str, side: SideSection, board: BoardPins) -> Iterator[HarnessWire]:
    if not side.encoder.channels:
        return
    key, pin = f"{name} encoder", board.named(str(side.encoder.pin))
    yield from _supplied(board, key, key, logic=True)
    if side.encoder.channels == 1:
        yield _wire(key, "OUT", BOARD, pin, ENCODER, f"{key}: edges")
        return
    pin_b = board.named(str(side.encoder.pin_b))
    yield _wire(key, "A", BOARD, pin, ENCODER, f"{key}: channel A")
    yield _wire(key, "B", BOARD, pin_b, ENCODER, f"{key}: channel B")


def _sensors(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    for name, sensor in board_sensors(robot).items():
        key = f"{name} sensor"
        yield from _supplied(board, key, key)
        if sensor.type in ECHOES:
            trigger, echo = board.named(str(sensor.trigger)), board.named(str(sensor.echo))
            yield _wire(BOARD, trigger, key, "Trig", FROM_BOARD, f"{key}: trigger")
            purpose = f"{key}: echo, 5 V"
            if sensor.level == "divider":  # 5 V x 2 / 3 = 3.3 V
                through = Divider("1k", "2k", echo, True)
                yield _wire(BOARD, echo, key, "Echo", SENSOR, purpose, through)
            else:
                yield _wire(key, "Echo", BOARD, echo, SENSOR, purpose)
            continue
        pin = board.named(str(sensor.pin))
        yield _wire(key, "Vo", BOARD, pin, SENSOR, f"{key}: 0 to 3.1 V")


def _imu(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    if robot.imu.type is None:
        return
    data, clock = board.i2c
    chip = IMU_CHIPS[robot.imu.type]
    address = chip.address(robot.imu.address)
    yield from _supplied(board, IMU, IMU, pin=chip.supply_pin)
    yield _wire(IMU, "SDA", BOARD, data, SENSOR, "IMU: data of the I2C bus")
    yield _wire(BOARD, clock, IMU, "SCL", FROM_BOARD, "IMU: clock of the I2C bus")
    is_high = address == chip.addresses[1]
    if is_high or chip.is_address_wired:
        level, kind = ("3.3V", SENSOR) if is_high else ("GND", GROUND)
        yield _wire(BOARD, level, IMU, chip.address_pin, kind, f"IMU: address {address}")


def _battery_voltage(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    if robot.battery.pin is not None:
        pin = board.named(str(robot.battery.pin))
        through = battery_divider(robot, board, pin)
        yield _wire(BOARD, pin, TAP, "+", SENSOR, "battery voltage", through)


def battery_divider(robot: Robot, board: BoardPins, pin: str) -> Divider:
    """The divider from the battery to the board's `pin`.

    Without a stated ratio: the smallest one that keeps the pin below what it takes, with a margin
    of 10 %.
    """
    ratio = robot.battery.divider
    full = robot.battery.full or SUPPLY_FULL_V
    required = (ratio or 1.1 * full / board.volts) - 1.0
    kilohms = [tens * decade for decade in (0.1, 1.0, 10.0) for tens in E24]
    if ratio is None:
        series = next(value for value in kilohms if value >= required * PARALLEL_KOHM)
    else:
        series = min(kilohms, key=lambda value: abs(value - required * PARALLEL_KOHM))
    return Divider(_resistor(series), _resistor(PARALLEL_KOHM), pin, True)


def _resistor(kilohms: float) -> str:
    """The value as printed in parts lists: 2k2, 10k."""
    if kilohms >= 10.0:
        return f"{kilohms:.0f}k"
    return f"{kilohms:.1f}".replace(".", "k")


def _button(robot: Robot, board: BoardPins) -> Iterator[HarnessWire]:
    if robot.board.stop_button is not None:
        pin = board.named(str(robot.board.stop_button))
        yield _wire(BOARD, pin, STOP, "1", BUTTON, "stop button: closed is pressed")
        yield _wire(BOARD, "GND", STOP, "2", GROUND, "stop button: ground")


def _parts(robot: Robot, board: BoardPins, wires: list[HarnessWire]) -> dict[str, HarnessPart]:
    facts = driver_facts(robot.drive.left.motor.driver)
    titles = {CELLS: "battery", DRIVER: facts.title, BOARD: board.title, RADIO: "HC-05"}
    titles |= {STOP: "stop button", TAP: "battery +", IMU: f"{robot.imu.type}".upper()} | {
        f"{name} sensor": f"{name}: {'HC-SR04' if sensor.type in ECHOES else 'Sharp'}"
        for name, sensor in board_sensors(robot).items()
    }
    pins: dict[str, dict[str, None]] = {}
    for wire in wires:
        for part, name in (wire.start, wire.end):
            pins.setdefault(part, {})[name] = None
    full = robot.battery.full
    remarks = {
        CELLS: "7 to 12 V" if full is None else f"{full:g} V full",
        DRIVER: _jumpers(robot) if facts.title == "L298N" else f"{facts.current:g} A",
        BOARD: {"vin": "VIN 7-12 V", "regulator": "5 V in", "usb": "USB power"}[robot.board.supply],
    }
    return {
        key: HarnessPart(key, titles.get(key, key), tuple(names), remarks.get(key, ""))
        for key, names in pins.items()
    }


def _jumpers(robot: Robot) -> str:
    return f"ENA/ENB {'on' if robot.drive.left.motor.enable is None else 'off'}"


def _printed(robot: Robot, board: BoardPins) -> dict[str, str]:
    # The pins of a board of 3.3 V have only their numbers printed.
    printed = {pin: f"{board.number(pin)} {pin}" for pin in board.analog if board.volts < FIVE_V}
    if not robot.link.has_radio:
        return printed
    receive, transmit = board.uarts[robot.link.uart]
    number = str(robot.link.uart or "")  # port 0 is printed RX and TX
    return printed | {receive: f"RX{number} {receive}", transmit: f"TX{number} {transmit}"}


def notes(robot: Robot) -> Iterator[str]:
    """Instructions that the wires do not show, in the order of assembly."""
    facts = driver_facts(robot.drive.left.motor.driver)
    title = facts.title
    yield from _motor_notes(robot, title)
    yield f"Connect the grounds of battery, {title} and board. No signal works without it."
    full = robot.battery.full
    battery = f"{full:g} V when full" if full is not None else "7 to 12 V"
    yield (
        f"Battery: {battery}. The {title} takes at most {facts.supply[1]:g} V, loses about "
        f"{facts.bridge.drop(USUAL_CURRENT):.2g} V at {USUAL_CURRENT:g} A, and supplies "
        f"{facts.current:g} A per motor; the motors of the kit are rated for 5 to 9 V."
    )
    board = BOARDS[robot.board.type]
    yield from _voltage_notes(robot, board)
    if robot.link.has_radio and robot.link.level == "divider" and board.volts == FIVE_V:
        yield "The HC-05 runs on 5 V, but its RXD takes 3.3 V: 1 kOhm in the wire, 2 kOhm to GND."
    sensors = board_sensors(robot)
    if any(is_analog(sensor.type) for sensor in sensors.values()):
        yield "Solder 10 uF across a Sharp sensor's VCC and GND: it draws its current in pulses."
    if any(sensor.type in ECHOES for sensor in sensors.values()):
        level = "right for this board, too much for one of 3.3 V"
        if board.volts < FIVE_V:
            level = "1 kOhm in its wire and 2 kOhm from the pin to GND make it 3.3 V"
        yield (
            f"The echo of an HC-SR04 is a 5 V signal: {level}. Mount it at least 10 cm above the "
            "floor, or tilted up: its beam is 15 degrees around its axis."
        )
    for name, sensor in robot.sensors.items():
        if sensor.type in LIDARS:
            lidar = LIDARS[sensor.type]
            yield (
                f"{name}: the {lidar.title} is connected to the computer, not to the board: by its "
                "USB adapter, or its TX (3.3 V) to the UART of a Raspberry Pi, with a common "
                f"ground. It sends at {lidar.baud} baud."
            )
    if robot.imu.type is not None:
        yield (
            f"Take the {robot.imu.type.upper()} on a module with a regulator and "
            f"{IMU_CHIPS[robot.imu.type].modules}: the bare chip takes 3.3 V. Screw it down flat, "
            f"with the axis {robot.imu.axes.removeprefix('-')} printed on it "
            f"{'down' if robot.imu.axes.startswith('-') else 'up'}, and keep its wires short."
        )
    if robot.battery.pin is not None:
        divider = battery_divider(robot, board, str(robot.battery.pin))
        yield (
            f"Battery voltage: {divider.series} from the battery's + to {divider.node}, "
            f"{divider.parallel} from {divider.node} to GND. Never without the divider: more than "
            f"{board.volts:g} V destroys the pin."
        )
    yield (
        f"10 kOhm {_floating_inputs(facts, robot)} to GND keep the motors off while the board is "
        "flashed, when its pins float."
    )
    for name in SIDES:
        names = driver_names(robot.drive.left.motor.driver, name)
        if getattr(robot.drive, name).motor.reversed:
            how = f"{names.in1} low drives"
            if names.in2 is not None:
                how = f"{names.in1} low and {names.in2} high drive"
            yield f"The {name} motor is mounted mirrored (reversed: true): {how} it forward."


def _motor_notes(robot: Robot, driver: str) -> Iterator[str]:
    text = pulses_text(robot)
    yield f"{text[0].upper()}{text[1:]}."
    if driver == "L298N" and robot.drive.left.motor.enable is None:
        yield "Leave the jumpers ENA and ENB on the L298N."
    elif driver == "L298N":
        yield (
            "Remove the jumpers ENA and ENB from the L298N: with them the board cannot release the "
            "motors, and 5 V is applied to its pins."
        )
    if driver == "L298N":
        if robot.board.supply == "regulator":
            yield "Keep the L298N's 5 V jumper: its regulator supplies the board. At most 12 V."
        else:
            yield "Do not connect the L298N's 5 V terminal: its regulator supplies only the L298N."
    if robot.drive.wheelbase is not None:
        yield (
            "Connect the two motors of a side in parallel, so that they turn in the same "
            "direction: their currents add up."
        )


def _voltage_notes(robot: Robot, board: BoardPins) -> Iterator[str]:
    """What a board of 3.3 V needs."""
    if board.volts == FIVE_V:
        return
    most = f"{board.volts:g} V"
    yield f"The pins of {board.with_article} take {most}: 5 V destroys them."
    if any(getattr(robot.drive, side).encoder.channels for side in SIDES):
        yield (
            f"Supply the encoders with {most}. One that works only with 5 V needs 1 kOhm in the "
            "wire of each of its outputs, and 2 kOhm from the pin to GND."
        )
    if not robot.link.has_radio:
        yield f"The cable to the computer goes to the {board.title}'s own USB socket."


def _floating_inputs(facts: MotorDriverFacts, robot: Robot) -> str:
    """The inputs that switch the motors on, as a person lists them."""
    if facts.standby is not None:
        return f"from {facts.standby}"
    halves = (facts.left, facts.right)
    has_enable = robot.drive.left.motor.enable is not None
    inputs = [(half.enable,) if has_enable else (half.in1, half.in2) for half in halves]
    return join_words([f"from {name}" for names in inputs for name in names if name], "and")
