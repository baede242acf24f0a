"""`diffbotctl drive` and `goto`: drive by hand for a time, a distance or an angle; or to a pose."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator
from math import degrees, hypot, inf, sqrt
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import NEGATIVE_NUMBERS, NumbersCommand, argument, command, option
from diffbotctl.cli.contradictions import is_typed, refuse_pair
from diffbotctl.cli.engine_client import attached, held_by
from diffbotctl.cli.options import ENGINE, FOR, Quantity, quantity_option
from diffbotctl.errors import Problem, RunError
from diffbotctl.printable import write_raw

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

COMMAND_PERIOD_S = 0.05  # the engine takes 0.3 s of silence for a lost operator
BRAKING = 0.15  # m/s2, gentle for any robot, so that it stops near the mark
TURN_BRAKING = 1.0  # rad/s2
DEFAULT_DURATION_S = 1.0  # a drive always has an end: the person may be gone
STOP = "operator.stop"  # the stop in force
SEPARATORS = re.compile(r"[,;\s]+")  # of X, Y and HEADING
DECIMAL_COMMA = re.compile(r"(?<![\d.])\d+,\d+(?![\d.])")  # `0,5` may be one number or two
ENGINE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
NO_NUMBERS = ("nan", "inf", "infinity")  # refused as a position
LATE_BEFORE_START_MAX = 20  # commands through a slow link, before the first one is taken
PATIENCE_S = 4.5  # without progress, as long as `goal_follower` waits at an obstacle
PROGRESS_RATIO_MIN = 0.1  # of the motion commanded in that time; less is no progress
PROGRESS_MIN, TURN_PROGRESS_MIN = 0.02, 0.035  # m, rad; enough, however fast the command is
AT_REST_S = 1.0  # without progress: longer than motors need to start
DISPLAY_PERIOD_S, LINE_PERIOD_S = 0.2, 5.0  # of the progress on a terminal, and in a pipe
REST_S = 0.3  # without motion before the result is printed: longer than between two slots
REST_TIMEOUT_S = 3.0  # that is waited for the rest, such as on a slope
REST_SPEED, REST_TURN_RATE = 0.005, 0.02  # m/s, rad/s; slower is at rest
SPEED_RATIO_MIN = 0.25  # kept up to the mark: at a lower speed friction may hold a wheel before it


class DriveProgress:
    """Progress towards the end of a drive, and the ratio of the speed still to be commanded.

    `seconds`, `metres`, `radians`: where the drive ends; one of them is given. `linear` and
    `angular` (m/s, rad/s): what is commanded. `coast_time` (s): by how much of its present speed
    the robot goes on after the last command.
    """

    coast_time = COMMAND_PERIOD_S  # an odometry message may be as old

    def __init__(
        self,
        seconds: float | None,
        metres: float | None,
        radians: float | None,
        linear: float,
        angular: float,
    ) -> None:
        self.seconds, self.metres, self.radians = seconds, metres, radians
        self.last: dict[str, Any] | None = None
        self.driven = self.turned = 0.0
        self.speed = self.turn_rate = 0.0  # by the newest odometry
        # Least motion that counts as progress; none where it does not bring the end nearer.
        way = min(PROGRESS_MIN, PROGRESS_RATIO_MIN * PATIENCE_S * abs(linear))
        turn = min(TURN_PROGRESS_MIN, PROGRESS_RATIO_MIN * PATIENCE_S * abs(angular))
        self.least_way = 0.0 if radians is not None else way
        self.least_turn = 0.0 if metres is not None else turn
        self._stop, self._stop_end = "", -inf  # the last one, as `code: cause`, and when it ended
        self.begin()

    def begin(self) -> None:
        self.start_time = self.motion_time = time.monotonic()
        self._note_progress()

    def _note_progress(self) -> None:
        self.progress_time = time.monotonic()
        self.progress_at = self.driven, self.turned

    def update_stop(self, stop: dict[str, Any]) -> None:
        """Take the stop in force; one without a code means that there is none."""
        if stop["code"]:
            self._stop, self._stop_end = f"{stop['code']}: {stop['cause']}", inf
        else:
            self._stop_end = min(self._stop_end, time.monotonic())

    @property
    def stop(self) -> str:
        """The stop in force, or the last one since there was progress; empty without one."""
        return self._stop if self._stop_end >= self.progress_time else ""

    @property
    def waiting(self) -> float:
        """Seconds without progress."""
        driven, turned = self.progress_at
        has_driven = 0.0 < self.least_way <= abs(self.driven - driven)
        if has_driven or 0.0 < self.least_turn <= abs(self.turned - turned):
            self._note_progress()
        return time.monotonic() - self.progress_time

    @property
    def is_blocked(self) -> bool:
        """Whether it has waited for long enough, or a drive for a time ends at rest by a stop."""
        has_ended = self.seconds is not None and self.speed_ratio(1.0, 0.0) == 0.0
        if not has_ended or not self.stop:
            return self.waiting > PATIENCE_S
        return self.waiting > min(AT_REST_S, 0.9 * (time.monotonic() - self.start_time))

    def text(self) -> str:
        """How far it is, such as `driven 0.53 of 3.00 m`."""
        if self.metres is not None:
            return f"driven {self.driven:.2f} of {self.metres:.2f} m"
        if self.radians is not None:
            return f"turned {degrees(abs(self.turned)):.0f} of {degrees(self.radians):.0f} deg"
        seconds = time.monotonic() - self.start_time
        return f"{seconds:.1f} of {self.seconds:.1f} s, driven {self.driven:.2f} m"

    def update(self, odometry: dict[str, Any]) -> None:
        if self.last is not None:
            step = odometry["x"] - self.last["x"], odometry["y"] - self.last["y"]
            self.driven += hypot(*step)
            self.turned += odometry["heading"] - self.last["heading"]
        self.last = odometry
        self.speed, self.turn_rate = abs(odometry["linear"]), abs(odometry["angular"])
        if self.speed > REST_SPEED or self.turn_rate > REST_TURN_RATE:
            self.motion_time = time.monotonic()

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing has moved for REST_S; also where no odometry shows it."""
        return self.last is None or time.monotonic() - self.motion_time > REST_S

    def speed_ratio(self, linear: float, angular: float) -> float:
        """The ratio of the speeds (m/s, rad/s) to command now, 1 to 0; 0 ends the drive."""
        if self.seconds is not None:
            return 1.0 if time.monotonic() - self.start_time < self.seconds else 0.0
        if self.metres is not None:
            remaining = self.metres - self.driven - self.speed * self.coast_time
            return braking_ratio(remaining, abs(linear), BRAKING)
        if self.radians is not None:
            remaining = self.radians - abs(self.turned) - self.turn_rate * self.coast_time
            return braking_ratio(remaining, abs(angular), TURN_BRAKING)
        return 1.0


