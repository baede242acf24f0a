"""The hand on the keys: key presses and the time in, the velocity that is wanted out.

A terminal tells of presses and repeats, never of a release. So in the mode `hold` a press counts
for KEY_LASTS, until the next repeat; the first repeat comes later than that on many machines,
which is seen as a hiccup. In the mode `latched` it counts until another key; there only a terminal
that goes on answering keeps the robot moving.
"""

from __future__ import annotations

from diffbotctl.ui.teleop.key_layouts import HALT, SETS, KeySet, MoveKey, SpeedUpKey, StepKey

KEY_LASTS = 0.4  # s; repeats come every 30 to 50 ms, and 300 ms more may be lost in a network
FIRST_REPEAT = 0.7  # s from a press to its first repeat, at most, as keyboards are set up
MODES = ("hold", "latched")
SHARE = 0.5  # of the limits: the speeds that one begins with
NO_KEY = ("", float("-inf"))
LEAST = 0.05  # of the limits; slower, no wheel turns


class KeyboardVelocity:
    """`speed` (m/s) and `turn` (rad/s) are what a full press means; `limits` is their most.

    Times are seconds of any one clock.
    """

    def __init__(
        self, limits: tuple[float, float], keys: str = "twist", mode: str = "hold"
    ) -> None:
        self.limits = limits
        self.speed, self.turn = SHARE * limits[0], SHARE * limits[1]
        self.keys: KeySet = SETS[keys]
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
            self.stuttered = last == key and now - ended < FIRST_REPEAT - KEY_LASTS
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
        self.keys = SETS[keys] if keys else self.keys
        self.mode = mode or self.mode

    def _move(self, meaning: MoveKey | StepKey, now: float) -> None:
        most, most_turn = self.limits
        if isinstance(meaning, MoveKey):
            self.linear, self.angular = meaning.forward * self.speed, meaning.turn * self.turn
        else:
            self.linear = _within(self.linear + meaning.speed * most, most)
            self.angular = _within(self.angular + meaning.turn * most_turn, most_turn)
        self.until = now + KEY_LASTS if self.mode == "hold" else float("inf")

    def _faster(self, meaning: SpeedUpKey) -> None:
        most, most_turn = self.limits
        was, was_turn = self.speed, self.turn
        self.speed = min(max(was * meaning.speed, LEAST * most), most)
        self.turn = min(max(was_turn * meaning.turn, LEAST * most_turn), most_turn)
        self.linear *= self.speed / was
        self.angular *= self.turn / was_turn


def _within(value: float, most: float) -> float:
    rounded = round(value, 9)  # ten steps up and ten down are zero again
    return min(max(rounded, -most), most)
