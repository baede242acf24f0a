"""Checks of pins: each has the function it is wired for, and only one use."""

from collections.abc import Iterator
from typing import Literal, NamedTuple, assert_never

from diffbotctl.config.board_pins import BOARDS, SIMULATED, BoardPins
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS, MOTOR_INPUTS
from diffbotctl.config.robot import SIDES
from diffbotctl.errors import Place, join_words

PINS_SHOWN_MAX = 6  # pins listed in a fix

PinRole = Literal["digital", "pwm", "interrupt", "analog", "change"]


class PinUse(NamedTuple):
    """One use of a pin: its name on the board, its role, a label, and its place in the file."""

    pin: str
    role: PinRole
    label: str
    place: Place | str


@check("board.type", "link.uart", "link.protocol")
def check_pins(context: CheckContext, board_type: str, uart: int, protocol: str) -> None:
    """Check every pin of the robot file against the table of its board."""
    if board_type == SIMULATED:
        if context.real:
            place = context.robot_place("board", "type")
            cause = "this robot exists only in the simulator: it has no board"
            context.error("E-BOARD-SIMULATED", place, cause, "run it without --port")
        return
    board = BOARDS[board_type]
    if uart not in board.uarts:
        cause = f"{board.with_article} has no uart {uart}"
        fix = f"it has uart {join_words(board.uarts)}"
        context.error("E-LINK-UART", context.error_place("link.uart", "board.type"), cause, fix)
    elif not board.links[protocol]:
        cause = f"the book's firmware does not run on {board.with_article}"
        place = context.error_place("link.protocol", "board.type")
        context.error("E-LINK-UART", place, cause, "set link.protocol: diffbot")
    elif uart not in board.links[protocol]:
        ports = join_words(board.links[protocol], "and")
        cause = f"our firmware uses uart {ports} of {board.with_article}, not {uart}"
        other = board.links[protocol][-1]
        receive, transmit = board.uarts[other]
        pins = f"its TX to pin {receive}, its RX to pin {transmit}"
        fix = f"connect the radio to uart {other}: {pins}"
        context.error("E-LINK-UART", context.error_place("link.uart", "link.protocol"), cause, fix)
    else:
        _check_required(context)
        serial = serial_pins(board, uart, protocol)
        _PinCheck(board, protocol, serial, list(_pins_in_use(context, board))).check(context)


def _check_required(context: CheckContext) -> None:
    """Refuse `none` for a pin that a robot with a board must have."""
    paths: list[tuple[str, ...]] = [
        ("drive", side, "encoder", "pin")
        for side in SIDES
        if context.values(f"drive.{side}.encoder.channels") != (0,)
    ]
    for side in SIDES:
        paths += [("drive", side, "motor", name) for name in _motor_inputs(context, side)]
    pulses = context.pulses
    if pulses is not None and pulses.on == "inputs":  # without a pin it is wired high
        paths = [steps for steps in paths if steps[-1] != "enable"]
    for steps in paths:
        value = context.robot_value(*steps)
        if value is not None and value.data in (None, "none"):
            code = "E-BOARD-PIN"
            cause = "only a robot that exists just in the simulator can omit this pin"
            fix = "set the pin number, or board: {type: simulated}"
            if steps[-1] == "enable" and pulses is not None:
                code, cause = "E-DRIVER", f"the pulses are on enable: {pulses.why}"
                fix = "remove the jumper, wire a pin with PWM to enable, and set its number"
            context.error(code, value.place, cause, fix)


def _motor_inputs(context: CheckContext, side: str) -> tuple[str, ...]:
    """The inputs of the driver of this motor, by their keys; all when it is unknown."""
    values = context.values(f"drive.{side}.motor.driver")
    facts = MOTOR_DRIVERS.get(values[0]) if values else None
    return facts.inputs() if facts else MOTOR_INPUTS["enable_in1_in2"]


