"""One-channel encoders cannot see a motor that turns the wrong way."""

from __future__ import annotations

from diffbotctl.config.case import Case


def check(case: Case) -> None:
    """Before a real robot moves: has anyone seen its wheels turn the right way?"""
    known = case.known("drive.polarity", "drive.left.encoder.channels")
    if not case.real or known is None or known != ("unproven", 1):
        return
    cause = (
        "nobody has seen yet that both motors turn the right way, and one-channel encoders "
        "cannot tell: the robot is held to 0.1 m/s"
    )
    fix = "run `diffbotctl calibrate encoders`, or set drive: {polarity: by_hand} when you have"
    case.warn("W-POLARITY", case.robot_place("drive", "polarity"), cause, fix)
