"""`diffbotctl drive`: velocities by hand, for a time, a distance or an angle.

`diffbotctl goto`: send the robot to a place.
"""

from __future__ import annotations

import time
from math import degrees, hypot, sqrt
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, held_by, quantity_of

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

PERIOD = 0.05  # s between two words; the engine takes 0.3 s of silence for a lost operator
BRAKING = 0.15  # m/s2, gentle for any robot, so that it comes to rest near the mark
TURN_BRAKING = 1.0  # rad/s2
A_MOMENT = "1 s"
CREEP = 0.25  # of the speed, kept up to the mark: slower, friction may hold a wheel before it


class DriveProgress:
    """How far it is: the share of the speed that is still wanted, from 1 down to 0."""

    def __init__(self, seconds: float | None, metres: float | None, radians: float | None) -> None:
        self.seconds, self.metres, self.radians = seconds, metres, radians
        self.started = time.monotonic()
        self.last: dict[str, Any] | None = None
        self.driven = self.turned = 0.0

    def see(self, odometry: dict[str, Any]) -> None:
        """Take an odometry message."""
        if self.last is not None:
            step = odometry["x"] - self.last["x"], odometry["y"] - self.last["y"]
            self.driven += hypot(*step)
            self.turned += odometry["heading"] - self.last["heading"]
        self.last = odometry

    def share(self, linear: float, angular: float) -> float:
        """Of the speeds wanted, so much is left."""
        if self.seconds is not None:
            return 1.0 if time.monotonic() - self.started < self.seconds else 0.0
        if self.metres is not None:
            return braking_share(self.metres - self.driven, abs(linear), BRAKING)
        if self.radians is not None:
            return braking_share(self.radians - abs(self.turned), abs(angular), TURN_BRAKING)
        return 1.0


def braking_share(left: float, speed: float, braking: float) -> float:
    """The share of `speed` from which one can still brake within `left`; 0 at the mark."""
    if left <= 0.0:
        return 0.0
    return min(1.0, max(CREEP, sqrt(2.0 * braking * left) / speed))


@click.command(context_settings={"ignore_unknown_options": True})  # -0.2 is a number here
@click.option("--v", "linear", default="0", metavar="SPEED", help="Forward, such as 0.2 or 20cm/s.")
@click.option("--w", "angular", default="0", metavar="RATE", help="Turning left, such as 45deg/s.")
@click.option("--for", "duration", metavar="TIME", help="For so long, such as 2s.")
@click.option("--distance", metavar="LENGTH", help="Until so far has been driven.")
@click.option("--angle", metavar="ANGLE", help="Until so much has been turned.")
@click.option("--take-over", is_flag=True, help="Even if someone else is driving.")
@engine_option
def drive(
    linear: str,
    angular: str,
    duration: str | None,
    distance: str | None,
    angle: str | None,
    take_over: bool,
    engine: str | None,
) -> int:
    """Drive by hand, for a second unless you say how long or how far.

    Ctrl-C lets go and the robot stands; so does the end of this process. A goal that was under way
    waits for `diffbotctl resume`.
    """
    v, w = quantity_of(linear, "m/s", "--v"), quantity_of(angular, "rad/s", "--w")
    way = _drive_progress(v, w, duration, distance, angle)
    with attached(engine, "drive") as caller:
        _watch_odometry(caller)
        try:
            while (share := way.share(v, w)) > 0.0:
                caller.ask("drive", linear=v * share, angular=w * share, take_over=take_over)
                take_over = False  # once: whoever takes over from us keeps it
                _follow_odometry(caller, way)
        finally:
            caller.tell("release")
        _follow_odometry(caller, way)
    click.echo(f"driven {way.driven:.3f} m, turned {degrees(way.turned):.1f} deg")
    return 0


def _drive_progress(
    v: float, w: float, duration: str | None, distance: str | None, angle: str | None
) -> DriveProgress:
    if sum(each is not None for each in (duration, distance, angle)) > 1:
        raise click.UsageError("give one of --for, --distance, --angle")
    if (distance is not None and not v) or (angle is not None and not w):
        raise click.UsageError("--distance needs a speed --v, --angle needs a rate --w")
    if distance is None and angle is None:
        duration = duration or A_MOMENT  # never without end: nobody may be left to end it
    seconds, metres, radians = (
        None if text is None else abs(quantity_of(text, unit, option))
        for text, unit, option in (
            (duration, "s", "--for"),
            (distance, "m", "--distance"),
            (angle, "rad", "--angle"),
        )
    )
    return DriveProgress(seconds, metres, radians)


def _watch_odometry(caller: ControlClient) -> None:
    for row in caller.ask("topics")["topics"]:
        if row["type"] == "Odometry":
            caller.ask("watch", topic=row["topic"])
            return


def _follow_odometry(caller: ControlClient, way: DriveProgress) -> None:
    """Take what comes until it is time for the next word."""
    for said in caller.stream(time.monotonic() + PERIOD):
        if "message" in said:
            way.see(said["message"])


@click.command(context_settings={"ignore_unknown_options": True})  # -0.5 is a number here
@click.argument("x")
@click.argument("y")
@click.argument("heading", required=False)
@engine_option
def goto(x: str, y: str, heading: str | None, engine: str | None) -> int:
    """Drive to X Y, and turn to HEADING: metres and radians, or with a unit, such as 50cm 0 90deg.

    It replaces the goals that the run had. The run no longer ends when a goal is reached.
    """
    place = quantity_of(x, "m", "X"), quantity_of(y, "m", "Y")
    turn = None if heading is None else quantity_of(heading, "rad", "HEADING")
    with attached(engine, "goto") as caller:
        caller.ask("goto", x=place[0], y=place[1], heading=turn)
        held = held_by(caller.ask("status"))
    facing = "" if turn is None else f", heading {degrees(turn):.0f} deg"
    click.echo(f"goal: x {place[0]:g} m, y {place[1]:g} m{facing}")
    if held:
        click.echo(f"the robot is held by {held}; `diffbotctl resume` lets it go", err=True)
    return 0
