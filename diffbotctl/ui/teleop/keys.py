"""What each key means to whoever drives: two sets of letters, and the arrows in both."""

from __future__ import annotations

from typing import NamedTuple


class Way(NamedTuple):
    """Shares of the wanted speed: 1 forward or turning left, -1 backward or turning right."""

    forward: float
    turn: float


class Faster(NamedTuple):
    """Factors of the wanted speed and turn rate."""

    speed: float
    turn: float


class Step(NamedTuple):
    """Shares of the limits that are added to what is commanded, where commands stay."""

    speed: float
    turn: float


HALT = Way(0.0, 0.0)
UP, DOWN = 1.1, 1 / 1.1  # as teleop_twist_keyboard: a tenth a press
STEP = 0.1  # as turtlebot3_teleop's steps, in shares of this robot's limits

ARROWS: dict[str, Way | Faster | Step] = {
    "up": Way(1, 0),
    "down": Way(-1, 0),
    "left": Way(0, 1),
    "right": Way(0, -1),
    "space": HALT,
    "+": Faster(UP, UP),
    "-": Faster(DOWN, DOWN),
}

# teleop_twist_keyboard's. Backwards the sign of the turn is the one of its table: `m` leads the
# robot's tail to the right, as a car's would with the wheel turned left.
TWIST: dict[str, Way | Faster | Step] = {
    **ARROWS,
    "u": Way(1, 1),
    "i": Way(1, 0),
    "o": Way(1, -1),
    "j": Way(0, 1),
    "k": HALT,
    "l": Way(0, -1),
    "m": Way(-1, -1),
    ",": Way(-1, 0),
    ".": Way(-1, 1),
    "q": Faster(UP, UP),
    "z": Faster(DOWN, DOWN),
    "w": Faster(UP, 1.0),
    "x": Faster(DOWN, 1.0),
    "e": Faster(1.0, UP),
    "c": Faster(1.0, DOWN),
}

# turtlebot3_teleop's letters: held down they drive; where commands stay they add steps, as there.
TURTLE_HELD: dict[str, Way | Faster | Step] = {
    **ARROWS,
    "w": Way(1, 0),
    "x": Way(-1, 0),
    "a": Way(0, 1),
    "d": Way(0, -1),
    "s": HALT,
}
TURTLE_KEPT: dict[str, Way | Faster | Step] = {
    **TURTLE_HELD,
    "w": Step(STEP, 0.0),
    "x": Step(-STEP, 0.0),
    "a": Step(0.0, STEP),
    "d": Step(0.0, -STEP),
}


class KeySet(NamedTuple):
    """A set of keys, as it is when keys are held, when commands stay, and in one line of help."""

    name: str
    held: dict[str, Way | Faster | Step]
    kept: dict[str, Way | Faster | Step]
    help: str


SETS = {
    each.name: each
    for each in (
        KeySet("twist", TWIST, TWIST, "u i o  j k l  m , .  drive, k stops; q z  w x  e c  speed"),
        KeySet("turtle", TURTLE_HELD, TURTLE_KEPT, "w x  a d  drive, s stops; + -  speed"),
    )
}
