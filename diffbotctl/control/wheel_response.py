"""What a wheel makes of its commands, learned while driving.

A motor at its limit does not follow a higher command: a weak motor, a low battery, or one that sags
under the load of the other motor. The robot keeps its curvature if the wheel that follows is slowed
down to the one that does not. Speeds of the wheels over the floor, in m/s.
"""

from __future__ import annotations

from math import copysign
from typing import Literal

RATIO_MIN, RATIO_MAX = 0.3, 1.0  # limits of the ratio
RATIO_FREE = 0.85  # the speed loop compensates a motor with a larger ratio
AVERAGING_TIME = 0.3  # s, of the ratio
STEADY_RATIO = 0.9  # of the command; below it the expected speed still rises
SHORT_RATIO = 0.75  # of the command; above it a loop compensates the motor soon
WEAK_AFTER = 0.7  # s for which a wheel is slower than commanded, before it counts as weak
# s; a wheel that stands although it is driven is faulty, in addition to the time in which it shows.
IDLE_AFTER = 1.5
IDLE_COMMAND_MIN = 0.01  # m/s; at lower commands a wheel may stand
IDLE_PITCHES = 2.2  # of travel without an edge: until then a wheel may turn
# s without a count, longer than the board waits, and m and pitches that a wheel should have
# travelled in several drives: friction may have held it in each of some short ones.
UNCOUNTED_AFTER, IDLE_TRAVEL_MIN, IDLE_TRAVEL_PITCHES = 1.5, 0.1, 8.0
# s, pitches and m of a wheel that has counted since it was driven last: a start may be late, but a
# motion does not end by itself.
BLOCKED_AFTER, BLOCKED_PITCHES, BLOCKED_TRAVEL_MIN = 0.35, 8.0, 0.06
MOVING_SPEED_MIN = 0.004  # m/s; a slower wheel may stand
# s without a frame of the board. What a command did in a longer gap is unknown: the board stops its
# motors when its host is silent, so a gap is no time in which a wheel was driven and did not turn.
GAP_MAX = 0.25
# Of its commanded travel during a goal. A wheel that is below it, while the other one is not,
# explains why the goal was not reached.
LAGGING_RATIO = 0.6
LAGGING_PITCHES = 10.0  # of commanded travel, before the ratio is significant
# Counts that took back the last ones, before they are reported: a wheel may tremble on an edge.
TAKEN_BACK_MIN = 3
NO_CHANNEL = "channel B of its encoder gives no edges, check its wire"


Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")


