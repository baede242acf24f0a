"""The board's dead-man's time outlasts the gap between two commands.

Edges come no faster than frames: a frame tells the time of one edge of each wheel.

One-channel encoders cannot see a motor that turns the wrong way.

The motors can do what the limits allow, and are no faster than motors of such robots are.

The robot stops within what its sensor sees.
"""

from __future__ import annotations

from math import hypot, pi, sqrt
from typing import Any

from diffbotctl.block import robot_fields
from diffbotctl.blocks.obstacle_stop import ObstacleStop, reaction_time, stopping_distance
from diffbotctl.blocks.range_sensor import REACH
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.robot import SIDES
from diffbotctl.errors import Place
from diffbotctl.params import declared

SAFE = 3  # commands; two in a row may be lost to noise without a stop


def check_deadman(context: CheckContext) -> None:
    """Compare the dead-man's time with the time from one command to the next."""
    known = context.values("board.deadman", "board.telemetry", "link.protocol")
    if known is None or known[2] != "diffbot":
        return  # the book's firmware has none; `run` says so
    deadman, rate, _ = known
    commands = deadman * rate
    place = context.error_place("board.deadman", "board.telemetry")
    cause = (
        f"commands go out with each frame, every {1000 / rate:.0f} ms; "
        f"the board stops {deadman * 1000:.0f} ms after the last"
    )
    fix = "raise board.telemetry, or board.deadman up to 500 ms"
    if commands <= 1:
        context.error("E-DEADMAN", place, f"{cause}, so it would stop between any two", fix)
    elif commands < SAFE:
        context.warn("W-DEADMAN", place, f"{cause}, so two lost ones stop it", fix)


# Edges a frame at full speed. Odometry tells which slot an edge belongs to from the one before it;
# simulated robots with twice as many lost their heading by ten degrees and more.
MOST = 1.25


def check_edges(context: CheckContext) -> None:
    """Compare the edges at full speed with the frames that a board with edge times sends."""
    known = context.values(
        "board.edge_times",
        "board.telemetry",
        "drive.left.wheel.diameter",
        "drive.left.encoder.slots",
        "limits.speed",
    )
    if known is None:
        return
    has_edge_times, telemetry, diameter, slots, speed = known
    rate = speed / (pi * diameter) * slots
    if not has_edge_times or rate <= MOST * telemetry:
        return
    place = context.error_place("board.telemetry", "drive.encoder.slots", "limits.speed")
    cause = (
        f"at {speed:g} m/s {rate:.0f} edges come each second and {telemetry:g} frames: a frame "
        "tells the time of one edge alone, and the heading drifts"
    )
    fix = f"telemetry: {rate:.0f} Hz, or a lower limits.speed, or edge_times: false"
    context.warn("W-EDGES", place, cause, fix)


def check_polarity(context: CheckContext) -> None:
    """Before a real robot moves: has anyone seen its wheels turn the right way?"""
    known = context.values("drive.polarity", "drive.left.encoder.channels")
    if not context.real or known is None or known != ("unproven", 1):
        return
    cause = (
        "nobody has seen yet that both motors turn the right way, and one-channel encoders "
        "cannot tell: the robot is held to 0.1 m/s"
    )
    fix = (
        "run `diffbotctl calibrate encoders`, or set drive: {polarity: checked_by_hand} when you "
        "have"
    )
    context.warn("W-POLARITY", context.robot_place("drive", "polarity"), cause, fix)


FIELDS = ("motor.rated", "wheel.diameter")
FASTEST = 60.0  # rad/s, 573 rpm; who forgets to write rpm usually states more


