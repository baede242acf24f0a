"""Edges come no faster than frames: a frame tells the time of one edge of each wheel."""

from __future__ import annotations

from math import pi

from diffbotctl.config.case import Case

# Edges a frame at full speed. Odometry tells which slot an edge belongs to from the one before it;
# simulated robots with twice as many lost their heading by ten degrees and more.
MOST = 1.25


def check(case: Case) -> None:
    """Compare the edges at full speed with the frames that a board with edge times sends."""
    known = case.known(
        "board.edge_times", "board.telemetry", "drive.left.wheel.diameter",
        "drive.left.encoder.slots", "limits.speed",
    )  # fmt: skip
    if known is None:
        return
    has_edge_times, telemetry, diameter, slots, speed = known
    rate = speed / (pi * diameter) * slots
    if not has_edge_times or rate <= MOST * telemetry:
        return
    place = case.blame("board.telemetry", "drive.encoder.slots", "limits.speed")
    cause = (
        f"at {speed:g} m/s {rate:.0f} edges come each second and {telemetry:g} frames: a frame "
        "tells the time of one edge alone, and the heading drifts"
    )
    fix = f"telemetry: {rate:.0f} Hz, or a lower limits.speed, or edge_times: false"
    case.warn("W-EDGES", place, cause, fix)
