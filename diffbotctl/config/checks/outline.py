"""The stated outline holds the tyres: guards, map and model go by it."""

from __future__ import annotations

from diffbotctl.config.case import Case
from diffbotctl.config.sides import SIDES

TYRES = tuple(f"drive.{side}.wheel.width" for side in SIDES)
SLACK = 0.002  # m; a rule across two soft tyres is read no better


def check(case: Case) -> None:
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
