"""Where the robot is, from its wheel encoders and the commands that its motors follow."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out, action
from diffbotctl.estimation.pose_filter import PoseFilter
from diffbotctl.estimation.timestamp_filter import TimestampFilter
from diffbotctl.estimation.wheel_odometer import CountWheelOdometer, SideConfig, WheelOdometer
from diffbotctl.messages import Encoders
from diffbotctl.messages import Odometry as Pose
from diffbotctl.params import FromRobot, Param

RESIDUAL_JITTER_RATIO = 0.3  # of the scatter of frames' times, once they are followed
# Without news for so long (ns) nobody knows what drove the motors: the host has stopped after a
# quarter of a second, and the board's dead-man has after 0.1 to 0.5 s of its own.
BLIND = 400_000_000
BLIND_PITCHES = 0.5  # sd of a wheel's way meanwhile: where in a slot it began, and ended
DOUBT = 1.0  # natural logarithm; dry friction is believed when it tells the rolling out better


class OdometryBlock(Block):
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
        float,
        default=0.0005,
        unit="m",
        minimum=0.0,
        help="Slip of a wheel: sd after a metre of its travel.",
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
    odometry = Out(Pose)

    def reset(self) -> None:
        self.last: Encoders | None = None
        self.pose = PoseFilter(self.track, self.slip)
        self.times = TimestampFilter(self.stamp_jitter, self.telemetry)
        self.wheels: tuple[WheelOdometer, WheelOdometer] | None = None

    @action
    def set_pose(self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Say where the robot is: x and y in m, heading in rad; the origin when left out."""
        self.pose.place(x, y, heading)

    def react(self, now: int, encoders: Encoders | None) -> Pose | None:
        if encoders is None:
            return None
        if self.stamp_jitter:
            sampled = self.times.sampled(encoders.time, self.last.time if self.last else 0)
            encoders = encoders._replace(time=sampled)
        last, self.last = self.last, encoders
        if last is None or self.wheels is None or encoders.boot != last.boot:
            self.wheels = self._start(encoders)
            self.pose.start()
            return self.pose.message(encoders.time, *self.wheels)
        if encoders.time - last.time > BLIND:
            return self._count_on(encoders, self.wheels)
        left, right = self.wheels
        since = encoders.command_time
        if since is None:
            since = self._took_hold(last.time, encoders.time)
        duty = encoders.command_kind == "duty"
        time = encoders.time
        left.frame(time, encoders.left, encoders.left_edge, encoders.left_command, duty, since)
        right.frame(time, encoders.right, encoders.right_edge, encoders.right_command, duty, since)
        self._agree(left, right)
        self.pose.move(left, right)
        return self.pose.message(time, left, right)

    def _agree(self, left: WheelOdometer, right: WheelOdometer) -> None:
        """Both motors are of one kind: they roll out alike."""
        if len(left.filter.tracks) > 1 or len(right.filter.tracks) > 1:
            dry = left.filter.leaning() + right.filter.leaning() > DOUBT
            left.filter.prefer(dry)
            right.filter.prefer(dry)
        left.tell()
        right.tell()

    def _count_on(self, encoders: Encoders, wheels: tuple[WheelOdometer, WheelOdometer]) -> Pose:
        """After a silence: the counts tell the way, and nothing more is known of the wheels."""
        left, right = wheels[0].counted(encoders.left), wheels[1].counted(encoders.right)
        self.wheels = self._start(encoders)
        self.pose.jump(left, right, BLIND_PITCHES * wheels[0].pitch)
        self.pose.start()
        return self.pose.message(encoders.time, *self.wheels)

    def _start(self, encoders: Encoders) -> tuple[WheelOdometer, WheelOdometer]:
        kind = WheelOdometer if self.method == "model" else CountWheelOdometer
        time = encoders.time
        link = (RESIDUAL_JITTER_RATIO * self.stamp_jitter, self.command_jitter, self.edge_times)
        return (
            kind(self.left_side, time, encoders.left, *link),
            kind(self.right_side, time, encoders.right, *link),
        )

    def _took_hold(self, before: int, time: int) -> int:
        """Commands follow frames, so a change between two frames came a fixed time before one."""
        delay = int(self.command_delay * 1e9)
        period = time - before
        return time - (-delay % period if period > 0 else 0)
