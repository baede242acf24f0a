"""Odometry: the pose from wheel encoders and motor commands."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out, action
from diffbotctl.estimation.pose_filter import PoseFilter
from diffbotctl.estimation.timestamp_filter import TimestampFilter
from diffbotctl.estimation.wheel_odometer import (
    CountWheelOdometer,
    LinkTiming,
    SideConfig,
    WheelOdometer,
)
from diffbotctl.messages import Encoders, Odometry
from diffbotctl.params import FromRobot, Param

RESIDUAL_JITTER_RATIO = 0.3  # jitter that TimestampFilter leaves, relative to its input
# ns; after a longer gap the commands in between are unknown: the host stops the robot after 0.25 s,
# the dead-man stop of the board after 0.1 to 0.5 s.
SILENCE_MAX = 400_000_000
SILENCE_TRAVEL_SD_PITCHES = 0.5  # pitches; position in the slot before and after the gap
FRICTION_LOG_ODDS_MIN = 1.0  # natural log; above it the motors have dry friction


class OdometryBlock(Block):
    """Integrate the travel of both wheels into a pose, with sub-slot resolution.

    Each wheel has a filter with a model of its motor; with `method: count` the travel is the count
    times the pitch.
    """

    method = Param(
        str,
        default="model",
        choices=("model", "count"),
        help="`model`: one filter per wheel with its motor model; `count`: counts alone.",
    )
    slip = Param(
        float, default=0.0005, unit="m", minimum=0.0, help="Slip of a wheel: sd after one metre."
    )
    command_delay: float = FromRobot("link.command_delay")
    command_jitter: float = FromRobot("link.command_jitter")
    stamp_jitter: float = FromRobot("link.stamp_jitter")
    telemetry: float = FromRobot("board.telemetry")
    edge_times: bool = FromRobot("board.edge_times")
    track: float = FromRobot("drive.track")
    left_side: SideConfig = FromRobot("drive.left")
    right_side: SideConfig = FromRobot("drive.right")
    encoders = In(Encoders)
    odometry = Out(Odometry)

    def reset(self) -> None:
        self.last: Encoders | None = None
        self.pose = PoseFilter(self.track, self.slip)
        self.timestamps = TimestampFilter(self.stamp_jitter, self.telemetry)
        self.wheels: tuple[WheelOdometer, WheelOdometer] | None = None

    @action(x="m", y="m", heading="rad")
    def set_pose(self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Set the pose: x and y in m, heading in rad; default: the origin."""
        self.pose.set_pose(x, y, heading)

    def react(self, now: int, encoders: Encoders | None) -> Odometry | None:
        if encoders is None:
            return None
        if self.stamp_jitter:
            sampled = self.timestamps.sampled(encoders.time, self.last.time if self.last else 0)
            encoders = encoders._replace(time=sampled)
        last, self.last = self.last, encoders
        time = encoders.time
        if last is None or self.wheels is None or encoders.boot != last.boot:
            self.wheels = self._start(encoders)
            self.pose.start()
        elif time - last.time > SILENCE_MAX:
            self._bridge_silence(encoders, self.wheels)
        else:
            self._update(encoders, last.time, *self.wheels)
        return self.pose.message(time, *self.wheels)

    def _update(
        self, encoders: Encoders, last_time: int, left: WheelOdometer, right: WheelOdometer
    ) -> None:
        time, since = encoders.time, encoders.command_time
        if since is None:
            since = self._command_start(last_time, time)
        is_duty = encoders.command_kind == "duty"
        left.update(time, encoders.left, encoders.left_edge, encoders.left_command, is_duty, since)
        right.update(
            time, encoders.right, encoders.right_edge, encoders.right_command, is_duty, since
        )
        if len(left.filter.hypotheses) > 1 or len(right.filter.hypotheses) > 1:
            # Both motors are of the same type, so they coast alike.
            log_odds = left.filter.friction_log_odds() + right.filter.friction_log_odds()
            left.filter.select_friction(log_odds > FRICTION_LOG_ODDS_MIN)
            right.filter.select_friction(log_odds > FRICTION_LOG_ODDS_MIN)
        left.report()
        right.report()
        self.pose.move(left, right)

    def _bridge_silence(
        self, encoders: Encoders, wheels: tuple[WheelOdometer, WheelOdometer]
    ) -> None:
        """After a gap in the telemetry: use the counts for the travel, and restart the filters."""
        left = wheels[0].unobserved_travel(encoders.left)
        right = wheels[1].unobserved_travel(encoders.right)
        self.wheels = self._start(encoders)
        self.pose.jump(left, right, SILENCE_TRAVEL_SD_PITCHES * wheels[0].pitch)
        self.pose.start()

    def _start(self, encoders: Encoders) -> tuple[WheelOdometer, WheelOdometer]:
        kind = WheelOdometer if self.method == "model" else CountWheelOdometer
        time = encoders.time
        timing = LinkTiming(
            RESIDUAL_JITTER_RATIO * self.stamp_jitter, self.command_jitter, self.edge_times
        )
        return (
            kind(self.left_side, time, encoders.left, timing),
            kind(self.right_side, time, encoders.right, timing),
        )

    def _command_start(self, before: int, time: int) -> int:
        """Estimated time at which a command took effect: a fixed delay after a frame."""
        delay = int(self.command_delay * 1e9)
        period = time - before
        return time - (-delay % period if period > 0 else 0)
