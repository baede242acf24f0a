"""Noise of the measured ends of drives, which is not known beforehand.

An end differs from dead reckoning by the slip of the wheels, by the reading of the position and of
the heading, and by how the robot stood at its start: a heading error there rotates the whole drive.
Four to ten drives hardly determine these four standard deviations, so the fit does not choose them.
It averages over a grid of them, each weighted by its prior and by how likely it makes the ends
(MacKay, "Information Theory, Inference and Learning Algorithms", 2003, ch. 24). That gives the
heavier tails of Student's t where there are few drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import log, pi, radians

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, Segment, dead_reckon, wrap_angle

UNKNOWN_VARIANCE = 1e6  # m^2 or rad^2, of what was not measured


@dataclass(frozen=True, slots=True)
class NoisePrior:
    """A lognormal prior of one standard deviation."""

    typical: float
    factor: float  # one standard deviation of the logarithm, as a factor
    values: tuple[float, ...]  # of the grid

    def log_weights(self) -> list[float]:
        """Of the values, not normalized."""
        return [-0.5 * (log(value / self.typical) / log(self.factor)) ** 2 for value in self.values]


# m per square root of m: from rubber on linoleum to plastic tyres on tiles.
SLIP = NoisePrior(0.0005, 2.5, (0.00012, 0.0003, 0.0007, 0.0016, 0.0035))
# Of a person with a tape and a set square.
POSITION = NoisePrior(0.003, 3.0, (0.0003, 0.001, 0.002, 0.0035, 0.006, 0.010, 0.017, 0.028))
HEADING = NoisePrior(
    radians(1.5), 2.5, tuple(radians(angle) for angle in (0.1, 0.4, 0.9, 1.8, 3.2, 5.5, 9.0))
)
START = NoisePrior(radians(0.3), 2.5, tuple(radians(angle) for angle in (0.05, 0.3, 0.8, 2.0)))
# Of a motion capture system: the poses are exact, so the slip decides.
CAMERA_POSITION = NoisePrior(0.001, 2.0, (0.0003, 0.001, 0.003, 0.008))
CAMERA_HEADING = NoisePrior(
    radians(0.2), 2.0, tuple(radians(angle) for angle in (0.05, 0.2, 0.6, 1.5))
)


@dataclass(frozen=True, slots=True)
class NoiseGrid:
    """All combinations of four standard deviations, (combinations,) each."""

    slip: Floats
    position: Floats
    heading: Floats
    start: Floats
    log_prior: Floats

    @classmethod
    def of(cls, *priors: NoisePrior) -> NoiseGrid:
        """The grid of the priors of slip, position, heading and start."""
        columns = np.array(list(product(*(prior.values for prior in priors)))).T
        weights = np.array(
            [sum(each) for each in product(*(prior.log_weights() for prior in priors))]
        )
        slip, position, heading, start = columns
        log_prior = weights - np.logaddexp.reduce(weights)
        return cls(slip, position, heading, start, log_prior)

    def expected(self, share: Floats) -> NoiseGrid:
        """One combination, with the expected variances; `share` (combinations,) of probability."""
        grid = (self.slip, self.position, self.heading, self.start)
        slip, position, heading, start = (np.array([(share @ sds**2) ** 0.5]) for sds in grid)
        return NoiseGrid(slip, position, heading, start, np.zeros(1))


TAPE_NOISE = NoiseGrid.of(SLIP, POSITION, HEADING, START)
CAMERA_NOISE = NoiseGrid.of(SLIP, CAMERA_POSITION, CAMERA_HEADING, CAMERA_HEADING)
# Coarse, for the search among hypotheses.
SEARCH_NOISE = NoiseGrid.of(
    NoisePrior(0.0005, 2.5, (0.0006, 0.0028)),
    NoisePrior(0.003, 3.0, (0.001, 0.004, 0.012, 0.03)),
    NoisePrior(radians(1.5), 2.5, tuple(radians(angle) for angle in (0.3, 1.5, 4.0, 9.0))),
    NoisePrior(radians(0.3), 2.5, tuple(radians(angle) for angle in (0.3, 1.5))),
)


@dataclass(frozen=True, slots=True)
class Linearized:
    """End errors of all segments at one geometry, and their derivatives."""

    residuals: Floats
    """(segments, 3): dead-reckoned minus measured end, m, m, rad; 0 where it was not measured"""
    jacobians: Floats  # (segments, 3, 3): by the logarithms of mean diameter, wheel ratio and track
    slip: Floats  # (segments, 3, 3): covariance if each wheel slips by 1 m per square root of m
    counts: Floats  # (segments, 3, 3)
    lever: Floats  # (segments, 3): derivatives of the measured end by the heading of the start
    known: NDArray[np.bool_]  # (segments, 3): whether it was measured

    def covariances(self, noise: NoiseGrid) -> Floats:
        """(combinations, segments, 3, 3)"""
        diagonal = np.zeros((len(noise.slip), len(self.residuals), 3))
        diagonal[:, :, :2] = noise.position[:, None, None] ** 2
        diagonal[:, :, 2] = noise.heading[:, None] ** 2
        diagonal[:, ~self.known] = UNKNOWN_VARIANCE
        lever = self.lever[:, :, None] * self.lever[:, None, :]
        return np.asarray(
            diagonal[..., None] * np.eye(3)
            + self.counts
            + noise.slip[:, None, None, None] ** 2 * self.slip
            + noise.start[:, None, None, None] ** 2 * lever
        )

    def log_densities(self, covariances: Floats) -> Floats:
        """(combinations, segments): of the residuals."""
        solved = np.linalg.solve(covariances, self.residuals[None, :, :, None])[..., 0]
        chi2 = (self.residuals * solved).sum(axis=2)
        _, log_determinant = np.linalg.slogdet(covariances)
        return np.asarray(-0.5 * (chi2 + log_determinant + 3 * log(2 * pi)))


def linearize(segments: Sequence[Segment], geometry: Geometry) -> Linearized:
    """The end errors of `segments` near `geometry`."""
    logs = log_jacobian(geometry)
    columns: list[list[Floats]] = [[], [], [], [], []]
    for segment in segments:
        reckoned = dead_reckon(segment, geometry)
        residual = reckoned.end - segment.motion
        residual[2] = wrap_angle(residual[2])
        lever = np.array([-reckoned.end[1], reckoned.end[0], 1.0])
        parts = (residual, reckoned.jacobian @ logs, reckoned.slip, reckoned.counts, lever)
        for column, part in zip(columns, parts, strict=True):
            column.append(part)
    residuals, jacobians, slip, counts, levers = (np.array(column) for column in columns)
    known = np.isfinite(residuals)
    return Linearized(np.nan_to_num(residuals), jacobians, slip, counts, levers, known)


def log_jacobian(geometry: Geometry) -> Floats:
    """(3, 3): both diameters and the track by the logarithms of mean, ratio and track."""
    right, left, ratio = geometry.right, geometry.left, geometry.ratio
    return np.array(
        [
            [right, right / (ratio + 1), 0.0],
            [left, -left * ratio / (ratio + 1), 0.0],
            [0.0, 0.0, geometry.track],
        ]
    )
