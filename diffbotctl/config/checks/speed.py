"""The motors can do what the limits allow."""

from __future__ import annotations

from math import pi

from diffbotctl.config.case import Case
from diffbotctl.config.sides import SIDES

FIELDS = ("motor.rated", "wheel.diameter")


def check(case: Case) -> None:
    """Compare the speed limit with the wheels' rated speed."""
    limit = case.known("limits.speed")
    wheels = [
        known[0] * known[1] / 2
        for side in SIDES
        if (known := case.known(f"drive.{side}.motor.rated", f"drive.{side}.wheel.diameter"))
    ]
    if limit is None or not wheels or limit[0] <= min(wheels):
        return
    top = min(wheels)
    rpm = top / _radius(case) / (2 * pi) * 60
    cause = f"the wheels reach {top:.2f} m/s at their rated {rpm:.0f} rpm, not {limit[0]:g} m/s"
    fix = f"set limits.speed to at most {int(top * 100) / 100:g} m/s, or correct drive.motor.rated"
    fields = [f"drive.{side}.{field}" for side in SIDES for field in FIELDS]
    case.error("E-LIMIT-SPEED", case.blame("limits.speed", *fields), cause, fix)


def _radius(case: Case) -> float:
    """The radius of the slower side's wheel."""
    radii = [
        (known[0] * known[1], known[1] / 2)
        for side in SIDES
        if (known := case.known(f"drive.{side}.motor.rated", f"drive.{side}.wheel.diameter"))
    ]
    return float(min(radii)[1])
