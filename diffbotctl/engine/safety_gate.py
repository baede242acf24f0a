"""The safety gate: the last check of each command before it is sent. It stops; it never clamps.

A command passes if it is finite, if it and the telemetry are fresh, if both wheels are within their
rated speed and the robot within its limits of speed and turn rate, if no wheel turns clearly faster
than commanded or against its command, and if no stop is active. Acceleration is not checked: a
stop is never ramped.
"""

from __future__ import annotations

from math import isfinite

from diffbotctl.block import Block, In, Out
from diffbotctl.config.robot import SideSection
from diffbotctl.engine.direction_cause import direction_cause
from diffbotctl.engine.overspeed import OverspeedDetector
from diffbotctl.engine.wheel_direction import WheelDirections
from diffbotctl.messages import Encoders, Link, Resume, Stop, Wheels
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import SECOND

# Of the newest telemetry, by the board's clock. Radios hold frames back for 0.2 s now and then; a
# line that is slower than the frames on it delays each of them more than the last.
TELEMETRY_AGE_MAX = SECOND // 2
ROUNDING_TOLERANCE = 1e-6  # relative; for rounding between m/s and rad/s


class Gate(Block):
    """Pass wheel commands, or stop the robot with a cause. Built into every robot pipeline."""

    telemetry_timeout = Param(
        float,
        default=0.25,
        unit="s",
        minimum=0.1,
        maximum=0.5,
        help="Time without telemetry after which the robot is stopped.",
    )
    command_timeout = Param(
        float,
        default=0.3,
        unit="s",
        minimum=0.1,
        maximum=0.5,
        help="Time without a command, during a motion, after which the robot is stopped.",
    )
    left_side: SideSection = FromRobot("drive.left")
    right_side: SideSection = FromRobot("drive.right")
    track: float = FromRobot("drive.track")
    speed: float = FromRobot("limits.speed")
    turn_rate: float = FromRobot("limits.turn_rate")
    command_delay: float = FromRobot("link.command_delay")
    command_jitter: float = FromRobot("link.command_jitter")
    telemetry: float = FromRobot("board.telemetry")
    protocol: str = FromRobot("link.protocol")

    command = In(Wheels, fresh_for="command_timeout", help="The command of the pipeline.")
    encoders = In(Encoders, fresh_for="telemetry_timeout", help="Telemetry of the board.")
    link = In(Link, optional=True, help="State of the link.")
    board = In(Stop, optional=True, help="A stop by the board: button, wheel fault.")
    operator = In(
        Stop, optional=True, help="A stop by the operator, or because the operator was lost."
    )
    waiting = In(
        Stop, optional=True, help="A stop until every source on which the motion depends has begun."
    )
    resume = In(Resume, optional=True, help="Permission to move after a latched stop.")
    wheels = Out(Wheels, help="The command that is sent.")
    stop = Out(Stop, help="The active stop; its code is empty when there is none.")

    def reset(self) -> None:
        self.active_stop: Stop | None = None
        self.telemetry_time = 0  # ns, arrival of the last telemetry; 0 before the first
        self.boot: int | None = None
        self.sent_motion = False
        self.last_messages: dict[str, object] = {}
        delay = self.command_delay + 3 * self.command_jitter + 1 / self.telemetry
        host_loop = self.protocol == "rosserial"
        self.wheels_watched = {
            name: OverspeedDetector(
                side.motor, side.encoder.counts, side.motor.lag, delay, host_loop
            )
            for name, side in (("left", self.left_side), ("right", self.right_side))
        }
        self.directions = WheelDirections(self.left_side, self.right_side, self.track)
        self.pushed: set[str] = set()  # wheels that turn by hand

    def react(
        self,
        now: int,
        command: Wheels | None,
        encoders: Encoders | None,
        link: Link | None,
        board: Stop | None,
        operator: Stop | None,
        waiting: Stop | None,
        resume: Resume | None,
    ) -> tuple[Wheels | None, Stop | None]:
        before = self.active_stop
        if resume is not None and self.is_new("resume", resume):
            self.end_stop(encoders)
        fresh = self.is_new("encoders", encoders)
        fault = self.find_fault(now, command, encoders, fresh, link, board, operator)
        if fault is None and waiting is not None and waiting.code:
            fault = waiting
        self.update_stop(fault)
        outgoing = self.outgoing_command(now, command)
        if self.active_stop is before:
            self.note_command(now, outgoing)
            return outgoing, None
        changed = self.active_stop or Stop(now, "", "", False)
        if outgoing is None and self.active_stop is not None:
            outgoing = Wheels(now, 0.0, 0.0)
        self.note_command(now, outgoing)
        return outgoing, changed

    def end_stop(self, encoders: Encoders | None) -> None:
        """End the active stop, unless the board sends no telemetry."""
        if encoders is not None:
            self.active_stop = None
            self.directions.restart()
        elif self.active_stop is not None:
            self.log.warning(
                "`resume` ends no stop now: no telemetry comes from the board; call it again when "
                "the link is up"
            )

    def note_command(self, now: int, outgoing: Wheels | None) -> None:
        """Pass what is sent to the detectors of wheels that turn too fast."""
        if outgoing is not None:
            watched, (left, right) = self.wheels_watched, (outgoing.left, outgoing.right)
            is_ahead = left * right > 0.0
            watched["left"].command(now, left, right if is_ahead else 0.0)
            watched["right"].command(now, right, left if is_ahead else 0.0)

    def update_stop(self, fault: Stop | None) -> None:
        """Set or clear the active stop; only `resume` clears a latched one."""
        if self.active_stop is not None and self.active_stop.latched:
            return
        if fault is None or self.active_stop is None or fault.code != self.active_stop.code:
            self.active_stop = fault

    def outgoing_command(self, now: int, command: Wheels | None) -> Wheels | None:
        """The command to send in this instant: the new one, zero in its place, or none."""
        if not self.is_new("command", command) or command is None:
            return None
        if self.active_stop is not None or not self.telemetry_time:
            self.sent_motion = False
            return Wheels(now, 0.0, 0.0)
        self.sent_motion = command.left != 0 or command.right != 0
        return command

    def find_fault(
        self,
        now: int,
        command: Wheels | None,
        encoders: Encoders | None,
        fresh: bool,
        link: Link | None,
        board: Stop | None,
        operator: Stop | None,
    ) -> Stop | None:
        """The reason why motion is not allowed now, the most severe first; None if it is."""
        if board is not None and self.is_new("board", board) and board.code:
            return board
        if operator is not None and self.is_new("operator", operator) and operator.code:
            return operator
        if link is not None and self.is_new("link", link) and link.state == "lost":
            return Stop(now, "link_lost", f"the link to the board is gone: {link.cause}", True)
        if encoders is not None and fresh:
            fault = (
                self.check_telemetry(now, encoders)
                or self.check_directions(now, encoders)
                or self.check_wheels(now, encoders)
            )
            if fault is not None:
                return fault
        if encoders is None and self.telemetry_time:
            return self.telemetry_stop(now)
        if encoders is not None and now - encoders.time > TELEMETRY_AGE_MAX:
            age = f"{(now - encoders.time) / SECOND:.1f} s"
            cause = f"the telemetry of the board arrives {age} late: the link is too slow for it"
            return Stop(now, "telemetry_stale", cause, False)
        if command is None and self.sent_motion:
            cause = "a block stopped sending commands while the robot was moving"
            return Stop(now, "command_stale", cause, True)
        return None if command is None else self.check_limits(now, command)

    def check_telemetry(self, now: int, encoders: Encoders) -> Stop | None:
        """The stop for a board that has restarted or was silent for 1 s, or None."""
        silent, self.telemetry_time = now - self.telemetry_time if self.telemetry_time else 0, now
        boot, self.boot = self.boot, encoders.boot
        if boot is not None and boot != encoders.boot:
            return Stop(now, "board_restart", "the board restarted while in use", True)
        if silent >= SECOND:
            cause = f"the board was silent for {silent / SECOND:.1f} s and is back"
            return Stop(now, "reconnect", cause, True)
        return None

    def check_directions(self, now: int, encoders: Encoders) -> Stop | None:
        """The stop for wheels that do not turn as they are driven, or None."""
        fault = self.directions.update(encoders)
        if fault is None:
            return None
        return Stop(
            now, "wheel_direction", direction_cause(fault, self.left_side, self.right_side), True
        )

    def check_wheels(self, now: int, encoders: Encoders) -> Stop | None:
        """The stop for a wheel that turns faster than commanded; a pushed one is only reported."""
        fault = None
        for side, count in (("left", encoders.left), ("right", encoders.right)):
            detector = self.wheels_watched[side]
            excess = detector.counts(encoders.time, count, encoders.boot)
            self.report_push(side, detector.is_pushed)
            if excess is not None:
                cause = (
                    f"the {side} wheel turns at {excess.speed:.1f} rad/s; its commands, now "
                    f"{detector.target:.1f} rad/s, explain at most {excess.limit:.1f} rad/s"
                )
                fault = fault or Stop(now, "wheel_runaway", cause, True)
        return fault

    def report_push(self, side: str, is_pushed: bool) -> None:
        """Log once that a wheel turns without a command after it stood."""
        if not is_pushed:
            self.pushed.discard(side)
        elif side not in self.pushed:
            self.pushed.add(side)
            self.log.warning(
                f"the {side} wheel turns although it was at rest and nothing is commanded: "
                "the robot is pushed or rolls, or its encoder counts noise"
            )

    def telemetry_stop(self, now: int) -> Stop:
        limit = f"{self.telemetry_timeout * 1000:.0f} ms"
        return Stop(now, "telemetry_stale", f"no telemetry from the board for {limit}", False)

    def check_limits(self, now: int, command: Wheels) -> Stop | None:
        """The stop for a command beyond the limits of the robot file, or None."""
        (left, right), (left_side, right_side) = command[1:], (self.left_side, self.right_side)
        left_rated, right_rated = left_side.motor.rated, right_side.motor.rated
        if not (isfinite(left) and isfinite(right)):
            return self.limit_stop(now, f"a wheel command is not a number ({left}, {right})")
        tolerance = 1 + ROUNDING_TOLERANCE
        if abs(left) > left_rated * tolerance:
            return self.limit_stop(now, _above_rated("left", left, left_rated))
        if abs(right) > right_rated * tolerance:
            return self.limit_stop(now, _above_rated("right", right, right_rated))
        left_rim_speed = left * left_side.wheel.diameter / 2
        right_rim_speed = right * right_side.wheel.diameter / 2
        linear = (left_rim_speed + right_rim_speed) / 2
        angular = (right_rim_speed - left_rim_speed) / self.track
        if abs(linear) > self.speed * tolerance:
            return self.limit_stop(
                now, f"{abs(linear):.3f} m/s is above the robot's limit of {self.speed:.3f} m/s"
            )
        if abs(angular) > self.turn_rate * tolerance:
            return self.limit_stop(
                now,
                f"{abs(angular):.2f} rad/s is above the robot's turn limit of "
                f"{self.turn_rate:.2f} rad/s",
            )
        return None

    def limit_stop(self, now: int, why: str) -> Stop:
        return Stop(now, "gate_limit", why, True)

    def is_new(self, port: str, message: object) -> bool:
        """True once for each message that arrives on `port`."""
        if message is None or self.last_messages.get(port) is message:
            return False
        self.last_messages[port] = message
        return True


def _above_rated(side: str, speed: float, rated: float) -> str:
    """Why a wheel may not turn at `speed` (rad/s)."""
    why = f"{abs(speed):.2f} rad/s for the {side} wheel is above its motor's rated"
    return f"{why} {rated:.2f} rad/s"
