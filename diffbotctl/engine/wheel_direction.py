"""Finds a wheel that turns or counts against its drive, and exchanged wheels.

The counts of two-channel encoders are compared with the command in force on the board. A wheel that
begins to turn against its command has a motor or an encoder with the wrong direction. The counts of
exchanged motors or encoders follow the command of the other wheel, which a turn shows. Where there
is a gyro, the turn that it measured decides whether the wheels really turned as they counted: then
the motors are wrong, otherwise the encoders. One channel counts in the direction of the command;
there a gyro shows one reversed motor in a straight motion.

Wires stay as they are, so a wheel that has turned with its command is not judged again: it may
be pushed back, or roll back on a slope. What inertia explains after a change of the command is left
out of the comparison. Speeds are rad/s of a wheel, angles rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import copysign, exp, pi

from diffbotctl.config.robot import SideSection
from diffbotctl.control.motor_curve import settled_speed
from diffbotctl.messages import Encoders

GAP_MAX_S = 0.3  # between two frames; what happened in a longer one is unknown
SPEED_WINDOW_S = 0.1  # over which the speed of a wheel is measured
LAG_MAX_S, COASTING_RATIO = 0.4, 1.5  # as in `overspeed`: the slowest motor, turned by its gear
# The sums forget what is older than this, or than these counts at the commanded speed. Loops of
# exchanged wheels run away within the second time.
MEMORY_S, EXCESS_MEMORY_S, MEMORY_COUNTS = 0.5, 0.25, 8.0
# That show a direction: more than the play of a gear, and than an edge that chatters.
ANGLE_MIN, COUNTS_MIN = 0.2, 3.0
OPPOSED_SHARE = 0.4  # of the commanded angle; a wheel that is held or pushed back turns less
# Of the faster command. The loops of exchanged wheels act on each other, so that one wheel runs
# ever faster than its command while the other one stands; unequal motors differ by less.
CROSSED_SHARE = 0.5
# A turn in which both wheels keep so close to their commands shows that they are not exchanged.
TURN_SHARE_MIN, OWN_SHARE = 0.7, 0.4
GYRO_TURN_MIN = 0.17  # rad between both explanations
GYRO_SHARE_MAX = 0.35  # of that by which the gyro may miss the explanation that is right
# With one channel: a motion is straight up to this share; the turn (rad) of a reversed wheel in it.
# Counts have the wrong sign while a wheel coasts with more than a share of its command.
STRAIGHT_SHARE, STRAIGHT_TURN_MIN, COASTING_SHARE = 0.3, 0.5, 0.3
WAIT_S = 0.4  # for the other wheel, and for the gyro


class Subject(StrEnum):
    """What is wrong: which wheels."""

    LEFT_WHEEL = "left"
    RIGHT_WHEEL = "right"
    BOTH_WHEELS = "both"
    EXCHANGED = "exchanged"
    BOTH_OR_EXCHANGED = "both or exchanged"


class Part(StrEnum):
    """What is wrong with them."""

    MOTOR = "motor"
    ENCODER = "encoder"
    UNKNOWN = "motor or encoder"


@dataclass(frozen=True, slots=True)
class DirectionFault:
    """Wheels that do not turn as they are driven."""

    subject: Subject
    part: Part


class WheelDirection:
    """Compares the counts of one wheel with its command."""

    def __init__(self, side: SideSection) -> None:
        self._motor = side.motor
        self.pitch = 2.0 * pi / side.encoder.counts
        self.radius = 0.5 * side.wheel.diameter
        self.angle_min = max(ANGLE_MIN, COUNTS_MIN * self.pitch)
        self._coasting_lag = COASTING_RATIO * max(LAG_MAX_S, 2.0 * side.motor.lag)
        self._speed = 0.0  # measured
        self._inertia = 0.0  # angle that inertia explains and that was not turned yet
        self.driven = self.expected = 0.0  # angle of a frame: without inertia, and as commanded
        self.judge_again()

    def judge_again(self) -> None:
        """Forget what it has shown; its motion goes on."""
        self.target = 0.0
        self._expected_speed = self._speed  # of a motor with the stated lag
        self._rolling = self._speed  # that inertia explains since the last change of direction
        self._with_command = self._commanded = 0.0  # sums
        self.is_right = False
        """whether it has turned with its command"""

    def measure(self, span: float, counts: int) -> float:
        """Update the speed with `counts` in the last `span` (s); the angle turned."""
        turned = counts * self.pitch
        self._speed += (turned / span - self._speed) * (1.0 - exp(-span / SPEED_WINDOW_S))
        return turned

    def update(self, span: float, counts: int, command: float, is_duty: bool) -> None:
        """Apply one frame: `counts` in the last `span` (s), and the command in force."""
        motor = self._motor
        target = settled_speed(command, motor.loop.static, motor.rated) if is_duty else command
        if _sign(target) != _sign(self.target):
            # The measured speed lags behind that of a motor which accelerates towards its target.
            self._rolling, self._inertia = self._speed, 0.0
            if self.target and self.target * self._speed <= self.target * self.target:
                self._rolling = self.target
        self.target = target
        turned = self.measure(span, counts)
        self._inertia += abs(self._rolling) * span
        self._rolling *= exp(-span / self._coasting_lag)
        coasted = min(abs(turned), self._inertia) if turned * self._rolling > 0.0 else 0.0
        self._inertia -= coasted
        self.driven = turned - copysign(coasted, turned)
        self._expected_speed += (target - self._expected_speed) * (1.0 - exp(-span / motor.lag))
        self.expected = self._expected_speed * span
        if target:
            kept = forgetting(target, self.pitch, span)
            sign = _sign(target)
            self._with_command = self._with_command * kept + sign * self.driven
            self._commanded = self._commanded * kept + max(sign * self.expected, 0.0)
            self.is_right = self.is_right or self._with_command >= self.angle_min

    @property
    def may_coast(self) -> bool:
        """Whether inertia may explain much of its motion."""
        return abs(self._rolling) > COASTING_SHARE * abs(self.target)

    @property
    def is_opposed(self) -> bool:
        """Whether it clearly turns against its command."""
        against = -self._with_command
        return against >= self.angle_min and against >= OPPOSED_SHARE * self._commanded

    @property
    def is_reversed(self) -> bool:
        """Whether it has turned against its command only."""
        return self.is_opposed and not self.is_right

    @property
    def is_still(self) -> bool:
        """Whether it hardly turns although it is driven."""
        return bool(self.target) and abs(self._with_command) < OPPOSED_SHARE * self._commanded


@dataclass(slots=True)
class _Excess:
    """Sums of the faster command, of the difference between both, and of what each wheel turns
    beyond its own command."""

    fastest: float = 0.0
    difference: float = 0.0
    left: float = 0.0
    right: float = 0.0

    def add(self, kept: float, left: WheelDirection, right: WheelDirection) -> None:
        """Add a frame; a wheel that is not driven turns in the direction of the other one."""
        self.fastest = self.fastest * kept + max(abs(left.expected), abs(right.expected))
        self.difference = self.difference * kept + abs(right.expected - left.expected)
        ahead = _sign(left.target or right.target), _sign(right.target or left.target)
        self.left = self.left * kept + ahead[0] * (left.driven - left.expected)
        self.right = self.right * kept + ahead[1] * (right.driven - right.expected)


@dataclass(slots=True)
class _Yaw:
    """Sums of the turned angles of both wheels and of the gyro's turn."""

    left: float = 0.0
    right: float = 0.0
    gyro: float = 0.0

    def add(self, kept: float, left: float, right: float, gyro: float) -> None:
        self.left = self.left * kept + left
        self.right = self.right * kept + right
        self.gyro = self.gyro * kept + gyro


