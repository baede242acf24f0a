"""What each key means to whoever drives: two sets of letters, and the arrows in both.

The hand on the keys: key presses and the time in, the velocity that is wanted out.

A terminal tells of presses and repeats, never of a release. So in the mode `hold` a press counts
for KEY_LASTS, until the next repeat; the first repeat comes later than that on many machines,
which is seen as a hiccup. In the mode `latched` it counts until another key; there only a terminal
that goes on answering keeps the robot moving.
"""

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
SPEED_UP_FACTOR, SPEED_DOWN_FACTOR = 1.1, 1 / 1.1  # as teleop_twist_keyboard: a tenth a press
SPEED_STEP_RATIO = 0.1  # as turtlebot3_teleop's steps, in shares of this robot's limits

ARROWS: dict[str, MoveKey | SpeedUpKey | StepKey] = {
    "up": MoveKey(1, 0),
    "down": MoveKey(-1, 0),
    "left": MoveKey(0, 1),
    "right": MoveKey(0, -1),
    "space": HALT,
    "+": SpeedUpKey(SPEED_UP_FACTOR, SPEED_UP_FACTOR),
    "-": SpeedUpKey(SPEED_DOWN_FACTOR, SPEED_DOWN_FACTOR),
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
    "q": SpeedUpKey(SPEED_UP_FACTOR, SPEED_UP_FACTOR),
    "z": SpeedUpKey(SPEED_DOWN_FACTOR, SPEED_DOWN_FACTOR),
    "w": SpeedUpKey(SPEED_UP_FACTOR, 1.0),
    "x": SpeedUpKey(SPEED_DOWN_FACTOR, 1.0),
    "e": SpeedUpKey(1.0, SPEED_UP_FACTOR),
    "c": SpeedUpKey(1.0, SPEED_DOWN_FACTOR),
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
TURTLE_LATCHED: dict[str, MoveKey | SpeedUpKey | StepKey] = {
    **TURTLE_HELD,
    "w": StepKey(SPEED_STEP_RATIO, 0.0),
    "x": StepKey(-SPEED_STEP_RATIO, 0.0),
    "a": StepKey(0.0, SPEED_STEP_RATIO),
    "d": StepKey(0.0, -SPEED_STEP_RATIO),
}


class KeySet(NamedTuple):
    """A set of keys, as it is when keys are held, when commands stay, and in one line of help."""

    name: str
    held: dict[str, MoveKey | SpeedUpKey | StepKey]
    kept: dict[str, MoveKey | SpeedUpKey | StepKey]
    help: str


KEY_SETS = {
    each.name: each
    for each in (
        KeySet("twist", TWIST, TWIST, "u i o  j k l  m , .  drive, k stops; q z  w x  e c  speed"),
        KeySet("turtle", TURTLE_HELD, TURTLE_LATCHED, "w x  a d  drive, s stops; + -  speed"),
    )
}


KEY_HOLD_TIMEOUT_S = (
    0.4  # s; repeats come every 30 to 50 ms, and 300 ms more may be lost in a network
)
FIRST_REPEAT_MAX_S = 0.7  # s from a press to its first repeat, at most, as keyboards are set up
MODES = ("hold", "latched")
INITIAL_SPEED_RATIO = 0.5  # of the limits: the speeds that one begins with
NO_KEY = ("", float("-inf"))
SPEED_MIN_RATIO = 0.05  # of the limits; slower, no wheel turns


class KeyboardVelocity:
    """`speed` (m/s) and `turn` (rad/s) are what a full press means; `limits` is their most.

    Times are seconds of any one clock.
    """

    def __init__(
        self, limits: tuple[float, float], keys: str = "twist", mode: str = "hold"
    ) -> None:
        self.limits = limits
        self.speed, self.turn = INITIAL_SPEED_RATIO * limits[0], INITIAL_SPEED_RATIO * limits[1]
        self.keys: KeySet = KEY_SETS[keys]
        self.mode = mode
        self.linear = self.angular = 0.0
        self.stuttered = False  # a key came again just after it had ceased to count
        self._ended = NO_KEY  # the key that ceased to count last, and when
        self._key = ""
        self.until: float | None = None  # when the press counts no more; None: nothing is pressed

    @property
    def is_on(self) -> bool:
        """True while a velocity is wanted, be it zero."""
        return self.until is not None

    def press(self, key: str, now: float) -> bool:
        """Take a key. False when it means nothing here."""
        table = self.keys.held if self.mode == "hold" else self.keys.kept
        meaning = table.get(key)
        if meaning is None:
            return False
        if isinstance(meaning, SpeedUpKey):
            self._faster(meaning)
        elif meaning == HALT:
            self.let_go()
        else:
            self.wanted(now)
            last, ended = self._ended
            self.stuttered = last == key and now - ended < FIRST_REPEAT_MAX_S - KEY_HOLD_TIMEOUT_S
            self._key, self._ended = key, NO_KEY
            self._move(meaning, now)
        return True

    def wanted(self, now: float) -> tuple[float, float] | None:
        """Velocity (m/s, rad/s) at `now`; None when nothing is pressed any more."""
        if self.until is not None and now >= self.until:
            self._ended = (self._key, self.until)
            self.let_go()
        return (self.linear, self.angular) if self.until is not None else None

    def let_go(self) -> None:
        """Nothing is pressed."""
        self.linear = self.angular = 0.0
        self.until = None

    def use(self, keys: str | None = None, mode: str | None = None) -> None:
        """Change the set of keys or the mode; the hand lets go."""
        self.let_go()
        self.keys = KEY_SETS[keys] if keys else self.keys
        self.mode = mode or self.mode

    def _move(self, meaning: MoveKey | StepKey, now: float) -> None:
        most, most_turn = self.limits
        if isinstance(meaning, MoveKey):
            self.linear, self.angular = meaning.forward * self.speed, meaning.turn * self.turn
        else:
            self.linear = _within(self.linear + meaning.speed * most, most)
            self.angular = _within(self.angular + meaning.turn * most_turn, most_turn)
        self.until = now + KEY_HOLD_TIMEOUT_S if self.mode == "hold" else float("inf")

    def _faster(self, meaning: SpeedUpKey) -> None:
        most, most_turn = self.limits
        was, was_turn = self.speed, self.turn
        self.speed = min(max(was * meaning.speed, SPEED_MIN_RATIO * most), most)
        self.turn = min(max(was_turn * meaning.turn, SPEED_MIN_RATIO * most_turn), most_turn)
        self.linear *= self.speed / was
        self.angular *= self.turn / was_turn


def _within(value: float, most: float) -> float:
    rounded = round(value, 9)  # ten steps up and ten down are zero again
    return min(max(rounded, -most), most)
