"""Checks of the simulated world, the goals, and the outline that obstacle checks rely on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees, hypot
from typing import NamedTuple

from diffbotctl.config.checks.block_needs import GUARDS
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.configuration import Configuration
from diffbotctl.errors import Place, Problem, join_words
from diffbotctl.geometry.footprint import Footprint, distance_to_segment, into_frame

# The odometry of a calibrated two-wheel robot is off by about 1 to 3 % of the way.
GOAL_FAR_M = 100.0
# The reported standard deviations fit the errors of robots that slip by twice the default.
SLIP_RATIO_MAX = 2.5
# Keys of simulation.encoder that encoders with two channels ignore.
OF_ONE_CHANNEL = ("bounce", "covered", "missed", "doubled")


@check("simulation.slip", "drive.slip")
def check_slip(context: CheckContext, simulated: float, stated: float) -> None:
    """Warn of simulated wheels that slip by far more than odometry assumes."""
    if context.real or simulated <= SLIP_RATIO_MAX * stated:
        return
    cause = (
        f"the simulated wheels slip by {1000 * simulated:.3g} mm after 1 m, and odometry assumes "
        f"{1000 * stated:.3g} mm; encoders cannot see slip, so the pose will be worse than reported"
    )
    fix = "`diffbotctl calibrate geometry` measures drive.slip; a gyro sees turns by slip"
    context.warn("W-SLIP", context.robot_place("simulation", "slip"), cause, fix)


@check("drive.left.encoder.channels", "simulation.equations")
def check_unused_keys(context: CheckContext, channels: int, equations: str) -> None:
    """Warn of properties of the simulated robot that a robot with these parts does not have."""
    if context.real:
        return
    if channels != 1:
        reason = "only encoders with one channel are simulated with it"
        for key in OF_ONE_CHANNEL:
            if any(context.values(f"simulation.encoder.{key}") or ()):
                _warn_unused(context, "encoder", key, reason)
    if equations == "torque" and context.values("simulation.motor.coasting") == ("linear",):
        reason = "the equations `torque` have dry friction, which stops a wheel without drive"
        _warn_unused(context, "motor", "coasting", reason)


def _warn_unused(context: CheckContext, section: str, key: str, reason: str) -> None:
    value = context.robot_value("simulation", section, key)
    if value is not None:  # otherwise it is the default
        cause = f"'{key}' has no effect on this robot: {reason}"
        context.warn("W-SIMULATION-UNUSED", value.place, cause, "remove it")


@check()
def check_walls(context: CheckContext) -> None:
    """Refuse walls without a length, and a field without an area."""
    walls = context.pipeline_value("world", "walls")
    for number, wall in enumerate(_walls(context)):
        if wall is not None and wall[0] == wall[1] and walls is not None:
            cause = "this wall begins and ends at the same point"
            context.error("E-WALL", walls.items[number].place, cause, "correct from or to")
    field = context.pipeline.world.field if context.pipeline and context.pipeline.world else None
    place = context.pipeline_value("world", "field")
    if field is None or place is None or len(field) != 2 or None in field:
        return
    if min(field) <= 0.0:
        cause = "the field is the rectangle from [0, 0] to this corner, so both must be above 0"
        context.error("E-WALL", place.place, cause, "write its size, such as [3 m, 2 m]")


@check()
def check_scanned_world(context: CheckContext) -> None:
    """Warn of a simulated world in which a laser scanner measures nothing: its guard stops."""
    world = context.pipeline.world if context.pipeline is not None else None
    if context.real or world is None or world.walls or world.obstacles or world.field:
        return
    for name in context.block_classes:
        wire = context.pipeline_value("blocks", name, "in", "scan")
        # Only guards have this parameter.
        is_open = context.parameters.get(name, {}).get("open_space")
        if is_open is not False or wire is None:
            continue
        if not str(wire.data).startswith("robot."):
            continue
        cause = f"'{name}' stops the robot here: in a world without walls its scanner sees nothing"
        fix = f"add walls to `world:`, or drive slowly with --set {name}.open_space=true"
        steps = (("world", "walls"), ("world",), ("blocks", name))
        place = next(filter(None, (context.pipeline_value(*each) for each in steps)), None)
        context.warn("W-WORLD-EMPTY", place.place if place is not None else name, cause, fix)


def _walls(context: CheckContext) -> list[tuple[tuple[float, float], tuple[float, float]] | None]:
    """The ends of each wall; None where one could not be read."""
    world = context.pipeline.world if context.pipeline else None
    ends: list[tuple[tuple[float, float], tuple[float, float]] | None] = []
    for wall in (world.walls or []) if world else []:
        points = [wall.start, wall.end] if wall is not None else [None]
        readable = all(point and len(point) == 2 and None not in point for point in points)
        ends.append((wall.start, wall.end) if readable else None)
    return ends


@check()
def check_goals(context: CheckContext) -> None:
    """Refuse goals in a wall or obstacle of the simulated world; warn of those very far away."""
    goals = context.pipeline_value("goals")
    if context.pipeline is None or goals is None:
        return
    width = context.values("body.width")
    start = context.values("simulation.start.x", "simulation.start.y", "simulation.start.heading")
    # With another start the world has a frame of its own, where the goal is not known.
    is_known = not context.real and width is not None and start is not None and not any(start)
    room = _room(context, width[0]) if is_known and width else None
    for entry, value in zip(context.pipeline.goals or [], goals.items, strict=False):
        if entry is not None and entry.x is not None and entry.y is not None:
            context.problems += goal_problems(value.place, entry.x, entry.y, room)


@check()
def check_start(context: CheckContext) -> None:
    """Refuse a start at which a wall or obstacle of the simulated world crosses the outline."""
    body = context.values("body.front", "body.back", "body.width")
    start = context.values("simulation.start.x", "simulation.start.y", "simulation.start.heading")
    if context.real or body is None or start is None:
        return
    outline = Footprint(body[0], body[1], body[2] / 2)
    for kind, crosses in (
        (
            "walls",
            [wall and outline.crosses(*into_frame([*wall], *start)) for wall in _walls(context)],
        ),
        ("obstacles", [_covers(each, outline, start) for each in _obstacles(context)]),
    ):
        entry = (
            context.pipeline_value("world", kind, crosses.index(True)) if True in crosses else None
        )
        if entry is not None:
            x, y, heading = start
            cause = (
                f"the robot starts at ({x:g}, {y:g}) m, {degrees(heading):g} deg, where this "
                f"{kind.removesuffix('s')} of the simulated world crosses its outline"
            )
            place = context.error_place("simulation.start", also=[entry])
            context.error(
                "E-START-WALL", place, cause, "move simulation.start, or the wall or obstacle"
            )
            return


def _covers(
    obstacle: Sequence[float] | None, outline: Footprint, start: tuple[float, float, float]
) -> bool:
    if obstacle is None:
        return False
    x, y, radius = obstacle
    ((ahead, aside),) = into_frame([(x, y)], *start)
    return outline.clearance(ahead, aside) < radius


class StandingRoom(NamedTuple):
    """Walls, each with its two ends, and round obstacles (x, y, radius); width of the robot (m)."""

    walls: Sequence[Sequence[float]]
    rounds: Sequence[Sequence[float]]
    width: float


def _room(context: CheckContext, width: float) -> StandingRoom:
    walls = [(*wall[0], *wall[1]) for wall in _walls(context) if wall is not None]
    rounds = [entry for entry in _obstacles(context) if entry is not None]
    return StandingRoom(walls, rounds, width)


def _obstacles(context: CheckContext) -> list[tuple[float, float, float] | None]:
    """x, y and radius of each round obstacle; None where one could not be read."""
    world = context.pipeline.world if context.pipeline else None
    return [
        (*entry.at, entry.radius)
        if entry and len(entry.at or ()) == 2 and None not in (*entry.at, entry.radius)
        else None
        for entry in ((world.obstacles or []) if world else [])
    ]


def goal_problems(
    place: Place | str, x: float, y: float, room: StandingRoom | None
) -> Iterator[Problem]:
    """What is wrong with the goal at (x, y) of odom; `room`: what is known to stand there."""
    distance = hypot(x, y)
    if distance > GOAL_FAR_M:
        cause = (
            f"this goal is {distance:.0f} m from the origin; the odometry of such a robot is off "
            "by 1 to 3 % of its way"
        )
        yield Problem("W-GOAL-FAR", place, cause, "check the unit of the coordinates", "warning")
    if room is None:
        return
    obstacles = [("wall", distance_to_segment(x, y, *wall)) for wall in room.walls]
    obstacles += [("obstacle", hypot(x - at, y - up) - radius) for at, up, radius in room.rounds]
    for kind, gap in obstacles:
        if gap < room.width / 2:
            cause = (
                f"the middle of the robot would be {max(gap, 0.0) * 1000:.0f} mm from a simulated "
                f"{kind}, less than half its width of {room.width * 1000:.0f} mm"
            )
            yield Problem("E-GOAL-WALL", place, cause, f"move the goal or the {kind}")
            return


def typed_goal_problems(
    configuration: Configuration, place: Place | str, x: float, y: float, is_simulated: bool
) -> list[Problem]:
    """As `goal_problems`, of a goal that was given at `place` for a checked configuration."""
    robot, world = configuration.robot, configuration.world
    room = None
    if robot is not None and is_simulated:
        start = robot.simulation.start
        if not any((start.x, start.y, start.heading)):
            walls = [(*wall.start, *wall.end) for wall in world.walls]
            rounds = [(*obstacle.at, obstacle.radius) for obstacle in world.obstacles]
            room = StandingRoom(walls, rounds, robot.body.width)
    return list(goal_problems(place, x, y, room))


@check()
def check_body(context: CheckContext) -> None:
    """Require the outline where a guard relies on it; without one, the book's would be assumed."""
    if context.robot is None or context.robot_tree is None or context.pipeline is None:
        return
    missing = [
        key for key in ("front", "back", "width") if context.robot_value("body", key) is None
    ]
    if not missing:
        return
    guards = [
        name
        for name, entry in (context.pipeline.blocks or {}).items()
        if entry is not None and entry.block in GUARDS
    ]
    if not guards:
        return
    body = context.robot.body
    if body is None or None in (body.front, body.back, body.width):
        return  # reported where it was read
    has_body = context.robot_value("body") is not None
    lack = f"`body:` has no {join_words(missing, 'or')}" if has_body else "it has no `body:`"
    cause = (
        f"'{guards[0]}' keeps the outline of the robot free, but in the robot file {lack}; assumed "
        f"are {body.front * 1000:g} mm to the front, {body.back * 1000:g} mm to the back and a "
        f"width of {body.width * 1000:g} mm"
    )
    fix = "measure it from the middle of the axle: `body: {front: ..., back: ..., width: ...}`"
    report = context.error if context.real else context.warn
    code = "E-BODY-MISSING" if context.real else "W-BODY-MISSING"
    place = context.robot_place("body" if has_body else "kind")
    report(code, place, cause, fix)
