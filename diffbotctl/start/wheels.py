"""The wiring check with lifted wheels: each wheel turns alone, its encoder counts, a person looks.

A slotted disc with one channel counts alike in both directions, so only an eye can tell which way a
wheel turned; which encoder counted tells the rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from typing import TYPE_CHECKING, NamedTuple

from diffbotctl.config.harness import BOARD, DRIVER, harness
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Encoders, Wheels

if TYPE_CHECKING:
    from diffbotctl.config.robot import Robot
    from diffbotctl.flash.visit import Visit

OTHER = {"left": "right", "right": "left"}
ANSWERS = ("forward", "backward", "other wheel", "still")
TURNS = 0.75  # of the wheel: enough to see which way it goes
SPEED = 0.3  # of the rated speed: above what friction holds, slow enough to follow with the eye
STEP = 0.05  # s between two commands; the board stops by itself after 0.1 s at the least
LEAST = 1 / 4  # of the edges expected, below which an encoder counts as silent
REST = 1.0  # s for the wheel to run out and the last edges to be told


class Turned(NamedTuple):
    """What the encoders counted while one wheel's motor had power."""

    own: int
    other: int
    expected: float


class Verdict(NamedTuple):
    """What follows from counts and eye. `kind`: fine, reversed, or fault, with cause and fix."""

    kind: str
    cause: str = ""
    fix: str = ""


def turn(visit: Visit, robot: Robot, side: str) -> Turned:
    """Turn one wheel, and stop it. The wheels must be lifted. Raises RunError, OSError."""
    motor, encoder = getattr(robot.drive, side).motor, getattr(robot.drive, side).encoder
    speed = SPEED * motor.rated
    before = _counts(visit)
    wanted = Wheels(0, speed, 0.0) if side == "left" else Wheels(0, 0.0, speed)
    for _ in range(round(TURNS * 2 * pi / speed / STEP)):
        visit.host.command(visit.now, wanted)
        _exhaust(visit.stay(STEP))
    visit.host.stop(visit.now)
    _exhaust(visit.stay(REST))
    if not visit.host.stopped:
        cause = "the board did not confirm that it stopped the wheel"
        fix = "pull the motors' supply, then look at cable and port: diffbotctl blink"
        raise RunError(Problem("E-START-WIRING", f"{side} wheel", cause, fix))
    after = _counts(visit)
    counts = {"left": after.left - before.left, "right": after.right - before.right}
    return Turned(abs(counts[side]), abs(counts[OTHER[side]]), TURNS * encoder.slots)


def judge(robot: Robot, side: str, turned: Turned, seen: str) -> Verdict:
    """What counts and eye (one of ANSWERS) say of one side's wiring."""
    least = turned.expected * LEAST
    own, other = turned.own >= least, turned.other >= least
    motor, encoder = f"{side} motor", f"{side} encoder"
    if seen == "still":
        cause = f"the {side} wheel stood still"
        return Verdict("fault", cause, f"is the battery on? Then look at {_wires(robot, motor)}")
    if seen == "other wheel":
        cause = f"the {OTHER[side]} wheel turned when the {side} motor had power"
        return Verdict("fault", cause, f"exchange the two motors: {_wires(robot, motor)}")
    if own and other:
        cause = f"both encoders counted when the {side} wheel turned"
        return Verdict("fault", cause, f"one picks up the other: look at {_wires(robot, encoder)}")
    if other:
        cause = f"the {OTHER[side]} encoder counted when the {side} wheel turned"
        return Verdict("fault", cause, f"exchange their OUT wires: {_wires(robot, encoder)}")
    if not own:
        cause = f"the {side} wheel turned, but its encoder counted {turned.own} of "
        cause += f"{turned.expected:.0f} slots"
        fix = f"does its disc pass through the fork? Then look at {_wires(robot, encoder)}"
        return Verdict("fault", cause, fix)
    return Verdict("fine" if seen == "forward" else "reversed")


def _wires(robot: Robot, part: str) -> str:
    """All wires of a part, and of the half of the driver that feeds it, in words."""
    made = harness(robot)
    wires = made.of(part, BOARD) if part.endswith("encoder") else made.of(part, DRIVER)
    wires += [wire for wire in made.of(BOARD, DRIVER) if wire.purpose.startswith(part)]
    return ", ".join(
        f"{made.parts[wire.start.part].title} {wire.start.name} to "
        f"{made.parts[wire.end.part].title} {wire.end.name}"
        for wire in wires
    )


def _counts(visit: Visit) -> Encoders:
    heard = visit.heard.get("encoders")
    if not isinstance(heard, Encoders):
        cause, fix = "the board tells no encoder counts", "unplug it, plug it in, and try again"
        raise RunError(Problem("E-START-WIRING", f"port {visit.port.device}", cause, fix))
    return heard


def _exhaust(events: Iterator[object]) -> None:
    for _ in events:
        pass
