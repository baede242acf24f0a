"""Checks of drive, limits and timing against each other."""

from __future__ import annotations

from math import ceil, cos, degrees, floor, hypot, pi, remainder, sqrt
from typing import Any

from diffbotctl.block import outputs, robot_fields
from diffbotctl.blocks.obstacle_stop import (
    ObstacleStop,
    guard_reaction,
    guard_sensor,
    max_safe_speed,
    stopping_distance,
)
from diffbotctl.blocks.range_sensor import sensor_reach
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.checks.sensors import GUARD_ASIDE_MAX
from diffbotctl.config.robot import (
    SIDES,
    BoardSection,
    DriveSection,
    LimitsSection,
    default_glitch,
    line_baud,
    shortest_level,
)
from diffbotctl.errors import Place, join_words
from diffbotctl.estimation.geometry_deviation import SKID_TRACK_SD, TRACK
from diffbotctl.estimation.slot_errors import LEARNABLE_SLOTS_MAX
from diffbotctl.links import link_protocol
from diffbotctl.messages import GoalState
from diffbotctl.params import declared
from diffbotctl.units import rounded_down, rounded_up

COMMANDS_PER_DEADMAN_MIN = 3  # two consecutive ones may be lost without a stop
# At full speed. Odometry derives the slot of an edge from the previous edge; simulated robots with
# twice as many edges lost their heading by ten degrees and more.
EDGES_PER_FRAME_MAX = 1.25
# Glitch time relative to the shortest level. Slots of 0.4 pitches instead of 0.5 (the widest spread
# of real discs) and a wheel 10 % above its rated speed shorten a level to 0.73 of it.
GLITCH_WARNED_RATIO, GLITCH_REFUSED_RATIO = 0.5, 0.7
# Beyond what the wheels reach; a smaller excess has no effect, a larger one is a wrong unit.
TURN_RATE_RATIO_MAX = 3.0
RATED_SPEED_MAX_RAD_S = 60.0  # 573 rpm; a value in rpm without its unit is usually larger
TYRE_WIDTH_TOLERANCE_M = 0.002  # reading error of a ruler across two soft tyres
# Uncertainty that remains when the board reports edge times, relative to a slot's: uneven slots and
# the unmodelled part of the motor (from 300 simulated robots).
EDGE_TIME_UNCERTAINTY_RATIO = 0.5
# Spread of a rosserial board's command delay; until then the robot follows the previous command.
STOCK_DELAY_SPREAD_S = 0.025

RATED = tuple(f"drive.{side}.motor.rated" for side in SIDES)
DIAMETERS = tuple(f"drive.{side}.wheel.diameter" for side in SIDES)
TYRE_WIDTHS = tuple(f"drive.{side}.wheel.width" for side in SIDES)


@check("board.deadman", "board.telemetry", "link.protocol")
def check_deadman(context: CheckContext, deadman: float, rate: float, protocol: str) -> None:
    """Compare the dead-man time with the time between two commands."""
    if protocol != "diffbot":
        return  # the book's firmware has none; `run` reports that
    place = context.error_place("board.deadman", "board.telemetry")
    cause = (
        f"a command is sent with each frame, every {1000 / rate:.0f} ms; "
        f"the board stops {deadman * 1000:.0f} ms after the last one"
    )
    slowest = ceil(COMMANDS_PER_DEADMAN_MIN / deadman)
    fix = f"set board.telemetry to at least {slowest} Hz"
    longest = declared(BoardSection)["deadman"].bounds["maximum"]
    if deadman < longest and longest * rate > 1:
        fix += f", or raise board.deadman up to {longest * 1000:.0f} ms"
    if deadman * rate <= 1:
        context.error("E-DEADMAN", place, f"{cause}, so it would stop between two commands", fix)
    elif deadman * rate < COMMANDS_PER_DEADMAN_MIN:
        context.warn("W-DEADMAN", place, f"{cause}, so the loss of two commands stops it", fix)


