"""Odometry: the pose from wheel encoders and motor commands."""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, radians, sqrt

from diffbotctl.block import Block, In, Out, action
from diffbotctl.estimation.commanded_wheel import CommandedWheelOdometer
from diffbotctl.estimation.encoder_faults import EncoderFaults, PossibleFaults
from diffbotctl.estimation.explained_edges import is_linear
from diffbotctl.estimation.fine_wheel import (
    CountWheelOdometer,
    DirectedWheelOdometer,
    FineWheelOdometer,
)
from diffbotctl.estimation.geometry_deviation import (
    CalibratedValue,
    GeometryDeviation,
    geometry_deviations,
    may_have_wrong_slots,
)
from diffbotctl.estimation.gyro_heading import SCALE_SD, GyroHeading
from diffbotctl.estimation.gyro_pose_filter import GyroPoseFilter
from diffbotctl.estimation.pin_level import COUNTED_LEVELS, PulseWidth
from diffbotctl.estimation.pose_filter import PoseFilter
from diffbotctl.estimation.slot_errors import LEARNABLE_SLOTS_MAX
from diffbotctl.estimation.timestamp_filter import TimestampFilter
from diffbotctl.estimation.wheel_frame import Levels, wheel_frames
from diffbotctl.estimation.wheel_odometer import WheelOdometer
from diffbotctl.estimation.wheel_side import LinkTiming, SideConfig
from diffbotctl.messages import Encoders, Imu, Odometry
from diffbotctl.params import FromRobot, Param

RESIDUAL_JITTER_RATIO = 0.3  # jitter that TimestampFilter leaves, relative to its input
# ns; after a longer gap the commands in between are unknown: the host stops the robot after 0.25 s,
# the dead-man stop of the board after 0.1 to 0.5 s.
SILENCE_MAX = 400_000_000
# Standard deviation of the share of edges that both encoders miss, or count twice, where the frames
# have jitter and edges no times: then nothing shows it.
HIDDEN_SHARE = 0.02
SILENCE_TRAVEL_SD_PITCHES = 0.5  # pitches; position in the slot before and after the gap
# ns without an edge after which a wheel that rolls out has stopped: four lags of a usual motor.
# The model of a motor begins at rest: of one that rolls it would take the edges for faults.
ROLL_OUT_NS = 350_000_000
# Of the way that a wheel rolls while the board restarts: friction shortens it by up to a half, and
# the time of the restart within a frame is unknown.
RESTART_TRAVEL_SD = 0.4
# m and rad; on more of it the turns by wheels and gyro agree with working encoders only. One that
# counts half makes them differ by half of the way over the track, and both by half of the turn.
AGREED_PATH_MIN, AGREED_TURN_MIN = 0.3, radians(45.0)

