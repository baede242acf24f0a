"""Pins: each can do what it is wired for, and is wired for one thing only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from diffbotctl.config.board_pins import BOARDS, SIMULATED, BoardPins
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.robot import SIDES
from diffbotctl.errors import Place, join_words

SHOWN = 6  # pins that a fix names before it says that there are more


class Use(NamedTuple):
    """One pin in one role: its name on the board, what it does, and where that is written."""

    pin: str
    role: str
    label: str
    place: Place | str


def check_pins(context: CheckContext) -> None:
    """Check every pin of the robot file against the table of its board."""
    known = context.values("board.type", "link.uart", "link.protocol")
    if known is None:
        return
    if known[0] == SIMULATED:
        _check_simulated(context)
        return
    board, uart, protocol = BOARDS[known[0]], known[1], known[2]
    if uart not in board.uarts:
        cause = f"an {board.title} has no uart {uart}"
        fix = f"it has uart {join_words(board.uarts)}"
        context.error("E-LINK-UART", context.error_place("link.uart", "board.type"), cause, fix)
        return
    if uart not in board.links[protocol]:
        ports = join_words(board.links[protocol], "and")
        cause = f"our firmware speaks on uart {ports} of a {board.title}, not on {uart}"
        fix = f"connect the radio to uart {board.links[protocol][-1]}: {_pins_of(board, protocol)}"
        context.error("E-LINK-UART", context.error_place("link.uart", "link.protocol"), cause, fix)
        return
    serial = serial_pins(board, uart, protocol)
    _check_given(context)
    uses = list(pins_in_use(context, board))
    for use in uses:
        _check_use(context, board, protocol, use, uses, serial)
    _check_shared(context, uses)


def _check_simulated(context: CheckContext) -> None:
    if context.real:
        place = context.robot_place("board", "type")
        cause = "this robot lives in the simulator alone: there is no board to speak to"
        context.error("E-BOARD-SIMULATED", place, cause, "run it without --port")


def _check_given(context: CheckContext) -> None:
    """Refuse `none` for a pin that a robot with a board must have."""
    if context.robot is None:
        return
    paths: list[tuple[str, ...]] = [("drive", side, *steps) for side in SIDES for steps in NEEDED]
    for name, sensor in (context.robot.sensors or {}).items():
        if sensor is None:
            continue
        if sensor.type in PINLESS:
            cause = f"a {sensor.type} can only be simulated yet: no board of ours reads it"
            place = context.robot_place("sensors", name, "type")
            context.error(
                "E-BOARD-SENSOR", place, cause, "remove it, or set board: {type: simulated}"
            )
        else:
            paths.append(("sensors", name, "pin"))
    for steps in paths:
        value = context.robot_value(*steps)
        if value is not None and value.data in NONE:
            cause = "only a robot that is simulated alone does without this pin"
            fix = "give the pin's number, or set board: {type: simulated}"
            context.error("E-BOARD-PIN", value.place, cause, fix)


NEEDED = (("motor", "enable"), ("motor", "in1"), ("motor", "in2"), ("encoder", "pin"))
PINLESS = ("lds01", "overhead_camera")  # sensors that no pin reads
NONE = (None, "none")


def _pins_of(board: BoardPins, protocol: str) -> str:
    receive, transmit = board.uarts[board.links[protocol][-1]]
    return f"its TX to pin {receive}, its RX to pin {transmit}"


def serial_pins(board: BoardPins, uart: int, protocol: str) -> dict[str, str]:
    """The pins that carry serial lines, with what they carry.

    Our firmware listens on all its ports at once, whichever is the link.
    """
    found: dict[str, str] = {}
    if protocol == "diffbot":
        for port in board.links[protocol]:
            found.update(dict.fromkeys(board.uarts[port], f"uart {port} of our firmware"))
    found.update(dict.fromkeys(board.uarts[uart], f"uart {uart}, the link"))
    found.update(dict.fromkeys(board.uarts[0], "the USB port"))
    return found


def pins_in_use(context: CheckContext, board: BoardPins) -> Iterator[Use]:
    """Every pin that the robot file names."""
    paths: list[tuple[str, str, tuple[str, ...], str]] = [
        ("digital", "direction input", ("drive", side, "motor", name), side)
        for side in SIDES
        for name in ("in1", "in2")
    ]
    paths += [("pwm", "motor enable", ("drive", side, "motor", "enable"), side) for side in SIDES]
    paths += [("interrupt", "encoder", ("drive", side, "encoder", "pin"), side) for side in SIDES]
    for name in (context.robot.sensors or {}) if context.robot else ():
        paths.append(("analog", "sensor", ("sensors", name, "pin"), name))
    paths.append(("analog", "battery", ("battery", "pin"), ""))
    paths.append(("digital", "stop button", ("board", "stop_button"), ""))
    for role, label, steps, owner in paths:
        found = context.values(".".join(steps))
        if found is not None:
            whose = f"{owner} {label}" if owner else label
            yield Use(board.named(str(found[0])), role, whose, context.robot_place(*steps))


def _check_use(
    context: CheckContext,
    board: BoardPins,
    protocol: str,
    use: Use,
    uses: list[Use],
    serial: dict[str, str],
) -> None:
    wrong = _wrong(board, protocol, use, serial)
    if wrong is not None:
        code, cause = wrong
        fix = _fix(able(board, use.role, protocol), use, uses, serial)
        context.error(code, use.place, cause, fix)


def _wrong(
    board: BoardPins, protocol: str, use: Use, serial: dict[str, str]
) -> tuple[str, str] | None:
    """The code and the reason why this pin cannot do this, or None when it can."""
    pin = f"pin {use.pin} of a {board.title}".replace("a ATmega", "an ATmega")
    if not board.has(use.pin):
        return "E-PIN-UNKNOWN", f"a {board.title} has no pin {use.pin}".replace("a AT", "an AT")
    if use.pin in serial:
        return "E-PIN-UART", f"{pin} carries {serial[use.pin]}"
    if use.role == "pwm" and use.pin not in board.pwm:
        return "E-PIN-PWM", f"{pin} has no PWM, so the motor could only be off or at full speed"
    timer = board.clock_timer[protocol]
    if use.role == "pwm" and board.pwm[use.pin] == timer:
        cause = f"the PWM of pin {use.pin} comes from timer {timer}, which keeps the board's clock"
        return "E-PIN-TIMER", cause
    if use.role == "interrupt" and use.pin not in board.interrupts:
        return "E-PIN-INTERRUPT", f"{pin} cannot raise an interrupt, so edges would be missed"
    if use.role == "analog" and use.pin not in board.analog:
        return "E-PIN-ANALOG", f"{pin} cannot measure a voltage, only high or low"
    if use.role != "analog" and use.pin in board.analog_only:
        return "E-PIN-DIGITAL", f"{pin} can only measure a voltage, not switch"
    return None


def able(board: BoardPins, role: str, protocol: str) -> list[str]:
    """The pins of `board` that can do `role`, those on the clock's timer left out."""
    if role == "pwm":
        clock = board.clock_timer[protocol]
        return sorted((pin for pin, timer in board.pwm.items() if timer != clock), key=int)
    if role == "interrupt":
        return list(board.interrupts)
    if role == "analog":
        return list(board.analog)
    return [pin for pin in (*board.digital, *board.analog) if pin not in board.analog_only]


