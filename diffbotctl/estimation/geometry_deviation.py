"""What the unknown part of the geometry does to the pose.

Track and wheel diameters are wrong by the same amount for a whole run, so their effect on the pose
grows with the path and does not average out. It is followed to first order: the deviation of the
pose for one standard deviation of each independent error. The products of two deviations are the
covariance (propagation of errors, J P J').
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from math import sqrt
from typing import Any, NamedTuple, Protocol

from diffbotctl.units import quantity

# m; standard deviations of values that were measured with a ruler and not calibrated. A track is
# measured between the middles of two tyres, a diameter across one soft tyre.
RULER_TRACK_SD = 0.002
RULER_DIAMETER_SD = 0.001
# Relative standard deviation of the track at which four wheels turn, which floor and load decide.
SKID_TRACK_SD = 0.2
# Relative standard deviation of a tyre's diameter from that of its pair, not calibrated: moulded
# tyres of 65 mm differ by about 0.3 mm.
TYRE_RATIO_SD = 0.005

UNSEEN_RATIO = 0.5  # of the share of faults of the other encoder, at least

TRACK = "drive.track"
LEFT_DIAMETER, RIGHT_DIAMETER = "drive.left.wheel.diameter", "drive.right.wheel.diameter"
GEOMETRY = frozenset((TRACK, LEFT_DIAMETER, RIGHT_DIAMETER))
SLOTS = "drive.left.encoder.slots", "drive.right.encoder.slots"


def may_have_wrong_slots(calibration: Container[str]) -> bool:
    """Whether nothing has measured the slots: neither turns by hand, nor edges on a known way,
    whose diameters have the true slots in them."""
    return not any(
        all(field in calibration for field in fields)
        for fields in (SLOTS, (LEFT_DIAMETER, RIGHT_DIAMETER))
    )


class CalibratedValue(Protocol):
    """One entry of the section `calibration` of the robot file."""

    sd: Any
    own_sd: Any


class GeometryDeviation(NamedTuple):
    """One independent error of the geometry: relative to each value, one standard deviation."""

    track: float = 0.0
    left: float = 0.0
    right: float = 0.0


class PoseDeviation(NamedTuple):
    """Deviation of the pose (m, rad) in the frame odom that one error of the geometry causes."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def advanced(
        self,
        wider: float,
        longer: float,
        distance: float,
        track: float,
        direction: tuple[float, float],
    ) -> PoseDeviation:
        """The deviation after the robot travelled `distance` (m).

        The error makes the right wheel travel `wider` (m) more than the left one, and both together
        `longer` (m) more. `direction`: cosine and sine of the heading in the middle of the step.
        """
        x, y, heading = self
        c, s = direction
        turn = wider / track
        ahead = 0.5 * longer
        aside = distance * (heading + 0.5 * turn)
        return PoseDeviation(x + ahead * c - aside * s, y + ahead * s + aside * c, heading + turn)


def geometry_deviations(
    track: float,
    left: float,
    right: float,
    calibration: Mapping[str, CalibratedValue],
    is_skid_steered: bool = False,
) -> tuple[GeometryDeviation, ...]:
    """The independent errors of `track` and of both wheel diameters (m).

    A ruler's error is common to both diameters. So is the rest of their `sd` where the file states
    an `own_sd`, and then each own part is the deviation from the mean of both: what one wheel is
    larger by, the other one is smaller. A track with an `own_sd` was measured in multiples of the
    mean diameter and shares its error. Of other calibrated lengths the file does not tell how their
    errors are related; they are taken as independent. `is_skid_steered`: four wheels slide in
    turns. Raises UnitError for an `sd` that is no length.
    """
    left_entry, right_entry = calibration.get(LEFT_DIAMETER), calibration.get(RIGHT_DIAMETER)
    own_left, own_right = _own_sd(left_entry), _own_sd(right_entry)
    left_sd, right_sd = calibrated_sd(left_entry), calibrated_sd(right_entry)
    if own_left is not None and own_right is not None and left_sd and right_sd:
        scale = max(_rest(left_sd, own_left) / left, _rest(right_sd, own_right) / right)
        wheels = [GeometryDeviation(left=own_left / left, right=-own_right / right)]
        common = GeometryDeviation(left=scale, right=scale)
    else:
        wheels = [
            GeometryDeviation(left=TYRE_RATIO_SD if left_sd is None else left_sd / left),
            GeometryDeviation(right=TYRE_RATIO_SD if right_sd is None else right_sd / right),
        ]
        common = GeometryDeviation(
            left=RULER_DIAMETER_SD / left if left_sd is None else 0.0,
            right=RULER_DIAMETER_SD / right if right_sd is None else 0.0,
        )
    own_track = _own_sd(calibration.get(TRACK))
    track_sd = calibrated_sd(calibration.get(TRACK))
    if track_sd is None:
        track_sd = SKID_TRACK_SD * track if is_skid_steered else RULER_TRACK_SD
    if own_track is not None and common.left and common.right:
        track_sd = own_track
        common = common._replace(track=0.5 * (common.left + common.right))
    deviations = (GeometryDeviation(track=track_sd / track), *wheels, common)
    return tuple(deviation for deviation in deviations if any(deviation))


def _own_sd(entry: CalibratedValue | None) -> float | None:
    """Standard deviation of a calibrated length for an exact mean diameter, m; None where it is not
    stated."""
    if entry is None or entry.own_sd is None:
        return None
    return quantity(str(entry.own_sd), "m")


def _rest(sd: float, own_sd: float) -> float:
    return sqrt(max(sd * sd - own_sd * own_sd, 0.0))


def calibrated_sd(entry: CalibratedValue | None) -> float | None:
    """Standard deviation of a calibrated length, m; None where it is not stated."""
    if entry is None or entry.sd is None:
        return None
    return quantity(str(entry.sd), "m")


def combined(
    unit_effects: tuple[PoseDeviation, PoseDeviation, PoseDeviation],
    errors: Sequence[GeometryDeviation],
) -> list[tuple[float, float, float]]:
    """What each of `errors` of the geometry does to the pose (m, rad), from the effects of relative
    errors of 1 of the track, the left and the right diameter."""
    (track_x, track_y, track_heading), (left_x, left_y, left_heading), of_right = unit_effects
    right_x, right_y, right_heading = of_right
    return [
        (
            track * track_x + left * left_x + right * right_x,
            track * track_y + left * left_y + right * right_y,
            track * track_heading + left * left_heading + right * right_heading,
        )
        for track, left, right in errors
    ]


def fault_effects(
    unit_effects: tuple[PoseDeviation, PoseDeviation, PoseDeviation], left: float, right: float
) -> list[tuple[float, float, float]]:
    """Deviations of the pose (m, rad) by the shares of edges that were missed or counted twice.

    What makes one encoder miss edges is likely to make the other one miss them, too, where its
    counts have not shown it yet; and to do so in the same sense, which lengthens or shortens the
    whole path.
    """
    if not left and not right:
        return []
    left, right = max(left, UNSEEN_RATIO * right), max(right, UNSEEN_RATIO * left)
    common = GeometryDeviation(left=left, right=right)
    errors = common, GeometryDeviation(left=left), GeometryDeviation(right=right)
    return combined(unit_effects, errors)
