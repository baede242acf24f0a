"""Wheel diameters and track from recorded drives.

Clocks are aligned, wrong drives are left out, and the posterior of the geometry is computed from
the rest. A fit that proves nothing is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, expm1, hypot, inf, log
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.clock_offset import CLOCK_OFFSET_MAX_S, clock_offset, delay_counts
from diffbotctl.calibrate.confidence import Confidence, confidence
from diffbotctl.calibrate.dead_reckoning import (
    MOTION_CAPTURE,
    SEGMENT_OVERLAP,
    Geometry,
    RecordedDrive,
    drive_segments,
    end_error,
    flattened,
)
from diffbotctl.calibrate.end_conventions import (
    BAD_DRIVES_RATIO_MAX,
    CONVENTIONS,
    HALF_WIDTH_MAX,
    SEARCH_SEGMENTS_MAX,
    plausible_geometry,
    refuse_convention,
    scale_covariance,
)
from diffbotctl.calibrate.end_noise import CAMERA_NOISE, TAPE_NOISE, NoiseGrid
from diffbotctl.calibrate.geometry_posterior import (
    DIAMETER_SD,
    RATIO_SD,
    TRACK_SD,
    GeometryPrior,
    Posterior,
    Solution,
    posterior,
    solve,
)
from diffbotctl.calibrate.known_lengths import is_scale_measured, known_scale_sd
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK, Finding
from diffbotctl.config.robot import Robot

NAMES_SHOWN_MAX = 4

SEGMENTS_MAX = 600
DIAMETER_SD_MIN = 0.001  # relative: another floor, another load
# Relative standard deviation of all lengths that one tape measures: its class (0.05 %), and that it
# hangs, or does not lie along the axis. No drive shows it.
TAPE_SCALE = np.array([0.001, 0.0, 0.001])  # of mean diameter, ratio and track
# Expected noise of the places, to the largest that the fit averages over: beyond, the ends differ
# from any geometry by what no person with a tape misreads (14 mm), nor a camera (4 mm).
POSITION_NOISE_RATIO_MAX = 0.5
SEEN_SD_RATIO = 0.5  # of the prior's; above, the drives do not determine the mean diameter
# Of the values that a ruler states. Moulded tyres differ by 0.5 %; that they differ by 5 % is an
# encoder that misses edges. A tyre is at most some per cent smaller under its load; 6 % is a wrong
# unit of length, or a wrong number of slots. Tracks are measured at the edges of wide tyres too.
MEAN_LOG_MAX, RATIO_LOG_MAX, TRACK_LOG_MAX = log(1.06), log(1.05), log(1.35)
# Of one wheel that differs much more than the other one, beyond twice the error of a ruler.
WHEEL_LOG_MAX, OTHER_WHEEL_RATIO_MAX = log(1.04), 0.6
# Of the track over the stated one, from drives that show only its ratio to the diameters: twice
# the error of a ruler across two tyres, 2 mm of 125 mm.
UNSEEN_TRACK_LOG_MAX = 0.032
EXCLUDED_SDS = 2.5  # of the mean diameter from that which would explain the track

USUAL_SDS = (0.02, 0.08)  # of ratio and track, as users state them: decides between hypotheses


class Outlier(NamedTuple):
    """A drive that was left out."""

    name: str
    ratio: float  # of its end error to the usual one


class GeometryFit(NamedTuple):
    """The result of a fit."""

    stated: Geometry
    geometry: Geometry
    confidence: Confidence
    drives: list[RecordedDrive]  # the drives used, with clocks aligned
    offsets: list[float]  # s; delay added to the counts of each drive used
    outliers: list[Outlier]
    sees_diameter: bool
    """False: the drives do not determine the mean diameter, which was kept as stated"""


def fit_geometry(
    drives: Sequence[RecordedDrive], stated: Geometry, mean_sd: float | None = None
) -> GeometryFit:
    """Fit the geometry to `drives`, starting from the `stated` one.

    `mean_sd`: relative standard deviation of the stated mean diameter; None: not known. Raises
    ValueError with the reason if the files contain a mistake, or the drives do not determine the
    geometry.
    """
    if not drives:
        raise ValueError("no drives to fit to")
    sd = DIAMETER_SD if mean_sd is None else mean_sd
    prior = GeometryPrior(stated, (sd, RATIO_SD, TRACK_SD))
    usual_prior = GeometryPrior(stated, (sd, *USUAL_SDS))
    plain = plausible_geometry(drives, usual_prior)
    offsets = [clock_offset(drive, plain.geometry) for drive in drives]
    _refuse_other_clocks(drives, offsets)
    aligned = [
        delay_counts(drive, offset) if offset else drive
        for drive, offset in zip(drives, offsets, strict=True)
    ]
    noise = _noise(drives)
    kept = _good_drives(aligned, plain, prior, noise)
    used = [aligned[number] for number in kept]

    groups = drive_segments(used, stated, SEGMENTS_MAX, SEGMENT_OVERLAP)
    segments, weights = flattened(groups)
    solution = solve(segments, weights, plain.geometry, prior, noise)
    result = posterior(segments, weights, solution.geometry, prior, noise)
    sees_diameter = bool(result.covariance[0, 0] ** 0.5 < SEEN_SD_RATIO * sd)
    mean_log, mean_log_sd = _mean_by_drives(result, prior)
    if not sees_diameter:
        result = result.with_mean(stated.mean)
    if noise is TAPE_NOISE:
        scales = scale_covariance(aligned, usual_prior, plain.geometry)
        result = result.wider(scales).wider(np.outer(TAPE_SCALE, TAPE_SCALE))
    if result.noise.position[0] > POSITION_NOISE_RATIO_MAX * noise.position.max():
        refuse_convention(drives, prior, plain, CONVENTIONS)
        raise _unexplained(used, drives)
    fit = GeometryFit(
        stated,
        result.geometry,
        confidence(result, [len(group) for group in groups], segments, weights),
        used,
        [offsets[number] for number in kept],
        _outliers(aligned, kept, result.geometry),
        sees_diameter,
    )
    _refuse_other_size(fit, prior)
    _refuse_unproven(fit, prior)
    if mean_sd is None and not sees_diameter:
        _refuse_other_wheels(fit, mean_log, mean_log_sd)
    return fit


def diameter_sd(robot: Robot) -> float | None:
    """Relative standard deviation of the mean diameter, where it was calibrated."""
    if not is_scale_measured(robot):
        return None
    return min(max(known_scale_sd(robot), DIAMETER_SD_MIN), DIAMETER_SD)


def geometry_findings(fit: GeometryFit) -> list[Finding]:
    """Both diameters and the track, with their standard deviations.

    A wheel's own part is that of the ratio; the track's own part is that of the track in multiples
    of the mean diameter, which is what turns depend on.
    """
    geometry, errors = fit.geometry, fit.confidence
    share = geometry.left / (geometry.right + geometry.left)  # of the ratio in the right wheel
    lengths = (
        (RIGHT_DIAMETER, geometry.right, errors.right.sd, share * errors.ratio.sd),
        (LEFT_DIAMETER, geometry.left, errors.left.sd, (1 - share) * errors.ratio.sd),
        (TRACK, geometry.track, errors.track.sd, errors.track_over_mean.sd),
    )
    # The part is larger than the whole where both errors partly cancel each other.
    return [
        Finding(field, length, length * max(sd, own), length * own)
        for field, length, sd, own in lengths
    ]


def _unexplained(bad: Sequence[RecordedDrive], drives: Sequence[RecordedDrive]) -> ValueError:
    """The error for drives without an explanation."""
    names = ", ".join(drive.name for drive in bad[:NAMES_SHOWN_MAX])
    more = ", ..." if len(bad) > NAMES_SHOWN_MAX else ""
    return ValueError(
        f"no geometry near the stated one explains {len(bad)} of {len(drives)} drives "
        f"({names}{more}): are their ends or poses of the same drives, measured from the start, x "
        "ahead and y to the left in metres, and headings counter-clockwise in the unit of their "
        "column, and did both encoders count all the time, forward positive, `slots` a turn?"
    )


def _refuse_other_clocks(drives: Sequence[RecordedDrive], offsets: Sequence[float]) -> None:
    """Raises ValueError if the clocks of poses and counts differ by too much in many drives."""
    late = [
        drive.name
        for drive, offset in zip(drives, offsets, strict=True)
        if abs(offset) > 0.99 * CLOCK_OFFSET_MAX_S
    ]
    if len(late) > BAD_DRIVES_RATIO_MAX * len(drives):
        raise ValueError(
            f"the true poses of {len(late)} of {len(drives)} drives, such as {late[0]}, come "
            f"{CLOCK_OFFSET_MAX_S:g} s or more before or after their counts: write the times of "
            "one clock"
        )


def _noise(drives: Sequence[RecordedDrive]) -> NoiseGrid:
    is_camera = all(drive.truth is MOTION_CAPTURE for drive in drives)
    return CAMERA_NOISE if is_camera else TAPE_NOISE


def _good_drives(
    drives: Sequence[RecordedDrive], rough: Solution, prior: GeometryPrior, noise: NoiseGrid
) -> list[int]:
    """Indices of the drives that agree. Raises ValueError if too few do."""
    groups = drive_segments(drives, prior.stated, SEARCH_SEGMENTS_MAX, 1)
    segments, weights = flattened(groups)
    good = solve(segments, weights, rough.geometry, prior, noise).good
    ends = np.cumsum([len(group) for group in groups])[:-1]
    kept = [
        number for number, part in enumerate(np.split(good, ends)) if float(np.median(part)) >= 0.5
    ]
    if len(drives) - len(kept) > BAD_DRIVES_RATIO_MAX * len(drives):
        bad = [drive for number, drive in enumerate(drives) if number not in kept]
        refuse_convention(drives, prior, rough, CONVENTIONS)
        raise _unexplained(bad, drives)
    return kept


def _outliers(
    drives: Sequence[RecordedDrive], kept: Sequence[int], geometry: Geometry
) -> list[Outlier]:
    errors = [end_error(drive, geometry) for drive in drives]
    distances = [hypot(error.x, error.y) for error in errors]
    usual = max(float(np.median([distances[number] for number in kept])), 1e-4)
    return [
        Outlier(drive.name, distances[number] / usual)
        for number, drive in enumerate(drives)
        if number not in kept
    ]


def _refuse_other_size(fit: GeometryFit, prior: GeometryPrior) -> None:
    """Raises ValueError if both wheels have another size than any ruler leaves."""
    mean = float(prior.offset(fit.geometry)[0])
    if abs(mean) > MEAN_LOG_MAX:
        raise ValueError(
            f"the fit has wheels of {exp(mean):.3f} times the stated size, which is not plausible: "
            "are x and y in metres, and is `slots` the number of counts per turn? Measure the "
            "wheels, and correct the robot file first"
        )


def _refuse_unproven(fit: GeometryFit, prior: GeometryPrior) -> None:
    """Raises ValueError for a fit that is loose or implausible."""
    errors = fit.confidence
    names = {
        "right wheel diameter": errors.right,
        "left wheel diameter": errors.left,
        "track": errors.track,
        "right over left": errors.ratio,
    }
    for name, interval in names.items():
        if interval.half_width > HALF_WIDTH_MAX:
            raise ValueError(
                f"these drives determine the {name} only to +- {100 * interval.half_width:.0f} % "
                f"(limit {100 * HALF_WIDTH_MAX:.0f} %): add longer drives, to the left and to the "
                "right, with the heading of each end"
            )
    mean, ratio, track = prior.offset(fit.geometry)
    if abs(track) > TRACK_LOG_MAX:
        raise ValueError(
            f"the fit has a track of {exp(track):.2f} times the stated one, which is not "
            "plausible: measure wheels and track, and correct the robot file first"
        )
    _refuse_odd_wheel(mean, ratio)


def _refuse_odd_wheel(mean: float, ratio: float) -> None:
    """Raises ValueError if one wheel differs so much from the stated one that its encoder is the
    likely cause. `mean`, `ratio`: logarithms of the fitted over the stated ones.

    An encoder that misses edges makes its wheel look larger, and the mean diameter by half of that;
    one whose edges bounce makes it look smaller.
    """
    logs = {"right": mean + ratio / 2, "left": mean - ratio / 2}
    odd, other = sorted(logs, key=lambda wheel: -abs(logs[wheel]))
    is_odd = abs(logs[odd]) > WHEEL_LOG_MAX
    is_alone = abs(logs[other]) < OTHER_WHEEL_RATIO_MAX * abs(logs[odd])
    if abs(ratio) <= RATIO_LOG_MAX and not (is_odd and is_alone):
        return
    percent, size = 100 * abs(expm1(logs[odd])), "larger" if logs[odd] > 0.0 else "smaller"
    large, small = ("right", "left") if ratio > 0.0 else ("left", "right")
    raise ValueError(
        f"the fit has a {odd} wheel {percent:.0f} % {size} than stated, and a wheel ratio of "
        f"{exp(ratio):.3f} times the stated one, which is not plausible: does the {large} encoder "
        f"miss edges, or does the {small} one count edges twice? `diffbotctl calibrate encoders` "
        "counts both. If they are right, check the tape, measure the wheels, and correct the robot "
        "file first"
    )


def _mean_by_drives(result: Posterior, prior: GeometryPrior) -> tuple[float, float]:
    """Logarithm of the mean diameter over the stated one without its prior, and its standard
    deviation; infinite if the drives show nothing of it."""
    posterior_precision = 1 / float(result.covariance[0, 0])
    precision = posterior_precision - 1 / prior.sds[0] ** 2
    if precision <= 0.0:
        return 0.0, inf
    change = float(prior.offset(result.geometry)[0])
    return change * posterior_precision / precision, precision**-0.5


def _refuse_other_wheels(fit: GeometryFit, mean_log: float, mean_log_sd: float) -> None:
    """Raises ValueError if the track is wrong, or wheels of unmeasured size are.

    Drives that end where they began show the track in multiples of what a count rolls. Wrong slots
    look like a wrong track there. `mean_log`: of the mean diameter over the stated one by the
    drives alone, with its standard deviation.
    """
    change = log(fit.geometry.track / fit.stated.track)
    # Drives that contradict the stated wheels too exclude nothing: the prior holds the fit there,
    # where its derivatives tell little about other wheels.
    limit = EXCLUDED_SDS * mean_log_sd
    is_excluded = abs(mean_log) <= limit < abs(mean_log + change)
    if is_excluded or abs(change) <= UNSEEN_TRACK_LOG_MAX:
        return
    words = ("larger", "smaller", "more") if change > 0.0 else ("smaller", "larger", "fewer")
    track, wheels, counts = words
    percent = 100 * abs(change)
    raise ValueError(
        f"either the track is {percent:.0f} % {track} than stated, or the wheels are {percent:.0f} "
        f"% {wheels}, or they give {percent:.0f} % {counts} counts per turn: drives that end near "
        "their start do not show which. Add a straight drive of a metre or more with its end, or "
        "run `diffbotctl calibrate distance` first"
    )
