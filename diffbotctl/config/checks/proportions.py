"""Checks of wheels and encoders against the size of the robot: what can be driven by odometry."""

from __future__ import annotations

from math import ceil, floor, pi

from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.robot import SIDES
from diffbotctl.errors import Place
from diffbotctl.links.diffbot_frames import SLOTS_MAXIMUM

DIAMETER_TRACK_RATIO_MAX = 1.2
# Travel of a wheel in one count: at 0.2 tracks one count turns the robot by 11 degrees.
PITCH_TRACK_RATIO_MAX = 0.2
# Counted edges per second of one encoder while the other turns as fast. An edge of one channel
# takes 4 us of a board's time. What a board counts of two channels stands in its table.
EDGE_RATE_MAX_HZ = 20_000
ROUNDING = 1.001


@check()
def check_proportions(context: CheckContext) -> None:
    """Compare diameters and counts of both wheels with the track, and edges with the board."""
    for side in SIDES:
        if context.values(f"drive.{side}.encoder.channels") == (0,):
            continue
        paths = [
            "drive.track",
            f"drive.{side}.wheel.diameter",
            f"drive.{side}.encoder.slots",
            f"drive.{side}.encoder.counts",
            f"drive.{side}.motor.rated",
        ]
        values = context.nominal_values(*paths)
        if values is None:
            continue
        track, diameter, slots, counts, rated = values
        place = context.error_place(
            f"drive.{side}.wheel.diameter", "drive.wheel.diameter", "drive.track"
        )
        if diameter > ROUNDING * DIAMETER_TRACK_RATIO_MAX * track:
            _report_diameter(context, place, diameter, track)
            return
        place = context.error_place(f"drive.{side}.encoder.slots", "drive.encoder.slots")
        if pi * diameter / counts > ROUNDING * PITCH_TRACK_RATIO_MAX * track:
            _report_pitch(context, place, pi * diameter, counts, track)
            return
        if counts > SLOTS_MAXIMUM:
            _report_counts(context, place, slots, counts)
            return
        limit = _rate_limit(context, side)
        if rated * slots / (2 * pi) > ROUNDING * limit:
            _report_rate(context, place, slots, rated, limit)
            return


def _rate_limit(context: CheckContext, side: str) -> int:
    """Slots per second that the board counts of this encoder."""
    board = context.board
    has_two = context.values(f"drive.{side}.encoder.channels") == (2,)
    return board.slot_rate if board and has_two else EDGE_RATE_MAX_HZ


def _report_diameter(
    context: CheckContext, place: Place | str, diameter: float, track: float
) -> None:
    cause = (
        f"wheels of {diameter * 1000:.0f} mm on a track of {track * 1000:.0f} mm: small errors of "
        "a wheel's angle turn the robot so far that odometry is useless"
    )
    least = diameter / DIAMETER_TRACK_RATIO_MAX
    fix = (
        f"correct drive.wheel.diameter or drive.track; the track must be {least * 1000:.0f} mm or "
        "more for these wheels"
    )
    context.error("E-WHEEL-SIZE", place, cause, fix)


def _report_pitch(
    context: CheckContext, place: Place | str, rim: float, counts: int, track: float
) -> None:
    cause = (
        f"with {counts} counts per turn a wheel travels {rim / counts * 1000:.0f} mm from one "
        f"count to the next, more than {PITCH_TRACK_RATIO_MAX:g} of the track of "
        f"{track * 1000:.0f} mm"
    )
    least = ceil(rim / (PITCH_TRACK_RATIO_MAX * track))
    fix = (
        f"use discs with {least} slots or more, or correct encoder.slots: those per turn of the "
        "wheel, not of the motor"
    )
    context.error("E-ENCODER-COARSE", place, cause, fix)


def _report_counts(context: CheckContext, place: Place | str, slots: int, counts: int) -> None:
    of_slot = counts // slots
    cause = (
        f"{slots:,} slots per turn are {counts:,} counts: the board counts {of_slot} edges of a "
        f"slot, and keeps at most {SLOTS_MAXIMUM:,} counts per turn"
    )
    fix = f"use an encoder with at most {SLOTS_MAXIMUM // of_slot:,} slots per turn of the wheel"
    context.error("E-ENCODER-FAST", place, cause, fix)


def _report_rate(
    context: CheckContext, place: Place | str, slots: int, rated: float, limit: int
) -> None:
    rate = rated * slots / (2 * pi)
    which = context.board.with_article if context.board else "a board"
    cause = (
        f"{slots:,} slots per turn at {rated * 60 / (2 * pi):.0f} rpm are {rate:,.0f} edges per "
        f"second, more than the {limit:,} that {which} counts"
    )
    most = floor(2 * pi * limit / rated)
    fix = f"use an encoder with at most {most:,} slots per turn, or correct encoder.slots or rated"
    context.error("E-ENCODER-FAST", place, cause, fix)