EncoderWheel = WheelOdometer | FineWheelOdometer
Wheel = EncoderWheel | CommandedWheelOdometer


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
    command_delay: float = FromRobot("link.command_delay")
    command_jitter: float = FromRobot("link.command_jitter")
    stamp_jitter: float = FromRobot("link.stamp_jitter")
    telemetry: float = FromRobot("board.telemetry")
    edge_times: bool = FromRobot("board.edge_times")
    protocol: str = FromRobot("link.protocol")
    track: float = FromRobot("drive.track")
    slip: float = FromRobot("drive.slip")
    wheelbase: float | None = FromRobot("drive.wheelbase")
    left_side: SideConfig = FromRobot("drive.left")
    right_side: SideConfig = FromRobot("drive.right")
    calibration: Mapping[str, CalibratedValue] = FromRobot("calibration")
    imu: str | None = FromRobot("imu.type")
    imu_scale: float = FromRobot("imu.scale")
    encoders = In(Encoders)
    odometry = Out(Odometry)
    imu_state = Out(Imu, name="imu")

    def reset(self) -> None:
        self.last: Encoders | None = None
        diameters = self.left_side.wheel.diameter, self.right_side.wheel.diameter
        geometry = geometry_deviations(
            self.track, *diameters, self.calibration, self.wheelbase is not None
        )
        if self.stamp_jitter and not self.edge_times:
            geometry += (GeometryDeviation(left=HIDDEN_SHARE, right=HIDDEN_SHARE),)
        self.pose = PoseFilter(self.track, self.slip, geometry)
        self.gyro: GyroHeading | None = None
        if self.imu is not None:
            entry = self.calibration.get("imu.scale")
            scale_sd = SCALE_SD if entry is None or entry.sd is None else float(entry.sd)
            is_fine = self.left_side.encoder.counts > LEARNABLE_SLOTS_MAX
            pose = GyroPoseFilter(
                self.track, self.slip, geometry, scale_sd, is_calibrated=entry is not None
            )
            self.pose, self.gyro = pose, GyroHeading(pose, self.imu_scale, is_fine)
        self.roll_out_end = 0  # ns; 0 except after a restart of the board
        self.roll_out_edges = False  # whether there were any since then
        self.timestamps = TimestampFilter(self.stamp_jitter, self.telemetry)
        self.wheels: tuple[Wheel, Wheel] | None = None
        sides = self.left_side, self.right_side
        may_be_wrong = may_have_wrong_slots(self.calibration)
        linear = all(is_linear(side.motor) for side in sides)
        self.encoder_faults = EncoderFaults(may_be_wrong, linear)
        self.pulse_widths = PulseWidth(), PulseWidth()
        self.counted_levels = [
            COUNTED_LEVELS.get(side.encoder.edge) if side.encoder.channels == 1 else None
            for side in sides
        ]
        channels = {side.encoder.channels for side in sides}
        # Of two channels an encoder with every second pulse missing, or doubled, counts none or
        # both ways: only the robot file may be wrong.
        has_one = 1 in channels
        self.possible_faults = PossibleFaults(has_one, has_one or may_be_wrong)

    @action(x="m", y="m", heading="rad")
    def set_pose(self, now: int, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Set the pose: x and y in m, heading in rad; default: the origin."""
        self.pose.set_pose(x, y, heading)
        self.encoder_faults.pose_is_set()
        for wheel in self.wheels or ():
            wheel.pose_is_set()

    def react(
        self, now: int, encoders: Encoders | None
    ) -> tuple[Odometry | None, Imu | None] | None:
        if encoders is None:
            return None
        if self.stamp_jitter:
            sampled = self.timestamps.sampled(encoders.time, self.last.time if self.last else 0)
            encoders = encoders._replace(time=sampled)
        last, self.last = self.last, encoders
        time = encoders.time
        if last is None or self.wheels is None or encoders.boot != last.boot:
            if self.wheels is not None:
                self._bridge_restart(self.wheels)
            self.wheels = self._start(encoders)
            self.pose.start()
            self.roll_out_end = 0 if last is None else time + ROLL_OUT_NS
            self.roll_out_edges = False
            if self.gyro is not None:
                self.gyro.restart()
        else:
            self._advance(encoders, last, self.wheels)
        if self.gyro is None:
            return self._message(time, *self.wheels), None
        is_ready = self._with_gyro(self.gyro, encoders, self.wheels)
        imu = self.gyro.message(time, "imu.scale" in self.calibration)
        return (self._message(time, *self.wheels) if is_ready else None), imu

    def _advance(self, encoders: Encoders, last: Encoders, wheels: tuple[Wheel, Wheel]) -> None:
        if self.gyro is not None:
            self.gyro.take(encoders, wheels)
        if encoders.time - last.time > SILENCE_MAX:
            self._bridge_silence(encoders, wheels)
        elif self._rolls_out(encoders, last):
            self._bridge_silence(encoders, wheels, is_continued=self.roll_out_edges)
            self.roll_out_edges |= (encoders.left, encoders.right) != (last.left, last.right)
        else:
            self._update(encoders, last.time, *wheels)

    def _with_gyro(
        self, gyro: GyroHeading, encoders: Encoders, wheels: tuple[Wheel, Wheel]
    ) -> bool:
        """Log what the gyro shows; False while its bias is measured before the first motion."""
        gyro.moved(encoders, wheels)
        for text in gyro.news:
            self.log.warning(text) if gyro.fault else self.log.info(text)
        gyro.news.clear()
        return not gyro.awaits_rest

    def _message(self, time: int, left: Wheel, right: Wheel) -> Odometry:
        text = warning(left, right)
        if self.gyro is not None and self.gyro.warning:
            text = f"{self.gyro.warning}; {text}" if text else self.gyro.warning
        message = self.pose.message(time, left, right, text)
        probability = self.encoder_faults.probability
        pushed_sd = hypot(left.pushed_travel, right.pushed_travel) / self.track
        if pushed_sd:  # a gyro measures a push, but not one before its first rest
            pushed_sd = min(pushed_sd, sqrt(max(message.covariance[5], 0.0)))
        if not probability and not pushed_sd:
            return message
        return message._replace(lost_edges_probability=probability, pushed_heading_sd=pushed_sd)

    def _rolls_out(self, encoders: Encoders, last: Encoders) -> bool:
        """Whether a wheel may still roll since a restart of the board in motion."""
        if encoders.left_command or encoders.right_command:
            self.roll_out_end = 0
        elif (encoders.left, encoders.right) != (last.left, last.right) and self.roll_out_end:
            self.roll_out_end = encoders.time + ROLL_OUT_NS
        elif encoders.time >= self.roll_out_end:
            self.roll_out_end = 0
        return self.roll_out_end > 0

    def _update(self, encoders: Encoders, last_time: int, left: Wheel, right: Wheel) -> None:
        time, since = encoders.time, encoders.command_time
        if since is None:
            since = self._command_start(last_time, time)
        frames = wheel_frames(encoders, since, self._counted_levels(encoders))
        left.update(frames[0])
        right.update(frames[1])
        if isinstance(left, EncoderWheel) and isinstance(right, EncoderWheel):
            self.encoder_faults.possible = self._possible_faults()
            self.encoder_faults.update(left, right)
        left.report()
        right.report()
        self.pose.move(left, right)

    def _possible_faults(self) -> PossibleFaults:
        """Those of encoders that the gyro does not rule out."""
        of_one, of_both = self.possible_faults
        if self.gyro is None or not self.gyro.is_used:
            return self.possible_faults
        assert isinstance(self.pose, GyroPoseFilter)
        return PossibleFaults(
            of_one and self.pose.agreed_path < AGREED_PATH_MIN,
            of_both and self.pose.agreed_turn < AGREED_TURN_MIN,
        )

    def _counted_levels(self, encoders: Encoders) -> Levels:
        """Whether the pins have the level to which a counted edge leads. A frame carries the level
        of one pin at most."""
        if encoders.left_level is not None:
            counted = self.counted_levels[0]
            levels: Levels = (None if counted is None else encoders.left_level == counted, None)
        elif encoders.right_level is not None:
            counted = self.counted_levels[1]
            levels = (None, None if counted is None else encoders.right_level == counted)
        else:
            return None, None
        time, (first, second) = encoders.time, self.pulse_widths
        first.update(time, encoders.left, encoders.left_edge, levels[0])
        second.update(time, encoders.right, encoders.right_edge, levels[1])
        self.encoder_faults.pulse_log_ratios = first.lost_log_ratio, second.lost_log_ratio
        return levels

    def _bridge_silence(
        self, encoders: Encoders, wheels: tuple[Wheel, Wheel], is_continued: bool = False
    ) -> None:
        """After a gap in the telemetry: use the counts for the travel, and restart the filters.

        `is_continued`: the counts follow others, whose positions in the slot are uncertain already.
        """
        left = wheels[0].unobserved_travel(encoders.left)
        right = wheels[1].unobserved_travel(encoders.right)
        self.wheels = self._start(encoders)
        sd = 0.0 if is_continued else SILENCE_TRAVEL_SD_PITCHES * wheels[0].pitch
        self.pose.jump(left, right, sd)
        self.pose.start()

    def _bridge_restart(self, wheels: tuple[Wheel, Wheel]) -> None:
        """Add what the wheels have rolled, uncounted, since the last frame of the former board.

        They were driven until it restarted, which was up to a frame on the board and one on the
        line later, and then coasted.
        """
        left, right = (
            wheel.speed * (1.0 / self.telemetry + side.motor.lag)
            for wheel, side in zip(wheels, (self.left_side, self.right_side), strict=True)
        )
        self.pose.jump(left, right, RESTART_TRAVEL_SD * max(abs(left), abs(right)))

    def _start(self, encoders: Encoders) -> tuple[Wheel, Wheel]:
        time = encoders.time
        self.encoder_faults.restart()
        for width in self.pulse_widths:
            width.restart()
        timing = LinkTiming(
            RESIDUAL_JITTER_RATIO * self.stamp_jitter,
            self.command_jitter,
            self.edge_times,
            is_published_firmware=self.protocol == "rosserial",
        )
        return (
            self._wheel_kind(self.left_side)(self.left_side, time, encoders.left, timing),
            self._wheel_kind(self.right_side)(self.right_side, time, encoders.right, timing),
        )

    def _wheel_kind(self, side: SideConfig) -> type[Wheel]:
        if not side.encoder.channels:
            return CommandedWheelOdometer
        if side.encoder.channels == 2:
            return DirectedWheelOdometer
        if self.method == "count":
            return CountWheelOdometer
        return FineWheelOdometer if side.encoder.slots > LEARNABLE_SLOTS_MAX else WheelOdometer

    def _command_start(self, before: int, time: int) -> int:
        """Estimated time at which a command took effect: a fixed delay after a frame."""
        delay = int(self.command_delay * 1e9)
        period = time - before
        return time - (-delay % period if period > 0 else 0)


def warning(left: Wheel, right: Wheel) -> str:
    """Why the pose is less accurate than usual; empty when it is not."""
    left_fault, right_fault = left.fault, right.fault
    if not left_fault and not right_fault:
        return ""
    if left_fault == right_fault:
        return f"left and right wheel: {left_fault}"
    faults = (("left", left_fault), ("right", right_fault))
    return "; ".join(f"{side} wheel: {fault}" for side, fault in faults if fault)