def check_speed(context: CheckContext) -> None:
    """Compare the speed limit with the wheels' rated speed."""
    limit = context.values("limits.speed")
    wheels = [
        known[0] * known[1] / 2
        for side in SIDES
        if (known := context.values(f"drive.{side}.motor.rated", f"drive.{side}.wheel.diameter"))
    ]
    if not wheels:
        return
    top = min(wheels)
    rated = context.values(*(f"drive.{side}.motor.rated" for side in SIDES))
    if rated is not None and max(rated) > FASTEST:
        _warn(context, max(rated))
    if limit is None or limit[0] <= top:
        return
    rpm = top / _radius(context) / (2 * pi) * 60
    cause = f"the wheels reach {top:.2f} m/s at their rated {rpm:.0f} rpm, not {limit[0]:g} m/s"
    fix = f"set limits.speed to at most {int(top * 100) / 100:g} m/s, or correct drive.motor.rated"
    fields = [f"drive.{side}.{field}" for side in SIDES for field in FIELDS]
    context.error("E-LIMIT-SPEED", context.error_place("limits.speed", *fields), cause, fix)


def _warn(context: CheckContext, rated: float) -> None:
    """A bare number is in rad/s, and motors are sold in rpm."""
    cause = (
        f"{rated:.4g} rad/s are {rated / (2 * pi) * 60:.0f} rpm, more than a geared motor of such "
        "robots turns a wheel"
    )
    fields = [f"drive.{side}.{field}" for side in SIDES for field in FIELDS]
    fix = "it is the wheel's speed, behind the gear; write the unit: `rated: 100 rpm`"
    context.warn("W-MOTOR-RATED", context.error_place("drive.motor.rated", *fields), cause, fix)


def _radius(context: CheckContext) -> float:
    """The radius of the slower side's wheel."""
    radii = [
        (known[0] * known[1], known[1] / 2)
        for side in SIDES
        if (known := context.values(f"drive.{side}.motor.rated", f"drive.{side}.wheel.diameter"))
    ]
    return float(min(radii)[1])


def check_reach(context: CheckContext) -> None:
    """Compare the stopping distance at full speed with the reach of each guarding sensor."""
    for name, kind in context.block_classes.items():
        if issubclass(kind, ObstacleStop) and name in context.parameters:
            _check_guard(context, name, kind)


def _check_guard(context: CheckContext, name: str, kind: type[ObstacleStop]) -> None:
    values = context.parameters[name]
    fields = {each: context.values(path) for each, path in robot_fields(kind).items()}
    speed = context.values("limits.speed")
    if speed is None or None in fields.values() or any(each is None for each in _used(values)):
        return
    robot: dict[str, Any] = {each: found[0] for each, found in fields.items() if found}
    reaction = values["reaction"]
    if reaction is None:
        reaction = reaction_time(
            robot["telemetry"], values["debounce"], robot["command_delay"], robot["lag"]
        )
    needed = stopping_distance(speed[0], robot["braking"], reaction)
    mounted = context.values(f"sensors.{values['sensor'] or next(iter(robot['sensors']), '')}.at.x")
    seen = REACH - (robot["front"] - mounted[0] if mounted else 0.0)
    if needed + values["margin"] <= seen:
        return
    cause = (
        f"from {speed[0]:g} m/s it takes {needed * 100:.0f} cm to stop ({reaction * 1000:.0f} ms "
        f"to react, then braking); the sensor sees {seen * 100:.0f} cm ahead of the front"
    )
    fix = (
        f"at most {_most(seen - values['margin'], robot['braking'], reaction):g} m/s stops in time"
    )
    place = _place(context, name, values["sensor"] or next(iter(robot["sensors"]), ""))
    if needed > seen:
        context.error("E-STOP-REACH", place, cause, fix)
    else:
        nearer = f"it would stand closer than the margin of {values['margin'] * 100:.0f} cm"
        context.warn("W-STOP-REACH", place, f"{cause}: {nearer}", fix)


def _used(values: dict[str, Any]) -> tuple[Any, ...]:
    return values["debounce"], values["margin"]