class WheelResponse:
    """Ratio of the speed of one wheel to its commands, and the time for which it has not turned."""

    __slots__ = (
        "command",
        "commanded_travel",
        "count_sign",
        "counted_travel",
        "expected",
        "has_counted",
        "idle_for",
        "is_raised",
        "ratio",
        "short_for",
        "speed",
        "taken_back",
        "uncounted_for",
        "uncounted_travel",
    )

    def __init__(self) -> None:
        self.ratio = 1.0
        self.command = 0.0
        self.expected = 0.0
        """speed of a wheel that follows its commands with the lag"""
        self.speed = 0.0
        """measured, positive in the direction of the command"""
        self.idle_for = 0.0
        """s for which it was driven since it turned last"""
        self.uncounted_for = self.uncounted_travel = 0.0
        """s for which it was driven, and m that it should have travelled, since its last count"""
        self.has_counted = False
        """since it was driven in the present direction"""
        self.count_sign = 0.0
        """of its last counts with the present command; 0: none"""
        self.taken_back = 0
        """how often in turn its counts have taken back the last ones"""
        self.is_raised = False
        """whether the host still raises the duty of a wheel that stands"""
        self.short_for = 0.0
        """s for which it has reached less than SHORT_RATIO of its command"""
        self.commanded_travel = self.counted_travel = 0.0
        """m, without sign, since the goal was accepted"""

    def begin(self) -> None:
        """Begin another goal: for how long it has stood, and what it has travelled, counts anew."""
        self.idle_for = self.uncounted_for = self.uncounted_travel = 0.0
        self.commanded_travel = self.counted_travel = 0.0

    def update(
        self,
        command: float,
        speed: float,
        lag: float,
        seconds: float,
        counted: float | None = None,
        is_limited: bool = True,
    ) -> None:
        """Apply the `speed` measured `seconds` after the last with `command` in force since then.

        `lag` of the motors in s; `counted`: travel (m) of the counts in that time with its sign,
        None if unknown.
        A wheel that turns against its command, also only by odometry, still turns.
        Counts that only take back the last ones do not: with channel B dead, an encoder of two
        channels counts up and down in turn.
        `is_limited`: the motor may be at its limit; below it, a loop that sets the duty still
        raises it.
        """
        if command * self.command <= 0.0:
            self.count_sign = 0.0
        is_unknown, counted = counted is None, self._advance(counted or 0.0)
        if is_unknown or counted > 0.0:
            self.uncounted_for = self.uncounted_travel = 0.0
        seconds = min(seconds, GAP_MAX)
        self.commanded_travel += abs(command) * seconds
        self.counted_travel += counted
        if command * self.command <= 0.0:
            self.expected = self.short_for = 0.0
            self.has_counted = False
        self.command = command
        self.is_raised = not is_limited
        if not command:
            return
        self.has_counted |= counted > 0.0
        level = abs(command)
        self.speed = speed = speed if command > 0.0 else -speed
        self.expected += (level - self.expected) * seconds / (seconds + lag)
        self.uncounted_for += seconds
        self.uncounted_travel += self.expected * seconds
        has_turned = counted > 0.0 or abs(speed) >= MOVING_SPEED_MIN
        if has_turned:
            self.idle_for = 0.0
        elif level >= IDLE_COMMAND_MIN:
            self.idle_for += seconds
        if speed < MOVING_SPEED_MIN:
            return
        if self.expected >= STEADY_RATIO * level:
            is_short = is_limited and speed < SHORT_RATIO * level
            self.short_for = self.short_for + seconds if is_short else 0.0
            ratio = min(max(speed / self.expected, RATIO_MIN), RATIO_MAX) if is_limited else 1.0
            self.ratio += (ratio - self.ratio) * seconds / (seconds + AVERAGING_TIME)

    def _advance(self, counted: float) -> float:
        """Travel (m, without sign) by which the counts advance."""
        if not counted:
            return 0.0
        sign, before = copysign(1.0, counted), self.count_sign
        self.count_sign = sign
        if sign * before < 0.0:
            self.taken_back += 1
            return 0.0
        self.taken_back = 0
        return abs(counted)

    def command_for(self, speed: float) -> float:
        """The command with which the wheel turns at `speed`."""
        return speed if self.ratio >= RATIO_FREE else speed * RATIO_FREE / self.ratio


