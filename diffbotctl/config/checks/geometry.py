"""The stated outline holds the tyres: guards, map and model go by it.

A goal's tolerance is no finer than the odometry can tell.
"""

from __future__ import annotations

from math import hypot, pi, sqrt

from diffbotctl.config.check_context import CheckContext
from diffbotctl.config.drive_sides import SIDES
from diffbotctl.errors import Place
from diffbotctl.params import declared

TYRES = tuple(f"drive.{side}.wheel.width" for side in SIDES)
SLACK = 0.002  # m; a rule across two soft tyres is read no better


def check_outline(case: CheckContext) -> None:
    """Compare the body's width with what the tyres reach, by the stated geometry: a calibrated
    track tells where tyres seem to touch, not how far they reach."""
    tyres = case.stated(*TYRES)
    stated = case.stated("drive.track", "body.width")
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
    case.warn("W-BODY-TYRES", case.blame(*fields), cause, fix)


# Share of a slot's uncertainty that is left when the board tells when each edge came: the slots'
# own unevenness and the motor's unmodelled part (a study of 300 simulated robots).
WITH_EDGE_TIMES = 0.5
# s; how much the moment scatters at which a rosserial board hears a command: the robot drives on
# for so long with what it was told before.
STOCK_DELAY_SPREAD = 0.025


def check_tolerance(case: CheckContext) -> None:
    """Compare the tolerance of each block that has one with the odometry's resolution."""
    known = case.known(
        "drive.left.wheel.diameter",
        "drive.left.encoder.slots",
        "limits.speed",
        "board.edge_times",
        "link.protocol",
    )
    if known is None:
        return
    finest = resolution(*known)
    for name, kind in case.kinds.items():
        setting = declared(kind).get("tolerance")
        if setting is None or setting.unit != "m":
            continue
        tolerance = case.values.get(name, {}).get("tolerance")
        if tolerance is not None and tolerance < 2 * finest:
            _complain(case, name, tolerance, finest)


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


def _complain(case: CheckContext, name: str, tolerance: float, finest: float) -> None:
    value = case.at("blocks", name, "with", "tolerance") or case.at("blocks", name)
    place: Place | str = value.spot if value else name
    cause = (
        f"{tolerance * 1000:g} mm is finer than this robot can tell: with its slots and board "
        f"its place is known to {finest * 1000:.1f} mm (standard deviation)"
    )
    fix = f"{2000 * finest:.0f} mm or more is reliable"
    if tolerance < finest:
        case.error("E-TOLERANCE", place, cause, fix)
    else:
        cause = cause.replace("is finer than", "is about as fine as")
        case.warn("W-TOLERANCE", place, f"{cause}, so some goals will need several tries", fix)