@check(
    "board.edge_times",
    "board.telemetry",
    "drive.left.wheel.diameter",
    "drive.left.encoder.slots",
    "limits.speed",
)
def check_edges(
    context: CheckContext,
    has_edge_times: bool,
    telemetry: float,
    diameter: float,
    slots: int,
    speed: float,
) -> None:
    """Compare the edges at full speed with the frames that a board with edge times sends.

    Odometry counts the edges of finer encoders, whose slots it does not distinguish.
    """
    if not has_encoders(context) or context.values("drive.left.encoder.channels") == (2,):
        return  # two channels show the direction of every edge
    top_speed = min((wheel[0] for wheel in _rim_speeds(context)), default=speed)
    speed = min(speed, top_speed)  # one beyond that is refused where it is stated
    rate = speed / (pi * diameter) * slots
    if not has_edge_times or slots > LEARNABLE_SLOTS_MAX or rate <= EDGES_PER_FRAME_MAX * telemetry:
        return
    place = context.error_place("board.telemetry", "drive.encoder.slots", "limits.speed")
    cause = (
        f"at {speed:g} m/s there are {rate:.0f} edges per second but {telemetry:g} frames; a frame "
        "reports the time of one edge only, so the heading drifts"
    )
    slower = rounded_down(speed * EDGES_PER_FRAME_MAX * telemetry / rate)
    options = [f"set telemetry to {ceil(rate)} Hz"] if _can_send(context, ceil(rate)) else []
    options += [f"lower limits.speed to {slower:g} m/s"] if slower >= 0.05 else []
    options.append("set edge_times: false")
    context.warn("W-EDGES", place, cause, join_words(options))


def _can_send(context: CheckContext, rate: float) -> bool:
    """True when the board and its link can send `rate` frames per second with edge times."""
    maximum = declared(BoardSection)["telemetry"].bounds["maximum"]
    protocol = context.values("link.protocol")
    if rate > maximum or protocol is None or context.robot is None:
        return False
    frame = link_protocol.frame_bytes(protocol[0], True)
    capacity = link_protocol.capacity(line_baud(context.robot))
    return rate * frame <= link_protocol.TELEMETRY_LOAD_MAX * capacity


@check()
def check_glitch(context: CheckContext) -> None:
    """Compare the glitch time of each encoder with the shortest level at the rated speed."""
    if context.values("link.protocol") != ("diffbot",) or not has_encoders(context):
        return  # a rosserial board has no glitch filter that we could set
    if context.values("drive.left.encoder.channels") == (2,):
        return  # two channels need none
    paths = ("encoder.glitch", "encoder.slots", "motor.rated")
    values = {side: context.values(*(f"drive.{side}.{path}" for path in paths)) for side in SIDES}
    if values["left"] == values["right"]:
        del values["right"]
        title = "encoders keep"
    else:
        title = ""
    for side, value in values.items():
        if value is not None and value[2] <= RATED_SPEED_MAX_RAD_S:
            place = context.error_place(*(f"drive.{side}.{path}" for path in paths))
            path = f"drive.{side}.encoder.glitch" if not title else "glitch"
            stated = context.robot_value("drive", side, "encoder", "glitch")
            is_own = stated is not None and stated.place.source.is_own
            default = ", or leave it out for this default" if is_own else ""
            _check_side_glitch(
                context, title or f"{side} encoder keeps", place, (path, default), *value
            )


def _check_side_glitch(
    context: CheckContext,
    title: str,
    place: Place | str,
    key: tuple[str, str],
    glitch: float,
    slots: int,
    rated: float,
) -> None:
    """`key`: the key to set, and what else can be done with it."""
    level = shortest_level(slots, rated)
    if glitch <= GLITCH_WARNED_RATIO * level:
        return
    cause = (
        f"at the rated {rated / (2 * pi) * 60:.0f} rpm the {title} a level for "
        f"{level * 1000:.3g} ms, and a level shorter than {glitch * 1000:g} ms is not counted"
    )
    default = default_glitch(slots, rated) * 1e6
    fix = f"set {key[0]} to {max(1, floor(default))} us{key[1]}"
    if glitch > GLITCH_REFUSED_RATIO * level:
        context.error("E-GLITCH", place, f"{cause}: edges would be lost", fix)
    else:
        context.warn("W-GLITCH", place, f"{cause}: uneven slots would lose edges", fix)


@check("drive.polarity", "drive.left.encoder.channels")
def check_polarity(context: CheckContext, polarity: str, channels: int) -> None:
    """Warn of a real robot whose motor directions are not verified."""
    if not context.real or polarity != "unproven":
        return
    encoders = "and one-channel encoders cannot detect them"
    if channels == 2:
        encoders = "nor which of channels A and B is which"
    cause = (
        f"the directions of the motors are not verified, {encoders}; the speed is limited to "
        "0.1 m/s"
    )
    fix = (
        "run `diffbotctl calibrate encoders`, or check that both wheels turn in the right "
        "direction and set drive: {polarity: checked_by_hand}"
    )
    context.warn("W-POLARITY", context.robot_place("drive", "polarity"), cause, fix)


