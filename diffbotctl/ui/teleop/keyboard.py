"""Keyboard teleoperation: key presses and the time in, the commanded velocity out.

Two sets of letters, and the arrows in both. A terminal reports presses and repeats, never a
release. So in the mode `hold` a press is valid for KEY_HOLD_TIMEOUT_S, until the next repeat; the
first repeat comes later than that on many machines, which is a short gap. In the mode `latched` it
is valid until another key; there the robot keeps moving only while the terminal answers.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

KeySetName = Literal["twist", "turtle"]
DriveMode = Literal["hold", "latched"]


class MoveKey(NamedTuple):
    """Shares of the set speeds: 1 forward or turning left, -1 backward or turning right."""

    forward: float
    turn: float


class SpeedUpKey(NamedTuple):
    """Factors of the set speed and turn rate."""

    speed: float
    turn: float


class StepKey(NamedTuple):
    """Shares of the limits that are added to the commanded velocity, where commands stay."""

    speed: float
    turn: float


KeyTable = dict[str, MoveKey | SpeedUpKey | StepKey]

HALT = MoveKey(0.0, 0.0)
SPEED_UP_FACTOR, SPEED_DOWN_FACTOR = 1.1, 1 / 1.1  # as in teleop_twist_keyboard
SPEED_STEP_RATIO = 0.1  # of this robot's limits, like the steps of turtlebot3_teleop

ARROWS: KeyTable = {
    "up": MoveKey(1, 0),
    "down": MoveKey(-1, 0),
    "left": MoveKey(0, 1),
    "right": MoveKey(0, -1),
    "space": HALT,
    "+": SpeedUpKey(SPEED_UP_FACTOR, SPEED_UP_FACTOR),
    "-": SpeedUpKey(SPEED_DOWN_FACTOR, SPEED_DOWN_FACTOR),
}

# teleop_twist_keyboard's. Backwards the sign of the turn is the one of its table: `m` moves the
# robot's tail to the right, like a car with the wheel turned left.
TWIST: KeyTable = {
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
TURTLE_HELD: KeyTable = {
    **ARROWS,
    "w": MoveKey(1, 0),
    "x": MoveKey(-1, 0),
    "a": MoveKey(0, 1),
    "d": MoveKey(0, -1),
    "s": HALT,
}
TURTLE_LATCHED: KeyTable = {
    **TURTLE_HELD,
    "w": StepKey(SPEED_STEP_RATIO, 0.0),
    "x": StepKey(-SPEED_STEP_RATIO, 0.0),
    "a": StepKey(0.0, SPEED_STEP_RATIO),
    "d": StepKey(0.0, -SPEED_STEP_RATIO),
}


class KeySet(NamedTuple):
    """A set of keys in the modes hold and latched, and one line of help."""

    name: KeySetName
    hold: KeyTable
    latched: KeyTable
    help: str


KEY_SETS: dict[KeySetName, KeySet] = {
    "twist": KeySet(
        "twist", TWIST, TWIST, "u i o  j k l  m , .  drive, k stops; q z  w x  e c  speed"
    ),
    "turtle": KeySet("turtle", TURTLE_HELD, TURTLE_LATCHED, "w x  a d  drive, s stops; + -  speed"),
}

# Repeats come every 30 to 50 ms, and 300 ms more may be lost in a network.
KEY_HOLD_TIMEOUT_S = 0.4
FIRST_REPEAT_MAX_S = 0.7  # from a press to its first repeat, as keyboards are set up
INITIAL_SPEED_RATIO = 0.5  # of the limits
SPEED_MIN_RATIO = 0.05  # of the limits; slower, no wheel turns
NO_KEY = ("", float("-inf"))


class KeyboardVelocity:
    """`speed` (m/s) and `turn_rate` (rad/s) are those of a full press; `limits` their maxima.

    Times are seconds of any one clock.
    """

    def __init__(
        self,
        limits: tuple[float, float],
        keys: KeySetName = "twist",
        mode: DriveMode = "hold",
    ) -> None:
        self.set_limits(*limits)
        self.keys = KEY_SETS[keys]
        self.mode: DriveMode = mode
        self.linear = self.angular = 0.0
        self.has_gap = False  # a key came again just after it had expired
        self._key = ""
        self._expired = NO_KEY  # the key that expired last, and when
        self._expires_at: float | None = None  # None: nothing is pressed

    def set_limits(
        self,
        speed_limit: float,
        turn_rate_limit: float,
        speed: float | None = None,
        turn_rate: float | None = None,
    ) -> None:
        """Set the limits and the initial speeds; by default half the limits."""
        self.limits = speed_limit, turn_rate_limit
        self.speed = min(speed or INITIAL_SPEED_RATIO * speed_limit, speed_limit)
        self.turn_rate = min(turn_rate or INITIAL_SPEED_RATIO * turn_rate_limit, turn_rate_limit)

    def press(self, key: str, now: float) -> bool:
        """Handle a key. False when it has no meaning here."""
        table = self.keys.hold if self.mode == "hold" else self.keys.latched
        meaning = table.get(key)
        if meaning is None:
            return False
        if isinstance(meaning, SpeedUpKey):
            self._change_speed(meaning)
        elif meaning == HALT:
            self.release()
        else:
            self.velocity(now)
            last, expired_at = self._expired
            late = now - expired_at < FIRST_REPEAT_MAX_S - KEY_HOLD_TIMEOUT_S
            self.has_gap = last == key and late
            self._key, self._expired = key, NO_KEY
            self._move(meaning, now)
        return True

    def velocity(self, now: float) -> tuple[float, float] | None:
        """Commanded velocity (m/s, rad/s) at `now`; None when no key is pressed."""
        if self._expires_at is not None and now >= self._expires_at:
            self._expired = (self._key, self._expires_at)
            self.release()
        return None if self._expires_at is None else (self.linear, self.angular)

    def release(self) -> None:
        self.linear = self.angular = 0.0
        self._expires_at = None

    def configure(self, keys: KeySetName | None = None, mode: DriveMode | None = None) -> None:
        """Change the set of keys or the mode; the velocity is released."""
        self.release()
        self.keys = KEY_SETS[keys] if keys else self.keys
        self.mode = mode or self.mode

    def _move(self, meaning: MoveKey | StepKey, now: float) -> None:
        maximum, turn_maximum = self.limits
        if isinstance(meaning, MoveKey):
            self.linear, self.angular = meaning.forward * self.speed, meaning.turn * self.turn_rate
        else:
            self.linear = _limited(self.linear + meaning.speed * maximum, maximum)
            self.angular = _limited(self.angular + meaning.turn * turn_maximum, turn_maximum)
        self._expires_at = now + KEY_HOLD_TIMEOUT_S if self.mode == "hold" else float("inf")

    def _change_speed(self, meaning: SpeedUpKey) -> None:
        maximum, turn_maximum = self.limits
        speed, turn_rate = self.speed, self.turn_rate
        if not speed or not turn_rate:
            return  # a pipeline without a robot has no speeds
        self.speed = min(max(speed * meaning.speed, SPEED_MIN_RATIO * maximum), maximum)
        self.turn_rate = min(
            max(turn_rate * meaning.turn, SPEED_MIN_RATIO * turn_maximum), turn_maximum
        )
        self.linear *= self.speed / speed
        self.angular *= self.turn_rate / turn_rate


def _limited(value: float, maximum: float) -> float:
    rounded = round(value, 9)  # so that ten steps up and ten down are zero again
    return min(max(rounded, -maximum), maximum)
