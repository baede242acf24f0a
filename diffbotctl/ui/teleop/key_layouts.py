"""What each key means to whoever drives: two sets of letters, and the arrows in both."""

from __future__ import annotations

from typing import NamedTuple


class MoveKey(NamedTuple):
    """Shares of the wanted speed: 1 forward or turning left, -1 backward or turning right."""

    forward: float
    turn: float


class SpeedUpKey(NamedTuple):
    """Factors of the wanted speed and turn rate."""

    speed: float
    turn: float


class StepKey(NamedTuple):
    """Shares of the limits that are added to what is commanded, where commands stay."""

    speed: float
    turn: float


HALT = MoveKey(0.0, 0.0)
UP, DOWN = 1.1, 1 / 1.1  # as teleop_twist_keyboard: a tenth a press
STEP = 0.1  # as turtlebot3_teleop's steps, in shares of this robot's limits

ARROWS: dict[str, MoveKey | SpeedUpKey | StepKey] = {
    "up": MoveKey(1, 0),
    "down": MoveKey(-1, 0),
    "left": MoveKey(0, 1),
    "right": MoveKey(0, -1),
    "space": HALT,
    "+": SpeedUpKey(UP, UP),
    "-": SpeedUpKey(DOWN, DOWN),
}

# teleop_twist_keyboard's. Backwards the sign of the turn is the one of its table: `m` leads the
# robot's tail to the right, as a car's would with the wheel turned left.
TWIST: dict[str, MoveKey | SpeedUpKey | StepKey] = {
    **ARROWS,
    "u": MoveKey(1, 1),
    "i": MoveKey(1, 0),
    "o": MoveKey(1, -1),
    "j": MoveKey(0, 1),
    "k": HALT,
    "l": MoveKey(0, -1),
    "m": MoveKey(-1, -1),
    ",": MoveKey(-1, 0),
    ".": MoveKey(-1, 1),
    "q": SpeedUpKey(UP, UP),
    "z": SpeedUpKey(DOWN, DOWN),
    "w": SpeedUpKey(UP, 1.0),
    "x": SpeedUpKey(DOWN, 1.0),
    "e": SpeedUpKey(1.0, UP),
    "c": SpeedUpKey(1.0, DOWN),
}

# turtlebot3_teleop's letters: held down they drive; where commands stay they add steps, as there.
TURTLE_HELD: dict[str, MoveKey | SpeedUpKey | StepKey] = {
    **ARROWS,
    "w": MoveKey(1, 0),
    "x": MoveKey(-1, 0),
    "a": MoveKey(0, 1),
    "d": MoveKey(0, -1),
    "s": HALT,
}
TURTLE_KEPT: dict[str, MoveKey | SpeedUpKey | StepKey] = {
    **TURTLE_HELD,
    "w": StepKey(STEP, 0.0),
    "x": StepKey(-STEP, 0.0),
    "a": StepKey(0.0, STEP),
    "d": StepKey(0.0, -STEP),
}


class KeySet(NamedTuple):
    """A set of keys, as it is when keys are held, when commands stay, and in one line of help."""

    name: str
    held: dict[str, MoveKey | SpeedUpKey | StepKey]
    kept: dict[str, MoveKey | SpeedUpKey | StepKey]
    help: str


SETS = {
    each.name: each
    for each in (
        KeySet("twist", TWIST, TWIST, "u i o  j k l  m , .  drive, k stops; q z  w x  e c  speed"),
        KeySet("turtle", TURTLE_HELD, TURTLE_KEPT, "w x  a d  drive, s stops; + -  speed"),
    )
}