class DriveResponse:
    """What both wheels make of their commands."""

    __slots__ = ("has_counted", "left", "pitch", "right", "track", "weak")

    def __init__(self, track: float, pitch: float) -> None:
        """`track` and travel of a wheel from one encoder slot to the next, in m."""
        self.track, self.pitch = track, pitch
        self.left, self.right = WheelResponse(), WheelResponse()
        self.has_counted = False
        """one of the encoders, since the last update"""
        self.weak: dict[Side, str] = {}
        """what `newly_weak` has reported of each wheel"""

    def begin(self) -> None:
        """Forget what was reported to the operator, and for how long a wheel has stood."""
        self.weak = {}
        self.left.begin()
        self.right.begin()

    @property
    def idle_for(self) -> float:
        """s for which a driven wheel has not turned."""
        return max(self.left.idle_for, self.right.idle_for)

    def compensated(self, linear: float, angular: float, speed: float) -> tuple[float, float]:
        """The velocity to command, so that wheels of unequal motors keep the curvature.

        A motor at its limit slows down the other one. No wheel is commanded more than `speed`
        (m/s), or than the velocity asks of either.
        """
        aside = 0.5 * self.track * angular
        left, right = linear - aside, linear + aside
        top = max(speed, abs(left), abs(right))
        left, right = self.left.command_for(left), self.right.command_for(right)
        over = max(abs(left), abs(right)) / top
        if over > 1.0:
            left, right = left / over, right / over
        return 0.5 * (left + right), (right - left) / self.track

    def newly_weak(self, speed: float) -> list[str]:
        """What the wheels reach that are found not to follow commands above `speed` (m/s)."""
        if self.left.short_for <= WEAK_AFTER and self.right.short_for <= WEAK_AFTER:
            return []
        found: dict[Side, str] = {
            side: self._weakness(side)
            for side in SIDES
            if side not in self.weak
            and self._wheel(side).short_for > WEAK_AFTER
            and abs(self._wheel(side).command) > speed
        }
        self.weak |= found
        return list(found.values())

    def weaknesses(self) -> list[str]:
        return list(self.weak.values()) or self._lagging()

    def _lagging(self) -> list[str]:
        """The wheel that has made much less of its commanded travel than the other one."""
        wheels = [self.left, self.right]
        if min(wheel.commanded_travel for wheel in wheels) < LAGGING_PITCHES * self.pitch:
            return []
        ratios = [wheel.counted_travel / wheel.commanded_travel for wheel in wheels]
        least = min(ratios)
        if least > LAGGING_RATIO or max(ratios) <= LAGGING_RATIO:
            return []
        side = SIDES[ratios.index(least)]
        return [
            f"the {side} wheel has made {least:.0%} of its commanded travel: it rubs, its motor is "
            "weak, or its encoder misses edges"
        ]

    def _weakness(self, side: Side) -> str:
        """What the wheel reaches of its present command."""
        wheel = self._wheel(side)
        return (
            f"the {side} wheel reaches {speed_text(wheel.speed)} of "
            f"{speed_text(abs(wheel.command))}: its motor or the battery is too weak for "
            "limits.speed"
        )

    def fault(self, creep: float, stuck_after: float, lag: float) -> str:
        """Which wheel does not turn although it is driven; empty if none.

        `creep`: command (m/s) below which friction may hold a wheel; `stuck_after`: time (s) after
        which a wheel that has not started is faulty; `lag` of the motors in s.
        """
        for side in SIDES:
            wheel = self._wheel(side)
            other = self.right if side == "left" else self.left
            if wheel.idle_for and wheel.idle_for > self._idle_max(
                wheel, other, creep, stuck_after, lag
            ):
                return (
                    f"the {side} wheel has not turned for {wheel.idle_for:.1f} s, commanded "
                    f"{speed_text(abs(wheel.command))}: blocked, or its motor or encoder is faulty"
                )
            if self._gives_no_counts(wheel, other, stuck_after):
                travel = f"{wheel.uncounted_travel:.2f} m of its commands"
                if wheel.taken_back >= TAKEN_BACK_MIN:
                    return f"the {side} wheel counts up and down in turn for {travel}: {NO_CHANNEL}"
                return (
                    f"the {side} wheel has given no count for {travel}: blocked, or its motor or "
                    "encoder is faulty"
                )
        return ""

    def _gives_no_counts(
        self, wheel: WheelResponse, other: WheelResponse, stuck_after: float
    ) -> bool:
        """Whether a wheel was driven again and again, and has not turned in any of the times.

        Only its counts show that: between two of them odometry takes it for turning.
        """
        is_alone = other.uncounted_for < wheel.uncounted_for
        if (
            is_alone
            and not wheel.is_raised  # friction holds a slow wheel until its duty has risen
            and wheel.has_counted
            and wheel.uncounted_for > BLOCKED_AFTER
            and wheel.uncounted_travel > max(BLOCKED_TRAVEL_MIN, BLOCKED_PITCHES * self.pitch)
        ):
            return True
        longest = UNCOUNTED_AFTER if is_alone and not wheel.is_raised else stuck_after
        travel = max(IDLE_TRAVEL_MIN, IDLE_TRAVEL_PITCHES * self.pitch)
        return wheel.uncounted_for > longest and wheel.uncounted_travel > travel

    def _idle_max(
        self,
        wheel: WheelResponse,
        other: WheelResponse,
        creep: float,
        stuck_after: float,
        lag: float,
    ) -> float:
        """Time (s) after which a driven wheel that does not turn is faulty.

        One that stands while the other one turns is known sooner. With few slots it takes some
        pitches until the speed is known.
        """
        command = abs(wheel.command)
        if command < creep or other.speed <= MOVING_SPEED_MIN:
            return stuck_after
        known = self._known_after(wheel, creep, lag)
        return min(IDLE_AFTER + known, max(stuck_after, known))

    def _known_after(self, wheel: WheelResponse, creep: float, lag: float) -> float:
        """Time (s) after which the encoder of a wheel at its command has shown its speed."""
        return IDLE_PITCHES * self.pitch / max(abs(wheel.command), creep) + lag

    def _wheel(self, side: Side) -> WheelResponse:
        return self.left if side == "left" else self.right


def speed_text(speed: float) -> str:
    """A speed in m/s, or in mm/s if it is slow."""
    return f"{speed:.2f} m/s" if abs(speed) >= 0.095 else f"{speed * 1000:.0f} mm/s"