@check()
def check_speed(context: CheckContext) -> None:
    """Compare the speed limit with the wheels' rated speed."""
    rated = context.values(*RATED)
    if rated is not None and max(rated) > RATED_SPEED_MAX_RAD_S:
        _warn_of_rated_speed(context, max(rated))
    wheels = _rim_speeds(context)
    limit = context.values("limits.speed")
    if not wheels or limit is None or limit[0] <= min(wheels)[0]:
        return
    top_speed, rated_speed = min(wheels)
    rpm = rated_speed / (2 * pi) * 60
    cause = (
        f"the wheels reach {top_speed:.2g} m/s at their rated {rpm:.3g} rpm, not {limit[0]:g} m/s"
    )
    slower = _possible("speed", rounded_down(top_speed))
    fix = f"{slower}correct drive.motor.rated"
    place = context.error_place("limits.speed", *_rated_and_diameters())
    context.error("E-LIMIT-SPEED", place, cause, fix)


@check("limits.turn_rate", "drive.track")
def check_turn_rate(context: CheckContext, rate: float, track: float) -> None:
    """Warn of a turning speed far beyond that of both wheels at their rated speed."""
    wheels = _rim_speeds(context)
    if len(wheels) < len(SIDES):
        return
    top_rate = 2.0 * min(wheels)[0] / track
    if rate <= TURN_RATE_RATIO_MAX * top_rate:
        return
    cause = (
        f"the wheels turn the robot by at most {top_rate:.3g} rad/s ({degrees(top_rate):.3g} "
        f"deg/s), not {rate:g} rad/s ({degrees(rate):.0f} deg/s)"
    )
    fix = f"{_possible('turn_rate', rounded_down(top_rate))}write its unit"
    place = context.error_place("limits.turn_rate", "drive.track", *_rated_and_diameters())
    context.warn("W-LIMIT-TURN", place, cause, fix)


def _possible(limit: str, value: float) -> str:
    """The advice to set `limits.LIMIT` to `value`; empty where its declaration refuses that."""
    declaration = declared(LimitsSection)[limit]
    if declaration.complaint(value) is not None:
        return ""
    return f"set limits.{limit} to at most {value:g} {declaration.unit}, or "


def _rim_speeds(context: CheckContext) -> list[tuple[float, float]]:
    """Speed of the rim (m/s) at the rated speed (rad/s), and that, of each wheel with both."""
    return [
        (values[0] * values[1] / 2, values[0])
        for paths in zip(RATED, DIAMETERS, strict=True)
        if (values := context.values(*paths))
    ]


def _warn_of_rated_speed(context: CheckContext, rated: float) -> None:
    """A number without unit is in rad/s, but motor labels are in rpm."""
    cause = (
        f"{rated:.4g} rad/s is {rated / (2 * pi) * 60:.0f} rpm, too fast for a wheel driven by a "
        "gear motor"
    )
    fix = "state the speed of the wheel, after the gear, with its unit: `rated: 100 rpm`"
    place = context.error_place("drive.motor.rated", *_rated_and_diameters())
    context.warn("W-MOTOR-RATED", place, cause, fix)


def _rated_and_diameters() -> list[str]:
    return [path for paths in zip(RATED, DIAMETERS, strict=True) for path in paths]


@check("limits.speed")
def check_reach(context: CheckContext, speed: float) -> None:
    """Compare the stopping distance at full speed with the reach of each guarding sensor."""
    for name, block in context.block_classes.items():
        if issubclass(block, ObstacleStop) and name in context.parameters:
            _check_guard(context, name, block, speed)


def _lacks_reaction(context: CheckContext, name: str) -> bool:
    """Refuse a guard whose distances a source gives, and whose reaction is not stated.

    How often and how late a board sends them is known; of a source it is not.
    """
    wire = context.pipeline_value("blocks", name, "in", "range")
    converter = str(wire.data).partition(".")[0] if wire is not None else ""
    through = context.pipeline_value("blocks", converter, "in", "volts")
    given = [str(each.data) for each in (wire, through) if each is not None]
    source = next((each for each in given if each in context.inputs), None)
    if source is None or wire is None or context.parameters[name]["reaction"] is not None:
        return False
    cause = (
        f"the distances of '{name}' come from {source}; how often and how late they come is not "
        "known, so it cannot compute how far the robot drives until it brakes"
    )
    fix = (
        "state it: with: {reaction: 0.4 s}, the longest time from an obstacle in view to "
        "braking: two readings, the delay of a command, and the lag of the motors"
    )
    context.error("E-STOP-REACH", wire.place, cause, fix)
    return True