def serial_pins(board: BoardPins, uart: int, protocol: str) -> dict[str, str]:
    """The pins that carry serial lines, with what they carry.

    Our firmware uses all its ports at once.
    """
    pins: dict[str, str] = {}
    if protocol == "diffbot":
        for port in board.links[protocol]:
            pins |= dict.fromkeys(board.uarts[port], f"uart {port} of our firmware")
    pins |= dict.fromkeys(board.uarts[uart], f"uart {uart}, the link")
    if board.has_usb_serial:
        pins |= dict.fromkeys(board.uarts[0], "the USB port")
    return pins


def _pins_in_use(context: CheckContext, board: BoardPins) -> Iterator[PinUse]:
    """Every pin that the robot file names."""
    if context.values("imu.type") not in (None, (None,)):
        for line, label in zip(board.i2c, ("data line", "clock line"), strict=True):
            yield PinUse(line, "digital", f"imu's {label}", context.robot_place("imu", "type"))
    pins: list[tuple[PinRole, str, str]] = []
    on_inputs = context.pulses is not None and context.pulses.on == "inputs"
    role: PinRole = "pwm" if on_inputs else "digital"
    enable: PinRole = "digital" if on_inputs else "pwm"
    for side in SIDES:
        inputs = _motor_inputs(context, side)
        for name in ("in1", "in2"):
            if name in inputs:
                label = f"{side} direction input" if "enable" in inputs else f"{side} motor {name}"
                pins.append((role, label, f"drive.{side}.motor.{name}"))
    for side in SIDES:
        if "enable" in _motor_inputs(context, side):
            pins.append((enable, f"{side} motor enable", f"drive.{side}.motor.enable"))
    pins.append(("digital", "driver's standby", "drive.left.motor.standby"))
    pins += [("interrupt", f"{side} encoder", f"drive.{side}.encoder.pin") for side in SIDES]
    second: PinRole = "interrupt" if board.counts_of_slot > 1 else "digital"
    pins += [
        (second, f"{side} encoder's channel B", f"drive.{side}.encoder.pin_b") for side in SIDES
    ]
    for name in (context.robot.sensors or {}) if context.robot else ():
        pins.append(("analog", f"{name} sensor", f"sensors.{name}.pin"))
        pins.append(("digital", f"{name} sensor's trigger", f"sensors.{name}.trigger"))
        pins.append(("change", f"{name} sensor's echo", f"sensors.{name}.echo"))
    pins += [("analog", "battery", "battery.pin"), ("digital", "stop button", "board.stop_button")]
    for role, label, path in pins:
        pin = context.values(path)
        if pin is not None:
            place = context.robot_place(*path.split("."))
            yield PinUse(board.named(str(pin[0])), role, label, place)


