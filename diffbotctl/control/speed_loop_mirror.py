"""What a board's wheel-speed loop adds to its feed-forward, worked out again on the host.

The loop's specification stands in the firmware: the board drives with the feed-forward of its
target and what a PI controller gathers from its own edges, at 100 Hz. The host hears of every
target and of nearly every edge, or can tell from the counts about when it was; so it knows the duty
that the motor gets, though no frame carries it. Without that the filter takes the loop's work for
friction.
"""

from __future__ import annotations

from math import copysign, pi
from typing import Protocol

TICK = 10_000_000  # ns between two runs of the board's loop
TICK_SECONDS = 0.010
SILENCE = 300_000_000  # ns without an edge after which the board's speed counts as unknown
MOST = 0.25  # duty; the board gathers no more


class SpeedLoopState(Protocol):
    """The robot file's `loop` of a motor."""

    static: float
    speed: float | None
    proportional: float
    integral: float


class SpeedLoopMirror:
    """One wheel's loop. `duty` is what the motor gets."""

    __slots__ = (
        "before",
        "duty",
        "gathered",
        "last",
        "loop",
        "pitch",
        "slope",
        "target",
        "time",
    )

    def __init__(self, loop: SpeedLoopState, rated: float, slots: int, time: int) -> None:
        """`rated`: rad/s at full duty, for the slope that the file leaves out."""
        self.loop = loop
        self.slope = loop.speed if loop.speed is not None else (1.0 - loop.static) / rated
        self.pitch = 2 * pi / slots
        self.time = time
        self.target = self.gathered = self.duty = 0.0
        self.last: int | None = None  # times of the last two edges since the target's sign changed
        self.before: int | None = None

    def frame(self, time: int, steps: int, edge: int, target: float, since: int) -> float:
        """Take one frame and return the duty. `steps` counts since the last, the last one at
        `edge`; `target` (rad/s) in force `since`."""
        if target != self.target and since <= edge:
            self._run(since)
            self._command(target)
        if steps:
            if abs(steps) > 1 and self.last is not None:  # evenly, for want of better
                self.last = edge - (edge - self.last) // abs(steps)
            self._run(edge)
            self.before, self.last = self.last, edge
        if target != self.target:
            self._run(since)
            self._command(target)
        self._run(time)
        missing = 0.0
        if self.loop.proportional:
            seen = self._speed(time)
            missing = target - seen if seen is not None else 0.0
        self.duty = self._driven(missing)
        return self.duty

    def _driven(self, missing: float) -> float:
        target, loop = self.target, self.loop
        if target == 0.0:
            return 0.0
        ahead = copysign(loop.static, target) + self.slope * target
        wanted = min(max(ahead + loop.proportional * missing + self.gathered, -1.0), 1.0)
        return wanted if wanted * target > 0.0 else 0.0

    def _command(self, target: float) -> None:
        if target == 0.0 or target * self.target <= 0.0:
            self.gathered = 0.0
            self.last = self.before = None
        self.target = target

    def _run(self, until: int) -> None:
        """Run the board's loop at its ticks until then. Where its ticks lie does not matter much:
        what one of them gathers is far below what a motor shows."""
        if not self.target or self.before is None:
            self.time = max(until, self.time)
            return
        while self.time + TICK <= until:
            self.time += TICK
            speed = self._speed(self.time)
            if speed is not None:
                self._gather((self.target - speed) * TICK_SECONDS)

    def _gather(self, angle: float) -> None:
        self.gathered = min(max(self.gathered + self.loop.integral * angle, -MOST), MOST)

    def _speed(self, now: int) -> float | None:
        """The speed (rad/s) that the board sees in its last period and the age of its last edge."""
        if self.last is None or self.before is None or now - self.last > SILENCE:
            return None
        longest = max(now - self.last, self.last - self.before)
        return copysign(self.pitch / (longest * 1e-9), self.target)