def braking_ratio(remaining: float, speed: float, braking: float) -> float:
    """The ratio of `speed` that allows braking within `remaining`; 0 at the end."""
    if remaining <= 0.0:
        return 0.0
    return min(1.0, max(SPEED_RATIO_MIN, sqrt(2.0 * braking * remaining) / speed))


@command(
    "Drive",
    4,
    "; drive for a time, distance or angle",
    cls=NumbersCommand,
    context_settings=NEGATIVE_NUMBERS,
)
def drive(
    linear: float = quantity_option(
        "m/s", "--speed", "--v", "Forward speed, such as 0.2 or 20cm/s.", default="0"
    ),
    angular: float = quantity_option(
        "rad/s",
        "--turn",
        "--w",
        "Turning speed, positive to the left, such as 45deg/s.",
        default="0",
    ),
    duration: float | None = FOR,
    distance: float | None = quantity_option("m", "Stop after this distance."),
    angle: float | None = quantity_option("rad", "Stop after this turn."),
    take_over: bool = option("Drive even if another client is driving."),
    engine: str | None = ENGINE,
) -> None:
    """Drive by hand, for 1 s unless --for, --distance or --angle is given.

    Ctrl-C stops the robot, and so does the end of this process. A goal that was under way waits for
    `diffbotctl resume`.
    """
    context = click.get_current_context()
    progress = _drive_progress(context, linear, angular, duration, distance, angle)
    display = ProgressDisplay()
    with attached(engine, "drive") as client:
        _subscribe(client, needs_odometry=progress.seconds is None)
        progress.coast_time += client.request("scene").get("coast_time", 0.0)
        progress.begin()  # ssh may have taken a second to connect
        late_allowed = LATE_BEFORE_START_MAX
        try:
            while (ratio := progress.speed_ratio(linear, angular)) > 0.0:
                if progress.is_blocked:
                    break
                display.show(progress)
                fields = {"linear": linear * ratio, "angular": angular * ratio}
                if _drive_once(client, late_allowed, {**fields, "take_over": take_over}):
                    late_allowed = 0
                    take_over = False  # once: a client that takes over from this one keeps control
                else:
                    late_allowed -= 1
                    progress.begin()
                _follow(client, progress)
            is_blocked = progress.is_blocked
        finally:
            display.end()
            client.send("release")
        deadline = time.monotonic() + REST_TIMEOUT_S
        _follow(client, progress)
        while not progress.is_at_rest and time.monotonic() < deadline:
            _follow(client, progress)
    click.echo(f"driven {progress.driven:.3f} m, turned {degrees(progress.turned):.1f} deg")
    if is_blocked:
        raise _blocked(progress)