def _fix(candidates: list[str], use: Use, uses: list[Use], serial: dict[str, str]) -> str:
    taken = {each.pin: each.label for each in uses if each is not use}
    free = [pin for pin in candidates if pin not in taken and pin not in serial]
    shown = free[:SHOWN]
    more = f" ({len(free) - SHOWN} more would do)" if len(free) > SHOWN else ""
    choice = f"use {join_words(shown)}{more}"
    if not free:
        choice = "no pin that could do it is free: move something else first"
    if len(candidates) > SHOWN * 2:
        return choice
    notes = [f"{pin} is the {label}'s" for pin, label in taken.items() if pin in candidates]
    lines = [pin for pin in candidates if pin in serial]
    if lines:
        verb = "carries" if len(lines) == 1 else "carry"
        notes.append(f"{join_words(lines, 'and')} {verb} {serial[lines[0]]}")
    return f"{choice} ({'; '.join(notes)})" if notes else choice


def _check_shared(context: CheckContext, uses: list[Use]) -> None:
    first: dict[str, Use] = {}
    for use in uses:
        other = first.setdefault(use.pin, use)
        if other is use:
            continue
        cause = f"pin {use.pin} is already the {other.label}'s ({_line(other.place, use.place)})"
        fix = f"give the {use.label} a pin of its own"
        context.error("E-PIN-TAKEN", use.place, cause, fix)


def _line(place: Place | str, seen_from: Place | str) -> str:
    """Where the other one stands, in few words."""
    if isinstance(place, Place) and isinstance(seen_from, Place):
        is_near = place.source.name == seen_from.source.name
        return f"line {place.line}" if is_near else f"{place.source.name}:{place.line}"
    return str(place)