@dataclass(slots=True)
class _Last:
    """The last frame: time (ns), counts, boot, and the sum of the gyro."""

    time: int
    counts: tuple[int, int]
    boot: int
    turn: float | None = field(default=None)


class WheelDirections:
    """Watches both wheels; call `update` with each frame."""

    def __init__(self, left: SideSection, right: SideSection, track: float) -> None:
        """`track` in m."""
        self._left, self._right = WheelDirection(left), WheelDirection(right)
        self._track = track
        self._has_directions = can_show_direction((left, right))
        self._last: _Last | None = None
        self.restart()

    def restart(self) -> None:
        """The wires may have been changed: judge both wheels anew."""
        self._left.judge_again()
        self._right.judge_again()
        self._excess, self._yaw = _Excess(), _Yaw()
        self._keeps_sides = False  # whether the wheels are not exchanged
        self._waited = 0.0  # s, since a wheel was found opposed

    def update(self, encoders: Encoders) -> DirectionFault | None:
        """Apply one frame; the fault once it is clear."""
        last = self._last
        counts = encoders.left, encoders.right
        turn = None if encoders.turn_fault else encoders.turn
        self._last = _Last(encoders.time, counts, encoders.boot, turn)
        if last is None:
            return None
        if encoders.boot != last.boot:
            self.restart()
            return None
        span = (encoders.time - last.time) * 1e-9
        if not 0.0 < span <= GAP_MAX_S:
            return None
        left, right = self._left, self._right
        steps = counts[0] - last.counts[0], counts[1] - last.counts[1]
        if self._keeps_sides and (not self._has_directions or (left.is_right and right.is_right)):
            left.measure(span, steps[0])
            right.measure(span, steps[1])
            return None
        is_duty = encoders.command_kind == "duty"
        left.update(span, steps[0], encoders.left_command, is_duty)
        right.update(span, steps[1], encoders.right_command, is_duty)
        fastest = max(abs(left.target), abs(right.target))
        if not fastest:
            return None
        pitch = max(left.pitch, right.pitch)
        kept = forgetting(fastest, pitch, span)
        self._excess.add(forgetting(fastest, pitch, span, EXCESS_MEMORY_S), left, right)
        has_gyro = turn is not None and last.turn is not None
        turned = turn - last.turn if turn is not None and last.turn is not None else 0.0
        self._yaw.add(
            kept,
            steps[0] * left.pitch * left.radius,
            steps[1] * right.pitch * right.radius,
            turned * self._track,
        )
        if self._has_directions:
            return self._judge(span, has_gyro)
        if left.may_coast or right.may_coast:
            self._yaw = _Yaw()
        return self._judge_by_gyro() if has_gyro else None

    def _judge_by_gyro(self) -> DirectionFault | None:
        """A reversed motor, which turns a straight motion into a turn.

        A wheel that slips or stands turns the robot half as far.
        """
        yaw = self._yaw
        path = abs(yaw.left + yaw.right)
        is_straight = abs(yaw.right - yaw.left) <= STRAIGHT_SHARE * path
        if self._keeps_sides or not is_straight or path < STRAIGHT_TURN_MIN * self._track:
            return None
        for subject in (Subject.LEFT_WHEEL, Subject.RIGHT_WHEEL):
            if self._part(subject) is Part.ENCODER:
                return DirectionFault(subject, Part.MOTOR)
        self._keeps_sides = self._part(Subject.LEFT_WHEEL) is Part.MOTOR
        return None

    def _judge(self, span: float, has_gyro: bool) -> DirectionFault | None:
        subject = self._subject()
        if subject is None:
            self._waited = 0.0
            return None
        self._waited += span
        part = self._part(subject) if has_gyro else Part.UNKNOWN
        if self._waited < WAIT_S:
            if subject in (Subject.LEFT_WHEEL, Subject.RIGHT_WHEEL) and self._other_is_open(
                subject
            ):
                return None
            if has_gyro and part is Part.UNKNOWN and subject is not Subject.BOTH_WHEELS:
                return None
        return DirectionFault(subject, part)

    def _subject(self) -> Subject | None:
        """The wheels that do not turn as they are driven."""
        left, right = self._left, self._right
        if self._is_crossed():
            return Subject.EXCHANGED
        is_one_reversed = left.is_reversed or right.is_reversed
        is_spin = left.target * right.target < 0.0
        if is_spin and not self._keeps_sides and (left.is_opposed or right.is_opposed):
            # The loop of one of two exchanged wheels may have stopped the other one.
            is_one_still = left.is_still or right.is_still
            may_start = is_one_reversed and self._waited < 0.5 * WAIT_S
            if (left.is_opposed and right.is_opposed) or (is_one_still and not may_start):
                has_right = left.is_right or right.is_right
                return Subject.EXCHANGED if has_right else Subject.BOTH_OR_EXCHANGED
        if left.is_reversed and right.is_reversed:
            return Subject.BOTH_WHEELS
        if is_one_reversed:
            return Subject.LEFT_WHEEL if left.is_reversed else Subject.RIGHT_WHEEL
        return None

    def _is_crossed(self) -> bool:
        """Whether one wheel runs away while the other one stands; keeps whether a turn has shown
        that each wheel follows its own command."""
        excess, left, right = self._excess, self._left, self._right
        resolution = max(left.angle_min, right.angle_min)
        if self._keeps_sides or excess.fastest < ANGLE_MIN + resolution:
            return False
        least, most = sorted((excess.left, excess.right))
        is_turn = excess.difference >= TURN_SHARE_MIN * excess.fastest
        deviation = max(abs(least), abs(most))
        self._keeps_sides = is_turn and deviation <= OWN_SHARE * excess.difference
        limit = CROSSED_SHARE * excess.fastest
        return least <= -limit and most >= limit + resolution

    def _other_is_open(self, subject: Subject) -> bool:
        """Whether the other wheel is driven, and has not shown its direction."""
        other = self._right if subject is Subject.LEFT_WHEEL else self._left
        return bool(other.target) and not other.is_right

    def _part(self, subject: Subject) -> Part:
        """What the gyro shows: motors if the wheels really turned as they counted."""
        yaw = self._yaw
        as_counted = yaw.right - yaw.left
        left, right = yaw.left, yaw.right
        if subject is Subject.LEFT_WHEEL:
            otherwise = right + left
        elif subject is Subject.RIGHT_WHEEL:
            otherwise = -right - left
        else:
            otherwise = -as_counted
        difference = abs(as_counted - otherwise)
        if difference < GYRO_TURN_MIN * self._track:
            return Part.UNKNOWN
        if abs(yaw.gyro - as_counted) <= GYRO_SHARE_MAX * difference:
            return Part.MOTOR
        if abs(yaw.gyro - otherwise) <= GYRO_SHARE_MAX * difference:
            return Part.ENCODER
        return Part.UNKNOWN


def forgetting(speed: float, pitch: float, span: float, memory: float = MEMORY_S) -> float:
    """Factor of a sum after `span` (s) at the commanded `speed`."""
    angle = abs(speed) * span
    return exp(-angle / max(memory * abs(speed), MEMORY_COUNTS * pitch))


def _sign(value: float) -> int:
    return (value > 0.0) - (value < 0.0)


def can_show_direction(sides: Sequence[SideSection]) -> bool:
    """Whether the encoders of these sides measure the direction."""
    return all(side.encoder.channels == 2 for side in sides)