class ProgressDisplay:
    """Shows how far a drive is: a line that changes on a terminal, else one every 5 s."""

    def __init__(self) -> None:
        self.is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self.shown, self.due = "", time.monotonic() + LINE_PERIOD_S * (not self.is_terminal)
        self.stop = ""

    def show(self, progress: DriveProgress) -> None:
        """Show it, when it is due, and a stop as soon as the robot stands."""
        waiting = progress.waiting
        if progress.stop not in ("", self.stop) and waiting > AT_REST_S:
            from diffbotctl.ui.text import fold_text

            self.end()
            click.echo(fold_text(f"stopped by {progress.stop}", hang=2), err=True)
            self.stop = progress.stop
        if time.monotonic() < self.due:
            return
        text = progress.text()
        if waiting > AT_REST_S:
            text += f"; no progress for {waiting:.0f} of {PATIENCE_S:g} s"
        if self.is_terminal:
            self.due = time.monotonic() + DISPLAY_PERIOD_S
            write_raw(sys.stderr, f"\r{text:<{len(self.shown)}}")
            self.shown = text
        else:
            self.due = time.monotonic() + LINE_PERIOD_S
            click.echo(text, err=True)

    def end(self) -> None:
        if self.shown:
            write_raw(sys.stderr, f"\r{'':<{len(self.shown)}}\r")
            self.shown = ""


def _blocked(progress: DriveProgress) -> Exception:
    """The error for a drive that ended before its mark."""
    cause = f"{progress.text()}; stopped by {progress.stop}, for {progress.waiting:.1f} s"
    fix = "remove the obstacle, or drive another way; `diffbotctl why` explains more"
    if not progress.stop:
        cause = f"{progress.text()}; the robot has not moved for {progress.waiting:.1f} s"
        fix = "does something hold a wheel, or is the speed too low for the motors?"
    return RunError(Problem("E-DRIVE-BLOCKED", "drive", cause, fix))


def _drive_once(client: ControlClient, late_allowed: int, fields: dict[str, Any]) -> bool:
    """Send one command; False when it came too late, and that is still allowed.

    It is not once the drive has begun: when a link works again, nothing must move by itself.
    """
    try:
        client.request("drive", **fields)
    except RunError as error:
        if not late_allowed or error.problems[0].code != "E-LATE":
            raise
        return False
    return True


def _drive_progress(
    context: click.Context,
    linear: float,
    angular: float,
    duration: float | None,
    distance: float | None,
    angle: float | None,
) -> DriveProgress:
    ends = {"--for": duration, "--distance": distance, "--angle": angle}
    given = [name for name, end in ends.items() if end is not None]
    if len(given) > 1:
        refuse_pair(given[0], given[1], "each states where the drive ends")
    for name, end in ends.items():
        if end == 0.0:
            raise click.UsageError(f"{name} 0 is no drive: give another value")
    if distance is not None and not linear:
        raise click.UsageError("--distance needs a --speed other than 0, such as --speed 0.1")
    if angle is not None and not angular:
        raise click.UsageError("--angle needs a --turn other than 0, such as --turn 45deg/s")
    if not is_typed(context, "--speed") and not is_typed(context, "--turn"):
        fix = "give --speed, such as --speed 0.1, or --turn, such as --turn 45deg/s"
        raise click.UsageError(f"without a speed the robot does not move: {fix}")
    for end, name, speed, sign in (
        (distance, "--distance", linear, "--speed"),
        (angle, "--angle", angular, "--turn"),
    ):
        if end is not None and end * speed < 0.0:
            cause = f"{name} and {sign} have opposite signs"
            raise click.UsageError(f"{cause}: the sign of {sign} is the direction")
    if distance is None and angle is None and duration is None:
        duration = DEFAULT_DURATION_S
    metres, radians = (None if end is None else abs(end) for end in (distance, angle))
    return DriveProgress(duration, metres, radians, linear, angular)