def _place(context: CheckContext, name: str, sensor: str) -> Place | str:
    given = [
        context.pipeline_value("blocks", name, "with", each)
        for each in ("reaction", "margin", "debounce")
    ]
    fields = ("limits.speed", "limits.braking", f"sensors.{sensor}.at.x", "board.telemetry")
    return context.error_place(*fields, also=given)


def _most(free: float, braking: float, reaction: float) -> float:
    """The highest speed, in steps of 1 cm/s, that stops within `free` metres."""
    speed = 0.0
    while stopping_distance(speed + 0.01, braking, reaction) <= free:
        speed += 0.01
    return round(speed, 2)


TYRES = tuple(f"drive.{side}.wheel.width" for side in SIDES)
SLACK = 0.002  # m; a rule across two soft tyres is read no better


def check_outline(context: CheckContext) -> None:
    """Compare the body's width with what the tyres reach, by the stated geometry: a calibrated
    track tells where tyres seem to touch, not how far they reach."""
    tyres = context.nominal_values(*TYRES)
    stated = context.nominal_values("drive.track", "body.width")
    if tyres is None or stated is None:
        return
    track, width = stated
    reach = track + max(tyres)
    if reach <= width + SLACK:
        return
    cause = (
        f"the tyres reach {reach * 1000:.0f} mm from outside to outside, the body is said to be "
        f"{width * 1000:.0f} mm wide: whatever keeps the robot clear of things by its outline "
        "takes it for narrower than it is"
    )
    fix = f"body.width: {reach * 1000:.0f} mm, or correct drive.track or wheel.width"
    fields = ("body.width", "drive.track", "drive.wheel.width", *TYRES)
    context.warn("W-BODY-TYRES", context.error_place(*fields), cause, fix)


# Share of a slot's uncertainty that is left when the board tells when each edge came: the slots'
# own unevenness and the motor's unmodelled part (a study of 300 simulated robots).
WITH_EDGE_TIMES = 0.5
# s; how much the moment scatters at which a rosserial board hears a command: the robot drives on
# for so long with what it was told before.
STOCK_DELAY_SPREAD = 0.025


def check_tolerance(context: CheckContext) -> None:
    """Compare the tolerance of each block that has one with the odometry's resolution."""
    known = context.values(
        "drive.left.wheel.diameter",
        "drive.left.encoder.slots",
        "limits.speed",
        "board.edge_times",
        "link.protocol",
    )
    if known is None:
        return
    finest = resolution(*known)
    for name, kind in context.block_classes.items():
        setting = declared(kind).get("tolerance")
        if setting is None or setting.unit != "m":
            continue
        tolerance = context.parameters.get(name, {}).get("tolerance")
        if tolerance is not None and tolerance < 2 * finest:
            _complain(context, name, tolerance, finest)


def resolution(
    diameter: float, slots: int, speed: float, has_edge_times: bool, protocol: str
) -> float:
    """Standard deviation in metres of where the robot believes to be along its way.

    A count alone places the wheel anywhere within one slot: pitch / sqrt(12).
    """
    pitch = pi * diameter / slots
    if protocol == "rosserial":
        return hypot(pitch / sqrt(12), speed * STOCK_DELAY_SPREAD)
    return pitch / sqrt(12) * (WITH_EDGE_TIMES if has_edge_times else 1.0)


def _complain(context: CheckContext, name: str, tolerance: float, finest: float) -> None:
    value = context.pipeline_value("blocks", name, "with", "tolerance") or context.pipeline_value(
        "blocks", name
    )
    place: Place | str = value.place if value else name
    cause = (
        f"{tolerance * 1000:g} mm is finer than this robot can tell: with its slots and board "
        f"its place is known to {finest * 1000:.1f} mm (standard deviation)"
    )
    fix = f"{2000 * finest:.0f} mm or more is reliable"
    if tolerance < finest:
        context.error("E-TOLERANCE", place, cause, fix)
    else:
        cause = cause.replace("is finer than", "is about as fine as")
        context.warn("W-TOLERANCE", place, f"{cause}, so some goals will need several tries", fix)