def _check_guard(context: CheckContext, name: str, block: type[ObstacleStop], speed: float) -> None:
    parameters, paths = context.parameters[name], robot_fields(block)
    margin, debounce = parameters["margin"], parameters["debounce"]
    values = context.values(*paths.values())
    if values is None or margin is None or debounce is None:
        return
    robot = dict(zip(paths, values, strict=True))
    if _lacks_reaction(context, name):
        return
    sensor = guard_sensor(robot["sensors"], parameters["sensor"])
    shortest = guard_reaction(robot["sensors"], sensor, robot["telemetry"], debounce)
    shortest += robot["command_delay"] + robot["lag"]
    reaction = shortest if parameters["reaction"] is None else parameters["reaction"]
    if reaction < shortest:
        cause = (
            f"a reaction of {reaction * 1000:.0f} ms is stated, but {debounce} readings of "
            f"'{sensor}', the delay of a command and the lag of the motors take "
            f"{shortest * 1000:.0f} ms: the robot would brake too late"
        )
        value = context.parameter_value(name, "reaction")
        place = value.place if value is not None else name
        context.error("E-STOP-REACH", place, cause, "remove `reaction`: it is then computed")
        return
    needed = stopping_distance(speed, robot["braking"], reaction)
    seen = sensor_reach(robot["sensors"], sensor)
    mounted = context.values(f"sensors.{sensor}.at.x", f"sensors.{sensor}.at.heading")
    if mounted:
        x, heading = mounted
        aside = remainder(heading, 2 * pi)  # one that looks farther aside is refused already
        ahead = cos(aside) if abs(aside) <= GUARD_ASIDE_MAX else 1.0
        seen = seen * ahead - (robot["front"] - x)
    if needed + margin <= seen:
        return
    cause = (
        f"from {speed:g} m/s it takes {needed * 100:.0f} cm to stop ({reaction * 1000:.0f} ms "
        f"to react, then braking); the sensor sees {max(seen, 0.0) * 100:.0f} cm ahead of the "
        "front"
    )
    safe_speed = max_safe_speed(seen - margin, robot["braking"], reaction)
    slower = _possible("speed", rounded_down(safe_speed)) if safe_speed > 0.0 else ""
    fix = slower.removesuffix(", or ") or (
        f"move '{sensor}' forward, or correct at.x of it, body.front or the margin of "
        f"{margin * 100:.0f} cm"
    )
    place = context.error_place(
        "limits.speed",
        "limits.braking",
        f"sensors.{sensor}.at.x",
        "board.telemetry",
        also=[
            context.pipeline_value("blocks", name, "with", parameter)
            for parameter in ("reaction", "margin", "debounce")
        ],
    )
    if needed > seen:
        context.error("E-STOP-REACH", place, cause, fix)
    else:
        nearer = f"it would stop closer than the margin of {margin * 100:.0f} cm"
        context.warn("W-STOP-REACH", place, f"{cause}: {nearer}", fix)


@check("drive.track", "body.width", *TYRE_WIDTHS, is_nominal=True)
def check_outline(context: CheckContext, track: float, width: float, *tyres: float) -> None:
    """Compare the body's width with the outer width of the tyres.

    The stated geometry is used: a calibrated track is the effective distance of the contact
    points, not of the tyres. So is that of four wheels.
    """
    if context.values("drive.wheelbase") is not None:
        return
    reach = track + max(tyres)
    if reach <= width + TYRE_WIDTH_TOLERANCE_M:
        return
    cause = (
        f"the tyres are {reach * 1000:.0f} mm wide from outside to outside, but body.width is "
        f"{width * 1000:.0f} mm: obstacle checks would use too narrow an outline"
    )
    fix = f"set body.width to {reach * 1000:.0f} mm, or correct drive.track or wheel.width"
    place = context.error_place("body.width", "drive.track", "drive.wheel.width", *TYRE_WIDTHS)
    context.warn("W-BODY-TYRES", place, cause, fix)