class _PinCheck(NamedTuple):
    """Checks the pins in `uses` on one board. `serial` are the pins that carry serial lines."""

    board: BoardPins
    protocol: str
    serial: dict[str, str]
    uses: list[PinUse]

    def check(self, context: CheckContext) -> None:
        first: dict[str, PinUse] = {}
        outputs: dict[int, PinUse] = {}
        for use in self.uses:
            problem = self._problem(use)
            if problem is not None:
                context.error(problem[0], use.place, problem[1], self._fix(use))
            other = first.setdefault(use.pin, use)
            if other is not use:
                where = _short_place(other.place, use.place)
                cause = f"pin {use.pin} is already used by the {other.label} ({where})"
                fix = f"use another pin for the {use.label}"
                context.error("E-PIN-TAKEN", use.place, cause, fix)
            if self.board.shares_pwm and use.role == "pwm" and use.pin in self.board.pwm:
                self._check_output(context, use, outputs)

    def _check_output(self, context: CheckContext, use: PinUse, outputs: dict[int, PinUse]) -> None:
        """Refuse two pins with one PWM output: both would have the same duty."""
        other = outputs.setdefault(self.board.pwm[use.pin], use)
        if other.pin == use.pin:
            return
        where = _short_place(other.place, use.place)
        cause = (
            f"pins {other.pin} and {use.pin} of {self.board.with_article} have one PWM output, "
            f"which the {other.label} uses ({where})"
        )
        taken = {self.board.pwm[each.pin] for each in outputs.values()}
        used = {each.pin for each in self.uses} | set(self.serial)
        free = [
            pin
            for pin in pins_for(self.board, "pwm", self.protocol)
            if pin not in used and self.board.pwm[pin] not in taken
        ]
        fix = f"use {join_words(free[:PINS_SHOWN_MAX])}"
        context.error("E-PIN-PWM", use.place, cause, fix)

    def _problem(self, use: PinUse) -> tuple[str, str] | None:
        """Code and cause when the pin does not have the function, else None."""
        board, pin = self.board, use.pin
        if not board.has(pin):
            return "E-PIN-UNKNOWN", f"{board.with_article} has no pin {pin}"
        pin_of_board = f"pin {pin} of {board.with_article}"
        if pin in self.serial:
            return "E-PIN-UART", f"{pin_of_board} carries {self.serial[pin]}"
        match use.role:
            case "pwm":
                timer = board.clock_timer[self.protocol]
                if pin not in board.pwm:
                    effect = "so the motor could only be off or at full speed"
                    return "E-PIN-PWM", f"{pin_of_board} has no PWM, {effect}"
                if board.pwm[pin] == timer:
                    source = f"timer {timer}, which keeps the board's clock"
                    return "E-PIN-TIMER", f"the PWM of pin {pin} comes from {source}"
            case "interrupt" | "change":
                cause = self._interrupt_problem(use)
                if cause is not None:
                    return "E-PIN-INTERRUPT", f"{pin_of_board} {cause}"
            case "analog":
                if pin not in board.analog:
                    cause = f"{pin_of_board} cannot measure a voltage, only high or low"
                    return "E-PIN-ANALOG", cause
                return None
            case "digital":
                pass
            case _:
                assert_never(use.role)
        if pin in board.analog_only:
            return "E-PIN-DIGITAL", f"{pin_of_board} can only measure a voltage, not switch"
        return None

    def _interrupt_problem(self, use: PinUse) -> str | None:
        if use.pin in pins_for(self.board, use.role, self.protocol):
            return None
        if use.role == "change":
            return "raises no interrupt when it changes, as an echo needs"
        return "cannot raise an interrupt, so edges would be missed"

    def _fix(self, use: PinUse) -> str:
        candidates = pins_for(self.board, use.role, self.protocol)
        taken = {other.pin: other.label for other in self.uses if other is not use}
        free = [pin for pin in candidates if pin not in taken and pin not in self.serial]
        choice = f"use {join_words(free[:PINS_SHOWN_MAX])}"
        if not free:
            choice = "no suitable pin is free; move another connection first"
        elif len(free) > PINS_SHOWN_MAX:
            more = len(free) - PINS_SHOWN_MAX
            choice += f" ({more} more {'is' if more == 1 else 'are'} suitable)"
        if len(candidates) > PINS_SHOWN_MAX * 2:
            return choice
        notes = [
            f"{pin} is used by the {label}" for pin, label in taken.items() if pin in candidates
        ]
        lines = [pin for pin in candidates if pin in self.serial]
        if lines:
            verb = "carries" if len(lines) == 1 else "carry"
            notes.append(f"{join_words(lines, 'and')} {verb} {self.serial[lines[0]]}")
        return f"{choice} ({'; '.join(notes)})" if notes else choice


def pins_for(board: BoardPins, role: PinRole, protocol: str) -> list[str]:
    """The pins of `board` with the function `role`, without those on the clock's timer."""
    match role:
        case "pwm":
            clock = board.clock_timer[protocol]
            return sorted((pin for pin, timer in board.pwm.items() if timer != clock), key=int)
        case "interrupt":
            return list(board.interrupts)
        case "analog":
            return list(board.analog)
        case "change":
            return list(board.changes)
        case "digital":
            pins = (*board.digital, *board.analog)
            return [pin for pin in pins if pin not in board.analog_only]
        case _:
            assert_never(role)


def _short_place(place: Place | str, seen_from: Place | str) -> str:
    """`place`; only its line when `seen_from` is in the same file."""
    if isinstance(place, Place) and isinstance(seen_from, Place):
        is_same_file = place.source.name == seen_from.source.name
        return f"line {place.line}" if is_same_file else f"{place.source.name}:{place.line}"
    return str(place)
