"""From what a job found to the fields of the robot file that hold it."""

from __future__ import annotations

from diffbotctl.calibrate.findings import Finding
from diffbotctl.calibrate.fit import Fit

RIGHT, LEFT = "drive.right.wheel.diameter", "drive.left.wheel.diameter"
TRACK = "drive.track"


def of_fit(fit: Fit) -> list[Finding]:
    """Both diameters and the track, with what the drives leave open."""
    found, sure = fit.geometry, fit.confidence
    return [
        Finding(RIGHT, found.right, found.right * sure.right.sd),
        Finding(LEFT, found.left, found.left * sure.left.sd),
        Finding(TRACK, found.track, found.track * sure.track.sd),
    ]
