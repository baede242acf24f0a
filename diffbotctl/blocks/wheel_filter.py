"""How far a wheel has turned, finer than its encoder's slots.

Says which flank of which slot each edge was, going forward or backward, and hands that to the
filter on the motor's model. Going forward a rising edge comes at each whole z, going backward at
each whole z plus the open share of the pitch. Times are integer nanoseconds, lengths pitches.
"""

from __future__ import annotations

from math import floor

from diffbotctl.blocks.wheel_motion import CREEP, Spread, WheelMotion

OPEN = 0.5  # share of the pitch that lies open, the middle of all discs
DOUBT = 1.2  # pitches/s (12 mm/s); slower after a reversal, the sign of the speed is a guess
OUTSIDE = 0.08  # mass beyond a bound from which on it is believed; less says nothing new at rest
SURE = 0.001  # the same while moving, when each frame says something new


class WheelFilter:
    """One wheel. `travel` (pitches since the start), `speed` (pitches/s) and `variance`."""

    __slots__ = (
        "count", "drive", "heading", "motion", "passed", "slot", "time", "turned_back",
    )  # fmt: skip

    def __init__(self, spread: Spread, time: int, count: int, slots: int = 0) -> None:
        """`slots` of the disc, whose errors are learnt when the board tells edges' times; or 0."""
        self.motion = WheelMotion(spread, slots)
        self.time = time
        self.count = count
        self.drive = 0.0
        self.heading = 0  # direction of the last drive: 1, -1, or 0 before the first
        self.slot = 0  # the slot whose flank was passed last
        self.passed = 0  # direction in which it was passed
        self.turned_back = False  # driven the other way since then

    @property
    def travel(self) -> float:
        """Pitches turned since the start."""
        return self.motion.z - self.motion.phase

    @property
    def speed(self) -> float:
        """Pitches per second."""
        return self.motion.speed

    @property
    def place(self) -> float:
        """z of the flank passed last, as nominally cut."""
        return self.slot + (OPEN if self.passed < 0 else 0.0)

    def frame(
        self, time: int, count: int, edge: int | None, drive: float, since: int | None
    ) -> None:
        """Take one frame: `count` at `time`, the last edge's time if the board tells it, and the
        `drive` (pitches/s wanted) in force, `since` when if known."""
        steps = count - self.count
        self.count = count
        marked = edge is not None and steps != 0
        changes = drive != self.drive
        switch = self._clamp(since, time) if changes else time
        passed = self._clamp(edge, time) if marked else time
        if changes and switch <= passed:
            self._advance(switch)
            self._turn(drive)
        if marked:
            self._advance(passed)
            self._pass(steps)
            self.motion.see_edge(self.place, self.slot, self.passed > 0)
        if changes and switch > passed:
            self._advance(switch)
            self._turn(drive)
        self._advance(time)
        if steps and not marked:
            self._pass(steps)
        if self.passed:
            low, high = bounds(self.place, self.passed, self.turned_back)
            moving = not marked and (steps != 0 or abs(self.motion.speed) > CREEP)
            self.motion.see_bounds(low, high, SURE if moving else OUTSIDE)

    def likely_edge(self, time: int, steps: int) -> int:
        """When the last of `steps` edges came that a frame at `time` counts, as the motor's model
        has it (ns)."""
        span = (time - self.time) * 1e-9
        speed = self.motion.speed
        if abs(speed) < DOUBT:
            return time - int(0.5e9 * span)
        heading = -1 if speed < 0.0 else 1
        beyond = heading * (self.motion.z + speed * span - self.place) - abs(steps)
        ago = min(max(beyond / abs(speed), 0.0), span, 1.0 / abs(speed))
        return time - int(ago * 1e9)

    def _clamp(self, moment: int | None, time: int) -> int:
        return self.time if moment is None else min(max(moment, self.time), time)

    def _advance(self, time: int) -> None:
        """Let the motor run on to `time` under the drive in force."""
        span = time - self.time
        if span > 0:
            self.time = time
            self.motion.run(span * 1e-9, self.drive)

    def _turn(self, drive: float) -> None:
        """The command changes to `drive`."""
        self.drive = drive
        if drive == 0.0:
            return
        heading = 1 if drive > 0.0 else -1
        if self.heading == 0 and self.passed == 0:
            self.passed = heading
            if heading < 0:  # the phase is as unknown against the flanks that come going backward
                self.motion.shift(-OPEN)
                self.slot = 0
        self.heading = heading
        if heading != self.passed:
            self.turned_back = True

    def _pass(self, steps: int) -> None:
        """`steps` edges have been passed (the board's sign is not believed)."""
        speed, z = self.motion.speed, self.motion.z
        heading = self.heading or (1 if steps > 0 else -1)
        if abs(speed) > CREEP:
            heading = 1 if speed > 0.0 else -1
        if heading == self.passed and not self.turned_back:
            self.slot += heading * abs(steps)
        else:
            forward, backward = floor(z + 0.5), floor(z - OPEN + 0.5)
            if abs(speed) < DOUBT:  # it may still roll the old way: the nearer edge decides
                heading = 1 if abs(forward - z) <= abs(backward + OPEN - z) else -1
            self.slot = forward if heading > 0 else backward
        self.passed = heading
        self.turned_back = self.heading != heading


def bounds(place: float, passed: int, turned_back: bool) -> tuple[float, float]:
    """Where z can lie when the last edge stood at `place` and was `passed` forward (1) or backward.

    Turned back since, the next edge may come from either flank of the slot, so both count.
    """
    if passed > 0:
        return place - (1.0 - OPEN if turned_back else 0.0), place + 1.0
    return place - 1.0, place + (1.0 - OPEN if turned_back else 0.0)