def _subscribe(client: ControlClient, needs_odometry: bool) -> None:
    """Follow the pose and the stop in force. Raises RunError if there is no pose to follow."""
    topics = client.request("list_topics")["topics"]
    poses = [row["topic"] for row in topics if row["type"] == "Odometry"][:1]
    if needs_odometry and not poses:
        from diffbotctl.errors import Problem, RunError

        cause = "this pipeline has no odometry, so that nothing shows how far the robot has driven"
        raise RunError(Problem("E-DRIVE-BLOCKED", "drive", cause, "drive for a time: --for 2s"))
    for topic in [*poses, *(row["topic"] for row in topics if row["topic"] == STOP)]:
        client.request("subscribe", topic=topic, last=True)


def _follow(client: ControlClient, progress: DriveProgress) -> None:
    """Take poses and stops until the next command is due."""
    for event in client.stream(time.monotonic() + COMMAND_PERIOD_S):
        message = event.get("message")
        if message is None:
            continue
        if event["topic"] != STOP:
            progress.update(message)
        else:
            progress.update_stop(message)


class GotoCommand(NumbersCommand):
    """`goto left 4 4` is `goto 4 4 --engine left`: no position begins with a letter."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Split `0.5,0.2`; move the name of an engine from the arguments to its option."""
        if not any(map(DECIMAL_COMMA.search, args)):
            args = [word for arg in args for word in SEPARATORS.split(arg.strip("()[], "))]
        elif len(args) == 1 and len(words := SEPARATORS.split(args[0].strip("()[], "))) in (2, 3):
            fix = f"diffbotctl goto {' '.join(words)}"
            raise click.UsageError(f"'{args[0]}' is one word; write {len(words)}: {fix}", context)
        if args and ENGINE_NAME.fullmatch(args[0]) and args[0].lower() not in NO_NUMBERS:
            if any(word.partition("=")[0] == "--engine" for word in args):
                raise click.UsageError(f"give either '{args[0]}' or --engine", context)
            args = ["--engine", args[0], *args[1:]]
        return super().parse_args(context, args)


@command(
    "Drive",
    3,
    "Drive to a pose",
    cls=GotoCommand,
    context_settings=NEGATIVE_NUMBERS,
    options_metavar="[OPTIONS] [ENGINE]",
)
def goto(
    x: float = argument(type=Quantity("m")),
    y: float = argument(type=Quantity("m")),
    heading: float | None = argument(type=Quantity("rad")),
    engine: str | None = ENGINE,
) -> None:
    """Drive to X Y and turn to HEADING, such as 0.5 0 90deg or 50cm 0 1.57rad.

    ENGINE is the name of a robot, as after --engine; only needed when several are running.
    Replaces the goals of the run. The run no longer ends when a goal is reached.
    """
    with attached(engine, "goto") as client:
        client.request("goto", x=x, y=y, heading=heading)
        held = held_by(client.request("status"))
        for warning in _warnings(client.request("scene"), x, y):
            click.echo(f"warning: {warning}", err=True)
    facing = "" if heading is None else f", heading {degrees(heading):.0f} deg"
    click.echo(f"goal: x {x:g} m, y {y:g} m{facing}")
    if held:
        click.echo(f"the robot is stopped by {held}; `diffbotctl resume` allows motion", err=True)


def _warnings(scene: dict[str, Any], x: float, y: float) -> Iterator[str]:
    """What is probably wrong with the goal at (x, y) in the simulated or real world of a run."""
    from diffbotctl.config.checks.world import StandingRoom, goal_problems

    outline = scene["robot"]
    room = None
    if outline is not None:
        room = StandingRoom(scene["walls"], scene["rounds"], outline["width"])
    for problem in goal_problems("the goal", x, y, room):
        yield problem.cause
