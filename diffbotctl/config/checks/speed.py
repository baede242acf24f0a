"""The motors can do what the limits allow, and are no faster than motors of such robots are."""

from __future__ import annotations

from math import pi

from diffbotctl.config.case import Case
from diffbotctl.config.sides import SIDES

FIELDS = ("motor.rated", "wheel.diameter")
FASTEST = 60.0  # rad/s, 573 rpm; who forgets to write rpm usually states more


def check(case: Case) -> None:
    """Compare the speed limit with the wheels' rated speed."""
    limit = case.known("limits.speed")
    wheels = [
        known[0] * known[1] / 2
        for side in SIDES
        if (known := case.known(f"drive.{side}.motor.rated", f"drive.{side}.wheel.diameter"))
    ]
    if not wheels:
        return
    top = min(wheels)
    rated = case.known(*(f"drive.{side}.motor.rated" for side in SIDES))
    if rated is not None and max(rated) > FASTEST:
        _warn(case, max(rated))
    if limit is None or limit[0] <= top:
        return
    rpm = top / _radius(case) / (2 * pi) * 60
    cause = f"the wheels reach {top:.2f} m/s at their rated {rpm:.0f} rpm, not {limit[0]:g} m/s"
    fix = f"set limits.speed to at most {int(top * 100) / 100:g} m/s, or correct drive.motor.rated"
    fields = [f"drive.{side}.{field}" for side in SIDES for field in FIELDS]
    case.error("E-LIMIT-SPEED", case.blame("limits.speed", *fields), cause, fix)


def _warn(case: Case, rated: float) -> None:
    """A bare number is in rad/s, and motors are sold in rpm."""
    cause = (
        f"{rated:.4g} rad/s are {rated / (2 * pi) * 60:.0f} rpm, more than a geared motor of such "
        "robots turns a wheel"
    )
    fields = [f"drive.{side}.{field}" for side in SIDES for field in FIELDS]
    fix = "it is the wheel's speed, behind the gear; write the unit: `rated: 100 rpm`"
    case.warn("W-MOTOR-RATED", case.blame("drive.motor.rated", *fields), cause, fix)


def _radius(case: Case) -> float:
    """The radius of the slower side's wheel."""
    radii = [
        (known[0] * known[1], known[1] / 2)
        for side in SIDES
        if (known := case.known(f"drive.{side}.motor.rated", f"drive.{side}.wheel.diameter"))
    ]
    return float(min(radii)[1])
