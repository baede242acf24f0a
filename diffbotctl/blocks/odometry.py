"""Where the robot is, from its wheel encoders and the commands that its motors follow."""

from __future__ import annotations

from math import copysign, cos, pi, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.blocks.wheel_filter import Spread, WheelFilter
from diffbotctl.messages import Encoders
from diffbotctl.messages import Odometry as Pose
from diffbotctl.params import FromRobot, Param


class Odometry(Block):
    """Integrate both wheels' travel into a pose, finer than the encoders' slots.

    Each wheel has a filter driven by the model of its motor; `method: count` is the naive way,
    which takes a count for a pitch.
    """

    method = Param(
        str,
        default="model",
        choices=("model", "count"),
        help="`model`: a filter a wheel, driven by the motor's model; `count`: counts alone.",
    )
    slip = Param(
        float, default=0.0005, unit="m", least=0.0,
        help="Slip of a wheel: sd after a metre of its travel.",
    )  # fmt: skip
    lag: float = FromRobot("drive.left.motor.lag")
    static_duty: float = FromRobot("drive.left.motor.loop.static")
    command_delay: float = FromRobot("link.command_delay")
    stamp_jitter: float = FromRobot("link.stamp_jitter")
    track: float = FromRobot("drive.track")
    left_diameter: float = FromRobot("drive.left.wheel.diameter")
    right_diameter: float = FromRobot("drive.right.wheel.diameter")
    slots: float = FromRobot("drive.left.encoder.slots")
    rated: float = FromRobot("drive.left.motor.rated")
    encoders = In(Encoders)
    odometry = Out(Pose)

    def reset(self) -> None:
        self.last: Encoders | None = None
        self.x = self.y = self.heading = 0.0
        self.left: WheelFilter | None = None
        self.right: WheelFilter | None = None
        self.gone_left = self.gone_right = 0.0
        self.spread = Spread(lag=self.lag, stamp=self.stamp_jitter)

    def react(self, now: int, encoders: Encoders | None) -> Pose | None:
        if encoders is None:
            return None
        last, self.last = self.last, encoders
        if last is None or encoders.boot != last.boot or self.left is None or self.right is None:
            self.left = WheelFilter(self.spread, encoders.time, encoders.left)
            self.right = WheelFilter(self.spread, encoders.time, encoders.right)
            self.gone_left = self.gone_right = 0.0
            self.first = (encoders.left, encoders.right)
            return self._pose(encoders.time, 0.0, 0.0)
        since = encoders.command_time
        to_pitches = 0.5 * self.slots / pi
        if encoders.command_kind == "duty":
            drives = [
                duty_speed(duty, self.static_duty, self.rated)
                for duty in (encoders.left_command, encoders.right_command)
            ]
        else:
            drives = [encoders.left_command, encoders.right_command]
        if since is None:
            since = self._took_hold(last.time, encoders.time)
        left, right = self.left, self.right
        left.frame(encoders.time, encoders.left, encoders.left_edge, drives[0] * to_pitches, since)
        right.frame(
            encoders.time, encoders.right, encoders.right_edge, drives[1] * to_pitches, since
        )
        gone_left, gone_right = left.travel, right.travel
        if self.method == "count":
            gone_left = float(encoders.left - self.first[0])
            gone_right = float(encoders.right - self.first[1])
        ahead_left, ahead_right = gone_left - self.gone_left, gone_right - self.gone_right
        self.gone_left, self.gone_right = gone_left, gone_right
        self._move(ahead_left * self._left_pitch(), ahead_right * self._right_pitch())
        return self._pose(
            encoders.time, left.speed * self._left_pitch(), right.speed * self._right_pitch()
        )

    def _left_pitch(self) -> float:
        return pi * self.left_diameter / self.slots

    def _right_pitch(self) -> float:
        return pi * self.right_diameter / self.slots

    def _took_hold(self, before: int, time: int) -> int:
        """Commands follow frames, so a change between two frames came a fixed time before one."""
        delay = int(self.command_delay * 1e9)
        period = time - before
        return time - (-delay % period if period > 0 else 0)

    def _move(self, left: float, right: float) -> None:
        self.x, self.y, self.heading = arc(self.x, self.y, self.heading, left, right, self.track)

    def _pose(self, time: int, left: float, right: float) -> Pose:
        return Pose(
            time, self.x, self.y, self.heading, 0.5 * (left + right), (right - left) / self.track,
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        )  # fmt: skip


def arc(
    x: float, y: float, heading: float, left: float, right: float, track: float
) -> tuple[float, float, float]:
    """The pose after the wheels rolled `left` and `right` (m) along one exact arc."""
    half = 0.5 * (right - left) / track
    chord = 0.5 * (left + right) * (sin(half) / half if half else 1.0)
    middle = heading + half
    return x + chord * cos(middle), y + chord * sin(middle), middle + half


def duty_speed(duty: float, static: float, rated: float) -> float:
    """Wheel speed (rad/s) at which a usual motor settles with `duty`: a dead band, then a line."""
    beyond = abs(duty) - static
    return copysign(beyond / (1.0 - static) * rated, duty) if beyond > 0.0 else 0.0
