"""`diffbotctl drive` and `goto`: drive by hand for a time, a distance or an angle; or to a pose."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from math import degrees, hypot, sqrt
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.contradictions import is_typed, refuse_pair
from diffbotctl.cli.engine_client import attached, held_by
from diffbotctl.cli.options import (
    NEGATIVE_NUMBERS,
    NumbersCommand,
    Quantity,
    engine_option,
    for_option,
)

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

COMMAND_PERIOD_S = 0.05  # the engine takes 0.3 s of silence for a lost operator
BRAKING = 0.15  # m/s2, gentle for any robot, so that it stops near the mark
TURN_BRAKING = 1.0  # rad/s2
DEFAULT_DURATION_S = 1.0  # a drive always has an end: the person may be gone
ENGINE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
NO_NUMBERS = ("nan", "inf", "infinity")  # refused as a position
LATE_BEFORE_START_MAX = 20  # commands through a slow link, before the first one is taken
SPEED_RATIO_MIN = 0.25  # kept up to the mark: at a lower speed friction may hold a wheel before it


class DriveProgress:
    """Progress towards the end of a drive, and the ratio of the speed still to be commanded.

    `seconds`, `metres`, `radians`: where the drive ends; one of them is given.
    """

    def __init__(self, seconds: float | None, metres: float | None, radians: float | None) -> None:
        self.seconds, self.metres, self.radians = seconds, metres, radians
        self.start_time = time.monotonic()
        self.last: dict[str, Any] | None = None
        self.driven = self.turned = 0.0

    def update(self, odometry: dict[str, Any]) -> None:
        """Take an odometry message."""
        if self.last is not None:
            step = odometry["x"] - self.last["x"], odometry["y"] - self.last["y"]
            self.driven += hypot(*step)
            self.turned += odometry["heading"] - self.last["heading"]
        self.last = odometry

    def speed_ratio(self, linear: float, angular: float) -> float:
        """The ratio of the speeds (m/s, rad/s) to command now, 1 to 0; 0 ends the drive."""
        if self.seconds is not None:
            return 1.0 if time.monotonic() - self.start_time < self.seconds else 0.0
        if self.metres is not None:
            return braking_ratio(self.metres - self.driven, abs(linear), BRAKING)
        if self.radians is not None:
            return braking_ratio(self.radians - abs(self.turned), abs(angular), TURN_BRAKING)
        return 1.0


def braking_ratio(remaining: float, speed: float, braking: float) -> float:
    """The ratio of `speed` that allows braking within `remaining`; 0 at the end."""
    if remaining <= 0.0:
        return 0.0
    return min(1.0, max(SPEED_RATIO_MIN, sqrt(2.0 * braking * remaining) / speed))


@click.command(cls=NumbersCommand, context_settings=NEGATIVE_NUMBERS)
@click.option(
    "--speed",
    "--v",
    "linear",
    type=Quantity("m/s"),
    default="0",
    metavar="SPEED",
    help="Forward speed, such as 0.2 or 20cm/s.",
)
@click.option(
    "--turn",
    "--w",
    "angular",
    type=Quantity("rad/s"),
    default="0",
    metavar="RATE",
    help="Turning speed, positive to the left, such as 45deg/s.",
)
@for_option
@click.option("--distance", type=Quantity("m"), metavar="LENGTH", help="Stop after this distance.")
@click.option("--angle", type=Quantity("rad"), metavar="ANGLE", help="Stop after this turn.")
@click.option("--take-over", is_flag=True, help="Drive even if another client is driving.")
@engine_option
def drive(
    linear: float,
    angular: float,
    duration: float | None,
    distance: float | None,
    angle: float | None,
    take_over: bool,
    engine: str | None,
) -> int:
    """Drive by hand, for 1 s unless --for, --distance or --angle is given.

    Ctrl-C stops the robot, and so does the end of this process. A goal that was under way waits for
    `diffbotctl resume`.
    """
    context = click.get_current_context()
    progress = _drive_progress(context, linear, angular, duration, distance, angle)
    with attached(engine, "drive") as client:
        _subscribe_odometry(client)
        progress.start_time = time.monotonic()  # ssh may have taken a second to connect
        late_allowed = LATE_BEFORE_START_MAX
        try:
            while (ratio := progress.speed_ratio(linear, angular)) > 0.0:
                fields = {"linear": linear * ratio, "angular": angular * ratio}
                if _drive_once(client, late_allowed, {**fields, "take_over": take_over}):
                    late_allowed = 0
                    take_over = False  # once: a client that takes over from this one keeps control
                else:
                    late_allowed -= 1
                    progress.start_time = time.monotonic()
                _follow_odometry(client, progress)
        finally:
            client.send("release")
        _follow_odometry(client, progress)
    click.echo(f"driven {progress.driven:.3f} m, turned {degrees(progress.turned):.1f} deg")
    return 0


def _drive_once(client: ControlClient, late_allowed: int, fields: dict[str, Any]) -> bool:
    """Send one command; False when it came too late, and that is still allowed.

    It is not once the drive has begun: when a link works again, nothing must move by itself.
    """
    from diffbotctl.errors import RunError

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
        refuse_pair(given[0], given[1], "each tells where the drive ends")
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
    for end, name, speed, option in (
        (distance, "--distance", linear, "--speed"),
        (angle, "--angle", angular, "--turn"),
    ):
        if end is not None and end * speed < 0.0:
            cause = f"{name} and {option} have opposite signs"
            raise click.UsageError(f"{cause}: the sign of {option} is the direction")
    if distance is None and angle is None and duration is None:
        duration = DEFAULT_DURATION_S
    return DriveProgress(
        duration, None if distance is None else abs(distance), None if angle is None else abs(angle)
    )


def _subscribe_odometry(client: ControlClient) -> None:
    for row in client.request("list_topics")["topics"]:
        if row["type"] == "Odometry":
            client.request("subscribe", topic=row["topic"])
            return


def _follow_odometry(client: ControlClient, progress: DriveProgress) -> None:
    """Take odometry messages until the next command is due."""
    for event in client.stream(time.monotonic() + COMMAND_PERIOD_S):
        if "message" in event:
            progress.update(event["message"])


class GotoCommand(NumbersCommand):
    """`goto left 4 4` is `goto 4 4 --engine left`: no position begins with a letter."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Move the name of an engine from the arguments to its option."""
        if len(args) == 1 and len(words := re.split(r"[,;\s]+", args[0].strip("()[], "))) in (2, 3):
            fix = f"diffbotctl goto {' '.join(words)}"
            raise click.UsageError(f"'{args[0]}' is one word; write {len(words)}: {fix}", context)
        if args and ENGINE_NAME.fullmatch(args[0]) and args[0].lower() not in NO_NUMBERS:
            if any(word.partition("=")[0] == "--engine" for word in args):
                raise click.UsageError(f"give either '{args[0]}' or --engine", context)
            args = ["--engine", args[0], *args[1:]]
        return super().parse_args(context, args)


@click.command(
    cls=GotoCommand,
    context_settings=NEGATIVE_NUMBERS,
    options_metavar="[OPTIONS] [ENGINE]",
)
@click.argument("x", type=Quantity("m"))
@click.argument("y", type=Quantity("m"))
@click.argument("heading", type=Quantity("rad"), required=False)
@engine_option
def goto(x: float, y: float, heading: float | None, engine: str | None) -> int:
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
    return 0


def _warnings(scene: dict[str, Any], x: float, y: float) -> Iterator[str]:
    """What is probably wrong with the goal at (x, y) in the simulated or real world of a run."""
    from diffbotctl.config.checks.world import StandingRoom, goal_problems

    outline = scene["robot"]
    room = None
    if outline is not None:
        room = StandingRoom(scene["walls"], scene["rounds"], outline["width"])
    for problem in goal_problems("the goal", x, y, room):
        yield problem.cause
