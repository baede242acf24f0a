"""Heading hold: a robot commanded to drive straight keeps its heading by odometry."""

from __future__ import annotations

from math import copysign, degrees, pi

from diffbotctl.block import Block, In, Out
from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.messages import Odometry, Stop, Twist
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import SECOND

GAIN_TIME_PRODUCT = 0.45  # of the proportional gain and the time until the motors have followed
INTEGRAL_RATIO = 0.15  # of the square of the proportional gain; above 0.25 the heading overshoots
# A motor that is slower than stated, as many are at a small duty, makes the heading swing about its
# reference. A swing that is not clearly smaller than the one before, on the other side, shows it:
# then the gain is reduced for the rest of the run.
SWING_MIN = 1.0 * pi / 180  # rad; smaller ones are the resolution of the encoders
SWING_RATIO, SWING_GAIN, SWING_SHARE_MIN = 0.7, 0.6, 0.15
STEP_MAX_S = 0.2  # between two twists; longer is a pause
STANDING_SPEED_MAX = 0.004  # m/s of the faster wheel


class HeadingHold(Block):
    """While a twist has no angular velocity, add one that holds the heading.

    Motors are never equal, so a robot whose wheels get the same command drives an arc. The
    reference is the heading at the start of the motion, or that at which a turn comes to its end.
    It is dropped at standstill, when the twist turns the robot, at a stop, when odometry warns (a
    faulty encoder), and beyond `error_max`. Connect it before the speed limiter, so that limits and
    obstacle stops apply to its output.

    blocks:
      straight: {block: heading_hold, in: {twist: mux.twist, odometry: odometry.odometry}}
    """

    correction = Param(
        float,
        default=0.2,
        unit="1",
        above=0.0,
        maximum=0.2,
        help="Largest change of the speed of a wheel, as a share of the speed of the robot.",
    )
    error_max = Param(
        float,
        default=15 * pi / 180,
        unit="rad",
        above=0.0,
        maximum=45 * pi / 180,
        help="Heading error at which it gives up: then something else turns the robot.",
    )
    track: float = FromRobot("drive.track")
    lag: float = FromRobot("drive.left.motor.lag")
    command_delay: float = FromRobot("link.command_delay")

    twist = In(Twist, help="The requested velocity.")
    odometry = In(Odometry, trigger=False, fresh_for=0.3, help="The heading to hold.")
    stop = In(Stop, trigger=False, optional=True, help="Stops of the blocks behind it.")
    held = Out(Twist, name="twist", help="The velocity that holds the heading.")

    def reset(self) -> None:
        self.reference: float | None = None  # rad
        self.integral = 0.0  # rad/s
        self.direction = 0.0  # sign of the speed for which the reference holds
        self.has_failed = False  # beyond `error_max`, until the next standstill or turn
        self.time = 0  # ns, of the last twist
        self.gain_share = 1.0  # of the gain that the stated lag allows
        self.swing = self.last_swing = 0.0  # rad with sign: largest errors on each side in turn

    def react(
        self, now: int, twist: Twist | None, odometry: Odometry | None, stop: Stop | None
    ) -> Twist | None:
        if twist is None:
            return None
        seconds, self.time = min((now - self.time) / SECOND, STEP_MAX_S), now
        is_stopped = stop is not None and stop.code != ""
        direction = copysign(1.0, twist.linear) if twist.linear else 0.0
        if twist.angular or direction != self.direction or is_stopped or odometry is None:
            self._drop()
            self.direction = direction
        if twist.angular or not direction or is_stopped or odometry is None:
            return twist
        angular = self._correction(odometry, abs(twist.linear), seconds)
        return twist if angular == 0.0 else twist._replace(angular=angular)

    def _drop(self) -> None:
        self.reference, self.integral, self.has_failed = None, 0.0, False
        self.swing = self.last_swing = 0.0

    def _correction(self, odometry: Odometry, speed: float, seconds: float) -> float:
        """Angular velocity (rad/s) that holds the heading at `speed` (m/s)."""
        half_track = 0.5 * self.track
        rim_speed = abs(odometry.angular) * half_track
        if abs(odometry.linear) + rim_speed < STANDING_SPEED_MAX:
            self._drop()
        if self.has_failed or odometry.warning:
            return 0.0
        if self.reference is None:  # after a turn the robot rotates until the motors have stopped
            self.reference = odometry.heading + odometry.angular * (self.lag + self.command_delay)
        error = shortest_turn(self.reference - odometry.heading)
        if abs(error) > self.error_max:
            self.has_failed = True
            self.log.warning(
                f"the robot is {degrees(abs(error)):.0f} deg off its heading, which is no longer "
                "held: is one wheel weak, blocked or slipping?"
            )
            return 0.0
        self._watch_swings(error)
        gain = self.gain_share * GAIN_TIME_PRODUCT / (self.lag + self.command_delay)
        limit = self.correction * speed / half_track
        integral = self.integral + INTEGRAL_RATIO * gain * gain * error * seconds
        self.integral = min(max(integral, -limit), limit)
        return min(max(gain * error + self.integral, -limit), limit)

    def _watch_swings(self, error: float) -> None:
        """Reduce the gain when the heading swings about its reference; `error` in rad."""
        if error * self.swing >= 0.0:
            self.swing = max(self.swing, error, key=abs)
            return
        size, last = abs(self.swing), abs(self.last_swing)
        if size > SWING_MIN and last > SWING_MIN and size > SWING_RATIO * last:
            self.gain_share = max(SWING_GAIN * self.gain_share, SWING_SHARE_MIN)
        self.last_swing, self.swing = self.swing, error