@check(*("drive.wheelbase", "drive.track", "body.width", "drive.left.wheel.width"), is_nominal=True)
def check_wheelbase(
    context: CheckContext, wheelbase: float, track: float, width: float, tyre: float
) -> None:
    """Warn of four driven wheels whose effective track is not calibrated.

    Slowly turning with the rate w, a wheel that rolls with v slides with v - w B / 2 along and
    w L / 2 across its direction (tyres B apart, axles L). Under equal load friction acts against
    the sliding alike in all directions, and its moments cancel: v = w (B + L2 / B) / 2. That is a
    robot with two wheels and the track B + L2 / B.
    """
    between = width - tyre
    is_calibrated = context.robot is None or TRACK in (context.robot.calibration or {})
    if between <= 0.0 or is_calibrated:
        return
    effective = between + wheelbase**2 / between
    cause = (
        f"four wheels slide sideways in turns: with tyres {between * 1000:.0f} mm and axles "
        f"{wheelbase * 1000:.0f} mm apart it turns as with a track of about "
        f"{effective * 1000:.0f} mm, by floor and load 20 % more or less; stated are "
        f"{track * 1000:.0f} mm"
    )
    fix = "measure it: `diffbotctl calibrate spin`; until then goals end `reached_unsure`"
    if declared(DriveSection)["track"].complaint(effective) is not None:
        fix = "such a robot hardly turns: correct drive.wheelbase, body.width or wheel.width"
    elif abs(track / effective - 1.0) > SKID_TRACK_SD:
        fix = f"set track: {effective * 1000:.0f} mm, then {fix}"
    context.warn("W-SKID-STEER", context.error_place("drive.track", "drive.wheelbase"), cause, fix)


def has_encoders(context: CheckContext) -> bool:
    """False for motors without encoders."""
    return context.values("drive.left.encoder.channels") != (0,)


@check()
def check_missing_encoders(context: CheckContext) -> None:
    """Refuse goals of a robot without encoders; otherwise warn of what does not work."""
    channels = [context.values(f"drive.{side}.encoder.channels") for side in SIDES]
    if (0,) not in channels:
        return
    missing = [side for side, each in zip(SIDES, channels, strict=True) if each == (0,)]
    place = context.error_place(*(f"drive.{side}.encoder.channels" for side in missing))
    if channels[0] != channels[1]:
        cause = "one wheel has an encoder, the other one has none"
        context.error("E-ENCODER-NONE", place, cause, "add the other one, or write none for both")
        return
    if context.values("link.protocol") == ("rosserial",):
        cause = "the book's firmware needs encoders"
        fix = "use ours: link: {protocol: diffbot}"
        context.error("E-ENCODER-NONE", place, cause, fix)
        return
    cause = (
        "without encoders the distance driven is estimated from the commands, with an error of "
        "up to a quarter of the distance"
    )
    for name, block in context.block_classes.items():
        if any(out.kind is GoalState for out in outputs(block).values()):
            fix = "drive by hand: `diffbotctl run teleop`; or add encoders"
            context.error("E-ENCODER-NONE", place, f"'{name}' cannot reach a goal: {cause}", fix)
            return
    fix = "driving by hand and for a time works; goals and calibration need encoders"
    context.warn("W-ENCODER-NONE", place, cause, fix)


@check(
    "drive.left.wheel.diameter",
    "drive.left.encoder.counts",
    "limits.speed",
    "board.edge_times",
    "link.protocol",
)
def check_tolerance(context: CheckContext, *values: Any) -> None:
    """Compare the tolerance of each block that has one with the odometry's resolution."""
    if not has_encoders(context):
        return
    stddev = resolution(*values)
    for name, block in context.block_classes.items():
        declaration = declared(block).get("tolerance")
        tolerance = context.parameters.get(name, {}).get("tolerance")
        if declaration is None or declaration.unit != "m" or tolerance is None:
            continue
        if tolerance < 2 * stddev:
            _report_tolerance(context, name, tolerance, stddev)


def resolution(
    diameter: float, counts: int, speed: float, has_edge_times: bool, protocol: str
) -> float:
    """Standard deviation in m of the estimated position along the path.

    A count alone leaves the position uniform from it to the next: pitch / sqrt(12). `counts`: per
    turn.
    """
    pitch = pi * diameter / counts
    if protocol == "rosserial":
        return hypot(pitch / sqrt(12), speed * STOCK_DELAY_SPREAD_S)
    return pitch / sqrt(12) * (EDGE_TIME_UNCERTAINTY_RATIO if has_edge_times else 1.0)


def _report_tolerance(context: CheckContext, name: str, tolerance: float, stddev: float) -> None:
    value = context.parameter_value(name, "tolerance")
    place = value.place if value else name
    fix = f"use {rounded_up(2000 * stddev):g} mm or more"
    reference = f"this robot's odometry resolution of {stddev * 1000:.1f} mm (standard deviation)"
    if tolerance < stddev:
        cause = f"{tolerance * 1000:g} mm is finer than {reference}"
        context.error("E-TOLERANCE", place, cause, fix)
    else:
        cause = (
            f"{tolerance * 1000:g} mm is close to {reference}, "
            "so some goals will need several attempts"
        )
        context.warn("W-TOLERANCE", place, cause, fix)
