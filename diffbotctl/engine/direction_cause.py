"""What is wrong with a wheel that turns against its command, and what to do, in words."""

from __future__ import annotations

from diffbotctl.config.motor_drivers import driver_names
from diffbotctl.config.robot import SideSection
from diffbotctl.engine.wheel_direction import DirectionFault, Part, Subject
from diffbotctl.errors import join_words

# What a person has seen before the stop, where the motors are wrong, and where the encoders are.
SEEN = {
    Subject.LEFT_WHEEL: ("the left wheel turned backward when driven forward", "it turned forward"),
    Subject.RIGHT_WHEEL: (
        "the right wheel turned backward when driven forward",
        "it turned forward",
    ),
    Subject.BOTH_WHEELS: ("the robot drove backward instead of forward", "it drove as commanded"),
    Subject.EXCHANGED: ("the robot turned right instead of left", "it turned as commanded"),
    Subject.BOTH_OR_EXCHANGED: ("the robot turned right instead of left", "it turned as commanded"),
}


def direction_cause(fault: DirectionFault, left: SideSection, right: SideSection) -> str:
    """The cause of a stop: which part, which wires to exchange, or which key of the robot file."""
    sides = {"left": left, "right": right}
    subject = fault.subject
    if subject is Subject.EXCHANGED:
        found = "each wheel follows the command of the other one"
        fixes = {Part.MOTOR: _exchanged_motors(sides), Part.ENCODER: _exchanged_encoders(sides)}
    elif subject is Subject.BOTH_OR_EXCHANGED:
        found = "both wheels count against their commands in a turn"
        both = {"motors": _reversed_motors(sides), "encoders": _reversed_encoders(sides)}
        fixes = {
            Part.MOTOR: f"{_exchanged_motors(sides)}; or {both['motors']}",
            Part.ENCODER: f"{_exchanged_encoders(sides)}; or {both['encoders']}",
        }
    else:
        if subject is Subject.BOTH_WHEELS:
            found = "both wheels count against their commands"
        else:
            verb = "turns" if fault.part is Part.MOTOR else "counts"
            found = f"the {subject.value} wheel {verb} against its command"
            sides = {subject.value: sides[subject.value]}
        fixes = {Part.MOTOR: _reversed_motors(sides), Part.ENCODER: _reversed_encoders(sides)}
    if fault.part is not Part.UNKNOWN:
        return f"{found}; by the IMU: {fixes[fault.part]}"
    motors, encoders = SEEN[subject]
    return f"{found}. If {motors}: {fixes[Part.MOTOR]}. If {encoders}: {fixes[Part.ENCODER]}"


def _reversed_motors(sides: dict[str, SideSection]) -> str:
    """The fix of motors that turn backward."""
    return "; ".join(
        f"the {name} motor is reversed: exchange its wires at {_outputs(side, name)} of the motor "
        f"driver{_inputs(side)}, or set drive.{name}.motor.reversed: "
        f"{_yaml(not side.motor.reversed)}"
        for name, side in sides.items()
    )


def _reversed_encoders(sides: dict[str, SideSection]) -> str:
    """The fix of encoders that count down going forward."""
    return "; ".join(
        f"the {name} encoder counts backward: exchange its wires A and B at pins {_pins(side)}, or "
        f"set drive.{name}.encoder.reversed: {_yaml(not side.encoder.reversed)}"
        for name, side in sides.items()
    )


def _exchanged_motors(sides: dict[str, SideSection]) -> str:
    left, right = sides["left"], sides["right"]
    pins = join_words([pin for pin in ("enable", "in1", "in2") if getattr(left.motor, pin)], "and")
    return (
        f"the motors are exchanged: connect the left one to {_outputs(left, 'left')} of the motor "
        f"driver and the right one to {_outputs(right, 'right')}, or exchange {pins} of "
        "drive.left.motor and drive.right.motor"
    )


def _exchanged_encoders(sides: dict[str, SideSection]) -> str:
    return (
        "the encoders are exchanged: connect the left one to pins "
        f"{_pins(sides['left'])} and the right one to pins {_pins(sides['right'])}, or exchange "
        "pin and pin_b of drive.left.encoder and drive.right.encoder"
    )


def _outputs(side: SideSection, name: str) -> str:
    terminals = driver_names(side.motor.driver, name)
    return f"{terminals.first_output} and {terminals.second_output}"


def _inputs(side: SideSection) -> str:
    """The wires of two direction inputs, which may be exchanged as well."""
    motor = side.motor
    return "" if motor.in2 is None else f" (or those at pins {motor.in1} and {motor.in2})"


def _pins(side: SideSection) -> str:
    return f"{side.encoder.pin} and {side.encoder.pin_b}"


def _yaml(value: bool) -> str:
    return str(value).lower()
